"""Changes along a road: bends, grades, centre line, zones, speed limits and sight distance.

Stations belong to the road: `s` grows in the direction of its driving lanes, also in tables for
drivers of the other direction. Directions are +1 along `s` and -1 against it, as in `Lane`.
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

MAX_LENGTH = 100_000.0  # A float64 position then still resolves far below the recorded centimetre.
MAX_SIGHT = 10_000.0
MAX_SPANS = 1_000
MAX_SEGMENTS = 20_000
MAX_CURVATURE = 0.1  # A radius of 10 m; sharper bends are no place to overtake.
MAX_GRADE = 0.2  # The steepest public roads come near a third, main roads hardly above a tenth.
_STATION = FieldSpec(unit="m", low=0.0, high=MAX_LENGTH)
MAX_SPEED_LIMIT = 100.0


class StationTable(NamedTuple):
    """A quantity by station: linear between the stations, constant before and behind them.

    Attributes:
        station: Stations in ascending order, shape (station,), at least one [m].
        value: The quantity at each of them, shape (station,).
    """

    station: F64
    value: F64

    @classmethod
    def from_pairs(cls, pairs: Sequence[tuple[float, float]]) -> Self:
        """The table of at least one pair (station, value)."""
        return cls._make(np.array(pairs, np.float64).T)

    @property
    def change_per_metre(self) -> F64:
        """Change of the quantity behind each station, shape (station,); 0 behind the last."""
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
    """The line painted between two lanes, spelled as `carla.LaneMarkingType` spells it.

    Of the double lines the first word names the line nearer to the lane that the mark belongs to,
    so the two lanes that share such a line see it with the words swapped: `reversed`.
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
    """Kind of a zone; in the last three a sign forbids to overtake."""

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
    """A stretch of road with a feature that rules refer to.

    Attributes:
        kind: The feature. A bend has reduced visibility; a narrow road is too narrow to pass on.
        start: Where it begins [m].
        stop: Where it ends, behind `start` [m].
        direction: Direction of travel that it counts for: +1, -1, or 0 for both.
    """

    kind: ZoneKind
    start: Annotated[float, _STATION]
    stop: Annotated[float, _STATION]
    direction: Annotated[int, FieldSpec(low=-1, high=1)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class CentreLineSpan:
    """A stretch of the line between the directions.

    Attributes:
        start: Where it begins [m].
        stop: Where it ends, behind `start` [m].
        mark: The line, seen from the driving lanes of the road; `mark.reverse` is the same line,
            seen from the other direction.
    """

    start: Annotated[float, _STATION]
    stop: Annotated[float, _STATION]
    mark: RoadMark


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimitSpan:
    """A stretch of road with a speed limit of its own.

    Attributes:
        start: Where it begins [m].
        stop: Where it ends, behind `start` [m].
        speed: Limit that is posted there [m/s].
        direction: Direction of travel that it counts for: +1, -1, or 0 for both.
    """

    start: Annotated[float, _STATION]
    stop: Annotated[float, _STATION]
    speed: Annotated[float, FieldSpec(unit="m/s", low=0.0, high=MAX_SPEED_LIMIT, low_is_open=True)]
    direction: Annotated[int, FieldSpec(low=-1, high=1)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadCourse:
    """Changes along a road.

    Attributes:
        segments: Segments of the reference line, joined end to start; empty for a straight road.
            Beyond its ends the line is straight.
        grade: Slope of the road by station: pairs (s, rise per metre) in order of s, linear in
            between and constant beyond; empty for a level road.
        centre_line_spans: Spans of the line between the directions, in order, without overlap.
            Elsewhere the mark of the driving lane beside that line holds.
        speed_limit_spans: Spans with a limit below `Road.speed_limit`, which applies elsewhere, in
            order of `start`, without overlap in one direction of travel.
        zones: Zones, in any order; they may overlap.
        sight: Sight distance of a driver along `s`, by station: pairs (s, distance) in order of s,
            linear in between and constant beyond [m]. Empty if the road does not limit sight.
        sight_against: The same for a driver in the other direction.

    Raises:
        ConfigError: A span is empty, spans or stations are not in order, or a bend or grade
            is beyond `MAX_CURVATURE` [1/m] or `MAX_GRADE`.
    """

    segments: tuple[CurveSegment, ...] = ()
    grade: tuple[tuple[float, float], ...] = ()
    centre_line_spans: tuple[CentreLineSpan, ...] = ()
    speed_limit_spans: tuple[SpeedLimitSpan, ...] = ()
    zones: tuple[RoadZone, ...] = ()
    sight: tuple[tuple[float, float], ...] = ()
    sight_against: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        """Refuse fields out of order or out of range."""
        check_batch(self, "course of a road")
        for name in ("centre_line_spans", "speed_limit_spans", "zones", "sight", "sight_against"):
            if len(getattr(self, name)) > MAX_SPANS:
                raise _error(name, f"at most {MAX_SPANS}", len(getattr(self, name)))
        for span in (*self.centre_line_spans, *self.speed_limit_spans, *self.zones):
            check_batch(span, "course of a road")
            if not span.start < span.stop:
                raise _error("stretch", "start before stop", f"{span.start:g} to {span.stop:g} m")
        _check_order("centre_line_spans", self.centre_line_spans)
        for direction in (1, -1):
            _check_order("speed_limit_spans", self.speed_limits_for(direction))
        for name in ("sight", "sight_against", "grade"):
            _check_station_table(name, getattr(self, name))
        _check_segments(self.segments)

    def mirror(self) -> Self:
        """The same in a world where left and right are swapped.

        Centre lines, speed limits, zones and sight stay the same, because they refer to lanes and
        not to left or right.
        """
        return dataclasses.replace(
            self, segments=tuple(segment.mirror() for segment in self.segments)
        )

    def sight_at(self, s: ArrayLike, direction: int = 1) -> F64:
        """Sight distance along the road.

        Args:
            s: Position of the driver, any shape [m].
            direction: +1 along the road, -1 against it.

        Returns:
            Distances of the same shape, infinite where the road does not limit sight [m].
        """
        pairs = self.sight if direction > 0 else self.sight_against
        if not pairs:
            return np.full(np.shape(s), np.inf)
        return StationTable.from_pairs(pairs).value_at(s)

    def speed_limits_for(self, direction: int) -> tuple[SpeedLimitSpan, ...]:
        """The spans with a lower limit for a direction of travel, +1 or -1."""
        return tuple(span for span in self.speed_limit_spans if span.direction in (0, direction))

    def zones_for(self, direction: int) -> tuple[RoadZone, ...]:
        """The zones for a direction of travel, +1 or -1."""
        return tuple(zone for zone in self.zones if zone.direction in (0, direction))


def _check_order(name: str, spans: Sequence[CentreLineSpan] | Sequence[SpeedLimitSpan]) -> None:
    """Refuse spans that overlap or are not in order."""
    for span, next_span in pairwise(spans):
        if span.stop > next_span.start:
            overlap = f"one to {span.stop:g} m, then one from {next_span.start:g} m"
            raise _error(name, "in order, without overlap", overlap)


def _check_station_table(name: str, table: Sequence[tuple[float, float]]) -> None:
    """Refuse a table of sight or grade with invalid values, or with stations out of order."""
    for s, value in table:
        if name == "grade":
            fits, bounds = abs(value) <= MAX_GRADE, f"{-MAX_GRADE:g} to {MAX_GRADE:g}"
            entry = f"{value:g} at {s:g} m"
        else:
            fits, bounds = 0.0 < value <= MAX_SIGHT, f"more than 0 and at most {MAX_SIGHT:g} m"
            entry = f"{value:g} m at {s:g} m"
        if not (0.0 <= s <= MAX_LENGTH and fits):  # Also true for NaN.
            raise _error(name, f"0 to {MAX_LENGTH:g} m, and {bounds}", entry)
    if not all(s < next_s for (s, _), (next_s, _) in pairwise(table)):
        raise _error(name, "stations in order", ", ".join(f"{s:g}" for s, _ in table))


def _check_segments(segments: Sequence[CurveSegment]) -> None:
    """Refuse a reference line with too many segments, or with an invalid one."""
    if len(segments) > MAX_SEGMENTS:
        raise _error("segments", f"at most {MAX_SEGMENTS}", len(segments))
    for segment in segments:
        if not (all(map(math.isfinite, segment)) and segment.length > 0.0):
            raise _error("segments", "finite numbers and positive lengths", segment)
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
    """Start of a mark along a line.

    Attributes:
        station: Where the mark begins, minus infinity for the first one [m].
        mark: The mark from there on.
    """

    station: float
    mark: RoadMark


def marks_along(spans: Sequence[CentreLineSpan], otherwise: RoadMark) -> tuple[MarkChange, ...]:
    """The line between the directions from end to end.

    Args:
        spans: Spans of the line, in order, without overlap.
        otherwise: The mark between them, before them and behind them.

    Returns:
        The changes of the mark in order; each mark differs from the one before.
    """
    starts = [MarkChange(-math.inf, otherwise)]
    for span in spans:
        if starts[-1].station == span.start:  # The previous span ends here.
            starts.pop()
        starts += [MarkChange(span.start, span.mark), MarkChange(span.stop, otherwise)]
    changes = starts[:1]
    for change in starts[1:]:
        if change.mark is not changes[-1].mark:
            changes.append(change)
    return tuple(changes)
