"""How far a road is visible round bends and over crests.

Where a course states no sight distance, it follows from the line and the grade of the road. Inside
a bend something stands beside the lanes, at a clearance from the middle of the nearest lane, and a
driver sees as far as a straight line passes it: on a circle of radius R with the clearance m, that
is 2 R acos(1 - m / R). Over a crest a driver sees all that the road itself does not cover: on a
vertical circle of radius R, from an eye at height a to an object of height b, that is
sqrt(2 R) (sqrt(a) + sqrt(b)).

Source:
    AASHTO (2018), chapter 3: sight distance on horizontal curves, and crest vertical curves.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F64, IndexArray, Mask
from overtaking.knowledge.roads import sight_facts
from overtaking.knowledge.toml_reader import constant
from overtaking.model.reference_line import Points, cos_sin
from overtaking.model.road import Road
from overtaking.model.road_course import RoadCourse, RoadZone, ZoneKind

_EYES_PER_BLOCK = 512
"""Stations whose view is computed at a time; it bounds the memory of a long road."""

_MIN_AHEAD = 1e-3
"""A point nearer than this in the direction of travel has no bearing [m]."""

_FAR = 1e9
"""Bearing of a part of the wall that hides nothing [1]."""

_NOT_AHEAD_MARGIN = -1.0
"""Margin of a point of the path that is not ahead: negative, so the point counts as hidden [1]."""


class VisibleDistance(NamedTuple):
    """Visible length of road at stations `station_spacing()` apart, at most `max_sight()`.

    Attributes:
        past_bends: Past the obstacles inside of bends, shape (station,) [m].
        over_crests: Over crests, from the eye of a car's driver, shape (station,) [m].
        over_crests_from_truck: Over crests, from the eye of a truck's driver, (station,) [m].
    """

    past_bends: F64
    over_crests: F64
    over_crests_from_truck: F64


class Path(NamedTuple):
    """Positions of drivers' eyes, in the order of travel.

    Attributes:
        points: The points, equally far apart along the road.
        cosine: Cosine of the direction of travel at each, shape (point,).
        sine: Sine of it, shape (point,).
    """

    points: Points
    cosine: F64
    sine: F64


def max_sight() -> float:
    """Largest computed sight distance: drivers look no farther for oncoming vehicles [m]."""
    return float(constant("model.oncoming.range"))


def station_spacing() -> float:
    """Distance between the stations at which the road is evaluated [m]."""
    return float(constant("model.steering.station"))


def sight_at(road: Road, s: ArrayLike, direction: int = 1) -> F64:
    """Length of road that the driver of a car sees.

    Args:
        road: The road.
        s: Station of the driver, any shape [m].
        direction: +1 along the road, -1 against it.

    Returns:
        Distances of the same shape, infinite where the road does not limit sight [m].
    """
    visible = visible_distance(road, direction)
    if visible is None:
        return (road.course or RoadCourse()).sight_at(s, direction)
    distance = np.minimum(visible.past_bends, visible.over_crests)
    distance = np.interp(np.asarray(s, np.float64), _stations(road), distance)
    return np.where(distance < max_sight(), distance, np.inf)


def all_zones_for(road: Road, direction: int) -> tuple[RoadZone, ...]:
    """The stated zones of a road, and the zones of short sight that follow from its geometry.

    Where sight follows from the geometry, a bend is a zone if its visibility is reduced in the
    sense of Article 19 of the Highway Code. A crest is a zone if sight is shorter than the distance
    that a passing zone needs at the speed limit there.

    Args:
        road: The road.
        direction: Direction of travel, +1 along the road, -1 against it.

    Returns:
        The zones that apply to this direction.
    """
    stated = road.course.zones_for(direction) if road.course else ()
    return (*stated, *_zones_of_short_sight(road, direction))


@lru_cache(maxsize=16)
def visible_distance(road: Road, direction: int) -> VisibleDistance | None:
    """Sight distances that follow from the geometry of a road.

    Args:
        road: The road.
        direction: +1 along the road, -1 against it. In both cases the stations are in the order of
            the road.

    Returns:
        The distances by station; None where the course states sight or nothing limits it.
    """
    course = road.course
    if course is None or not (course.segments or course.grade):
        return None
    if course.sight or course.sight_against:
        return None
    facts = sight_facts()
    past_bends = over_crests = from_truck = np.full(len(_stations(road)), max_sight())
    if course.segments:
        past_bends = _sight_round_bends(road, direction, facts.clearance)
    if course.grade:
        over_crests, from_truck = (
            _sight_over_crests(road, direction, eye_height, facts.object_height)
            for eye_height in (facts.eye_height, facts.truck_eye_height)
        )
    return VisibleDistance(past_bends, over_crests, from_truck)


@lru_cache(maxsize=16)
def _zones_of_short_sight(road: Road, direction: int) -> tuple[RoadZone, ...]:
    """The bends and crests of a road whose sight is too short, see `all_zones_for`."""
    visible = visible_distance(road, direction)
    if visible is None:
        return ()
    facts = sight_facts()
    limits = road.speed_limit_at(_stations(road), direction)
    passing_sight = np.interp(limits, facts.passing_zone_speeds, facts.passing_zone_sight)
    reduced_visibility = float(constant("law.sight.least"))
    masks = (
        (ZoneKind.BEND, visible.past_bends < reduced_visibility),
        (ZoneKind.CREST, visible.over_crests < passing_sight),
    )
    return tuple(
        RoadZone(kind=kind, start=start, stop=stop, direction=direction)
        for kind, is_short in masks
        for start, stop in _spans_where(road, is_short)
    )


def _spans_where(road: Road, is_inside: Mask) -> Iterator[tuple[float, float]]:
    """First and last station of each stretch whose stations are all marked [m]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_inside, [False]])))
    # The last station may lie up to one spacing beyond the end of the road.
    stations = np.minimum(_stations(road), road.length)
    for first, stop in edges.reshape(-1, 2):
        last = stop - 1
        if stations[first] < stations[last]:
            yield float(stations[first]), float(stations[last])


def _stations(road: Road) -> F64:
    """The stations of `RoadParameters.course_table` [m]."""
    count = int(np.ceil(road.length / station_spacing())) + 1
    return np.arange(count, dtype=np.float64) * station_spacing()


def _stations_ahead(road: Road, direction: int) -> tuple[F64, int]:
    """Stations in the order of travel, continued by the largest sight distance.

    Beyond its ends the road continues straight.

    Returns:
        The stations [m], and how many of them are beyond the end.
    """
    num_ahead = round(max_sight() / station_spacing())
    stations = _stations(road)
    continued = stations[-1] + np.arange(1, num_ahead + 1) * station_spacing()
    distance = np.concatenate([stations, continued])
    return (distance if direction > 0 else stations[-1] - distance), num_ahead


def _sight_round_bends(road: Road, direction: int, clearance: float) -> F64:
    """Sight past obstacles beside the outermost lanes, in the order of the road, (station,) [m].

    Args:
        road: A road with a line.
        direction: +1 along the road, -1 against it.
        clearance: Distance between the middle of the outermost lane and the obstacles [m].
    """
    stations, num_ahead = _stations_ahead(road, direction)
    cosine, sine = cos_sin(road.heading_at(stations))
    distances = []
    for side, d in zip((1.0, -1.0), _outer_centres(road), strict=True):
        path = Path(road.to_world(stations, d), direction * cosine, direction * sine)
        wall = road.to_world(stations, d + side * clearance)
        # For a driver against the direction of the road, its left side is to the right.
        distances.append(_sight_past_wall(path, wall, side * direction, num_ahead))
    return _in_order_of_road(np.minimum(*distances), direction)


def _outer_centres(road: Road) -> tuple[float, float]:
    """Middle of the leftmost and of the rightmost driving lane, of either direction [m]."""
    centres = list(road.lane_centres)
    if road.is_two_way and (opposing_lane := road.overtaking_side_neighbour):
        centres.append(road.lane_boundaries[-1] + 0.5 * road.overtaking_sign * opposing_lane.width)
    return float(max(centres)), float(min(centres))


def _sight_past_wall(path: Path, wall: Points, side: float, num_ahead: int) -> F64:
    """How far a driver sees along a path past a wall beside it, shape (station,) [m].

    A point of the path is visible if no part of the wall before it has a smaller bearing, measured
    towards the wall.

    Args:
        path: The path, with `num_ahead` points beyond the last station.
        wall: The point of the wall beside each point of the path.
        side: +1 if the wall is to the left, -1 if it is to the right.
        num_ahead: Number of points ahead that a driver can see at most.
    """
    num_stations = len(path.points.x) - num_ahead
    distances = []
    # Process the eyes in blocks: each eye needs several hundred bearings.
    for eye, ahead in _eye_blocks(num_stations, num_ahead):
        target_bearing = side * _bearing(path, eye, path.points, ahead)
        wall_bearing = side * _bearing(path, eye, wall, ahead)
        # A part of the wall that is not ahead hides nothing.
        wall_bearing = np.where(np.isfinite(wall_bearing), wall_bearing, _FAR)
        nearest_wall = np.minimum.accumulate(wall_bearing, axis=1)
        is_ahead = np.isfinite(target_bearing)
        margin = np.where(is_ahead, nearest_wall - target_bearing, _NOT_AHEAD_MARGIN)
        distances.append(_distance_to_first_hidden(margin))
    return np.concatenate(distances)


def _bearing(path: Path, eye: IndexArray, points: Points, index: IndexArray) -> F64:
    """Tangent of the angle to points, left positive; infinite for points that are not ahead.

    The tangent orders directions as the angle does, without an arctangent for each pair.

    Args:
        path: Positions and directions of the eyes.
        eye: Indices of the eyes, shape (eye, 1).
        points: The points whose bearing is computed.
        index: Indices of these points, shape (eye, point).
    """
    east = points.x[index] - path.points.x[eye]
    north = points.y[index] - path.points.y[eye]
    cosine, sine = path.cosine[eye], path.sine[eye]
    forward = east * cosine + north * sine
    left = north * cosine - east * sine
    is_ahead = forward > _MIN_AHEAD
    return np.where(is_ahead, left / np.where(is_ahead, forward, 1.0), np.inf)


def _sight_over_crests(road: Road, direction: int, eye_height: float, object_height: float) -> F64:
    """Sight over the crests of a road, in the order of the road, shape (station,) [m].

    An object is visible if its top is at least as steep above the eye as all the road before it.

    Args:
        road: A road with a grade.
        direction: +1 along the road, -1 against it.
        eye_height: Height of the eye above the road [m].
        object_height: Height of the object above the road [m].
    """
    stations, num_ahead = _stations_ahead(road, direction)
    height = road.height_at(stations)
    distance = np.arange(1, num_ahead + 1) * station_spacing()
    distances = []
    for eye, ahead in _eye_blocks(len(stations) - num_ahead, num_ahead):
        rise = height[ahead] - (height[eye] + eye_height)
        steepest_road = np.maximum.accumulate(rise / distance, axis=1)
        margin = (rise + object_height) / distance - steepest_road
        distances.append(_distance_to_first_hidden(margin))
    return _in_order_of_road(np.concatenate(distances), direction)


def _eye_blocks(num_stations: int, num_ahead: int) -> Iterator[tuple[IndexArray, IndexArray]]:
    """Indices of a block of eyes, (eye, 1), and of the points ahead of each, (eye, point)."""
    for first in range(0, num_stations, _EYES_PER_BLOCK):
        eye = np.arange(first, min(first + _EYES_PER_BLOCK, num_stations))[:, None]
        yield eye, eye + np.arange(1, num_ahead + 1)


def _distance_to_first_hidden(margin: F64) -> F64:
    """Distance at which a margin first falls below zero, linear between points, (eye,) [m].

    Args:
        margin: Shape (eye, point ahead); the first point is one spacing ahead.
    """
    is_hidden = margin < 0.0
    has_hidden = is_hidden.any(axis=1)
    eye = np.arange(len(margin))
    first = np.argmax(is_hidden, axis=1)  # 0 also without a hidden point, see the last line.
    # No point comes before the first one: it stands in for itself, and `share` leaves it out.
    last_visible, first_hidden = margin[eye, np.maximum(first - 1, 0)], margin[eye, first]
    # Without a hidden point the fall has no meaning; 1 keeps the division finite.
    fall = np.where(has_hidden, last_visible - first_hidden, 1.0)
    # Where the first point is hidden, the fall is 0: divide by 1, and take a share of 0.
    share = np.where(first > 0, last_visible / np.where(fall > 0.0, fall, 1.0), 0.0)
    distance = (first + share) * station_spacing()
    # At least one spacing: a driver always sees the road in front of the vehicle.
    distance = np.clip(distance, station_spacing(), max_sight())
    return np.where(has_hidden, distance, max_sight())


def _in_order_of_road(distance: F64, direction: int) -> F64:
    """Distances in the order of the road, from the order of travel."""
    return distance if direction > 0 else distance[::-1]
