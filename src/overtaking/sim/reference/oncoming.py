"""Who comes the other way: where, what drivers believe of it, and how they give way to it."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, Mask, clamp, exp, maximum, minimum
from overtaking.model.trajectory import Stage
from overtaking.model.vehicles import Role
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


@dataclass(slots=True, kw_only=True)
class Oncoming:
    """The nearest vehicle of the other direction ahead; arrays of shape (vehicle, simulation).

    Of the ego it is the nearest in any lane, of the others the nearest in their own.

    Attributes:
        slot: Whole-number slots or `NOBODY`.
        gap: Bumper-to-bumper gap [m].
        half_length: Half of its length [m].
        in_lane: Whether it is in the driver's lane, or visibly on its way there.
        detected: Whether the driver has noticed it.
        sure: Whether the driver has looked for long enough to know who comes, if anybody.
        believed_gap: How far off it is believed to be, `Constants.oncoming_range` without any [m].
        closing: Believed speed of approach; the usual one without any [m/s].
        sight: How far the ego sees its road, and what comes there, (simulation,) [m].
    """

    slot: F32
    gap: F32
    half_length: F32
    in_lane: Mask
    detected: Mask
    sure: Mask
    believed_gap: F32
    closing: F32
    sight: F32


def look_ahead(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    decision: int,
) -> Oncoming:
    """Who comes, and what each driver believes of it; advances the time in view.

    The distance is misjudged by a slowly varying factor, and small oncomers are believed farther
    off. The speed of approach is what is usual until it looms, and is sensed from there on.

    Source:
        Farber and Silver 1967, ARRB 1978 (a usual speed); Levulis 2015 (small oncomers).
    """
    found = _nearest(state, given, p, np.full_like(state.s, NOBODY))
    sight = _sight(state, given, p, q, near)
    return _judged(state, given, p, q, near, found, sight, decision, None)


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
    found = _nearest(state, given, p, first.slot)
    return _judged(state, given, p, q, near, found, first.sight, decision, first.detected)


def _nearest(state: State, given: Parameters, p: Fields, but: F32) -> tuple[F32, F32, Mask]:
    """Slot and distance of the nearest oncomer of each vehicle, and whether it is in its lane.

    Slots `but` do not count.
    """
    c, road = given.constants, given.road
    low, high = lane_borders(state, given, 0.0)
    to = high.copy()
    to[Role.EGO] = road.boundaries[road.num_lanes]
    slot, nearest = np.full_like(state.s, NOBODY), np.full_like(state.s, _FAR)
    in_lane = np.zeros(state.s.shape, bool)
    for j in range(len(state.s)):
        s, d = seen_from_each(state, given, p, j)
        ahead = s - state.s
        low_side, high_side = d - p.half_width[j], d + p.half_width[j]
        lane = np.float32(road.num_lanes - 1) - state.lane[j]
        comes = shows_change(state, given, j) & (lane == state.lane)
        above = high_side > low + c.corridor_margin
        inside = comes | (above & (low_side < high - c.corridor_margin))
        watched = comes | (above & (low_side < to - c.corridor_margin))
        opposed = (p.valid[j] > 0) & (p.direction[j] != p.direction) & (p.valid > 0)
        nearer = opposed & watched & (ahead >= 0) & (ahead < nearest) & (but != np.float32(j))
        slot = np.where(nearer, np.float32(j), slot)
        nearest = np.where(nearer, ahead, nearest)
        in_lane = np.where(nearer, inside, in_lane)
    return slot, nearest, in_lane


def _sight(
    state: State, given: Parameters, p: Fields, q: SimulationParameters, near: Neighbours
) -> F32:
    """How far the ego sees the other lane: by the road, the weather, and past a high leader."""
    c, road, ego = given.constants, given.road, Role.EGO
    place = state.s[ego]
    stations, values, slopes = road.sight
    by_road = np.zeros_like(place)
    for k in range(len(stations)):
        here = values[k] + (place - stations[k]) * slopes[k]
        by_road = np.where(place >= stations[k], here, by_road)
    lead = near.slot[LEAD, ego]
    reach = maximum(near.distance[LEAD, ego] - near.half_length[LEAD, ego], LEAST_REACH)
    edge = near.aside[LEAD, ego] + pick(p.half_width, lead) - c.eye_offset
    middle = _HALF * (road.boundaries[road.num_lanes] + road.boundaries[road.own_lanes])
    beside = middle - state.d[ego] - c.eye_offset
    hides = (lead >= 0) & (pick(p.tall, lead) > 0) & (edge > 0) & (beside > 0)
    past = np.where(hides, beside * (reach / maximum(edge, LEAST_REACH)), _FAR)
    by_road = minimum(by_road, state.shown[ego])
    return minimum(minimum(by_road, past), q.oncoming_sight)


def _judged(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    found: tuple[F32, F32, Mask],
    sight: F32,
    decision: int,
    noticed: Mask | None,
) -> Oncoming:
    """What drivers believe of whom they have `noticed`; None for whom they watch."""
    c, one = given.constants, np.float32(1.0)
    slot, nearest, in_lane = found
    half = pick(p.half_length, slot)
    true_gap = nearest - (half + p.half_length)
    effort = _strain(state, given, p, q, near, slot, true_gap)
    reach = minimum(c.oncoming_range, state.shown)
    reach[Role.EGO] = minimum(reach[Role.EGO], sight)
    visible = (slot >= 0) & (effort <= one) & (true_gap < reach)
    if noticed is None:
        needed = q.detection_time * (one + c.detection_growth * (effort * effort * effort))
        needed = np.where(visible, needed, q.detection_time)
        _watch(state, c.decision, c.seen_before, np.where(visible, slot, NOBODY))
        sure = state.oncoming_time >= needed
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
        in_lane=in_lane,
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


def _watch(state: State, decision: np.float32, before: np.float32, seen: F32) -> None:
    """Count for how long drivers have seen what they see now, `seen` in the slots of `Oncoming`."""
    longer = np.where(seen == state.oncoming_id, state.oncoming_time + decision, np.float32(0.0))
    state.oncoming_time = np.where(state.oncoming_id == UNKNOWN, before, longer)
    state.oncoming_id = seen


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
    """Whether the ego is overtaking, or on its way back from there, (simulation,)."""
    stage = state.stage
    away = (stage != np.float32(Stage.FOLLOW)) & (stage != np.float32(Stage.DONE))
    return away & (state.crashed[Role.EGO] == 0)


def give_way(state: State, given: Parameters, p: Fields, oncoming: Oncoming) -> F32:
    """The acceleration that drivers do not go beyond for who comes in their lane [m/s^2].

    They flash and lift, then brake so as to stop within their part of the way, and move aside. The
    ego does so in its own lane; while it overtakes, `passing` says what it does. Those who are
    being passed may make room.
    """
    c = given.constants
    met = oncoming.detected & oncoming.in_lane & (state.crashed == 0)
    met[Role.EGO] = met[Role.EGO] & ~is_out(state)
    time = oncoming.believed_gap / maximum(oncoming.closing, _SLOWEST)
    lifts, brakes = met & (time < c.head_on_flash), met & (time < c.head_on_time)
    state.flashes = np.where(lifts, np.float32(1.0), np.float32(0.0))
    halved = np.float32(2.0) * maximum(time, _SHORTEST)
    braking = clamp(state.vx / halved, c.head_on_least, c.head_on_most)
    _move_aside(state, given, p, brakes)
    return np.where(brakes, -braking, np.where(lifts, -c.head_on_lift, _FAR))


def is_passed(state: State, given: Parameters, p: Fields) -> Mask:
    """Whom the ego is passing, as they notice it, (vehicle, simulation)."""
    c, ego = given.constants, Role.EGO
    apart = np.abs(state.s - state.s[ego]) - (p.half_length + p.half_length[ego])
    beside = (apart < c.beside_margin) & (p.direction == p.direction[ego]) & (state.crashed == 0)
    beside = beside & (state.lane[ego] > state.lane) & is_out(state)
    beside[ego] = False
    return beside


def _move_aside(state: State, given: Parameters, p: Fields, brakes: Mask) -> None:
    """Move towards the edge of the lane for who comes in it, or passes; and back afterwards."""
    c = given.constants
    room = np.where(is_passed(state, given, p), p.makes_room, np.float32(0.0))
    wanted = np.where(brakes, c.aside_way, room)
    wanted[Role.EGO] = np.float32(0.0)
    arrived = state.path_time >= state.path_duration
    moved = (wanted > state.aside) | (arrived & (wanted < state.aside))
    moved = moved & (state.crashed == 0) & (p.valid > 0)
    low, high = lane_borders(state, given, 0.0)
    duration = np.where(brakes, c.aside_duration, np.float32(2.0) * c.aside_duration)
    begin_path(state, moved, _HALF * (low + high) - wanted, duration)
    state.aside = np.where(moved, wanted, state.aside)
