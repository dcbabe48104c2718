"""Rules about the ego's speed: L12 and L13, and the highest speeds of Article 27."""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32, U8, IndexArray, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import class_of, conduct, has_changing_limit, limit_table, limits_of
from overtaking.labels.law.margins import (
    ENDLESS,
    decided,
    inapplicable,
    limited,
    never_negative,
    reduced,
    stretch,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, standard_error
from overtaking.labels.law.numbers import amount, bare
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.signals import encounter
from overtaking.labels.snapshots import at, num_slow
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding, Severity, Verdict


def _of_speed(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the ego's speed."""
    del case
    return np.full_like(found.margin, errors.speed_std)


OF_SPEED = Spread(formula="sv", of=_of_speed)

_ROUNDING = np.float32(5e-4)
"""Half of the step in which speeds are recorded: 25 m/s must not be more than 90 km/h [m/s]."""

_ANYWHERE = 1e6
"""Metres; congestion is judged by all that were recorded."""

Limits = Callable[..., tuple[F32, F32]]
"""The limits of a law: a function like `speed_limits`."""


def speed_limits(case: Case, ahead: float = 0.0) -> tuple[F32, F32]:
    """`limits_of` by Article 27."""
    return limits_of(case, limit_table("law"), ahead)


WITHIN_LIMIT = (
    "At every frame: speed <= min(limit posted where the ego's centre is, limit of the class on "
    "this kind of road). No tolerance."
)

_MINIMUM = amount("law.minimum.speed")


def _within_limit(case: Case) -> Finding:
    """Speed never exceeds the posted limit and that of the class of vehicle on this road."""
    found = keeps_limit(case, speed_limits(case))
    return found.replace(severity=_severity(case, found))


def keeps_limit(case: Case, limits: tuple[F32, F32]) -> Finding:
    """Speed never exceeds a limit; in doubt between the lowest and the highest that may hold.

    Args:
        case: The batch.
        limits: The lowest and the highest, both of shape (simulation, time) [m/s].
    """
    speed, span = case.signals.speed, conduct(case)
    # What is the same in all frames is broadcast; one number for each simulation is faster.
    short = (each[:, 0] if each.strides[1] == 0 else each for each in limits)
    least, most = (rounded(each) for each in short)
    found, doubtful = limited(speed, most, span, is_most=True), None
    if not np.array_equal(least, most):
        doubtful = limited(speed, least, span, is_most=True).low < 0
    ends = found.first, found.last
    return decided(span.exists, found.low, *ends, longest=found.longest, doubtful=doubtful)


def rounded(limits: F32) -> F32:
    """Limits with the rounding of recorded speeds allowed for, of the same shape [m/s]."""
    return limits + _ROUNDING


def limit_spread(limits: Limits) -> Spread:
    """Of a speed, and of a position where another limit is near, under the limits of a law."""

    def of(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
        if not has_changing_limit(case.trajectories) or "speed_limit" in case.trajectories.unknown:
            return OF_SPEED.of(case, found, errors)
        speed, span = case.signals.speed, conduct(case)

        def moved(ahead: np.float32, faster: np.float32) -> F32:
            most = limits(case, float(ahead))[1]
            return reduced(np.minimum, most - (speed + faster), span)

        return standard_error(moved, errors.position_std, errors.speed_std)

    formula = "sv, and by sp the difference between two limits where both are that near"
    return Spread(formula=formula, of=of)


def decisive_limit(case: Case, limits: tuple[F32, F32]) -> F32:
    """The highest limit that may hold where it is exceeded most, shape (simulation,) [m/s].

    Args:
        case: The batch.
        limits: As for `keeps_limit`.
    """
    margin = limits[1] - case.signals.speed
    within = conduct(case).mask(np.arange(len(margin)), case.signals.num_frames)
    return at(limits[1], np.where(within, margin, ENDLESS).argmin(axis=1))


def _severity(case: Case, found: Finding) -> U8:
    """By the excess: light, serious, or very serious."""
    light = class_of(case.trajectories.scenario.vehicles.kind[:, EGO_SLOT]) < 2
    severity = np.full(len(light), Severity.LIGHT, np.uint8)
    for grade in ("serious", "very_serious"):
        of_light, of_other = (
            constant(f"law.excess.light_{grade}"),
            constant(f"law.excess.other_{grade}"),
        )
        severity += (-found.margin > np.where(light, of_light, of_other)).astype(np.uint8)
    return np.where(found.verdict == Verdict.ILLEGAL, severity, np.uint8(Severity.NONE))


L12 = Rule(
    id="pt.ce.27@2013",
    code="L12",
    law="Article 27",
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
    partly=frozenset(["speed_limit", "kinds", "road_kind"]),
    without_attempt=True,
    check=_within_limit,
    spread=limit_spread(speed_limits),
    limit=lambda case: decisive_limit(case, speed_limits(case)),
)


def _above_minimum(case: Case) -> Finding:
    """On a motorway speed is at least 50 km/h, unless others are in the way or stand or crawl."""
    seen, road_known = case.signals, "road_kind" not in case.trajectories.unknown
    if road_known and case.trajectories.road.kind != "motorway":
        return inapplicable(seen.num_simulations)
    span, least = conduct(case), constant("law.minimum.speed")
    low = limited(seen.speed, least, span, is_most=False)
    slow = np.flatnonzero(span.exists & (low.low < 0))
    margin, slow_spans = seen.speed[slow] - least, span.at_rows(slow)
    row, frames = np.nonzero(slow_spans.mask(np.arange(len(slow)), seen.num_frames) & (margin < 0))
    held = _is_held_up(case, slow[row], frames)
    margin[row[held], frames[held]] = ENDLESS
    checked = never_negative(low.with_rows(slow, stretch(margin, slow_spans)), span)
    return checked if road_known else perhaps(checked)


def _is_held_up(case: Case, rows: IndexArray, frames: IndexArray) -> Mask:
    """Whether at single frames traffic is congested, or a slow leader has to be followed."""
    crawl = float(constant("law.minimum.congestion_speed"))
    crawling = num_slow(case, rows, frames, below=crawl, reach=_ANYWHERE)
    least = constant("law.minimum.speed")
    ahead = encounter(case, NeighbourRole.LEADER, rows, frames)
    leader_speed = case.signals.speed[rows, frames] - ahead.closing_speed
    near = ahead.gap <= constant("law.minimum.queue_time_gap") * least
    congested = crawling >= constant("law.minimum.congestion_vehicles")
    return congested | (ahead.valid & near & (leader_speed < least))


def perhaps(found: Finding) -> Finding:
    """The same where what it is about may not be so: a breach is then in doubt."""
    slow = found.margin < 0
    margin = np.where(slow, np.float32(0.0), found.margin)
    applies = found.verdict != Verdict.NOT_APPLICABLE
    return decided(applies, margin, found.first_frame, found.last_frame, doubtful=slow)


L13 = Rule(
    id="pt.ce.27-6@2013",
    code="L13",
    law="Article 27(6)",
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
    partly=frozenset(["road_kind"]),
    without_attempt=True,
    check=_above_minimum,
    spread=OF_SPEED,
)
