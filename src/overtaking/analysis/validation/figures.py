"""The figures of a profile: declarations, and values with interval, target and verdict.

A figure is declared once, in `DEFINITIONS`. Its target, with limits and source, is the entry of the
same name in `validation.toml`; the sums that its statistic reads are added in `traffic` and
`overtakes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from overtaking.analysis.validation.tally import F64, Tally, quantile, ratio
from overtaking.analysis.validation.traffic import ACCEL_WIDTH, CHANGE_WIDTH, GAP_WIDTH
from overtaking.core.plain import plain
from overtaking.core.units import kmh_from_mps
from overtaking.knowledge import Quantity, quantities

Statistic = Callable[[Tally], float]
"""A number computed from a tally."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure of a profile.

    Attributes:
        name: Its name, as in `validation.toml` where it has a target.
        title: Its description.
        unit: Unit of all its numbers; empty for a share or a count.
        value: The number; NaN if nothing was counted.
        low: Lower limit of its 95 % confidence interval, at least 0.
        high: Upper limit.
        target_low: Lower limit of the target, None without one.
        target_high: Upper limit of the target, None without one.
        source: Source of the target; empty without one.
    """

    name: str
    title: str
    unit: str
    value: float
    low: float
    high: float
    target_low: float | None = None
    target_high: float | None = None
    source: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the value meets the target; None without a target."""
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
    """The declaration of a figure; `validation.toml` has the limits and source of its target.

    Attributes:
        name: Its name, as in `validation.toml` where it has a target.
        title: Its description.
        statistic: The number, from a tally.
        unit: Unit in which it is shown; empty for a share or a count.
        scale: The number in that unit over the number in SI.
        counts: The sum in the tally that must not be empty for two profiles to be compared in it;
            empty for a figure that is not a property of the traffic.
    """

    name: str
    title: str
    statistic: Statistic
    unit: str = ""
    scale: float = 1.0
    counts: str = ""

    def target(self, side: str) -> Quantity | None:
        """The `low` or `high` limit that published measurements set [SI]; None without one."""
        entry = quantities("validation.toml").get(f"targets.{self.name}.{side}")
        return entry if isinstance(entry, Quantity) else None

    def measured(self, tally: Tally) -> Figure:
        """The figure of a tally, with its interval and target."""
        value, low, high = (float(self.scale * number) for number in tally.estimate(self.statistic))
        limits = least, most = self.target("low"), self.target("high")
        return Figure(
            name=self.name,
            title=self.title,
            unit=self.unit,
            value=value,
            low=low if math.isnan(low) else max(low, 0.0),
            high=high,
            target_low=least and self.scale * least.number,
            target_high=most and self.scale * most.number,
            source=next((one.source for one in reversed(limits) if one), ""),
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


RATE = Definition(
    "lane_changes_per_km", "lane changes per vehicle-km", _share("changes", "metres"), "1/km", 1e3
)
"""Measured on rings where there are some, because the published rates are of steady traffic."""

RING_TITLE = "lane changes per vehicle-km, steady at 15 to 25 vehicles/km/lane"

OWN_RATE = Definition(
    "own_lane_changes_per_km",
    "lane changes per vehicle-km at the profile's own densities",
    _share("changes", "metres"),
    "1/km",
    1e3,
    counts="changes",
)
"""Shown beside a rate that was measured on rings."""

DEFINITIONS = (
    OWN_RATE,
    Definition(
        "lane_change_duration",
        "mean duration of a lane change",
        _mean_duration,
        "s",
        counts="durations",
    ),
    Definition(
        "lane_change_lognormal",
        "distance of the durations from a lognormal",
        _distance_from_lognormal,
    ),
    Definition(
        "gap_time",
        "median time gap of who follows",
        lambda tally: quantile(tally.total("gap_times"), 0.5, GAP_WIDTH),
        "s",
        counts="gap_times",
    ),
    Definition(
        "short_ttc",
        "time to collision below 3 s, share of the time behind another",
        _share("critical", "behind"),
        counts="critical",
    ),
    Definition(
        "passing_speed",
        "how much faster a car is than the car it begins to pass",
        _share("passing_speed", "passing"),
        "km/h",
        kmh_from_mps(1.0),
        counts="passing",
    ),
    Definition(
        "lateral_accel",
        "95th percentile of the lateral acceleration",
        lambda tally: quantile(tally.total("lateral"), 0.95, ACCEL_WIDTH),
        "m/s^2",
        counts="lateral",
    ),
    Definition(
        "usual_accel",
        "longitudinal acceleration in -3 to 2 m/s^2, share of the uncritical time",
        _share("usual", "calm"),
        counts="usual",
    ),
    Definition(
        "impossible_accel",
        "simulations with more than 11 m/s^2",
        _share("impossible", "simulations"),
    ),
    Definition(
        "flying_share",
        "flying overtakes, share of all",
        _share("flying", "overtakes"),
        counts="flying",
    ),
    Definition(
        "open_at_end",
        "overtakes that are open at the end",
        _share("open", "attempts"),
        counts="open",
    ),
    Definition(
        "effective_share",
        "effective number of simulations over their number",
        _effective_share,
    ),
    Definition(
        "contacts",
        "contacts per 1,000 vehicle-km",
        _share("contacts", "metres"),
        "1/Mm",
        1e6,
        counts="contacts",
    ),
    Definition(
        "edges",
        "time in which the ego sees where the traffic ends",
        _share("edges", "frames"),
    ),
    Definition(
        "attempts",
        "simulations with an attempt",
        _share("attempts", "simulations"),
        counts="attempts",
    ),
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
    rate = replace(RATE, title=RING_TITLE).measured(ring)
    return [rate, *(one.measured(open_road) for one in DEFINITIONS)]
