"""The roads that come with the package.

`known_road` reads a road from the section with its name in `knowledge/data/roads.toml` and returns
it as a `Road` (`model.road`). The classes here mirror the keys of that file: one `_RoadEntry` for
each section, with subsections for the lanes beside the road and for its course. To add a road, add
its section and its name in `ROAD_NAMES`. All roads are straight in the plane; a two-way road states
its bends and crests as zones of reduced sight.

Terms: driving lanes are the lanes of the road's direction, counted from the kerb side to the
overtaking side. A station is a distance along the road's reference line from its start, and `d` is
the offset to the left of that line. The map format OpenDRIVE defines ids and types of lanes and
roads. A mark (`RoadMark`) is the line painted at the edge of a lane; in double marks such as
`SOLID_BROKEN` the first word names the line nearer to the driving lanes.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from operator import attrgetter

from overtaking.core.errors import ConfigError
from overtaking.knowledge.toml_reader import read_record
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark
from overtaking.model.road_course import CentreLineSpan, RoadCourse, RoadZone, ZoneKind

ROAD_NAMES = ("town06", "motorway", "rural")
"""Names of the sections of `roads.toml` that describe a road. Its other sections hold numbers for
all roads, such as general speed limits."""

_CENTRE_LINE_MARKS = {
    "solid": RoadMark.SOLID,
    "solid_broken": RoadMark.SOLID_BROKEN,
    "broken_solid": RoadMark.BROKEN_SOLID,
}
"""Marks of the centre line by the field of `_CourseEntry` that holds their stretches."""

_ZONE_KINDS = {"junction": ZoneKind.JUNCTION, "crest": ZoneKind.CREST, "bend": ZoneKind.BEND}
"""Kinds of zones by the field of `_CourseEntry` that holds their stretches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _NeighbourEntry:
    """A lane beside the driving lanes: a shoulder, or the opposing lane of a two-way road.

    Attributes:
        lane_id: OpenDRIVE id.
        kind: OpenDRIVE lane type, "shoulder" or "driving".
        width: Width [m].
        far_mark: Line on its side away from the driving lanes.
        is_oncoming: Whether its traffic runs against the driving lanes.
    """

    lane_id: int
    kind: str
    width: float
    far_mark: RoadMark
    is_oncoming: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _CourseEntry:
    """Changes along a two-way road.

    All fields but the last two hold stretches of the road: pairs of the stations of start and end
    [m]. Elsewhere the line between the directions is `_RoadEntry.overtaking_edge_mark`.

    Attributes:
        solid: Stretches on which the line between the directions is solid for both.
        solid_broken: Stretches on which this line is solid for the driving lanes only.
        broken_solid: Stretches on which this line is solid for oncoming traffic only.
        junction: Junctions.
        crest: Crests of reduced visibility.
        bend: Bends of reduced visibility.
        sight: Pairs of a station and the sight distance along the road from there [m]. The distance
            is linear between the stations, and constant before the first and after the last.
        sight_against: The same for oncoming drivers; their stations fall as they drive.
    """

    solid: tuple[tuple[float, float], ...] = ()
    solid_broken: tuple[tuple[float, float], ...] = ()
    broken_solid: tuple[tuple[float, float], ...] = ()
    junction: tuple[tuple[float, float], ...] = ()
    crest: tuple[tuple[float, float], ...] = ()
    bend: tuple[tuple[float, float], ...] = ()
    sight: tuple[tuple[float, float], ...] = ()
    sight_against: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _RoadEntry:
    """A straight road in SI units; the file states units, and its reader converts them.

    Attributes:
        kind: OpenDRIVE road type, "motorway" or "rural".
        driving_side: Side of the road that traffic keeps to.
        lane_ids: OpenDRIVE ids of the driving lanes. They are floats with whole values, because the
            reader converts all numbers of a list to floats.
        lane_widths: Width of each driving lane [m].
        kerb_edge_mark: Line on the kerb side of the first driving lane. This line and the next two
            must look the same from both sides, because both lanes beside a line get the same mark:
            they cannot be `SOLID_BROKEN` or `BROKEN_SOLID`.
        lane_mark: Line between every two driving lanes.
        overtaking_edge_mark: Line on the overtaking side of the last driving lane.
        kerb_edge_d: `d` of the edge of the first driving lane on the kerb side [m].
        length: Length [m].
        x0: World x of the point with station 0 and `d` 0 [m].
        y0: World y of the same point [m].
        heading: Direction of travel, anticlockwise from the world x axis [rad].
        speed_limit: Posted limit [m/s].
        kerb_side: Lane beside the first driving lane.
        overtaking_side: Lane beside the last driving lane.
        course: Changes along a two-way road; None for a road that is the same everywhere.
    """

    kind: str
    driving_side: DrivingSide
    lane_ids: tuple[float, ...]
    lane_widths: tuple[float, ...]
    kerb_edge_mark: RoadMark
    lane_mark: RoadMark
    overtaking_edge_mark: RoadMark
    kerb_edge_d: float
    length: float
    x0: float
    y0: float
    heading: float
    speed_limit: float
    kerb_side: _NeighbourEntry
    overtaking_side: _NeighbourEntry
    course: _CourseEntry | None = None


@cache
def known_road(name: str) -> Road:
    """One of the roads that come with the package.

    Args:
        name: "town06" (five lanes of CARLA's map Town06, on which the reproduced study drove),
            "motorway" (three lanes, 5 km) or "rural" (two-way, 5 km).

    Returns:
        The road; calls with the same name return the same object.

    Raises:
        ConfigError: There is no such road.
    """
    if name not in ROAD_NAMES:
        raise ConfigError(
            what="road",
            where="known_road",
            expected=" or ".join(ROAD_NAMES),
            got=repr(name),
            next_step="choose one of them, or read a map file",
        )
    road = read_record(_RoadEntry, "roads.toml", name)
    kerb_side, overtaking_side = road.kerb_side, road.overtaking_side
    lanes = zip(map(int, road.lane_ids), road.lane_widths, _marks(road), strict=True)
    # Marks of a lane are pairs: on its kerb side, on its overtaking side.
    kerb_marks = kerb_side.far_mark, road.kerb_edge_mark
    overtaking_marks = road.overtaking_edge_mark, overtaking_side.far_mark
    return Road(
        name=name,
        kind=road.kind,
        driving_side=road.driving_side,
        lanes=tuple(
            _lane(road, lane_id, width, marks, "driving") for lane_id, width, marks in lanes
        ),
        kerb_edge_d=road.kerb_edge_d,
        length=road.length,
        x0=road.x0,
        y0=road.y0,
        heading=road.heading,
        speed_limit=road.speed_limit,
        kerb_side_neighbour=_neighbour_lane(road, kerb_side, kerb_marks),
        overtaking_side_neighbour=_neighbour_lane(road, overtaking_side, overtaking_marks),
        course=None if road.course is None else _course(road.course),
    )


def _course(entry: _CourseEntry) -> RoadCourse:
    """The course of a road; `RoadCourse` requires spans in order, and zones in any order."""
    centre_line_spans = [
        CentreLineSpan(start=start, stop=stop, mark=mark)
        for field_name, mark in _CENTRE_LINE_MARKS.items()
        for start, stop in getattr(entry, field_name)
    ]
    zones = [
        RoadZone(kind=kind, start=start, stop=stop)
        for field_name, kind in _ZONE_KINDS.items()
        for start, stop in getattr(entry, field_name)
    ]
    return RoadCourse(
        centre_line_spans=tuple(sorted(centre_line_spans, key=attrgetter("start"))),
        zones=tuple(zones),
        sight=entry.sight,
        sight_against=entry.sight_against,
    )


def _marks(road: _RoadEntry) -> Iterable[tuple[RoadMark, RoadMark]]:
    """The marks of each driving lane on its kerb side and on its overtaking side."""
    inner_marks = [road.lane_mark] * (len(road.lane_ids) - 1)
    return pairwise([road.kerb_edge_mark, *inner_marks, road.overtaking_edge_mark])


def _neighbour_lane(
    road: _RoadEntry, neighbour: _NeighbourEntry, marks: tuple[RoadMark, RoadMark]
) -> Lane:
    """A lane beside the driving lanes, with its direction of travel."""
    lane = _lane(road, neighbour.lane_id, neighbour.width, marks, neighbour.kind)
    return replace(lane, direction=-1) if neighbour.is_oncoming else lane


def _lane(
    road: _RoadEntry, lane_id: int, width: float, marks: tuple[RoadMark, RoadMark], kind: str
) -> Lane:
    """A lane whose traffic runs in the road's direction of travel.

    Args:
        road: The road, whose driving side decides which mark is on the right.
        lane_id: OpenDRIVE id.
        width: Width [m].
        marks: Its lines on the kerb side and on the overtaking side.
        kind: OpenDRIVE lane type.
    """
    is_right_hand = road.driving_side is DrivingSide.RIGHT
    right_mark, left_mark = marks if is_right_hand else reversed(marks)
    return Lane(lane_id=lane_id, width=width, kind=kind, right_mark=right_mark, left_mark=left_mark)
