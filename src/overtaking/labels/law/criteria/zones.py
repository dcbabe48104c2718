"""Criteria about places and signs that forbid to overtake.

A `Case` is a batch of simulations with one ego each. An event is a frame of each simulation,
`NEVER` (-1) without it; a span is the first and the last frame of a stretch of time. A zone is a
place where the law restricts overtaking, such as a bend, a crossing or a stretch with a sign; zones
belong to the `course` of a road; a road may be without one. `overtaking_span` lasts from the line
crossing until the target is passed and the ego back on its side. In `ERROR_FORMULA`, sp and sv are
the standard deviations of a position and of a speed. The docstring of the package `criteria`
explains these terms in full, `rule.Criterion` describes the methods.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.case import (
    RoadInterval,
    distance_to_intervals,
    ego_may_be,
    opposing_lane_span,
    overtaking_span,
    target_may_be,
    zone_intervals,
)
from overtaking.labels.law.margins import (
    SAME_MARGIN_M,
    UNCONSTRAINED,
    breach_frames_in,
    finding_from_margins,
    finding_not_applicable,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, return_time_error
from overtaking.labels.law.numbers import quantity
from overtaking.labels.law.remedies import BreachContext, Remedy, RemedyQuantity, single_change
from overtaking.labels.law.rule import Criterion
from overtaking.labels.snapshots import METRES_PER_MM, at_frame, slot_or_ego
from overtaking.model.overtake_events import NEVER
from overtaking.model.road_course import ZoneKind
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding, Verdict
from overtaking.world.sight_distance import all_zones_for

# Later than any frame: a minimum of frames ignores it, as a maximum ignores `NEVER` (-1).
_NO_FRAME = np.iinfo(np.int32).max

_WITH_APPROACH = (ZoneKind.JUNCTION, ZoneKind.PEDESTRIAN_CROSSING, ZoneKind.LEVEL_CROSSING)
"""Places before which overtaking is also forbidden, within the approach length."""

_WAIVED_ON_SEVERAL_LANES = (
    ZoneKind.CREST,
    ZoneKind.LEVEL_CROSSING,
    ZoneKind.JUNCTION,
    ZoneKind.BEND,
)
"""Places where the ego may overtake on a road with several lanes in its direction, if it does not
use the opposing lane."""

_ALWAYS_FORBIDDEN = (ZoneKind.PEDESTRIAN_CROSSING, ZoneKind.NARROW)
"""Places where no number of lanes permits overtaking."""

_WHILE_OVERTAKING = "From line_crossed until the target is passed and the ego back on its side"

_ERROR_FORMULA = "sp; where the ego is back decides, sqrt(sp^2 + (v sp / speed across the road)^2)"
"""The second term counts if the margin is measured where the ego is back on its side."""

_APPROACH_LENGTH = quantity(
    50.0, "m", why="A choice for 'immediately before'; a car at 60 km/h stops within it"
)
"""Length of road that is 'immediately before' a crossing or junction."""

ApproachLength = Callable[[ZoneKind], float]
"""Function from the kind of a place to its approach: the road before it that counts as part [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _ForbiddenZones:
    """Stretches of road in which the ego must not overtake, in some simulations.

    Attributes:
        intervals: The stretches, each with its approach: the road before it that counts.
        applies: Whether they forbid overtaking in each simulation, shape (simulation,).
    """

    intervals: list[RoadInterval]
    applies: Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOvertakingZones(Criterion):
    """The ego does not overtake in a dangerous place, or a target that is itself overtaking.

    Attributes:
        approach_length: Length of road before a crossing or junction that counts as part of it.
    """

    approach_length: Quantity = _APPROACH_LENGTH
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kind of the road."""
        return frozenset(["road_kind"])

    def predicate(self) -> str:
        """The places, whose kinds the gloss of the rule names, and the target that overtakes."""
        return (
            f"{_WHILE_OVERTAKING}: the ego's front is in no such place of the road, nor "
            f"{self.approach_length} or less before a crossing or junction. On two-way roads, "
            "at attempt: the target's body is not over the line between the directions."
        )

    def check(self, case: Case) -> Finding:
        """The smallest distance from a place, or of the target from the line, decides."""
        trajectories = case.trajectories
        # A one-way road without a course has no zones. A road of unknown kind may be two-way: the
        # rule then applies, and is undecidable, because `road_kind` is a required input.
        if not (
            trajectories.road.is_two_way
            or trajectories.road.course
            or "road_kind" in trajectories.unknown
        ):
            return finding_not_applicable(case.signals.num_simulations)
        findings = [_zone_finding(case, zones) for zones in self._forbidden_zones(case)]
        return _combined_findings([*findings, _target_side_finding(case)])

    ERROR_FORMULA: ClassVar[str] = _ERROR_FORMULA

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the distance from the deciding place, as `_zone_margin_error` [m]."""
        return _zone_margin_error(case, finding, errors, self._forbidden_zones(case))

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """Overtake before or after the place, or have the target on its own side of the road."""
        # `breach.case` has one simulation.
        target_margin = float(_target_side_finding(breach.case).margin[0])
        if target_margin < 0 and abs(target_margin - breach.margin) < SAME_MARGIN_M:
            return single_change(
                RemedyQuantity.CLEARANCE,
                actual=breach.margin,
                needed=0.0,
                frame=breach.first_frame,
                slot=breach.target_slot,
            )
        return _overtake_elsewhere(breach)

    def _forbidden_zones(self, case: Case) -> list[_ForbiddenZones]:
        """Places that always forbid overtaking, and places that permit it on several lanes."""
        num_simulations = case.signals.num_simulations
        has_several_lanes = np.full(num_simulations, case.trajectories.road.num_lanes > 1)
        is_waived = has_several_lanes & ~opposing_lane_span(case).is_nonempty
        approach_length = _approach_lengths(self.approach_length)
        return [
            _ForbiddenZones(
                intervals=zone_intervals(case, _ALWAYS_FORBIDDEN, approach_length),
                applies=np.ones(num_simulations, np.bool_),
            ),
            _ForbiddenZones(
                intervals=zone_intervals(case, _WAIVED_ON_SEVERAL_LANES, approach_length),
                applies=~is_waived,
            ),
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOvertakingSigns(Criterion):
    """The ego does not overtake where a sign forbids it for the ego and its target.

    Attributes:
        has_sign_for_motorcycles: Whether the law has a sign that forbids motorcycles to overtake.
        exempts_two_wheelers: Whether the sign for heavy vehicles, like the general sign, permits
            overtaking bicycles and motorcycles.
        is_undecidable_without_zones: Whether an overtake on a road without zones is undecidable
            where the posted speed limit is unknown: such a recording may have no signs either.
    """

    has_sign_for_motorcycles: bool = False
    exempts_two_wheelers: bool = False
    is_undecidable_without_zones: bool = False
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kinds of ego and target; and the posted limits, without which signs are unknown."""
        return frozenset(["kinds", "speed_limit"])

    def predicate(self) -> str:
        """The stretches of signs, and the targets."""
        targets = (
            ", the target being no bicycle and no motorcycle"
            if self.exempts_two_wheelers
            else " and its target"
        )
        return (
            f"{_WHILE_OVERTAKING}: the ego's front is not in a stretch with a sign for it{targets}."
        )

    def check(self, case: Case) -> Finding:
        """The smallest distance from a stretch with such a sign decides."""
        trajectories, has_attempt = case.trajectories, case.events.has_attempt
        if not all_zones_for(trajectories.road, direction=1):  # 1 is the ego's direction.
            # Signs are known only if the posted limit is known. Otherwise the rule may apply, and
            # is then undecidable, because `speed_limit` is a required input.
            may_have_sign = has_attempt & ("speed_limit" in trajectories.unknown)
            may_have_sign &= self.is_undecidable_without_zones
            attempt = case.events.attempt
            return finding_from_margins(
                may_have_sign, np.zeros(len(attempt), np.float32), attempt, attempt
            )
        return _combined_findings(
            [_zone_finding(case, zones) for zones in self._forbidden_zones(case)]
        )

    ERROR_FORMULA: ClassVar[str] = _ERROR_FORMULA

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the distance from the deciding place, as `_zone_margin_error` [m]."""
        return _zone_margin_error(case, finding, errors, self._forbidden_zones(case))

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """Overtake before or after the stretch."""
        return _overtake_elsewhere(breach)

    def _forbidden_zones(self, case: Case) -> list[_ForbiddenZones]:
        """The stretches of each sign, for simulations whose ego and target the sign concerns."""
        # A vehicle of unknown kind counts as a kind that the sign concerns: the rule then applies,
        # and is undecidable, because `kinds` is a required input.
        has_target = case.target.slot != NO_VEHICLE
        # A target that is known to be a bicycle or a motorcycle is a two-wheeler.
        target_is_no_two_wheeler = target_may_be(case, bicycle=False) & ~_target_is_motorcycle(case)
        applies_by_sign = {
            ZoneKind.NO_OVERTAKING: target_is_no_two_wheeler & has_target,
            ZoneKind.NO_OVERTAKING_HEAVY: ego_may_be(case, VehicleKind.TRUCK) & has_target,
        }
        if self.exempts_two_wheelers:
            applies_by_sign[ZoneKind.NO_OVERTAKING_HEAVY] &= target_is_no_two_wheeler
        if self.has_sign_for_motorcycles:
            applies_by_sign[ZoneKind.NO_OVERTAKING_MOTORCYCLE] = (
                ego_may_be(case, VehicleKind.MOTORCYCLE) & has_target
            )
        # A sign forbids from its place on, so its stretch has no approach.
        return _zones_by_kind(case, applies_by_sign, approach_length=lambda _: 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOvertakingAtCrossings(Criterion):
    """The ego overtakes no vehicle where pedestrians cross, no motor vehicle where rails cross.

    Attributes:
        pedestrian_approach_length: Length of road before a crossing of pedestrians that counts as
            part of it.
        level_approach_length: The same before a level crossing.
    """

    pedestrian_approach_length: Quantity = _APPROACH_LENGTH
    level_approach_length: Quantity
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kind of the target; a target of unknown kind counts as a motor vehicle."""
        return frozenset(["kinds"])

    def predicate(self) -> str:
        """Both kinds of crossing, with the road before them."""
        return (
            f"{_WHILE_OVERTAKING}: the ego's front is not in a crossing of pedestrians or "
            f"{self.pedestrian_approach_length} before it, nor, the target being no bicycle, in a "
            f"level crossing or {self.level_approach_length} before it."
        )

    def check(self, case: Case) -> Finding:
        """The smallest distance from a crossing decides."""
        if not case.trajectories.road.course:
            return finding_not_applicable(case.signals.num_simulations)
        return _combined_findings(
            [_zone_finding(case, zones) for zones in self._forbidden_zones(case)]
        )

    ERROR_FORMULA: ClassVar[str] = _ERROR_FORMULA

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the distance from the deciding place, as `_zone_margin_error` [m]."""
        return _zone_margin_error(case, finding, errors, self._forbidden_zones(case))

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """Overtake before or after the crossing."""
        return _overtake_elsewhere(breach)

    def _forbidden_zones(self, case: Case) -> list[_ForbiddenZones]:
        """Crossings of pedestrians for all targets, level crossings for motor vehicles."""
        has_target = case.target.slot != NO_VEHICLE
        applies_by_kind = {
            ZoneKind.PEDESTRIAN_CROSSING: has_target,
            ZoneKind.LEVEL_CROSSING: has_target & target_may_be(case, bicycle=False),
        }
        approach_length = _approach_lengths(
            self.pedestrian_approach_length, self.level_approach_length
        )
        return _zones_by_kind(case, applies_by_kind, approach_length)


def _approach_lengths(approach: Quantity, before_rails: Quantity | None = None) -> ApproachLength:
    """Function from the kind of a place to the length of road before it that counts [m].

    Args:
        approach: Length before the kinds in `_WITH_APPROACH`.
        before_rails: Length before level crossings, if it differs.
    """
    lengths: dict[ZoneKind, float] = dict.fromkeys(_WITH_APPROACH, float(approach.f32))
    if before_rails is not None:
        lengths[ZoneKind.LEVEL_CROSSING] = float(before_rails.f32)
    return lambda kind: lengths.get(kind, 0.0)


def _zones_by_kind(
    case: Case, applies_by_kind: Mapping[ZoneKind, Mask], approach_length: ApproachLength
) -> list[_ForbiddenZones]:
    """One `_ForbiddenZones` for each kind.

    Args:
        case: The batch.
        applies_by_kind: Whether each kind forbids overtaking in each simulation, (simulation,).
        approach_length: As for `zone_intervals`.
    """
    return [
        _ForbiddenZones(intervals=zone_intervals(case, [kind], approach_length), applies=applies)
        for kind, applies in applies_by_kind.items()
    ]


def _zone_finding(case: Case, zones: _ForbiddenZones) -> Finding:
    """Check that the ego does not overtake in these zones.

    The margin is the distance of the ego's front from the nearest zone, negative within it.
    """
    span, margin = overtaking_span(case), distance_to_intervals(case, zones.intervals)
    applies = zones.applies & span.is_nonempty
    rows = np.flatnonzero(applies)
    is_in_span = span.mask(rows, margin.shape[1])
    min_margin = np.full(len(applies), UNCONSTRAINED)
    min_margin[rows] = np.where(is_in_span, margin[rows], UNCONSTRAINED).min(axis=1)
    first, last, num_run_frames = breach_frames_in(span, rows, margin[rows] < 0)
    is_judged = applies & (min_margin < UNCONSTRAINED)
    return finding_from_margins(is_judged, min_margin, first, last, longest=num_run_frames)


def _target_side_finding(case: Case) -> Finding:
    """Check that, on a two-way road, the target is not over the line between the directions."""
    trajectories, events, road = case.trajectories, case.events, case.trajectories.road
    if not (road.is_two_way or "road_kind" in trajectories.unknown):
        return finding_not_applicable(case.signals.num_simulations)
    frame = events.attempt
    # The line between the directions bounds the last lane. Mirrored, positions grow to the
    # overtaking side also in left-hand traffic.
    line = np.float32(road.overtaking_sign * road.lane_boundaries[-1])
    has_target = (case.target.slot != NO_VEHICLE) & (frame != NEVER)
    return finding_from_margins(has_target, line - target_left_edge(case), frame, frame)


def target_left_edge(case: Case) -> F32:
    """Lateral position of the target's left side at the attempt, shape (simulation,) [m].

    The values are undefined where there is no target or no attempt.
    """
    trajectories, row = case.trajectories, np.arange(case.signals.num_simulations)
    slot, frame = slot_or_ego(case.target.slot), np.maximum(case.events.attempt, 0)
    lateral_position = (
        np.float32(trajectories.road.overtaking_sign)
        * as_f32(trajectories.states.d[row, slot, frame])
        * METRES_PER_MM
    )
    return lateral_position + trajectories.scenario.vehicles.width[row, slot] * HALF


def _target_is_motorcycle(case: Case) -> Mask:
    """Whether the target is known to be a motorcycle, shape (simulation,)."""
    slot, trajectories = case.target.slot, case.trajectories
    kind = trajectories.scenario.vehicles.kind[np.arange(len(slot)), slot_or_ego(slot)]
    return (kind == VehicleKind.MOTORCYCLE) & ("kinds" not in trajectories.unknown)


def _combined_findings(findings: list[Finding]) -> Finding:
    """One finding from several checks: the smallest margin, and the frames of all breaches."""
    applies = np.stack([finding.verdict != Verdict.NOT_APPLICABLE for finding in findings])
    margins = np.stack([finding.margin for finding in findings])
    min_margin = np.where(applies, margins, UNCONSTRAINED).min(axis=0)
    first_frames = np.stack([finding.first_frame for finding in findings])
    # `finding_from_margins` ignores these frames where no check finds a breach.
    first = np.where(first_frames == NEVER, _NO_FRAME, first_frames).min(axis=0)
    last = np.stack([finding.last_frame for finding in findings]).max(axis=0)
    longest = np.stack([finding.longest_run for finding in findings]).max(axis=0)
    return finding_from_margins(
        min_margin < UNCONSTRAINED, min_margin, first, last, longest=longest
    )


def _zone_margin_error(
    case: Case,
    finding: Finding,
    errors: MeasurementErrors,
    forbidden_zones: Iterable[_ForbiddenZones],
) -> F32:
    """Error of a position along the road, and of the return where the return decides [m].

    Where the margin is the one of the frame in which the ego is back on its side, an error of the
    lateral position moves this frame, and so the position along the road.
    """
    end, position_error = overtaking_span(case).last, np.float32(errors.position_std)
    decides_at_end = np.zeros(len(end), np.bool_)
    for zones in forbidden_zones:
        distance = at_frame(distance_to_intervals(case, zones.intervals), end)
        decides_at_end |= zones.applies & (np.abs(distance - finding.margin) < SAME_MARGIN_M)
    return_decides = decides_at_end & (end == opposing_lane_span(case).last)
    return_error = at_frame(case.signals.speed, end) * return_time_error(case, errors)
    both_errors = np.sqrt(position_error * position_error + return_error * return_error)
    return np.where(return_decides, both_errors, position_error)


def _overtake_elsewhere(breach: BreachContext) -> tuple[Remedy]:
    """One remedy: overtake outside the place, beyond the end to which the ego was nearer.

    The margin is minus the distance to that end.
    """
    return single_change(RemedyQuantity.PLACE, actual=-breach.margin, needed=0.0)
