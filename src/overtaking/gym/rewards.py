"""Rewards of a step of an environment, in which an agent drives the ego.

The ego is the vehicle whose overtaking is studied. A reward is a function of the observations
before and after a step, the action and the outcome of the step; it computes one number for each
environment of a batch. A step lasts one or several decisions of 50 ms. An action has one or more
parts, such as acceleration and lane change. Rewards see the observations before these are clipped
and normalized for the agent.

`REWARDS` names the functions; users may pass a function of their own. To add one, write it like
`progress`, and list it in `REWARDS`, and in `NEED_LABELS` if it reads `is_legal` or `is_completed`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from overtaking.core.arrays import F64, Mask
from overtaking.core.errors import ConfigError
from overtaking.core.float32_math import as_f32
from overtaking.labels.law.numbers import MAX_DECEL
from overtaking.labels.law.safe_distance import lawful_gap
from overtaking.sim.ego_observation import EgoObservation

CRASH_COST: Final = 100.0
"""Cost of an accident, as lost time [s]. Chosen: more than any overtake can gain."""

BREACH_COST: Final = 10.0
"""Cost of an episode with a breach of the law, as lost time [s]. Chosen: a tenth of an accident."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepOutcome:
    """Outcome of a step; each array has shape (env,).

    An episode (one simulation of an environment) ends by termination or truncation. Its *label* is
    the judgement of the whole simulation after the end: its outcome and its breaches of the law.

    Attributes:
        seconds: Duration of the step [s]; shorter if the simulation ended within it, as it does
            two seconds after an accident.
        terminated: The ego has had an accident, or its overtake is over.
        truncated: The simulated time has reached its end (the horizon), or the deadline by which
            an overtake has to begin.
        has_crashed: The ego has hit another vehicle, or left the road.
        is_judged: The label is known: the episode has ended, and the environment was made with
            `with_labels=True`. Elsewhere the next two attributes are False.
        is_legal: The simulation breaks no rule of the policy `default` (a set of traffic rules).
        is_completed: The overtake was completed, by the label.
    """

    seconds: F64
    terminated: Mask
    truncated: Mask
    has_crashed: Mask
    is_judged: Mask
    is_legal: Mask
    is_completed: Mask


RewardFunction = Callable[[EgoObservation, F64, EgoObservation, StepOutcome], F64]
"""Function of observation, actions (env, part), next observation and outcome; rewards (env,)."""


def progress(
    observation: EgoObservation, action: F64, next_observation: EgoObservation, outcome: StepOutcome
) -> F64:
    """Minus the time lost compared with driving at the desired speed, shape (env,) [s].

    The desired speed belongs to the scenario's driver, which the agent replaces. Driving faster
    gains nothing, so the reward is never positive. An accident costs `CRASH_COST` more.

    Args:
        observation: Observation before the step.
        action: Actions, shape (env, part); not used.
        next_observation: Observation after the step.
        outcome: Outcome of the step.
    """
    del action
    # Observations are float32; rewards are float64, as Gymnasium expects.
    distance = next_observation.ego.s.astype(np.float64) - observation.ego.s
    # `vehicle` holds the parameters of the ego's vehicle and of the scenario's driver.
    desired_speed = observation.vehicle.desired_speed.astype(np.float64)
    time_at_desired_speed = distance / np.maximum(desired_speed, 1.0)  # 1 m/s: no division by 0.
    lost_time = np.maximum(outcome.seconds - time_at_desired_speed, 0.0)
    return -lost_time - np.where(outcome.has_crashed, CRASH_COST, 0.0)


def progress_legal(
    observation: EgoObservation, action: F64, next_observation: EgoObservation, outcome: StepOutcome
) -> F64:
    """`progress` minus the cost of breaches of the law, shape (env,) [s].

    Rule L3 demands a safe gap to the leader, the vehicle ahead. While the gap is too small, each
    second costs the missing share of the gap: 0.3 s if 30 % is missing. So the agent gets feedback
    in every step. At the end of the episode, `BREACH_COST` is due if `is_legal` is false.

    Args:
        observation: Observation before the step.
        action: Actions, shape (env, part); not used.
        next_observation: Observation after the step.
        outcome: Outcome of the step.

    Raises:
        ConfigError: An episode has ended and has no label.
    """
    _check_judged(outcome, "progress_legal")
    ego, leader = next_observation.ego, next_observation.leader
    # The deceleration on a dry road, 8 m/s^2. On a wet road the rule assumes less and demands a
    # larger gap, but observations do not contain the water on the road.
    decel_limit = as_f32(MAX_DECEL.f32)
    min_gap = lawful_gap(ego.speed, leader.closing_speed, decel_limit)
    # The lawful gap is 0 at standstill; 1 m avoids the division by 0.
    missing_share = np.clip(1.0 - leader.gap / np.maximum(min_gap, 1.0), 0.0, 1.0)
    missing_share = np.where(leader.is_detected > 0, missing_share, 0.0)
    gap_cost = outcome.seconds * missing_share
    cost = gap_cost + BREACH_COST * (outcome.is_judged & ~outcome.is_legal)
    return progress(observation, action, next_observation, outcome) - cost


def overtake_once(
    observation: EgoObservation, action: F64, next_observation: EgoObservation, outcome: StepOutcome
) -> F64:
    """1 at the end of an episode with a completed overtake, -1 at an accident, else 0.

    The result has shape (env,).

    The label decides whether the overtake was completed, not the ego's stage. If the ego pulls out
    twice, the stage describes the second attempt, but the overtake of the label may have begun with
    the first attempt, behind another vehicle.

    Args:
        observation: Observation before the step; not used.
        action: Actions, shape (env, part); not used.
        next_observation: Observation after the step; not used.
        outcome: Outcome of the step.

    Raises:
        ConfigError: An episode has ended and has no label.
    """
    del observation, action, next_observation
    _check_judged(outcome, "overtake_once")
    # Never both: with an accident, the outcome in the label is not "completed".
    return np.where(outcome.is_completed, 1.0, -outcome.has_crashed.astype(np.float64))


def _check_judged(outcome: StepOutcome, reward: str) -> None:
    """Raise a `ConfigError` if an episode has ended and has no label.

    Args:
        outcome: Outcome of the step.
        reward: Name of the reward that needs the label, for the message.
    """
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
"""Rewards that need environments with `with_labels=True`.

Other environments reject them at once, not at the end of the first episode. Rewards of users are
not checked: without labels, they receive outcomes whose `is_judged` is False.
"""
