"""Who comes the other way: what drivers see, and believe of it."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import exp, maximum, minimum
from overtaking.sim.reference.decision_context import Neighbours, OncomingTraffic, OncomingVehicle
from overtaking.sim.reference.neighbour_search import lane_borders, visibly_changes_lane
from overtaking.sim.reference.perception import (
    MIN_SIGHT_LINE,
    extinction_ahead,
    recall_motion,
    sense_looming,
    sight_range_ratio,
)
from overtaking.sim.reference.state import LEADER, NEVER_LOOKED, NO_SLOT, State, value_at_slot
from overtaking.world.step_parameters import StepParameters

_FAR = np.float32(1e9)  # Sight past nobody [m].

_HALF = np.float32(0.5)

# Where drivers look for oncoming vehicles: `Attention.oncoming_slot`.
_IN_ANY_LANE, _IN_OWN_LANE = range(2)

NearestOncoming = tuple[F32, F32]
"""Slots of oncoming vehicles, `NOBODY` for none, and the distance of the centres [m]."""


def observe_oncoming(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    decision_index: int,
) -> OncomingTraffic:
    """Who comes, and what each driver believes of it; advances the time in view.

    The distance is misjudged by a slowly varying factor, and small oncomers are believed farther
    off. The speed of approach is what is usual until it looms, and is sensed from there on.

    Source:
        Farber and Silver 1967, ARRB 1978 (a usual speed); Levulis 2015 (small oncomers).
    """
    oncoming = nearest_oncoming(state, params, np.full_like(state.motion.s, NO_SLOT))
    sight = _sight_distance(state, params, neighbours)
    coming, facing = (
        _judged(state, params, neighbours, oncoming[lanes], sight, decision_index, lanes)
        for lanes in (_IN_ANY_LANE, _IN_OWN_LANE)
    )
    leader = neighbours.slot[LEADER]
    return OncomingTraffic(
        nearest=coming,
        in_own_lane=facing,
        is_being_passed=is_being_passed(state, params),
        leader_pulls_out=(leader >= 0) & (value_at_slot(state.controls.indicator, leader) > 0),
    )


def observe_second_oncoming(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    first: OncomingVehicle,
    decision_index: int,
) -> OncomingVehicle:
    """Who comes behind the nearest, and what each driver would believe of it.

    Our drivers decide by the nearest alone; another driver of the ego is told of the next one. It
    is noticed with the nearest, where it can be seen.
    """
    oncoming, _ = nearest_oncoming(state, params, first.slot)
    return _judged(
        state,
        params,
        neighbours,
        oncoming,
        first.sight_distance,
        decision_index,
        _IN_ANY_LANE,
        first.is_detected,
    )


def _sight_distance(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
) -> F32:
    """How far drivers see the other lane: by the road, the weather, and past a high leader."""
    vehicles, simulations = params.vehicles, params.simulations
    constants, road = params.constants, params.road
    place, _ = state.road_position(params)
    by_road = np.where(
        vehicles.travel_sign < 0, *(_interpolate_knots(table, place) for table in road.sight[::-1])
    )
    lead = neighbours.slot[LEADER]
    reach = maximum(neighbours.distance[LEADER] - neighbours.half_length[LEADER], MIN_SIGHT_LINE)
    edge = (
        neighbours.lateral_distance[LEADER]
        + value_at_slot(vehicles.half_width, lead)
        - constants.eye_offset
    )
    middle = _HALF * (road.boundaries[road.num_lanes] + road.boundaries[road.num_own_lanes])
    beside = middle - state.motion.d - constants.eye_offset
    hides = (
        (lead >= 0) & (value_at_slot(vehicles.blocks_view, lead) > 0) & (edge > 0) & (beside > 0)
    )
    past = np.where(hides, beside * (reach / maximum(edge, MIN_SIGHT_LINE)), _FAR)
    return minimum(
        minimum(minimum(by_road, state.road.sight_distance), past), simulations.oncoming_sight
    )


def _interpolate_knots(table: F32, place: F32) -> F32:
    """What a table of `RoadParameters.sight` says of places [m]."""
    stations, values, slopes = table
    knot = np.searchsorted(stations, place, side="right") - 1
    return values[knot] + (place - stations[knot]) * slopes[knot]


def _judged(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    oncoming: tuple[F32, F32],
    sight: F32,
    decision_index: int,
    lanes: int,
    noticed: Mask | None = None,
) -> OncomingVehicle:
    """What drivers believe of whom they have `noticed`; None for whom they watch in some lanes."""
    vehicles, simulations = params.vehicles, params.simulations
    constants, one = params.constants, np.float32(1.0)
    slot, distance = oncoming
    half = value_at_slot(vehicles.half_length, slot)
    true_gap = distance - (half + vehicles.half_length)
    shines = (
        value_at_slot(vehicles.log_contrast, slot),
        value_at_slot(vehicles.inverse_head_lamp, slot),
    )
    depths = extinction_ahead(state, params, neighbours)
    effort = sight_range_ratio(params, true_gap, shines, depths, is_front=True)
    reach = minimum(
        constants.oncoming_range, sight if lanes == _IN_ANY_LANE else state.road.sight_distance
    )
    visible = (slot >= 0) & (effort <= one) & (true_gap < reach)
    if noticed is None:
        needed = simulations.detection_time * (
            one + constants.detection_growth * (effort * effort * effort)
        )
        needed = np.where(visible, needed, simulations.detection_time)
        update_time_in_view(state, params, lanes, np.where(visible, slot, NO_SLOT))
        sure = state.attention.oncoming_time_in_view[lanes] >= needed
    else:
        sure = noticed
    detected = visible & sure
    own_speed, _ = state.road_velocity()
    urgent = true_gap < constants.urgent_time * (own_speed + value_at_slot(state.motion.vx, slot))
    ticks = np.where(urgent, vehicles.urgent_reaction_delay, vehicles.reaction_delay)
    then = maximum(np.float32(decision_index) - ticks, np.float32(0.0))
    elapsed = (np.float32(decision_index) - then) * constants.decision
    place, speed = recall_motion(state, then, slot)
    place = place + speed * elapsed
    gap = (params.road.length - place) - state.motion.s - (half + vehicles.half_length)
    closing = own_speed + speed
    _, clear, share, sensed = sense_looming(
        state, params, gap, closing, value_at_slot(vehicles.looming_width, slot)
    )
    small = np.where(
        value_at_slot(vehicles.two_wheeler, slot) > 0, constants.two_wheeler_distance_factor, one
    )
    judged = exp(simulations.oncoming_error * state.noise.distance_error) * small
    habit = expected_closing_speed(state, params)
    return OncomingVehicle(
        slot=slot,
        gap=true_gap,
        half_length=half,
        is_detected=detected,
        is_certain=sure,
        believed_gap=np.where(
            detected, gap + gap * ((judged - one) * share), constants.oncoming_range
        ),
        closing_speed=np.where(detected, habit + clear * (sensed - habit), habit),
        sight_distance=sight,
    )


def expected_closing_speed(state: State, params: StepParameters) -> F32:
    """Speed of approach that drivers expect of who comes, (vehicle, simulation) [m/s]."""
    simulations = params.simulations
    own_speed, _ = state.road_velocity()
    return own_speed + simulations.expected_oncoming_speed


def update_time_in_view(state: State, params: StepParameters, lanes: int, seen: F32) -> None:
    """Count for how long drivers have seen what they see in some lanes now: slots `seen`."""
    constants, before = params.constants, state.attention.oncoming_slot[lanes]
    longer = np.where(
        seen == before,
        state.attention.oncoming_time_in_view[lanes] + constants.decision,
        np.float32(0.0),
    )
    state.attention.oncoming_time_in_view[lanes] = np.where(
        before == NEVER_LOOKED, constants.initial_time_in_view, longer
    )
    state.attention.oncoming_slot[lanes] = seen


def nearest_oncoming(
    state: State, params: StepParameters, but: F32
) -> tuple[NearestOncoming, NearestOncoming]:
    """The nearest oncomer of each vehicle in any lane, and in its own; slots `but` do not count.

    One that is visibly on its way into the own lane is there.
    """
    vehicles = params.vehicles
    constants, road = params.constants, params.road
    low, high = lane_borders(state, params, 0.0)
    edges = road.boundaries[0], road.boundaries[road.num_lanes]
    slot = np.full((2, *state.motion.s.shape), NO_SLOT)
    distance = np.full_like(slot, _FAR)
    for j in range(len(state.motion.s)):
        s, d = state.position_seen_by_each(params, j)
        ahead = s - state.motion.s
        low_side, high_side = d - vehicles.half_width[j], d + vehicles.half_width[j]
        lane = np.float32(road.num_lanes - 1) - state.lane_choice.lane[j]
        comes = visibly_changes_lane(state, params, j) & (lane == state.lane_choice.lane)
        opposed = (
            (vehicles.valid[j] > 0)
            & (vehicles.travel_sign[j] != vehicles.travel_sign)
            & (vehicles.valid > 0)
        )
        opposed = opposed & (ahead >= 0) & (but != np.float32(j))
        for k, (begin, end) in enumerate((edges, (low, high))):
            there = (high_side > begin + constants.corridor_margin) & (
                low_side < end - constants.corridor_margin
            )
            there = there | comes if k else there
            nearer = opposed & there & (ahead < distance[k])
            slot[k] = np.where(nearer, np.float32(j), slot[k])
            distance[k] = np.where(nearer, ahead, distance[k])
    return (slot[0], distance[0]), (slot[1], distance[1])


def is_being_passed(state: State, params: StepParameters) -> Mask:
    """Whom others pass in the next lane, as they notice it, (vehicle, simulation)."""
    vehicles = params.vehicles
    out, passed = state.is_overtaking(), np.zeros(state.motion.s.shape, bool)
    for j in range(len(state.motion.s)):
        apart = np.abs(state.motion.s - state.motion.s[j]) - (
            vehicles.half_length + vehicles.half_length[j]
        )
        beside = (apart < params.constants.passed_awareness_margin) & (
            vehicles.travel_sign == vehicles.travel_sign[j]
        )
        passed = passed | (beside & (state.lane_choice.lane[j] > state.lane_choice.lane) & out[j])
    return passed & (state.motion.is_wreck == 0)
