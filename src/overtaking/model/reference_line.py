"""Reference lines in the plane, whose segments are straight lines, arcs and clothoids.

The curvature of a segment changes linearly along it. With the heading h and the curvature k at its
start, and the change of curvature c along it, the heading after t metres is h + k t + c t^2 / 2.
The position is the integral of its cosine and sine, by Gauss-Legendre quadrature with eight nodes
(Abramowitz and Stegun, Handbook of Mathematical Functions, table 25.4). Segments are split until
each turns by one radian at most; the error then is a rounding error. The code adds, multiplies and
divides float64 in a fixed order only, so every machine computes the same bits.
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
_SINE = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(19, 0, -2))
_COSINE = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(18, -1, -2))
_NODES = (0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363)
_WEIGHTS = (0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763)

_QUADRATURE = tuple(
    (0.5 + 0.5 * sign * node, 0.5 * weight)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True)
    for sign in (-1.0, 1.0)
)
"""Nodes and weights of the unit interval."""
_MAX_TURN = 1.0  # Beyond this, eight nodes no longer reach the rounding of float64 [rad].
_SPACING = 10.0  # Between the points among which the nearest one is looked for [m].
_MIN_DENOMINATOR = 0.1  # Newton's step for a point near the centre of a bend is bounded by this.
_ITERATIONS = 8  # Newton's method doubles the digits; four steps reach a micrometre on a road.
_MAX_PAIRS_IN_MEMORY = 1_000_000  # Distances that are held in memory at a time.


class Points(NamedTuple):
    """Points, or displacements, in the plane.

    Attributes:
        x: World x, any shape [m].
        y: World y, to the left of x, the same shape [m].
    """

    x: F64
    y: F64


class Pose(NamedTuple):
    """Points of a line; every array has the same shape.

    Attributes:
        x: World coordinate [m].
        y: World coordinate, to the left of x [m].
        heading: Direction of the line, anticlockwise from x [rad].
        curvature: Change of the heading, positive in left bends [1/m].
    """

    x: F64
    y: F64
    heading: F64
    curvature: F64


class CurveSegment(NamedTuple):
    """A straight line, an arc or a clothoid.

    Attributes:
        x: World coordinate of its start [m].
        y: World coordinate of its start [m].
        heading: Direction at its start [rad].
        length: Length [m].
        curvature: Curvature at its start [1/m].
        end_curvature: Curvature at its end [1/m].
    """

    x: float
    y: float
    heading: float
    length: float
    curvature: float = 0.0
    end_curvature: float = 0.0

    def reverse(self) -> "CurveSegment":
        """The same segment in the other direction, from its end to its start."""
        end = ReferenceLine.from_segments([self]).pose_at(self.length)
        heading = math.remainder(float(end.heading) + math.pi, math.tau)
        place = (float(end.x), float(end.y), heading, self.length)
        return CurveSegment(*place, -self.end_curvature, -self.curvature)

    def mirror(self) -> "CurveSegment":
        """The segment in a world where left and right are swapped."""
        return CurveSegment(
            self.x, -self.y, -self.heading, self.length, -self.curvature, -self.end_curvature
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceLine(ContentEquality):
    """A line of segments; arrays have shape (segment,).

    Before its start and beyond its end the line goes on straight.

    Attributes:
        segment_start: Distance along the line to the start of each segment [m].
        x: World coordinate at the start of each segment [m].
        y: World coordinate at the start of each segment [m].
        heading: Direction there [rad].
        curvature: Curvature there [1/m].
        curvature_rate: Change of the curvature along each segment [1/m^2].
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
        """The line of one or more segments of positive length, each at its own world position."""
        short = [part for segment in segments for part in _split_by_turn(segment)]
        lengths = [part.length for part in short]
        return cls(
            segment_start=np.cumsum([0.0, *lengths[:-1]]),
            x=np.array([part.x for part in short]),
            y=np.array([part.y for part in short]),
            heading=np.array([part.heading for part in short]),
            curvature=np.array([part.curvature for part in short]),
            curvature_rate=np.array(
                [(part.end_curvature - part.curvature) / part.length for part in short]
            ),
            length=float(np.sum(lengths)),
        )

    @property
    def max_curvature(self) -> float:
        """The largest curvature, of either sign, positive [1/m]."""
        lengths = np.diff([*self.segment_start, self.length])
        ends = self.curvature + self.curvature_rate * lengths
        return float(np.maximum(np.abs(self.curvature), np.abs(ends)).max())

    def pose_at(self, s: ArrayLike) -> Pose:
        """Points of the line.

        Args:
            s: Distance along the line, any shape [m].
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
            curvature=np.where(overrun == 0.0, k + c * t, 0.0),
        )

    def heading_at(self, s: ArrayLike) -> F64:
        """Direction of the line, anticlockwise from x, without the quadrature of `pose_at` [rad].

        Args:
            s: Distance along the line, any shape [m].
        """
        segment, t, _ = self._locate(s)
        return self.heading[segment] + t * (
            self.curvature[segment] + 0.5 * self.curvature_rate[segment] * t
        )

    def _locate(self, s: ArrayLike) -> tuple[NDArray[np.intp], F64, F64]:
        """The segment of each point, the distance along it, and beyond the line [m]."""
        station = np.asarray(s, dtype=np.float64)
        on_line = np.clip(station, 0.0, self.length)
        segment = np.searchsorted(self.segment_start, on_line, side="right") - 1
        return segment, on_line - self.segment_start[segment], station - on_line

    def to_world(self, s: ArrayLike, d: ArrayLike) -> Points:
        """World coordinates of points beside the line.

        Args:
            s: Distance along the line, any shape [m].
            d: Offset to its left, a shape that broadcasts with it [m].
        """
        pose = self.pose_at(s)
        cosine, sine = cos_sin(pose.heading)
        left = np.asarray(d, dtype=np.float64)
        return Points(pose.x - left * sine, pose.y + left * cosine)

    def to_road(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Distance along the line and offset from it; the inverse of `to_world`.

        Several points of the line may have the given point at a right angle. The search begins at
        the nearest of samples of the line every ten metres, and Newton's method refines it.

        Args:
            x: World coordinate, any shape [m].
            y: World coordinate, the same shape [m].

        Returns:
            s and d [m].
        """
        east, north = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        s = self._nearest(east.ravel(), north.ravel()).reshape(east.shape)
        for _ in range(_ITERATIONS):
            ahead, left, curvature = self._offset_from(s, east, north)
            s = s + ahead / np.maximum(1.0 - curvature * left, _MIN_DENOMINATOR)
        return s, self._offset_from(s, east, north)[1]

    def _offset_from(self, s: F64, x: F64, y: F64) -> tuple[F64, F64, F64]:
        """How far points lie ahead and to the left of points of the line, and the curvature."""
        pose = self.pose_at(s)
        cosine, sine = cos_sin(pose.heading)
        east, north = x - pose.x, y - pose.y
        return east * cosine + north * sine, north * cosine - east * sine, pose.curvature

    def _nearest(self, x: F64, y: F64) -> F64:
        """The nearest sample to each point, or its foot on the straight continuation."""
        samples = np.linspace(0.0, self.length, max(2, math.ceil(self.length / _SPACING) + 1))
        line = self.pose_at(samples)
        step = max(1, _MAX_PAIRS_IN_MEMORY // len(samples))
        nearest = np.empty(len(x), np.intp)
        for first in range(0, len(x), step):
            points = slice(first, first + step)
            squared_distance = (x[points, None] - line.x) ** 2 + (y[points, None] - line.y) ** 2
            nearest[points] = np.argmin(squared_distance, axis=1)
        s = samples[nearest]
        is_end = (nearest == 0) | (nearest == len(samples) - 1)
        ahead = self._offset_from(s, x, y)[0]
        is_outside = is_end & (np.where(nearest == 0, ahead, -ahead) < 0.0)
        return np.where(is_outside, s + ahead, s)


def _split_by_turn(segment: CurveSegment) -> list[CurveSegment]:
    """The same segment as parts that each turn by at most one radian."""
    rate = (segment.end_curvature - segment.curvature) / segment.length
    max_turn = segment.length * max(abs(segment.curvature), abs(segment.end_curvature))
    num_parts = max(1, math.ceil(max_turn / _MAX_TURN))
    length = segment.length / num_parts
    x, y, heading, curvature = segment.x, segment.y, segment.heading, segment.curvature
    parts = []
    for number in range(1, num_parts + 1):
        end_curvature = segment.curvature + rate * (length * number)
        parts.append(CurveSegment(x, y, heading, length, curvature, end_curvature))
        # Nothing starts at the end of the last part. Most segments have one part, so that this
        # saves most of the quadratures.
        if number < num_parts:
            start = map(np.asarray, (heading, curvature, rate, length))
            displacement = segment_displacement(*start)
            x, y = x + float(displacement.x), y + float(displacement.y)
            heading += length * (curvature + 0.5 * rate * length)
            curvature = end_curvature
    return parts


def segment_displacement(heading: F64, k: F64, c: F64, t: F64) -> Points:
    """Displacement from the start of a segment to the point after `t` metres.

    Args:
        heading: Direction at the start, any shape [rad].
        k: Curvature there [1/m].
        c: Its change along the segment [1/m^2].
        t: Distance along it, over which it turns by one radian at most [m].
    """
    east, north = np.zeros_like(t), np.zeros_like(t)
    for node, weight in _QUADRATURE:
        u = node * t
        cosine, sine = cos_sin(heading + u * (k + 0.5 * c * u))
        east, north = east + weight * cosine, north + weight * sine
    return Points(t * east, t * north)


def cos_sin(heading: ArrayLike) -> tuple[F64, F64]:
    """Cosine and sine of angles of at most some turns, with the same bits on every machine.

    The last bit of libm's differs between systems. These are Taylor series on [-pi/4, pi/4], where
    the first term left out is below 1e-19, in IEEE double additions and multiplications only.

    Args:
        heading: Angles, any shape [rad].
    """
    angle = np.asarray(heading, dtype=np.float64)
    turns = np.rint(angle / _HALF_PI)
    remainder = angle - turns * _HALF_PI
    square = remainder * remainder
    cosine, sine = _series(_COSINE, square), remainder * _series(_SINE, square)
    quarter = turns.astype(np.int64) & 3
    return (
        np.choose(quarter, (cosine, -sine, -cosine, sine)),
        np.choose(quarter, (sine, cosine, -sine, -cosine)),
    )


def _series(coefficients: tuple[float, ...], argument: F64) -> F64:
    """Polynomial with the highest power first, by Horner's rule."""
    total = np.zeros_like(argument)
    for coefficient in coefficients:
        total = total * argument + coefficient
    return total
