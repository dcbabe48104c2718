//! Motion of a vehicle over one step; see `overtaking.sim.reference.dynamics`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::sincos;
use crate::lanes::{M, V, at_least, choose, clamp, clamp_to, max, min, put, splat};
use crate::names::{Constants, Vehicle};
use crate::state::State;
use crate::world::{Stride, World};

/// Keeps the direction of a wreck at rest finite [m/s].
const TINY: f32 = 1e-3;
/// Left sideways by full braking, squared, to divide by [N^2].
const LEAST_GRIP: f32 = 1.0;

/// Loads and forces of one axle.
struct Axle<S: Simd> {
    load: V<S>,
    along: V<S>,
    split: V<S>,
    limit: V<S>,
}

/// What a step comes to: velocity and yaw rate at its end, and the mean yaw rate.
#[derive(Clone, Copy)]
pub struct Motion<S: Simd> {
    vx: V<S>,
    vy: V<S>,
    r: V<S>,
    mean_r: V<S>,
}

impl<S: Simd> Motion<S> {
    /// At rest.
    pub fn none(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        Self {
            vx: zero,
            vy: zero,
            r: zero,
            mean_r: zero,
        }
    }
}

/// Lateral force of an axle against the slip, and how fast it grows with the slip.
#[inline(always)]
fn fiala<S: Simd>(stiffness: V<S>, across: V<S>, along: V<S>, limit: V<S>) -> (V<S>, V<S>) {
    let one = splat(across.simd, 1.0);
    let z = stiffness * across / (3.0 * limit * along);
    let sticks = at_least(one - z.abs(), 0.0);
    let size = limit * (one - sticks * sticks * sticks);
    (
        choose(z.simd_lt(0.0), size, -size),
        stiffness * (sticks * sticks),
    )
}

#[inline(always)]
fn drive_force<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    i: usize,
    accel: V<S>,
    resistance: V<S>,
    speed: V<S>,
    inverse_speed: V<S>,
) -> V<S> {
    let (c, p) = (w.c, &w.p[i]);
    let wanted = p.mass * accel + resistance;
    let engine = min(p.launch_force, p.power * inverse_speed);
    let throttle = clamp_to(
        (p.max_speed + c.governor_band - speed) * w.rates.governing,
        0.0,
        1.0,
    );
    max(min(wanted, engine * throttle), -p.max_brake_force)
}

/// Forces of one axle under a load that is asked for a longitudinal force.
#[inline(always)]
fn axle_forces<S: Simd>(
    c: &Constants,
    p: &Vehicle<S>,
    mu_fast: V<S>,
    mu_slow: V<S>,
    force: V<S>,
    load: V<S>,
) -> Axle<S> {
    let half_load = 0.5 * load;
    let share = choose(
        force.simd_gt(0.0) & p.two_wheeler.simd_eq(0.0),
        splat(force.simd, c.traction_share),
        splat(force.simd, c.abs_share),
    );
    let bound_fast = share * mu_fast * half_load;
    let bound_slow = share * mu_slow * half_load;
    let fast = clamp(0.5 * force, -bound_fast, bound_fast);
    let slow = clamp(0.5 * force, -bound_slow, bound_slow);
    let total = fast + slow;
    let grip = (mu_fast + mu_slow) * half_load;
    let left = at_least(grip * grip - total * total, LEAST_GRIP);
    Axle {
        load,
        along: total,
        split: slow - fast,
        limit: left.sqrt(),
    }
}

/// Share of the load on the front axle at an acceleration.
#[inline(always)]
fn front_weight<S: Simd, const N: usize>(w: &World<'_, S, N>, i: usize, accel: V<S>) -> V<S> {
    let p = &w.p[i];
    let lifted = accel * p.cg_height * w.rates.inverse_gravity;
    p.inverse_wheelbase * (p.cg_rear - clamp(lifted, -p.cg_front, p.cg_rear))
}

/// Largest acceleration that friction allows.
#[inline(always)]
fn grip<S: Simd, const N: usize>(state: &State<'_, S, N>, c: &Constants, i: usize) -> V<S> {
    c.gravity * 0.5 * (state.mu_fast[i] + state.mu_slow[i])
}

/// Loads and forces of the front and the rear axle.
#[inline(always)]
fn axles<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    force: V<S>,
    resistance: V<S>,
    angle: V<S>,
) -> (Axle<S>, Axle<S>) {
    let (c, p) = (w.c, &w.p[i]);
    let rides = p.two_wheeler.simd_gt(0.0);
    let brakes = force.simd_lt(0.0);
    let weight = front_weight(w, i, state.a_lon[i]);
    let share = choose(brakes, weight, p.front_drive);
    let limit = choose(
        force.simd_gt(0.0) & !rides,
        splat(w.simd, c.traction_share),
        splat(w.simd, c.abs_share),
    ) * grip(state, c, i);
    let asked = force * p.inverse_mass;
    let (front, rear) = (limit * weight, limit * (1.0 - weight));
    let asked = clamp(share * asked, -front, front) + clamp((1.0 - share) * asked, -rear, rear);
    let held = choose(rides, splat(w.simd, 0.0), state.a_lat[i] * weight * angle);
    let weight = front_weight(w, i, asked - resistance * p.inverse_mass - held);
    let share = choose(brakes, weight, p.front_drive);
    let whole = c.gravity * p.mass;
    let (fast, slow) = (state.mu_fast[i], state.mu_slow[i]);
    (
        axle_forces(c, p, fast, slow, share * force, whole * weight),
        axle_forces(
            c,
            p,
            fast,
            slow,
            (1.0 - share) * force,
            whole * (1.0 - weight),
        ),
    )
}

/// Advance vehicle `i` by one step up to its new velocity, with this wheel angle or lean in the middle;
/// the accelerations are kept in the state.
#[inline(always)]
pub fn accelerate<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    angle: V<S>,
    stride: &Stride,
) -> Motion<S> {
    let (c, p) = (w.c, &w.p[i]);
    let speed = at_least(state.vx[i] + stride.half * state.a_lon[i], 0.0);
    let inverse_speed = 1.0 / at_least(speed, c.slip_speed);
    let air = speed - state.tail_wind[i];
    let held_back = p.drag * air * air.abs() + p.rolling;
    let mut resistance = held_back;
    if VARIES {
        resistance += c.gravity * p.mass * state.slope[i];
    }
    let force = drive_force(w, i, state.accel[i], resistance, speed, inverse_speed);
    let (front, rear) = axles(state, w, i, force, held_back, angle);
    let straight = (front.along + rear.along - resistance) * p.inverse_mass;
    let mut motion = on_four_wheels(
        state,
        w,
        i,
        &(front, rear),
        resistance,
        (speed, inverse_speed),
        angle,
        stride,
    );
    let rides = p.two_wheeler.simd_gt(0.0);
    if rides.any_true() {
        lean(
            state,
            w,
            i,
            rides,
            straight,
            (inverse_speed, angle),
            stride,
            &mut motion,
        );
    }
    let zero = splat(w.simd, 0.0);
    motion.vx = at_least(motion.vx, 0.0);
    let creeps = motion.vx.simd_lt(c.standstill) & motion.vy.abs().simd_lt(c.standstill);
    let stands = creeps & state.accel[i].simd_le(0.0);
    motion.vx = choose(stands, zero, motion.vx);
    motion.vy = choose(stands, zero, motion.vy);
    motion.r = choose(stands, zero, motion.r);
    motion.mean_r = choose(stands, 0.5 * state.r[i], motion.mean_r);
    motion
}

/// A step of the single-track model; side speed and yaw rate by the linearised equations.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn on_four_wheels<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    (front, rear): &(Axle<S>, Axle<S>),
    resistance: V<S>,
    (speed, inverse_speed): (V<S>, V<S>),
    angle: V<S>,
    stride: &Stride,
) -> Motion<S> {
    let p = &w.p[i];
    let (vx, vy, r) = (state.vx[i], state.vy[i], state.r[i]);
    let (sine, cosine) = sincos(angle);
    let u = (vy + p.cg_front * r) * inverse_speed;
    let (front_y, front_k) = fiala(
        p.front_stiffness * front.load,
        u * cosine - sine,
        cosine + u * sine,
        front.limit,
    );
    let u = (vy - p.cg_rear * r) * inverse_speed;
    let one = splat(u.simd, 1.0);
    let (rear_y, rear_k) = fiala(p.rear_stiffness * rear.load, u, one, rear.limit);
    let (front_k, rear_k) = (front_k * inverse_speed, rear_k * inverse_speed);
    let side = front_y * cosine + front.along * sine;
    let moment = p.half_track * (front.split + rear.split);
    let across = (side + rear_y + state.wind_force[i]) * p.inverse_mass - speed * r;
    let moment = moment + stability_control(state, w, i, speed, angle);
    let turn = p.cg_front * side - p.cg_rear * rear_y + state.wind_moment[i] + moment;
    let turn = turn * p.inverse_inertia;
    let (ahead, behind) = (p.cg_front * (front_k * cosine), p.cg_rear * rear_k);
    let (by_mass, by_inertia) = (
        stride.half * p.inverse_mass,
        stride.half * p.inverse_inertia,
    );
    let a11 = 1.0 + by_mass * (front_k * cosine + rear_k);
    let a12 = by_mass * (ahead - behind) + stride.half * speed;
    let a21 = by_inertia * (ahead - behind);
    let a22 = 1.0 + by_inertia * (p.cg_front * ahead + p.cg_rear * behind);
    let share = stride.length / (a11 * a22 - a12 * a21);
    let more_vy = share * (a22 * across - a12 * turn);
    let more_r = share * (a11 * turn - a21 * across);
    let middle_r = r + 0.5 * more_r;
    let middle_y = front_y - front_k * (0.5 * (more_vy + p.cg_front * more_r));
    let along = front.along * cosine - middle_y * sine + rear.along - resistance;
    state.a_lon[i] = along * p.inverse_mass;
    state.a_lat[i] = more_vy * stride.per_second + speed * middle_r;
    Motion {
        vx: vx + stride.length * (state.a_lon[i] + (vy + 0.5 * more_vy) * middle_r),
        vy: vy + more_vy,
        r: r + more_r,
        mean_r: middle_r,
    }
}

/// Yaw moment of stability control, which brakes single wheels.
#[inline(always)]
fn stability_control<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    speed: V<S>,
    angle: V<S>,
) -> V<S> {
    let (c, p) = (w.c, &w.p[i]);
    let grip = grip(state, c, i);
    let reach = grip / at_least(speed, c.slip_speed);
    let asked = speed * angle / (p.wheelbase + p.understeer * (speed * speed));
    let off = state.r[i] - clamp(asked, -reach, reach);
    let off = off - clamp_to(off, -c.stability_threshold, c.stability_threshold);
    let most = 0.25 * grip * p.mass * p.half_track;
    clamp(
        -off * (1.0 / c.stability_time) / p.inverse_inertia,
        -most,
        most,
    )
}

/// A step of a point mass that leans, where it has two wheels.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn lean<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    rides: M<S>,
    a_lon: V<S>,
    (inverse_speed, angle): (V<S>, V<S>),
    stride: &Stride,
    motion: &mut Motion<S>,
) {
    let (c, p) = (w.c, &w.p[i]);
    let grip = grip(state, c, i);
    let lean = clamp(angle + state.wind_force[i] * p.inverse_mass, -grip, grip);
    let r = lean * inverse_speed;
    let vx = state.vx[i] + stride.length * a_lon;
    motion.vx = choose(rides, vx, motion.vx);
    motion.vy = choose(rides, splat(w.simd, 0.0), motion.vy);
    motion.r = choose(rides, r, motion.r);
    motion.mean_r = choose(rides, r, motion.mean_r);
    put(&mut state.a_lon[i], rides, a_lon);
    put(&mut state.a_lat[i], rides, lean);
}

/// New place of vehicle `i` with the mean of the old and the new velocity.
#[inline(always)]
pub fn integrate<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    motion: Motion<S>,
    stride: &Stride,
) {
    let wrecked = state.crashed[i].simd_gt(0.0);
    let (sine, cosine) = (state.sine[i], state.cosine[i]);
    let along = state.vx[i] * cosine - state.vy[i] * sine;
    let across = state.vx[i] * sine + state.vy[i] * cosine;
    let mut r = motion.r;
    let mut kept = splat(w.simd, 1.0);
    if wrecked.any_true() {
        (r, kept) = slide(state, w, i, wrecked, (along, across), r, stride);
    }
    let mean_r = choose(wrecked, 0.5 * (state.r[i] + r), motion.mean_r);
    state.psi[i] += stride.length * mean_r;
    let mut slides = (along, across);
    if VARIES {
        let turned = stride.length * (state.curve[i] * (along + stride.half * state.a_lon[i]));
        state.psi[i] -= turned;
        let (aside, ahead) = sincos(turned);
        slides = (
            along * ahead + across * aside,
            across * ahead - along * aside,
        );
    }
    let (sine, cosine) = sincos(state.psi[i]);
    (state.sine[i], state.cosine[i]) = (sine, cosine);
    let mut new_along = motion.vx * cosine - motion.vy * sine;
    let mut new_across = motion.vx * sine + motion.vy * cosine;
    (state.vx[i], state.vy[i]) = (motion.vx, motion.vy);
    if wrecked.any_true() {
        new_along = choose(wrecked, slides.0 * kept, new_along);
        new_across = choose(wrecked, slides.1 * kept, new_across);
        let ahead = new_along * cosine + new_across * sine;
        let aside = new_across * cosine - new_along * sine;
        state.vx[i] = choose(wrecked, ahead, motion.vx);
        state.vy[i] = choose(wrecked, aside, motion.vy);
    }
    let way = stride.half * (along + new_along);
    state.s[i] += if VARIES { way * state.stretch[i] } else { way };
    state.d[i] += stride.half * (across + new_across);
    state.yaw_accel[i] = (r - state.r[i]) * stride.per_second;
    state.r[i] = r;
}

/// A wreck slides to rest with locked wheels: its new yaw rate, and the share of its velocity that is kept.
#[inline(always)]
fn slide<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    wrecked: M<S>,
    (along, across): (V<S>, V<S>),
    r: V<S>,
    stride: &Stride,
) -> (V<S>, V<S>) {
    let (c, p) = (w.c, &w.p[i]);
    let friction = c.sliding_ratio * grip(state, c, i);
    let speed = (along * along + across * across).sqrt();
    let lost = min(friction * stride.length, speed) / at_least(speed, TINY);
    let spin = friction * p.mass * p.inverse_inertia * 0.5 * p.wheelbase * stride.length;
    let rate = -(lost * stride.per_second);
    state.a_lon[i] = choose(wrecked, rate * state.vx[i], state.a_lon[i]);
    state.a_lat[i] = choose(wrecked, rate * state.vy[i], state.a_lat[i]);
    let turned = state.r[i] - clamp(state.r[i], -spin, spin);
    (choose(wrecked, turned, r), 1.0 - lost)
}
