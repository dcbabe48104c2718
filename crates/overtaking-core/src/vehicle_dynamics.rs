//! Motion of a vehicle over one step; see `overtaking.sim.reference.vehicle_dynamics`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::sincos;
use crate::math::vectors::{
    F32, Mask, assign_where, at_least, clamp, clamp_to, max, min, select, splat,
};
use crate::names::{ModelConstants, VehicleParams};
use crate::params::{Params, StepLength};
use crate::state::State;
use crate::vehicle_handle::VehicleHandle;

/// Keeps the direction of a wreck at rest finite [m/s].
const MIN_SLIDING_SPEED: f32 = 1e-3;
/// Left sideways by full braking, squared, to divide by [N^2].
const MIN_LATERAL_GRIP: f32 = 1.0;

/// Loads and forces of one axle.
struct Axle<S: Simd> {
    load: F32<S>,
    force_lon: F32<S>,
    force_difference: F32<S>,
    max_lateral_force: F32<S>,
}

/// What a step comes to: velocity and yaw rate at its end, and the mean yaw rate.
#[derive(Clone, Copy)]
pub struct MotionStep<S: Simd> {
    vx: F32<S>,
    vy: F32<S>,
    yaw_rate: F32<S>,
    mean_yaw_rate: F32<S>,
}

impl<S: Simd> MotionStep<S> {
    /// At rest.
    pub fn none(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        Self {
            vx: zero,
            vy: zero,
            yaw_rate: zero,
            mean_yaw_rate: zero,
        }
    }
}

/// Lateral force of an axle against the slip, and how fast it grows with the slip.
#[inline(always)]
fn fiala_force<S: Simd>(
    stiffness: F32<S>,
    across: F32<S>,
    along: F32<S>,
    limit: F32<S>,
) -> (F32<S>, F32<S>) {
    let one = splat(across.simd, 1.0);
    let z = stiffness * across / (3.0 * limit * along);
    let sticks = at_least(one - z.abs(), 0.0);
    let size = limit * (one - sticks * sticks * sticks);
    (
        select(z.simd_lt(0.0), size, -size),
        stiffness * (sticks * sticks),
    )
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    #[inline(always)]
    fn requested_force(
        self,
        accel: F32<S>,
        resistance: F32<S>,
        speed: F32<S>,
        inverse_speed: F32<S>,
    ) -> F32<S> {
        let params = self.params;
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let wanted = vehicle.mass * accel + resistance;
        let engine = min(vehicle.launch_force, vehicle.power * inverse_speed);
        let throttle = clamp_to(
            (vehicle.max_speed + constants.governor_band - speed)
                * params.derived.per_governor_band,
            0.0,
            1.0,
        );
        max(min(wanted, engine * throttle), -vehicle.max_brake_force)
    }
}

/// Forces of one axle under a load that is asked for a longitudinal force.
#[inline(always)]
fn axle_forces<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    mu_fast: F32<S>,
    mu_slow: F32<S>,
    force: F32<S>,
    load: F32<S>,
) -> Axle<S> {
    let half_load = 0.5 * load;
    let share = select(
        force.simd_gt(0.0) & vehicle.two_wheeler.simd_eq(0.0),
        splat(force.simd, constants.traction_share),
        splat(force.simd, constants.abs_share),
    );
    let bound_fast = share * mu_fast * half_load;
    let bound_slow = share * mu_slow * half_load;
    let fast = clamp(0.5 * force, -bound_fast, bound_fast);
    let slow = clamp(0.5 * force, -bound_slow, bound_slow);
    let total = fast + slow;
    let grip = (mu_fast + mu_slow) * half_load;
    let left = at_least(grip * grip - total * total, MIN_LATERAL_GRIP);
    Axle {
        load,
        force_lon: total,
        force_difference: slow - fast,
        max_lateral_force: left.sqrt(),
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Share of the load on the front axle at an acceleration.
    #[inline(always)]
    fn front_load_share(self, accel: F32<S>) -> F32<S> {
        let params = self.params;
        let vehicle = self.vehicle();
        let lifted = accel * vehicle.cg_height * params.derived.inverse_gravity;
        vehicle.inverse_wheelbase
            * (vehicle.cg_rear - clamp(lifted, -vehicle.cg_front, vehicle.cg_rear))
    }

    /// Largest acceleration that friction allows.
    #[inline(always)]
    fn max_friction_accel(self, constants: &ModelConstants) -> F32<S> {
        let (state, slot) = (self.state, self.slot);
        constants.gravity
            * 0.5
            * (state.friction_and_wind.mu_left[slot] + state.friction_and_wind.mu_right[slot])
    }

    /// Loads and forces of the front and the rear axle.
    #[inline(always)]
    fn axles(self, force: F32<S>, resistance: F32<S>, angle: F32<S>) -> (Axle<S>, Axle<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let rides = vehicle.two_wheeler.simd_gt(0.0);
        let brakes = force.simd_lt(0.0);
        let weight = self.front_load_share(state.motion.accel_lon[slot]);
        let share = select(brakes, weight, vehicle.front_drive);
        let limit = select(
            force.simd_gt(0.0) & !rides,
            splat(params.simd, constants.traction_share),
            splat(params.simd, constants.abs_share),
        ) * self.max_friction_accel(constants);
        let asked = force * vehicle.inverse_mass;
        let (front, rear) = (limit * weight, limit * (1.0 - weight));
        let asked = clamp(share * asked, -front, front) + clamp((1.0 - share) * asked, -rear, rear);
        let held = select(
            rides,
            splat(params.simd, 0.0),
            state.motion.accel_lat[slot] * weight * angle,
        );
        let weight = self.front_load_share(asked - resistance * vehicle.inverse_mass - held);
        let share = select(brakes, weight, vehicle.front_drive);
        let whole = constants.gravity * vehicle.mass;
        let (fast, slow) = (
            state.friction_and_wind.mu_left[slot],
            state.friction_and_wind.mu_right[slot],
        );
        (
            axle_forces(
                constants,
                vehicle,
                fast,
                slow,
                share * force,
                whole * weight,
            ),
            axle_forces(
                constants,
                vehicle,
                fast,
                slow,
                (1.0 - share) * force,
                whole * (1.0 - weight),
            ),
        )
    }
}

/// Advance vehicle `slot` by one step up to its new velocity, with this wheel angle or lean in the middle;
/// the accelerations are kept in the state.
#[inline(always)]
pub fn compute_step<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    angle: F32<S>,
    stride: &StepLength,
) -> MotionStep<S> {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let speed = at_least(
        state.motion.vx[slot] + stride.half * state.motion.accel_lon[slot],
        0.0,
    );
    let inverse_speed = 1.0 / at_least(speed, constants.slip_speed);
    let air = speed - state.friction_and_wind.tail_wind[slot];
    let held_back = vehicle.drag * air * air.abs() + vehicle.rolling;
    let mut resistance = held_back;
    if VARIES {
        resistance += constants.gravity * vehicle.mass * state.road.sin_slope[slot];
    }
    let force = state.vehicle(params, slot).requested_force(
        state.controls.requested_accel[slot],
        resistance,
        speed,
        inverse_speed,
    );
    let (front, rear) = state.vehicle(params, slot).axles(force, held_back, angle);
    let straight = (front.force_lon + rear.force_lon - resistance) * vehicle.inverse_mass;
    let mut motion = single_track_step(
        state,
        params,
        slot,
        &(front, rear),
        resistance,
        (speed, inverse_speed),
        angle,
        stride,
    );
    let rides = vehicle.two_wheeler.simd_gt(0.0);
    if rides.any_true() {
        leaning_step(
            state,
            params,
            slot,
            rides,
            straight,
            (inverse_speed, angle),
            stride,
            &mut motion,
        );
    }
    let zero = splat(params.simd, 0.0);
    motion.vx = at_least(motion.vx, 0.0);
    let creeps =
        motion.vx.simd_lt(constants.standstill) & motion.vy.abs().simd_lt(constants.standstill);
    let stands = creeps & state.controls.requested_accel[slot].simd_le(0.0);
    motion.vx = select(stands, zero, motion.vx);
    motion.vy = select(stands, zero, motion.vy);
    motion.yaw_rate = select(stands, zero, motion.yaw_rate);
    motion.mean_yaw_rate = select(
        stands,
        0.5 * state.motion.yaw_rate[slot],
        motion.mean_yaw_rate,
    );
    motion
}

/// A step of the single-track model; side speed and yaw rate by the linearised equations.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn single_track_step<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    (front, rear): &(Axle<S>, Axle<S>),
    resistance: F32<S>,
    (speed, inverse_speed): (F32<S>, F32<S>),
    angle: F32<S>,
    stride: &StepLength,
) -> MotionStep<S> {
    let vehicle = &params.vehicles[slot];
    let (vx, vy, r) = (
        state.motion.vx[slot],
        state.motion.vy[slot],
        state.motion.yaw_rate[slot],
    );
    let (sine, cosine) = sincos(angle);
    let u = (vy + vehicle.cg_front * r) * inverse_speed;
    let (front_y, front_k) = fiala_force(
        vehicle.front_stiffness * front.load,
        u * cosine - sine,
        cosine + u * sine,
        front.max_lateral_force,
    );
    let u = (vy - vehicle.cg_rear * r) * inverse_speed;
    let one = splat(u.simd, 1.0);
    let (rear_y, rear_k) = fiala_force(
        vehicle.rear_stiffness * rear.load,
        u,
        one,
        rear.max_lateral_force,
    );
    let (front_k, rear_k) = (front_k * inverse_speed, rear_k * inverse_speed);
    let side = front_y * cosine + front.force_lon * sine;
    let moment = vehicle.half_track * (front.force_difference + rear.force_difference);
    let across = (side + rear_y + state.friction_and_wind.wind_force[slot]) * vehicle.inverse_mass
        - speed * r;
    let moment = moment + state.vehicle(params, slot).stability_control(speed, angle);
    let turn = vehicle.cg_front * side - vehicle.cg_rear * rear_y
        + state.friction_and_wind.wind_moment[slot]
        + moment;
    let turn = turn * vehicle.inverse_inertia;
    let (ahead, behind) = (
        vehicle.cg_front * (front_k * cosine),
        vehicle.cg_rear * rear_k,
    );
    let (by_mass, by_inertia) = (
        stride.half * vehicle.inverse_mass,
        stride.half * vehicle.inverse_inertia,
    );
    let a11 = 1.0 + by_mass * (front_k * cosine + rear_k);
    let a12 = by_mass * (ahead - behind) + stride.half * speed;
    let a21 = by_inertia * (ahead - behind);
    let a22 = 1.0 + by_inertia * (vehicle.cg_front * ahead + vehicle.cg_rear * behind);
    let share = stride.length / (a11 * a22 - a12 * a21);
    let more_vy = share * (a22 * across - a12 * turn);
    let more_r = share * (a11 * turn - a21 * across);
    let middle_r = r + 0.5 * more_r;
    let middle_y = front_y - front_k * (0.5 * (more_vy + vehicle.cg_front * more_r));
    let along = front.force_lon * cosine - middle_y * sine + rear.force_lon - resistance;
    state.motion.accel_lon[slot] = along * vehicle.inverse_mass;
    state.motion.accel_lat[slot] = more_vy * stride.inverse + speed * middle_r;
    MotionStep {
        vx: vx + stride.length * (state.motion.accel_lon[slot] + (vy + 0.5 * more_vy) * middle_r),
        vy: vy + more_vy,
        yaw_rate: r + more_r,
        mean_yaw_rate: middle_r,
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Yaw moment of stability control, which brakes single wheels.
    #[inline(always)]
    fn stability_control(self, speed: F32<S>, angle: F32<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let grip = self.max_friction_accel(constants);
        let reach = grip / at_least(speed, constants.slip_speed);
        let asked = speed * angle / (vehicle.wheelbase + vehicle.understeer * (speed * speed));
        let off = state.motion.yaw_rate[slot] - clamp(asked, -reach, reach);
        let off = off
            - clamp_to(
                off,
                -constants.stability_threshold,
                constants.stability_threshold,
            );
        let most = 0.25 * grip * vehicle.mass * vehicle.half_track;
        clamp(
            -off * (1.0 / constants.stability_time) / vehicle.inverse_inertia,
            -most,
            most,
        )
    }
}

/// A step of a point mass that leans, where it has two wheels.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn leaning_step<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    rides: Mask<S>,
    accel_lon: F32<S>,
    (inverse_speed, angle): (F32<S>, F32<S>),
    stride: &StepLength,
    motion: &mut MotionStep<S>,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let grip = state.vehicle(params, slot).max_friction_accel(constants);
    let lean = clamp(
        angle + state.friction_and_wind.wind_force[slot] * vehicle.inverse_mass,
        -grip,
        grip,
    );
    let r = lean * inverse_speed;
    let vx = state.motion.vx[slot] + stride.length * accel_lon;
    motion.vx = select(rides, vx, motion.vx);
    motion.vy = select(rides, splat(params.simd, 0.0), motion.vy);
    motion.yaw_rate = select(rides, r, motion.yaw_rate);
    motion.mean_yaw_rate = select(rides, r, motion.mean_yaw_rate);
    assign_where(&mut state.motion.accel_lon[slot], rides, accel_lon);
    assign_where(&mut state.motion.accel_lat[slot], rides, lean);
}

/// New place of vehicle `slot` with the mean of the old and the new velocity.
#[inline(always)]
pub fn update_position<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    motion: MotionStep<S>,
    stride: &StepLength,
) {
    let wrecked = state.motion.is_wreck[slot].simd_gt(0.0);
    let (sine, cosine) = (
        state.motion.sin_heading[slot],
        state.motion.cos_heading[slot],
    );
    let along = state.motion.vx[slot] * cosine - state.motion.vy[slot] * sine;
    let across = state.motion.vx[slot] * sine + state.motion.vy[slot] * cosine;
    let mut r = motion.yaw_rate;
    let mut kept = splat(params.simd, 1.0);
    if wrecked.any_true() {
        (r, kept) = slide_wreck(state, params, slot, wrecked, (along, across), r, stride);
    }
    let mean_r = select(
        wrecked,
        0.5 * (state.motion.yaw_rate[slot] + r),
        motion.mean_yaw_rate,
    );
    state.motion.heading[slot] += stride.length * mean_r;
    let mut slides = (along, across);
    if VARIES {
        let turned = stride.length
            * (state.road.curvature[slot] * (along + stride.half * state.motion.accel_lon[slot]));
        state.motion.heading[slot] -= turned;
        let (aside, ahead) = sincos(turned);
        slides = (
            along * ahead + across * aside,
            across * ahead - along * aside,
        );
    }
    let (sine, cosine) = sincos(state.motion.heading[slot]);
    (
        state.motion.sin_heading[slot],
        state.motion.cos_heading[slot],
    ) = (sine, cosine);
    let mut new_along = motion.vx * cosine - motion.vy * sine;
    let mut new_across = motion.vx * sine + motion.vy * cosine;
    (state.motion.vx[slot], state.motion.vy[slot]) = (motion.vx, motion.vy);
    if wrecked.any_true() {
        new_along = select(wrecked, slides.0 * kept, new_along);
        new_across = select(wrecked, slides.1 * kept, new_across);
        let ahead = new_along * cosine + new_across * sine;
        let aside = new_across * cosine - new_along * sine;
        state.motion.vx[slot] = select(wrecked, ahead, motion.vx);
        state.motion.vy[slot] = select(wrecked, aside, motion.vy);
    }
    let way = stride.half * (along + new_along);
    state.motion.s[slot] += if VARIES {
        way * state.road.station_per_metre[slot]
    } else {
        way
    };
    state.motion.d[slot] += stride.half * (across + new_across);
    state.motion.yaw_accel[slot] = (r - state.motion.yaw_rate[slot]) * stride.inverse;
    state.motion.yaw_rate[slot] = r;
}

/// A wreck slides to rest with locked wheels: its new yaw rate, and the share of its velocity that is kept.
#[inline(always)]
fn slide_wreck<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    wrecked: Mask<S>,
    (along, across): (F32<S>, F32<S>),
    r: F32<S>,
    stride: &StepLength,
) -> (F32<S>, F32<S>) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let friction =
        constants.sliding_ratio * state.vehicle(params, slot).max_friction_accel(constants);
    let speed = (along * along + across * across).sqrt();
    let lost = min(friction * stride.length, speed) / at_least(speed, MIN_SLIDING_SPEED);
    let spin =
        friction * vehicle.mass * vehicle.inverse_inertia * 0.5 * vehicle.wheelbase * stride.length;
    let rate = -(lost * stride.inverse);
    state.motion.accel_lon[slot] = select(
        wrecked,
        rate * state.motion.vx[slot],
        state.motion.accel_lon[slot],
    );
    state.motion.accel_lat[slot] = select(
        wrecked,
        rate * state.motion.vy[slot],
        state.motion.accel_lat[slot],
    );
    let turned = state.motion.yaw_rate[slot] - clamp(state.motion.yaw_rate[slot], -spin, spin);
    (select(wrecked, turned, r), 1.0 - lost)
}
