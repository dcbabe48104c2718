//! Motion of a vehicle over one step: single-track model with Fiala tyres, leaning point mass, sliding wreck. The twin
//! of `overtaking.sim.reference.vehicle_dynamics`, which names the sources.
//!
//! The sideways motion on four wheels is fast compared with a step of 50 ms, and stiff at low speed. A linearly
//! implicit step therefore advances side speed and yaw rate together: it computes the forces and their slopes once, and
//! solves two linear equations. docs/explanation/model.md derives it.
//!
//! Velocities are in the vehicle's axes: `vx` ahead, `vy` to the left. Lateral positions, forces, angles and yaw rates
//! are positive to the left. A wreck is a vehicle that has collided or has left the road. Values of type `F32<S>` and
//! `Mask<S>` have one element for each simulation of a block, the simulations that are computed together;
//! `VehicleHandle` is a view of one vehicle in them. `N` is the number of slots, the vehicles that a simulation can
//! have. The flag `VARIES` is whether the road bends, rises or has several speed limits.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::sincos;
use crate::math::vectors::{
    F32, Mask, assign_where, at_least, clamp, clamp_to, max, min, select, splat,
};
use crate::params::{Params, StepLength};
use crate::state::State;
use crate::vehicle_handle::VehicleHandle;

/// Keeps the direction of a wreck at rest finite [m/s].
const MIN_SLIDING_SPEED: f32 = 1e-3;
/// Smallest square of the largest lateral force [N^2].
///
/// `fiala_force` divides by that force, which would be 0 at full braking.
const MIN_SQUARED_LATERAL_GRIP: f32 = 1.0;

/// Length of a step, and motion and controls in its middle.
struct MidStep<'a, S: Simd> {
    /// Length of the step.
    step_length: &'a StepLength,
    /// Speed, extrapolated by the acceleration of the last step [m/s].
    speed: F32<S>,
    /// One over the speed, or over `slip_speed` at lower speeds, where the equations of tyre slip are stiff [s/m].
    inverse_speed: F32<S>,
    /// Front wheel angle [rad], or requested lean of a two-wheeler as the lateral acceleration that it balances
    /// [m/s^2].
    wheel_angle: F32<S>,
    /// Air drag and rolling resistance [N].
    level_resistance: F32<S>,
    /// Air drag, rolling resistance and the pull of the slope [N].
    resistance: F32<S>,
}

/// Loads and forces of one axle.
struct Axle<S: Simd> {
    /// Load [N].
    load: F32<S>,
    /// Longitudinal force [N].
    force_lon: F32<S>,
    /// Longitudinal force of the right side minus the left side's [N].
    force_difference: F32<S>,
    /// Largest lateral force [N].
    max_lateral_force: F32<S>,
}

/// Both axles of a vehicle.
struct Axles<S: Simd> {
    /// Front axle.
    front: Axle<S>,
    /// Rear axle.
    rear: Axle<S>,
}

/// Lateral force of an axle.
struct TyreForce<S: Simd> {
    /// Force against the slip, positive to the left [N].
    force: F32<S>,
    /// Growth of the size of the force per slip; slip is side speed over speed [N].
    slope: F32<S>,
}

/// Result of a step, without its mean accelerations, which are stored in the state.
#[derive(Clone, Copy)]
pub struct MotionStep<S: Simd> {
    /// Velocity ahead at the end, in the vehicle's axes [m/s].
    vx: F32<S>,
    /// Velocity to the left at the end [m/s].
    vy: F32<S>,
    /// Yaw rate at the end [rad/s].
    yaw_rate: F32<S>,
    /// Mean yaw rate [rad/s].
    mean_yaw_rate: F32<S>,
}

impl<S: Simd> MotionStep<S> {
    /// A step of a vehicle that stands.
    pub fn standstill(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        Self {
            vx: zero,
            vy: zero,
            yaw_rate: zero,
            mean_yaw_rate: zero,
        }
    }

    /// The fields of `step` where the mask holds, else of this step.
    #[inline(always)]
    fn replace_where(self, mask: Mask<S>, step: Self) -> Self {
        Self {
            vx: select(mask, step.vx, self.vx),
            vy: select(mask, step.vy, self.vy),
            yaw_rate: select(mask, step.yaw_rate, self.yaw_rate),
            mean_yaw_rate: select(mask, step.mean_yaw_rate, self.mean_yaw_rate),
        }
    }
}

/// Lateral force of an axle, and its slope.
///
/// `stiffness` is the cornering stiffness of the axle [N/rad], `max_force` its largest lateral force [N].
/// `velocity_across` and `velocity_along` are the velocities of its wheels across and along their planes. Only their
/// ratio counts, so any unit serves.
#[inline(always)]
fn fiala_force<S: Simd>(
    stiffness: F32<S>,
    velocity_across: F32<S>,
    velocity_along: F32<S>,
    max_force: F32<S>,
) -> TyreForce<S> {
    // Slip over the slip from which the whole contact patch slides.
    let z = stiffness * velocity_across / (3.0 * max_force * velocity_along);
    // Share of the contact patch that sticks.
    let sticking_share = at_least(1.0 - z.abs(), 0.0);
    let size = max_force * (1.0 - sticking_share * sticking_share * sticking_share);
    TyreForce {
        force: select(z.simd_lt(0.0), size, -size),
        slope: stiffness * (sticking_share * sticking_share),
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Speed and resistance in the middle of the step, by the acceleration of the last one.
    #[inline(always)]
    fn mid_step<const VARIES: bool>(
        self,
        wheel_angle: F32<S>,
        step_length: &StepLength,
    ) -> MidStep<'_, S> {
        let (state, slot) = (self.state, self.slot);
        let (constants, vehicle) = (&self.params.constants, self.vehicle());
        let speed = at_least(
            state.motion.vx[slot] + step_length.half * state.motion.accel_lon[slot],
            0.0,
        );
        let air_speed = speed - state.friction_and_wind.tail_wind[slot];
        let level_resistance = vehicle.drag * air_speed * air_speed.abs() + vehicle.rolling;
        let mut resistance = level_resistance;
        if VARIES {
            resistance += constants.gravity * vehicle.mass * state.road.sin_slope[slot];
        }
        MidStep {
            step_length,
            speed,
            inverse_speed: 1.0 / at_least(speed, constants.slip_speed),
            wheel_angle,
            level_resistance,
            resistance,
        }
    }

    /// Tyre force requested for an acceleration, within engine, governor and brakes [N].
    #[inline(always)]
    fn requested_force(self, requested_accel: F32<S>, mid: &MidStep<'_, S>) -> F32<S> {
        let (params, vehicle) = (self.params, self.vehicle());
        let force = vehicle.mass * requested_accel + mid.resistance;
        let engine_force = min(vehicle.launch_force, vehicle.power * mid.inverse_speed);
        // The governor closes the throttle over a band of speeds above the largest speed.
        let speed_margin = vehicle.max_speed + params.constants.governor_band - mid.speed;
        let throttle = clamp_to(speed_margin * params.derived.per_governor_band, 0.0, 1.0);
        max(
            min(force, engine_force * throttle),
            -vehicle.max_brake_force,
        )
    }

    /// Share of the friction that a requested longitudinal force may use [1].
    ///
    /// Traction control lets the engine use a smaller share than anti-lock brakes let the brakes use: driven wheels at
    /// their limit could not keep the vehicle on course. A two-wheeler, a point mass without tyre slip, stays on course
    /// without it.
    #[inline(always)]
    fn friction_share(self, force: F32<S>) -> F32<S> {
        let (constants, simd) = (&self.params.constants, self.params.simd);
        let has_traction_control = force.simd_gt(0.0) & self.vehicle().two_wheeler.simd_eq(0.0);
        select(
            has_traction_control,
            splat(simd, constants.traction_share),
            splat(simd, constants.abs_share),
        )
    }

    /// Forces of one axle for a requested longitudinal force [N] under a load [N].
    ///
    /// Each side transmits as much as its own friction allows, which turns the vehicle on split friction.
    #[inline(always)]
    fn axle_forces(self, force: F32<S>, load: F32<S>) -> Axle<S> {
        let (friction, slot) = (&self.state.friction_and_wind, self.slot);
        let (mu_left, mu_right) = (friction.mu_left[slot], friction.mu_right[slot]);
        let half_load = 0.5 * load;
        let share = self.friction_share(force);
        let max_left = share * mu_left * half_load;
        let max_right = share * mu_right * half_load;
        let left = clamp(0.5 * force, -max_left, max_left);
        let right = clamp(0.5 * force, -max_right, max_right);
        let force_lon = left + right;
        // Friction circle: longitudinal and lateral force together are at most the grip.
        let grip = (mu_left + mu_right) * half_load;
        let squared_lateral_grip = at_least(
            grip * grip - force_lon * force_lon,
            MIN_SQUARED_LATERAL_GRIP,
        );
        Axle {
            load,
            force_lon,
            force_difference: right - left,
            max_lateral_force: squared_lateral_grip.sqrt(),
        }
    }

    /// Share of the load on the front axle at an acceleration, 0 to 1.
    ///
    /// It is never negative: an axle can lift off the road, but not pull at it.
    #[inline(always)]
    fn front_load_share(self, accel: F32<S>) -> F32<S> {
        let vehicle = self.vehicle();
        // An acceleration moves the load backwards, as if the centre of gravity lay so much farther back [m].
        let shift = accel * vehicle.cg_height * self.params.derived.inverse_gravity;
        vehicle.inverse_wheelbase
            * (vehicle.cg_rear - clamp(shift, -vehicle.cg_front, vehicle.cg_rear))
    }

    /// Largest acceleration that friction allows [m/s^2].
    #[inline(always)]
    pub fn max_friction_accel(self) -> F32<S> {
        let (friction, slot) = (&self.state.friction_and_wind, self.slot);
        self.params.constants.gravity * 0.5 * (friction.mu_left[slot] + friction.mu_right[slot])
    }

    /// Loads and forces of both axles for a requested force [N].
    ///
    /// The loads depend on the acceleration of this step, which depends on the loads. They are computed from an
    /// estimate of the acceleration: the requested force, limited by friction under the loads of the last step, minus
    /// resistance and the backward part of the side force at the turned front wheels.
    #[inline(always)]
    fn axles(self, force: F32<S>, mid: &MidStep<'_, S>) -> Axles<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let is_two_wheeler = vehicle.two_wheeler.simd_gt(0.0);
        let brakes = force.simd_lt(0.0);
        // The acceleration of the last step contains the pull of the slope, which should not count (see below). This
        // error reaches the estimate by `steering_loss`, and where friction limits the force of an axle. Unlimited,
        // both forces add up to `force` at any load.
        let front_load_share = self.front_load_share(state.motion.accel_lon[slot]);
        // `front_drive` is the share of the engine's force at the front axle.
        let front_force_share = select(brakes, front_load_share, vehicle.front_drive);
        let max_accel = self.friction_share(force) * self.max_friction_accel();
        let accel = force * vehicle.inverse_mass;
        let max_front = max_accel * front_load_share;
        let max_rear = max_accel * (1.0 - front_load_share);
        let front_accel = clamp(front_force_share * accel, -max_front, max_front);
        let rear_accel = clamp((1.0 - front_force_share) * accel, -max_rear, max_rear);
        let accel = front_accel + rear_accel;
        // In steady cornering the front axle carries this share of the side force too; the angle stands for its sine.
        let steering_loss = select(
            is_two_wheeler,
            splat(params.simd, 0.0),
            state.motion.accel_lat[slot] * front_load_share * mid.wheel_angle,
        );
        // The pull of a slope has no moment about the centre of gravity, so it is not subtracted. Air drag counts as if
        // it acted at the road.
        let front_load_share = self
            .front_load_share(accel - mid.level_resistance * vehicle.inverse_mass - steering_loss);
        // Brakes follow the load, so that no axle locks before the other (required by UN R13-H).
        let front_force_share = select(brakes, front_load_share, vehicle.front_drive);
        let weight = constants.gravity * vehicle.mass;
        Axles {
            front: self.axle_forces(front_force_share * force, weight * front_load_share),
            rear: self.axle_forces(
                (1.0 - front_force_share) * force,
                weight * (1.0 - front_load_share),
            ),
        }
    }

    /// Yaw moment of stability control, which brakes single wheels [N m].
    ///
    /// It reacts to a yaw rate that differs by more than a threshold from the yaw rate that the wheel angle requests
    /// and friction allows. It uses at most the braking force of one wheel. The loss of speed by this braking is
    /// neglected.
    #[inline(always)]
    fn stability_control(self, mid: &MidStep<'_, S>) -> F32<S> {
        let (constants, vehicle, speed) = (&self.params.constants, self.vehicle(), mid.speed);
        let max_accel = self.max_friction_accel();
        let max_yaw_rate = max_accel / at_least(speed, constants.slip_speed);
        let requested =
            speed * mid.wheel_angle / (vehicle.wheelbase + vehicle.understeer * (speed * speed));
        let error =
            self.state.motion.yaw_rate[self.slot] - clamp(requested, -max_yaw_rate, max_yaw_rate);
        let threshold = constants.stability_threshold;
        let error = error - clamp_to(error, -threshold, threshold);
        // A wheel carries a quarter of the weight.
        let max_moment = 0.25 * max_accel * vehicle.mass * vehicle.half_track;
        // The moment that would remove the error within `stability_time`.
        let moment = -error * (1.0 / constants.stability_time) / vehicle.inverse_inertia;
        clamp(moment, -max_moment, max_moment)
    }
}

/// Advance the vehicle in `slot` by one step up to its new velocity, and store its mean accelerations.
///
/// `wheel_angle` is as in `MidStep`.
#[inline(always)]
pub fn compute_step<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    wheel_angle: F32<S>,
    step_length: &StepLength,
) -> MotionStep<S> {
    let vehicle = &params.vehicles[slot];
    let handle = state.vehicle(params, slot);
    let mid = handle.mid_step::<VARIES>(wheel_angle, step_length);
    let force = handle.requested_force(state.controls.requested_accel[slot], &mid);
    let axles = handle.axles(force, &mid);
    let tyre_force = axles.front.force_lon + axles.rear.force_lon;
    let accel_lon = (tyre_force - mid.resistance) * vehicle.inverse_mass;
    let mut motion_step = single_track_step(state, params, slot, &axles, &mid);
    let is_two_wheeler = vehicle.two_wheeler.simd_gt(0.0);
    if is_two_wheeler.any_true() {
        let leaning_step = leaning_step(state, params, slot, accel_lon, &mid);
        motion_step = motion_step.replace_where(is_two_wheeler, leaning_step);
    }
    motion_step.vx = at_least(motion_step.vx, 0.0); // Vehicles do not reverse.
    state
        .vehicle(params, slot)
        .stop_when_creeping(&mut motion_step);
    motion_step
}

/// A step of the single-track model; side speed and yaw rate by the linearised equations. Stores its accelerations.
#[inline(always)]
fn single_track_step<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    axles: &Axles<S>,
    mid: &MidStep<'_, S>,
) -> MotionStep<S> {
    let (vehicle, inverse_speed) = (&params.vehicles[slot], mid.inverse_speed);
    let step_length = mid.step_length;
    let Axles { front, rear } = axles;
    let motion = &state.motion;
    let (vx, vy, yaw_rate) = (motion.vx[slot], motion.vy[slot], motion.yaw_rate[slot]);
    let wind_force = state.friction_and_wind.wind_force[slot];
    let wind_moment = state.friction_and_wind.wind_moment[slot];
    let (sine, cosine) = sincos(mid.wheel_angle);

    // Side speed of each axle over the speed; the front wheels are turned by the wheel angle.
    let u = (vy + vehicle.cg_front * yaw_rate) * inverse_speed;
    let front_tyre = fiala_force(
        vehicle.front_stiffness * front.load,
        u * cosine - sine,
        cosine + u * sine,
        front.max_lateral_force,
    );
    let u = (vy - vehicle.cg_rear * yaw_rate) * inverse_speed;
    let rear_tyre = fiala_force(
        vehicle.rear_stiffness * rear.load,
        u,
        splat(params.simd, 1.0),
        rear.max_lateral_force,
    );
    let front_slope = front_tyre.slope * inverse_speed;
    let rear_slope = rear_tyre.slope * inverse_speed;

    // Rates of change of side speed and yaw rate at the start of the step.
    let front_side_force = front_tyre.force * cosine + front.force_lon * sine;
    // Moment of unequal longitudinal forces on the two sides.
    let split_moment = vehicle.half_track * (front.force_difference + rear.force_difference);
    let side_force = front_side_force + rear_tyre.force + wind_force;
    let vy_rate = side_force * vehicle.inverse_mass - mid.speed * yaw_rate;
    let extra_moment = split_moment + state.vehicle(params, slot).stability_control(mid);
    let moment = vehicle.cg_front * front_side_force - vehicle.cg_rear * rear_tyre.force
        + wind_moment
        + extra_moment;
    let yaw_accel = moment * vehicle.inverse_inertia;

    // (1 - h/2 J) (change of vy, change of the yaw rate) = h (rates). J is the derivative of the rates by side speed
    // and yaw rate: slopes of the side forces, and the term speed * yaw_rate. It neglects terms of second order in the
    // wheel angle, and stability control.
    let half_step = step_length.half;
    let front_arm = vehicle.cg_front * (front_slope * cosine);
    let rear_arm = vehicle.cg_rear * rear_slope;
    let per_mass = half_step * vehicle.inverse_mass;
    let per_inertia = half_step * vehicle.inverse_inertia;
    let a11 = 1.0 + per_mass * (front_slope * cosine + rear_slope);
    let a12 = per_mass * (front_arm - rear_arm) + half_step * mid.speed;
    let a21 = per_inertia * (front_arm - rear_arm);
    let a22 = 1.0 + per_inertia * (vehicle.cg_front * front_arm + vehicle.cg_rear * rear_arm);
    let scale = step_length.length / (a11 * a22 - a12 * a21);
    let vy_change = scale * (a22 * vy_rate - a12 * yaw_accel);
    let yaw_rate_change = scale * (a11 * yaw_accel - a21 * vy_rate);

    // The side force of turned front wheels points partly backwards, and so decelerates the vehicle. It is taken in the
    // middle of the step.
    let side_speed_change = 0.5 * (vy_change + vehicle.cg_front * yaw_rate_change);
    let front_force_mid = front_tyre.force - front_slope * side_speed_change;
    let force_lon =
        front.force_lon * cosine - front_force_mid * sine + rear.force_lon - mid.resistance;
    let accel_lon = force_lon * vehicle.inverse_mass;
    let mean_yaw_rate = yaw_rate + 0.5 * yaw_rate_change;
    let mean_vy = vy + 0.5 * vy_change;
    state.motion.accel_lon[slot] = accel_lon;
    // The turning of the axes takes `speed * yaw_rate` off the rate of `vy`.
    state.motion.accel_lat[slot] = vy_change * step_length.inverse + mid.speed * mean_yaw_rate;
    MotionStep {
        vx: vx + step_length.length * (accel_lon + mean_vy * mean_yaw_rate),
        vy: vy + vy_change,
        yaw_rate: yaw_rate + yaw_rate_change,
        mean_yaw_rate,
    }
}

/// A step of a two-wheeler: a point mass that leans by its driver's request and the wind, within friction.
///
/// It turns at once as it leans, so its yaw rate at the end is the one in the middle of the step. Stores the
/// accelerations of two-wheelers; the result is undefined for other vehicles.
#[inline(always)]
fn leaning_step<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    accel_lon: F32<S>,
    mid: &MidStep<'_, S>,
) -> MotionStep<S> {
    let vehicle = &params.vehicles[slot];
    let is_two_wheeler = vehicle.two_wheeler.simd_gt(0.0);
    let max_accel = state.vehicle(params, slot).max_friction_accel();
    let wind_accel = state.friction_and_wind.wind_force[slot] * vehicle.inverse_mass;
    let accel_lat = clamp(mid.wheel_angle + wind_accel, -max_accel, max_accel);
    let yaw_rate = accel_lat * mid.inverse_speed;
    assign_where(&mut state.motion.accel_lon[slot], is_two_wheeler, accel_lon);
    assign_where(&mut state.motion.accel_lat[slot], is_two_wheeler, accel_lat);
    MotionStep {
        vx: state.motion.vx[slot] + mid.step_length.length * accel_lon,
        vy: splat(params.simd, 0.0),
        yaw_rate,
        mean_yaw_rate: yaw_rate,
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Stop a vehicle that hardly moves and whose driver does not request acceleration.
    #[inline(always)]
    fn stop_when_creeping(self, motion_step: &mut MotionStep<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let standstill = params.constants.standstill;
        let creeps = motion_step.vx.simd_lt(standstill) & motion_step.vy.abs().simd_lt(standstill);
        let stops = creeps & state.controls.requested_accel[slot].simd_le(0.0);
        let zero = splat(params.simd, 0.0);
        motion_step.vx = select(stops, zero, motion_step.vx);
        motion_step.vy = select(stops, zero, motion_step.vy);
        motion_step.yaw_rate = select(stops, zero, motion_step.yaw_rate);
        // The yaw rate falls from its present value to 0 during the step.
        motion_step.mean_yaw_rate = select(
            stops,
            0.5 * state.motion.yaw_rate[slot],
            motion_step.mean_yaw_rate,
        );
    }
}

/// Move the vehicle in `slot` by the mean of the old and the new velocity, and store the new motion.
///
/// Each vehicle measures `s` in its own direction of travel. In a bend the road turns under the vehicle by its
/// curvature times the driven distance. A wreck with locked wheels keeps the direction of its velocity over ground
/// until it rests, even if its body or the road turns.
#[inline(always)]
pub fn update_position<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    motion_step: MotionStep<S>,
    step_length: &StepLength,
) {
    let is_wreck = state.motion.is_wreck[slot].simd_gt(0.0);
    let (along, across) = state.vehicle(params, slot).road_velocity(); // Before the step [m/s].
    let mut yaw_rate = motion_step.yaw_rate;
    let mut kept_share = splat(params.simd, 1.0);
    if is_wreck.any_true() {
        let slide = slide_wreck(state, params, slot, step_length);
        yaw_rate = select(is_wreck, slide.yaw_rate, yaw_rate);
        kept_share = slide.kept_share;
    }
    let motion = &mut state.motion;
    let mean_yaw_rate = select(
        is_wreck,
        0.5 * (motion.yaw_rate[slot] + yaw_rate),
        motion_step.mean_yaw_rate,
    );
    motion.heading[slot] += step_length.length * mean_yaw_rate;
    let mut sliding_velocity = (along, across);
    if VARIES {
        // The new speed along the road depends on this turn, so the mean speed is extrapolated instead. The angle to
        // the road is neglected in it. `curvature` belongs to the vehicle's path along the road, positive to the
        // left.
        let road_turn = step_length.length
            * (state.road.curvature[slot] * (along + step_length.half * motion.accel_lon[slot]));
        motion.heading[slot] -= road_turn;
        // The axes of the road turn by `road_turn`, so a constant velocity turns back against them.
        let (sine, cosine) = sincos(road_turn);
        sliding_velocity = (
            along * cosine + across * sine,
            across * cosine - along * sine,
        );
    }
    let (sine, cosine) = sincos(motion.heading[slot]);
    (motion.sin_heading[slot], motion.cos_heading[slot]) = (sine, cosine);
    let mut new_along = motion_step.vx * cosine - motion_step.vy * sine;
    let mut new_across = motion_step.vx * sine + motion_step.vy * cosine;
    (motion.vx[slot], motion.vy[slot]) = (motion_step.vx, motion_step.vy);
    if is_wreck.any_true() {
        new_along = select(is_wreck, sliding_velocity.0 * kept_share, new_along);
        new_across = select(is_wreck, sliding_velocity.1 * kept_share, new_across);
        let vx = new_along * cosine + new_across * sine;
        let vy = new_across * cosine - new_along * sine;
        motion.vx[slot] = select(is_wreck, vx, motion_step.vx);
        motion.vy[slot] = select(is_wreck, vy, motion_step.vy);
    }
    let distance = step_length.half * (along + new_along);
    motion.s[slot] += if VARIES {
        distance * state.road.station_per_metre[slot]
    } else {
        distance
    };
    motion.d[slot] += step_length.half * (across + new_across);
    motion.yaw_accel[slot] = (yaw_rate - motion.yaw_rate[slot]) * step_length.inverse;
    motion.yaw_rate[slot] = yaw_rate;
}

/// A step of a wreck that slides with locked wheels.
struct WreckSlide<S: Simd> {
    /// Yaw rate at the end [rad/s].
    yaw_rate: F32<S>,
    /// Share of the velocity that is left at the end, 0 to 1.
    kept_share: F32<S>,
}

/// Slide a wreck in `slot`, and store its accelerations.
///
/// Sliding friction takes a share of a wreck's speed, and its moment slows the spin. The formula assumes a body that
/// only spins, with its weight at half the wheelbase from the centre. `sliding_ratio` is the sliding friction over the
/// peak friction.
#[inline(always)]
fn slide_wreck<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    step_length: &StepLength,
) -> WreckSlide<S> {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let handle = state.vehicle(params, slot);
    let (along, across) = handle.road_velocity();
    let speed = (along * along + across * across).sqrt();
    let sliding_decel = constants.sliding_ratio * handle.max_friction_accel();
    let lost_share =
        min(sliding_decel * step_length.length, speed) / at_least(speed, MIN_SLIDING_SPEED);
    let max_spin_change = sliding_decel
        * vehicle.mass
        * vehicle.inverse_inertia
        * 0.5
        * vehicle.wheelbase
        * step_length.length;
    let motion = &mut state.motion;
    let is_wreck = motion.is_wreck[slot].simd_gt(0.0);
    let rate = -(lost_share * step_length.inverse);
    motion.accel_lon[slot] = select(is_wreck, rate * motion.vx[slot], motion.accel_lon[slot]);
    motion.accel_lat[slot] = select(is_wreck, rate * motion.vy[slot], motion.accel_lat[slot]);
    let spin = motion.yaw_rate[slot];
    WreckSlide {
        yaw_rate: spin - clamp(spin, -max_spin_change, max_spin_change),
        kept_share: 1.0 - lost_share,
    }
}
