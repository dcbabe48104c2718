//! A batch that waits at every decision for what another driver orders.
//!
//! Its state lies on the stack of a thread of its own, which answers one request after the other.

use std::sync::mpsc::{Receiver, Sender};

use fearless_simd::Simd;
use rayon::prelude::*;

use crate::block::{Block, merge};
use crate::engine::{Inputs, Seat, alike_together, shares};
use crate::lanes::{LANES, M, outlined};
use crate::neighbours::Neighbours;
use crate::observation::{Source, Table, WIDTH, observe};
use crate::orders::{Kind, PARTS, Script};
use crate::output::Storage;
use crate::perception::Beliefs;
use crate::state::{History, Road};
use crate::step::{Mind, Minds, SUBSTEPS, drive_others, perceive};
use crate::{MAX_VEHICLES, SLOTS};

/// Decisions after which simulations move together, where others have ended.
const MERGING: u32 = 16;

/// What another driver orders in every simulation, for some decisions.
pub struct Request {
    /// Steps of each number, (simulation, part); nothing reads them where the model drives.
    pub values: Vec<i32>,
    /// How many decisions they hold for, one at least.
    pub decisions: u32,
}

/// What it observes then.
pub struct Answer {
    /// Numbers of the simulations that run, zeros of the others, (simulation, `WIDTH`).
    pub table: Vec<f32>,
    /// Whether each simulation runs.
    pub runs: Vec<bool>,
}

/// Who talks to a batch: orders, observations, and what both mean.
pub struct Talk {
    /// What the numbers of orders mean; None where the model's own driver decides.
    pub kind: Option<Kind>,
    /// What is observed.
    pub source: Source,
    /// Where orders come from; the batch ends when nobody gives any more.
    pub requests: Receiver<Request>,
    /// Where observations go: one at first, and one after each request.
    pub answers: Sender<Answer>,
}

/// Simulate a batch at a SIMD level, as far as another driver takes it.
///
/// Generic, as `simulate` is.
///
/// # Errors
/// There are too many vehicles.
pub fn serve<S: Simd>(simd: S, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    match SLOTS.into_iter().find(|slots| inputs.slots <= *slots) {
        Some(8) => converse::<S, 8>(simd, inputs, talk),
        Some(16) => converse::<S, 16>(simd, inputs, talk),
        Some(32) => converse::<S, 32>(simd, inputs, talk),
        _ => {
            return Err(format!(
                "{} slots are more than {MAX_VEHICLES}",
                inputs.slots
            ));
        }
    }
    Ok(())
}

fn converse<S: Simd, const N: usize>(simd: S, inputs: &Inputs<'_>, talk: &Talk) {
    let batch = inputs.index.len();
    let road = Road::of(inputs);
    let mut storage = Storage::new(batch, inputs.slots, LANES);
    let mut places: Vec<_> = storage
        .output()
        .into_simulations()
        .into_iter()
        .map(Some)
        .collect();
    let seats = alike_together(inputs)
        .into_iter()
        .filter_map(|one| Some((one, places[one].take()?)))
        .collect();
    let portions = shares(seats);
    let mut histories: Vec<Vec<History<N>>> = portions.iter().map(|one| room(one.len())).collect();
    let mut shares: Vec<_> = portions
        .into_iter()
        .zip(&mut histories)
        .map(|(seats, histories)| Share::new(simd, inputs, &road, seats, histories))
        .collect();
    let mut places = vec![0; batch];
    for share in &shares {
        for (place, one) in share.seated.iter().enumerate() {
            places[*one] = place;
        }
    }
    let mut orders: Option<Request> = None;
    loop {
        let meaning = (talk.kind, talk.source);
        let answer = go_on(inputs, &mut shares, &places, meaning, orders.as_ref());
        if talk.answers.send(answer).is_err() {
            return;
        }
        match talk.requests.recv() {
            Ok(next) if next.values.len() == batch * PARTS => orders = Some(next),
            _ => return,
        }
    }
}

fn room<const N: usize>(seats: usize) -> Vec<History<N>> {
    let mut histories = Vec::new();
    histories.resize_with(seats.div_ceil(LANES), History::default);
    histories
}

/// Carry out orders for as long as they hold, and look around then.
fn go_on<S: Simd, const N: usize>(
    inputs: &Inputs<'_>,
    shares: &mut [Share<'_, S, N>],
    places: &[usize],
    (kind, source): (Option<Kind>, Source),
    orders: Option<&Request>,
) -> Answer {
    let mut answer = Answer {
        table: vec![0.0; places.len() * WIDTH],
        runs: vec![false; places.len()],
    };
    let table = answer.table.chunks_exact_mut(WIDTH);
    let mut rows: Vec<_> = table.zip(&mut answer.runs).map(Some).collect();
    let mut work: Vec<_> = shares
        .iter_mut()
        .map(|share| {
            let own: Vec<_> = share
                .seated
                .iter()
                .filter_map(|one| rows[*one].take())
                .collect();
            (share, own)
        })
        .collect();
    work.par_iter_mut().for_each(|(share, rows)| {
        if let Some(orders) = orders {
            let script = kind.map(|kind| Script {
                kind,
                values: &orders.values,
                decisions: 1,
            });
            for _ in 1..orders.decisions {
                share.act(inputs, script.as_ref());
                share.look(None);
            }
            share.act(inputs, script.as_ref());
        }
        share.look(Some((source, places, rows)));
    });
    drop(work);
    answer
}

/// Where what a share observes goes: what, the place of each simulation in it, and a row for each place.
type Rows<'r, 'o> = (
    Source,
    &'r [usize],
    &'r mut Vec<(&'o mut [f32], &'o mut bool)>,
);

/// What the ego of a block knew when it was to decide.
struct Kept<S: Simd> {
    near: Neighbours<S>,
    believed: Beliefs<S>,
    looks: M<S>,
    waits: M<S>,
}

impl<S: Simd> Kept<S> {
    fn of(mind: Mind<'_, S>) -> Self {
        Self {
            near: *mind.near,
            believed: *mind.believed,
            looks: mind.looks,
            waits: mind.waits,
        }
    }

    fn mind(&self) -> Mind<'_, S> {
        Mind {
            near: &self.near,
            believed: &self.believed,
            looks: self.looks,
            waits: self.waits,
        }
    }
}

/// Blocks that one thread advances together.
struct Share<'a, S: Simd, const N: usize> {
    blocks: Vec<Box<Block<'a, S, N>>>,
    /// What the ego of each block knows at this decision.
    kept: Vec<Kept<S>>,
    minds: Minds<S, N>,
    /// The simulations that were in it at first.
    seated: Vec<usize>,
    step: u32,
}

impl<'a, S: Simd, const N: usize> Share<'a, S, N> {
    fn new(
        simd: S,
        inputs: &Inputs<'a>,
        road: &'a Road,
        seats: Vec<Seat<'a>>,
        histories: &'a mut [History<N>],
    ) -> Self {
        let seated = seats.iter().map(|(one, _)| *one).collect();
        let mut seats = seats.into_iter();
        Self {
            blocks: histories
                .iter_mut()
                .map_while(|history| Block::new(simd, inputs, road, &mut seats, history))
                .collect(),
            kept: Vec::new(),
            minds: Minds::new(simd),
            seated,
            step: 0,
        }
    }

    /// Let egos do as ordered, or as they decide, and everything move until the next decision.
    fn act(&mut self, inputs: &Inputs<'_>, script: Option<&Script<'_>>) {
        for (block, kept) in self.blocks.iter_mut().zip(&self.kept) {
            block.go_on(self.step, inputs, script, kept.mind(), &mut self.minds);
        }
        self.step += SUBSTEPS;
        let step = self.step;
        self.blocks.retain_mut(|block| block.dismiss(step));
        if (step / SUBSTEPS).is_multiple_of(MERGING) {
            merge(&mut self.blocks);
        }
    }

    /// Let everybody look around, everybody but the ego decide, and write down what the egos observe.
    fn look(&mut self, mut rows: Option<Rows<'_, '_>>) {
        self.kept.clear();
        for block in &mut self.blocks {
            let Block {
                state,
                world,
                recorder,
                simulations,
                ..
            } = &mut **block;
            perceive(state, world, &mut self.minds, self.step, true);
            if let Some((source, places, rows)) = &mut rows {
                let mind = self.minds.of_ego();
                let table: Table<S> = outlined!(world.simd, observe(state, world, mind, *source));
                for lane in (0..LANES).filter(|lane| recorder.is_busy(*lane)) {
                    let (row, runs) = &mut rows[places[simulations[lane]]];
                    for (to, from) in row.iter_mut().zip(&table) {
                        *to = from[lane];
                    }
                    **runs = true;
                }
            }
            drive_others(state, world, &self.minds, self.step);
            self.kept.push(Kept::of(self.minds.of_ego()));
        }
    }
}
