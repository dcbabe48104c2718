"""A reference line through points: straight, or of curvature that is linear between knots.

Lines of points have a corner at each; a road has none. The line with the fewest knots is taken that
stays close to the points: a straight one, then one with knots farther and farther from 80 m down
to 5 m. Its unknowns are where it begins, its direction there, and its curvature at the knots; they
are found by the method of Gauss and Newton, which makes the squares of the distances from the
points to the line least.
"""

from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F64
from overtaking.model.reference_line import CurveSegment, ReferenceLine
from overtaking.model.road_course import MAX_CURVATURE, MAX_LENGTH

CLOSE = 0.1
"""Distance from the points within which a line needs no more knots [m]."""

LARGEST_MISS = 0.5
"""Distance from the points beyond which a line is not theirs [m]."""

_LIMITS = (CLOSE, 0.25, LARGEST_MISS)  # Fewer knots come before a line that is nearer than these.

_SPACINGS = (80.0, 40.0, 20.0, 10.0, 5.0)  # Between knots [m].
_MOST_KNOTS = 200  # More take seconds, and no recording shows that much road.
_MOST_POINTS = 2_000
_ITERATIONS = 8
_SETTLED = 1.0e-3  # A change of distances that is none [m].
_STATIONS = 4_000  # At most, half a metre apart, over which the turning is summed up.
_LEAST_WAY = 1.0e-6  # Nearer points have no direction that a float64 can hold [m].


class Fitted(NamedTuple):
    """A line through points.

    Attributes:
        pieces: The line, a single straight one where that is close enough.
        miss: Largest distance of a point from it [m].
    """

    pieces: tuple[CurveSegment, ...]
    miss: float


def fitted(points: F64, *, finest: float = _SPACINGS[-1]) -> Fitted | None:
    """The line of the fewest pieces that is close to points, or else the nearest that was found.

    Args:
        points: World points in their order along the line, shape (point, 2) [m].
        finest: Least distance between knots [m].

    Returns:
        The line, from the first point to the last; None if the points have no length, or more than
        roads have.
    """
    points, way = _spaced(points)
    if not (len(points) > 1 and _LEAST_WAY < way[-1] < MAX_LENGTH):
        return None
    found = [_straight(points)]
    for spacing in (one for one in _SPACINGS if one >= finest):
        count = max(1, round(way[-1] / spacing))
        if found[-1].miss <= CLOSE or count > _MOST_KNOTS or 2 * count > len(points):
            break
        found.append(_bent(points, way, np.linspace(0.0, way[-1], count + 1)))
    near = (one for limit in _LIMITS for one in found if one.miss <= limit)
    return next(near, min(found, key=lambda one: one.miss))


def is_straight(pieces: tuple[CurveSegment, ...]) -> bool:
    """Whether a line does not bend."""
    return len(pieces) == 1 and pieces[0].curvature == pieces[0].end_curvature == 0.0


def _spaced(points: F64) -> tuple[F64, F64]:
    """Points a metre apart or more along the line through all of them, and their ways."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    kept = np.append(True, steps > _LEAST_WAY)
    way = np.append(0.0, np.cumsum(steps))[kept]
    count = int(min(max(way[-1], 1.0), _MOST_POINTS)) + 1
    at = np.linspace(0.0, way[-1], count)
    return np.stack([np.interp(at, way, axis) for axis in points[kept].T], axis=1), at


def _straight(points: F64) -> Fitted:
    """The straight line that is nearest to points, from the foot of the first to that of the last.

    It runs through their mean, along the axis about which they have the least moment.
    """
    mean = points.mean(axis=0)
    east, north = (points - mean).T
    heading = 0.5 * np.arctan2(2.0 * (east * north).sum(), (east**2 - north**2).sum())
    chord = points[-1] - points[0]
    if chord @ np.array([np.cos(heading), np.sin(heading)]) < 0.0:
        heading = heading + (np.pi if heading < 0.0 else -np.pi)
    cosine, sine = np.cos(heading), np.sin(heading)
    along, across = east * cosine + north * sine, north * cosine - east * sine
    x, y = mean + along[0] * np.array([cosine, sine])
    length = max(float(along[-1] - along[0]), _LEAST_WAY)
    return Fitted(
        (CurveSegment(float(x), float(y), float(heading), length),), float(np.abs(across).max())
    )


def _bent(points: F64, way: F64, knots: F64) -> Fitted:
    """The line with these knots that is nearest to points.

    Args:
        points: Shape (point, 2) [m].
        way: Way along them, same shape [m].
        knots: From the first to the last of these ways [m].
    """
    stations = np.linspace(0.0, way[-1], min(int(2.0 * way[-1]) + 2, _STATIONS))
    hats = np.stack([np.interp(stations, knots, row) for row in np.eye(len(knots))], axis=1)
    turns = np.column_stack([np.ones(len(stations)), _summed(hats, stations)])
    start, unknown = points[0], _first_guess(points, way, knots)
    s, before = way, np.full(len(way), np.inf)
    for _ in range(_ITERATIONS):
        heading = turns @ unknown
        east, north = np.cos(heading)[:, None], np.sin(heading)[:, None]
        place = start + _summed(np.hstack([east, north]), stations)
        x, y, at = (np.interp(s, stations, each) for each in (*place.T, heading))
        ahead, left = _turned(points[:, 0] - x, points[:, 1] - y, at)
        s = s + ahead
        # How far each unknown moves the line to its left at each point.
        sideways = _summed(np.hstack([-north * turns, east * turns]), stations)
        near = np.clip(np.searchsorted(stations, s), 0, len(stations) - 1)
        across = east[near] * sideways[near, turns.shape[1] :]
        across -= north[near] * sideways[near, : turns.shape[1]]
        shift = np.cos(heading[near] - unknown[0])
        change = np.linalg.lstsq(np.column_stack([shift, across]), left, rcond=None)[0]
        normal = np.array([-np.sin(unknown[0]), np.cos(unknown[0])])
        start, unknown = start + change[0] * normal, unknown + change[1:]
        unknown[1:] = unknown[1:].clip(-2.0 * MAX_CURVATURE, 2.0 * MAX_CURVATURE)
        if np.abs(left - before).max() < _SETTLED:
            break
        before = left
    pieces = _pieces(start, unknown, knots)
    pose = ReferenceLine.from_segments(pieces).pose_at(s)
    ahead, left = _turned(points[:, 0] - pose.x, points[:, 1] - pose.y, pose.heading)
    return Fitted(pieces, float(np.hypot(ahead, left).max()))


def _first_guess(points: F64, way: F64, knots: F64) -> F64:
    """Direction at the start, and the curvature at the knots, from the points between these."""
    at = np.stack([np.interp(knots, way, axis) for axis in points.T], axis=1)
    heading = np.unwrap(np.arctan2(*np.diff(at, axis=0).T[::-1]))
    if len(heading) == 1:
        return np.array([heading[0], 0.0, 0.0])
    inner = np.diff(heading) / (0.5 * (knots[2:] - knots[:-2]))
    curvature = np.concatenate([inner[:1], inner, inner[-1:]])
    return np.append(heading[0] - 0.5 * curvature[0] * (knots[1] - knots[0]), curvature)


def _pieces(start: F64, unknown: F64, knots: F64) -> tuple[CurveSegment, ...]:
    """The line of a start, a direction there, and curvatures at the knots."""
    x, y, heading = float(start[0]), float(start[1]), float(unknown[0])
    pieces: list[CurveSegment] = []
    for length, before, after in zip(np.diff(knots), unknown[1:-1], unknown[2:], strict=True):
        piece = CurveSegment(x, y, heading, float(length), float(before), float(after))
        pieces.append(piece)
        end = ReferenceLine.from_segments([piece]).pose_at(piece.length)
        x, y, heading = float(end.x), float(end.y), float(end.heading)
    return tuple(pieces)


def _turned(east: F64, north: F64, heading: F64) -> tuple[F64, F64]:
    """Ways ahead and to the left, from those east and north [m]."""
    cosine, sine = np.cos(heading), np.sin(heading)
    return east * cosine + north * sine, north * cosine - east * sine


def _summed(values: F64, stations: F64) -> F64:
    """Integral of each column from the first station to each, by trapezoids."""
    areas = 0.5 * (values[1:] + values[:-1]) * np.diff(stations)[:, None]
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(areas, axis=0)])
