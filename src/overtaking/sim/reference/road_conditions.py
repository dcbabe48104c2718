"""What the weather does to each vehicle at a decision: friction under it, wind beside it."""

import dataclasses

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import atan, clamp, exp, maximum, minimum, sincos
from overtaking.core.random_numbers import Stream, philox_words, uniform_from_word
from overtaking.sim.reference.state import NO_ACCEL_LIMIT, State
from overtaking.world import road_surface
from overtaking.world.driver_parameters import DesiredSpeedFactors, adapted_speed
from overtaking.world.road_parameters import allowed_speed, bend_speed, interpolate_course
from overtaking.world.step_parameters import StepParameters

_ROOT_3 = np.float32(1.732_050_8)  # A uniform number of unit variance lies within +- sqrt(3).


_TAU = np.float32(6.283_185_5)


_HALF_PI = np.float32(1.570_796_4)


_MIN_RADIUS_SHARE = np.float32(0.25)  # Keeps the path finite for a vehicle inside the bend.


_MIN_AIR_SPEED = np.float32(1.0)  # Keeps the angle of the wind finite at rest [m/s].


def _ornstein_uhlenbeck_step(process: F32, keep: F32, word: F32) -> F32:
    """One step of an Ornstein-Uhlenbeck process of unit variance with uniform innovations.

    Over a correlation time of dozens of steps the sum of the innovations is normal to within 2 % in
    kurtosis (Berry-Esseen), and a uniform number is a single word.
    """
    innovation = _ROOT_3 * (np.float32(2.0) * word - np.float32(1.0))
    return keep * process + np.sqrt(np.float32(1.0) - keep * keep) * innovation


def update_random_processes(
    state: State,
    params: StepParameters,
    decision_index: int,
) -> None:
    """Advance gusts, errors of judgement and wander in the lane by one decision."""
    vehicles, simulations = params.vehicles, params.simulations
    constants = params.constants
    slots = np.arange(state.motion.s.shape[0], dtype=np.uint32)[:, None] + np.uint32(Stream.MOTION)
    draw = [
        uniform_from_word(word)
        for word in philox_words(params.seed, params.scenario_index[None, :], slots, decision_index)
    ]
    along = state.motion.vx - vehicles.travel_sign * simulations.wind_along
    air_speed = np.sqrt(along * along + simulations.wind_across * simulations.wind_across)
    # The first draw is the stationary state: nothing of a past is kept.
    kept = np.float32(0.0 if decision_index == 0 else 1.0)
    keep = kept * exp(-(air_speed * constants.decision) / constants.gust_length_scale)
    state.noise.gust = _ornstein_uhlenbeck_step(state.noise.gust, keep, draw[0])
    keep_error = kept * exp(-constants.decision / constants.error_time)
    state.noise.distance_error = _ornstein_uhlenbeck_step(
        state.noise.distance_error, keep_error, draw[1]
    )
    state.noise.speed_error = _ornstein_uhlenbeck_step(state.noise.speed_error, keep_error, draw[2])
    state.noise.lane_wander = _ornstein_uhlenbeck_step(
        state.noise.lane_wander, kept * exp(-constants.decision / constants.lane_time), draw[3]
    )


def value_of_lane(values: F32, lane: F32, count: int) -> F32:
    """`values[lane]` for whole-number lanes, the first or last value outside 0 to count - 1."""
    chosen = np.zeros_like(lane) + values[0]
    for k in range(1, count):
        chosen = np.where(lane >= np.float32(k), values[k], chosen)
    return chosen


def update_friction(state: State, params: StepParameters) -> None:
    """Friction under the wheels of either side."""
    vehicles, simulations = params.vehicles, params.simulations
    constants, road = params.constants, params.road
    lane = np.zeros_like(state.motion.d)
    for k in range(1, road.num_lanes):
        lane = np.where(state.motion.d >= road.boundaries[k], np.float32(k), lane)
    path = value_of_lane(road.film_path, lane, road.num_lanes)
    water = road_surface.lane_film(
        simulations.min_wet_film, simulations.film_rain_factor, path, simulations.texture_depth
    )
    columns = road_surface.friction_at_speed(
        constants, state.motion.vx, vehicles.tyre_wear, vehicles.has_truck_tyres
    )
    width = (road.boundaries[road.num_lanes] - road.boundaries[0]) / np.float32(2 * road.num_lanes)
    sides = []
    s, d = state.road_position(params)
    for offset in (vehicles.half_track, -vehicles.half_track):
        wheel_path = road_surface.floor(
            (d + vehicles.travel_sign * offset - road.boundaries[0]) / width
        )
        depth = road_surface.puddle_depth_share(
            constants,
            s,
            wheel_path,
            simulations.puddle_phase_1,
            simulations.puddle_phase_2,
            simulations.puddle_threshold,
        )
        found = road_surface.friction_at_film(
            constants, columns, water + simulations.puddle_film * depth
        )
        sides.append(minimum(found, vehicles.max_friction))
    state.friction_and_wind.mu_left, state.friction_and_wind.mu_right = sides


def update_road_course(state: State, params: StepParameters) -> None:
    """Curvature, slope and sight at each vehicle until the next decision.

    Values are those of the middle of that time. For an oncoming vehicle a bend to the left is one
    to the right, and a rise is a fall.
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants, road = params.constants, params.road
    if not road.varies_along_road:
        return
    one, half, table = np.float32(1.0), np.float32(0.5), road.course_table
    high = vehicles.has_truck_tyres > 0
    turned = vehicles.travel_sign < 0
    offset = np.where(turned, state.motion.d - road.edge_sum, state.motion.d)
    soon = half * constants.decision
    late = np.where(
        vehicles.two_wheeler > 0,
        constants.two_wheeler_lag,
        constants.steering_lag + vehicles.side_lag * state.motion.vx,
    )
    here = state.motion.s + soon * state.motion.vx
    there = state.motion.s + (soon + late) * state.motion.vx

    def at(row: F32, s: F32) -> F32:
        return interpolate_course(row, np.where(turned, road.length - s, s) * constants.per_station)

    def stretch(bend: F32) -> F32:
        return one / maximum(one - bend * offset, _MIN_RADIUS_SHARE)

    bend, ahead = (vehicles.travel_sign * at(table.curvature, s) for s in (here, there))
    state.road.station_per_metre = stretch(bend)
    state.road.curvature = bend * state.road.station_per_metre
    state.road.curvature_ahead = ahead * stretch(ahead)
    state.road.sin_slope = vehicles.travel_sign * at(table.sine_of_slope, here)
    by_car, by_truck = (
        np.where(turned, at(against, state.motion.s), at(along, state.motion.s))
        for along, against in (
            (table.sight_along, table.sight_against),
            (table.truck_sight_along, table.truck_sight_against),
        )
    )
    state.road.bend_speed = bend_speed(
        constants, road, simulations.max_lateral_accel, state.motion.s, turned
    )
    state.road.sight_distance = np.where(high, by_truck, by_car)


def with_local_speeds(state: State, params: StepParameters) -> StepParameters:
    """Parameters with the speeds that drivers want by the limits at and ahead of them.

    Ahead of a lower limit the wanted speed falls. The driver brakes at the rate at which it falls,
    less the remaining difference over a time constant, but no harder than its comfortable
    deceleration. The driver thus approaches the wanted speed from below.

    Args:
        state: State at a decision; `LocalRoad.accel_limit` is set.
        params: Parameters of the batch.
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants, road = params.constants, params.road
    if not road.varies_along_road:
        return params
    turned = vehicles.travel_sign < 0
    wish = DesiredSpeedFactors(
        vehicles.free_speed,
        vehicles.speed_limit_compliance,
        vehicles.caution,
        simulations.rain_slowing,
        simulations.stoppable_speed,
    )
    allowed, coming = (
        allowed_speed(constants, road, s, turned)
        for s in (state.motion.s, state.motion.s + constants.decision * state.motion.vx)
    )
    here, soon = (
        minimum(adapted_speed(wish, limit), vehicles.desired_speed) for limit in (allowed, coming)
    )
    change = (soon - here) / constants.decision
    eased = change + (here - state.motion.vx) * constants.per_approach
    state.road.accel_limit = np.where(change < 0, maximum(eased, -vehicles.decel), NO_ACCEL_LIMIT)
    passing = minimum(here * constants.passing_speed_factor, vehicles.passing_speed)
    local = vehicles._replace(desired_speed=here, passing_speed=passing, speed_limit=allowed)
    return dataclasses.replace(params, local_vehicles=local)


def wind_shelter(state: State, params: StepParameters) -> F32:
    """Share of the side wind left beside high-sided vehicles upwind, (vehicle, simulation).

    Source:
        Full beside the body, back as a smooth step over a part of its length (a choice); side winds
        on what passes a truck: Coleman and Baker 1990.
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants = params.constants
    share = np.ones_like(state.motion.s)
    one = np.float32(1.0)
    for j in range(state.motion.s.shape[0]):
        other_s, other_d = state.position_seen_by_each(params, j)
        beyond = np.abs(state.motion.s - other_s) - vehicles.half_length[j]
        u = clamp(
            beyond / (constants.shelter_release * np.float32(2.0) * vehicles.half_length[j]),
            np.float32(0.0),
            one,
        )
        open_share = constants.shelter_factor + (one - constants.shelter_factor) * (
            u * u * (np.float32(3.0) - np.float32(2.0) * u)
        )
        aside = state.motion.d - other_d
        reach = constants.shelter_reach + vehicles.half_width + vehicles.half_width[j]
        upwind = aside * (vehicles.travel_sign * simulations.wind_across) > 0
        beside = (
            (vehicles.shelters_wind[j] > 0)
            & (vehicles.valid[j] > 0)
            & upwind
            & (np.abs(aside) < reach)
        )
        beside[j] = False
        share = np.where(beside, minimum(share, open_share), share)
    return share


def discrete_gust(state: State, params: StepParameters) -> F32:
    """The single gusts of bridges and cuttings, 0 to 1: one every `gust_spacing`, 1 - cos shaped.

    Source:
        The shape of discrete gusts in certification rules, such as EASA CS-25.341.
    """
    simulations = params.simulations
    constants = params.constants
    s, _ = state.road_position(params)
    cell = s / constants.gust_spacing + simulations.gust_phase
    inside = (cell - road_surface.floor(cell)) * constants.gust_spacing / simulations.gust_length
    _, cosine = sincos(_TAU * minimum(inside, np.float32(1.0)))
    return np.where(
        inside < np.float32(1.0), np.float32(0.5) - np.float32(0.5) * cosine, np.float32(0.0)
    )


def update_wind(state: State, params: StepParameters) -> None:
    """Side force, yaw moment and tail wind of each vehicle.

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapter 4: coefficients on the side area
        at the relative wind, growing with its angle; the growth saturates (a choice).
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants = params.constants
    one = np.float32(1.0)
    bumps = simulations.gust_gain * discrete_gust(state, params)
    strength = one + constants.turbulence_intensity * state.noise.gust + bumps
    strength = maximum(strength, np.float32(0.0))
    across = vehicles.travel_sign * simulations.wind_across * strength * wind_shelter(state, params)
    state.friction_and_wind.tail_wind = vehicles.travel_sign * simulations.wind_along * strength
    along = maximum(state.motion.vx - state.friction_and_wind.tail_wind, _MIN_AIR_SPEED)
    angle = atan(np.abs(across) / along)
    sine, _ = sincos(minimum(constants.wind_angle_factor * angle, _HALF_PI))
    force = vehicles.side_wind * (along * along + across * across) * sine
    state.friction_and_wind.wind_force = np.where(across < 0, -force, force)
    cosine = along / np.sqrt(along * along + across * across)
    state.friction_and_wind.wind_moment = state.friction_and_wind.wind_force * (
        vehicles.wind_centre * cosine + vehicles.wind_arm
    )


def apply_study_push(state: State, params: StepParameters, decision_index: int) -> None:
    """Push sideways for a part of each interval, unannounced: after drivers answered the wind.

    Source:
        Pinto, Dutra and Fonseca 2023: forces towards the side that the wind blows to, at longer
        intervals for less rain and wind. Size and duration are choices of the specification.
    """
    vehicles, simulations = params.vehicles, params.simulations
    cell = np.float32(decision_index) * simulations.push_rate + simulations.push_phase
    pushed = (simulations.push_accel != 0) & (
        cell - road_surface.floor(cell) < simulations.push_duty_cycle
    )
    force = (
        state.friction_and_wind.wind_force
        + vehicles.travel_sign * simulations.push_accel * vehicles.mass
    )
    state.friction_and_wind.wind_force = np.where(pushed, force, state.friction_and_wind.wind_force)
