"""What rules look up in a case: spans of frames, neighbours, zones of the road, speed limits."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.toml_reader import constant, number
from overtaking.labels.law.margins import (
    ENDLESS,
    Stretches,
    always_at,
    answers,
    ends_in,
    frames_of,
    time_to_regain,
)
from overtaking.labels.signals import beside_target, encounter
from overtaking.labels.snapshots import (
    METRES,
    Frames,
    Span,
    coming,
    others_at,
    slot_of,
    spread_over,
)
from overtaking.model.batch import cached_per_batch
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.road_course import ZoneKind
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import NO_VEHICLE, POSITION_RESOLUTION, Trajectories
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case, Finding
from overtaking.world.sight_distance import all_zones_for
from overtaking.world.weather_parameters import weather_effects


def seconds_of(case: Case, frames: Frames) -> F32:
    """Duration of a number of frames, of the same shape [s]."""
    return as_f32(frames * np.int32(case.signals.frame_interval_ms)) / np.float32(1000.0)


@cached_per_batch
def driving_end(case: Case) -> I32:
    """Last frame in which the ego is driven: before a collision, off the road or a spin."""
    events = case.events
    end = events.last.copy()
    for stop in (events.collision, events.road_departure, events.spin):
        end = np.where(stop != NEVER, np.minimum(end, stop - 1), end)
    return end


@cached_per_batch
def manoeuvre(case: Case) -> Span:
    """From 3 s before the attempt to 3 s after its end; empty without an attempt.

    An overtake that is not completed ends when the ego is back, or with the recording.
    """
    events = case.events
    before = frames_of(case, constant("law.window.before"))
    after = frames_of(case, constant("law.window.after"))
    given_up = np.where(events.abort_end != NEVER, events.abort_end, events.last)
    over = np.where(events.return_end != NEVER, events.return_end + after, given_up)
    stop = np.minimum(over, driving_end(case))
    return Span(
        start=np.maximum(events.attempt - before, events.first),
        stop=np.where(events.has_attempt, stop, NEVER).astype(np.int32),
    )


@cached_per_batch
def conduct(case: Case) -> Span:
    """The manoeuvre, or all that was driven where there was no attempt."""
    attempted, within = case.events.has_attempt, manoeuvre(case)
    return Span(
        start=np.where(attempted, within.start, case.events.first),
        stop=np.where(attempted, within.stop, driving_end(case)),
    )


@cached_per_batch
def settled(case: Case) -> Span:
    """`conduct` without the time in which a distance that another has taken may be regained.

    What came before a recording is not known: its beginning is like a cut-in.
    """
    span, begin = conduct(case), case.events.first + time_to_regain(case) + 1
    return Span(start=np.maximum(span.start, begin), stop=span.stop)


@cached_per_batch
def passed(case: Case) -> Span:
    """From the frame in which the target was passed to the end of the manoeuvre."""
    end, stop = case.events.overlap_end, manoeuvre(case).stop
    return Span(start=np.where(end != NEVER, end, stop + 1), stop=stop)


@cached_per_batch
def after_cut_ins(case: Case) -> Mask:
    """Whether the leader has cut in so lately that it may be too near, shape (simulation, time).

    A vehicle cuts in where it comes from another lane and becomes the leader of an ego that keeps
    its own.
    """
    run, lane = case.trajectories, case.signals.lane
    leader = case.signals.neighbour_slot[:, NeighbourRole.LEADER]
    lately = np.zeros(leader.shape, np.bool_)
    new = (leader[:, 1:] != leader[:, :-1]) & (leader[:, 1:] != NO_VEHICLE)
    rows, before = np.nonzero(new & (lane[:, 1:] == lane[:, :-1]))
    slots = leader[rows, before + 1]
    came = run.states.lane[rows, slots, before] != lane[rows, before]
    if run.is_recorded is not None:
        came &= run.is_recorded[rows, slots, before]
    for row, frame, slot in zip(rows[came], before[came] + 1, slots[came], strict=True):
        since = slice(frame, frame + 1 + time_to_regain(case))
        lately[row, since] |= leader[row, since] == slot
    return lately


@cached_per_batch
def stretches(case: Case) -> Stretches:
    """All that rules and features ask about stretches of frames."""
    events = case.events
    until = np.where(events.collision == NEVER, events.last, events.collision)
    until = np.where(events.has_attempt, NEVER, until).astype(np.int32)
    spans = {
        "conduct": conduct(case),
        "settled": settled(case),
        "passed": passed(case),
        "manoeuvre": manoeuvre(case),
        "counted": Span(start=np.zeros_like(until), stop=until),
    }
    return answers(case, spans)


@cached_per_batch
def on_the_other_side(case: Case) -> Span:
    """The manoeuvre while a corner is beyond the line between the directions.

    From the first to the last such frame; empty on one-way roads.
    """
    span, road = manoeuvre(case), case.trajectories.road
    never = np.full(len(span.start), NEVER)
    if not road.is_two_way:
        return Span(start=never + np.int32(1), stop=never)
    line = np.float32(road.overtaking_sign * road.lane_boundaries[-1]) + constant(
        "law.line.tolerance"
    )
    rows = np.flatnonzero(span.exists)
    first, last, _ = ends_in(span, rows, case.signals.left_edge[rows] > line)
    return Span(start=np.where(first == NEVER, last + 1, first).astype(np.int32), stop=last)


Along = tuple[float, float]
"""Beginning and end of a stretch of road [m]."""


@cached_per_batch
def overtaking(case: Case) -> Span:
    """From the line being crossed until the target is passed, and the ego back on its side."""
    events, over = case.events, manoeuvre(case)
    passed = np.where(events.overlap_end != NEVER, events.overlap_end, over.stop)
    stop = np.minimum(np.maximum(passed, on_the_other_side(case).stop), over.stop)
    begun = over.exists & (events.line_crossed != NEVER)
    return Span(start=np.where(begun, events.line_crossed, stop + 1).astype(np.int32), stop=stop)


def distance_from(case: Case, along: Iterable[Along]) -> F32:
    """Distance of the ego's front from the nearest of some stretches, (simulation, time) [m].

    Within a stretch it is negative: the way to the nearer end.
    """
    run = case.trajectories
    front = as_f32(run.states.s[:, EGO_SLOT]) * METRES
    front = front + run.scenario.vehicles.length[:, [EGO_SLOT]] * HALF
    least = np.full(front.shape, ENDLESS)
    for one in along:
        start, stop = np.float32(one[0]), np.float32(one[1])
        least = np.minimum(least, np.maximum(start - front, front - stop))
    return least


def stretches_of(
    case: Case, kinds: Iterable[ZoneKind], before: Callable[[ZoneKind], float]
) -> list[Along]:
    """The stretches of some kinds of places for those who come along the road.

    Args:
        case: The batch.
        kinds: Which.
        before: How long before a place of a kind its stretch begins [m].
    """
    wanted, places = frozenset(kinds), all_zones_for(case.trajectories.road, 1)
    return [(one.start - before(one.kind), one.stop) for one in places if one.kind in wanted]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alongside:
    """The frames in which ego and target overlap, in order; arrays have shape (instant,).

    Attributes:
        rows: Simulation of each.
        frames: Its frame.
        lane: Lane of the target.
        lateral_gap: Between the sides of their bodies [m].
        accel: Of the target [m/s^2].
    """

    rows: IndexArray
    frames: IndexArray
    lane: U8
    lateral_gap: F32
    accel: F32

    def check(self, case: Case, margin: F32, about: Mask | None = None) -> Finding:
        """A margin of these frames that may never be negative, in the simulations that count."""
        rows, frames = self.rows, self.frames
        if about is not None:
            counted = about[rows]
            rows, frames, margin = rows[counted], frames[counted], margin[counted]
        return always_at(margin, rows, frames, case.signals.num_simulations)


@cached_per_batch
def alongside(case: Case) -> Alongside:
    """The frames in which ego and target overlap, in the overtake."""
    events, end = case.events, driving_end(case)
    over = np.where(events.overlap_end != NEVER, np.minimum(events.overlap_end, end), end)
    begun = (events.overlap_begin != NEVER) & (case.target.slot != NO_VEHICLE)
    return overlaps(case, Span(start=np.where(begun, events.overlap_begin, over + 1), stop=over))


def overlaps(case: Case, span: Span) -> Alongside:
    """The frames of a span in which ego and target overlap along the road."""
    rows, frames, lane, lateral_gap, accel = beside_target(case, span.ends)
    return Alongside(rows=rows, frames=frames, lane=lane, lateral_gap=lateral_gap, accel=accel)


def lane_index(lane: U8) -> np.ndarray:
    """Lane indices as signed numbers, with -1 for what is beyond the slow edge."""
    return lane.view(np.int8)


def ego_may_be(case: Case, kind: VehicleKind) -> Mask:
    """Whether the ego is of a kind, or its kind is unknown, shape (simulation,)."""
    is_one = case.trajectories.scenario.vehicles.kind[:, EGO_SLOT] == kind
    return is_one | ("kinds" in case.trajectories.unknown)


def target_may_be(case: Case, *, bicycle: bool) -> Mask:
    """Whether there is a target that is a bicycle, or is none, or may be; shape (simulation,)."""
    vehicle, kind = case.target.slot, case.trajectories.scenario.vehicles.kind
    is_bicycle = kind[np.arange(len(vehicle)), slot_of(vehicle)] == VehicleKind.BICYCLE
    unknown = "kinds" in case.trajectories.unknown
    return (vehicle != NO_VEHICLE) & ((is_bicycle == bicycle) | unknown)


def beside(case: Case, place: NeighbourRole, frame: Frames) -> Encounter:
    """The neighbour in a place at one frame of each simulation; nobody where that is `NEVER`."""
    rows = np.flatnonzero(frame != NEVER)
    found = encounter(case, place, rows, frame[rows].astype(np.intp))
    if len(rows) == len(frame):
        return found
    spread = partial(spread_over, simulations=rows, count=len(frame))
    return Encounter(**{one.name: spread(getattr(found, one.name)) for one in fields(Encounter)})


MIN_CLOSING_SPEED = np.float32(0.1)
"""A slower approach counts as this fast, which keeps times finite [m/s]."""


def next_oncomer(
    case: Case, frame: I32, rows: IndexArray | None = None
) -> tuple[F32, F32, IndexArray]:
    """The nearest who comes at one frame of some simulations of a two-way road; none at `NEVER`.

    Args:
        case: The batch.
        frame: A frame of each, shape (instant,).
        rows: Which simulations, same shape; all of them if left out.

    Returns:
        Gap to it [m] and both speeds together [m/s], NaN where nobody comes, and its slot.
    """
    rows = np.arange(len(frame)) if rows is None else rows
    others, instant = others_at(case, frame, rows), np.arange(len(frame))
    gaps = np.where(coming(others), others.gap, np.inf)
    slot = gaps.argmin(axis=1)
    gap, own = gaps[instant, slot], case.signals.speed[rows, np.maximum(frame, 0)]
    there = (frame != NEVER) & np.isfinite(gap)
    both = np.maximum(own + others.speed[instant, slot], MIN_CLOSING_SPEED)
    nan = np.float32(np.nan)
    return (
        np.where(there, gap, nan).astype(np.float32),
        np.where(there, both, nan).astype(np.float32),
        slot,
    )


@cached_per_batch
def optical_range(case: Case) -> F32:
    """Meteorological optical range in fog and falling rain, shape (simulation,) [m]."""
    sight = weather_effects(case.trajectories.scenario).sight
    air = sight["fog_extinction"] + sight["rain_extinction"]
    return constant("weather.fog.transmission_depth") / air


ROAD_KINDS = ("motorway", "other", "town")

CLASSES = ("light", "van", "heavy")

_CLASS_OF = {VehicleKind.VAN: 1, VehicleKind.TRUCK: 2}
"""Index into `CLASSES` of vehicles that are neither light passenger vehicles nor two-wheelers."""


def limits_of(case: Case, general: F32, ahead: float = 0.0) -> tuple[F32, F32]:
    """The lowest and the highest limit that may hold where each ego is [m/s].

    They are equal where kind of road, kind of ego and posted limit are known.

    Args:
        case: The batch.
        general: General limits by `ROAD_KINDS` and `CLASSES`, shape (3, 3) [m/s].
        ahead: How far ahead of each ego [m].

    Returns:
        Both of shape (simulation, time), read-only.
    """
    unknown, road = case.trajectories.unknown, case.trajectories.road
    if "road_kind" not in unknown:
        row = ROAD_KINDS.index(road.kind if road.kind in ROAD_KINDS else "other")
        general = general[row : row + 1]
    low, high = general.min(axis=0), general.max(axis=0)
    if "kinds" in unknown:
        low, high = (np.full_like(low, low.min()), np.full_like(high, high.max()))
    column = class_of(case.trajectories.scenario.vehicles.kind[:, EGO_SLOT])
    low, high = low[column, None], high[column, None]
    if "speed_limit" in unknown:
        # Any sign may stand there, but none that allows more than the general limit.
        low = np.zeros_like(low)
    else:
        posted = _posted(case.trajectories, ahead)
        low, high = np.minimum(low, posted), np.minimum(high, posted)
    shape = case.signals.speed.shape
    return np.broadcast_to(low, shape), np.broadcast_to(high, shape)


def _posted(run: Trajectories, ahead: float) -> F32:
    """The limit that is posted so far ahead of the ego's centre [m/s].

    Returns:
        Shape (simulation, time), or (1, 1) where it is the same everywhere.
    """
    if not has_changing_limit(run):
        return np.full((1, 1), run.road.speed_limit, np.float32)
    return as_f32(run.road.speed_limit_at(run.states.s[:, EGO_SLOT] * POSITION_RESOLUTION + ahead))


def has_changing_limit(run: Trajectories) -> bool:
    """Whether the posted limit changes along the road."""
    return run.road.course is not None and bool(run.road.course.speed_limits_for(1))


def class_of(kind: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Index into `CLASSES` of vehicle kinds."""
    classes = np.zeros(len(VehicleKind), np.intp)
    for each, index in _CLASS_OF.items():
        classes[each] = index
    return classes[kind]


def limit_table(file: str) -> F32:
    """Limits of a file, named without suffix; shape (kind of road, class) [m/s]."""
    rows = [[number(f"{file}.limits.{road}.{of}") for of in CLASSES] for road in ROAD_KINDS]
    return np.array(rows, np.float32)
