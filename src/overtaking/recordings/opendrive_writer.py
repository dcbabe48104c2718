"""One road as OpenDRIVE, for simulators and for scenarios in OpenSCENARIO.

The reference line is the road's own, so that stations, offsets and lane ids are the same in the
file; where lane ids say that traffic runs against the line, the line runs the other way. Its pieces
are lines, arcs and clothoids, its heights quadratic between the stations of the grade. The lane of
oncoming traffic lies across the line; the line between the directions has a mark for each stretch.
Each stretch with a limit of its own has a type with it; where oncoming traffic has others, its lane
states them. Places and how far one sees are no part of the file.
"""

import dataclasses
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.core.units import kmh_from_mps
from overtaking.model.reference_line import CurveSegment
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark
from overtaking.model.road_course import CentreLineSpan, RoadCourse, RoadZone, SpeedLimitSpan
from overtaking.recordings.opendrive_lanes import MARKS
from overtaking.recordings.xml import quoted

S = TypeVar("S", CentreLineSpan, SpeedLimitSpan, RoadZone)
T = TypeVar("T")

_NAMES = {mark: name for name, mark in MARKS.items()}
_NAMES[RoadMark.OTHER] = "none"  # OpenDRIVE has no word for an unknown mark.
_MARK_WIDTH = 0.15
"""Width of a painted line, as on Portuguese motorways [m]."""

_TAIL = 10.0
"""Length of the last lane section [m]: CARLA's topology, on which its Traffic Manager drives, has
pairs of successive lane sections, so a road needs two of them and is driven up to the last."""
_NO_PLACE = "+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"

_SHORTEST = 1e-6
"""A shorter piece is none, but the rounding of a sum [m]."""

Marks = tuple[tuple[float, RoadMark], ...]
"""Where each mark of a line begins, by station of the file, the first at or before 0 [m]."""

Limits = tuple[tuple[float, float], ...]
"""Where each limit begins, by station of the file, the first at 0 [m], and the limit [m/s]."""


class _Strip(NamedTuple):
    """A lane as the file has it: its outer border is the one away from the reference line."""

    lane_id: int
    kind: str
    width: float
    outer_marks: Marks
    limits: Limits = ()


def write_opendrive(road: Road, *, road_id: str = "1") -> str:
    """The text of an OpenDRIVE 1.7 file with one road.

    Args:
        road: The road. `read_opendrive` gives it back, under the name of the file; places and sight
            are left out. Coordinates in the file count from the origin of the road, which is the
            offset in the header: simulators compute in float32 and need small coordinates.
        road_id: Its id in the file.

    Raises:
        ConfigError: Its lane ids are not consecutive ones of one side.
    """
    right = road.lanes[0].lane_id < 0
    along = right == (road.driving_side is DrivingSide.RIGHT)
    line = whole_plan(road)
    if not along:
        line = [piece.reverse() for piece in reversed(line)]
    inner = _inner_edge(road) * (1.0 if along else -1.0)
    name = quoted(road.name)
    rule = "RHT" if road.driving_side is DrivingSide.RIGHT else "LHT"
    sections = "".join(_sections(road, right=right, along=along))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<OpenDRIVE><header revMajor="1" revMinor="7" name={name} version="1.00">'
        f"<geoReference><![CDATA[{_NO_PLACE}]]></geoReference>{_offset(road)}</header>\n"
        f'<road name={name} length="{road.length!r}" id={quoted(road_id)} junction="-1"'
        f' rule="{rule}">\n'
        f"{''.join(_types(road, along=along))}\n"
        f"<planView>{''.join(_plan_view(line))}</planView>\n"
        f"<elevationProfile>{''.join(_heights(road, along=along))}</elevationProfile>\n"
        f'<lanes><laneOffset s="0" a="{inner!r}" b="0" c="0" d="0"/>\n'
        f"{sections}</lanes>\n"
        "</road></OpenDRIVE>\n"
    )


def _offset(road: Road) -> str:
    """The `<offset>` of a road with an origin, else empty."""
    if not (road.origin_x or road.origin_y):
        return ""
    return f'<offset x="{road.origin_x!r}" y="{road.origin_y!r}" z="0" hdg="0"/>'


def covering(road: Road, begin: float, end: float) -> Road:
    """The same road from one station to another, which is farther on; stations count from there.

    Args:
        road: The road; before its start and beyond its end it goes on straight.
        begin: Where it is to begin, at its start or before [m].
        end: Where it is to end, at its end or beyond [m].
    """
    x, y = road.to_world(begin, 0.0)
    course = road.course
    if course is not None and begin < 0.0:
        course = _moved(course, -begin, CurveSegment(float(x), float(y), road.heading, -begin))
    return dataclasses.replace(road, x0=float(x), y0=float(y), length=end - begin, course=course)


def _moved(course: RoadCourse, by: float, before: CurveSegment) -> RoadCourse:
    """A course that begins so much farther on, behind a straight piece."""

    def table(given: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        return tuple((s + by, value) for s, value in given)

    def farther(one: S) -> S:
        return dataclasses.replace(one, start=one.start + by, stop=one.stop + by)

    return RoadCourse(
        segments=(before, *course.segments) if course.segments else (),
        grade=table(course.grade),
        centre_line_spans=tuple(map(farther, course.centre_line_spans)),
        speed_limit_spans=tuple(map(farther, course.speed_limit_spans)),
        zones=tuple(map(farther, course.zones)),
        sight=table(course.sight),
        sight_against=table(course.sight_against),
    )


def whole_plan(road: Road) -> list[CurveSegment]:
    """The pieces of the reference line, as long as the road: beyond them it goes on straight."""
    if not road.is_curved:
        return [CurveSegment(road.x0, road.y0, road.heading, road.length)]
    kept: list[CurveSegment] = []
    covered = 0.0
    for piece in road.segments:
        length = min(piece.length, road.length - covered)
        if length > _SHORTEST:
            bend = piece.curvature + (piece.end_curvature - piece.curvature) * length / piece.length
            kept.append(piece._replace(length=length, end_curvature=bend))
        covered += piece.length
    if road.length - covered > _SHORTEST:
        x, y = road.to_world(covered, 0.0)
        heading = float(road.heading_at(covered))
        kept.append(CurveSegment(float(x), float(y), heading, road.length - covered))
    return kept


def _limits(road: Road, direction: int, *, along: bool) -> Limits:
    """The limits for a direction of travel, from station to station of the file."""
    lower = road.course.speed_limits_for(direction) if road.course else ()
    ends = {end for one in lower for end in (one.start, one.stop)} - {road.length}
    stations = sorted({0.0, *ends})
    limits = road.speed_limit_at(stations, direction).tolist()
    if not along:
        stations = [0.0, *(road.length - station for station in reversed(stations[1:]))]
        limits = limits[::-1]
    return tuple(zip(stations, limits, strict=True))


def _speed(limit: float, station: float | None = None) -> str:
    """The element of a limit, of a lane with its station from the section on."""
    offset = "" if station is None else f'sOffset="{station or 0!r}" '
    return f'<speed {offset}max="{kmh_from_mps(limit):.13g}" unit="km/h"/>'


def _types(road: Road, *, along: bool) -> Iterator[str]:
    """The type of the road from each station on at which the limit changes."""
    for station, limit in _limits(road, 1, along=along):
        yield f'<type s="{station or 0!r}" type={quoted(road.kind)}>{_speed(limit)}</type>'


def _plan_view(line: Sequence[CurveSegment]) -> Iterator[str]:
    """The elements of the pieces of the reference line."""
    station = 0.0
    for piece in line:
        k, end = piece.curvature, piece.end_curvature
        shape = f'<spiral curvStart="{k!r}" curvEnd="{end!r}"/>'
        if k == end:
            shape = f'<arc curvature="{k!r}"/>' if k else "<line/>"
        yield (
            f'<geometry s="{station or 0!r}" x="{piece.x!r}" y="{piece.y!r}"'
            f' hdg="{piece.heading!r}" length="{piece.length!r}">{shape}</geometry>'
        )
        station += piece.length


def _heights(road: Road, *, along: bool) -> Iterator[str]:
    """The elements of the heights: the slope is linear between stations, so they are quadratic."""
    grade = road.course.grade if road.course else ()
    inside = {s for s, _ in grade if 0.0 < s < road.length}
    stations = np.array(sorted({0.0, road.length, *inside}))
    heights, slopes = road.height_at(stations), road.grade_at(stations)
    if not along:
        stations = road.length - stations[::-1]
        heights, slopes = heights[::-1], -slopes[::-1]
    spans = zip(*map(pairwise, (stations.tolist(), heights.tolist(), slopes.tolist())), strict=True)
    for (start, stop), (height, _), (first, last) in spans:
        bend = 0.5 * (last - first) / (stop - start)
        yield f'<elevation s="{start or 0!r}" a="{height or 0!r}"'
        yield f' b="{first or 0!r}" c="{bend or 0!r}" d="0"/>'


def _sections(road: Road, *, right: bool, along: bool) -> Iterator[str]:
    """The lane sections, of the same lanes, with the marks of each stretch."""
    strips, others = _strips(road, along=along), _opposite(road, along=along)
    stations = [0.0, road.length - _TAIL] if road.length > 2.0 * _TAIL else [0.0]
    links = [("successor",), ("predecessor",)] if len(stations) > 1 else [()]
    centre = _Strip(0, "none", 0.0, _centre_marks(road, along=along))
    for k, (station, linked) in enumerate(zip(stations, links, strict=True)):
        end = stations[k + 1] if k + 1 < len(stations) else road.length
        own, beyond = (
            [_lane(strip, station, end, linked) for strip in lanes] for lanes in (strips, others)
        )
        left, right_hand = (beyond, own) if right else (own, beyond)
        yield (
            f'<laneSection s="{station or 0!r}">{_group("left", left[::-1])}'
            f"<center>{_lane(centre, station, end)}</center>"
            f"{_group('right', right_hand)}</laneSection>\n"
        )


def _group(side: str, lanes: Sequence[str]) -> str:
    """The lanes on one side of the reference line, if there are any."""
    return f"<{side}>{''.join(lanes)}</{side}>" if lanes else ""


def _beside(road: Road) -> tuple[Lane | None, Lane | None]:
    """The lanes beside the driving lanes, unless they lie across the reference line."""
    sign = road.lanes[0].lane_id
    found = (road.overtaking_side_neighbour, road.kerb_side_neighbour)
    fast, slow = (lane if lane and lane.lane_id * sign > 0 else None for lane in found)
    return fast, slow


def _inner_edge(road: Road) -> float:
    """`d` of the border nearest to the reference line [m]."""
    fast, _ = _beside(road)
    return float(road.lane_boundaries[-1]) + road.overtaking_sign * (fast.width if fast else 0.0)


def _strips(road: Road, *, along: bool) -> list[_Strip]:
    """All lanes from the reference line outward; ids that the road lacks get lanes of no width."""
    fast, slow = _beside(road)
    lanes = [lane for lane in (fast, *reversed(road.lanes), slow) if lane]
    sign = 1 if lanes[0].lane_id > 0 else -1
    first = abs(lanes[0].lane_id)
    if [lane.lane_id for lane in lanes] != [sign * (first + k) for k in range(len(lanes))]:
        raise ConfigError(
            what="lane ids",
            where=f"road {road.name}",
            expected="consecutive ones, growing away from the reference line",
            got=str([lane.lane_id for lane in lanes]),
            next_step="number the lanes as OpenDRIVE does",
        )
    fillers = _fillers(sign, first)
    if fillers:
        fillers[-1] = fillers[-1]._replace(outer_marks=_inner_marks(road, along=along))
    real = [_Strip(one.lane_id, one.kind, one.width, _same(_marks(road, one)[1])) for one in lanes]
    return fillers + real


def _opposite(road: Road, *, along: bool) -> list[_Strip]:
    """The lane beside the driving lanes that lies across the reference line, from there outward."""
    lane, sign = road.overtaking_side_neighbour, road.lanes[0].lane_id
    if lane is None or lane.lane_id * sign > 0:
        return []
    outer = _same(_marks(road, lane)[0])  # Away from the line is what is towards it over there.
    limits = _limits(road, -1, along=along) if road.is_two_way else ()
    if limits == _limits(road, 1, along=along):
        limits = ()
    strip = _Strip(lane.lane_id, lane.kind, lane.width, outer, limits)
    return [*_fillers(1 if lane.lane_id > 0 else -1, abs(lane.lane_id)), strip]


def _fillers(sign: int, first: int) -> list[_Strip]:
    """Lanes of no width, with the ids before the first one."""
    return [_Strip(sign * k, "none", 0.0, _same(RoadMark.NONE)) for k in range(1, first)]


def _same(mark: RoadMark) -> Marks:
    """One mark from end to end."""
    return ((0.0, mark),)


def _marks(road: Road, lane: Lane) -> tuple[RoadMark, RoadMark]:
    """The lines of a lane of the road's side, towards the reference line and away from it."""
    if road.driving_side is DrivingSide.RIGHT:
        return lane.left_mark, lane.right_mark
    return lane.right_mark, lane.left_mark


def _inner_marks(road: Road, *, along: bool) -> Marks:
    """The line of the innermost lane towards the reference line, seen from beyond it."""
    fast, _ = _beside(road)
    if fast is not None:
        return _same(_marks(road, fast)[0].reverse)
    found = [(max(start, 0.0), mark.reverse) for start, mark in road.overtaking_edge_marks]
    found = [one for one in found if one[0] < road.length]
    if along:
        return tuple(found)
    ends = [*(start for start, _ in found[1:]), road.length]
    turned = zip(reversed(ends), reversed(found), strict=True)
    return tuple((road.length - end, mark) for end, (_, mark) in turned)


def _centre_marks(road: Road, *, along: bool) -> Marks:
    """The line on the reference line, as a file states it: the first word names the left side."""
    fast, _ = _beside(road)
    innermost = fast or road.lanes[-1]
    if abs(innermost.lane_id) > 1:
        return _same(RoadMark.NONE)
    found = _inner_marks(road, along=along)
    if innermost.lane_id < 0:
        return found
    return tuple((start, mark.reverse) for start, mark in found)


def _lane(strip: _Strip, start: float, end: float, linked: tuple[str, ...] = ()) -> str:
    """The element of a lane in a section, which goes on in other sections if it has a width."""
    links = "".join(f'<{name} id="{strip.lane_id}"/>' for name in linked)
    link = f"<link>{links}</link>" if links and strip.width else ""
    width = f'<width sOffset="0" a="{strip.width!r}" b="0" c="0" d="0"/>' if strip.lane_id else ""
    marks = "".join(
        f'<roadMark sOffset="{max(station - start, 0.0) or 0!r}" type="{_NAMES[mark]}"'
        f' weight="standard" color="standard" width="{_MARK_WIDTH}"'
        f' laneChange="{_allowed(strip.lane_id, mark)}"/>'
        for station, mark in _between(strip.outer_marks, start, end)
    )
    speeds = "".join(
        _speed(limit, max(station - start, 0.0))
        for station, limit in _between(strip.limits, start, end)
    )
    return (
        f'<lane id="{strip.lane_id}" type={quoted(strip.kind)} level="false">'
        f"{link}{width}{marks}{speeds}</lane>\n"
    )


def _between(entries: Sequence[tuple[float, T]], start: float, end: float) -> list[tuple[float, T]]:
    """The entries that hold somewhere between two stations."""
    before = [one for one in entries if one[0] <= start]
    return [*before[-1:], *(one for one in entries if start < one[0] < end)]


def _allowed(lane_id: int, mark: RoadMark) -> str:
    """Which way the line may be crossed, for simulators that ask the file and not the line.

    The first word of a double line is on the inner side of a lane, and left of the centre.
    """
    if mark in (RoadMark.BROKEN, RoadMark.BROKEN_BROKEN, RoadMark.BOTTS_DOTS):
        return "both"
    inwards, outwards = ("decrease", "increase") if lane_id > 0 else ("increase", "decrease")
    return {RoadMark.SOLID_BROKEN: inwards, RoadMark.BROKEN_SOLID: outwards}.get(mark, "none")
