"""Who comes the other way: where, what drivers believe of it, and how they give way to it."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, Mask, clamp, exp, maximum, minimum
from overtaking.model.trajectory import Stage
from overtaking.sim.reference.neighbours import Neighbours, lane_borders, shows_change
from overtaking.sim.reference.perception import (
    DEEPEST,
    FARTHEST,
    LEAST_CONTRAST,
    LEAST_LOOMING,
    LEAST_REACH,
    NEAREST,
    optical_depth,
)
from overtaking.sim.reference.state import (
    HISTORY,
    LEAD,
    NOBODY,
    UNKNOWN,
    Fields,
    State,
    on_the_road,
    pick,
    road_velocity,
    seen_from_each,
)
from overtaking.sim.reference.steering import begin_path
from overtaking.world.parameters import Parameters, SimulationParameters

_FAR = np.float32(1e9)  # Distance without anybody [m].
_SLOWEST = np.float32(0.1)  # Keeps the time until vehicles meet finite [m/s].
_SHORTEST = np.float32(0.1)  # Keeps braking finite for who is there already [s].
_HALF = np.float32(0.5)


ANY_LANE, OWN_LANE = range(2)
"""Where drivers look for oncoming vehicles: `State.oncoming_id`."""

Met = tuple[F32, F32]
"""Slots of oncoming vehicles, `NOBODY` for none, and the distance of the centres [m]."""


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
        believed_gap: How far off it is believed to be, `Constants.oncoming_range` without any [m].
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
    given: Parameters,
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
    met = _nearest(state, given, p, np.full_like(state.s, NOBODY))
    sight = _sight(state, given, p, q, near)
    coming, facing = (
        _judged(state, given, p, q, near, met[lanes], sight, decision, lanes)
        for lanes in (ANY_LANE, OWN_LANE)
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
    given: Parameters,
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
    met = _nearest(state, given, p, first.slot)[ANY_LANE]
    return _judged(state, given, p, q, near, met, first.sight, decision, ANY_LANE, first.detected)


def _nearest(state: State, given: Parameters, p: Fields, but: F32) -> tuple[Met, Met]:
    """The nearest oncomer of each vehicle in any lane, and in its own; slots `but` do not count.

    One that is visibly on its way into the own lane is there.
    """
    c, road = given.constants, given.road
    low, high = lane_borders(state, given, 0.0)
    edges = road.boundaries[0], road.boundaries[road.num_lanes]
    slot = np.full((2, *state.s.shape), NOBODY)
    nearest = np.full_like(slot, _FAR)
    for j in range(len(state.s)):
        s, d = seen_from_each(state, given, p, j)
        ahead = s - state.s
        low_side, high_side = d - p.half_width[j], d + p.half_width[j]
        lane = np.float32(road.num_lanes - 1) - state.lane[j]
        comes = shows_change(state, given, j) & (lane == state.lane)
        opposed = (p.valid[j] > 0) & (p.direction[j] != p.direction) & (p.valid > 0)
        opposed = opposed & (ahead >= 0) & (but != np.float32(j))
        for lanes, (begin, end) in enumerate((edges, (low, high))):
            there = (high_side > begin + c.corridor_margin) & (low_side < end - c.corridor_margin)
            there = there | comes if lanes == OWN_LANE else there
            nearer = opposed & there & (ahead < nearest[lanes])
            slot[lanes] = np.where(nearer, np.float32(j), slot[lanes])
            nearest[lanes] = np.where(nearer, ahead, nearest[lanes])
    return (slot[ANY_LANE], nearest[ANY_LANE]), (slot[OWN_LANE], nearest[OWN_LANE])


def _sight(
    state: State, given: Parameters, p: Fields, q: SimulationParameters, near: Neighbours
) -> F32:
    """How far drivers see the other lane: by the road, the weather, and past a high leader."""
    c, road = given.constants, given.road
    place, _ = on_the_road(state, given, p)
    by_road = np.where(p.direction < 0, *(_shown(table, place) for table in road.sight[::-1]))
    lead = near.slot[LEAD]
    reach = maximum(near.distance[LEAD] - near.half_length[LEAD], LEAST_REACH)
    edge = near.aside[LEAD] + pick(p.half_width, lead) - c.eye_offset
    middle = _HALF * (road.boundaries[road.num_lanes] + road.boundaries[road.own_lanes])
    beside = middle - state.d - c.eye_offset
    hides = (lead >= 0) & (pick(p.tall, lead) > 0) & (edge > 0) & (beside > 0)
    past = np.where(hides, beside * (reach / maximum(edge, LEAST_REACH)), _FAR)
    return minimum(minimum(minimum(by_road, state.shown), past), q.oncoming_sight)


def _shown(table: F32, place: F32) -> F32:
    """What a table of `RoadParameters.sight` says of places [m]."""
    stations, values, slopes = table
    knot = np.searchsorted(stations, place, side="right") - 1
    return values[knot] + (place - stations[knot]) * slopes[knot]


def _judged(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    met: Met,
    sight: F32,
    decision: int,
    lanes: int,
    noticed: Mask | None = None,
) -> Oncoming:
    """What drivers believe of whom they have `noticed`; None for whom they watch in some lanes."""
    c, one = given.constants, np.float32(1.0)
    slot, nearest = met
    half = pick(p.half_length, slot)
    true_gap = nearest - (half + p.half_length)
    effort = _strain(state, given, p, q, near, slot, true_gap)
    reach = minimum(c.oncoming_range, sight if lanes == ANY_LANE else state.shown)
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
    ticks = np.where(urgent, p.urgent_ticks, p.reaction_ticks)
    then = maximum(np.float32(decision) - ticks, np.float32(0.0))
    elapsed = (np.float32(decision) - then) * c.decision
    row, who = then.astype(np.int64) % HISTORY, slot.astype(np.int64).clip(0)
    column = np.arange(state.s.shape[1])
    speed = state.history_v[row, who, column]
    place = state.history_s[row, who, column] + speed * elapsed
    gap = (given.road.far_end - place) - state.s - (half + p.half_length)
    closing = own_speed + speed
    distance = maximum(gap, NEAREST)
    expansion = pick(p.loom_width, slot) * np.abs(closing) / (distance * distance)
    span = maximum(c.looming_growth * c.looming_threshold, LEAST_LOOMING)
    clear = clamp((expansion - c.looming_threshold) / span, np.float32(0.0), one)
    fading = maximum(closing * c.error_fade_time, NEAREST)
    share = minimum(distance / fading, one)
    small = np.where(pick(p.two_wheeler, slot) > 0, c.small_oncomer, one)
    judged = exp(q.oncoming_error * state.distance_error) * small
    sensed = closing * (one + share * (q.speed_error * state.speed_error))
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
    return own_speed + q.usual_speed


def _watch(state: State, given: Parameters, lanes: int, seen: F32) -> None:
    """Count for how long drivers have seen what they see in some lanes now: slots `seen`."""
    c, before = given.constants, state.oncoming_id[lanes]
    longer = np.where(seen == before, state.oncoming_time[lanes] + c.decision, np.float32(0.0))
    state.oncoming_time[lanes] = np.where(before == UNKNOWN, c.seen_before, longer)
    state.oncoming_id[lanes] = seen


def _strain(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    slot: F32,
    gap: F32,
) -> F32:
    """How close to the limit of sight an oncomer is, as `perception.strain`."""
    c = given.constants
    air, spray = optical_depth(state, given, p, q, near)
    distance = clamp(gap, NEAREST, FARTHEST)
    depth = air * distance + spray * minimum(distance, c.spray_reach)
    by_contrast = depth / maximum(pick(p.contrast, slot) + q.sight_front, LEAST_CONTRAST)
    by_contrast = maximum(by_contrast, distance * q.inverse_lit_range)
    lamp = pick(p.inverse_head_lamp, slot)
    by_lamp = np.sqrt(
        distance * distance * (q.lamp_threshold * lamp) * exp(minimum(depth, DEEPEST))
    )
    return minimum(by_contrast, by_lamp)


def is_out(state: State) -> Mask:
    """Who is overtaking, or on the way back from there, (vehicle, simulation)."""
    stage = state.stage
    away = (stage != np.float32(Stage.FOLLOW)) & (stage != np.float32(Stage.DONE))
    return away & (state.crashed == 0)


def give_way(state: State, given: Parameters, p: Fields, met: Encounters) -> F32:
    """The acceleration that drivers do not go beyond for who comes in their lane [m/s^2].

    They flash and lift, then brake so as to stop within their part of the way, and move aside.
    What who overtakes does is told by `passing`. Those who are being passed may make room.
    """
    c, oncoming = given.constants, met.facing
    out = is_out(state)
    meets = oncoming.detected & (state.crashed == 0) & ~out
    time = oncoming.believed_gap / maximum(oncoming.closing, _SLOWEST)
    lifts, brakes = meets & (time < c.head_on_flash), meets & (time < c.head_on_time)
    state.flashes = np.where(lifts, np.float32(1.0), np.float32(0.0))
    halved = np.float32(2.0) * maximum(time, _SHORTEST)
    braking = clamp(state.vx / halved, c.head_on_least, c.head_on_most)
    _move_aside(state, given, p, brakes, np.where(met.passed, p.makes_room, np.float32(0.0)), out)
    return np.where(brakes, -braking, np.where(lifts, -c.head_on_lift, _FAR))


def is_passed(state: State, given: Parameters, p: Fields) -> Mask:
    """Whom others pass in the next lane, as they notice it, (vehicle, simulation)."""
    out, passed = is_out(state), np.zeros(state.s.shape, bool)
    for j in range(len(state.s)):
        apart = np.abs(state.s - state.s[j]) - (p.half_length + p.half_length[j])
        beside = (apart < given.constants.beside_margin) & (p.direction == p.direction[j])
        passed = passed | (beside & (state.lane[j] > state.lane) & out[j])
    return passed & (state.crashed == 0)


def _move_aside(
    state: State, given: Parameters, p: Fields, brakes: Mask, room: F32, out: Mask
) -> None:
    """Move towards the edge of the lane for who comes in it, or passes; and back afterwards.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        brakes: Who brakes for who comes.
        room: How far others move for who passes [m].
        out: Who overtakes, and keeps to the way of that.
    """
    c = given.constants
    wanted = np.where(brakes, c.aside_way, room)
    arrived = state.path_time >= state.path_duration
    moved = (wanted > state.aside) | (arrived & (wanted < state.aside))
    moved = moved & (state.crashed == 0) & (p.valid > 0) & ~out
    low, high = lane_borders(state, given, 0.0)
    duration = np.where(brakes, c.aside_duration, np.float32(2.0) * c.aside_duration)
    begin_path(state, moved, _HALF * (low + high) - wanted, duration)
    state.aside = np.where(out, np.float32(0.0), np.where(moved, wanted, state.aside))
