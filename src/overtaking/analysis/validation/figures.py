"""The figures of a profile: how each is computed, and values with interval, target and verdict.

The entry of the same name in `validation.toml` says what a figure is, its unit, its limits with
their sources, and its standing. The sums that a statistic reads are added in `traffic` and
`overtakes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.stats.weighted_statistics import wilson_interval
from overtaking.analysis.validation import overtakes, passes
from overtaking.analysis.validation.accidents import Severity
from overtaking.analysis.validation.changes import (
    CHANGE_WIDTH,
    HEADWAY_WIDTH,
    PEAK_WIDTH,
    SPACE_WIDTH,
)
from overtaking.analysis.validation.poisson import poisson_limits
from overtaking.analysis.validation.tally import Tally, quantile, ratio
from overtaking.analysis.validation.targets import FigureTarget, TargetRole, targets
from overtaking.analysis.validation.traffic import ACCEL_WIDTH, GAP_WIDTH, limit
from overtaking.core.equality import ContentEquality
from overtaking.core.representation import json_values
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from overtaking.core.arrays import F64

Statistic = Callable[[Tally], float]
"""A number computed from a tally."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure(ContentEquality):
    """One figure of a profile.

    Attributes:
        name: Its name, as in `validation.toml`.
        title: Its description.
        standing: Statement about the drivers that a value within the limits supports.
        unit: Unit of all its numbers; empty for a share or a count.
        value: The number; NaN if the count is empty.
        low: Lower limit of its 95 % confidence interval, at least 0 unless it may be negative.
        high: Upper limit.
        target_low: Lower limit of the target, None if it is open.
        target_high: Upper limit of the target, None if it is open.
        source: Source of the target; empty without one.
        needs_km: Vehicle-km that a verdict needs, if fewer were driven; else 0.
    """

    name: str
    title: str
    standing: TargetRole
    unit: str
    value: float
    low: float
    high: float
    target_low: float | None = None
    target_high: float | None = None
    source: str = ""
    needs_km: float = 0.0

    @property
    def has_target(self) -> bool:
        """Whether there is a target to hold the value against."""
        return self.target_low is not None or self.target_high is not None

    @property
    def met(self) -> bool | None:
        """Whether the value lies within the target; None without a target, or if not measured."""
        if self.needs_km or math.isnan(self.value) or not self.has_target:
            return None
        above = self.target_low is None or self.value >= self.target_low
        return above and (self.target_high is None or self.value <= self.target_high)

    @property
    def is_sure(self) -> bool:
        """Whether both ends of the interval lie on the same sides of the target."""
        ends = (self.low, self.high)
        lows = {self.target_low is None or end >= self.target_low for end in ends}
        highs = {self.target_high is None or end <= self.target_high for end in ends}
        return len(lows) == len(highs) == 1

    def values(self) -> dict[str, Any]:
        """The figure for JSON."""
        return json_values(self) | {"met": self.met, "sure": self.is_sure}


@dataclass(frozen=True, slots=True)
class Definition:
    """How a figure is computed; `validation.toml` has its description, unit and limits.

    Attributes:
        name: Its name, as in `validation.toml`.
        statistic: The number, from a tally.
        counts: The sum in the tally that must not be empty for two profiles to be compared in it;
            empty for a figure that is not a property of the traffic.
        events: The sum of rare events whose rate it is, with their squares under `_squares`.
            Empty for all others.
        among: The sum of few events of which it is a share, with their squares under `_squares`.
            Empty for all others.
        of: Section of `validation.toml`.
        is_signed: Whether it may be negative.
    """

    name: str
    statistic: Statistic
    counts: str = ""
    events: str = ""
    among: str = ""
    of: str = "figures"
    is_signed: bool = False

    @property
    def target(self) -> FigureTarget:
        """Its description, unit, limits and standing."""
        return targets(self.of)[self.name]

    def measured(self, tally: Tally) -> Figure:
        """The figure of a tally, with its interval, target and standing."""
        target = self.target
        estimate = self._estimate(tally)
        value, low, high = (float(target.scale * number) for number in estimate)
        least = target.min_distance.number if target.min_distance else 0.0
        lacks = tally.total("metres").sum() < least
        return Figure(
            name=self.name,
            title=target.description,
            standing=target.standing,
            unit=target.unit,
            value=value,
            low=low if math.isnan(low) or self.is_signed else max(low, 0.0),
            high=high,
            target_low=target.low and target.scale * target.low.number,
            target_high=target.high and target.scale * target.high.number,
            source=target.source,
            needs_km=1e-3 * least if lacks else 0.0,
        )

    def _estimate(self, tally: Tally) -> tuple[float, float, float]:
        if self.events:
            return self._rare(tally)
        return self._of_few(tally) if self.among else tally.estimate(self.statistic)

    def _of_few(self, tally: Tally) -> tuple[float, float, float]:
        """A share with the wider limits of two: Wilson's of the effective number, the jackknife's.

        Where all events are alike, the jackknife knows no doubt.
        """
        total, squares = (tally.total(f"{self.among}{end}").sum() for end in ("", "_squares"))
        if not squares > 0.0:
            return math.nan, math.nan, math.nan
        share, least, most = tally.estimate(self.statistic)
        low, high = wilson_interval(share, float(total * total / squares))
        return share, np.fmin(low, least), min(np.fmax(high, most), 1.0)

    def _rare(self, tally: Tally) -> tuple[float, float, float]:
        """The rate with the wider limits of two: a Poisson count's and the jackknife's.

        Events of one simulation may depend on each other; of few events the jackknife says nothing.
        """
        total, squares = (tally.total(f"{self.events}{end}").sum() for end in ("", "_squares"))
        weight = squares / total if total > 0.0 else 1.0
        low, high = poisson_limits(total / weight)
        exposure = tally.total("metres").sum()
        if not exposure > 0.0:
            return math.nan, math.nan, math.nan
        rate, least, most = tally.estimate(self.statistic)
        return rate, min(weight * low / exposure, least), max(weight * high / exposure, most)


def _share(part: str, whole: str) -> Statistic:
    return lambda tally: ratio(tally.total(part), tally.total(whole))


def _rate(events: str, counts: str = "") -> Definition:
    """The rate of rare events by distance, whose figure has the name of their sum."""
    return Definition(events, _share(events, "metres"), counts, events)


def _mean(name: str, width: float) -> Statistic:
    """The mean of a histogram."""

    def mean(tally: Tally) -> float:
        histogram = tally.total(name)
        return ratio(histogram * width * np.arange(len(histogram)), histogram)

    return mean


def _median(name: str, width: float) -> Statistic:
    """The median of a histogram."""
    return lambda tally: quantile(tally.total(name), 0.5, width)


def _spread_of_durations(tally: Tally) -> float:
    """Standard deviation of the durations."""
    histogram = tally.total("durations")
    times = CHANGE_WIDTH * np.arange(len(histogram))
    mean = ratio(histogram * times, histogram)
    return math.sqrt(ratio(histogram * (times - mean) ** 2, histogram))


def _near_crashes_per_accident(tally: Tally) -> float:
    return ratio(tally.total("near_crashes"), tally.total("accidents"))


def _distance_from_lognormal(tally: Tally) -> float:
    """Largest distance of the distribution of durations from the fitted lognormal."""
    histogram: F64 = tally.total("durations")
    total = histogram.sum()
    if not total > 0.0:
        return float("nan")
    times = np.maximum(CHANGE_WIDTH * np.arange(len(histogram)), 0.5 * CHANGE_WIDTH)
    logs = np.log(times)
    mean = float((histogram * logs).sum() / total)
    sigma = math.sqrt(float((histogram * (logs - mean) ** 2).sum() / total))
    below = np.cumsum(histogram) / total
    edges = np.log(times + 0.5 * CHANGE_WIDTH)
    normal = [0.5 * (1.0 + math.erf((x - mean) / (sigma * math.sqrt(2.0)))) for x in edges]
    return float(np.abs(below - np.array(normal)).max())


def _effective_share(tally: Tally) -> float:
    """Effective number of simulations over their number (Kish 1965)."""
    weights, squares = tally.total("simulations").sum(), tally.total("squares").sum()
    number = tally.total("number").sum()
    return float(weights * weights / (squares * number)) if number else float("nan")


RATE = Definition("lane_changes_per_km", _share("changes", "changed_metres"))
"""Measured on rings where there are some, because the published rates are of steady traffic."""

OWN_RATE = Definition("own_lane_changes_per_km", RATE.statistic, "changes")
"""Shown beside a rate that was measured on rings."""

DEFINITIONS = (
    OWN_RATE,
    Definition("lane_change_duration", _mean("durations", CHANGE_WIDTH), "durations"),
    Definition("lane_change_spread", _spread_of_durations),
    Definition("lane_change_lognormal", _distance_from_lognormal),
    Definition("lane_change_crossing", _mean("crossings", CHANGE_WIDTH), "crossings"),
    Definition("lane_change_settled", _mean("settlings", CHANGE_WIDTH), "settlings"),
    Definition("peak_lateral_speed", _median("peaks", PEAK_WIDTH), "peaks"),
    Definition("undone", _share("undone", "watched"), "undone"),
    Definition("retreats", _share("given_up", "begun"), "given_up"),
    Definition("start_gap", _median("start_gaps", SPACE_WIDTH), "start_gaps"),
    Definition("start_headway", _median("start_headways", HEADWAY_WIDTH), "start_headways"),
    Definition("return_gap", _median("return_gaps", SPACE_WIDTH), "return_gaps"),
    Definition("return_headway", _median("return_headways", HEADWAY_WIDTH), "return_headways"),
    Definition("gap_time", _median("gap_times", GAP_WIDTH), "gap_times"),
    Definition("short_ttc", _share("critical", "behind"), "critical"),
    Definition("passing_speed", _share("passing_speed", "passing"), "passing"),
    Definition("left_lane_time", _share("left_time", "car_time"), "left_time"),
    Definition("night_share", _share("night_metres", "metres"), "night_metres"),
    Definition(
        "lateral_accel",
        lambda tally: quantile(tally.total("lateral"), 0.95, ACCEL_WIDTH),
        "lateral",
    ),
    Definition("usual_accel", _share("usual", "calm"), "usual"),
    Definition("impossible_accel", _share("impossible", "simulations")),
    _rate("hard_braking", "hard_braking"),
    _rate("very_hard_braking"),
    _rate("near_crashes"),
    _rate("accidents", "accidents"),
    *(_rate(f"accidents_{one.name.lower()}") for one in Severity),
    Definition("impact_speed", _share("impact_speed", "impacts")),
    Definition("near_crashes_per_accident", _near_crashes_per_accident),
    Definition("flying_share", _share("flying", "overtakes"), "flying"),
    Definition("open_at_end", _share("open", "attempts"), "open"),
    Definition("effective_share", _effective_share),
    Definition("edges", _share("edges", "frames")),
    Definition("attempts", _share("attempts", "simulations"), "attempts"),
)
"""The figures, in the order in which they are shown."""


def _pass(
    name: str,
    statistic: Statistic,
    counts: str = "",
    *,
    among: str = "",
    is_signed: bool = False,
) -> Definition:
    return Definition(name, statistic, counts, among=among, of="passes", is_signed=is_signed)


def _of_passes(name: str) -> Statistic:
    return lambda tally: passes.mean_of(tally, name)


def _difference(name: str, other: str) -> Statistic:
    return lambda tally: passes.mean_of(tally, name) - passes.mean_of(tally, other)


def _spread_of_passes(tally: Tally) -> float:
    mean = passes.mean_of(tally, "duration")
    return math.sqrt(max(passes.mean_of(tally, "duration_squared") - mean * mean, 0.0))


def _legal_share(tally: Tally) -> float:
    classes = tally.total("classes")
    if len(classes) == 1:
        return math.nan
    legal, illegal = (
        classes[overtakes.cell(0, one)]
        for one in (OvertakeClass.SUCCESS_L, OvertakeClass.SUCCESS_I)
    )
    return ratio(legal, legal + illegal)


PASSES = (
    _pass("time_in_other_lane", _of_passes("duration"), "duration"),
    _pass("time_spread", _spread_of_passes, "duration"),
    _pass("time_past_slow", _of_passes("duration_slow"), "duration_slow"),
    _pass("time_past_fast", _of_passes("duration_fast"), "duration_fast"),
    _pass("margin_unsafe", _of_passes("unsafe"), "unsafe"),
    _pass("margin_scarce", _of_passes("scarce"), "scarce"),
    _pass("aborted", _share("aborted", "attempts"), "aborted"),
    _pass("surplus", _of_passes("surplus"), "surplus"),
    _pass("way_past_truck", _of_passes("way_truck"), "way_truck"),
    _pass("way_saved", _difference("way_truck", "way_car"), "way_car", is_signed=True),
    _pass("safe_gap", passes.safe_gap, "offers_unsafe"),
    _pass("no_return", _of_passes("no_return"), "no_return"),
    _pass("critical_gap", passes.critical_gap, "refused"),
    _pass(
        "fast_oncomer",
        lambda tally: limit("fast_oncomer") * passes.slope(tally.total("fast_sums"), 2),
        is_signed=True,
    ),
    _pass("small_oncomer", passes.favour_of_small, is_signed=True),
    _pass("zone_length", lambda tally: passes.slope(tally.total("zone_sums"), 1), is_signed=True),
    _pass("equal_split", passes.cost_of_equal_split, is_signed=True),
    _pass("squeezed", _difference("left_pressed", "left_calm"), is_signed=True),
    _pass("over_limit", _of_passes("too_fast"), "too_fast"),
    _pass("legal", _legal_share),
    _pass("collided", _share("collided", "attempts"), "collided", among="attempts"),
    _pass("attempts", _share("attempts", "simulations"), "attempts"),
    _pass("others_per_hour", _share("others_attempts", "others_seconds"), "others_attempts"),
    _pass("others_aborted", _share("others_aborted", "others_attempts"), "others_aborted"),
    _pass("others_time", _of_passes("others_time"), "others_time"),
    _pass("others_unsafe", _of_passes("others_unsafe"), "others_unsafe"),
    _pass("others_scarce", _of_passes("others_scarce"), "others_scarce"),
    _pass("open_at_end", _share("open", "attempts"), "open"),
    _pass("effective_share", _effective_share),
)
"""The figures of passes on two-way roads, in the order in which they are shown."""

HEAD_ON = _pass("head_on_share", _share("head_on", "hard"), among="hard")
"""Of profiles with a proposal alone: head-on collisions are too rare to be met by running."""


def figures(open_road: Tally, ring: Tally | None) -> list[Figure]:
    """All figures.

    Args:
        open_road: The tally of the profile's simulations.
        ring: The tally of the rings; None if the profile cannot be put on one. Then the rate of
            lane changes of the open road is compared with the target.
    """
    if ring is None:
        return [one.measured(open_road) for one in (RATE, *DEFINITIONS) if one is not OWN_RATE]
    rate = RATE.measured(ring)
    title = f"{rate.title}, steady at 15 to 25 vehicles/km/lane"
    return [replace(rate, title=title), *(one.measured(open_road) for one in DEFINITIONS)]


def figures_of_passes(tally: Tally, *, is_enriched: bool) -> list[Figure]:
    """All figures of a two-way road.

    Args:
        tally: The tally of the profile's simulations.
        is_enriched: Whether the profile has a proposal.
    """
    shown = (*PASSES, HEAD_ON) if is_enriched else PASSES
    return [one.measured(tally) for one in shown]
