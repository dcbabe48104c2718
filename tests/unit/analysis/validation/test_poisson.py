"""Exact limits of Poisson counts equal published values and SciPy."""

from __future__ import annotations

import pytest
from scipy.stats import chi2

from overtaking.analysis.validation.poisson import poisson_limits


@pytest.mark.parametrize(
    ("count", "low", "high"),
    [(0, 0.0, 3.689), (1, 0.0253, 5.572), (5, 1.623, 11.668), (10, 4.795, 18.390)],
)
def test_poisson_limits_equal_garwoods_table(count, low, high):
    assert poisson_limits(count) == pytest.approx((low, high), abs=6e-4)


@pytest.mark.parametrize("count", [0.4, 2.5, 37, 312.7, 5000])
def test_poisson_limits_are_chi_squared_quantiles(count):
    expected = 0.5 * chi2.ppf(0.025, 2 * count), 0.5 * chi2.ppf(0.975, 2 * count + 2)
    assert poisson_limits(count) == pytest.approx(expected, rel=1e-9)
