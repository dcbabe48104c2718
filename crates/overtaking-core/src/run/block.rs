//! Blocks of sixteen simulations that advance together.
//!
//! A block computes its simulations in the sixteen lanes of SIMD vectors. A lane whose simulation has ended costs as
//! much as any other, so the blocks of a thread pause together at regular steps. If the simulations that still run fit
//! into fewer blocks, they move to free lanes, and the thread drops the empty blocks. The results of a simulation do
//! not depend on its lane. A lane is never a lane of the road in this file.
//!
//! A *share* is the part of a batch that one thread simulates. A *step* is 10 ms, a *decision* of the drivers comes
//! every `SUBSTEPS` steps, and a *frame* is a recorded state. A *tile* buffers the last sixteen frames. A *slot* is the
//! number of a vehicle in its simulation; the ego, the vehicle under study, is in `EGO_SLOT`.

use std::sync::Arc;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::SLOT_CAPACITIES;
use crate::collisions::Pairs;
use crate::decision_context::{DecisionContext, DriverContext, RoadPositions};
use crate::ego_action::{ActionLog, EgoAction};
use crate::math::vectors::{CopyLane, F32, SIMD_LANES, splat, with_cpu_features};
use crate::names::{SimulationParams, VehicleParams};
use crate::overtake::EgoDecision;
use crate::params::{DerivedConstants, Params, SUBSTEPS, StepLength};
use crate::recorder::Recorder;
use crate::recorder::frame_tiles::{FRAMES_PER_TILE, FrameTile};
use crate::run::engine::{Inputs, ParameterSwitch, SimulationOutput, max_blocks_per_share};
use crate::run::step::{
    IntegrationStep, advance, decide, drive_ego, find_near_pairs, update_slip_reach,
};
use crate::state::{EGO_SLOT, History, State, new_history};

/// Number of tiles between two pauses: 1, 4 or 8 for blocks of 8, 16 or 32 slots.
///
/// A choice: after a pause the caches load the states of all blocks of the share again, which takes longer for larger
/// and for more blocks.
const fn tiles_between_pauses(slots: usize) -> u32 {
    let slots_ratio = slots / SLOT_CAPACITIES[0];
    let blocks_ratio = max_blocks_per_share(slots) / max_blocks_per_share(SLOT_CAPACITIES[0]);
    (slots_ratio * blocks_ratio) as u32
}

/// Buffers that a thread reuses for each of its shares.
#[derive(Default)]
pub struct ThreadMemory<const N: usize> {
    tile: FrameTile<N>,
    /// Memory for the past motion that drivers recall, from blocks that have ended.
    histories: Vec<History<N>>,
}

/// Simulate a share from the first step to the end of its longest simulation.
///
/// It is not inlined, because Rayon divides the shares recursively, and each level of the recursion would reserve stack
/// for all locals of this function.
#[inline(never)]
pub fn run<'a, S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'a>,
    switches: &[ParameterSwitch<'_>],
    share: Vec<SimulationOutput<'a>>,
    memory: &mut ThreadMemory<N>,
) {
    let ThreadMemory { tile, histories } = memory;
    let mut share = share.into_iter();
    let mut blocks = Vec::new();
    while share.len() > 0 {
        let (simulations, outputs): (Vec<_>, Vec<_>) = share.by_ref().take(SIMD_LANES).unzip();
        let recorder = Some(Recorder::new(outputs));
        let history = histories.pop().unwrap_or_else(new_history);
        blocks.push(Block::new(simd, inputs, &simulations, recorder, history));
    }
    let mut context = DecisionContext::new(simd);
    let num_steps = steps_between_pauses(tiles_between_pauses(N), inputs.steps_per_frame);
    let mut step = 0;
    while !blocks.is_empty() {
        let pause_step = step + num_steps;
        for block in &mut blocks {
            block.advance((step, pause_step), inputs, switches, tile, &mut context);
        }
        step = pause_step;
        for block in &mut blocks {
            block.finish_ended(step);
        }
        histories.extend(
            merge(&mut blocks)
                .into_iter()
                .map(|block| block.state.attention.history),
        );
    }
}

/// Number of steps between two pauses: whole decisions, and whole tiles, so that every tile is full at a pause.
fn steps_between_pauses(tiles: u32, steps_per_frame: u32) -> u32 {
    let steps = tiles * FRAMES_PER_TILE as u32 * steps_per_frame;
    if steps.is_multiple_of(SUBSTEPS) {
        steps
    } else {
        steps * SUBSTEPS
    }
}

/// Up to sixteen simulations that advance together.
pub(crate) struct Block<'a, S: Simd, const N: usize> {
    pub(crate) params: Params<S, N>,
    pub(crate) state: State<S, N>,
    /// Records the simulations; `None` if an external driver steps them.
    recorder: Option<Recorder<'a, N>>,
    /// Pairs of vehicles that may collide before the next decision.
    pub(crate) pairs: Pairs<S>,
    /// Angle of the ego's front wheels that an external driver requested at the last decision [rad]; `None` if the
    /// model steers.
    wheel_angle: Option<F32<S>>,
    /// Row in the batch of the simulation in each lane; a free lane repeats the row of another lane.
    pub(crate) simulations: [usize; SIMD_LANES],
    /// Whether each lane has a simulation that runs; the other lanes are free.
    pub(crate) has_simulation: [bool; SIMD_LANES],
}

impl<'a, S: Simd, const N: usize> Block<'a, S, N> {
    /// Make a block of one to sixteen simulations of a batch, in the order of the outputs of `recorder`.
    pub(crate) fn new(
        simd: S,
        inputs: &Inputs<'_>,
        simulations: &[usize],
        recorder: Option<Recorder<'a, N>>,
        history: History<N>,
    ) -> Box<Self> {
        let has_simulation = core::array::from_fn(|lane| lane < simulations.len());
        let simulations = core::array::from_fn(|lane| simulations[lane.min(simulations.len() - 1)]);
        let scenario_index = simulations.map(|simulation| inputs.scenario_index[simulation]);
        let (vehicle_params, simulation_params) = load(
            simd,
            inputs.vehicle,
            inputs.simulation,
            inputs,
            &simulations,
        );
        let mut params = Params {
            simd,
            constants: Arc::clone(&inputs.constants),
            derived: DerivedConstants::from_constants(&inputs.constants),
            road: Arc::clone(&inputs.road),
            vehicles: vehicle_params,
            simulations: simulation_params,
            num_slots_in_use: 1,
            is_ring: has_ring(&simulation_params),
            key: [inputs.seed as u32, (inputs.seed >> 32) as u32],
            scenario_index_low: scenario_index.map(|index| index as u32),
            scenario_index_high: scenario_index.map(|index| (index >> 32) as u32),
        };
        params.num_slots_in_use = slots_in_use(&params, &has_simulation);
        let state = State::at_start(&params, history);
        Box::new(Self {
            params,
            state,
            recorder,
            pairs: Pairs::new(),
            wheel_angle: None,
            simulations,
            has_simulation,
        })
    }

    /// Simulate from `first_step` to `pause_step`, or until all simulations have ended.
    fn advance(
        &mut self,
        (first_step, pause_step): (u32, u32),
        inputs: &Inputs<'_>,
        switches: &[ParameterSwitch<'_>],
        tile: &mut FrameTile<N>,
        context: &mut DecisionContext<S, N>,
    ) {
        let simd = self.params.simd;
        let (step_length, substeps) = self.step_length(inputs.steps_per_frame);
        let mut step = first_step;
        while step < pause_step && any_runs(&self.state, simd, step) {
            for switch in switches.iter().filter(|switch| switch.step == step) {
                self.switch_parameters(inputs, switch);
            }
            let (state, params) = (&mut self.state, &self.params);
            if step.is_multiple_of(SUBSTEPS) {
                let decision_index = (step / SUBSTEPS) as usize;
                let action = inputs
                    .action_log
                    .map(|log| log.action_at(simd, &self.simulations, decision_index));
                self.wheel_angle = action.and_then(|action| action.wheel_angle());
                let ego_decision = EgoDecision {
                    step,
                    action: action.as_ref(),
                };
                let recorder = self.recorder.as_mut();
                decide(state, params, context, recorder, &ego_decision);
                find_near_pairs(state, params, &mut self.pairs);
            }
            if let Some(recorder) = &mut self.recorder
                && step.is_multiple_of(inputs.steps_per_frame)
            {
                // A frame at a decision has lamps and stage after this decision.
                let frame = (step / inputs.steps_per_frame) as usize;
                with_cpu_features!(simd, {
                    let is_running = splat(simd, step as f32).simd_le(state.end_step);
                    recorder.record_frame(state, params, is_running, frame, tile);
                });
            }
            let integration = IntegrationStep {
                index: step,
                length: &step_length,
                wheel_angle: self.wheel_angle,
            };
            let step_start = &mut context.step_start;
            advance(state, params, &self.pairs, step_start, &integration);
            step += substeps;
        }
        if let Some(recorder) = &mut self.recorder {
            with_cpu_features!(simd, recorder.write_tile(&self.params, tile));
        }
    }

    /// Replace the parameters from the present step on, for a branch, a what-if continuation of a simulation.
    ///
    /// Station and speed of each vehicle change by the new `start_s` and `start_speed` minus the earlier ones.
    fn switch_parameters(&mut self, inputs: &Inputs<'_>, switch: &ParameterSwitch<'_>) {
        let (vehicle_params, simulation_params) = load(
            self.params.simd,
            switch.vehicle,
            switch.simulation,
            inputs,
            &self.simulations,
        );
        let old_vehicle_params = std::mem::replace(&mut self.params.vehicles, vehicle_params);
        self.params.simulations = simulation_params;
        self.params.is_ring = has_ring(&simulation_params);
        for (lane, simulation) in self.simulations.into_iter().enumerate() {
            let index = switch.scenario_index[simulation];
            self.params.scenario_index_low[lane] = index as u32;
            self.params.scenario_index_high[lane] = (index >> 32) as u32;
            if let Some(errors) = switch.judgement_errors {
                // All errors of distance come first, then all errors of speed.
                self.state.noise.distance_error[EGO_SLOT][lane] = errors[simulation];
                self.state.noise.speed_error[EGO_SLOT][lane] =
                    errors[switch.scenario_index.len() + simulation];
            }
            for (slot, (old, new)) in old_vehicle_params
                .iter()
                .zip(&self.params.vehicles)
                .enumerate()
            {
                let shift = new.start_s[lane] - old.start_s[lane];
                let speed_change = new.start_speed[lane] - old.start_speed[lane];
                self.state.displace_vehicle(slot, lane, shift, speed_change);
            }
        }
        // `slip_reach` depends on the new parameters, and a step between decisions does not update it.
        update_slip_reach(&mut self.state, &self.params);
    }

    /// Let the ego decide at step `first_step`, after all other drivers, and move all vehicles until the next decision.
    ///
    /// `action_log` has the action of an external driver at this decision, `None` if the model drives the ego. `ego` is
    /// the context of the ego's driver, and `step_start` memory for the positions before an integration step.
    pub(crate) fn advance_to_decision(
        &mut self,
        (first_step, steps_per_frame): (u32, u32),
        action_log: Option<&ActionLog<'_>>,
        ego: &DriverContext<S>,
        step_start: &mut RoadPositions<S, N>,
    ) {
        let (step_length, substeps) = self.step_length(steps_per_frame);
        // The log has one decision only, so its index is 0.
        let action = action_log.map(|log| log.action_at(self.params.simd, &self.simulations, 0));
        let ego_decision = EgoDecision {
            step: first_step,
            action: action.as_ref(),
        };
        let (state, params, pairs) = (&mut self.state, &self.params, &mut self.pairs);
        drive_ego(state, params, ego, self.recorder.as_mut(), &ego_decision);
        find_near_pairs(state, params, pairs);
        for index in (first_step..first_step + SUBSTEPS).step_by(substeps as usize) {
            let integration = IntegrationStep {
                index,
                length: &step_length,
                wheel_angle: action.as_ref().and_then(EgoAction::wheel_angle),
            };
            advance(state, params, pairs, step_start, &integration);
        }
    }

    /// Length of the integration steps, and the number of steps of 10 ms in each.
    ///
    /// The length is 50 ms if every frame coincides with a decision. It is 10 ms otherwise, because frames between
    /// decisions need a state.
    fn step_length(&self, steps_per_frame: u32) -> (StepLength, u32) {
        let derived = &self.params.derived;
        if steps_per_frame.is_multiple_of(SUBSTEPS) {
            (derived.coarse, SUBSTEPS)
        } else {
            (derived.fine, 1)
        }
    }

    /// Finish the recordings of simulations that have ended before `step`, and free their lanes.
    fn finish_ended(&mut self, step: u32) {
        let (simd, state, params) = (self.params.simd, &self.state, &self.params);
        if let Some(recorder) = &mut self.recorder {
            // `finish` does nothing in lanes that were free already.
            for lane in (0..SIMD_LANES).filter(|lane| state.end_step[*lane] < step as f32) {
                with_cpu_features!(simd, recorder.finish(lane, state, params));
            }
        }
        self.free_lanes(|block, lane| block.state.end_step[lane] < step as f32);
    }

    /// Free the lanes whose simulation is over by `is_over`, a function of the block and the lane.
    pub(crate) fn free_lanes(&mut self, is_over: impl Fn(&Self, usize) -> bool) {
        let mut is_freed = false;
        for lane in 0..SIMD_LANES {
            if self.has_simulation[lane] && is_over(self, lane) {
                self.has_simulation[lane] = false;
                is_freed = true;
            }
        }
        if is_freed {
            self.params.num_slots_in_use = slots_in_use(&self.params, &self.has_simulation);
        }
    }

    /// Number of lanes whose simulation runs.
    pub(crate) fn num_running(&self) -> usize {
        self.has_simulation
            .iter()
            .filter(|is_used| **is_used)
            .count()
    }

    /// The first lane without a running simulation.
    fn free_lane(&self) -> Option<usize> {
        (0..SIMD_LANES).find(|lane| !self.has_simulation[*lane])
    }

    /// Move the simulation in lane `source_lane` of another block, which is at the same step, into `lane`.
    fn take_over(&mut self, lane: usize, source: &mut Self, source_lane: usize) {
        self.params.copy_lane(lane, &source.params, source_lane);
        self.state.copy_lane(lane, &source.state, source_lane);
        if let (Some(recorder), Some(source_recorder)) = (&mut self.recorder, &mut source.recorder)
        {
            recorder.take_over(lane, source_recorder, source_lane);
        }
        self.simulations[lane] = source.simulations[source_lane];
        self.has_simulation[lane] = true;
        self.params.num_slots_in_use = slots_in_use(&self.params, &self.has_simulation);
    }
}

/// Number of slots up to the last one that a running simulation uses, at least one.
fn slots_in_use<S: Simd, const N: usize>(
    params: &Params<S, N>,
    has_simulation: &[bool; SIMD_LANES],
) -> usize {
    let is_used = |slot: &usize| {
        (0..SIMD_LANES).any(|lane| has_simulation[lane] && params.vehicles[*slot].valid[lane] > 0.0)
    };
    (0..N).rev().find(is_used).map_or(1, |last| last + 1)
}

/// Move running simulations into as few blocks as possible; returns the blocks that are empty now.
pub(crate) fn merge<'a, S: Simd, const N: usize>(
    blocks: &mut Vec<Box<Block<'a, S, N>>>,
) -> Vec<Box<Block<'a, S, N>>> {
    let running: usize = blocks.iter().map(|block| block.num_running()).sum();
    let needed = running.div_ceil(SIMD_LANES);
    if needed == blocks.len() {
        return Vec::new();
    }
    // The fullest blocks stay, so that as few simulations as possible move.
    blocks.sort_by_key(|block| std::cmp::Reverse(block.num_running()));
    let mut emptied = blocks.split_off(needed);
    for source in &mut emptied {
        for source_lane in 0..SIMD_LANES {
            if !source.has_simulation[source_lane] {
                continue;
            }
            let free = blocks
                .iter_mut()
                .find_map(|block| block.free_lane().map(|lane| (block, lane)));
            if let Some((block, lane)) = free {
                block.take_over(lane, source, source_lane);
            }
        }
    }
    emptied
}

/// Load the parameters of the simulations of a block from the arrays of a batch.
///
/// `vehicle` has shape (field, slot, simulation) and `simulation` (field, simulation), flat. `simulations` has the row
/// in the batch for each lane. Slots that the batch does not have get zeros, also in `valid`, so they hold no vehicle.
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
    let vehicle_params = core::array::from_fn(|slot| {
        if slot < slots {
            VehicleParams::load(simd, |field| row(vehicle, field * slots + slot))
        } else {
            VehicleParams::load(simd, |_| [0.0; SIMD_LANES])
        }
    });
    (
        vehicle_params,
        SimulationParams::load(simd, |field| row(simulation, field)),
    )
}

/// Whether the road of any simulation is a ring.
fn has_ring<S: Simd>(simulation: &SimulationParams<S>) -> bool {
    (0..SIMD_LANES).any(|lane| simulation.ring_length[lane] != 0.0)
}

/// Whether any simulation of a block still runs at `step`.
fn any_runs<S: Simd, const N: usize>(state: &State<S, N>, simd: S, step: u32) -> bool {
    with_cpu_features!(
        simd,
        splat(simd, step as f32).simd_le(state.end_step).any_true()
    )
}
