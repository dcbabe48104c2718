//! Where in the lane to be, and the wheel angle that gets there; see `overtaking.sim.reference.steering`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{M, V, choose, clamp, clamp_to, min, splat};
use crate::state::{State, World};

/// Lay a quintic from where the path of vehicle `i` is now to the centre of another lane.
#[inline(always)]
pub fn begin_path<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    i: usize,
    moved: M<S>,
    centre: V<S>,
    duration: V<S>,
) {
    let (place, speed, accel) = path_now(state, i);
    let t = duration;
    let rest = centre - place - speed * t - 0.5 * accel * (t * t);
    let lost = -(speed + accel * t);
    let bend = -accel;
    let t2 = t * t;
    let t3 = t2 * t;
    let c3 = (10.0 * rest - 4.0 * (lost * t) + 0.5 * (bend * t2)) / t3;
    let c4 = (-15.0 * rest + 7.0 * (lost * t) - bend * t2) / (t3 * t);
    let c5 = (6.0 * rest - 3.0 * (lost * t) + 0.5 * (bend * t2)) / (t3 * t2);
    for (k, value) in [place, speed, 0.5 * accel, c3, c4, c5]
        .into_iter()
        .enumerate()
    {
        state.path[i][k] = choose(moved, value, state.path[i][k]);
    }
    let zero = splat(t.simd, 0.0);
    state.path_time[i] = choose(moved, zero, state.path_time[i]);
    state.path_duration[i] = choose(moved, duration, state.path_duration[i]);
    state.since_change[i] = choose(moved, zero, state.since_change[i]);
}

/// Position, velocity and acceleration of the lateral path of vehicle `i` now.
#[inline(always)]
pub fn path_now<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize) -> (V<S>, V<S>, V<S>) {
    let t = min(state.path_time[i], state.path_duration[i]);
    let [c0, c1, c2, c3, c4, c5] = state.path[i];
    let place = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))));
    let speed = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * (5.0 * c5))));
    let accel = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * (20.0 * c5)));
    (place, speed, accel)
}

/// Answer the side wind after a lag; at the first frame it is held already.
#[inline(always)]
pub fn hold_against_wind<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    step: u32,
) {
    let p = &w.p[i];
    let pushed = state.wind_force[i] * p.inverse_mass;
    let angle = p.understeer * pushed + state.wind_moment[i] * p.moment_angle;
    let target = -choose(p.two_wheeler.simd_gt(0.0), pushed, angle);
    if step == 0 {
        state.trim[i] = target;
    }
    state.trim[i] = state.trim[i] + (target - state.trim[i]) * w.rates.trimming;
}

/// How far the front wheels may turn from the slip angle on the friction of this decision.
#[inline(always)]
pub fn reach<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> V<S> {
    w.c.slip_share * 0.5 * (state.mu_fast[i] + state.mu_slow[i]) / w.p[i].front_stiffness
}

/// Turn the front wheels of vehicle `i`, or lean, towards the path for one step.
#[inline(always)]
pub fn steer<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    inverse_speed: V<S>,
) {
    let (c, p) = (w.c, &w.p[i]);
    let (place, speed, accel) = path_now(state, i);
    let sideways = state.vx[i] * state.sine[i] + state.vy[i] * state.cosine[i];
    let wanted = accel + c.velocity_gain * (speed - sideways);
    let aim = place + c.lane_deviation * state.wander[i] - state.d[i];
    let wanted = wanted + c.position_gain * aim;
    let wanted = clamp(wanted, -w.q.side_accel, w.q.side_accel);
    let felt = wanted + c.yaw_gain * (wanted - state.vx[i] * state.r[i]);
    let angle =
        felt * (p.wheelbase * (inverse_speed * inverse_speed) + p.understeer) + state.trim[i];
    let slip = (state.vy[i] + p.cg_front * state.r[i]) * inverse_speed;
    let reach = state.reach[i];
    let angle = clamp_to(
        clamp(angle, slip - reach, slip + reach),
        -c.steering_limit,
        c.steering_limit,
    );
    let turn = (angle - state.wheel[i]) * w.rates.steering;
    let turn = clamp_to(turn, -c.steering_rate * c.step, c.steering_rate * c.step);
    let lean = (wanted + state.trim[i] - state.wheel[i]) * w.rates.leaning;
    let moved = choose(
        p.two_wheeler.simd_gt(0.0),
        state.wheel[i] + lean,
        state.wheel[i] + turn,
    );
    state.wheel[i] = choose(state.crashed[i].simd_gt(0.0), splat(w.simd, 0.0), moved);
    state.path_time[i] += c.step;
}
