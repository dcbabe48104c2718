"""External drivers among oncoming traffic: their observations, and the built-in ego as one."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import pytest
from examples.human_ego import HumanEgo
from tests.support.two_way import SCENES, pair, road
from tests.support.worlds import scenario

from overtaking import _core
from overtaking.model.driver_interface import (
    ACTION_KINDS,
    MAX_ACTION_PARTS,
    NEIGHBOUR_ROLES,
    Move,
    NeighbourColumns,
    PassingColumns,
    split_observation,
)
from overtaking.model.trajectories import Stage
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import built_in_drivers, engine, reference
from overtaking.sim.external_driver import Driver, drive
from overtaking.sim.sensors import Sensor
from overtaking.sim.stepping import new_stepper
from overtaking.world.step_parameters import step_parameters

from .situations import difference
from .test_external_driver import random_actions

LEVELS = [name for name, available in _core.simd_levels() if available]
HUMAN = Driver(function=HumanEgo(), observation="human", action="decision")


def rural(numbers, seed: int = 7, **changes: object):
    specification = load_specification("rural", {"traffic.held_up": 1.0} | changes)
    return ScenarioSource(specification, load_road("rural"), seed).sample(
        np.asarray(numbers, np.uint64)
    )


@pytest.mark.ci
@pytest.mark.parametrize(
    ("kind", "observes_truth"), list(zip(ACTION_KINDS, cycle([False, True]), strict=False))
)
def test_both_engines_observe_the_same_bits(kind, observes_truth):
    parameters = step_parameters(
        scenario(*SCENES, road=road(is_open=False), horizon=9.0, num_slots=5)
    )
    values = random_actions(kind, (len(SCENES), 181), seed=2).values
    steppers = [
        new_stepper(parameters, kind, observes_truth=observes_truth, simulator=name)
        for name in ("engine", "reference")
    ]
    (table, runs, _), (expected, expected_runs, _) = (
        stepper.observe_start() for stepper in steppers
    )
    decision, num_second_oncoming = 0, 0
    while expected_runs.any():
        np.testing.assert_array_equal(runs, expected_runs)
        np.testing.assert_array_equal(table, expected, err_msg=f"decision {decision}")
        num_second_oncoming += int(
            split_observation(table)
            .neighbours[:, NEIGHBOUR_ROLES.index("second_oncoming"), 0]
            .sum()
        )
        actions = np.ascontiguousarray(values[:, decision])
        (table, runs, _), (expected, expected_runs, _) = (
            stepper.step(actions, 1) for stepper in steppers
        )
        decision += 1
    assert decision > 100
    assert num_second_oncoming > 20


@pytest.mark.ci
@pytest.mark.parametrize("kind", ACTION_KINDS)
def test_recorded_actions_have_the_same_bits_on_both_engines(kind):
    world = scenario(*SCENES, road=road(), horizon=9.0, num_slots=5)
    parameters = step_parameters(world)
    actions = random_actions(kind, (len(SCENES), 181))
    expected = reference.run(world, parameters, actions=actions)
    for level in LEVELS:
        run = engine.run(world, parameters, actions=actions, level=level)
        assert not (mismatch := difference(run, expected)), f"{level}: {mismatch}"


@pytest.mark.ci
def test_the_built_in_ego_as_a_policy_has_the_same_trace():
    world = rural(np.arange(64))
    expected = engine.run(world, step_parameters(world))
    driven = drive(world, HUMAN, engine.run)
    assert {Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE} <= set(np.unique(expected.stage))
    assert not difference(driven.replace(actions=None), expected)


@pytest.mark.ci
def test_the_built_in_ego_as_a_policy_has_the_same_trace_in_aborts():
    gaps = np.arange(200.0, 1500.0, 25.0)
    scenes = [pair(gap, comes=75.0, gap_demand_factor=0.2) for gap in gaps]
    world = scenario(*scenes, road=road(), horizon=20.0)
    expected = engine.run(world, step_parameters(world))
    assert (expected.stage == Stage.ABORT).any()
    assert not difference(drive(world, HUMAN, engine.run).replace(actions=None), expected)


@pytest.mark.ci
def test_the_built_in_ego_as_a_policy_has_the_same_trace_on_the_reference():
    world = scenario(*SCENES, road=road(is_open=False), horizon=12.0, num_slots=5)
    expected = engine.run(world, step_parameters(world)).trace_hash
    driven = drive(world, HUMAN, reference.run, "reference")
    np.testing.assert_array_equal(driven.trace_hash, expected)


@pytest.mark.soak
def test_a_thousand_simulations_of_the_rural_profile_have_the_same_trace():
    num_same = 0
    for first in range(0, 1000, 100):
        specification = load_specification("rural")
        world = ScenarioSource(specification, load_road("rural"), 7).sample(
            np.arange(first, first + 100, dtype=np.uint64)
        )
        expected = engine.run(world, step_parameters(world)).trace_hash
        num_same += int((drive(world, HUMAN, engine.run).trace_hash == expected).all(axis=1).sum())
    assert num_same == 1000


class ObservationRecorder:
    """A driver that stays in its lane and records its observations."""

    def __init__(self) -> None:
        """Begin without observations."""
        self.tables = []

    def __call__(self, observation):
        """Record the observation and stay in the lane."""
        self.tables.append(observation.table.copy())
        return built_in_drivers.stay(observation)


def observe_drive(observe, *scenes, on_road=None, horizon: float = 8.0):
    """A simulation, its observed neighbours by role, and the observed columns about passing.

    Each column has the shape (decision, simulation).
    """
    world = scenario(*scenes, road=on_road or road(), horizon=horizon)
    recorder = ObservationRecorder()
    run = drive(
        world, Driver(function=recorder, observation=observe, action="decision"), engine.run
    )
    _, neighbours, passing = split_observation(np.stack(recorder.tables))
    roles = {
        role: NeighbourColumns._make(np.moveaxis(neighbours[:, :, index], -1, 0))
        for index, role in enumerate(NEIGHBOUR_ROLES)
    }
    return run, roles, PassingColumns._make(np.moveaxis(passing, -1, 0))


def test_the_true_observation_has_gap_offset_and_closing_speed_of_oncoming_vehicles():
    run, roles, _ = observe_drive("truth", pair(300.0, 420.0))
    frames = np.arange(len(roles["leader"].gap))
    s, d = run.states.s[0, :, frames] / 1e3, run.states.d[0, :, frames] / 1e3
    half_length = run.scenario.vehicles.length[0] / 2.0
    is_before_meeting = s[:, 2] > s[:, 0]
    for role, slot in (("oncoming", 2), ("second_oncoming", 3)):
        gap = s[:, slot] - s[:, 0] - half_length[slot] - half_length[0]
        np.testing.assert_allclose(
            roles[role].gap[is_before_meeting, 0], gap[is_before_meeting], atol=3e-3
        )
        lateral_distance = (d[:, slot] - d[:, 0])[is_before_meeting]
        np.testing.assert_allclose(
            roles[role].lateral_distance[is_before_meeting, 0], lateral_distance, atol=3e-3
        )
        closing = -np.diff(gap) / 0.05
        observed_closing = roles[role].closing_speed[1:, 0]
        np.testing.assert_allclose(
            observed_closing[is_before_meeting[1:]], closing[is_before_meeting[1:]], atol=0.1
        )
    assert not roles["oncoming"].stop_lamp.any()


def test_after_a_meeting_the_second_oncoming_vehicle_becomes_the_first():
    run, roles, _ = observe_drive("truth", pair(150.0, 300.0))
    gap = roles["oncoming"].gap[:, 0]
    meeting_frame = int(np.flatnonzero(np.diff(gap) > 50.0)[0])
    assert roles["second_oncoming"].gap[meeting_frame, 0] == pytest.approx(
        gap[meeting_frame + 1], abs=5.0
    )
    assert roles["second_oncoming"].is_detected[meeting_frame + 1, 0] == 0
    assert run.states.s[0, 2, meeting_frame + 3] < run.states.s[0, 0, meeting_frame + 3]


def test_a_human_detects_oncoming_vehicles_only_within_the_sight_distance():
    winding_road = road(is_open=False)
    run, roles, passing = observe_drive("human", pair(900.0), on_road=winding_road, horizon=12.0)
    sight = passing.sight_distance[:, 0]
    is_detected = roles["oncoming"].is_detected[:, 0] > 0
    frames = np.arange(len(roles["leader"].gap))
    gap = (run.states.s[0, 2, frames] - run.states.s[0, 0, frames]) / 1e3
    assert is_detected.any()
    assert (gap[is_detected] < sight[is_detected] + 20.0).all()
    assert (roles["oncoming"].gap[~is_detected] == 1000.0).all()


@pytest.mark.ci
def test_a_sensor_detects_oncoming_vehicles_only_within_its_range(repository):
    radar = Sensor.from_file(repository / "examples" / "radar.toml")
    _, roles, passing = observe_drive(radar, pair(300.0, 380.0))
    for role in ("oncoming", "second_oncoming"):
        is_detected = roles[role].is_detected[:, 0] > 0
        assert is_detected.any()
        assert roles[role].gap[is_detected, 0].max() < radar.range_ahead + 1.0
    assert not passing.gap_ahead_of_leader.any()


def test_the_move_cancel_aborts_a_pass():
    world = scenario(pair(), road=road(), horizon=14.0)
    parameters = step_parameters(world)
    stepper = new_stepper(parameters, "decision", observes_truth=True)
    table, runs, _ = stepper.observe_start()
    moves = []
    while runs.any():
        passing = PassingColumns._make(split_observation(table).passing[0])
        is_passing = bool(table[0, 8] == Stage.PASS)
        move = Move.CANCEL if is_passing and passing.can_abort_pass else Move.PULL_OUT
        moves.append(int(move))
        values = np.zeros((1, MAX_ACTION_PARTS), np.int32)
        values[0, 0] = move
        table, runs, _ = stepper.step(values, 1)
        if move is Move.CANCEL:
            break
    assert Move.CANCEL in moves
    assert table[0, 8] == Stage.ABORT


@pytest.mark.ci
def test_the_rule_driver_passes_at_once_without_oncoming_traffic_and_otherwise_waits():
    world = scenario(pair(), pair(300.0), road=road(), horizon=25.0)
    driver = Driver(function=built_in_drivers.rules, observation="human", action="decision")
    run = drive(world, driver, engine.run)
    starts = [np.flatnonzero(stage == Stage.PULL_OUT) for stage in run.stage]
    assert len(starts[0])
    met = np.flatnonzero(run.states.s[1, 2] < run.states.s[1, 0])[0]
    assert len(starts[1])
    assert starts[1][0] >= met
