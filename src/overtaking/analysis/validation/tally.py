"""Sums over groups of simulations, for statistics and their uncertainty.

Events within one simulation depend on each other; simulations are independent. So everything is
summed in groups of whole simulations, and the standard error of a statistic is the jackknife's:
leave out one group after the other. That works for ratios, quantiles and distances of distributions
alike, takes memory for the groups only, and gives the same numbers in any order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.core.arrays import F64

Array: TypeAlias = NDArray[Any]

GROUPS = 20
"""Number of groups; a simulation belongs to the one of its number modulo this."""

_T95 = 2.093  # Student's t of 95 % with 19 degrees of freedom.


class Tally:
    """Weighted sums and histograms by name, each of shape (group, bin)."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._sums: dict[str, F64] = {}

    def add(self, name: str, group: Array, values: Array) -> None:
        """Add weights.

        Args:
            name: Name of the sum.
            group: Group of each entry.
            values: Weight of each entry, broadcast against `group`.
        """
        self.add_binned(name, group, np.zeros(np.shape(group), np.int64), values, 1)

    def add_binned(self, name: str, group: Array, place: Array, values: Array, bins: int) -> None:
        """Add weights to the bins at `place`; places beyond are added to the outermost bin."""
        inside = np.clip(place, 0, bins - 1).astype(np.int64) + bins * group.astype(np.int64)
        weights = np.broadcast_to(values, inside.shape)
        found = np.bincount(inside.ravel(), weights.ravel(), GROUPS * bins).reshape(GROUPS, bins)
        self._sums[name] = self._sums.get(name, np.zeros((GROUPS, bins))) + found

    def total(self, name: str) -> F64:
        """The sum over all groups, shape (bin,)."""
        return self._of(name).sum(axis=0)

    def estimate(self, statistic: Callable[[Tally], float]) -> tuple[float, float, float]:
        """A statistic, and the limits of its 95 % confidence interval.

        Source:
            B. Efron, C. Stein, The jackknife estimate of variance, Ann. Statist. 9 (1981) 586-596.
        """
        value, spread = self.spread(statistic)
        return value, value - _T95 * spread, value + _T95 * spread

    def spread(self, statistic: Callable[[Tally], float]) -> tuple[float, float]:
        """A statistic and its standard error, by leaving out one group after the other."""
        left_out = np.array([statistic(self._without(group)) for group in range(GROUPS)])
        variance = (GROUPS - 1) / GROUPS * float(((left_out - left_out.mean()) ** 2).sum())
        return statistic(self), variance**0.5

    def groups_with(self, name: str, place: int = -1) -> int:
        """Number of groups with a positive sum, in the bin at `place` or in any."""
        sums = self._of(name)
        return int(((sums if place < 0 else sums[:, place : place + 1]) > 0.0).any(axis=1).sum())

    def _of(self, name: str) -> F64:
        return self._sums.get(name, np.zeros((GROUPS, 1)))

    def _without(self, group: int) -> Tally:
        rest = Tally()
        rest._sums = {name: np.delete(sums, group, axis=0) for name, sums in self._sums.items()}
        return rest


def quantile(histogram: F64, share: float, width: float) -> float:
    """A quantile of a histogram from zero with bins of a width, NaN if it is empty."""
    below = np.cumsum(histogram)
    if below[-1] <= 0.0:
        return float("nan")
    wanted = share * below[-1]
    place = int(np.searchsorted(below, wanted))
    before = below[place - 1] if place else 0.0
    return width * (place + (wanted - before) / histogram[place])


def ratio(part: F64, whole: F64) -> float:
    """The sum of one over the sum of the other, NaN if that is zero."""
    total = float(whole.sum())
    return float(part.sum()) / total if total > 0.0 else float("nan")
