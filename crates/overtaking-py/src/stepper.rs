//! Binding of `overtaking_core::stepper`: a batch that waits for another driver between calls.

use std::mem::forget;
use std::process::id;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use numpy::{PyUntypedArrayMethods, ToPyArray};
use overtaking_core::ego_action::{ActionKind, MAX_ACTION_PARTS};
use overtaking_core::observation_table::{OBSERVATION_SIZE, ObservationSource};
use overtaking_core::pool::process_pool;
use overtaking_core::run::stepped_batch::{Fresh, Observed, Request, Talk};
use overtaking_core::{
    Inputs, MAX_VEHICLES, ModelConstants, Road, SIMULATION_NAMES, VEHICLE_NAMES, require_level,
};
use overtaking_portable::serve_at;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::inputs::{Numbers, RoadValues, expect_length};
use crate::spread::{expect_room, no_threads};

/// Memory for a simulation of a batch that waits between calls, at most: with 32 vehicles, their parameters and
/// states of 4 bytes each, and their histories [bytes].
const STEPPED_BYTES: usize = 64 << 10;

/// What a batch is simulated from.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Batch<'py> {
    vehicle: PyReadonlyArray1<'py, f32>,
    simulation: PyReadonlyArray1<'py, f32>,
    scenario_index: PyReadonlyArray1<'py, u64>,
    num_slots: usize,
    seed: u64,
    steps_per_frame: u32,
    road: RoadValues,
    constants: Numbers,
}

/// The same, kept by the thread that simulates it.
struct Kept {
    vehicle: Vec<f32>,
    simulation: Vec<f32>,
    scenario_index: Vec<u64>,
    num_slots: usize,
    seed: u64,
    steps_per_frame: u32,
    road: Arc<Road>,
    constants: Arc<ModelConstants>,
}

impl Batch<'_> {
    fn kept(self) -> PyResult<Kept> {
        let (slots, batch) = (self.num_slots, self.scenario_index.len());
        if slots == 0 || slots > MAX_VEHICLES || self.steps_per_frame == 0 || batch == 0 {
            return Err(PyValueError::new_err(format!(
                "num_slots: expected 1 to {MAX_VEHICLES}, got {slots}"
            )));
        }
        let (vehicle, simulation) = (self.vehicle.as_slice()?, self.simulation.as_slice()?);
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
        Ok(Kept {
            vehicle: vehicle.to_vec(),
            simulation: simulation.to_vec(),
            scenario_index: self.scenario_index.as_slice()?.to_vec(),
            num_slots: slots,
            seed: self.seed,
            steps_per_frame: self.steps_per_frame,
            constants: Arc::new(self.constants.constants()?),
            road: Arc::new(self.road.road()),
        })
    }
}

impl Kept {
    fn inputs(&self) -> Inputs<'_> {
        Inputs {
            vehicle: &self.vehicle,
            simulation: &self.simulation,
            scenario_index: &self.scenario_index,
            num_slots: self.num_slots,
            constants: Arc::clone(&self.constants),
            road: Arc::clone(&self.road),
            seed: self.seed,
            steps_per_frame: self.steps_per_frame,
            action_log: None,
        }
    }
}

/// A batch that waits at every decision for the actions of an external driver.
#[pyclass(frozen)]
pub struct Stepper {
    batch: usize,
    slots: usize,
    /// Id of the process in which the thread of the line runs.
    process: u32,
    line: Mutex<Option<Line>>,
}

/// The line to the thread that simulates it.
struct Line {
    requests: Sender<Request>,
    answers: Receiver<Observed>,
    thread: JoinHandle<()>,
}

/// Observations of the egos, (simulation, field), which simulations run, and how many decisions of the
/// request each simulation has carried out.
type ObservedArrays<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<u32>>,
);

#[pymethods]
impl Stepper {
    /// Begin before the first decision.
    ///
    /// Args:
    ///     batch: vehicle, simulation, scenario_index, num_slots, seed, steps_per_frame, road and
    ///         constants as in `simulate`.
    ///     action_kind: Kind of the actions; None if the model's driver decides.
    ///     observes_truth: Whether the driver observes the true state, and not its beliefs.
    ///     level: SIMD level; None for the best of this CPU.
    ///
    /// Raises:
    ///     ValueError: An array has another length, or the kind or SIMD level is unknown.
    #[new]
    #[pyo3(signature = (
        batch: "Mapping[str, Any]",
        action_kind: "str | None",
        observes_truth: "bool",
        level: "str | None" = None,
    ))]
    fn new(
        batch: Batch<'_>,
        action_kind: Option<&str>,
        observes_truth: bool,
        level: Option<&str>,
    ) -> PyResult<Self> {
        let known = |name| {
            ActionKind::from_name(name)
                .ok_or_else(|| PyValueError::new_err(format!("no action {name}")))
        };
        let kind = action_kind.map(known).transpose()?;
        let level = require_level(level).map_err(PyValueError::new_err)?;
        let count = batch.scenario_index.len();
        // The parameters are copied, and each simulation has states, a history and a row of each answer.
        expect_room(count.saturating_mul(STEPPED_BYTES))?;
        let kept = batch.kept()?;
        let slots = kept.num_slots;
        let (requests, theirs) = channel();
        let (given, answers) = channel();
        let talk = Talk {
            kind,
            source: if observes_truth {
                ObservationSource::Truth
            } else {
                ObservationSource::Beliefs
            },
            requests: theirs,
            answers: given,
            pool: process_pool().map_err(no_threads)?,
        };
        let serve = move || {
            // Slots were checked before: then there is nothing else to refuse.
            let served = serve_at(level, &kept.inputs(), &talk);
            debug_assert!(served.is_ok());
        };
        let thread = Builder::new()
            .spawn(serve)
            .map_err(|error| no_threads(error.to_string()))?;
        Ok(Self {
            batch: count,
            slots,
            process: id(),
            line: Mutex::new(Some(Line {
                requests,
                answers,
                thread,
            })),
        })
    }

    /// Observations at the start, (simulation, field); which simulations run; zeros.
    #[pyo3(signature = () -> "tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]")]
    fn observe_start<'py>(&self, py: Python<'py>) -> PyResult<ObservedArrays<'py>> {
        self.ask(py, self.batch, None)
    }

    /// Carry out one action of each simulation for some decisions.
    ///
    /// Args:
    ///     values: Numbers of the actions, shape (simulation, part).
    ///     decisions: Number of decisions, at least 1.
    ///
    /// Returns:
    ///     Observations, for a simulation that ended within the step those at its end; which
    ///     simulations run; the number of decisions that each carried out.
    ///
    /// Raises:
    ///     ValueError: The actions have another length.
    #[pyo3(signature = (
        values: "NDArray[np.int32]",
        decisions: "int",
    ) -> "tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]")]
    fn step<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray2<'py, i32>,
        decisions: u32,
    ) -> PyResult<ObservedArrays<'py>> {
        expect_length("values", values.len(), self.batch * MAX_ACTION_PARTS)?;
        let values = values.as_slice()?.to_vec();
        self.ask(py, self.batch, Some(Request::Go { values, decisions }))
    }

    /// Begin new simulations in rows of the batch, and observe their start.
    ///
    /// Args:
    ///     rows: The rows, each once.
    ///     batch: The new simulations, one for each row, with as many slots as the others. Their
    ///         seed, road and constants are those of the others.
    ///
    /// Raises:
    ///     ValueError: A row occurs twice or does not exist, or an array has another length.
    #[pyo3(signature = (
        rows: "NDArray[np.int64]",
        batch: "Mapping[str, Any]",
    ) -> "tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]")]
    fn restart<'py>(
        &self,
        py: Python<'py>,
        rows: PyReadonlyArray1<'py, i64>,
        batch: Batch<'py>,
    ) -> PyResult<ObservedArrays<'py>> {
        let rows: Vec<_> = rows.as_slice()?.iter().map(|row| *row as usize).collect();
        let kept = batch.kept()?;
        expect_length("rows", rows.len(), kept.scenario_index.len())?;
        let mut sorted = rows.clone();
        sorted.sort_unstable();
        sorted.dedup();
        if sorted.len() < rows.len() || sorted.last().is_some_and(|last| *last >= self.batch) {
            return Err(PyValueError::new_err("rows: expected each row once"));
        }
        expect_length("num_slots", kept.num_slots, self.slots)?;
        let count = rows.len();
        let fresh = Fresh {
            vehicle: kept.vehicle,
            simulation: kept.simulation,
            index: kept.scenario_index,
        };
        self.ask(py, count, Some(Request::Renew { rows, fresh }))
    }
}

impl Stepper {
    fn ask<'py>(
        &self,
        py: Python<'py>,
        rows: usize,
        request: Option<Request>,
    ) -> PyResult<ObservedArrays<'py>> {
        if self.process != id() {
            return Err(PyRuntimeError::new_err(
                "simulations that are driven: expected calls from the process that began them, got one \
                 from a forked child, which has no copy of their threads; begin them in the child, or start \
                 it with the method 'spawn'",
            ));
        }
        let answer = py.detach(|| {
            let line = self.line.lock().ok()?;
            let line = line.as_ref()?;
            if let Some(request) = request {
                line.requests.send(request).ok()?;
            }
            line.answers.recv().ok()
        });
        let answer = answer.ok_or_else(|| PyValueError::new_err("the simulation has ended"))?;
        let table = Array2::from_shape_vec((rows, OBSERVATION_SIZE), answer.table)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok((
            table.into_pyarray(py),
            answer.runs.to_pyarray(py),
            answer.num_decisions.into_pyarray(py),
        ))
    }
}

impl Drop for Stepper {
    /// Hang up, and wait until the memory is free.
    fn drop(&mut self) {
        let line = self.line.get_mut().ok().and_then(Option::take);
        if self.process != id() {
            // The thread does not exist in a forked child: `join` would wait forever, and locks of the channels may
            // be held.
            forget(line);
            return;
        }
        if let Some(Line {
            requests,
            answers,
            thread,
        }) = line
        {
            drop((requests, answers));
            // A panic of the thread has been told already.
            let _ = thread.join();
        }
    }
}
