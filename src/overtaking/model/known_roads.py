"""The roads that come with the package, as nouns."""

from functools import cache
from itertools import pairwise

from overtaking.core.errors import ConfigError
from overtaking.knowledge.roads import ROAD_NAMES, BesideFacts, RoadFacts, road_facts
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark


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
    return Road(
        name=name,
        kind=facts.kind,
        driving_side=DrivingSide(facts.driving_side),
        lanes=_lanes(facts),
        edge_d=facts.edge_d,
        length=facts.length,
        x0=facts.x0,
        y0=facts.y0,
        heading=facts.heading,
        speed_limit=facts.speed_limit,
        slow_side_neighbour=_lane(facts, slow, slow.far_mark, facts.slow_edge_mark),
        fast_side_neighbour=_lane(facts, fast, facts.fast_edge_mark, fast.far_mark),
    )


def _lanes(facts: RoadFacts) -> tuple[Lane, ...]:
    """The driving lanes, with the marks on either side of each."""
    between = [facts.lane_mark] * (len(facts.lane_ids) - 1)
    marks = pairwise([facts.slow_edge_mark, *between, facts.fast_edge_mark])
    ids_and_widths = zip(facts.lane_ids, facts.lane_widths, strict=True)
    return tuple(
        _marked(facts, lane_id=int(lane_id), width=width, kind="driving", slow=slow, fast=fast)
        for (lane_id, width), (slow, fast) in zip(ids_and_widths, marks, strict=True)
    )


def _lane(facts: RoadFacts, beside: BesideFacts, slow: str, fast: str) -> Lane:
    """A lane beside the driving lanes, with its marks on the slow and the fast side."""
    return _marked(
        facts, lane_id=beside.lane_id, width=beside.width, kind=beside.kind, slow=slow, fast=fast
    )


def _marked(
    facts: RoadFacts, *, lane_id: int, width: float, kind: str, slow: str, fast: str
) -> Lane:
    """A lane whose marks are given by side of the road rather than by hand."""
    marks = (RoadMark(slow), RoadMark(fast))
    right, left = marks if facts.driving_side == "right" else marks[::-1]
    return Lane(lane_id=lane_id, width=width, kind=kind, right_mark=right, left_mark=left)
