"""Rewards of a step of an environment."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from overtaking.core.arrays import F64, Mask
from overtaking.core.errors import ConfigError
from overtaking.core.float32_math import as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.distances import lawful_gap
from overtaking.sim.observation import EgoObservation

CRASH_COST: Final = 100.0
"""Cost of an accident: more time than any overtake gains; a choice [s]."""

BREACH_COST: Final = 10.0
"""Cost of a breach of the law; a choice [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepOutcome:
    """Outcome of a step, each of shape (simulation,).

    Attributes:
        seconds: Length of the step [s]; where the episode ended within it, the time until then.
        terminated: The ego has had an accident, or its overtake is over.
        truncated: The episode has reached the horizon, or the deadline without an attempt.
        has_crashed: The ego has hit another vehicle, or left the road.
        is_judged: Whether `is_legal` and `is_completed` are known: at the end of an episode, in
            environments with labels.
        is_legal: Whether the whole simulation is legal under the policy `default`.
        is_completed: Whether the overtake was completed, by the label of the whole simulation.
    """

    seconds: F64
    terminated: Mask
    truncated: Mask
    has_crashed: Mask
    is_judged: Mask
    is_legal: Mask
    is_completed: Mask


RewardFunction = Callable[[EgoObservation, F64, EgoObservation, StepOutcome], F64]
"""From the observation, the action, the next observation and the outcome to the reward."""


def progress(
    observation: EgoObservation, action: F64, next_observation: EgoObservation, outcome: StepOutcome
) -> F64:
    """Time lost against driving as fast as the scenario's driver wishes, shape (simulation,) [s].

    Never positive; an accident costs `CRASH_COST` more.

    Args:
        observation: Observation before the step.
        action: Actions, shape (simulation, part).
        next_observation: Observation after the step.
        outcome: Outcome of the step.
    """
    del action
    distance = next_observation.ego.s.astype(np.float64) - observation.ego.s
    lost = outcome.seconds - distance / np.maximum(
        observation.vehicle.desired_speed.astype(np.float64), 1.0
    )
    return -np.maximum(lost, 0.0) - np.where(outcome.has_crashed, CRASH_COST, 0.0)


def progress_legal(
    observation: EgoObservation, action: F64, next_observation: EgoObservation, outcome: StepOutcome
) -> F64:
    """`progress`, less the cost of breaches of the law, shape (simulation,) [s].

    Following too close (rule L3, on a dry road) costs as much time as it lasts, in proportion to
    what the gap lacks. Other rules are final only at the end: a breach of any costs `BREACH_COST`.

    Args:
        observation: Observation before the step.
        action: Actions, shape (simulation, part).
        next_observation: Observation after the step.
        outcome: Outcome of the step.

    Raises:
        ConfigError: A simulation has ended and has no label.
    """
    _check_judged(outcome, "progress_legal")
    ego, leader = next_observation.ego, next_observation.leader
    decel_limit = as_f32(constant("law.safe_distance.decel_limit"))
    min_gap = lawful_gap(ego.speed, leader.closing_speed, decel_limit)
    missing_share = np.clip(1.0 - leader.gap / np.maximum(min_gap, 1.0), 0.0, 1.0)
    missing_share = np.where(leader.is_detected > 0, missing_share, 0.0)
    cost = outcome.seconds * missing_share + BREACH_COST * (outcome.is_judged & ~outcome.is_legal)
    return progress(observation, action, next_observation, outcome) - cost


def overtake_once(
    observation: EgoObservation, action: F64, next_observation: EgoObservation, outcome: StepOutcome
) -> F64:
    """1 at the end of a completed overtake, -1 at an accident, shape (simulation,).

    The label of the whole simulation decides whether the overtake was completed. The stage of the
    ego cannot: after a second pull-out it belongs to another target than the label.

    Args:
        observation: Observation before the step.
        action: Actions, shape (simulation, part).
        next_observation: Observation after the step.
        outcome: Outcome of the step.

    Raises:
        ConfigError: A simulation has ended and has no label.
    """
    del observation, action, next_observation
    _check_judged(outcome, "overtake_once")
    return np.where(outcome.is_completed, 1.0, -outcome.has_crashed.astype(np.float64))


def _check_judged(outcome: StepOutcome, reward: str) -> None:
    """Refuse simulations that have ended without a label."""
    ended = outcome.terminated | outcome.truncated
    if (ended & ~outcome.is_judged).any():
        raise ConfigError(
            what="with_labels",
            where=reward,
            expected="environments that label each simulation at its end",
            got=False,
            next_step="make the environments with with_labels=True",
        )


REWARDS: Final[dict[str, RewardFunction]] = {
    reward.__name__: reward for reward in (progress, progress_legal, overtake_once)
}
"""Rewards by name."""

NEED_LABELS: Final[tuple[RewardFunction, ...]] = (progress_legal, overtake_once)
"""Rewards that need the label of each simulation."""
