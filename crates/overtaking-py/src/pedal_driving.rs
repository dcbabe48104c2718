//! Binding of `overtaking_core::driven`: a table of vehicles, changed in place.

use std::sync::Arc;

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2, PyUntypedArrayMethods};
use overtaking_core::pedal_driving::{Deed, PedalControls};
use overtaking_core::{Inputs, MAX_VEHICLES, SIMULATION_NAMES, VEHICLE_NAMES};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::inputs::{Numbers, RoadValues, expect_length};

/// Vehicles of one simulation that somebody else drives, and what they stand on.
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
    fn act(
        &self,
        deed: Deed<'_>,
        level: Option<&str>,
        mut table: PyReadwriteArray2<'_, f32>,
    ) -> PyResult<()> {
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
        let inputs = Inputs {
            vehicle,
            simulation,
            scenario_index: self.scenario_index.as_slice()?,
            num_slots: self.num_slots,
            constants: Arc::new(self.constants.constants()?),
            road: Arc::new(self.road.road()),
            seed: self.seed,
            steps_per_frame: 1,
            action_log: None,
        };
        overtaking_core::pedal_driving::act(&inputs, deed, level, table.as_slice_mut()?)
            .map_err(PyValueError::new_err)
    }
}

/// Write gusts, friction and wind of a decision into a table of vehicles.
///
/// Args:
///     driven: vehicle, simulation, scenario_index, num_slots, seed, road and constants as in
///         `simulate`, of one
///         simulation.
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
    driven.act(Deed::Weather(decision), level, table)
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
    driven.act(Deed::Drive(controls, steps), level, table)
}
