//! Friction under the wheels and wind on the side; see `overtaking.sim.reference.road_conditions`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{atan, exp, sincos};
use crate::math::philox::{MOTION, uniform, words};
use crate::math::vectors::{
    F32, SIMD_LANES, at_least, at_most, clamp_to, floor, max, min, select, splat,
};
use crate::names::{ModelConstants, SimulationParams, VehicleParams};
use crate::params::Params;
use crate::state::{NO_ACCEL_LIMIT, State};
use crate::vehicle_handle::VehicleHandle;

/// A uniform number of unit variance lies within +- sqrt(3).
const ROOT_3: f32 = 1.732_050_8;
/// Phases of neighbouring wheel paths differ by the golden ratio, and by its square.
const PHASE_STEP_1: f32 = 0.618_034;
const PHASE_STEP_2: f32 = 0.381_966;
/// Keeps the distance along a bend finite for a vehicle that has left the road inwards.
const MIN_RADIUS_SHARE: f32 = 0.25;
/// Keeps the angle of the wind finite at rest [m/s].
const MIN_AIR_SPEED: f32 = 1.0;

#[inline(always)]
fn ornstein_uhlenbeck_step<S: Simd>(process: F32<S>, keep: F32<S>, word: F32<S>) -> F32<S> {
    let innovation = ROOT_3 * (2.0 * word - 1.0);
    keep * process + (1.0 - keep * keep).sqrt() * innovation
}

/// Advance gusts, errors of judgement and wander in the lane by one decision.
#[inline(always)]
pub fn update_random_processes<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    decision: u32,
) {
    let (constants, simulation) = (&params.constants, &params.simulations);
    // The first draw is the stationary state: nothing of a past is kept.
    let kept = if decision == 0 { 0.0 } else { 1.0 };
    let keep_error = kept
        * exp(splat(
            params.simd,
            -constants.decision / constants.error_time,
        ));
    let keep_wander = kept
        * exp(splat(
            params.simd,
            -constants.decision / constants.lane_time,
        ));
    for i in 0..params.num_slots_in_use {
        let [gust, distance, speed, lane] = words(
            params.key,
            &params.scenario_index_low,
            &params.scenario_index_high,
            MOTION + i as u32,
            decision,
        );
        let along = state.motion.vx[i]
            - state
                .vehicle(params, i)
                .in_travel_direction(simulation.wind_along);
        let air_speed = (along * along + simulation.wind_across * simulation.wind_across).sqrt();
        let keep = kept * exp(-(air_speed * constants.decision) / constants.gust_length_scale);
        state.noise.gust[i] =
            ornstein_uhlenbeck_step(state.noise.gust[i], keep, uniform(params.simd, gust));
        state.noise.distance_error[i] = ornstein_uhlenbeck_step(
            state.noise.distance_error[i],
            keep_error,
            uniform(params.simd, distance),
        );
        state.noise.speed_error[i] = ornstein_uhlenbeck_step(
            state.noise.speed_error[i],
            keep_error,
            uniform(params.simd, speed),
        );
        state.noise.lane_wander[i] = ornstein_uhlenbeck_step(
            state.noise.lane_wander[i],
            keep_wander,
            uniform(params.simd, lane),
        );
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// A number along or across the road, in the direction of vehicle `i`.
    #[inline(always)]
    fn in_travel_direction(self, value: F32<S>) -> F32<S> {
        let params = self.params;
        if params.road.directions.has_oncoming_traffic {
            self.vehicle().travel_sign * value
        } else {
            value
        }
    }
}

/// `values[lane]` for whole-number lanes, the first or last value outside.
#[inline(always)]
pub fn value_of_lane<S: Simd>(values: &[f32], lane: F32<S>) -> F32<S> {
    let mut chosen = splat(lane.simd, values[0]);
    for (k, value) in values.iter().enumerate().skip(1) {
        chosen = select(
            lane.simd_ge(k as i32 as f32),
            splat(lane.simd, *value),
            chosen,
        );
    }
    chosen
}

/// Film on a lane outside puddles [mm].
#[inline(always)]
pub fn lane_film<S: Simd, const N: usize>(params: &Params<S, N>, path: F32<S>) -> F32<S> {
    max(
        params.simulations.min_wet_film,
        params.simulations.film_rain_factor * path - params.simulations.texture_depth,
    )
}

#[inline(always)]
fn triangle_wave<S: Simd>(x: F32<S>) -> F32<S> {
    (2.0 * (x - floor(x)) - 1.0).abs()
}

/// Depth of the puddle at a point, 0 to 1.
#[inline(always)]
fn puddle_depth_share<S: Simd, const N: usize>(
    params: &Params<S, N>,
    s: F32<S>,
    path: F32<S>,
) -> F32<S> {
    let (constants, simulation) = (&params.constants, &params.simulations);
    let wave = triangle_wave(
        s * constants.inverse_puddle_wave_1 + simulation.puddle_phase_1 + PHASE_STEP_1 * path,
    );
    let wave = wave
        + triangle_wave(
            s * constants.inverse_puddle_wave_2 + simulation.puddle_phase_2 + PHASE_STEP_2 * path,
        );
    clamp_to(
        (simulation.puddle_threshold - wave) * constants.puddle_slope,
        0.0,
        1.0,
    )
}

/// Peak friction of tyres at a speed, one value for each of the four water films of the table.
#[inline(always)]
pub fn friction_at_speed<S: Simd>(
    constants: &ModelConstants,
    speed: F32<S>,
    wear: F32<S>,
    truck: F32<S>,
) -> [F32<S>; 4] {
    let [v0, v1, v2] = constants.friction_speeds;
    let low = clamp_to((speed - v0) / (v1 - v0), 0.0, 1.0);
    let high = clamp_to((speed - v1) / (v2 - v1), 0.0, 1.0);
    let mut columns = [splat(speed.simd, 0.0); 4];
    for (knot, column) in columns.iter_mut().enumerate() {
        let mut rows = [*column; 3];
        for (row, (new, worn)) in rows
            .iter_mut()
            .zip(constants.friction_new.iter().zip(&constants.friction_worn))
        {
            *row = new[knot] + wear * (worn[knot] - new[knot]);
        }
        let change = low * (rows[1] - rows[0]) + high * (rows[2] - rows[1]);
        *column = match knot {
            0 => (1.0 + truck * (constants.truck_dry_factor - 1.0)) * (rows[0] + change),
            1 => rows[0] + change,
            _ => rows[0] + (1.0 + truck * (constants.truck_loss_factor - 1.0)) * change,
        };
    }
    columns
}

/// Peak friction on a water film [mm], between the values of `friction_at_speed`.
#[inline(always)]
pub fn friction_at_film<S: Simd>(
    constants: &ModelConstants,
    columns: &[F32<S>; 4],
    film: F32<S>,
) -> F32<S> {
    let [h0, h1, h2, h3] = constants.friction_films;
    if film.simd_le(h0).all_true() {
        return at_least(columns[0], constants.friction_floor);
    }
    let a = clamp_to((film - h0) / (h1 - h0), 0.0, 1.0);
    let b = clamp_to((film - h1) / (h2 - h1), 0.0, 1.0);
    let d = clamp_to((film - h2) / (h3 - h2), 0.0, 1.0);
    let value = columns[0] + a * (columns[1] - columns[0]);
    let value = value + b * (columns[2] - columns[1]);
    let value = value + d * (columns[3] - columns[2]);
    at_least(value, constants.friction_floor)
}

/// What the road does to vehicle `slot` until the next decision: it bends, rises, shows itself, has limits.
#[inline(always)]
pub fn update_road_course<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
) {
    let (constants, vehicle, ways) = (
        &params.constants,
        &params.vehicles[slot],
        &params.road.directions,
    );
    let table = &params.road.course_table;
    let turned = vehicle.travel_sign.simd_lt(0.0);
    let offset = select(
        turned,
        state.motion.d[slot] - ways.edge_sum,
        state.motion.d[slot],
    );
    let soon = 0.5 * constants.decision;
    let late = select(
        vehicle.two_wheeler.simd_gt(0.0),
        splat(params.simd, constants.two_wheeler_lag),
        constants.steering_lag + vehicle.side_lag * state.motion.vx[slot],
    );
    let (s, v) = (state.motion.s[slot], state.motion.vx[slot]);
    let (here, there) = (s + soon * v, s + (soon + late) * v);
    let last = (table.curvature.len() - 1) as f32;
    let station = |s: F32<S>| {
        let way = select(turned, ways.length - s, s) * constants.per_station;
        clamp_to(way, 0.0, last)
    };
    let (here, there, now) = (station(here), station(there), station(s));
    let is_oncoming = |lane: usize| usize::from(vehicle.travel_sign[lane] < 0.0);
    let radii = [&table.radius_along, &table.radius_against];
    let sights = [
        &table.sight_along,
        &table.sight_against,
        &table.truck_sight_along,
        &table.truck_sight_against,
    ];
    let allowed_speeds = [&table.allowed_speed_along, &table.allowed_speed_against];
    let stretch = |bend: F32<S>| 1.0 / at_least(1.0 - bend * offset, MIN_RADIUS_SHARE);
    let bend = vehicle.travel_sign * interpolate_course(here, last, |_| &table.curvature);
    let ahead = vehicle.travel_sign * interpolate_course(there, last, |_| &table.curvature);
    state.road.station_per_metre[slot] = stretch(bend);
    state.road.curvature[slot] = bend * state.road.station_per_metre[slot];
    state.road.curvature_ahead[slot] = ahead * stretch(ahead);
    state.road.sin_slope[slot] =
        vehicle.travel_sign * interpolate_course(here, last, |_| &table.sine_of_slope);
    let radius = interpolate_course(now, last, |lane| radii[is_oncoming(lane)]);
    state.road.bend_speed[slot] =
        (at_most(params.simulations.max_lateral_accel, constants.bend_accel) * radius).sqrt();
    let sight =
        |lane: usize| 2 * usize::from(vehicle.has_truck_tyres[lane] > 0.0) + is_oncoming(lane);
    state.road.sight_distance[slot] = interpolate_course(now, last, |lane| sights[sight(lane)]);
    let allowed =
        |place: F32<S>| interpolate_course(place, last, |lane| allowed_speeds[is_oncoming(lane)]);
    let wanted = |limit: F32<S>| {
        min(
            adapted_speed(vehicle, &params.simulations, limit),
            vehicle.desired_speed,
        )
    };
    state.road.speed_limit[slot] = allowed(now);
    let wish = wanted(state.road.speed_limit[slot]);
    let soon = wanted(allowed(station(s + constants.decision * v)));
    let change = (soon - wish) / constants.decision;
    let eased = max(change + (wish - v) * constants.per_approach, -vehicle.decel);
    state.road.accel_limit[slot] = select(
        change.simd_lt(0.0),
        eased,
        splat(params.simd, NO_ACCEL_LIMIT),
    );
    state.road.passing_speed[slot] =
        min(wish * constants.passing_speed_factor, vehicle.passing_speed);
    state.road.desired_speed[slot] = wish;
}

/// Speed that a driver wants under a speed limit in its weather and light [m/s].
#[inline(always)]
fn adapted_speed<S: Simd>(
    vehicle: &VehicleParams<S>,
    simulation: &SimulationParams<S>,
    limit: F32<S>,
) -> F32<S> {
    let wanted = vehicle.free_speed
        - vehicle.speed_limit_compliance * at_least(vehicle.free_speed - limit, 0.0);
    let excess = at_least(
        wanted - simulation.rain_slowing - simulation.stoppable_speed,
        0.0,
    );
    wanted - vehicle.caution * (simulation.rain_slowing + excess)
}

/// A row of the road between its stations, linear; each simulation may have its own.
#[inline(always)]
fn interpolate_course<'a, S: Simd>(
    station: F32<S>,
    last: f32,
    row: impl Fn(usize) -> &'a [f32],
) -> F32<S> {
    let first = at_most(floor(station), last - 1.0);
    let (mut low, mut high) = (first, first);
    for lane in 0..SIMD_LANES {
        let (row, k) = (row(lane), first[lane] as usize);
        (low[lane], high[lane]) = (row[k], row[k + 1]);
    }
    low + (station - first) * (high - low)
}

/// Friction under the wheels of either side.
#[inline(always)]
pub fn update_friction<S: Simd, const N: usize>(state: &mut State<S, N>, params: &Params<S, N>) {
    let (road, n) = (&params.road, params.road.num_lanes);
    let width = (road.boundaries[n] - road.boundaries[0]) / (2 * n) as f32;
    let has_puddles = params.simulations.puddle_film.simd_gt(0.0).any_true();
    for i in 0..params.num_slots_in_use {
        let vehicle = &params.vehicles[i];
        let mut lane = splat(params.simd, 0.0);
        for k in 1..n {
            lane = select(
                state.motion.d[i].simd_ge(road.boundaries[k]),
                splat(params.simd, k as i32 as f32),
                lane,
            );
        }
        let water = lane_film(params, value_of_lane(&road.film_path[..n], lane));
        let columns = friction_at_speed(
            &params.constants,
            state.motion.vx[i],
            vehicle.tyre_wear,
            vehicle.has_truck_tyres,
        );
        if !has_puddles {
            let friction = min(
                friction_at_film(&params.constants, &columns, water),
                vehicle.max_friction,
            );
            (
                state.friction_and_wind.mu_left[i],
                state.friction_and_wind.mu_right[i],
            ) = (friction, friction);
            continue;
        }
        let (s, d) = state.vehicle(params, i).road_position();
        let left = state
            .vehicle(params, i)
            .in_travel_direction(vehicle.half_track);
        let right = state
            .vehicle(params, i)
            .in_travel_direction(-vehicle.half_track);
        for (offset, friction) in [
            (left, &mut state.friction_and_wind.mu_left[i]),
            (right, &mut state.friction_and_wind.mu_right[i]),
        ] {
            let wheel_path = floor((d + offset - road.boundaries[0]) / width);
            let depth = puddle_depth_share(params, s, wheel_path);
            *friction = min(
                friction_at_film(
                    &params.constants,
                    &columns,
                    water + params.simulations.puddle_film * depth,
                ),
                vehicle.max_friction,
            );
        }
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Share of the side wind left beside high-sided vehicles upwind of vehicle `i`.
    #[inline(always)]
    fn wind_shelter<const TWO_WAY: bool>(self) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let constants = &params.constants;
        let wind = self.in_travel_direction(params.simulations.wind_across);
        let mut share = splat(params.simd, 1.0);
        for j in 0..params.num_slots_in_use {
            if slot == j {
                continue;
            }
            let other = &params.vehicles[j];
            let (s, d) = self.position_of::<TWO_WAY>(j);
            let aside = state.motion.d[slot] - d;
            let reach = constants.shelter_reach + self.vehicle().half_width + other.half_width;
            let upwind = (aside * wind).simd_gt(0.0);
            let beside = other.shelters_wind.simd_gt(0.0)
                & other.valid.simd_gt(0.0)
                & upwind
                & aside.abs().simd_lt(reach);
            if !beside.any_true() {
                continue;
            }
            let beyond = (state.motion.s[slot] - s).abs() - other.half_length;
            let u = clamp_to(
                beyond / (constants.shelter_release * 2.0 * other.half_length),
                0.0,
                1.0,
            );
            let open_share = constants.shelter_factor
                + (1.0 - constants.shelter_factor) * (u * u * (3.0 - 2.0 * u));
            share = select(beside, min(share, open_share), share);
        }
        share
    }

    /// The discrete gusts of bridges and cuttings, 0 to 1.
    #[inline(always)]
    fn discrete_gust(self) -> F32<S> {
        let params = self.params;
        let (s, _) = self.road_position();
        let cell = s / params.constants.gust_spacing + params.simulations.gust_phase;
        let inside =
            (cell - floor(cell)) * params.constants.gust_spacing / params.simulations.gust_length;
        let (_, cosine) = sincos(core::f32::consts::TAU * at_most(inside, 1.0));
        select(
            inside.simd_lt(1.0),
            0.5 - 0.5 * cosine,
            splat(params.simd, 0.0),
        )
    }
}

/// Push sideways for a part of each interval, after drivers answered the wind.
#[inline(always)]
pub fn apply_study_push<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    decision: u32,
) {
    let simulation = &params.simulations;
    let cell = decision as f32 * simulation.push_rate + simulation.push_phase;
    let pushed = simulation.push_accel.simd_ne(0.0)
        & (cell - floor(cell)).simd_lt(simulation.push_duty_cycle);
    for i in 0..params.num_slots_in_use {
        let force = state.friction_and_wind.wind_force[i]
            + state
                .vehicle(params, i)
                .in_travel_direction(simulation.push_accel)
                * params.vehicles[i].mass;
        state.friction_and_wind.wind_force[i] =
            select(pushed, force, state.friction_and_wind.wind_force[i]);
    }
}

/// Side force, yaw moment and tail wind of each vehicle.
#[inline(always)]
pub fn update_wind<S: Simd, const N: usize>(state: &mut State<S, N>, params: &Params<S, N>) {
    let (constants, simulation) = (&params.constants, &params.simulations);
    let has_gusts = simulation.gust_gain.simd_ne(0.0).any_true();
    for i in 0..params.num_slots_in_use {
        let vehicle = &params.vehicles[i];
        let mut strength = 1.0 + constants.turbulence_intensity * state.noise.gust[i];
        if has_gusts {
            strength += simulation.gust_gain * state.vehicle(params, i).discrete_gust();
        }
        let strength = at_least(strength, 0.0);
        let open = if params.road.directions.has_oncoming_traffic {
            state.vehicle(params, i).wind_shelter::<true>()
        } else {
            state.vehicle(params, i).wind_shelter::<false>()
        };
        let across = state
            .vehicle(params, i)
            .in_travel_direction(simulation.wind_across)
            * strength
            * open;
        state.friction_and_wind.tail_wind[i] = state
            .vehicle(params, i)
            .in_travel_direction(simulation.wind_along)
            * strength;
        let along = at_least(
            state.motion.vx[i] - state.friction_and_wind.tail_wind[i],
            MIN_AIR_SPEED,
        );
        let angle = atan(across.abs() / along);
        let (sine, _) = sincos(at_most(
            constants.wind_angle_factor * angle,
            core::f32::consts::FRAC_PI_2,
        ));
        let force = vehicle.side_wind * (along * along + across * across) * sine;
        state.friction_and_wind.wind_force[i] = select(across.simd_lt(0.0), -force, force);
        let cosine = along / (along * along + across * across).sqrt();
        state.friction_and_wind.wind_moment[i] = state.friction_and_wind.wind_force[i]
            * (vehicle.wind_centre * cosine + vehicle.wind_arm);
    }
}
