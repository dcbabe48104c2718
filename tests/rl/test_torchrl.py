"""TorchRL's `GymWrapper` drives the vector environment; run by `make test-rl`."""

# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.rl
pytest.importorskip("torchrl", reason="run by make test-rl")

STEPS = 100
SHORT = {"time.horizon_s": 8.0, "time.attempt_deadline_s": 6.0}
INFO = {"scenario_index", "stage", "num_clipped", "outcome", "is_legal", "num_broken"}


def make_env(mode: str):
    from overtaking.gym import OvertakingVectorEnv

    return OvertakingVectorEnv(
        "pinto2023-physical",
        4,
        action_repeat=10,
        observation="truth",
        reward="overtake_once",
        with_labels=True,
        overrides=SHORT,
        autoreset_mode=mode,
    )


def roll_out(mode: str) -> Any:
    """A rollout of random actions, a TensorDict of shape (env, step)."""
    import torch
    from torchrl.envs import GymWrapper

    torch.manual_seed(1)
    env = GymWrapper(make_env(mode))
    if not env.info_dict_reader:  # TorchRL reads `info` by itself in the mode SAME_STEP only.
        env = env.auto_register_info_dict()
    env.set_seed(3)
    return env.rollout(STEPS, break_when_any_done=False)


@pytest.mark.parametrize("mode", ["SAME_STEP", "DISABLED"])
def test_a_rollout_has_the_steps_of_the_environment(mode: str):
    rollout = roll_out(mode)
    assert tuple(rollout.shape) == (4, STEPS)
    steps = {name: rollout["next", name].numpy() for name in ("reward", "done", "terminated")}
    assert set(rollout["next"].keys()) >= INFO
    assert steps["done"].sum() > 20
    env = make_env("SAME_STEP")
    env.reset(seed=3)
    observation, _ = env.reset()
    for step in range(STEPS):
        np.testing.assert_array_equal(rollout["observation"][:, step].numpy(), observation)
        action = rollout["action"][:, step].numpy()
        observation, reward, terminated, truncated, info = env.step(action)
        ended = terminated | truncated
        np.testing.assert_array_equal(steps["reward"][:, step, 0], reward.astype(np.float32))
        np.testing.assert_array_equal(steps["done"][:, step, 0], ended)
        np.testing.assert_array_equal(steps["terminated"][:, step, 0], terminated)
        last = observation.copy()
        if ended.any():
            last[ended] = np.stack(list(info["final_obs"][ended]))
        np.testing.assert_array_equal(rollout["next", "observation"][:, step].numpy(), last)


def test_torchrl_accepts_the_declared_spaces():
    from torchrl.envs import GymWrapper
    from torchrl.envs.utils import check_env_specs

    check_env_specs(GymWrapper(make_env("SAME_STEP")))
