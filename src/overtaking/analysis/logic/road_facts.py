"""Facts about the road, which all simulations of a data set share.

Lengths are in mm, speeds in mm/s. In facts, left is the overtaking side, also in left-hand traffic.

A fact is a predicate with values, such as `lane_width(0,3500)`. The keywords of the decorator
`fact` are the arguments of the predicate with their types. The function below it returns one column
of integers for each argument, with a row for each fact. The source has the recordings of a group of
simulations, of which every one has this road.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic.fact_declaration import Fact, fact, no_facts
from overtaking.analysis.logic.vocabulary import (
    LANE,
    MARK,
    MILLISECONDS,
    MM,
    ROAD,
    SIDE,
    SIDES,
    SPEED,
    UNKNOWN,
    ZONE_KIND,
    nearest_thousandths,
    rounded_down_thousandths,
)
from overtaking.model.road import DrivingSide
from overtaking.model.road_course import MAX_LENGTH
from overtaking.model.trajectories import POSITION_RESOLUTION
from overtaking.world.sight_distance import all_zones_for

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.analysis.logic.fact_declaration import FactColumns
    from overtaking.analysis.logic.fact_source import FactSource
    from overtaking.model.road import Lane, Road, RoadMark

ROAD_FACTS: dict[str, Fact] = {}
"""Facts about the road, by name."""


@fact(ROAD_FACTS, "interval", "Time between two frames.", Ms=MILLISECONDS)
def _frame_interval(source: FactSource) -> FactColumns:
    return (np.array([source.trajectories.scenario.frame_interval_ms]),)


@fact(ROAD_FACTS, "road", "Kind of the road.", required_input="road_kind", Kind=ROAD)
def _road_kind(source: FactSource) -> FactColumns:
    kind = source.road.kind if source.road.kind in ROAD.constants else "other"
    return (np.array([ROAD.constants.index(kind)]),)


@fact(ROAD_FACTS, "lanes", "Number of driving lanes in the direction of travel.", N=LANE)
def _num_lanes(source: FactSource) -> FactColumns:
    return (np.array([source.road.num_lanes]),)


@fact(
    ROAD_FACTS,
    "opposing_lane",
    "The lane beyond the fastest one is for oncoming traffic.",
    Lane=LANE,
)
def _opposing_lane(source: FactSource) -> FactColumns:
    # One fact on a two-way road, no fact on other roads.
    return (np.full(int(source.road.is_two_way), source.road.num_lanes),)


@fact(
    ROAD_FACTS,
    "posted_limit",
    "Posted speed limit, rounded; the highest where it changes along the road.",
    required_input="speed_limit",
    Limit=SPEED,
)
def _posted_limit(source: FactSource) -> FactColumns:
    return (nearest_thousandths(np.array([source.road.speed_limit])),)


@fact(
    ROAD_FACTS,
    "lower_limit",
    "A stretch with a limit below `posted_limit` for the direction of travel; ends rounded up.",
    required_input="speed_limit",
    From=MM,
    To=MM,
    Limit=SPEED,
)
def _lower_limits(source: FactSource) -> FactColumns:
    course = source.road.course
    limits = course.speed_limits_for(direction=1) if course else ()
    # The program tests `From <= X < To` with a whole `X`: ends that are rounded up give the same
    # result as unrounded ones.
    table = np.array([(limit.start, limit.stop, limit.speed) for limit in limits]).reshape(-1, 3)
    return (
        _first_position_from(table[:, 0]),
        _first_position_from(table[:, 1]),
        nearest_thousandths(table[:, 2]),
    )


def _first_position_from(stations: NDArray[np.float64]) -> NDArray[np.int64]:
    """The first recordable position, in whole millimetres, at or beyond each station in m [mm]."""
    # `POSITION_RESOLUTION` is 0.001 m, so the quotient is in mm.
    first = np.ceil(stations / POSITION_RESOLUTION).astype(np.int64)
    # The quotient is rounded, so its ceiling may be one too high or one too low.
    first -= (first - 1) * POSITION_RESOLUTION >= stations
    return first + (first * POSITION_RESOLUTION < stations)


@fact(
    ROAD_FACTS,
    "border",
    "Lateral position of the border on the slow side of a lane.",
    Lane=LANE,
    D=MM,
)
def _borders(source: FactSource) -> FactColumns:
    road = source.road
    # Facts are positive to the overtaking side, offsets of the road to the geometric left.
    positions = nearest_thousandths(road.overtaking_sign * np.array(road.lane_boundaries))
    # The last border is the fast edge of the driving lanes: the slow side of lane `num_lanes`.
    return np.arange(road.num_lanes + 1), positions


@fact(
    ROAD_FACTS,
    "lane_width",
    "Width of a driving lane, rounded down; also of a driving lane beyond the fast edge.",
    Lane=LANE,
    Width=MM,
)
def _lane_widths(source: FactSource) -> FactColumns:
    lanes, neighbour = list(source.road.lanes), source.road.overtaking_side_neighbour
    if neighbour is not None and neighbour.kind == "driving":
        lanes.append(neighbour)
    # As float32, in which `WidthForOvertaking`, the rule in Python, compares them. The limit of the
    # law is a smallest width, so a width is rounded down.
    widths = np.array([lane.width for lane in lanes], np.float32)
    return np.arange(len(lanes)), rounded_down_thousandths(widths)


@fact(
    ROAD_FACTS,
    "mark",
    "The line on the slow side of a lane, as seen from the right or from the left.",
    required_input="marks",
    Lane=LANE,
    From=SIDE,
    Mark=MARK,
)
def _lane_marks(source: FactSource) -> FactColumns:
    road = source.road
    facts: list[tuple[int, int, int]] = []
    for index, lane in enumerate(road.lanes):
        slow_mark, fast_mark = _side_marks(road, lane)
        # The marks of a lane are as seen from inside the lane: it lies on the left of its slow line
        # `index`, and on the right of its fast line `index + 1`. The fast line of the last lane is
        # left out if it changes along the road: the predicate `line` then has it.
        facts.append((index, SIDES.index("left"), _mark_code(slow_mark)))
        if index + 1 < road.num_lanes or not _has_varying_edge_mark(road):
            facts.append((index + 1, SIDES.index("right"), _mark_code(fast_mark)))
    border, side, mark = zip(*sorted(facts), strict=True)
    return np.array(border), np.array(side), np.array(mark)


def _side_marks(road: Road, lane: Lane) -> tuple[RoadMark, RoadMark]:
    """The marks on the slow and on the fast side of a lane; the road's sides are geometric."""
    if road.driving_side is DrivingSide.RIGHT:
        return lane.right_mark, lane.left_mark
    return lane.left_mark, lane.right_mark


def _mark_code(mark: RoadMark) -> int:
    return MARK.constants.index(mark.name.lower())


def _has_varying_edge_mark(road: Road) -> bool:
    """Whether the line on the fast side of the fastest lane changes along the road."""
    return len(road.overtaking_edge_marks) > 1


@fact(
    ROAD_FACTS,
    "line",
    "A stretch of the line on the fast side of the fastest lane, seen from there, if it changes.",
    required_input="marks",
    From=MM,
    To=MM,
    Mark=MARK,
)
def _edge_marks_along(source: FactSource) -> FactColumns:
    if not _has_varying_edge_mark(source.road):
        return no_facts(3)
    # As seen from the fastest lane.
    begins, marks = zip(*source.road.overtaking_edge_marks, strict=True)
    # The first stretch begins at minus infinity, and the last ends at infinity, which no integer
    # holds. A road lies between 0 and `MAX_LENGTH`, so cutting both beyond the road loses nothing.
    ends = np.clip([*begins, np.inf], -MAX_LENGTH, 2.0 * MAX_LENGTH)
    codes = np.array([_mark_code(mark) for mark in marks])
    # A choice: to the nearest, while the ends of `lower_limit` are rounded up. A position less than
    # half a millimetre from an end may get the mark of the stretch beyond it.
    return nearest_thousandths(ends[:-1]), nearest_thousandths(ends[1:]), codes


@fact(
    ROAD_FACTS,
    "zone",
    "A stretch of road with a crest, a bend, a crossing or a sign for the direction of travel.",
    Kind=ZONE_KIND,
    From=MM,
    To=MM,
)
def _zones(source: FactSource) -> FactColumns:
    zones = all_zones_for(source.road, direction=1)
    codes = [ZONE_KIND.constants.index(zone.kind.name.lower()) for zone in zones]
    ends = np.array([(zone.start, zone.stop) for zone in zones]).reshape(-1, 2)
    # Rounding up, as for the ends of limits, would not be exact here: the rules compare zones with
    # the ego's front, `X + L/2`, which may end in half a millimetre.
    return (
        np.array(codes, np.int64),
        nearest_thousandths(ends[:, 0]),
        nearest_thousandths(ends[:, 1]),
    )


@fact(ROAD_FACTS, "unknown", "An input that the recordings lack.", What=UNKNOWN)
def _unknown_inputs(source: FactSource) -> FactColumns:
    codes = sorted(map(UNKNOWN.constants.index, source.trajectories.unknown))
    return (np.array(codes, np.int64),)
