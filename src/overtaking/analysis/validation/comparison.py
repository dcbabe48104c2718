"""Weighted rates of an enriched profile beside the rates of the profile that it enriches.

Weights undo the proposal exactly if it is drawn as it says. So every rate that both profiles have
often enough must be the same but for chance; one that is not means that a quantity is drawn in a
way that its weight does not know.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from statistics import NormalDist
from typing import Any

from overtaking.analysis.validation.figures import DEFINITIONS, Definition, Statistic
from overtaking.analysis.validation.overtakes import STRATA, cell
from overtaking.analysis.validation.tally import GROUPS, Tally, ratio
from overtaking.model.labels import OvertakeClass

LEAST_GROUPS = 15
"""A rate is common enough to compare if what it counts was met in so many of the groups of
simulations, in both profiles: with fewer, leaving out groups says nothing of its spread."""

LEVEL = 0.05
"""How often at most one of all rates of a comparison disagrees by chance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """A rate of both profiles.

    Attributes:
        title: What it is, in words.
        unit: Unit of all its numbers; empty for a share.
        weighted: Of the enriched profile, by its weights.
        natural: Of the profile without its proposal.
        low: Lower limit of the difference, weighted minus natural; of the simultaneous interval.
        high: Upper limit.
    """

    title: str
    unit: str
    weighted: float
    natural: float
    low: float
    high: float

    @property
    def agrees(self) -> bool:
        """Whether the difference may be chance."""
        return self.low <= 0.0 <= self.high

    def values(self) -> dict[str, Any]:
        """The same for machines."""
        return asdict(self) | {"agrees": self.agrees}


def compare(weighted: Tally, natural: Tally) -> tuple[Rate, ...]:
    """Every rate that is common enough in both, with Bonferroni's simultaneous intervals.

    Args:
        weighted: What was counted of the enriched profile.
        natural: What was counted of the profile without its proposal, with other seeds.

    Source:
        R. G. Miller, Simultaneous Statistical Inference (1981), section 2.3 (Bonferroni); degrees
        of freedom are the fewer of the two, on the safe side of Welch's.
    """
    both = (weighted, natural)
    common = [
        one
        for one, name, place in _candidates()
        if min(tally.groups_with(name, place) for tally in both) >= LEAST_GROUPS
    ]
    reach = student(1.0 - 0.5 * LEVEL / max(1, len(common)), GROUPS - 1)
    return tuple(_rate(one, weighted, natural, reach) for one in common)


def student(probability: float, freedom: int) -> float:
    """Quantile of Student's t, to within 1 % from ten degrees of freedom and 0.5 to 0.9999.

    Source:
        Abramowitz and Stegun, Handbook of Mathematical Functions (1964), 26.7.5.
    """
    x = NormalDist().inv_cdf(probability)
    first = (x**3 + x) / 4.0
    second = (5.0 * x**5 + 16.0 * x**3 + 3.0 * x) / 96.0
    third = (3.0 * x**7 + 19.0 * x**5 + 17.0 * x**3 - 15.0 * x) / 384.0
    return x + first / freedom + second / freedom**2 + third / freedom**3


def _rate(one: Definition, weighted: Tally, natural: Tally, reach: float) -> Rate:
    there, spread = weighted.spread(one.statistic)
    here, other = natural.spread(one.statistic)
    half = reach * math.hypot(spread, other)
    return Rate(
        title=one.title,
        unit=one.unit,
        weighted=float(one.scale * there),
        natural=float(one.scale * here),
        low=float(one.scale * (there - here - half)),
        high=float(one.scale * (there - here + half)),
    )


def _candidates() -> list[tuple[Definition, str, int]]:
    """What may be compared, each with the sum and the bin that must not be empty."""
    found = [(one, one.counts, -1) for one in DEFINITIONS if one.counts]
    for row, stratum in enumerate(STRATA):
        if row > 0:
            share = Definition(
                name=f"{stratum} share", title=f"simulations: {stratum}", statistic=_weather(row)
            )
            found.append((share, "stratum", row))
        for kind in OvertakeClass:
            there = f", {stratum}" if row > 0 else ""
            share = Definition(
                name=f"{stratum} {kind.title}",
                title=f"{kind.title}{there}",
                statistic=_class_in(row, kind),
            )
            found.append((share, "classes", cell(row, kind)))
    return found


def _weather(row: int) -> Statistic:
    return lambda tally: ratio(tally.total("stratum")[row], tally.total("stratum")[0])


def _class_in(row: int, kind: OvertakeClass) -> Statistic:
    return lambda tally: ratio(tally.total("classes")[cell(row, kind)], tally.total("stratum")[row])
