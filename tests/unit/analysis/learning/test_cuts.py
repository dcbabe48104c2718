"""Supervised cuts of numbers by the criterion of Fayyad and Irani."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import entropy as scipy_entropy
from sklearn.tree import DecisionTreeClassifier

from overtaking.analysis.learning.cuts import supervised_cuts


def reference_cut(values: np.ndarray, positive: np.ndarray) -> float | None:
    """The first cut by the formulas of the paper, evaluated literally and slowly."""

    def entropy(part: np.ndarray) -> float:
        return float(scipy_entropy(np.bincount(part, minlength=2), base=2)) if len(part) else 0.0

    all_classes, number = positive.astype(int), len(values)
    levels = np.unique(values)
    best_entropy, best_border = np.inf, 0.0
    for border in (levels[:-1] + levels[1:]) / 2.0:
        below, above = all_classes[values < border], all_classes[values >= border]
        mean_entropy = (len(below) * entropy(below) + len(above) * entropy(above)) / number
        if mean_entropy < best_entropy - 1e-12:
            best_entropy, best_border = mean_entropy, border
    below, above = all_classes[values < best_border], all_classes[values >= best_border]
    num_classes = [len(np.unique(part)) for part in (all_classes, below, above)]
    delta = np.log2(3.0 ** num_classes[0] - 2.0) - (
        num_classes[0] * entropy(all_classes)
        - num_classes[1] * entropy(below)
        - num_classes[2] * entropy(above)
    )
    return (
        best_border
        if entropy(all_classes) - best_entropy > (np.log2(number - 1) + delta) / number
        else None
    )


@pytest.mark.parametrize("seed", range(12))
def test_the_first_cut_follows_the_formulas_of_the_paper(seed: int):
    rng = np.random.default_rng(seed)
    values = np.round(rng.normal(0.0, 1.0, 300), 1)
    positive = rng.random(300) < 1.0 / (1.0 + np.exp(-values * seed / 4.0))
    expected = reference_cut(values, positive)
    cuts = supervised_cuts(values, positive, depth=1)
    assert cuts.tolist() == ([] if expected is None else [pytest.approx(expected)])


def test_a_cut_equals_the_split_of_a_decision_tree_of_scikit_learn():
    tree = DecisionTreeClassifier(criterion="entropy", max_depth=1)
    rng = np.random.default_rng(5)
    values = rng.uniform(0.0, 10.0, 500)
    positive = (values > 6.3) ^ (rng.random(500) < 0.1)
    tree.fit(values[:, None], positive)
    cut = supervised_cuts(values, positive, depth=1)
    assert cut == pytest.approx([tree.tree_.threshold[0]])


def test_random_outcomes_give_no_cut():
    rng = np.random.default_rng(2)
    assert len(supervised_cuts(rng.random(2000), rng.random(2000) < 0.3)) == 0


def test_constant_and_empty_values_have_no_cut():
    assert len(supervised_cuts(np.ones(50), np.arange(50) < 25)) == 0
    assert len(supervised_cuts(np.zeros(0), np.zeros(0, np.bool_))) == 0


def test_values_with_many_class_changes_have_at_most_seven_cuts():
    values = np.arange(32_000.0)
    cuts = supervised_cuts(values, (values // 1000) % 2 == 0)
    assert 3 <= len(cuts) <= 7  # Three levels of halving give at most 1 + 2 + 4 cuts.
    # The class changes between 999 and 1000, 1999 and 2000, and so on.
    assert np.all(cuts % 1000.0 == 999.5)
