//! Overtaking as a state machine, of the ego and on two-way roads of everybody; see `overtaking.sim.reference.overtake`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::DriverContext;
use crate::ego_action::{self, EgoAction};
use crate::gap_acceptance::form_intent;
use crate::gap_acceptance::{Intent, is_in_stage};
use crate::lane_change::start_lane_changes;
use crate::math::vectors::{F32, assign_where, at_least, max, min, select, splat};
use crate::neighbour_search::Neighbours;
use crate::params::{Params, SUBSTEPS};
use crate::pass_continuation::{
    PassContinuation, decide_pass_continuation, overtakes_next_vehicle,
};
use crate::perception::Beliefs;
use crate::recorder::{ManoeuvreKind, Recorder};
use crate::state::{
    EGO_SLOT, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER, State, stage,
};

/// One decision of every ego of the block; what it intends holds until it looks around again.
#[inline(always)]
pub fn decide_ego<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    mind: DriverContext<'_, S>,
    recorder: &mut Recorder<'_, N>,
    step: u32,
    orders: Option<&EgoAction<S>>,
) {
    let (near, believed) = (mind.neighbours, mind.beliefs);
    let two_way = params.road.directions.has_oncoming_traffic;
    // Oncoming traffic changes the pedals and the haste of the ego, also under another driver.
    let plight = if two_way {
        Some(update_pass_continuation(state, params, &mind, EGO_SLOT))
    } else {
        None
    };
    let intent = match orders {
        None => form_intent(state, params, &mind, EGO_SLOT, plight.as_ref()),
        Some(orders) => ego_action::intent_from_action(state, params, orders),
    };
    count_waiting_time(state, params, EGO_SLOT, believed);
    let oncoming = two_way.then_some(&mind.oncoming.nearest);
    let (out, back) = (
        [LEADER, LEFT_LEADER, LEFT_FOLLOWER],
        [LEADER, RIGHT_LEADER, RIGHT_FOLLOWER],
    );
    recorder.record_percepts(
        state,
        params,
        near,
        believed,
        intent.starts_pull_out,
        ManoeuvreKind::PullOut,
        out,
        step,
        oncoming,
    );
    recorder.record_percepts(
        state,
        params,
        near,
        believed,
        intent.cancels_pull_out,
        ManoeuvreKind::Cancel,
        back,
        step,
        None,
    );
    recorder.record_percepts(
        state,
        params,
        near,
        believed,
        intent.cancels_return,
        ManoeuvreKind::Cancel,
        out,
        step,
        None,
    );
    recorder.record_percepts(
        state,
        params,
        near,
        believed,
        intent.starts_return,
        ManoeuvreKind::Return,
        back,
        step,
        None,
    );
    let next = next_stage(state, params, near, EGO_SLOT, &intent);
    carry_out_intent(state, params, &mind, EGO_SLOT, &intent, step / SUBSTEPS);
    assign_where(
        &mut state.has_attempted,
        intent.starts_pull_out,
        splat(params.simd, 1.0),
    );
    if let Some(orders) = orders {
        ego_action::set_requested_indicator(state, orders);
    }
    set_end_step(state, params, &intent, next, step);
    set_stage(state, params, EGO_SLOT, next);
}

/// One decision of vehicle `i`, not the ego, on a two-way road; who has overtaken may do so again.
#[inline(always)]
pub fn decide_other<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    mind: DriverContext<'_, S>,
    i: usize,
    step: u32,
) {
    let settled = state.overtake.stage[i].simd_eq(stage::FOLLOW)
        & state.overtake.time_indicating[i].simd_eq(0.0);
    let still = settled
        & state.lane_choice.wanted_side[i].simd_eq(0.0)
        & state.controls.indicator[i].simd_eq(0.0);
    if (still & !mind.checks_mirrors).all_true() {
        count_waiting_time(state, params, i, mind.beliefs);
        return; // A driver begins no manoeuvre without a look around.
    }
    let plight = update_pass_continuation(state, params, &mind, i);
    let intent = form_intent(state, params, &mind, i, Some(&plight));
    count_waiting_time(state, params, i, mind.beliefs);
    let next = next_stage(state, params, mind.neighbours, i, &intent);
    carry_out_intent(state, params, &mind, i, &intent, step / SUBSTEPS);
    let done = next.simd_eq(stage::DONE);
    assign_where(
        &mut state.overtake.time_waiting[i],
        done,
        splat(params.simd, 0.0),
    );
    set_stage(
        state,
        params,
        i,
        select(done, splat(params.simd, stage::FOLLOW), next),
    );
}

/// How driver `i` stands to oncoming traffic, remembered.
#[inline(always)]
fn update_pass_continuation<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    mind: &DriverContext<'_, S>,
    i: usize,
) -> PassContinuation<S> {
    let plight = decide_pass_continuation(state, params, i, mind);
    let (one, zero) = (splat(params.simd, 1.0), splat(params.simd, 0.0));
    state.overtake.must_abort[i] = select(plight.must_abort, one, zero);
    state.overtake.must_return_urgently[i] = select(plight.must_return_urgently, one, zero);
    plight
}

/// Go on to the next stage, or stay.
#[inline(always)]
fn set_stage<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    next: F32<S>,
) {
    let changed = next.simd_ne(state.overtake.stage[i]);
    assign_where(
        &mut state.overtake.time_in_stage[i],
        changed,
        splat(params.simd, 0.0),
    );
    state.overtake.stage[i] = next;
}

/// Count the time behind a slower leader.
#[inline(always)]
fn count_waiting_time<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    believed: &Beliefs<S>,
) {
    let speed = state.motion.vx[i];
    let queues = believed.gap[LEADER].simd_lt(params.constants.waiting_time_gap * speed);
    let waits = is_in_stage(state, i, stage::FOLLOW)
        & believed.is_detected[LEADER]
        & queues
        & state
            .desired_speed(params, i)
            .simd_gt(speed - believed.closing_speed[LEADER]);
    let longer = state.overtake.time_waiting[i] + params.constants.decision;
    assign_where(&mut state.overtake.time_waiting[i], waits, longer);
}

#[inline(always)]
fn next_stage<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    near: &Neighbours<S>,
    i: usize,
    intent: &Intent<S>,
) -> F32<S> {
    let centre = 0.5 * (near.lane_right_edge + near.lane_left_edge);
    let settled = (state.motion.d[i] - centre)
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
        state.overtake.stage[i],
    );
    let next = select(
        is_in_stage(state, i, pull_out) & intent.has_finished_lane_change,
        splat(params.simd, pass),
        next,
    );
    let next = select(intent.cancels_pull_out, splat(params.simd, abort), next);
    let returning = select(
        intent.has_passed_target,
        splat(params.simd, back),
        splat(params.simd, abort),
    );
    let returns = intent.starts_return & is_in_stage(state, i, pass);
    let next = select(returns, returning, next);
    let next = select(
        is_in_stage(state, i, back) & finished,
        splat(params.simd, done),
        next,
    );
    let next = select(
        is_in_stage(state, i, abort) & finished,
        splat(params.simd, follow),
        next,
    );
    select(intent.cancels_return, splat(params.simd, pass), next)
}

/// Move over and show it.
#[inline(always)]
fn carry_out_intent<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    mind: &DriverContext<'_, S>,
    i: usize,
    intent: &Intent<S>,
    decision: u32,
) {
    let (constants, zero) = (&params.constants, splat(params.simd, 0.0));
    let (faster, slower) = (
        intent.starts_pull_out | intent.cancels_return,
        intent.starts_return | intent.cancels_pull_out,
    );
    assign_where(
        &mut state.overtake.target_slot[i],
        intent.starts_pull_out,
        mind.neighbours.slot[LEADER],
    );
    if params.road.directions.has_oncoming_traffic {
        let beside = overtakes_next_vehicle(state, params, i, mind);
        assign_where(
            &mut state.overtake.target_slot[i],
            beside,
            mind.neighbours.slot[RIGHT_LEADER],
        );
    }
    let broken_off = intent.cancels_pull_out | intent.cancels_return;
    let sides = (faster, slower, broken_off);
    let hasty = if params.road.directions.has_oncoming_traffic {
        let hurried = state.overtake.must_return_urgently[i].simd_gt(0.0)
            | state.overtake.must_abort[i].simd_gt(0.0);
        let turned =
            constants.min_change_distance / at_least(state.motion.vx[i], constants.slip_speed);
        Some(select(
            hurried,
            max(params.simulations.urgent_change_duration, turned),
            zero,
        ))
    } else {
        None
    };
    start_lane_changes(state, params, i, sides, mind.beliefs, hasty, decision);
    let moved = faster | slower;
    let kept = select(
        state.overtake.time_indicating[i].simd_gt(0.0),
        state.controls.indicator[i],
        zero,
    );
    let used = params.vehicles[i].uses_indicator;
    let shown = select(
        intent.wants_to_pull_out,
        used,
        select(intent.wants_to_return, -used, kept),
    );
    assign_where(
        &mut state.controls.indicator[i],
        intent.has_finished_lane_change & !moved,
        shown,
    );
    assign_where(&mut state.overtake.time_indicating[i], moved, zero);
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
    let idle = is_in_stage(state, EGO_SLOT, stage::FOLLOW)
        & !intent.wants_to_pull_out
        & now.simd_ge(params.simulations.deadline_step);
    let sooner = min(state.end_step, now);
    assign_where(&mut state.end_step, idle, sooner);
}
