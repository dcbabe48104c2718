"""Environments for reinforcement learning, with the interface of Gymnasium; needs the extra [gym].

An agent (a program that learns) drives the ego, the vehicle whose overtaking is studied, in
simulated traffic.

    import gymnasium

    env = gymnasium.make("overtaking.gym:overtaking/motorway-v0")
    envs = gymnasium.make_vec("overtaking.gym:overtaking/motorway-v0", num_envs=64)

Importing this module registers an environment for each profile of the package, a named setting of
road, traffic, weather and drivers such as `motorway`. In the id, the text before the colon is the
module that Gymnasium imports, so the user need not import it; `-v0` is Gymnasium's version number.

environments      `OvertakingEnv` (one environment) and `OvertakingVectorEnv` (many, in one batch)
episodes          the simulations behind the environments, and the supply of their scenarios
rewards           functions for the reward of a step
spaces            names, units and bounds of observations and actions
stable_baselines  adapter for the library Stable-Baselines3, not imported here
"""

from overtaking.core.errors import MissingExtraError

# Before the imports below: they need gymnasium as well, and their error would be less helpful.
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

# `make_env` is a function around `OvertakingEnv`. From the class, Gymnasium would read the list of
# render modes and, for `human`, which is not in it, open a window of its own; from a function it
# cannot, so the environment itself refuses `human`. Gymnasium opens no window for vector
# environments, so those are made from the class.
for _name in profile_names():
    gymnasium.register(
        f"overtaking/{_name}-v0",
        entry_point="overtaking.gym.environments:make_env",
        vector_entry_point="overtaking.gym.environments:OvertakingVectorEnv",
        kwargs={"profile": _name},
    )
