//! How hard each driver accelerates or brakes; see `overtaking.sim.reference.control`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::following::follow;
use crate::lanes::{M, V, at_least, choose, clamp, max, min, pick, splat};
use crate::neighbours::Neighbours;
use crate::passing::{room_left, speed_of_pass};
use crate::perception::Beliefs;
use crate::state::{EGO, FAST_LEAD, LEAD, SLOW_LEAD, State, stage};
use crate::world::World;

const FREE: f32 = 1e9;

#[inline(always)]
fn is_passing<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize) -> M<S> {
    state.stage[i].simd_eq(stage::PULL_OUT) | state.stage[i].simd_eq(stage::PASS)
}

#[inline(always)]
fn desired_speed<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    passed: M<S>,
) -> V<S> {
    let p = &w.p[i];
    let mut desired = state.desired_speed(w, i);
    if w.road.ways.has_oncoming_traffic {
        desired = choose(passed, desired * p.speed_factor_when_passed, desired);
        let passing = is_passing(state, i);
        if passing.any_true() {
            desired = choose(passing, speed_of_pass(state, w, i), desired);
        }
    } else if i == EGO {
        desired = choose(is_passing(state, i), state.pass_speed(w, i), desired);
    }
    if w.road.varies_along_road() {
        return min(desired, state.bend_speed[i]);
    }
    desired
}

/// Time gap kept; who is about to pull out accepts a smaller one, and to trucks of two-way roads more room is left.
#[inline(always)]
fn time_gap<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    near: &Neighbours<S>,
) -> V<S> {
    let own = w.p[i].time_gap;
    if w.road.lets_overtake(i) {
        let follows = state.stage[i].simd_eq(stage::FOLLOW);
        let about_to = state.signalled[i].simd_gt(0.0) & follows;
        let kept = choose(about_to, w.c.signalling_time_gap * own, own);
        if w.road.ways.has_oncoming_traffic {
            choose(follows, kept * room_left(w, near.slot[LEAD]), kept)
        } else {
            kept
        }
    } else {
        own
    }
}

/// Acceleration behind the leader of the lane that is driven in or being entered; somebody may pass the driver.
#[inline(always)]
pub fn behind_leader<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    (near, believed): (&Neighbours<S>, &Beliefs<S>),
    passed: M<S>,
) -> V<S> {
    let (c, p) = (w.c, &w.p[i]);
    let desired = desired_speed(state, w, i, passed);
    let kept = time_gap(state, w, i, near);
    let (gap, closing) = (believed.gap[LEAD], believed.closing[LEAD]);
    let wanted = follow(
        c,
        p,
        state.vx[i],
        desired,
        gap,
        closing,
        kept,
        believed.accel[LEAD],
    );
    let eased = state.eased(w, i, wanted);
    if w.road.lets_overtake(i) {
        let passing = is_passing(state, i);
        let wanted = choose(passing, wanted, eased);
        let eager = passing & wanted.simd_gt(0.0);
        let usual = splat(w.simd, w.c.accelerate_gain);
        let gain = if w.road.ways.has_oncoming_traffic {
            let hurried = splat(w.simd, w.c.urgent_accel_factor);
            choose(state.hurries[i].simd_gt(0.0), hurried, usual)
        } else {
            usual
        };
        wanted * choose(eager, gain, splat(w.simd, 1.0))
    } else {
        eased
    }
}

/// Acceleration behind the one whose lane is being left, while the bodies overlap.
#[inline(always)]
fn behind_old_leader<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    near: &Neighbours<S>,
    believed: &Beliefs<S>,
    passed: M<S>,
) -> V<S> {
    let (c, p, n) = (w.c, &w.p[i], w.count);
    let free = splat(w.simd, FREE);
    let changing = state.path_time[i].simd_lt(state.path_duration[i]);
    if !changing.any_true() {
        return free;
    }
    let to_fast = (0.5 * (near.lane_low + near.lane_high)).simd_gt(state.d[i]);
    let slot = choose(to_fast, near.slot[SLOW_LEAD], near.slot[FAST_LEAD]);
    let gap = choose(to_fast, believed.gap[SLOW_LEAD], believed.gap[FAST_LEAD]);
    let closing = choose(
        to_fast,
        believed.closing[SLOW_LEAD],
        believed.closing[FAST_LEAD],
    );
    let accel = choose(
        to_fast,
        believed.accel[SLOW_LEAD],
        believed.accel[FAST_LEAD],
    );
    let aside = choose(to_fast, near.aside[SLOW_LEAD], near.aside[FAST_LEAD]).abs();
    let overlaps =
        aside.simd_lt(p.half_width + pick!(n, slot, |j| w.p[j].half_width) + c.footprint_margin);
    let left = at_least(
        c.lane_cleared_share * state.path_duration[i] - state.path_time[i],
        0.0,
    );
    let needed =
        braking_to_clear(w, gap - p.min_gap, closing, left + c.lane_clearance_time) - accel;
    let matters = changing & slot.simd_ge(0.0) & overlaps & needed.simd_gt(0.0);
    if !matters.any_true() {
        return free;
    }
    let kept = follow(
        c,
        p,
        state.vx[i],
        desired_speed(state, w, i, passed),
        gap,
        closing,
        p.time_gap,
        accel,
    );
    choose(matters, max(kept, -needed), free)
}

#[inline(always)]
fn braking_to_clear<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    room: V<S>,
    closing: V<S>,
    time: V<S>,
) -> V<S> {
    let room = at_least(room, w.c.min_effective_gap);
    let way = closing * time;
    choose(
        way.simd_lt(2.0 * room),
        2.0 * (way - room) / (time * time),
        closing * closing / (2.0 * room),
    )
}

/// The acceleration that driver `i` wants behind the leader, and behind the one whose lane is being left.
#[inline(always)]
pub fn wanted<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    (near, believed): (&Neighbours<S>, &Beliefs<S>),
    passed: M<S>,
    leader: V<S>,
) -> V<S> {
    min(
        leader,
        behind_old_leader(state, w, i, near, believed, passed),
    )
}

/// Move the pedals of vehicle `i` towards the wanted acceleration.
#[inline(always)]
pub fn press<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    wanted: V<S>,
) {
    let c = w.c;
    let wanted = max(wanted, -(w.p[i].max_brake_force * w.p[i].inverse_mass));
    let up = choose(
        state.accel[i].simd_lt(0.0),
        splat(w.simd, c.jerk_release),
        splat(w.simd, c.jerk_up),
    ) * c.decision;
    let down = at_least(-wanted / c.brake_ramp, c.jerk_down) * c.decision;
    let changed = state.accel[i] + clamp(wanted - state.accel[i], -down, up);
    state.accel[i] = choose(state.crashed[i].simd_gt(0.0), splat(w.simd, 0.0), changed);
}
