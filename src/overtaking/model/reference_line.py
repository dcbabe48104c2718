"""Reference lines of roads with bends, and conversion between road and world coordinates.

A road (`model.road`) and readers of map files use a `ReferenceLine` to convert the road coordinates
s (distance along the line) and d (offset to its left) to x and y in the plane, and back. The line
consists of segments: straight lines, arcs and clothoids.

The curvature of a segment changes linearly along it. Let h be the heading and k the curvature at
its start, and c the change of curvature per metre. After t metres the heading is
h + k t + c t^2 / 2, and the displacement is the integral of its cosine and sine over t. The
integral has no closed form; Gauss-Legendre quadrature with eight nodes (Abramowitz and Stegun,
Handbook of Mathematical Functions, table 25.4) computes it. Segments are split so that each turns
by at most one radian, and then the error of the quadrature is a rounding error.

World coordinates are recorded, and recordings must have the same bits on every machine. Therefore
the code uses only operations that IEEE 754 rounds correctly (+, -, *, /, remainder, rounding to
integers), in a fixed order, and computes cosine and sine by them: the last bit of library functions
differs between systems.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overtaking.core.arrays import F64
from overtaking.core.equality import ContentEquality

_HALF_PI = math.pi / 2.0

# Coefficients of the Taylor series, highest power first: of sin(x) / x and of cos(x) in x^2. On
# [-pi/4, pi/4] the first omitted term is below 1e-19, less than the rounding of float64.
_SINE = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(19, 0, -2))
_COSINE = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(18, -1, -2))

# The four positive nodes on [-1, 1] and their weights; the negative nodes have the same weights.
_NODES = (0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363)
_WEIGHTS = (0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763)

_QUADRATURE = tuple(
    (0.5 + 0.5 * sign * node, 0.5 * weight)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True)
    for sign in (-1.0, 1.0)
)
"""All eight nodes with their weights, mapped to the interval [0, 1]."""

_MAX_TURN = 1.0
"""Largest turn of a segment [rad]. Beyond it, eight nodes do not reach the rounding of float64."""

_SAMPLE_SPACING = 10.0
"""Spacing of the points of the line from which the search for the nearest point starts [m]. Chosen:
in the sharpest bend that a road may have (10 m radius, `MAX_CURVATURE` of `model.road_course`) the
line turns by one radian in between."""

_MIN_DENOMINATOR = 0.1
"""Lower bound of 1 - curvature * d, by which Newton's step in `ReferenceLine.to_road` divides. The
expression is 0 at the centre of a bend, where d, the offset to the left, is the radius 1 /
curvature. Driving lanes reach to half the radius (`model.road`), where it is 0.5, so the bound has
no effect on them."""

_NUM_NEWTON_STEPS = 8
"""Each step doubles the number of correct digits. Chosen: four steps reach a micrometre on a road,
so eight leave a reserve."""

_MAX_PAIRS_IN_MEMORY = 1_000_000
"""Most distances from a point to a sample of the line that are in memory at a time. Chosen: 8 MB
for each of the few arrays of this size."""


class Points(NamedTuple):
    """Points in the plane, or displacements between points.

    Attributes:
        x: World x, any shape [m].
        y: World y, whose axis points to the left of the x axis, the same shape [m].
    """

    x: F64
    y: F64


class Pose(NamedTuple):
    """Points of a line with its direction and curvature; every array has the same shape.

    Attributes:
        x: World x [m].
        y: World y [m].
        heading: Direction of the line, anticlockwise from the x axis; not limited to one turn
            [rad].
        curvature: Change of the heading per metre, positive in left bends [1/m].
    """

    x: F64
    y: F64
    heading: F64
    curvature: F64


class CurveSegment(NamedTuple):
    """A part of a line: straight, an arc (equal curvatures) or a clothoid (different curvatures).

    Attributes:
        x: World x of its start [m].
        y: World y of its start [m].
        heading: Direction at its start, anticlockwise from the x axis [rad].
        length: Length, positive [m].
        curvature: Curvature at its start, positive in left bends [1/m].
        end_curvature: Curvature at its end; in between it changes linearly [1/m].
    """

    x: float
    y: float
    heading: float
    length: float
    curvature: float = 0.0
    end_curvature: float = 0.0

    def reverse(self) -> "CurveSegment":
        """The same segment in the other direction, from its end to its start."""
        # A line splits segments that turn by more than one radian, as the quadrature demands.
        end = ReferenceLine.from_segments([self]).pose_at(self.length)
        return CurveSegment(
            x=float(end.x),
            y=float(end.y),
            # Half a turn is added. Reduced to [-pi, pi], the heading does not grow if a segment is
            # reversed again; the error of `cos_sin` grows with the number of turns.
            heading=math.remainder(float(end.heading) + math.pi, math.tau),
            length=self.length,
            # A left bend is a right bend in the other direction.
            curvature=-self.end_curvature,
            end_curvature=-self.curvature,
        )

    def mirror(self) -> "CurveSegment":
        """The segment in a world whose y axis is reversed, so that left and right are swapped."""
        return CurveSegment(
            self.x, -self.y, -self.heading, self.length, -self.curvature, -self.end_curvature
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceLine(ContentEquality):
    """A line of segments; `from_segments` makes it. `==` compares the content of the arrays.

    Before its start and beyond its end the line goes on straight, so that vehicles there have
    coordinates, too. All arrays have shape (segment,).

    Attributes:
        segment_start: Distance along the line to the start of each segment, in ascending order [m].
        x: World x at the start of each segment [m].
        y: World y at the start of each segment [m].
        heading: Direction at the start of each segment, anticlockwise from the x axis [rad].
        curvature: Curvature at the start of each segment [1/m].
        curvature_rate: Change of the curvature per metre along each segment [1/m^2].
        length: Length of the line [m].
    """

    segment_start: F64
    x: F64
    y: F64
    heading: F64
    curvature: F64
    curvature_rate: F64
    length: float

    @classmethod
    def from_segments(cls, segments: Sequence[CurveSegment]) -> Self:
        """Make a line of segments, and split those that turn by more than one radian.

        Args:
            segments: Segments in order, at least one, which the caller ensures. Each keeps its own
                start, as map files state it; whether it begins at the end of the previous one is
                not checked.
        """
        parts = [part for segment in segments for part in _split_by_turn(segment)]
        lengths = [part.length for part in parts]
        # `np.cumsum` adds in order, `np.sum` in pairs, so `length` can differ by rounding from the
        # end of the last segment. Both orders are fixed; another would change recorded lengths.
        return cls(
            segment_start=np.cumsum([0.0, *lengths[:-1]]),
            x=np.array([part.x for part in parts]),
            y=np.array([part.y for part in parts]),
            heading=np.array([part.heading for part in parts]),
            curvature=np.array([part.curvature for part in parts]),
            curvature_rate=np.array(
                [(part.end_curvature - part.curvature) / part.length for part in parts]
            ),
            length=float(np.sum(lengths)),
        )

    @property
    def max_curvature(self) -> float:
        """The largest absolute value of the curvature [1/m]."""
        lengths = np.diff([*self.segment_start, self.length])
        # The curvature is linear along a segment, so its extremes are at the ends of segments.
        end_curvature = self.curvature + self.curvature_rate * lengths
        return float(np.maximum(np.abs(self.curvature), np.abs(end_curvature)).max())

    def pose_at(self, s: ArrayLike) -> Pose:
        """Points of the line with direction and curvature.

        Args:
            s: Distance along the line, any shape; negative before its start [m].

        Returns:
            Position, heading and curvature, each of the same shape.
        """
        segment, t, overrun = self._locate(s)
        k, c = self.curvature[segment], self.curvature_rate[segment]
        displacement = segment_displacement(self.heading[segment], k, c, t)
        heading = self.heading_at(s)
        cosine, sine = cos_sin(heading)
        return Pose(
            x=self.x[segment] + displacement.x + overrun * cosine,
            y=self.y[segment] + displacement.y + overrun * sine,
            heading=heading,
            curvature=np.where(overrun == 0.0, k + c * t, 0.0),  # Straight beyond the ends.
        )

    def heading_at(self, s: ArrayLike) -> F64:
        """Direction of the line, anticlockwise from the x axis [rad].

        It is the heading of `pose_at`, computed without the positions.

        Args:
            s: Distance along the line, any shape [m].

        Returns:
            Angles of the same shape.
        """
        segment, t, _ = self._locate(s)
        return self.heading[segment] + t * (
            self.curvature[segment] + 0.5 * self.curvature_rate[segment] * t
        )

    def _locate(self, s: ArrayLike) -> tuple[NDArray[np.intp], F64, F64]:
        """Find the segments in which distances along the line lie.

        Args:
            s: Distance along the line, any shape [m].

        Returns:
            Three arrays of the same shape: the index of the segment, the distance from the start of
            the segment [m], and the distance beyond the end of the line (positive), before its
            start (negative), or 0 on the line [m].
        """
        station = np.asarray(s, dtype=np.float64)
        on_line = np.clip(station, 0.0, self.length)
        segment = np.searchsorted(self.segment_start, on_line, side="right") - 1
        return segment, on_line - self.segment_start[segment], station - on_line

    def to_world(self, s: ArrayLike, d: ArrayLike) -> Points:
        """Convert road coordinates to world coordinates.

        Args:
            s: Distance along the line, any shape [m].
            d: Offset to its left, at a right angle, a shape that broadcasts with `s` [m].

        Returns:
            World x and y, of the common shape [m].
        """
        pose = self.pose_at(s)
        cosine, sine = cos_sin(pose.heading)
        left = np.asarray(d, dtype=np.float64)
        return Points(pose.x - left * sine, pose.y + left * cosine)

    def to_road(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Convert world coordinates to road coordinates; the inverse of `to_world`.

        A point inside a bend may lie at a right angle to the line at several stations. The search
        starts at the nearest of some samples of the line, which are at most 10 m apart, and
        Newton's method refines it, so the result is the station near that sample.

        Args:
            x: World x, any shape [m].
            y: World y, a shape that broadcasts with `x` [m].

        Returns:
            s and d, of the common shape [m].
        """
        east, north = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        s = self._start_of_search(east.ravel(), north.ravel()).reshape(east.shape)
        for _ in range(_NUM_NEWTON_STEPS):
            ahead, left, curvature = self._offset_from(s, east, north)
            # The root has `ahead` = 0; per metre of s, `ahead` falls by 1 - curvature * left.
            s = s + ahead / np.maximum(1.0 - curvature * left, _MIN_DENOMINATOR)
        return s, self._offset_from(s, east, north)[1]

    def _offset_from(self, s: F64, x: F64, y: F64) -> tuple[F64, F64, F64]:
        """Offsets of world points from points of the line, in the direction of the line.

        Args:
            s: Distance along the line to its points [m].
            x: World x of the other points, same shape [m].
            y: World y of the other points, same shape [m].

        Returns:
            Distance ahead of the point of the line [m], distance to its left [m], and curvature of
            the line there [1/m], same shape.
        """
        pose = self.pose_at(s)
        cosine, sine = cos_sin(pose.heading)
        east, north = x - pose.x, y - pose.y
        return east * cosine + north * sine, north * cosine - east * sine, pose.curvature

    def _start_of_search(self, x: F64, y: F64) -> F64:
        """Distances along the line from which Newton's method converges, shape (point,) [m].

        Args:
            x: World x, shape (point,) [m].
            y: World y, shape (point,) [m].
        """
        num_samples = max(2, math.ceil(self.length / _SAMPLE_SPACING) + 1)
        samples = np.linspace(0.0, self.length, num_samples)
        line = self.pose_at(samples)
        num_points = max(1, _MAX_PAIRS_IN_MEMORY // len(samples))
        nearest = np.empty(len(x), np.intp)
        for first in range(0, len(x), num_points):
            points = slice(first, first + num_points)
            squared_distance = (x[points, None] - line.x) ** 2 + (y[points, None] - line.y) ** 2
            nearest[points] = np.argmin(squared_distance, axis=1)
        s = samples[nearest]
        # A point before the start or beyond the end of the line belongs to its straight
        # continuation, where the distance ahead is exact.
        ahead = self._offset_from(s, x, y)[0]
        is_before = (nearest == 0) & (ahead < 0.0)
        is_beyond = (nearest == len(samples) - 1) & (ahead > 0.0)
        return np.where(is_before | is_beyond, s + ahead, s)


def _split_by_turn(segment: CurveSegment) -> list[CurveSegment]:
    """The same segment as parts of equal length that each turn by at most one radian."""
    rate = (segment.end_curvature - segment.curvature) / segment.length
    # An upper bound of the turn, as if the largest curvature held along the whole segment.
    max_turn = segment.length * max(abs(segment.curvature), abs(segment.end_curvature))
    num_parts = max(1, math.ceil(max_turn / _MAX_TURN))
    length = segment.length / num_parts
    x, y, heading, curvature = segment.x, segment.y, segment.heading, segment.curvature
    parts = []
    for number in range(1, num_parts + 1):
        end_curvature = segment.curvature + rate * (length * number)
        parts.append(CurveSegment(x, y, heading, length, curvature, end_curvature))
        # The end of the last part is not needed. Most segments have one part, so this condition
        # saves most of the quadratures.
        if number < num_parts:
            displacement = segment_displacement(
                *map(np.asarray, (heading, curvature, rate, length))
            )
            x, y = x + float(displacement.x), y + float(displacement.y)
            heading += length * (curvature + 0.5 * rate * length)
            curvature = end_curvature
    return parts


def segment_displacement(heading: F64, k: F64, c: F64, t: F64) -> Points:
    """Displacement from the start of a segment to the point after `t` metres.

    The integral of cos and sin of heading + k u + c u^2 / 2 over u from 0 to t, by Gauss-Legendre
    quadrature with eight nodes (Abramowitz and Stegun, table 25.4). It takes arrays, one entry for
    each segment or point; readers of map files use it, too.

    Args:
        heading: Direction at the start, any shape [rad].
        k: Curvature at the start, same shape [1/m].
        c: Change of the curvature per metre, same shape [1/m^2].
        t: Distance from the start, same shape; the segment turns by at most one radian over it [m].

    Returns:
        Displacements in world x and y, same shape [m].
    """
    # Means of cosine and sine over the way, which times the way are the displacements.
    mean_cosine, mean_sine = np.zeros_like(t), np.zeros_like(t)
    for node, weight in _QUADRATURE:
        u = node * t
        cosine, sine = cos_sin(heading + u * (k + 0.5 * c * u))
        mean_cosine, mean_sine = mean_cosine + weight * cosine, mean_sine + weight * sine
    return Points(t * mean_cosine, t * mean_sine)


def cos_sin(heading: ArrayLike) -> tuple[F64, F64]:
    """Cosine and sine, with the same bits on every machine.

    `np.cos` and `np.sin` differ between systems in the last bit.

    Args:
        heading: Angles, any shape [rad]. Within ten turns of 0 the error is below 1e-14; it grows
            with the number of turns, because pi / 2 is rounded.

    Returns:
        Cosine and sine, each of the same shape.
    """
    angle = np.asarray(heading, dtype=np.float64)
    # Reduce each angle to [-pi/4, pi/4], where the Taylor series converge fast, and turn the result
    # back by the quarter turns that were subtracted.
    quarter_turns = np.rint(angle / _HALF_PI)
    remainder = angle - quarter_turns * _HALF_PI
    square = remainder * remainder
    cosine, sine = _polynomial(_COSINE, square), remainder * _polynomial(_SINE, square)
    quarter = quarter_turns.astype(np.int64) & 3  # 0 to 3, also for negative angles.
    return (
        np.choose(quarter, (cosine, -sine, -cosine, sine)),
        np.choose(quarter, (sine, cosine, -sine, -cosine)),
    )


def _polynomial(coefficients: tuple[float, ...], argument: F64) -> F64:
    """Value of a polynomial by Horner's rule; the first coefficient has the highest power."""
    total = np.zeros_like(argument)
    for coefficient in coefficients:
        total = total * argument + coefficient
    return total
