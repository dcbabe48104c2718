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

from overtaking.analysis.validation.tally import Tally, quantile, ratio
from overtaking.analysis.validation.traffic import ACCEL_WIDTH, CHANGE_WIDTH, GAP_WIDTH
from overtaking.core.plain import plain
from overtaking.knowledge.validation import Standing, Target, targets

if TYPE_CHECKING:
    from overtaking.core.elementary import F64

Statistic = Callable[[Tally], float]
"""A number computed from a tally."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure of a profile.

    Attributes:
        name: Its name, as in `validation.toml`.
        title: Its description.
        standing: What a value within the limits says of the drivers.
        unit: Unit of all its numbers; empty for a share or a count.
        value: The number; NaN if nothing was counted.
        low: Lower limit of its 95 % confidence interval, at least 0.
        high: Upper limit.
        target_low: Lower limit of the target, None if it is open.
        target_high: Upper limit of the target, None if it is open.
        source: Source of the target; empty without one.
    """

    name: str
    title: str
    standing: Standing
    unit: str
    value: float
    low: float
    high: float
    target_low: float | None = None
    target_high: float | None = None
    source: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the value lies within the target; None without a target."""
        if self.target_low is None and self.target_high is None:
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
        return plain(self) | {"met": self.met, "sure": self.is_sure}


@dataclass(frozen=True, slots=True)
class Definition:
    """How a figure is computed; `validation.toml` has its description, unit and limits.

    Attributes:
        name: Its name, as in `validation.toml`.
        statistic: The number, from a tally.
        counts: The sum in the tally that must not be empty for two profiles to be compared in it;
            empty for a figure that is not a property of the traffic.
    """

    name: str
    statistic: Statistic
    counts: str = ""

    @property
    def target(self) -> Target:
        """Its description, unit, limits and standing."""
        return targets()[self.name]

    def measured(self, tally: Tally) -> Figure:
        """The figure of a tally, with its interval, target and standing."""
        target = self.target
        value, low, high = (
            float(target.scale * number) for number in tally.estimate(self.statistic)
        )
        return Figure(
            name=self.name,
            title=target.what,
            standing=target.standing,
            unit=target.unit,
            value=value,
            low=low if math.isnan(low) else max(low, 0.0),
            high=high,
            target_low=target.low and target.scale * target.low.number,
            target_high=target.high and target.scale * target.high.number,
            source=target.source,
        )


def _share(part: str, whole: str) -> Statistic:
    return lambda tally: ratio(tally.total(part), tally.total(whole))


def _mean_duration(tally: Tally) -> float:
    histogram = tally.total("durations")
    return ratio(histogram * CHANGE_WIDTH * np.arange(len(histogram)), histogram)


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


RATE = Definition("lane_changes_per_km", _share("changes", "metres"))
"""Measured on rings where there are some, because the published rates are of steady traffic."""

OWN_RATE = Definition("own_lane_changes_per_km", RATE.statistic, "changes")
"""Shown beside a rate that was measured on rings."""

DEFINITIONS = (
    OWN_RATE,
    Definition("lane_change_duration", _mean_duration, "durations"),
    Definition("lane_change_lognormal", _distance_from_lognormal),
    Definition(
        "gap_time", lambda tally: quantile(tally.total("gap_times"), 0.5, GAP_WIDTH), "gap_times"
    ),
    Definition("short_ttc", _share("critical", "behind"), "critical"),
    Definition("passing_speed", _share("passing_speed", "passing"), "passing"),
    Definition(
        "lateral_accel",
        lambda tally: quantile(tally.total("lateral"), 0.95, ACCEL_WIDTH),
        "lateral",
    ),
    Definition("usual_accel", _share("usual", "calm"), "usual"),
    Definition("impossible_accel", _share("impossible", "simulations")),
    Definition("flying_share", _share("flying", "overtakes"), "flying"),
    Definition("open_at_end", _share("open", "attempts"), "open"),
    Definition("effective_share", _effective_share),
    Definition("contacts", _share("contacts", "metres"), "contacts"),
    Definition("edges", _share("edges", "frames")),
    Definition("attempts", _share("attempts", "simulations"), "attempts"),
)
"""The figures, in the order in which they are shown."""


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
