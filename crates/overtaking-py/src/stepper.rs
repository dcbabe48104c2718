//! Binding of `overtaking_core::run::stepped_batch`: a batch that waits for an external driver between calls.

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use numpy::{PyUntypedArrayMethods, ToPyArray};
use overtaking_core::ego_action::{ActionKind, MAX_ACTION_PARTS};
use overtaking_core::observation_table::{OBSERVATION_SIZE, ObservationSource};
use overtaking_core::require_level;
use overtaking_core::run::stepped_batch::{EgoObservations, SteppedBatch};
use overtaking_portable::stepped_batch_at;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::batch_inputs::PyInputs;
use crate::inputs::expect_length;
use crate::spread::{run_in_pool, run_without_memory_check};

/// Upper bound of the memory of a simulation that waits between calls [bytes]: 512 numbers of 4 bytes for the
/// parameters, state and history of each of 32 vehicles.
const STEPPED_BYTES: usize = 64 << 10;

/// A batch that waits at every decision for the actions of an external driver.
///
/// Calls change the batch, so Python raises `RuntimeError` if two threads call it at the same time.
#[pyclass]
pub struct Stepper {
    batch: Box<dyn SteppedBatch>,
    num_simulations: usize,
    num_slots: usize,
    /// Observations before the first decision.
    start: EgoObservations,
}

/// Observations of the egos, (simulation, field); whether each simulation runs; number of decisions of the call that
/// each simulation has carried out.
type ObservationArrays<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<u32>>,
);

#[pymethods]
impl Stepper {
    /// Begin all simulations of a batch, which wait before their first decision.
    ///
    /// Args:
    ///     inputs: Inputs of the batch, with at least one simulation.
    ///     action_kind: Kind of the actions; None if the simulator's own driver drives the ego and
    ///         `step` ignores the actions.
    ///     observes_truth: Whether the driver observes the true state, and not its beliefs about
    ///         it, which are late and have errors.
    ///     level: SIMD level; None for the best of this CPU.
    ///
    /// Raises:
    ///     ValueError: There is no simulation, or the kind or SIMD level is unknown.
    #[new]
    #[pyo3(signature = (
        inputs: "Inputs",
        action_kind: "str | None",
        observes_truth: "bool",
        level: "str | None" = None,
    ))]
    fn new(
        inputs: &Bound<'_, PyInputs>,
        action_kind: Option<&str>,
        observes_truth: bool,
        level: Option<&str>,
    ) -> PyResult<Self> {
        let (py, inputs) = (inputs.py(), inputs.get());
        let action_kind = action_kind
            .map(|name| {
                ActionKind::from_name(name)
                    .ok_or_else(|| PyValueError::new_err(format!("no action {name}")))
            })
            .transpose()?;
        let source = if observes_truth {
            ObservationSource::Truth
        } else {
            ObservationSource::Beliefs
        };
        let level = require_level(level).map_err(PyValueError::new_err)?;
        let (num_simulations, num_slots) = (inputs.num_simulations, inputs.num_slots);
        if num_simulations == 0 {
            return Err(PyValueError::new_err(
                "scenario_index: expected at least 1 simulation, got 0",
            ));
        }
        let all_rows: Vec<_> = (0..num_simulations).collect();
        let work_bytes = num_simulations.saturating_mul(STEPPED_BYTES);
        inputs.with_slices(py, |inputs| {
            let mut batch = stepped_batch_at(level, &inputs, action_kind, source)
                .map_err(PyValueError::new_err)?;
            let start = run_in_pool(py, work_bytes, || {
                batch.begin_simulations(&inputs, &all_rows)
            })?;
            Ok(Self {
                batch,
                num_simulations,
                num_slots,
                start,
            })
        })
    }

    /// Observations at the start, in the format of `step`, with 0 decisions carried out.
    #[pyo3(signature = () -> "tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]")]
    fn observe_start<'py>(&self, py: Python<'py>) -> PyResult<ObservationArrays<'py>> {
        to_arrays(py, self.start.clone())
    }

    /// Carry out one action of each simulation for some decisions.
    ///
    /// Args:
    ///     values: Each part of the actions as a multiple of its `ActionPart.resolution`
    ///         (`model.driver_interface`), shape (simulation, part).
    ///     decisions: Number of decisions, at least 1.
    ///
    /// Returns:
    ///     Observations after the decisions, or at the end of a simulation that ended earlier,
    ///     (simulation, field); whether each simulation runs; the number of decisions that each
    ///     has carried out.
    ///
    /// Raises:
    ///     ValueError: The actions have another length.
    #[pyo3(signature = (
        values: "NDArray[np.int32]",
        decisions: "int",
    ) -> "tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]")]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        values: PyReadonlyArray2<'py, i32>,
        decisions: u32,
    ) -> PyResult<ObservationArrays<'py>> {
        expect_length(
            "values",
            values.len(),
            self.num_simulations * MAX_ACTION_PARTS,
        )?;
        let actions = values.as_slice()?;
        let batch = &mut self.batch;
        // `begin_simulations` has allocated the memory of the batch.
        let observations = run_without_memory_check(py, || batch.advance(actions, decisions))?;
        to_arrays(py, observations)
    }

    /// Begin new simulations in rows of the batch, and observe their start.
    ///
    /// Args:
    ///     rows: The rows, each once.
    ///     inputs: Inputs of the new simulations, one for each row, with the slots of the batch.
    ///         Their seed, road and constants are ignored: the batch keeps its own.
    ///
    /// Raises:
    ///     ValueError: A row occurs twice or does not exist, or `inputs` has another number of
    ///         simulations or slots.
    #[pyo3(signature = (
        rows: "NDArray[np.int64]",
        inputs: "Inputs",
    ) -> "tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]")]
    fn restart<'py>(
        &mut self,
        py: Python<'py>,
        rows: PyReadonlyArray1<'py, i64>,
        inputs: &Bound<'py, PyInputs>,
    ) -> PyResult<ObservationArrays<'py>> {
        let inputs = inputs.get();
        let rows: Vec<_> = rows.as_slice()?.iter().map(|row| *row as usize).collect();
        expect_length("rows", rows.len(), inputs.num_simulations)?;
        let mut sorted = rows.clone();
        sorted.sort_unstable();
        sorted.dedup();
        let last_row = sorted.last().copied().unwrap_or(0);
        if sorted.len() < rows.len() || last_row >= self.num_simulations {
            return Err(PyValueError::new_err("rows: expected each row once"));
        }
        if inputs.num_slots != self.num_slots {
            return Err(PyValueError::new_err(format!(
                "num_slots: expected {}, got {}",
                self.num_slots, inputs.num_slots
            )));
        }
        let work_bytes = rows.len().saturating_mul(STEPPED_BYTES);
        let batch = &mut self.batch;
        let observations = inputs.with_slices(py, |inputs| {
            run_in_pool(py, work_bytes, || batch.begin_simulations(&inputs, &rows))
        })?;
        to_arrays(py, observations)
    }
}

/// The observations as arrays of Python.
fn to_arrays(py: Python<'_>, observations: EgoObservations) -> PyResult<ObservationArrays<'_>> {
    let shape = (observations.is_running.len(), OBSERVATION_SIZE);
    let table = Array2::from_shape_vec(shape, observations.table)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok((
        table.into_pyarray(py),
        observations.is_running.to_pyarray(py),
        observations.num_decisions.into_pyarray(py),
    ))
}
