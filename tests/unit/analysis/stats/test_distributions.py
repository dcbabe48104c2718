"""Bins, boxes and samples for figures."""

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
def test_bins_contain_every_value_and_their_number_is_bounded(values: list[float]):
    edges = nice_edges(np.array(values))
    assert edges[0] <= min(values)
    assert edges[-1] >= max(values)
    assert 1 <= len(edges) - 1 <= MAX_BINS + 1
    assert np.histogram(values, edges)[0].sum() == len(values)


@pytest.mark.parametrize("name", [feature.name for feature in FEATURES])
def test_a_histogram_counts_every_simulation_once(sample: Sample, name: str):
    result = histogram(sample, name)
    assert result.counts.sum() + result.num_missing == len(sample)
    by_class = sample.frame.groupby("CLASS", observed=False)[name].count()
    assert result.counts.sum(axis=1).tolist() == [
        by_class[class_name] for class_name in sample.classes
    ]


def test_a_box_equals_matplotlib(sample: Sample):
    from matplotlib.cbook import boxplot_stats

    values = sample.values("D")
    expected = boxplot_stats(values[~np.isnan(values)])[0]
    result = box(values)
    assert result.quartiles == pytest.approx((expected["q1"], expected["med"], expected["q3"]))
    assert result.whiskers == pytest.approx((expected["whislo"], expected["whishi"]))
    assert result.outliers.tolist() == sorted(set(expected["fliers"].tolist()))
    assert len(result.outliers) > 0


def test_a_simulation_of_weight_two_has_the_same_median_as_two_simulations():
    values = np.array([1.0, 2.0, 3.0, 10.0])
    weighted = box(values, np.array([1.0, 2.0, 1.0, 1.0]))
    repeated = box(np.array([1.0, 2.0, 2.0, 3.0, 10.0]))
    assert weighted.quartiles[1] == repeated.quartiles[1] == 2.0


def test_scaling_equals_the_min_max_scaler_of_scikit_learn(sample: Sample):
    from sklearn.preprocessing import MinMaxScaler

    names = [feature.name for feature in NUMERIC]
    expected = MinMaxScaler().fit_transform(sample.frame[names])
    scaled = np.column_stack([min_max(sample.values(name)) for name in names])
    np.testing.assert_allclose(scaled, expected, rtol=0, atol=1e-12)


def test_constant_and_missing_features_have_boxes_too():
    frame = synthetic_features(20).assign(FOG=2.0, SP=np.nan)
    boxes = scaled_boxes(prepare(frame, policy="paper"))
    assert boxes["FOG"].quartiles == (0.0, 0.0, 0.0)
    assert boxes["SP"].count == 0


@given(st.integers(0, 500), st.integers(1, 100))
def test_every_kth_selects_a_member_at_most_once(count: int, max_selected: int):
    members = np.arange(count) % 3 != 1
    selected = every_kth(members, max_selected)
    assert len(selected) == min(max_selected, int(members.sum()))
    assert members[selected].all()
    assert len(set(selected.tolist())) == len(selected)


def test_points_of_5000_simulations_are_a_marked_sample():
    sample = prepare(synthetic_features(5000), policy="paper")
    swarm, pairs = swarm_points(sample, "SE"), pair_points(sample)
    assert swarm["Success_I"].is_sampled
    assert len(swarm["Success_I"].simulations) == 200  # `MAX_SWARM` points.
    assert pairs.is_sampled
    assert pairs.num_all == 5000
    # `MAX_PAIRS` is 1,200, of which each class has at least a twentieth.
    assert len(pairs.simulations) < 1500
    counts = sample.frame["CLASS"].iloc[pairs.simulations].value_counts()
    assert counts["Success_L"] >= 60


def test_points_of_a_small_data_set_are_complete(sample: Sample):
    assert not pair_points(sample).is_sampled
    swarm = swarm_points(sample, "SE")
    assert not any(points.is_sampled for points in swarm.values())
    assert sum(len(points.simulations) for points in swarm.values()) == len(sample)


def test_the_typical_simulation_of_a_class_has_its_median_values():
    frame = synthetic_features(300)
    names = [feature.name for feature in NUMERIC]
    legal = frame.index[frame["CLASS"] == "Success_L"]
    frame.loc[legal[4], names] = frame.loc[legal, names].median()
    assert typical(prepare(frame, policy="paper"))["Success_L"] == legal[4]


def test_a_class_without_simulations_has_no_typical_simulation(sample: Sample):
    frame = synthetic_features()
    typical_simulations = typical(prepare(frame[frame["CLASS"] != "No_attempt"], policy="paper"))
    assert "No_attempt" not in typical_simulations
    assert len(typical_simulations) == 4


def test_a_class_with_missing_values_has_a_typical_simulation():
    frame = synthetic_features(40).assign(SP=np.nan, DSEP=np.nan, D=np.nan)
    assert set(typical(prepare(frame, policy="paper"))) == set(pd.unique(frame["CLASS"]))
