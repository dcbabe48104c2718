"""Road and weather at each vehicle: friction, course of the road, speed limits and wind.

Functions run once for each decision of the drivers, every 0.05 s. Parameters of road and wind hold
in the frame of the road, the state in each vehicle's direction of travel. In both, lateral values
are positive to the left, the overtaking side. `travel_sign` (1 along the road, -1 against it)
converts signs between the two.
"""

import dataclasses

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import (
    HALF,
    HALF_PI,
    ONE,
    TAU,
    TWO,
    ZERO,
    atan,
    clamp,
    exp,
    maximum,
    minimum,
    sincos,
)
from overtaking.core.random_numbers import Stream, philox_words, uniform_from_word
from overtaking.sim.reference.state import NO_ACCEL_LIMIT, State
from overtaking.world import road_surface
from overtaking.world.driver_parameters import DesiredSpeedFactors, adapted_speed
from overtaking.world.road_parameters import allowed_speed, bend_speed, interpolate_course
from overtaking.world.step_parameters import StepParameters

_ROOT_3 = np.float32(1.732_050_8)  # A uniform number of unit variance lies within +- sqrt(3).

# Smallest radius of a vehicle's path over that of the reference line; keeps the path finite for a
# vehicle far inside a bend [1]. A choice.
_MIN_RADIUS_SHARE = np.float32(0.25)

_MIN_AIR_SPEED = np.float32(1.0)  # Keeps the angle of the wind finite at rest [m/s].


def _ornstein_uhlenbeck_step(process: F32, kept_share: F32, uniform_number: F32) -> F32:
    """One step of an Ornstein-Uhlenbeck process of unit variance with uniform innovations.

    A uniform number takes one random word, a normal one two. The process is nearly normal all the
    same: with a correlation time of 80 steps its excess kurtosis is -0.015.

    Args:
        process: Present value [1].
        kept_share: Correlation of the new value with the present one, 0 to 1.
        uniform_number: Uniform random number, 0 to 1.
    """
    innovation = _ROOT_3 * (TWO * uniform_number - ONE)
    return kept_share * process + np.sqrt(ONE - kept_share * kept_share) * innovation


def update_random_processes(state: State, params: StepParameters, decision_index: int) -> None:
    """Advance gusts, errors of judgement and wander in the lane by one decision."""
    vehicles, simulations = params.vehicles, params.simulations
    constants, noise = params.constants, state.noise
    # Each vehicle has a stream of random words of its own, four words for each decision.
    streams = np.arange(len(state.motion.s), dtype=np.uint32)[:, None] + np.uint32(Stream.MOTION)
    words = philox_words(params.seed, params.scenario_index[None, :], streams, decision_index)
    gust_draw, distance_draw, speed_draw, wander_draw = (uniform_from_word(word) for word in words)
    relative_along = state.motion.vx - vehicles.travel_sign * simulations.wind_along
    wind_across = simulations.wind_across
    air_speed = np.sqrt(relative_along * relative_along + wind_across * wind_across)
    # The first draw keeps nothing of the past, so the processes start with unit variance.
    has_past = np.float32(0.0 if decision_index == 0 else 1.0)
    decision = constants.decision  # Time between two decisions [s].
    # The turbulence is correlated over a length of air, and passes a fast vehicle in less time.
    kept_gust = has_past * exp(-(air_speed * decision) / constants.gust_length_scale)
    kept_error = has_past * exp(-decision / constants.error_time)
    kept_wander = has_past * exp(-decision / constants.lane_time)
    noise.gust = _ornstein_uhlenbeck_step(noise.gust, kept_gust, gust_draw)
    noise.distance_error = _ornstein_uhlenbeck_step(noise.distance_error, kept_error, distance_draw)
    noise.speed_error = _ornstein_uhlenbeck_step(noise.speed_error, kept_error, speed_draw)
    noise.lane_wander = _ornstein_uhlenbeck_step(noise.lane_wander, kept_wander, wander_draw)


def value_of_lane(values: F32, lane: F32, num_lanes: int) -> F32:
    """`values[lane]` for lanes as whole numbers; for other lanes the value of the nearest one."""
    value = np.zeros_like(lane) + values[0]
    for k in range(1, num_lanes):
        value = np.where(lane >= np.float32(k), values[k], value)
    return value


def update_friction(state: State, params: StepParameters) -> None:
    """Update the friction under the wheels of either side in `state.friction_and_wind`."""
    vehicles, simulations = params.vehicles, params.simulations
    constants, road = params.constants, params.road
    # The lane that the centre is in, in the frame of the vehicle: from there a two-way road, whose
    # two lanes are equally wide, looks the same in both directions.
    lane = np.zeros_like(state.motion.d)
    for k in range(1, road.num_lanes):
        lane = np.where(state.motion.d >= road.boundaries[k], np.float32(k), lane)
    # The film grows with the distance over which water drains to the lane, by this factor.
    path_factor = value_of_lane(road.film_path, lane, road.num_lanes)
    film = road_surface.lane_film(
        simulations.min_wet_film,
        simulations.film_rain_factor,
        path_factor,
        simulations.texture_depth,
    )
    # The friction at this speed on each film of the table, between which `friction_at_film`
    # interpolates.
    friction_columns = road_surface.friction_at_speed(
        constants, state.motion.vx, vehicles.tyre_wear, vehicles.has_truck_tyres
    )
    # Puddles lie along the wheel paths, two in each lane.
    path_width = (road.boundaries[road.num_lanes] - road.boundaries[0]) / np.float32(
        2 * road.num_lanes
    )
    s, d = state.road_position(params)

    def friction_at(offset: F32) -> F32:
        """Friction under wheels at an offset to the left of the centre [m]."""
        wheel_d = d + vehicles.travel_sign * offset
        # Number of the wheel path, counted from the kerb side.
        wheel_path = road_surface.floor((wheel_d - road.boundaries[0]) / path_width)
        depth_share = road_surface.puddle_depth_share(
            constants,
            s,
            wheel_path,
            simulations.puddle_phase_1,
            simulations.puddle_phase_2,
            simulations.puddle_threshold,
        )
        local_film = film + simulations.puddle_film * depth_share
        friction = road_surface.friction_at_film(constants, friction_columns, local_film)
        return minimum(friction, vehicles.max_friction)

    state.friction_and_wind.mu_left = friction_at(vehicles.half_track)
    state.friction_and_wind.mu_right = friction_at(-vehicles.half_track)


def update_road_course(state: State, params: StepParameters) -> None:
    """Compute curvature, slope, bend speed and sight at each vehicle until the next decision.

    Curvature and slope hold for the middle of that time, bend speed and sight for its start. For a
    vehicle against the road a bend to the left becomes a bend to the right, and a rise a fall.
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants, road, motion = params.constants, params.road, state.motion
    if not road.varies_along_road:
        return
    table, local_road = road.course_table, state.road
    is_opposite = vehicles.travel_sign < 0
    # Distance to the left of the reference line, in the direction of travel. The reference line is
    # at d = `edge_sum` in the frame of vehicles against the road.
    offset = np.where(is_opposite, motion.d - road.edge_sum, motion.d)
    half_decision = HALF * constants.decision
    # A driver steers for the curvature at the place where the vehicle will respond; the lags are
    # times [s].
    car_lag = constants.steering_lag + vehicles.side_lag * motion.vx
    steering_lag = np.where(vehicles.two_wheeler > 0, constants.two_wheeler_lag, car_lag)
    s_mid = motion.s + half_decision * motion.vx
    s_ahead = motion.s + (half_decision + steering_lag) * motion.vx

    def value_at(row: F32, s: F32) -> F32:
        """The value of a row of the table at station `s` of each vehicle."""
        road_s = np.where(is_opposite, road.length - s, s)
        return interpolate_course(row, road_s * constants.per_station)

    def station_per_metre(curvature: F32) -> F32:
        """Metres of the reference line for each metre driven: above 1 inside of a bend."""
        return ONE / maximum(ONE - curvature * offset, _MIN_RADIUS_SHARE)

    curvature, curvature_ahead = (
        vehicles.travel_sign * value_at(table.curvature, s) for s in (s_mid, s_ahead)
    )
    local_road.station_per_metre = station_per_metre(curvature)
    # The curvature of the vehicle's path, whose radius is smaller by `offset`.
    local_road.curvature = curvature * local_road.station_per_metre
    local_road.curvature_ahead = curvature_ahead * station_per_metre(curvature_ahead)
    local_road.sin_slope = vehicles.travel_sign * value_at(table.sine_of_slope, s_mid)
    local_road.bend_speed = bend_speed(
        constants, road, simulations.max_lateral_accel, motion.s, is_opposite
    )
    car_sight = np.where(
        is_opposite,
        value_at(table.sight_against, motion.s),
        value_at(table.sight_along, motion.s),
    )
    # The eyes of a truck driver are higher, so crests hide less.
    truck_sight = np.where(
        is_opposite,
        value_at(table.truck_sight_against, motion.s),
        value_at(table.truck_sight_along, motion.s),
    )
    local_road.sight_distance = np.where(vehicles.has_truck_tyres > 0, truck_sight, car_sight)


def with_local_speeds(state: State, params: StepParameters) -> StepParameters:
    """Parameters in which speeds follow the speed limits at each driver and ahead of it.

    The allowed speed at a place is the largest from which a driver can slow down in time for each
    limit ahead, so the desired speed falls ahead of a lower limit. The driver brakes at the rate of
    this fall, and removes the difference between its speed and the desired one with a time
    constant. It does not brake harder than its comfortable deceleration.

    Args:
        state: State at a decision; the function updates its `road.accel_limit`.
        params: Parameters of the batch.

    Returns:
        Parameters with new `local_vehicles`, the parameters of drivers at their present places;
        `params` itself on a straight, level road with one limit.
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants, road, motion = params.constants, params.road, state.motion
    if not road.varies_along_road:
        return params
    is_opposite = vehicles.travel_sign < 0
    factors = DesiredSpeedFactors(
        vehicles.free_speed,
        vehicles.speed_limit_compliance,
        vehicles.caution,
        simulations.rain_slowing,
        simulations.stoppable_speed,
    )
    next_s = motion.s + constants.decision * motion.vx
    speed_limit, next_speed_limit = (
        allowed_speed(constants, road, s, is_opposite) for s in (motion.s, next_s)
    )
    # `adapted_speed` is the speed under a limit in this weather and light.
    desired_speed, next_desired_speed = (
        minimum(adapted_speed(factors, limit), vehicles.desired_speed)
        for limit in (speed_limit, next_speed_limit)
    )
    change_rate = (next_desired_speed - desired_speed) / constants.decision
    # `per_approach` is one over the time constant.
    accel = change_rate + (desired_speed - motion.vx) * constants.per_approach
    state.road.accel_limit = np.where(
        change_rate < 0, maximum(accel, -vehicles.decel), NO_ACCEL_LIMIT
    )
    passing_speed = minimum(desired_speed * constants.passing_speed_factor, vehicles.passing_speed)
    local_vehicles = vehicles._replace(
        desired_speed=desired_speed, passing_speed=passing_speed, speed_limit=speed_limit
    )
    return dataclasses.replace(params, local_vehicles=local_vehicles)


def wind_shelter(state: State, params: StepParameters) -> F32:
    """Share of the side wind left beside high-sided vehicles upwind, (vehicle, simulation).

    Source:
        Coleman and Baker 1990 (side winds on vehicles that pass a truck). Shelter is full beside
        the body and ends as a smooth step over a part of the body's length (a choice).
    """
    vehicles, constants, motion = params.vehicles, params.constants, state.motion
    wind_across = vehicles.travel_sign * params.simulations.wind_across
    share = np.ones_like(motion.s)
    for other_slot in range(len(motion.s)):
        other_s, other_d = state.position_seen_by_each(params, other_slot)
        half_length = vehicles.half_length[other_slot]
        distance_past_body = np.abs(motion.s - other_s) - half_length
        # 0 beside the body, 1 where the shelter has ended.
        release = clamp(
            distance_past_body / (constants.shelter_release * TWO * half_length), ZERO, ONE
        )
        smooth_step = release * release * (np.float32(3.0) - TWO * release)
        open_share = constants.shelter_factor + (ONE - constants.shelter_factor) * smooth_step
        lateral_distance = motion.d - other_d
        reach = constants.shelter_reach + vehicles.half_width + vehicles.half_width[other_slot]
        # The wind blows from the other vehicle to this one.
        is_upwind = lateral_distance * wind_across > 0
        is_sheltered = (
            (vehicles.shelters_wind[other_slot] > 0)
            & (vehicles.valid[other_slot] > 0)
            & is_upwind
            & (np.abs(lateral_distance) < reach)
        )
        is_sheltered[other_slot] = False  # A vehicle does not shelter itself.
        share = np.where(is_sheltered, minimum(share, open_share), share)
    return share


def discrete_gust(state: State, params: StepParameters) -> F32:
    """Strength of the single gusts at bridges and cuttings, 0 to 1.

    The road has one gust in each interval of `gust_spacing`, with the shape of 1 - cos. It covers
    the first `gust_length` metres.

    Source:
        The shape of discrete gusts in certification rules, such as EASA CS-25.341.
    """
    simulations, constants = params.simulations, params.constants
    s, _ = state.road_position(params)
    num_intervals = s / constants.gust_spacing + simulations.gust_phase
    share_of_interval = num_intervals - road_surface.floor(num_intervals)
    distance = share_of_interval * constants.gust_spacing
    # Share of the gust that the vehicle has passed, above 1 beyond the gust.
    gust_share = distance / simulations.gust_length
    _, cosine = sincos(TAU * minimum(gust_share, ONE))
    return np.where(gust_share < ONE, HALF - HALF * cosine, ZERO)


def update_wind(state: State, params: StepParameters) -> None:
    """Update side force, yaw moment and tail wind in `state.friction_and_wind`.

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapter 4: the side force is a
        coefficient times the side area and the pressure of the relative wind. The coefficient grows
        with the angle of this wind, up to a maximum (a choice).
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants, wind = params.constants, state.friction_and_wind
    single_gust = simulations.gust_gain * discrete_gust(state, params)
    # Factor on the mean wind; `noise.gust` is the turbulence.
    strength = ONE + constants.turbulence_intensity * state.noise.gust + single_gust
    strength = maximum(strength, ZERO)
    across = vehicles.travel_sign * simulations.wind_across * strength * wind_shelter(state, params)
    wind.tail_wind = vehicles.travel_sign * simulations.wind_along * strength
    along = maximum(state.motion.vx - wind.tail_wind, _MIN_AIR_SPEED)
    angle = atan(np.abs(across) / along)
    sine, _ = sincos(minimum(constants.wind_angle_factor * angle, HALF_PI))
    force = vehicles.side_wind * (along * along + across * across) * sine
    wind.wind_force = np.where(across < 0, -force, force)
    # The centre of pressure moves back as the wind comes more from the side. `wind_arm` is the
    # distance of the middle between the axles ahead of the centre of gravity.
    cosine = along / np.sqrt(along * along + across * across)
    wind.wind_moment = wind.wind_force * (vehicles.wind_centre * cosine + vehicles.wind_arm)


def apply_study_push(state: State, params: StepParameters, decision_index: int) -> None:
    """Add the pushes of the study by Pinto et al. to the wind force, for a part of each interval.

    Source:
        Pinto, Dutra and Fonseca 2023: forces towards the side that the wind blows to, more often in
        more rain and wind. Size and duration are choices of the profile `pinto2023`.
    """
    vehicles, simulations = params.vehicles, params.simulations
    wind = state.friction_and_wind
    # Intervals since the start, one for each push.
    num_intervals = np.float32(decision_index) * simulations.push_rate + simulations.push_phase
    share_of_interval = num_intervals - road_surface.floor(num_intervals)
    is_within_push = share_of_interval < simulations.push_duty_cycle
    is_pushed = (simulations.push_accel != 0) & is_within_push
    force = wind.wind_force + vehicles.travel_sign * simulations.push_accel * vehicles.mass
    wind.wind_force = np.where(is_pushed, force, wind.wind_force)
