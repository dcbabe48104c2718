"""The road for the step: lateral axis towards the fast side, padded to a fixed size."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F32, F64, Mask
from overtaking.core.errors import ConfigError
from overtaking.core.float32_math import as_f32, clamp, minimum, sincos
from overtaking.knowledge.toml_reader import constant
from overtaking.model.road import MAX_LANES, DrivingSide, Road, RoadMark
from overtaking.model.road_course import RoadCourse
from overtaking.model.scenario import Scenario
from overtaking.world import road_surface
from overtaking.world.constants import ModelConstants
from overtaking.world.sight_distance import visible_distance

MAX_KNOTS = 64
"""Most stations between which sight, or the line between the directions, changes."""

_SOLID = (RoadMark.SOLID, RoadMark.SOLID_SOLID, RoadMark.SOLID_BROKEN)
"""Lines that are not crossed from their first side."""

_FAR = 1e9
"""Where a road does not limit sight [m]."""

_RADIUS, _ALLOWED = slice(2, 4), slice(8, 10)
"""Rows of `RoadParameters.course` along and against the road."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadParameters:
    """The road as the step sees it, lateral axis towards the fast side.

    Attributes:
        num_lanes: Driving lanes; on a two-way road that of oncoming traffic is one of them.
        own_lanes: Those of the road's own direction.
        two_way: Whether others may come the other way.
        far_end: Station from which oncoming vehicles count theirs, the end of the road [m].
        across: Sum of the edges: what an oncoming vehicle takes its lateral position from [m].
        sight: Along and against the road: stations, how far one sees there [m], and how much more
            per metre; (2, 3, MAX_KNOTS).
        line: Stations, and 1 from where on the line is not to be crossed by who drives along the
            road, and by who comes the other way; (3, MAX_KNOTS).
        course: What the road does at stations every `model.steering.station`: curvature towards
            the fast side [1/m], sine of the slope, and along and against the road the radius by
            which drivers choose their speed [m], see `_course`, how far they see [m], how far
            from a truck [m], and the speed up to which limits let them drive [m/s], see `_allowed`;
            (10, station), no station where the road is straight and level and has one limit.
        boundaries: Lane borders from slow to fast, padded with the last, shape (MAX_LANES + 1,)
            [m].
        film_path: `film.film_per_path` of each lane, padded, shape (MAX_LANES,).
        side: +1 in right-hand traffic, -1 in left-hand traffic.
        x0: World x of the road's origin [m].
        y0: World y [m].
        heading: Direction of travel [rad].
        cosine: Of the heading.
        sine: Of the heading.
    """

    num_lanes: int
    own_lanes: int
    two_way: bool
    far_end: np.float32
    across: np.float32
    sight: F32
    line: F32
    course: F32
    boundaries: F32
    film_path: F32
    side: np.float32
    x0: np.float32
    y0: np.float32
    heading: np.float32
    cosine: np.float32
    sine: np.float32


@lru_cache(maxsize=16)
def road_parameters(road: Road) -> RoadParameters:
    """The road as the step sees it; all callers share its arrays, which must not be changed."""
    side = np.float32(1.0 if road.driving_side is DrivingSide.RIGHT else -1.0)
    borders = side * as_f32(road.boundaries)
    two_way = has_two_directions(road)
    if two_way:
        # The opposing lane is one more lane, as wide as lane 0. Turned by half a circle each lane
        # becomes the other, so oncoming vehicles are simulated like all others, in a frame of their
        # own.
        borders = np.append(borders, borders[-1] + np.float32(road.lanes[0].width))
    across = borders[0] + borders[-1]
    num_lanes = len(borders) - 1
    borders = _padded(borders)
    crown = borders[road.num_lanes] if two_way else borders[-1]
    course = _course(road)
    # On a road that bends the step knows stations and offsets alone; see `model.placed`.
    pose = (0.0, 0.0, 0.0) if road.bends else (road.x0, road.y0, road.heading)
    x0, y0, heading = map(np.float32, pose)
    sine, cosine = sincos(heading)
    return RoadParameters(
        num_lanes=num_lanes,
        own_lanes=road.num_lanes,
        two_way=two_way,
        far_end=np.float32(road.length),
        across=across,
        sight=_sight(road) if two_way else np.zeros((2, 3, MAX_KNOTS), np.float32),
        line=_line(road) if two_way else np.zeros((3, MAX_KNOTS), np.float32),
        course=course,
        boundaries=borders,
        film_path=road_surface.film_path_factor(_drainage_path(borders, crown)),
        side=side,
        x0=x0,
        y0=y0,
        heading=heading,
        cosine=np.float32(cosine),
        sine=np.float32(sine),
    )


def _padded(borders: F32) -> F32:
    """Borders with the last one repeated, so that lanes which do not exist have no width."""
    return np.concatenate([borders, np.full(MAX_LANES + 1 - len(borders), borders[-1], np.float32)])


def _drainage_path(borders: F32, crown: np.float32) -> F32:
    """How far water has run from the crown to the middle of each lane [m].

    The crown is the fast edge, and on a two-way road the line between the directions.
    """
    middle = (borders[1:] + borders[:-1]) * np.float32(0.5)
    return np.maximum(np.abs(crown - middle), constant("model.water.min_drainage_path"))


def has_two_directions(road: Road) -> bool:
    """Whether traffic of both directions can be simulated: one lane each, equally wide.

    A course may have `MAX_KNOTS` - 1 stations. Elsewhere vehicles keep to the lanes of the road's
    own direction.
    """
    beyond, course = road.fast_side_neighbour, road.course or RoadCourse()
    return (
        road.is_two_way
        and road.num_lanes == 1
        and beyond is not None
        and beyond.width == road.lanes[0].width
        and max(map(len, (course.sight, course.sight_against, road.fast_edge_marks))) < MAX_KNOTS
    )


def refuse_oncoming(scenario: Scenario, where: str) -> None:
    """ConfigError for vehicles that come the other way.

    Args:
        scenario: A batch of scenarios.
        where: A part of the package that knows one direction only.
    """
    road = scenario.road
    if (scenario.vehicles.valid & (scenario.start_lane == road.num_lanes)).any():
        raise ConfigError.of(
            what=f"traffic on road {road.name}",
            where=where,
            expected="vehicles that all drive the same way",
            got="oncoming ones",
            next_step="choose another profile",
        )


def _sight(road: Road) -> F32:
    """Along and against: stations, sight there, and its change per metre; see `_knots`."""
    course = road.course or RoadCourse()
    both = []
    for table in (course.sight, course.sight_against):
        stations = np.array([s for s, _ in table] or [0.0], np.float64)
        seen = np.array([distance for _, distance in table] or [_FAR], np.float64)
        change = np.append(np.diff(seen) / np.diff(stations), 0.0)
        # Before the first station sight is as there.
        rows = [np.append(-_FAR, stations), np.append(seen[0], seen), np.append(0.0, change)]
        both.append(_knots(rows))
    return np.stack(both)


def _line(road: Road) -> F32:
    """Stations, and whether the line is solid from there on for the one and the other direction."""
    marks = road.fast_edge_marks
    stations = [max(start, -_FAR) for start, _ in marks]
    along = [float(mark in _SOLID) for _, mark in marks]
    against = [float(mark.reversed in _SOLID) for _, mark in marks]
    return _knots([stations, along, against])


def _course(road: Road) -> F32:
    """Curvature, slope, speeds and sight by station, the rows of `RoadParameters.course`.

    The curvature is the mean around a station, so that turning adds up to that of the line. The
    radius that counts for the speed is the least of R + 2 (b / a) x over all bends of radius R at a
    way x ahead: who drives at the root of a times it comes into each bend with the lateral
    acceleration a, having braked by b.
    """
    if road.course is None or not (road.course.line or road.course.grade or road.course.limits):
        return np.zeros((10, 0), np.float32)
    spacing = float(constant("model.steering.station"))
    stations = np.arange(math.ceil(road.length / spacing) + 1, dtype=np.float64) * spacing
    turn = road.heading_at(stations + 0.5 * spacing) - road.heading_at(stations - 0.5 * spacing)
    turn = turn - math.tau * np.rint(turn / math.tau)  # Pieces may count their turns anew.
    curvature = turn / spacing
    slope = road.grade_at(stations)
    rise = 2.0 * float(
        constant("model.steering.bend_decel") / constant("model.steering.bend_accel")
    )
    radius = 1.0 / np.maximum(np.abs(curvature), 1.0 / _FAR)
    along = np.minimum.accumulate((radius + rise * stations)[::-1])[::-1] - rise * stations
    against = np.minimum.accumulate(radius - rise * stations) + rise * stations
    rows = [road.side * curvature, slope / np.sqrt(1.0 + slope * slope), along, against]
    allowed = [_allowed(road, stations, direction) for direction in (1, -1)]
    return np.array([*rows, *_shown(road, len(stations)), *allowed], np.float32)


def _allowed(road: Road, stations: F64, direction: int) -> F64:
    """Speed from which one slows down in time to every limit ahead, by station [m/s].

    A way x before a limit l that is the root of l^2 + 2 b x. Each stretch is one station longer at
    either end: whatever is between two stations, within the stretch both have its limit.
    """
    spacing, braking = (
        float(constant(f"model.steering.{one}")) for one in ("station", "bend_decel")
    )
    allowed = np.full(stations.shape, road.speed_limit)
    for one in road.course.speed_limits_for(direction) if road.course else ():
        before, after = one.start - spacing - stations, stations - one.stop - spacing
        ahead, behind = (before, after) if direction > 0 else (after, before)
        speed = np.sqrt(one.speed * one.speed + 2.0 * braking * np.maximum(ahead, 0.0))
        allowed = np.where(behind < 0.0, np.minimum(allowed, speed), allowed)
    return allowed


def along_course(row: F32, station: F32) -> F32:
    """A row of `RoadParameters.course`, linear between its stations and constant beyond.

    Args:
        row: The row, shape (station,).
        station: Where, counted in stations, any shape.
    """
    last = np.float32(len(row) - 1)
    place = clamp(station, np.float32(0.0), last)
    first = minimum(road_surface.floor(place), last - np.float32(1.0))
    low, high = (row[first.astype(np.int64) + k] for k in (0, 1))
    return low + (place - first) * (high - low)


def bend_speed(
    c: ModelConstants, road: RoadParameters, side_accel: F32, s: F32, turned: Mask
) -> F32:
    """Speed that drivers choose for the bends at and ahead of a place [m/s].

    Args:
        c: Constants.
        road: A road that bends or rises.
        side_accel: Largest lateral acceleration that drivers ask for [m/s^2].
        s: Where they are, in the frame of their own direction [m].
        turned: Who comes the other way.
    """
    return np.sqrt(minimum(c.bend_accel, side_accel) * _by_way(c, road, _RADIUS, s, turned))


def allowed_speed(c: ModelConstants, road: RoadParameters, s: F32, turned: Mask) -> F32:
    """Speed up to which the limits at and ahead of a place let one drive [m/s].

    Args:
        c: Constants.
        road: A road with a course.
        s: Where they are, in the frame of their own direction [m].
        turned: Who comes the other way.
    """
    return _by_way(c, road, _ALLOWED, s, turned)


def _by_way(c: ModelConstants, road: RoadParameters, rows: slice, s: F32, turned: Mask) -> F32:
    """The row along the road, or for who comes the other way that against it."""
    station = np.where(turned, road.far_end - s, s) * c.per_station
    along, against = (along_course(row, station) for row in road.course[rows])
    return np.where(turned, against, along)


def _shown(road: Road, count: int) -> list[F64]:
    """How far one sees along and against the road, and how far from a truck [m]."""
    ways = [visible_distance(road, direction) for direction in (1, -1)]
    unlimited = np.full(count, _FAR)
    return [
        unlimited if one is None else np.minimum(one.past_bends, getattr(one, over))
        for over in ("over_crests", "over_crests_from_truck")
        for one in ways
    ]


def _knots(rows: Sequence[ArrayLike]) -> F32:
    """Rows of `MAX_KNOTS` numbers, the last station repeated."""
    table = np.array([np.asarray(row, np.float64) for row in rows])
    rest = np.repeat(table[:, -1:], MAX_KNOTS - table.shape[1], axis=1)
    return np.concatenate([table, rest], axis=1).astype(np.float32)
