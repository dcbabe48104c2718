//! A batch that waits at every decision for what another driver orders.
//!
//! Its state lies on the stack of a thread of its own, which answers one request after the other.

use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Mutex, PoisonError};

use fearless_simd::Simd;
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::decision_context::{DecisionContext, DriverContext};
use crate::ego_action::{ActionKind, ActionLog, MAX_ACTION_PARTS};
use crate::math::vectors::{Mask, SIMD_LANES, with_cpu_features};
use crate::neighbour_search::Neighbours;
use crate::observation_table::{
    OBSERVATION_SIZE, ObservationSource, ObservationTable, observation_table,
};
use crate::oncoming::OncomingTraffic;
use crate::params::{Road, SUBSTEPS};
use crate::perception::Beliefs;
use crate::recorder::output::{Output, Storage};
use crate::run::block::{Block, merge};
use crate::run::engine::{Inputs, SimulationOutput, order_by_similarity, shares};
use crate::run::step::{drive_others, perceive};
use crate::state::{History, HistoryRows};
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Decisions after which simulations move together, where others have ended.
const MERGE_INTERVAL: u32 = 16;

/// What another driver asks for.
pub enum Request {
    /// Go on.
    Go {
        /// Steps of each number in every simulation, (simulation, part); nothing reads them where the
        /// model drives.
        values: Vec<i32>,
        /// For how many decisions, one at least.
        decisions: u32,
    },
    /// Begin new simulations in the rows of others.
    Renew {
        /// The rows, each once.
        rows: Vec<usize>,
        /// The new simulations.
        fresh: Fresh,
    },
}

/// Parameters of new simulations, as those in `Inputs`.
pub struct Fresh {
    /// Of vehicles, for as many slots as the others have.
    pub vehicle: Vec<f32>,
    /// Of simulations.
    pub simulation: Vec<f32>,
    /// Numbers of the simulations.
    pub index: Vec<u64>,
}

/// What it observes then, in every simulation or in the new ones.
pub struct Observed {
    /// Numbers of the simulations that run, or ran until now; zeros of the others, (simulation, `OBSERVATION_SIZE`).
    ///
    /// A simulation that ends while an order holds is observed at its end, not at the end of the order.
    pub table: Vec<f32>,
    /// Whether each simulation runs.
    pub runs: Vec<bool>,
    /// How many decisions of the request each simulation has carried out.
    pub num_decisions: Vec<u32>,
}

/// The entries of one simulation in an `Answer`.
struct AnswerRow<'o> {
    table: &'o mut [f32],
    runs: &'o mut bool,
    num_decisions: &'o mut u32,
}

/// Who talks to a batch: orders, observations, and what both mean.
pub struct Talk {
    /// What the numbers of orders mean; None where the model's own driver decides.
    pub kind: Option<ActionKind>,
    /// What is observed.
    pub source: ObservationSource,
    /// Where orders come from; the batch ends when nobody gives any more.
    pub requests: Receiver<Request>,
    /// Where observations go: one at first, and one after each request.
    pub answers: Sender<Observed>,
    /// Threads that simulate it.
    pub pool: &'static ThreadPool,
}

/// Simulate a batch at a SIMD level, as far as another driver takes it.
///
/// Generic, as `simulate` is.
///
/// # Errors
/// There are too many vehicles.
pub fn stepped_batch<S: Simd>(simd: S, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    match SLOT_CAPACITIES
        .into_iter()
        .find(|slots| inputs.num_slots <= *slots)
    {
        Some(8) => converse::<S, 8>(simd, inputs, talk),
        Some(16) => converse::<S, 16>(simd, inputs, talk),
        Some(32) => converse::<S, 32>(simd, inputs, talk),
        _ => {
            return Err(format!(
                "{} slots are more than {MAX_VEHICLES}",
                inputs.num_slots
            ));
        }
    }
    Ok(())
}

fn converse<S: Simd, const N: usize>(simd: S, inputs: &Inputs<'_>, talk: &Talk) {
    let batch = inputs.scenario_index.len();
    let road = Road::of(inputs);
    let mut storage = Storage::new(batch, inputs.num_slots, SIMD_LANES);
    // A block has one simulation at least, so there are never more of them.
    let mut histories = Vec::new();
    histories.resize_with(batch, || None::<History<N>>);
    let mut crowd = SteppedBatch {
        simd,
        inputs,
        road: &road,
        meaning: (talk.kind, talk.source),
        outputs: storage
            .output()
            .into_simulations()
            .into_iter()
            .map(Some)
            .collect(),
        unused: histories.iter_mut(),
        spare: Vec::new(),
        shares: Vec::new(),
        places: vec![0; batch],
        owners: vec![0; batch],
        begun: 0,
        pool: talk.pool,
        minds: (0..=talk.pool.current_num_threads())
            .map(|_| Mutex::new(DecisionContext::new(simd)))
            .collect(),
    };
    let everyone: Vec<_> = (0..batch).collect();
    let mut answer = crowd.renew(inputs, &everyone);
    while talk.answers.send(answer).is_ok() {
        answer = match talk.requests.recv() {
            Ok(Request::Go { values, decisions }) if values.len() == batch * MAX_ACTION_PARTS => {
                crowd.go_on(&values, decisions)
            }
            Ok(Request::Renew { rows, fresh }) if rows.iter().all(|row| *row < batch) => {
                let inputs = Inputs {
                    vehicle: &fresh.vehicle,
                    simulation: &fresh.simulation,
                    scenario_index: &fresh.index,
                    ..*inputs
                };
                crowd.renew(&inputs, &rows)
            }
            _ => return,
        };
    }
}

/// All simulations, in shares of those that began at the same time.
struct SteppedBatch<'a, S: Simd, const N: usize> {
    simd: S,
    inputs: &'a Inputs<'a>,
    road: &'a Road<'a>,
    meaning: (Option<ActionKind>, ObservationSource),
    /// Where the results of each row would go, while nothing runs in it.
    outputs: Vec<Option<Output<'a>>>,
    unused: std::slice::IterMut<'a, Option<History<N>>>,
    spare: Vec<&'a mut HistoryRows<N>>,
    shares: Vec<StepGroup<'a, S, N>>,
    /// Place of each row in the share that has it.
    places: Vec<usize>,
    /// The share that has it, by its number.
    owners: Vec<usize>,
    /// Shares so far.
    begun: usize,
    pool: &'static ThreadPool,
    /// Room to think, for each thread.
    minds: Vec<Mutex<DecisionContext<S, N>>>,
}

impl<'a, S: Simd, const N: usize> SteppedBatch<'a, S, N> {
    /// Carry out orders for as long as they hold, and look around then.
    fn go_on(&mut self, values: &[i32], decisions: u32) -> Observed {
        let script = self.meaning.0.map(|kind| ActionLog {
            kind,
            values,
            decisions: 1,
        });
        let (inputs, every) = (self.inputs, 0..self.places.len());
        let answer = self.look(0, every.len(), &|row| row, &|share, minds, rows| {
            let first_step = share.step;
            for decision in 1..=decisions {
                share.act(inputs, script.as_ref(), minds, first_step);
                let writes = if decision < decisions {
                    Writes::Ended
                } else {
                    Writes::All
                };
                share.look(minds, rows, first_step, writes);
            }
        });
        self.tidy();
        answer
    }

    /// Begin simulations in some rows, and look around in them.
    fn renew(&mut self, fresh: &Inputs<'_>, rows: &[usize]) -> Observed {
        let mut places = vec![None; self.places.len()];
        for (place, row) in rows.iter().enumerate() {
            places[*row] = Some(place);
        }
        for share in &mut self.shares {
            share.leave(|row| places[row].is_some());
        }
        self.tidy();
        let seats = order_by_similarity(fresh)
            .into_iter()
            .filter_map(|one| Some((one, self.outputs[rows[one]].take()?)))
            .collect();
        let old = self.shares.len();
        for seats in self.pool.install(|| shares(seats)) {
            self.begin(fresh, rows, seats);
        }
        let place = |row: usize| places[row].unwrap_or(0);
        self.look(old, rows.len(), &place, &|share, minds, rows| {
            share.look(minds, rows, share.step, Writes::All);
        })
    }

    /// Begin the simulations of a share.
    fn begin(&mut self, fresh: &Inputs<'_>, rows: &[usize], seats: Vec<SimulationOutput<'a>>) {
        let number = self.begun;
        self.begun += 1;
        let seated: Vec<_> = seats.iter().map(|(one, _)| rows[*one]).collect();
        for (place, row) in seated.iter().enumerate() {
            (self.places[*row], self.owners[*row]) = (place, number);
        }
        let mut blocks = Vec::new();
        let mut seats = seats.into_iter().peekable();
        while seats.peek().is_some() {
            let unused = &mut self.unused;
            let new = || unused.next().map(|one| &mut *one.get_or_insert_default().0);
            let Some(history) = self.spare.pop().or_else(new) else {
                return;
            };
            let shared = (self.inputs.constants, self.road);
            if let Some(mut block) = Block::new(self.simd, fresh, shared, &mut seats, history) {
                block.simulations = block.simulations.map(|one| rows[one]);
                blocks.push(block);
            }
        }
        self.shares.push(StepGroup {
            blocks,
            kept: Vec::new(),
            seated,
            number,
            step: 0,
            freed: Vec::new(),
            spare: Vec::new(),
        });
    }

    /// Let all shares from index `from` on do `work` in parallel; it writes the observations of their egos.
    fn look(
        &mut self,
        from: usize,
        length: usize,
        place: &dyn Fn(usize) -> usize,
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
        let (owners, source) = (&self.owners, self.meaning.1);
        let mut portions: Vec<_> = self.shares[from..]
            .iter_mut()
            .map(|share| {
                let own: Vec<_> = share
                    .seated
                    .iter()
                    .map(|row| (owners[*row] == share.number).then(|| rows[place(*row)].take()))
                    .map(Option::flatten)
                    .collect();
                (share, own)
            })
            .collect();
        let (places, minds) = (&self.places, &self.minds);
        self.pool.install(|| {
            portions.par_iter_mut().for_each(|(share, rows)| {
                let thread = rayon::current_thread_index().map_or(0, |thread| thread + 1);
                let mut minds = minds[thread].lock().unwrap_or_else(PoisonError::into_inner);
                let mut rows = ShareRows {
                    source,
                    places,
                    rows,
                };
                work(share, &mut minds, &mut rows);
            });
        });
        drop(portions);
        answer
    }

    /// Take back what simulations that are over have used.
    fn tidy(&mut self) {
        for share in &mut self.shares {
            for (row, out) in share.freed.drain(..) {
                self.outputs[row] = Some(out);
            }
            self.spare.append(&mut share.spare);
        }
        self.shares.retain(|share| !share.blocks.is_empty());
    }
}

/// What the ego of a block knew when it was to decide.
struct Kept<S: Simd> {
    near: Neighbours<S>,
    believed: Beliefs<S>,
    met: OncomingTraffic<S>,
    looks: Mask<S>,
    waits: Mask<S>,
}

impl<S: Simd> Kept<S> {
    fn of(mind: DriverContext<'_, S>) -> Self {
        Self {
            near: *mind.neighbours,
            believed: *mind.beliefs,
            met: *mind.oncoming,
            looks: mind.checks_mirrors,
            waits: mind.gives_way,
        }
    }

    fn mind(&self) -> DriverContext<'_, S> {
        DriverContext {
            neighbours: &self.near,
            beliefs: &self.believed,
            oncoming: &self.met,
            checks_mirrors: self.looks,
            gives_way: self.waits,
        }
    }
}

/// The rows of the answer in which a share writes the observations of its egos.
struct ShareRows<'r, 'o> {
    source: ObservationSource,
    /// Place in the share of the simulation in each row of the batch.
    places: &'r [usize],
    /// The entries for each place; `None` for a row that another share has taken over.
    rows: &'r mut [Option<AnswerRow<'o>>],
}

/// The work of a share at a request: its last step writes the observations of its egos.
type ShareWork<'a, 'w, S, const N: usize> = dyn Fn(&mut StepGroup<'a, S, N>, &mut DecisionContext<S, N>, &mut ShareRows<'_, '_>)
    + Sync
    + 'w;

/// The simulations whose observations `Share::look` writes.
#[derive(Clone, Copy, PartialEq)]
enum Writes {
    /// Only simulations that have ended at this decision.
    Ended,
    /// All simulations that had not ended before this decision.
    All,
}

/// Blocks that one thread advances together.
struct StepGroup<'a, S: Simd, const N: usize> {
    blocks: Vec<Box<Block<'a, S, N>>>,
    /// What the ego of each block knows at this decision.
    kept: Vec<Kept<S>>,
    /// The rows that were in it at first.
    seated: Vec<usize>,
    number: usize,
    step: u32,
    /// Rows that it has no more.
    freed: Vec<(usize, Output<'a>)>,
    /// Histories that it needs no more.
    spare: Vec<&'a mut HistoryRows<N>>,
}

impl<'a, S: Simd, const N: usize> StepGroup<'a, S, N> {
    /// Let egos do as ordered, or as they decide, and everything move until the next decision.
    ///
    /// Simulations stay until it has been `told` that they have ended: what their egos saw last counts.
    fn act(
        &mut self,
        inputs: &Inputs<'_>,
        script: Option<&ActionLog<'_>>,
        minds: &mut DecisionContext<S, N>,
        told: u32,
    ) {
        for (block, kept) in self.blocks.iter_mut().zip(&self.kept) {
            block.go_on(self.step, inputs, script, kept.mind(), minds);
        }
        self.step += SUBSTEPS;
        self.leave_lanes(|block, lane| block.state.end_step[lane] < told as f32);
        if (self.step / SUBSTEPS).is_multiple_of(MERGE_INTERVAL) {
            let left = merge(&mut self.blocks);
            self.spare
                .extend(left.into_iter().map(|block| block.state.attention.history));
        }
    }

    /// Give up rows.
    fn leave(&mut self, leaves: impl Fn(usize) -> bool) {
        self.leave_lanes(|block, lane| leaves(block.simulations[lane]));
    }

    fn leave_lanes(&mut self, leaves: impl Fn(&Block<'a, S, N>, usize) -> bool) {
        for block in &mut self.blocks {
            self.freed.extend(block.release(&leaves));
        }
        if self.blocks.iter().all(|block| block.num_running() > 0) {
            return;
        }
        let kept = std::mem::take(&mut self.kept);
        for (block, kept) in std::mem::take(&mut self.blocks).into_iter().zip(kept) {
            if block.num_running() > 0 {
                self.blocks.push(block);
                self.kept.push(kept);
            } else {
                self.spare.push(block.state.attention.history);
            }
        }
    }

    /// Let everybody look around, everybody but the ego decide, and write down what the egos observe.
    ///
    /// `first_step` is the step at which the request began.
    fn look(
        &mut self,
        minds: &mut DecisionContext<S, N>,
        rows: &mut ShareRows<'_, '_>,
        first_step: u32,
        writes: Writes,
    ) {
        self.kept.clear();
        for block in &mut self.blocks {
            let Block {
                state,
                world,
                recorder,
                simulations,
                ..
            } = &mut **block;
            perceive(state, world, minds, self.step, true);
            let step = self.step as f32;
            let runs = |lane: usize| step <= state.end_step[lane];
            // A lane (one simulation of the vector) that ended at an earlier decision of this request moves on
            // with the vector until the request is over. Its row already has the observation at its end.
            let ended_before = |lane: usize| step - SUBSTEPS as f32 > state.end_step[lane];
            let is_written = |lane: usize| {
                recorder.is_busy(lane)
                    && !ended_before(lane)
                    && (writes == Writes::All || !runs(lane))
            };
            if (0..SIMD_LANES).any(is_written) {
                let mind = minds.of_ego();
                let decision = (self.step / SUBSTEPS) as usize;
                let table: ObservationTable<S> = with_cpu_features!(
                    world.simd,
                    observation_table(state, world, mind, rows.source, decision)
                );
                for lane in (0..SIMD_LANES).filter(|lane| is_written(*lane)) {
                    let Some(row) = &mut rows.rows[rows.places[simulations[lane]]] else {
                        continue;
                    };
                    for (to, from) in row.table.iter_mut().zip(&table) {
                        *to = from[lane];
                    }
                    *row.runs = runs(lane);
                    *row.num_decisions = (self.step - first_step) / SUBSTEPS;
                }
            }
            drive_others(state, world, minds, self.step);
            self.kept.push(Kept::of(minds.of_ego()));
        }
    }
}
