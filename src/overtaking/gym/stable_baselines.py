"""The vector environment for Stable-Baselines3, which has a class of its own for them.

from stable_baselines3 import PPO
from overtaking.gym.stable_baselines import StableBaselinesVecEnv

envs = StableBaselinesVecEnv("motorway", 64, observation="truth", reward="progress", normalize=True)
PPO("MlpPolicy", envs).learn(100_000)
"""

# It is in .venv-rl only.
# pyright: reportMissingImports=false, reportUntypedBaseClass=false
# pyright: reportUnknownVariableType=false

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from overtaking.api.simulator_registry import ProfileSource
from overtaking.core.arrays import F32
from overtaking.core.errors import ConfigError
from overtaking.gym.environments import Info, OvertakingVectorEnv


class StableBaselinesVecEnv(VecEnv):
    """Environments in one batch, for algorithms of Stable-Baselines3.

    Args:
        profile: Profile of the scenarios, as in `overtaking.sample`.
        num_envs: How many environments.
        seed: Seed of the scenarios; None for one from the system.
        **settings: The other arguments of `OvertakingVectorEnv`.
    """

    def __init__(
        self, profile: ProfileSource, num_envs: int, *, seed: int | None = None, **settings: Any
    ) -> None:
        """Make the environments."""
        mode = AutoresetMode.SAME_STEP
        self.batch = OvertakingVectorEnv(profile, num_envs, autoreset_mode=mode, **settings)
        self._first_seed, self._actions = seed, np.zeros(0)
        super().__init__(
            num_envs, self.batch.single_observation_space, self.batch.single_action_space
        )

    def reset(self) -> F32:
        """Begin new episodes in all environments."""
        seed = next((seed for seed in self._seeds if seed is not None), self._first_seed)
        self._first_seed = None
        self._reset_seeds()
        return self.batch.reset(seed=seed)[0]

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[F32, NDArray[np.float32], NDArray[np.bool_], list[Info]]:
        """Carry out the actions of `step_async`; where an episode ends, the next one begins.

        Returns:
            Observations, rewards, which episodes have ended, and a dictionary for each environment.
            Where an episode has ended, it holds the `info` of its end and its last observation.
        """
        observations, reward, terminated, truncated, info = self.batch.step(self._actions)
        infos: list[Info] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(terminated | truncated):
            final: Info = info["final_info"]
            infos[row] = {name: final[name][row] for name in final if not name.startswith("_")} | {
                "terminal_observation": info["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row]),
            }
        return observations, reward.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """Free the simulations."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, the same in all environments."""
        return [getattr(self.batch, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: environments of one batch are alike."""
        del attr_name, value, indices
        raise _only_together("set_attr")

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **named: Any
    ) -> list[Any]:
        """Refuse: environments of one batch have no methods of their own."""
        del method_name, args, indices, named
        raise _only_together("env_method")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No environment has a wrapper."""
        del wrapper_class
        return [False] * len(list(self._get_indices(indices)))


def _only_together(name: str) -> ConfigError:
    return ConfigError(
        what=name,
        where="StableBaselinesVecEnv",
        expected="settings that all environments share",
        got="a call for single ones",
        next_step="give settings when the environments are made",
    )
