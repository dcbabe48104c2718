"""Scores beside those of scikit-learn, and intervals for examples that are kin."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn import metrics

from overtaking.analysis.learning.scores import best_threshold, grouped_interval, score
from overtaking.analysis.stats.weighted_statistics import wilson_interval

DRAW = np.random.default_rng(7)
SAID, POSITIVE = DRAW.random(500) < 0.3, DRAW.random(500) < 0.2


def test_scores_are_those_of_scikit_learn():
    found = score("x", SAID, POSITIVE)
    for name, other in (
        ("precision", metrics.precision_score),
        ("recall", metrics.recall_score),
        ("f_measure", metrics.f1_score),
        ("accuracy", metrics.accuracy_score),
        ("balanced_accuracy", metrics.balanced_accuracy_score),
    ):
        assert getattr(found, name) == pytest.approx(other(POSITIVE, SAID)), name


def test_nothing_said_has_no_precision():
    found = score("x", np.zeros(5, np.bool_), np.ones(5, np.bool_))
    assert found.values()["precision"] is None
    assert found.recall == 0.0


def test_the_best_threshold_is_the_best():
    chance = DRAW.random(500) + 0.5 * POSITIVE
    best = best_threshold(chance, POSITIVE)
    reached = score("x", chance >= best, POSITIVE).f_measure
    assert reached == pytest.approx(
        max(score("x", chance >= one, POSITIVE).f_measure for one in chance)
    )


def test_strangers_have_wilsons_interval():
    right = DRAW.random(400) < 0.8
    low, high = grouped_interval(right, np.arange(400))
    assert (low, high) == pytest.approx(wilson_interval(float(right.mean()), 400), abs=1e-3)


def test_copies_say_no_more_than_their_originals():
    right = DRAW.random(400) < 0.8
    low, high = grouped_interval(np.repeat(right, 5), np.repeat(np.arange(400), 5))
    assert (low, high) == pytest.approx(wilson_interval(float(right.mean()), 400), abs=2e-3)
    narrow = wilson_interval(float(right.mean()), 2000)
    assert high - low > 2.0 * (narrow[1] - narrow[0])
