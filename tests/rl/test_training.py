"""Drivers are trained in the environments and drive; run by `make test-rl`."""

# pyright: reportMissingImports=false

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import overtaking as ot
from overtaking.api import evaluation

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.rl
pytest.importorskip("stable_baselines3", reason="run by make test-rl")

SHORT = {"time.horizon_s": 8.0, "time.attempt_deadline_s": 6.0}
PROFILE = "pinto2023-physical"


def vec_env(count: int = 4, **settings: Any):
    from overtaking.gym.stable_baselines import StableBaselinesVecEnv

    given = {"observation": "truth", "action_repeat": 10, "overrides": SHORT}
    return StableBaselinesVecEnv(PROFILE, count, seed=3, **(given | settings))


@pytest.mark.parametrize("action", ["accel_lane", "accel_steer", "decision"])
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")  # Our actions have units.
def test_stable_baselines_accepts_an_environment(action):
    from stable_baselines3.common.env_checker import check_env

    from overtaking.gym import OvertakingEnv

    check_env(
        OvertakingEnv(
            PROFILE, observation="human", action=action, action_repeat=10, overrides=SHORT
        )
    )


def test_who_has_ended_begins_at_once_and_is_told_of():
    env = vec_env(with_labels=True)
    env.reset()
    for _ in range(20):
        seen, reward, done, infos = env.step(np.zeros((4, 2), np.float32))
        assert reward.dtype == np.float32
        for row in np.flatnonzero(done):
            last = infos[row]["terminal_observation"]
            assert env.observation_space.contains(last)
            assert not np.array_equal(last, seen[row])
            assert {"outcome", "legal", "TimeLimit.truncated"} <= set(infos[row])
            return
    pytest.fail("no episode has ended")


def test_a_seed_repeats_everything():
    first, second = (vec_env().reset() for _ in range(2))
    np.testing.assert_array_equal(first, second)
    env = vec_env()
    env.seed(9)
    assert not np.array_equal(env.reset(), first)


def test_a_driver_learns_to_avoid_accidents(tmp_path: Path):
    """PPO, a few thousand steps; what is saved is a policy of `drive` that repeats itself."""
    from examples.rl.learn_to_overtake import HOLD, Learned, train

    model = train(12_288, seed=1, profiles=["motorway"])
    last = np.mean([episode["r"] for episode in model.ep_info_buffer])
    assert last > -30.0, "half of the drivers who do anything have accidents: about -50"
    model.save(tmp_path / "learned.zip")
    scenes = ot.sample(PROFILE, num_simulations=20, seed=1)
    runs = [
        ot.drive(scenes, Learned(path), observation="truth", action="decision", action_repeat=HOLD)
        for path in [tmp_path / "learned.zip"] * 2
    ]
    np.testing.assert_array_equal(runs[0].trace_hash, runs[1].trace_hash)
    assert runs[0].actions
    assert runs[0].actions.values.any()


def test_a_network_in_onnx_drives_as_the_trained_one(tmp_path: Path):
    """With bounds, scales and the rule that guards it."""
    from examples.rl.export_to_onnx import export
    from examples.rl.learn_to_overtake import HOLD, Learned, train

    model = train(4096, seed=2)
    model.save(tmp_path / "learned.zip")
    export(model, tmp_path / "learned.onnx")
    driver = evaluation.load_driver(
        str(tmp_path / "learned.onnx"), "truth", action="decision", action_repeat=HOLD
    )
    scenes = ot.sample(PROFILE, num_simulations=40, seed=1)
    runs = [
        ot.drive(scenes, policy, observation="truth", action="decision", action_repeat=HOLD)
        for policy in (Learned(tmp_path / "learned.zip"), driver.function)
    ]
    np.testing.assert_array_equal(runs[0].trace_hash, runs[1].trace_hash)
    assert str(tmp_path).encode() not in (tmp_path / "learned.onnx").read_bytes()


def test_the_notebook_runs(repository: Path, workdir: Path):
    """With a short training."""
    page = repository / "docs" / "tutorials" / "train-a-driver.ipynb"
    cells = json.loads(page.read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    text = "\n".join(code)
    assert "steps=98_304" in text
    exec(compile(text.replace("steps=98_304", "steps=4096"), page, "exec"), {"__name__": "page"})
    assert (workdir / "learned.zip").exists()
