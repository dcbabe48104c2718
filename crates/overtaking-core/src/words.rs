//! What is recorded of a vehicle, as integers of stated steps; see `overtaking.sim.reference.recording`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::lanes::{V, choose, clamp_to, splat};
use crate::state::State;
use crate::tile::WORDS;
use crate::world::World;

/// Slot number, or lane, of nobody and nothing.
pub const NO_VEHICLE: i32 = 255;
const INT16_LIMIT: f32 = 32767.0;
/// Largest recorded word of 32 bits.
pub const INT32_LIMIT: f32 = 2.0e9;
const TURNS_PER_RADIAN: f32 = 0.159_154_94;
/// Steps of a metre, of a metre a second, of a second.
pub const THOUSAND: f32 = 1000.0;
const TEN_THOUSAND: f32 = 10000.0;
const INDICATOR_LEFT: i32 = 1;
const INDICATOR_RIGHT: i32 = 2;
const BRAKE: i32 = 4;
const HIGH_BEAM: i32 = 16;

/// A number in steps, the nearest, within limits.
#[inline(always)]
pub fn rounded<S: Simd>(value: V<S>, scale: f32, limit: f32) -> i32x16<S> {
    clamp_to(value * scale, -limit, limit)
        .round_ties_even()
        .to_int()
}

#[inline(always)]
fn wrapped<S: Simd>(angle: V<S>) -> V<S> {
    let turns = (angle * TURNS_PER_RADIAN).round_ties_even();
    angle - turns * core::f32::consts::TAU
}

/// The recorded integers of vehicle `i`.
#[inline(always)]
pub fn vehicle_words<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> [i32x16<S>; WORDS] {
    let (road, p) = (w.road, &w.p[i]);
    let [x0, y0, heading, cosine, sine] = road.pose;
    let (s, from_slow) = state.on_the_road(w, i);
    let d = road.overtaking_sign * from_slow;
    let mut lane = i32x16::splat(w.simd, NO_VEHICLE);
    for k in 0..=road.ways.num_own_lanes {
        let beyond = from_slow.simd_ge(road.boundaries[k]);
        lane = beyond.select(i32x16::splat(w.simd, k as i32), lane);
    }
    let speed = (state.vx[i] * state.vx[i] + state.vy[i] * state.vy[i]).sqrt();
    let wheel = choose(
        p.two_wheeler.simd_gt(0.0),
        splat(w.simd, 0.0),
        state.wheel[i],
    );
    let mut course = heading + road.overtaking_sign * state.psi[i];
    if road.ways.has_oncoming_traffic {
        let half_turn = splat(w.simd, core::f32::consts::PI);
        course += choose(p.travel_sign.simd_lt(0.0), half_turn, splat(w.simd, 0.0));
    }
    [
        rounded(x0 + s * cosine - d * sine, THOUSAND, INT32_LIMIT),
        rounded(y0 + s * sine + d * cosine, THOUSAND, INT32_LIMIT),
        rounded(s, THOUSAND, INT32_LIMIT),
        rounded(d, THOUSAND, INT32_LIMIT),
        rounded(speed, THOUSAND, INT32_LIMIT),
        rounded(wrapped(course), TEN_THOUSAND, INT16_LIMIT),
        rounded(road.overtaking_sign * wheel, TEN_THOUSAND, INT16_LIMIT),
        rounded(state.a_lon[i], THOUSAND, INT16_LIMIT),
        rounded(road.overtaking_sign * state.a_lat[i], THOUSAND, INT16_LIMIT),
        rounded(road.overtaking_sign * state.r[i], TEN_THOUSAND, INT16_LIMIT),
        lane,
        lights(state, w, i),
    ]
}

#[inline(always)]
fn lights<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> i32x16<S> {
    let towards_left = w.road.overtaking_sign * state.indicator[i];
    let left = towards_left.simd_gt(0.0).select(
        i32x16::splat(w.simd, INDICATOR_LEFT),
        i32x16::splat(w.simd, 0),
    );
    let right = towards_left.simd_lt(0.0).select(
        i32x16::splat(w.simd, INDICATOR_RIGHT),
        i32x16::splat(w.simd, 0),
    );
    let braking = state.accel[i].simd_lt(-w.c.stop_lamp_decel) | state.crashed[i].simd_gt(0.0);
    let base: i32x16<S> = w.p[i].initial_lights.to_int();
    let shown = base
        + left
        + right
        + braking.select(i32x16::splat(w.simd, BRAKE), i32x16::splat(w.simd, 0));
    if !w.road.ways.has_oncoming_traffic {
        return shown;
    }
    let flashes = state.flashes[i].simd_gt(0.0);
    shown + flashes.select(i32x16::splat(w.simd, HIGH_BEAM), i32x16::splat(w.simd, 0))
}
