"""One environment, as Gymnasium's `Env`."""

from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from overtaking.api.choices import Profile
from overtaking.core.arrays import F32
from overtaking.gym.vector import Info, OvertakingVectorEnv


class OvertakingEnv(Env[F32, Any]):
    """An environment in which a policy drives the ego.

    It costs nearly as much as sixteen of an `OvertakingVectorEnv`, which explains everything.

    Args:
        profile: What to sample, as in `overtaking.sample`.
        observe: `human` for what the model's driver believes, or `truth`.
        **settings: The other arguments of `OvertakingVectorEnv`.

    Raises:
        ConfigError: An argument cannot be used.
    """

    def __init__(self, profile: Profile, *, observe: str, **settings: Any) -> None:
        """Check what is asked for; `reset` draws the first scenario."""
        self._batch = OvertakingVectorEnv(
            profile, 1, observe=observe, autoreset_mode=AutoresetMode.DISABLED, **settings
        )
        self.metadata = {"render_modes": []}
        self.render_mode = self._batch.render_mode
        self.observation_space = self._batch.single_observation_space
        self.action_space = self._batch.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[F32, Info]:
        """Begin a new episode.

        Args:
            seed: Seed of the scenarios; with None the episode that follows, or a seed from the
                system at first.
            options: None are known.
        """
        super().reset(seed=seed)
        del options
        seen, info = self._batch.reset(seed=seed)
        return seen[0], _of_one(info)

    def step(self, action: NDArray[Any] | int) -> tuple[F32, float, bool, bool, Info]:
        """Carry out an action.

        Raises:
            ConfigError: There is no episode, or it has ended, or the action is none.
        """
        stepped = self._batch.step(np.asarray(action)[None])
        seen, reward, terminated, truncated, info = stepped
        return seen[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), _of_one(info)


def _of_one(info: Info) -> Info:
    """The values of the only environment."""
    return {name: value[0].item() for name, value in info.items() if not name.startswith("_")}
