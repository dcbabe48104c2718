"""Rewards are what their definitions say."""

from __future__ import annotations

import numpy as np
import pytest

import overtaking.gym as envs
from overtaking.core.errors import ConfigError
from overtaking.gym.rewards import BREACH_COST, CRASH_COST
from overtaking.model.observation import AROUND, MEETING, OWN, ROLES
from overtaking.model.trajectory import Stage
from overtaking.sim.observation import Seen
from overtaking.world.parameters import VEHICLE_FIELDS, VehicleParameters

from .test_environments import made, wish

ACTION = np.zeros((2, 2))


def seen(**numbers) -> Seen:
    """Two egos that wish for 30 m/s."""
    own, around = np.zeros((2, len(OWN)), np.float32), np.zeros((2, len(ROLES), len(AROUND)))
    for name, value in numbers.items():
        if name in OWN:
            own[:, list(OWN).index(name)] = value
        else:
            around[:, 0, list(AROUND).index(name)] = value
    wish_of = VehicleParameters._make(np.full((len(VEHICLE_FIELDS), 2), 30.0, np.float32))
    around = around.astype(np.float32)
    meeting = np.zeros((2, len(MEETING)), np.float32)
    return Seen(
        time=0.0,
        active=np.ones(2, bool),
        own=own,
        around=around,
        meeting=meeting,
        driver=wish_of,
    )


def events(**changes) -> envs.Events:
    none = np.zeros(2, bool)
    names = ("terminated", "truncated", "crashed", "judged", "legal")
    return envs.Events(seconds=0.5, **(dict.fromkeys(names, none) | changes))


def test_progress_is_time_lost():
    after = seen(position=[15.0, 9.0])  # 0.5 s at the wished 30 m/s, and at 18 m/s.
    lost = envs.progress(seen(), ACTION, after, events())
    np.testing.assert_allclose(lost, [0.0, -0.2], atol=1e-6)
    crashed = envs.progress(seen(), ACTION, after, events(crashed=np.array([True, False])))
    np.testing.assert_allclose(crashed, [-CRASH_COST, -0.2], atol=1e-6)


def test_following_too_close_costs_by_what_the_gap_lacks():
    # At equal speeds the lawful gap is the way in the reaction time, 1 s: 20 m.
    after = seen(position=15.0, speed=20.0, detected=1.0, gap=[10.0, 25.0])
    cost = envs.progress_legal(seen(), ACTION, after, events())
    np.testing.assert_allclose(cost, [-0.25, 0.0], atol=1e-6)


def test_a_breach_costs_at_the_end():
    ended = np.ones(2, bool)
    judged = events(truncated=ended, judged=ended, legal=np.array([True, False]))
    after = seen(position=15.0, gap=1000.0)
    cost = envs.progress_legal(seen(), ACTION, after, judged)
    np.testing.assert_allclose(cost, [0.0, -BREACH_COST], atol=1e-6)
    with pytest.raises(ConfigError, match="labels=True"):
        envs.progress_legal(seen(), ACTION, after, events(truncated=ended))


def test_an_overtake_counts_once():
    done = events(terminated=np.array([True, True]), crashed=np.array([False, True]))
    after = seen(stage=[Stage.DONE, Stage.CRASHED])
    np.testing.assert_array_equal(envs.overtake_once(seen(), ACTION, after, done), [1.0, -1.0])
    assert (envs.overtake_once(seen(), ACTION, after, events()) == 0.0).all()


@pytest.mark.parametrize("name", envs.REWARDS)
def test_an_environment_pays_it(name):
    env = made(8, reward=name, labels=True)
    seen_now, _ = env.reset(seed=2)
    paid = np.zeros(8)
    for _ in range(35):
        seen_now, reward, *_ = env.step(wish(seen_now))
        assert np.isfinite(reward).all()
        paid += reward
    assert paid.any()


def test_a_function_of_ones_own_is_a_reward():
    def speed(before: Seen, action: np.ndarray, after: Seen, came: envs.Events) -> np.ndarray:
        return after.of("speed").astype(np.float64)

    env = made(reward=speed)
    env.reset(seed=1)
    seen_now, reward, *_ = env.step(np.zeros((6, 2)))
    np.testing.assert_allclose(reward, seen_now[:, 0], rtol=1e-6)
