"""Spans of frames, neighbours, zones of the road, sight and speed limits of a case.

A `Case` is a batch of simulations with signals, events and targets, one ego in each simulation. An
event is a frame of each simulation, `NEVER` (-1) where it does not occur. A `FrameSpan` holds the
first and last frame of a span in each simulation; it is empty where `last` is before `first`.
`cached_per_batch` computes a result once for each case. A zone is a place where the law restricts
overtaking, such as a bend, a crossing or a stretch with a sign.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.quantities import Quantity
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    ScanResults,
    breach_frames_in,
    finding_at_instants,
    num_frames_in,
    num_frames_to_regain_gap,
    scan_spans,
)
from overtaking.labels.law.numbers import (
    LINE_TOLERANCE,
    WINDOW_AFTER,
    WINDOW_BEFORE,
    quantity,
)
from overtaking.labels.signals import encounters_at, frames_alongside_target
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    Frames,
    FrameSpan,
    at_frame,
    other_vehicles_at,
    scatter,
    slot_or_ego,
)
from overtaking.model.batch import cached_per_batch
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.road_course import ZoneKind
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import NO_VEHICLE, POSITION_RESOLUTION, Trajectories
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case, Finding
from overtaking.world.sight_distance import all_zones_for, sight_at
from overtaking.world.weather_parameters import weather_effects


def seconds_of(case: Case, frames: Frames) -> F32:
    """Duration of a number of frames, of the same shape [s]."""
    return as_f32(frames * np.int32(case.signals.frame_interval_ms)) / np.float32(1000.0)


@cached_per_batch
def last_driven_frame(case: Case) -> I32:
    """Last frame before a collision, a departure from the road or a spin, (simulation,).

    Without any of these, it is the last frame of the recording.
    """
    events = case.events
    last = events.last.copy()
    for accident in (events.collision, events.road_departure, events.spin):
        last = np.where(accident != NEVER, np.minimum(last, accident - 1), last)
    return last


@cached_per_batch
def manoeuvre(case: Case) -> FrameSpan:
    """From 3 s before the attempt to 3 s after the return; empty without an attempt.

    Both times are choices, `WINDOW_BEFORE` and `WINDOW_AFTER`: looking, signalling and following
    before the start belong to the overtake, and so does settling in front of the target.

    Without a return the span ends when the ego is back behind the target, or with the recording. It
    has no frame after `last_driven_frame`.
    """
    events = case.events
    num_frames_before = num_frames_in(case, WINDOW_BEFORE.f32)
    num_frames_after = num_frames_in(case, WINDOW_AFTER.f32)
    end_without_return = np.where(events.abort_end != NEVER, events.abort_end, events.last)
    end = np.where(
        events.return_end != NEVER, events.return_end + num_frames_after, end_without_return
    )
    last = np.minimum(end, last_driven_frame(case))
    return FrameSpan(
        first=np.maximum(events.attempt - num_frames_before, events.first),
        last=np.where(events.has_attempt, last, NEVER).astype(np.int32),
    )


@cached_per_batch
def judged_span(case: Case) -> FrameSpan:
    """The manoeuvre; without an attempt, all driven frames."""
    has_attempt, span = case.events.has_attempt, manoeuvre(case)
    return FrameSpan(
        first=np.where(has_attempt, span.first, case.events.first),
        last=np.where(has_attempt, span.last, last_driven_frame(case)),
    )


@cached_per_batch
def span_after_gap_recovery(case: Case) -> FrameSpan:
    """`judged_span` without its first seconds, in which a driver may restore a gap.

    The time before a recording is unknown, and simulations place vehicles before any driver acts.
    So the beginning counts like a cut-in of the leader.
    """
    # As in `is_regaining_gap`, the frame of the cut-in itself is not judged either, hence + 1.
    span, begin = judged_span(case), case.events.first + num_frames_to_regain_gap(case) + 1
    return FrameSpan(first=np.maximum(span.first, begin), last=span.last)


@cached_per_batch
def span_after_passing(case: Case) -> FrameSpan:
    """From the first frame with the ego wholly ahead of the target to the end of the manoeuvre."""
    passing_frame, last = case.events.overlap_end, manoeuvre(case).last
    # Without a passing frame the span is empty.
    return FrameSpan(first=np.where(passing_frame != NEVER, passing_frame, last + 1), last=last)


@cached_per_batch
def is_regaining_gap(case: Case) -> Mask:
    """Whether the leader cut in so recently that it may be too near, shape (simulation, time).

    A vehicle cuts in if it comes from another lane and becomes the leader of an ego that keeps its
    lane.
    """
    trajectories, lane = case.trajectories, case.signals.lane
    leader = case.signals.neighbour_slot[:, NeighbourRole.LEADER]
    is_recent = np.zeros(leader.shape, np.bool_)
    is_new_leader = (leader[:, 1:] != leader[:, :-1]) & (leader[:, 1:] != NO_VEHICLE)
    simulation, last_frame_before = np.nonzero(is_new_leader & (lane[:, 1:] == lane[:, :-1]))
    slots = leader[simulation, last_frame_before + 1]
    has_changed_lane = (
        trajectories.states.lane[simulation, slots, last_frame_before]
        != lane[simulation, last_frame_before]
    )
    if trajectories.is_recorded is not None:  # None: all vehicles are recorded in all frames.
        has_changed_lane &= trajectories.is_recorded[simulation, slots, last_frame_before]
    for simulation_of_cut_in, frame, slot in zip(
        simulation[has_changed_lane],
        last_frame_before[has_changed_lane] + 1,
        slots[has_changed_lane],
        strict=True,
    ):
        frames_after = slice(frame, frame + 1 + num_frames_to_regain_gap(case))
        is_recent[simulation_of_cut_in, frames_after] |= (
            leader[simulation_of_cut_in, frames_after] == slot
        )
    return is_recent


@cached_per_batch
def scans(case: Case) -> ScanResults:
    """Results of the compiled scan over the spans that rules and features read."""
    events = case.events
    # The engine sums over the span "summed". The reproduced paper (Pinto, Dutra and Fonseca, 2023)
    # describes a simulation without an attempt by means over its frames, and one with an attempt by
    # a single frame, so the span is then empty. By choice it begins at frame 0 and includes the
    # frame of a collision. Departures and spins, which the paper's classes do not name, do not end
    # it.
    last_summed = np.where(events.collision == NEVER, events.last, events.collision)
    last_summed = np.where(events.has_attempt, NEVER, last_summed).astype(np.int32)
    # The keys are the engine's names of its input spans, `_core.FIELD_NAMES["spans"]`.
    spans = {
        "judged": judged_span(case),
        "after_gap_recovery": span_after_gap_recovery(case),
        "after_passing": span_after_passing(case),
        "manoeuvre": manoeuvre(case),
        "summed": FrameSpan(first=np.zeros_like(last_summed), last=last_summed),
    }
    return scan_spans(case, spans)


@cached_per_batch
def opposing_lane_span(case: Case) -> FrameSpan:
    """From the first to the last frame in which the ego is in the opposing lane.

    In these frames a corner of the ego is more than `LINE_TOLERANCE` beyond the line between the
    directions of travel. The span lies within the manoeuvre, and is empty on one-way roads.
    """
    span, road = manoeuvre(case), case.trajectories.road
    never = np.full(len(span.first), NEVER)
    if not road.is_two_way:
        return FrameSpan(first=never + np.int32(1), last=never)  # Empty.
    # The last boundary of the lanes is the line between the directions. `lane_boundaries` are
    # positive towards the left, `left_edge` towards the overtaking side, which in left-hand traffic
    # is the right: the sign, -1 there, converts the boundary.
    line = np.float32(road.overtaking_sign * road.lane_boundaries[-1]) + LINE_TOLERANCE.f32
    rows = np.flatnonzero(span.is_nonempty)
    # `breach_frames_in` finds the first and last frame of any condition; to be over the line is not
    # a breach by itself.
    first, last, _ = breach_frames_in(span, rows, case.signals.left_edge[rows] > line)
    return FrameSpan(first=np.where(first == NEVER, last + 1, first).astype(np.int32), last=last)


RoadInterval = tuple[float, float]
"""Stations at which a stretch of road begins and ends [m]."""


@cached_per_batch
def overtaking_span(case: Case) -> FrameSpan:
    """From the line crossing until the target is passed and the ego is back on its own side.

    If the target is never passed, the span lasts to the end of the manoeuvre.
    """
    events, span = case.events, manoeuvre(case)
    passing_frame = np.where(events.overlap_end != NEVER, events.overlap_end, span.last)
    last = np.minimum(np.maximum(passing_frame, opposing_lane_span(case).last), span.last)
    has_begun = span.is_nonempty & (events.line_crossed != NEVER)
    return FrameSpan(
        first=np.where(has_begun, events.line_crossed, last + 1).astype(np.int32), last=last
    )


def distance_to_intervals(case: Case, intervals: Iterable[RoadInterval]) -> F32:
    """Distance of the ego's front from the nearest interval, shape (simulation, time) [m].

    Within an interval it is negative: the distance to the nearer end with a minus sign. Without
    intervals it is `UNCONSTRAINED`, which is larger than any margin.
    """
    trajectories = case.trajectories
    front = as_f32(trajectories.states.s[:, EGO_SLOT]) * METRES_PER_MM
    front = front + trajectories.scenario.vehicles.length[:, [EGO_SLOT]] * HALF
    distance = np.full(front.shape, UNCONSTRAINED)
    for interval in intervals:
        start, stop = np.float32(interval[0]), np.float32(interval[1])
        distance = np.minimum(distance, np.maximum(start - front, front - stop))
    return distance


def zone_intervals(
    case: Case, kinds: Iterable[ZoneKind], approach_length: Callable[[ZoneKind], float]
) -> list[RoadInterval]:
    """Intervals of the road with zones of some kinds for traffic in the ego's direction.

    Args:
        case: The batch.
        kinds: Kinds of the zones.
        approach_length: Function from a kind to the length by which an interval begins before its
            zone [m].
    """
    zone_kinds, zones = frozenset(kinds), all_zones_for(case.trajectories.road, direction=1)
    return [
        (zone.start - approach_length(zone.kind), zone.stop)
        for zone in zones
        if zone.kind in zone_kinds
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alongside:
    """The frames in which ego and target overlap along the road; arrays have shape (instant,).

    Attributes:
        simulation: Row of the simulation.
        frame: Frame, in order within each simulation.
        lane: Lane index of the target.
        lateral_gap: Gap between the sides of ego and target, negative where they overlap [m].
        accel: Acceleration of the target [m/s^2].
    """

    simulation: IndexArray
    frame: IndexArray
    lane: U8
    lateral_gap: F32
    accel: F32

    def finding(self, case: Case, margin: F32, applies: Mask | None = None) -> Finding:
        """Finding from the smallest margin in these frames.

        Args:
            case: The batch.
            margin: Margin at each instant, shape (instant,).
            applies: The simulations to which the rule applies, shape (simulation,); None for all.
        """
        simulation, frame = self.simulation, self.frame
        if applies is not None:
            is_judged = applies[simulation]
            simulation, frame, margin = simulation[is_judged], frame[is_judged], margin[is_judged]
        return finding_at_instants(margin, simulation, frame, case.signals.num_simulations)


@cached_per_batch
def alongside(case: Case) -> Alongside:
    """The frames in which ego and target overlap during the overtake."""
    events, end = case.events, last_driven_frame(case)
    last = np.where(events.overlap_end != NEVER, np.minimum(events.overlap_end, end), end)
    has_begun = (events.overlap_begin != NEVER) & (case.target.slot != NO_VEHICLE)
    return overlaps_in(
        case, FrameSpan(first=np.where(has_begun, events.overlap_begin, last + 1), last=last)
    )


def overlaps_in(case: Case, span: FrameSpan) -> Alongside:
    """The frames of a span in which ego and target overlap along the road."""
    simulation, frame, lane, lateral_gap, accel = frames_alongside_target(case, span.packed_ends)
    return Alongside(
        simulation=simulation, frame=frame, lane=lane, lateral_gap=lateral_gap, accel=accel
    )


def signed_lane(lane: U8) -> np.ndarray:
    """Lane indices as signed numbers: 255, a vehicle beyond the slow edge, becomes -1."""
    return lane.view(np.int8)


def ego_may_be(case: Case, kind: VehicleKind) -> Mask:
    """Whether the ego is of a kind, or no kind of the batch is known, shape (simulation,).

    Where only some kinds are unknown, `judging` tries the possible kinds.
    """
    is_kind = case.trajectories.scenario.vehicles.kind[:, EGO_SLOT] == kind
    return is_kind | ("kinds" in case.trajectories.unknown)


def target_may_be(case: Case, *, bicycle: bool) -> Mask:
    """Whether the target may be a bicycle, or may be another vehicle; false without a target.

    A target of unknown kind may be both.

    Args:
        case: The batch.
        bicycle: Whether to test for a bicycle; otherwise for any other vehicle.

    Returns:
        Shape (simulation,).
    """
    slot, kind = case.target.slot, case.trajectories.scenario.vehicles.kind
    is_bicycle = kind[np.arange(len(slot)), slot_or_ego(slot)] == VehicleKind.BICYCLE
    is_unknown = "kinds" in case.trajectories.unknown
    return (slot != NO_VEHICLE) & ((is_bicycle == bicycle) | is_unknown)


def neighbour_at(case: Case, role: NeighbourRole, frame: Frames) -> Encounter:
    """The neighbour in a role at one frame of each simulation; invalid where `frame` is `NEVER`."""
    simulation = np.flatnonzero(frame != NEVER)
    encounters = encounters_at(case, role, simulation, frame[simulation].astype(np.intp))
    if len(simulation) == len(frame):
        return encounters
    to_batch = partial(scatter, simulations=simulation, num_simulations=len(frame))
    return Encounter(
        **{field.name: to_batch(getattr(encounters, field.name)) for field in fields(Encounter)}
    )


MIN_CLOSING_SPEED = np.float32(0.1)
"""Smallest closing speed to an oncoming vehicle, which keeps times to meet finite [m/s].

The value is a choice, far below walking pace: it matters only where ego and oncoming vehicle both
stand or nearly stand.
"""


def nearest_oncoming_at(
    case: Case, frame: I32, simulation: IndexArray | None = None
) -> tuple[F32, F32, IndexArray]:
    """The nearest oncoming vehicle at one frame of some simulations of a two-way road.

    Args:
        case: The batch.
        frame: A frame of each simulation, shape (instant,); at `NEVER` there is no vehicle.
        simulation: Rows of the simulations, same shape; None for all of them.

    Returns:
        Gap to the vehicle [m], closing speed [m/s] and slot of the vehicle. Without an oncoming
        vehicle, gap and closing speed are NaN, and the slot is arbitrary.
    """
    simulation = np.arange(len(frame)) if simulation is None else simulation
    # At `NEVER` this reads frame 0; `has_oncoming` drops the result.
    others, index = other_vehicles_at(case.trajectories, frame, simulation), np.arange(len(frame))
    # Approaching vehicles are ahead of the ego; an oncoming vehicle that it has met is behind.
    gaps = np.where(others.is_approaching, others.gap, np.inf)
    slot = gaps.argmin(axis=1)
    gap, ego_speed = gaps[index, slot], case.signals.speed[simulation, np.maximum(frame, 0)]
    has_oncoming = (frame != NEVER) & np.isfinite(gap)
    closing_speed = np.maximum(ego_speed + others.speed[index, slot], MIN_CLOSING_SPEED)
    nan = np.float32(np.nan)
    return (
        np.where(has_oncoming, gap, nan).astype(np.float32),
        np.where(has_oncoming, closing_speed, nan).astype(np.float32),
        slot,
    )


@cached_per_batch
def meteorological_range(case: Case) -> F32:
    """Meteorological optical range in fog and falling rain, shape (simulation,) [m].

    The distance over which air transmits 5 % of the light.
    """
    sight = weather_effects(case.trajectories.scenario).sight
    air = sight["fog_extinction"] + sight["rain_extinction"]
    return constant("weather.fog.transmission_depth") / air


def available_sight(case: Case, frame: I32) -> F32:
    """Sight distance at one frame of each simulation, limited by air and road [m]."""
    sight_of_road = as_f32(sight_at(case.trajectories.road, at_frame(case.signals.s, frame)))
    return np.minimum(meteorological_range(case), sight_of_road)


def assumed_oncoming_speed(case: Case, frame: I32) -> F32:
    """Speed assumed for oncoming vehicles that the ego cannot see yet, (simulation,) [m/s].

    It is the highest posted limit of their direction, -1, between the ego and the end of its sight.
    The limit at the ego alone would be too low just before a section of low speed ends, and the
    highest limit of the road too high within a long section.
    """
    road = case.trajectories.road
    near = at_frame(case.signals.s, frame)
    far = near + available_sight(case, frame)
    highest = road.speed_limit_at(near, -1)
    sections = road.course.speed_limits_for(-1) if road.course else ()
    section_ends = {end for section in sections for end in (section.start, section.stop)}
    # Limits change only where a section begins or ends. The end of the road is left out: a section
    # that ends there does not include this station, so `speed_limit_at` would return the higher
    # limit outside all sections.
    for station in section_ends - {road.length}:
        is_in_sight = (near < station) & (station <= far)
        limit = np.maximum(highest, road.speed_limit_at(station, -1))
        highest = np.where(is_in_sight, limit, highest)
    return as_f32(highest)


ROAD_KINDS = ("motorway", "other", "town")
"""Kinds of road with general speed limits of their own, in the order of rows of limits."""

LIMIT_CLASSES = ("light", "van", "heavy")
"""Classes of vehicles with general speed limits of their own, in the order of columns."""

_LIMIT_CLASS_OF_KIND = {VehicleKind.VAN: 1, VehicleKind.TRUCK: 2}
"""Index into `LIMIT_CLASSES` of the kinds that are not in class 0, light vehicles."""

NO_GENERAL_LIMIT = quantity(1000.0, "km/h", why="Larger than any speed")
"""Stands for a general speed limit in a law without such a limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassSpeedLimits:
    """General speed limits on one kind of road, by class of vehicle.

    Attributes:
        light: Limit of all vehicles but vans and heavy vehicles.
        van: Limit of light goods vehicles.
        heavy: Limit of heavy goods vehicles.
    """

    light: Quantity
    van: Quantity
    heavy: Quantity

    def __str__(self) -> str:
        """The three limits with their units, such as `120 km/h, 110 km/h and 90 km/h`."""
        light, van, heavy = (
            "none" if limit is NO_GENERAL_LIMIT else str(limit)
            for limit in (self.light, self.van, self.heavy)
        )
        return f"{light}, {van} and {heavy}"


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneralSpeedLimits:
    """Speed limits that hold without a sign, by kind of road and class of vehicle.

    Attributes:
        motorway: Limits on motorways.
        other: Limits outside towns on roads that are no motorways.
        town: Limits in towns.
    """

    motorway: ClassSpeedLimits
    other: ClassSpeedLimits
    town: ClassSpeedLimits

    def __str__(self) -> str:
        """The nine limits, for the predicate of a rule."""
        return (
            f"{self.motorway} on motorways for light vehicles, vans and heavy goods vehicles, "
            f"{self.other} on other roads, and {self.town} in towns"
        )

    def to_array(self) -> F32:
        """Limits by `ROAD_KINDS` and `LIMIT_CLASSES`, shape (3, 3) [m/s]."""
        roads = (getattr(self, road) for road in ROAD_KINDS)
        rows = [[getattr(limits, name).f32 for name in LIMIT_CLASSES] for limits in roads]
        return np.array(rows, np.float32)


def speed_limit_bounds(
    case: Case, general_limits: GeneralSpeedLimits, ahead: float = 0.0
) -> tuple[F32, F32]:
    """The lowest and the highest speed limit that may hold for each ego in each frame [m/s].

    They are equal where kind of road, kind of ego and posted limit are known.

    Args:
        case: The batch.
        general_limits: Limits that hold without a sign.
        ahead: Distance ahead of the ego's centre at which posted limits are read [m].

    Returns:
        Both of shape (simulation, time), read-only.
    """
    unknown, road = case.trajectories.unknown, case.trajectories.road
    general = general_limits.to_array()
    if "road_kind" not in unknown:
        row = ROAD_KINDS.index(road.kind if road.kind in ROAD_KINDS else "other")
        general = general[row : row + 1]
    low, high = general.min(axis=0), general.max(axis=0)
    if "kinds" in unknown:
        low, high = (np.full_like(low, low.min()), np.full_like(high, high.max()))
    column = limit_class(case.trajectories.scenario.vehicles.kind[:, EGO_SLOT])
    low, high = low[column, None], high[column, None]
    if "speed_limit" in unknown:
        # An unknown sign may post any limit, but never more than the general limit.
        low = np.zeros_like(low)
    else:
        posted = _posted_limit(case.trajectories, ahead)
        low, high = np.minimum(low, posted), np.minimum(high, posted)
    shape = case.signals.speed.shape
    return np.broadcast_to(low, shape), np.broadcast_to(high, shape)


def _posted_limit(trajectories: Trajectories, ahead: float) -> F32:
    """The limit that is posted at a distance ahead of the ego's centre [m/s].

    Returns:
        Shape (simulation, time), or (1, 1) where it is the same everywhere.
    """
    if not has_changing_limit(trajectories):
        return np.full((1, 1), trajectories.road.speed_limit, np.float32)
    # Roads are computed in float64; `METRES_PER_MM` is the same factor in float32.
    return as_f32(
        trajectories.road.speed_limit_at(
            trajectories.states.s[:, EGO_SLOT] * POSITION_RESOLUTION + ahead
        )
    )


def has_changing_limit(trajectories: Trajectories) -> bool:
    """Whether the posted limit of the ego's direction changes along the road."""
    return trajectories.road.course is not None and bool(
        trajectories.road.course.speed_limits_for(1)
    )


def limit_class(kind: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Index into `LIMIT_CLASSES` of each vehicle kind, of the same shape."""
    classes = np.zeros(len(VehicleKind), np.intp)
    for vehicle_kind, index in _LIMIT_CLASS_OF_KIND.items():
        classes[vehicle_kind] = index
    return classes[kind]
