//! Motion of a vehicle over one step; see `overtaking.sim.reference.dynamics`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::sincos;
use crate::fields::{Constants, Vehicle};
use crate::lanes::{V, at_least, choose, clamp, clamp_to, max, min, splat};
use crate::state::{State, World};

/// Keeps the direction of a wreck at rest finite [m/s].
const TINY: f32 = 1e-3;
/// Left sideways by full braking, squared, to divide by [N^2].
const LEAST_GRIP: f32 = 1.0;

#[inline(always)]
fn fiala<S: Simd>(stiffness: V<S>, slope: V<S>, limit: V<S>) -> V<S> {
    let z = stiffness * slope / (3.0 * limit);
    let size = z.abs();
    let inner = 3.0 * z - 3.0 * z * size + z * z * z;
    let one = splat(z.simd, 1.0);
    let outer = choose(z.simd_lt(0.0), -one, one);
    -limit * choose(size.simd_lt(1.0), inner, outer)
}

#[inline(always)]
fn drive_force<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    resistance: V<S>,
    inverse_speed: V<S>,
) -> V<S> {
    let (c, p) = (w.c, &w.p[i]);
    let wanted = p.mass * state.accel[i] + resistance;
    let engine = min(p.launch_force, p.power * inverse_speed);
    let throttle = clamp_to(
        (p.max_speed + c.governor_band - state.vx[i]) * w.rates.governing,
        0.0,
        1.0,
    );
    max(min(wanted, engine * throttle), -p.brake_force)
}

/// Longitudinal force of an axle, its imbalance, and the lateral limit.
#[inline(always)]
fn axle_forces<S: Simd>(
    c: &Constants,
    p: &Vehicle<S>,
    mu_fast: V<S>,
    mu_slow: V<S>,
    force: V<S>,
    load: V<S>,
) -> (V<S>, V<S>, V<S>) {
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
    (total, slow - fast, left.sqrt())
}

/// Forces of both axles and the sine and cosine of the wheel angle.
struct Tyres<S: Simd> {
    front_x: V<S>,
    rear_x: V<S>,
    front_y: V<S>,
    rear_y: V<S>,
    moment: V<S>,
    sine: V<S>,
    cosine: V<S>,
}

#[inline(always)]
fn tyre_forces<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    force: V<S>,
    inverse_speed: V<S>,
) -> Tyres<S> {
    let (c, p) = (w.c, &w.p[i]);
    let shift = clamp(
        state.a_lon[i] * p.cg_height,
        -c.gravity * p.cg_front,
        c.gravity * p.cg_rear,
    );
    let front_weight = p.inverse_wheelbase * (c.gravity * p.cg_rear - shift);
    let front_load = p.mass * front_weight;
    let rear_load = p.mass * p.inverse_wheelbase * (c.gravity * p.cg_front + shift);
    let share = choose(
        force.simd_lt(0.0),
        front_weight * w.rates.inverse_gravity,
        p.front_drive,
    );
    let (mu_fast, mu_slow) = (state.mu_fast[i], state.mu_slow[i]);
    let (front_x, front_split, front_limit) =
        axle_forces(c, p, mu_fast, mu_slow, share * force, front_load);
    let (rear_x, rear_split, rear_limit) =
        axle_forces(c, p, mu_fast, mu_slow, (1.0 - share) * force, rear_load);
    let (sine, cosine) = sincos(state.wheel[i]);
    let slip = (state.vy[i] + p.cg_front * state.r[i]) * inverse_speed;
    let front_slope = (slip * cosine - sine) / (cosine + slip * sine);
    let rear_slope = (state.vy[i] - p.cg_rear * state.r[i]) * inverse_speed;
    let front_y = fiala(p.front_stiffness * front_load, front_slope, front_limit);
    let rear_y = fiala(p.rear_stiffness * rear_load, rear_slope, rear_limit);
    let moment = p.half_track * (front_split + rear_split);
    Tyres {
        front_x,
        rear_x,
        front_y,
        rear_y,
        moment,
        sine,
        cosine,
    }
}

/// One over the speed of vehicle `i`, for slip angles; finite at rest.
#[inline(always)]
pub fn inverse_speed<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> V<S> {
    1.0 / at_least(state.vx[i], w.c.slip_speed)
}

/// Accelerations of vehicle `i` by tyres and wind, kept in the state, and its new yaw rate.
#[inline(always)]
pub fn accelerate<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    inverse_speed: V<S>,
) -> V<S> {
    let (c, p) = (w.c, &w.p[i]);
    let air = state.vx[i] - state.tail_wind[i];
    let resistance = p.drag * air * air.abs() + p.rolling;
    let force = drive_force(state, w, i, resistance, inverse_speed);
    let t = tyre_forces(state, w, i, force, inverse_speed);
    let front_side = t.front_y * t.cosine + t.front_x * t.sine;
    let along =
        (t.front_x * t.cosine - t.front_y * t.sine + t.rear_x - resistance) * p.inverse_mass;
    let across = (front_side + t.rear_y + state.wind_force[i]) * p.inverse_mass;
    let yaw = p.cg_front * front_side - p.cg_rear * t.rear_y + state.wind_moment[i] + t.moment;
    let turn = yaw * p.inverse_inertia;
    let bound = c.gravity * 0.5 * (state.mu_fast[i] + state.mu_slow[i]);
    let lean = clamp(
        state.wheel[i] + state.wind_force[i] * p.inverse_mass,
        -bound,
        bound,
    );
    let rides = p.two_wheeler.simd_gt(0.0);
    let a_lon = choose(
        rides,
        (t.front_x + t.rear_x - resistance) * p.inverse_mass,
        along,
    );
    let a_lat = choose(rides, lean, across);
    let turned = choose(rides, lean * inverse_speed, state.r[i] + c.step * turn);
    (state.a_lon[i], state.a_lat[i]) = (a_lon, a_lat);
    let wrecked = state.crashed[i].simd_gt(0.0);
    if !wrecked.any_true() {
        return turned;
    }
    let (wreck_lon, wreck_lat, wreck_turn) = wreck(state, c, p, i);
    state.a_lon[i] = choose(wrecked, wreck_lon, a_lon);
    state.a_lat[i] = choose(wrecked, wreck_lat, a_lat);
    choose(wrecked, state.r[i] + wreck_turn, turned)
}

#[inline(always)]
fn wreck<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    c: &Constants,
    p: &Vehicle<S>,
    i: usize,
) -> (V<S>, V<S>, V<S>) {
    let (vx, vy) = (state.vx[i], state.vy[i]);
    let friction = c.sliding_ratio * c.gravity * 0.5 * (state.mu_fast[i] + state.mu_slow[i]);
    let speed = (vx * vx + vy * vy).sqrt();
    let share = min(friction, speed / c.step) / at_least(speed, TINY);
    let spin = friction * p.mass * p.inverse_inertia * 0.5 * p.wheelbase * c.step;
    (-share * vx, -share * vy, -clamp(state.r[i], -spin, spin))
}

/// New velocity of vehicle `i`, then its new position with the mean of both.
#[inline(always)]
pub fn integrate<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    r: V<S>,
) {
    let c = w.c;
    let zero = splat(r.simd, 0.0);
    let wrecked = state.crashed[i].simd_gt(0.0);
    let rides = w.p[i].two_wheeler.simd_gt(0.0) & !wrecked;
    let (sine, cosine) = (state.sine[i], state.cosine[i]);
    let along = state.vx[i] * cosine - state.vy[i] * sine;
    let across = state.vx[i] * sine + state.vy[i] * cosine;
    let turning = state.r[i];
    let swept = choose(rides, zero, state.vy[i] * state.r[i]);
    let vx = state.vx[i] + c.step * (state.a_lon[i] + swept);
    let vy = state.vy[i] + c.step * (state.a_lat[i] - state.vx[i] * state.r[i]);
    let vy = choose(rides, zero, vy);
    let creeps = vx.simd_lt(c.standstill) & vy.abs().simd_lt(c.standstill);
    let stands = !wrecked & creeps & state.accel[i].simd_le(0.0);
    let vx = choose(wrecked, vx, max(vx, zero));
    state.vx[i] = choose(stands, zero, vx);
    state.vy[i] = choose(stands, zero, vy);
    state.r[i] = choose(stands, zero, r);
    let half = c.step * 0.5;
    state.psi[i] += half * (turning + state.r[i]);
    let (sine, cosine) = sincos(state.psi[i]);
    (state.sine[i], state.cosine[i]) = (sine, cosine);
    state.s[i] += half * (along + (state.vx[i] * cosine - state.vy[i] * sine));
    state.d[i] += half * (across + (state.vx[i] * sine + state.vy[i] * cosine));
}
