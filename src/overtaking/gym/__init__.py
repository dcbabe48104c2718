"""Environments of Gymnasium in which an agent drives the ego; needs the extra [gym].

    import gymnasium

    env = gymnasium.make("overtaking.gym:overtaking/motorway-v0")
    envs = gymnasium.make_vec("overtaking.gym:overtaking/motorway-v0", num_envs=64)

Importing this module registers an environment for each profile of the package. Gymnasium imports
the module that stands before the colon of an id, so no further import is needed.

environments      OvertakingEnv and OvertakingVectorEnv
episodes          episodes in the rows of a batch, and the scenarios they take
rewards           rewards
spaces            spaces of observations and actions
stable_baselines  adapter for Stable-Baselines3
"""

from overtaking.core.errors import MissingExtraError

try:
    import gymnasium
except ImportError as error:
    raise MissingExtraError.for_extra("gym", what="gymnasium", where="overtaking.gym") from error

from overtaking.gym.environments import OvertakingEnv, OvertakingVectorEnv
from overtaking.gym.rewards import (
    REWARDS,
    RewardFunction,
    StepOutcome,
    overtake_once,
    progress,
    progress_legal,
)
from overtaking.gym.spaces import OBSERVATION_COLUMNS, ObservationColumn, flatten_observation
from overtaking.scenarios.profiles import profile_names

__all__ = [
    "OBSERVATION_COLUMNS",
    "REWARDS",
    "ObservationColumn",
    "OvertakingEnv",
    "OvertakingVectorEnv",
    "RewardFunction",
    "StepOutcome",
    "flatten_observation",
    "overtake_once",
    "progress",
    "progress_legal",
]

for _name in profile_names():
    gymnasium.register(
        f"overtaking/{_name}-v0",
        entry_point="overtaking.gym.environments:make_env",
        vector_entry_point="overtaking.gym.environments:OvertakingVectorEnv",
        kwargs={"profile": _name},
    )
