"""Criteria about lines, the width of lanes, and lanes that a class of vehicles may not use.

A `Case` is a batch of simulations with one ego each; a `BreachContext` has the one simulation of
its breach, at index 0. An event is a frame of each simulation, `NEVER` (-1) without it; a span is
the first and the last frame of a stretch of time. `judged_span` lasts from 3 s before the attempt
to overtake to 3 s after the return; without an attempt it has all driven frames. Lane 0 is the
slowest; left is the overtaking side, also in left-hand traffic, where `overtaking_sign` (-1)
mirrors the lateral positions of the road. In `ERROR_FORMULA`, sp and sv are the standard deviations
of a position and of a speed. The docstring of the package `criteria` explains these terms in full,
`rule.Criterion` describes the methods.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.quantities import Quantity
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
from overtaking.labels.law.numbers import LINE_TOLERANCE, quantity
from overtaking.labels.law.remedies import BreachContext, Remedy, RemedyQuantity, single_change
from overtaking.labels.law.rule import Criterion
from overtaking.labels.snapshots import FrameSpan
from overtaking.model.overtake_events import NEVER
from overtaking.model.road import DrivingSide, Road, RoadMark
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case, Finding, Severity, Verdict

_SOLID_MARKS = frozenset(
    [RoadMark.SOLID, RoadMark.SOLID_SOLID, RoadMark.SOLID_BROKEN, RoadMark.CURB, RoadMark.GRASS]
)
"""Marks that a vehicle must not cross from the lane; of a double line the nearer line counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidLines(Criterion):
    """No corner of the ego is beyond a line that is continuous for it.

    Attributes:
        severity_between_directions: Severity of crossing the line between the directions of travel,
            in a law that grades breaches by the line; crossing any other line is then light. None
            in a law that grades all lines alike.
    """

    severity_between_directions: Severity | None = None
    unit: str = "m"
    applies_without_attempt: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The marks of the road."""
        return frozenset(["marks"])

    def predicate(self) -> str:
        """The lines, and the stretch of a line that counts."""
        return (
            f"At every frame: no corner of the ego is more than {LINE_TOLERANCE} over a line "
            "that is continuous for the lane it comes from, nor over a kerb or grass. Of the line "
            "between the directions the stretch beside the ego's centre counts: an ego that is "
            "beyond it when it becomes continuous for the ego's direction breaks the rule."
        )

    def check(self, case: Case) -> Finding:
        """The smallest distance from a continuous line decides."""
        road, span = case.trajectories.road, judged_span(case)
        if "marks" in case.trajectories.unknown:
            # Any line may be there: the rule applies, and is undecidable, because `marks` is a
            # required input.
            never = np.full(len(span.first), NEVER)
            return finding_from_margins(
                span.is_nonempty, np.zeros(len(never), np.float32), never, never
            )
        if not (solid_sides := solid_borders(road)):
            return finding_not_applicable(case.signals.num_simulations)
        tolerance = LINE_TOLERANCE.f32
        distances = [
            _min_distance_to_border(case, span, border, sides)
            for border, sides in solid_sides.items()
        ]
        min_margin = np.minimum.reduce(distances) + tolerance
        # The frames of the breach are searched only in simulations with a breach.
        rows = np.flatnonzero(span.is_nonempty & (min_margin < 0))
        is_over = [
            _distances_to_border(case, rows, border, sides) + tolerance < 0
            for border, sides in solid_sides.items()
        ]
        is_over_any = np.logical_or.reduce(is_over)
        first, last, num_run_frames = breach_frames_in(span, rows, is_over_any)
        applies = span.is_nonempty & (min_margin < UNCONSTRAINED)
        finding = finding_from_margins(applies, min_margin, first, last, longest=num_run_frames)
        if self.severity_between_directions is None:
            return finding
        # The line between the directions is the last border, and `distances` are in order.
        is_centre_line_solid = road.is_two_way and road.num_lanes in solid_sides
        is_over_centre_line = (distances[-1] + tolerance < 0) & is_centre_line_solid
        severity = np.where(is_over_centre_line, self.severity_between_directions, Severity.LIGHT)
        is_illegal = finding.verdict == Verdict.ILLEGAL
        return finding.replace(
            severity=np.where(is_illegal, severity, Severity.NONE).astype(np.uint8)
        )

    ERROR_FORMULA: ClassVar[str] = "sp"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of one position across the road [m]."""
        del case
        return np.full_like(finding.margin, errors.position_std)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The body at most `LINE_TOLERANCE` over the line, where the margin is 0."""
        return single_change(RemedyQuantity.CLEARANCE, actual=breach.margin, needed=0.0)


def solid_borders(road: Road) -> dict[int, tuple[bool, bool]]:
    """The lane borders with a line that is continuous for traffic on one side at least.

    Returns:
        By border, in order, whether the line is continuous for traffic on its right, and on its
        left. Border 0 is the slow edge, border k the left border of lane k - 1.
    """
    marks = [(lane.right_mark, lane.left_mark) for lane in road.lanes]
    # Each pair: slow side, overtaking side. Right is the slow side in this module, but lanes name
    # their marks by geometric sides.
    if road.driving_side is not DrivingSide.RIGHT:
        marks = [(left, right) for right, left in marks]
    borders = {}
    for k in range(road.num_lanes + 1):
        from_right = k > 0 and marks[k - 1][1] in _SOLID_MARKS
        if k == road.num_lanes:
            # The last line may change along the road: pairs of a station and the mark from there.
            from_right = any(mark in _SOLID_MARKS for _, mark in road.overtaking_edge_marks)
        from_left = k < road.num_lanes and marks[k][0] in _SOLID_MARKS
        if from_right or from_left:
            borders[k] = (from_right, from_left)
    return borders


def is_solid_at(road: Road, s: F32) -> Mask:
    """Whether the left line of the fastest lane is continuous for this lane at station `s` [m]."""
    # Each mark begins at its station and ends at the next; the first begins at minus infinity.
    stations, marks = zip(*road.overtaking_edge_marks, strict=True)
    is_solid = np.array([mark in _SOLID_MARKS for mark in marks])
    return is_solid[np.searchsorted(np.array(stations), s, side="right") - 1]


def _min_distance_to_border(
    case: Case, span: FrameSpan, border: int, sides: tuple[bool, bool]
) -> F32:
    """Smallest `_distances_to_border` in a span, shape (simulation,) [m]."""
    signals, road = case.signals, case.trajectories.road
    position = as_f32(road.overtaking_sign * road.lane_boundaries)[border]
    # The compiled minimum compares one side of the body with the border. That suffices at the first
    # and the last border, where the distance stays negative beyond the border.
    if border == 0:
        return minimum_to_limit(signals.right_edge, position, span, is_most=False).min_margin
    if border == road.num_lanes and len(road.overtaking_edge_marks) == 1:
        return minimum_to_limit(signals.left_edge, position, span, is_most=True).min_margin
    all_simulations = np.arange(signals.num_simulations)
    return reduce_span(np.minimum, _distances_to_border(case, all_simulations, border, sides), span)


def _distances_to_border(
    case: Case, rows: IndexArray, border: int, sides: tuple[bool, bool]
) -> F32:
    """Distance of the ego's body from a lane border, negative where the body is over it.

    Beyond the first and the last border of the driving lanes, that is, off the road or in the
    opposing lane, the distance stays negative. Beyond any other border, the ego is in a lane, and
    the distance is positive. A line that is continuous for one side counts only while the ego comes
    from this side.

    Args:
        case: The batch.
        rows: Simulations, shape (row,).
        border: Key of `solid_borders`.
        sides: Its value.

    Returns:
        Shape (row, time) [m].
    """
    signals, road = case.signals, case.trajectories.road
    position = as_f32(road.overtaking_sign * road.lane_boundaries)[border]
    on_right, on_left = position - signals.left_edge[rows], signals.right_edge[rows] - position
    if border == 0:
        return on_left
    if border == road.num_lanes:
        return np.where(is_solid_at(road, signals.s[rows]), on_right, UNCONSTRAINED)
    # Both are negative while the body is over the line; else the positive one is the distance.
    distance = np.maximum(on_right, on_left)
    from_right, from_left = sides
    if from_right and from_left:
        return distance
    # An ego from the other side may cross: for it, the distance is positive.
    came_from_right = _came_from_right(on_right >= 0, on_left >= 0)
    return np.where(came_from_right == from_right, distance, np.abs(distance))


def _came_from_right(is_right: Mask, is_left: Mask) -> Mask:
    """Whether the ego was wholly on the right of a border more recently than on its left.

    Args:
        is_right: Whether the whole body is on the right, shape (row, time).
        is_left: Whether the whole body is on the left, same shape.

    Returns:
        Same shape; true before the body has been wholly on either side.
    """
    frame = np.arange(is_right.shape[1], dtype=np.int32)
    last_right = np.maximum.accumulate(np.where(is_right, frame, -1), axis=1)
    last_left = np.maximum.accumulate(np.where(is_left, frame, -1), axis=1)
    return last_right >= last_left


@dataclass(frozen=True, slots=True, kw_only=True)
class WidthForOvertaking(Criterion):
    """At the attempt there is a driving lane on the left that is wide enough for the ego.

    Widths of lanes and vehicles are taken as exact, so there is no standard error.

    Attributes:
        min_border_distance: Smallest lawful distance of the ego from either border of the lane on
            the left.
    """

    min_border_distance: Quantity = quantity(
        0.2, "m", "stl-monitor", why="Room to either border of the lane (close_to_lane_border)"
    )
    unit: str = "m"

    def predicate(self) -> str:
        """The lane, and its width beyond the width of the ego."""
        extra_width = 2.0 * self.min_border_distance.number
        return (
            "At attempt: the lane on the left is a driving lane and at least "
            f"{extra_width:.3g} {self.min_border_distance.unit} wider than the ego."
        )

    def check(self, case: Case) -> Finding:
        """The width of the lane on the left, minus the needed width, decides."""
        width = case.trajectories.scenario.vehicles.width[:, EGO_SLOT]
        needed_width = width + np.float32(2.0) * self.min_border_distance.f32
        margin = _left_lane_width(case) - needed_width
        return finding_at_frame(case.events.attempt, margin, case.events.has_attempt)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A lane on the left that is wide enough."""
        width = float(_left_lane_width(breach.case)[0])
        return single_change(
            RemedyQuantity.WIDTH,
            actual=width,
            needed=width - breach.margin,
            frame=breach.first_frame,
        )


def _left_lane_width(case: Case) -> F32:
    """Width of the driving lane left of the original lane, 0 without one, (simulation,) [m]."""
    road = case.trajectories.road
    neighbour = road.overtaking_side_neighbour  # The opposing lane, another strip, or None.
    is_driving_lane = neighbour is not None and neighbour.kind == "driving"
    width_beyond = neighbour.width if neighbour is not None and is_driving_lane else 0.0
    # Element k has the lane on the left of lane k, so lane 0 is left out. Codes of lanes beyond
    # the driving lanes read the last element.
    widths = np.array([lane.width for lane in road.lanes[1:]] + [width_beyond], np.float32)
    return widths[np.minimum(case.events.original_lane, len(widths) - 1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RightmostLanesForTrucks(Criterion):
    """On a motorway with several lanes a truck is in one of the slowest lanes.

    An ego of unknown kind counts as a truck, an unknown road as a motorway: the rule then applies,
    and is undecidable, because both are required inputs.

    Attributes:
        num_open_lanes: Number of the slowest lanes that trucks may use.
        min_lanes: Smallest number of lanes of a motorway to which the rule applies.
    """

    num_open_lanes: Quantity
    min_lanes: Quantity
    unit: str = "lanes"
    applies_without_attempt: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kind of the ego, and the kind of the road."""
        return frozenset(["kinds", "road_kind"])

    def predicate(self) -> str:
        """The motorways, and the lanes."""
        return (
            "At every frame, the ego being a truck on a motorway with at least "
            f"{self.min_lanes.bare()} lanes: its lane is one of the "
            f"{self.num_open_lanes.bare()} slowest."
        )

    def check(self, case: Case) -> Finding:
        """The fastest lane that the ego used decides."""
        signals, is_truck = case.signals, ego_may_be(case, VehicleKind.TRUCK)
        if not (self._is_on_wide_motorway(case) and is_truck.any()):
            return finding_not_applicable(signals.num_simulations)
        span, num_open_lanes = judged_span(case), self.num_open_lanes.f32
        applies = is_truck & span.is_nonempty
        rows = np.flatnonzero(applies)
        # As a signed number the strip beyond the slow edge, code 255, is lane -1: below lane 0.
        lane, margin = signed_lane(signals.lane[rows]), np.zeros(len(applies), np.float32)
        fastest = as_f32(reduce_span(np.maximum, lane, span.select(rows)))
        # Lanes count from 0. The half makes the margin 0.5 in the last open lane and -0.5 in the
        # next, so that no margin is 0.
        margin[rows] = num_open_lanes - HALF - fastest
        breaches = np.flatnonzero(margin[rows] < 0)
        is_in_closed_lane = lane[breaches] >= num_open_lanes
        first, last, num_run_frames = breach_frames_in(span, rows[breaches], is_in_closed_lane)
        return finding_from_margins(applies, margin, first, last, longest=num_run_frames)

    ERROR_FORMULA: ClassVar[str] = "0.5 sp / distance from the border that decides"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the margin: half a lane where the ego's centre is `sp` from the border [lanes].

        The border lies between the last open lane and the next.
        """
        if not self._is_on_wide_motorway(case):
            return np.zeros_like(finding.margin)
        road, span = case.trajectories.road, judged_span(case)
        borders = as_f32(road.overtaking_sign * road.lane_boundaries)
        border = borders[int(self.num_open_lanes.f32)]
        rows, frames = span.instants()
        # Largest signed distance of the centre to the left of the border: the fastest lane decides.
        max_distance = np.full(len(span.first), -UNCONSTRAINED, np.float32)
        np.maximum.at(max_distance, rows, case.signals.lateral_position[rows, frames] - border)
        return lane_margin_error(max_distance, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The fastest lane that is open to trucks."""
        lanes = signed_lane(breach.case.signals.lane)[0, breach.frames]
        worst, fastest_open = int(lanes.argmax()), int(self.num_open_lanes.f32) - 1
        return single_change(
            RemedyQuantity.LANE,
            actual=lanes[worst],
            needed=fastest_open,
            frame=breach.frames[worst],
        )

    def _is_on_wide_motorway(self, case: Case) -> bool:
        """Whether the road is or may be a motorway with enough lanes for the rule."""
        road = case.trajectories.road
        is_motorway = road.kind == "motorway" or "road_kind" in case.trajectories.unknown
        return is_motorway and road.num_lanes >= self.min_lanes.number
