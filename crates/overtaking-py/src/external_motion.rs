//! Binding of `overtaking_core::external_motion`: drivers of the model in vehicles that another simulator moves.

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use overtaking_core::external_motion::{
    DRIVER_OUTPUT_FIELDS, ExternallyMoved, MOTION_FIELDS, VehicleContact,
};
use overtaking_core::{Output, require_level};
use overtaking_portable::externally_moved_at;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::batch_inputs::PyInputs;
use crate::inputs::expect_length;
use crate::with_borrowed_outputs;

/// Drivers of the model in one simulation whose vehicles another simulator moves.
#[pyclass]
pub struct ExternallyMovedSimulation {
    simulation: Box<dyn ExternallyMoved>,
    /// Arrays of the recording, owned by Python.
    outputs: Py<PyDict>,
    /// Number of frames for which `outputs` have memory.
    frames: usize,
    num_slots: usize,
}

/// Requests of the drivers, (field, slot); lamps in the last recorded frame, (slot); the last step of the simulation.
type DriverOutputArrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<u8>>, i64);

#[pymethods]
impl ExternallyMovedSimulation {
    /// Begin before the first decision.
    ///
    /// Args:
    ///     inputs: Inputs of one simulation.
    ///     tick: Time between two decisions [s], in which one call of `steer` turns the wheels.
    ///     frames: Number of frames that fit into the outputs, a multiple of `SIMD_LANES`: the
    ///         recorder writes `SIMD_LANES` frames at once, also for a single simulation.
    ///     outputs: Flat arrays by name, as in `simulate`. Each call writes a part of them.
    ///     level: SIMD level; None for the best of this CPU.
    ///
    /// Raises:
    ///     ValueError: `inputs` has no simulation or several, an array has another length, or the
    ///         SIMD level is unknown or not available.
    #[new]
    #[pyo3(signature = (
        inputs: "Inputs",
        *,
        tick: "float",
        frames: "int",
        outputs: "dict[str, NDArray[Any]]",
        level: "str | None" = None,
    ))]
    fn new(
        inputs: &Bound<'_, PyInputs>,
        tick: f32,
        frames: usize,
        outputs: Bound<'_, PyDict>,
        level: Option<&str>,
    ) -> PyResult<Self> {
        let (py, inputs) = (inputs.py(), inputs.get());
        // `scenario_index` has one number for each simulation.
        expect_length("scenario_index", inputs.num_simulations, 1)?;
        let level = require_level(level).map_err(PyValueError::new_err)?;
        let num_slots = inputs.num_slots;
        let simulation = inputs.with_slices(py, |inputs| {
            with_output(&outputs, num_slots, frames, |out| {
                externally_moved_at(level, &inputs, tick, out)
            })?
            .map_err(PyValueError::new_err)
        })?;
        Ok(Self {
            simulation,
            outputs: outputs.unbind(),
            frames,
            num_slots,
        })
    }

    /// Record the first contact of each vehicle, which becomes a wreck.
    ///
    /// Args:
    ///     contacts: Slot, slot of the other vehicle, time [s], size of the impulse [N s], and
    ///         closing speed [m/s]. A contact is recorded for its first slot only; the other
    ///         vehicle needs an entry of its own.
    ///     step: Step of the contacts; may be negative, before the first decision. A contact of
    ///         the ego ends the simulation soon after this step.
    ///
    /// Raises:
    ///     ValueError: A slot does not exist.
    #[pyo3(signature = (
        contacts: "Sequence[tuple[int, int, float, float, float]]",
        step: "int",
    ) -> "None")]
    fn record_contacts(
        &mut self,
        contacts: Vec<(usize, usize, f32, f32, f32)>,
        step: i32,
    ) -> PyResult<()> {
        let contacts: Vec<_> = contacts
            .into_iter()
            .map(
                |(slot, other_slot, time, impulse, closing_speed)| VehicleContact {
                    slot,
                    other_slot,
                    time,
                    impulse,
                    closing_speed,
                },
            )
            .collect();
        // `other_slot` is not checked: the engine only records it.
        if contacts
            .iter()
            .any(|contact| contact.slot >= self.num_slots)
        {
            return Err(PyValueError::new_err("contacts: no such slot"));
        }
        self.simulation.record_contacts(&contacts, step);
        Ok(())
    }

    /// Let all drivers decide, and record a frame if one is due.
    ///
    /// Args:
    ///     motion: Motion after the last tick, (field, slot), fields as `FIELD_NAMES["motion"]`.
    ///     step: Number of the step; steps last 10 ms.
    ///
    /// Returns:
    ///     Requests of the drivers, (field, slot), fields as `FIELD_NAMES["driver_output"]`; lamps
    ///     in the last recorded frame, (slot,), as bits of `Lights`; the last step of the
    ///     simulation.
    ///
    /// Raises:
    ///     ValueError: The motion has another length.
    #[pyo3(signature = (
        motion: "NDArray[np.float32]",
        step: "int",
    ) -> "tuple[NDArray[np.float32], NDArray[np.uint8], int]")]
    fn decide<'py>(
        &mut self,
        py: Python<'py>,
        motion: PyReadonlyArray2<'py, f32>,
        step: u32,
    ) -> PyResult<DriverOutputArrays<'py>> {
        self.check_motion(&motion)?;
        let (frames, num_slots) = (self.frames, self.num_slots);
        let (outputs, simulation) = (self.outputs.bind(py), &mut self.simulation);
        let motion = motion.as_slice()?;
        let driver_output = with_output(outputs, num_slots, frames, |out| {
            simulation.decide(motion, step, out)
        })?;
        let shape = [DRIVER_OUTPUT_FIELDS.len(), num_slots];
        Ok((
            driver_output.table.into_pyarray(py).reshape(shape)?,
            driver_output.lights.into_pyarray(py),
            // The engine keeps steps as whole float32 numbers.
            driver_output.end_step as i64,
        ))
    }

    /// Turn the front wheels for one tick.
    ///
    /// Args:
    ///     wind_trim: Part of the wheel angle [rad], or of the lateral acceleration of a
    ///         two-wheeler [m/s^2], that compensates crosswind, (slot,).
    ///
    /// Returns:
    ///     Wheel angle [rad], or lateral acceleration of a two-wheeler [m/s^2], (slot,).
    ///
    /// Raises:
    ///     ValueError: The array has another length.
    #[pyo3(signature = (wind_trim: "NDArray[np.float32]") -> "NDArray[np.float32]")]
    fn steer<'py>(
        &mut self,
        py: Python<'py>,
        wind_trim: PyReadonlyArray1<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        expect_length("wind_trim", wind_trim.len(), self.num_slots)?;
        Ok(self
            .simulation
            .steer(wind_trim.as_slice()?)
            .into_pyarray(py))
    }

    /// Record a frame, if one is due, in which the other simulator drives all vehicles.
    ///
    /// Args:
    ///     motion: As in `decide`.
    ///     ego_stage: Code of the ego's `Stage`.
    ///     ego_indicator: 1 towards the overtaking side, -1 towards the kerb side, 0 off.
    ///     step: Number of the step; steps last 10 ms.
    ///
    /// Raises:
    ///     ValueError: The motion has another length.
    #[pyo3(signature = (
        motion: "NDArray[np.float32]",
        ego_stage: "float",
        ego_indicator: "float",
        step: "int",
    ) -> "None")]
    fn record(
        &mut self,
        py: Python<'_>,
        motion: PyReadonlyArray2<'_, f32>,
        ego_stage: f32,
        ego_indicator: f32,
        step: u32,
    ) -> PyResult<()> {
        self.check_motion(&motion)?;
        let (frames, num_slots) = (self.frames, self.num_slots);
        let (outputs, simulation) = (self.outputs.bind(py), &mut self.simulation);
        let motion = motion.as_slice()?;
        with_output(outputs, num_slots, frames, |out| {
            simulation.record(motion, ego_stage, ego_indicator, step, out);
        })
    }

    /// Set the last step of the simulation.
    #[pyo3(signature = (step: "int") -> "None")]
    fn end_at(&mut self, step: u32) {
        self.simulation.end_at(step);
    }

    /// The last step of the simulation.
    #[pyo3(signature = () -> "int")]
    fn end_step(&self) -> i64 {
        self.simulation.end_step() as i64
    }

    /// Whether the ego has collided or left the road.
    #[pyo3(signature = () -> "bool")]
    fn is_ego_wrecked(&self) -> bool {
        self.simulation.is_ego_wrecked()
    }

    /// Write the last frames, the contacts and the hash of the recording to the outputs.
    #[pyo3(signature = () -> "None")]
    fn finish(&mut self, py: Python<'_>) -> PyResult<()> {
        let (frames, num_slots) = (self.frames, self.num_slots);
        let (outputs, simulation) = (self.outputs.bind(py), &mut self.simulation);
        with_output(outputs, num_slots, frames, |out| simulation.finish(out))
    }
}

impl ExternallyMovedSimulation {
    /// Reject motion of another number of fields or slots.
    fn check_motion(&self, motion: &PyReadonlyArray2<'_, f32>) -> PyResult<()> {
        expect_length("motion", motion.len(), MOTION_FIELDS.len() * self.num_slots)
    }
}

/// Call `run` with the outputs of one simulation.
fn with_output<R>(
    outputs: &Bound<'_, PyDict>,
    num_slots: usize,
    frames: usize,
    run: impl FnOnce(Output<'_>) -> R,
) -> PyResult<R> {
    with_borrowed_outputs(outputs, (1, num_slots, frames), run)
}
