"""The number of each replicate that is compared with a number of the paper."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from overtaking.analysis.reproduction.replicates import SIZE, Replicates, members
from overtaking.analysis.reproduction.statements import Statement, Statistic

if TYPE_CHECKING:
    from overtaking.core.arrays import F64, Mask

POLICY = "paper"
"""The policy whose classes are compared: it decides by the paper's columns."""


def measured(of: Replicates, statement: Statement) -> F64:
    """The number of a statement, in each replicate.

    Args:
        of: The replicates.
        statement: A statement that is not about a design.

    Returns:
        Shape (replicate,), in SI; NaN where a replicate has nothing to measure.
    """
    inside = members(of.classes[POLICY], statement.outcome_class)
    if statement.measure == Statistic.COUNT:
        return inside.sum(axis=1).astype(np.float64)
    values = np.where(inside, of.columns[statement.feature], np.nan)
    if statement.measure == Statistic.MEAN:
        return _mean(values)
    if statement.measure == Statistic.SUM:
        return np.nansum(values, axis=1)
    if statement.measure == Statistic.WITHIN:
        return _within(values, statement).sum(axis=1).astype(np.float64)
    other = np.where(inside, of.columns[statement.other_feature], np.nan)
    if statement.measure == Statistic.RATIO:
        return _mean(values) / _mean(other)
    rho = spearman(values, other)
    return rho if statement.measure == Statistic.SPEARMAN else p_value(rho, SIZE)


def _within(values: F64, statement: Statement) -> Mask:
    """Which values lie in a closed range, widened slightly because features are 32-bit numbers."""
    hair = 1e-6 * max(abs(statement.low), abs(statement.high), 1.0)
    return (values >= statement.low - hair) & (values <= statement.high + hair)


def _mean(values: F64) -> F64:
    """Mean of each row without its gaps; NaN for a row of gaps."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # A class may be empty: NaN says so.
        return np.nanmean(values, axis=1)


def spearman(one: F64, other: F64) -> F64:
    """Spearman's correlation in each row, ties sharing their mean rank.

    Args:
        one: A variable, shape (replicate, simulation).
        other: Another one.

    Returns:
        Shape (replicate,), NaN where a variable is constant. Simulations that lack one of the two
        are left out.
    """
    gaps = np.isnan(one) | np.isnan(other)
    first, second = (
        pd.DataFrame(np.where(gaps, np.nan, values)).rank(axis=1) for values in (one, other)
    )
    return np.asarray(first.corrwith(second, axis=1), dtype=np.float64)


def p_value(rho: F64, size: int) -> F64:
    """Two-sided p of the t-test of a correlation.

    Args:
        rho: Correlations.
        size: An even number of pairs that each is of.

    Source:
        M. Abramowitz, I. Stegun, Handbook of Mathematical Functions, 1964, 26.7.4: Student's
        distribution for an even number of degrees of freedom.
    """
    freedom = size - 2
    tangent = rho / np.sqrt(np.maximum(1.0 - rho**2, np.finfo(np.float64).tiny))
    cosine_squared = 1.0 / (1.0 + tangent**2)
    term = np.ones_like(rho)
    total = np.ones_like(rho)
    for k in range(1, freedom // 2):
        term = term * cosine_squared * (2 * k - 1) / (2 * k)
        total = total + term
    inside = np.abs(tangent) * np.sqrt(cosine_squared) * total
    return np.clip(1.0 - inside, 0.0, 1.0)
