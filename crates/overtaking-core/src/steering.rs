//! Lateral path of a lane change, and the wheel angle that follows it; the twin of
//! `overtaking.sim.reference.steering`, which names the sources.
//!
//! Lateral positions `d`, angles and forces are positive to the left, the overtaking side. The *lean* of a two-wheeler
//! is stated as the lateral acceleration that it balances, and takes the place of the wheel angle. Drivers decide every
//! 0.05 s; a *step* of the motion lasts as long or less.
//!
//! Values of type `F32<S>` and `Mask<S>` have one element for each simulation of a block, the simulations that are
//! computed together. `VehicleHandle` is a view of one vehicle in them. `N` is the number of slots, the vehicles that a
//! simulation can have. The flag `VARIES` is whether the road bends, rises or has several speed limits.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{atan, sincos};
use crate::math::vectors::{F32, Mask, at_least, clamp, clamp_to, min, select, splat};
use crate::params::{Params, StepLength};
use crate::state::{EGO_SLOT, State};
use crate::vehicle_handle::VehicleHandle;

/// A point of the lateral path of a lane change.
struct PathPoint<S: Simd> {
    /// Lateral position [m].
    d: F32<S>,
    /// Velocity across the road [m/s].
    velocity: F32<S>,
}

/// Steering that a driver requests.
struct RequestedSteering<S: Simd> {
    /// Wheel angle [rad].
    angle: F32<S>,
    /// Lateral acceleration of a two-wheeler that leans [m/s^2].
    lean: F32<S>,
}

/// Start a quintic path of the vehicle in `slot` from its present path to the lateral position `end_d` [m], where
/// `starts` holds.
///
/// The path takes `duration` [s]. Position, velocity and acceleration are continuous; at the end velocity and
/// acceleration are 0.
#[inline(always)]
pub fn start_path<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    slot: usize,
    starts: Mask<S>,
    end_d: F32<S>,
    duration: F32<S>,
) {
    let PathPoint { d, velocity } = path_point(state, slot, 0.0);
    let accel = path_accel(state, slot, splat(duration.simd, 0.0)); // Of the present path.
    let t = duration;
    // The terms of third to fifth order must bring about these changes by the end of the path.
    let d_change = end_d - d - velocity * t - 0.5 * accel * (t * t);
    let velocity_change = -(velocity + accel * t);
    let accel_change = -accel;
    let t2 = t * t;
    let t3 = t2 * t;
    let c3 = (10.0 * d_change - 4.0 * (velocity_change * t) + 0.5 * (accel_change * t2)) / t3;
    let c4 = (-15.0 * d_change + 7.0 * (velocity_change * t) - accel_change * t2) / (t3 * t);
    let c5 = (6.0 * d_change - 3.0 * (velocity_change * t) + 0.5 * (accel_change * t2)) / (t3 * t2);
    let zero = splat(t.simd, 0.0);
    let path = &mut state.path;
    for (coefficient, value) in
        path.coefficients[slot]
            .iter_mut()
            .zip([d, velocity, 0.5 * accel, c3, c4, c5])
    {
        *coefficient = select(starts, value, *coefficient);
    }
    path.elapsed[slot] = select(starts, zero, path.elapsed[slot]);
    path.duration[slot] = select(starts, duration, path.duration[slot]);
    let time_since_lane_change = &mut state.lane_choice.time_since_lane_change[slot];
    *time_since_lane_change = select(starts, zero, *time_since_lane_change);
}

/// The point of the lateral path of the vehicle in `slot` that it reaches in `lookahead` seconds.
#[inline(always)]
fn path_point<S: Simd, const N: usize>(
    state: &State<S, N>,
    slot: usize,
    lookahead: f32,
) -> PathPoint<S> {
    let t = min(
        state.path.elapsed[slot] + lookahead,
        state.path.duration[slot],
    );
    let [c0, c1, c2, c3, c4, c5] = state.path.coefficients[slot];
    PathPoint {
        d: c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
        velocity: c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * (5.0 * c5)))),
    }
}

/// Acceleration of the lateral path of the vehicle in `slot`, `lookahead` seconds ahead [m/s^2].
#[inline(always)]
fn path_accel<S: Simd, const N: usize>(
    state: &State<S, N>,
    slot: usize,
    lookahead: F32<S>,
) -> F32<S> {
    let t = min(
        state.path.elapsed[slot] + lookahead,
        state.path.duration[slot],
    );
    let [_, _, c2, c3, c4, c5] = state.path.coefficients[slot];
    2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * (20.0 * c5)))
}

/// Let the driver in `slot` follow the side wind with a lag, once for each decision.
///
/// At the first frame, `step` 0, it holds against the wind already. `wind_trim_share` is the share of the difference
/// that it corrects until the next decision.
#[inline(always)]
pub fn update_wind_trim<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    step: u32,
) {
    let target = state.vehicle(params, slot).wind_trim();
    let wind_trim = &mut state.controls.wind_trim[slot];
    if step == 0 {
        *wind_trim = target;
    }
    *wind_trim = *wind_trim + (target - *wind_trim) * params.derived.wind_trim_share;
}

/// Let the vehicle in `slot` drive steadily along the bend at the first frame, as if it had entered it before.
///
/// The vehicle turns with the road. Its rear points outwards by the slip of the rear tyres, whose stiffness is stated
/// per load.
#[inline(always)]
pub fn settle_into_bend<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let (motion, curvature) = (&mut state.motion, state.road.curvature[slot]);
    let is_two_wheeler = vehicle.two_wheeler.simd_gt(0.0);
    let v = motion.vx[slot];
    let yaw_rate = curvature * v;
    let accel_lat = yaw_rate * v;
    let rear_slip = accel_lat / (constants.gravity * vehicle.rear_stiffness);
    let vy = vehicle.cg_rear * yaw_rate - v * rear_slip;
    let angle = curvature * (vehicle.wheelbase + vehicle.understeer * (v * v));
    state.controls.wheel_angle[slot] = select(is_two_wheeler, accel_lat, angle);
    motion.vy[slot] = select(is_two_wheeler, splat(params.simd, 0.0), vy);
    // The centre moves along the road. `slip_speed` is the least divisor in place of a speed.
    motion.heading[slot] = -atan(motion.vy[slot] / at_least(v, constants.slip_speed));
    (motion.sin_heading[slot], motion.cos_heading[slot]) = sincos(motion.heading[slot]);
    (motion.yaw_rate[slot], motion.accel_lat[slot]) = (yaw_rate, accel_lat);
}

/// Turn the front wheels of the vehicle in `slot`, or lean, towards the path for one step.
///
/// Returns the wheel angle [rad], or of a two-wheeler its lean, a lateral acceleration [m/s^2], in the middle of the
/// step. Wheels and lean follow with a lag: they move towards the request in the middle of the step, which the last
/// step's accelerations predict.
#[inline(always)]
pub fn steer<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    step_length: &StepLength,
) -> F32<S> {
    let driver = state.vehicle(params, slot);
    let request = driver.requested_steering::<VARIES>(step_length.half);
    turn_wheels(state, params, slot, &request, step_length)
}

/// Turn the front wheels of the ego, or lean, towards the angle that an external driver requests, for one step.
///
/// Returns the same as `steer`.
#[inline(always)]
pub fn steer_to_angle<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    ego_wheel_angle: F32<S>,
    step_length: &StepLength,
) -> F32<S> {
    let ego = state.vehicle(params, EGO_SLOT);
    let limit = params.constants.steering_limit;
    let request = RequestedSteering {
        angle: clamp_to(ego_wheel_angle, -limit, limit),
        ..ego.requested_steering::<VARIES>(step_length.half)
    };
    turn_wheels(state, params, EGO_SLOT, &request, step_length)
}

/// Turn the front wheels of the vehicle in `slot`, or lean, as requested, with a lag; returns the same as `steer`.
///
/// The lags are of first order, integrated by the trapezoidal rule: `step_length.steering` and `step_length.leaning`
/// are the shares of the remaining difference that a step corrects.
#[inline(always)]
fn turn_wheels<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    request: &RequestedSteering<S>,
    step_length: &StepLength,
) -> F32<S> {
    let start_angle = state.controls.wheel_angle[slot];
    let max_turn = step_length.max_wheel_turn;
    let turn = clamp_to(
        (request.angle - start_angle) * step_length.steering,
        -max_turn,
        max_turn,
    );
    let lean_change = (request.lean - start_angle) * step_length.leaning;
    let is_two_wheeler = params.vehicles[slot].two_wheeler.simd_gt(0.0);
    let change = select(is_two_wheeler, lean_change, turn);
    // A wreck slides whatever the angle of its wheels, so its angle is 0.
    let is_sound = state.motion.is_wreck[slot].simd_eq(0.0);
    let zero = splat(params.simd, 0.0);
    state.controls.wheel_angle[slot] = select(is_sound, start_angle + change, zero);
    state.path.elapsed[slot] += step_length.length;
    select(is_sound, start_angle + 0.5 * change, zero)
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Wheel angle [rad], or lean [m/s^2], that holds a straight course in the side wind.
    ///
    /// `moment_angle` is the wheel angle per yaw moment of the wind, `understeer` the wheel angle per lateral
    /// acceleration.
    #[inline(always)]
    fn wind_trim(self) -> F32<S> {
        let (wind, slot, vehicle) = (&self.state.friction_and_wind, self.slot, self.vehicle());
        let wind_accel = wind.wind_force[slot] * vehicle.inverse_mass;
        let angle = vehicle.understeer * wind_accel + wind.wind_moment[slot] * vehicle.moment_angle;
        -select(vehicle.two_wheeler.simd_gt(0.0), wind_accel, angle)
    }

    /// Largest difference of the wheel angle from the slip angle of the front axle, on the friction of this decision
    /// [rad].
    ///
    /// Beyond this slip a larger wheel angle gives hardly more side force. With a `slip_share` of 3 the tyre would
    /// slide.
    #[inline(always)]
    pub fn slip_reach(self) -> F32<S> {
        let (friction, slot) = (&self.state.friction_and_wind, self.slot);
        self.params.constants.slip_share * 0.5 * (friction.mu_left[slot] + friction.mu_right[slot])
            / self.vehicle().front_stiffness
    }

    /// Steering that the driver requests `lookahead` seconds ahead.
    ///
    /// A vehicle follows its steering late, by the lag of the wheels and the time in which its tyres build up the side
    /// force. Drivers therefore request the acceleration of the path that far ahead of time.
    #[inline(always)]
    fn requested_steering<const VARIES: bool>(self, lookahead: f32) -> RequestedSteering<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle, motion) = (&params.constants, self.vehicle(), &state.motion);
        let path = path_point(state, slot, lookahead);
        let lag = select(
            vehicle.two_wheeler.simd_gt(0.0),
            splat(params.simd, constants.two_wheeler_lag),
            constants.steering_lag + vehicle.side_lag * motion.vx[slot],
        );
        let feedforward = path_accel(state, slot, lookahead + lag);

        // State after the lookahead of half a step, by the accelerations of the last step. They are forces over the
        // mass, in the vehicle's axes. The turning of these axes changes `vy` as well; its effect on `vx`, and the
        // turning of the road in a bend, are neglected.
        let (sine, cosine) = (motion.sin_heading[slot], motion.cos_heading[slot]);
        let (accel_lon, accel_lat) = (motion.accel_lon[slot], motion.accel_lat[slot]);
        let velocity_d_now = motion.vx[slot] * sine + motion.vy[slot] * cosine;
        let d = motion.d[slot] + lookahead * velocity_d_now;
        let velocity_d = velocity_d_now + lookahead * (accel_lon * sine + accel_lat * cosine);
        let vx = motion.vx[slot] + lookahead * accel_lon;
        let vy =
            motion.vy[slot] + lookahead * (accel_lat - motion.vx[slot] * motion.yaw_rate[slot]);
        let yaw_rate = motion.yaw_rate[slot] + lookahead * motion.yaw_accel[slot];

        // Error of the driver's aim [m]: a standard deviation times a process of unit variance.
        let wander = constants.lane_deviation * state.noise.lane_wander[slot];
        let accel = feedforward + constants.velocity_gain * (path.velocity - velocity_d);
        let accel = accel + constants.position_gain * (path.d + wander - d);
        // The limit holds for moves within the road; drivers follow its bends in any case.
        let max_accel_lat = params.simulations.max_lateral_accel;
        let mut accel = clamp(accel, -max_accel_lat, max_accel_lat);
        if VARIES {
            // The curvature where the vehicle will be when it responds.
            accel += state.road.curvature_ahead[slot] * (vx * vx);
        }
        let inverse_speed = 1.0 / at_least(vx, constants.slip_speed);
        // Feedback of the yaw rate damps the steering; without it, trucks weave.
        let damped_accel = accel + constants.yaw_gain * (accel - vx * yaw_rate);
        let angle_per_accel =
            vehicle.wheelbase * (inverse_speed * inverse_speed) + vehicle.understeer;
        let wind_trim = state.controls.wind_trim[slot];
        let angle = damped_accel * angle_per_accel + wind_trim;

        // Beyond the slip angle `reach` a larger wheel angle gives hardly more side force; so drivers steer a sliding
        // vehicle into the slide.
        let slip = (vy + vehicle.cg_front * yaw_rate) * inverse_speed;
        let reach = state.controls.slip_reach[slot];
        let limit = constants.steering_limit;
        RequestedSteering {
            angle: clamp_to(clamp(angle, slip - reach, slip + reach), -limit, limit),
            lean: accel + wind_trim,
        }
    }
}
