"""Who comes the other way: what drivers see, and believe of it."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import exp, maximum, minimum
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.perception import (
    LEAST_REACH,
    optical_depth,
    recall,
    sense,
    strain,
)
from overtaking.sim.reference.state import (
    LEAD,
    NOBODY,
    UNKNOWN,
    Fields,
    State,
    on_the_road,
    pick,
    road_velocity,
)
from overtaking.sim.reference.traffic import is_passed, nearest
from overtaking.world.step_parameters import StepParameters
from overtaking.world.weather_parameters import SimulationParameters

_FAR = np.float32(1e9)  # Sight past nobody [m].
_HALF = np.float32(0.5)

# Where drivers look for oncoming vehicles: `State.oncoming_id`.
_ANY_LANE, _OWN_LANE = range(2)


@dataclass(slots=True, kw_only=True)
class Oncoming:
    """The nearest vehicle of the other direction ahead, and what its driver believes of it.

    Arrays have shape (vehicle, simulation).

    Attributes:
        slot: Whole-number slots or `NOBODY`.
        gap: Bumper-to-bumper gap [m].
        half_length: Half of its length [m].
        detected: Whether the driver has noticed it.
        sure: Whether the driver has looked for long enough to know who comes, if anybody.
        believed_gap: How far off it is believed to be, `ModelConstants.oncoming_range` without any
            [m].
        closing: Believed speed of approach; the usual one without any [m/s].
        sight: How far the driver sees the other lane, and what comes there [m].
    """

    slot: F32
    gap: F32
    half_length: F32
    detected: Mask
    sure: Mask
    believed_gap: F32
    closing: F32
    sight: F32


@dataclass(slots=True, kw_only=True)
class Encounters:
    """Whom drivers meet on a two-way road; arrays of shape (vehicle, simulation).

    Attributes:
        coming: Who comes in any lane: that is who limits a pass.
        facing: Who comes in the lane that a driver is in.
        passed: Whether somebody is passing the driver, as far as that is noticed.
        leader_goes: Whether the leader signals that it will pull out itself.
    """

    coming: Oncoming
    facing: Oncoming
    passed: Mask
    leader_goes: Mask


def look_ahead(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    decision: int,
) -> Encounters:
    """Who comes, and what each driver believes of it; advances the time in view.

    The distance is misjudged by a slowly varying factor, and small oncomers are believed farther
    off. The speed of approach is what is usual until it looms, and is sensed from there on.

    Source:
        Farber and Silver 1967, ARRB 1978 (a usual speed); Levulis 2015 (small oncomers).
    """
    met = nearest(state, given, p, np.full_like(state.s, NOBODY))
    sight = _sight(state, given, p, q, near)
    coming, facing = (
        _judged(state, given, p, q, near, met[lanes], sight, decision, lanes)
        for lanes in (_ANY_LANE, _OWN_LANE)
    )
    leader = near.slot[LEAD]
    return Encounters(
        coming=coming,
        facing=facing,
        passed=is_passed(state, given, p),
        leader_goes=(leader >= 0) & (pick(state.indicator, leader) > 0),
    )


def look_beyond(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    first: Oncoming,
    decision: int,
) -> Oncoming:
    """Who comes behind the nearest, and what each driver would believe of it.

    Our drivers decide by the nearest alone; another driver of the ego is told of the next one. It
    is noticed with the nearest, where it can be seen.
    """
    met, _ = nearest(state, given, p, first.slot)
    return _judged(state, given, p, q, near, met, first.sight, decision, _ANY_LANE, first.detected)


def _sight(
    state: State, given: StepParameters, p: Fields, q: SimulationParameters, near: Neighbours
) -> F32:
    """How far drivers see the other lane: by the road, the weather, and past a high leader."""
    c, road = given.constants, given.road
    place, _ = on_the_road(state, given, p)
    by_road = np.where(p.travel_sign < 0, *(_shown(table, place) for table in road.sight[::-1]))
    lead = near.slot[LEAD]
    reach = maximum(near.distance[LEAD] - near.half_length[LEAD], LEAST_REACH)
    edge = near.aside[LEAD] + pick(p.half_width, lead) - c.eye_offset
    middle = _HALF * (road.boundaries[road.num_lanes] + road.boundaries[road.num_own_lanes])
    beside = middle - state.d - c.eye_offset
    hides = (lead >= 0) & (pick(p.blocks_view, lead) > 0) & (edge > 0) & (beside > 0)
    past = np.where(hides, beside * (reach / maximum(edge, LEAST_REACH)), _FAR)
    return minimum(minimum(minimum(by_road, state.shown), past), q.oncoming_sight)


def _shown(table: F32, place: F32) -> F32:
    """What a table of `RoadParameters.sight` says of places [m]."""
    stations, values, slopes = table
    knot = np.searchsorted(stations, place, side="right") - 1
    return values[knot] + (place - stations[knot]) * slopes[knot]


def _judged(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    met: tuple[F32, F32],
    sight: F32,
    decision: int,
    lanes: int,
    noticed: Mask | None = None,
) -> Oncoming:
    """What drivers believe of whom they have `noticed`; None for whom they watch in some lanes."""
    c, one = given.constants, np.float32(1.0)
    slot, distance = met
    half = pick(p.half_length, slot)
    true_gap = distance - (half + p.half_length)
    shines = pick(p.log_contrast, slot), pick(p.inverse_head_lamp, slot)
    depths = optical_depth(state, given, p, q, near)
    effort = strain(c, q, true_gap, shines, depths, is_front=True)
    reach = minimum(c.oncoming_range, sight if lanes == _ANY_LANE else state.shown)
    visible = (slot >= 0) & (effort <= one) & (true_gap < reach)
    if noticed is None:
        needed = q.detection_time * (one + c.detection_growth * (effort * effort * effort))
        needed = np.where(visible, needed, q.detection_time)
        _watch(state, given, lanes, np.where(visible, slot, NOBODY))
        sure = state.oncoming_time[lanes] >= needed
    else:
        sure = noticed
    detected = visible & sure
    own_speed, _ = road_velocity(state)
    urgent = true_gap < c.urgent_time * (own_speed + pick(state.vx, slot))
    ticks = np.where(urgent, p.urgent_reaction_delay, p.reaction_delay)
    then = maximum(np.float32(decision) - ticks, np.float32(0.0))
    elapsed = (np.float32(decision) - then) * c.decision
    place, speed = recall(state, then, slot)
    place = place + speed * elapsed
    gap = (given.road.length - place) - state.s - (half + p.half_length)
    closing = own_speed + speed
    _, clear, share, sensed = sense(state, c, q, gap, closing, pick(p.looming_width, slot))
    small = np.where(pick(p.two_wheeler, slot) > 0, c.two_wheeler_distance_factor, one)
    judged = exp(q.oncoming_error * state.distance_error) * small
    habit = usual_closing(state, q)
    return Oncoming(
        slot=slot,
        gap=true_gap,
        half_length=half,
        detected=detected,
        sure=sure,
        believed_gap=np.where(detected, gap + gap * ((judged - one) * share), c.oncoming_range),
        closing=np.where(detected, habit + clear * (sensed - habit), habit),
        sight=sight,
    )


def usual_closing(state: State, q: SimulationParameters) -> F32:
    """Speed of approach that drivers expect of who comes, (vehicle, simulation) [m/s]."""
    own_speed, _ = road_velocity(state)
    return own_speed + q.expected_oncoming_speed


def _watch(state: State, given: StepParameters, lanes: int, seen: F32) -> None:
    """Count for how long drivers have seen what they see in some lanes now: slots `seen`."""
    c, before = given.constants, state.oncoming_id[lanes]
    longer = np.where(seen == before, state.oncoming_time[lanes] + c.decision, np.float32(0.0))
    state.oncoming_time[lanes] = np.where(before == UNKNOWN, c.initial_time_in_view, longer)
    state.oncoming_id[lanes] = seen
