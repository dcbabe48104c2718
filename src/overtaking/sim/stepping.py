"""A batch that another driver takes from decision to decision, on either engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from overtaking import _core
from overtaking.core.native import simd_level
from overtaking.model.driver_interface import MAX_ACTION_PARTS, split_observation
from overtaking.sim.engine import road_values
from overtaking.sim.reference.simulation import ReferenceStepper as ReferenceStepper
from overtaking.sim.reference.simulation import SteppedObservation
from overtaking.world.constants import engine_constants
from overtaking.world.step_parameters import StepParameters, step_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F32
    from overtaking.model.driver_interface import Actions
    from overtaking.model.scenario import Scenario


class Stepper(Protocol):
    """A batch that waits at every decision for orders; both engines give the same bits.

    The last observation of a simulation is the one at its end, even if an order was to hold longer.
    """

    def observe_start(self) -> SteppedObservation:
        """The observations at the start."""
        ...

    def step(self, values: NDArray[np.int32], decisions: int) -> SteppedObservation:
        """Carry out the same orders for some decisions.

        Args:
            values: Steps of each number of the action, shape (simulation, `MAX_ACTION_PARTS`).
            decisions: How many, one at least.
        """
        ...


class EngineStepper:
    """The compiled stepper, in whose rows new simulations can begin while others go on.

    Args:
        params: Parameters of a batch.
        kind: A name in `model.driver_interface.ACTION_KINDS`; None where the model's own driver
            decides.
        observes_truth: Whether the truth is observed, not what the ego believes.
        level: As in `stepper`.
    """

    def __init__(
        self,
        params: StepParameters,
        kind: str | None,
        *,
        observes_truth: bool,
        level: str | None = None,
    ) -> None:
        """Stand before the first decision."""
        self._batch = _core.Stepper(_values(params), kind, observes_truth, simd_level(level))

    def observe_start(self) -> SteppedObservation:
        """As `Stepper.observe_start`."""
        return SteppedObservation(*self._batch.observe_start())

    def step(self, values: NDArray[np.int32], decisions: int) -> SteppedObservation:
        """As `Stepper.step`."""
        return SteppedObservation(*self._batch.step(values, decisions))

    def restart(self, rows: NDArray[np.int64], parameters: StepParameters) -> SteppedObservation:
        """Begin new simulations in some rows.

        Args:
            rows: The rows in which they begin, each once.
            parameters: Their parameters: on the same road, with the same seed and number of slots.

        Returns:
            The observations at their start, shape (row, `OBSERVATION_SIZE`).
        """
        return SteppedObservation(*self._batch.restart(rows, _values(parameters)))


@dataclass(frozen=True, slots=True, kw_only=True)
class BeliefTrace:
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


def new_stepper(
    params: StepParameters,
    kind: str | None,
    *,
    observes_truth: bool,
    simulator: str = "engine",
    level: str | None = None,
) -> Stepper:
    """A batch before its first decision.

    Args:
        params: Parameters of the batch.
        kind: A name in `model.driver_interface.ACTION_KINDS`; None where the model's own driver
            decides.
        observes_truth: Whether the truth is observed, not what the ego believes.
        simulator: `engine` or `reference`.
        level: SIMD level of the engine; None for `OVERTAKING_SIMD` or the best of this CPU.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU lacks it.
    """
    if simulator == "reference":
        return ReferenceStepper(params, kind, observes_truth=observes_truth)
    return EngineStepper(params, kind, observes_truth=observes_truth, level=level)


def _values(params: StepParameters) -> dict[str, Any]:
    """A batch as the compiled stepper takes it."""
    return {
        "vehicle": params.vehicle_table.reshape(-1),
        "simulation": params.simulation_table.reshape(-1),
        "scenario_index": params.scenario_index,
        "num_slots": params.vehicle_table.shape[1],
        "seed": params.seed,
        "steps_per_frame": params.steps_per_frame,
        "road": road_values(params),
        "constants": engine_constants(params.constants),
    }


def trace_beliefs(
    scenario: Scenario, actions: Actions | None = None, simulator: str = "engine"
) -> BeliefTrace:
    """Simulate again, and return the beliefs of the egos at every decision.

    Args:
        scenario: A batch of scenarios.
        actions: What another driver did with the ego; None for the model's own.
        simulator: `engine` or `reference`; their beliefs are the same.
    """
    ego, believed = _trace(scenario, actions, simulator, observes_truth=False)
    _, true = _trace(scenario, actions, simulator, observes_truth=True)
    return BeliefTrace(ego=ego, believed=believed, true=true)


def _trace(
    scenario: Scenario, actions: Actions | None, simulator: str, *, observes_truth: bool
) -> tuple[F32, F32]:
    """Columns of the egos and of their neighbours."""
    kind = None if actions is None else actions.kind
    steps = new_stepper(
        step_parameters(scenario), kind, observes_truth=observes_truth, simulator=simulator
    )
    nothing = np.zeros((scenario.num_simulations, MAX_ACTION_PARTS), np.int32)
    tables: list[F32] = []
    table, runs, _ = steps.observe_start()
    while runs.any():
        tables.append(np.where(runs[:, None], table, np.float32(np.nan)))
        orders = nothing if actions is None else _actions_at(actions, len(tables) - 1)
        table, runs, _ = steps.step(orders, 1)
    ego, neighbours, _ = split_observation(np.stack(tables))
    return ego, neighbours


def _actions_at(actions: Actions, decision: int) -> np.ndarray:
    """The orders of a decision; those of the last one where there are no more."""
    return np.ascontiguousarray(actions.values[:, min(decision, actions.values.shape[1] - 1)])
