"""Changes along a road: bends, grades, centre line, zones, speed limits and sight distance.

A `Road` (`model.road`) has the same lanes along its whole length; its field `course` holds a
`RoadCourse`, which states everything else that changes. Readers of map files fill it in. The driver
model, the rules of the law and the pictures of simulations read it.

Terms:
    driving lanes: the lanes of the road itself, whose traffic runs in direction +1. On a two-way
        road the traffic of direction -1 uses the opposing lane beside them.
    station: distance `s` along the road's reference line from its start [m]. It grows in direction
        +1, also in tables for drivers of direction -1.
    mark: the border between two lanes, such as a painted line or a kerb.

`FieldSpec` declares the unit and the range of a field. `check_batch` raises a `ConfigError` if a
field of a dataclass has another type or is out of its range. It is named after batches, dataclasses
that hold many simulations, and takes any dataclass.
"""

import dataclasses
import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_batch
from overtaking.model.reference_line import CurveSegment

MAX_LENGTH = 100_000.0
"""Largest station [m]. Simulations hold stations in float32, whose steps are 8 mm there."""

MAX_SIGHT = 10_000.0
"""Largest sight distance [m]. Chosen: ten times the 1,000 m in which drivers look for oncoming
vehicles."""

MAX_SPANS = 1_000
"""Largest number of entries in each of the fields of spans, zones and sight. Chosen: ten per
kilometre of the longest road."""

MAX_SEGMENTS = 20_000
"""Largest number of segments of a reference line. Chosen: one per 5 m of the longest road."""

MAX_CURVATURE = 0.1
"""Largest curvature of a reference line [1/m]: a radius of 10 m. Drivers do not overtake in sharper
bends."""

MAX_GRADE = 0.2
"""Largest rise or fall per metre [1]. Chosen: main roads hardly exceed 0.1. A few streets are
steeper than this limit, up to a third."""

MAX_SPEED_LIMIT = 100.0
"""Largest speed limit [m/s], above any posted one. Readers of map files use it for roads without a
limit."""

_STATION = FieldSpec(unit="m", low=0.0, high=MAX_LENGTH)


class StationTable(NamedTuple):
    """A quantity by station: linear between stations, constant before the first and after the last.

    Attributes:
        station: Stations in ascending order, shape (station,), at least one [m].
        value: The quantity at each of them, shape (station,).
    """

    station: F64
    value: F64

    @classmethod
    def from_pairs(cls, pairs: Sequence[tuple[float, float]]) -> Self:
        """The table of one or more pairs (station, value), in ascending order of the stations."""
        station, value = np.array(pairs, np.float64).T
        return cls(station, value)

    @property
    def change_per_metre(self) -> F64:
        """Slope of the quantity from each station to the next; 0 from the last on.

        Returns:
            Change per metre, shape (station,).
        """
        return np.append(np.diff(self.value) / np.diff(self.station), 0.0)

    def value_at(self, s: ArrayLike) -> F64:
        """The quantity at stations.

        Args:
            s: Stations, any shape [m].

        Returns:
            Values of the same shape.
        """
        return np.interp(np.asarray(s, np.float64), self.station, self.value)


class RoadMark(enum.Enum):
    """The border between two lanes, in the spelling of CARLA, a driving simulator.

    A mark is described as seen from one of the two lanes. Of a double line the first word names the
    line nearer to that lane: drivers in this lane must not cross `SOLID_BROKEN`, drivers in the
    other lane may. `reverse` is the same line as seen from the other lane.
    """

    NONE = "NONE"
    SOLID = "Solid"
    BROKEN = "Broken"
    SOLID_SOLID = "SolidSolid"
    SOLID_BROKEN = "SolidBroken"
    BROKEN_SOLID = "BrokenSolid"
    BROKEN_BROKEN = "BrokenBroken"
    BOTTS_DOTS = "BottsDots"
    CURB = "Curb"
    GRASS = "Grass"
    OTHER = "Other"

    @property
    def reverse(self) -> "RoadMark":
        """The same line as seen from the lane on its other side."""
        if self is RoadMark.SOLID_BROKEN:
            return RoadMark.BROKEN_SOLID
        if self is RoadMark.BROKEN_SOLID:
            return RoadMark.SOLID_BROKEN
        return self


class ZoneKind(enum.Enum):
    """Kind of a zone, a place where the law restricts overtaking.

    The last three are stretches on which a sign forbids overtaking: to every driver, to drivers of
    heavy vehicles, and to riders of motorcycles and mopeds.
    """

    JUNCTION = "junction"
    PEDESTRIAN_CROSSING = "pedestrian_crossing"
    LEVEL_CROSSING = "level_crossing"
    CREST = "crest"
    BEND = "bend"
    NARROW = "narrow"
    NO_OVERTAKING = "no_overtaking"
    NO_OVERTAKING_HEAVY = "no_overtaking_heavy"
    NO_OVERTAKING_MOTORCYCLE = "no_overtaking_motorcycle"


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadZone:
    """A stretch of road on which the law restricts overtaking.

    Attributes:
        kind: The reason. `BEND` has reduced visibility; `NARROW` is too narrow for passing.
        start: Station of its start [m].
        stop: Station of its end, greater than `start` [m].
        direction: Direction of travel that is restricted: +1, -1, or 0 for both.
    """

    kind: ZoneKind
    start: Annotated[float, _STATION]
    stop: Annotated[float, _STATION]
    direction: Annotated[int, FieldSpec(low=-1, high=1)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class CentreLineSpan:
    """A stretch of the line between the two directions of a two-way road.

    Attributes:
        start: Station of its start [m].
        stop: Station of its end, greater than `start` [m].
        mark: The line as seen from the driving lanes; drivers of the opposing lane see
            `mark.reverse`.
    """

    start: Annotated[float, _STATION]
    stop: Annotated[float, _STATION]
    mark: RoadMark


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimitSpan:
    """A stretch of road with a lower speed limit than the rest of the road.

    Attributes:
        start: Station of its start [m].
        stop: Station of its end, greater than `start` [m].
        speed: Posted limit [m/s].
        direction: Direction of travel that it applies to: +1, -1, or 0 for both.
    """

    start: Annotated[float, _STATION]
    stop: Annotated[float, _STATION]
    speed: Annotated[float, FieldSpec(unit="m/s", low=0.0, high=MAX_SPEED_LIMIT, low_is_open=True)]
    direction: Annotated[int, FieldSpec(low=-1, high=1)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadCourse:
    """Changes along a road. Pairs by station are in ascending order and read as a `StationTable`.

    Attributes:
        segments: Segments of the reference line in world coordinates, joined end to start; the
            first begins at station 0. Beyond the last the line is straight. Empty for a straight
            road.
        grade: Slope of the road: pairs (station [m], rise per metre, positive uphill in direction
            +1); empty for a level road.
        centre_line_spans: Spans of the line between the directions, in order, without overlap.
            Between them the mark that the adjacent driving lane states applies (`model.road`).
        speed_limit_spans: Spans with a limit below `Road.speed_limit`, in order of `start`. Two
            spans may overlap only if they apply to opposite directions. Outside them
            `Road.speed_limit` applies.
        zones: Zones, in any order; they may overlap.
        sight: Distance that a driver of direction +1 sees along the road: pairs (station [m],
            distance [m]). If only this field is empty, the road does not limit sight in this
            direction. If this field and `sight_against` are empty, `world.sight_distance` computes
            the sight of both directions from bends and slopes.
        sight_against: The same for a driver of direction -1.

    Raises:
        ConfigError: A span is empty, spans or stations are not in order, there are too many of
            them, or a value is out of range. `Road` compares the course with its own length, speed
            limit and lanes.
    """

    segments: tuple[CurveSegment, ...] = ()
    grade: tuple[tuple[float, float], ...] = ()
    centre_line_spans: tuple[CentreLineSpan, ...] = ()
    speed_limit_spans: tuple[SpeedLimitSpan, ...] = ()
    zones: tuple[RoadZone, ...] = ()
    sight: tuple[tuple[float, float], ...] = ()
    sight_against: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        """Check the order, the number and the range of all entries."""
        check_batch(self, "course of a road")
        # `grade` has no limit, because readers sample it as densely as the map file states heights.
        for name in ("centre_line_spans", "speed_limit_spans", "zones", "sight", "sight_against"):
            if len(getattr(self, name)) > MAX_SPANS:
                raise _error(name, f"at most {MAX_SPANS}", len(getattr(self, name)))
        for span in (*self.centre_line_spans, *self.speed_limit_spans, *self.zones):
            check_batch(span, "course of a road")  # The call above does not look into tuples.
            if not span.start < span.stop:
                raise _error("stretch", "start before stop", f"{span.start:g} to {span.stop:g} m")
        _check_order("centre_line_spans", self.centre_line_spans)
        for direction in (1, -1):
            _check_order("speed_limit_spans", self.speed_limits_for(direction))
        for name in ("sight", "sight_against", "grade"):
            _check_station_table(name, getattr(self, name))
        _check_segments(self.segments)

    def mirror(self) -> Self:
        """The course of the same road in a world where left and right are swapped.

        Only bends change. Centre lines, speed limits, zones and sight distances refer to lanes and
        directions of travel, which are swapped with the road itself.
        """
        return dataclasses.replace(
            self, segments=tuple(segment.mirror() for segment in self.segments)
        )

    def sight_at(self, s: ArrayLike, direction: int = 1) -> F64:
        """Sight distance that the fields `sight` and `sight_against` state, never a computed one.

        Args:
            s: Stations of drivers, any shape [m].
            direction: Their direction of travel, +1 or -1.

        Returns:
            Distances of the same shape, infinite if the field of this direction is empty [m].
        """
        pairs = self.sight if direction > 0 else self.sight_against
        if not pairs:
            return np.full(np.shape(s), np.inf)
        return StationTable.from_pairs(pairs).value_at(s)

    def speed_limits_for(self, direction: int) -> tuple[SpeedLimitSpan, ...]:
        """The spans with a lower limit that apply to a direction of travel, +1 or -1."""
        return tuple(span for span in self.speed_limit_spans if span.direction in (0, direction))

    def zones_for(self, direction: int) -> tuple[RoadZone, ...]:
        """The zones that apply to a direction of travel, +1 or -1."""
        return tuple(zone for zone in self.zones if zone.direction in (0, direction))


def _check_order(name: str, spans: Sequence[CentreLineSpan] | Sequence[SpeedLimitSpan]) -> None:
    """Raise ConfigError for spans that overlap or are not in ascending order."""
    for span, next_span in pairwise(spans):
        if span.stop > next_span.start:
            overlap = f"one to {span.stop:g} m, then one from {next_span.start:g} m"
            raise _error(name, "in order, without overlap", overlap)


def _check_station_table(name: str, table: Sequence[tuple[float, float]]) -> None:
    """Raise ConfigError for pairs of sight or grade out of range or out of order."""
    for s, value in table:
        if name == "grade":
            is_in_range, bounds = abs(value) <= MAX_GRADE, f"{-MAX_GRADE:g} to {MAX_GRADE:g}"
            entry = f"{value:g} at {s:g} m"
        else:
            is_in_range = 0.0 < value <= MAX_SIGHT
            bounds = f"more than 0 and at most {MAX_SIGHT:g} m"
            entry = f"{value:g} m at {s:g} m"
        if not (0.0 <= s <= MAX_LENGTH and is_in_range):  # Also true for NaN.
            raise _error(name, f"0 to {MAX_LENGTH:g} m, and {bounds}", entry)
    if not all(s < next_s for (s, _), (next_s, _) in pairwise(table)):
        raise _error(name, "stations in order", ", ".join(f"{s:g}" for s, _ in table))


def _check_segments(segments: Sequence[CurveSegment]) -> None:
    """Raise ConfigError for a reference line with too many segments or an invalid segment."""
    if len(segments) > MAX_SEGMENTS:
        raise _error("segments", f"at most {MAX_SEGMENTS}", len(segments))
    for segment in segments:  # A tuple of position, heading, length and both curvatures.
        if not (all(map(math.isfinite, segment)) and segment.length > 0.0):
            raise _error("segments", "finite numbers and positive lengths", segment)
        # Curvature is linear along a segment, so its largest value is at one of the ends.
        max_curvature = max(abs(segment.curvature), abs(segment.end_curvature))
        if max_curvature > MAX_CURVATURE:
            expected = f"bends of at least {1.0 / MAX_CURVATURE:g} m radius"
            raise _error("segments", expected, f"{1.0 / max_curvature:.2f} m")


def _error(what: str, expected: str, got: object) -> ConfigError:
    return ConfigError(
        what=what,
        where="course of a road",
        expected=expected,
        got=got,
        next_step="correct the road",
    )


class MarkChange(NamedTuple):
    """A station at which the mark of a line changes.

    Attributes:
        station: Station of the change; minus infinity for the first mark of the line [m].
        mark: The mark from there to the next change.
    """

    station: float
    mark: RoadMark


def marks_along(spans: Sequence[CentreLineSpan], default_mark: RoadMark) -> tuple[MarkChange, ...]:
    """The line between the directions along the whole road.

    Args:
        spans: Spans of the line, in order, without overlap.
        default_mark: The mark before, between and after the spans.

    Returns:
        The changes of the mark in order of their stations; each mark differs from the previous one.
    """
    candidates = [MarkChange(-math.inf, default_mark)]
    for span in spans:
        if candidates[-1].station == span.start:  # No default mark: the previous span ends here.
            candidates.pop()
        candidates += [MarkChange(span.start, span.mark), MarkChange(span.stop, default_mark)]
    changes = candidates[:1]
    for candidate in candidates[1:]:
        if candidate.mark is not changes[-1].mark:  # Else the mark stays the same.
            changes.append(candidate)
    return tuple(changes)
