"""Rules about lines and lanes: L2, L16, L20."""

import numpy as np

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import ego_may_be, judged_span, signed_lane
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    breach_frames_in,
    finding_at_frame,
    finding_from_margins,
    finding_not_applicable,
    minimum_to_limit,
    reduce_span,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, lane_margin_error
from overtaking.labels.law.numbers import LINE_TOLERANCE, amount, bare
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.snapshots import FrameSpan
from overtaking.model.overtake_events import NEVER
from overtaking.model.road import DrivingSide, Road, RoadMark
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case, Finding, Severity, Verdict


def _position_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of one position across the road."""
    del case
    return np.full_like(finding.margin, errors.position_std)


def _slow_lanes(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of being in the two slowest lanes, by the way to the border of the third."""
    del finding
    road, span = case.trajectories.road, judged_span(case)
    border = as_f32(road.overtaking_sign * road.lane_boundaries)[int(constant("law.trucks.lanes"))]
    rows, frames = span.instants()
    over = np.full(len(span.first), -UNCONSTRAINED, np.float32)
    np.maximum.at(over, rows, case.signals.lateral_position[rows, frames] - border)
    return lane_margin_error(over, errors)


OF_PLACE = Spread(formula="sp", standard_error=_position_error)

SLOW_LANES = Spread(
    formula="0.5 sp / distance from the border that decides", standard_error=_slow_lanes
)

SOLID_MARKS = frozenset(
    [RoadMark.SOLID, RoadMark.SOLID_SOLID, RoadMark.SOLID_BROKEN, RoadMark.CURB, RoadMark.GRASS]
)
"""Marks that a vehicle must not cross from the lane; of a mixed line the nearer one counts."""

OFF_THE_LINE = (
    f"At every frame: no corner of the ego is more than {LINE_TOLERANCE} over a line "
    "that is continuous for the lane it comes from, nor over a kerb or grass. Of the line between "
    "the directions the stretch beside the ego's centre counts: an ego that is beyond it when it "
    "becomes continuous for the ego's direction breaks the rule."
)


def _off_the_line(case: Case) -> Finding:
    """No corner of the ego is beyond a line that is continuous for it."""
    road, span = case.trajectories.road, judged_span(case)
    if "marks" in case.trajectories.unknown:
        never = np.full(len(span.first), NEVER)  # Any line may be there: the rule applies.
        return finding_from_margins(
            span.is_nonempty, np.zeros(len(never), np.float32), never, never
        )
    if not (closed := solid_borders(road)):
        return finding_not_applicable(case.signals.num_simulations)
    tolerance = LINE_TOLERANCE.f32
    distances = [_min_distance_to_border(case, span, k, sides) for k, sides in closed.items()]
    min_margin = np.minimum.reduce(distances) + tolerance
    rows = np.flatnonzero(span.is_nonempty & (min_margin < 0))
    broken = [
        _distances_to_border(case, rows, k, sides) + tolerance < 0 for k, sides in closed.items()
    ]
    first, last, longest = breach_frames_in(span, rows, np.logical_or.reduce(broken))
    finding = finding_from_margins(
        span.is_nonempty & (min_margin < UNCONSTRAINED), min_margin, first, last, longest=longest
    )
    # Very serious where the line separates the directions of travel (146(o)), else light.
    between = road.is_two_way and road.num_lanes in closed
    is_beyond_road = (distances[-1] + tolerance < 0) & between
    severity = np.where(is_beyond_road, Severity.VERY_SERIOUS, Severity.LIGHT)
    illegal = finding.verdict == Verdict.ILLEGAL
    return finding.replace(severity=np.where(illegal, severity, Severity.NONE).astype(np.uint8))


def solid_borders(road: Road) -> dict[int, tuple[bool, bool]]:
    """The borders with a line that is continuous from the right, from the left, or from both."""
    marks = [(lane.right_mark, lane.left_mark) for lane in road.lanes]
    if road.driving_side is not DrivingSide.RIGHT:
        marks = [(left, right) for right, left in marks]
    borders = {}
    for k in range(road.num_lanes + 1):
        from_right = k > 0 and marks[k - 1][1] in SOLID_MARKS
        if k == road.num_lanes:
            from_right = any(mark in SOLID_MARKS for _, mark in road.overtaking_edge_marks)
        from_left = k < road.num_lanes and marks[k][0] in SOLID_MARKS
        if from_right or from_left:
            borders[k] = (from_right, from_left)
    return borders


def _min_distance_to_border(case: Case, span: FrameSpan, k: int, sides: tuple[bool, bool]) -> F32:
    """Smallest distance of the ego's body from border k in a span, shape (simulation,) [m]."""
    signals, road = case.signals, case.trajectories.road
    border = as_f32(road.overtaking_sign * road.lane_boundaries)[k]
    if k == 0:
        return minimum_to_limit(signals.right_edge, border, span, is_most=False).min_margin
    if k == road.num_lanes and len(road.overtaking_edge_marks) == 1:
        return minimum_to_limit(signals.left_edge, border, span, is_most=True).min_margin
    all_simulations = np.arange(signals.num_simulations)
    return reduce_span(np.minimum, _distances_to_border(case, all_simulations, k, sides), span)


def _distances_to_border(case: Case, rows: IndexArray, k: int, sides: tuple[bool, bool]) -> F32:
    """Distance of the ego's body from border k, negative where it treads on it, (row, time) [m].

    Beyond an edge of the road it stays negative. A line that may be crossed from one side is looked
    at only while the ego comes from the other.
    """
    signals, road = case.signals, case.trajectories.road
    border = as_f32(road.overtaking_sign * road.lane_boundaries)[k]
    on_right, on_left = border - signals.left_edge[rows], signals.right_edge[rows] - border
    if k == 0:
        return on_left
    if k == road.num_lanes:
        return np.where(is_solid_at(road, signals.s[rows]), on_right, UNCONSTRAINED)
    clear = np.maximum(on_right, on_left)
    from_right, from_left = sides
    if from_right and from_left:
        return clear
    came_from_right = _came_from_right(on_right >= 0, on_left >= 0)
    return np.where(came_from_right == from_right, clear, np.abs(clear))


def is_solid_at(road: Road, s: F32) -> Mask:
    """Whether the line on the fast side of the fastest lane is continuous from there at `s`."""
    begins, marks = zip(*road.overtaking_edge_marks, strict=True)
    closed = np.array([mark in SOLID_MARKS for mark in marks])
    return closed[np.searchsorted(np.array(begins), s, side="right") - 1]


def _came_from_right(right: Mask, left: Mask) -> Mask:
    """Whether the ego was last wholly on the right of a border, shape (simulation, time)."""
    frame = np.arange(right.shape[1], dtype=np.int32)
    last_right = np.maximum.accumulate(np.where(right, frame, -1), axis=1)
    last_left = np.maximum.accumulate(np.where(left, frame, -1), axis=1)
    return last_right >= last_left


L2 = Rule(
    id="pt.rst.60-m1-m3@2019",
    code="L2",
    article="Regulation of signs, Article 60 (marks M1 and M3); Highway Code, Article 146(o)",
    title="Continuous line",
    gloss="A continuous line must be neither trodden on nor crossed; of a continuous and a broken"
    " line side by side the one nearer to the driver rules.",
    predicate=OFF_THE_LINE,
    unit="m",
    grade=Grade.BY_BREACH,
    source="pt-signs-2019",
    required_inputs=frozenset(["marks"]),
    applies_without_attempt=True,
    check=_off_the_line,
    spread=OF_PLACE,
)


def _wide_enough(case: Case) -> Finding:
    """At the start there is a driving lane on the left, with 0.2 m to spare on either side."""
    events = case.events
    widths = left_lane_widths(case.trajectories.road)
    lane = np.minimum(events.original_lane, len(widths) - 1)
    spare = np.float32(2.0) * constant("law.width.border")
    needed = case.trajectories.scenario.vehicles.width[:, EGO_SLOT] + spare
    return finding_at_frame(events.attempt, widths[lane] - needed, events.has_attempt)


def left_lane_widths(road: Road) -> F32:
    """Width of the driving lane to the left of each lane, 0 without such a lane [m]."""
    neighbour = road.overtaking_side_neighbour
    width_beyond = neighbour.width if neighbour is not None and neighbour.kind == "driving" else 0.0
    return np.array([lane.width for lane in road.lanes[1:]] + [width_beyond], np.float32)


L16 = Rule(
    id="pt.ce.41-1-g@2013",
    code="L16",
    article="Articles 41(1)(g) and 38(2)(a)",
    title="Sufficient width",
    gloss="Do not overtake where the carriageway is not wide enough.",
    predicate=(
        "At attempt: the lane on the left is a driving lane and at least "
        f"{amount('law.width.border', times=2.0)} wider than the ego."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    check=_wide_enough,
)


def _in_slow_lanes(case: Case) -> Finding:
    """On a motorway with three or more lanes a truck is in one of the two slowest."""
    signals, road = case.signals, case.trajectories.road
    trucks = ego_may_be(case, VehicleKind.TRUCK)
    motorway = road.kind == "motorway" or "road_kind" in case.trajectories.unknown
    if not (motorway and trucks.any() and road.num_lanes >= constant("law.trucks.from_lanes")):
        return finding_not_applicable(signals.num_simulations)
    span, lanes = judged_span(case), constant("law.trucks.lanes")
    applies = trucks & span.is_nonempty
    rows = np.flatnonzero(applies)
    # The strip beyond the slow edge counts as below lane 0.
    lane, margin = signed_lane(signals.lane[rows]), np.zeros(len(applies), np.float32)
    margin[rows] = lanes - HALF - as_f32(reduce_span(np.maximum, lane, span.select(rows)))
    over = np.flatnonzero(margin[rows] < 0)
    first, last, longest = breach_frames_in(span, rows[over], lane[over] >= lanes)
    return finding_from_margins(applies, margin, first, last, longest=longest)


L20 = Rule(
    id="pt.ce.74@2013",
    code="L20",
    article="Article 74",
    title="Lanes for trucks",
    gloss="On motorways with three or more lanes in one direction, goods vehicles over 3.5 t use "
    "only the two right-most.",
    predicate=(
        "At every frame, the ego being a truck on such a motorway: its lane is one of the "
        f"{bare('law.trucks.lanes')} slowest."
    ),
    unit="lanes",
    grade=Grade.LIGHT,
    required_inputs=frozenset(["kinds", "road_kind"]),
    applies_without_attempt=True,
    check=_in_slow_lanes,
    spread=SLOW_LANES,
)
