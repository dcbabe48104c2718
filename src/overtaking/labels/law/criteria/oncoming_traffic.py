"""Criteria about oncoming traffic on two-way roads.

A `Case` is a batch of simulations with one ego each; a `BreachContext` has the one simulation of
its breach, at index 0. An event is a frame of each simulation, `NEVER` (-1) without it; a span is
the first and the last frame of a stretch of time. `opposing_lane_span` is the time of the ego in
the opposing lane. `OtherVehicles` has all vehicles at one frame of each simulation, shape
(simulation, vehicle); `is_approaching` is true for oncoming vehicles that the ego has not yet met.
In `ERROR_FORMULA`, sp and sv are the standard deviations of a position and of a speed, t and b the
reaction time and the deceleration of the safe distance, v and u the speeds of the vehicles behind
and ahead. The docstring of the package `criteria` explains these terms in full, `rule.Criterion`
describes the methods. On roads with lanes of one direction, no rule of this module applies.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from overtaking.core.arrays import F32, I32, Mask
from overtaking.core.float32_math import HALF, as_f32, maximum
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.case import opposing_lane_span, seconds_of
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    finding_at_frame,
    finding_at_instants,
    finding_not_applicable,
)
from overtaking.labels.law.measurement_errors import (
    MeasurementErrors,
    StateError,
    error_from_vehicles,
    return_time_error,
)
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    LINE_TOLERANCE,
    ONCOMING_TIME,
    RETURN_RANGE,
    quantity,
)
from overtaking.labels.law.remedies import BreachContext, Remedy, RemedyQuantity, single_change
from overtaking.labels.law.rule import Criterion
from overtaking.labels.law.safe_distance import decel_for_safe_distance, lawful_gap
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    OtherVehicles,
    VehicleInstants,
    at_frame,
    lane_borders,
    lateral_position_and_gap,
    other_vehicles_at,
    slot_or_ego,
)
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding


@dataclass(frozen=True, slots=True, kw_only=True)
class GapAtReturn(Criterion):
    """When the ego is back in its lane, after a pass or an abort, oncoming traffic is far away.

    Attributes:
        min_time: Smallest lawful time until the ego and an oncoming vehicle meet.
        min_pet: Smallest lawful post-encroachment time: from the return of the ego until an
            oncoming vehicle reaches the place where the ego returned. The gap is measured at the
            return, so the vehicle reaches this place after gap / speed.
    """

    min_time: Quantity = ONCOMING_TIME
    min_pet: Quantity = quantity(
        2.0, "s", why="A choice, above the post-encroachment times of conflicts, 1 to 1.5 s"
    )
    # `only_two_way_roads` stays False: older tables of one-way roads have rows of this rule, and
    # their contents must not change.
    unit: str = "m"

    def predicate(self) -> str:
        """The gap and the post-encroachment time."""
        return (
            "On two-way roads, at return_end or abort_end: gap to each oncoming vehicle >= "
            f"{self.min_time} (v + v_oncoming), and it reaches the place that the ego has left "
            f"after {self.min_pet} or more."
        )

    def check(self, case: Case) -> Finding:
        """The oncoming vehicle with the smallest margin decides."""
        if not case.trajectories.road.is_two_way:
            return finding_not_applicable(case.signals.num_simulations)
        frame, others = _return_frame(case), _others_at_return(case)
        # Where the ego never returns, `frame` is `NEVER`, and the rule does not apply.
        has_crossed_line = case.events.line_crossed != NEVER
        margin = self._margins(case, others).min(axis=1)
        return finding_at_frame(frame, margin, has_crossed_line & others.is_approaching.any(axis=1))

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(2 sp^2 + 2 min_time^2 sv^2), or sqrt(2 sp^2 + min_pet^2 sv^2) where min_pet decides"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the smallest margin of a gap to an oncoming vehicle [m]."""
        del finding
        others = _others_at_return(case)

        def margin_with(ego_error: StateError, oncoming_error: StateError) -> F32:
            measured = _oncoming_with_errors(others, ego_error, oncoming_error)
            return self._margins(case, measured, ego_error.speed).min(axis=1)

        return error_from_vehicles(margin_with, num_vehicles=2, errors=errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap to the oncoming vehicle with the smallest margin."""
        others = _others_at_return(breach.case)
        return _more_gap_to_oncoming(breach, others, self._margins(breach.case, others))

    def _margins(
        self, case: Case, others: OtherVehicles, ego_speed_error: F32 | None = None
    ) -> F32:
        """Margin of the gap to each oncoming vehicle when the ego is back.

        Args:
            case: The batch.
            others: All vehicles at `_return_frame`.
            ego_speed_error: Error of the ego's speed, shape (simulation,) or a number; None for no
                error [m/s].

        Returns:
            Shape (simulation, vehicle) [m]; `UNCONSTRAINED` for vehicles that are not oncoming.
        """
        ego_speed = _speed_at(case, _return_frame(case), ego_speed_error)
        meeting_distance = self.min_time.f32 * (others.speed + ego_speed)
        encroachment_distance = self.min_pet.f32 * others.speed
        needed_gap = maximum(meeting_distance, encroachment_distance)
        return np.where(others.is_approaching, others.gap - needed_gap, UNCONSTRAINED)


def _return_frame(case: Case) -> I32:
    """Frame in which the ego is back in its lane after a pass, else after an abort."""
    events = case.events
    return np.where(events.return_end != NEVER, events.return_end, events.abort_end)


def _others_at_return(case: Case) -> OtherVehicles:
    """All vehicles when the ego is back in its lane."""
    return other_vehicles_at(case.trajectories, _return_frame(case))


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeToPass(Criterion):
    """When the ego pulls out, the gap to oncoming traffic is large enough for the whole overtake.

    Oncoming vehicles are assumed to keep their speed at the line crossing: an oncoming driver who
    brakes for the ego later does not make the overtake lawful.

    Attributes:
        min_time: Smallest lawful time until the ego, once back, and an oncoming vehicle meet.
    """

    min_time: Quantity = ONCOMING_TIME
    unit: str = "m"
    only_two_way_roads: bool = True

    def predicate(self) -> str:
        """The predicted gap, and the smallest lawful gap at the return."""
        return (
            "On two-way roads, as the line between the directions is crossed: gap to each oncoming "
            "vehicle - distance that the ego drives until it is back - v_oncoming (time in the "
            f"opposing lane) >= {self.min_time} (v + v_oncoming), v when it is back, v_oncoming "
            "when the line is crossed."
        )

    def check(self, case: Case) -> Finding:
        """The oncoming vehicle with the smallest margin decides."""
        if not case.trajectories.road.is_two_way:
            return finding_not_applicable(case.signals.num_simulations)
        span, others = opposing_lane_span(case), _others_at_pull_out(case)
        applies = span.is_nonempty & others.is_approaching.any(axis=1)
        return finding_at_frame(span.first, self._margins(case, others).min(axis=1), applies)

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(2 sp^2 + (T + min_time)^2 sv^2 + min_time^2 sv^2 + ((v + v_oncoming) sp / w)^2), T "
        "the time in the opposing lane, w the speed across the road as the ego is back"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the predicted gap [m].

        An error of the ego's lateral position moves the frame in which the ego is back, and the gap
        shrinks by the closing speed until then.
        """
        del finding
        others = _others_at_pull_out(case)

        def margin_with(ego_error: StateError, oncoming_error: StateError) -> F32:
            measured = _oncoming_with_errors(others, ego_error, oncoming_error)
            return self._margins(case, measured, ego_error.speed).min(axis=1)

        margins = self._margins(case, others)
        simulation, slot = np.arange(len(margins)), margins.argmin(axis=1)
        ego_speed = at_frame(case.signals.speed, opposing_lane_span(case).last)
        closing_speed = ego_speed + others.speed[simulation, slot]
        delay_error = closing_speed * return_time_error(case, errors)
        gap_error = error_from_vehicles(margin_with, num_vehicles=2, errors=errors)
        return np.sqrt(gap_error * gap_error + delay_error * delay_error)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap at the pull-out to the oncoming vehicle with the smallest margin."""
        others = _others_at_pull_out(breach.case)
        return _more_gap_to_oncoming(breach, others, self._margins(breach.case, others))

    def _margins(
        self, case: Case, others: OtherVehicles, ego_speed_error: F32 | None = None
    ) -> F32:
        """Margin of the predicted gap to each oncoming vehicle; arguments as in `GapAtReturn`."""
        ego_speed = _speed_at(case, opposing_lane_span(case).last, ego_speed_error)
        needed_gap = self.min_time.f32 * (ego_speed + others.speed)
        margins = _predicted_gaps(case, others) - needed_gap
        return np.where(others.is_approaching, margins, UNCONSTRAINED)


def _others_at_pull_out(case: Case) -> OtherVehicles:
    """All vehicles when the ego crosses the line between the directions."""
    return other_vehicles_at(case.trajectories, opposing_lane_span(case).first)


def _predicted_gaps(case: Case, others: OtherVehicles) -> F32:
    """Gap to each vehicle when the ego is back, if the vehicle approaches at constant speed.

    Args:
        case: The batch.
        others: All vehicles when the ego pulls out.

    Returns:
        Shape (simulation, vehicle) [m].
    """
    span, s = opposing_lane_span(case), case.trajectories.states.s[:, EGO_SLOT]
    distance = as_f32(at_frame(s, span.last) - at_frame(s, span.first)) * METRES_PER_MM
    time = seconds_of(case, np.maximum(span.last - span.first, 0))
    return others.gap - (distance[:, None] + others.speed * time[:, None])


def _speed_at(case: Case, frame: I32, error: F32 | None) -> F32:
    """Speed of the ego at one frame of each simulation plus an error, (simulation, 1) [m/s]."""
    speed = at_frame(case.signals.speed, frame)[:, None]
    return speed if error is None else speed + error


def _oncoming_with_errors(
    others: OtherVehicles, ego_error: StateError, oncoming_error: StateError
) -> OtherVehicles:
    """Oncoming vehicles as they would have been measured with errors.

    Errors of positions are positive in the ego's direction, errors of speeds in the direction of
    each vehicle.
    """
    return replace(
        others,
        gap=others.gap + oncoming_error.position - ego_error.position,
        speed=others.speed + oncoming_error.speed,
    )


def _more_gap_to_oncoming(
    breach: BreachContext, others: OtherVehicles, margins: F32
) -> tuple[Remedy]:
    """One remedy: a larger gap to the oncoming vehicle with the smallest margin.

    Args:
        breach: The breach.
        others: All vehicles in the frame of the breach, of one simulation.
        margins: Margins of the gaps, shape (1, vehicle) [m].
    """
    slot = int(margins[0].argmin())
    gap = float(others.gap[0, slot])
    return single_change(
        RemedyQuantity.GAP_ONCOMING,
        actual=gap,
        needed=gap - breach.margin,
        frame=breach.first_frame,
        slot=slot,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOncomingReaction(Criterion):
    """While the ego is in the opposing lane, it does not force the next oncoming driver to react.

    A reaction is abrupt braking or leaving the lane. There is no standard error. Constant errors of
    positions and speeds do not change a recorded acceleration; a lateral error, by which a vehicle
    may seem to leave its lane, is neglected.

    Attributes:
        max_meeting_time: Oncoming vehicles that the ego meets later, at the speeds of both, do not
            count.
    """

    max_meeting_time: Quantity = quantity(
        10.0, "s", why="A choice; a driver whom the ego meets later does not yet brake for it"
    )
    unit: str = "m/s^2"
    only_two_way_roads: bool = True

    def predicate(self) -> str:
        """The vehicle, its braking, and the margin of leaving the lane."""
        return (
            "While a corner of the ego is beyond the line between the directions: the next "
            f"oncoming vehicle, if it is met within {self.max_meeting_time}, brakes at "
            f"{ABRUPT_BRAKING} or less and keeps its lane. Leaving the lane counts as "
            f"{ABRUPT_BRAKING} too much."
        )

    def check(self, case: Case) -> Finding:
        """The hardest braking of the nearest oncoming vehicle decides, or an exit from its lane.

        Leaving the lane has no deceleration from which a margin could follow. By choice it counts
        as braking at twice `ABRUPT_BRAKING`, as `predicate` states, so its margin is minus that
        limit.
        """
        trajectories = case.trajectories
        if not trajectories.road.is_two_way:
            return finding_not_applicable(case.signals.num_simulations)
        oncoming = self._nearest_oncoming(case)
        limit = ABRUPT_BRAKING.f32
        # Acceleration along the heading of the vehicle at each instant: negative while it brakes.
        accel = as_f32(trajectories.states.accel_lon[oncoming]) * METRES_PER_MM
        margin = limit + accel
        has_left_lane = distance_over_outer_edge(case, oncoming) > LINE_TOLERANCE.f32
        margin = np.where(has_left_lane, np.minimum(margin, -limit), margin)
        frame = oncoming.frame.astype(np.intp)
        return finding_at_instants(margin, oncoming.simulation, frame, case.signals.num_simulations)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """Less braking, or the oncoming vehicle in its lane where leaving the lane decided."""
        case, limit = breach.case, float(ABRUPT_BRAKING.f32)
        oncoming = self._nearest_oncoming(case)
        slot, frame = oncoming.slot, oncoming.frame
        decel = case.trajectories.states.accel_lon[oncoming] * -1e-3  # From mm/s^2 to m/s^2.
        excursion = distance_over_outer_edge(case, oncoming)
        hardest, farthest = int(decel.argmax()), int(excursion.argmax())
        # As in `check`: leaving the lane counts like braking at twice the limit.
        if excursion[farthest] > LINE_TOLERANCE.f32 and decel[hardest] <= 2.0 * limit:
            return single_change(
                RemedyQuantity.EVASION,
                actual=excursion[farthest],
                needed=0.0,  # A choice: wholly in its lane, without the tolerance of `check`.
                frame=frame[farthest],
                slot=int(slot[farthest]),
            )
        return single_change(
            RemedyQuantity.ONCOMING_BRAKING,
            actual=decel[hardest],
            needed=limit,
            frame=frame[hardest],
            slot=int(slot[hardest]),
        )

    def _nearest_oncoming(self, case: Case) -> VehicleInstants:
        """The nearest oncoming vehicle in each frame of `opposing_lane_span`, in order.

        Frames without a vehicle that is met within `max_meeting_time` are left out. The result is
        also an index into arrays of shape (simulation, vehicle, time).
        """
        simulation, frame = opposing_lane_span(case).instants()
        others = other_vehicles_at(case.trajectories, frame.astype(np.int32), simulation)
        closing_speed = others.speed + case.signals.speed[simulation, frame][:, None]
        is_within_time = others.gap <= self.max_meeting_time.f32 * closing_speed
        is_near = others.is_approaching & is_within_time
        slot = np.where(is_near, others.gap, np.inf).argmin(axis=1)
        instants = np.flatnonzero(is_near.any(axis=1))
        return VehicleInstants(simulation[instants], slot[instants], frame[instants])


def distance_over_outer_edge(case: Case, oncoming: VehicleInstants) -> F32:
    """Distance of oncoming bodies beyond the outer edge of their lane, on the ego's far left.

    Lateral positions grow to the ego's left.

    Args:
        case: The batch, with a two-way road.
        oncoming: The vehicles and frames.

    Returns:
        Shape (instant,), negative for a vehicle in its lane [m].
    """
    trajectories = case.trajectories
    centre, _ = lateral_position_and_gap(trajectories, case.signals, oncoming)
    width = trajectories.scenario.vehicles.width[oncoming.simulation, oncoming.slot]
    left_edge = centre + width * HALF
    return left_edge - lane_borders(trajectories.road)[-1]  # The leftmost border of the road.


@dataclass(frozen=True, slots=True, kw_only=True)
class GapToReturnInto(Criterion):
    """When the ego pulls out, the gap in its lane ahead of the passed vehicles is large enough.

    Attributes:
        safe_distance_rule: Code of the rule of the same law that states the safe distance.
    """

    safe_distance_rule: str
    unit: str = "m"
    only_two_way_roads: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather, on which the deceleration depends."""
        return frozenset(["weather"])

    def predicate(self) -> str:
        """The gap, and its smallest lawful length for an ego at the speed of the leader."""
        return (
            "On two-way roads, as the line between the directions is crossed: the gap ahead of the "
            "foremost vehicle that the ego will pass, or of the target, if a vehicle drives less "
            f"than {RETURN_RANGE} ahead of it, >= length of the ego + safe distances (as "
            f"{self.safe_distance_rule}) behind and ahead of it, at the speed of the one ahead."
        )

    def check(self, case: Case) -> Finding:
        """The gap in the frame in which the ego crosses the line decides."""
        if not case.trajectories.road.is_two_way:
            return finding_not_applicable(case.signals.num_simulations)
        frame, gap = opposing_lane_span(case).first, _return_gap(case)
        decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))
        return finding_at_frame(frame, _return_gap_margin(gap, decel), gap.is_judged)

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(2 sp^2 + sv^2 ((t + v/b)^2 + (t - u/b)^2)), v behind the gap and u ahead of it"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap between two vehicles minus the gap that their speeds require [m]."""
        del finding
        gap = _return_gap(case)
        frame = opposing_lane_span(case).first
        decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))

        def margin_with(follower_error: StateError, leader_error: StateError) -> F32:
            measured = replace(
                gap,
                length=gap.length + leader_error.position - follower_error.position,
                follower_speed=gap.follower_speed + follower_error.speed,
                leader_speed=gap.leader_speed + leader_error.speed,
            )
            return _return_gap_margin(measured, decel)

        return error_from_vehicles(margin_with, num_vehicles=2, errors=errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap between the two vehicles."""
        gap = float(_return_gap(breach.case).length[0])
        return single_change(
            RemedyQuantity.GAP_TO_RETURN,
            actual=gap,
            needed=gap - breach.margin,
            frame=breach.first_frame,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _ReturnGap:
    """The gap in the ego's lane into which the ego would return; shapes (simulation,).

    Attributes:
        is_judged: Whether two vehicles bound the gap, and it is at most `RETURN_RANGE` long.
        length: Gap between the bumpers of the two vehicles [m].
        follower_speed: Speed of the vehicle behind the gap [m/s].
        leader_speed: Speed of the vehicle ahead of the gap [m/s].
        ego_length: Length of the ego [m].
    """

    is_judged: Mask
    length: F32
    follower_speed: F32
    leader_speed: F32
    ego_length: F32


def _return_gap(case: Case) -> _ReturnGap:
    """The gap ahead of the foremost vehicle that the ego passes, when the ego pulls out."""
    span, trajectories = opposing_lane_span(case), case.trajectories
    simulation = np.arange(len(span.first))
    # An empty span has negative ends; frame 0 stands for them, and `is_judged` is false.
    pull_out_frame, return_frame = np.maximum(span.first, 0), np.maximum(span.last, 0)
    others = other_vehicles_at(trajectories, pull_out_frame)
    ego_lane = at_frame(case.signals.lane, pull_out_frame)[:, None]
    is_in_ego_lane = others.valid & ~others.is_oncoming & (others.lane == ego_lane)

    # `ego_lead` is the station of the ego minus the station of the vehicle. A passed vehicle is
    # ahead of the ego at the pull-out, where `ego_lead` is negative, and behind it at the return.
    s = trajectories.states.s
    is_behind_at_return = (
        s[simulation, EGO_SLOT, return_frame, None] > s[simulation, :, return_frame]
    )
    is_passed = is_in_ego_lane & (others.ego_lead < 0) & is_behind_at_return
    foremost_passed = np.where(is_passed, others.ego_lead, np.inf).argmin(axis=1)
    # An ego that aborts passes no vehicle: the gap ahead of its target is judged. Without a target
    # `slot_or_ego` gives the ego, and no gap is judged.
    target = slot_or_ego(case.target.slot)
    follower = np.where(is_passed.any(axis=1), foremost_passed, target)

    follower_lead = others.ego_lead[simulation, follower]
    is_ahead = is_in_ego_lane & (others.ego_lead < follower_lead[:, None])
    leader = np.where(is_ahead, others.ego_lead, -np.inf).argmax(axis=1)
    vehicle_length = trajectories.scenario.vehicles.length
    lengths = vehicle_length[simulation, follower] + vehicle_length[simulation, leader]
    length = follower_lead - others.ego_lead[simulation, leader] - lengths * HALF
    is_bounded = span.is_nonempty & (follower != EGO_SLOT) & is_ahead.any(axis=1)
    return _ReturnGap(
        is_judged=is_bounded & (length <= RETURN_RANGE.f32),
        length=length,
        follower_speed=others.speed[simulation, follower],
        leader_speed=others.speed[simulation, leader],
        ego_length=vehicle_length[:, EGO_SLOT],
    )


def _return_gap_margin(gap: _ReturnGap, decel: F32) -> F32:
    """Length of a gap minus the length that the ego needs at the speed of the leader [m].

    Args:
        gap: The gap.
        decel: `decel_for_safe_distance` [m/s^2].
    """
    closing_speed = gap.follower_speed - gap.leader_speed
    gap_behind = lawful_gap(gap.follower_speed, closing_speed, decel)
    gap_ahead = lawful_gap(gap.leader_speed, np.float32(0.0), decel)
    return gap.length - (gap.ego_length + gap_behind + gap_ahead)
