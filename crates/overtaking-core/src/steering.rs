//! Where in the lane to be, and the wheel angle that gets there; see `overtaking.sim.reference.steering`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{atan, sincos};
use crate::math::vectors::{M, V, at_least, choose, clamp, clamp_to, min, splat};
use crate::params::{Params, StepLength};
use crate::state::{EGO_SLOT, State};

/// Lay a quintic from where the path of vehicle `i` is now to the centre of another lane.
#[inline(always)]
pub fn start_path<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    i: usize,
    moved: M<S>,
    centre: V<S>,
    duration: V<S>,
) {
    let (place, speed) = path_position(state, i, 0.0);
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
pub fn path_position<S: Simd, const N: usize>(
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
pub fn update_wind_trim<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    i: usize,
    step: u32,
) {
    let vehicle = &params.vehicles[i];
    let pushed = state.wind_force[i] * vehicle.inverse_mass;
    let angle = vehicle.understeer * pushed + state.wind_moment[i] * vehicle.moment_angle;
    let target = -choose(vehicle.two_wheeler.simd_gt(0.0), pushed, angle);
    if step == 0 {
        state.trim[i] = target;
    }
    state.trim[i] = state.trim[i] + (target - state.trim[i]) * params.derived.wind_trim_share;
}

/// How far the front wheels may turn from the slip angle on the friction of this decision.
#[inline(always)]
pub fn slip_reach<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    params: &Params<'_, S, N>,
    i: usize,
) -> V<S> {
    params.constants.slip_share * 0.5 * (state.mu_fast[i] + state.mu_slow[i])
        / params.vehicles[i].front_stiffness
}

/// Drive vehicle `i` steadily along the bend at the first frame, as who came into it before.
#[inline(always)]
pub fn settle_into_bend<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    i: usize,
) {
    let (constants, vehicle, v) = (params.constants, &params.vehicles[i], state.vx[i]);
    let rides = vehicle.two_wheeler.simd_gt(0.0);
    let rate = state.curve[i] * v;
    let accel = rate * v;
    let slips = vehicle.cg_rear * rate - v * (accel / (constants.gravity * vehicle.rear_stiffness));
    let angle = state.curve[i] * (vehicle.wheelbase + vehicle.understeer * (v * v));
    state.wheel[i] = choose(rides, accel, angle);
    state.vy[i] = choose(rides, splat(params.simd, 0.0), slips);
    state.psi[i] = -atan(state.vy[i] / at_least(v, constants.slip_speed));
    (state.sine[i], state.cosine[i]) = sincos(state.psi[i]);
    (state.r[i], state.a_lat[i]) = (rate, accel);
}

/// Turn the front wheels of vehicle `i`, or lean, towards the path for one step; the angle in its middle.
#[inline(always)]
pub fn steer<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    i: usize,
    stride: &StepLength,
) -> V<S> {
    let wanted = requested_steering::<S, N, VARIES>(state, params, i, stride.half);
    turn_wheels(state, params, i, wanted, stride)
}

/// The same for the ego, where another driver has ordered an angle of the front wheels.
#[inline(always)]
pub fn steer_to_angle<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    ordered: V<S>,
    stride: &StepLength,
) -> V<S> {
    let (_, lean) = requested_steering::<S, N, VARIES>(state, params, EGO_SLOT, stride.half);
    let limit = params.constants.steering_limit;
    let angle = clamp_to(ordered, -limit, limit);
    turn_wheels(state, params, EGO_SLOT, (angle, lean), stride)
}

/// Turn the front wheels of vehicle `i`, or lean, as asked, with a lag.
#[inline(always)]
fn turn_wheels<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    i: usize,
    (angle, lean): (V<S>, V<S>),
    stride: &StepLength,
) -> V<S> {
    let wheel = state.wheel[i];
    let turn = clamp_to(
        (angle - wheel) * stride.steering,
        -stride.max_wheel_turn,
        stride.max_wheel_turn,
    );
    let lean = (lean - wheel) * stride.leaning;
    let moved = choose(params.vehicles[i].two_wheeler.simd_gt(0.0), lean, turn);
    let (is_sound, zero) = (state.crashed[i].simd_eq(0.0), splat(params.simd, 0.0));
    state.wheel[i] = choose(is_sound, wheel + moved, zero);
    state.path_time[i] += stride.length;
    choose(is_sound, wheel + 0.5 * moved, zero)
}

/// Wheel angle and lean that the driver of vehicle `i` asks for, a time `ahead`.
#[inline(always)]
fn requested_steering<S: Simd, const N: usize, const VARIES: bool>(
    state: &State<'_, S, N>,
    params: &Params<'_, S, N>,
    i: usize,
    ahead: f32,
) -> (V<S>, V<S>) {
    let (constants, vehicle) = (params.constants, &params.vehicles[i]);
    let (place, speed) = path_position(state, i, ahead);
    let late = choose(
        vehicle.two_wheeler.simd_gt(0.0),
        splat(params.simd, constants.two_wheeler_lag),
        constants.steering_lag + vehicle.side_lag * state.vx[i],
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
    let wanted = accel + constants.velocity_gain * (speed - sideways);
    let aim = place + constants.lane_deviation * state.wander[i] - d;
    let wanted = wanted + constants.position_gain * aim;
    let mut wanted = clamp(
        wanted,
        -params.simulations.max_lateral_accel,
        params.simulations.max_lateral_accel,
    );
    if VARIES {
        wanted += state.curve_ahead[i] * (vx * vx);
    }
    let inverse_speed = 1.0 / at_least(vx, constants.slip_speed);
    let felt = wanted + constants.yaw_gain * (wanted - vx * r);
    let angle = felt * (vehicle.wheelbase * (inverse_speed * inverse_speed) + vehicle.understeer)
        + state.trim[i];
    let slip = (vy + vehicle.cg_front * r) * inverse_speed;
    let reach = state.reach[i];
    let angle = clamp_to(
        clamp(angle, slip - reach, slip + reach),
        -constants.steering_limit,
        constants.steering_limit,
    );
    (angle, wanted + state.trim[i])
}
