"""Mean, spread, quantiles and shares with and without weights, and the interval of a share."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64

Z95 = 1.959963984540054  # The 97.5 % point of the normal distribution.


@dataclass(frozen=True, slots=True)
class Moments:
    """Moments of the values of a feature in a class; NaN where undefined.

    Attributes:
        count: Number of values.
        weight: Sum of their weights; equal to `count` without weights.
        minimum: Smallest value.
        mean: Weighted mean.
        maximum: Largest value.
        sigma: Standard deviation, NaN for fewer than two values.
    """

    count: int
    weight: float
    minimum: float
    mean: float
    maximum: float
    sigma: float


def moments(values: F64, weight: F64) -> Moments:
    """Moments of the known values.

    Args:
        values: One per simulation, NaN: missing, shape (simulation,).
        weight: Weight of each, same shape.

    Returns:
        The moments. The variance is unbiased: it divides by n - 1, with weights by
        sum(w) - sum(w^2) / sum(w), as `numpy.cov` with `aweights`.
    """
    there = ~np.isnan(values) & (weight > 0.0)
    values, weight = values[there], weight[there]
    total = float(weight.sum())
    if not len(values):
        return Moments(0, 0.0, math.nan, math.nan, math.nan, math.nan)
    mean = float((weight * values).sum()) / total
    freedom = total - float((weight**2).sum()) / total
    squares = float((weight * (values - mean) ** 2).sum())
    return Moments(
        count=len(values),
        weight=total,
        minimum=float(values.min()),
        mean=mean,
        maximum=float(values.max()),
        sigma=math.sqrt(squares / freedom) if len(values) > 1 else math.nan,
    )


def sums(codes: NDArray[np.int64], values: F64, size: int = 0) -> F64:
    """Sum of the values of each code, shape (code,), at least `size` long."""
    return np.bincount(codes, values, minlength=size).astype(np.float64)


def quantiles(values: F64, probabilities: tuple[float, ...], weight: F64 | None = None) -> F64:
    """Quantiles of values without gaps, shape (probability,).

    Without weights they are interpolated, as pandas does; with weights they are values that occur,
    since between weighted values there is no agreed interpolation.
    """
    if not len(values):
        return np.full(len(probabilities), np.nan)
    if weight is None:
        return np.quantile(values, probabilities)
    return np.quantile(values, probabilities, weights=weight, method="inverted_cdf")


def wilson_interval(share: float, size: float) -> tuple[float, float]:
    """95 % confidence interval of a share.

    Args:
        share: The observed share, 0 to 1.
        size: Number of observations; the effective number if they are weighted.

    Returns:
        The limits; 0 and 1 without observations.

    Source:
        E. B. Wilson, Probable inference, the law of succession, and statistical inference,
        J. Am. Stat. Assoc. 22 (1927) 209-212.
    """
    if size <= 0.0:
        return 0.0, 1.0
    z2 = Z95**2 / size
    centre = (share + z2 / 2.0) / (1.0 + z2)
    reach = math.sqrt(share * (1.0 - share) * z2 + z2**2 / 4.0) / (1.0 + z2)
    return max(0.0, centre - reach), min(1.0, centre + reach)
