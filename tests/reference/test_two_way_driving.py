"""Another driver among oncoming traffic: what it observes, and the built-in ego as one of them."""

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
    given = load_specification("rural", {"traffic.held_up": 1.0} | changes)
    return ScenarioSource(given, load_road("rural"), seed).sample(np.asarray(numbers, np.uint64))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("kind", "observes_truth"), list(zip(ACTION_KINDS, cycle([False, True]), strict=False))
)
def test_both_engines_observe_the_same_bits(kind, observes_truth):
    given = step_parameters(scenario(*SCENES, road=road(is_open=False), horizon=9.0, num_slots=5))
    values = random_actions(kind, (len(SCENES), 181), seed=2).values
    pair_of = [
        new_stepper(given, kind, observes_truth=observes_truth, simulator=name)
        for name in ("engine", "reference")
    ]
    (table, runs, _), (expected, still, _) = (one.observe_start() for one in pair_of)
    at, met = 0, 0
    while still.any():
        np.testing.assert_array_equal(runs, still)
        np.testing.assert_array_equal(table, expected, err_msg=f"decision {at}")
        met += int(
            split_observation(table)
            .neighbours[:, NEIGHBOUR_ROLES.index("second_oncoming"), 0]
            .sum()
        )
        now = np.ascontiguousarray(values[:, at])
        (table, runs, _), (expected, still, _) = (one.step(now, 1) for one in pair_of)
        at += 1
    assert at > 100
    assert met > 20


@pytest.mark.ci
@pytest.mark.parametrize("kind", ACTION_KINDS)
def test_recorded_actions_have_the_same_bits_on_both_engines(kind):
    world = scenario(*SCENES, road=road(), horizon=9.0, num_slots=5)
    given = step_parameters(world)
    actions = random_actions(kind, (len(SCENES), 181))
    expected = reference.run(world, given, actions=actions)
    for level in LEVELS:
        found = engine.run(world, given, actions=actions, level=level)
        assert not (wrong := difference(found, expected)), f"{level}: {wrong}"


@pytest.mark.ci
def test_the_built_in_ego_as_a_policy_leaves_the_same_trace():
    world = rural(np.arange(64))
    expected = engine.run(world, step_parameters(world))
    found = drive(world, HUMAN, engine.run)
    assert {Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE} <= set(np.unique(expected.stage))
    assert not difference(found.replace(actions=None), expected)


@pytest.mark.ci
def test_it_leaves_the_same_trace_where_it_gives_up():
    gaps = np.arange(200.0, 1500.0, 25.0)
    scenes = [pair(gap, comes=75.0, gap_demand_factor=0.2) for gap in gaps]
    world = scenario(*scenes, road=road(), horizon=20.0)
    expected = engine.run(world, step_parameters(world))
    assert (expected.stage == Stage.ABORT).any()
    assert not difference(drive(world, HUMAN, engine.run).replace(actions=None), expected)


@pytest.mark.ci
def test_the_reference_lets_it_do_the_same():
    world = scenario(*SCENES, road=road(is_open=False), horizon=12.0, num_slots=5)
    expected = engine.run(world, step_parameters(world)).trace_hash
    found = drive(world, HUMAN, reference.run, "reference")
    np.testing.assert_array_equal(found.trace_hash, expected)


@pytest.mark.soak
def test_a_thousand_of_the_rural_profile_leave_the_same_trace():
    same = 0
    for first in range(0, 1000, 100):
        given = load_specification("rural")
        world = ScenarioSource(given, load_road("rural"), 7).sample(
            np.arange(first, first + 100, dtype=np.uint64)
        )
        expected = engine.run(world, step_parameters(world)).trace_hash
        same += int((drive(world, HUMAN, engine.run).trace_hash == expected).all(axis=1).sum())
    assert same == 1000


class Seeing:
    """Stays, and keeps what it observes."""

    def __init__(self) -> None:
        """Have seen nothing."""
        self.tables = []

    def __call__(self, observation):
        """Stay."""
        self.tables.append(observation.table.copy())
        return built_in_drivers.stay(observation)


def observed(observe, *scenes, on=None, horizon: float = 8.0):
    """A simulation, its observed neighbours by role, and the columns about a pass.

    Each column has the shape (decision, simulation).
    """
    world = scenario(*scenes, road=on or road(), horizon=horizon)
    eyes = Seeing()
    run = drive(world, Driver(function=eyes, observation=observe, action="decision"), engine.run)
    _, neighbours, passing = split_observation(np.stack(eyes.tables))
    roles = {
        role: NeighbourColumns._make(np.moveaxis(neighbours[:, :, index], -1, 0))
        for index, role in enumerate(NEIGHBOUR_ROLES)
    }
    return run, roles, PassingColumns._make(np.moveaxis(passing, -1, 0))


def test_the_truth_tells_where_those_who_come_are():
    run, roles, _ = observed("truth", pair(300.0, 420.0))
    frames = np.arange(len(roles["leader"].gap))
    s, d = run.states.s[0, :, frames] / 1e3, run.states.d[0, :, frames] / 1e3
    half = run.scenario.vehicles.length[0] / 2.0
    before = s[:, 2] > s[:, 0]
    for role, slot in (("oncoming", 2), ("second_oncoming", 3)):
        gap = s[:, slot] - s[:, 0] - half[slot] - half[0]
        np.testing.assert_allclose(roles[role].gap[before, 0], gap[before], atol=3e-3)
        aside = (d[:, slot] - d[:, 0])[before]
        np.testing.assert_allclose(roles[role].lateral_distance[before, 0], aside, atol=3e-3)
        closing = -np.diff(gap) / 0.05
        told = roles[role].closing_speed[1:, 0]
        np.testing.assert_allclose(told[before[1:]], closing[before[1:]], atol=0.1)
    assert not roles["oncoming"].stop_lamp.any()


def test_who_is_met_makes_room_for_the_next_one():
    run, roles, _ = observed("truth", pair(150.0, 300.0))
    gap = roles["oncoming"].gap[:, 0]
    meets = int(np.flatnonzero(np.diff(gap) > 50.0)[0])
    assert roles["second_oncoming"].gap[meets, 0] == pytest.approx(gap[meets + 1], abs=5.0)
    assert roles["second_oncoming"].is_detected[meets + 1, 0] == 0
    assert run.states.s[0, 2, meets + 3] < run.states.s[0, 0, meets + 3]


def test_a_human_sees_those_who_come_as_far_as_the_road_shows_them():
    hidden = road(is_open=False)
    run, roles, passing = observed("human", pair(900.0), on=hidden, horizon=12.0)
    sight = passing.sight_distance[:, 0]
    seen = roles["oncoming"].is_detected[:, 0] > 0
    frames = np.arange(len(roles["leader"].gap))
    gap = (run.states.s[0, 2, frames] - run.states.s[0, 0, frames]) / 1e3
    assert seen.any()
    assert (gap[seen] < sight[seen] + 20.0).all()
    assert (roles["oncoming"].gap[~seen] == 1000.0).all()


@pytest.mark.ci
def test_a_sensor_sees_those_who_come_within_its_range(repository):
    radar = Sensor.from_file(repository / "examples" / "radar.toml")
    _, roles, passing = observed(radar, pair(300.0, 380.0))
    for role in ("oncoming", "second_oncoming"):
        seen = roles[role].is_detected[:, 0] > 0
        assert seen.any()
        assert roles[role].gap[seen, 0].max() < radar.range_ahead + 1.0
    assert not passing.gap_ahead_of_leader.any()


def test_an_order_to_give_up_falls_in_behind_who_was_to_be_passed():
    world = scenario(pair(), road=road(), horizon=14.0)
    given = step_parameters(world)
    steps = new_stepper(given, "decision", observes_truth=True)
    table, runs, _ = steps.observe_start()
    moves = []
    while runs.any():
        passing = PassingColumns._make(split_observation(table).passing[0])
        out = bool(table[0, 8] == Stage.PASS)
        move = Move.CANCEL if out and passing.can_abort_pass else Move.PULL_OUT
        moves.append(int(move))
        values = np.zeros((1, MAX_ACTION_PARTS), np.int32)
        values[0, 0] = move
        table, runs, _ = steps.step(values, 1)
        if move is Move.CANCEL:
            break
    assert Move.CANCEL in moves
    assert table[0, 8] == Stage.ABORT


@pytest.mark.ci
def test_the_shipped_rules_pass_where_nobody_comes_and_wait_where_somebody_does():
    world = scenario(pair(), pair(300.0), road=road(), horizon=25.0)
    driver = Driver(function=built_in_drivers.rules, observation="human", action="decision")
    run = drive(world, driver, engine.run)
    starts = [np.flatnonzero(stage == Stage.PULL_OUT) for stage in run.stage]
    assert len(starts[0])
    met = np.flatnonzero(run.states.s[1, 2] < run.states.s[1, 0])[0]
    assert len(starts[1])
    assert starts[1][0] >= met
