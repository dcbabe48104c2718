//! Binding of `overtaking_core::pedal_driving`: tables of vehicles and bodies, changed in place.

use std::sync::Arc;

use numpy::{
    IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use overtaking_core::pedal_driving::{BODY_FIELDS, PedalControls, TickPart, compute_part_of_tick};
use overtaking_core::{Inputs, MAX_VEHICLES, SIMULATION_NAMES, VEHICLE_NAMES};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::inputs::{Numbers, RoadValues, expect_length};

/// Parameters of the vehicles of one simulation and of the road under them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Driven<'py> {
    vehicle: PyReadonlyArray1<'py, f32>,
    simulation: PyReadonlyArray1<'py, f32>,
    scenario_index: PyReadonlyArray1<'py, u64>,
    num_slots: usize,
    seed: u64,
    road: RoadValues,
    constants: Numbers,
}

impl Driven<'_> {
    fn compute(
        &self,
        part: TickPart<'_>,
        level: Option<&str>,
        mut table: PyReadwriteArray2<'_, f32>,
    ) -> PyResult<()> {
        let inputs = self.inputs()?;
        compute_part_of_tick(&inputs, part, level, table.as_slice_mut()?)
            .map_err(PyValueError::new_err)
    }

    fn inputs(&self) -> PyResult<Inputs<'_>> {
        let (vehicle, simulation) = (self.vehicle.as_slice()?, self.simulation.as_slice()?);
        if self.num_slots == 0 || self.num_slots > MAX_VEHICLES {
            return Err(PyValueError::new_err(format!(
                "num_slots: expected 1 to {MAX_VEHICLES}, got {}",
                self.num_slots
            )));
        }
        expect_length(
            "vehicle",
            vehicle.len(),
            VEHICLE_NAMES.len() * self.num_slots,
        )?;
        expect_length("simulation", simulation.len(), SIMULATION_NAMES.len())?;
        expect_length("scenario_index", self.scenario_index.len(), 1)?;
        Ok(Inputs {
            vehicle,
            simulation,
            scenario_index: self.scenario_index.as_slice()?,
            num_slots: self.num_slots,
            constants: Arc::new(self.constants.constants()?),
            road: Arc::new(self.road.road()),
            seed: self.seed,
            steps_per_frame: 1,
            action_log: None,
        })
    }
}

/// Write gusts, friction and wind of a decision into a table of vehicles.
///
/// Args:
///     driven: vehicle, simulation, scenario_index, num_slots, seed, road and constants as in
///         `simulate`, of one simulation.
///     table: Shape (field, vehicle), fields as `FIELD_NAMES["pedal_table"]`.
///     decision: Number of the decision, 20 a second.
///     level: SIMD level; None for the best of this CPU.
///
/// Raises:
///     ValueError: An array has another length, or the SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (
    driven: "Mapping[str, Any]",
    table: "NDArray[np.float32]",
    decision: "int",
    level: "str | None" = None,
) -> "None")]
pub fn weather_driven(
    driven: Driven<'_>,
    table: PyReadwriteArray2<'_, f32>,
    decision: u32,
    level: Option<&str>,
) -> PyResult<()> {
    driven.compute(TickPart::Weather(decision), level, table)
}

/// Move the vehicles of a table by some steps.
///
/// Args:
///     driven: As in `weather_driven`.
///     table: Shape (field, vehicle), fields as `FIELD_NAMES["pedal_table"]`.
///     controls: Throttle, brake and requested angle of the front wheels [rad], (3, vehicle).
///     wheel_rate: Rate at which the front wheels turn [rad/s].
///     steps: Number of steps of 10 ms.
///     level: SIMD level; None for the best of this CPU.
///
/// Raises:
///     ValueError: An array has another length, or the SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (
    driven: "Mapping[str, Any]",
    table: "NDArray[np.float32]",
    controls: "NDArray[np.float32]",
    wheel_rate: "float",
    steps: "int",
    level: "str | None" = None,
) -> "None")]
pub fn drive(
    driven: Driven<'_>,
    table: PyReadwriteArray2<'_, f32>,
    controls: PyReadonlyArray2<'_, f32>,
    wheel_rate: f32,
    steps: u32,
    level: Option<&str>,
) -> PyResult<()> {
    expect_length("controls", controls.len(), 3 * driven.num_slots)?;
    let mut rows = controls.as_slice()?.chunks_exact(driven.num_slots.max(1));
    let mut row = || rows.next().unwrap_or_default();
    let controls = PedalControls {
        throttle: row(),
        brake: row(),
        wheel_angle: row(),
        wheel_rate,
    };
    driven.compute(TickPart::Motion(controls, steps), level, table)
}

/// Exchange momentum between the bodies of each pair that touched during the last step.
///
/// Args:
///     driven: As in `weather_driven`; its constant `step` is the length of the step.
///     bodies: Shape (field, body), fields as `FIELD_NAMES["bodies"]`. Motion after the step,
///         changed in place.
///     old_positions: `s` and `d` before the step [m], (2, body).
///     pairs: Two bodies each, (pair, 2), in the order of resolution.
///     level: SIMD level; None for the best of this CPU.
///
/// Returns:
///     First other body that each body touched, -1 without a contact.
///
/// Raises:
///     ValueError: An array has another length, a pair names a body that does not exist, or the
///         SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (
    driven: "Mapping[str, Any]",
    bodies: "NDArray[np.float32]",
    old_positions: "NDArray[np.float32]",
    pairs: "NDArray[np.uint32]",
    level: "str | None" = None,
) -> "NDArray[np.int32]")]
pub fn resolve_contacts<'py>(
    py: Python<'py>,
    driven: Driven<'_>,
    mut bodies: PyReadwriteArray2<'_, f32>,
    old_positions: PyReadonlyArray2<'_, f32>,
    pairs: PyReadonlyArray2<'_, u32>,
    level: Option<&str>,
) -> PyResult<Bound<'py, PyArray1<i32>>> {
    expect_length("bodies", bodies.shape()[0], BODY_FIELDS.len())?;
    expect_length("pairs", pairs.len(), 2 * pairs.shape()[0])?;
    let pairs: Vec<_> = pairs
        .as_slice()?
        .chunks_exact(2)
        .map(|pair| [pair[0] as usize, pair[1] as usize])
        .collect();
    let partners = overtaking_core::pedal_driving::resolve_contacts(
        &driven.inputs()?,
        bodies.as_slice_mut()?,
        old_positions.as_slice()?,
        &pairs,
        level,
    )
    .map_err(PyValueError::new_err)?;
    let column = |partner: Option<usize>| partner.map_or(-1, |body| body as i32);
    let columns: Vec<_> = partners.into_iter().map(column).collect();
    Ok(columns.into_pyarray(py))
}
