"""Oncoming vehicles on two-way roads: search, visibility and beliefs of drivers.

Each vehicle has a frame of coordinates of its own direction of travel. In it stations grow ahead,
lateral positions grow to the left, the overtaking side, lane 0 is the lane of that direction, and
the opposing lane is on the left. Each vehicle has a slot, its number in the simulation; a slot is
empty where `valid` is 0, and without a vehicle `value_at_slot` reads slot 0. A driver's leader is
the vehicle ahead of it in its direction.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, ZERO, exp, maximum, minimum
from overtaking.sim.reference.decision_context import (
    DecisionContext,
    Neighbours,
    OncomingTraffic,
    OncomingVehicle,
)
from overtaking.sim.reference.neighbour_search import lane_borders, visibly_changes_lane
from overtaking.sim.reference.perception import (
    MIN_SIGHT_LINE,
    Conspicuity,
    Looming,
    detection_time,
    extinction_ahead,
    extrapolate_motion,
    sense_looming,
    sight_range_ratio,
)
from overtaking.sim.reference.state import (
    FAR,
    LEADER,
    NEVER_LOOKED,
    NO_SLOT,
    State,
    value_at_slot,
)
from overtaking.world.step_parameters import StepParameters

# Rows of `Attention.oncoming_slot` and `oncoming_time_in_view`: the nearest oncoming vehicle in any
# lane, and in the driver's own lane.
_IN_ANY_LANE, _IN_OWN_LANE = range(2)


class NearestOncoming(NamedTuple):
    """The nearest oncoming vehicle of each driver, (vehicle, simulation)."""

    slot: F32  # `NO_SLOT` without a vehicle.
    distance: F32  # Distance of the centres along the road, `FAR` without a vehicle [m].


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """Visibility of one oncoming vehicle for each driver, (vehicle, simulation).

    Attributes:
        slot: Slot of the vehicle, or `NO_SLOT`.
        half_lengths: Half of the lengths of both vehicles [m].
        gap: Gap between the front bumpers [m].
        sight_range_ratio: Distance over the range at which light and weather show the vehicle [1].
        is_visible: Whether the driver can see the vehicle.
        sight_distance: Distance to which the driver sees along the lane of the vehicle [m].
    """

    slot: F32
    half_lengths: F32
    gap: F32
    sight_range_ratio: F32
    is_visible: Mask
    sight_distance: F32


def observe_oncoming(
    state: State, params: StepParameters, neighbours: Neighbours, decision_index: int
) -> OncomingTraffic:
    """The oncoming vehicles that matter to each driver, and its beliefs about them.

    The function updates the time in view in `state.attention`. The nearest vehicle in any lane
    limits a pass; for the nearest in its own lane the driver brakes and moves to the edge.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        neighbours: Neighbours of the drivers in the same direction.
        decision_index: Index of this decision, 20 per second.

    Source:
        Farber and Silver 1967, ARRB 1978 (drivers expect a usual speed); Levulis 2015 (small
        oncoming vehicles look farther away).
    """
    excludes_none = np.full_like(state.motion.s, NO_SLOT)
    nearest_in_any_lane, nearest_in_own_lane = nearest_oncoming(state, params, excludes_none)
    sight_distance = _sight_distance(state, params, neighbours)
    any_lane_sighting = _sighting(state, params, neighbours, nearest_in_any_lane, sight_distance)
    # Bends and crests limit the view along the driver's own lane. That a leader does not hide it is
    # a choice of this model.
    own_sight_distance = state.road.sight_distance
    own_lane_sighting = _sighting(
        state, params, neighbours, nearest_in_own_lane, own_sight_distance
    )
    update_time_in_view(state, params, _IN_ANY_LANE, any_lane_sighting)
    update_time_in_view(state, params, _IN_OWN_LANE, own_lane_sighting)
    is_certain_of_any_lane = _is_certain(state, params, any_lane_sighting, _IN_ANY_LANE)
    is_certain_of_own_lane = _is_certain(state, params, own_lane_sighting, _IN_OWN_LANE)
    leader = neighbours.slot[LEADER]
    # An indicator is positive to the left.
    return OncomingTraffic(
        nearest=_believe(state, params, any_lane_sighting, is_certain_of_any_lane, decision_index),
        in_own_lane=_believe(
            state, params, own_lane_sighting, is_certain_of_own_lane, decision_index
        ),
        is_being_passed=is_being_passed(state, params),
        leader_pulls_out=(leader >= 0) & (value_at_slot(state.controls.indicator, leader) > 0),
    )


def observe_second_oncoming(
    state: State, params: StepParameters, context: DecisionContext
) -> OncomingVehicle:
    """The oncoming vehicle behind the nearest one, and each driver's beliefs about it.

    The model's drivers decide by the nearest vehicle alone; external drivers also observe the
    second. A driver detects the second together with the nearest, if it can see the second.
    """
    assert context.oncoming is not None, "one-way roads have no oncoming traffic"
    first = context.oncoming.nearest
    second, _ = nearest_oncoming(state, params, first.slot)
    sighting = _sighting(state, params, context.neighbours, second, first.sight_distance)
    return _believe(state, params, sighting, first.is_detected, context.decision_index)


def _sight_distance(state: State, params: StepParameters, neighbours: Neighbours) -> F32:
    """Sight distance along the opposing lane [m].

    The smallest of the distances that the road, the weather and a tall leader leave.
    """
    vehicles, constants, road = params.vehicles, params.constants, params.road
    s, _ = state.road_position(params)  # Counted from the start of the road for both directions.
    along, against = (_interpolate_knots(table, s) for table in road.sight)
    # The travel sign is 1 along the road and -1 against it.
    stated_by_map = np.where(vehicles.travel_sign < 0, against, along)
    leader = neighbours.slot[LEADER]
    # The line of sight begins at the driver's eye, which is `eye_offset` to the left of the
    # vehicle's centre, and passes the leader's left rear corner. Offsets are lateral distances from
    # the eye, positive to the left.
    distance_to_rear = maximum(
        neighbours.distance[LEADER] - neighbours.half_length[LEADER], MIN_SIGHT_LINE
    )
    half_width = value_at_slot(vehicles.half_width, leader)
    corner_offset = neighbours.lateral_distance[LEADER] + half_width - constants.eye_offset
    opposing_lane_d = HALF * (road.boundaries[road.num_lanes] + road.boundaries[road.num_own_lanes])
    lane_offset = opposing_lane_d - state.motion.d - constants.eye_offset
    is_tall = (leader >= 0) & (value_at_slot(vehicles.blocks_view, leader) > 0)
    hides_lane = is_tall & (corner_offset > 0) & (lane_offset > 0)
    # By similar triangles the line of sight meets the middle of the opposing lane at this distance.
    distance = lane_offset * (distance_to_rear / maximum(corner_offset, MIN_SIGHT_LINE))
    past_leader = np.where(hides_lane, distance, FAR)
    # `state.road.sight_distance` follows from bends and crests; it limits nothing if the map states
    # sight distances. `oncoming_sight` is the limit by the weather.
    by_road = minimum(stated_by_map, state.road.sight_distance)
    return minimum(minimum(by_road, past_leader), params.simulations.oncoming_sight)


def _interpolate_knots(table: F32, s: F32) -> F32:
    """Sight distance at stations, by the table of one direction in `RoadParameters.sight` [m]."""
    # The first station of a table is far before the road, so every `s` has a knot behind it.
    stations, values, slopes = table
    knot = np.searchsorted(stations, s, side="right") - 1
    return values[knot] + (s - stations[knot]) * slopes[knot]


def _sighting(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    oncoming: NearestOncoming,
    sight_distance: F32,
) -> Sighting:
    """Visibility of one oncoming vehicle for each driver.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        neighbours: Neighbours of the drivers; the leader's spray dims the view.
        oncoming: The oncoming vehicle.
        sight_distance: Sight distance in the lane of the oncoming vehicle [m].
    """
    vehicles, slot = params.vehicles, oncoming.slot
    half_lengths = value_at_slot(vehicles.half_length, slot) + vehicles.half_length
    gap = oncoming.distance - half_lengths
    # An oncoming vehicle shows its headlamps.
    conspicuity = Conspicuity(
        value_at_slot(vehicles.log_contrast, slot), value_at_slot(vehicles.inverse_head_lamp, slot)
    )
    extinction = extinction_ahead(state, params, neighbours)
    ratio = sight_range_ratio(params, gap, conspicuity, extinction, is_ahead=True)
    max_range = minimum(params.constants.oncoming_range, sight_distance)
    return Sighting(
        slot=slot,
        half_lengths=half_lengths,
        gap=gap,
        sight_range_ratio=ratio,
        is_visible=(slot >= 0) & (ratio <= ONE) & (gap < max_range),
        sight_distance=sight_distance,
    )


def update_time_in_view(
    state: State, params: StepParameters, lanes: int, sighting: Sighting
) -> None:
    """Count the time for which each driver has had the same vehicle, or no vehicle, in view.

    Args:
        state: The function updates its `attention`.
        params: Parameters of the batch.
        lanes: Row of the attention, `_IN_ANY_LANE` or `_IN_OWN_LANE`.
        sighting: Visibility of the nearest vehicle in these lanes.
    """
    attention, constants = state.attention, params.constants
    slot_in_view = np.where(sighting.is_visible, sighting.slot, NO_SLOT)
    # `decision` is the time between two decisions [s].
    longer_time = attention.oncoming_time_in_view[lanes] + constants.decision
    time_in_view = np.where(slot_in_view == attention.oncoming_slot[lanes], longer_time, ZERO)
    # Drivers have watched the traffic before the first frame.
    is_first_look = attention.oncoming_slot[lanes] == NEVER_LOOKED
    attention.oncoming_time_in_view[lanes] = np.where(
        is_first_look, constants.initial_time_in_view, time_in_view
    )
    attention.oncoming_slot[lanes] = slot_in_view


def _is_certain(state: State, params: StepParameters, sighting: Sighting, lanes: int) -> Mask:
    """Whether each driver has looked long enough to know if a vehicle is coming.

    The time in view counts for the vehicle in view, or for the view without a vehicle. Recognising
    an empty road takes as long as detecting a clearly visible vehicle, so no driver pulls out the
    moment a bend or a truck stops hiding the road.
    """
    needed_time = np.where(
        sighting.is_visible,
        detection_time(params, sighting.sight_range_ratio),
        params.simulations.detection_time,
    )
    return state.attention.oncoming_time_in_view[lanes] >= needed_time


def _believe(
    state: State,
    params: StepParameters,
    sighting: Sighting,
    is_certain: Mask,
    decision_index: int,
) -> OncomingVehicle:
    """Beliefs of drivers about an oncoming vehicle, and their assumptions without one.

    Drivers extrapolate the motion that they saw a reaction delay ago. They misjudge the distance by
    a slowly varying factor. They expect the usual speed until the vehicle looms, that is until its
    image visibly grows. A driver that has detected no vehicle assumes one at the range to which
    drivers look.
    """
    vehicles, slot = params.vehicles, sighting.slot
    own_speed, _ = state.road_velocity()  # Along the road.
    delay = _reaction_delay(state, params, sighting)
    # Station and speed that the driver saw a reaction delay ago, the station extrapolated to now.
    recalled = extrapolate_motion(state, params, slot, delay, decision_index)
    # The frame of the oncoming vehicle counts stations from the other end of the road.
    gap = (params.road.length - recalled.s) - state.motion.s - sighting.half_lengths
    width = value_at_slot(vehicles.looming_width, slot)
    looming = sense_looming(state, params, gap, own_speed + recalled.speed, width)
    is_detected = sighting.is_visible & is_certain
    believed_gap = _believed_gap(state, params, slot, gap, looming)
    return OncomingVehicle(
        slot=slot,
        gap=sighting.gap,
        half_length=value_at_slot(vehicles.half_length, slot),
        is_detected=is_detected,
        is_certain=is_certain,
        believed_gap=np.where(is_detected, believed_gap, params.constants.oncoming_range),
        closing_speed=_believed_closing_speed(state, params, looming, is_detected),
        sight_distance=sighting.sight_distance,
    )


def _reaction_delay(state: State, params: StepParameters, sighting: Sighting) -> F32:
    """Reaction delay to the oncoming vehicle, shorter where it is imminent [decisions]."""
    vehicles = params.vehicles
    own_speed, _ = state.road_velocity()
    # The true motion now: the driver's beliefs depend on the delay that this function selects.
    # The speed `vx` of the vehicle along its own axis is nearly that along the road.
    closing_speed = own_speed + value_at_slot(state.motion.vx, sighting.slot)
    is_imminent = sighting.gap < params.constants.urgent_time * closing_speed
    return np.where(is_imminent, vehicles.urgent_reaction_delay, vehicles.reaction_delay)


def _believed_gap(
    state: State, params: StepParameters, slot: F32, gap: F32, looming: Looming
) -> F32:
    """Gap to the oncoming vehicle as drivers misjudge it [m].

    Two-wheelers look farther away. `looming.error_share` is the share of the error that is left; it
    falls from 1 to 0 as contact comes near.
    """
    is_two_wheeler = value_at_slot(params.vehicles.two_wheeler, slot) > 0
    size_factor = np.where(is_two_wheeler, params.constants.two_wheeler_distance_factor, ONE)
    # The coefficient of variation times a random process of unit variance.
    error_factor = exp(params.simulations.oncoming_error * state.noise.distance_error)
    return gap + gap * ((error_factor * size_factor - ONE) * looming.error_share)


def _believed_closing_speed(
    state: State, params: StepParameters, looming: Looming, is_detected: Mask
) -> F32:
    """Believed closing speed [m/s].

    The expected speed until the vehicle looms; then `looming.noticed_share`, which grows to 1 with
    the looming, weights the speed that looming shows.
    """
    expected = expected_closing_speed(state, params)
    sensed = expected + looming.noticed_share * (looming.closing_speed - expected)
    return np.where(is_detected, sensed, expected)


def expected_closing_speed(state: State, params: StepParameters) -> F32:
    """Closing speed if oncoming vehicles drive as fast as usual, (vehicle, simulation) [m/s]."""
    own_speed, _ = state.road_velocity()
    return own_speed + params.simulations.expected_oncoming_speed


def nearest_oncoming(
    state: State, params: StepParameters, excluded_slot: F32
) -> tuple[NearestOncoming, NearestOncoming]:
    """The nearest oncoming vehicle of each driver in any lane, and the nearest in its own lane.

    A vehicle is in each lane that its body overlaps by more than a margin, and in the lane to which
    it visibly changes.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        excluded_slot: Slot of a vehicle that does not count, or `NO_SLOT`, (vehicle, simulation).
    """
    vehicles, constants, road = params.vehicles, params.constants, params.road
    lane, margin = state.lane_choice.lane, constants.corridor_margin
    # Borders of the lanes in the order of `_IN_ANY_LANE` and `_IN_OWN_LANE`.
    road_edges = road.boundaries[0], road.boundaries[road.num_lanes]
    # 0 selects each driver's own lane.
    borders = road_edges, lane_borders(state, params, 0.0)
    slot = np.full((2, *state.motion.s.shape), NO_SLOT)
    distance = np.full_like(slot, FAR)
    for other_slot in range(len(state.motion.s)):
        # Station and lateral position of the other vehicle in the frame of each driver.
        s, d = state.position_seen_by_each(params, other_slot)
        distance_ahead = s - state.motion.s
        right_side, left_side = (
            d - vehicles.half_width[other_slot],
            d + vehicles.half_width[other_slot],
        )
        # The frame of the other vehicle counts lanes from the other side of the road.
        mirrored_lane = np.float32(road.num_lanes - 1) - state.lane_choice.lane[other_slot]
        changes_to_lane = visibly_changes_lane(state, params, other_slot) & (mirrored_lane == lane)
        is_oncoming = (
            (vehicles.valid[other_slot] > 0)
            & (vehicles.travel_sign[other_slot] != vehicles.travel_sign)
            & (vehicles.valid > 0)
        )
        is_ahead = is_oncoming & (distance_ahead >= 0) & (excluded_slot != np.float32(other_slot))
        for lanes, (right, left) in enumerate(borders):
            is_in_lanes = (left_side > right + margin) & (right_side < left - margin)
            # A vehicle that changes lanes is in some lane anyway.
            is_in_lanes = is_in_lanes | changes_to_lane if lanes == _IN_OWN_LANE else is_in_lanes
            is_nearer = is_ahead & is_in_lanes & (distance_ahead < distance[lanes])
            slot[lanes] = np.where(is_nearer, np.float32(other_slot), slot[lanes])
            distance[lanes] = np.where(is_nearer, distance_ahead, distance[lanes])
    any_lane, own_lane = (
        NearestOncoming(slot[lanes], distance[lanes]) for lanes in (_IN_ANY_LANE, _IN_OWN_LANE)
    )
    return any_lane, own_lane


def is_being_passed(state: State, params: StepParameters) -> Mask:
    """Whether another vehicle passes each driver on the left, near enough for the driver to notice.

    The gap to the vehicle, which may be behind or ahead, is less than `passed_awareness_margin`.
    """
    vehicles, s, lane = params.vehicles, state.motion.s, state.lane_choice.lane
    overtakes, is_passed = state.is_overtaking(), np.zeros(s.shape, bool)
    for other_slot in range(len(s)):
        half_lengths = vehicles.half_length + vehicles.half_length[other_slot]
        gap = np.abs(s - s[other_slot]) - half_lengths
        is_near = gap < params.constants.passed_awareness_margin
        is_same_direction = vehicles.travel_sign == vehicles.travel_sign[other_slot]
        is_on_left = lane[other_slot] > lane
        is_passed = is_passed | (is_near & is_same_direction & is_on_left & overtakes[other_slot])
    return is_passed & (state.motion.is_wreck == 0)
