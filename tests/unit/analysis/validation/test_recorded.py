"""Recordings beside simulations in traffic as dense as theirs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ks_2samp
from tests.unit.analysis.validation.test_changes import still

from overtaking.analysis.validation import recorded
from overtaking.analysis.validation.traffic import Batch


def test_the_distance_is_that_of_smirnov():
    random = np.random.default_rng(3)
    one, other = random.normal(size=40), random.normal(0.4, 1.3, size=70)
    expected, _ = ks_2samp(one, other)
    assert recorded.distance(one, other) == pytest.approx(expected)
    assert recorded.distance(one, one) == 0.0
    assert np.isnan(recorded.distance(one, other[:0]))


def test_the_density_is_that_of_even_spacing():
    batch = Batch.of(still(*((100.0 + 40.0 * k, 25.0) for k in range(6))))
    lanes = batch.runs.road.num_lanes
    assert recorded._density(batch) == pytest.approx(25.0 / lanes, rel=0.01)


def test_what_is_sampled_of_a_follower_is_its_time_gap_and_speed():
    batch = Batch.of(still((100.0, 25.0), (154.4, 25.0)))
    found = recorded._samples(batch, recorded._egos(batch))
    assert found["speed"] == pytest.approx(25.0)
    assert found["time gap of followers"] == pytest.approx(2.0, abs=0.01)
    assert not len(found["duration of a lane change"])
