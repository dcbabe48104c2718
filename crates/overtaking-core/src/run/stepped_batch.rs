//! A batch of simulations that waits at every decision for the orders of an external driver of the egos.
//!
//! The batch lives on the stack of a separate thread, which answers one request after the other through a pair of
//! channels. The *ego* is the vehicle under study of a simulation; drivers decide every 50 ms, `SUBSTEPS` steps of
//! 10 ms. Each simulation has a fixed *row* in the arrays of requests and answers, and new simulations can begin in
//! rows at any request. Simulations that began together are divided into *shares* (`StepGroup`), each advanced by one
//! thread in blocks of sixteen lanes (`block`). Nothing is recorded; outputs exist because a block needs some.

use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Mutex, PoisonError};

use fearless_simd::Simd;
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::decision_context::{DecisionContext, DriverContext};
use crate::ego_action::{ActionKind, ActionLog, MAX_ACTION_PARTS};
use crate::math::vectors::{SIMD_LANES, with_cpu_features};
use crate::observation_table::{OBSERVATION_SIZE, ObservationSource, ObservationTable};
use crate::params::SUBSTEPS;
use crate::recorder::output::{Output, Storage};
use crate::run::block::{Block, merge};
use crate::run::engine::{Inputs, SimulationOutput, divide_into_shares, order_by_similarity};
use crate::run::step::{drive_others, perceive};
use crate::state::{EGO_SLOT, History, new_history};
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Number of decisions between two attempts to merge blocks whose simulations have ended. Chosen.
const MERGE_INTERVAL: u32 = 16;

/// A request of the external driver.
pub enum Request {
    /// Advance all simulations.
    Go {
        /// Actions of the egos as integers, in the units of `ActionKind`, (row, part). Ignored if the model drives.
        values: Vec<i32>,
        /// Number of decisions for which the actions hold, at least one.
        decisions: u32,
    },
    /// Begin new simulations in some rows, in place of the simulations there.
    Renew {
        /// Rows, without repetitions.
        rows: Vec<usize>,
        /// Parameters of the new simulations, in the order of `rows`.
        fresh: Fresh,
    },
}

/// Parameters of new simulations, flat arrays with the shapes of those in `Inputs`.
pub struct Fresh {
    /// Parameters of vehicles, (field, slot, simulation), with as many slots as the batch.
    pub vehicle: Vec<f32>,
    /// Parameters of simulations, (field, simulation).
    pub simulation: Vec<f32>,
    /// Scenario indices.
    pub index: Vec<u64>,
}

/// The answer to a request: observations of the egos of all rows, or of the rows with new simulations.
pub struct Observed {
    /// Observations, (simulation, `OBSERVATION_SIZE`). Zeros if the simulation had ended before the request.
    ///
    /// A simulation that ends during the request is observed at its end, not at the end of the request.
    pub table: Vec<f32>,
    /// Whether each simulation still runs.
    pub runs: Vec<bool>,
    /// Number of decisions that each simulation has carried out in the request.
    pub num_decisions: Vec<u32>,
}

/// The entries of one simulation in an `Observed`.
struct AnswerRow<'o> {
    table: &'o mut [f32],
    runs: &'o mut bool,
    num_decisions: &'o mut u32,
}

/// The connection between a batch and the external driver.
pub struct Talk {
    /// Meaning of the numbers of an action; `None` if the model drives the egos.
    pub kind: Option<ActionKind>,
    /// Source of the observations, such as the beliefs of the driver.
    pub source: ObservationSource,
    /// Channel of requests; the batch ends when the sender is dropped.
    pub requests: Receiver<Request>,
    /// Channel of answers: one at the start, then one after each request.
    pub answers: Sender<Observed>,
    /// Threads that simulate the batch.
    pub pool: &'static ThreadPool,
}

/// Simulate a batch at a SIMD level and answer requests until the external driver closes the channel.
///
/// The function is generic for the reason that `simulate` states.
///
/// # Errors
/// There are more than `MAX_VEHICLES` slots.
pub fn stepped_batch<S: Simd>(simd: S, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    match SLOT_CAPACITIES
        .into_iter()
        .find(|slots| inputs.num_slots <= *slots)
    {
        Some(8) => answer_requests::<S, 8>(simd, inputs, talk),
        Some(16) => answer_requests::<S, 16>(simd, inputs, talk),
        Some(32) => answer_requests::<S, 32>(simd, inputs, talk),
        _ => {
            return Err(format!(
                "{} slots are more than {MAX_VEHICLES}",
                inputs.num_slots
            ));
        }
    }
    Ok(())
}

/// Answer requests with a batch compiled for `N` vehicle slots; an invalid request ends the batch.
fn answer_requests<S: Simd, const N: usize>(simd: S, inputs: &Inputs<'_>, talk: &Talk) {
    let batch = inputs.scenario_index.len();
    let mut storage = Storage::new(batch, inputs.num_slots, SIMD_LANES);
    let mut stepped = SteppedBatch::<S, N> {
        simd,
        inputs,
        action_kind: talk.kind,
        source: talk.source,
        outputs: storage
            .output()
            .into_simulations()
            .into_iter()
            .map(Some)
            .collect(),
        free_histories: Vec::new(),
        shares: Vec::new(),
        places: vec![0; batch],
        owners: vec![0; batch],
        num_shares_begun: 0,
        pool: talk.pool,
        contexts: (0..=talk.pool.current_num_threads())
            .map(|_| Mutex::new(DecisionContext::new(simd)))
            .collect(),
    };
    let all_rows: Vec<_> = (0..batch).collect();
    let mut answer = stepped.begin_simulations(inputs, &all_rows);
    while talk.answers.send(answer).is_ok() {
        answer = match talk.requests.recv() {
            Ok(Request::Go { values, decisions }) if values.len() == batch * MAX_ACTION_PARTS => {
                stepped.advance(&values, decisions)
            }
            Ok(Request::Renew { rows, fresh }) if rows.iter().all(|row| *row < batch) => {
                let inputs = Inputs {
                    vehicle: &fresh.vehicle,
                    simulation: &fresh.simulation,
                    scenario_index: &fresh.index,
                    ..inputs.clone()
                };
                stepped.begin_simulations(&inputs, &rows)
            }
            _ => return,
        };
    }
}

/// All simulations of the batch, in shares of simulations that began at the same request.
struct SteppedBatch<'a, S: Simd, const N: usize> {
    simd: S,
    inputs: &'a Inputs<'a>,
    /// Meaning of the numbers of an action; `None` if the model drives the egos.
    action_kind: Option<ActionKind>,
    source: ObservationSource,
    /// Output memory of each row without a running simulation; `None` while a block uses the memory.
    outputs: Vec<Option<Output<'a>>>,
    /// Histories of blocks that have ended, for the next blocks.
    free_histories: Vec<History<N>>,
    shares: Vec<StepGroup<'a, S, N>>,
    /// Position of each row in `initial_rows` of its share.
    places: Vec<usize>,
    /// Number of the share of each row.
    owners: Vec<usize>,
    /// Number of shares that have begun so far; the next share gets it as its number.
    num_shares_begun: usize,
    pool: &'static ThreadPool,
    /// Working memory for perception, one per thread of the pool and one for a thread outside it.
    contexts: Vec<Mutex<DecisionContext<S, N>>>,
}

impl<'a, S: Simd, const N: usize> SteppedBatch<'a, S, N> {
    /// Advance all simulations by `decisions` decisions with the same actions, and observe their egos.
    fn advance(&mut self, values: &[i32], decisions: u32) -> Observed {
        // A log of one decision: the actions of the request.
        let action_log = self.action_kind.map(|kind| ActionLog {
            kind,
            values,
            decisions: 1,
        });
        let (inputs, num_rows) = (self.inputs, self.places.len());
        let answer = self.observe_shares(0, num_rows, &|row| row, &|share, context, rows| {
            let first_step = share.step;
            for decision in 1..=decisions {
                share.advance_to_decision(inputs, action_log.as_ref(), context, first_step);
                let writes = if decision < decisions {
                    Writes::Ended
                } else {
                    Writes::All
                };
                share.observe(context, rows, first_step, writes);
            }
        });
        self.reclaim_memory();
        answer
    }

    /// Begin simulations in some rows, in place of the simulations there, and observe their egos.
    fn begin_simulations(&mut self, fresh: &Inputs<'_>, rows: &[usize]) -> Observed {
        let mut answer_rows = vec![None; self.places.len()];
        for (answer_row, row) in rows.iter().enumerate() {
            answer_rows[*row] = Some(answer_row);
        }
        for share in &mut self.shares {
            share.release_lanes(|block, lane| answer_rows[block.simulations[lane]].is_some());
        }
        self.reclaim_memory();
        let simulations = order_by_similarity(fresh)
            .into_iter()
            .filter_map(|index| Some((index, self.outputs[rows[index]].take()?)))
            .collect();
        let num_old_shares = self.shares.len();
        // In the pool, because the division depends on its number of threads.
        for simulations in self.pool.install(|| divide_into_shares(simulations)) {
            self.begin_share(fresh, rows, simulations);
        }
        let answer_row = |row: usize| answer_rows[row].unwrap_or(0);
        self.observe_shares(
            num_old_shares,
            rows.len(),
            &answer_row,
            &|share, context, rows| {
                share.observe(context, rows, share.step, Writes::All);
            },
        )
    }

    /// Begin the simulations of a share. `rows` has the row of each simulation of `fresh`.
    fn begin_share(
        &mut self,
        fresh: &Inputs<'_>,
        rows: &[usize],
        simulations: Vec<SimulationOutput<'a>>,
    ) {
        let number = self.num_shares_begun;
        self.num_shares_begun += 1;
        let initial_rows: Vec<_> = simulations.iter().map(|(index, _)| rows[*index]).collect();
        for (place, row) in initial_rows.iter().enumerate() {
            (self.places[*row], self.owners[*row]) = (place, number);
        }
        let mut blocks = Vec::new();
        let mut simulations = simulations.into_iter().peekable();
        while simulations.peek().is_some() {
            let history = self.free_histories.pop().unwrap_or_else(new_history);
            if let Some(mut block) = Block::new(self.simd, fresh, &mut simulations, history) {
                block.simulations = block.simulations.map(|index| rows[index]);
                blocks.push(block);
            }
        }
        self.shares.push(StepGroup {
            blocks,
            ego_contexts: Vec::new(),
            initial_rows,
            number,
            step: 0,
            released: Vec::new(),
            free_histories: Vec::new(),
        });
    }

    /// Let all shares from index `first_share` on do `work` in parallel, and collect the observations that it writes.
    ///
    /// The answer has `length` rows; `answer_row` maps a row of the batch to its row there.
    fn observe_shares(
        &mut self,
        first_share: usize,
        length: usize,
        answer_row: &dyn Fn(usize) -> usize,
        work: &ShareWork<'a, '_, S, N>,
    ) -> Observed {
        let mut answer = Observed {
            table: vec![0.0; length * OBSERVATION_SIZE],
            runs: vec![false; length],
            num_decisions: vec![0; length],
        };
        let table = answer.table.chunks_exact_mut(OBSERVATION_SIZE);
        let mut rows: Vec<_> = table
            .zip(&mut answer.runs)
            .zip(&mut answer.num_decisions)
            .map(|((table, runs), num_decisions)| {
                Some(AnswerRow {
                    table,
                    runs,
                    num_decisions,
                })
            })
            .collect();
        let (owners, source) = (&self.owners, self.source);
        let mut shares_with_rows: Vec<_> = self.shares[first_share..]
            .iter_mut()
            .map(|share| {
                let share_rows: Vec<_> = share
                    .initial_rows
                    .iter()
                    .map(|row| {
                        (owners[*row] == share.number).then(|| rows[answer_row(*row)].take())
                    })
                    .map(Option::flatten)
                    .collect();
                (share, share_rows)
            })
            .collect();
        let (places, contexts) = (&self.places, &self.contexts);
        self.pool.install(|| {
            shares_with_rows.par_iter_mut().for_each(|(share, rows)| {
                let thread = rayon::current_thread_index().map_or(0, |thread| thread + 1);
                // Each thread has its own context, so the lock never waits.
                let mut context = contexts[thread]
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner);
                let mut rows = ShareRows {
                    source,
                    places,
                    rows,
                };
                work(share, &mut context, &mut rows);
            });
        });
        drop(shares_with_rows);
        answer
    }

    /// Take back the outputs and histories of simulations that have ended, and drop empty shares.
    fn reclaim_memory(&mut self) {
        for share in &mut self.shares {
            for (row, out) in share.released.drain(..) {
                self.outputs[row] = Some(out);
            }
            self.free_histories.append(&mut share.free_histories);
        }
        self.shares.retain(|share| !share.blocks.is_empty());
    }
}

/// The rows of the answer in which a share writes the observations of its egos.
struct ShareRows<'r, 'o> {
    source: ObservationSource,
    /// Position of each row of the batch in `initial_rows` of its share.
    places: &'r [usize],
    /// The entries of each of `initial_rows`; `None` for a row in which another share has begun a simulation.
    rows: &'r mut [Option<AnswerRow<'o>>],
}

/// The work of a share at a request: its last step writes the observations of its egos.
type ShareWork<'a, 'w, S, const N: usize> = dyn Fn(&mut StepGroup<'a, S, N>, &mut DecisionContext<S, N>, &mut ShareRows<'_, '_>)
    + Sync
    + 'w;

/// The simulations whose observations `StepGroup::observe` writes.
#[derive(Clone, Copy, PartialEq)]
enum Writes {
    /// Only simulations that have ended at this decision.
    Ended,
    /// All simulations that had not ended before this decision.
    All,
}

/// A share: blocks that began at the same request and that one thread advances together.
struct StepGroup<'a, S: Simd, const N: usize> {
    blocks: Vec<Box<Block<'a, S, N>>>,
    /// Context of the egos of each block at the present decision, which `observe` keeps for the next request.
    ego_contexts: Vec<DriverContext<S>>,
    /// Rows of the simulations that began in this share.
    initial_rows: Vec<usize>,
    /// Number of the share, as in `SteppedBatch::owners`.
    number: usize,
    /// Number of steps of 10 ms since these simulations began.
    step: u32,
    /// Rows of simulations that have left the share, with their outputs, until `SteppedBatch` takes them back.
    released: Vec<(usize, Output<'a>)>,
    /// Histories of blocks that have ended, until `SteppedBatch` takes them back.
    free_histories: Vec<History<N>>,
}

impl<'a, S: Simd, const N: usize> StepGroup<'a, S, N> {
    /// Let the egos decide, by orders or by the model, and move all vehicles until the next decision.
    ///
    /// A simulation leaves the share after the request in which it ended, because that request still has to write the
    /// observation at its end. `request_start` is the step at which the present request began.
    fn advance_to_decision(
        &mut self,
        inputs: &Inputs<'_>,
        action_log: Option<&ActionLog<'_>>,
        context: &mut DecisionContext<S, N>,
        request_start: u32,
    ) {
        for (block, driver) in self.blocks.iter_mut().zip(&self.ego_contexts) {
            block.advance_to_decision(self.step, inputs, action_log, driver, context);
        }
        self.step += SUBSTEPS;
        self.release_lanes(|block, lane| block.state.end_step[lane] < request_start as f32);
        if (self.step / SUBSTEPS).is_multiple_of(MERGE_INTERVAL) {
            let emptied = merge(&mut self.blocks);
            self.free_histories.extend(
                emptied
                    .into_iter()
                    .map(|block| block.state.attention.history),
            );
        }
    }

    /// Remove the simulations in the lanes for which `leaves` holds, and the blocks that are empty then.
    fn release_lanes(&mut self, leaves: impl Fn(&Block<'a, S, N>, usize) -> bool) {
        for block in &mut self.blocks {
            self.released.extend(block.release(&leaves));
        }
        if self.blocks.iter().all(|block| block.num_running() > 0) {
            return;
        }
        let ego_contexts = std::mem::take(&mut self.ego_contexts);
        for (block, ego_context) in std::mem::take(&mut self.blocks)
            .into_iter()
            .zip(ego_contexts)
        {
            if block.num_running() > 0 {
                self.blocks.push(block);
                self.ego_contexts.push(ego_context);
            } else {
                self.free_histories.push(block.state.attention.history);
            }
        }
    }

    /// Update the perception of all drivers, write the observations of the egos, and decide for all other drivers.
    ///
    /// `first_step` is the step at which the request began.
    fn observe(
        &mut self,
        context: &mut DecisionContext<S, N>,
        rows: &mut ShareRows<'_, '_>,
        first_step: u32,
        writes: Writes,
    ) {
        self.ego_contexts.clear();
        for block in &mut self.blocks {
            let Block {
                state,
                params,
                recorder,
                simulations,
                ..
            } = &mut **block;
            perceive(state, params, context, self.step, true);
            let step = self.step as f32;
            let runs = |lane: usize| step <= state.end_step[lane];
            // A simulation that ended at an earlier decision of this request moves on
            // with its block until the request is over. Its row already has the observation at its end.
            let ended_before = |lane: usize| step - SUBSTEPS as f32 > state.end_step[lane];
            let is_written = |lane: usize| {
                recorder.is_busy(lane)
                    && !ended_before(lane)
                    && (writes == Writes::All || !runs(lane))
            };
            if (0..SIMD_LANES).any(is_written) {
                let driver = &context.drivers[EGO_SLOT];
                let table: ObservationTable<S> = with_cpu_features!(
                    params.simd,
                    state
                        .vehicle(params, EGO_SLOT)
                        .observation_table(driver, rows.source)
                );
                for lane in (0..SIMD_LANES).filter(|lane| is_written(*lane)) {
                    let Some(row) = &mut rows.rows[rows.places[simulations[lane]]] else {
                        continue;
                    };
                    for (entry, values) in row.table.iter_mut().zip(&table) {
                        *entry = values[lane];
                    }
                    *row.runs = runs(lane);
                    *row.num_decisions = (self.step - first_step) / SUBSTEPS;
                }
            }
            drive_others(state, params, context);
            self.ego_contexts.push(context.drivers[EGO_SLOT]);
        }
    }
}
