"""Criteria about the begin of an overtake, and about the vehicles that it must not endanger.

A `Case` is a batch of simulations with one ego each; a `BreachContext` has the one simulation of
its breach, at index 0. An event is a frame of each simulation, `NEVER` (-1) without it: the attempt
is the begin of the movement to the left, and `line_crossed` follows. The new leader and follower
are those in the lane on the left. A `GapMargin` is a function of gap, speed of the ego, closing
speed and `decel_for_safe_distance`. A belief is the margin that follows from what the driver
perceived at a decision; `belief_at` compares it with the true margin. In `ERROR_FORMULA`, sp and sv
are the standard deviations of a position and of a speed, dv is the closing speed. The docstring of
the package `criteria` explains these terms in full, `rule.Criterion` describes the methods.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.core.float32_math import maximum
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.beliefs import belief_at, pull_out_percept
from overtaking.labels.law.case import (
    GeneralSpeedLimits,
    ego_may_be,
    meteorological_range,
    neighbour_at,
    speed_limit_bounds,
)
from overtaking.labels.law.margins import finding_at_frame
from overtaking.labels.law.measurement_errors import (
    BRAKING_ERROR_FORMULA,
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    StateError,
    error_from_vehicles,
    gap_error,
)
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    ENTRY_TTC,
    LATERAL_ERROR_SHARE,
    LATERAL_NOISE_TIME,
    quantity,
)
from overtaking.labels.law.remedies import (
    NO_SPEED,
    BreachContext,
    Remedy,
    RemedyQuantity,
    change_by_margin,
    gap_and_closing_speed,
    max_following_speed,
    min_speed_before_follower,
    more_gap,
    single_change,
)
from overtaking.labels.law.rule import Criterion
from overtaking.labels.law.safe_distance import (
    GapMargin,
    decel_for_safe_distance,
    entry_margin_ahead,
    entry_margin_behind,
)
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    OtherVehicles,
    VehicleInstants,
    at_frame,
    indicator_to_overtaking_side,
    lateral_speed_at,
    lateral_speed_half_window,
    other_vehicles_at,
    scatter,
    slot_or_ego,
    vehicle_snapshot,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import (
    NO_VEHICLE,
    ManoeuvreKind,
    PerceivedVehicle,
    Trajectories,
)
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding


@dataclass(frozen=True, slots=True, kw_only=True)
class GapAhead(Criterion):
    """As the line is crossed, the gap to the leader in the lane on the left is lawful.

    Attributes:
        min_ttc: Smallest lawful time to collision with this leader.
        safe_distance_rule: Code of the rule of the same law that states the safe distance, for the
            sentence of `predicate`; the formula is the same in all laws.
    """

    min_ttc: Quantity = ENTRY_TTC
    safe_distance_rule: str
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather, on which the deceleration depends."""
        return frozenset(["weather"])

    @property
    def believed_margins(self) -> Mapping[tuple[ManoeuvreKind, PerceivedVehicle], GapMargin]:
        """The margin to the new leader at the decision to pull out."""
        return MappingProxyType(
            {(ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_LEADER): self._margin}
        )

    def predicate(self) -> str:
        """The gap and the time to collision."""
        return (
            "At line_crossed: gap to the leader in the lane on the left >= safe distance (as "
            f"{self.safe_distance_rule}), and time to collision >= {self.min_ttc}."
        )

    def check(self, case: Case) -> Finding:
        """The gap as the line is crossed decides."""
        role, perceived = NeighbourRole.LEFT_LEADER, PerceivedVehicle.NEW_LEADER
        return _finding_at_crossing(case, role, perceived, self._margin)

    ERROR_FORMULA: ClassVar[str] = (
        f"{GAP_ERROR_FORMULA}, or sqrt(2 sp^2 + 2 min_ttc^2 sv^2) where the time to collision "
        "decides"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap as the line is crossed [m]."""
        del finding
        frame = case.events.line_crossed
        return gap_error(case, NeighbourRole.LEFT_LEADER, frame, self._margin, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap to the new leader, or a lower speed."""
        neighbour, frames = NeighbourRole.LEFT_LEADER, np.array([breach.first_frame])
        gap, closing_speed = gap_and_closing_speed(breach, neighbour, frames)
        leader_speed = breach.case.signals.speed[0, frames] - closing_speed
        decel = decel_for_safe_distance(breach.case.signals.friction[0, frames])
        allowed = np.minimum(
            max_following_speed(gap, leader_speed, decel), leader_speed + gap / self.min_ttc.f32
        )
        # A negative gap is an overlap of the bodies, which is unlawful at any speed.
        allowed = np.where(gap < 0, NO_SPEED, allowed)
        larger_gap = more_gap(breach, neighbour, breach.first_frame, margin=breach.margin)
        return *larger_gap, *breach.remedy_slower_ego(frames, allowed)

    def _margin(self, gap: F32, speed: F32, closing_speed: F32, decel: F32) -> F32:
        """Gap minus the gap that safe distance and time to collision of this law require [m]."""
        return entry_margin_ahead(gap, speed, closing_speed, decel, self.min_ttc.f32)


@dataclass(frozen=True, slots=True, kw_only=True)
class GapBehind(Criterion):
    """As the line is crossed, the gap to the follower in the lane on the left is lawful.

    Attributes:
        safe_distance_rule: Code of the rule of the same law that states the safe distance, for the
            sentence of `predicate`; the formula is the same in all laws.
        general_limits: Speed limits of the same law; no remedy exceeds the limit at the crossing.
    """

    safe_distance_rule: str
    general_limits: GeneralSpeedLimits
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather, on which the deceleration depends."""
        return frozenset(["weather"])

    @property
    def believed_margins(self) -> Mapping[tuple[ManoeuvreKind, PerceivedVehicle], GapMargin]:
        """The margin to the new follower at the decision to pull out."""
        return MappingProxyType(
            {(ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_FOLLOWER): entry_margin_behind}
        )

    def predicate(self) -> str:
        """The gap and the braking."""
        return (
            "At line_crossed: gap to the follower in the lane on the left >= its safe distance (as "
            f"{self.safe_distance_rule}), and the braking that is forced on it, closing speed^2 / "
            f"(2 gap), <= {ABRUPT_BRAKING}."
        )

    def check(self, case: Case) -> Finding:
        """The gap as the line is crossed decides."""
        role, perceived = NeighbourRole.LEFT_FOLLOWER, PerceivedVehicle.NEW_FOLLOWER
        return _finding_at_crossing(case, role, perceived, entry_margin_behind)

    ERROR_FORMULA: ClassVar[str] = f"{GAP_ERROR_FORMULA}, or {BRAKING_ERROR_FORMULA}"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap as the line is crossed [m]."""
        del finding
        frame = case.events.line_crossed
        return gap_error(case, NeighbourRole.LEFT_FOLLOWER, frame, entry_margin_behind, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap to the new follower, or a higher speed where the law allows it."""
        case, frame, neighbour = breach.case, breach.first_frame, NeighbourRole.LEFT_FOLLOWER
        larger_gap = more_gap(breach, neighbour, frame, margin=breach.margin)
        frames = np.array([frame])
        gap, closing_speed = gap_and_closing_speed(breach, neighbour, frames)
        follower_speed = case.signals.speed[0, frames] + closing_speed
        decel = decel_for_safe_distance(case.signals.friction[0, frames])
        # At this speed the gap is lawful and the follower need not brake abruptly. Overlapping
        # vehicles have a negative gap, which has no square root; no speed mends this.
        needed = min_speed_before_follower(np.maximum(gap, 0), follower_speed, decel)[0]
        # Where a sign or a kind is unknown, the highest limit that may hold counts.
        _, highest_limit = speed_limit_bounds(case, self.general_limits)
        if gap[0] < 0 or needed > highest_limit[0, frame]:
            return larger_gap
        return *larger_gap, *breach.remedy_ego_speed(frame, needed)


def _finding_at_crossing(
    case: Case, role: NeighbourRole, perceived: PerceivedVehicle, margin: GapMargin
) -> Finding:
    """The finding of a gap to a neighbour as the line is crossed.

    Args:
        case: The batch.
        role: The neighbour.
        perceived: The same vehicle in the percept of the decision to pull out.
        margin: Margin of the gap.
    """
    signals, frame = case.signals, case.events.line_crossed
    neighbour = neighbour_at(case, role, frame)
    decel = decel_for_safe_distance(at_frame(signals.friction, frame))
    return finding_at_frame(
        frame,
        margin(neighbour.gap, at_frame(signals.speed, frame), neighbour.closing_speed, decel),
        neighbour.valid,
        belief=belief_at(case, pull_out_percept(case), {perceived: margin}),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CalmFollower(Criterion):
    """After a change of lane, the vehicle behind need not brake hard.

    By choice it leaves out the safe distance that `GapBehind` requires, so it needs no weather. It
    compares no belief of the driver.

    Attributes:
        manoeuvre: The pull-out, as the line is crossed, or the return, as it ends.
    """

    manoeuvre: ManoeuvreKind
    unit: str = "m"

    def predicate(self) -> str:
        """The event, the vehicle and the gap."""
        is_pull_out = self.manoeuvre is ManoeuvreKind.PULL_OUT
        event = "line_crossed" if is_pull_out else "return_end"
        follower = "the follower in the lane on the left" if is_pull_out else "the vehicle behind"
        return (
            f"At {event}: gap to {follower} >= closing speed^2 / (2 x {ABRUPT_BRAKING}), so that "
            "it need not brake hard."
        )

    def check(self, case: Case) -> Finding:
        """The gap at the event decides."""
        frame = self._frame(case)
        follower = neighbour_at(case, self._role, frame)
        margin = follower.gap - _braking_distance(follower.closing_speed)
        return finding_at_frame(frame, margin, follower.valid)

    ERROR_FORMULA: ClassVar[str] = f"sqrt(2 sp^2 + 2 (dv/a)^2 sv^2), a = {ABRUPT_BRAKING}"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the gap at the event [m]."""
        del finding

        def margin(gap: F32, speed: F32, closing_speed: F32, decel: F32) -> F32:
            del speed, decel
            return gap - _braking_distance(closing_speed)

        return gap_error(case, self._role, self._frame(case), margin, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A larger gap to the vehicle behind."""
        return more_gap(breach, self._role, breach.first_frame, margin=breach.margin)

    @property
    def _role(self) -> NeighbourRole:
        """The vehicle behind that the manoeuvre may endanger."""
        is_pull_out = self.manoeuvre is ManoeuvreKind.PULL_OUT
        return NeighbourRole.LEFT_FOLLOWER if is_pull_out else NeighbourRole.FOLLOWER

    def _frame(self, case: Case) -> I32:
        """Frame of the event, `NEVER` without it, shape (simulation,)."""
        is_pull_out = self.manoeuvre is ManoeuvreKind.PULL_OUT
        return case.events.line_crossed if is_pull_out else case.events.return_end


def _braking_distance(closing_speed: F32) -> F32:
    """Gap at which a follower loses its closing speed by `ABRUPT_BRAKING` [m]."""
    closing_speed = np.maximum(closing_speed, np.float32(0.0))
    return closing_speed * closing_speed / (np.float32(2.0) * ABRUPT_BRAKING.f32)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedAdvantage(Criterion):
    """As the ego comes alongside, it is substantially faster than the target.

    This instant is a choice; the law names none.

    Attributes:
        min_speed_gain: Smallest lawful speed of the ego minus the speed of the target.
    """

    min_speed_gain: Quantity
    unit: str = "m/s"

    def predicate(self) -> str:
        """The difference of the speeds."""
        return f"At overlap_begin: v - v_target >= {self.min_speed_gain}."

    def check(self, case: Case) -> Finding:
        """The difference as the overlap begins decides."""
        begin, slot = case.events.overlap_begin, case.target.slot
        frame = np.maximum(begin, 0)  # `NEVER` is negative.
        target = vehicle_snapshot(case.trajectories, slot, np.arange(len(frame)), frame)
        speed_gain = at_frame(case.signals.speed, frame) - target.speed
        return finding_at_frame(begin, speed_gain - self.min_speed_gain.f32, slot != NO_VEHICLE)

    ERROR_FORMULA: ClassVar[str] = "sqrt(2) sv"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the difference of two independent speeds [m/s]."""
        del case
        return np.full_like(finding.margin, np.sqrt(2.0) * errors.speed_std)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A higher speed, by the size of the margin."""
        speed = breach.case.signals.speed[0, breach.first_frame]
        return breach.remedy_ego_speed(breach.first_frame, speed - np.float32(breach.margin))


@dataclass(frozen=True, slots=True, kw_only=True)
class SightForTrucks(Criterion):
    """As a truck begins to overtake, fog and rain leave enough sight.

    Every truck counts: kinds of vehicles have no limit of weight, such as the 7.5 t of German law.

    Attributes:
        min_range: Smallest lawful meteorological range.
    """

    min_range: Quantity
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kind of the ego and the weather."""
        return frozenset(["kinds", "weather"])

    def predicate(self) -> str:
        """The range."""
        return (
            "At attempt, the ego being a truck: the meteorological optical range is "
            f"{self.min_range} or more."
        )

    def check(self, case: Case) -> Finding:
        """The meteorological range, which is the same in all frames, decides."""
        # An ego of unknown kind counts as a truck; as `kinds` is a required input, the verdict is
        # then undecidable.
        is_judged = ego_may_be(case, VehicleKind.TRUCK) & case.events.has_attempt
        margin = meteorological_range(case) - self.min_range.f32
        return finding_at_frame(case.events.attempt, margin, is_judged)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The range that the law asks for; a driver can only wait for it."""
        needed = self.min_range.f32
        actual = float(needed) + breach.margin
        return single_change(
            RemedyQuantity.SIGHT, actual=actual, needed=needed, frame=breach.first_frame
        )


_MOVING_OUT_SPEED = quantity(
    0.2, "m/s", why="A choice; slower sideways motion counts as swaying in the lane"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOtherOvertaking(Criterion):
    """At the attempt, no vehicle overtakes the ego or is about to.

    Attributes:
        min_arrival: Smallest lawful time until the next vehicle on the left is beside the ego.
        max_arrival: Later arrivals count as this, so that margins stay finite.
        reach: Followers in the lane of the ego count up to this distance behind it.
        max_lateral_speed: A follower that moves left faster has begun to pull out.
    """

    min_arrival: Quantity = quantity(
        4.0,
        "s",
        why="A choice; a lane change takes about 5 s, and a vehicle that would be beside the ego "
        "during most of it overtakes already",
    )
    max_arrival: Quantity = quantity(
        60.0, "s", why="Later arrivals count as this, so that margins stay finite"
    )
    reach: Quantity = quantity(
        100.0, "m", why="A choice; the motion of a follower farther back is not taken as overtaking"
    )
    max_lateral_speed: Quantity = _MOVING_OUT_SPEED
    unit: str = "s"

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """The indicators: a follower may signal left; one that moves left decides without them."""
        return frozenset(["indicators"])

    def predicate(self) -> str:
        """The arrival on the left, and the followers in the lane."""
        return (
            "At attempt: no vehicle behind in the lane on the left arrives beside the ego within "
            f"{self.min_arrival}, and no vehicle within {self.reach} behind in its lane signals "
            f"left or moves left at over {self.max_lateral_speed}."
        )

    def check(self, case: Case) -> Finding:
        """The arrival of the next vehicle on the left decides, as the attempt begins.

        A follower that has begun to pull out is an arrival in 0 s.
        """
        has_attempt = case.events.has_attempt
        # Only attempts are looked up: in a batch, most simulations may have no attempt.
        others = _others_at_attempt(case)
        is_follower, is_left_follower = self._followers(case, others)
        has_begun = self._has_begun_to_pull_out(case, others, is_follower)
        arrival = self._first_arrival(case, others, is_left_follower)
        arrival = np.where(has_begun, np.float32(0.0), arrival)
        # A follower with unknown indicators may indicate, which would break a kept rule. A broken
        # rule stays broken: `finding_at_frame` ignores the doubt in a breach.
        is_doubtful = np.any(is_follower, axis=1) & ("indicators" in case.trajectories.unknown)
        # The arrays have a row for each attempt; `to_batch` puts them into the rows of the batch.
        to_batch = partial(scatter, simulations=has_attempt, num_simulations=len(has_attempt))
        return finding_at_frame(
            case.events.attempt,
            to_batch(arrival - self.min_arrival.f32),
            to_batch(np.any(is_left_follower | is_follower, axis=1)),
            doubtful=to_batch(is_doubtful),
        )

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(2 sp^2 + 2 time^2 sv^2) / closing speed; 0 where a vehicle signals or moves left"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the arrival of the next vehicle on the left [s]."""
        del finding
        others, has_attempt = _others_at_attempt(case), case.events.has_attempt
        is_follower, is_left_follower = self._followers(case, others)

        def arrival_with(ego_error: StateError, other_error: StateError) -> F32:
            # The arrival depends on the difference of both speeds. `_first_arrival` reads the ego's
            # speed from the signals, so the error of that speed is subtracted from the others'.
            measured = replace(
                others,
                gap=others.gap + ego_error.position - other_error.position,
                speed=others.speed + other_error.speed - ego_error.speed,
            )
            return self._first_arrival(case, measured, is_left_follower)

        error = error_from_vehicles(arrival_with, num_vehicles=2, errors=errors)
        # A follower that has begun to pull out decides whatever the vehicles on the left do.
        has_begun = self._has_begun_to_pull_out(case, others, is_follower)
        error = np.where(has_begun, np.float32(0.0), error)
        return scatter(error, has_attempt, len(has_attempt))

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A later arrival of the next vehicle on the left."""
        # Of a follower that has begun to pull out, the actual arrival is 0 s, as in `check`.
        needed = self.min_arrival.f32
        actual = float(needed) + breach.margin
        return single_change(
            RemedyQuantity.ARRIVAL, actual=actual, needed=needed, frame=breach.first_frame
        )

    def _followers(self, case: Case, others: OtherVehicles) -> tuple[Mask, Mask]:
        """Followers within `reach` in the lane of the ego, and all vehicles behind on the left.

        Returns:
            Each of shape (attempt, vehicle).
        """
        ego_lane = _ego_lane_at_attempt(case)[:, None]
        # `ego_lead` is positive for vehicles behind the ego.
        is_behind = others.valid & ~others.is_oncoming & (others.ego_lead > 0)
        is_follower = is_behind & (others.lane == ego_lane) & (others.gap <= self.reach.f32)
        # Code 255 of an ego beyond the slow edge, plus 1, wraps to 0, the lane on its left.
        return is_follower, is_behind & (others.lane == ego_lane + 1)

    def _has_begun_to_pull_out(self, case: Case, others: OtherVehicles, is_follower: Mask) -> Mask:
        """Whether any follower moves to the left, or indicates to, at each attempt, (attempt,)."""
        index, slot = np.nonzero(is_follower)
        simulation = np.flatnonzero(case.events.has_attempt)[index]
        frame, limit = case.events.attempt[simulation], self.max_lateral_speed.f32
        vehicles = VehicleInstants(simulation, slot, frame)
        speed_to_left = denoised_lateral_speed_at(case.trajectories, vehicles, float(limit))
        is_moving_left = is_follower.copy()
        is_moving_left[is_follower] = speed_to_left > limit

        lamp = indicator_to_overtaking_side(case.trajectories.road)
        is_known = "indicators" not in case.trajectories.unknown
        is_indicating = is_follower & ((others.lights & lamp) != 0) & is_known
        return (is_moving_left | is_indicating).any(axis=1)

    def _first_arrival(self, case: Case, others: OtherVehicles, is_left_follower: Mask) -> F32:
        """Time until the first vehicle behind on the left is beside the ego, (attempt,) [s].

        Speeds are constant.
        """
        simulation = np.flatnonzero(case.events.has_attempt)
        longest = self.max_arrival.f32
        ego_speed = case.signals.speed[simulation, case.events.attempt[simulation], None]
        closing_speed = others.speed - ego_speed
        is_closing = is_left_follower & (closing_speed > 0)
        gap = maximum(others.gap, np.float32(0.0))  # A vehicle that overlaps has arrived.
        time = gap / np.where(is_closing, closing_speed, np.float32(1.0))
        return np.where(is_closing & (time < longest), time, longest).min(axis=1)


def _others_at_attempt(case: Case) -> OtherVehicles:
    """All vehicles at each attempt, one row for each simulation with an attempt."""
    simulation = np.flatnonzero(case.events.has_attempt)
    return other_vehicles_at(case.trajectories, case.events.attempt[simulation], simulation)


def _ego_lane_at_attempt(case: Case) -> U8:
    """Lane of the ego at each attempt, shape (attempt,)."""
    simulation = np.flatnonzero(case.events.has_attempt)
    return case.signals.lane[simulation, case.events.attempt[simulation]]


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetInLane(Criterion):
    """At the attempt, the target neither indicates to the left nor moves left.

    Attributes:
        max_lateral_speed: A target that moves left faster leaves its lane.
    """

    max_lateral_speed: Quantity = _MOVING_OUT_SPEED
    unit: str = "m/s"

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """The indicators: the target might indicate."""
        return frozenset(["indicators"])

    def predicate(self) -> str:
        """The indicator, the speed, and the margin of a signal alone."""
        return (
            "At attempt: the target does not signal left, and moves left at no more than "
            f"{self.max_lateral_speed}. A signal alone counts as a margin of "
            f"-{self.max_lateral_speed}."
        )

    def check(self, case: Case) -> Finding:
        """The speed of the target to the left decides, as the attempt begins.

        There is no standard error: constant errors of positions do not change a speed, and
        `denoised_lateral_speed_at` reduces the noise that differs from frame to frame.
        """
        trajectories, attempt = case.trajectories, case.events.attempt
        has_target, slot = case.target.slot != NO_VEHICLE, slot_or_ego(case.target.slot)
        limit = self.max_lateral_speed.f32
        # Without an attempt the target need not be recorded in that frame.
        simulation = np.flatnonzero(has_target & case.events.has_attempt)
        speed_to_left = np.zeros(len(slot), np.float32)
        target = VehicleInstants(simulation, slot[simulation], attempt[simulation])
        speed_to_left[simulation] = denoised_lateral_speed_at(trajectories, target, float(limit))
        margin = limit - speed_to_left

        lights = trajectories.states.lights[np.arange(len(slot)), slot, np.maximum(attempt, 0)]
        is_unknown = "indicators" in trajectories.unknown
        lamp = indicator_to_overtaking_side(trajectories.road)
        is_indicating = has_target & ((lights & lamp) != 0) & (not is_unknown)
        # A signal has no speed from which a margin could follow. By choice the margin is -limit, as
        # of a motion at twice the limit; `predicate` states it.
        margin = np.where(is_indicating, np.minimum(margin, -limit), margin)
        doubtful = np.full(len(slot), is_unknown)
        return finding_at_frame(attempt, margin, has_target, doubtful=doubtful)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A target that does not move left."""
        return change_by_margin(
            breach,
            RemedyQuantity.TARGET_DRIFT,
            limit=self.max_lateral_speed.f32,
            frame=breach.first_frame,
            slot=breach.target_slot,
        )


_THIRD_DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])
"""A third difference: 0 for a parabola, with 20 times the variance of the noise."""


def denoised_lateral_speed_at(
    trajectories: Trajectories, vehicles: VehicleInstants, limit: float
) -> F32:
    """Speed of vehicles to the left at single frames, shape (instant,) [m/s].

    The speed is the difference of the positions h after and h before the frame, divided by 2 h. In
    simulations, which have no noise, h is about 0.1 s, at all frame rates; the value is a choice.

    In a recording, h is increased until the standard error of the speed, sqrt(2) noise / (2 h), is
    at most `LATERAL_ERROR_SHARE` of the limit, but not beyond `LATERAL_NOISE_TIME`. The noise is
    the standard deviation of a position, measured from the frames up to `LATERAL_NOISE_TIME` before
    and after: the root mean square of the third differences, divided by sqrt(20).

    Args:
        trajectories: The batch.
        vehicles: The vehicles and frames.
        limit: The speed with which it is compared [m/s].
    """
    # `unknown` names the inputs that are not recorded. Only simulations have all: recordings of
    # real traffic never have the stage of the ego (following, pulling out, ...).
    if not trajectories.unknown:
        return lateral_speed_at(trajectories, vehicles)
    interval = trajectories.scenario.frame_interval_ms
    max_half_window = int(float(LATERAL_NOISE_TIME.f32) * 1000.0 / interval)
    max_error = float(LATERAL_ERROR_SHARE.f32) * limit
    # A third difference takes four frames, more than the three of a half window of 1.
    noise = _lateral_noise(trajectories, vehicles, max(2, max_half_window))
    required_duration = np.sqrt(2.0) * noise / max_error  # 2 h [s].
    half_window = np.ceil(required_duration / 2.0 * 1000.0 / interval)
    min_half_window = lateral_speed_half_window(interval)
    max_half_window = max(min_half_window, max_half_window)
    half_window = np.clip(half_window, min_half_window, max_half_window).astype(np.int32)
    return lateral_speed_at(trajectories, vehicles, half_window)


def _lateral_noise(
    trajectories: Trajectories, vehicles: VehicleInstants, half_window: int
) -> NDArray[np.float64]:
    """Standard deviation of the noise of a lateral position, from the frames around it [m]."""
    simulation, slot, frame = vehicles
    frames = frame[:, None] + np.arange(-half_window, half_window + 1)
    is_recorded = (frames >= 0) & (frames < trajectories.num_frames[simulation, None])
    instants = (simulation[:, None], slot[:, None], np.where(is_recorded, frames, 0))
    is_recorded &= trajectories.state_mask[instants]
    d = trajectories.states.d[instants] * float(METRES_PER_MM)
    num_differences = frames.shape[1] - len(_THIRD_DIFFERENCE) + 1
    windows = [
        (d[:, k : k + num_differences], is_recorded[:, k : k + num_differences])
        for k in range(len(_THIRD_DIFFERENCE))
    ]
    third_difference = sum(
        weight * values for weight, (values, _) in zip(_THIRD_DIFFERENCE, windows, strict=True)
    )
    is_complete = np.logical_and.reduce([is_inside for _, is_inside in windows])
    # Without four recorded frames in a row the noise is 0, which selects the shortest window; too
    # few frames are recorded for a longer one.
    squares = np.where(is_complete, third_difference**2, 0.0).sum(axis=1)
    return np.sqrt(squares / np.maximum(is_complete.sum(axis=1), 1) / (_THIRD_DIFFERENCE**2).sum())
