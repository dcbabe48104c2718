"""Criteria about the return to the original lane, and about keeping right.

A `Case` is a batch of simulations with one ego each; a `BreachContext` has the one simulation of
its breach, at index 0. An event is a frame of each simulation, `NEVER` (-1) without it; a span is
the first and the last frame of a stretch of time. `scans(case)` has results of the compiled engine.
A belief is the margin that follows from what the driver perceived at a decision; `belief_at`
compares it with the true margin. In `ERROR_FORMULA`, sp and sv are the standard deviations of a
position and of a speed, t and b the reaction time and the deceleration of the safe distance, v and
u the speeds of the vehicles behind and ahead, dv is the closing speed. The docstring of the package
`criteria` explains these terms in full, `rule.Criterion` describes the methods.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray, Mask
from overtaking.core.float32_math import TWO, minimum
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.beliefs import belief_at, return_percept
from overtaking.labels.law.case import (
    last_driven_frame,
    manoeuvre,
    neighbour_at,
    scans,
    seconds_of,
    span_after_passing,
)
from overtaking.labels.law.margins import (
    MIN_RATE_OF_CHANGE,
    UNCONSTRAINED,
    finding_at_frame,
    finding_from_margins,
    finding_of_minimum,
    num_frames_in,
)
from overtaking.labels.law.measurement_errors import (
    BRAKING_ERROR_FORMULA,
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    StateError,
    deciding_frame,
    encounter_with_error,
    error_from_vehicles,
    zero_if_infinite,
)
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    MAX_FORCED_BRAKING,
    OBSTRUCTION_TIME,
    RETURN_FREE_TIME,
    RETURN_RANGE,
    RETURN_TIME_GAP,
    quantity,
)
from overtaking.labels.law.remedies import (
    BreachContext,
    Remedy,
    RemedyQuantity,
    RequiredChange,
    change_by_margin,
    gap_and_closing_speed,
    margins_to_neighbour,
    more_gap,
    single_change,
)
from overtaking.labels.law.rule import Criterion
from overtaking.labels.law.safe_distance import (
    REACTION_AND_DECEL,
    GapMargin,
    decel_for_safe_distance,
    entry_margin_behind,
    gap_between,
    gap_in_right_lane,
    lawful_gap,
    margin_to_leader,
)
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import at_frame, vehicle_snapshot
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, PerceivedVehicle
from overtaking.model.verdicts import Case, Finding
from overtaking.world.surrogate_safety import drac


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeReturn(Criterion):
    """At the end of the return, the gaps behind and ahead of the ego are lawful.

    Attributes:
        safe_distance_rule: Code of the rule of the same law that states the formula of the safe
            distance. None: `predicate` states the formula.
    """

    safe_distance_rule: str | None = None
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather, on which the deceleration depends."""
        return frozenset(["weather"])

    @property
    def believed_margins(self) -> Mapping[tuple[ManoeuvreKind, PerceivedVehicle], GapMargin]:
        """The margins to both vehicles in the lane that is entered, at the decision to return."""
        return MappingProxyType(
            {
                (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_FOLLOWER): entry_margin_behind,
                (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_LEADER): margin_to_leader,
            }
        )

    def predicate(self) -> str:
        """The gap behind, the braking, and the gap ahead."""
        if self.safe_distance_rule is None:
            gap_behind = (
                "v t + v^2 / (2 b) - u^2 / (2 b), v behind and u ahead, " + REACTION_AND_DECEL
            )
            condition_ahead = "by the same formula"
        else:
            gap_behind = f"its safe distance (as {self.safe_distance_rule})"
            condition_ahead = ">= the ego's safe distance"
        return (
            "At return_end: gap to the vehicle behind, the target or a vehicle in between, >= "
            f"{gap_behind}; the braking forced on it <= {ABRUPT_BRAKING}; gap to the vehicle "
            f"ahead {condition_ahead}."
        )

    def check(self, case: Case) -> Finding:
        """The smaller of the two margins decides."""
        frame = case.events.return_end
        follower, leader = _follower_and_leader(case, frame)
        conditions = {
            PerceivedVehicle.NEW_FOLLOWER: entry_margin_behind,
            PerceivedVehicle.NEW_LEADER: margin_to_leader,
        }
        return finding_at_frame(
            frame,
            _return_margin(case, follower, leader),
            follower.valid | leader.valid,
            belief=belief_at(case, return_percept(case), conditions),
        )

    ERROR_FORMULA: ClassVar[str] = (
        f"behind: {GAP_ERROR_FORMULA}, or {BRAKING_ERROR_FORMULA}; ahead: {GAP_ERROR_FORMULA}; of "
        "the three, the one that decides"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the smaller margin [m]; 0 where no vehicle is near."""
        del finding
        follower, leader = _follower_and_leader(case, case.events.return_end)

        def margin(ego_speed_error: F32, follower: Encounter, leader: Encounter) -> F32:
            return _return_margin(case, follower, leader, ego_speed_error)

        error = _error_between_neighbours(margin, follower, leader, errors, is_first_ahead=False)
        # Only a guard: without a vehicle the margin is a constant, so its error is 0 anyway.
        return zero_if_infinite(error)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap to the vehicle behind or ahead, to both if both were too near."""
        frame, changes = breach.first_frame, list[RequiredChange]()
        for neighbour, margin_of_gap in (
            (NeighbourRole.FOLLOWER, entry_margin_behind),
            (NeighbourRole.LEADER, margin_to_leader),
        ):
            has_neighbour = breach.case.signals.neighbour_slot[0, neighbour, frame] != NO_VEHICLE
            margin = margins_to_neighbour(breach, neighbour, np.array([frame]), margin_of_gap)[0]
            if has_neighbour and margin < 0:
                (remedy,) = more_gap(breach, neighbour, frame, margin=margin)
                changes += remedy
        return (tuple(changes),)


def _follower_and_leader(case: Case, frame: I32) -> tuple[Encounter, Encounter]:
    """The vehicles behind and ahead of the ego in its lane at one frame of each simulation."""
    follower = neighbour_at(case, NeighbourRole.FOLLOWER, frame)
    return follower, neighbour_at(case, NeighbourRole.LEADER, frame)


def _return_margin(
    case: Case,
    follower: Encounter,
    leader: Encounter,
    ego_speed_error: F32 | np.float32 = np.float32(0.0),  # noqa: B008 - A number cannot change.
) -> F32:
    """Smaller margin of the gaps behind and ahead at the end of the return, (simulation,) [m]."""
    signals, frame = case.signals, case.events.return_end
    speed = at_frame(signals.speed, frame) + ego_speed_error
    decel = decel_for_safe_distance(at_frame(signals.friction, frame))
    # `entry_margin_behind` has both limits behind as gaps: the safe distance, and the gap in which
    # the follower can slow down without abrupt braking.
    margin_behind = entry_margin_behind(follower.gap, speed, follower.closing_speed, decel)
    margin_ahead = margin_to_leader(leader.gap, speed, leader.closing_speed, decel)
    return minimum(
        np.where(follower.valid, margin_behind, UNCONSTRAINED),
        np.where(leader.valid, margin_ahead, UNCONSTRAINED),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnDelay(Criterion):
    """After the pass, the ego does not stay out of its lane for long while it could return.

    The ego could return in a frame if three conditions hold: the target is far enough behind, the
    gaps ahead and behind in the lane to the right are large enough, and the ego would not reach a
    vehicle in that lane within `RETURN_FREE_TIME`. The longest unbroken run of such frames counts.
    Frames in the lane of oncoming traffic do not count.

    Attributes:
        max_delay: Longest lawful time in which the ego could return and does not.
        opposing_lane_rule: Code of the rule of the same law that judges the return from the lane of
            oncoming traffic, for the sentence of `predicate`.
    """

    max_delay: Quantity = quantity(
        8.0,
        "s",
        why="A choice; enough for looking, signalling and a lane change of average duration",
    )
    opposing_lane_rule: str
    unit: str = "s"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather, on which the deceleration depends."""
        return frozenset(["weather"])

    def predicate(self) -> str:
        """The conditions of a possible return, its longest delay, and a stricter rule."""
        return (
            "From overlap_end on: the ego never stays out of its original lane for more than "
            f"{self.max_delay} on end in which the target is max({RETURN_TIME_GAP} v_target, safe "
            "distance) or more behind it and the lane to the right is free: room ahead and behind, "
            f"and no vehicle reached within {RETURN_FREE_TIME}. {self.opposing_lane_rule} is the "
            "rule for the lane of oncoming traffic."
        )

    def check(self, case: Case) -> Finding:
        """The longest opportunity to return decides.

        The breach lasts from the frame in which the return is overdue to the last frame in which a
        return is still possible.
        """
        # The span begins as the target is passed. The scan has the first frame and the number of
        # frames of the longest run in it in which the ego could have returned.
        span, (first, num_frames) = span_after_passing(case), scans(case).return_opportunity
        applies = (case.events.overlap_end != NEVER) & span.is_nonempty
        overdue = first + num_frames_in(case, self.max_delay.f32)
        margin = self.max_delay.f32 - seconds_of(case, num_frames)
        return finding_from_margins(applies, margin, overdue, first + num_frames - 1)

    ERROR_FORMULA: ClassVar[str] = (
        "(error of the gap to the target as it becomes large enough) / (v - v_target) and (error of"
        " the room to the right as it ends) / (its loss per second), added in squares"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the time for which the ego could have returned [s].

        The opportunity begins when the gap to the target is large enough, and ends when the right
        lane is taken. A position error dx shifts the begin by dx / (opening speed) and the end by
        dx / (rate at which the gap in the right lane shrinks). The two errors are taken as
        independent and add in quadrature.
        """
        del finding
        has_opportunity = scans(case).return_opportunity[0] != NEVER
        begin_error, end_error = _begin_error(case, errors), _end_error(case, errors)
        total = np.sqrt(begin_error * begin_error + end_error * end_error)
        return np.where(has_opportunity, total, np.float32(0.0))

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A return within the lawful time."""
        return change_by_margin(breach, RemedyQuantity.TIME_OUT, limit=self.max_delay.f32)


def _begin_error(case: Case, errors: MeasurementErrors) -> F32:
    """Error of the time at which the target is far enough behind, shape (simulation,) [s]."""
    # Where `first` is `NEVER`, the values belong to frame 0, and `standard_error` drops them.
    first, _ = scans(case).return_opportunity
    target = vehicle_snapshot(case.trajectories, case.target.slot, np.arange(len(first)), first)
    ego_speed = at_frame(case.signals.speed, first)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, first))

    def margin_with(ego_error: StateError, target_error: StateError) -> F32:
        target_speed = target.speed + target_error.speed
        safe_gap = lawful_gap(target_speed, target_speed - ego_speed - ego_error.speed, decel)
        needed_gap = np.maximum(RETURN_TIME_GAP.f32 * target_speed, safe_gap)
        return target.gap + ego_error.position - target_error.position - needed_gap

    # A lower bound on the opening speed keeps the error finite where the gap hardly opens.
    opening_speed = np.maximum(ego_speed - target.speed, MIN_RATE_OF_CHANGE)
    error = error_from_vehicles(margin_with, num_vehicles=2, errors=errors) / opening_speed
    return np.where(target.valid, error, np.float32(0.0))


def _end_error(case: Case, errors: MeasurementErrors) -> F32:
    """Error of the time at which the right lane is taken, shape (simulation,) [s].

    It is 0 if the manoeuvre ends first.
    """
    first, num_frames = scans(case).return_opportunity
    end_frame = first + num_frames  # The first frame after the opportunity.
    ends_within_span = (first != NEVER) & (end_frame <= span_after_passing(case).last)
    # `end_frame` and the frame before it must exist. Where they did not, the result is dropped.
    end_frame = np.maximum(np.minimum(end_frame, case.events.last), 1)
    # `gap_in_right_lane` is the gap beyond the distances that a return needs [m].
    gap_change = gap_in_right_lane(case, end_frame) - gap_in_right_lane(case, end_frame - 1)
    frame_duration = seconds_of(case, np.ones_like(end_frame))
    # Where the opportunity ends for another reason, such as a nearer target, the gap may also grow.
    rate_of_change = np.maximum(np.abs(gap_change) / frame_duration, MIN_RATE_OF_CHANGE)
    error = _gap_in_right_lane_error(case, end_frame, errors) / rate_of_change
    return np.where(ends_within_span, error, np.float32(0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class RightLaneUse(Criterion):
    """At the first frame, the ego is in the right-most lane or the next lane to the right is taken.

    Attributes:
        return_rule: Code of the rule of the same law that states when the lane to the right is
            free. None: `predicate` states it.
    """

    return_rule: str | None = None
    unit: str = "m"
    applies_without_attempt: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather, on which the deceleration depends."""
        return frozenset(["weather"])

    def predicate(self) -> str:
        """The conditions of a lane to the right that is taken, and the margin."""
        if self.return_rule is None:
            lane = (
                "without the safe distances ahead and behind, or with a vehicle that is reached "
                f"within {RETURN_FREE_TIME}"
            )
        else:
            lane = f"without the room that {self.return_rule} requires"
        return (
            "At the first frame, if the ego is not in the slowest lane: the lane to the right is "
            f"occupied, that is, {lane}. The margin is the distance by which the room falls short, "
            f"at most {RETURN_RANGE}."
        )

    def check(self, case: Case) -> Finding:
        """The missing space in the lane to the right is the margin.

        Not to use a free lane is the breach, so free space makes the margin negative.
        """
        frame = case.events.first
        lane = at_frame(case.signals.lane, frame)
        # Lane 0 has no lane to its right, and beyond the last driving lane the ego is in the lane
        # of oncoming traffic or off the road.
        has_right_lane = (lane > 0) & (lane < case.trajectories.road.num_lanes)
        # In a recording that begins with an accident, the first frame is not driven.
        applies = has_right_lane & (last_driven_frame(case) >= frame)
        # `gap_in_right_lane` is the gap beyond the distances that a return needs; it is looked up
        # only where the rule applies.
        margin = -gap_in_right_lane(case, np.where(applies, frame, NEVER))
        return finding_at_frame(frame, margin, applies)

    ERROR_FORMULA: ClassVar[str] = (
        f"ahead and behind: {GAP_ERROR_FORMULA}, or sqrt(2 sp^2 + 2 ({RETURN_FREE_TIME})^2 sv^2) "
        f"where {RETURN_FREE_TIME} ahead decide"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap in the lane to the right at the first frame [m].

        The needed gap ahead is the safe distance, or the distance by which the gap shrinks in
        `RETURN_FREE_TIME` where this is larger; `ERROR_FORMULA` has both.
        """
        del finding
        return _gap_in_right_lane_error(case, case.events.first, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """One lane to the right."""
        lane = int(breach.case.signals.lane[0, breach.first_frame])
        return single_change(
            RemedyQuantity.LANE, actual=lane, needed=lane - 1, frame=breach.first_frame
        )


def _gap_in_right_lane_error(case: Case, frame: I32, errors: MeasurementErrors) -> F32:
    """Error of `gap_in_right_lane`, shape (simulation,) [m]."""
    leader = neighbour_at(case, NeighbourRole.RIGHT_LEADER, frame)
    follower = neighbour_at(case, NeighbourRole.RIGHT_FOLLOWER, frame)
    speed = at_frame(case.signals.speed, frame)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))

    def margin(ego_speed_error: F32, leader: Encounter, follower: Encounter) -> F32:
        return gap_between(speed + ego_speed_error, decel, leader, follower)

    return _error_between_neighbours(margin, leader, follower, errors, is_first_ahead=True)


def _error_between_neighbours(
    margin: Callable[[F32, Encounter, Encounter], F32],
    first: Encounter,
    second: Encounter,
    errors: MeasurementErrors,
    *,
    is_first_ahead: bool,
) -> F32:
    """Error of a margin that depends on a vehicle ahead of the ego and one behind it.

    Args:
        margin: The margin from an error of the ego's speed [m/s] and the two vehicles.
        first: One of the two vehicles; its square is added before the square of `second`. The order
            affects at most the last bits of the result.
        second: The other vehicle.
        errors: Standard deviations of positions and speeds.
        is_first_ahead: Whether `first` is ahead of the ego and `second` behind it.
    """

    def margin_with(
        ego_error: StateError, first_error: StateError, second_error: StateError
    ) -> F32:
        return margin(
            ego_error.speed,
            encounter_with_error(first, ego_error, first_error, is_ahead=is_first_ahead),
            encounter_with_error(second, ego_error, second_error, is_ahead=not is_first_ahead),
        )

    return error_from_vehicles(margin_with, num_vehicles=3, errors=errors)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoForcedBraking(Criterion):
    """After each change of lane, the ego forces no hard braking on its follower."""

    unit: str = "m/s^2"

    def predicate(self) -> str:
        """The time after a lane change, and the largest braking in it."""
        return (
            f"In the {OBSTRUCTION_TIME} after each change of lane: closing speed^2 / (2 gap) of "
            f"the vehicle behind the ego <= {ABRUPT_BRAKING}."
        )

    def check(self, case: Case) -> Finding:
        """The hardest braking decides.

        The scan has the minimum of `ABRUPT_BRAKING` minus the forced braking, over the frames that
        follow a change of lane by at most `OBSTRUCTION_TIME`.
        """
        return finding_of_minimum(scans(case).forced_braking, manoeuvre(case))

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(2 sv^2 (dv/gap)^2 + 2 sp^2 (dv^2 / (2 gap^2))^2), in the frame of the smallest margin"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the braking in the frame in which it is hardest [m/s^2]."""
        is_after_lane_change = _is_after_lane_change(case)

        def margin(simulation: IndexArray, frame: IndexArray) -> F32:
            follower = encounters_at(case, NeighbourRole.FOLLOWER, simulation, frame)
            is_judged = follower.valid & is_after_lane_change[simulation, frame]
            return np.where(is_judged, _braking_margin(follower), UNCONSTRAINED)

        frame = deciding_frame(manoeuvre(case), margin, finding)
        follower = neighbour_at(case, NeighbourRole.FOLLOWER, frame)

        def margin_with(ego_error: StateError, follower_error: StateError) -> F32:
            return _braking_margin(
                encounter_with_error(follower, ego_error, follower_error, is_ahead=False)
            )

        return error_from_vehicles(margin_with, num_vehicles=2, errors=errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A gap to the follower at which it need not brake hard."""
        neighbour, limit = NeighbourRole.FOLLOWER, ABRUPT_BRAKING.f32
        frames = breach.frames_with_neighbour(neighbour)
        gap, closing_speed = gap_and_closing_speed(breach, neighbour, frames)
        forced = np.minimum(drac(gap, closing_speed), MAX_FORCED_BRAKING.f32)
        # At this gap the follower loses its closing speed by braking at the limit.
        needed_gap = closing_speed * closing_speed / (TWO * limit)
        # Margins capped by `MAX_FORCED_BRAKING` are equal in several frames: of these, the frame
        # with the largest missing gap is taken.
        has_margin = np.isclose(limit - forced, breach.margin)
        worst = int(np.where(has_margin, needed_gap - gap, -np.inf).argmax())
        return more_gap(breach, neighbour, frames[worst], margin=gap[worst] - needed_gap[worst])


def _is_after_lane_change(case: Case) -> Mask:
    """Whether the ego has changed lane in the manoeuvre within the last `OBSTRUCTION_TIME`.

    Returns:
        Shape (simulation, time). As in the compiled scan, the frame of the change counts, and
        changes before the manoeuvre do not.
    """
    lane, span = case.signals.lane, manoeuvre(case)
    num_simulations, num_frames = lane.shape
    frame = np.arange(num_frames)
    is_change = np.zeros(lane.shape, np.bool_)
    is_change[:, 1:] = lane[:, 1:] != lane[:, :-1]
    is_change &= span.mask(np.arange(num_simulations), num_frames)
    num_frames_after = num_frames_in(case, OBSTRUCTION_TIME.f32)
    # Frames before the first change get a last change that is too early even for frame 0.
    last_change = np.where(is_change, frame, -num_frames_after - 1)
    return frame - np.maximum.accumulate(last_change, axis=1) <= num_frames_after


def _braking_margin(follower: Encounter) -> F32:
    """Allowed braking minus the braking by which the follower avoids a collision [m/s^2]."""
    forced = np.minimum(drac(follower.gap, follower.closing_speed), MAX_FORCED_BRAKING.f32)
    return ABRUPT_BRAKING.f32 - forced
