"""Rules about the ego's speed: L12 and L13, and the highest speeds of Article 27."""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32, U8, IndexArray, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    general_limits,
    has_changing_limit,
    judged_span,
    limit_class,
    speed_limit_bounds,
)
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    finding_from_margins,
    finding_not_applicable,
    finding_of_minimum,
    minimum_over,
    minimum_to_limit,
    reduce_span,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, propagated_error
from overtaking.labels.law.numbers import amount, bare
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import at_frame, num_slow_vehicles
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding, Severity, Verdict


def _of_speed(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the ego's speed."""
    del case
    return np.full_like(finding.margin, errors.speed_std)


OF_SPEED = Spread(formula="sv", standard_error=_of_speed)

_ROUNDING = np.float32(5e-4)
"""Half of the step in which speeds are recorded: 25 m/s must not be more than 90 km/h [m/s]."""

_ANYWHERE = 1e6
"""Metres; congestion is judged by all that were recorded."""

Limits = Callable[..., tuple[F32, F32]]
"""The limits of a law: a function like `speed_limits`."""


def speed_limits(case: Case, ahead: float = 0.0) -> tuple[F32, F32]:
    """`speed_limit_bounds` by Article 27."""
    return speed_limit_bounds(case, general_limits("law"), ahead)


WITHIN_LIMIT = (
    "At every frame: speed <= min(limit posted where the ego's centre is, limit of the class on "
    "this kind of road). No tolerance."
)

_MINIMUM = amount("law.minimum.speed")


def _within_limit(case: Case) -> Finding:
    """Speed never exceeds the posted limit, nor the limit of the class of vehicle on this road."""
    finding = keeps_limit(case, speed_limits(case))
    return finding.replace(severity=_severity(case, finding))


def keeps_limit(case: Case, limits: tuple[F32, F32]) -> Finding:
    """Speed never exceeds a limit; in doubt between the lowest and the highest that may hold.

    Args:
        case: The batch.
        limits: The lowest and the highest, both of shape (simulation, time) [m/s].
    """
    speed, span = case.signals.speed, judged_span(case)
    # A limit that is the same in all frames is a broadcast array. One number for each simulation
    # is faster to compare.
    short = (limit[:, 0] if limit.strides[1] == 0 else limit for limit in limits)
    least, highest_limit = (to_recorded_resolution(limit) for limit in short)
    minimum, doubtful = minimum_to_limit(speed, highest_limit, span, is_most=True), None
    if not np.array_equal(least, highest_limit):
        doubtful = minimum_to_limit(speed, least, span, is_most=True).min_margin < 0
    ends = minimum.first_frame, minimum.last_frame
    return finding_from_margins(
        span.is_nonempty, minimum.min_margin, *ends, longest=minimum.longest_run, doubtful=doubtful
    )


def to_recorded_resolution(limits: F32) -> F32:
    """Limits with the rounding of recorded speeds allowed for, of the same shape [m/s]."""
    return limits + _ROUNDING


def limit_error(limits: Limits) -> Spread:
    """Of a speed, and of a position where another limit is near, under the limits of a law."""

    def standard_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        if not has_changing_limit(case.trajectories) or "speed_limit" in case.trajectories.unknown:
            return OF_SPEED.standard_error(case, finding, errors)
        speed, span = case.signals.speed, judged_span(case)

        def margin_with(ahead: np.float32, faster: np.float32) -> F32:
            limit = limits(case, float(ahead))[1]
            return reduce_span(np.minimum, limit - (speed + faster), span)

        return propagated_error(margin_with, errors.position_std, errors.speed_std)

    formula = "sv, and by sp the difference between two limits where both are that near"
    return Spread(formula=formula, standard_error=standard_error)


def limit_at_worst_frame(case: Case, limits: tuple[F32, F32]) -> F32:
    """The highest limit that may hold where it is exceeded most, shape (simulation,) [m/s].

    Args:
        case: The batch.
        limits: As for `keeps_limit`.
    """
    margin = limits[1] - case.signals.speed
    span = judged_span(case).mask(np.arange(len(margin)), case.signals.num_frames)
    return at_frame(limits[1], np.where(span, margin, UNCONSTRAINED).argmin(axis=1))


def _severity(case: Case, finding: Finding) -> U8:
    """By the excess: light, serious, or very serious."""
    light = limit_class(case.trajectories.scenario.vehicles.kind[:, EGO_SLOT]) < 2
    severity = np.full(len(light), Severity.LIGHT, np.uint8)
    for grade in ("serious", "very_serious"):
        of_light, severity_elsewhere = (
            constant(f"law.excess.light_{grade}"),
            constant(f"law.excess.other_{grade}"),
        )
        severity += (-finding.margin > np.where(light, of_light, severity_elsewhere)).astype(
            np.uint8
        )
    return np.where(finding.verdict == Verdict.ILLEGAL, severity, np.uint8(Severity.NONE))


L12 = Rule(
    id="pt.ce.27@2013",
    code="L12",
    article="Article 27",
    title="Speed limit",
    gloss="Keep to the limit that is posted and to the general limit of road and vehicle: on "
    f"motorways {amount('law.limits.motorway.light')} for light vehicles, "
    f"{bare('law.limits.motorway.van')} for vans, {bare('law.limits.motorway.heavy')} for heavy "
    "goods vehicles.",
    predicate=(
        f"{WITHIN_LIMIT} Severe by excess: over {amount('law.excess.light_serious')} serious, over "
        f"{bare('law.excess.light_very_serious')} very serious; heavy vehicles over "
        f"{bare('law.excess.other_serious')} and {bare('law.excess.other_very_serious')}."
    ),
    unit="m/s",
    grade=Grade.BY_BREACH,
    conditional_inputs=frozenset(["speed_limit", "kinds", "road_kind"]),
    applies_without_attempt=True,
    check=_within_limit,
    spread=limit_error(speed_limits),
    limit=lambda case: limit_at_worst_frame(case, speed_limits(case)),
)


def _above_minimum(case: Case) -> Finding:
    """On a motorway speed is at least 50 km/h, unless others are in the way or stand or crawl."""
    signals, road_known = case.signals, "road_kind" not in case.trajectories.unknown
    if road_known and case.trajectories.road.kind != "motorway":
        return finding_not_applicable(signals.num_simulations)
    span, least = judged_span(case), constant("law.minimum.speed")
    low = minimum_to_limit(signals.speed, least, span, is_most=False)
    slow = np.flatnonzero(span.is_nonempty & (low.min_margin < 0))
    margin, slow_spans = signals.speed[slow] - least, span.select(slow)
    row, frames = np.nonzero(
        slow_spans.mask(np.arange(len(slow)), signals.num_frames) & (margin < 0)
    )
    held = _may_be_slow(case, slow[row], frames)
    margin[row[held], frames[held]] = UNCONSTRAINED
    checked = finding_of_minimum(low.with_simulations(slow, minimum_over(margin, slow_spans)), span)
    return checked if road_known else with_breaches_undecidable(checked)


def _may_be_slow(case: Case, rows: IndexArray, frames: IndexArray) -> Mask:
    """Whether at single frames traffic is congested, or a slow leader has to be followed."""
    crawl = float(constant("law.minimum.congestion_speed"))
    crawling = num_slow_vehicles(case.trajectories, rows, frames, below=crawl, reach=_ANYWHERE)
    least = constant("law.minimum.speed")
    ahead = encounters_at(case, NeighbourRole.LEADER, rows, frames)
    leader_speed = case.signals.speed[rows, frames] - ahead.closing_speed
    near = ahead.gap <= constant("law.minimum.queue_time_gap") * least
    congested = crawling >= constant("law.minimum.congestion_vehicles")
    return congested | (ahead.valid & near & (leader_speed < least))


def with_breaches_undecidable(finding: Finding) -> Finding:
    """The same where what it is about may not be so: a breach is then in doubt."""
    slow = finding.margin < 0
    margin = np.where(slow, np.float32(0.0), finding.margin)
    applies = finding.verdict != Verdict.NOT_APPLICABLE
    return finding_from_margins(
        applies, margin, finding.first_frame, finding.last_frame, doubtful=slow
    )


L13 = Rule(
    id="pt.ce.27-6@2013",
    code="L13",
    article="Article 27(6)",
    title="Lowest speed",
    gloss=f"On motorways do not drive slower than {_MINIMUM}.",
    predicate=(
        f"At every frame on a motorway: speed >= {_MINIMUM}, unless at least "
        f"{bare('law.minimum.congestion_vehicles')} others are slower than "
        f"{amount('law.minimum.congestion_speed', unit='km/h')}, or the leader in the ego's lane "
        f"is slower than {_MINIMUM} and no farther ahead than "
        f"{amount('law.minimum.queue_time_gap')} at {_MINIMUM}. Frames above {_MINIMUM} count in "
        "congestion too."
    ),
    unit="m/s",
    grade=Grade.LIGHT,
    conditional_inputs=frozenset(["road_kind"]),
    applies_without_attempt=True,
    check=_above_minimum,
    spread=OF_SPEED,
)
