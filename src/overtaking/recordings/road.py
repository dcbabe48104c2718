"""A gently curved road as the straight one of the model: along and across its own lanes.

The road of a recording is given by the borders of its lanes as lines of points. A smooth line in
their middle is the reference: `s` runs along it, and offsets from it are measured square to it. The
model's lanes have constant widths, so an offset is scaled piecewise, from the borders where they
are at that `s` to the mean borders of the stretch: a vehicle on a line stays on it, and one
in the middle of a lane still is. A decision in `docs/adr` has the reasons, and what this costs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

GRID = 1.0
"""Spacing of the points at which the reference line and the borders are held [m]."""

SMOOTHING = 31
"""Points of the running mean that smooths the reference line; its borders stay as they are."""

MAX_TURN = 0.5
"""Largest angle between the reference line and its chord [rad]."""

MAX_STRETCH = 0.05
"""Largest part by which the way along a lane may differ from that along the reference line."""

MAX_WIDENING = 0.25
"""Largest part by which a lane may be wider or narrower than it is in the mean."""

_MARGIN = 200.0  # How far the reference line goes on straight beyond the borders [m].
_MIN_ADVANCE = 1.0e-6  # Shorter segments have no slope that a float64 can hold [m].
_MIN_NEWTON = 0.5  # Beyond the centre of a bend a point has no foot; on a road it is 0.95 or more.
_ITERATIONS = 6  # The error of Newton's method is below a micrometre after four.


class RoadShapeError(ValueError):
    """A road that no straight road with constant lanes stands for.

    Attributes:
        what: The thing that is wrong.
        expected: What would have been right.
        got: The value found.
    """

    def __init__(self, *, what: str, expected: str, got: str) -> None:
        """Note it, for a caller that knows the file."""
        super().__init__(f"{what}: expected {expected}, got {got}")
        self.what, self.expected, self.got = what, expected, got


@dataclass(frozen=True, slots=True, kw_only=True)
class Projection:
    """Points in the coordinates of a road; every array has the shape of the points.

    Attributes:
        s: Along the reference line [m].
        d: Across it, scaled to the lanes of constant width [m].
        offset: Across it, as measured [m].
        tangent: World direction of the reference line [rad].
        stretch: Way along the line through the point, over that along the reference line.
    """

    s: F64
    d: F64
    offset: F64
    tangent: F64
    stretch: F64


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceLine:
    """A smooth line along a road, as a function over its chord.

    Attributes:
        origin: World position at which the chord begins, shape (2,) [m].
        chord: Direction of the chord, anticlockwise from world x [rad].
        u: Points along the chord, shape (point,) [m].
        v: Offset of the line from the chord, same shape [m].
        slope: Its derivative, same shape.
        bend: Derivative of the slope, same shape [1/m].
        way: Length of the line up to each point, 0 where the road begins, same shape [m].
        length: Length of the road along the line [m].
    """

    origin: F64
    chord: float
    u: F64
    v: F64
    slope: F64
    bend: F64
    way: F64
    length: float

    @property
    def turn(self) -> float:
        """Largest angle between the line and its chord on the road [rad]."""
        on_road = (self.way >= 0.0) & (self.way <= self.length)
        return float(np.abs(np.arctan(self.slope[on_road])).max())

    @property
    def start(self) -> tuple[float, float]:
        """World position at which the road begins [m]."""
        u, v = (float(np.interp(0.0, self.way, line)) for line in (self.u, self.v))
        cosine, sine = np.cos(self.chord), np.sin(self.chord)
        x, y = self.origin
        return float(x + u * cosine - v * sine), float(y + u * sine + v * cosine)

    def foot(self, along: F64, across: F64) -> tuple[F64, F64, F64, F64]:
        """The foot of each point on the line, by Newton's method along the chord.

        Args:
            along: Positions along the chord, shape (point,) [m].
            across: Positions to its left, same shape [m].

        Returns:
            Way [m], offset [m], world direction [rad] and curvature [1/m] at each foot.
        """
        foot = along
        for _ in range(_ITERATIONS):
            v, slope, bend = (np.interp(foot, self.u, y) for y in (self.v, self.slope, self.bend))
            miss = (along - foot) + (across - v) * slope
            foot = foot + miss / np.maximum(1.0 + slope * slope - (across - v) * bend, _MIN_NEWTON)
        v, slope, bend = (np.interp(foot, self.u, y) for y in (self.v, self.slope, self.bend))
        secant = np.sqrt(1.0 + slope * slope)
        offset = ((across - v) - (along - foot) * slope) / secant
        way = np.interp(foot, self.u, self.way)
        return way, offset, self.chord + np.arctan(slope), bend / secant**3


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadShape:
    """The reference line of a road and the borders of its lanes.

    Attributes:
        line: The reference line.
        border_s: Points along it, shape (station,) [m].
        borders: Offsets of the borders there, from the right to the left, shape
            (station, lane + 1) [m].
        mean_borders: Borders of the straight road, shape (lane + 1,) [m].
    """

    line: ReferenceLine
    border_s: F64
    borders: F64
    mean_borders: F64

    def project(self, x: F64, y: F64) -> Projection:
        """World points in road coordinates."""
        points = _to_chord(np.stack([x, y], axis=1), self.line.origin, self.line.chord)
        s, offset, tangent, curvature = self.line.foot(*points.T)
        local = np.stack([np.interp(s, self.border_s, line) for line in self.borders.T], axis=-1)
        return Projection(
            s=s,
            d=scaled(offset, local, self.mean_borders),
            offset=offset,
            tangent=tangent,
            stretch=1.0 - curvature * offset,
        )

    @property
    def widening(self) -> float:
        """Largest part by which a lane is anywhere wider or narrower than in the mean."""
        widths, mean = np.diff(self.borders, axis=1), np.diff(self.mean_borders)
        return float(np.abs(widths / mean - 1.0).max())


def scaled(offset: F64, local: F64, mean: F64) -> F64:
    """Offsets across a road, moved from its borders to those of a road of other lane widths.

    Args:
        offset: Any shape [m].
        local: Borders from the right to the left where each point is, shape (..., lane + 1)
            [m].
        mean: Borders of the other road, shape (lane + 1,) [m].
    """
    lanes = len(mean) - 1
    lane = np.clip((offset[..., None] >= local).sum(axis=-1) - 1, 0, lanes - 1)
    low = np.take_along_axis(local, lane[..., None], -1)[..., 0]
    high = np.take_along_axis(local, lane[..., None] + 1, -1)[..., 0]
    factor = (mean[lane + 1] - mean[lane]) / (high - low)
    # Beyond the edges no widths are known: distances stay as they are.
    inside = mean[lane] + (offset - low) * factor
    beyond = np.where(offset < low, mean[lane] + offset - low, mean[lane + 1] + offset - high)
    return np.where((offset < low) | (offset > high), beyond, inside)


def shape_of(borders: list[F64]) -> RoadShape:
    """The shape of a road from the borders of its lanes.

    Args:
        borders: Lines of world points, each of shape (point, 2), in the direction of travel, from
            the right edge to the left edge [m].

    Raises:
        RoadShapeError: The road bends too much, or its lanes are not of nearly constant width.
    """
    begin, end = (np.mean([line[place] for line in borders], axis=0) for place in (0, -1))
    chord = float(np.arctan2(*(end - begin)[::-1]))
    turned = [_to_chord(line, begin, chord) for line in borders]
    first, last = (max(line[0, 0] for line in turned), min(line[-1, 0] for line in turned))
    if not last - first >= 10.0 * GRID:
        raise RoadShapeError(
            what="lanes",
            expected=f"{10.0 * GRID:g} m beside each other",
            got=f"{last - first:.3g} m",
        )
    grid = np.linspace(first, last, int(np.ceil((last - first) / GRID)) + 1)
    across = np.stack([_over(grid, line) for line in turned])
    u, v = _reference(grid, (across[0] + across[-1]) * 0.5)
    return _measured(_line(begin, chord, u, v, grid[[0, -1]]), grid, across)


def _to_chord(points: F64, origin: F64, chord: float) -> F64:
    """World points along and across the chord."""
    east, north = (points - origin).T
    cosine, sine = np.cos(chord), np.sin(chord)
    return np.stack([east * cosine + north * sine, north * cosine - east * sine], axis=1)


def _over(grid: F64, line: F64) -> F64:
    """A line of points as a function along the chord, without points that do not go ahead."""
    farthest = np.concatenate([[-np.inf], np.maximum.accumulate(line[:, 0])[:-1]])
    ahead = line[:, 0] > farthest + _MIN_ADVANCE
    return np.interp(grid, line[ahead, 0], line[ahead, 1])


def _reference(grid: F64, middle: F64) -> tuple[F64, F64]:
    """The smoothed middle, going on straight at both ends."""
    half = SMOOTHING // 2
    padded = np.concatenate([
        2.0 * middle[0] - _padding(middle, half)[::-1],
        middle,
        2.0 * middle[-1] - _padding(middle[::-1], half),
    ])  # fmt: skip
    v = np.convolve(padded, np.full(SMOOTHING, 1.0 / SMOOTHING), mode="valid")
    step = grid[1] - grid[0]
    more = np.arange(1, int(_MARGIN / step) + 1)
    before, after = (v[1] - v[0]), (v[-1] - v[-2])
    return (
        np.concatenate([grid[0] - more[::-1] * step, grid, grid[-1] + more * step]),
        np.concatenate([v[0] - more[::-1] * before, v, v[-1] + more * after]),
    )


def _padding(middle: F64, count: int) -> F64:
    """The points after the first, the last of them again where there are too few."""
    return middle[np.minimum(np.arange(1, count + 1), len(middle) - 1)]


def _line(origin: F64, chord: float, u: F64, v: F64, ends: F64) -> ReferenceLine:
    """The reference line through points over the chord; `ends` are those of the road on it."""
    slope = np.gradient(v, u)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(u), np.diff(v)))])
    begin, end = np.interp(ends, u, way)
    line = ReferenceLine(
        origin=origin,
        chord=chord,
        u=u,
        v=v,
        slope=slope,
        bend=np.gradient(slope, u),
        way=way - begin,
        length=float(end - begin),
    )
    if line.turn > MAX_TURN:
        raise RoadShapeError(
            what="bend", expected=f"at most {MAX_TURN:g} rad", got=f"{line.turn:.2f} rad"
        )
    return line


def _measured(line: ReferenceLine, grid: F64, across: F64) -> RoadShape:
    """The borders as offsets from the reference line, and their mean."""
    stations = np.linspace(0.0, line.length, int(np.ceil(line.length / GRID)) + 1)
    borders = np.empty((len(stations), len(across)))
    stretch = 0.0
    for k, border in enumerate(across):
        s, offset, _, curvature = line.foot(grid, border)
        borders[:, k] = np.interp(stations, s, offset)
        stretch = max(stretch, float(np.abs(curvature * offset).max()))
    _check(borders, stretch)
    widths = np.diff(borders, axis=1).mean(axis=0)
    mean = borders[:, 0].mean() + np.concatenate([[0.0], np.cumsum(widths)])
    return RoadShape(line=line, border_s=stations, borders=borders, mean_borders=mean)


def _check(borders: F64, stretch: float) -> None:
    """Refuse what would be distorted too much."""
    if stretch > MAX_STRETCH:
        raise RoadShapeError(
            what="bend",
            expected=f"lanes at most {MAX_STRETCH:.0%} longer than the middle of the road",
            got=f"{stretch:.0%}",
        )
    widths = np.diff(borders, axis=1)
    mean = widths.mean(axis=0)
    for lane in range(widths.shape[1]):
        if np.abs(widths[:, lane] - mean[lane]).max() > MAX_WIDENING * mean[lane]:
            raise RoadShapeError(
                what=f"lane {lane + 1} from the right",
                expected=f"a width that differs by at most {MAX_WIDENING:.0%}",
                got=f"{widths[:, lane].min():.2f} to {widths[:, lane].max():.2f} m",
            )
