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
    far_mark: str
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
    """A straight road, lanes from the slow to the fast side, all in SI.

    Attributes:
        kind: OpenDRIVE road type.
        driving_side: "right" or "left".
        lane_ids: OpenDRIVE ids.
        lane_widths: Widths [m].
        slow_edge_mark: Line on the slow side of the first lane.
        lane_mark: Line between two lanes.
        fast_edge_mark: Line on the fast side of the last lane.
        edge_d: Offset of the slow-side edge of the first lane [m].
        length: Length [m].
        x0: World x of (s, d) = (0, 0) [m].
        y0: World y of (s, d) = (0, 0) [m].
        heading: Direction of travel, anticlockwise from x [rad].
        speed_limit: Posted limit [m/s].
        slow_side: Lane beside the first lane.
        fast_side: Lane beside the last lane.
        course: Changes along it, or None.
    """

    kind: str
    driving_side: str
    lane_ids: tuple[float, ...]
    lane_widths: tuple[float, ...]
    slow_edge_mark: str
    lane_mark: str
    fast_edge_mark: str
    edge_d: float
    length: float
    x0: float
    y0: float
    heading: float
    speed_limit: float
    slow_side: _NeighbourEntry
    fast_side: _NeighbourEntry
    course: _CourseEntry | None = None


@cache
def road_facts(name: str) -> _RoadEntry:
    """The facts about one of `ROAD_NAMES`; KnowledgeError for any other name."""
    return read_record(_RoadEntry, "roads.toml", name)


_LINES = (RoadMark.SOLID, RoadMark.SOLID_BROKEN, RoadMark.BROKEN_SOLID)
_PLACES = (ZoneKind.JUNCTION, ZoneKind.CREST, ZoneKind.BEND)


@cache
def known_road(name: str) -> Road:
    """One of the roads that come with the package.

    Args:
        name: One of `overtaking.model.known_roads.ROAD_NAMES`.

    Raises:
        ConfigError: There is no such road.
    """
    if name not in ROAD_NAMES:
        raise ConfigError.of(
            what="road",
            where="known_road",
            expected=" or ".join(ROAD_NAMES),
            got=repr(name),
            next_step="choose one of them, or read a map file",
        )
    facts = road_facts(name)
    slow, fast = facts.slow_side, facts.fast_side
    lanes = zip(map(int, facts.lane_ids), facts.lane_widths, _marks(facts), strict=True)
    slow_marks = slow.far_mark, facts.slow_edge_mark
    fast_marks = facts.fast_edge_mark, fast.far_mark
    return Road(
        name=name,
        kind=facts.kind,
        driving_side=DrivingSide(facts.driving_side),
        lanes=tuple(_lane(facts, *lane, "driving") for lane in lanes),
        edge_d=facts.edge_d,
        length=facts.length,
        x0=facts.x0,
        y0=facts.y0,
        heading=facts.heading,
        speed_limit=facts.speed_limit,
        slow_side_neighbour=_neighbour_lane(facts, slow, slow_marks),
        fast_side_neighbour=_neighbour_lane(facts, fast, fast_marks),
        course=facts.course and _course(facts.course),
    )


def _course(facts: _CourseEntry) -> RoadCourse:
    lines = [
        CentreLineSpan(start=start, stop=stop, mark=mark)
        for mark in _LINES
        for start, stop in getattr(facts, mark.name.lower())
    ]
    places = [
        RoadZone(kind=kind, start=start, stop=stop)
        for kind in _PLACES
        for start, stop in getattr(facts, kind.value)
    ]
    return RoadCourse(
        lines=tuple(sorted(lines, key=attrgetter("start"))),
        places=tuple(places),
        sight=facts.sight,
        sight_against=facts.sight_against,
    )


def _marks(facts: _RoadEntry) -> Iterable[tuple[str, str]]:
    """The marks of each driving lane on its kerb side and on its overtaking side."""
    between = [facts.lane_mark] * (len(facts.lane_ids) - 1)
    return pairwise([facts.slow_edge_mark, *between, facts.fast_edge_mark])


def _neighbour_lane(facts: _RoadEntry, beside: _NeighbourEntry, marks: tuple[str, str]) -> Lane:
    lane = _lane(facts, beside.lane_id, beside.width, marks, beside.kind)
    return replace(lane, direction=-1) if beside.is_oncoming else lane


def _lane(facts: _RoadEntry, lane_id: int, width: float, marks: tuple[str, str], kind: str) -> Lane:
    """A lane, from its marks on the kerb side and on the overtaking side."""
    slow, fast = map(RoadMark, marks)
    right, left = (slow, fast) if facts.driving_side == "right" else (fast, slow)
    return Lane(lane_id=lane_id, width=width, kind=kind, right_mark=right, left_mark=left)
