"""Supervised cuts: Fayyad and Irani's criterion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import entropy as scipy_entropy
from sklearn.tree import DecisionTreeClassifier

from overtaking.analysis.learning.cuts import supervised_cuts


def literal(values: np.ndarray, positive: np.ndarray) -> float | None:
    """The first cut by the formulas of the paper, word for word and slowly."""

    def ent(part: np.ndarray) -> float:
        return float(scipy_entropy(np.bincount(part, minlength=2), base=2)) if len(part) else 0.0

    whole, number = positive.astype(int), len(values)
    levels = np.unique(values)
    best, place = np.inf, 0.0
    for border in (levels[:-1] + levels[1:]) / 2.0:
        low, high = whole[values < border], whole[values >= border]
        mean = (len(low) * ent(low) + len(high) * ent(high)) / number
        if mean < best - 1e-12:
            best, place = mean, border
    low, high = whole[values < place], whole[values >= place]
    kinds = [len(np.unique(part)) for part in (whole, low, high)]
    delta = np.log2(3.0 ** kinds[0] - 2.0) - (
        kinds[0] * ent(whole) - kinds[1] * ent(low) - kinds[2] * ent(high)
    )
    return place if ent(whole) - best > (np.log2(number - 1) + delta) / number else None


@pytest.mark.parametrize("seed", range(12))
def test_the_first_cut_is_that_of_the_paper(seed: int):
    draw = np.random.default_rng(seed)
    values = np.round(draw.normal(0.0, 1.0, 300), 1)
    positive = draw.random(300) < 1.0 / (1.0 + np.exp(-values * seed / 4.0))
    expected = literal(values, positive)
    found = supervised_cuts(values, positive, depth=1)
    assert found.tolist() == ([] if expected is None else [pytest.approx(expected)])


def test_a_cut_is_where_a_decision_tree_of_scikit_learn_splits():
    tree = DecisionTreeClassifier(criterion="entropy", max_depth=1)
    draw = np.random.default_rng(5)
    values = draw.uniform(0.0, 10.0, 500)
    positive = (values > 6.3) ^ (draw.random(500) < 0.1)
    tree.fit(values[:, None], positive)
    cut = supervised_cuts(values, positive, depth=1)
    assert cut == pytest.approx([tree.tree_.threshold[0]])


def test_noise_is_not_cut():
    draw = np.random.default_rng(2)
    assert len(supervised_cuts(draw.random(2000), draw.random(2000) < 0.3)) == 0


def test_a_constant_is_not_cut():
    assert len(supervised_cuts(np.ones(50), np.arange(50) < 25)) == 0
    assert len(supervised_cuts(np.zeros(0), np.zeros(0, np.bool_))) == 0


def test_a_number_is_cut_at_most_seven_times():
    values = np.arange(32_000.0)
    found = supervised_cuts(values, (values // 1000) % 2 == 0)
    assert 3 <= len(found) <= 7
    assert np.all(found % 1000.0 == 999.5)
