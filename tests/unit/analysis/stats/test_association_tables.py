"""Associations in words that claim no more than the numbers."""

from __future__ import annotations

import math

import pytest
from tests.support.features import synthetic_features

from overtaking.analysis.stats.associations import (
    Associations,
    associations,
    class_associations,
    reading,
    strongest_pairs,
)
from overtaking.analysis.stats.sample import prepare


@pytest.fixture(scope="module")
def found() -> Associations:
    return associations(prepare(synthetic_features(), policy="paper"))


def test_every_feature_is_beside_the_class_once(found: Associations):
    rows = class_associations(found).rows
    assert len(rows) == 15
    assert rows["feature"].is_unique
    assert rows["association"].abs().is_monotonic_decreasing


def test_the_strongest_pair_is_that_of_the_presets(found: Associations):
    rows = strongest_pairs(found).rows
    assert rows.loc[0, "features"] == "PREC, WIND"
    assert rows.loc[0, "association"] == pytest.approx(1.0)
    assert not rows["features"].str.contains("CLASS").any()


@pytest.mark.parametrize(
    ("p_value", "q_value", "text"),
    [
        (0.001, 0.01, "stands out, also after correction"),
        (0.04, 0.2, "stands out alone, not after correction"),
        (0.3, 0.5, "compatible with no association"),
        (math.nan, math.nan, "cannot be tested"),
    ],
)
def test_a_p_value_is_read_with_care(p_value: float, q_value: float, text: str):
    assert reading(p_value, q_value) == text


@pytest.mark.parametrize(
    ("first", "second", "size"),
    [("PREC", "WIND", "large"), ("NV", "OLR", "negligible"), ("SE", "CLASS", "large")],
)
def test_an_effect_has_the_conventional_word(
    found: Associations, first: str, second: str, size: str
):
    pair = next(one for one in found.pairs if (one.first, one.second) == (first, second))
    assert pair.size == size
