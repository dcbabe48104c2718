"""Sums in groups and their uncertainty by leaving one group out (jackknife)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from overtaking.analysis.validation.tally import GROUPS, Tally, quantile, ratio


def test_the_interval_of_a_mean_agrees_with_its_standard_error():
    rng = np.random.default_rng(1)
    values = rng.normal(3.0, 2.0, 20_000)
    group = np.arange(len(values)) % GROUPS
    tally = Tally()
    tally.add("sum", group, values)
    tally.add("number", group, np.ones(1))
    value, low, high = tally.estimate(lambda t: ratio(t.total("sum"), t.total("number")))
    assert value == pytest.approx(values.mean())
    # 2.093 is Student's t with 19 degrees of freedom. The spread of 20 groups is known to 16 %.
    assert high - low == pytest.approx(2 * 2.093 * values.std() / math.sqrt(len(values)), rel=0.4)
    assert low < 3.0 < high


def test_95_percent_intervals_cover_the_median_in_95_percent_of_repetitions():
    rng = np.random.default_rng(2)
    num_covered = 0
    for _ in range(300):
        values = rng.exponential(1.0, 400)
        tally = Tally()
        group = np.arange(400) % GROUPS
        tally.add_binned("times", group, values / 0.02, np.ones(1), 500)
        _, low, high = tally.estimate(lambda t: quantile(t.total("times"), 0.5, 0.02))
        num_covered += low < math.log(2.0) < high  # ln 2 is the median of this distribution.
    assert num_covered / 300 == pytest.approx(0.95, abs=0.04)


def test_a_quantile_equals_numpy_up_to_the_bin_width():
    values = np.random.default_rng(3).gamma(2.0, 1.0, 5000)
    tally = Tally()
    tally.add_binned("x", np.zeros(5000, int), values / 0.01, np.ones(1), 3000)
    for share in (0.05, 0.5, 0.95):
        estimate = quantile(tally.total("x"), share, 0.01)
        assert estimate == pytest.approx(float(np.quantile(values, share)), abs=0.011)


def test_a_ratio_is_the_quotient_of_its_sums_over_all_groups():
    tally = Tally()
    tally.add("part", np.array([0, 1]), np.array([1.0, 0.0]))
    tally.add("whole", np.array([0, 1]), np.array([1.0, 3.0]))
    assert ratio(tally.total("part"), tally.total("whole")) == 0.25


def test_an_empty_tally_has_nan_for_ratios_and_quantiles():
    value, low, high = Tally().estimate(lambda t: ratio(t.total("a"), t.total("b")))
    assert all(math.isnan(number) for number in (value, low, high))
    assert math.isnan(quantile(np.zeros(5), 0.5, 1.0))
