r"""Train a driver with PPO, and drive with it.

    python examples/rl/learn_to_overtake.py --steps 98304 --out learned.zip

Needs Stable-Baselines3 (`make rl`, then `.venv-rl/bin/python`). The driver decides once a second
when to signal, pull out, give up and return; pedals and steering are those of the scenario's
driver. It learns in two profiles in turns, because what it learns in one does not hold in others.
It sees the truth, as an automated car with good sensors would. In training and afterwards a rule
guards it: no lane change begins where the gap is too small. Training takes minutes on a core.
"""

# pyright: reportMissingImports=false, reportUnknownParameterType=false
# pyright: reportUntypedBaseClass=false, reportUnknownVariableType=false

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import Space
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.vec_env import VecEnvWrapper, VecMonitor, VecNormalize

import overtaking as ot
from overtaking.core.arrays import F32
from overtaking.gym import OBSERVATION_COLUMNS, StepOutcome, flatten_observation, progress
from overtaking.gym.stable_baselines import StableBaselinesVecEnv
from overtaking.sim.ego_observation import EgoObservation

HOLD = 20  # Decisions for which an answer holds, 1 s.
PROFILES = ("motorway", "pinto2023")
STEPS = 98_304
TURN = 8192  # Steps in a profile before the next one has its turn.
ENVS = 64
FIRST = 1_000_000  # Scenes of training: those of an evaluation begin at 0.
SIGNAL = 0.95  # Time from the indicator to the movement, as UN R79 asks [s].
HEADWAY, BEHIND = 1.0, 10.0  # Time gap ahead [s], and gap behind [m], that a lane change needs.
FAR_AHEAD, FAR_BEHIND = 5.0, 6.0  # Times in which these gaps are not closed [s].
NEAR = 3.0  # Time in which the vehicle that is left behind is not reached [s].
TARDY = 0.5  # Cost of each second in which the target is passed and the ego has not returned [s].

KEEP, INDICATE_PULL_OUT, PULL_OUT, INDICATE_RETURN, RETURN = map(int, list(ot.Move)[:5])

UNSEEN = ("ego.s", "ego.lateral_position", "ego.lane")  # They mean nothing on another road.

_PLACES = {column.name: (place, column.scale) for place, column in enumerate(OBSERVATION_COLUMNS)}


def guarded(move: Any, seen: Any, where: Callable[..., Any] = np.where) -> Any:
    """What is answered: nothing but an indicator as long as a lane change is not safe.

    Args:
        move: A `Move` of each simulation.
        seen: What is observed, scaled, shape (simulation, `COLUMNS`).
        where: `torch.where` for tensors.
    """
    shown = (number(seen, "ego.time_indicating") >= SIGNAL) & (number(seen, "ego.gives_way") == 0)
    follows = number(seen, "ego.stage") == float(ot.Stage.FOLLOW)
    out = follows & shown & has_gap(seen, "left") & (time_to(seen, "leader") > NEAR)
    move = where((move == PULL_OUT) & ~out, INDICATE_PULL_OUT, move)
    move = where((move == INDICATE_PULL_OUT) & ~follows, KEEP, move)
    back = shown & has_gap(seen, "right")
    return where((move == RETURN) & ~back, INDICATE_RETURN, move)


def has_gap(seen: Any, side: str) -> Any:
    """Whether there is a gap in the next lane on a side, `left` or `right`."""
    ahead, behind = f"{side}_leader", f"{side}_follower"
    is_free = number(seen, f"{ahead}.gap") > HEADWAY * number(seen, "ego.speed")
    is_free &= number(seen, f"{behind}.gap") > BEHIND
    return is_free & (time_to(seen, ahead) > FAR_AHEAD) & (time_to(seen, behind) > FAR_BEHIND)


def time_to(seen: Any, role: str) -> Any:
    """Time in which a gap is closed [s]."""
    return number(seen, f"{role}.gap") / number(seen, f"{role}.closing_speed").clip(min=1e-3)


def number(seen: Any, name: str) -> Any:
    """A number of what is observed, in SI units."""
    place, scale = _PLACES[name]
    return seen[:, place] * scale


class Guarded(VecEnvWrapper):
    """Environments in which the rule guards what is answered."""

    def reset(self) -> F32:
        """Begin new episodes in all of them."""
        self._seen = self.venv.reset()
        return self._seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the answers of the next step."""
        self.venv.step_async(guarded(actions, self._seen))

    def step_wait(self) -> Any:
        """Carry them out."""
        stepped = self.venv.step_wait()
        self._seen = stepped[0]
        return stepped


class AnyRoad(FlattenExtractor):
    """The first layer of the networks: leaves out `UNSEEN`."""

    def __init__(self, observation_space: Space[Any]) -> None:
        """Keep what is seen."""
        super().__init__(observation_space)
        known = [column.name not in UNSEEN for column in OBSERVATION_COLUMNS]
        self.register_buffer("known", torch.tensor(known, dtype=torch.float32))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """The numbers of an observation, shape (simulation, `COLUMNS`), some of them zero."""
        return observations * self.known


class Learned:
    """A trained network as a driver for `overtaking.drive`: observe the truth, answer `decision`.

    Args:
        path: What `train` has saved.
    """

    def __init__(self, path: str | Path = "learned.zip") -> None:
        """Load the network."""
        self.model = PPO.load(path, device="cpu")

    def __call__(self, observation: ot.Observation) -> NDArray[Any]:
        """A move for each simulation."""
        inputs = flatten_observation(observation, normalize=True)
        return guarded(self.model.predict(inputs, deterministic=True)[0], inputs)


def soon_back(
    observation: EgoObservation,
    action: NDArray[Any],
    next_observation: EgoObservation,
    outcome: StepOutcome,
) -> NDArray[Any]:
    """The reward `progress`, less what it costs to stay out once the target is passed.

    Args:
        observation: Observation before the step.
        action: Actions.
        next_observation: Observation after the step.
        outcome: Outcome of the step.
    """
    stage = next_observation.ego.stage
    is_tardy = (next_observation.ego.has_passed_target > 0) & (stage == ot.Stage.PASS)
    reward = progress(observation, action, next_observation, outcome)
    return reward - TARDY * outcome.seconds * is_tardy


def train(steps: int, seed: int, profiles: Sequence[str] = PROFILES) -> PPO:
    """Train a network.

    Args:
        steps: Of all environments together, each of a second; whole turns of each profile.
        seed: Of scenes, initial weights and exploration.
        profiles: What it drives in, in turns.
    """
    worlds = [_environments(one, seed) for one in profiles]
    model = PPO(
        "MlpPolicy",
        worlds[0],
        n_steps=64,
        batch_size=256,
        gamma=0.99,
        seed=seed,
        device="cpu",
        verbose=1,
        policy_kwargs={"features_extractor_class": AnyRoad},
    )
    for _ in range(-(-steps // (TURN * len(worlds)))):
        for world in worlds:
            model.set_env(world)
            model.learn(TURN, reset_num_timesteps=False)
    return model


def _environments(profile: str, seed: int) -> VecNormalize:
    """Guarded environments of a profile, with scaled rewards."""
    envs = StableBaselinesVecEnv(
        profile,
        ENVS,
        seed=seed,
        first_scenario=FIRST,
        observation="truth",
        action="decision",
        action_repeat=HOLD,
        reward=soon_back,
        normalize=True,
    )
    return VecNormalize(VecMonitor(Guarded(envs)), norm_obs=False)


def main() -> None:
    """Train, save, and say how it fares in scenes that it has not seen."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--profiles", nargs="+", default=PROFILES)
    options.add_argument("--steps", type=int, default=STEPS)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--out", type=Path, default=Path("learned.zip"))
    given = options.parse_args()
    train(given.steps, given.seed, given.profiles).save(given.out)
    scenario = ot.sample(given.profiles[0], num_simulations=100, seed=1)
    trajectories = ot.drive(
        scenario, Learned(given.out), observation="truth", action="decision", action_repeat=HOLD
    )
    labels = ot.label(trajectories)
    print(f"100 scenes: {labels.events.has_attempt.sum()} overtakes begun", end=", ")
    print(f"{labels.events.is_completed.sum()} completed", end=", ")
    print(f"{np.count_nonzero(labels.events.collision >= 0)} collisions")


if __name__ == "__main__":
    main()
