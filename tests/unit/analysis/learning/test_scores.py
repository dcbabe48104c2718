"""Scores equal scikit-learn; intervals allow for groups of related examples."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn import metrics

from overtaking.analysis.learning.scores import best_threshold, grouped_interval, score
from overtaking.analysis.stats.weighted_statistics import wilson_interval

RNG = np.random.default_rng(7)
PREDICTED, POSITIVE = RNG.random(500) < 0.3, RNG.random(500) < 0.2


def test_scores_equal_scikit_learn():
    scores = score("x", PREDICTED, POSITIVE)
    for name, metric in (
        ("precision", metrics.precision_score),
        ("recall", metrics.recall_score),
        ("f_measure", metrics.f1_score),
        ("accuracy", metrics.accuracy_score),
        ("balanced_accuracy", metrics.balanced_accuracy_score),
    ):
        assert getattr(scores, name) == pytest.approx(metric(POSITIVE, PREDICTED)), name


def test_predictions_without_a_positive_have_no_precision():
    scores = score("x", np.zeros(5, np.bool_), np.ones(5, np.bool_))
    assert scores.values()["precision"] is None
    assert scores.recall == 0.0


def test_the_best_threshold_has_the_highest_f_measure():
    probability = RNG.random(500) + 0.5 * POSITIVE
    threshold = best_threshold(probability, POSITIVE)
    best_f_measure = score("x", probability >= threshold, POSITIVE).f_measure
    assert best_f_measure == pytest.approx(
        max(score("x", probability >= candidate, POSITIVE).f_measure for candidate in probability)
    )


def test_independent_examples_have_wilsons_interval():
    is_right = RNG.random(400) < 0.8
    low, high = grouped_interval(is_right, np.arange(400))
    assert (low, high) == pytest.approx(wilson_interval(float(is_right.mean()), 400), abs=1e-3)


def test_five_copies_of_each_example_do_not_narrow_the_interval():
    is_right = RNG.random(400) < 0.8
    low, high = grouped_interval(np.repeat(is_right, 5), np.repeat(np.arange(400), 5))
    assert (low, high) == pytest.approx(wilson_interval(float(is_right.mean()), 400), abs=2e-3)
    interval_of_2000 = wilson_interval(float(is_right.mean()), 2000)
    assert high - low > 2.0 * (interval_of_2000[1] - interval_of_2000[0])
