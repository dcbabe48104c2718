"""Environments of Gymnasium in which a policy drives the ego; needs the extra [gym].

    import gymnasium
    import overtaking.gym

    env = gymnasium.make("overtaking/motorway-v0", observe="human")
    envs = gymnasium.make_vec("overtaking/motorway-v0", num_envs=64, observe="human")

Importing this module registers an environment for each profile of the package. It is not imported
by the rest of the package.
"""

from overtaking.core.errors import MissingExtraError

try:
    import gymnasium
except ImportError as error:
    raise MissingExtraError.lacking("gym", what="gymnasium", where="overtaking.gym") from error

from overtaking.gym.rewards import (
    REWARDS,
    Events,
    Reward,
    overtake_once,
    progress,
    progress_legal,
)
from overtaking.gym.single import OvertakingEnv
from overtaking.gym.spaces import COLUMNS, Column, flat
from overtaking.gym.vector import OvertakingVectorEnv
from overtaking.scenarios import profile_names

__all__ = [
    "COLUMNS",
    "REWARDS",
    "Column",
    "Events",
    "OvertakingEnv",
    "OvertakingVectorEnv",
    "Reward",
    "flat",
    "overtake_once",
    "progress",
    "progress_legal",
]

for _name in profile_names():
    gymnasium.register(
        f"overtaking/{_name}-v0",
        entry_point="overtaking.gym.single:OvertakingEnv",
        vector_entry_point="overtaking.gym.vector:OvertakingVectorEnv",
        kwargs={"profile": _name},
    )
