"""Rewards are what their definitions say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import overtaking as ot
import overtaking.gym as envs
from overtaking.core.errors import ConfigError
from overtaking.gym.rewards import BREACH_COST, CRASH_COST
from overtaking.model.driver_interface import OBSERVATION_SIZE, EgoColumns
from overtaking.model.overtake_events import Outcome
from overtaking.model.trajectories import Stage
from overtaking.sim.ego_observation import EgoObservation
from overtaking.world.step_parameters import VEHICLE_FIELDS, VehicleParameters

from .test_environments import made, wish

ACTION = np.zeros((2, 2))


def observed(**columns) -> EgoObservation:
    """Two egos that wish for 30 m/s, with values in columns of the ego or of its leader."""
    observation = EgoObservation(
        time=0.0,
        is_running=np.ones(2, bool),
        table=np.zeros((2, OBSERVATION_SIZE), np.float32),
        vehicle=VehicleParameters._make(np.full((len(VEHICLE_FIELDS), 2), 30.0, np.float32)),
    )
    for name, values in columns.items():
        group = observation.ego if name in EgoColumns._fields else observation.leader
        getattr(group, name)[:] = values
    return observation


def events(**changes) -> envs.StepOutcome:
    none = np.zeros(2, bool)
    names = ("terminated", "truncated", "has_crashed", "is_judged", "is_legal", "is_completed")
    return envs.StepOutcome(seconds=np.full(2, 0.5), **(dict.fromkeys(names, none) | changes))


def test_progress_is_time_lost():
    after = observed(s=[15.0, 9.0])  # 0.5 s at the wished 30 m/s, and at 18 m/s.
    lost = envs.progress(observed(), ACTION, after, events())
    np.testing.assert_allclose(lost, [0.0, -0.2], atol=1e-6)
    crashed = envs.progress(observed(), ACTION, after, events(has_crashed=np.array([True, False])))
    np.testing.assert_allclose(crashed, [-CRASH_COST, -0.2], atol=1e-6)


def test_following_too_close_costs_by_what_the_gap_lacks():
    # At equal speeds the lawful gap is the way in the reaction time, 1 s: 20 m.
    after = observed(s=15.0, speed=20.0, is_detected=1.0, gap=[10.0, 25.0])
    cost = envs.progress_legal(observed(), ACTION, after, events())
    np.testing.assert_allclose(cost, [-0.25, 0.0], atol=1e-6)


def test_a_breach_costs_at_the_end():
    ended = np.ones(2, bool)
    judged = events(truncated=ended, is_judged=ended, is_legal=np.array([True, False]))
    after = observed(s=15.0, gap=1000.0)
    cost = envs.progress_legal(observed(), ACTION, after, judged)
    np.testing.assert_allclose(cost, [0.0, -BREACH_COST], atol=1e-6)
    with pytest.raises(ConfigError, match="labels=True"):
        envs.progress_legal(observed(), ACTION, after, events(truncated=ended))


def test_an_overtake_counts_where_the_label_says_that_it_was_completed():
    ended = np.ones(2, bool)
    completed, crashed = np.array([True, False]), np.array([False, True])
    outcome = events(terminated=ended, is_judged=ended, is_completed=completed, has_crashed=crashed)
    after = observed(stage=[Stage.DONE, Stage.CRASHED])
    np.testing.assert_array_equal(
        envs.overtake_once(observed(), ACTION, after, outcome), [1.0, -1.0]
    )
    assert (envs.overtake_once(observed(), ACTION, after, events()) == 0.0).all()
    with pytest.raises(ConfigError, match="labels=True"):
        envs.overtake_once(observed(), ACTION, after, events(terminated=ended))


def test_a_step_costs_its_own_length():
    """An episode that ended after 0.2 s of a step is charged for 0.2 s."""
    outcome = events()
    outcome = dataclasses.replace(outcome, seconds=np.array([0.5, 0.2]))
    lost = envs.progress(observed(), ACTION, observed(s=[9.0, 3.0]), outcome)
    np.testing.assert_allclose(lost, [-0.2, -0.1], atol=1e-6)


def test_progress_of_an_environment_follows_from_its_observations():
    """The loss is the length of the step minus the time for its distance at the desired speed."""
    env = made(8, reward="progress", action="decision", action_repeat=10, overrides=None)
    index = [column.name for column in envs.OBSERVATION_COLUMNS].index("ego.s")
    before, _ = env.reset(seed=2)
    assert env._episodes
    wished_speed = env._episodes.ego_observation.vehicle.desired_speed.astype(float)
    losses = []
    for _ in range(10):
        after, reward, terminated, *_ = env.step(np.full(8, ot.Move.KEEP))
        assert not terminated.any()
        lost = np.maximum(0.5 - (after[:, index] - before[:, index]) / wished_speed, 0.0)
        np.testing.assert_allclose(reward, -lost, atol=1e-4)
        losses.append(lost)
        before = after
    assert 0.01 < np.mean(losses) < 0.4


def pull_out_near_a_leader(observations: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """Pull out behind a leader that is slower, and return 30 steps later."""
    table = dict(
        zip([column.name for column in envs.OBSERVATION_COLUMNS], observations.T, strict=True)
    )
    is_held_up = (table["leader.closing_speed"] > 1.0) & (table["leader.gap"] < 60.0)
    move = np.where(is_held_up, ot.Move.PULL_OUT, ot.Move.KEEP)
    return np.where(clock % 40 > 30, ot.Move.RETURN, move)


def pull_out_and_return_in_turns(observations: np.ndarray, clock: np.ndarray) -> np.ndarray:
    return np.where(clock % 24 < 12, ot.Move.PULL_OUT, ot.Move.RETURN)


def give_up_often(observations: np.ndarray, clock: np.ndarray) -> np.ndarray:
    return np.choose(clock // 5 % 3, [ot.Move.PULL_OUT, ot.Move.CANCEL, ot.Move.RETURN])


def stay_out(observations: np.ndarray, clock: np.ndarray) -> np.ndarray:
    return np.full(len(clock), ot.Move.PULL_OUT)


@pytest.mark.ci
@pytest.mark.parametrize(
    "driver", [pull_out_near_a_leader, pull_out_and_return_in_turns, give_up_often, stay_out]
)
def test_overtake_once_and_the_label_agree(driver):
    """The reward follows the label also after a second pull-out with another target."""
    env = made(
        50,
        action_repeat=10,
        action="decision",
        reward="overtake_once",
        with_labels=True,
        overrides=None,
    )
    observations, _ = env.reset(seed=3)
    clock, completed, rewarded = np.zeros(50, int), list[bool](), list[bool]()
    while len(completed) < 250:
        observations, reward, terminated, truncated, info = env.step(driver(observations, clock))
        ended = terminated | truncated
        clock = np.where(ended, 0, clock + 1)
        completed += (info["outcome"][ended] == Outcome.COMPLETED).tolist()
        rewarded += (reward[ended] == 1.0).tolist()
    assert rewarded == completed
    if driver is not stay_out:
        assert any(completed)


@pytest.mark.parametrize("name", envs.REWARDS)
def test_an_environment_pays_it(name):
    env = made(8, reward=name, with_labels=True)
    seen_now, _ = env.reset(seed=2)
    paid = np.zeros(8)
    for _ in range(35):
        seen_now, reward, *_ = env.step(wish(seen_now))
        assert np.isfinite(reward).all()
        paid += reward
    assert paid.any()


def test_a_function_of_ones_own_is_a_reward():
    def speed(
        before: EgoObservation, action: np.ndarray, after: EgoObservation, came: envs.StepOutcome
    ) -> np.ndarray:
        return after.ego.speed.astype(np.float64)

    env = made(reward=speed)
    env.reset(seed=1)
    seen_now, reward, *_ = env.step(np.zeros((6, 2)))
    np.testing.assert_allclose(reward, seen_now[:, 0], rtol=1e-6)
