"""External drivers of the ego: equal on both engines, and equal to the built-in ego."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import pytest
from examples.human_ego import HumanEgo
from examples.mobil_driver import MobilDriver

from overtaking import _core
from overtaking.model.driver_interface import (
    ACTION_KINDS,
    EGO_COLUMNS,
    MAX_ACTION_PARTS,
    NEIGHBOUR_COLUMNS,
    NEIGHBOUR_ROLES,
    OBSERVATION_SIZE,
    PASSING_COLUMNS,
    Actions,
    NeighbourColumns,
    split_observation,
)
from overtaking.model.scenario import ForcedDecision
from overtaking.model.trajectories import Stage
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification, profile_names
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.traffic_specification import TwoWayTraffic
from overtaking.sim import engine, reference
from overtaking.sim.branching import branch
from overtaking.sim.external_driver import Driver, drive
from overtaking.sim.stepping import new_stepper
from overtaking.world.step_parameters import step_parameters

from .situations import difference

pytestmark = pytest.mark.ci

SHORT = {"time.horizon_s": 15.0, "time.attempt_deadline_s": 15.0}
SHORTER = {
    "time.horizon_s": 8.0,
    "time.attempt_deadline_s": 8.0,
}  # For the reference, which is slow.


def scenes(count: int, profile: str = "pinto2023-physical", **changes: object):
    specification = load_specification(profile, SHORT | changes)
    return ScenarioSource(specification, load_road(specification.road), 4).sample(
        np.arange(count, dtype=np.uint64)
    )


def random_actions(kind: str, shape: tuple[int, int], seed: int = 1) -> Actions:
    """Actions that change every half second, mostly within the range of a human driver."""
    limits = {
        "move": (0, 6),
        "accel": (-3000, 2500),
        "lane_change": (-1, 2),
        "wheel_angle": (-40, 40),
    }
    generator = np.random.default_rng(seed)
    values = np.zeros((*shape, MAX_ACTION_PARTS), np.int32)
    for column, part in enumerate(ACTION_KINDS[kind]):
        held_values = generator.integers(*limits[part.name], (shape[0], -(-shape[1] // 10)))
        values[:, :, column] = np.repeat(held_values, 10, axis=1)[:, : shape[1]]
    return Actions(values=values, kind=kind)


@pytest.mark.parametrize("kind", ACTION_KINDS)
def test_recorded_actions_have_the_same_bits_on_both_engines(kind):
    scenario = scenes(12, **SHORTER)
    parameters = step_parameters(scenario)
    actions = random_actions(kind, (12, 161))
    expected = reference.run(scenario, parameters, actions=actions)
    for level in [name for name, available in _core.simd_levels() if available]:
        run = engine.run(scenario, parameters, actions=actions, level=level)
        assert not (mismatch := difference(run, expected)), f"{level}: {mismatch}"
    built_in_run = engine.run(scenario, parameters)
    assert (expected.trace_hash != built_in_run.trace_hash).any(axis=1).sum() > 6


# No kind of action depends on the observation, so each kind is tested with one observation.
VIEWS = [("pinto2023-physical", False), ("pinto2023-physical", True), ("pinto2023", False)]


@pytest.mark.parametrize(
    ("kind", "profile", "observes_truth"),
    [(kind, *view) for kind, view in zip(ACTION_KINDS, cycle(VIEWS), strict=False)],
)
def test_both_engines_observe_the_same_bits(kind, profile, observes_truth):
    parameters = step_parameters(scenes(10, profile, **SHORTER))
    values = random_actions(kind, (10, 161), seed=2).values
    steppers = [
        new_stepper(parameters, kind, observes_truth=observes_truth, simulator=name)
        for name in ("engine", "reference")
    ]
    (table, runs, _), (expected, expected_runs, _) = (
        stepper.observe_start() for stepper in steppers
    )
    decision, actions = 0, np.zeros((10, MAX_ACTION_PARTS), np.int32)
    while expected_runs.any():
        np.testing.assert_array_equal(runs, expected_runs)
        np.testing.assert_array_equal(table, expected, err_msg=f"decision {decision}")
        hold = 1 + decision % 3
        actions = np.ascontiguousarray(values[:, decision])
        stepped, reference_stepped = (stepper.step(actions, hold) for stepper in steppers)
        np.testing.assert_array_equal(stepped.num_decisions, reference_stepped.num_decisions)
        (table, runs, _), (expected, expected_runs, _) = stepped, reference_stepped
        decision += hold
    assert decision > 100
    assert not runs.any()
    assert table.any()
    np.testing.assert_array_equal(table, expected, err_msg="those that have ended last")
    (table, *_), (expected, *_) = (stepper.step(actions, 1) for stepper in steppers)
    assert not table.any()
    assert not expected.any()


def test_every_number_of_an_observation_has_a_name():
    assert _core.FIELD_NAMES["ego"] == tuple(EGO_COLUMNS)
    assert _core.FIELD_NAMES["neighbour"] == tuple(NEIGHBOUR_COLUMNS)
    assert _core.FIELD_NAMES["passing"] == tuple(PASSING_COLUMNS)
    parameters = step_parameters(scenes(3))
    table, runs, _ = new_stepper(parameters, "accel_lane", observes_truth=True).observe_start()
    assert table.shape == (3, OBSERVATION_SIZE)
    assert (
        len(EGO_COLUMNS) + len(NEIGHBOUR_ROLES) * len(NEIGHBOUR_COLUMNS) + len(PASSING_COLUMNS)
        == OBSERVATION_SIZE
    )
    assert runs.all()
    _, neighbours, passing = split_observation(table)
    for role in ("oncoming", "second_oncoming"):
        empty = NeighbourColumns._make(neighbours[0, NEIGHBOUR_ROLES.index(role)])
        assert empty.gap == parameters.constants.unseen_gap
        assert not any(empty._replace(gap=np.zeros(1)))
    assert not passing.any()


ONE_WAY = [
    name
    for name in profile_names()
    if not isinstance(load_specification(name).traffic, TwoWayTraffic)
]
"""Policies do not drive among oncoming traffic."""

HUMAN = Driver(function=HumanEgo(), observation="human", action="decision")


@pytest.mark.parametrize("profile", ONE_WAY)
def test_the_built_in_ego_as_a_policy_has_the_same_trace(profile):
    specification = load_specification(
        profile, {"time.horizon_s": 30.0, "time.attempt_deadline_s": 30.0}
    )
    scenario = ScenarioSource(specification, load_road(specification.road), 7).sample(
        np.arange(48, dtype=np.uint64)
    )
    expected = engine.run(scenario, step_parameters(scenario))
    driven = drive(scenario, HUMAN, engine.run)
    assert np.unique(expected.stage).size > 4
    assert not difference(driven.replace(actions=None), expected)


@pytest.mark.soak
@pytest.mark.parametrize("profile", ONE_WAY)
def test_a_thousand_simulations_of_each_profile_have_the_same_trace(profile):
    specification = load_specification(profile)
    road, num_same = load_road(specification.road), 0
    for first in range(0, 1000, 100):
        scenario = ScenarioSource(specification, road, 7).sample(
            np.arange(first, first + 100, dtype=np.uint64)
        )
        expected = engine.run(scenario, step_parameters(scenario)).trace_hash
        num_same += int(
            (drive(scenario, HUMAN, engine.run).trace_hash == expected).all(axis=1).sum()
        )
    assert num_same == 1000


@pytest.mark.soak
def test_a_policy_drives_the_same_in_small_and_in_large_batches():
    specification = load_specification("pinto2023-physical")
    scenario = ScenarioSource(specification, load_road(specification.road), 9).sample(
        np.arange(4096, dtype=np.uint64)
    )
    batch_run = drive(scenario, HUMAN, engine.run)
    order = np.random.default_rng(5).permutation(4096)
    small_batches = [order[k : k + 16] for k in range(0, 256, 16)]
    for rows in (order, *small_batches, *order[:64, None]):
        driven = drive(scenario.select(rows), HUMAN, engine.run)
        np.testing.assert_array_equal(driven.trace_hash, batch_run.trace_hash[rows])


def test_the_mobil_driver_without_lane_changes_follows_like_the_built_in_driver():
    """Its accelerations equal those of the built-in driver in its lane, except for rounding."""
    scenario, mobil = scenes(24, "motorway"), MobilDriver()
    mobil.reset(scenario)
    expected = branch(scenario, 0, decision=ForcedDecision.STAY)
    stays = Driver(
        function=lambda observation: mobil(observation) * np.float32([1.0, 0.0]),
        observation="human",
    )
    driven = drive(scenario, stays, engine.run)
    in_both = expected.frame_mask & driven.frame_mask
    distance = np.abs(driven.states.s[:, 0] - expected.states.s[:, 0])
    assert distance[in_both].max() < 100  # 0.1 m, after 15 s.
    assert np.ptp(expected.states.speed[:, 0], axis=1).max() > 2000  # Some have to brake.


def test_the_mobil_driver_changes_lanes():
    scenario = scenes(48, "motorway")
    driven = drive(scenario, Driver(function=MobilDriver(), observation="human"), engine.run)
    has_pulled_out = (driven.stage == Stage.PULL_OUT).any(axis=1)
    assert 3 <= has_pulled_out.sum() < 24
    assert not (driven.stage == Stage.CRASHED).any()


def test_a_policy_drives_the_same_on_the_reference():
    scenario = scenes(8)
    driven = drive(scenario, HUMAN, reference.run, "reference")
    assert not difference(driven, drive(scenario, HUMAN, engine.run))
    expected = engine.run(scenario, step_parameters(scenario)).trace_hash
    np.testing.assert_array_equal(driven.trace_hash, expected)


def test_a_policy_drives_the_same_in_any_batch():
    scenario = scenes(33)
    batch_run = drive(scenario, HUMAN, engine.run)
    order = np.random.default_rng(5).permutation(33)
    for rows in (order, order[:16], np.array([32])):
        driven = drive(scenario.select(rows), HUMAN, engine.run)
        np.testing.assert_array_equal(driven.trace_hash, batch_run.trace_hash[rows])
        assert driven.actions
        assert batch_run.actions
        assert driven.actions.hashes == [batch_run.actions.hashes[index] for index in rows]
