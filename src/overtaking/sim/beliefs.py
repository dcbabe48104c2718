"""What the ego believes at every decision, not only at those that are recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.driver_interface import MAX_ACTION_PARTS, split_observation
from overtaking.sim.stepping import stepper
from overtaking.world.step_parameters import step_parameters

if TYPE_CHECKING:
    from overtaking.core.arrays import F32
    from overtaking.model.driver_interface import Actions
    from overtaking.model.scenario import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Beliefs:
    """Beliefs of the egos of a batch at each decision, 20 a second; NaN once a simulation is over.

    Attributes:
        ego: Columns of the egos, shape (decision, simulation, `EGO_COLUMNS`).
        believed: Columns of their neighbours as the egos believe them to be, shape (decision,
            simulation, `NEIGHBOUR_ROLES`, `NEIGHBOUR_COLUMNS`).
        true: True columns of the neighbours, in the same shape.
    """

    ego: F32
    believed: F32
    true: F32


def beliefs(
    scenario: Scenario, actions: Actions | None = None, simulator: str = "engine"
) -> Beliefs:
    """Simulate again, and return the beliefs of the egos at every decision.

    Args:
        scenario: A batch of scenarios.
        actions: What another driver did with the ego; None for the model's own.
        simulator: `engine` or `reference`; their beliefs are the same.
    """
    ego, believed = _told(scenario, actions, simulator, is_true=False)
    _, true = _told(scenario, actions, simulator, is_true=True)
    return Beliefs(ego=ego, believed=believed, true=true)


def _told(
    scenario: Scenario, actions: Actions | None, simulator: str, *, is_true: bool
) -> tuple[F32, F32]:
    """Columns of the egos and of their neighbours."""
    kind = None if actions is None else actions.kind
    steps = stepper(step_parameters(scenario), kind, is_true=is_true, simulator=simulator)
    nothing = np.zeros((scenario.num_simulations, MAX_ACTION_PARTS), np.int32)
    tables: list[F32] = []
    table, runs, _ = steps.begin()
    while runs.any():
        tables.append(np.where(runs[:, None], table, np.float32(np.nan)))
        orders = nothing if actions is None else _orders(actions, len(tables) - 1)
        table, runs, _ = steps.step(orders, 1)
    ego, neighbours, _ = split_observation(np.stack(tables))
    return ego, neighbours


def _orders(actions: Actions, decision: int) -> np.ndarray:
    """The orders of a decision; those of the last one where there are no more."""
    return np.ascontiguousarray(actions.values[:, min(decision, actions.values.shape[1] - 1)])
