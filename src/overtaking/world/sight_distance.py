"""How far a road shows itself: round its bends, over its crests.

Where a course states no sight of its own, it follows from the line and the grade. In bends
something stands beside the lanes, at a clearance from the middle of the lane inside; one sees as
far as a straight line passes it. On a circle of radius R with the clearance m that is
2 R acos(1 - m / R). Over a crest one sees what the road does not cover: on a vertical circle of
radius R, from an eye at a to an object at b, sqrt(2 R) (sqrt(a) + sqrt(b)).

Source:
    AASHTO (2018), chapter 3: sight distance on horizontal curves, and crest vertical curves.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overtaking.core.arrays import F64
from overtaking.knowledge.roads import sight_facts
from overtaking.knowledge.toml_reader import constant
from overtaking.model.reference_line import cos_sin as of_angle
from overtaking.model.road import Road
from overtaking.model.road_course import RoadCourse, RoadZone, ZoneKind

_EYES_PER_BLOCK = 512  # Places whose view is looked at together.
_MIN_AHEAD = 1e-3  # What is not this far ahead has no bearing [m].
_FAR = 1e9  # Bearing of a wall that hides nothing.


class VisibleDistance(NamedTuple):
    """How far one sees from stations `model.steering.station` apart, up to `reach()` [m].

    Attributes:
        past_bends: Past what stands inside of bends.
        over_crests: Over crests, from the eye of who drives a car.
        over_crests_from_truck: Over crests, from the eye of who drives a truck.
    """

    past_bends: F64
    over_crests: F64
    over_crests_from_truck: F64


def max_sight() -> float:
    """Up to which distance roads limit sight here: beyond, nobody looks for who comes [m]."""
    return float(constant("model.oncoming.range"))


def sight_at(road: Road, s: ArrayLike, direction: int = 1) -> F64:
    """How far the driver of a car sees the road.

    Args:
        road: The road.
        s: Where the driver is, any shape [m].
        direction: +1 along the road, -1 against it.

    Returns:
        Distances of the same shape, infinite where the road does not limit sight [m].
    """
    found = visible_distance(road, direction)
    if found is None:
        return (road.course or RoadCourse()).sight_at(s, direction)
    seen = np.minimum(found.past_bends, found.over_crests)
    seen = np.interp(np.asarray(s, np.float64), _stations(road), seen)
    return np.where(seen < max_sight(), seen, np.inf)


def all_zones_for(road: Road, direction: int) -> tuple[RoadZone, ...]:
    """The places that count for a direction of travel, +1 or -1: stated ones, and what follows.

    Where sight follows from the geometry, so do bends of reduced visibility, by Article 19 of the
    Highway Code, and crests, where one sees less than lines let one pass at the limit there.
    """
    stated = road.course.zones_for(direction) if road.course else ()
    return (*stated, *_zones_of_short_sight(road, direction))


@lru_cache(maxsize=16)
def visible_distance(road: Road, direction: int) -> VisibleDistance | None:
    """What follows from the geometry, by station; None where sight is stated or unlimited.

    Args:
        road: The road.
        direction: +1 along the road, -1 against it. The stations are those of the road.
    """
    course = road.course
    if course is None or not (course.line or course.grade):
        return None
    if course.sight or course.sight_against:
        return None
    facts, ahead = sight_facts(), max_sight()
    count = len(_stations(road))
    car = truck = bends = np.full(count, ahead)
    if course.line:
        bends = _sight_round_bends(road, direction, facts.clearance)
    if course.grade:
        eyes = (facts.eye_height, facts.truck_eye_height)
        car, truck = (_sight_over_crests(road, direction, eye, facts.object_height) for eye in eyes)
    return VisibleDistance(bends, car, truck)


@lru_cache(maxsize=16)
def _zones_of_short_sight(road: Road, direction: int) -> tuple[RoadZone, ...]:
    found = visible_distance(road, direction)
    if found is None:
        return ()
    facts = sight_facts()
    limits = road.speed_limit_at(_stations(road), direction)
    passing = np.interp(limits, facts.passing_zone_speeds, facts.passing_zone_sight)
    least = float(constant("law.sight.least"))
    kinds = (
        (ZoneKind.BEND, found.past_bends < least),
        (ZoneKind.CREST, found.over_crests < passing),
    )
    return tuple(
        RoadZone(kind=kind, start=start, stop=stop, direction=direction)
        for kind, low in kinds
        for start, stop in _spans_where(road, low)
    )


def _spans_where(road: Road, low: NDArray[np.bool_]) -> Iterator[tuple[float, float]]:
    """Beginning and end of each stretch whose stations are marked [m]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], low, [False]])))
    stations = np.minimum(_stations(road), road.length)
    for first, beyond in edges.reshape(-1, 2):
        if stations[first] < stations[beyond - 1]:
            yield float(stations[first]), float(stations[beyond - 1])


def station_spacing() -> float:
    """Distance between the stations at which the road is evaluated [m]."""
    return float(constant("model.steering.station"))


def _stations(road: Road) -> F64:
    """The stations of `RoadParameters.course` [m]."""
    count = int(np.ceil(road.length / station_spacing())) + 1
    return np.arange(count, dtype=np.float64) * station_spacing()


def _stations_ahead(road: Road, direction: int) -> tuple[F64, int]:
    """Stations in the order of travel, on beyond the end as far as one looks, and how many.

    Beyond its ends the road goes on straight.
    """
    ahead = round(max_sight() / station_spacing())
    stations = _stations(road)
    way = np.concatenate([stations, stations[-1] + np.arange(1, ahead + 1) * station_spacing()])
    return (way if direction > 0 else stations[-1] - way), ahead


def _sight_round_bends(road: Road, direction: int, clearance: float) -> F64:
    """How far one sees past what stands beside the lanes on either side, by station [m]."""
    way, ahead = _stations_ahead(road, direction)
    heading = of_angle(road.heading_at(way))
    cosine, sine = (direction * each for each in heading)
    found = []
    for left, d in zip((1.0, -1.0), _outer_centres(road), strict=True):
        x, y = road.to_world(way, d)
        beside = road.to_world(way, d + left * clearance)
        # Seen by who drives: to the left of travel against the road is to its right.
        found.append(_sight_past_wall((x, y), beside, (cosine, sine), left * direction, ahead))
    return _by_station(np.minimum(*found), direction)


def _outer_centres(road: Road) -> tuple[float, float]:
    """Middle of the outermost driving lane to the left and to the right, of either direction."""
    middles = list(road.centres)
    if road.is_two_way and (beyond := road.fast_side_neighbour):
        middles.append(road.boundaries[-1] + 0.5 * road.side * beyond.width)
    return float(max(middles)), float(min(middles))


def _sight_past_wall(
    path: tuple[F64, F64],
    wall: tuple[F64, F64],
    heading: tuple[F64, F64],
    side: float,
    ahead: int,
) -> F64:
    """How far one sees along a path past a wall on one side, by station [m].

    Args:
        path: Points of it, x and y.
        wall: The points beside them.
        heading: Cosine and sine of the direction of travel at each.
        side: +1 for a wall to the left, -1 to the right.
        ahead: Number of points that are looked at.
    """
    found = []
    for eye, there in _eye_blocks(len(path[0]) - ahead, ahead):
        target, hides = (
            side * _bearing(points, path, heading, eye, there) for points in (path, wall)
        )
        nearest = np.minimum.accumulate(np.where(np.isfinite(hides), hides, _FAR), axis=1)
        found.append(
            _distance_to_first_hidden(np.where(np.isfinite(target), nearest - target, -1.0))
        )
    return np.concatenate(found)


def _bearing(
    points: tuple[F64, F64],
    path: tuple[F64, F64],
    heading: tuple[F64, F64],
    eye: NDArray[np.intp],
    there: NDArray[np.intp],
) -> F64:
    """Way to the left by way ahead of points as seen from others, infinite for what is not ahead.

    Args:
        points: Points, x and y.
        path: Where the eyes are.
        heading: Cosine and sine of where they look.
        eye: Indices of the eyes, shape (eye, 1).
        there: Indices of the points, shape (eye, point).
    """
    east, north = (at[there] - here[eye] for at, here in zip(points, path, strict=True))
    cosine, sine = (one[eye] for one in heading)
    along, left = east * cosine + north * sine, north * cosine - east * sine
    is_ahead = along > _MIN_AHEAD
    return np.where(is_ahead, left / np.where(is_ahead, along, 1.0), np.inf)


def _sight_over_crests(road: Road, direction: int, eye_height: float, object_height: float) -> F64:
    """How far one sees over the crests of a road, by station [m]."""
    way, ahead = _stations_ahead(road, direction)
    height = road.height_at(way)
    distance = np.arange(1, ahead + 1) * station_spacing()
    found = []
    for eye, there in _eye_blocks(len(way) - ahead, ahead):
        rise = height[there] - (height[eye] + eye_height)
        crest = np.maximum.accumulate(rise / distance, axis=1)
        found.append(_distance_to_first_hidden((rise + object_height) / distance - crest))
    return _by_station(np.concatenate(found), direction)


def _eye_blocks(count: int, ahead: int) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Some stations at a time, shape (eye, 1), and those ahead of each, shape (eye, ahead)."""
    for first in range(0, count, _EYES_PER_BLOCK):
        eye = np.arange(first, min(first + _EYES_PER_BLOCK, count))[:, None]
        yield eye, eye + np.arange(1, ahead + 1)


def _distance_to_first_hidden(margin: F64) -> F64:
    """Distance at which a margin by station ahead first falls below zero, linear in between [m]."""
    hidden = margin < 0.0
    first = np.argmax(hidden, axis=1)
    row = np.arange(len(margin))
    before, after = margin[row, np.maximum(first - 1, 0)], margin[row, first]
    fall = np.where(hidden[row, first], before - after, 1.0)
    share = np.where(first > 0, before / np.where(fall > 0.0, fall, 1.0), 0.0)
    seen = (first + share) * station_spacing()
    # Who sees not even the next station is shown that much of the road.
    return np.where(hidden.any(axis=1), np.clip(seen, station_spacing(), max_sight()), max_sight())


def _by_station(seen: F64, direction: int) -> F64:
    """In the order of the road, from that of travel."""
    return seen if direction > 0 else seen[::-1]
