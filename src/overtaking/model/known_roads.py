"""The roads that come with the package, as nouns."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from operator import attrgetter

from overtaking.core.errors import ConfigError
from overtaking.knowledge.roads import ROAD_NAMES, BesideFacts, CourseFacts, RoadFacts, road_facts
from overtaking.model.course import Course, Line, Place, PlaceKind
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark

_LINES = (RoadMark.SOLID, RoadMark.SOLID_BROKEN, RoadMark.BROKEN_SOLID)
_PLACES = (PlaceKind.JUNCTION, PlaceKind.CREST, PlaceKind.BEND)


@cache
def known_road(name: str) -> Road:
    """One of the roads that come with the package.

    Args:
        name: One of `overtaking.knowledge.roads.ROAD_NAMES`.

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
        slow_side_neighbour=_beside(facts, slow, slow_marks),
        fast_side_neighbour=_beside(facts, fast, fast_marks),
        course=facts.course and _course(facts.course),
    )


def _course(facts: CourseFacts) -> Course:
    lines = [
        Line(start=start, stop=stop, mark=mark)
        for mark in _LINES
        for start, stop in getattr(facts, mark.name.lower())
    ]
    places = [
        Place(kind=kind, start=start, stop=stop)
        for kind in _PLACES
        for start, stop in getattr(facts, kind.value)
    ]
    return Course(
        lines=tuple(sorted(lines, key=attrgetter("start"))),
        places=tuple(places),
        sight=facts.sight,
        sight_against=facts.sight_against,
    )


def _marks(facts: RoadFacts) -> Iterable[tuple[str, str]]:
    """The marks of each driving lane on its slow and its fast side."""
    between = [facts.lane_mark] * (len(facts.lane_ids) - 1)
    return pairwise([facts.slow_edge_mark, *between, facts.fast_edge_mark])


def _beside(facts: RoadFacts, beside: BesideFacts, marks: tuple[str, str]) -> Lane:
    lane = _lane(facts, beside.lane_id, beside.width, marks, beside.kind)
    return replace(lane, direction=-1) if beside.is_oncoming else lane


def _lane(facts: RoadFacts, lane_id: int, width: float, marks: tuple[str, str], kind: str) -> Lane:
    """A lane whose marks are given by side of the road rather than by hand."""
    slow, fast = map(RoadMark, marks)
    right, left = (slow, fast) if facts.driving_side == "right" else (fast, slow)
    return Lane(lane_id=lane_id, width=width, kind=kind, right_mark=right, left_mark=left)
