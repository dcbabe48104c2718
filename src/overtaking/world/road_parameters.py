"""The road in a simulation step: borders of lanes, and tables of sight, lines, geometry and limits.

`road_parameters` converts a `Road` to `RoadParameters`, which the reference simulator and the
compiled engine read. Road coordinates are the station s along the road and the lateral position d.
A `Road` counts d to the left; here d counts towards the overtaking side, so that left-hand traffic
is the mirror image of right-hand traffic. *Against* the road means in the direction of oncoming
traffic. Oncoming vehicles have their own *frame*, a coordinate system turned by half a circle: s
becomes length - s, d becomes `edge_sum` - d.

`Road.course` holds everything that changes along the road: segments of the reference line, grade,
sight distances that a map states, speed limits, marks of the centre line. `constant` reads a number
of the model from `knowledge/data`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F32, F64, Mask
from overtaking.core.errors import ConfigError
from overtaking.core.float32_math import HALF, ONE, ZERO, as_f32, clamp, minimum, sincos
from overtaking.knowledge.toml_reader import constant
from overtaking.model.road import MAX_LANES, Road, RoadMark
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan, StationTable
from overtaking.model.scenario import Scenario
from overtaking.world import road_surface
from overtaking.world.constants import ModelConstants
from overtaking.world.sight_distance import visible_distance

MAX_STATIONS = 64
"""Number of columns of the tables of sight and of the line between the directions. A choice;
the compiled engine has tables of the same size."""

_SOLID = (RoadMark.SOLID, RoadMark.SOLID_SOLID, RoadMark.SOLID_BROKEN)
"""Marks that a vehicle must not cross from the lane that the mark belongs to. The first word of a
double line names the line nearer to that lane."""

_FAR = 1e9
"""A sight distance or radius that limits nothing [m]. It is finite, because interpolation between
infinite numbers gives NaN. `-_FAR` is a station before the start of every road."""


class CourseTable(NamedTuple):
    """Geometry, sight and speed limits of a road at equally spaced stations.

    Every row has shape (station,). The stations begin at s = 0 and are 2 m apart
    (`model.steering.station`); the last one is at the end of the road or beyond it. The rows are
    empty if the road is straight and level and has one speed limit. Rows that end in `_against`
    hold for drivers against the road; they, too, are in the order of s.

    Attributes:
        curvature: Positive where the road bends towards the overtaking side [1/m].
        sine_of_slope: Positive where the road rises along `s` [1].
        radius_along: Radius by which drivers along the road choose their speed: large where the
            next bends are wide or far ahead. `_course_table` has the formula [m].
        radius_against: The same for the other direction [m].
        sight_along: Length of road that a car driver sees past bends and over crests. It is `_FAR`
            if the road has neither, or if the map states sight distances, which
            `RoadParameters.sight` holds [m].
        sight_against: The same for the other direction [m].
        truck_sight_along: Length of road that a truck driver sees. The higher eye sees farther over
            crests than the eye of a car driver [m].
        truck_sight_against: The same for the other direction [m].
        allowed_speed_along: Largest speed that the limits here and ahead allow: a driver at this
            speed can slow down in time for each limit [m/s].
        allowed_speed_against: The same for the other direction [m/s].
    """

    curvature: F32
    sine_of_slope: F32
    radius_along: F32
    radius_against: F32
    sight_along: F32
    sight_against: F32
    truck_sight_along: F32
    truck_sight_against: F32
    allowed_speed_along: F32
    allowed_speed_against: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadParameters:
    """The road in the step, with the lateral axis towards the overtaking side.

    Attributes:
        num_lanes: Number of lanes that vehicles use, including the opposing lane if
            `has_oncoming_traffic`.
        num_own_lanes: Number of lanes of the road's own direction.
        has_oncoming_traffic: Whether vehicles may come in the opposing lane, see
            `has_two_directions`.
        length: End of the road, from which oncoming vehicles count their stations [m].
        edge_sum: Sum of the lateral positions of both edges. An oncoming vehicle at d is at
            `edge_sum` - d in the frame of its own direction [m].
        sight: Sight distances that the map states, first for drivers along the road, then against
            it. For each direction three rows: stations, from the start of the road [m], sight
            distance there [m], its change per metre from there on [1]. Shape (2, 3, MAX_STATIONS);
            zeros without oncoming traffic.
        solid_line: Three rows: stations [m]; 1 if from there on traffic along the road must not
            cross the line between the directions, else 0; the same for oncoming traffic. Shape
            (3, MAX_STATIONS); zeros without oncoming traffic.
        course_table: Geometry, computed sight and limits by station.
        boundaries: Lane borders from the kerb side to the overtaking side, then copies of the last
            one. Shape (MAX_LANES + 1,) [m].
        film_path: Factor of the film of water in each lane (`road_surface.film_path_factor`). It
            grows with the lane's distance from the crown, the highest line of the road. Shape
            (MAX_LANES,) [1].
        overtaking_sign: +1 if the overtaking side is the left (right-hand traffic), else -1.
        x0: World x of (s, d) = (0, 0). It is 0 for a road that bends, as are `y0` and `heading`:
            the step does not convert positions on it to the world [m].
        y0: World y of the same point [m].
        heading: Direction of travel, anticlockwise from world x [rad].
        cosine: Cosine of the heading.
        sine: Sine of the heading.
    """

    num_lanes: int
    num_own_lanes: int
    has_oncoming_traffic: bool
    length: np.float32
    edge_sum: np.float32
    sight: F32
    solid_line: F32
    course_table: CourseTable
    boundaries: F32
    film_path: F32
    overtaking_sign: np.float32
    x0: np.float32
    y0: np.float32
    heading: np.float32
    cosine: np.float32
    sine: np.float32

    @property
    def varies_along_road(self) -> bool:
        """Whether the road bends, rises or has several speed limits."""
        return bool(self.course_table.curvature.size)


@lru_cache(maxsize=16)
def road_parameters(road: Road) -> RoadParameters:
    """Compute the parameters of a road.

    Results of the last 16 roads are cached: all callers share the arrays and must not change them.

    Args:
        road: The road.

    Returns:
        Its parameters, in float32.
    """
    overtaking_sign = np.float32(road.overtaking_sign)
    borders = overtaking_sign * as_f32(road.lane_boundaries)
    has_oncoming_traffic = has_two_directions(road)
    if has_oncoming_traffic:
        # The opposing lane is one more lane, as wide as lane 0. A turn by half a circle exchanges
        # the two lanes, so the step treats oncoming vehicles like all others, in their frame.
        borders = np.append(borders, borders[-1] + np.float32(road.lanes[0].width))
    edge_sum = borders[0] + borders[-1]
    num_lanes = len(borders) - 1
    crown = borders[road.num_lanes]
    borders = _pad_borders(borders)
    empty_sight = np.zeros((2, 3, MAX_STATIONS), np.float32)
    empty_line = np.zeros((3, MAX_STATIONS), np.float32)
    # One position and heading describe a straight road only. On a road that bends, the recording
    # converts the positions of vehicles to the world, after the simulation.
    pose = (0.0, 0.0, 0.0) if road.is_curved else (road.x0, road.y0, road.heading)
    x0, y0, heading = map(np.float32, pose)
    sine, cosine = map(np.float32, sincos(heading))
    return RoadParameters(
        num_lanes=num_lanes,
        num_own_lanes=road.num_lanes,
        has_oncoming_traffic=has_oncoming_traffic,
        length=np.float32(road.length),
        edge_sum=edge_sum,
        sight=_sight_table(road) if has_oncoming_traffic else empty_sight,
        solid_line=_line_table(road) if has_oncoming_traffic else empty_line,
        course_table=_course_table(road),
        boundaries=borders,
        film_path=road_surface.film_path_factor(_drainage_path(borders, crown)),
        overtaking_sign=overtaking_sign,
        x0=x0,
        y0=y0,
        heading=heading,
        cosine=cosine,
        sine=sine,
    )


def has_two_directions(road: Road) -> bool:
    """Whether traffic of both directions can be simulated: one lane each, equally wide.

    On all other roads vehicles keep to the lanes of the road's own direction. They also do so if
    the tables of the step are too short: the map states sight distances, or changes of the centre
    line, at `MAX_STATIONS` stations or more.

    Args:
        road: The road.
    """
    opposing_lane, course = road.overtaking_side_neighbour, road.course or RoadCourse()
    tables = (course.sight, course.sight_against, road.overtaking_edge_marks)
    # "<", not "<=": `_sight_table` adds a station.
    fits_tables = max(map(len, tables)) < MAX_STATIONS
    return (
        road.is_two_way
        and road.num_lanes == 1
        and opposing_lane is not None
        and opposing_lane.width == road.lanes[0].width
        and fits_tables
    )


def check_one_direction(scenario: Scenario, where: str) -> None:
    """Check that no vehicle starts in the opposing lane.

    Args:
        scenario: A batch of scenarios.
        where: Simulator ("SUMO") or kind of road with traffic in one direction only, for the
            message.

    Raises:
        ConfigError: A vehicle drives in the opposite direction.
    """
    road = scenario.road
    # `Scenario` counts the road's own lanes from 0; the next index is the opposing lane.
    is_oncoming = scenario.vehicles.valid & (scenario.start_lane == road.num_lanes)
    if is_oncoming.any():
        raise ConfigError(
            what=f"traffic on road {road.name}",
            where=where,
            expected="vehicles that all drive the same way",
            got="oncoming ones",
            next_step="choose another profile",
        )


def bend_speed(
    constants: ModelConstants,
    road: RoadParameters,
    max_lateral_accel: F32,
    s: F32,
    is_oncoming: Mask,
) -> F32:
    """Speed that drivers choose for the bends at their position and ahead of it [m/s].

    Args:
        constants: Constants of the model.
        road: A road that `varies_along_road`; the table of other roads is empty.
        max_lateral_accel: Largest lateral acceleration that drivers dare at the friction that they
            assume, a shape that broadcasts with `s` [m/s^2].
        s: Stations of the drivers, in the frame of their own direction, any shape [m].
        is_oncoming: Whether they drive against the road, the same shape.

    Returns:
        Speeds of the same shape.
    """
    table = road.course_table
    rows = (table.radius_along, table.radius_against)
    radius = _value_for_direction(constants, road, rows, s, is_oncoming)
    return np.sqrt(minimum(constants.bend_accel, max_lateral_accel) * radius)


def allowed_speed(
    constants: ModelConstants, road: RoadParameters, s: F32, is_oncoming: Mask
) -> F32:
    """Largest speed that the limits at a position and ahead of it allow [m/s].

    Args:
        constants: Constants of the model.
        road: A road that `varies_along_road`; the table of other roads is empty.
        s: Stations of the drivers, in the frame of their own direction, any shape [m].
        is_oncoming: Whether they drive against the road, the same shape.

    Returns:
        Speeds of the same shape.
    """
    table = road.course_table
    rows = (table.allowed_speed_along, table.allowed_speed_against)
    return _value_for_direction(constants, road, rows, s, is_oncoming)


def interpolate_course(row: F32, position: F32) -> F32:
    """Interpolate a row of a `CourseTable` linearly; it is constant beyond its ends.

    Unlike `np.interp`, which computes in float64, it has the float32 operations of the engine, so
    that both simulators have the same results.

    Args:
        row: The row, shape (station,), at least two columns.
        position: Positions in the row: stations over the spacing of the columns, any shape [1].

    Returns:
        Values of the shape of `position`, in the unit of the row.
    """
    last = np.float32(len(row) - 1)
    position = clamp(position, ZERO, last)
    # At the last column, `first` is the column before it: an interval needs two columns.
    first = minimum(road_surface.floor(position), last - ONE)
    low, high = (row[first.astype(np.int64) + k] for k in (0, 1))
    return low + (position - first) * (high - low)


def _value_for_direction(
    constants: ModelConstants,
    road: RoadParameters,
    rows: tuple[F32, F32],
    s: F32,
    is_oncoming: Mask,
) -> F32:
    """Interpolate two rows of the course: the first, or the second for oncoming vehicles."""
    position = np.where(is_oncoming, road.length - s, s) * constants.per_station
    along, against = (interpolate_course(row, position) for row in rows)
    return np.where(is_oncoming, against, along)


def _pad_borders(borders: F32) -> F32:
    """Extend the borders to `MAX_LANES` + 1: lanes that do not exist have the width 0."""
    return np.concatenate([borders, np.full(MAX_LANES + 1 - len(borders), borders[-1], np.float32)])


def _drainage_path(borders: F32, crown: np.float32) -> F32:
    """Length of the water's path from the crown to the middle of each lane, (MAX_LANES,) [m].

    The crown is the highest line of the cross section: the border on the overtaking side of the
    road's own lanes, which on a two-way road is the line between the directions.
    """
    centres = (borders[1:] + borders[:-1]) * HALF
    # The lower limit keeps a path of length 0 from being dry in any rain.
    return np.maximum(np.abs(crown - centres), constant("model.water.min_drainage_path"))


def _sight_table(road: Road) -> F32:
    """The table `RoadParameters.sight`, along the road and against it."""
    course = road.course or RoadCourse()
    tables = []
    for pairs in (course.sight, course.sight_against):
        # If the map states no sight distance for this direction, sight is unlimited everywhere.
        sight = StationTable.from_pairs(pairs or ((0.0, _FAR),))
        # The step interpolates from the last station behind a driver. Drivers before the first
        # stated station need one, too: an additional station, with the same sight distance.
        rows = [
            np.append(-_FAR, sight.station),
            np.append(sight.value[0], sight.value),
            np.append(0.0, sight.change_per_metre),
        ]
        tables.append(_pad_stations(rows))
    return np.stack(tables)


def _line_table(road: Road) -> F32:
    """The table `RoadParameters.solid_line`."""
    marks = road.overtaking_edge_marks
    # The first mark begins at minus infinity; the stations of the table are finite.
    stations = [max(start, -_FAR) for start, _ in marks]
    along = [float(mark in _SOLID) for _, mark in marks]
    # `reverse` is the same mark as seen from the opposing lane.
    against = [float(mark.reverse in _SOLID) for _, mark in marks]
    return _pad_stations([stations, along, against])


def _course_table(road: Road) -> CourseTable:
    """Curvature, slope, radii, sight and allowed speeds by station.

    The curvature of a station is the mean over one spacing around it, so that the turns of all
    stations add up to the turn of the line.

    Drivers choose their speed by the smallest R + 2 (b / a) x over all bends of radius R at a
    distance x ahead, with the lateral acceleration a (`bend_accel`) and the deceleration b
    (`bend_decel`). From the speed sqrt(a (R + 2 (b / a) x)) a driver that brakes by b enters the
    bend at the speed sqrt(a R), that is with the lateral acceleration a.
    """
    course = road.course
    if course is None or not (course.segments or course.grade or course.speed_limit_spans):
        return CourseTable._make(np.zeros((len(CourseTable._fields), 0), np.float32))
    spacing = float(constant("model.steering.station"))
    stations = np.arange(math.ceil(road.length / spacing) + 1, dtype=np.float64) * spacing
    turn = road.heading_at(stations + 0.5 * spacing) - road.heading_at(stations - 0.5 * spacing)
    # Segments may state headings that differ by full turns: take the smallest equivalent turn.
    turn = turn - math.tau * np.rint(turn / math.tau)
    curvature = turn / spacing
    slope = road.grade_at(stations)
    decel_over_accel = float(
        constant("model.steering.bend_decel") / constant("model.steering.bend_accel")
    )
    # A station on a straight counts as a bend of radius `_FAR`.
    radius = 1.0 / np.maximum(np.abs(curvature), 1.0 / _FAR)
    # With x as a difference of two stations, the smallest sum is a running minimum: from the end
    # of the road backwards for drivers along it, from its start for drivers against it.
    radius_gain = 2.0 * decel_over_accel * stations
    radius_along = np.minimum.accumulate((radius + radius_gain)[::-1])[::-1] - radius_gain
    radius_against = np.minimum.accumulate(radius - radius_gain) + radius_gain
    allowed_along, allowed_against = (
        _allowed_speeds(road.speed_limit, course.speed_limits_for(direction), stations, direction)
        for direction in (1, -1)
    )
    # In the order of the fields of `CourseTable`.
    rows = [
        road.overtaking_sign * curvature,
        slope / np.sqrt(1.0 + slope * slope),
        radius_along,
        radius_against,
        *_sight_rows(road, len(stations)),
        allowed_along,
        allowed_against,
    ]
    return CourseTable._make(np.array(rows, np.float32))


def _allowed_speeds(
    default_limit: float, spans: Sequence[SpeedLimitSpan], stations: F64, direction: int
) -> F64:
    """Largest speed from which a driver slows down in time for every limit ahead [m/s].

    At a distance x before the span of a limit l it is sqrt(l^2 + 2 b x), with the deceleration b
    (`bend_decel`). `interpolate_course` is linear between stations, so the stations on both sides
    of a vehicle in a span must have the limit: each span is extended by one spacing at either end.

    Args:
        default_limit: Limit outside all spans [m/s].
        spans: Stretches with a lower limit that applies to this direction.
        stations: Stations in ascending order, shape (station,) [m].
        direction: +1 along the road, -1 against it.

    Returns:
        Shape (station,).
    """
    spacing = float(constant("model.steering.station"))
    decel = float(constant("model.steering.bend_decel"))
    allowed = np.full(stations.shape, default_limit)
    for span in spans:
        before_start = span.start - spacing - stations
        past_stop = stations - span.stop - spacing
        # A vehicle against the road reaches the span at its `stop` and leaves it at its `start`.
        distance_ahead, distance_behind = (
            (before_start, past_stop) if direction > 0 else (past_stop, before_start)
        )
        speed = np.sqrt(span.speed * span.speed + 2.0 * decel * np.maximum(distance_ahead, 0.0))
        # A vehicle that has left the span is free of its limit.
        allowed = np.where(distance_behind < 0.0, np.minimum(allowed, speed), allowed)
    return allowed


def _sight_rows(road: Road, num_stations: int) -> list[F64]:
    """Four rows of sight distances: from a car along and against the road, then from a truck [m].

    `visible_distance` returns None if the road has neither bends nor grades, or if the map states
    sight distances (`RoadParameters.sight`).
    """
    unlimited = np.full(num_stations, _FAR)
    from_car, from_truck = [], []
    for direction in (1, -1):
        visible = visible_distance(road, direction)
        if visible is None:
            from_car.append(unlimited)
            from_truck.append(unlimited)
        else:
            from_car.append(np.minimum(visible.past_bends, visible.over_crests))
            from_truck.append(np.minimum(visible.past_bends, visible.over_crests_from_truck))
    return [*from_car, *from_truck]


def _pad_stations(rows: Sequence[ArrayLike]) -> F32:
    """Extend rows of equal length to `MAX_STATIONS` numbers by copies of their last number.

    Copies keep the stations in ascending order, as the search in the tables requires.
    """
    table = np.array([np.asarray(row, np.float64) for row in rows])
    padding = np.repeat(table[:, -1:], MAX_STATIONS - table.shape[1], axis=1)
    return np.concatenate([table, padding], axis=1).astype(np.float32)
