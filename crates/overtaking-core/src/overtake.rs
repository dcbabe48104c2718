//! Overtaking as a state machine, of the ego and on two-way roads of everybody; see `overtaking.sim.reference.overtake`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::DriverContext;
use crate::ego_action::{self, EgoAction};
use crate::gap_acceptance::Intent;
use crate::gap_acceptance::form_intent;
use crate::lane_change::start_lane_changes;
use crate::math::vectors::{F32, assign_where, at_least, max, min, select, splat};
use crate::neighbour_search::Neighbours;
use crate::params::Params;
use crate::pass_continuation::PassContinuation;
use crate::perception::Beliefs;
use crate::recorder::Recorder;
use crate::state::{EGO_SLOT, LEADER, RIGHT_LEADER, State, stage};
use crate::vehicle_handle::VehicleHandle;

/// A decision of the egos of a block.
pub struct EgoDecision<'a, S: Simd> {
    /// Step of 10 ms at which it is made.
    pub step: u32,
    /// Actions of an external driver; `None` if the model decides.
    pub action: Option<&'a EgoAction<S>>,
}

/// Let the ego of every simulation decide, or carry out the action of an external driver.
///
/// What the ego intends holds until it checks its mirrors again.
#[inline(always)]
pub fn decide_ego<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &DriverContext<S>,
    recorder: &mut Recorder<'_, N>,
    decision: &EgoDecision<'_, S>,
) {
    // No closure: it would be compiled as a function of its own, without the SIMD features.
    let continuation = if params.road.directions.has_oncoming_traffic {
        // Also with an external driver: the model controls the pedals that the action does not set.
        Some(update_pass_continuation(state, params, EGO_SLOT, context))
    } else {
        None
    };
    let intent = match decision.action {
        None => form_intent(state, params, EGO_SLOT, context, continuation.as_ref()),
        Some(action) => ego_action::intent_from_action(state, params, action),
    };
    count_waiting_time(state, params, EGO_SLOT, &context.beliefs);
    recorder.record_manoeuvres(state, params, context, &intent, decision.step);

    // Compute the stage before the ego moves over, and store it last: the calls in between read the old stage.
    let stage = state
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
    set_end_step(state, params, &intent, stage, decision.step);
    set_stage(state, params, EGO_SLOT, stage);
}

/// Let the driver of vehicle `slot`, not the ego, decide on a two-way road. After an overtake it may overtake again.
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
    let next = state
        .vehicle(params, slot)
        .next_stage(&context.neighbours, &intent);
    carry_out_intent(state, params, slot, context, &intent);
    let is_done = next.simd_eq(stage::DONE);
    assign_where(
        &mut state.overtake.time_waiting[slot],
        is_done,
        splat(params.simd, 0.0),
    );
    let next = select(is_done, splat(params.simd, stage::FOLLOW), next);
    set_stage(state, params, slot, next);
}

/// Decide how driver `slot` goes on with its pass, and remember whether it aborts or returns urgently.
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

/// Go on to the next stage, or stay.
#[inline(always)]
fn set_stage<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    next: F32<S>,
) {
    let changed = next.simd_ne(state.overtake.stage[slot]);
    assign_where(
        &mut state.overtake.time_in_stage[slot],
        changed,
        splat(params.simd, 0.0),
    );
    state.overtake.stage[slot] = next;
}

/// Count the time behind a slower leader.
#[inline(always)]
fn count_waiting_time<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    believed: &Beliefs<S>,
) {
    let speed = state.motion.vx[slot];
    let queues = believed.gap[LEADER].simd_lt(params.constants.waiting_time_gap * speed);
    let waits = state.vehicle(params, slot).is_in_stage(stage::FOLLOW)
        & believed.is_detected[LEADER]
        & queues
        & state
            .vehicle(params, slot)
            .desired_speed()
            .simd_gt(speed - believed.closing_speed[LEADER]);
    let longer = state.overtake.time_waiting[slot] + params.constants.decision;
    assign_where(&mut state.overtake.time_waiting[slot], waits, longer);
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    #[inline(always)]
    fn next_stage(self, near: &Neighbours<S>, intent: &Intent<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let centre = 0.5 * (near.lane_right_edge + near.lane_left_edge);
        let settled = (state.motion.d[slot] - centre)
            .abs()
            .simd_lt(params.constants.settled_offset);
        let finished = intent.has_finished_lane_change & settled;
        let [pull_out, pass, back, done, abort, follow] = [
            stage::PULL_OUT,
            stage::PASS,
            stage::RETURN,
            stage::DONE,
            stage::ABORT,
            stage::FOLLOW,
        ];
        let next = select(
            intent.starts_pull_out,
            splat(params.simd, pull_out),
            state.overtake.stage[slot],
        );
        let next = select(
            self.is_in_stage(pull_out) & intent.has_finished_lane_change,
            splat(params.simd, pass),
            next,
        );
        let next = select(intent.cancels_pull_out, splat(params.simd, abort), next);
        let returning = select(
            intent.has_passed_target,
            splat(params.simd, back),
            splat(params.simd, abort),
        );
        let returns = intent.starts_return & self.is_in_stage(pass);
        let next = select(returns, returning, next);
        let next = select(
            self.is_in_stage(back) & finished,
            splat(params.simd, done),
            next,
        );
        let next = select(
            self.is_in_stage(abort) & finished,
            splat(params.simd, follow),
            next,
        );
        select(intent.cancels_return, splat(params.simd, pass), next)
    }
}

/// Move over and show it.
#[inline(always)]
fn carry_out_intent<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    context: &DriverContext<S>,
    intent: &Intent<S>,
) {
    let (constants, zero) = (&params.constants, splat(params.simd, 0.0));
    let (faster, slower) = (
        intent.starts_pull_out | intent.cancels_return,
        intent.starts_return | intent.cancels_pull_out,
    );
    assign_where(
        &mut state.overtake.target_slot[slot],
        intent.starts_pull_out,
        context.neighbours.slot[LEADER],
    );
    if params.road.directions.has_oncoming_traffic {
        let beside = state.vehicle(params, slot).overtakes_next_vehicle(context);
        assign_where(
            &mut state.overtake.target_slot[slot],
            beside,
            context.neighbours.slot[RIGHT_LEADER],
        );
    }
    let broken_off = intent.cancels_pull_out | intent.cancels_return;
    let sides = (faster, slower, broken_off);
    let hasty = if params.road.directions.has_oncoming_traffic {
        let hurried = state.overtake.must_return_urgently[slot].simd_gt(0.0)
            | state.overtake.must_abort[slot].simd_gt(0.0);
        let turned =
            constants.min_change_distance / at_least(state.motion.vx[slot], constants.slip_speed);
        Some(select(
            hurried,
            max(params.simulations.urgent_change_duration, turned),
            zero,
        ))
    } else {
        None
    };
    start_lane_changes(
        state,
        params,
        slot,
        sides,
        &context.beliefs,
        hasty,
        context.decision_index,
    );
    let moved = faster | slower;
    let kept = select(
        state.overtake.time_indicating[slot].simd_gt(0.0),
        state.controls.indicator[slot],
        zero,
    );
    let used = params.vehicles[slot].uses_indicator;
    let shown = select(
        intent.wants_to_pull_out,
        used,
        select(intent.wants_to_return, -used, kept),
    );
    assign_where(
        &mut state.controls.indicator[slot],
        intent.has_finished_lane_change & !moved,
        shown,
    );
    assign_where(&mut state.overtake.time_indicating[slot], moved, zero);
}

/// End the simulation some time after the overtake, or at the deadline if the ego follows then.
#[inline(always)]
fn set_end_step<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    intent: &Intent<S>,
    next: F32<S>,
    step: u32,
) {
    let constants = &params.constants;
    let now = splat(params.simd, step as f32);
    let over = next.simd_eq(stage::DONE) & state.overtake.stage[EGO_SLOT].simd_ne(stage::DONE);
    let after = now + (constants.after_overtake / constants.step).round_ties_even();
    let sooner = min(state.end_step, after);
    assign_where(&mut state.end_step, over, sooner);
    let idle = state.vehicle(params, EGO_SLOT).is_in_stage(stage::FOLLOW)
        & !intent.wants_to_pull_out
        & now.simd_ge(params.simulations.deadline_step);
    let sooner = min(state.end_step, now);
    assign_where(&mut state.end_step, idle, sooner);
}
