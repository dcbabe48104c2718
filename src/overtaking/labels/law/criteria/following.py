"""Criteria about the distance to the vehicle ahead.

A `Case` is a batch of simulations with one ego each; a `BreachContext` has the one simulation of
its breach, at index 0. `judged_span` lasts from 3 s before the attempt to overtake to 3 s after the
return; without an attempt it has all driven frames. `span_after_gap_recovery` leaves out the first
3 s of the recording, in which a driver may restore a gap; `is_regaining_gap` marks the 3 s after
the leader cut in. A belief is the margin that follows from what the driver perceived at a decision;
`belief_at` compares it with the true margin. In `ERROR_FORMULA`, sp and sv are the standard
deviations of a position and of a speed, t and b the reaction time and the deceleration of the safe
distance, v and u the speeds of the vehicles behind and ahead. The docstring of the package
`criteria` explains these terms in full, `rule.Criterion` describes the methods.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, I32, IndexArray, Mask
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.beliefs import belief_at, pull_out_percept
from overtaking.labels.law.case import (
    distance_to_intervals,
    ego_may_be,
    is_regaining_gap,
    judged_span,
    neighbour_at,
    scans,
    span_after_gap_recovery,
    zone_intervals,
)
from overtaking.labels.law.margins import (
    MIN_RATE_OF_CHANGE,
    UNCONSTRAINED,
    finding_at_instants,
    finding_from_margins,
    finding_not_applicable,
    finding_of_minimum,
    finding_over_span,
    margins_within_span,
    minimum_over,
    reduce_span,
)
from overtaking.labels.law.measurement_errors import (
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    deciding_frame,
    gap_error,
    propagated_error,
)
from overtaking.labels.law.numbers import GAP_REGAIN_TIME
from overtaking.labels.law.remedies import (
    NO_SPEED,
    BreachContext,
    Remedy,
    gap_and_closing_speed,
    margins_to_neighbour,
    max_following_speed,
    more_gap,
)
from overtaking.labels.law.rule import Criterion
from overtaking.labels.law.safe_distance import (
    REACTION_AND_DECEL,
    GapMargin,
    decel_for_safe_distance,
    margin_to_leader,
)
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import FrameSpan, at_frame
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.road_course import ZoneKind
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, PerceivedVehicle
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding

_LEADER = NeighbourRole.LEADER

_NO_ERROR = np.float32(0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeDistance(Criterion):
    """The gap to the leader avoids a collision if the leader brakes hard."""

    unit: str = "m"
    applies_without_attempt: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather, on which the deceleration depends."""
        return frozenset(["weather"])

    @property
    def believed_margins(self) -> Mapping[tuple[ManoeuvreKind, PerceivedVehicle], GapMargin]:
        """The margin to the leader at the decision to pull out."""
        return MappingProxyType(
            {(ManoeuvreKind.PULL_OUT, PerceivedVehicle.LEADER): margin_to_leader}
        )

    def predicate(self) -> str:
        """The formula, its numbers, and the exceptions."""
        return (
            "At every frame: gap to the leader in the ego's lane >= v t + v^2 / (2 b) - v_lead^2 / "
            f"(2 b), {REACTION_AND_DECEL}; not in the {GAP_REGAIN_TIME} after the leader cut in or "
            "the recording began."
        )

    def check(self, case: Case) -> Finding:
        """The smallest margin over all judged frames decides."""
        conditions = {PerceivedVehicle.LEADER: margin_to_leader}
        # `scans` has the minimum of `margin_to_leader`, without frames just after a cut-in.
        return finding_of_minimum(
            scans(case).following,
            span_after_gap_recovery(case),
            belief=belief_at(case, pull_out_percept(case), conditions),
        )

    ERROR_FORMULA: ClassVar[str] = (
        f"{GAP_ERROR_FORMULA}, in the frame of the smallest margin; where that is the last one in "
        "the lane, the square of sp (v - u) / (speed across the road) is added to the variance"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap in the frame with the smallest margin [m]."""

        # `deciding_frame` seeks the margin of the finding. Frames just after a cut-in stay in: only
        # by chance do they have this margin.
        def margin(simulation: IndexArray, frame: IndexArray) -> F32:
            leader = encounters_at(case, _LEADER, simulation, frame)
            decel = decel_for_safe_distance(case.signals.friction[simulation, frame])
            speed = case.signals.speed[simulation, frame]
            margin = margin_to_leader(leader.gap, speed, leader.closing_speed, decel)
            return np.where(leader.valid, margin, UNCONSTRAINED)

        frame = deciding_frame(span_after_gap_recovery(case), margin, finding)
        error = gap_error(case, _LEADER, frame, margin_to_leader, errors)
        leaving_error = _lane_leaving_error(case, frame, errors)
        return np.sqrt(error * error + leaving_error * leaving_error)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap in the worst frame, or a lower speed at the same gaps."""
        frames = _judged_frames(breach)
        margins = margins_to_neighbour(breach, _LEADER, frames, margin_to_leader)
        worst, too_near_frames = int(margins.argmin()), frames[margins < 0]
        larger_gap = more_gap(breach, _LEADER, frames[worst], margin=margins[worst])
        gap, closing_speed = gap_and_closing_speed(breach, _LEADER, too_near_frames)
        leader_speed = breach.case.signals.speed[0, too_near_frames] - closing_speed
        decel = decel_for_safe_distance(breach.case.signals.friction[0, too_near_frames])
        # A negative gap is an overlap of the bodies, which is unlawful at any speed.
        max_speed = np.where(gap < 0, NO_SPEED, max_following_speed(gap, leader_speed, decel))
        return *larger_gap, *breach.remedy_slower_ego(too_near_frames, max_speed)

    def margins_by_frame(self, case: Case) -> F64:
        """Margins of the frames with a leader that did not cut in recently."""
        signals = case.signals
        return _margins_behind_leader(
            case,
            margin_to_leader(
                signals.gap[:, _LEADER],
                signals.speed,
                signals.closing_speed[:, _LEADER],
                decel_for_safe_distance(signals.friction),
            ),
        )


def _lane_leaving_error(case: Case, frame: I32, errors: MeasurementErrors) -> F32:
    """Error of the smallest gap due to the error of the frame in which the ego leaves the lane.

    A gap that closes until the ego has left the lane is smallest in the last frame in the lane. An
    error of the lateral position shifts that frame by the position error over the lateral speed.

    Returns:
        Shape (simulation,) [m]; 0 where the ego is still in the lane after `frame`.
    """
    signals, next_frame = case.signals, np.minimum(frame + 1, case.events.last)
    leaves_lane = at_frame(signals.lane, next_frame) != at_frame(signals.lane, frame)
    closing_speed = neighbour_at(case, _LEADER, frame).closing_speed
    lateral_speed = np.maximum(np.abs(at_frame(signals.lateral_speed, frame)), MIN_RATE_OF_CHANGE)
    error = closing_speed * np.float32(errors.position_std) / lateral_speed
    return np.where(leaves_lane, error, np.float32(0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeDistance(Criterion):
    """The gap to the leader is at least the distance that the ego drives in `min_time`.

    Attributes:
        min_time: Smallest lawful time gap, a multiple of 0.1 s for `_distance_in_whole_mm`.
    """

    min_time: Quantity
    unit: str = "m"
    applies_without_attempt: bool = True

    def predicate(self) -> str:
        """The time gap, its origin, and the exceptions."""
        return (
            f"At every frame: gap to the leader in the ego's lane >= {self.min_time} v, which is "
            f"what courts ask for; not in the {GAP_REGAIN_TIME} after the leader cut in or the "
            "recording began."
        )

    def check(self, case: Case) -> Finding:
        """The smallest margin over all judged frames decides."""
        is_judged = _has_settled_leader(case)
        return _finding_of_gap(case, self._min_gap(case.signals.speed), is_judged)

    ERROR_FORMULA: ClassVar[str] = "sqrt(2 sp^2 + min_time^2 sv^2)"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap minus the distance driven in `min_time` [m]."""
        del case
        return _gap_and_time_error(finding, float(self.min_time.f32), errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap in the frame with the smallest margin."""
        frames = _judged_frames(breach)
        return _larger_gap(breach, frames, self._min_gap(breach.case.signals.speed[0, frames]))

    def margins_by_frame(self, case: Case) -> F64:
        """Margins of the frames with a leader that did not cut in recently."""
        signals = case.signals
        return _margins_behind_leader(case, signals.gap[:, _LEADER] - self._min_gap(signals.speed))

    def _min_gap(self, speed: F32) -> F32:
        """Smallest lawful gap at each speed [m]."""
        return _distance_in_whole_mm(speed, self.min_time)


@dataclass(frozen=True, slots=True, kw_only=True)
class FinedTimeDistance(Criterion):
    """Above `min_speed`, the gap to the leader is too small for a short time at most.

    The margin is the remaining time: the shorter of `max_duration` and the time in which the ego
    drives `max_distance`, minus the time for which the gap has been too small without a break. It
    is a duration, so there are no margins by frame.

    The German catalogue of fines (BKatV, numbers 12.5 to 12.7) states gaps in tenths of "half the
    speedometer", the number of metres that is half the speed in km/h. Five tenths are the distance
    driven in 0.9 s.

    Attributes:
        min_time: Time gap below which a gap is too small, a multiple of 0.1 s for
            `_distance_in_whole_mm`.
        min_speed: Speed above which the duty holds.
        max_duration: Longest lawful time with a gap that is too small.
        max_distance: Longest lawful distance driven with such a gap.
        distance_rule: Code of the rule of the same law that states the exceptions.
    """

    min_time: Quantity
    min_speed: Quantity
    max_duration: Quantity
    max_distance: Quantity
    distance_rule: str
    unit: str = "s"
    applies_without_attempt: bool = True

    def predicate(self) -> str:
        """The gap, the tolerated time and distance, and the margin."""
        return (
            f"At every frame above {self.min_speed}: the gap has not been under five tenths of "
            f"half the speedometer, {self.min_time} v, for more than {self.max_duration} on end, "
            f"or than {self.max_distance} / v if that is less. Exceptions as {self.distance_rule}. "
            "The margin is the time that was left."
        )

    def check(self, case: Case) -> Finding:
        """The smallest remaining time decides."""
        span = span_after_gap_recovery(case)
        margin = self._margins(case)
        minimum = minimum_over(margin, span)
        return finding_from_margins(
            span.is_nonempty & (margin < UNCONSTRAINED).any(axis=1),
            minimum.min_margin,
            minimum.first_frame,
            minimum.last_frame,
            longest=minimum.longest_run,
        )

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(2 p^2 + q^2), p half the difference of the margins with a gap larger and smaller by "
        "sp in all frames, q the same with a speed of the ego higher and lower by sv"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the remaining time, by the errors of both positions and of the speed [s]."""
        del finding
        span = span_after_gap_recovery(case)

        def margin_with(
            ego_position_error: F32, leader_position_error: F32, speed_error: F32
        ) -> F32:
            margin = self._margins(case, leader_position_error - ego_position_error, speed_error)
            # With an error, the speed may be below `min_speed` in all frames: the margin is then
            # `UNCONSTRAINED`, and all of the tolerated time remains.
            return reduce_span(np.minimum, np.minimum(margin, self.max_duration.f32), span)

        std = errors.position_std, errors.position_std, errors.speed_std
        return np.where(span.is_nonempty, propagated_error(margin_with, *std), np.float32(0.0))

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A large enough gap, in the frame with the largest missing gap."""
        frames, signals = _judged_frames(breach), breach.case.signals
        # The frame is chosen by the gap, because the margin is a time. Between two parts of a
        # breach the ego may be too slow for the duty, so these frames must be dropped here.
        frames = frames[signals.speed[0, frames] > self.min_speed.f32]
        gap, speed = signals.gap[0, _LEADER, frames], signals.speed[0, frames]
        missing_gap = self._min_gap(speed) - gap
        worst = int(missing_gap.argmax())
        return more_gap(breach, _LEADER, frames[worst], margin=-missing_gap[worst])

    def _margins(
        self,
        case: Case,
        error_of_gap: F32 | np.float32 = _NO_ERROR,
        error_of_speed: F32 | np.float32 = _NO_ERROR,
    ) -> F32:
        """Remaining time in each frame, `UNCONSTRAINED` where the duty does not hold.

        Args:
            case: The batch.
            error_of_gap: Error of the gap to the leader in all frames [m].
            error_of_speed: Error of the ego's speed in all frames [m/s].

        Returns:
            Shape (simulation, time) [s].
        """
        speed, span = case.signals.speed + error_of_speed, span_after_gap_recovery(case)
        is_judged = _has_settled_leader(case) & (speed > self.min_speed.f32)
        # The time with a small gap is counted from the begin of the span at the earliest.
        is_judged &= span.mask(np.arange(len(speed)), speed.shape[1])
        gap = case.signals.gap[:, _LEADER] + error_of_gap
        is_too_near = is_judged & (gap < self._min_gap(speed))
        frame_duration = np.float32(case.signals.frame_interval_ms / 1000.0)
        duration = _run_lengths(is_too_near).astype(np.float32) * frame_duration
        # The bound of 1 m/s only avoids a division by 0 in frames below `min_speed`, which are not
        # judged.
        time_for_distance = self.max_distance.f32 / np.maximum(speed, np.float32(1.0))
        margin = np.minimum(self.max_duration.f32, time_for_distance) - duration
        return np.where(is_judged, margin, UNCONSTRAINED)

    def _min_gap(self, speed: F32) -> F32:
        """Gap below which the driver is fined, at each speed [m]."""
        return _distance_in_whole_mm(speed, self.min_time)


def _run_lengths(mask: Mask) -> NDArray[np.int64]:
    """Number of frames for which a mask has held so far, shape (simulation, time)."""
    frame = np.arange(1, mask.shape[1] + 1)
    last_off = np.maximum.accumulate(np.where(mask, 0, frame), axis=1)
    return np.where(mask, frame - last_off, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedDistance(Criterion):
    """On motorways, above `min_speed`, a truck keeps a fixed gap to its leader.

    Attributes:
        min_gap: Smallest lawful gap.
        min_speed: Speed above which the duty holds.
        distance_rule: Code of the rule of the same law that states the exceptions.
    """

    min_gap: Quantity
    min_speed: Quantity
    distance_rule: str
    unit: str = "m"
    applies_without_attempt: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kinds of the ego and of the road."""
        return frozenset(["kinds", "road_kind"])

    def predicate(self) -> str:
        """The gap, the speed, and the exceptions."""
        return (
            f"At every frame on a motorway, the ego being a truck above {self.min_speed}: gap to "
            f"the leader >= {self.min_gap}. Exceptions as {self.distance_rule}."
        )

    def check(self, case: Case) -> Finding:
        """The smallest gap over all judged frames decides."""
        is_truck, road = ego_may_be(case, VehicleKind.TRUCK), case.trajectories.road
        # An ego of unknown kind counts as a truck, an unknown road as a motorway: the rule then
        # applies, and is undecidable, because both are required inputs.
        is_motorway = road.kind == "motorway" or "road_kind" in case.trajectories.unknown
        if not (is_motorway and is_truck.any()):
            return finding_not_applicable(case.signals.num_simulations)
        is_judged = _has_settled_leader(case) & (case.signals.speed > self.min_speed.f32)
        return _finding_of_gap(case, self.min_gap.f32, is_judged & is_truck[:, None])

    ERROR_FORMULA: ClassVar[str] = "sqrt(2) sp"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of a gap [m]."""
        del case
        return _gap_and_time_error(finding, 0.0, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap in the frame with the smallest margin."""
        return _larger_gap(breach, _judged_frames(breach), self.min_gap.f32)


@dataclass(frozen=True, slots=True, kw_only=True)
class GapForAnotherVehicle(Criterion):
    """A truck that does not overtake leaves a gap into which an overtaking vehicle can move.

    Attributes:
        vehicle_length: Length of the vehicle that moves in.
        min_time: Time gap ahead of and behind the vehicle that moves in, at the ego's speed; a
            multiple of 0.1 s for `_distance_in_whole_mm`.
        distance_rule: Code of the rule of the same law that requires this time gap and states the
            exceptions.
    """

    vehicle_length: Quantity
    min_time: Quantity
    distance_rule: str
    unit: str = "m"
    applies_without_attempt: bool = True
    only_two_way_roads: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kinds of the ego and of the road."""
        return frozenset(["kinds", "road_kind"])

    def predicate(self) -> str:
        """The roads, the gap, and the exceptions."""
        return (
            "At every frame on a two-way road with one lane each way outside built-up areas, the "
            "ego being a truck that does not begin to overtake, not in a stretch of sign 276: gap "
            f"to the leader >= {self.vehicle_length} + 2 x {self.min_time} v, a car with the "
            f"distances of {self.distance_rule}. Exceptions as {self.distance_rule}."
        )

    def check(self, case: Case) -> Finding:
        """The smallest margin over all judged frames decides."""
        if not _is_narrow_road_outside_towns(case):
            return finding_not_applicable(case.signals.num_simulations)
        # A driver who is about to overtake may close up.
        has_duty = ego_may_be(case, VehicleKind.TRUCK) & ~case.events.has_attempt
        # The duty does not hold where sign 276 forbids overtaking, from the sign on: the approach
        # is 0 m. The ego's distance from such a stretch is negative within it.
        bans = zone_intervals(case, [ZoneKind.NO_OVERTAKING], approach_length=lambda _: 0.0)
        is_judged = _has_settled_leader(case) & has_duty[:, None]
        is_judged &= distance_to_intervals(case, bans) >= 0.0
        return _finding_of_gap(case, self._min_gap(case.signals.speed), is_judged)

    ERROR_FORMULA: ClassVar[str] = "sqrt(2 sp^2 + (2 min_time)^2 sv^2)"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap minus twice the distance driven in `min_time` [m]."""
        del case
        return _gap_and_time_error(finding, 2.0 * float(self.min_time.f32), errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap in the frame with the smallest margin."""
        frames = _judged_frames(breach)
        return _larger_gap(breach, frames, self._min_gap(breach.case.signals.speed[0, frames]))

    def _min_gap(self, speed: F32) -> F32:
        """Smallest lawful gap at each speed [m]."""
        return self.vehicle_length.f32 + _distance_in_whole_mm(
            np.float32(2.0) * speed, self.min_time
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowVehicleDistance(Criterion):
    """A slow truck that does not overtake keeps a gap into which overtaking drivers can return.

    Attributes:
        max_speed: Largest speed at which the duty holds.
        min_gap: Smallest lawful gap.
    """

    max_speed: Quantity
    min_gap: Quantity
    unit: str = "m"
    applies_without_attempt: bool = True
    only_two_way_roads: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kinds of the ego and of the road."""
        return frozenset(["kinds", "road_kind"])

    def predicate(self) -> str:
        """The speed, the roads and the gap."""
        return (
            f"At every frame at {self.max_speed} or less, the ego being a truck that does not "
            "begin to overtake, on a two-way road with one lane each way outside localities: gap "
            f"to the leader in its lane >= {self.min_gap}."
        )

    def check(self, case: Case) -> Finding:
        """The smallest gap over all judged frames decides."""
        signals = case.signals
        if not _is_narrow_road_outside_towns(case):
            return finding_not_applicable(signals.num_simulations)
        # A driver who is about to overtake may close up.
        has_duty = ego_may_be(case, VehicleKind.TRUCK) & ~case.events.has_attempt
        # This duty has no exception after a cut-in. Without an attempt, the span has all driven
        # frames.
        span = judged_span(case)
        # Without a duty the last frame is before the first: the span is empty.
        span = FrameSpan(first=span.first, last=np.where(has_duty, span.last, span.first - 1))
        simulation, frame = span.instants()
        is_judged = signals.speed[simulation, frame] <= self.max_speed.f32
        is_judged &= signals.neighbour_slot[simulation, _LEADER, frame] != NO_VEHICLE
        simulation, frame = simulation[is_judged], frame[is_judged]
        gap = encounters_at(case, _LEADER, simulation, frame).gap
        return finding_at_instants(
            gap - self.min_gap.f32, simulation, frame, signals.num_simulations
        )

    ERROR_FORMULA: ClassVar[str] = "sqrt(2) sp"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of a gap [m]."""
        del case
        return _gap_and_time_error(finding, 0.0, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap in the frame with the margin of the finding.

        The smallest gap may lie in a frame in which the ego is too fast for the duty.
        """
        return _larger_gap(breach, breach.frames_with_neighbour(_LEADER), self.min_gap.f32)


def _is_narrow_road_outside_towns(case: Case) -> bool:
    """Whether the road has one lane each way and may lie outside built-up areas."""
    trajectories = case.trajectories
    road = trajectories.road  # `num_lanes` counts the lanes in the ego's direction.
    is_in_town = road.kind == "town" and "road_kind" not in trajectories.unknown
    return road.is_two_way and road.num_lanes == 1 and not is_in_town


def _has_settled_leader(case: Case) -> Mask:
    """Whether the ego has a leader that did not cut in recently, shape (simulation, time)."""
    has_leader = case.signals.neighbour_slot[:, _LEADER] != NO_VEHICLE
    return has_leader & ~is_regaining_gap(case)


def _finding_of_gap(case: Case, min_gap: F32 | np.float32, is_judged: Mask) -> Finding:
    """Finding of the gap to the leader against a smallest lawful gap.

    Args:
        case: The batch.
        min_gap: Smallest lawful gap, a number or of shape (simulation, time) [m].
        is_judged: Whether the duty holds and the ego has a leader, shape (simulation, time).
    """
    margin = case.signals.gap[:, _LEADER] - min_gap
    return finding_over_span(
        np.where(is_judged, margin, UNCONSTRAINED), span_after_gap_recovery(case)
    )


def _gap_and_time_error(finding: Finding, time: float, errors: MeasurementErrors) -> F32:
    """Error of a gap between two vehicles minus the distance that the ego drives in `time` [m].

    Args:
        finding: Result of `check`, for the shape of the error.
        time: Factor of the ego's speed in the lawful gap, 0 for a fixed gap [s].
        errors: Standard deviations of positions and speeds.
    """
    error_of_gap, error_of_distance = np.sqrt(2.0) * errors.position_std, time * errors.speed_std
    return np.full_like(finding.margin, np.hypot(error_of_gap, error_of_distance))


def _judged_frames(breach: BreachContext) -> IndexArray:
    """Frames of the breach with a leader that did not cut in recently, shape (frame,)."""
    frames = breach.frames_with_neighbour(_LEADER)
    return frames[~is_regaining_gap(breach.case)[0, frames]]


def _larger_gap(
    breach: BreachContext, frames: IndexArray, min_gap: F32 | np.float32
) -> tuple[Remedy, ...]:
    """One remedy: a larger gap to the leader, in the frame that has the margin of the finding.

    The margin identifies the frame, so `frames` may contain frames in which the duty does not hold,
    such as frames at a low speed.

    Args:
        breach: The breach.
        frames: Frames with a leader.
        min_gap: Smallest lawful gap, a number or of shape (frame,) [m].
    """
    margins = breach.case.signals.gap[0, _LEADER, frames] - min_gap
    frame = frames[int(np.abs(margins - breach.margin).argmin())]
    return more_gap(breach, _LEADER, frame, margin=breach.margin)


def _margins_behind_leader(case: Case, margin: F32) -> F64:
    """Margins (1, time) of one simulation, NaN in frames that are not judged, shape (time,)."""
    margins = margins_within_span(span_after_gap_recovery(case), margin)
    return np.where(_has_settled_leader(case)[0], margins, np.nan)


def _distance_in_whole_mm(speed: F32, time: Quantity) -> F32:
    """Distance driven in `time`, a multiple of 0.1 s, rounded down to whole millimetres [m].

    A speed in whole mm/s times 1.5 s may end in half a millimetre, but the logic programs of the
    laws compute in whole millimetres. Without the rounding, criterion and program differ in 1 of
    1,344 simulations.
    """
    tenths = round(10.0 * float(time.f32))
    speed_mmps = np.rint(speed.astype(np.float64) * 1000.0).astype(np.int64)
    return (speed_mmps * tenths // 10 / 1000.0).astype(np.float32)
