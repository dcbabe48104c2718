//! Lane changes of everybody but the ego; see `overtaking.sim.reference.mobil`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::following::{follow, forced_braking, needed_braking};
use crate::lanes::{M, V, at_least, choose, min, put, splat};
use crate::neighbours::{Body, along, lane_borders};
use crate::perception::{Beliefs, draw_check};
use crate::state::{FAST_LEAD, FAST_REAR, LEAD, REAR, SLOW_LEAD, SLOW_REAR, State};
use crate::steering::begin_path;
use crate::world::World;

/// Keeps the time until a gap is closed finite [m/s].
const SLOWEST: f32 = 0.1;

#[inline(always)]
fn imposed<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    i: usize,
    speed: V<S>,
    gap: V<S>,
    closing: V<S>,
) -> V<S> {
    forced_braking(w.c, &w.p[i], speed + closing, gap, closing, w.p[i].time_gap)
}

#[inline(always)]
fn incentives<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    believed: &Beliefs<S>,
    own: V<S>,
) -> (V<S>, V<S>) {
    let (c, p, v) = (w.c, &w.p[i], state.vx[i]);
    let (gap, closing) = (&believed.gap, &believed.closing);
    let steady = splat(w.simd, 0.0);
    let desired = state.desired_speed(w, i);
    let fast = follow(
        c,
        p,
        v,
        desired,
        gap[FAST_LEAD],
        closing[FAST_LEAD],
        p.time_gap,
        steady,
    );
    let slow = follow(
        c,
        p,
        v,
        desired,
        gap[SLOW_LEAD],
        closing[SLOW_LEAD],
        p.time_gap,
        steady,
    );
    let (fast, slow) = (state.eased(w, i, fast), state.eased(w, i, slow));
    let no_passing = v.simd_gt(c.no_passing_right_speed);
    let here = choose(no_passing, min(own, fast), own);
    let there = choose(no_passing, min(slow, own), slow);
    let body = 2.0 * p.half_length;
    let after = imposed(w, i, v, gap[FAST_REAR], closing[FAST_REAR]);
    let open_gap = gap[FAST_REAR] + gap[FAST_LEAD] + body;
    let before = imposed(
        w,
        i,
        v - closing[FAST_LEAD],
        open_gap,
        closing[FAST_REAR] + closing[FAST_LEAD],
    );
    let relieved_gap = gap[REAR] + gap[LEAD] + body;
    let now = imposed(w, i, v, gap[REAR], closing[REAR]);
    let relieved = imposed(
        w,
        i,
        v - closing[LEAD],
        relieved_gap,
        closing[REAR] + closing[LEAD],
    );
    let to_fast = fast - here + p.politeness * (after - before) - p.keep_right_bias;
    let to_slow = there - own + p.politeness * (relieved - now) + p.keep_right_bias;
    (to_fast, to_slow)
}

#[inline(always)]
fn is_safe<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    believed: &Beliefs<S>,
    front: usize,
    rear: usize,
) -> M<S> {
    let (c, p, v) = (w.c, &w.p[i], state.vx[i]);
    let (gap, closing) = (&believed.gap, &believed.closing);
    let (later, faster) = soon(w, gap[rear], closing[rear]);
    let braking = min(
        imposed(w, i, v, gap[rear], closing[rear]),
        imposed(w, i, v, later, faster),
    );
    let own = forced_braking(c, p, v, gap[front], closing[front], p.time_gap);
    let room = gap[rear].simd_gt(c.min_rear_gap) & gap[front].simd_gt(c.min_rear_gap);
    room & braking.simd_ge(-p.safe_decel) & own.simd_ge(-p.safe_decel)
}

/// Gap to a follower, and how fast it closes, if it speeds up for some seconds.
#[inline(always)]
pub fn soon<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    gap: V<S>,
    closing: V<S>,
) -> (V<S>, V<S>) {
    let c = w.c;
    let faster = c.foresight_accel * c.foresight;
    (
        gap - c.foresight * (closing + 0.5 * faster),
        closing + faster,
    )
}

/// Let vehicle `i`, not the ego, change lanes where it pays and is safe, or back in danger.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
pub fn change_lanes<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    i: usize,
    believed: &Beliefs<S>,
    own: V<S>,
    looks: M<S>,
    decision: u32,
) {
    let (c, p, v) = (w.c, &w.p[i], state.vx[i]);
    let (to_fast, to_slow) = incentives(state, w, i, believed, own);
    let ready = looks
        & state.path_time[i].simd_ge(state.path_duration[i])
        & state.since_change[i].simd_ge(c.cooldown)
        & state.crashed[i].simd_eq(0.0)
        & p.valid.simd_gt(0.0);
    let exists_fast = state.lane[i].simd_lt((w.road.num_lanes - 1) as f32);
    let exists_slow = state.lane[i].simd_ge(1.0);
    let fast = ready
        & exists_fast
        & to_fast.simd_gt(p.lane_change_threshold)
        & is_safe(state, w, i, believed, FAST_LEAD, FAST_REAR);
    let slow = ready
        & exists_slow
        & to_slow.simd_gt(p.lane_change_threshold)
        & is_safe(state, w, i, believed, SLOW_LEAD, SLOW_REAR)
        & believed.gap[SLOW_LEAD].simd_gt(c.free_ahead_time * v)
        & !fast;
    let wanted = side(w, fast, slow);
    let shows = looks & state.path_time[i].simd_ge(state.path_duration[i]);
    put(&mut state.indicator[i], shows, wanted * p.uses_indicator);
    let decided = decide(state, w, i, wanted, looks);
    let (mut fast, mut slow) = (fast & decided, slow & decided);
    if (fast | slow).any_true() {
        let first = !must_wait(state, w, bodies, i, wanted);
        (fast, slow) = (fast & first, slow & first);
    }
    let (back, to_fast) = retreats(state, w, i, believed);
    let back = back & looks;
    let (fast, slow) = (fast | (back & !to_fast), slow | (back & to_fast));
    turn_to_lane(state, w, i, (fast, slow, back), believed, None, decision);
}

/// Whether vehicle `i` lets somebody first who signals for the same place from the other side of it.
#[inline(always)]
pub fn must_wait<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    i: usize,
    side: V<S>,
) -> M<S> {
    let reach = w.c.claim_time * state.vx[i];
    let mut waits = side.simd_ne(side);
    for j in 0..w.count {
        let other = &bodies[j];
        let ahead = along(w, state.s[j] - state.s[i]);
        let same = other.claims.simd_eq(-side)
            & other.lane.simd_eq(bodies[i].lane + 2.0 * side)
            & side.simd_ne(0.0);
        let close = ahead.abs().simd_lt(reach);
        let first = ahead.simd_gt(0.0) | (ahead.simd_eq(0.0) & side.simd_lt(0.0));
        waits |= same & close & first;
    }
    waits
}

/// Whether the lane change of vehicle `i` is to the fast side, and a whole one: a retreat has less far to
/// go.
#[inline(always)]
pub fn change_of<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> (M<S>, M<S>) {
    let (low, high) = lane_borders(w, state.lane[i], 0.0);
    let way = 0.5 * (low + high) - state.path[i][0];
    (way.simd_gt(0.0), way.abs().simd_gt(0.5 * (high - low)))
}

/// Whether vehicle `i` gives up a lane change, as it has turned dangerous; and whether it is to the fast
/// side.
#[inline(always)]
fn retreats<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    believed: &Beliefs<S>,
) -> (M<S>, M<S>) {
    let (c, p, v) = (w.c, &w.p[i], state.vx[i]);
    let (gap, closing) = (&believed.gap, &believed.closing);
    let early = state.path_time[i].simd_lt(c.abort_until * state.path_duration[i])
        & state.crashed[i].simd_eq(0.0)
        & p.valid.simd_gt(0.0);
    if !early.any_true() {
        return (early, early);
    }
    let (to_fast, whole) = change_of(state, w, i);
    let old =
        |values: &[V<S>; 6], slow: usize, fast: usize| choose(to_fast, values[slow], values[fast]);
    let bad_rear = imposed(w, i, v, gap[REAR], closing[REAR])
        .simd_lt(-(c.abort_imposed_factor * p.safe_decel));
    let own = forced_braking(c, p, v, gap[LEAD], closing[LEAD], p.time_gap);
    let bad_front = own.simd_lt(-(c.abort_factor * p.decel));
    let (ahead, nearing) = (
        old(gap, SLOW_LEAD, FAST_LEAD),
        old(closing, SLOW_LEAD, FAST_LEAD),
    );
    let back = needed_braking(c, v, ahead, nearing, splat(w.simd, 0.0));
    let room =
        back.simd_ge(-p.max_assumed_decel) & old(gap, SLOW_REAR, FAST_REAR).simd_gt(c.min_rear_gap);
    ((bad_rear | bad_front) & room & early & whole, to_fast)
}

/// Whether vehicle `i` has wanted the same for as long as it signals; remembers what it wants.
#[inline(always)]
fn decide<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    wanted: V<S>,
    looks: M<S>,
) -> M<S> {
    let same = wanted.simd_eq(state.wanted[i]) & wanted.simd_ne(0.0);
    put(&mut state.wanted_time[i], looks & !same, splat(w.simd, 0.0));
    put(&mut state.wanted[i], looks, wanted);
    looks & same & state.wanted_time[i].simd_ge(w.p[i].indicator_lead_time)
}

/// 1 towards the fast side, -1 towards the slow side, 0 for neither.
#[inline(always)]
fn side<S: Simd, const N: usize>(w: &World<'_, S, N>, fast: M<S>, slow: M<S>) -> V<S> {
    let (zero, one) = (splat(w.simd, 0.0), splat(w.simd, 1.0));
    choose(fast, one, zero) - choose(slow, one, zero)
}

/// Begin a lane change of vehicle `i` in the masked simulations, to the fast side, to the slow side or back;
/// in less than its usual time where the leader would be reached before, or in a time for who is in a hurry.
#[inline(always)]
pub fn turn_to_lane<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    (fast, slow, back): (M<S>, M<S>, M<S>),
    believed: &Beliefs<S>,
    hasty: Option<V<S>>,
    decision: u32,
) {
    let moved = fast | slow;
    if !moved.any_true() {
        return;
    }
    let p = &w.p[i];
    let step = side(w, fast, slow);
    state.lane[i] += step;
    let (low, high) = lane_borders(w, state.lane[i], 0.0);
    let c = w.c;
    let left = believed.gap[LEAD] / at_least(believed.closing[LEAD], SLOWEST);
    let hurried = at_least(
        (left - c.lane_clearance_time) / c.lane_cleared_share,
        c.min_lane_change_duration,
    );
    let usual = min(p.lane_change_duration, hurried);
    let duration = choose(back, c.abort_duration_share * p.lane_change_duration, usual);
    let duration = hasty.map_or(duration, |hasty| {
        choose(hasty.simd_gt(0.0), hasty, duration)
    });
    begin_path(state, i, moved, 0.5 * (low + high), duration);
    state.indicator[i] = choose(moved, step * p.uses_indicator, state.indicator[i]);
    state.wanted[i] = choose(moved, splat(w.simd, 0.0), state.wanted[i]);
    draw_check(state, w, i, moved, decision);
}
