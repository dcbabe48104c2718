//! Where in the lane to be, and the wheel angle that gets there; see `overtaking.sim.reference.steering`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{atan, sincos};
use crate::math::vectors::{F32, Mask, at_least, clamp, clamp_to, min, select, splat};
use crate::params::{Params, StepLength};
use crate::state::{EGO_SLOT, State};
use crate::vehicle_handle::VehicleHandle;

/// Lay a quintic from where the path of vehicle `slot` is now to the centre of another lane.
#[inline(always)]
pub fn start_path<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    slot: usize,
    moved: Mask<S>,
    centre: F32<S>,
    duration: F32<S>,
) {
    let (place, speed) = path_position(state, slot, 0.0);
    let accel = path_accel(state, slot, splat(duration.simd, 0.0));
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
        state.path.coefficients[slot][k] = select(moved, value, state.path.coefficients[slot][k]);
    }
    let zero = splat(t.simd, 0.0);
    state.path.elapsed[slot] = select(moved, zero, state.path.elapsed[slot]);
    state.path.duration[slot] = select(moved, duration, state.path.duration[slot]);
    state.lane_choice.time_since_lane_change[slot] =
        select(moved, zero, state.lane_choice.time_since_lane_change[slot]);
}

/// Position and velocity of the lateral path of vehicle `slot`, a time `ahead`.
#[inline(always)]
pub fn path_position<S: Simd, const N: usize>(
    state: &State<S, N>,
    slot: usize,
    ahead: f32,
) -> (F32<S>, F32<S>) {
    let t = min(state.path.elapsed[slot] + ahead, state.path.duration[slot]);
    let [c0, c1, c2, c3, c4, c5] = state.path.coefficients[slot];
    let place = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))));
    let speed = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * (5.0 * c5))));
    (place, speed)
}

/// Acceleration of the lateral path of vehicle `slot`, a time `ahead`.
#[inline(always)]
fn path_accel<S: Simd, const N: usize>(state: &State<S, N>, slot: usize, ahead: F32<S>) -> F32<S> {
    let t = min(state.path.elapsed[slot] + ahead, state.path.duration[slot]);
    let [_, _, c2, c3, c4, c5] = state.path.coefficients[slot];
    2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * (20.0 * c5)))
}

/// Answer the side wind after a lag; at the first frame it is held already.
#[inline(always)]
pub fn update_wind_trim<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    step: u32,
) {
    let vehicle = &params.vehicles[slot];
    let pushed = state.friction_and_wind.wind_force[slot] * vehicle.inverse_mass;
    let angle = vehicle.understeer * pushed
        + state.friction_and_wind.wind_moment[slot] * vehicle.moment_angle;
    let target = -select(vehicle.two_wheeler.simd_gt(0.0), pushed, angle);
    if step == 0 {
        state.controls.wind_trim[slot] = target;
    }
    state.controls.wind_trim[slot] = state.controls.wind_trim[slot]
        + (target - state.controls.wind_trim[slot]) * params.derived.wind_trim_share;
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// How far the front wheels may turn from the slip angle on the friction of this decision.
    #[inline(always)]
    pub fn slip_reach(self) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        params.constants.slip_share
            * 0.5
            * (state.friction_and_wind.mu_left[slot] + state.friction_and_wind.mu_right[slot])
            / self.vehicle().front_stiffness
    }
}

/// Drive vehicle `slot` steadily along the bend at the first frame, as who came into it before.
#[inline(always)]
pub fn settle_into_bend<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
) {
    let (constants, vehicle, v) = (
        &params.constants,
        &params.vehicles[slot],
        state.motion.vx[slot],
    );
    let rides = vehicle.two_wheeler.simd_gt(0.0);
    let rate = state.road.curvature[slot] * v;
    let accel = rate * v;
    let slips = vehicle.cg_rear * rate - v * (accel / (constants.gravity * vehicle.rear_stiffness));
    let angle = state.road.curvature[slot] * (vehicle.wheelbase + vehicle.understeer * (v * v));
    state.controls.wheel_angle[slot] = select(rides, accel, angle);
    state.motion.vy[slot] = select(rides, splat(params.simd, 0.0), slips);
    state.motion.heading[slot] = -atan(state.motion.vy[slot] / at_least(v, constants.slip_speed));
    (
        state.motion.sin_heading[slot],
        state.motion.cos_heading[slot],
    ) = sincos(state.motion.heading[slot]);
    (state.motion.yaw_rate[slot], state.motion.accel_lat[slot]) = (rate, accel);
}

/// Turn the front wheels of vehicle `slot`, or lean, towards the path for one step; the angle in its middle.
#[inline(always)]
pub fn steer<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    stride: &StepLength,
) -> F32<S> {
    let wanted = state
        .vehicle(params, slot)
        .requested_steering::<VARIES>(stride.half);
    turn_wheels(state, params, slot, wanted, stride)
}

/// The same for the ego, where another driver has ordered an angle of the front wheels.
#[inline(always)]
pub fn steer_to_angle<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    ordered: F32<S>,
    stride: &StepLength,
) -> F32<S> {
    let (_, lean) = state
        .vehicle(params, EGO_SLOT)
        .requested_steering::<VARIES>(stride.half);
    let limit = params.constants.steering_limit;
    let angle = clamp_to(ordered, -limit, limit);
    turn_wheels(state, params, EGO_SLOT, (angle, lean), stride)
}

/// Turn the front wheels of vehicle `slot`, or lean, as asked, with a lag.
#[inline(always)]
fn turn_wheels<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    (angle, lean): (F32<S>, F32<S>),
    stride: &StepLength,
) -> F32<S> {
    let wheel = state.controls.wheel_angle[slot];
    let turn = clamp_to(
        (angle - wheel) * stride.steering,
        -stride.max_wheel_turn,
        stride.max_wheel_turn,
    );
    let lean = (lean - wheel) * stride.leaning;
    let moved = select(params.vehicles[slot].two_wheeler.simd_gt(0.0), lean, turn);
    let (is_sound, zero) = (
        state.motion.is_wreck[slot].simd_eq(0.0),
        splat(params.simd, 0.0),
    );
    state.controls.wheel_angle[slot] = select(is_sound, wheel + moved, zero);
    state.path.elapsed[slot] += stride.length;
    select(is_sound, wheel + 0.5 * moved, zero)
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Wheel angle and lean that the driver of vehicle `i` asks for, a time `ahead`.
    #[inline(always)]
    fn requested_steering<const VARIES: bool>(self, ahead: f32) -> (F32<S>, F32<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let (place, speed) = path_position(state, slot, ahead);
        let late = select(
            vehicle.two_wheeler.simd_gt(0.0),
            splat(params.simd, constants.two_wheeler_lag),
            constants.steering_lag + vehicle.side_lag * state.motion.vx[slot],
        );
        let accel = path_accel(state, slot, ahead + late);
        let (sine, cosine) = (
            state.motion.sin_heading[slot],
            state.motion.cos_heading[slot],
        );
        let (a_lon, a_lat) = (state.motion.accel_lon[slot], state.motion.accel_lat[slot]);
        let sideways = state.motion.vx[slot] * sine + state.motion.vy[slot] * cosine;
        let d = state.motion.d[slot] + ahead * sideways;
        let sideways = sideways + ahead * (a_lon * sine + a_lat * cosine);
        let vx = state.motion.vx[slot] + ahead * a_lon;
        let vy = state.motion.vy[slot]
            + ahead * (a_lat - state.motion.vx[slot] * state.motion.yaw_rate[slot]);
        let r = state.motion.yaw_rate[slot] + ahead * state.motion.yaw_accel[slot];
        let wanted = accel + constants.velocity_gain * (speed - sideways);
        let aim = place + constants.lane_deviation * state.noise.lane_wander[slot] - d;
        let wanted = wanted + constants.position_gain * aim;
        let mut wanted = clamp(
            wanted,
            -params.simulations.max_lateral_accel,
            params.simulations.max_lateral_accel,
        );
        if VARIES {
            wanted += state.road.curvature_ahead[slot] * (vx * vx);
        }
        let inverse_speed = 1.0 / at_least(vx, constants.slip_speed);
        let felt = wanted + constants.yaw_gain * (wanted - vx * r);
        let angle = felt
            * (vehicle.wheelbase * (inverse_speed * inverse_speed) + vehicle.understeer)
            + state.controls.wind_trim[slot];
        let slip = (vy + vehicle.cg_front * r) * inverse_speed;
        let reach = state.controls.slip_reach[slot];
        let angle = clamp_to(
            clamp(angle, slip - reach, slip + reach),
            -constants.steering_limit,
            constants.steering_limit,
        );
        (angle, wanted + state.controls.wind_trim[slot])
    }
}
