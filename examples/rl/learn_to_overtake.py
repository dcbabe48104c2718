r"""Train a driver with PPO, and drive with it.

    python examples/rl/learn_to_overtake.py --profile motorway --steps 200000 --out learned.zip

Needs Stable-Baselines3 (`make rl`, then `.venv-rl/bin/python`). The driver decides twice a second
when to signal, pull out, give up and return; pedals and steering are those of the scenario's
driver. It sees the truth, as an automated car with good sensors would. A rule guards the trained
network: no lane change begins where the gap is too small. Training takes minutes on two cores.
"""

# pyright: reportMissingImports=false, reportUnknownParameterType=false

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import overtaking as ot
from overtaking.core.elementary import Mask
from overtaking.gym import flat
from overtaking.gym.stable_baselines import StableBaselinesVecEnv

HOLD = 10  # Decisions for which an answer holds, 0.5 s.
ENVS = 64
FIRST = 1_000_000  # Scenes of training: those of an evaluation begin at 0.
AHEAD, FAR_AHEAD = 1.0, 4.0  # Time gap, and time to close it, that a lane change needs [s].
BEHIND, FAR_BEHIND = 10.0, 6.0  # Gap [m], and time in which it is not closed [s].


class Learned:
    """A trained network as a policy of `overtaking.drive`: observe the truth, answer `decision`.

    Args:
        path: What `train` has saved.
    """

    def __init__(self, path: str | Path = "learned.zip") -> None:
        """Load the network."""
        self.model = PPO.load(path, device="cpu")

    def __call__(self, seen: ot.Observation) -> NDArray[Any]:
        """A move for each simulation: no lane change into a gap that is too small."""
        move = self.model.predict(flat(seen, scaled=True), deterministic=True)[0]
        move = np.where((move == ot.Move.PULL_OUT) & ~clear(seen, "fast"), ot.Move.SHOW_OUT, move)
        return np.where((move == ot.Move.RETURN) & ~clear(seen, "slow"), ot.Move.SHOW_BACK, move)


def clear(seen: ot.Observation, side: str) -> Mask:
    """Whether there is a gap in the next lane on a side."""
    closing, nearing = (
        np.maximum(seen.of("closing", f"{side}_{end}"), 0.0) for end in ("lead", "rear")
    )
    ahead = seen.of("gap", f"{side}_lead") > AHEAD * seen.of("speed") + FAR_AHEAD * closing
    return ahead & (seen.of("gap", f"{side}_rear") > BEHIND + FAR_BEHIND * nearing)


def train(profile: str, steps: int, seed: int) -> PPO:
    """Train a network.

    Args:
        profile: What it drives in.
        steps: Of all environments together, each of half a second.
        seed: Of scenes, initial weights and exploration.
    """
    envs = StableBaselinesVecEnv(
        profile,
        ENVS,
        seed=seed,
        first=FIRST,
        observe="truth",
        action="decision",
        hold=HOLD,
        reward="progress",
        scaled=True,
        labels=False,
    )
    model = PPO(
        "MlpPolicy",
        VecNormalize(VecMonitor(envs), norm_obs=False),
        n_steps=64,
        batch_size=256,
        gamma=0.99,
        seed=seed,
        device="cpu",
        verbose=1,
    )
    return model.learn(steps)


def main() -> None:
    """Train, save, and say how it fares in scenes that it has not seen."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--profile", default="motorway")
    options.add_argument("--steps", type=int, default=200_000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--out", type=Path, default=Path("learned.zip"))
    given = options.parse_args()
    train(given.profile, given.steps, given.seed).save(given.out)
    scenes = ot.sample(given.profile, 100, seed=1)
    runs = ot.drive(scenes, Learned(given.out), observe="truth", action="decision", hold=HOLD)
    labels = ot.label(runs)
    print(f"100 scenes: {labels.events.attempted.sum()} overtakes begun", end=", ")
    print(f"{labels.events.completed.sum()} completed", end=", ")
    print(f"{np.count_nonzero(labels.events.collision >= 0)} collisions")


if __name__ == "__main__":
    main()
