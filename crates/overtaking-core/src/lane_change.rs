//! Lane changes of everybody but the ego; see `overtaking.sim.reference.lane_change`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{acc_accel, cah_accel, imposed_accel};
use crate::decision_context::DriverContext;
use crate::math::vectors::{F32, Mask, assign_where, at_least, min, select, splat};
use crate::neighbour_search::{VisibleBody, lane_borders, nearest_image};
use crate::params::Params;
use crate::perception::{Beliefs, draw_shoulder_check};
use crate::state::{
    FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER, State,
};
use crate::steering::start_path;

/// Keeps the time until a gap is closed finite [m/s].
const MIN_SPEED: f32 = 0.1;

#[inline(always)]
fn imposed_accel_on_follower<S: Simd, const N: usize>(
    params: &Params<S, N>,
    i: usize,
    speed: F32<S>,
    gap: F32<S>,
    closing: F32<S>,
) -> F32<S> {
    imposed_accel(
        &params.constants,
        &params.vehicles[i],
        speed + closing,
        gap,
        closing,
        params.vehicles[i].time_gap,
    )
}

#[inline(always)]
fn mobil_incentives<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    believed: &Beliefs<S>,
    own: F32<S>,
) -> (F32<S>, F32<S>) {
    let (constants, vehicle, v) = (&params.constants, &params.vehicles[i], state.motion.vx[i]);
    let (gap, closing) = (&believed.gap, &believed.closing_speed);
    let steady = splat(params.simd, 0.0);
    let desired = state.desired_speed(params, i);
    let fast = acc_accel(
        constants,
        vehicle,
        v,
        desired,
        gap[LEFT_LEADER],
        closing[LEFT_LEADER],
        vehicle.time_gap,
        steady,
    );
    let slow = acc_accel(
        constants,
        vehicle,
        v,
        desired,
        gap[RIGHT_LEADER],
        closing[RIGHT_LEADER],
        vehicle.time_gap,
        steady,
    );
    let (fast, slow) = (
        state.limit_accel(params, i, fast),
        state.limit_accel(params, i, slow),
    );
    let no_passing = v.simd_gt(constants.no_passing_right_speed);
    let here = select(no_passing, min(own, fast), own);
    let there = select(no_passing, min(slow, own), slow);
    let body = 2.0 * vehicle.half_length;
    let after = imposed_accel_on_follower(params, i, v, gap[LEFT_FOLLOWER], closing[LEFT_FOLLOWER]);
    let open_gap = gap[LEFT_FOLLOWER] + gap[LEFT_LEADER] + body;
    let before = imposed_accel_on_follower(
        params,
        i,
        v - closing[LEFT_LEADER],
        open_gap,
        closing[LEFT_FOLLOWER] + closing[LEFT_LEADER],
    );
    let relieved_gap = gap[FOLLOWER] + gap[LEADER] + body;
    let now = imposed_accel_on_follower(params, i, v, gap[FOLLOWER], closing[FOLLOWER]);
    let relieved = imposed_accel_on_follower(
        params,
        i,
        v - closing[LEADER],
        relieved_gap,
        closing[FOLLOWER] + closing[LEADER],
    );
    let to_fast = fast - here + vehicle.politeness * (after - before) - vehicle.keep_right_bias;
    let to_slow = there - own + vehicle.politeness * (relieved - now) + vehicle.keep_right_bias;
    (to_fast, to_slow)
}

#[inline(always)]
fn is_safe_lane_change<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    believed: &Beliefs<S>,
    front: usize,
    rear: usize,
) -> Mask<S> {
    let (constants, vehicle, v) = (&params.constants, &params.vehicles[i], state.motion.vx[i]);
    let (gap, closing) = (&believed.gap, &believed.closing_speed);
    let (later, faster) = anticipated_follower(params, gap[rear], closing[rear]);
    let braking = min(
        imposed_accel_on_follower(params, i, v, gap[rear], closing[rear]),
        imposed_accel_on_follower(params, i, v, later, faster),
    );
    let own = imposed_accel(
        constants,
        vehicle,
        v,
        gap[front],
        closing[front],
        vehicle.time_gap,
    );
    let room =
        gap[rear].simd_gt(constants.min_rear_gap) & gap[front].simd_gt(constants.min_rear_gap);
    room & braking.simd_ge(-vehicle.safe_decel) & own.simd_ge(-vehicle.safe_decel)
}

/// Gap to a follower, and how fast it closes, if it speeds up for some seconds.
#[inline(always)]
pub fn anticipated_follower<S: Simd, const N: usize>(
    params: &Params<S, N>,
    gap: F32<S>,
    closing: F32<S>,
) -> (F32<S>, F32<S>) {
    let constants = &params.constants;
    let faster = constants.foresight_accel * constants.foresight;
    (
        gap - constants.foresight * (closing + 0.5 * faster),
        closing + faster,
    )
}

/// Let vehicle `i`, not the ego, change lanes where it pays and is safe, or back in danger.
#[inline(always)]
pub fn change_lanes_by_mobil<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    bodies: &[VisibleBody<S>; N],
    context: &DriverContext<S>,
    own: F32<S>,
) {
    let (believed, looks) = (&context.beliefs, context.checks_mirrors);
    let (constants, vehicle, v) = (&params.constants, &params.vehicles[i], state.motion.vx[i]);
    let (to_fast, to_slow) = mobil_incentives(state, params, i, believed, own);
    let ready = looks
        & state.path.elapsed[i].simd_ge(state.path.duration[i])
        & state.lane_choice.time_since_lane_change[i].simd_ge(constants.cooldown)
        & state.motion.is_wreck[i].simd_eq(0.0)
        & vehicle.valid.simd_gt(0.0);
    let exists_fast = state.lane_choice.lane[i].simd_lt((params.road.num_lanes - 1) as f32);
    let exists_slow = state.lane_choice.lane[i].simd_ge(1.0);
    let fast = ready
        & exists_fast
        & to_fast.simd_gt(vehicle.lane_change_threshold)
        & is_safe_lane_change(state, params, i, believed, LEFT_LEADER, LEFT_FOLLOWER);
    let slow = ready
        & exists_slow
        & to_slow.simd_gt(vehicle.lane_change_threshold)
        & is_safe_lane_change(state, params, i, believed, RIGHT_LEADER, RIGHT_FOLLOWER)
        & believed.gap[RIGHT_LEADER].simd_gt(constants.free_ahead_time * v)
        & !fast;
    let wanted = signed_side(params, fast, slow);
    let shows = looks & state.path.elapsed[i].simd_ge(state.path.duration[i]);
    assign_where(
        &mut state.controls.indicator[i],
        shows,
        wanted * vehicle.uses_indicator,
    );
    let decided = update_wanted_side(state, params, i, wanted, looks);
    let (mut fast, mut slow) = (fast & decided, slow & decided);
    if (fast | slow).any_true() {
        let first = !gives_way(state, params, bodies, i, wanted);
        (fast, slow) = (fast & first, slow & first);
    }
    let (back, to_fast) = cancels_lane_change(state, params, i, believed);
    let back = back & looks;
    let (fast, slow) = (fast | (back & !to_fast), slow | (back & to_fast));
    start_lane_changes(
        state,
        params,
        i,
        (fast, slow, back),
        believed,
        None,
        context.decision_index,
    );
}

/// Whether vehicle `i` lets somebody first who signals for the same place from the other side of it.
#[inline(always)]
pub fn gives_way<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    bodies: &[VisibleBody<S>; N],
    i: usize,
    signed_side: F32<S>,
) -> Mask<S> {
    let reach = params.constants.claim_time * state.motion.vx[i];
    let mut waits = signed_side.simd_ne(signed_side);
    for j in 0..params.num_slots_in_use {
        let other = &bodies[j];
        let ahead = nearest_image(params, state.motion.s[j] - state.motion.s[i]);
        let same = other.claimed_side.simd_eq(-signed_side)
            & other.lane.simd_eq(bodies[i].lane + 2.0 * signed_side)
            & signed_side.simd_ne(0.0);
        let close = ahead.abs().simd_lt(reach);
        let first = ahead.simd_gt(0.0) | (ahead.simd_eq(0.0) & signed_side.simd_lt(0.0));
        waits |= same & close & first;
    }
    waits
}

/// Whether the lane change of vehicle `i` is to the fast side, and a whole one: a retreat has less far to
/// go.
#[inline(always)]
pub fn lane_change_direction<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
) -> (Mask<S>, Mask<S>) {
    let (low, high) = lane_borders(params, state.lane_choice.lane[i], 0.0);
    let way = 0.5 * (low + high) - state.path.coefficients[i][0];
    (way.simd_gt(0.0), way.abs().simd_gt(0.5 * (high - low)))
}

/// Whether vehicle `i` gives up a lane change, as it has turned dangerous; and whether it is to the fast
/// side.
#[inline(always)]
fn cancels_lane_change<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    believed: &Beliefs<S>,
) -> (Mask<S>, Mask<S>) {
    let (constants, vehicle, v) = (&params.constants, &params.vehicles[i], state.motion.vx[i]);
    let (gap, closing) = (&believed.gap, &believed.closing_speed);
    let early = state.path.elapsed[i].simd_lt(constants.abort_until * state.path.duration[i])
        & state.motion.is_wreck[i].simd_eq(0.0)
        & vehicle.valid.simd_gt(0.0);
    if !early.any_true() {
        return (early, early);
    }
    let (to_fast, whole) = lane_change_direction(state, params, i);
    let old = |values: &[F32<S>; 6], slow: usize, fast: usize| {
        select(to_fast, values[slow], values[fast])
    };
    let bad_rear = imposed_accel_on_follower(params, i, v, gap[FOLLOWER], closing[FOLLOWER])
        .simd_lt(-(constants.abort_imposed_factor * vehicle.safe_decel));
    let own = imposed_accel(
        constants,
        vehicle,
        v,
        gap[LEADER],
        closing[LEADER],
        vehicle.time_gap,
    );
    let bad_front = own.simd_lt(-(constants.abort_factor * vehicle.decel));
    let (ahead, nearing) = (
        old(gap, RIGHT_LEADER, LEFT_LEADER),
        old(closing, RIGHT_LEADER, LEFT_LEADER),
    );
    let back = cah_accel(constants, v, ahead, nearing, splat(params.simd, 0.0));
    let room = back.simd_ge(-vehicle.max_assumed_decel)
        & old(gap, RIGHT_FOLLOWER, LEFT_FOLLOWER).simd_gt(constants.min_rear_gap);
    ((bad_rear | bad_front) & room & early & whole, to_fast)
}

/// Whether vehicle `i` has wanted the same for as long as it signals; remembers what it wants.
#[inline(always)]
fn update_wanted_side<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    wanted: F32<S>,
    looks: Mask<S>,
) -> Mask<S> {
    let same = wanted.simd_eq(state.lane_choice.wanted_side[i]) & wanted.simd_ne(0.0);
    assign_where(
        &mut state.lane_choice.time_wanted[i],
        looks & !same,
        splat(params.simd, 0.0),
    );
    assign_where(&mut state.lane_choice.wanted_side[i], looks, wanted);
    looks & same & state.lane_choice.time_wanted[i].simd_ge(params.vehicles[i].indicator_lead_time)
}

/// 1 towards the fast side, -1 towards the slow side, 0 for neither.
#[inline(always)]
fn signed_side<S: Simd, const N: usize>(
    params: &Params<S, N>,
    fast: Mask<S>,
    slow: Mask<S>,
) -> F32<S> {
    let (zero, one) = (splat(params.simd, 0.0), splat(params.simd, 1.0));
    select(fast, one, zero) - select(slow, one, zero)
}

/// Begin a lane change of vehicle `i` in the masked simulations, to the fast side, to the slow side or back;
/// in less than its usual time where the leader would be reached before, or in a time for who is in a hurry.
#[inline(always)]
pub fn start_lane_changes<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    (fast, slow, back): (Mask<S>, Mask<S>, Mask<S>),
    believed: &Beliefs<S>,
    hasty: Option<F32<S>>,
    decision: u32,
) {
    let moved = fast | slow;
    if !moved.any_true() {
        return;
    }
    let vehicle = &params.vehicles[i];
    let step = signed_side(params, fast, slow);
    state.lane_choice.lane[i] += step;
    let (low, high) = lane_borders(params, state.lane_choice.lane[i], 0.0);
    let constants = &params.constants;
    let left = believed.gap[LEADER] / at_least(believed.closing_speed[LEADER], MIN_SPEED);
    let hurried = at_least(
        (left - constants.lane_clearance_time) / constants.lane_cleared_share,
        constants.min_lane_change_duration,
    );
    let usual = min(vehicle.lane_change_duration, hurried);
    let duration = select(
        back,
        constants.abort_duration_share * vehicle.lane_change_duration,
        usual,
    );
    let duration = hasty.map_or(duration, |hasty| {
        select(hasty.simd_gt(0.0), hasty, duration)
    });
    start_path(state, i, moved, 0.5 * (low + high), duration);
    state.controls.indicator[i] = select(
        moved,
        step * vehicle.uses_indicator,
        state.controls.indicator[i],
    );
    state.lane_choice.wanted_side[i] = select(
        moved,
        splat(params.simd, 0.0),
        state.lane_choice.wanted_side[i],
    );
    draw_shoulder_check(state, params, i, moved, decision);
}
