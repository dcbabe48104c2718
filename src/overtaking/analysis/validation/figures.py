"""The figures that a profile is held against, each with its interval, target and verdict."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from overtaking.analysis.validation.tally import F64, Tally, quantile, ratio
from overtaking.analysis.validation.traffic import ACCEL_WIDTH, CHANGE_WIDTH, GAP_WIDTH
from overtaking.core.units import kmh_from_mps
from overtaking.knowledge import Quantity, quantities

Statistic = Callable[[Tally], float]
"""A number that follows from a tally."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure of a profile.

    Attributes:
        name: Its name, as in `validation.toml` where it has a target.
        title: What it is, in words.
        unit: Unit of all its numbers; empty for a share or a count.
        value: The number; NaN if there was nothing to count.
        low: Lower limit of its interval of 95 %, not below zero as no figure is.
        high: Upper limit.
        target_low: What it must reach, None if nothing.
        target_high: What it must not exceed, None if nothing.
        source: Where the target comes from; empty without one.
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
        """Whether all of the interval says the same as the value."""
        ends = (self.low, self.high)
        lows = {self.target_low is None or end >= self.target_low for end in ends}
        highs = {self.target_high is None or end <= self.target_high for end in ends}
        return len(lows) == len(highs) == 1

    def values(self) -> dict[str, Any]:
        """The same for machines; NaN is null."""
        values = asdict(self) | {"met": self.met, "sure": self.is_sure}
        return {
            name: None if isinstance(value, float) and math.isnan(value) else value
            for name, value in values.items()
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """How a figure is made.

    Attributes:
        name: Its name.
        title: What it is, in words.
        statistic: What is computed.
        unit: Unit of what is shown.
        scale: That unit over the SI one.
        counts: The sum that must not be empty for two profiles to be compared in it; empty for what
            is not a property of the traffic.
    """

    name: str
    title: str
    statistic: Statistic
    unit: str = ""
    scale: float = 1.0
    counts: str = ""


def figures(open_road: Tally, ring: Tally | None) -> list[Figure]:
    """All figures.

    Args:
        open_road: What was counted in the profile's simulations.
        ring: What was counted on rings; None if the profile cannot be put on one, and the rate of
            lane changes of the open road is held against the target.
    """
    rate = Definition(
        name="lane_changes_per_km",
        title="lane changes per vehicle-km, steady at 15 to 25 vehicles/km/lane"
        if ring
        else "lane changes per vehicle-km",
        statistic=_rate,
        unit="1/km",
        scale=1e3,
    )
    first = _figure(rate, ring or open_road)
    rest = [one for one in DEFINITIONS if ring or one.name != _OWN_RATE]
    return [first, *(_figure(definition, open_road) for definition in rest)]


def _figure(definition: Definition, tally: Tally) -> Figure:
    value, low, high = (
        definition.scale * float(number) for number in tally.estimate(definition.statistic)
    )
    known = quantities("validation.toml")
    ends: dict[str, float] = {}
    source = ""
    for side in ("low", "high"):
        entry = known.get(f"targets.{definition.name}.{side}")
        if isinstance(entry, Quantity):
            ends[f"target_{side}"] = definition.scale * entry.number
            source = entry.source
    return Figure(
        name=definition.name,
        title=definition.title,
        unit=definition.unit,
        value=value,
        low=low if math.isnan(low) else max(low, 0.0),
        high=high,
        source=source,
        **ends,
    )


def _rate(tally: Tally) -> float:
    return ratio(tally.total("changes"), tally.total("metres"))


def _share(part: str, whole: str) -> Statistic:
    return lambda tally: ratio(tally.total(part), tally.total(whole))


def _mean_duration(tally: Tally) -> float:
    histogram = tally.total("durations")
    return ratio(histogram * CHANGE_WIDTH * np.arange(len(histogram)), histogram)


def _distance_from_lognormal(tally: Tally) -> float:
    """Largest distance of the distribution of the durations from the fitted lognormal."""
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


def effective_share(tally: Tally) -> float:
    """Effective number of simulations over their number (Kish 1965)."""
    weights, squares = tally.total("simulations").sum(), tally.total("squares").sum()
    number = tally.total("number").sum()
    return float(weights * weights / (squares * number)) if number else float("nan")


_OWN_RATE = "own_lane_changes_per_km"

DEFINITIONS = (
    Definition(
        name=_OWN_RATE,
        title="lane changes per vehicle-km at the profile's own densities",
        statistic=_rate,
        unit="1/km",
        scale=1e3,
        counts="changes",
    ),
    Definition(
        name="lane_change_duration",
        title="mean duration of a lane change",
        statistic=_mean_duration,
        unit="s",
        counts="durations",
    ),
    Definition(
        name="lane_change_lognormal",
        title="distance of the durations from a lognormal",
        statistic=_distance_from_lognormal,
    ),
    Definition(
        name="gap_time",
        title="median time gap of who follows",
        statistic=lambda tally: quantile(tally.total("gap_times"), 0.5, GAP_WIDTH),
        unit="s",
        counts="gap_times",
    ),
    Definition(
        name="short_ttc",
        title="time to collision below 3 s, share of the time behind another",
        statistic=_share("critical", "behind"),
        counts="critical",
    ),
    Definition(
        name="passing_speed",
        title="how much faster a car is than the car it begins to pass",
        statistic=_share("passing_speed", "passing"),
        unit="km/h",
        scale=kmh_from_mps(1.0),
        counts="passing",
    ),
    Definition(
        name="lateral_accel",
        title="95th percentile of the lateral acceleration",
        statistic=lambda tally: quantile(tally.total("lateral"), 0.95, ACCEL_WIDTH),
        unit="m/s^2",
        counts="lateral",
    ),
    Definition(
        name="usual_accel",
        title="longitudinal acceleration in -3 to 2 m/s^2, share of the uncritical time",
        statistic=_share("usual", "calm"),
        counts="usual",
    ),
    Definition(
        name="impossible_accel",
        title="simulations with more than 11 m/s^2",
        statistic=_share("impossible", "simulations"),
    ),
    Definition(
        name="flying_share",
        title="flying overtakes, share of all",
        statistic=_share("flying", "overtakes"),
        counts="flying",
    ),
    Definition(
        name="open_at_end",
        title="overtakes that are open at the end",
        statistic=_share("open", "attempts"),
        counts="open",
    ),
    Definition(
        name="effective_share",
        title="effective number of simulations over their number",
        statistic=effective_share,
    ),
    Definition(
        name="contacts",
        title="contacts per 1,000 vehicle-km",
        statistic=_share("contacts", "metres"),
        unit="1/Mm",
        scale=1e6,
        counts="contacts",
    ),
    Definition(
        name="edges",
        title="time in which the ego sees where the traffic ends",
        statistic=_share("edges", "frames"),
    ),
    Definition(
        name="attempts",
        title="simulations with an attempt",
        statistic=_share("attempts", "simulations"),
        counts="attempts",
    ),
)
