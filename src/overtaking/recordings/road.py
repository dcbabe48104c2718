"""The road of a recording: a smooth reference line between its borders, and lanes beside it.

The road is given by the borders of its lanes as lines of points. A line of linear curvature in
their middle is the reference (`fitting`): `s` runs along it, and offsets from it are measured
square to it. The model's lanes have constant widths, so an offset is scaled piecewise, from the
borders where they are at that `s` to the mean borders of the stretch: a vehicle on a line stays on
it, and one in the middle of a lane still is. A decision in `docs/adr` has the reasons, and what
this costs.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F64
from overtaking.model.reference_line import CurveSegment, ReferenceLine
from overtaking.recordings.fitting import LARGEST_MISS, Fitted, fitted

GRID = 1.0
"""Spacing of the stations at which the borders are held [m]."""

MAX_STRETCH = 0.2
"""Largest part by which the way along a lane may differ from that along the reference line."""

MAX_WIDENING = 0.25
"""Largest part by which a lane may be wider or narrower than it is in the mean."""

LEAST_LENGTH = 10.0
"""A road is that long at least [m]."""

_MOST_STATIONS = 20_000


class RoadShapeError(ValueError):
    """A road that the model has no place for.

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
        curvature: Of the reference line, positive in left bends [1/m].
    """

    s: F64
    d: F64
    offset: F64
    tangent: F64
    curvature: F64

    @property
    def stretch(self) -> F64:
        """Way along the line through each point, over that along the reference line."""
        return 1.0 - self.curvature * self.offset


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadShape:
    """The reference line of a road and the borders of its lanes.

    Attributes:
        pieces: The reference line, a single straight piece where the road does not bend.
        miss: Largest distance of the middle of the lanes from it [m].
        border_s: Stations along it, shape (station,) [m].
        borders: Offsets of the borders there, from the right to the left, shape
            (station, lane + 1) [m].
        mean_borders: Borders of the lanes of constant width, shape (lane + 1,) [m].
    """

    pieces: tuple[CurveSegment, ...]
    miss: float
    border_s: F64
    borders: F64
    mean_borders: F64

    @property
    def line(self) -> ReferenceLine:
        """The reference line."""
        return ReferenceLine.from_segments(self.pieces)

    @property
    def length(self) -> float:
        """Length of the road along its line [m]."""
        return float(self.border_s[-1])

    @property
    def turn(self) -> float:
        """Angle between the directions of the road that differ most [rad]."""
        return float(np.ptp(self.line.heading_at(self.border_s)))

    def project(self, x: F64, y: F64) -> Projection:
        """World points in road coordinates."""
        line = self.line
        s, offset = line.to_road(x, y)
        local = np.stack([np.interp(s, self.border_s, each) for each in self.borders.T], axis=-1)
        pose = line.pose_at(s)
        return Projection(
            s=s,
            d=scaled(offset, local, self.mean_borders),
            offset=offset,
            tangent=pose.heading,
            curvature=pose.curvature,
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
        RoadShapeError: No smooth line runs between the borders, or the lanes are not of nearly
            constant width.
    """
    # Edges of different lengths do not pair well: a first line shows where they lie.
    rough = _fitted((_evenly(borders[0]) + _evenly(borders[-1])) * 0.5, finest=20.0).pieces
    stations, across = _measured(ReferenceLine.from_segments(rough), borders)
    middle = (across[:, 0] + across[:, -1]) * 0.5
    line = _fitted(np.stack(ReferenceLine.from_segments(rough).to_world(stations, middle), axis=1))
    if line.miss > LARGEST_MISS:
        raise RoadShapeError(
            what="bend",
            expected=f"a smooth line within {LARGEST_MISS:g} m of the middle of the lanes",
            got=f"{line.miss:.2f} m",
        )
    made = ReferenceLine.from_segments(line.pieces)
    stations, across = _measured(made, borders, length=made.length)
    _check(across, made.pose_at(stations).curvature)
    widths = np.diff(across, axis=1).mean(axis=0)
    mean = across[:, 0].mean() + np.concatenate([[0.0], np.cumsum(widths)])
    return RoadShape(
        pieces=line.pieces, miss=line.miss, border_s=stations, borders=across, mean_borders=mean
    )


def _fitted(points: F64, *, finest: float = 5.0) -> Fitted:
    """The line through points, which have to be as many as a line takes."""
    line = fitted(points, finest=finest)
    if line is None:
        got = f"{np.hypot(*np.diff(points, axis=0).T).sum():.3g} m"
        raise RoadShapeError(what="lanes", expected="the length of a road", got=got)
    return line


def _evenly(line: F64) -> F64:
    """Points at equal parts of the way along a line, shape (point, 2) [m]."""
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    at = np.linspace(0.0, way[-1], 1_000)
    return np.stack([np.interp(at, way, axis) for axis in line.T], axis=1)


def _measured(
    line: ReferenceLine, borders: list[F64], *, length: float | None = None
) -> tuple[F64, F64]:
    """Stations of the road, and the offsets of its borders from a line there.

    Args:
        line: The line.
        borders: Lines of points.
        length: Where the road ends, which begins at 0 [m]; by default it begins and ends where
            all borders do.

    Returns:
        Stations, shape (station,) [m], and offsets, shape (station, border) [m].
    """
    turned = [_ahead(*line.to_road(*border.T)) for border in borders]
    first, last = max(s[0] for s, _ in turned), min(s[-1] for s, _ in turned)
    if not last - first >= LEAST_LENGTH:
        raise RoadShapeError(
            what="lanes",
            expected=f"{LEAST_LENGTH:g} m beside each other",
            got=f"{last - first:.3g} m",
        )
    if length is not None:
        first, last = 0.0, length
    count = min(int(np.ceil((last - first) / GRID)), _MOST_STATIONS)
    stations = np.linspace(first, last, count + 1)
    return stations, np.stack([np.interp(stations, s, d) for s, d in turned], axis=1)


def _ahead(s: F64, d: F64) -> tuple[F64, F64]:
    """A line of points without those that do not go ahead."""
    farthest = np.concatenate([[-np.inf], np.maximum.accumulate(s)[:-1]])
    ahead = s > farthest
    return s[ahead], d[ahead]


def _check(borders: F64, curvature: F64) -> None:
    """Refuse what would be distorted too much."""
    stretch = float(np.abs(curvature[:, None] * borders).max())
    if stretch > MAX_STRETCH:
        raise RoadShapeError(
            what="bend",
            expected=f"lanes at most {MAX_STRETCH:.0%} longer than the middle of the road",
            got=f"{stretch:.0%}",
        )
    widths = np.diff(borders, axis=1)
    mean = widths.mean(axis=0)
    for lane in range(widths.shape[1]):
        if not np.abs(widths[:, lane] - mean[lane]).max() <= MAX_WIDENING * mean[lane]:
            raise RoadShapeError(
                what=f"lane {lane + 1} from the right",
                expected=f"a width that differs by at most {MAX_WIDENING:.0%}",
                got=f"{widths[:, lane].min():.2f} to {widths[:, lane].max():.2f} m",
            )
