//! A batch of simulations that waits at every decision for the actions of an external driver of the egos.
//!
//! The *ego* is the vehicle under study of a simulation; drivers decide every 50 ms, `SUBSTEPS` steps of 10 ms. Each
//! simulation has a fixed *row* in the arrays of actions and observations, and new simulations can begin in rows
//! between two calls. Simulations that began together are divided into *groups* (`StepGroup`), each advanced by one
//! thread in blocks of sixteen lanes (`block`). Nothing is recorded.
//!
//! A call runs in the thread pool of its caller. The batch holds no thread between calls, so that a forked child
//! process can continue with its copy.

use std::sync::{Arc, Mutex, PoisonError};

use fearless_simd::Simd;
use rayon::prelude::*;

use crate::decision_context::{DecisionContext, DriverContext};
use crate::ego_action::{ActionKind, ActionLog};
use crate::math::vectors::{SIMD_LANES, with_cpu_features};
use crate::observation_table::{OBSERVATION_SIZE, ObservationSource, ObservationTable};
use crate::params::SUBSTEPS;
use crate::run::block::{Block, merge};
use crate::run::engine::{Inputs, divide_into_shares, max_blocks_per_share, order_by_similarity};
use crate::run::step::{drive_others, perceive};
use crate::state::{EGO_SLOT, History, new_history};
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Number of decisions between two attempts to merge blocks whose simulations have ended. A choice.
const MERGE_INTERVAL: u32 = 16;

/// A batch whose egos an external driver drives. It waits between calls; each call observes the egos.
pub trait SteppedBatch: Send + Sync {
    /// Begin simulations in some rows, in place of the simulations there, and observe their egos.
    ///
    /// `inputs` has the new simulations in the order of `rows`, which has no repetitions. Only their parameters and
    /// scenario indices are read: road, constants and seed are those that the batch was made with.
    fn begin_simulations(&mut self, inputs: &Inputs<'_>, rows: &[usize]) -> EgoObservations;

    /// Advance all simulations by `decisions` decisions, at least one, with the same actions, and observe their egos.
    ///
    /// `actions` has integers in the units of `ActionKind`, (row, `MAX_ACTION_PARTS`). They are ignored if the model
    /// drives.
    fn advance(&mut self, actions: &[i32], decisions: u32) -> EgoObservations;
}

/// The egos of all rows, or of the rows with new simulations, after a call of a `SteppedBatch`.
#[derive(Clone)]
pub struct EgoObservations {
    /// Observations, (simulation, `OBSERVATION_SIZE`). Zeros if the simulation had ended before the call.
    ///
    /// A simulation that ends during the call is observed at its end, not at the end of the call.
    pub table: Vec<f32>,
    /// Whether each simulation still runs.
    pub is_running: Vec<bool>,
    /// Number of decisions that each simulation has carried out in the call.
    pub num_decisions: Vec<u32>,
}

/// The entries of one simulation in an `EgoObservations`.
struct ObservationRow<'o> {
    table: &'o mut [f32],
    is_running: &'o mut bool,
    num_decisions: &'o mut u32,
}

/// Make a stepped batch with one row for each simulation of `inputs`, at a SIMD level. No simulation has begun yet.
///
/// Without `action_kind` the model drives the egos. The function is generic, so that the crates that call it, one for
/// each kind of CPU, can compile it at the same time.
///
/// # Errors
/// There are more than `MAX_VEHICLES` slots.
pub fn stepped_batch<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    action_kind: Option<ActionKind>,
    source: ObservationSource,
) -> Result<Box<dyn SteppedBatch>, String> {
    let num_slots = inputs.num_slots;
    match SLOT_CAPACITIES
        .into_iter()
        .find(|slots| num_slots <= *slots)
    {
        Some(8) => Ok(StepGroups::<S, 8>::new_batch(
            simd,
            inputs,
            action_kind,
            source,
        )),
        Some(16) => Ok(StepGroups::<S, 16>::new_batch(
            simd,
            inputs,
            action_kind,
            source,
        )),
        Some(32) => Ok(StepGroups::<S, 32>::new_batch(
            simd,
            inputs,
            action_kind,
            source,
        )),
        _ => Err(format!("{num_slots} slots are more than {MAX_VEHICLES}")),
    }
}

/// A stepped batch with up to `N` vehicle slots: groups of simulations that began at the same call.
struct StepGroups<S: Simd, const N: usize> {
    simd: S,
    /// Road, constants, seed and frame interval of all simulations; the interval determines the integration step.
    shared: Inputs<'static>,
    /// Meaning of the numbers of an action; `None` if the model drives the egos.
    action_kind: Option<ActionKind>,
    /// Source of the observed motion of neighbours.
    source: ObservationSource,
    /// Memory for the past motion that drivers recall, from blocks that have ended, for the next blocks.
    free_histories: Vec<History<N>>,
    groups: Vec<StepGroup<S, N>>,
    /// Position of each row of the batch in `initial_rows` of its group.
    positions_in_group: Vec<usize>,
    /// Number of the group of each row, as in `StepGroup::number`.
    group_of_row: Vec<usize>,
    /// Number of groups that have begun so far; the next group gets it as its number.
    num_groups_begun: usize,
    /// Working memory for perception of each thread.
    contexts: Vec<Mutex<DecisionContext<S, N>>>,
}

impl<S: Simd, const N: usize> SteppedBatch for StepGroups<S, N> {
    fn begin_simulations(&mut self, inputs: &Inputs<'_>, rows: &[usize]) -> EgoObservations {
        let inputs = &Inputs {
            vehicle: inputs.vehicle,
            simulation: inputs.simulation,
            scenario_index: inputs.scenario_index,
            ..self.shared.clone()
        };
        // For each row of the batch, its row in the observations; `None` for a row without a new simulation.
        let mut observed_rows = vec![None; self.positions_in_group.len()];
        for (observed_row, row) in rows.iter().enumerate() {
            observed_rows[*row] = Some(observed_row);
        }
        for group in &mut self.groups {
            group.free_lanes(|block, lane| observed_rows[block.simulations[lane]].is_some());
        }
        self.drop_empty_groups();
        let num_old_groups = self.groups.len();
        for simulations in divide_into_shares(order_by_similarity(inputs), max_blocks_per_share(N))
        {
            self.begin_group(inputs, rows, &simulations);
        }
        // New groups have only rows with new simulations, so the 0 is never used.
        let observed_row = |row: usize| observed_rows[row].unwrap_or(0);
        self.observe_groups(
            num_old_groups,
            rows.len(),
            &observed_row,
            &|group, context, rows| {
                group.observe(context, rows, group.step, Writes::All);
            },
        )
    }

    fn advance(&mut self, actions: &[i32], decisions: u32) -> EgoObservations {
        // A log of one decision, the actions of this call. They hold for all its decisions, because decisions beyond
        // the end of a log take the last actions in it.
        let action_log = self.action_kind.map(|kind| ActionLog {
            kind,
            values: actions,
            decisions: 1,
        });
        let (steps_per_frame, num_rows) =
            (self.shared.steps_per_frame, self.positions_in_group.len());
        let observations = self.observe_groups(0, num_rows, &|row| row, &|group, context, rows| {
            let call_start = group.step;
            for decision in 1..=decisions {
                group.advance_to_decision(
                    steps_per_frame,
                    action_log.as_ref(),
                    context,
                    call_start,
                );
                let writes = if decision < decisions {
                    Writes::Ended
                } else {
                    Writes::All
                };
                group.observe(context, rows, call_start, writes);
            }
        });
        self.drop_empty_groups();
        observations
    }
}

impl<S: Simd, const N: usize> StepGroups<S, N> {
    /// A batch with a row for each simulation of `inputs`, none of which has begun.
    fn new_batch(
        simd: S,
        inputs: &Inputs<'_>,
        action_kind: Option<ActionKind>,
        source: ObservationSource,
    ) -> Box<dyn SteppedBatch> {
        let batch = inputs.scenario_index.len();
        Box::new(Self {
            simd,
            shared: Inputs {
                vehicle: &[],
                simulation: &[],
                scenario_index: &[],
                constants: Arc::clone(&inputs.constants),
                road: Arc::clone(&inputs.road),
                num_slots: inputs.num_slots,
                seed: inputs.seed,
                steps_per_frame: inputs.steps_per_frame,
                action_log: None,
            },
            action_kind,
            source,
            free_histories: Vec::new(),
            groups: Vec::new(),
            positions_in_group: vec![0; batch],
            group_of_row: vec![0; batch],
            num_groups_begun: 0,
            contexts: Vec::new(),
        })
    }

    /// Begin some `simulations` of `inputs` in a new group. `rows` has the row of each simulation of `inputs`.
    fn begin_group(&mut self, inputs: &Inputs<'_>, rows: &[usize], simulations: &[usize]) {
        let number = self.num_groups_begun;
        self.num_groups_begun += 1;
        let initial_rows: Vec<_> = simulations.iter().map(|index| rows[*index]).collect();
        for (position, row) in initial_rows.iter().enumerate() {
            (self.positions_in_group[*row], self.group_of_row[*row]) = (position, number);
        }
        let mut blocks = Vec::new();
        for simulations in simulations.chunks(SIMD_LANES) {
            let history = self.free_histories.pop().unwrap_or_else(new_history);
            let mut block = Block::new(self.simd, inputs, simulations, None, history);
            // From positions in `inputs` to rows of the batch. Lanes without a simulation repeat the last one;
            // `has_simulation` leaves them out.
            block.simulations = block.simulations.map(|index| rows[index]);
            blocks.push(block);
        }
        self.groups.push(StepGroup {
            blocks,
            ego_contexts: Vec::new(),
            initial_rows,
            number,
            step: 0,
            free_histories: Vec::new(),
        });
    }

    /// Do `work` for all groups from index `first_group` on in parallel, and collect the observations that it writes.
    ///
    /// There are `num_observed` observations; `observed_row` maps a row of the batch to its row in the observations.
    fn observe_groups(
        &mut self,
        first_group: usize,
        num_observed: usize,
        observed_row: &dyn Fn(usize) -> usize,
        work: &GroupWork<'_, S, N>,
    ) -> EgoObservations {
        // A forked child may have a pool of more threads than its parent.
        let num_threads = rayon::current_num_threads().max(self.contexts.len());
        self.contexts
            .resize_with(num_threads, || Mutex::new(DecisionContext::new(self.simd)));
        let mut observations = EgoObservations {
            table: vec![0.0; num_observed * OBSERVATION_SIZE],
            is_running: vec![false; num_observed],
            num_decisions: vec![0; num_observed],
        };
        let table = observations.table.chunks_exact_mut(OBSERVATION_SIZE);
        let mut rows: Vec<_> = table
            .zip(&mut observations.is_running)
            .zip(&mut observations.num_decisions)
            .map(|((table, is_running), num_decisions)| {
                Some(ObservationRow {
                    table,
                    is_running,
                    num_decisions,
                })
            })
            .collect();
        let (group_of_row, source) = (&self.group_of_row, self.source);
        let mut groups_with_rows: Vec<_> = self.groups[first_group..]
            .iter_mut()
            .map(|group| {
                let group_rows: Vec<_> = group
                    .initial_rows
                    .iter()
                    .map(|row| {
                        (group_of_row[*row] == group.number)
                            .then(|| rows[observed_row(*row)].take())
                    })
                    .map(Option::flatten)
                    .collect();
                (group, group_rows)
            })
            .collect();
        let (positions_in_group, contexts) = (&self.positions_in_group, &self.contexts);
        groups_with_rows.par_iter_mut().for_each(|(group, rows)| {
            // Each thread of the pool has its own context, so the lock never waits.
            let thread = rayon::current_thread_index().unwrap_or(0);
            let mut context = contexts[thread]
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let mut rows = GroupRows {
                source,
                positions_in_group,
                rows,
            };
            work(group, &mut context, &mut rows);
        });
        drop(groups_with_rows);
        observations
    }

    /// Take back the memory of blocks that have ended, and drop empty groups.
    fn drop_empty_groups(&mut self) {
        for group in &mut self.groups {
            self.free_histories.append(&mut group.free_histories);
        }
        self.groups.retain(|group| !group.blocks.is_empty());
    }
}

/// The rows in which a group writes the observations of its egos.
struct GroupRows<'r, 'o> {
    source: ObservationSource,
    /// Position of each row of the batch in `initial_rows` of its group.
    positions_in_group: &'r [usize],
    /// The entries of each of `initial_rows`; `None` for a row in which another group has begun a simulation.
    rows: &'r mut [Option<ObservationRow<'o>>],
}

/// The work of a group in a call, which writes the observations of its egos at its end.
type GroupWork<'w, S, const N: usize> =
    dyn Fn(&mut StepGroup<S, N>, &mut DecisionContext<S, N>, &mut GroupRows<'_, '_>) + Sync + 'w;

/// The simulations whose observations `StepGroup::observe` writes.
#[derive(Clone, Copy, PartialEq)]
enum Writes {
    /// Only simulations that have ended at this decision.
    Ended,
    /// All simulations that had not ended before this decision.
    All,
}

/// Blocks that began at the same call and that one thread advances together.
struct StepGroup<S: Simd, const N: usize> {
    blocks: Vec<Box<Block<'static, S, N>>>,
    /// Context of the egos of each block at the present decision, which `observe` stores for `advance_to_decision`.
    ego_contexts: Vec<DriverContext<S>>,
    /// Rows of the simulations that began in this group.
    initial_rows: Vec<usize>,
    /// Number of the group, as in `StepGroups::group_of_row`.
    number: usize,
    /// Number of steps of 10 ms since these simulations began.
    step: u32,
    /// Memory for the past motion from blocks that have ended, until `StepGroups` takes it back.
    free_histories: Vec<History<N>>,
}

impl<S: Simd, const N: usize> StepGroup<S, N> {
    /// Let the egos decide, by the actions of the external driver or by the model, and move all vehicles until the next
    /// decision.
    ///
    /// A simulation leaves the group after the call in which it ended, because this call still has to write the
    /// observation at its end. `call_start` is the step at which the present call began.
    fn advance_to_decision(
        &mut self,
        steps_per_frame: u32,
        action_log: Option<&ActionLog<'_>>,
        context: &mut DecisionContext<S, N>,
        call_start: u32,
    ) {
        for (block, ego) in self.blocks.iter_mut().zip(&self.ego_contexts) {
            let steps = (self.step, steps_per_frame);
            block.advance_to_decision(steps, action_log, ego, &mut context.step_start);
        }
        self.step += SUBSTEPS;
        self.free_lanes(|block, lane| block.state.end_step[lane] < call_start as f32);
        if (self.step / SUBSTEPS).is_multiple_of(MERGE_INTERVAL) {
            // This changes the order of the blocks; `observe` then stores their `ego_contexts` anew.
            let emptied = merge(&mut self.blocks);
            self.free_histories.extend(
                emptied
                    .into_iter()
                    .map(|block| block.state.attention.history),
            );
        }
    }

    /// Remove the simulations in the lanes for which `leaves` holds, and the blocks that are empty then.
    fn free_lanes(&mut self, leaves: impl Fn(&Block<'static, S, N>, usize) -> bool) {
        for block in &mut self.blocks {
            block.free_lanes(&leaves);
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
    /// The other drivers decide here, because the next block overwrites their perception in `context`. `call_start` is
    /// the step at which the present call began.
    fn observe(
        &mut self,
        context: &mut DecisionContext<S, N>,
        rows: &mut GroupRows<'_, '_>,
        call_start: u32,
        writes: Writes,
    ) {
        self.ego_contexts.clear();
        for block in &mut self.blocks {
            let Block {
                state,
                params,
                has_simulation,
                simulations,
                ..
            } = &mut **block;
            // `true`: the search includes all neighbours of the ego at every decision, because its observation shows
            // them all, and an external driver may change lanes at any.
            perceive(state, params, context, self.step, true);
            let step = self.step as f32;
            let is_running = |lane: usize| step <= state.end_step[lane];
            // A simulation that ended at an earlier decision of this call stays in its block until the call is over.
            // Its row already has the observation at its end.
            let ended_before = |lane: usize| step - SUBSTEPS as f32 > state.end_step[lane];
            let is_written = |lane: usize| {
                has_simulation[lane]
                    && !ended_before(lane)
                    && (writes == Writes::All || !is_running(lane))
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
                    let Some(row) = &mut rows.rows[rows.positions_in_group[simulations[lane]]]
                    else {
                        continue;
                    };
                    for (entry, values) in row.table.iter_mut().zip(&table) {
                        *entry = values[lane];
                    }
                    *row.is_running = is_running(lane);
                    *row.num_decisions = (self.step - call_start) / SUBSTEPS;
                }
            }
            drive_others(state, params, context);
            self.ego_contexts.push(context.drivers[EGO_SLOT]);
        }
    }
}
