"""Weighted ratios of several drivers in the same scenes, their intervals, and what to make of them.

Scenes are drawn again with replacement, the same ones for every driver, so that what a scene does
to all of them cancels in a difference (the paired bootstrap).

Source:
    B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap (1993), chapters 8 and 13; rare
    events: M. P. Fay, E. J. Feuer, Statistics in Medicine 16 (1997) 791-801.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import TYPE_CHECKING, Final

import numpy as np

from overtaking.analysis.validation.poisson import poisson_limits

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from overtaking.analysis.validation.tally import Array
    from overtaking.core.arrays import F64

REPEATS: Final = 2000
LEVEL: Final = 0.05
FEW: Final = 20
"""Pairs of scenes that must differ before a difference is judged, and events before the bootstrap
gives the interval of a rate."""

_AT_ONCE: Final = 100  # Repeats, for the memory.


class Resampled:
    """Weighted sums of columns, over the scenes and over scenes that are drawn again.

    Args:
        weight: Of each scene, shape (scene,).
        columns: Columns of each driver, by driver and name; each of shape (scene,).
        seed: Seed of the draws.
    """

    def __init__(
        self, weight: F64, columns: Mapping[str, Mapping[str, F64]], seed: int = 1
    ) -> None:
        """Draw the scenes again."""
        self._place = {
            (driver, name): place
            for place, (driver, name) in enumerate(
                (driver, name) for driver, named in columns.items() for name in named
            )
        }
        values = [one for named in columns.values() for one in named.values()]
        table = weight[:, None] * np.stack(values, axis=1)
        self._total = table.sum(axis=0)
        rng, scenes = np.random.default_rng(seed), len(weight)
        sums: list[F64] = []
        for _ in range(REPEATS // _AT_ONCE):
            chosen = rng.integers(0, scenes, (_AT_ONCE, scenes))
            chosen += scenes * np.arange(_AT_ONCE)[:, None]
            counts = np.bincount(chosen.ravel(), minlength=_AT_ONCE * scenes)
            sums.append(counts.reshape(_AT_ONCE, scenes) @ table)
        self._sums = np.concatenate(sums)

    def ratio(self, driver: str, part: str, whole: str) -> tuple[float, F64]:
        """A ratio over the scenes, and over the scenes of each repeat, (repeat,)."""
        above, below = (self._place[driver, name] for name in (part, whole))
        totals = _over(self._total[[above]], self._total[[below]])
        return float(totals[0]), _over(self._sums[:, above], self._sums[:, below])


def _over(part: F64, whole: F64) -> F64:
    return np.divide(part, whole, out=np.full(part.shape, np.nan), where=whole > 0.0)


def interval(repeats: F64) -> tuple[float, float]:
    """The middle 95 % of the repeats, NaN if some have no value."""
    if np.isnan(repeats).any():
        return math.nan, math.nan
    low, high = np.quantile(repeats, (0.5 * LEVEL, 1.0 - 0.5 * LEVEL))
    return float(low), float(high)


def rare_interval(weight: Array, happened: Array) -> tuple[float, float]:
    """The 95 % interval of a weighted rate of few events, by the gamma method.

    Args:
        weight: What each scene adds to the whole, shape (scene,).
        happened: Number of events, same shape.
    """
    total = float(weight.sum())
    if total <= 0.0:
        return math.nan, math.nan
    parts, most = weight * happened / total, float(weight.max()) / total
    rate, variance = float(parts.sum()), float((parts**2).sum())
    low = variance / rate * poisson_limits(rate**2 / variance)[0] if rate > 0.0 else 0.0
    more, spread = rate + most, variance + most**2
    # The exact upper limit of a count k is the quantile of a gamma of shape k + 1.
    return low, spread / more * poisson_limits(max(more**2 / spread - 1.0, 0.0))[1]


def concentration(weight: Array) -> tuple[float, float]:
    """The effective number of scenes, and the share of the largest weight.

    Args:
        weight: What each scene adds to the whole of a ratio.
    """
    total = float(weight.sum())
    if total <= 0.0:
        return 0.0, math.nan
    return total**2 / float((weight**2).sum()), float(weight.max()) / total


def two_sided(difference: float, repeats: F64) -> float:
    """The p-value of no difference, from the spread of the repeats."""
    spread = float(np.std(repeats, ddof=1))
    if not spread > 0.0:
        return math.nan
    return 2.0 * NormalDist().cdf(-abs(difference) / spread)


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjusted p-values that hold the family-wise error rate; NaN stays and is not counted.

    Source:
        S. Holm, A simple sequentially rejective multiple test procedure, Scand. J. Statist. 6
        (1979) 65-70.
    """
    known = sorted((p, place) for place, p in enumerate(p_values) if not math.isnan(p))
    adjusted = [math.nan] * len(p_values)
    largest = 0.0
    for rank, (p, place) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * p))
        adjusted[place] = largest
    return adjusted


def quantiles(values: F64, weight: F64, shares: Iterable[float]) -> list[float]:
    """Weighted quantiles, NaN without a value."""
    if not len(values):
        return [math.nan for _ in shares]
    order = np.argsort(values)
    below = np.cumsum(weight[order])
    places = [int(np.searchsorted(below, share * below[-1])) for share in shares]
    return [float(values[order[min(place, len(order) - 1)]]) for place in places]
