"""Tables of associations between features, and their words for p-values and sizes."""

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
def feature_associations() -> Associations:
    return associations(prepare(synthetic_features(), policy="paper"))


def test_every_feature_has_one_association_with_the_class(feature_associations: Associations):
    rows = class_associations(feature_associations).rows
    assert len(rows) == 15
    assert rows["feature"].is_unique
    assert rows["association"].abs().is_monotonic_decreasing


def test_rain_and_wind_are_the_strongest_pair_because_of_the_presets(
    feature_associations: Associations,
):
    rows = strongest_pairs(feature_associations).rows
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
def test_a_p_value_is_put_into_words_with_its_corrected_value(
    p_value: float, q_value: float, text: str
):
    assert reading(p_value, q_value) == text


@pytest.mark.parametrize(
    ("first", "second", "size"),
    [("PREC", "WIND", "large"), ("NV", "OLR", "negligible"), ("SE", "CLASS", "large")],
)
def test_an_association_has_the_conventional_word_for_its_size(
    feature_associations: Associations, first: str, second: str, size: str
):
    pair = next(
        pair for pair in feature_associations.pairs if (pair.first, pair.second) == (first, second)
    )
    assert pair.size == size
