//! Road and weather at each vehicle: friction, course of the road, speed limits and wind. The twin of
//! `overtaking.sim.reference.road_conditions`, which names the sources.
//!
//! Functions run once for each decision of the drivers, every 0.05 s. Parameters of road and wind hold in the frame of
//! the road, the state in each vehicle's direction of travel. In both, lateral values are positive to the left, the
//! overtaking side. `travel_sign` (1 along the road, -1 against it) converts signs between the two.
//!
//! Values of type `F32<S>` and `Mask<S>` have one element for each simulation of a block, the simulations that are
//! computed together; such an element is a SIMD lane. `VehicleHandle` is a view of one vehicle in them. `N` is the
//! number of slots, the vehicles that a simulation can have.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{atan, exp, sincos};
use crate::math::philox::{MOTION, uniform, words};
use crate::math::vectors::{
    F32, Mask, SIMD_LANES, at_least, at_most, clamp_to, floor, max, min, select, splat,
};
use crate::names::{ModelConstants, SimulationParams, VehicleParams};
use crate::params::Params;
use crate::state::{NO_ACCEL_LIMIT, State};
use crate::vehicle_handle::VehicleHandle;

/// A uniform number of unit variance lies within +- sqrt(3).
const ROOT_3: f32 = 1.732_050_8;
/// Shifts of the two waves of puddles from one wheel path to the next, in wave lengths: neighbouring wheel paths have
/// puddles at different places. The first is one over the golden ratio, the second its square, because multiples of
/// these fill a period evenly.
const PHASE_STEP_1: f32 = 0.618_034;
const PHASE_STEP_2: f32 = 0.381_966;
/// Smallest radius of a vehicle's path over that of the reference line; keeps the path finite for a vehicle far inside
/// a bend [1]. A choice.
const MIN_RADIUS_SHARE: f32 = 0.25;
/// Keeps the angle of the wind finite at rest [m/s].
const MIN_AIR_SPEED: f32 = 1.0;

/// Advance an Ornstein-Uhlenbeck process of unit variance by one step.
///
/// `kept_share` is the correlation of the new value with the present one, 0 to 1, and `uniform_number` a random number
/// in (0, 1). A uniform number takes one random word, a normal one two; the process is nearly normal all the same.
#[inline(always)]
fn ornstein_uhlenbeck_step<S: Simd>(
    process: &mut F32<S>,
    kept_share: F32<S>,
    uniform_number: F32<S>,
) {
    let innovation = ROOT_3 * (2.0 * uniform_number - 1.0);
    *process = kept_share * *process + (1.0 - kept_share * kept_share).sqrt() * innovation;
}

/// Advance gusts, errors of judgement and wander in the lane by one decision.
#[inline(always)]
pub fn update_random_processes<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    decision_index: u32,
) {
    let (simd, constants, simulation) = (params.simd, &params.constants, &params.simulations);
    // The first draw keeps nothing of the past, so the processes start with unit variance.
    let has_past = if decision_index == 0 { 0.0 } else { 1.0 };
    // `decision` is the time between two decisions [s].
    let kept_error = has_past * exp(splat(simd, -constants.decision / constants.error_time));
    let kept_wander = has_past * exp(splat(simd, -constants.decision / constants.lane_time));
    for slot in 0..params.num_slots_in_use {
        let [gust_word, distance_word, speed_word, lane_word] = words(
            params.key,
            &params.scenario_index_low,
            &params.scenario_index_high,
            MOTION + slot as u32,
            decision_index,
        );
        let vehicle = state.vehicle(params, slot);
        let wind_along = vehicle.in_travel_direction(simulation.wind_along);
        let relative_along = state.motion.vx[slot] - wind_along;
        let wind_across = simulation.wind_across;
        let air_speed = (relative_along * relative_along + wind_across * wind_across).sqrt();
        // The turbulence is correlated over a length of air, and passes a fast vehicle in less time.
        let kept_gust =
            has_past * exp(-(air_speed * constants.decision) / constants.gust_length_scale);
        let noise = &mut state.noise;
        ornstein_uhlenbeck_step(&mut noise.gust[slot], kept_gust, uniform(simd, gust_word));
        ornstein_uhlenbeck_step(
            &mut noise.distance_error[slot],
            kept_error,
            uniform(simd, distance_word),
        );
        ornstein_uhlenbeck_step(
            &mut noise.speed_error[slot],
            kept_error,
            uniform(simd, speed_word),
        );
        ornstein_uhlenbeck_step(
            &mut noise.lane_wander[slot],
            kept_wander,
            uniform(simd, lane_word),
        );
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// A component along or across the road, in this vehicle's direction of travel.
    #[inline(always)]
    fn in_travel_direction(self, component: F32<S>) -> F32<S> {
        if self.params.road.directions.has_oncoming_traffic {
            self.vehicle().travel_sign * component
        } else {
            component
        }
    }
}

/// `values[lane]` for lanes as whole numbers; for other lanes the value of the nearest one.
#[inline(always)]
pub fn value_of_lane<S: Simd>(values: &[f32], lane: F32<S>) -> F32<S> {
    let mut result = splat(lane.simd, values[0]);
    for (index, value) in values.iter().enumerate().skip(1) {
        let is_reached = lane.simd_ge(index as i32 as f32);
        result = select(is_reached, splat(lane.simd, *value), result);
    }
    result
}

/// Film of water on a lane outside puddles [mm].
///
/// `path_factor` is the lane's entry of `film_path`: the factor by which the film grows with the distance over which
/// water drains to the lane [1].
#[inline(always)]
pub fn lane_film<S: Simd, const N: usize>(params: &Params<S, N>, path_factor: F32<S>) -> F32<S> {
    max(
        params.simulations.min_wet_film,
        params.simulations.film_rain_factor * path_factor - params.simulations.texture_depth,
    )
}

/// Triangle wave of period 1: falls linearly from 1 at 0 to 0 at 0.5 and rises again.
#[inline(always)]
fn triangle_wave<S: Simd>(x: F32<S>) -> F32<S> {
    (2.0 * (x - floor(x)) - 1.0).abs()
}

/// Depth of the puddle at a point, as a share of its full depth: 0 outside puddles, at most 1.
///
/// Puddles lie where two triangle waves along the wheel path add up to less than a threshold, and are the deeper, the
/// less they add up to. `wheel_path` is a whole number, counted across the road.
#[inline(always)]
fn puddle_depth_share<S: Simd, const N: usize>(
    params: &Params<S, N>,
    s: F32<S>,
    wheel_path: F32<S>,
) -> F32<S> {
    let (constants, simulation) = (&params.constants, &params.simulations);
    let wave_1 = triangle_wave(
        s * constants.inverse_puddle_wave_1 + simulation.puddle_phase_1 + PHASE_STEP_1 * wheel_path,
    );
    let wave_sum = wave_1
        + triangle_wave(
            s * constants.inverse_puddle_wave_2
                + simulation.puddle_phase_2
                + PHASE_STEP_2 * wheel_path,
        );
    clamp_to(
        (simulation.puddle_threshold - wave_sum) * constants.puddle_slope,
        0.0,
        1.0,
    )
}

/// Peak friction of tyres at a speed [1], one value for each of the four films of water of the table.
///
/// `wear` is 0 for new tyres to 1 for worn ones; `truck` is 1 for truck tyres, else 0.
#[inline(always)]
pub fn friction_at_speed<S: Simd>(
    constants: &ModelConstants,
    speed: F32<S>,
    wear: F32<S>,
    truck: F32<S>,
) -> [F32<S>; 4] {
    let [v0, v1, v2] = constants.friction_speeds;
    // Shares of the ways from the first to the second speed of the table and from the second to the third.
    let low = clamp_to((speed - v0) / (v1 - v0), 0.0, 1.0);
    let high = clamp_to((speed - v1) / (v2 - v1), 0.0, 1.0);
    let mut columns = [splat(speed.simd, 0.0); 4];
    for (film, column) in columns.iter_mut().enumerate() {
        // The friction at each of the three speeds, for this wear.
        let mut rows = [*column; 3];
        for (row, (new, worn)) in rows
            .iter_mut()
            .zip(constants.friction_new.iter().zip(&constants.friction_worn))
        {
            *row = new[film] + wear * (worn[film] - new[film]);
        }
        let change = low * (rows[1] - rows[0]) + high * (rows[2] - rows[1]);
        *column = match film {
            // Dry.
            0 => (1.0 + truck * (constants.truck_dry_factor - 1.0)) * (rows[0] + change),
            // 0.2 mm: truck tyres like car tyres.
            1 => rows[0] + change,
            // 1 mm and 2 mm: truck tyres lose less friction with speed.
            _ => rows[0] + (1.0 + truck * (constants.truck_loss_factor - 1.0)) * change,
        };
    }
    columns
}

/// Peak friction on a film of water [mm], linear between the values of `friction_at_speed` [1].
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
    // Shares of the ways from each film of the table to the next.
    let share_1 = clamp_to((film - h0) / (h1 - h0), 0.0, 1.0);
    let share_2 = clamp_to((film - h1) / (h2 - h1), 0.0, 1.0);
    let share_3 = clamp_to((film - h2) / (h3 - h2), 0.0, 1.0);
    let friction = columns[0] + share_1 * (columns[1] - columns[0]);
    let friction = friction + share_2 * (columns[2] - columns[1]);
    let friction = friction + share_3 * (columns[3] - columns[2]);
    at_least(friction, constants.friction_floor)
}

/// Update curvature, slope, sight and desired speeds of the vehicle in `slot` until the next decision.
///
/// Curvature and slope hold for the middle of that time, the other values for its start. For a vehicle against the road
/// a bend to the left becomes a bend to the right, and a rise a fall.
///
/// Ahead of a lower speed limit the desired speed falls. The driver brakes at the rate of this fall, and removes the
/// difference between its speed and the desired one with a time constant. It does not brake harder than its comfortable
/// deceleration.
#[inline(always)]
pub fn update_road_course<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let (directions, table) = (&params.road.directions, &params.road.course_table);
    let (s, d, v) = (
        state.motion.s[slot],
        state.motion.d[slot],
        state.motion.vx[slot],
    );
    let travel_sign = vehicle.travel_sign;
    let drives_against = travel_sign.simd_lt(0.0);
    let last = (table.curvature.len() - 1) as f32; // Index of the last station of the table.
    // Index of the direction of travel in pairs of rows of the table, for the simulation in one SIMD lane.
    let direction = |simd_lane: usize| usize::from(travel_sign[simd_lane] < 0.0);

    let half_decision = 0.5 * constants.decision;
    // A driver steers for the curvature at the place where the vehicle will respond; the lags are times [s].
    let steering_lag = select(
        vehicle.two_wheeler.simd_gt(0.0),
        splat(params.simd, constants.two_wheeler_lag),
        constants.steering_lag + vehicle.side_lag * v,
    );
    let middle_station = course_station(params, drives_against, s + half_decision * v);
    let ahead_s = s + (half_decision + steering_lag) * v;
    let ahead_station = course_station(params, drives_against, ahead_s);
    // Distance to the left of the reference line, in the direction of travel. The reference line is at d = `edge_sum`
    // in the frame of vehicles against the road.
    let offset = select(drives_against, d - directions.edge_sum, d);
    let curvature = travel_sign * interpolate_course(middle_station, last, |_| &table.curvature);
    let curvature_ahead =
        travel_sign * interpolate_course(ahead_station, last, |_| &table.curvature);
    let road = &mut state.road;
    road.station_per_metre[slot] = station_per_metre(curvature, offset);
    // The curvature of the vehicle's path, whose radius is smaller by `offset`.
    road.curvature[slot] = curvature * road.station_per_metre[slot];
    road.curvature_ahead[slot] = curvature_ahead * station_per_metre(curvature_ahead, offset);
    road.sin_slope[slot] =
        travel_sign * interpolate_course(middle_station, last, |_| &table.sine_of_slope);

    let station = course_station(params, drives_against, s);
    let radii = [&table.radius_along, &table.radius_against];
    // Radius by which drivers choose their speed: large where the next bends are wide or far ahead.
    let radius = interpolate_course(station, last, |simd_lane| radii[direction(simd_lane)]);
    let bend_accel = at_most(params.simulations.max_lateral_accel, constants.bend_accel);
    road.bend_speed[slot] = (bend_accel * radius).sqrt();
    let sight_distances = [
        &table.sight_along,
        &table.sight_against,
        &table.truck_sight_along,
        &table.truck_sight_against,
    ];
    // The eyes of a truck driver are higher, so crests hide less.
    road.sight_distance[slot] = interpolate_course(station, last, |simd_lane| {
        let is_truck = usize::from(vehicle.has_truck_tyres[simd_lane] > 0.0);
        sight_distances[2 * is_truck + direction(simd_lane)]
    });

    // Largest speed from which a driver can slow down in time for each limit here and ahead.
    let allowed_speeds = [&table.allowed_speed_along, &table.allowed_speed_against];
    let next_s = s + constants.decision * v;
    let next_station = course_station(params, drives_against, next_s);
    let speed_limit = interpolate_course(station, last, |simd_lane| {
        allowed_speeds[direction(simd_lane)]
    });
    let next_speed_limit = interpolate_course(next_station, last, |simd_lane| {
        allowed_speeds[direction(simd_lane)]
    });
    road.speed_limit[slot] = speed_limit;
    let adapted_speed_now = adapted_speed(vehicle, &params.simulations, speed_limit);
    let desired_speed = min(adapted_speed_now, vehicle.desired_speed);
    let next_adapted_speed = adapted_speed(vehicle, &params.simulations, next_speed_limit);
    let next_desired_speed = min(next_adapted_speed, vehicle.desired_speed);
    let change_rate = (next_desired_speed - desired_speed) / constants.decision;
    // `per_approach` is one over the time constant.
    let accel_limit = max(
        change_rate + (desired_speed - v) * constants.per_approach,
        -vehicle.decel,
    );
    road.accel_limit[slot] = select(
        change_rate.simd_lt(0.0),
        accel_limit,
        splat(params.simd, NO_ACCEL_LIMIT),
    );
    road.passing_speed[slot] = min(
        desired_speed * constants.passing_speed_factor,
        vehicle.passing_speed,
    );
    road.desired_speed[slot] = desired_speed;
}

/// Position in the course table at station `s` [m] of a vehicle, as a multiple of the spacing of its stations [1].
///
/// This and `station_per_metre` are functions: the compiler does not inline a closure that is called twice, and
/// compiles it without the SIMD features of the CPU.
#[inline(always)]
fn course_station<S: Simd, const N: usize>(
    params: &Params<S, N>,
    drives_against: Mask<S>,
    s: F32<S>,
) -> F32<S> {
    let last = (params.road.course_table.curvature.len() - 1) as f32;
    let road_s = select(drives_against, params.road.directions.length - s, s);
    clamp_to(road_s * params.constants.per_station, 0.0, last)
}

/// Metres of the reference line passed for each metre driven by a vehicle `offset` metres to the left of the line [1].
///
/// It is above 1 inside of a bend.
#[inline(always)]
fn station_per_metre<S: Simd>(curvature: F32<S>, offset: F32<S>) -> F32<S> {
    1.0 / at_least(1.0 - curvature * offset, MIN_RADIUS_SHARE)
}

/// Speed that a driver wants under a limit in its weather and light [m/s].
///
/// A fully cautious driver slows by `rain_slowing`, and further to `stoppable_speed` if that speed is lower still.
/// Other drivers slow by the share `caution` of this reduction.
#[inline(always)]
fn adapted_speed<S: Simd>(
    vehicle: &VehicleParams<S>,
    simulation: &SimulationParams<S>,
    speed_limit: F32<S>,
) -> F32<S> {
    let excess_over_limit = at_least(vehicle.free_speed - speed_limit, 0.0);
    let in_good_weather = vehicle.free_speed - vehicle.speed_limit_compliance * excess_over_limit;
    let excess_over_sight = at_least(
        in_good_weather - simulation.rain_slowing - simulation.stoppable_speed,
        0.0,
    );
    in_good_weather - vehicle.caution * (simulation.rain_slowing + excess_over_sight)
}

/// A row of the course table, linear between its stations.
///
/// `row` gives the row for the simulation in a SIMD lane, and `last` is the index of the last station.
#[inline(always)]
fn interpolate_course<'a, S: Simd>(
    station: F32<S>,
    last: f32,
    row: impl Fn(usize) -> &'a [f32],
) -> F32<S> {
    let first = at_most(floor(station), last - 1.0);
    let (mut low, mut high) = (first, first);
    for simd_lane in 0..SIMD_LANES {
        let (row, k) = (row(simd_lane), first[simd_lane] as usize);
        (low[simd_lane], high[simd_lane]) = (row[k], row[k + 1]);
    }
    low + (station - first) * (high - low)
}

/// Update the friction under the wheels of either side.
#[inline(always)]
pub fn update_friction<S: Simd, const N: usize>(state: &mut State<S, N>, params: &Params<S, N>) {
    let (constants, road, num_lanes) = (&params.constants, &params.road, params.road.num_lanes);
    // Puddles lie along the wheel paths, two in each lane.
    let path_width = (road.boundaries[num_lanes] - road.boundaries[0]) / (2 * num_lanes) as f32;
    let has_puddles = params.simulations.puddle_film.simd_gt(0.0).any_true();
    for slot in 0..params.num_slots_in_use {
        let vehicle = &params.vehicles[slot];
        // The lane that the centre is in, in the frame of the vehicle: from there a two-way road, whose two lanes are
        // equally wide, looks the same in both directions.
        let mut lane = splat(params.simd, 0.0);
        for index in 1..num_lanes {
            let is_beyond_line = state.motion.d[slot].simd_ge(road.boundaries[index]);
            lane = select(
                is_beyond_line,
                splat(params.simd, index as i32 as f32),
                lane,
            );
        }
        let film = lane_film(params, value_of_lane(&road.film_path[..num_lanes], lane));
        // The friction at this speed on each film of the table, between which `friction_at_film` interpolates.
        let columns = friction_at_speed(
            constants,
            state.motion.vx[slot],
            vehicle.tyre_wear,
            vehicle.has_truck_tyres,
        );
        if !has_puddles {
            let friction = min(
                friction_at_film(constants, &columns, film),
                vehicle.max_friction,
            );
            state.friction_and_wind.mu_left[slot] = friction;
            state.friction_and_wind.mu_right[slot] = friction;
            continue;
        }
        let handle = state.vehicle(params, slot);
        let (s, d) = handle.road_position();
        let left_offset = handle.in_travel_direction(vehicle.half_track);
        let right_offset = handle.in_travel_direction(-vehicle.half_track);
        for (offset, friction) in [
            (left_offset, &mut state.friction_and_wind.mu_left[slot]),
            (right_offset, &mut state.friction_and_wind.mu_right[slot]),
        ] {
            // Number of the wheel path, counted from the kerb side.
            let wheel_path = floor((d + offset - road.boundaries[0]) / path_width);
            let depth_share = puddle_depth_share(params, s, wheel_path);
            let local_film = film + params.simulations.puddle_film * depth_share;
            *friction = min(
                friction_at_film(constants, &columns, local_film),
                vehicle.max_friction,
            );
        }
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Share of the side wind left beside high-sided vehicles upwind.
    ///
    /// Shelter is full beside the body and ends as a smooth step over a part of the body's length.
    #[inline(always)]
    fn wind_shelter<const TWO_WAY: bool>(self) -> F32<S> {
        let (motion, params, slot) = (&self.state.motion, self.params, self.slot);
        let constants = &params.constants;
        let wind_across = self.in_travel_direction(params.simulations.wind_across);
        let mut share = splat(params.simd, 1.0);
        for j in (0..params.num_slots_in_use).filter(|j| *j != slot) {
            let shelter = &params.vehicles[j];
            let (s, d) = self.position_of::<TWO_WAY>(j);
            let lateral_distance = motion.d[slot] - d;
            let reach = constants.shelter_reach + self.vehicle().half_width + shelter.half_width;
            // The wind blows from the other vehicle to this one.
            let is_upwind = (lateral_distance * wind_across).simd_gt(0.0);
            let is_sheltered = shelter.shelters_wind.simd_gt(0.0)
                & shelter.valid.simd_gt(0.0)
                & is_upwind
                & lateral_distance.abs().simd_lt(reach);
            if !is_sheltered.any_true() {
                continue;
            }
            let distance_past_body = (motion.s[slot] - s).abs() - shelter.half_length;
            // 0 beside the body, 1 where the shelter has ended.
            let release = clamp_to(
                distance_past_body / (constants.shelter_release * 2.0 * shelter.half_length),
                0.0,
                1.0,
            );
            let factor = constants.shelter_factor;
            let smooth_step = release * release * (3.0 - 2.0 * release);
            let open_share = factor + (1.0 - factor) * smooth_step;
            share = select(is_sheltered, min(share, open_share), share);
        }
        share
    }

    /// Strength of the single gusts at bridges and cuttings, 0 to 1.
    ///
    /// The road has one gust in each interval of `gust_spacing`, with the shape of 1 - cos. It covers the first
    /// `gust_length` metres.
    #[inline(always)]
    fn discrete_gust(self) -> F32<S> {
        let params = self.params;
        let (s, _) = self.road_position();
        let num_intervals = s / params.constants.gust_spacing + params.simulations.gust_phase;
        // Share of the gust that the vehicle has passed, above 1 beyond the gust.
        let gust_share = (num_intervals - floor(num_intervals)) * params.constants.gust_spacing
            / params.simulations.gust_length;
        let (_, cosine) = sincos(core::f32::consts::TAU * at_most(gust_share, 1.0));
        select(
            gust_share.simd_lt(1.0),
            0.5 - 0.5 * cosine,
            splat(params.simd, 0.0),
        )
    }
}

/// Add the pushes of the study by Pinto et al. (2023) to the wind force: sideways, for a part of each interval.
#[inline(always)]
pub fn apply_study_push<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    decision_index: u32,
) {
    let simulation = &params.simulations;
    // Intervals since the start, one for each push.
    let num_intervals = decision_index as f32 * simulation.push_rate + simulation.push_phase;
    let is_pushed = simulation.push_accel.simd_ne(0.0)
        & (num_intervals - floor(num_intervals)).simd_lt(simulation.push_duty_cycle);
    for slot in 0..params.num_slots_in_use {
        let vehicle = state.vehicle(params, slot);
        let push_accel = vehicle.in_travel_direction(simulation.push_accel);
        let push_force = push_accel * params.vehicles[slot].mass;
        let wind_force = &mut state.friction_and_wind.wind_force[slot];
        *wind_force = select(is_pushed, *wind_force + push_force, *wind_force);
    }
}

/// Update side force, yaw moment and tail wind of each vehicle.
#[inline(always)]
pub fn update_wind<S: Simd, const N: usize>(state: &mut State<S, N>, params: &Params<S, N>) {
    let (constants, simulation) = (&params.constants, &params.simulations);
    let has_gusts = simulation.gust_gain.simd_ne(0.0).any_true();
    for slot in 0..params.num_slots_in_use {
        let (vehicle, handle) = (&params.vehicles[slot], state.vehicle(params, slot));
        // Factor on the mean wind; `noise.gust` is the turbulence.
        let mut strength = 1.0 + constants.turbulence_intensity * state.noise.gust[slot];
        if has_gusts {
            strength += simulation.gust_gain * handle.discrete_gust();
        }
        let strength = at_least(strength, 0.0);
        let open_share = if params.road.directions.has_oncoming_traffic {
            handle.wind_shelter::<true>()
        } else {
            handle.wind_shelter::<false>()
        };
        let across = handle.in_travel_direction(simulation.wind_across) * strength * open_share;
        let tail_wind = handle.in_travel_direction(simulation.wind_along) * strength;
        let along = at_least(state.motion.vx[slot] - tail_wind, MIN_AIR_SPEED);
        // The force coefficient grows with the angle of the relative wind, up to a maximum.
        let angle = atan(across.abs() / along);
        let (sine, _) = sincos(at_most(
            constants.wind_angle_factor * angle,
            core::f32::consts::FRAC_PI_2,
        ));
        let squared_air_speed = along * along + across * across;
        let force = vehicle.side_wind * squared_air_speed * sine;
        let force = select(across.simd_lt(0.0), -force, force);
        // The centre of pressure moves back as the wind comes more from the side. `wind_arm` is the distance of the
        // middle between the axles ahead of the centre of gravity.
        let cosine = along / squared_air_speed.sqrt();
        let wind = &mut state.friction_and_wind;
        wind.tail_wind[slot] = tail_wind;
        wind.wind_force[slot] = force;
        wind.wind_moment[slot] = force * (vehicle.wind_centre * cosine + vehicle.wind_arm);
    }
}
