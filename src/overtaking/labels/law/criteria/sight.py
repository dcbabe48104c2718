"""Criteria about the sight distance: stopping within it, and enough of it to overtake.

A `Case` is a batch of simulations with one ego each; a `BreachContext` has the one simulation of
its breach, at index 0. An event is a frame of each simulation, `NEVER` (-1) without it; a span is
the first and the last frame of a stretch of time. `manoeuvre` lasts from 3 s before the attempt to
overtake to 3 s after the return; `judged_span` is the same, and without an attempt all driven
frames. A road without a `course` is straight and level. In `ERROR_FORMULA`, sp and sv are the
standard deviations of a position and of a speed, t and b the reaction time and the deceleration, v
the speed of the ego. The docstring of the package `criteria` explains these terms in full,
`rule.Criterion` describes the methods.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from overtaking.core.arrays import F32, F64, I32, IndexArray, Mask
from overtaking.core.float32_math import as_f32
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.case import (
    assumed_oncoming_speed,
    available_sight,
    judged_span,
    manoeuvre,
    meteorological_range,
    scans,
    seconds_of,
)
from overtaking.labels.law.margins import (
    SAME_MARGIN_M,
    MarginMinimum,
    finding_at_frame,
    finding_not_applicable,
    finding_of_minimum,
    finding_over_span,
    margins_within_span,
    minimum_to_limit,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, deciding_frame
from overtaking.labels.law.numbers import ONCOMING_TIME, STOPPING_REACTION_TIME
from overtaking.labels.law.remedies import BreachContext, Remedy, RemedyQuantity, single_change
from overtaking.labels.law.rule import Criterion
from overtaking.labels.law.safe_distance import (
    GRIP_DECEL,
    decel_with_all_grip,
    stopping_distance_for_sight,
)
from overtaking.labels.snapshots import FrameSpan, at_frame
from overtaking.model.overtake_events import NEVER
from overtaking.model.verdicts import Case, Finding
from overtaking.world.road_surface import stoppable_speed
from overtaking.world.sight_distance import sight_at


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppingSightDistance(Criterion):
    """In every frame the ego can stop within the distance at which it sees an obstacle.

    Attributes:
        safe_distance_rule: Code of the rule of the same law about the distance to the leader.
        is_for_unlit_obstacles: Whether the obstacle is unlit; otherwise a vehicle with lamps on.
    """

    safe_distance_rule: str
    is_for_unlit_obstacles: bool = False
    unit: str = "m"
    applies_without_attempt: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather; for unlit obstacles also the ego's lamps, which must light them."""
        return _inputs_for_sight(is_unlit=self.is_for_unlit_obstacles)

    def predicate(self) -> str:
        """The stopping distance, the sight distance, and the reason to ignore the leader."""
        obstacle = "an unlit obstacle" if self.is_for_unlit_obstacles else "a lit vehicle"
        return (
            f"At every frame: v t + v^2 / (2 {GRIP_DECEL}) <= the distance at which "
            f"{obstacle} is seen, t = {STOPPING_REACTION_TIME}. A leader does not shorten the "
            "visible space: its brake lamps announce what it meets, and "
            f"{self.safe_distance_rule} is the rule for it."
        )

    def check(self, case: Case) -> Finding:
        """The smallest difference, sight distance minus stopping distance, decides."""
        results = scans(case)
        minimum = results.stop_unlit if self.is_for_unlit_obstacles else results.stop_lit
        return finding_of_minimum(minimum, judged_span(case))

    ERROR_FORMULA: ClassVar[str] = "(t + v/b) sv, in the frame of the smallest margin"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the stopping distance, by the ego's speed [m]."""
        signals = case.signals

        def margin(simulation: IndexArray, frame: IndexArray) -> F32:
            speed, friction = signals.speed[simulation, frame], signals.friction[simulation, frame]
            sight = self._sight(case)[simulation, frame]
            return sight - stopping_distance_for_sight(speed, friction)

        frame = deciding_frame(judged_span(case), margin, finding)
        decel = decel_with_all_grip(at_frame(signals.friction, frame))
        # The derivative of v t + v^2 / (2 b) by v.
        time = STOPPING_REACTION_TIME.f32 + at_frame(signals.speed, frame) / decel
        return time * np.float32(errors.speed_std)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The highest speed from which the ego stops within its sight."""
        frames = breach.frames
        # Friction at the actual speed. At a lower speed it is no smaller, so the stop succeeds.
        decel = decel_with_all_grip(breach.case.signals.friction[0, frames])
        sight = self._sight(breach.case)[0, frames]
        max_speed = stoppable_speed(sight, as_f32(STOPPING_REACTION_TIME.f32), decel)
        return breach.remedy_slower_ego(frames, max_speed)

    def margins_by_frame(self, case: Case) -> F64:
        """Margins of the judged frames."""
        stop = stopping_distance_for_sight(case.signals.speed, case.signals.friction)
        return margins_within_span(judged_span(case), self._sight(case) - stop)

    def _sight(self, case: Case) -> F32:
        """Distance at which the obstacle is seen, shape (simulation, time) [m]."""
        signals = case.signals
        return signals.sight_unlit if self.is_for_unlit_obstacles else signals.sight_lit


@dataclass(frozen=True, slots=True, kw_only=True)
class MinimumSightDistance(Criterion):
    """From the attempt until the target is passed, the ego sees far enough.

    On two-way roads the sight must also cover the whole overtake, as in `PassingSightDistance`.

    Attributes:
        min_sight: Smallest lawful sight distance.
        clearance_time: Time to an oncoming vehicle that must remain at the end of the overtake.
        is_for_unlit_obstacles: Whether the sight distance is the distance at which an unlit
            obstacle is seen; otherwise the distance over which air and road show the carriageway.
    """

    min_sight: Quantity
    clearance_time: Quantity = ONCOMING_TIME
    is_for_unlit_obstacles: bool = False
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather; for unlit obstacles also the ego's lamps, which must light them."""
        return _inputs_for_sight(is_unlit=self.is_for_unlit_obstacles)

    def predicate(self) -> str:
        """The smallest sight distance, and the sight distance on two-way roads."""
        sight = "the meteorological optical range and the sight that the road gives are"
        if self.is_for_unlit_obstacles:
            sight = "an unlit obstacle is seen at"
        return (
            f"From attempt to overlap_end, or to the end: {sight} {self.min_sight} or more. "
            f"Two-way roads, at line_crossed: {_passing_sight_predicate(self.clearance_time)}"
        )

    def check(self, case: Case) -> Finding:
        """The frame with the smallest sight decides, or the line crossing on two-way roads."""
        span, road = _span_until_passed(case), case.trajectories.road
        if not (road.is_two_way or road.course or self.is_for_unlit_obstacles):
            # Here only air limits the sight, equally in all frames: one comparison serves a whole
            # simulation, and a breach lasts for the whole span.
            minimum = MarginMinimum(
                min_margin=meteorological_range(case) - self.min_sight.f32,
                first_frame=span.first,
                last_frame=span.last,
                longest_run=span.last - span.first + 1,
            )
            return finding_of_minimum(minimum, span)
        sight = self._sight(case)
        if not road.is_two_way:
            minimum = minimum_to_limit(sight, self.min_sight.f32, span, is_most=False)
            return finding_of_minimum(minimum, span)
        margin = sight - self.min_sight.f32
        # The sight over the whole overtake is compared in one frame only, at the line crossing.
        simulation = np.flatnonzero(case.events.has_attempt)
        crossing = _crossing_frame(case)[simulation]
        passing_margin = _passing_sight_margin(case, self.clearance_time)[simulation]
        margin[simulation, crossing] = np.minimum(margin[simulation, crossing], passing_margin)
        return finding_over_span(margin, span)

    ERROR_FORMULA: ClassVar[str] = (
        "(time on the left + clearance_time) sv where oncoming traffic decides, else 0"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the sight that the overtake needs; the available sight has no error [m]."""
        return _required_sight_error(case, finding, self.clearance_time, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The sight distance of the condition that decided; the driver can only wait for it."""
        case, needed = breach.case, self.min_sight.f32
        if _is_passing_sight_margin(case, breach.margin, self.clearance_time)[0]:
            needed = _required_passing_sight(case, self.clearance_time)[0]
        return _more_sight(breach, needed)

    def _sight(self, case: Case) -> F32:
        """Sight distance in each frame, shape (simulation, time) [m]."""
        signals, road = case.signals, case.trajectories.road
        if self.is_for_unlit_obstacles:
            return signals.sight_unlit
        # The carriageway counts, not other vehicles: their lamps are seen beyond 50 m, the
        # Portuguese `min_sight`, in all weather of the package, so a rule about them could not be
        # broken.
        sight_in_air = np.broadcast_to(meteorological_range(case)[:, None], signals.speed.shape)
        if road.course is None:  # The road hides nothing.
            return sight_in_air
        return np.minimum(sight_in_air, as_f32(sight_at(road, signals.s)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PassingSightDistance(Criterion):
    """When the line is crossed on a two-way road, the sight distance covers the whole overtake.

    Attributes:
        clearance_time: Time to an oncoming vehicle that must remain at the end of the overtake.
    """

    clearance_time: Quantity = ONCOMING_TIME
    unit: str = "m"
    only_two_way_roads: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The weather."""
        return frozenset(["weather"])

    def predicate(self) -> str:
        """The event and the sight distance."""
        return (
            "On two-way roads, at line_crossed, or at attempt if no line is crossed: "
            f"{_passing_sight_predicate(self.clearance_time)}"
        )

    def check(self, case: Case) -> Finding:
        """The sight distance at the line crossing decides."""
        if not case.trajectories.road.is_two_way:
            return finding_not_applicable(case.signals.num_simulations)
        margin = _passing_sight_margin(case, self.clearance_time)
        return finding_at_frame(_crossing_frame(case), margin, case.events.has_attempt)

    ERROR_FORMULA: ClassVar[str] = "(time on the left + clearance_time) sv"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the sight that the overtake needs; the available sight has no error [m]."""
        return _required_sight_error(case, finding, self.clearance_time, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """Sight over the whole overtake; the driver can only wait for it."""
        return _more_sight(breach, _required_passing_sight(breach.case, self.clearance_time)[0])


def _inputs_for_sight(*, is_unlit: bool) -> frozenset[str]:
    """Names of `trajectories.UNKNOWNS` on which the sight of an obstacle depends."""
    return frozenset(["weather", "lamps"] if is_unlit else ["weather"])


def _span_until_passed(case: Case) -> FrameSpan:
    """From the attempt until the target is passed, or to the end; empty without an attempt."""
    events, stop = case.events, manoeuvre(case).last
    passed = np.where(events.overlap_end != NEVER, np.minimum(events.overlap_end, stop), stop)
    return FrameSpan(first=np.where(events.has_attempt, events.attempt, passed + 1), last=passed)


def _passing_sight_predicate(clearance_time: Quantity) -> str:
    """The sight distance that an overtake in the opposing lane needs, in words."""
    return (
        f"air and road give a sight of (v + limit) (time on the left + {clearance_time}) or more, "
        "limit: the highest for oncoming traffic within that sight."
    )


def _passing_sight_margin(case: Case, clearance_time: Quantity) -> F32:
    """Sight distance at the line crossing minus `_required_passing_sight`, (simulation,) [m].

    Air and road limit this sight distance. The distance to which drivers look ahead in other
    situations does not: oncoming vehicles are lit, or visible by day, and a driver who overtakes
    looks as far as the overtake needs.
    """
    return available_sight(case, _crossing_frame(case)) - _required_passing_sight(
        case, clearance_time
    )


def _required_passing_sight(case: Case, clearance_time: Quantity) -> F32:
    """Sight distance that an overtake in the opposing lane needs, shape (simulation,) [m].

    The distance that the ego and an oncoming vehicle at `assumed_oncoming_speed` together drive in
    `_required_clear_time`.

    Source:
        AASHTO (2018), section 3.2.4. The distances of this source are written here as a time at
        the sum of both speeds.
    """
    frame = _crossing_frame(case)
    closing_speed = at_frame(case.signals.speed, frame) + assumed_oncoming_speed(case, frame)
    return closing_speed * _required_clear_time(case, clearance_time)


def _required_clear_time(case: Case, clearance_time: Quantity) -> F32:
    """Time for which the opposing lane must be clear, shape (simulation,) [s].

    The ego's time on the left, from the line crossing to the end of the return or abort, plus the
    clearance. For an ego that does not return this time is unknown and counts as 0.
    """
    events = case.events
    return_frame = np.where(events.return_end != NEVER, events.return_end, events.abort_end)
    has_returned = (events.line_crossed != NEVER) & (return_frame != NEVER)
    time_on_left = seconds_of(case, np.where(has_returned, return_frame - events.line_crossed, 0))
    return time_on_left + clearance_time.f32


def _crossing_frame(case: Case) -> I32:
    """Frame of the line crossing, or of the attempt without one, shape (simulation,)."""
    events = case.events
    return np.where(events.line_crossed != NEVER, events.line_crossed, events.attempt)


def _is_passing_sight_margin(case: Case, margin: F32 | float, clearance_time: Quantity) -> Mask:
    """Whether `_passing_sight_margin` equals `margin`, so that it decided; false on one-way roads.

    Shape (simulation,).
    """
    if not case.trajectories.road.is_two_way:
        return np.zeros(case.signals.num_simulations, np.bool_)
    return np.abs(_passing_sight_margin(case, clearance_time) - margin) < SAME_MARGIN_M


def _required_sight_error(
    case: Case, finding: Finding, clearance_time: Quantity, errors: MeasurementErrors
) -> F32:
    """Error of `_required_passing_sight` by the ego's speed, 0 where it does not decide [m]."""
    decides = _is_passing_sight_margin(case, finding.margin, clearance_time)
    error = _required_clear_time(case, clearance_time) * np.float32(errors.speed_std)
    return np.where(decides, error, np.float32(0.0))


def _more_sight(breach: BreachContext, needed: np.float32) -> tuple[Remedy]:
    """One remedy: the sight that the law requires [m]."""
    actual = float(needed) + breach.margin
    return single_change(
        RemedyQuantity.SIGHT, actual=actual, needed=needed, frame=breach.first_frame
    )
