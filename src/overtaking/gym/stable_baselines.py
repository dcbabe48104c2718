"""Adapter of `OvertakingVectorEnv` for Stable-Baselines3, a library of learning algorithms.

The library has its own interface (`VecEnv`) for many environments that step together. It divides
`step` into two calls, `step_async` and `step_wait`, and replaces an ended episode at once.

    from stable_baselines3 import PPO
    from overtaking.gym.stable_baselines import StableBaselinesVecEnv

    envs = StableBaselinesVecEnv("motorway", 64, observation="truth", reward="progress")
    PPO("MlpPolicy", envs).learn(100_000)
"""

# Stable-Baselines3 is large and only installed in .venv-rl (`make rl`), which pyright does not see.
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
    """Environments of one batch for Stable-Baselines3; in each, an agent drives a vehicle.

    Args:
        profile: Profile of the scenarios: a name, a TOML file, or a specification.
        num_envs: Number of environments.
        seed: Seed of the scenarios; None for a random one from the system.
        **settings: Other arguments of `OvertakingVectorEnv`, without `autoreset_mode`.

    Attributes:
        batch: The environments with Gymnasium's interface.
    """

    def __init__(
        self, profile: ProfileSource, num_envs: int, *, seed: int | None = None, **settings: Any
    ) -> None:
        """Make the environments."""
        mode = AutoresetMode.SAME_STEP  # `VecEnv` replaces an ended episode at once.
        self.batch = OvertakingVectorEnv(profile, num_envs, autoreset_mode=mode, **settings)
        self._first_seed, self._actions = seed, np.zeros(0)
        super().__init__(
            num_envs, self.batch.single_observation_space, self.batch.single_action_space
        )

    def reset(self) -> F32:
        """Begin new episodes in all environments; return their observations, shape (env, column).

        If `VecEnv.seed` was called since the last reset, its seed is used; else, at the first
        reset, the seed of the constructor. Without a seed the sequence of scenarios continues.
        """
        # `VecEnv.seed` stores a seed for each environment in `_seeds`. The batch has one seed for
        # all, and the scenarios of its environments differ anyway, so the first one is used.
        seed = next((seed for seed in self._seeds if seed is not None), self._first_seed)
        self._first_seed = None
        self._reset_seeds()
        return self.batch.reset(seed=seed)[0]

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions for `step_wait`.

        Args:
            actions: Actions in `action_space`. Shape (env, part) if an action has several numbers,
                such as acceleration and wheel angle; (env,) if it is one number, such as a `Move`.
        """
        self._actions = actions

    def step_wait(self) -> tuple[F32, NDArray[np.float32], NDArray[np.bool_], list[Info]]:
        """Carry out the stored actions; where an episode ends, the next one begins.

        Returns:
            Observations, shape (env, column); rewards and which episodes have ended, shape (env,);
            and a dictionary for each environment, empty unless an episode has ended. Then it holds
            the `info` of its end, `terminal_observation` (the last one of the episode) and
            `TimeLimit.truncated`, the keys that the library reads.
        """
        observations, reward, terminated, truncated, info = self.batch.step(self._actions)
        infos: list[Info] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(terminated | truncated):
            final: Info = info["final_info"]  # Exists only in steps in which an episode ends.
            # Names that begin with "_" are Gymnasium's masks of the environments with a value; the
            # value of a single environment needs no mask.
            infos[row] = {name: final[name][row] for name in final if not name.startswith("_")} | {
                "terminal_observation": info["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row]),
            }
        # The library stores rewards as float32.
        return observations, reward.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """Free the simulations."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The value of an attribute for each environment; all share the batch's value."""
        return [getattr(self.batch, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Raise a `ConfigError`, because the environments of a batch share their attributes."""
        del attr_name, value, indices
        raise _only_together("set_attr")

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **named: Any
    ) -> list[Any]:
        """Raise a `ConfigError`, because a batch has no method for a single environment."""
        del method_name, args, indices, named
        raise _only_together("env_method")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """False for each environment: the environments of a batch cannot be wrapped."""
        del wrapper_class
        return [False] * len(list(self._get_indices(indices)))


def _only_together(name: str) -> ConfigError:
    """The error for a method of `VecEnv` that is for a single environment."""
    return ConfigError(
        what=name,
        where="StableBaselinesVecEnv",
        expected="settings that all environments share",
        got="a call for single ones",
        next_step="give settings when the environments are made",
    )
