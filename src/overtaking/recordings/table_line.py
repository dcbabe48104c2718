"""The reference line of a road that bends, from the ways of the vehicles on it.

The vehicle with the longest way draws the first line, lane changes and all. What the others do
beside it, each against the middle of its own offsets, corrects it: whoever keeps a lane shows how
the road bends, and most do at any place.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.reference_line import ReferenceLine
from overtaking.recordings.fitting import Fitted, fitted
from overtaking.recordings.table_errors import refused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64
    from overtaking.recordings.rows import Rows


_ROUNDS = 3
_BINS = 10.0  # Between the stations at which the offsets of all vehicles are compared [m].
_FINEST = 20.0  # Between knots: the offsets of a few vehicles show no finer bends [m].
_NEAR = 25.0  # Vehicles farther from the first line are on another road [m].
_BEYOND = 25.0  # Road before the first and after the last position: the longest body fits [m].
_SAMPLE = 20_000


def line_of_traffic(rows: Rows, x: F64, y: F64, heading: float | None) -> Fitted:
    """The line along which most of the traffic drives.

    Args:
        rows: The rows.
        x: Positions, shape (row,) [m].
        y: The same, to the left of x [m].
        heading: Direction of the road in its middle, None for that of most vehicles [rad].

    Raises:
        ImportFormatError: No vehicle moves.
    """
    vehicle = np.repeat(np.arange(len(rows.names)), np.diff(rows.start))
    first, last = rows.start[:-1], rows.start[1:] - 1
    longest = int(np.argmax(np.hypot(x[last] - x[first], y[last] - y[first])))
    part = slice(rows.start[longest], rows.start[longest + 1])
    line = _line(rows.where, np.stack([x[part], y[part]], axis=1))
    some = slice(None, None, 1 + len(x) // _SAMPLE)
    x, y, vehicle = x[some], y[some], vehicle[some]
    for _ in range(_ROUNDS):
        made = ReferenceLine.from_segments(line.pieces)
        s, d = made.to_road(x, y)
        if _is_backwards(made, s, vehicle, heading):
            ends = made.length, 0.0
            points = np.stack(made.to_world(np.linspace(*ends, 1_000), 0.0), axis=1)
        else:
            near = np.abs(d) < _NEAR
            points = np.stack(made.to_world(*_middle(s[near], d[near], vehicle[near])), axis=1)
        line = _line(rows.where, points)
    return line


def _line(where: str, points: F64) -> Fitted:
    """The line near points, refused where they have no way."""
    line = fitted(points, finest=_FINEST)
    if line is None:
        raise refused(where, "ways of the vehicles", "some that are those of a road", "none")
    return line


def _is_backwards(
    line: ReferenceLine, s: F64, vehicle: NDArray[np.int64], heading: float | None
) -> bool:
    """Whether a line runs against the stated direction, or against most of the traffic."""
    if heading is not None:
        return bool(np.cos(line.heading_at(0.5 * line.length) - heading) < 0.0)
    same = np.diff(vehicle) == 0
    return bool(np.diff(s)[same].sum() < 0.0)


def _middle(s: F64, d: F64, vehicle: NDArray[np.int64]) -> tuple[F64, F64]:
    """Stations, and the offset of the road there: the median over who drives along the line.

    The first and the last lie `_BEYOND` the vehicles.
    """
    starts = np.flatnonzero(np.append(True, np.diff(vehicle) != 0))
    off, forward = np.empty_like(d), np.zeros(len(d), np.bool_)
    for low, high in pairwise([*starts.tolist(), len(d)]):
        off[low:high] = d[low:high] - np.median(d[low:high])
        forward[low:high] = s[high - 1] > s[low]
    s, off = s[forward], off[forward]
    place = np.floor(s / _BINS).astype(np.int64)
    found = np.unique(place)
    middle = np.array([np.median(off[place == one]) for one in found])
    ends = np.array([s.min() - _BEYOND, s.max() + _BEYOND])
    return (
        np.concatenate([ends[:1], (found.astype(np.float64) + 0.5) * _BINS, ends[1:]]),
        np.concatenate([middle[:1], middle, middle[-1:]]),
    )
