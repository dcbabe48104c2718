//! Thin Python binding of `overtaking-core`, arrays in, arrays filled in place, and of tiny-skia,
//! which draws films.

mod arrays;
mod canvas;
mod drawing;
mod draws;
mod driven;
mod hash;
mod labels;
mod recorded;
mod spread;
mod stepper;

use numpy::{PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use overtaking_core::ego_action::{ActionKind, ActionLog, MAX_ACTION_PARTS};
use overtaking_core::pool::process_pool;
use overtaking_core::{
    Inputs, MAX_PERCEPTS, MAX_STATIONS, MAX_VEHICLES, ModelConstants, Output, ParameterSwitch,
    RoadDirections, SIMULATION_NAMES, VEHICLE_NAMES, require_level, with_outputs,
};
use overtaking_portable::{is_compiled, simulate_at};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{expect_length, output};
use crate::spread::{SIMULATION_BYTES, no_threads, spread};

/// The road of a batch, lateral axis towards the fast side.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Road {
    num_lanes: usize,
    boundaries: [f32; 9],
    film_path: [f32; 8],
    overtaking_sign: f32,
    pose: [f32; 5],
    num_own_lanes: usize,
    has_oncoming_traffic: bool,
    length: f32,
    edge_sum: f32,
    sight: [[[f32; MAX_STATIONS]; 3]; 2],
    solid_line: [[f32; MAX_STATIONS]; 3],
    course_table: Vec<f32>,
}

impl Road {
    fn ways(&self) -> RoadDirections {
        RoadDirections {
            num_own_lanes: self.num_own_lanes.clamp(1, 8),
            has_oncoming_traffic: self.has_oncoming_traffic,
            length: self.length,
            edge_sum: self.edge_sum,
            sight: self.sight,
            solid_line: self.solid_line,
        }
    }
}

/// The constants of the model.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Numbers {
    values: Vec<f32>,
    friction_new: [[f32; 4]; 3],
    friction_worn: [[f32; 4]; 3],
    friction_speeds: [f32; 3],
    friction_films: [f32; 4],
}

impl Numbers {
    fn constants(&self) -> PyResult<ModelConstants> {
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

/// Borrow every output array, call `$body` with an `Output` over them.
macro_rules! filled {
    (
        {
            { $arrays:expr, $batch:expr, $slots:expr, $frames:expr, $body:expr }
            { $($(#[$doc:meta])* $field:ident: $kind:ty, $size:expr;)* }
        }
        $($(#[$meaning:meta])* $state:ident: $number:ty,)*
    ) => {{
        let sizes: std::collections::HashMap<_, _> = Output::sizes($batch, $slots, $frames).into_iter().collect();
        $(let mut $field = output::<$kind>($arrays, stringify!($field), sizes[stringify!($field)])?;)*
        $(let mut $state = output::<$number>($arrays, stringify!($state), sizes[stringify!($state)])?;)*
        let out = Output {
            $($field: $field.as_slice_mut()?,)*
            $($state: $state.as_slice_mut()?,)*
            frames: $frames,
            slots: $slots,
        };
        $body(out)
    }};
}

/// Parameters of vehicles and simulations, simulation numbers, errors of the egos, and the step from which
/// they hold.
type Turn<'a> = (
    PyReadonlyArray1<'a, f32>,
    PyReadonlyArray1<'a, f32>,
    PyReadonlyArray1<'a, u64>,
    Option<PyReadonlyArray1<'a, f32>>,
    u32,
);

/// Simulate a batch and fill the arrays of `outputs`, a dictionary by field.
#[pyfunction]
#[pyo3(signature = (*, vehicle, simulation, index, slots, frames, seed, steps_per_frame, road, constants, outputs, later=Vec::new(), actions=None, level=None))]
#[allow(clippy::too_many_arguments)]
fn simulate(
    py: Python<'_>,
    vehicle: PyReadonlyArray1<'_, f32>,
    simulation: PyReadonlyArray1<'_, f32>,
    index: PyReadonlyArray1<'_, u64>,
    slots: usize,
    frames: usize,
    seed: u64,
    steps_per_frame: u32,
    road: Road,
    constants: Numbers,
    outputs: &Bound<'_, PyDict>,
    later: Vec<Turn<'_>>,
    actions: Option<(String, PyReadonlyArray3<'_, i32>)>,
    level: Option<&str>,
) -> PyResult<()> {
    let (vehicle, simulation, index) = (
        vehicle.as_slice()?,
        simulation.as_slice()?,
        index.as_slice()?,
    );
    let batch = index.len();
    if slots == 0 || slots > MAX_VEHICLES || steps_per_frame == 0 {
        return Err(PyValueError::new_err(format!(
            "slots: expected 1 to {MAX_VEHICLES}, got {slots}"
        )));
    }
    expect_length(
        "vehicle",
        vehicle.len(),
        VEHICLE_NAMES.len() * slots * batch,
    )?;
    expect_length(
        "simulation",
        simulation.len(),
        SIMULATION_NAMES.len() * batch,
    )?;
    let constants = constants.constants()?;
    let later: Vec<_> = later
        .iter()
        .map(|(vehicle, simulation, index, errors, switch)| {
            Ok(ParameterSwitch {
                vehicle: vehicle.as_slice()?,
                simulation: simulation.as_slice()?,
                scenario_index: index.as_slice()?,
                judgement_errors: errors.as_ref().map(|one| one.as_slice()).transpose()?,
                step: *switch,
            })
        })
        .collect::<PyResult<_>>()?;
    for later in &later {
        expect_length("later vehicle", later.vehicle.len(), vehicle.len())?;
        expect_length("later simulation", later.simulation.len(), simulation.len())?;
        expect_length("later index", later.scenario_index.len(), index.len())?;
        let errors = later.judgement_errors.map_or(2 * batch, <[f32]>::len);
        expect_length("later errors", errors, 2 * batch)?;
    }
    let script = actions.as_ref().map(|actions| script(actions, batch));
    let inputs = Inputs {
        vehicle,
        simulation,
        scenario_index: index,
        num_slots: slots,
        constants: &constants,
        num_lanes: road.num_lanes.clamp(1, 8),
        boundaries: road.boundaries,
        film_path: road.film_path,
        overtaking_sign: road.overtaking_sign,
        pose: road.pose,
        directions: road.ways(),
        course_table: &road.course_table,
        seed,
        steps_per_frame,
        action_log: script.transpose()?,
    };
    let level = require_level(level).map_err(PyValueError::new_err)?;
    let room = batch * SIMULATION_BYTES;
    let run = |out: Output<'_>| spread(py, room, || simulate_at(level, &inputs, &later, out));
    let done = with_outputs! { filled! { outputs, batch, slots, frames, run } };
    done?.map_err(PyValueError::new_err)
}

/// What another driver did, (simulation, decision, part), by the name of what it means.
fn script<'a>(
    (kind, values): &'a (String, PyReadonlyArray3<'_, i32>),
    batch: usize,
) -> PyResult<ActionLog<'a>> {
    let [simulations, decisions, parts] = *values.shape() else {
        unreachable!("an array of three axes has three lengths");
    };
    let kind = ActionKind::from_name(kind)
        .ok_or_else(|| PyValueError::new_err(format!("no action {kind}")))?;
    expect_length("actions", simulations, batch)?;
    expect_length("parts", parts, MAX_ACTION_PARTS)?;
    if decisions == 0 {
        return Err(PyValueError::new_err("actions: expected one decision"));
    }
    Ok(ActionLog {
        kind,
        values: values.as_slice()?,
        decisions,
    })
}

/// Names of the vehicle parameters, in order.
#[pyfunction]
fn vehicle_fields() -> Vec<&'static str> {
    VEHICLE_NAMES.to_vec()
}

/// Names of the simulation parameters, in order.
#[pyfunction]
fn simulation_fields() -> Vec<&'static str> {
    SIMULATION_NAMES.to_vec()
}

/// Names of the constants, in order.
#[pyfunction]
fn constant_fields() -> Vec<&'static str> {
    ModelConstants::NAMES.to_vec()
}

/// Every SIMD level, and whether it is compiled and this CPU can run it.
#[pyfunction]
fn simd_levels() -> Vec<(&'static str, bool)> {
    overtaking_core::simd_levels()
        .into_iter()
        .map(|(name, is_known)| (name, is_known && is_compiled(name)))
        .collect()
}

/// The SIMD level that is used when none is asked for.
#[pyfunction]
fn simd_level() -> &'static str {
    overtaking_core::default_level_name()
}

/// Threads of the pool that simulations are spread over.
#[pyfunction]
fn num_threads() -> PyResult<usize> {
    let pool = process_pool().map_err(no_threads)?;
    Ok(pool.current_num_threads())
}

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("MAX_VEHICLES", MAX_VEHICLES)?;
    module.add("MAX_PERCEPTS", MAX_PERCEPTS)?;
    module.add("LANES", overtaking_core::LANES)?;
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(simulate, module)?)?;
    module.add_function(wrap_pyfunction!(labels::ego_signals_and_events, module)?)?;
    module.add_function(wrap_pyfunction!(labels::event_fields, module)?)?;
    module.add_function(wrap_pyfunction!(labels::neighbour_signals, module)?)?;
    module.add_function(wrap_pyfunction!(labels::target_signals, module)?)?;
    module.add_function(wrap_pyfunction!(labels::frames_alongside, module)?)?;
    module.add_function(wrap_pyfunction!(labels::scan_spans, module)?)?;
    module.add_function(wrap_pyfunction!(labels::span_fields, module)?)?;
    module.add_function(wrap_pyfunction!(labels::limit_margins, module)?)?;
    module.add_function(wrap_pyfunction!(labels::flag_bits, module)?)?;
    module.add_function(wrap_pyfunction!(labels::encounter_measures, module)?)?;
    module.add_function(wrap_pyfunction!(labels::encounter_fields, module)?)?;
    module.add_function(wrap_pyfunction!(driven::weather_driven, module)?)?;
    module.add_function(wrap_pyfunction!(driven::drive, module)?)?;
    module.add_function(wrap_pyfunction!(driven::moving_fields, module)?)?;
    module.add_function(wrap_pyfunction!(draws::words, module)?)?;
    module.add_function(wrap_pyfunction!(draws::exponentials, module)?)?;
    module.add_function(wrap_pyfunction!(draws::logarithms, module)?)?;
    module.add_function(wrap_pyfunction!(draws::uniforms, module)?)?;
    module.add_function(wrap_pyfunction!(draws::larger, module)?)?;
    module.add_function(wrap_pyfunction!(draws::smaller, module)?)?;
    module.add_function(wrap_pyfunction!(draws::normal_pairs, module)?)?;
    module.add_function(wrap_pyfunction!(vehicle_fields, module)?)?;
    module.add_function(wrap_pyfunction!(simulation_fields, module)?)?;
    module.add_function(wrap_pyfunction!(constant_fields, module)?)?;
    module.add_function(wrap_pyfunction!(simd_levels, module)?)?;
    module.add_function(wrap_pyfunction!(simd_level, module)?)?;
    module.add_function(wrap_pyfunction!(num_threads, module)?)?;
    module.add_function(wrap_pyfunction!(stepper::ego_columns, module)?)?;
    module.add_function(wrap_pyfunction!(stepper::neighbour_columns, module)?)?;
    module.add_function(wrap_pyfunction!(stepper::passing_columns, module)?)?;
    module.add_class::<stepper::Stepper>()?;
    module.add_class::<hash::ColumnHash>()?;
    module.add_class::<canvas::Canvas>()?;
    module.add_class::<drawing::Drawing>()?;
    Ok(())
}
