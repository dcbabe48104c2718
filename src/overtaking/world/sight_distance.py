"""How far a road is visible round bends and over crests.

The functions compute sight distances of a `Road` at its *stations*, which are points at equal
spacing along the road. The simulation step reads them as tables (`road_parameters`), and rules of
the law compare them with limits.

A map may state the sight distances of its road (`RoadCourse.sight`). Otherwise they follow from the
reference line and the grade of the road:

- In a bend, an obstacle called *wall* stands on the inner side, at a clearance from the middle of
  the nearest lane. A driver sees the lane as far as a straight line passes the wall. On a circle of
  radius R with the clearance m, that is 2 R acos(1 - m / R).
- Over a crest, a driver sees all that the road itself does not cover. On a vertical circle of
  radius R, from an eye at height a to an object of height b, that is sqrt(2 R) (sqrt(a) + sqrt(b)).

For roads of any shape, the functions below test the points ahead of each station one by one.
`constant` and `sight_facts` read numbers of the model from `knowledge/data`.

`direction` is +1 for drivers along the road, in the order of the stations, and -1 against it.

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
"""Stations whose view is computed at a time, a *block*. A choice: with 500 points ahead of each, an
array has 2 MB, however long the road is."""

_MIN_AHEAD = 1e-3
"""Nearer points count as not ahead, because `_bearing` divides by the distance ahead [m]."""

_HIDES_NOTHING = 1e9
"""Bearing of a part of the wall that hides no point: larger than the bearing of every point [1]."""

_NOT_AHEAD_MARGIN = -1.0
"""Margin of a point of the path that is not ahead, as after a bend by more than a right angle:
negative, so that the point counts as hidden [1]."""


class VisibleDistance(NamedTuple):
    """Visible length of road at stations `station_spacing()` apart, at most `max_sight()`.

    All arrays have shape (station,), in the order of the road for both directions. A driver sees
    the smaller of the distances past bends and over crests.

    Attributes:
        past_bends: Past the walls on the inner side of bends [m].
        over_crests: Over crests, from the eye of a car's driver [m].
        over_crests_from_truck: Over crests, from the higher eye of a truck's driver [m].
    """

    past_bends: F64
    over_crests: F64
    over_crests_from_truck: F64


class Path(NamedTuple):
    """The middle of a lane as points in the plane, in the order of travel.

    Each point is the eye of a driver, and a point that drivers behind it may see.

    Attributes:
        points: World coordinates x and y, each of shape (point,); one point for each station [m].
        cosine: Cosine of the direction of travel at each point, shape (point,).
        sine: Sine of the direction of travel, shape (point,).
    """

    points: Points
    cosine: F64
    sine: F64


def max_sight() -> float:
    """Largest computed sight distance, 1,000 m: drivers of the model look no farther ahead [m]."""
    return float(constant("model.oncoming.range"))


def station_spacing() -> float:
    """Distance between two neighbouring stations, 2 m [m]."""
    return float(constant("model.steering.station"))


def sight_at(road: Road, s: ArrayLike, direction: int = 1) -> F64:
    """Length of road that the driver of a car sees.

    Args:
        road: The road.
        s: Position of the driver from the start of the road, for both directions, any shape [m].
        direction: +1 along the road, -1 against it.

    Returns:
        Distances of the same shape, stated by the map or computed; infinite where the road does not
        limit sight [m].
    """
    visible = visible_distance(road, direction)
    if visible is None:
        # The map states the distances, or the road is straight and level. `RoadCourse` returns
        # infinite distances where none are stated.
        return (road.course or RoadCourse()).sight_at(s, direction)
    distance = np.minimum(visible.past_bends, visible.over_crests)
    distance = np.interp(np.asarray(s, np.float64), _stations(road), distance)
    # A computed distance of `max_sight()` means that the road hides no point within it.
    return np.where(distance < max_sight(), distance, np.inf)


def all_zones_for(road: Road, direction: int) -> tuple[RoadZone, ...]:
    """Zones of a road that rules of the law refer to: stated zones and zones of short sight.

    In a zone the law restricts overtaking. A map states zones such as junctions, crests and bends.
    Where sight follows from the geometry, the stretches of short sight are also zones:

    - bends with less than 50 m of sight, "reduced visibility" in Article 19 of the Portuguese
      Highway Code;
    - crests with less sight than a centre line that permits passing requires: this distance grows
      with the speed limit (`sight_facts`). The eye of a car's driver counts, as in the source of
      this distance.

    Args:
        road: The road.
        direction: Direction of travel, +1 along the road, -1 against it.

    Returns:
        The zones that apply to this direction, first the stated ones.
    """
    stated = road.course.zones_for(direction) if road.course else ()
    return (*stated, *_zones_of_short_sight(road, direction))


@lru_cache(maxsize=16)
def visible_distance(road: Road, direction: int) -> VisibleDistance | None:
    """Sight distances that follow from the geometry of a road.

    The results are cached, as they take time: callers must not change the arrays.

    Args:
        road: The road.
        direction: +1 along the road, -1 against it.

    Returns:
        The distances by station; None if the map states sight distances, or if the road is straight
        and level and so limits no sight.
    """
    course = road.course
    if course is None or not (course.segments or course.grade):
        return None
    # A map that states one direction only leaves the other one unlimited.
    if course.sight or course.sight_against:
        return None
    facts = sight_facts()
    # The three names share one array: a road without bends or without crests keeps it unchanged.
    past_bends = over_crests = from_truck = np.full(len(_stations(road)), max_sight())
    # Only a road that bends has segments, the pieces of its reference line.
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
    """The bends and crests of a road with short sight, as `all_zones_for` describes them."""
    visible = visible_distance(road, direction)
    if visible is None:
        return ()
    facts = sight_facts()
    limits = road.speed_limit_at(_stations(road), direction)
    passing_sight = np.interp(limits, facts.passing_zone_speeds, facts.passing_zone_sight)
    masks = (
        (ZoneKind.BEND, visible.past_bends < facts.min_visible),
        (ZoneKind.CREST, visible.over_crests < passing_sight),
    )
    return tuple(
        RoadZone(kind=kind, start=start, stop=stop, direction=direction)
        for kind, is_short in masks
        for start, stop in _spans_where(road, is_short)
    )


def _spans_where(road: Road, is_inside: Mask) -> Iterator[tuple[float, float]]:
    """First and last position of each stretch of two and more stations in a mask [m].

    Args:
        road: The road.
        is_inside: Whether each station belongs to a stretch, shape (station,).
    """
    # Indices where the mask changes. They alternate: the first station of a stretch, then the first
    # station behind the stretch.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_inside, [False]])))
    # The last station may lie up to one spacing beyond the end of the road.
    stations = np.minimum(_stations(road), road.length)
    for first, stop in edges.reshape(-1, 2):
        last = stop - 1
        # A zone has a length above 0, so a single station is no zone.
        if stations[first] < stations[last]:
            yield float(stations[first]), float(stations[last])


def _stations(road: Road) -> F64:
    """The stations from 0 to the end of the road or one spacing beyond, shape (station,) [m].

    `RoadParameters.course_table` has the same ones.
    """
    count = int(np.ceil(road.length / station_spacing())) + 1
    return np.arange(count, dtype=np.float64) * station_spacing()


def _stations_ahead(road: Road, direction: int) -> tuple[F64, int]:
    """Stations in the order of travel, continued by the largest sight distance.

    So every driver has the same number of points ahead. `Road` continues straight beyond its ends.

    Returns:
        The stations, descending and below 0 at their end if `direction` is -1 [m], and the number
        of those beyond the end.
    """
    num_ahead = round(max_sight() / station_spacing())
    stations = _stations(road)
    continued = stations[-1] + np.arange(1, num_ahead + 1) * station_spacing()
    # From the first station in the order of travel.
    distance = np.concatenate([stations, continued])
    return (distance if direction > 0 else stations[-1] - distance), num_ahead


def _sight_round_bends(road: Road, direction: int, clearance: float) -> F64:
    """Sight past walls beside the outermost lanes, in the order of the road, (station,) [m].

    A wall stands on each side along the whole road. The wall on the inner side of a bend limits the
    sight; the other one hides no point.

    Args:
        road: A road with a curved reference line.
        direction: +1 along the road, -1 against it.
        clearance: Distance between the middle of the outermost lane and the wall beside it [m].
    """
    stations, num_ahead = _stations_ahead(road, direction)
    cosine, sine = cos_sin(road.heading_at(stations))
    distances = []
    for side, d in zip((1.0, -1.0), _outer_centres(road), strict=True):
        # The sight from the lane nearest to the wall is the shortest; it counts for all lanes.
        path = Path(road.to_world(stations, d), direction * cosine, direction * sine)
        wall = road.to_world(stations, d + side * clearance)
        # `side` is +1 to the left of the road, which is to the right of a driver against it.
        distances.append(_sight_past_wall(path, wall, side * direction, num_ahead))
    return _in_order_of_road(np.minimum(*distances), direction)


def _outer_centres(road: Road) -> tuple[float, float]:
    """Lateral positions of the leftmost and rightmost lane centre, of both directions [m]."""
    centres = list(road.lane_centres)
    if road.is_two_way and (opposing_lane := road.overtaking_side_neighbour):
        # Lanes count from the kerb, so the last boundary is the centre line. `overtaking_sign` is
        # the sign of the lateral positions beyond it.
        centre_line = road.lane_boundaries[-1]
        centres.append(centre_line + 0.5 * road.overtaking_sign * opposing_lane.width)
    return float(max(centres)), float(min(centres))


def _sight_past_wall(path: Path, wall: Points, side: float, num_ahead: int) -> F64:
    """How far a driver sees along a path past a wall beside it, shape (station,) [m].

    Bearings are positive towards the wall. A point of the path is hidden if a point of the wall up
    to there has a smaller bearing: the line of sight then crosses the wall.

    Args:
        path: The path, with `num_ahead` points beyond the last station.
        wall: The point of the wall beside each point of the path.
        side: +1 if the wall is to the left of the driver, -1 if it is to the right.
        num_ahead: Number of points ahead that are tested for each driver.

    Returns:
        In the order of travel.
    """
    num_stations = len(path.points.x) - num_ahead
    distances = []
    for eye, ahead in _eye_blocks(num_stations, num_ahead):
        target_bearing = side * _bearing(path, eye, path.points, ahead)
        wall_bearing = side * _bearing(path, eye, wall, ahead)
        # A part of the wall that is not ahead hides nothing.
        wall_bearing = np.where(np.isfinite(wall_bearing), wall_bearing, _HIDES_NOTHING)
        nearest_wall = np.minimum.accumulate(wall_bearing, axis=1)
        is_ahead = np.isfinite(target_bearing)
        margin = np.where(is_ahead, nearest_wall - target_bearing, _NOT_AHEAD_MARGIN)
        distances.append(_distance_to_first_hidden(margin))
    return np.concatenate(distances)


def _bearing(path: Path, eye: IndexArray, points: Points, index: IndexArray) -> F64:
    """Tangent of the angle from the direction of travel to points, positive to the left [1].

    The tangent orders directions as the angle does, without an arctangent for each pair.

    Args:
        path: Positions and directions of the eyes.
        eye: Indices of the eyes, shape (eye, 1).
        points: The points whose bearing is computed.
        index: Indices of these points, shape (eye, point).

    Returns:
        Shape (eye, point); infinite for points that are not ahead.
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

    An object is visible if the line from the eye to its top is at least as steep as the lines to
    all points of the road up to there.

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
    """Indices of the eyes of a block, shape (eye, 1), and of the points ahead, (eye, point)."""
    for first in range(0, num_stations, _EYES_PER_BLOCK):
        eye = np.arange(first, min(first + _EYES_PER_BLOCK, num_stations))[:, None]
        yield eye, eye + np.arange(1, num_ahead + 1)


def _distance_to_first_hidden(margin: F64) -> F64:
    """Distance at which a margin first falls below zero, linear between points, shape (eye,) [m].

    Args:
        margin: Shape (eye, point); negative for a hidden point. Point k is k + 1 spacings ahead.

    Returns:
        At least one spacing, as a driver always sees the road in front of the vehicle, and
        `max_sight()` if no point is hidden.
    """
    is_hidden = margin < 0.0
    has_hidden = is_hidden.any(axis=1)
    eye = np.arange(len(margin))
    # `argmax` gives the first hidden point, and 0 if there is no hidden point.
    first = np.argmax(is_hidden, axis=1)
    last_visible, first_hidden = margin[eye, np.maximum(first - 1, 0)], margin[eye, first]
    # Share of the spacing from the last visible to the first hidden point at which the margin is 0.
    # It stays 0 if point 0 is hidden, so that no visible point precedes, or if no point is hidden;
    # the divisor of 1 then avoids a division by 0. Margins made of `_HIDES_NOTHING` or
    # `_NOT_AHEAD_MARGIN` give an arbitrary share; the error is below one spacing.
    fall = np.where(first > 0, last_visible - first_hidden, 1.0)
    share = np.where(first > 0, last_visible / fall, 0.0)
    # The last visible point is `first` spacings ahead.
    distance = np.clip((first + share) * station_spacing(), station_spacing(), max_sight())
    return np.where(has_hidden, distance, max_sight())


def _in_order_of_road(distance: F64, direction: int) -> F64:
    """Sort distances in the order of travel into the order of the road."""
    return distance if direction > 0 else distance[::-1]
