"""Roads of the model out of roads of an OpenDRIVE file: the longest stretch with the same lanes.

A file states lanes, widths, marks, type and limit anew wherever one of them changes. In between the
driving lanes of one side are a cell; the road of the model is the longest row of cells with the
same lanes, on one road or on several that lead to each other without a junction. The line between
the directions and the limits may change within a row: the road has a course.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Self

import numpy as np

from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError
from overtaking.model.reference_line import CurveSegment
from overtaking.model.road import MAX_LENGTH, DrivingSide, Lane, Road, RoadMark
from overtaking.model.road_course import CentreLineSpan, RoadCourse
from overtaking.recordings.limits import highest_and_lower
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive_lanes import (
    OTHER_SIDE,
    Cell,
    Side,
    SideSections,
    Strip,
    cells,
    runs_along,
    side_of_traffic,
)
from overtaking.recordings.opendrive_plan import (
    MAX_KINK,
    MAX_STRETCH,
    check_joint,
    pieces,
    pieces_between,
)
from overtaking.recordings.opendrive_shape import (
    TOLERANCE,
    Alignment,
    Unfit,
    grade_of,
    straight_line,
    unfit,
)
from overtaking.recordings.origins import origin_near
from overtaking.recordings.xml import Element

Stretch = tuple[float, float, Cell]
"""Where a cell begins and ends on the road of the model [m], and the cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part(ContentEquality):
    """What a road of the model takes of one road of a file.

    Attributes:
        road_id: Id of the road.
        start: Station where the part begins, as the file counts [m].
        end: Station where it ends [m].
        is_whole: Whether it is all of the road.
    """

    road_id: str
    start: float
    end: float
    is_whole: bool

    def __str__(self) -> str:
        """The id, and the stations of a part of the road."""
        return self.road_id + (
            "" if self.is_whole else f" from {self.start:.0f} to {self.end:.0f} m"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A road of the model, and what of the file it is.

    Attributes:
        road: The road.
        parts: The parts of the file's roads, in the direction of travel.
    """

    road: Road
    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """A road of the file as a route takes it.

    Attributes:
        element: The `<road>`.
        length: Its length [m].
        side: Side of its reference line on which the driving lanes lie.
        along: Whether they run along the line.
        driving_side: Side of the road that traffic keeps to.
    """

    element: Element
    length: float
    side: Side
    along: bool
    driving_side: DrivingSide

    @classmethod
    def of(cls, road: Element, driving_side: DrivingSide, *, along: bool) -> Self:
        """A road driven along its reference line or against it."""
        right = along == (driving_side is DrivingSide.RIGHT)
        return cls(
            element=road,
            length=_length(road),
            side="right" if right else "left",
            along=along,
            driving_side=driving_side,
        )

    def exit(self) -> Element | None:
        """The link to the road that this one leads to without a junction."""
        links = self.element.optional("link")
        name = "successor" if self.along else "predecessor"
        found = None if links is None else links.optional(name)
        is_road = found is not None and found.attribute("elementType", default="") == "road"
        return found if is_road else None

    @property
    def leads_to(self) -> str | None:
        """Id of that road, None where there is none."""
        link = self.exit()
        return None if link is None else link.attribute("elementId")


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Options of a caller about a road; each is None where the file decides.

    Attributes:
        lanes: Side of the reference line on which the driving lanes lie.
        speed_limit: Limit in place of the file's [m/s].
        driving_side: Side of the road that traffic keeps to.
    """

    lanes: Side | None = None
    speed_limit: float | None = None
    driving_side: DrivingSide | None = None


AS_IN_FILE = Choice()
"""No choice: the file decides."""


def read_part(path: Path, road: Element, choice: Choice = AS_IN_FILE) -> Route:
    """The longest stretch of a road on which its lanes stay the same.

    Args:
        path: The file, for the name of the road.
        road: The `<road>`.
        choice: Options of the caller.

    Raises:
        ImportFormatError: The road is of a shape that is not supported.
    """
    road.belongs_to(f"road {shown(road.attribute('id'))}")
    _check_outside_junctions(road)
    return _route(path, [first_way(road, choice)], choice.speed_limit)


def first_way(road: Element, choice: Choice = AS_IN_FILE) -> Way:
    """A road driven on lanes of a side; without a choice as `read_opendrive` chooses."""
    length = _length(road)
    driving_side = choice.driving_side or side_of_traffic(road, length)
    side = choice.lanes or _default_side(road, driving_side, length)
    return Way.of(road, driving_side, along=runs_along(side, driving_side))


def join_roads(path: Path, roads: Sequence[Element], choice: Choice = AS_IN_FILE) -> Route:
    """Several roads of a file, each of which the one before leads to without a junction."""
    for road in roads:
        road.belongs_to(f"road {shown(road.attribute('id'))}")
        _check_outside_junctions(road)
    first = roads[0]
    tried = [first_way(first, choice)]
    if choice.lanes is None:
        tried.append(Way.of(first, tried[0].driving_side, along=not tried[0].along))
    second = roads[1].attribute("id")
    ways = [next((way for way in tried if way.leads_to == second), tried[0])]
    for road in roads[1:]:
        ways.append(_next_way(ways[-1], road))
    route = _route(path, ways, choice.speed_limit)
    if len(route.parts) < len(roads):
        got = " and ".join(map(str, route.parts))
        raise unfit(first, "and those it leads to", "the same lanes on all of them", f"only {got}")
    return route


def _next_way(way: Way, road: Element) -> Way:
    """A road as the way before it enters it."""
    link, name = way.exit(), road.attribute("id")
    if link is None or way.leads_to != name:
        got = "none" if link is None else f"one to road {shown(link.attribute('elementId'))}"
        wanted = f"a link to road {shown(name)} without a junction"
        raise unfit(way.element, "leads elsewhere", wanted, got)
    return Way.of(road, way.driving_side, along=link.attribute("contactPoint") == "start")


def is_in_junction(road: Element) -> bool:
    """Whether a road is a way across a junction; an empty attribute names no junction."""
    return road.attribute("junction", default="").strip() not in ("", "-1")


def _check_outside_junctions(road: Element) -> None:
    if is_in_junction(road):
        got = f'junction "{shown(road.attribute("junction"))}"'
        raise unfit(road, "belongs to a junction", "a road outside junctions", got)


def _route(path: Path, ways: Sequence[Way], speed_limit: float | None) -> Route:
    """The longest stretch of some roads in a row on which the lanes stay the same."""
    run = _longest(ways, speed_limit)
    groups = [(way, [cell for _, cell in group]) for way, group in groupby(run, key=itemgetter(0))]
    parts = tuple(_part(way, cells) for way, cells in groups)
    ids = ", ".join(map(str, parts))
    name = f"{shown(path.stem)} road{'s' if len(parts) > 1 else ''} {ids}"
    first = ways[0].element
    try:
        row = [cell for _, cell in run]
        road = _build(name, ways[0].driving_side, row, _near_origin(_alignment(groups)))
    except ConfigError as error:
        raise unfit(first, "is beyond the model", "a road of ordinary size", str(error)) from None
    return Route(road=road, parts=parts)


def _part(way: Way, cells: Sequence[Cell]) -> Part:
    start, end = min(cell.start for cell in cells), max(cell.end for cell in cells)
    whole = start <= TOLERANCE and end >= way.length - TOLERANCE
    name = shown(way.element.attribute("id"))
    return Part(road_id=name, start=start, end=end, is_whole=whole)


def _longest(ways: Sequence[Way], speed_limit: float | None) -> list[tuple[Way, Cell]]:
    """The longest row of stretches, in the direction of travel, whose lanes are the same."""
    rows: list[list[tuple[Way, Cell]]] = [[]]
    refusals: list[Unfit] = []
    for way in ways:
        stretches = cells(
            way.element,
            side=way.side,
            length=way.length,
            speed_limit=speed_limit,
            driving_side=way.driving_side,
        )
        for cell in stretches if way.along else reversed(stretches):
            if isinstance(cell, Unfit):
                refusals.append(cell)
                rows.append([])
            elif rows[-1] and _goes_on(rows[-1], way, cell):
                rows[-1].append((way, cell))
            else:
                rows.append([(way, cell)])
    longest = max(rows, key=lambda row: sum(cell.end - cell.start for _, cell in row))
    if not longest:
        raise refusals[0]
    return longest


def _goes_on(row: Sequence[tuple[Way, Cell]], way: Way, cell: Cell) -> bool:
    """Whether a stretch has the lanes of a row of them, and begins where that ends."""
    before, last = row[-1]
    if not row[0][1].goes_on(cell):
        return False
    if before is not way:
        return True  # Where roads join is checked when their lines are joined.
    low, high = (last, cell) if way.along else (cell, last)
    end, begin = low.inner.starting(high.start), high.inner
    return abs(end.a - begin.a) <= TOLERANCE and abs(end.b - begin.b) <= MAX_KINK


def _build(name: str, driving_side: DrivingSide, row: Sequence[Cell], line: Alignment) -> Road:
    """The road of a row of stretches, in the direction of travel."""
    section = row[0]
    right_hand = driving_side is DrivingSide.RIGHT
    # Outward is away from the reference line: to the right of travel in right-hand traffic, both
    # along the line and, on its other side, against it.
    outward = -1.0 if right_hand else 1.0
    outer_edge = line.inner_edge + sum(strip.width for strip in section.strips)

    def lane(strip: Strip, direction: int = 1) -> Lane:
        # A lane across the centre line has its own outside on the other hand.
        inner_on_left = right_hand == (direction == 1)
        left, right = strip.inner_mark, strip.outer_mark
        return Lane(
            lane_id=strip.lane_id,
            width=strip.width,
            kind=strip.kind,
            direction=direction,
            left_mark=left if inner_on_left else right,
            right_mark=right if inner_on_left else left,
        )

    slow, fast = (_narrowest(row, side) for side in ("outer_neighbour", "inner_neighbour"))
    return Road(
        name=name,
        kind=section.kind,
        driving_side=driving_side,
        lanes=tuple(lane(strip) for strip in reversed(section.strips)),
        kerb_edge_d=outward * outer_edge,
        length=line.length,
        x0=line.x,
        y0=line.y,
        heading=line.heading,
        origin_x=line.origin[0],
        origin_y=line.origin[1],
        course=line.course,
        speed_limit=max(max(cell.limit, cell.limit_against) for cell in row),
        kerb_side_neighbour=lane(slow) if slow else None,
        overtaking_side_neighbour=lane(fast, -1 if section.across else 1) if fast else None,
    )


def _narrowest(row: Sequence[Cell], name: str) -> Strip | None:
    """A lane beside the road where it begins, as wide as it is everywhere."""
    beside: list[Strip | None] = [getattr(cell, name) for cell in row]
    if beside[0] is None:
        return None
    return beside[0]._replace(width=min(one.width for one in beside if one is not None))


def _alignment(groups: Sequence[tuple[Way, list[Cell]]]) -> Alignment:
    """The reference line of a row of stretches, by road, in the direction of travel.

    Where the lanes keep their distance from the reference line of the file, that is the line.
    Elsewhere it is the middle of the driving lanes: the file measures their widths square to its
    own line, so the farther from the middle, the larger is what the angle between both shortens.
    """
    way, first = groups[0]
    cell = first[0]
    edge = cell.inner.a if way.along else cell.inner.starting(cell.end).a
    moved = any(
        abs(found - edge) > TOLERANCE
        for _, row in groups
        for one in row
        for found in one.inner.extremes(one.end - one.start)
    )
    straight = straight_line(way.element, way.length)
    if straight is not None and not moved and len(groups) == 1:
        return _straight(straight, way, first, edge)
    half = 0.5 * sum(strip.width for strip in cell.strips)
    line: list[CurveSegment] = []
    grade: list[tuple[float, float]] = []
    stretches: list[Stretch] = []
    done = 0.0
    for one, row in groups:
        bends = _bent(one, row, half if moved else None)
        if line:
            check_joint(line[-1], bends[0], one.element)
        length = sum(piece.length for piece in bends)
        grade += [(done + s, slope) for s, slope in _grade(one, row, length)]
        stretches += [
            (done + begin, done + end, cell) for begin, end, cell in _stretches(one, row, length)
        ]
        line += bends
        done += length
    course = _course(tuple(line), grade, stretches, done)
    return Alignment(*line[0][:3], length=done, inner_edge=-half if moved else edge, course=course)


def _near_origin(line: Alignment) -> Alignment:
    """The line in coordinates that count from an origin near it, if it is far from the file's."""
    pieces = line.course.segments if line.course else ()
    starts = np.array([(line.x, line.y), *(piece[:2] for piece in pieces)])
    east, north = origin_near(*starts.T)
    if (east, north) == (0.0, 0.0):
        return line
    moved = tuple(piece._replace(x=piece.x - east, y=piece.y - north) for piece in pieces)
    return replace(
        line,
        x=line.x - east,
        y=line.y - north,
        course=replace(line.course, segments=moved) if line.course else None,
        origin=(east, north),
    )


def _straight(line: Alignment, way: Way, row: Sequence[Cell], edge: float) -> Alignment:
    """A part of a straight reference line, from its end where the traffic runs against it."""
    ends = (min(cell.start for cell in row), max(cell.end for cell in row))
    start, length = ends[0 if way.along else 1], ends[1] - ends[0]
    x = line.x + start * math.cos(line.heading)
    y = line.y + start * math.sin(line.heading)
    turned = math.remainder(line.heading + math.pi, math.tau)
    heading = line.heading if way.along else turned
    course = _course((), _grade(way, row, length), _stretches(way, row, length), length)
    return Alignment(x, y, heading, length=length, inner_edge=edge, course=course)


def _bent(way: Way, row: Sequence[Cell], half: float | None) -> list[CurveSegment]:
    """The line of a part of a road, in the direction of travel.

    Args:
        way: The road.
        row: The stretches of the part.
        half: Distance of the line from the innermost border, outward; that of the file if None [m].
    """
    road, in_order = way.element, sorted(row, key=lambda cell: cell.start)
    covered = sum(one.length for one in pieces(road))
    if abs(covered - way.length) > TOLERANCE + MAX_STRETCH * way.length:
        wanted = f"a line of {way.length:g} m"
        raise road.error("does not end with its line", wanted, f"{covered:g} m")
    start, end = in_order[0].start, in_order[-1].end
    left = -1.0 if way.side == "right" else 1.0
    nothing = replace(in_order[0].inner, a=0.0, b=0.0, c=0.0, d=0.0)
    aside = [nothing]
    if half is not None:
        aside = [
            replace(one, a=left * (one.a + half), b=left * one.b, c=left * one.c, d=left * one.d)
            for one in (cell.inner for cell in in_order)
        ]
    bends = [
        one._replace(heading=math.remainder(one.heading, math.tau))
        for one in pieces_between(road, start, end, aside)
    ]
    return bends if way.along else [one.reverse() for one in reversed(bends)]


def _grade(way: Way, row: Sequence[Cell], length: float) -> list[tuple[float, float]]:
    """Slope by station of a part of a road, in the direction of travel, `length` metres long."""
    start, end = min(cell.start for cell in row), max(cell.end for cell in row)
    table = grade_of(way.element, way.length)
    if not table:
        return [(0.0, 0.0), (length, 0.0)]
    inside = [s for s, _ in table if start < s < end]
    stations = np.array([start, *inside, end])
    slopes = np.interp(stations, *np.array(table).T)
    ahead = (stations - start) if way.along else (end - stations)
    rows = zip((ahead * (length / (end - start))).tolist(), slopes.tolist(), strict=True)
    found = [(min(s, length), slope if way.along else -slope) for s, slope in rows]
    return found if way.along else found[::-1]


def _stretches(way: Way, row: Sequence[Cell], length: float) -> list[Stretch]:
    """Where each cell of a part of a road begins and ends, in the direction of travel."""
    start, end = min(cell.start for cell in row), max(cell.end for cell in row)
    scale = length / (end - start)
    return [
        (
            scale * (cell.start - start if way.along else end - cell.end),
            min(scale * (cell.end - start if way.along else end - cell.start), length),
            cell,
        )
        for cell in row
    ]


def _course(
    line: tuple[CurveSegment, ...],
    grade: Sequence[tuple[float, float]],
    stretches: Sequence[Stretch],
    length: float,
) -> RoadCourse | None:
    """What changes along a road; None if nothing does."""
    rises = any(slope != 0.0 for _, slope in grade)
    table = [one for k, one in enumerate(grade) if rises and (k == 0 or one[0] > grade[k - 1][0])]
    marks: list[tuple[float, float, RoadMark]] = []
    for start, stop, cell in stretches:
        mark = cell.strips[0].inner_mark
        if cell.is_two_way and marks and marks[-1][2] is mark and marks[-1][1] == start:
            marks[-1] = (marks[-1][0], stop, mark)
        elif cell.is_two_way:
            marks.append((start, stop, mark))
    lines = tuple(
        CentreLineSpan(start=start, stop=min(stop, length), mark=mark)
        for start, stop, mark in marks
        if mark is not marks[0][2]
    )
    stated = [(start, cell.limit, cell.limit_against) for start, _, cell in stretches]
    limits = highest_and_lower(stated, length)[1]
    if not (line or table or lines or limits):
        return None
    return RoadCourse(
        segments=line, grade=tuple(table), centre_line_spans=lines, speed_limit_spans=limits
    )


def _length(road: Element) -> float:
    length = road.number("length")
    if not 0.0 < length <= MAX_LENGTH:
        raise unfit(
            road, "attribute length", f"more than 0 and at most {MAX_LENGTH:g} m", f"{length:g}"
        )
    return length


def _default_side(road: Element, driving_side: DrivingSide, length: float) -> Side:
    """The side whose lanes run along the reference line, unless only the other has any."""
    along: Side = "right" if driving_side is DrivingSide.RIGHT else "left"
    against: Side = OTHER_SIDE[along]
    has_along, has_against = (
        bool(SideSections.of(road, side, length).driving) for side in (along, against)
    )
    return along if has_along or not has_against else against
