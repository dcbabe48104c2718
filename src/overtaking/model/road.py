"""Roads: lanes, geometry, and conversion between road, world and file coordinates.

A `Road` is a stretch of road whose driving lanes all run the same way. It may have one further lane
on each side of them, a neighbour: a hard shoulder, or the opposing lane of a two-way road.
`model.known_roads` and the readers of map files make roads; scenarios, simulators and the rules of
the law read them. Invalid roads are refused when they are made.

```
  overtaking side   d = lane_boundaries[n]   -------------------------  left_mark of lanes[n-1]
                                              lanes[n-1]     travel -->      (right-hand traffic)
                    d = lane_boundaries[1]   - - - - - - - - - - - - -
                                              lanes[0]          s -->
        kerb side   d = lane_boundaries[0]   -------------------------  right_mark of lanes[0]
```

Road coordinates are the station `s`, the distance along the reference line in the direction of
travel, and the offset `d` to the left of that line, in right-hand and in left-hand traffic [m]. The
reference line is straight, or has the bends of `course` (`model.reference_line`). World coordinates
`x` and `y` are a plane with `y` to the left of `x`.

Lanes are counted from the kerb side to the overtaking side: from right to left in right-hand
traffic, where `overtaking_sign` is +1, and from left to right in left-hand traffic, where it is -1.
A mark is the line painted at the edge of a lane (`RoadMark`). `course` holds everything that
changes along the road, such as bends, grades and speed limits (`model.road_course`).
"""

import dataclasses
import enum
import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_batch
from overtaking.model.reference_line import CurveSegment, Points, ReferenceLine, cos_sin
from overtaking.model.road_course import (
    MAX_LENGTH,
    MAX_SPEED_LIMIT,
    MarkChange,
    RoadCourse,
    RoadMark,
    StationTable,
    marks_along,
)

MAX_LANES = 8
"""Most driving lanes of a road. Simulators hold parameters of lanes in arrays of this length."""

MIN_LANE_WIDTH, MAX_LANE_WIDTH = 2.0, 6.0
"""Limits of the width of a driving lane [m]. A car does not fit into a narrower lane, and two cars
fit side by side into a wider one."""

MAX_NEIGHBOUR_WIDTH = 100.0
"""Largest width of a lane beside the driving lanes [m]. Chosen: wider than the shoulders, verges
and parking strips of map files."""

MAX_COORDINATE = 1.8e6
"""Largest x0 and y0 of a road [m]. World positions are int32 millimetres, and the simulators clip
them at 2000 km. A road of at most 100 km (`MAX_LENGTH`) that begins here ends before that."""

MAX_ORIGIN = 1.0e8
"""Largest coordinate of the world's origin in a file [m]. Chosen: beyond the coordinates of every
map projection of the Earth."""

MAX_CURVATURE_TIMES_OFFSET = 0.5
"""Largest |curvature * d| of the edges of the driving lanes [1]. Chosen: lanes extend to at most
half the radius of a bend. Near the centre of the bend, where the product is 1, one world position
has many coordinates s and d."""


@lru_cache(maxsize=16)
def _reference_line(segments: tuple[CurveSegment, ...]) -> ReferenceLine:
    """The line of these segments; all callers share its arrays.

    A `Road` cannot store the line, because it is frozen and the line is not a field. The cache
    holds the lines of 16 roads; chosen: more than a program uses at a time.
    """
    return ReferenceLine.from_segments(segments)


_COORDINATE = FieldSpec(unit="m", low=-MAX_COORDINATE, high=MAX_COORDINATE)
_ORIGIN = FieldSpec(unit="m", low=-MAX_ORIGIN, high=MAX_ORIGIN)


class DrivingSide(enum.Enum):
    """The side of the road that traffic keeps to."""

    RIGHT = "right"
    LEFT = "left"

    @property
    def opposite(self) -> "DrivingSide":
        """The other side."""
        return DrivingSide.LEFT if self is DrivingSide.RIGHT else DrivingSide.RIGHT


@dataclass(frozen=True, slots=True, kw_only=True)
class Lane:
    """One lane of a road: a driving lane, or a neighbour beside the driving lanes.

    Attributes:
        lane_id: Id of the lane in the map format OpenDRIVE: negative ids lie to the right of the
            file's reference line, positive ids to its left; 0 is the line itself.
        width: Width, the same along the whole road [m].
        kind: OpenDRIVE's lane type: "driving", "shoulder", "border", ...
        direction: Direction of its traffic: +1 along the road's `s`, also for shoulders, or -1
            against it, on the opposing lane; never 0.
        right_mark: Line on its right in the road's direction of travel, as seen from this lane: in
            a double mark such as `SOLID_BROKEN` the first word names the line nearer to the lane.
        left_mark: Line on its left in the road's direction of travel, as seen from this lane.

    Raises:
        ConfigError: A value is of another type or out of range.
    """

    lane_id: Annotated[int, FieldSpec(low=-32768, high=32767)]  # Tables hold it in 16 bits.
    width: Annotated[
        float, FieldSpec(unit="m", low=0.0, high=MAX_NEIGHBOUR_WIDTH, low_is_open=True)
    ]
    kind: str = "driving"
    direction: Annotated[int, FieldSpec(low=-1, high=1)] = 1
    right_mark: RoadMark
    left_mark: RoadMark

    def __post_init__(self) -> None:
        """Refuse fields of another type or out of range; `check_batch` accepts any dataclass."""
        check_batch(self, f"lane {self.lane_id}")

    def mirror(self) -> Self:
        """The lane in a world where left and right are swapped.

        Its id changes sign, because it lies on the other side of the file's reference line.
        """
        return dataclasses.replace(
            self, lane_id=-self.lane_id, right_mark=self.left_mark, left_mark=self.right_mark
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Road:
    """A stretch of road whose driving lanes run in one direction and are the same along all of it.

    Attributes:
        name: Name, for people and for the manifests of data sets.
        kind: OpenDRIVE's road type: "motorway", "rural", "town", ...
        driving_side: Side that traffic keeps to.
        lanes: Driving lanes, from the kerb side to the overtaking side, 1 to `MAX_LANES`.
        kerb_edge_d: `d` of the edge of `lanes[0]` on the kerb side [m].
        length: Length of the stretch along the reference line [m].
        x0: World x of the start of the reference line, (s, d) = (0, 0) [m].
        y0: World y of the same point [m].
        heading: Direction of travel at that point, anticlockwise from the world x axis, within one
            turn of zero [rad].
        speed_limit: Limit that is posted for the road, in both directions, outside the stretches
            with a lower limit (`RoadCourse.speed_limit_spans`) [m/s].
        origin_x: x of the world's origin in the file that the road comes from [m]. Not 0 for files
            with large coordinates, such as UTM: recorded positions are int32 millimetres, which
            could not hold them.
        origin_y: y of the same point [m].
        kerb_side_neighbour: Lane beside `lanes[0]`, such as a hard shoulder; None if the road ends
            there.
        overtaking_side_neighbour: Lane beside `lanes[-1]`, the opposing lane of a two-way road;
            None if the road ends there.
        course: Changes along the road; None for a straight and level road with the same marks and
            speed limit everywhere.

    Raises:
        ConfigError: A value is outside the model's range.
    """

    name: str
    kind: str
    driving_side: DrivingSide
    lanes: tuple[Lane, ...]
    kerb_edge_d: Annotated[float, _COORDINATE]
    length: Annotated[float, FieldSpec(unit="m", low=0.0, high=MAX_LENGTH, low_is_open=True)]
    x0: Annotated[float, _COORDINATE]
    y0: Annotated[float, _COORDINATE]
    heading: Annotated[float, FieldSpec(unit="rad", low=-math.tau, high=math.tau)]
    speed_limit: Annotated[
        float, FieldSpec(unit="m/s", low=0.0, high=MAX_SPEED_LIMIT, low_is_open=True)
    ]
    origin_x: Annotated[float, _ORIGIN] = 0.0
    origin_y: Annotated[float, _ORIGIN] = 0.0
    kerb_side_neighbour: Lane | None = None
    overtaking_side_neighbour: Lane | None = None
    course: RoadCourse | None = None

    def __post_init__(self) -> None:
        """Refuse roads outside the model's range."""
        check_batch(self, f"road {self.name}")  # Types and ranges of the fields.
        self._check_lanes()
        self._check_course()

    @property
    def num_lanes(self) -> int:
        """Number of driving lanes."""
        return len(self.lanes)

    @property
    def overtaking_sign(self) -> float:
        """+1.0 if `d` grows from kerb to overtaking side (right-hand traffic), -1.0 if it falls.

        It is a float because it is a factor of offsets.
        """
        return 1.0 if self.driving_side is DrivingSide.RIGHT else -1.0

    @property
    def is_two_way(self) -> bool:
        """Whether the neighbour on the overtaking side is a driving lane of the other direction."""
        neighbour = self.overtaking_side_neighbour
        return neighbour is not None and neighbour.kind == "driving" and neighbour.direction == -1

    @property
    def overtaking_edge_marks(self) -> tuple[MarkChange, ...]:
        """Marks of the line on the overtaking side of `lanes[-1]`, as seen from that lane.

        On a two-way road this is the line between the directions, which may change along the road.

        Returns:
            Pairs of a station and the mark that begins there, in order; the first station is minus
            infinity.
        """
        last = self.lanes[-1]
        is_right_hand = self.driving_side is DrivingSide.RIGHT
        default_mark = last.left_mark if is_right_hand else last.right_mark
        return marks_along(self.course.centre_line_spans if self.course else (), default_mark)

    @property
    def lane_boundaries(self) -> F64:
        """`d` of the lane boundaries from kerb to overtaking side, shape (lane + 1,) [m]."""
        boundaries = [self.kerb_edge_d]
        for lane in self.lanes:
            boundaries.append(boundaries[-1] + self.overtaking_sign * lane.width)
        return np.array(boundaries, dtype=np.float64)

    @property
    def lane_centres(self) -> F64:
        """`d` of the lane centres from kerb to overtaking side, shape (lane,) [m]."""
        boundaries = self.lane_boundaries
        return (boundaries[:-1] + boundaries[1:]) * 0.5

    @property
    def segments(self) -> tuple[CurveSegment, ...]:
        """Segments of the reference line (straight, arcs, clothoids); empty for a straight road."""
        return self.course.segments if self.course else ()

    @property
    def is_curved(self) -> bool:
        """Whether the reference line has segments; without segments it is straight."""
        return bool(self.segments)

    def heading_at(self, s: ArrayLike) -> F64:
        """Direction of the reference line, anticlockwise from the world x axis [rad].

        Args:
            s: Station, any shape [m].

        Returns:
            Angles of the same shape.
        """
        if self.is_curved:
            return _reference_line(self.segments).heading_at(s)
        return np.full(np.shape(s), self.heading)

    def curvature_at(self, s: ArrayLike) -> F64:
        """Change of the direction of the reference line per metre, positive in left bends [1/m].

        Args:
            s: Station, any shape [m].

        Returns:
            Curvatures of the same shape.
        """
        if self.is_curved:
            return _reference_line(self.segments).pose_at(s).curvature
        return np.zeros(np.shape(s))

    def grade_at(self, s: ArrayLike) -> F64:
        """Slope of the road: rise per metre, positive where it rises along `s` [1].

        Args:
            s: Station, any shape [m].

        Returns:
            Slopes of the same shape.
        """
        pairs = self.course.grade if self.course else ()  # Stations [m] and slopes, by station.
        if not pairs:
            return np.zeros(np.shape(s))
        return StationTable.from_pairs(pairs).value_at(s)

    def speed_limit_at(self, s: ArrayLike, direction: int = 1) -> F64:
        """The posted speed limit [m/s].

        At a station where one limit ends and another begins, the limit of the higher stations
        applies. Spans of one direction do not overlap.

        Args:
            s: Station, any shape [m].
            direction: Direction of travel, +1 along `s` or -1 against it.

        Returns:
            Limits of the same shape.
        """
        station = np.asarray(s, np.float64)
        limits = np.full(station.shape, self.speed_limit)
        for span in self.course.speed_limits_for(direction) if self.course else ():
            limits[(span.start <= station) & (station < span.stop)] = span.speed
        return limits

    def height_at(self, s: ArrayLike) -> F64:
        """Height above the start of the road [m], the integral of the slope.

        Args:
            s: Station, any shape [m].

        Returns:
            Heights of the same shape.
        """
        station = np.asarray(s, np.float64)
        grade = (self.course or RoadCourse()).grade
        # 0.0 is the start of the road, where the height is 0; no knot has a smaller station.
        knots = np.array(sorted({0.0, *(knot for knot, _ in grade)}))
        slopes = self.grade_at(knots)
        # The slope is linear between knots, so trapezoids are its exact integral.
        rises = 0.5 * (slopes[1:] + slopes[:-1]) * np.diff(knots)
        heights = np.concatenate([[0.0], np.cumsum(rises)])
        # The last knot at or before each station; for stations before the road, the first knot.
        previous = np.clip(np.searchsorted(knots, station, side="right") - 1, 0, None)
        rise = 0.5 * (slopes[previous] + self.grade_at(station)) * (station - knots[previous])
        return heights[previous] + rise

    def to_world(self, s: ArrayLike, d: ArrayLike) -> Points:
        """Convert road coordinates to world coordinates.

        Args:
            s: Station, any shape [m].
            d: Offset to the left, a shape that broadcasts with `s` [m].

        Returns:
            World x and y, of the common shape [m].
        """
        if self.is_curved:
            return _reference_line(self.segments).to_world(s, d)
        along, left = np.asarray(s, dtype=np.float64), np.asarray(d, dtype=np.float64)
        cosine, sine = cos_sin(self.heading)
        # The parentheses fix the order of rounding, on which recorded positions depend.
        return Points(
            self.x0 + (along * cosine - left * sine),
            self.y0 + (along * sine + left * cosine),
        )

    def to_road(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Convert world coordinates to road coordinates; the inverse of `to_world`.

        Args:
            x: World x, any shape [m].
            y: World y, a shape that broadcasts with `x` [m].

        Returns:
            s and d of the common shape [m].
        """
        if self.is_curved:
            return _reference_line(self.segments).to_road(x, y)
        dx = np.asarray(x, dtype=np.float64) - self.x0
        dy = np.asarray(y, dtype=np.float64) - self.y0
        cosine, sine = cos_sin(self.heading)
        return dx * cosine + dy * sine, dy * cosine - dx * sine

    def to_source(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Convert world coordinates to coordinates of the file that the road comes from.

        Args:
            x: World x, any shape [m].
            y: World y, same shape [m].

        Returns:
            x and y in the file, of the same shape [m].
        """
        return (
            np.asarray(x, dtype=np.float64) + self.origin_x,
            np.asarray(y, dtype=np.float64) + self.origin_y,
        )

    def from_source(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Convert coordinates of the file that the road comes from to world coordinates.

        Args:
            x: x in the file, any shape [m].
            y: y in the file, same shape [m].

        Returns:
            World x and y, of the same shape [m].
        """
        return (
            np.asarray(x, dtype=np.float64) - self.origin_x,
            np.asarray(y, dtype=np.float64) - self.origin_y,
        )

    def lane_index(self, d: ArrayLike) -> NDArray[np.int64]:
        """Index into `lanes` of the lane that contains a point.

        A point on a boundary is in the lane on its overtaking side.

        Args:
            d: Offset to the left, any shape [m].

        Returns:
            Integers of the same shape: -1 beyond the edge on the kerb side, and `num_lanes` on the
            edge on the overtaking side and beyond it.
        """
        # `searchsorted` requires ascending boundaries; without the sign they descend in left-hand
        # traffic.
        sign = self.overtaking_sign
        offset = sign * np.asarray(d, dtype=np.float64)
        return np.searchsorted(sign * self.lane_boundaries, offset, side="right") - 1

    def check_straight(self, where: str) -> None:
        """Refuse a road with bends or grades.

        Args:
            where: The part of the package that handles straight and level roads only.

        Raises:
            ConfigError: The road bends or rises.
        """
        if self.course and (self.course.segments or self.course.grade):
            raise ConfigError(
                what=f"road {self.name}",
                where=where,
                expected="a straight and level one",
                got="one that bends or rises",
                next_step="choose another road",
            )

    def check_one_speed_limit(self, where: str) -> None:
        """Refuse a road with several speed limits.

        Args:
            where: The part of the package that handles one speed limit per road.

        Raises:
            ConfigError: The speed limit changes along the road.
        """
        if self.course and self.course.speed_limit_spans:
            raise ConfigError(
                what=f"road {self.name}",
                where=where,
                expected="one limit from end to end",
                got=f"another one from {self.course.speed_limit_spans[0].start:g} m on",
                next_step="choose another road",
            )

    def mirror(self) -> Self:
        """The road in a world where left and right are swapped: d, y and heading change sign.

        For any point, `mirror().to_world(s, -d)` has the bits of `(x, -y)`, so recordings can be
        mirrored without rounding. Mirroring twice gives an equal road.
        """
        kerb_side, overtaking_side = self.kerb_side_neighbour, self.overtaking_side_neighbour
        return dataclasses.replace(
            self,
            driving_side=self.driving_side.opposite,
            lanes=tuple(lane.mirror() for lane in self.lanes),
            kerb_edge_d=-self.kerb_edge_d,
            y0=-self.y0,
            origin_y=-self.origin_y,
            heading=-self.heading,
            kerb_side_neighbour=kerb_side.mirror() if kerb_side else None,
            overtaking_side_neighbour=overtaking_side.mirror() if overtaking_side else None,
            course=self.course and self.course.mirror(),
        )

    def extend_to(self, length: float) -> Self:
        """The same road with a straight continuation at its end, so that vehicles can drive on.

        The last values of `course`, such as the grade, hold on the continuation; zones and spans
        end where they ended.

        Args:
            length: Length of the new road, at least the length of this one [m].

        Raises:
            ConfigError: The length is less than the length of this road.
        """
        if not length >= self.length:  # Also true for NaN.
            raise self._error("extended length", f"at least {self.length:g} m", f"{length:g} m")
        return dataclasses.replace(self, length=length)

    def _error(self, what: str, expected: str, got: str) -> ConfigError:
        """The error for an invalid part of this road; `ConfigError` explains the arguments."""
        return ConfigError(
            what=what,
            where=f"road {self.name}",
            expected=expected,
            got=got,
            next_step="correct the road",
        )

    def _check_lanes(self) -> None:
        """Refuse invalid driving lanes, equal ids, and contradicting marks of adjacent lanes."""
        if not 1 <= self.num_lanes <= MAX_LANES:
            raise self._error("driving lanes", f"1 to {MAX_LANES}", str(self.num_lanes))
        ids = [lane.lane_id for lane in self.lanes]
        if len(set(ids)) < self.num_lanes:
            raise self._error("lane ids", "a different one for each lane", str(ids))
        for lane in self.lanes:
            self._check_driving_lane(lane)
        for lane, next_lane in pairwise(self.lanes):
            # Two lanes see the line between them from its two sides.
            mark, next_mark = lane.left_mark, next_lane.right_mark
            if self.driving_side is DrivingSide.LEFT:
                mark, next_mark = lane.right_mark, next_lane.left_mark
            if mark is not next_mark.reverse:
                raise self._error(
                    f"line between lanes {lane.lane_id} and {next_lane.lane_id}",
                    f"{mark.reverse.value} from the second as it is {mark.value} from the first",
                    next_mark.value,
                )

    def _check_course(self) -> None:
        """Refuse a course that contradicts the length, the limit or the lanes of the road.

        The course has already checked itself.
        """
        course = self.course
        if course is None:
            return
        spans = (*course.centre_line_spans, *course.speed_limit_spans, *course.zones)
        stations = [span.stop for span in spans]
        stations += [s for s, _ in (*course.sight, *course.sight_against, *course.grade)]
        if stations and max(stations) > self.length:
            expected = f"at most {self.length:g} m, the length of the road"
            raise self._error("course", expected, f"{max(stations):g} m")
        # A span is by definition a stretch with a lower limit, so an equal limit is an error, too.
        limits = [span.speed for span in course.speed_limit_spans]
        if limits and max(limits) >= self.speed_limit:
            expected = f"below {self.speed_limit:g} m/s, the limit of the road"
            raise self._error("speed_limit_spans", expected, f"{max(limits):g} m/s")
        directed_spans = (*course.speed_limit_spans, *course.zones)
        is_for_oncoming = bool(course.centre_line_spans or course.sight_against) or any(
            span.direction < 0 for span in directed_spans
        )
        if is_for_oncoming and not self.is_two_way:
            expected = "oncoming traffic: a driving lane with direction -1 on the overtaking side"
            raise self._error("course", expected, "lines or sight for it, and no such lane")
        if course.segments:
            self._check_reference_line(course.segments)

    def _check_reference_line(self, segments: tuple[CurveSegment, ...]) -> None:
        """Refuse segments that begin elsewhere than the road, or are too sharp for its lanes."""
        # Equal to the last bit: readers of maps take x0, y0 and heading from the first segment.
        start = (segments[0].x, segments[0].y, segments[0].heading)
        if start != (self.x0, self.y0, self.heading):
            raise self._error(
                "start of the line",
                f"x0, y0, heading: {self.x0}, {self.y0}, {self.heading}",
                str(start),
            )
        max_curvature = _reference_line(segments).max_curvature
        max_offset = max(abs(self.kerb_edge_d), abs(float(self.lane_boundaries[-1])))
        if max_curvature * max_offset >= MAX_CURVATURE_TIMES_OFFSET:
            raise self._error(
                "bend",
                f"lanes within {MAX_CURVATURE_TIMES_OFFSET:g} of its radius from the reference "
                "line",
                f"an edge {max_offset:.1f} m beside it in a bend of {1.0 / max_curvature:.1f} m",
            )

    def _check_driving_lane(self, lane: Lane) -> None:
        """Refuse a driving lane with an invalid width, type or direction."""
        if not MIN_LANE_WIDTH <= lane.width <= MAX_LANE_WIDTH:  # Also true for NaN.
            raise self._error(
                f"width of lane {lane.lane_id}",
                f"{MIN_LANE_WIDTH:g} to {MAX_LANE_WIDTH:g} m",
                f"{lane.width:g} m",
            )
        if lane.kind != "driving" or lane.direction != 1:
            raise self._error(
                f"lane {lane.lane_id}",
                "a 'driving' lane with direction 1; others can only be neighbours",
                f"{lane.kind!r} with direction {lane.direction}",
            )
