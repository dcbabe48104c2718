"""Beliefs of the ego at every decision belong to the recorded simulation."""

from __future__ import annotations

import numpy as np
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.model.driver_interface import (
    NEIGHBOUR_ROLES,
    Actions,
    EgoColumns,
    NeighbourColumns,
)
from overtaking.sim.stepping import trace_beliefs

_MM = 1000.0


@pytest.fixture(scope="module")
def scenario() -> ot.Scenario:
    return ot.sample("pinto2023-physical", num_simulations=6, seed=1)


def test_a_trace_has_the_recorded_positions(scenario: ot.Scenario):
    runs, trace = ot.simulate(scenario), trace_beliefs(scenario)
    for row, frames in enumerate(runs.num_frames):
        s = EgoColumns._make(trace.ego[:, row].T).s
        assert np.isfinite(s).sum() == frames  # 20 frames and decisions a second.
        assert (np.rint(s[:frames] * _MM) == runs.states.s[row, 0, :frames]).all()


def test_a_trace_repeats_the_actions_of_an_external_driver(scenario: ot.Scenario):
    def brakes(observation: ot.Observation) -> np.ndarray:
        accel = np.full(len(observation.is_running), 0.5 if observation.time < 1.0 else -1.0)
        return np.stack([accel, np.zeros_like(accel)], axis=1)

    runs = ot.drive(scenario, brakes, observation="human", action="accel_lane")
    trace = trace_beliefs(scenario, runs.actions)
    for row, frames in enumerate(runs.num_frames):
        s = EgoColumns._make(trace.ego[:frames, row].T).s
        assert (np.rint(s * _MM) == runs.states.s[row, 0, :frames]).all()


@pytest.mark.ci
def test_both_simulators_give_the_same_beliefs(scenario: ot.Scenario):
    two_scenarios = scenario.select(slice(0, 2))
    two_scenarios = two_scenarios.replace(horizon=np.full(2, 1.5, np.float32))
    by_engine, by_reference = (
        trace_beliefs(two_scenarios, simulator=name) for name in ("engine", "reference")
    )
    for name in ("ego", "believed", "true"):
        np.testing.assert_array_equal(getattr(by_engine, name), getattr(by_reference, name))
    assert EgoColumns._make(by_reference.ego.T).speed.max() > 5.0


@pytest.mark.parametrize("simulator", ["engine", "reference"])
@pytest.mark.parametrize("actions", [None, Actions.empty(0)])
def test_a_batch_without_simulations_has_an_empty_trace(
    scenario: ot.Scenario, simulator: str, actions: Actions | None
):
    trace = trace_beliefs(scenario.select(slice(0, 0)), actions, simulator)
    assert trace.ego.shape == (0, 0, len(EgoColumns._fields))
    expected_shape = (0, 0, len(NEIGHBOUR_ROLES), len(NeighbourColumns._fields))
    assert trace.believed.shape == trace.true.shape == expected_shape


def test_an_unknown_simulator_is_refused(scenario: ot.Scenario):
    with pytest.raises(ConfigError, match="simulator"):
        trace_beliefs(scenario, simulator="other")


def test_undetected_neighbours_have_no_believed_closing_speed(scenario: ot.Scenario):
    trace = trace_beliefs(scenario)
    beliefs = NeighbourColumns._make(trace.believed.T)
    is_undetected = beliefs.is_detected == 0
    assert (beliefs.closing_speed[is_undetected] == 0).all()
    assert 0.2 < is_undetected.mean() < 1.0
