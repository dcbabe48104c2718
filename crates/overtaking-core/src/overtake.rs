//! Overtaking as a state machine: follow, pull out, pass, return, or abort; the twin of
//! `overtaking.sim.reference.overtake`.
//!
//! On one-way roads only the ego, the vehicle under study, goes through its stages, on two-way roads every driver. The
//! target is the vehicle that a driver overtakes. All functions run at a decision, every 0.05 s
//! (`constants.decision`).
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen; a slot is the number of a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::DriverContext;
use crate::ego_action::{self, EgoAction};
use crate::gap_acceptance::Intent;
use crate::gap_acceptance::form_intent;
use crate::lane_change::{LaneMoves, start_lane_changes};
use crate::math::vectors::{F32, Mask, assign_where, at_least, max, min, select, splat};
use crate::neighbour_search::Neighbours;
use crate::params::Params;
use crate::pass_continuation::PassContinuation;
use crate::perception::Beliefs;
use crate::recorder::Recorder;
use crate::state::{EGO_SLOT, LEADER, RIGHT_LEADER, State, stage};
use crate::vehicle_handle::VehicleHandle;

/// A decision of the egos of a block.
pub struct EgoDecision<'a, S: Simd> {
    /// Index of the integration step of 10 ms.
    pub step: u32,
    /// Actions of an external driver; `None` if the model decides.
    pub action: Option<&'a EgoAction<S>>,
}

/// Let the ego of every simulation decide, or carry out the action of an external driver.
#[inline(always)]
pub fn decide_ego<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &DriverContext<S>,
    recorder: Option<&mut Recorder<'_, N>>,
    decision: &EgoDecision<'_, S>,
) {
    // Not `then` with a closure: it would be compiled as a function of its own, without the SIMD features.
    let continuation = if params.road.directions.has_oncoming_traffic {
        // The state of the pass is also updated for an external driver: where its action leaves the pedals to the
        // model, the model brakes to abort and accelerates to return urgently.
        Some(update_pass_continuation(state, params, EGO_SLOT, context))
    } else {
        None
    };
    let intent = match decision.action {
        None => form_intent(state, params, EGO_SLOT, context, continuation.as_ref()),
        Some(action) => ego_action::intent_from_action(state, params, action),
    };
    count_waiting_time(state, params, EGO_SLOT, &context.beliefs);
    if let Some(recorder) = recorder {
        recorder.record_manoeuvres(state, params, context, &intent, decision.step);
    }

    // The next stage is stored last, because the functions called before that read the present one.
    let next_stage = state
        .vehicle(params, EGO_SLOT)
        .next_stage(&context.neighbours, &intent);
    carry_out_intent(state, params, EGO_SLOT, context, &intent);
    assign_where(
        &mut state.has_attempted,
        intent.starts_pull_out,
        splat(params.simd, 1.0),
    );
    if let Some(action) = decision.action {
        ego_action::set_requested_indicator(state, action);
    }
    set_end_step(state, params, &intent, next_stage, decision.step);
    set_stage(state, params, EGO_SLOT, next_stage);
}

/// Let the driver in `slot`, not the ego, decide on a two-way road; it may overtake several times.
#[inline(always)]
pub fn decide_other<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    context: &DriverContext<S>,
) {
    let has_no_plan = state.overtake.stage[slot].simd_eq(stage::FOLLOW)
        & state.overtake.time_indicating[slot].simd_eq(0.0)
        & state.lane_choice.wanted_side[slot].simd_eq(0.0)
        & state.controls.indicator[slot].simd_eq(0.0);
    if (has_no_plan & !context.checks_mirrors).all_true() {
        count_waiting_time(state, params, slot, &context.beliefs);
        return; // A driver begins no manoeuvre without checking its mirrors.
    }
    let continuation = update_pass_continuation(state, params, slot, context);
    let intent = form_intent(state, params, slot, context, Some(&continuation));
    count_waiting_time(state, params, slot, &context.beliefs);
    let next_stage = state
        .vehicle(params, slot)
        .next_stage(&context.neighbours, &intent);
    carry_out_intent(state, params, slot, context, &intent);
    // After an overtake the driver follows again, and its waiting time starts at 0. The ego stays `DONE`: a simulation
    // has one completed overtake at most.
    let is_done = next_stage.simd_eq(stage::DONE);
    assign_where(
        &mut state.overtake.time_waiting[slot],
        is_done,
        splat(params.simd, 0.0),
    );
    let next_stage = select(is_done, splat(params.simd, stage::FOLLOW), next_stage);
    set_stage(state, params, slot, next_stage);
}

/// Decide whether the driver in `slot` completes or aborts its pass, and store it.
#[inline(always)]
fn update_pass_continuation<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    context: &DriverContext<S>,
) -> PassContinuation<S> {
    let continuation = state
        .vehicle(params, slot)
        .decide_pass_continuation(context);
    let (one, zero) = (splat(params.simd, 1.0), splat(params.simd, 0.0));
    state.overtake.must_abort[slot] = select(continuation.must_abort, one, zero);
    state.overtake.must_return_urgently[slot] =
        select(continuation.must_return_urgently, one, zero);
    continuation
}

/// Store the stage, and set the time in it to 0 where it is new.
#[inline(always)]
fn set_stage<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    stage: F32<S>,
) {
    let is_new = stage.simd_ne(state.overtake.stage[slot]);
    assign_where(
        &mut state.overtake.time_in_stage[slot],
        is_new,
        splat(params.simd, 0.0),
    );
    state.overtake.stage[slot] = stage;
}

/// Count the time that the driver in `slot` spends close behind a leader slower than it wants to drive.
#[inline(always)]
fn count_waiting_time<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    beliefs: &Beliefs<S>,
) {
    let (driver, speed) = (state.vehicle(params, slot), state.motion.vx[slot]);
    let is_close = beliefs.gap[LEADER].simd_lt(params.constants.waiting_time_gap * speed);
    let leader_speed = speed - beliefs.closing_speed[LEADER];
    let waits = driver.is_in_stage(stage::FOLLOW)
        & beliefs.is_detected[LEADER]
        & is_close
        & driver.desired_speed().simd_gt(leader_speed);
    let longer_time = state.overtake.time_waiting[slot] + params.constants.decision;
    assign_where(&mut state.overtake.time_waiting[slot], waits, longer_time);
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Stage after this decision.
    ///
    /// Of the rules below, in the order of an overtake, the last that applies wins: a driver that aborts at the end of
    /// its pull-out goes to `ABORT`, not to `PASS`.
    #[inline(always)]
    fn next_stage(self, neighbours: &Neighbours<S>, intent: &Intent<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let stage_of = |stage: f32| splat(params.simd, stage);
        let centre = 0.5 * (neighbours.lane_right_edge + neighbours.lane_left_edge);
        let is_near_centre = (state.motion.d[slot] - centre)
            .abs()
            .simd_lt(params.constants.settled_offset);
        // `has_finished_lane_change` is true at every decision at which no lane change is under way.
        let is_back_in_lane = intent.has_finished_lane_change & is_near_centre;
        let has_pulled_out = self.is_in_stage(stage::PULL_OUT) & intent.has_finished_lane_change;
        // A return ahead of the target completes the overtake, a return behind it aborts it. An external driver may
        // also change to the right while it follows, which is no return.
        let stage_of_return = select(
            intent.has_passed_target,
            stage_of(stage::RETURN),
            stage_of(stage::ABORT),
        );
        let mut stage = state.overtake.stage[slot];
        for (applies, next_stage) in [
            (intent.starts_pull_out, stage_of(stage::PULL_OUT)),
            (has_pulled_out, stage_of(stage::PASS)),
            (intent.cancels_pull_out, stage_of(stage::ABORT)),
            (
                intent.starts_return & self.is_in_stage(stage::PASS),
                stage_of_return,
            ),
            (
                self.is_in_stage(stage::RETURN) & is_back_in_lane,
                stage_of(stage::DONE),
            ),
            (
                self.is_in_stage(stage::ABORT) & is_back_in_lane,
                stage_of(stage::FOLLOW),
            ),
            (intent.cancels_return, stage_of(stage::PASS)),
        ] {
            stage = select(applies, next_stage, stage);
        }
        stage
    }

    /// Duration of an urgent lane change, 0 for a driver without urgency [s].
    ///
    /// At low speed the turning circle limits it: on a turning circle of 11 m a vehicle needs 8 m of road to move over
    /// by a lane of 3.5 m. Drivers take twice that, `min_change_distance`, because wheels take time to turn. In shorter
    /// lane changes, vehicles that had slowed to 9 km/h swung across their lane and left the road.
    #[inline(always)]
    fn urgent_change_duration(self) -> F32<S> {
        let (overtake, params, slot) = (&self.state.overtake, self.params, self.slot);
        let constants = &params.constants;
        let is_urgent = overtake.must_return_urgently[slot].simd_gt(0.0)
            | overtake.must_abort[slot].simd_gt(0.0);
        // `slip_speed`, 3 m/s, is the least speed by which the model divides.
        let speed = at_least(self.state.motion.vx[slot], constants.slip_speed);
        let min_duration = constants.min_change_distance / speed;
        let duration = max(params.simulations.urgent_change_duration, min_duration);
        select(is_urgent, duration, splat(params.simd, 0.0))
    }
}

/// Start the intended lane changes of the driver in `slot`, with their indicator, and store the target.
#[inline(always)]
fn carry_out_intent<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    context: &DriverContext<S>,
    intent: &Intent<S>,
) {
    let neighbour_slot = &context.neighbours.slot;
    let target_slot = &mut state.overtake.target_slot[slot];
    assign_where(target_slot, intent.starts_pull_out, neighbour_slot[LEADER]);
    // Not `then` with a closure: it would be compiled as a function of its own, without the SIMD features.
    let urgent_duration = if params.road.directions.has_oncoming_traffic {
        // A driver that has passed its target and goes on past the next vehicle in the right lane takes that one as its
        // target.
        let passes_next = state.vehicle(params, slot).overtakes_next_vehicle(context);
        let target_slot = &mut state.overtake.target_slot[slot];
        assign_where(target_slot, passes_next, neighbour_slot[RIGHT_LEADER]);
        Some(state.vehicle(params, slot).urgent_change_duration())
    } else {
        None
    };
    let moves = LaneMoves {
        to_left: intent.starts_pull_out | intent.cancels_return,
        to_right: intent.starts_return | intent.cancels_pull_out,
        is_cancelled: intent.cancels_pull_out | intent.cancels_return,
        urgent_duration,
    };
    start_lane_changes(state, params, slot, context, &moves);
    set_indicator(state, params, slot, intent, moves.to_left | moves.to_right);
}

/// Set the indicator by the driver's intention: 1 left, -1 right, 0 off.
///
/// During a lane change the indicator with which it started stays on.
#[inline(always)]
fn set_indicator<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    intent: &Intent<S>,
    is_moving: Mask<S>,
) {
    let (zero, uses_indicator) = (
        splat(params.simd, 0.0),
        params.vehicles[slot].uses_indicator,
    );
    let controls = &mut state.controls;
    // `store_wanted_side` counts `time_indicating` up while the driver wants a lane change, and down to 0 when it no
    // longer does. Until then the indicator stays on: a short doubt does not switch it off.
    let is_on = state.overtake.time_indicating[slot].simd_gt(0.0);
    let indicator = select(is_on, controls.indicator[slot], zero);
    let indicator = select(intent.wants_to_return, -uses_indicator, indicator);
    let indicator = select(intent.wants_to_pull_out, uses_indicator, indicator);
    let keeps_lane = intent.has_finished_lane_change & !is_moving;
    assign_where(&mut controls.indicator[slot], keeps_lane, indicator);
    // The next lane change will be indicated anew.
    assign_where(&mut state.overtake.time_indicating[slot], is_moving, zero);
}

/// End the simulation some time after the overtake, or at the deadline without one under way.
///
/// An attempt that was aborted before the deadline does not delay the end. An ego that indicates a pull-out at the
/// deadline goes on with its attempt.
#[inline(always)]
fn set_end_step<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    intent: &Intent<S>,
    next_stage: F32<S>,
    step: u32,
) {
    let (constants, this_step) = (&params.constants, splat(params.simd, step as f32));
    let is_completed =
        next_stage.simd_eq(stage::DONE) & state.overtake.stage[EGO_SLOT].simd_ne(stage::DONE);
    let last_step = this_step + (constants.after_overtake / constants.step).round_ties_even();
    let end_step = min(state.end_step, last_step);
    assign_where(&mut state.end_step, is_completed, end_step);
    let makes_no_attempt =
        state.vehicle(params, EGO_SLOT).is_in_stage(stage::FOLLOW) & !intent.wants_to_pull_out;
    let is_over = makes_no_attempt & this_step.simd_ge(params.simulations.deadline_step);
    let end_step = min(state.end_step, this_step);
    assign_where(&mut state.end_step, is_over, end_step);
}
