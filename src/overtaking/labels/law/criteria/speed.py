"""Criteria about the ego's speed: speed limits, lowest speed on motorways, speed in fog.

A `Case` is a batch of simulations with one ego each; a `BreachContext` has the one simulation of
its breach, at index 0. `judged_span` lasts from 3 s before the attempt to overtake to 3 s after the
return; without an attempt it has all driven frames. In `ERROR_FORMULA`, sp and sv are the standard
deviations of a position and of a speed. The docstring of the package `criteria` explains these
terms in full, `rule.Criterion` describes the methods.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from overtaking.core.arrays import F32, F64, U8, IndexArray, Mask
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.case import (
    LIMIT_CLASSES,
    GeneralSpeedLimits,
    has_changing_limit,
    judged_span,
    limit_class,
    meteorological_range,
    speed_limit_bounds,
)
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    finding_from_margins,
    finding_not_applicable,
    finding_of_minimum,
    finding_over_span,
    margins_within_span,
    minimum_over,
    minimum_to_limit,
    reduce_span,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, propagated_error
from overtaking.labels.law.numbers import quantity
from overtaking.labels.law.remedies import BreachContext, Remedy
from overtaking.labels.law.rule import Criterion
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import at_frame, num_slow_vehicles
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding, Severity, Verdict

_HALF_SPEED_STEP = np.float32(5e-4)
"""Half of the resolution of recorded speeds [m/s]: 50 km/h, or 13.8889 m/s, is recorded as
13.889 m/s, which must not exceed a limit of 50 km/h."""

_WHOLE_ROAD = 1e6
"""Distance from the ego within which slow vehicles count as congestion [m]: more than any road is
long, so all recorded vehicles count."""

_SPEED_ERROR_FORMULA = "sv"


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimit(Criterion):
    """In every frame, the ego keeps to the posted limit and to the general limit.

    Attributes:
        general_limits: Limits by kind of road and class of vehicle.
        serious_excess: Excess over the limit beyond which a breach is serious.
        very_serious_excess: Excess over the limit beyond which a breach is very serious.
        heavy_serious_excess: `serious_excess` for heavy vehicles; None for the same value.
        heavy_very_serious_excess: `very_serious_excess` for heavy vehicles; None for the same.
    """

    general_limits: GeneralSpeedLimits
    serious_excess: Quantity
    very_serious_excess: Quantity
    heavy_serious_excess: Quantity | None = None
    heavy_very_serious_excess: Quantity | None = None
    unit: str = "m/s"
    applies_without_attempt: bool = True

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """If one of these is unknown, a speed between two possible limits is undecidable."""
        return frozenset(["speed_limit", "kinds", "road_kind"])

    def predicate(self) -> str:
        """The limits, and the severity of an excess."""
        heavy = ""
        if self.heavy_serious_excess and self.heavy_very_serious_excess:
            heavy = (
                f"; of heavy vehicles more than {self.heavy_serious_excess} and "
                f"{self.heavy_very_serious_excess}"
            )
        return (
            "At every frame: speed <= min(limit posted where the ego's centre is, general limit). "
            f"The general limits are {self.general_limits}. An excess of more than "
            f"{self.serious_excess} is serious, of more than {self.very_serious_excess} very "
            f"serious{heavy}."
        )

    def bounds(self, case: Case, ahead: float = 0.0) -> tuple[F32, F32]:
        """The lowest and the highest limit that may hold, as `speed_limit_bounds`.

        Args:
            case: The batch.
            ahead: Distance ahead of the ego at which the limit is read; negative behind it [m].
        """
        return speed_limit_bounds(case, self.general_limits, ahead)

    def check(self, case: Case) -> Finding:
        """The largest excess over the highest limit that may hold decides."""
        finding = keeps_limit(case, self.bounds(case))
        return finding.replace(severity=self._severity(case, finding))

    def _severity(self, case: Case, finding: Finding) -> U8:
        """Severity of each breach by its excess, shape (simulation,)."""
        vehicle_class = limit_class(case.trajectories.scenario.vehicles.kind[:, EGO_SLOT])
        is_heavy = vehicle_class == LIMIT_CLASSES.index("heavy")
        severity = np.full(len(is_heavy), Severity.LIGHT, np.uint8)
        for excess, heavy_excess in (
            (self.serious_excess, self.heavy_serious_excess),
            (self.very_serious_excess, self.heavy_very_serious_excess),
        ):
            threshold = np.where(is_heavy, (heavy_excess or excess).f32, excess.f32)
            # The codes count up: light, serious, very serious.
            severity += (-finding.margin > threshold).astype(np.uint8)
        return np.where(finding.verdict == Verdict.ILLEGAL, severity, np.uint8(Severity.NONE))

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(sv^2 + c^2), c half the change of the limit from sp behind the ego to sp ahead of it"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the speed, and of the place at which the limit changes [m/s]."""
        if not has_changing_limit(case.trajectories) or "speed_limit" in case.trajectories.unknown:
            return _speed_error(finding, errors)
        speed, span = case.signals.speed, judged_span(case)

        def margin_with(position_error: np.float32, speed_error: np.float32) -> F32:
            _, highest_limit = self.bounds(case, ahead=float(position_error))
            # Without `_to_recorded_resolution`: the constant cancels in differences of margins.
            return reduce_span(np.minimum, highest_limit - (speed + speed_error), span)

        return propagated_error(margin_with, errors.position_std, errors.speed_std)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The limit, in the frame in which the ego exceeded it most."""
        _, highest_limit = self.bounds(breach.case)
        return breach.remedy_slower_ego(breach.frames, highest_limit[0, breach.frames])

    def limit(self, case: Case) -> F32:
        """The highest limit that may hold, in the frame in which the ego exceeds it most [m/s].

        A policy may tolerate an excess up to a share of the measured speed, which is this limit
        plus the excess.
        """
        _, highest_limit = self.bounds(case)
        margin = highest_limit - case.signals.speed
        is_judged = judged_span(case).mask(np.arange(len(margin)), case.signals.num_frames)
        return at_frame(highest_limit, np.where(is_judged, margin, UNCONSTRAINED).argmin(axis=1))

    def margins_by_frame(self, case: Case) -> F64:
        """Highest limit that may hold minus speed, in each judged frame."""
        _, highest_limit = self.bounds(case)
        return margins_within_span(
            judged_span(case), _to_recorded_resolution(highest_limit) - case.signals.speed
        )


def keeps_limit(case: Case, limits: tuple[F32, F32]) -> Finding:
    """Compare the ego's speed with a limit in every judged frame.

    A speed between the two limits is undecidable; a speed above both is a breach.

    Args:
        case: The batch.
        limits: The lowest and the highest limit that may hold, each of shape (simulation, time)
            [m/s].
    """
    speed, span = case.signals.speed, judged_span(case)
    # A limit that is the same in all frames is a broadcast array, with stride 0 along time. One
    # number for each simulation is faster to compare.
    limits_by_simulation = (limit[:, 0] if limit.strides[1] == 0 else limit for limit in limits)
    lowest, highest = (_to_recorded_resolution(limit) for limit in limits_by_simulation)
    minimum, doubtful = minimum_to_limit(speed, highest, span, is_most=True), None
    if not np.array_equal(lowest, highest):
        doubtful = minimum_to_limit(speed, lowest, span, is_most=True).min_margin < 0
    return finding_from_margins(
        span.is_nonempty,
        minimum.min_margin,
        minimum.first_frame,
        minimum.last_frame,
        longest=minimum.longest_run,
        doubtful=doubtful,
    )


def _to_recorded_resolution(limits: F32) -> F32:
    """Limits that no speed exceeds by rounding alone, of the same shape [m/s]."""
    return limits + _HALF_SPEED_STEP


def _speed_error(finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of a margin that is a constant minus the ego's speed [m/s]."""
    return np.full_like(finding.margin, errors.speed_std)


@dataclass(frozen=True, slots=True, kw_only=True)
class MinimumSpeed(Criterion):
    """On a motorway, the ego is fast enough unless other traffic is slow.

    Frames in congestion, and frames in which the ego follows a slow leader, are no breach. Frames
    at a lawful speed keep their margin, also in congestion. The numbers from `stl-monitor` are
    from a published monitor of traffic rules.

    Attributes:
        min_speed: Lowest lawful speed.
        congestion_speed: Speed below which a vehicle counts as congested.
        congestion_min_vehicles: Smallest number of other congested vehicles that are a congestion.
        queue_time_gap: Time gap, at `min_speed`, within which a leader slower than `min_speed`
            holds the ego up.
    """

    min_speed: Quantity
    congestion_speed: Quantity = quantity(
        2.78, "m/s", "stl-monitor", why="10 km/h; slower vehicles count as congested there"
    )
    congestion_min_vehicles: Quantity = quantity(3.0, "vehicle", "stl-monitor")
    queue_time_gap: Quantity = quantity(
        3.0,
        "s",
        why="An ego that is nearer than this, at the lowest speed, to a slower leader cannot drive "
        "faster; the time gap of following in event_detection.toml",
    )
    unit: str = "m/s"
    applies_without_attempt: bool = True

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """The kind of the road: a slow ego may be on a motorway."""
        return frozenset(["road_kind"])

    def predicate(self) -> str:
        """The lowest lawful speed, and the traffic that excuses a lower speed."""
        return (
            f"At every frame on a motorway: speed >= {self.min_speed}, unless at least "
            f"{self.congestion_min_vehicles.bare()} others are slower than "
            f"{self.congestion_speed.in_unit('km/h')}, or the leader in the ego's lane is slower "
            f"than {self.min_speed} and no farther ahead than {self.queue_time_gap} at "
            f"{self.min_speed}. Frames above {self.min_speed} count in congestion too."
        )

    def check(self, case: Case) -> Finding:
        """The lowest speed in frames without slow traffic decides."""
        signals, is_road_known = case.signals, "road_kind" not in case.trajectories.unknown
        if is_road_known and case.trajectories.road.kind != "motorway":
            return finding_not_applicable(signals.num_simulations)
        # No `_HALF_SPEED_STEP` is needed: the only lowest speed of the laws here, 50 km/h, is
        # recorded as 13.889 m/s, which is not below it.
        span, min_speed = judged_span(case), self.min_speed.f32
        minimum = minimum_to_limit(signals.speed, min_speed, span, is_most=False)
        # The search for congestion is slow, so it is made only in frames below the lowest speed.
        slow_simulations = np.flatnonzero(span.is_nonempty & (minimum.min_margin < 0))
        margin = signals.speed[slow_simulations] - min_speed
        slow_spans = span.select(slow_simulations)
        is_judged = slow_spans.mask(np.arange(len(slow_simulations)), signals.num_frames)
        row, frame = np.nonzero(is_judged & (margin < 0))
        is_excused = self._is_in_slow_traffic(case, slow_simulations[row], frame)
        margin[row[is_excused], frame[is_excused]] = UNCONSTRAINED
        minimum_of_slow = minimum_over(margin, slow_spans)
        finding = finding_of_minimum(
            minimum.with_simulations(slow_simulations, minimum_of_slow), span
        )
        return finding if is_road_known else _with_breaches_undecidable(finding)

    def _is_in_slow_traffic(self, case: Case, simulation: IndexArray, frame: IndexArray) -> Mask:
        """Whether traffic is congested, or a slow leader is near, shape (instant,)."""
        num_congested = num_slow_vehicles(
            case.trajectories,
            simulation,
            frame,
            below=float(self.congestion_speed.f32),
            reach=_WHOLE_ROAD,
        )
        leader = encounters_at(case, NeighbourRole.LEADER, simulation, frame)
        leader_speed = case.signals.speed[simulation, frame] - leader.closing_speed
        is_near = leader.gap <= self.queue_time_gap.f32 * self.min_speed.f32
        is_behind_slow_leader = leader.valid & is_near & (leader_speed < self.min_speed.f32)
        return (num_congested >= self.congestion_min_vehicles.f32) | is_behind_slow_leader

    ERROR_FORMULA: ClassVar[str] = _SPEED_ERROR_FORMULA

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the speed [m/s]."""
        del case
        return _speed_error(finding, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The lowest lawful speed, in the frame that decided."""
        min_speed = self.min_speed.f32
        margins = breach.case.signals.speed[0, breach.frames] - min_speed
        return breach.remedy_ego_speed(breach.frame_of_margin(margins), min_speed)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedInFog(Criterion):
    """In fog or rain that hides the road, the ego is slow enough.

    Attributes:
        max_range: Meteorological optical range below which the duty holds.
        max_speed: Highest lawful speed in this range.
    """

    max_range: Quantity
    max_speed: Quantity
    unit: str = "m/s"
    applies_without_attempt: bool = True

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """The weather: a fast ego may drive in fog."""
        return frozenset(["weather"])

    def predicate(self) -> str:
        """The meteorological range and the speed."""
        return (
            "At every frame, the meteorological optical range being under "
            f"{self.max_range}: speed <= {self.max_speed}."
        )

    def check(self, case: Case) -> Finding:
        """The highest speed decides, if the range is short."""
        is_weather_unknown = "weather" in case.trajectories.unknown
        has_short_range = meteorological_range(case) < self.max_range.f32
        applies = has_short_range | is_weather_unknown
        # A choice: without `_HALF_SPEED_STEP`, so 50 km/h, recorded as 13.889 m/s, is a breach of
        # 50 km/h.
        margin = self.max_speed.f32 - case.signals.speed
        finding = finding_over_span(
            np.where(applies[:, None], margin, UNCONSTRAINED), judged_span(case)
        )
        return _with_breaches_undecidable(finding) if is_weather_unknown else finding

    ERROR_FORMULA: ClassVar[str] = _SPEED_ERROR_FORMULA

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the speed [m/s]."""
        del case
        return _speed_error(finding, errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The highest lawful speed, in the frame in which the ego was fastest."""
        fastest = breach.frames[int(breach.case.signals.speed[0, breach.frames].argmax())]
        return breach.remedy_ego_speed(fastest, self.max_speed.f32)


def _with_breaches_undecidable(finding: Finding) -> Finding:
    """Make each breach undecidable: an unknown input may exempt the simulation from the duty."""
    is_breach = finding.margin < 0
    # `finding_from_margins` calls a negative margin a breach even where it is doubtful.
    margin = np.where(is_breach, np.float32(0.0), finding.margin)
    applies = finding.verdict != Verdict.NOT_APPLICABLE
    return finding_from_margins(
        applies, margin, finding.first_frame, finding.last_frame, doubtful=is_breach
    )
