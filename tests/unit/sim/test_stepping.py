"""What the ego believes at every decision: the simulation itself, not another one."""

from __future__ import annotations

import numpy as np
import pytest

import overtaking as ot
from overtaking.model.driver_interface import EgoColumns, NeighbourColumns
from overtaking.sim.stepping import trace_beliefs

_MM = 1000.0


@pytest.fixture(scope="module")
def scenario() -> ot.Scenario:
    return ot.sample("pinto2023-physical", num_simulations=6, seed=1)


def test_the_ego_is_where_it_was_recorded(scenario: ot.Scenario):
    runs, told = ot.simulate(scenario), trace_beliefs(scenario)
    for one, frames in enumerate(runs.num_frames):
        position = EgoColumns._make(told.ego[:, one].T).s
        assert np.isfinite(position).sum() == frames  # 20 frames and decisions a second.
        assert (np.rint(position[:frames] * _MM) == runs.states.s[one, 0, :frames]).all()


def test_an_ego_that_another_driver_drove_does_the_same_again(scenario: ot.Scenario):
    def brakes(observation: ot.Observation) -> np.ndarray:
        accel = np.full(len(observation.is_running), 0.5 if observation.time < 1.0 else -1.0)
        return np.stack([accel, np.zeros_like(accel)], axis=1)

    runs = ot.drive(scenario, brakes, observation="human", action="accel_lane")
    told = trace_beliefs(scenario, runs.actions)
    for one, frames in enumerate(runs.num_frames):
        position = EgoColumns._make(told.ego[:frames, one].T).s
        assert (np.rint(position * _MM) == runs.states.s[one, 0, :frames]).all()


@pytest.mark.ci
def test_both_engines_tell_the_same(scenario: ot.Scenario):
    few = scenario.select(slice(0, 2))
    few = few.replace(horizon=np.full(2, 1.5, np.float32))
    ours, readable = (trace_beliefs(few, simulator=name) for name in ("engine", "reference"))
    for name in ("ego", "believed", "true"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(readable, name))
    assert EgoColumns._make(readable.ego.T).speed.max() > 5.0


def test_what_is_not_seen_is_not_believed(scenario: ot.Scenario):
    told = trace_beliefs(scenario)
    believed = NeighbourColumns._make(told.believed.T)
    unseen = believed.is_detected == 0
    assert (believed.closing_speed[unseen] == 0).all()
    assert 0.2 < unseen.mean() < 1.0
