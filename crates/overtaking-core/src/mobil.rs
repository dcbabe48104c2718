//! Lane changes of everybody but the ego; see `overtaking.sim.reference.mobil`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::fields::Constants;
use crate::following::{follow, forced_braking};
use crate::lanes::{M, V, choose, min, splat};
use crate::neighbours::lane_borders;
use crate::perception::Beliefs;
use crate::state::{FAST_LEAD, FAST_REAR, LEAD, REAR, SLOW_LEAD, SLOW_REAR, State, World};
use crate::steering::begin_path;

/// Whether lane changes are considered at a decision.
#[inline(always)]
pub fn is_due(c: &Constants, decision: usize) -> bool {
    decision.is_multiple_of(c.mobil_interval as usize)
}

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
    let fast = follow(
        c,
        p,
        v,
        p.desired_speed,
        gap[FAST_LEAD],
        closing[FAST_LEAD],
        p.time_gap,
        steady,
    );
    let slow = follow(
        c,
        p,
        v,
        p.desired_speed,
        gap[SLOW_LEAD],
        closing[SLOW_LEAD],
        p.time_gap,
        steady,
    );
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
    let to_fast = fast - here + p.politeness * (after - before) - p.bias;
    let to_slow = there - own + p.politeness * (relieved - now) + p.bias;
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
    let braking = imposed(w, i, v, gap[rear], closing[rear]);
    let own = forced_braking(c, p, v, gap[front], closing[front], p.time_gap);
    let room = gap[rear].simd_gt(c.smallest_rear_gap) & gap[front].simd_gt(c.smallest_rear_gap);
    room & braking.simd_ge(-p.safe_decel) & own.simd_ge(-p.safe_decel)
}

/// Let vehicle `i`, not the ego, change lanes where it pays and is safe.
#[inline(always)]
pub fn change_lanes<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    believed: &Beliefs<S>,
    own: V<S>,
) {
    let (c, p, v) = (w.c, &w.p[i], state.vx[i]);
    let (to_fast, to_slow) = incentives(state, w, i, believed, own);
    let ready = state.path_time[i].simd_ge(state.path_duration[i])
        & state.since_change[i].simd_ge(c.cooldown)
        & state.crashed[i].simd_eq(0.0)
        & p.valid.simd_gt(0.0);
    let exists_fast = state.lane[i].simd_lt((w.road.num_lanes - 1) as f32);
    let exists_slow = state.lane[i].simd_ge(1.0);
    let fast = ready
        & exists_fast
        & to_fast.simd_gt(p.threshold)
        & is_safe(state, w, i, believed, FAST_LEAD, FAST_REAR);
    let slow = ready
        & exists_slow
        & to_slow.simd_gt(p.threshold)
        & is_safe(state, w, i, believed, SLOW_LEAD, SLOW_REAR)
        & believed.gap[SLOW_LEAD].simd_gt(c.free_ahead_time * v)
        & !fast;
    let wanted = side(w, fast, slow);
    let decided = decide(state, w, i, wanted);
    turn_to_lane(state, w, i, fast & decided, slow & decided);
    let done = state.path_time[i].simd_ge(state.path_duration[i]);
    state.indicator[i] = choose(done, wanted * p.uses_indicator, state.indicator[i]);
}

/// Whether vehicle `i` has wanted the same for as long as it signals; remembers it.
#[inline(always)]
fn decide<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    wanted: V<S>,
) -> M<S> {
    let same = wanted.simd_eq(state.wanted[i]) & wanted.simd_ne(0.0);
    let longer = state.wanted_time[i] + w.c.mobil_interval * w.c.decision;
    state.wanted_time[i] = choose(same, longer, splat(w.simd, 0.0));
    state.wanted[i] = wanted;
    state.wanted_time[i].simd_ge(w.p[i].signal_time)
}

/// 1 towards the fast side, -1 towards the slow side, 0 for neither.
#[inline(always)]
fn side<S: Simd, const N: usize>(w: &World<'_, S, N>, fast: M<S>, slow: M<S>) -> V<S> {
    let (zero, one) = (splat(w.simd, 0.0), splat(w.simd, 1.0));
    choose(fast, one, zero) - choose(slow, one, zero)
}

/// Begin a lane change of vehicle `i` in the masked simulations.
#[inline(always)]
pub fn turn_to_lane<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    fast: M<S>,
    slow: M<S>,
) {
    if !(fast | slow).any_true() {
        return;
    }
    let p = &w.p[i];
    let step = side(w, fast, slow);
    state.lane[i] += step;
    let (low, high) = lane_borders(w, state.lane[i], 0.0);
    begin_path(
        state,
        i,
        fast | slow,
        0.5 * (low + high),
        p.lane_change_duration,
    );
    state.indicator[i] = choose(fast | slow, step * p.uses_indicator, state.indicator[i]);
}
