//! Where in the lane to be, and the wheel angle that gets there; see `overtaking.sim.reference.steering`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::{atan, sincos};
use crate::lanes::{M, V, at_least, choose, clamp, clamp_to, min, splat};
use crate::state::{EGO, State};
use crate::world::{Stride, World};

/// Lay a quintic from where the path of vehicle `i` is now to the centre of another lane.
#[inline(always)]
pub fn begin_path<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    i: usize,
    moved: M<S>,
    centre: V<S>,
    duration: V<S>,
) {
    let (place, speed) = path_at(state, i, 0.0);
    let accel = path_accel(state, i, splat(duration.simd, 0.0));
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

/// Position and velocity of the lateral path of vehicle `i`, a time `ahead`.
#[inline(always)]
pub fn path_at<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    i: usize,
    ahead: f32,
) -> (V<S>, V<S>) {
    let t = min(state.path_time[i] + ahead, state.path_duration[i]);
    let [c0, c1, c2, c3, c4, c5] = state.path[i];
    let place = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))));
    let speed = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * (5.0 * c5))));
    (place, speed)
}

/// Acceleration of the lateral path of vehicle `i`, a time `ahead`.
#[inline(always)]
fn path_accel<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize, ahead: V<S>) -> V<S> {
    let t = min(state.path_time[i] + ahead, state.path_duration[i]);
    let [_, _, c2, c3, c4, c5] = state.path[i];
    2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * (20.0 * c5)))
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

/// Drive vehicle `i` steadily along the bend at the first frame, as who came into it before.
#[inline(always)]
pub fn hold_bend<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) {
    let (c, p, v) = (w.c, &w.p[i], state.vx[i]);
    let rides = p.two_wheeler.simd_gt(0.0);
    let rate = state.curve[i] * v;
    let accel = rate * v;
    let slips = p.cg_rear * rate - v * (accel / (c.gravity * p.rear_stiffness));
    let angle = state.curve[i] * (p.wheelbase + p.understeer * (v * v));
    state.wheel[i] = choose(rides, accel, angle);
    state.vy[i] = choose(rides, splat(w.simd, 0.0), slips);
    state.psi[i] = -atan(state.vy[i] / at_least(v, c.slip_speed));
    (state.sine[i], state.cosine[i]) = sincos(state.psi[i]);
    (state.r[i], state.a_lat[i]) = (rate, accel);
}

/// Turn the front wheels of vehicle `i`, or lean, towards the path for one step; the angle in its middle.
#[inline(always)]
pub fn steer<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    stride: &Stride,
) -> V<S> {
    let wanted = asked::<S, N, VARIES>(state, w, i, stride.half);
    turn(state, w, i, wanted, stride)
}

/// The same for the ego, where another driver has ordered an angle of the front wheels.
#[inline(always)]
pub fn steer_as_ordered<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    ordered: V<S>,
    stride: &Stride,
) -> V<S> {
    let (_, lean) = asked::<S, N, VARIES>(state, w, EGO, stride.half);
    let limit = w.c.steering_limit;
    let angle = clamp_to(ordered, -limit, limit);
    turn(state, w, EGO, (angle, lean), stride)
}

/// Turn the front wheels of vehicle `i`, or lean, as asked, with a lag.
#[inline(always)]
fn turn<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    (angle, lean): (V<S>, V<S>),
    stride: &Stride,
) -> V<S> {
    let wheel = state.wheel[i];
    let turn = clamp_to((angle - wheel) * stride.steering, -stride.most, stride.most);
    let lean = (lean - wheel) * stride.leaning;
    let moved = choose(w.p[i].two_wheeler.simd_gt(0.0), lean, turn);
    let (is_sound, zero) = (state.crashed[i].simd_eq(0.0), splat(w.simd, 0.0));
    state.wheel[i] = choose(is_sound, wheel + moved, zero);
    state.path_time[i] += stride.length;
    choose(is_sound, wheel + 0.5 * moved, zero)
}

/// Wheel angle and lean that the driver of vehicle `i` asks for, a time `ahead`.
#[inline(always)]
fn asked<S: Simd, const N: usize, const VARIES: bool>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    ahead: f32,
) -> (V<S>, V<S>) {
    let (c, p) = (w.c, &w.p[i]);
    let (place, speed) = path_at(state, i, ahead);
    let late = choose(
        p.two_wheeler.simd_gt(0.0),
        splat(w.simd, c.two_wheeler_lag),
        c.steering_lag + p.side_lag * state.vx[i],
    );
    let accel = path_accel(state, i, ahead + late);
    let (sine, cosine) = (state.sine[i], state.cosine[i]);
    let (a_lon, a_lat) = (state.a_lon[i], state.a_lat[i]);
    let sideways = state.vx[i] * sine + state.vy[i] * cosine;
    let d = state.d[i] + ahead * sideways;
    let sideways = sideways + ahead * (a_lon * sine + a_lat * cosine);
    let vx = state.vx[i] + ahead * a_lon;
    let vy = state.vy[i] + ahead * (a_lat - state.vx[i] * state.r[i]);
    let r = state.r[i] + ahead * state.yaw_accel[i];
    let wanted = accel + c.velocity_gain * (speed - sideways);
    let aim = place + c.lane_deviation * state.wander[i] - d;
    let wanted = wanted + c.position_gain * aim;
    let mut wanted = clamp(wanted, -w.q.max_lateral_accel, w.q.max_lateral_accel);
    if VARIES {
        wanted += state.curve_ahead[i] * (vx * vx);
    }
    let inverse_speed = 1.0 / at_least(vx, c.slip_speed);
    let felt = wanted + c.yaw_gain * (wanted - vx * r);
    let angle =
        felt * (p.wheelbase * (inverse_speed * inverse_speed) + p.understeer) + state.trim[i];
    let slip = (vy + p.cg_front * r) * inverse_speed;
    let reach = state.reach[i];
    let angle = clamp_to(
        clamp(angle, slip - reach, slip + reach),
        -c.steering_limit,
        c.steering_limit,
    );
    (angle, wanted + state.trim[i])
}
