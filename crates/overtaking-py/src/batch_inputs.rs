//! The inputs of a batch of simulations, which Python makes once and passes to every entry point of the engine.

use std::sync::Arc;

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use overtaking_core::{
    CourseTable, Inputs, MAX_STATIONS, MAX_VEHICLES, ModelConstants, Road, RoadDirections,
    SIMULATION_NAMES, VEHICLE_NAMES,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::inputs::expect_length;

/// All inputs of a batch. Each call reads the arrays in place.
#[pyclass(frozen, name = "Inputs")]
pub struct PyInputs {
    vehicle: Py<PyArray1<f32>>,
    simulation: Py<PyArray1<f32>>,
    scenario_index: Py<PyArray1<u64>>,
    pub num_simulations: usize,
    pub num_slots: usize,
    seed: u64,
    steps_per_frame: u32,
    road: Arc<Road>,
    constants: Arc<ModelConstants>,
}

#[pymethods]
impl PyInputs {
    /// Check the inputs of a batch.
    ///
    /// Args:
    ///     vehicle: Parameters of vehicles and drivers, flat (field, slot, simulation), fields as
    ///         `FIELD_NAMES["vehicle"]`.
    ///     simulation: Parameters of simulations, flat (field, simulation), fields as
    ///         `FIELD_NAMES["simulation"]`.
    ///     scenario_index: Index of each scenario, shape (simulation,).
    ///     num_slots: Vehicle slots, 1 to `MAX_VEHICLES`.
    ///     seed: Seed of the data set, the key of the random numbers.
    ///     steps_per_frame: Steps of 10 ms between recorded frames, at least 1.
    ///     road: Fields of the road by name, as `sim.engine.road_inputs` returns them.
    ///     constants: Constants of the model by name, as `world.constants.engine_constants` returns
    ///         them.
    ///
    /// Raises:
    ///     TypeError: An array has another type or is not contiguous.
    ///     ValueError: An array has another length, or a number is out of range.
    #[new]
    #[pyo3(signature = (
        *,
        vehicle: "NDArray[np.float32]",
        simulation: "NDArray[np.float32]",
        scenario_index: "NDArray[np.uint64]",
        num_slots: "int",
        seed: "int",
        steps_per_frame: "int",
        road: "Mapping[str, Any]",
        constants: "Mapping[str, Any]",
    ))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        vehicle: PyReadonlyArray1<'_, f32>,
        simulation: PyReadonlyArray1<'_, f32>,
        scenario_index: PyReadonlyArray1<'_, u64>,
        num_slots: usize,
        seed: u64,
        steps_per_frame: u32,
        road: RoadValues,
        constants: ConstantValues,
    ) -> PyResult<Self> {
        let num_simulations = scenario_index.as_slice()?.len();
        if num_slots == 0 || num_slots > MAX_VEHICLES {
            return Err(PyValueError::new_err(format!(
                "num_slots: expected 1 to {MAX_VEHICLES}, got {num_slots}"
            )));
        }
        if steps_per_frame == 0 {
            return Err(PyValueError::new_err(
                "steps_per_frame: expected at least 1, got 0",
            ));
        }
        expect_length(
            "vehicle",
            vehicle.as_slice()?.len(),
            VEHICLE_NAMES.len() * num_slots * num_simulations,
        )?;
        expect_length(
            "simulation",
            simulation.as_slice()?.len(),
            SIMULATION_NAMES.len() * num_simulations,
        )?;
        Ok(Self {
            vehicle: vehicle.as_unbound().clone_ref(vehicle.py()),
            simulation: simulation.as_unbound().clone_ref(simulation.py()),
            scenario_index: scenario_index.as_unbound().clone_ref(scenario_index.py()),
            num_simulations,
            num_slots,
            seed,
            steps_per_frame,
            road: Arc::new(road.road()),
            constants: Arc::new(constants.constants()?),
        })
    }
}

impl PyInputs {
    /// Call `run` with the inputs as slices.
    ///
    /// # Errors
    /// `TypeError`: An array is no longer contiguous. Also the errors of `run`.
    pub fn with_slices<R>(
        &self,
        py: Python<'_>,
        run: impl FnOnce(Inputs<'_>) -> PyResult<R>,
    ) -> PyResult<R> {
        let vehicle = self.vehicle.bind(py).try_readonly()?;
        let simulation = self.simulation.bind(py).try_readonly()?;
        let scenario_index = self.scenario_index.bind(py).try_readonly()?;
        run(Inputs {
            vehicle: vehicle.as_slice()?,
            simulation: simulation.as_slice()?,
            scenario_index: scenario_index.as_slice()?,
            num_slots: self.num_slots,
            constants: Arc::clone(&self.constants),
            road: Arc::clone(&self.road),
            seed: self.seed,
            steps_per_frame: self.steps_per_frame,
            action_log: None,
        })
    }
}

/// The values of a road by name, as `overtaking.sim.engine.road_inputs` makes them. `Road` describes them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct RoadValues {
    num_lanes: usize,
    boundaries: [f32; 9],
    film_path: [f32; 8],
    overtaking_sign: f32,
    /// The fields of `RoadPose`.
    pose: [f32; 5],
    num_own_lanes: usize,
    has_oncoming_traffic: bool,
    length: f32,
    edge_sum: f32,
    /// The fields of `KnotTable`, along the road and against it.
    sight: [[[f32; MAX_STATIONS]; 3]; 2],
    /// The fields of `LineMarks`.
    solid_line: [[f32; MAX_STATIONS]; 3],
    /// The rows of `CourseTable` in turn.
    course_table: Vec<f32>,
}

impl RoadValues {
    /// The road as the engine reads it.
    fn road(&self) -> Road {
        let [sight_along, sight_against] = self.sight;
        Road {
            // `boundaries` and `film_path` hold at most eight lanes.
            num_lanes: self.num_lanes.clamp(1, 8),
            boundaries: self.boundaries,
            film_path: self.film_path,
            overtaking_sign: self.overtaking_sign,
            pose: self.pose.into(),
            directions: RoadDirections {
                num_own_lanes: self.num_own_lanes.clamp(1, 8),
                has_oncoming_traffic: self.has_oncoming_traffic,
                length: self.length,
                edge_sum: self.edge_sum,
                sight_along: sight_along.into(),
                sight_against: sight_against.into(),
                line_marks: self.solid_line.into(),
            },
            course_table: CourseTable::from_rows(&self.course_table),
        }
    }
}

/// The constants of the model by name, as `overtaking.world.constants.engine_constants` makes them. `ModelConstants`
/// describes them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ConstantValues {
    /// In the order of `ModelConstants::NAMES`.
    values: Vec<f32>,
    friction_new: [[f32; 4]; 3],
    friction_worn: [[f32; 4]; 3],
    friction_speeds: [f32; 3],
    friction_films: [f32; 4],
}

impl ConstantValues {
    /// The constants as the engine reads them.
    ///
    /// # Errors
    /// `ValueError`: `values` has another length.
    pub fn constants(&self) -> PyResult<ModelConstants> {
        expect_length("constants", self.values.len(), ModelConstants::NAMES.len())?;
        let mut constants = ModelConstants::default();
        constants.set(&self.values);
        constants.friction_new = self.friction_new;
        constants.friction_worn = self.friction_worn;
        constants.friction_speeds = self.friction_speeds;
        constants.friction_films = self.friction_films;
        Ok(constants)
    }
}
