"""Mean, spread, quantiles and shares, with weights and without."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64


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
