"""The roads that come with the package."""

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
"""The roads that come with the package."""

_LINES = (RoadMark.SOLID, RoadMark.SOLID_BROKEN, RoadMark.BROKEN_SOLID)
_PLACES = (ZoneKind.JUNCTION, ZoneKind.CREST, ZoneKind.BEND)


@dataclass(frozen=True, slots=True, kw_only=True)
class _NeighbourEntry:
    """A lane beside the driving lanes.

    Attributes:
        lane_id: OpenDRIVE id.
        kind: OpenDRIVE lane type.
        width: Width [m].
        far_mark: Line on its side away from the driving lanes, spelled as CARLA does.
        is_oncoming: Whether its traffic comes the other way.
    """

    lane_id: int
    kind: str
    width: float
    far_mark: RoadMark
    is_oncoming: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _CourseEntry:
    """Changes along a two-way road: where each stretch begins and ends [m].

    Attributes:
        solid: Where the line between the directions is solid for both.
        solid_broken: Where it is solid for the driving lanes alone.
        broken_solid: Where it is solid for oncoming traffic alone.
        junction: Junctions.
        crest: Crests.
        bend: Bends of reduced visibility.
        sight: Stations, and the sight distance from there along the road.
        sight_against: The same for oncoming traffic.
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
    """A straight road, lanes from the kerb side to the overtaking side, in SI units.

    Attributes:
        kind: OpenDRIVE road type.
        driving_side: Side of the road that traffic keeps to.
        lane_ids: OpenDRIVE ids.
        lane_widths: Widths [m].
        kerb_edge_mark: Line on the kerb side of the first lane.
        lane_mark: Line between two lanes.
        overtaking_edge_mark: Line on the overtaking side of the last lane.
        kerb_edge_d: Offset of the edge of the first lane on the kerb side [m].
        length: Length [m].
        x0: World x of (s, d) = (0, 0) [m].
        y0: World y of (s, d) = (0, 0) [m].
        heading: Direction of travel, anticlockwise from x [rad].
        speed_limit: Posted limit [m/s].
        kerb_side: Lane beside the first lane.
        overtaking_side: Lane beside the last lane.
        course: Changes along it, or None.
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
        name: One of `overtaking.model.known_roads.ROAD_NAMES`.

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
    kerb_marks = kerb_side.far_mark, road.kerb_edge_mark
    overtaking_marks = road.overtaking_edge_mark, overtaking_side.far_mark
    return Road(
        name=name,
        kind=road.kind,
        driving_side=road.driving_side,
        lanes=tuple(_lane(road, *lane, "driving") for lane in lanes),
        kerb_edge_d=road.kerb_edge_d,
        length=road.length,
        x0=road.x0,
        y0=road.y0,
        heading=road.heading,
        speed_limit=road.speed_limit,
        kerb_side_neighbour=_neighbour_lane(road, kerb_side, kerb_marks),
        overtaking_side_neighbour=_neighbour_lane(road, overtaking_side, overtaking_marks),
        course=road.course and _course(road.course),
    )


def _course(entry: _CourseEntry) -> RoadCourse:
    """The course, its centre line in the order of stations."""
    lines = [
        CentreLineSpan(start=start, stop=stop, mark=mark)
        for mark in _LINES
        for start, stop in getattr(entry, mark.name.lower())
    ]
    places = [
        RoadZone(kind=kind, start=start, stop=stop)
        for kind in _PLACES
        for start, stop in getattr(entry, kind.value)
    ]
    return RoadCourse(
        centre_line_spans=tuple(sorted(lines, key=attrgetter("start"))),
        zones=tuple(places),
        sight=entry.sight,
        sight_against=entry.sight_against,
    )


def _marks(road: _RoadEntry) -> Iterable[tuple[RoadMark, RoadMark]]:
    """The marks of each driving lane on its kerb side and on its overtaking side."""
    between = [road.lane_mark] * (len(road.lane_ids) - 1)
    return pairwise([road.kerb_edge_mark, *between, road.overtaking_edge_mark])


def _neighbour_lane(
    road: _RoadEntry, beside: _NeighbourEntry, marks: tuple[RoadMark, RoadMark]
) -> Lane:
    """A lane beside the driving lanes, whose traffic may come the other way."""
    lane = _lane(road, beside.lane_id, beside.width, marks, beside.kind)
    return replace(lane, direction=-1) if beside.is_oncoming else lane


def _lane(
    road: _RoadEntry, lane_id: int, width: float, marks: tuple[RoadMark, RoadMark], kind: str
) -> Lane:
    """A lane, from its marks on the kerb side and on the overtaking side."""
    is_right_hand = road.driving_side is DrivingSide.RIGHT
    right, left = marks if is_right_hand else reversed(marks)
    return Lane(lane_id=lane_id, width=width, kind=kind, right_mark=right, left_mark=left)
