"""Compares the weighted rates of an enriched profile with those of its natural profile.

Weights undo the proposal exactly if scenarios are drawn from it. So every rate that is common
enough in both profiles must agree but for chance; a rate that does not shows that a quantity is
drawn from another distribution than its weight assumes.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

from overtaking.analysis.validation.overtakes import STRATA, cell
from overtaking.analysis.validation.tally import GROUPS, Tally, ratio
from overtaking.core.equality import ContentEquality
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from collections.abc import Iterable

    from overtaking.analysis.validation.figures import Definition, Statistic

LEAST_GROUPS = 15
"""A rate is compared if both profiles have it in at least so many groups of simulations: with
fewer, the jackknife says nothing of its spread."""

LEVEL = 0.05
"""Family-wise error rate of a comparison."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate(ContentEquality):
    """A rate of both profiles.

    Attributes:
        title: Its description.
        unit: Unit of all its numbers; empty for a share.
        weighted: The weighted rate of the enriched profile.
        natural: The rate of the profile without its proposal.
        low: Lower limit of the simultaneous interval of the difference, weighted minus natural.
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
        """Whether the interval of the difference holds 0."""
        return self.low <= 0.0 <= self.high

    def values(self) -> dict[str, Any]:
        """The rate for JSON."""
        return asdict(self) | {"agrees": self.agrees}


def compare(weighted: Tally, natural: Tally, of: Iterable[Definition]) -> tuple[Rate, ...]:
    """Every rate that is common enough in both, with Bonferroni's simultaneous intervals.

    Args:
        weighted: The tally of the enriched profile.
        natural: The tally of the profile without its proposal, with another seed.
        of: The figures; those are compared that count something.

    Source:
        R. G. Miller, Simultaneous Statistical Inference (1981), section 2.3 (Bonferroni); the
        degrees of freedom of one profile are fewer than Welch's, so the test is on the safe side.
    """
    both = (weighted, natural)
    common = [
        one
        for one in _candidates(of)
        if min(tally.groups_with(one.counts, one.place) for tally in both) >= LEAST_GROUPS
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


def _rate(one: _Candidate, weighted: Tally, natural: Tally, reach: float) -> Rate:
    (there, spread), (here, other) = (tally.spread(one.statistic) for tally in (weighted, natural))
    half = reach * math.hypot(spread, other)
    return Rate(
        title=one.title,
        unit=one.unit,
        weighted=float(one.scale * there),
        natural=float(one.scale * here),
        low=float(one.scale * (there - here - half)),
        high=float(one.scale * (there - here + half)),
    )


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A rate that may be compared; `counts` is the sum whose bin at `place` must not be empty."""

    title: str
    statistic: Statistic
    counts: str
    place: int = -1
    unit: str = ""
    scale: float = 1.0


def _candidates(of: Iterable[Definition]) -> list[_Candidate]:
    """The figures that are properties of the traffic, and the classes in each stratum."""
    found = [
        _Candidate(
            one.target.description,
            one.statistic,
            one.counts,
            unit=one.target.unit,
            scale=one.target.scale,
        )
        for one in of
        if one.counts
    ]
    for row, stratum in enumerate(STRATA):
        if row > 0:
            title = f"simulations: {stratum}"
            found.append(_Candidate(title, _share("stratum", row, 0), "stratum", row))
        there = f", {stratum}" if row > 0 else ""
        for kind in OvertakeClass:
            place = cell(row, kind)
            share = _share("classes", place, row)
            found.append(_Candidate(f"{kind.title}{there}", share, "classes", place))
    return found


def _share(name: str, place: int, row: int) -> Statistic:
    """One bin of a sum as a share of the simulations of a stratum."""
    return lambda tally: ratio(tally.total(name)[place], tally.total("stratum")[row])
