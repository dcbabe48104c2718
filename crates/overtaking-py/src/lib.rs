//! Python binding of `overtaking-core`, of `overtaking-labels`, and of tiny-skia, which draws the frames of videos.
//!
//! Arrays of Python are read and filled in place.

mod batch_inputs;
mod bulk_math;
mod column_hash;
mod external_motion;
mod film_canvas;
mod inputs;
mod labels;
mod pedal_driving;
mod spread;
mod stepper;

use numpy::{PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use overtaking_core::ego_action::{ActionKind, ActionLog, MAX_ACTION_PARTS};
use overtaking_core::pool::process_pool;
use overtaking_core::{
    Inputs, ModelConstants, Output, ParameterSwitch, SIMULATION_NAMES, VEHICLE_NAMES,
    require_level, with_outputs,
};
use overtaking_portable::{is_compiled, simulate_at};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::batch_inputs::PyInputs;
use crate::inputs::{borrow_output, expect_length};
use crate::spread::{SIMULATION_BYTES, no_threads, run_in_pool};

/// Borrow every output array, and call `$body` with an `Output` over them.
///
/// `with_outputs!` calls this macro: it passes on the first group, and adds the second group (output arrays) and the
/// recorded states of vehicles, which follow the groups.
macro_rules! borrow_outputs {
    (
        {
            { $arrays:expr, $batch:expr, $slots:expr, $frames:expr, $body:expr }
            { $($(#[$doc:meta])* $field:ident: $kind:ty, $size:expr;)* }
        }
        $($(#[$meaning:meta])* $state:ident: $number:ty,)*
    ) => {{
        let sizes: std::collections::HashMap<_, _> = Output::sizes($batch, $slots, $frames).into_iter().collect();
        $(let mut $field = borrow_output::<$kind>($arrays, stringify!($field), sizes[stringify!($field)])?;)*
        $(let mut $state = borrow_output::<$number>($arrays, stringify!($state), sizes[stringify!($state)])?;)*
        let out = Output {
            $($field: $field.as_slice_mut()?,)*
            $($state: $state.as_slice_mut()?,)*
            frames: $frames,
            slots: $slots,
        };
        Ok($body(out))
    }};
}

/// Call `run` with the output arrays of a batch. The second argument has its numbers of simulations, slots and frames.
///
/// # Errors
/// `KeyError`: An array is missing. `ValueError`: An array has another length or is not contiguous.
pub(crate) fn with_borrowed_outputs<R>(
    outputs: &Bound<'_, PyDict>,
    (batch, num_slots, frames): (usize, usize, usize),
    run: impl FnOnce(Output<'_>) -> R,
) -> PyResult<R> {
    with_outputs! { borrow_outputs! { outputs, batch, num_slots, frames, run } }
}

/// Parameters of vehicles and of simulations, scenario indices, errors of the egos in judging distance and speed, and
/// the step from which all of these hold.
type SwitchArrays<'a> = (
    PyReadonlyArray1<'a, f32>,
    PyReadonlyArray1<'a, f32>,
    PyReadonlyArray1<'a, u64>,
    Option<PyReadonlyArray1<'a, f32>>,
    u32,
);

/// Simulate a batch and fill the flat arrays of `outputs`.
///
/// Args:
///     inputs: Inputs of the batch.
///     frames: Frames that the outputs have room for, a multiple of `SIMD_LANES`: the recorder
///         writes `SIMD_LANES` frames at once.
///     outputs: Flat arrays by name.
///     switches: For each step at which parameters change: vehicle and simulation parameters,
///         indices of the scenarios, errors of the egos in judging distance and speed
///         (2, simulation) or None, and the step.
///     action_log: Kind and numbers of the actions of an external driver of the ego, (simulation,
///         decision, part).
///     level: SIMD level; None for the best of this CPU.
///
/// Raises:
///     ValueError: An array has another length, or the SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (
    inputs: "Inputs",
    *,
    frames: "int",
    outputs: "dict[str, NDArray[Any]]",
    switches: "Sequence[tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]], NDArray[np.uint64], NDArray[np.floating[Any]] | None, int]]" = Vec::new(),
    action_log: "tuple[str, NDArray[np.int32]] | None" = None,
    level: "str | None" = None,
) -> "None")]
fn simulate(
    inputs: &Bound<'_, PyInputs>,
    frames: usize,
    outputs: &Bound<'_, PyDict>,
    switches: Vec<SwitchArrays<'_>>,
    action_log: Option<(String, PyReadonlyArray3<'_, i32>)>,
    level: Option<&str>,
) -> PyResult<()> {
    let (py, inputs) = (inputs.py(), inputs.get());
    let (batch, num_slots) = (inputs.num_simulations, inputs.num_slots);
    let switches: Vec<_> = switches
        .iter()
        .map(|(vehicle, simulation, scenario_index, errors, step)| {
            Ok(ParameterSwitch {
                vehicle: vehicle.as_slice()?,
                simulation: simulation.as_slice()?,
                scenario_index: scenario_index.as_slice()?,
                judgement_errors: errors.as_ref().map(|array| array.as_slice()).transpose()?,
                step: *step,
            })
        })
        .collect::<PyResult<_>>()?;
    for switch in &switches {
        expect_length(
            "switches: vehicle",
            switch.vehicle.len(),
            VEHICLE_NAMES.len() * num_slots * batch,
        )?;
        expect_length(
            "switches: simulation",
            switch.simulation.len(),
            SIMULATION_NAMES.len() * batch,
        )?;
        expect_length(
            "switches: scenario_index",
            switch.scenario_index.len(),
            batch,
        )?;
        if let Some(errors) = switch.judgement_errors {
            expect_length("switches: judgement_errors", errors.len(), 2 * batch)?;
        }
    }
    let action_log = action_log
        .as_ref()
        .map(|actions| read_action_log(actions, batch))
        .transpose()?;
    let level = require_level(level).map_err(PyValueError::new_err)?;
    let work_bytes = batch * SIMULATION_BYTES;
    inputs.with_slices(py, |inputs| {
        let inputs = Inputs {
            action_log,
            ..inputs
        };
        let run = |out: Output<'_>| {
            run_in_pool(py, work_bytes, || {
                simulate_at(level, &inputs, &switches, out)
            })
        };
        // The errors of the output arrays, of the threads, and of the simulation.
        let simulated = with_borrowed_outputs(outputs, (batch, num_slots, frames), run)??;
        simulated.map_err(PyValueError::new_err)
    })
}

/// Actions of an external driver, (simulation, decision, part), and the name of their kind.
fn read_action_log<'a>(
    (kind, values): &'a (String, PyReadonlyArray3<'_, i32>),
    batch: usize,
) -> PyResult<ActionLog<'a>> {
    let [simulations, decisions, parts] = *values.shape() else {
        unreachable!("an array of three axes has three lengths");
    };
    let kind = ActionKind::from_name(kind)
        .ok_or_else(|| PyValueError::new_err(format!("no action {kind}")))?;
    expect_length("action_log", simulations, batch)?;
    expect_length("parts", parts, MAX_ACTION_PARTS)?;
    if decisions == 0 {
        return Err(PyValueError::new_err(
            "action_log: expected at least one decision",
        ));
    }
    Ok(ActionLog {
        kind,
        values: values.as_slice()?,
        decisions,
    })
}

/// Every SIMD level, and whether it is compiled and this CPU can run it.
#[pyfunction]
#[pyo3(signature = () -> "list[tuple[str, bool]]")]
fn simd_levels() -> Vec<(&'static str, bool)> {
    overtaking_core::simd_levels()
        .into_iter()
        .map(|(name, is_supported)| (name, is_supported && is_compiled(name)))
        .collect()
}

/// The SIMD level of calls that name no level.
#[pyfunction]
#[pyo3(signature = () -> "str")]
fn default_simd_level() -> &'static str {
    overtaking_core::default_level_name()
}

/// Number of threads that simulate.
#[pyfunction]
#[pyo3(signature = () -> "int")]
fn num_threads() -> PyResult<usize> {
    let pool = process_pool().map_err(no_threads)?;
    Ok(pool.current_num_threads())
}

/// The compiled engine; its source is `crates/overtaking-py`. Use it through `sim.engine`.
#[pymodule]
mod _core {
    use pyo3::prelude::*;
    use pyo3::types::{PyDict, PyTuple};

    #[pymodule_export]
    use crate::batch_inputs::PyInputs;
    #[pymodule_export]
    use crate::bulk_math::{
        exp_in_place, log_in_place, maximum_in_place, minimum_in_place, normal_pairs_in_place,
        random_words, uniform_numbers,
    };
    #[pymodule_export]
    use crate::column_hash::ColumnHash;
    #[pymodule_export]
    use crate::external_motion::ExternallyMovedSimulation;
    #[pymodule_export]
    use crate::film_canvas::{Canvas, Drawing};
    #[pymodule_export]
    use crate::labels::{
        ego_signals_and_events, encounter_measures, flag_bits, frames_alongside, limit_margins,
        neighbour_signals, scan_spans, target_signals,
    };
    #[pymodule_export]
    use crate::pedal_driving::PedalDriving;
    #[pymodule_export]
    use crate::stepper::Stepper;
    #[pymodule_export]
    use crate::{default_simd_level, num_threads, simd_levels, simulate};

    #[pymodule_export]
    const MAX_VEHICLES: usize = overtaking_core::MAX_VEHICLES;
    #[pymodule_export]
    const MAX_PERCEPTS: usize = overtaking_core::MAX_PERCEPTS;
    #[pymodule_export]
    const SIMD_LANES: usize = overtaking_core::SIMD_LANES;
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_init]
    fn add_field_names(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let field_names = PyDict::new(module.py());
        for (key, names) in crate::field_names() {
            field_names.set_item(key, PyTuple::new(module.py(), names)?)?;
        }
        module.add("FIELD_NAMES", field_names)
    }
}

/// Names of the fields of every table that Python exchanges with the engine, in their order, by table.
fn field_names() -> [(&'static str, Vec<&'static str>); 17] {
    use overtaking_core::observation_table::{
        EGO_COLUMN_NAMES, NEIGHBOUR_COLUMN_NAMES, PASSING_COLUMN_NAMES,
    };
    use overtaking_labels as labels;
    [
        ("vehicle", VEHICLE_NAMES.to_vec()),
        ("simulation", SIMULATION_NAMES.to_vec()),
        ("constants", ModelConstants::NAMES.to_vec()),
        (
            "pedal_table",
            overtaking_core::pedal_driving::TABLE_FIELDS.to_vec(),
        ),
        (
            "bodies",
            overtaking_core::pedal_driving::BODY_FIELDS.to_vec(),
        ),
        (
            "motion",
            overtaking_core::external_motion::MOTION_FIELDS.to_vec(),
        ),
        (
            "driver_output",
            overtaking_core::external_motion::DRIVER_OUTPUT_FIELDS.to_vec(),
        ),
        ("ego", EGO_COLUMN_NAMES.to_vec()),
        ("neighbour", NEIGHBOUR_COLUMN_NAMES.to_vec()),
        ("passing", PASSING_COLUMN_NAMES.to_vec()),
        ("events", labels::EVENT_NAMES.to_vec()),
        ("encounters", labels::ENCOUNTER_NAMES.to_vec()),
        ("spans", labels::SPAN_NAMES.to_vec()),
        ("moments", labels::MOMENT_NAMES.to_vec()),
        ("measures", labels::measure_names()),
        ("frames", labels::FRAME_NAMES.to_vec()),
        ("sums", labels::SUM_NAMES.to_vec()),
    ]
}
