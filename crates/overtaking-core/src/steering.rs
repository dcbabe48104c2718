//! Where in the lane to be, and the wheel angle that gets there; see `overtaking.sim.reference.steering`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{atan, sincos};
use crate::math::vectors::{F32, Mask, at_least, clamp, clamp_to, min, select, splat};
use crate::params::{Params, StepLength};
use crate::state::{EGO_SLOT, State};

/// Lay a quintic from where the path of vehicle `i` is now to the centre of another lane.
#[inline(always)]
pub fn start_path<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    i: usize,
    moved: Mask<S>,
    centre: F32<S>,
    duration: F32<S>,
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
        state.path.coefficients[i][k] = select(moved, value, state.path.coefficients[i][k]);
    }
    let zero = splat(t.simd, 0.0);
    state.path.elapsed[i] = select(moved, zero, state.path.elapsed[i]);
    state.path.duration[i] = select(moved, duration, state.path.duration[i]);
    state.lane_choice.time_since_lane_change[i] =
        select(moved, zero, state.lane_choice.time_since_lane_change[i]);
}

/// Position and velocity of the lateral path of vehicle `i`, a time `ahead`.
#[inline(always)]
pub fn path_position<S: Simd, const N: usize>(
    state: &State<S, N>,
    i: usize,
    ahead: f32,
) -> (F32<S>, F32<S>) {
    let t = min(state.path.elapsed[i] + ahead, state.path.duration[i]);
    let [c0, c1, c2, c3, c4, c5] = state.path.coefficients[i];
    let place = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))));
    let speed = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * (5.0 * c5))));
    (place, speed)
}

/// Acceleration of the lateral path of vehicle `i`, a time `ahead`.
#[inline(always)]
fn path_accel<S: Simd, const N: usize>(state: &State<S, N>, i: usize, ahead: F32<S>) -> F32<S> {
    let t = min(state.path.elapsed[i] + ahead, state.path.duration[i]);
    let [_, _, c2, c3, c4, c5] = state.path.coefficients[i];
    2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * (20.0 * c5)))
}

/// Answer the side wind after a lag; at the first frame it is held already.
#[inline(always)]
pub fn update_wind_trim<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    step: u32,
) {
    let vehicle = &params.vehicles[i];
    let pushed = state.friction_and_wind.wind_force[i] * vehicle.inverse_mass;
    let angle =
        vehicle.understeer * pushed + state.friction_and_wind.wind_moment[i] * vehicle.moment_angle;
    let target = -select(vehicle.two_wheeler.simd_gt(0.0), pushed, angle);
    if step == 0 {
        state.controls.wind_trim[i] = target;
    }
    state.controls.wind_trim[i] = state.controls.wind_trim[i]
        + (target - state.controls.wind_trim[i]) * params.derived.wind_trim_share;
}

/// How far the front wheels may turn from the slip angle on the friction of this decision.
#[inline(always)]
pub fn slip_reach<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
) -> F32<S> {
    params.constants.slip_share
        * 0.5
        * (state.friction_and_wind.mu_left[i] + state.friction_and_wind.mu_right[i])
        / params.vehicles[i].front_stiffness
}

/// Drive vehicle `i` steadily along the bend at the first frame, as who came into it before.
#[inline(always)]
pub fn settle_into_bend<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
) {
    let (constants, vehicle, v) = (&params.constants, &params.vehicles[i], state.motion.vx[i]);
    let rides = vehicle.two_wheeler.simd_gt(0.0);
    let rate = state.road.curvature[i] * v;
    let accel = rate * v;
    let slips = vehicle.cg_rear * rate - v * (accel / (constants.gravity * vehicle.rear_stiffness));
    let angle = state.road.curvature[i] * (vehicle.wheelbase + vehicle.understeer * (v * v));
    state.controls.wheel_angle[i] = select(rides, accel, angle);
    state.motion.vy[i] = select(rides, splat(params.simd, 0.0), slips);
    state.motion.heading[i] = -atan(state.motion.vy[i] / at_least(v, constants.slip_speed));
    (state.motion.sin_heading[i], state.motion.cos_heading[i]) = sincos(state.motion.heading[i]);
    (state.motion.yaw_rate[i], state.motion.accel_lat[i]) = (rate, accel);
}

/// Turn the front wheels of vehicle `i`, or lean, towards the path for one step; the angle in its middle.
#[inline(always)]
pub fn steer<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    stride: &StepLength,
) -> F32<S> {
    let wanted = requested_steering::<S, N, VARIES>(state, params, i, stride.half);
    turn_wheels(state, params, i, wanted, stride)
}

/// The same for the ego, where another driver has ordered an angle of the front wheels.
#[inline(always)]
pub fn steer_to_angle<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    ordered: F32<S>,
    stride: &StepLength,
) -> F32<S> {
    let (_, lean) = requested_steering::<S, N, VARIES>(state, params, EGO_SLOT, stride.half);
    let limit = params.constants.steering_limit;
    let angle = clamp_to(ordered, -limit, limit);
    turn_wheels(state, params, EGO_SLOT, (angle, lean), stride)
}

/// Turn the front wheels of vehicle `i`, or lean, as asked, with a lag.
#[inline(always)]
fn turn_wheels<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    (angle, lean): (F32<S>, F32<S>),
    stride: &StepLength,
) -> F32<S> {
    let wheel = state.controls.wheel_angle[i];
    let turn = clamp_to(
        (angle - wheel) * stride.steering,
        -stride.max_wheel_turn,
        stride.max_wheel_turn,
    );
    let lean = (lean - wheel) * stride.leaning;
    let moved = select(params.vehicles[i].two_wheeler.simd_gt(0.0), lean, turn);
    let (is_sound, zero) = (
        state.motion.is_wreck[i].simd_eq(0.0),
        splat(params.simd, 0.0),
    );
    state.controls.wheel_angle[i] = select(is_sound, wheel + moved, zero);
    state.path.elapsed[i] += stride.length;
    select(is_sound, wheel + 0.5 * moved, zero)
}

/// Wheel angle and lean that the driver of vehicle `i` asks for, a time `ahead`.
#[inline(always)]
fn requested_steering<S: Simd, const N: usize, const VARIES: bool>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    ahead: f32,
) -> (F32<S>, F32<S>) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[i]);
    let (place, speed) = path_position(state, i, ahead);
    let late = select(
        vehicle.two_wheeler.simd_gt(0.0),
        splat(params.simd, constants.two_wheeler_lag),
        constants.steering_lag + vehicle.side_lag * state.motion.vx[i],
    );
    let accel = path_accel(state, i, ahead + late);
    let (sine, cosine) = (state.motion.sin_heading[i], state.motion.cos_heading[i]);
    let (a_lon, a_lat) = (state.motion.accel_lon[i], state.motion.accel_lat[i]);
    let sideways = state.motion.vx[i] * sine + state.motion.vy[i] * cosine;
    let d = state.motion.d[i] + ahead * sideways;
    let sideways = sideways + ahead * (a_lon * sine + a_lat * cosine);
    let vx = state.motion.vx[i] + ahead * a_lon;
    let vy = state.motion.vy[i] + ahead * (a_lat - state.motion.vx[i] * state.motion.yaw_rate[i]);
    let r = state.motion.yaw_rate[i] + ahead * state.motion.yaw_accel[i];
    let wanted = accel + constants.velocity_gain * (speed - sideways);
    let aim = place + constants.lane_deviation * state.noise.lane_wander[i] - d;
    let wanted = wanted + constants.position_gain * aim;
    let mut wanted = clamp(
        wanted,
        -params.simulations.max_lateral_accel,
        params.simulations.max_lateral_accel,
    );
    if VARIES {
        wanted += state.road.curvature_ahead[i] * (vx * vx);
    }
    let inverse_speed = 1.0 / at_least(vx, constants.slip_speed);
    let felt = wanted + constants.yaw_gain * (wanted - vx * r);
    let angle = felt * (vehicle.wheelbase * (inverse_speed * inverse_speed) + vehicle.understeer)
        + state.controls.wind_trim[i];
    let slip = (vy + vehicle.cg_front * r) * inverse_speed;
    let reach = state.controls.slip_reach[i];
    let angle = clamp_to(
        clamp(angle, slip - reach, slip + reach),
        -constants.steering_limit,
        constants.steering_limit,
    );
    (angle, wanted + state.controls.wind_trim[i])
}
