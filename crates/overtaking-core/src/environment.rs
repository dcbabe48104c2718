//! Friction under the wheels and wind on the side; see `overtaking.sim.reference.environment`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::{atan, exp, sincos};
use crate::lanes::{LANES, V, at_least, at_most, choose, clamp_to, floor, max, min, splat};
use crate::names::Constants;
use crate::philox::{MOTION, uniform, words};
use crate::state::{ANY_ACCEL, State};
use crate::world::World;

/// A uniform number of unit variance lies within +- sqrt(3).
const ROOT_3: f32 = 1.732_050_8;
/// Phases of neighbouring wheel paths differ by the golden ratio, and by its square.
const GOLDEN: f32 = 0.618_034;
const GOLDEN_SQUARE: f32 = 0.381_966;
/// Keeps the way in a bend finite for who has left the road inwards.
const LEAST_SHARE: f32 = 0.25;
/// Keeps the angle of the wind finite at rest [m/s].
const LEAST_AIR_SPEED: f32 = 1.0;

#[inline(always)]
fn relaxed<S: Simd>(process: V<S>, keep: V<S>, word: V<S>) -> V<S> {
    let innovation = ROOT_3 * (2.0 * word - 1.0);
    keep * process + (1.0 - keep * keep).sqrt() * innovation
}

/// Advance gusts, errors of judgement and wander in the lane by one decision.
#[inline(always)]
pub fn move_random_processes<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    decision: u32,
) {
    let (c, q) = (w.c, &w.q);
    // The first draw is the stationary state: nothing of a past is kept.
    let kept = if decision == 0 { 0.0 } else { 1.0 };
    let keep_error = kept * exp(splat(w.simd, -c.decision / c.error_time));
    let keep_wander = kept * exp(splat(w.simd, -c.decision / c.lane_time));
    for i in 0..w.count {
        let [gust, distance, speed, lane] = words(
            w.key,
            &w.index_low,
            &w.index_high,
            MOTION + i as u32,
            decision,
        );
        let along = state.vx[i] - facing(w, i, q.wind_along);
        let air_speed = (along * along + q.wind_across * q.wind_across).sqrt();
        let keep = kept * exp(-(air_speed * c.decision) / c.gust_length_scale);
        state.gust[i] = relaxed(state.gust[i], keep, uniform(w.simd, gust));
        state.distance_error[i] = relaxed(
            state.distance_error[i],
            keep_error,
            uniform(w.simd, distance),
        );
        state.speed_error[i] = relaxed(state.speed_error[i], keep_error, uniform(w.simd, speed));
        state.wander[i] = relaxed(state.wander[i], keep_wander, uniform(w.simd, lane));
    }
}

/// A number along or across the road, in the direction of vehicle `i`.
#[inline(always)]
fn facing<S: Simd, const N: usize>(w: &World<'_, S, N>, i: usize, value: V<S>) -> V<S> {
    if w.road.ways.has_oncoming_traffic {
        w.p[i].travel_sign * value
    } else {
        value
    }
}

/// `values[lane]` for whole-number lanes, the first or last value outside.
#[inline(always)]
pub fn lane_value<S: Simd>(values: &[f32], lane: V<S>) -> V<S> {
    let mut chosen = splat(lane.simd, values[0]);
    for (k, value) in values.iter().enumerate().skip(1) {
        chosen = choose(
            lane.simd_ge(k as i32 as f32),
            splat(lane.simd, *value),
            chosen,
        );
    }
    chosen
}

/// Film on a lane outside puddles [mm].
#[inline(always)]
pub fn lane_film<S: Simd, const N: usize>(w: &World<'_, S, N>, path: V<S>) -> V<S> {
    max(
        w.q.min_wet_film,
        w.q.film_rain_factor * path - w.q.texture_depth,
    )
}

#[inline(always)]
fn triangle_wave<S: Simd>(x: V<S>) -> V<S> {
    (2.0 * (x - floor(x)) - 1.0).abs()
}

/// Depth of the puddle at a point, 0 to 1.
#[inline(always)]
fn puddle<S: Simd, const N: usize>(w: &World<'_, S, N>, s: V<S>, path: V<S>) -> V<S> {
    let (c, q) = (w.c, &w.q);
    let wave = triangle_wave(s * c.inverse_puddle_wave_1 + q.puddle_phase_1 + GOLDEN * path);
    let wave =
        wave + triangle_wave(s * c.inverse_puddle_wave_2 + q.puddle_phase_2 + GOLDEN_SQUARE * path);
    clamp_to((q.puddle_threshold - wave) * c.puddle_slope, 0.0, 1.0)
}

/// Peak friction of tyres at a speed, one value for each of the four water films of the table.
#[inline(always)]
pub fn speed_columns<S: Simd>(c: &Constants, speed: V<S>, wear: V<S>, truck: V<S>) -> [V<S>; 4] {
    let [v0, v1, v2] = c.friction_speeds;
    let low = clamp_to((speed - v0) / (v1 - v0), 0.0, 1.0);
    let high = clamp_to((speed - v1) / (v2 - v1), 0.0, 1.0);
    let mut columns = [splat(speed.simd, 0.0); 4];
    for (knot, column) in columns.iter_mut().enumerate() {
        let mut rows = [*column; 3];
        for (row, (new, worn)) in rows
            .iter_mut()
            .zip(c.friction_new.iter().zip(&c.friction_worn))
        {
            *row = new[knot] + wear * (worn[knot] - new[knot]);
        }
        let change = low * (rows[1] - rows[0]) + high * (rows[2] - rows[1]);
        *column = match knot {
            0 => (1.0 + truck * (c.truck_dry_factor - 1.0)) * (rows[0] + change),
            1 => rows[0] + change,
            _ => rows[0] + (1.0 + truck * (c.truck_loss_factor - 1.0)) * change,
        };
    }
    columns
}

/// Peak friction on a water film [mm], between the values of `speed_columns`.
#[inline(always)]
pub fn at_film<S: Simd>(c: &Constants, columns: &[V<S>; 4], film: V<S>) -> V<S> {
    let [h0, h1, h2, h3] = c.friction_films;
    if film.simd_le(h0).all_true() {
        return at_least(columns[0], c.friction_floor);
    }
    let a = clamp_to((film - h0) / (h1 - h0), 0.0, 1.0);
    let b = clamp_to((film - h1) / (h2 - h1), 0.0, 1.0);
    let d = clamp_to((film - h2) / (h3 - h2), 0.0, 1.0);
    let value = columns[0] + a * (columns[1] - columns[0]);
    let value = value + b * (columns[2] - columns[1]);
    let value = value + d * (columns[3] - columns[2]);
    at_least(value, c.friction_floor)
}

/// What the road does to vehicle `i` until the next decision: it bends, rises, shows itself, has limits.
#[inline(always)]
pub fn course<S: Simd, const N: usize>(state: &mut State<'_, S, N>, w: &World<'_, S, N>, i: usize) {
    let (c, p, ways) = (w.c, &w.p[i], &w.road.ways);
    let table = &w.road.course_table;
    let turned = p.travel_sign.simd_lt(0.0);
    let offset = choose(turned, state.d[i] - ways.edge_sum, state.d[i]);
    let soon = 0.5 * c.decision;
    let late = choose(
        p.two_wheeler.simd_gt(0.0),
        splat(w.simd, c.two_wheeler_lag),
        c.steering_lag + p.side_lag * state.vx[i],
    );
    let (s, v) = (state.s[i], state.vx[i]);
    let (here, there) = (s + soon * v, s + (soon + late) * v);
    let last = (table.curvature.len() - 1) as f32;
    let station = |s: V<S>| {
        let way = choose(turned, ways.length - s, s) * c.per_station;
        clamp_to(way, 0.0, last)
    };
    let (here, there, now) = (station(here), station(there), station(s));
    let is_oncoming = |lane: usize| usize::from(p.travel_sign[lane] < 0.0);
    let radii = [table.radius_along, table.radius_against];
    let sights = [
        table.sight_along,
        table.sight_against,
        table.truck_sight_along,
        table.truck_sight_against,
    ];
    let allowed_speeds = [table.allowed_speed_along, table.allowed_speed_against];
    let stretch = |bend: V<S>| 1.0 / at_least(1.0 - bend * offset, LEAST_SHARE);
    let bend = p.travel_sign * between(here, last, |_| table.curvature);
    let ahead = p.travel_sign * between(there, last, |_| table.curvature);
    state.stretch[i] = stretch(bend);
    state.curve[i] = bend * state.stretch[i];
    state.curve_ahead[i] = ahead * stretch(ahead);
    state.slope[i] = p.travel_sign * between(here, last, |_| table.sine_of_slope);
    let radius = between(now, last, |lane| radii[is_oncoming(lane)]);
    state.bend_speed[i] = (at_most(w.q.max_lateral_accel, c.bend_accel) * radius).sqrt();
    let sight = |lane: usize| 2 * usize::from(p.has_truck_tyres[lane] > 0.0) + is_oncoming(lane);
    state.shown[i] = between(now, last, |lane| sights[sight(lane)]);
    let allowed = |place: V<S>| between(place, last, |lane| allowed_speeds[is_oncoming(lane)]);
    let wanted = |limit: V<S>| min(adapted_speed(w, i, limit), p.desired_speed);
    state.allowed_speed[i] = allowed(now);
    let wish = wanted(state.allowed_speed[i]);
    let soon = wanted(allowed(station(s + c.decision * v)));
    let change = (soon - wish) / c.decision;
    let eased = max(change + (wish - v) * c.per_approach, -p.decel);
    state.most_accel[i] = choose(change.simd_lt(0.0), eased, splat(w.simd, ANY_ACCEL));
    state.wanted_pass_speed[i] = min(wish * c.passing_speed_factor, p.passing_speed);
    state.wanted_speed[i] = wish;
}

/// Speed that driver `i` wants under a limit in its weather and light.
#[inline(always)]
fn adapted_speed<S: Simd, const N: usize>(w: &World<'_, S, N>, i: usize, limit: V<S>) -> V<S> {
    let (p, q) = (&w.p[i], &w.q);
    let wanted = p.free_speed - p.speed_limit_compliance * at_least(p.free_speed - limit, 0.0);
    let excess = at_least(wanted - q.rain_slowing - q.stoppable_speed, 0.0);
    wanted - p.caution * (q.rain_slowing + excess)
}

/// A row of the road between its stations, linear; each simulation may have its own.
#[inline(always)]
fn between<'a, S: Simd>(station: V<S>, last: f32, row: impl Fn(usize) -> &'a [f32]) -> V<S> {
    let first = at_most(floor(station), last - 1.0);
    let (mut low, mut high) = (first, first);
    for lane in 0..LANES {
        let (row, k) = (row(lane), first[lane] as usize);
        (low[lane], high[lane]) = (row[k], row[k + 1]);
    }
    low + (station - first) * (high - low)
}

/// Friction under the wheels of either side.
#[inline(always)]
pub fn grip<S: Simd, const N: usize>(state: &mut State<'_, S, N>, w: &World<'_, S, N>) {
    let (road, n) = (w.road, w.road.num_lanes);
    let width = (road.boundaries[n] - road.boundaries[0]) / (2 * n) as f32;
    let has_puddles = w.q.puddle_film.simd_gt(0.0).any_true();
    for i in 0..w.count {
        let p = &w.p[i];
        let mut lane = splat(w.simd, 0.0);
        for k in 1..n {
            lane = choose(
                state.d[i].simd_ge(road.boundaries[k]),
                splat(w.simd, k as i32 as f32),
                lane,
            );
        }
        let water = lane_film(w, lane_value(&road.film_path[..n], lane));
        let columns = speed_columns(w.c, state.vx[i], p.tyre_wear, p.has_truck_tyres);
        if !has_puddles {
            let friction = min(at_film(w.c, &columns, water), p.max_friction);
            (state.mu_fast[i], state.mu_slow[i]) = (friction, friction);
            continue;
        }
        let (s, d) = state.on_the_road(w, i);
        for (offset, friction) in [
            (p.half_track, &mut state.mu_fast[i]),
            (-p.half_track, &mut state.mu_slow[i]),
        ] {
            let offset = facing(w, i, offset);
            let wheel_path = floor((d + offset - road.boundaries[0]) / width);
            let depth = puddle(w, s, wheel_path);
            *friction = min(
                at_film(w.c, &columns, water + w.q.puddle_film * depth),
                p.max_friction,
            );
        }
    }
}

/// Share of the side wind left beside high-sided vehicles upwind of vehicle `i`.
#[inline(always)]
fn shelter<S: Simd, const N: usize, const TWO_WAY: bool>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> V<S> {
    let c = w.c;
    let wind = facing(w, i, w.q.wind_across);
    let mut share = splat(w.simd, 1.0);
    for j in 0..w.count {
        if i == j {
            continue;
        }
        let other = &w.p[j];
        let (s, d) = state.seen_from::<TWO_WAY>(w, i, j);
        let aside = state.d[i] - d;
        let reach = c.shelter_reach + w.p[i].half_width + other.half_width;
        let upwind = (aside * wind).simd_gt(0.0);
        let beside = other.shelters_wind.simd_gt(0.0)
            & other.valid.simd_gt(0.0)
            & upwind
            & aside.abs().simd_lt(reach);
        if !beside.any_true() {
            continue;
        }
        let beyond = (state.s[i] - s).abs() - other.half_length;
        let u = clamp_to(
            beyond / (c.shelter_release * 2.0 * other.half_length),
            0.0,
            1.0,
        );
        let open_share = c.shelter_factor + (1.0 - c.shelter_factor) * (u * u * (3.0 - 2.0 * u));
        share = choose(beside, min(share, open_share), share);
    }
    share
}

/// The discrete gusts of bridges and cuttings, 0 to 1.
#[inline(always)]
fn gust_bump<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> V<S> {
    let (s, _) = state.on_the_road(w, i);
    let cell = s / w.c.gust_spacing + w.q.gust_phase;
    let inside = (cell - floor(cell)) * w.c.gust_spacing / w.q.gust_length;
    let (_, cosine) = sincos(core::f32::consts::TAU * at_most(inside, 1.0));
    choose(inside.simd_lt(1.0), 0.5 - 0.5 * cosine, splat(w.simd, 0.0))
}

/// Push sideways for a part of each interval, after drivers answered the wind.
#[inline(always)]
pub fn push<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    decision: u32,
) {
    let q = &w.q;
    let cell = decision as f32 * q.push_rate + q.push_phase;
    let pushed = q.push_accel.simd_ne(0.0) & (cell - floor(cell)).simd_lt(q.push_duty_cycle);
    for i in 0..w.count {
        let force = state.wind_force[i] + facing(w, i, q.push_accel) * w.p[i].mass;
        state.wind_force[i] = choose(pushed, force, state.wind_force[i]);
    }
}

/// Side force, yaw moment and tail wind of each vehicle.
#[inline(always)]
pub fn wind<S: Simd, const N: usize>(state: &mut State<'_, S, N>, w: &World<'_, S, N>) {
    let (c, q) = (w.c, &w.q);
    let has_gusts = q.gust_gain.simd_ne(0.0).any_true();
    for i in 0..w.count {
        let p = &w.p[i];
        let mut strength = 1.0 + c.turbulence_intensity * state.gust[i];
        if has_gusts {
            strength += q.gust_gain * gust_bump(state, w, i);
        }
        let strength = at_least(strength, 0.0);
        let open = if w.road.ways.has_oncoming_traffic {
            shelter::<S, N, true>(state, w, i)
        } else {
            shelter::<S, N, false>(state, w, i)
        };
        let across = facing(w, i, q.wind_across) * strength * open;
        state.tail_wind[i] = facing(w, i, q.wind_along) * strength;
        let along = at_least(state.vx[i] - state.tail_wind[i], LEAST_AIR_SPEED);
        let angle = atan(across.abs() / along);
        let (sine, _) = sincos(at_most(
            c.wind_angle_factor * angle,
            core::f32::consts::FRAC_PI_2,
        ));
        let force = p.side_wind * (along * along + across * across) * sine;
        state.wind_force[i] = choose(across.simd_lt(0.0), -force, force);
        let cosine = along / (along * along + across * across).sqrt();
        state.wind_moment[i] = state.wind_force[i] * (p.wind_centre * cosine + p.wind_arm);
    }
}
