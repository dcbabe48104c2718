"""A stretch of road whose driving lanes all run the same way, and what is beside them.

```
  overtaking side   d = lane_boundaries[n]   -------------------------  left_mark of lanes[n-1]
                                              lanes[n-1]     travel -->      (right-hand traffic)
                    d = lane_boundaries[1]   - - - - - - - - - - - - -
                                              lanes[0]          s -->
        kerb side   d = lane_boundaries[0]   -------------------------  right_mark of lanes[0]
```

`s` grows along the direction of travel and `d` to the left of it, in either kind of traffic; on a
road with bends, both refer to its reference line (`model.reference_line`), where `d` is 0.
Lanes are counted from the kerb side to the overtaking side: from right to left in right-hand
traffic, where `overtaking_sign` is +1, and from left to right in left-hand traffic, where it is -1.
On a two-way road the neighbour on the overtaking side is the opposing lane. `course` holds
everything that changes along the road.
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
MIN_LANE_WIDTH, MAX_LANE_WIDTH = 2.0, 6.0  # Beyond these a car does not fit, or two do.
MAX_NEIGHBOUR_WIDTH = 100.0
MAX_COORDINATE = 1.8e6
"""Largest x0 and y0 of a road [m]. World positions are int32 millimetres, which the engines clip at
2000 km; a road of at most 100 km that begins here ends before."""

MAX_ORIGIN = 1.0e8  # Wider than any map projection of the Earth in metres.
MAX_CURVATURE_TIMES_OFFSET = (
    0.5  # |curvature * d|: nearer to the centre of a bend s and d lose their meaning.
)


@lru_cache(maxsize=16)
def _reference_line(segments: tuple[CurveSegment, ...]) -> ReferenceLine:
    """The line of these segments; all callers share its arrays."""
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
    """One lane of a road.

    Attributes:
        lane_id: OpenDRIVE's id: 0 is the centre line, negative ids lie to the right of the file's
            reference line, positive ones to its left.
        width: Width, the same along the whole road [m].
        kind: OpenDRIVE's lane type: "driving", "shoulder", "border", ...
        direction: +1 if its traffic runs along the road's `s`, -1 if it comes the other way.
        right_mark: Line on its right, seen in the road's direction of travel.
        left_mark: Line on its left, seen in the road's direction of travel.

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
        """Refuse invalid lanes."""
        check_batch(self, f"lane {self.lane_id}")

    def mirror(self) -> Self:
        """The lane in a world where left and right are swapped."""
        return dataclasses.replace(
            self, lane_id=-self.lane_id, right_mark=self.left_mark, left_mark=self.right_mark
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Road:
    """A stretch of road of one direction, with the same lanes along all of it.

    Attributes:
        name: Name, for people and manifests.
        kind: OpenDRIVE's road type: "motorway", "rural", "town", ...
        driving_side: Side that traffic keeps to.
        lanes: Driving lanes, from the kerb side to the overtaking side.
        kerb_edge_d: `d` of the edge of `lanes[0]` on the kerb side [m].
        length: Length of the stretch along the reference line [m].
        x0: World x of (s=0, d=0), right-handed, y to the left of x, as in OpenDRIVE [m].
        y0: World y of (s=0, d=0) [m].
        heading: Direction of travel there, anticlockwise from world x, within one turn of zero
            [rad].
        speed_limit: Limit that is posted for the driving lanes, on a road with
            `RoadCourse.speed_limit_spans` the highest one [m/s].
        origin_x: x of the world's origin in the file that the road comes from [m]. It is not 0 for
            files with large coordinates, such as UTM, whose millimetres exceed the recorded
            integers.
        origin_y: y of the same point [m].
        kerb_side_neighbour: Lane beside `lanes[0]`, such as a hard shoulder, or None.
        overtaking_side_neighbour: Lane beside `lanes[-1]`, or None.
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
        check_batch(self, f"road {self.name}")
        self._check_lanes()
        self._check_course()

    @property
    def num_lanes(self) -> int:
        """Number of driving lanes."""
        return len(self.lanes)

    @property
    def overtaking_sign(self) -> float:
        """+1.0 if `d` grows from kerb to overtaking side (right-hand traffic), -1.0 if it falls."""
        return 1.0 if self.driving_side is DrivingSide.RIGHT else -1.0

    @property
    def is_two_way(self) -> bool:
        """Whether the neighbour on the overtaking side is an opposing lane."""
        neighbour = self.overtaking_side_neighbour
        return neighbour is not None and neighbour.kind == "driving" and neighbour.direction == -1

    @property
    def overtaking_edge_marks(self) -> tuple[MarkChange, ...]:
        """The line on the overtaking side of `lanes[-1]`: where each mark begins.

        The marks are those seen from `lanes[-1]`. The first begins at minus infinity.
        """
        last = self.lanes[-1]
        mark = last.left_mark if self.driving_side is DrivingSide.RIGHT else last.right_mark
        return marks_along(self.course.centre_line_spans if self.course else (), mark)

    @property
    def lane_boundaries(self) -> F64:
        """`d` of the lane boundaries from kerb to overtaking side, shape (lane + 1,) [m]."""
        borders = [self.kerb_edge_d]
        for lane in self.lanes:
            borders.append(borders[-1] + self.overtaking_sign * lane.width)
        return np.array(borders, dtype=np.float64)

    @property
    def lane_centres(self) -> F64:
        """`d` of the lane centres from kerb to overtaking side, shape (lane,) [m]."""
        borders = self.lane_boundaries
        return (borders[:-1] + borders[1:]) * 0.5

    @property
    def segments(self) -> tuple[CurveSegment, ...]:
        """The segments of the reference line; empty for a straight road."""
        return self.course.segments if self.course else ()

    @property
    def is_curved(self) -> bool:
        """Whether the reference line has segments; without segments it is straight."""
        return bool(self.segments)

    def heading_at(self, s: ArrayLike) -> F64:
        """Direction of the road, anticlockwise from world x [rad].

        Args:
            s: Station, any shape [m].
        """
        if self.is_curved:
            return _reference_line(self.segments).heading_at(s)
        return np.full(np.shape(s), self.heading)

    def curvature_at(self, s: ArrayLike) -> F64:
        """Change of the direction of the reference line, positive in left bends [1/m].

        Args:
            s: Station, any shape [m].
        """
        if self.is_curved:
            return _reference_line(self.segments).pose_at(s).curvature
        return np.zeros(np.shape(s))

    def grade_at(self, s: ArrayLike) -> F64:
        """Slope of the road, positive where it rises along `s`.

        Args:
            s: Station, any shape [m].
        """
        pairs = self.course.grade if self.course else ()
        if not pairs:
            return np.zeros(np.shape(s))
        return StationTable.from_pairs(pairs).value_at(s)

    def speed_limit_at(self, s: ArrayLike, direction: int = 1) -> F64:
        """The posted limit [m/s].

        Where one span ends and another begins, the limit of the second applies.

        Args:
            s: Station, any shape [m].
            direction: Direction of travel, +1 along `s` or -1 against it.
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
        """
        station = np.asarray(s, np.float64)
        knots = np.array(
            sorted({0.0, *(s_knot for s_knot, _ in (self.course or RoadCourse()).grade)})
        )
        slopes = self.grade_at(knots)
        steps = 0.5 * (slopes[1:] + slopes[:-1]) * np.diff(knots)
        heights = np.concatenate([[0.0], np.cumsum(steps)])
        last = np.clip(np.searchsorted(knots, station, side="right") - 1, 0, None)
        rise = 0.5 * (slopes[last] + self.grade_at(station)) * (station - knots[last])
        return heights[last] + rise

    def to_world(self, s: ArrayLike, d: ArrayLike) -> Points:
        """World coordinates of points on the road.

        Args:
            s: Position along the road, any shape [m].
            d: Offset to the left, a shape that broadcasts with it [m].

        Returns:
            x and y in the right-handed world frame [m].
        """
        if self.is_curved:
            return _reference_line(self.segments).to_world(s, d)
        along, left = np.asarray(s, dtype=np.float64), np.asarray(d, dtype=np.float64)
        cosine, sine = cos_sin(self.heading)
        return Points(
            self.x0 + (along * cosine - left * sine),
            self.y0 + (along * sine + left * cosine),
        )

    def to_road(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Road coordinates (s, d) of world points [m]; the inverse of `to_world`."""
        if self.is_curved:
            return _reference_line(self.segments).to_road(x, y)
        east = np.asarray(x, dtype=np.float64) - self.x0
        north = np.asarray(y, dtype=np.float64) - self.y0
        cosine, sine = cos_sin(self.heading)
        return east * cosine + north * sine, north * cosine - east * sine

    def to_source(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Coordinates (x, y) of world points in the file that the road comes from [m].

        Args:
            x: World x, any shape [m].
            y: World y, same shape [m].
        """
        return (
            np.asarray(x, dtype=np.float64) + self.origin_x,
            np.asarray(y, dtype=np.float64) + self.origin_y,
        )

    def from_source(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """World coordinates (x, y) of points that are given in the coordinates of the file [m]."""
        return (
            np.asarray(x, dtype=np.float64) - self.origin_x,
            np.asarray(y, dtype=np.float64) - self.origin_y,
        )

    def lane_index(self, d: ArrayLike) -> NDArray[np.int64]:
        """Index into `lanes` of the lane that a point lies in.

        A boundary belongs to the lane on its overtaking side. The result is -1 beyond the kerb-side
        edge, and `num_lanes` on the last boundary and beyond it.

        Args:
            d: Offset to the left, any shape [m].

        Returns:
            Integers of the same shape.
        """
        offset = self.overtaking_sign * np.asarray(d, dtype=np.float64)
        return (
            np.searchsorted(self.overtaking_sign * self.lane_boundaries, offset, side="right") - 1
        )

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

        `mirror().to_world(s, -d)` is `(x, -y)` bit for bit; mirroring twice gives an equal road.
        """
        slow, fast = self.kerb_side_neighbour, self.overtaking_side_neighbour
        return dataclasses.replace(
            self,
            driving_side=self.driving_side.opposite,
            lanes=tuple(lane.mirror() for lane in self.lanes),
            kerb_edge_d=-self.kerb_edge_d,
            y0=-self.y0,
            origin_y=-self.origin_y,
            heading=-self.heading,
            kerb_side_neighbour=slow.mirror() if slow else None,
            overtaking_side_neighbour=fast.mirror() if fast else None,
            course=self.course and self.course.mirror(),
        )

    def extend_to(self, length: float) -> Self:
        """The same road, with a straight continuation up to a length of `length` [m].

        Raises:
            ConfigError: `length` is shorter than the road is.
        """
        if not length >= self.length:  # Also true for NaN.
            raise self._error("extended length", f"at least {self.length:g} m", f"{length:g} m")
        return dataclasses.replace(self, length=length)

    def _error(self, what: str, expected: str, got: str) -> ConfigError:
        return ConfigError(
            what=what,
            where=f"road {self.name}",
            expected=expected,
            got=got,
            next_step="correct the road",
        )

    def _check_lanes(self) -> None:
        if not 1 <= self.num_lanes <= MAX_LANES:
            raise self._error("driving lanes", f"1 to {MAX_LANES}", str(self.num_lanes))
        ids = [lane.lane_id for lane in self.lanes]
        if len(set(ids)) < self.num_lanes:
            raise self._error("lane ids", "a different one for each lane", str(ids))
        for lane in self.lanes:
            self._check_driving_lane(lane)
        for slower, faster in pairwise(self.lanes):
            near, far = slower.left_mark, faster.right_mark
            if self.driving_side is DrivingSide.LEFT:
                near, far = slower.right_mark, faster.left_mark
            if near is not far.reverse:
                raise self._error(
                    f"line between lanes {slower.lane_id} and {faster.lane_id}",
                    f"{near.reverse.value} from the second as it is {near.value} from the first",
                    far.value,
                )

    def _check_course(self) -> None:
        course = self.course
        if course is None:
            return
        spans = (*course.centre_line_spans, *course.speed_limit_spans, *course.zones)
        stations = [span.stop for span in spans]
        stations += [s for s, _ in (*course.sight, *course.sight_against, *course.grade)]
        if stations and max(stations) > self.length:
            length = f"at most {self.length:g} m, the length of the road"
            raise self._error("course", length, f"{max(stations):g} m")
        above = [span.speed for span in course.speed_limit_spans if span.speed >= self.speed_limit]
        if above:
            lower = f"below {self.speed_limit:g} m/s, the limit of the road"
            raise self._error("speed_limit_spans", lower, f"{max(above):g} m/s")
        directed = (*course.speed_limit_spans, *course.zones)
        against = course.sight_against or [span for span in directed if span.direction < 0]
        if not self.is_two_way and (course.centre_line_spans or against):
            lane = "oncoming traffic: a driving lane with direction -1 on the overtaking side"
            raise self._error("course", lane, "lines or sight for it, and no such lane")
        if course.segments:
            self._check_line(course.segments)

    def _check_line(self, line: tuple[CurveSegment, ...]) -> None:
        start = (line[0].x, line[0].y, line[0].heading)
        if start != (self.x0, self.y0, self.heading):
            raise self._error(
                "start of the line",
                f"x0, y0, heading: {self.x0}, {self.y0}, {self.heading}",
                str(start),
            )
        sharpest = _reference_line(line).max_curvature
        widest = max(abs(self.kerb_edge_d), abs(float(self.lane_boundaries[-1])))
        if not sharpest * widest < MAX_CURVATURE_TIMES_OFFSET:
            raise self._error(
                "bend",
                f"lanes within {MAX_CURVATURE_TIMES_OFFSET:g} of its radius from the reference "
                "line",
                f"an edge {widest:.1f} m beside it in a bend of {1.0 / sharpest:.1f} m",
            )

    def _check_driving_lane(self, lane: Lane) -> None:
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
