//! Binding of `overtaking_core::pedal_driving`: tables of vehicles and bodies, changed in place. A tick is the time
//! between two decisions, 50 ms; a step lasts 10 ms.

use fearless_simd::Level;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2, PyReadwriteArray2, PyUntypedArrayMethods};
use overtaking_core::pedal_driving::{
    BODY_FIELDS, PedalControls, TickPart, compute_part_of_tick, resolve_contacts,
};
use overtaking_core::require_level;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::batch_inputs::PyInputs;
use crate::inputs::expect_length;

/// Moves vehicles of one simulation by their pedals and wheel angles.
#[pyclass(frozen)]
pub struct PedalDriving {
    inputs: Py<PyInputs>,
    level: Level,
}

#[pymethods]
impl PedalDriving {
    /// Keep the parameters of the vehicles and of the road under them.
    ///
    /// Args:
    ///     inputs: Inputs of one simulation; `steps_per_frame` is ignored.
    ///     level: SIMD level; None for the best of this CPU.
    ///
    /// Raises:
    ///     ValueError: `inputs` has no simulation or several, or the SIMD level is unknown or not
    ///         available.
    #[new]
    #[pyo3(signature = (inputs: "Inputs", level: "str | None" = None))]
    fn new(inputs: Bound<'_, PyInputs>, level: Option<&str>) -> PyResult<Self> {
        // `scenario_index` has one number for each simulation.
        expect_length("scenario_index", inputs.get().num_simulations, 1)?;
        Ok(Self {
            inputs: inputs.unbind(),
            level: require_level(level).map_err(PyValueError::new_err)?,
        })
    }

    /// Write gusts, friction and wind of a decision into a table of vehicles.
    ///
    /// Args:
    ///     table: Shape (field, vehicle), fields as `FIELD_NAMES["pedal_table"]`.
    ///     decision_index: Index of the decision, 20 a second, which the random numbers depend on.
    ///
    /// Raises:
    ///     ValueError: An array has another length.
    #[pyo3(signature = (table: "NDArray[np.float32]", decision_index: "int") -> "None")]
    fn update_weather(
        &self,
        py: Python<'_>,
        table: PyReadwriteArray2<'_, f32>,
        decision_index: u32,
    ) -> PyResult<()> {
        self.compute_part_of_tick(py, TickPart::Weather { decision_index }, table)
    }

    /// Move the vehicles of a table by some steps.
    ///
    /// Args:
    ///     table: Shape (field, vehicle), fields as `FIELD_NAMES["pedal_table"]`.
    ///     controls: Throttle and brake, 0 to 1, and requested angle of the front wheels [rad],
    ///         (3, vehicle).
    ///     wheel_rate: Rate at which the front wheels turn [rad/s].
    ///     num_steps: Number of steps, each as long as the constant `step`.
    ///
    /// Raises:
    ///     ValueError: An array has another length.
    #[pyo3(signature = (
        table: "NDArray[np.float32]",
        controls: "NDArray[np.float32]",
        wheel_rate: "float",
        num_steps: "int",
    ) -> "None")]
    fn drive(
        &self,
        py: Python<'_>,
        table: PyReadwriteArray2<'_, f32>,
        controls: PyReadonlyArray2<'_, f32>,
        wheel_rate: f32,
        num_steps: u32,
    ) -> PyResult<()> {
        let num_slots = self.inputs.get().num_slots;
        expect_length("controls", controls.len(), 3 * num_slots)?;
        let mut rows = controls.as_slice()?.chunks_exact(num_slots);
        let mut row = || rows.next().unwrap_or_default();
        let controls = PedalControls {
            throttle: row(),
            brake: row(),
            wheel_angle: row(),
            wheel_rate,
        };
        let motion = TickPart::Motion {
            controls,
            num_steps,
        };
        self.compute_part_of_tick(py, motion, table)
    }

    /// Exchange momentum between the bodies of each pair that touched during the last step.
    ///
    /// Args:
    ///     bodies: Shape (field, body), fields as `FIELD_NAMES["bodies"]`. Motion after the step,
    ///         which lasts the constant `step`; changed in place.
    ///     old_positions: `s` and `d` before the step [m], (2, body).
    ///     pairs: Two bodies each, (pair, 2), in the order of resolution.
    ///
    /// Returns:
    ///     First other body that each body touched, -1 without a contact.
    ///
    /// Raises:
    ///     ValueError: An array has another length, or a pair names a body that does not exist.
    #[pyo3(signature = (
        bodies: "NDArray[np.float32]",
        old_positions: "NDArray[np.float32]",
        pairs: "NDArray[np.uint32]",
    ) -> "NDArray[np.int32]")]
    fn resolve_contacts<'py>(
        &self,
        py: Python<'py>,
        mut bodies: PyReadwriteArray2<'_, f32>,
        old_positions: PyReadonlyArray2<'_, f32>,
        pairs: PyReadonlyArray2<'_, u32>,
    ) -> PyResult<Bound<'py, PyArray1<i32>>> {
        expect_length("bodies", bodies.shape()[0], BODY_FIELDS.len())?;
        expect_length("pairs", pairs.len(), 2 * pairs.shape()[0])?;
        let pairs: Vec<_> = pairs
            .as_slice()?
            .chunks_exact(2)
            .map(|pair| [pair[0] as usize, pair[1] as usize])
            .collect();
        let (bodies, old_positions) = (bodies.as_slice_mut()?, old_positions.as_slice()?);
        let partners = self.inputs.get().with_slices(py, |inputs| {
            resolve_contacts(self.level, &inputs, bodies, old_positions, &pairs)
                .map_err(PyValueError::new_err)
        })?;
        let partners: Vec<_> = partners
            .into_iter()
            .map(|partner| partner.map_or(-1, |body| body as i32))
            .collect();
        Ok(partners.into_pyarray(py))
    }
}

impl PedalDriving {
    /// Compute the weather or the motion of a tick in a table.
    fn compute_part_of_tick(
        &self,
        py: Python<'_>,
        part: TickPart<'_>,
        mut table: PyReadwriteArray2<'_, f32>,
    ) -> PyResult<()> {
        let table = table.as_slice_mut()?;
        self.inputs.get().with_slices(py, |inputs| {
            compute_part_of_tick(self.level, &inputs, part, table).map_err(PyValueError::new_err)
        })
    }
}
