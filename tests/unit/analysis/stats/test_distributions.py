"""Bins, boxes and samples: what figures draw."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.features import synthetic_features

from overtaking.analysis.stats.columns import FEATURES, NUMERIC
from overtaking.analysis.stats.distributions import (
    MAX_BINS,
    box,
    every_kth,
    histogram,
    min_max,
    nice_edges,
    pair_points,
    scaled_boxes,
    swarm_points,
    typical,
)
from overtaking.analysis.stats.sample import Sample, prepare

NUMBERS = st.lists(st.floats(-1e6, 1e6, width=32), min_size=1, max_size=200)


@pytest.fixture(scope="module")
def sample() -> Sample:
    return prepare(synthetic_features(), policy="paper")


@given(NUMBERS)
def test_bins_hold_every_value_and_are_not_too_many(values: list[float]):
    edges = nice_edges(np.array(values))
    assert edges[0] <= min(values)
    assert edges[-1] >= max(values)
    assert 1 <= len(edges) - 1 <= MAX_BINS + 1
    assert np.histogram(values, edges)[0].sum() == len(values)


@pytest.mark.parametrize("name", [one.name for one in FEATURES])
def test_a_histogram_counts_every_simulation_once(sample: Sample, name: str):
    drawn = histogram(sample, name)
    assert drawn.counts.sum() + drawn.num_missing == len(sample)
    by_class = sample.frame.groupby("CLASS", observed=False)[name].count()
    assert drawn.counts.sum(axis=1).tolist() == [by_class[one] for one in sample.classes]


def test_a_box_is_matplotlibs(sample: Sample):
    from matplotlib.cbook import boxplot_stats

    values = sample.values("D")
    expected = boxplot_stats(values[~np.isnan(values)])[0]
    found = box(values)
    assert found.quartiles == pytest.approx((expected["q1"], expected["med"], expected["q3"]))
    assert found.whiskers == pytest.approx((expected["whislo"], expected["whishi"]))
    assert found.outliers.tolist() == sorted(set(expected["fliers"].tolist()))
    assert len(found.outliers) > 0


def test_a_weight_of_two_is_two_simulations():
    values = np.array([1.0, 2.0, 3.0, 10.0])
    weighted = box(values, np.array([1.0, 2.0, 1.0, 1.0]))
    repeated = box(np.array([1.0, 2.0, 2.0, 3.0, 10.0]))
    assert weighted.quartiles[1] == repeated.quartiles[1] == 2.0


def test_scaling_is_that_of_scikit_learn(sample: Sample):
    from sklearn.preprocessing import MinMaxScaler

    names = [one.name for one in NUMERIC]
    expected = MinMaxScaler().fit_transform(sample.frame[names])
    found = np.column_stack([min_max(sample.values(name)) for name in names])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_what_is_constant_or_missing_has_a_box_all_the_same():
    frame = synthetic_features(20).assign(FOG=2.0, SP=np.nan)
    boxes = scaled_boxes(prepare(frame, policy="paper"))
    assert boxes["FOG"].quartiles == (0.0, 0.0, 0.0)
    assert boxes["SP"].count == 0


@given(st.integers(0, 500), st.integers(1, 100))
def test_every_kth_takes_each_member_at_most_once(number: int, most: int):
    members = np.arange(number) % 3 != 1
    chosen = every_kth(members, most)
    assert len(chosen) == min(most, int(members.sum()))
    assert members[chosen].all()
    assert len(set(chosen.tolist())) == len(chosen)


def test_a_large_set_is_sampled_and_says_so():
    sample = prepare(synthetic_features(5000), policy="paper")
    swarm, pairs = swarm_points(sample, "SE"), pair_points(sample)
    assert swarm["Success_I"].is_sampled
    assert len(swarm["Success_I"].simulations) == 200
    assert pairs.is_sampled
    assert pairs.num_all == 5000
    assert len(pairs.simulations) < 1500
    counts = sample.frame["CLASS"].iloc[pairs.simulations].value_counts()
    assert counts["Success_L"] >= 60


def test_a_small_set_is_drawn_whole(sample: Sample):
    assert not pair_points(sample).is_sampled
    swarm = swarm_points(sample, "SE")
    assert not any(points.is_sampled for points in swarm.values())
    assert sum(len(points.simulations) for points in swarm.values()) == len(sample)


def test_the_typical_simulation_is_in_the_middle_of_its_class():
    frame = synthetic_features(300)
    names = [one.name for one in NUMERIC]
    legal = frame.index[frame["CLASS"] == "Success_L"]
    frame.loc[legal[4], names] = frame.loc[legal, names].median()
    assert typical(prepare(frame, policy="paper"))["Success_L"] == legal[4]


def test_a_class_without_simulations_has_no_typical_one(sample: Sample):
    frame = synthetic_features()
    typical_simulations = typical(prepare(frame[frame["CLASS"] != "No_attempt"], policy="paper"))
    assert "No_attempt" not in typical_simulations
    assert len(typical_simulations) == 4


def test_missing_values_do_not_hide_a_class():
    frame = synthetic_features(40).assign(SP=np.nan, DSEP=np.nan, D=np.nan)
    assert set(typical(prepare(frame, policy="paper"))) == set(pd.unique(frame["CLASS"]))
