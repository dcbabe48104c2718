"""Warnings about classes that are absent from a stratum against expectation."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from tests.support.features import synthetic_features

from overtaking.analysis.stats.leaks import leaks
from overtaking.analysis.stats.sample import prepare


def test_no_legal_overtake_at_night_is_a_warning():
    frame = synthetic_features()
    leaks_by_level = {
        (leak.feature, leak.level): leak for leak in leaks(prepare(frame, policy="paper"))
    }
    leak = leaks_by_level["DN", "Night"]
    nights, legal = int((frame["DN"] == "Night").sum()), int((frame["CLASS"] == "Success_L").sum())
    assert leak.name == "Success_L"
    assert leak.size == nights
    assert leak.expected == pytest.approx(legal * nights / len(frame))
    assert leak.chance == pytest.approx(comb(len(frame) - nights, legal) / comb(len(frame), legal))
    assert "No Success_L among the" in leak.sentence


def test_the_counts_of_the_paper_give_a_warning():
    """29 legal overtakes, all by day, of 94 days and 182 nights (what its weather implies)."""
    frame = synthetic_features(276)
    frame["CLASS"] = ["Success_L"] * 29 + ["Success_I"] * 247
    frame["DN"] = ["Day"] * 94 + ["Night"] * 182
    night_leaks = [leak for leak in leaks(prepare(frame, policy="paper")) if leak.feature == "DN"]
    assert [(leak.name, leak.level, leak.size) for leak in night_leaks] == [
        ("Success_L", "Night", 182)
    ]
    assert night_leaks[0].expected == pytest.approx(29 * 182 / 276)
    assert night_leaks[0].chance < 1e-12
    assert "below one in a million" in night_leaks[0].sentence


def test_a_class_absent_from_a_stratum_by_plausible_chance_gives_no_warning():
    frame = synthetic_features(60)
    frame["CLASS"] = ["Success_L"] * 2 + ["Success_I"] * 58
    frame["DN"] = ["Day"] * 30 + ["Night"] * 30
    assert not [leak for leak in leaks(prepare(frame, policy="paper")) if leak.feature == "DN"]


def test_a_class_that_occurs_in_every_stratum_gives_no_warning():
    frame = synthetic_features(500)
    frame["DN"] = np.where(np.arange(500) % 2 == 0, "Day", "Night")
    assert not [leak for leak in leaks(prepare(frame, policy="paper")) if leak.feature == "DN"]


def test_censored_simulations_give_no_warning():
    frame = synthetic_features(276)
    frame["CLASS"] = ["Success_L"] * 29 + ["censored"] * 247
    frame["DN"] = ["Day"] * 94 + ["Night"] * 182
    assert leaks(prepare(frame, policy="paper")) == ()


def test_a_weather_value_of_a_few_possible_ones_is_a_stratum():
    levels = {
        (leak.feature, leak.level) for leak in leaks(prepare(synthetic_features(), policy="paper"))
    }
    assert ("FOG", "60 %") in levels
