//! Blocks of sixteen simulations that advance together, and move together when others end.
//!
//! A lane whose simulation has ended costs as much as any other. So blocks pause together after some whole
//! tiles of frames, and when the simulations that still run fit into fewer blocks, they change seats. What a
//! simulation computes does not depend on its lane.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::SLOT_CAPACITIES;
use crate::collisions::Pairs;
use crate::decision_context::{DecisionContext, DriverContext};
use crate::ego_action::{ActionLog, EgoAction};
use crate::math::vectors::{CopyLane, F32, SIMD_LANES, splat, with_cpu_features};
use crate::names::{ModelConstants, SimulationParams, VehicleParams};
use crate::params::{DerivedConstants, Params, Road, SUBSTEPS, StepLength};
use crate::recorder::Recorder;
use crate::recorder::frame_tiles::{FRAMES_PER_TILE, FrameTile};
use crate::recorder::output::Output;
use crate::run::engine::{Inputs, ParameterSwitch, SimulationOutput};
use crate::run::step::{advance, decide, drive_ego, update_slip_reach};
use crate::state::{EGO_SLOT, History, HistoryRows, State};

/// Tiles of frames between two pauses at least: a larger block takes longer to come back into the caches.
const fn tiles_per_phase(slots: usize) -> u32 {
    (slots / SLOT_CAPACITIES[0]) as u32
}

/// Memory that a thread uses again.
#[derive(Default)]
pub struct ThreadMemory<const N: usize> {
    tile: FrameTile<N>,
    histories: Vec<History<N>>,
}

/// Simulate the share of one thread.
///
/// Not inlined: what divides the shares calls itself, and would have room for all of this each time.
#[inline(never)]
pub fn run<'a, S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'a>,
    later: &[ParameterSwitch<'_>],
    share: Vec<SimulationOutput<'a>>,
    scratch: &mut ThreadMemory<N>,
) {
    let road = Road::of(inputs);
    let ThreadMemory { tile, histories } = scratch;
    histories.resize_with(
        histories.len().max(share.len().div_ceil(SIMD_LANES)),
        History::default,
    );
    let mut share = share.into_iter();
    let mut blocks: Vec<_> = histories
        .iter_mut()
        .map_while(|history| {
            Block::new(
                simd,
                inputs,
                (inputs.constants, &road),
                &mut share,
                &mut history.0,
            )
        })
        .collect();
    let mut minds = DecisionContext::new(simd);
    let length = phase(tiles_per_phase(N), inputs.steps_per_frame);
    let mut step = 0;
    while !blocks.is_empty() {
        for block in &mut blocks {
            block.advance((step, step + length), inputs, later, tile, &mut minds);
        }
        step += length;
        blocks.retain_mut(|block| block.finish_ended(step));
        merge(&mut blocks);
    }
}

/// Steps between two pauses: whole tiles of frames, and whole decisions.
fn phase(tiles: u32, steps_per_frame: u32) -> u32 {
    let tiles = tiles * FRAMES_PER_TILE as u32 * steps_per_frame;
    if tiles.is_multiple_of(SUBSTEPS) {
        tiles
    } else {
        tiles * SUBSTEPS
    }
}

/// Sixteen simulations, or fewer when some have ended.
pub(crate) struct Block<'a, S: Simd, const N: usize> {
    pub(crate) world: Params<'a, S, N>,
    pub(crate) state: State<'a, S, N>,
    pub(crate) recorder: Recorder<'a, N>,
    pub(crate) pairs: Pairs<S>,
    /// Angle of the ego's front wheels that another driver ordered at the last decision.
    wheel: Option<F32<S>>,
    /// Number of the simulation in each lane within the batch; free lanes repeat another one.
    pub(crate) simulations: [usize; SIMD_LANES],
}

impl<'a, S: Simd, const N: usize> Block<'a, S, N> {
    /// A block of the next simulations; `None` if there are no more.
    pub(crate) fn new(
        simd: S,
        inputs: &Inputs<'_>,
        (constants, road): (&'a ModelConstants, &'a Road),
        share: &mut impl Iterator<Item = SimulationOutput<'a>>,
        history: &'a mut HistoryRows<N>,
    ) -> Option<Box<Self>> {
        let mut out: [Option<Output<'a>>; SIMD_LANES] = core::array::from_fn(|_| None);
        let mut simulations = [0; SIMD_LANES];
        let mut taken = 0;
        for (simulation, results) in share.take(SIMD_LANES) {
            simulations[taken..].fill(simulation);
            out[taken] = Some(results);
            taken += 1;
        }
        if taken == 0 {
            return None;
        }
        let index = simulations.map(|simulation| inputs.scenario_index[simulation]);
        let (p, q) = load(
            simd,
            inputs.vehicle,
            inputs.simulation,
            inputs,
            &simulations,
        );
        let mut world = Params {
            simd,
            constants,
            derived: DerivedConstants::of(constants),
            road,
            vehicles: p,
            simulations: q,
            num_slots_in_use: 1,
            is_ring: has_ring(&q),
            key: [inputs.seed as u32, (inputs.seed >> 32) as u32],
            scenario_index_low: index.map(|number| number as u32),
            scenario_index_high: index.map(|number| (number >> 32) as u32),
        };
        let recorder = Recorder::new(out);
        world.num_slots_in_use = slots_in_use(&world, &recorder);
        let state = State::at_start(&world, history);
        Some(Box::new(Self {
            world,
            state,
            recorder,
            pairs: Pairs::new(),
            wheel: None,
            simulations,
        }))
    }

    /// Simulate from step `first` up to step `end`, or until all simulations have ended.
    fn advance(
        &mut self,
        (first, end): (u32, u32),
        inputs: &Inputs<'_>,
        later: &[ParameterSwitch<'_>],
        tile: &mut FrameTile<N>,
        minds: &mut DecisionContext<S, N>,
    ) {
        let simd = self.world.simd;
        let (stride, steps) = self.step_length(inputs);
        let mut step = first;
        while step < end && runs(&self.state, simd, step) {
            for later in later.iter().filter(|later| later.step == step) {
                self.switch_parameters(inputs, later);
            }
            let (state, world, recorder) = (&mut self.state, &self.world, &mut self.recorder);
            if step.is_multiple_of(SUBSTEPS) {
                let decision = (step / SUBSTEPS) as usize;
                let orders = inputs
                    .action_log
                    .map(|script| script.action_at(simd, &self.simulations, decision));
                self.wheel = orders.and_then(|orders| orders.wheel_angle());
                let pairs = &mut self.pairs;
                decide(state, world, minds, recorder, pairs, step, orders.as_ref());
            }
            if step.is_multiple_of(inputs.steps_per_frame) {
                let number = (step / inputs.steps_per_frame) as usize;
                with_cpu_features!(simd, {
                    let active = splat(simd, step as f32).simd_le(state.end_step);
                    recorder.record_frame(state, world, active, number, tile);
                });
            }
            let before = &mut minds.step_start;
            advance(state, world, &self.pairs, before, step, &stride, self.wheel);
            step += steps;
        }
        with_cpu_features!(simd, self.recorder.write_tile(&self.world, tile));
    }

    /// Go on with other parameters.
    fn switch_parameters(&mut self, inputs: &Inputs<'_>, later: &ParameterSwitch<'_>) {
        let (vehicle, simulation) = (later.vehicle, later.simulation);
        let (p, q) = load(
            self.world.simd,
            vehicle,
            simulation,
            inputs,
            &self.simulations,
        );
        let before = std::mem::replace(&mut self.world.vehicles, p);
        self.world.simulations = q;
        self.world.is_ring = has_ring(&q);
        for (lane, simulation) in self.simulations.into_iter().enumerate() {
            let number = later.scenario_index[simulation];
            self.world.scenario_index_low[lane] = number as u32;
            self.world.scenario_index_high[lane] = (number >> 32) as u32;
            if let Some(errors) = later.judgement_errors {
                self.state.noise.distance_error[EGO_SLOT][lane] = errors[simulation];
                self.state.noise.speed_error[EGO_SLOT][lane] =
                    errors[later.scenario_index.len() + simulation];
            }
            for (slot, (old, new)) in before.iter().zip(&self.world.vehicles).enumerate() {
                let ahead = new.start_s[lane] - old.start_s[lane];
                let faster = new.start_speed[lane] - old.start_speed[lane];
                self.state.displace_vehicle(slot, lane, ahead, faster);
            }
        }
        update_slip_reach(&mut self.state, &self.world);
    }

    /// Let the ego do as ordered at a decision, and everything move until the next one.
    pub(crate) fn go_on(
        &mut self,
        first: u32,
        inputs: &Inputs<'_>,
        script: Option<&ActionLog<'_>>,
        mind: DriverContext<'_, S>,
        minds: &mut DecisionContext<S, N>,
    ) {
        let (stride, steps) = self.step_length(inputs);
        let orders = script.map(|one| one.action_at(self.world.simd, &self.simulations, 0));
        let (state, world, pairs) = (&mut self.state, &self.world, &mut self.pairs);
        drive_ego(
            state,
            world,
            mind,
            &mut self.recorder,
            pairs,
            first,
            orders.as_ref(),
        );
        let wheel = orders.as_ref().and_then(EgoAction::wheel_angle);
        for step in (first..first + SUBSTEPS).step_by(steps as usize) {
            let before = &mut minds.step_start;
            advance(state, world, pairs, before, step, &stride, wheel);
        }
    }

    /// A step, and how many of 10 ms that is: frames at other times than decisions want a state at each.
    fn step_length(&self, inputs: &Inputs<'_>) -> (StepLength, u32) {
        let rates = &self.world.derived;
        if inputs.steps_per_frame.is_multiple_of(SUBSTEPS) {
            (rates.coarse, SUBSTEPS)
        } else {
            (rates.fine, 1)
        }
    }

    /// Finish the simulations that have ended before `step`; whether others still run.
    pub(crate) fn finish_ended(&mut self, step: u32) -> bool {
        for lane in 0..SIMD_LANES {
            if self.state.end_step[lane] < step as f32 {
                let (simd, state, world) = (self.world.simd, &self.state, &self.world);
                with_cpu_features!(simd, self.recorder.finish(lane, state, world));
            }
        }
        self.world.num_slots_in_use = slots_in_use(&self.world, &self.recorder);
        self.num_running() > 0
    }

    /// Free the lanes of simulations of which nothing is recorded; where their results would have gone.
    pub(crate) fn release(
        &mut self,
        is_over: impl Fn(&Self, usize) -> bool,
    ) -> Vec<(usize, Output<'a>)> {
        let mut freed = Vec::new();
        for lane in 0..SIMD_LANES {
            if self.recorder.is_busy(lane) && is_over(self, lane) {
                let out = self.recorder.release(lane);
                freed.extend(out.map(|out| (self.simulations[lane], out)));
            }
        }
        if !freed.is_empty() {
            self.world.num_slots_in_use = slots_in_use(&self.world, &self.recorder);
        }
        freed
    }

    /// How many simulations it holds.
    pub(crate) fn num_running(&self) -> usize {
        (0..SIMD_LANES)
            .filter(|lane| self.recorder.is_busy(*lane))
            .count()
    }

    /// A lane that is free.
    fn free_lane(&self) -> Option<usize> {
        (0..SIMD_LANES).find(|lane| !self.recorder.is_busy(*lane))
    }

    /// Take over the simulation in lane `other` of another block that has come as far.
    fn seat(&mut self, lane: usize, from: &mut Self, other: usize) {
        self.world.copy_lane(lane, &from.world, other);
        self.state.copy_lane(lane, &from.state, other);
        self.recorder.seat(lane, &mut from.recorder, other);
        self.simulations[lane] = from.simulations[other];
        self.world.num_slots_in_use = slots_in_use(&self.world, &self.recorder);
    }
}

/// Slots up to the last one that a running simulation uses.
fn slots_in_use<S: Simd, const N: usize>(
    params: &Params<'_, S, N>,
    recorder: &Recorder<'_, N>,
) -> usize {
    let is_used = |slot: &usize| {
        (0..SIMD_LANES)
            .any(|lane| recorder.is_busy(lane) && params.vehicles[*slot].valid[lane] > 0.0)
    };
    (0..N).rev().find(is_used).map_or(1, |last| last + 1)
}

/// Move simulations together where that frees whole blocks, and hand these over.
pub(crate) fn merge<'a, S: Simd, const N: usize>(
    blocks: &mut Vec<Box<Block<'a, S, N>>>,
) -> Vec<Box<Block<'a, S, N>>> {
    let running: usize = blocks.iter().map(|block| block.num_running()).sum();
    let needed = running.div_ceil(SIMD_LANES);
    if needed == blocks.len() {
        return Vec::new();
    }
    // The fullest stay.
    blocks.sort_by_key(|block| std::cmp::Reverse(block.num_running()));
    let mut leaving = blocks.split_off(needed);
    for from in &mut leaving {
        for other in 0..SIMD_LANES {
            if !from.recorder.is_busy(other) {
                continue;
            }
            let free = blocks
                .iter_mut()
                .find_map(|block| block.free_lane().map(|lane| (block, lane)));
            if let Some((block, lane)) = free {
                block.seat(lane, from, other);
            }
        }
    }
    leaving
}

/// The parameters of the simulations of a block.
#[inline(always)]
pub(crate) fn load<S: Simd, const N: usize>(
    simd: S,
    vehicle: &[f32],
    simulation: &[f32],
    inputs: &Inputs<'_>,
    simulations: &[usize; SIMD_LANES],
) -> ([VehicleParams<S>; N], SimulationParams<S>) {
    let batch = inputs.scenario_index.len();
    let slots = inputs.num_slots;
    let row = |values: &[f32], row: usize| {
        let values = &values[row * batch..(row + 1) * batch];
        simulations.map(|simulation| values[simulation])
    };
    let p = core::array::from_fn(|slot| {
        if slot < slots {
            VehicleParams::load(simd, |field| row(vehicle, field * slots + slot))
        } else {
            VehicleParams::load(simd, |_| [0.0; SIMD_LANES])
        }
    });
    (
        p,
        SimulationParams::load(simd, |field| row(simulation, field)),
    )
}

/// Whether the road of any simulation is a ring.
fn has_ring<S: Simd>(simulation: &SimulationParams<S>) -> bool {
    (0..SIMD_LANES).any(|lane| simulation.ring_length[lane] != 0.0)
}

fn runs<S: Simd, const N: usize>(state: &State<'_, S, N>, simd: S, step: u32) -> bool {
    with_cpu_features!(
        simd,
        splat(simd, step as f32).simd_le(state.end_step).any_true()
    )
}
