"""What the weather does to each vehicle at a decision: friction under it, wind beside it."""

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import atan, clamp, exp, maximum, minimum, sincos
from overtaking.core.random_numbers import Stream, philox_words, uniform_from_word
from overtaking.sim.reference.state import (
    NO_ACCEL_LIMIT,
    State,
    position_seen_by_each,
    road_position,
)
from overtaking.world import road_surface
from overtaking.world.driver_parameters import DesiredSpeedFactors, adapted_speed
from overtaking.world.road_parameters import allowed_speed, bend_speed, interpolate_course
from overtaking.world.step_parameters import StepParameters, VehicleParameters
from overtaking.world.weather_parameters import SimulationParameters

_ROOT_3 = np.float32(1.732_050_8)  # A uniform number of unit variance lies within +- sqrt(3).


_TAU = np.float32(6.283_185_5)


_HALF_PI = np.float32(1.570_796_4)


_MIN_RADIUS_SHARE = np.float32(
    0.25
)  # Keeps the way in a bend finite for who has left the road inwards.


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
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    decision: int,
) -> None:
    """Advance gusts, errors of judgement and wander in the lane by one decision."""
    c = given.constants
    slots = np.arange(state.s.shape[0], dtype=np.uint32)[:, None] + np.uint32(Stream.MOTION)
    draw = [
        uniform_from_word(word)
        for word in philox_words(given.seed, given.scenario_index[None, :], slots, decision)
    ]
    along = state.vx - p.travel_sign * q.wind_along
    air_speed = np.sqrt(along * along + q.wind_across * q.wind_across)
    # The first draw is the stationary state: nothing of a past is kept.
    kept = np.float32(0.0 if decision == 0 else 1.0)
    keep = kept * exp(-(air_speed * c.decision) / c.gust_length_scale)
    state.gust = _ornstein_uhlenbeck_step(state.gust, keep, draw[0])
    keep_error = kept * exp(-c.decision / c.error_time)
    state.distance_error = _ornstein_uhlenbeck_step(state.distance_error, keep_error, draw[1])
    state.speed_error = _ornstein_uhlenbeck_step(state.speed_error, keep_error, draw[2])
    state.wander = _ornstein_uhlenbeck_step(
        state.wander, kept * exp(-c.decision / c.lane_time), draw[3]
    )


def value_of_lane(values: F32, lane: F32, count: int) -> F32:
    """`values[lane]` for whole-number lanes, the first or last value outside 0 to count - 1."""
    chosen = np.zeros_like(lane) + values[0]
    for k in range(1, count):
        chosen = np.where(lane >= np.float32(k), values[k], chosen)
    return chosen


def update_friction(
    state: State, given: StepParameters, p: VehicleParameters, q: SimulationParameters
) -> None:
    """Friction under the wheels of either side."""
    c, road = given.constants, given.road
    lane = np.zeros_like(state.d)
    for k in range(1, road.num_lanes):
        lane = np.where(state.d >= road.boundaries[k], np.float32(k), lane)
    path = value_of_lane(road.film_path, lane, road.num_lanes)
    water = road_surface.lane_film(q.min_wet_film, q.film_rain_factor, path, q.texture_depth)
    columns = road_surface.friction_at_speed(c, state.vx, p.tyre_wear, p.has_truck_tyres)
    width = (road.boundaries[road.num_lanes] - road.boundaries[0]) / np.float32(2 * road.num_lanes)
    sides = []
    s, d = road_position(state, given, p)
    for offset in (p.half_track, -p.half_track):
        wheel_path = road_surface.floor((d + p.travel_sign * offset - road.boundaries[0]) / width)
        depth = road_surface.puddle_depth_share(
            c, s, wheel_path, q.puddle_phase_1, q.puddle_phase_2, q.puddle_threshold
        )
        found = road_surface.friction_at_film(c, columns, water + q.puddle_film * depth)
        sides.append(minimum(found, p.max_friction))
    state.mu_fast, state.mu_slow = sides


def update_road_course(
    state: State, given: StepParameters, p: VehicleParameters, q: SimulationParameters
) -> None:
    """What the road does under each vehicle until the next decision: it bends, it rises.

    Values are those of the middle of that time. For who comes the other way a bend to the left
    is one to the right, and a rise is a fall.
    """
    c, road = given.constants, given.road
    if not road.varies_along_road:
        return
    one, half, table = np.float32(1.0), np.float32(0.5), road.course_table
    high = p.has_truck_tyres > 0
    turned = p.travel_sign < 0
    offset = np.where(turned, state.d - road.edge_sum, state.d)
    soon = half * c.decision
    late = np.where(p.two_wheeler > 0, c.two_wheeler_lag, c.steering_lag + p.side_lag * state.vx)
    here = state.s + soon * state.vx
    there = state.s + (soon + late) * state.vx

    def at(row: F32, s: F32) -> F32:
        return interpolate_course(row, np.where(turned, road.length - s, s) * c.per_station)

    def stretch(bend: F32) -> F32:
        return one / maximum(one - bend * offset, _MIN_RADIUS_SHARE)

    bend, ahead = (p.travel_sign * at(table.curvature, s) for s in (here, there))
    state.stretch = stretch(bend)
    state.curve = bend * state.stretch
    state.curve_ahead = ahead * stretch(ahead)
    state.slope = p.travel_sign * at(table.sine_of_slope, here)
    by_car, by_truck = (
        np.where(turned, at(against, state.s), at(along, state.s))
        for along, against in (
            (table.sight_along, table.sight_against),
            (table.truck_sight_along, table.truck_sight_against),
        )
    )
    state.bend_speed = bend_speed(c, road, q.max_lateral_accel, state.s, turned)
    state.shown = np.where(high, by_truck, by_car)


def with_local_speeds(
    state: State, given: StepParameters, p: VehicleParameters, q: SimulationParameters
) -> VehicleParameters:
    """The parameters of drivers with the speeds that they want by the limits at and ahead of them.

    Ahead of a lower limit the wanted speed falls. The driver brakes at the rate at which it falls,
    less the remaining difference over a time constant, but no harder than its comfortable
    deceleration. The driver thus approaches the wanted speed from below.

    Args:
        state: State at a decision; `State.most_accel` is set.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
    """
    c, road = given.constants, given.road
    if not road.varies_along_road:
        return p
    turned = p.travel_sign < 0
    wish = DesiredSpeedFactors(
        p.free_speed, p.speed_limit_compliance, p.caution, q.rain_slowing, q.stoppable_speed
    )
    allowed, coming = (
        allowed_speed(c, road, s, turned) for s in (state.s, state.s + c.decision * state.vx)
    )
    here, soon = (
        minimum(adapted_speed(wish, limit), p.desired_speed) for limit in (allowed, coming)
    )
    change = (soon - here) / c.decision
    eased = change + (here - state.vx) * c.per_approach
    state.most_accel = np.where(change < 0, maximum(eased, -p.decel), NO_ACCEL_LIMIT)
    passing = minimum(here * c.passing_speed_factor, p.passing_speed)
    return p._replace(desired_speed=here, passing_speed=passing, speed_limit=allowed)


def wind_shelter(
    state: State, given: StepParameters, p: VehicleParameters, q: SimulationParameters
) -> F32:
    """Share of the side wind left beside high-sided vehicles upwind, (vehicle, simulation).

    Source:
        Full beside the body, back as a smooth step over a part of its length (a choice); side winds
        on what passes a truck: Coleman and Baker 1990.
    """
    c = given.constants
    share = np.ones_like(state.s)
    one = np.float32(1.0)
    for j in range(state.s.shape[0]):
        other_s, other_d = position_seen_by_each(state, given, p, j)
        beyond = np.abs(state.s - other_s) - p.half_length[j]
        u = clamp(
            beyond / (c.shelter_release * np.float32(2.0) * p.half_length[j]), np.float32(0.0), one
        )
        open_share = c.shelter_factor + (one - c.shelter_factor) * (
            u * u * (np.float32(3.0) - np.float32(2.0) * u)
        )
        aside = state.d - other_d
        reach = c.shelter_reach + p.half_width + p.half_width[j]
        upwind = aside * (p.travel_sign * q.wind_across) > 0
        beside = (p.shelters_wind[j] > 0) & (p.valid[j] > 0) & upwind & (np.abs(aside) < reach)
        beside[j] = False
        share = np.where(beside, minimum(share, open_share), share)
    return share


def discrete_gust(
    state: State, given: StepParameters, p: VehicleParameters, q: SimulationParameters
) -> F32:
    """The single gusts of bridges and cuttings, 0 to 1: one every `gust_spacing`, 1 - cos shaped.

    Source:
        The shape of discrete gusts in certification rules, such as EASA CS-25.341.
    """
    c = given.constants
    s, _ = road_position(state, given, p)
    cell = s / c.gust_spacing + q.gust_phase
    inside = (cell - road_surface.floor(cell)) * c.gust_spacing / q.gust_length
    _, cosine = sincos(_TAU * minimum(inside, np.float32(1.0)))
    return np.where(
        inside < np.float32(1.0), np.float32(0.5) - np.float32(0.5) * cosine, np.float32(0.0)
    )


def update_wind(
    state: State, given: StepParameters, p: VehicleParameters, q: SimulationParameters
) -> None:
    """Side force, yaw moment and tail wind of each vehicle.

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapter 4: coefficients on the side area
        at the relative wind, growing with its angle; the growth saturates (a choice).
    """
    c = given.constants
    one = np.float32(1.0)
    bumps = q.gust_gain * discrete_gust(state, given, p, q)
    strength = one + c.turbulence_intensity * state.gust + bumps
    strength = maximum(strength, np.float32(0.0))
    across = p.travel_sign * q.wind_across * strength * wind_shelter(state, given, p, q)
    state.tail_wind = p.travel_sign * q.wind_along * strength
    along = maximum(state.vx - state.tail_wind, _MIN_AIR_SPEED)
    angle = atan(np.abs(across) / along)
    sine, _ = sincos(minimum(c.wind_angle_factor * angle, _HALF_PI))
    force = p.side_wind * (along * along + across * across) * sine
    state.wind_force = np.where(across < 0, -force, force)
    cosine = along / np.sqrt(along * along + across * across)
    state.wind_moment = state.wind_force * (p.wind_centre * cosine + p.wind_arm)


def apply_study_push(
    state: State, p: VehicleParameters, q: SimulationParameters, decision: int
) -> None:
    """Push sideways for a part of each interval, unannounced: after drivers answered the wind.

    Source:
        Pinto, Dutra and Fonseca 2023: forces towards the side that the wind blows to, at longer
        intervals for less rain and wind. Size and duration are choices of the specification.
    """
    cell = np.float32(decision) * q.push_rate + q.push_phase
    pushed = (q.push_accel != 0) & (cell - road_surface.floor(cell) < q.push_duty_cycle)
    force = state.wind_force + p.travel_sign * q.push_accel * p.mass
    state.wind_force = np.where(pushed, force, state.wind_force)
