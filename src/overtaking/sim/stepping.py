"""A batch that waits at every decision for the actions of an external driver, on either simulator.

The external driver replaces the *model driver*, the simulator's own driver of the ego.
`new_stepper` makes such a batch. `trace_beliefs` uses it to simulate a recording again, with the
beliefs of the egos about their neighbours at every decision.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from overtaking import _core
from overtaking.core.errors import check_choice
from overtaking.core.native import simd_level
from overtaking.model.driver_interface import (
    MAX_ACTION_PARTS,
    OBSERVATION_SIZE,
    SplitObservation,
    SteppedObservation,
    split_observation,
)
from overtaking.sim.engine import engine_inputs
from overtaking.world.step_parameters import StepParameters, step_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F32
    from overtaking.model.driver_interface import Actions
    from overtaking.model.scenario import Scenario


_SIMULATORS = ("engine", "reference")


class Stepper(Protocol):
    """A batch that waits at every decision for actions; both simulators give the same bits.

    A simulation may end before the decisions of a call of `step` are over. The observation of the
    simulation is then the state at its end.
    """

    def observe_start(self) -> SteppedObservation:
        """The observations at the start."""
        ...

    def step(self, actions: NDArray[np.int32], num_decisions: int) -> SteppedObservation:
        """Carry out the same action at some successive decisions.

        Args:
            actions: Each part of the action as an integer multiple of its resolution, shape
                (simulation, `MAX_ACTION_PARTS`).
            num_decisions: Number of decisions, at least 1.
        """
        ...


class EngineStepper:
    """The compiled stepper. New simulations can begin in some rows while the other rows go on.

    It holds no thread between calls, so a child process after `fork` can continue with its copy.

    Args:
        params: Parameters of a batch.
        action_kind: A name in `model.driver_interface.ACTION_KINDS`; None lets the model driver
            drive.
        observes_truth: Whether observations hold the true neighbours; if not, the beliefs of the
            model driver.
        level: As in `new_stepper`.
    """

    def __init__(
        self,
        params: StepParameters,
        action_kind: str | None,
        *,
        observes_truth: bool,
        level: str | None = None,
    ) -> None:
        """Place the batch before its first decision."""
        self._batch = _core.Stepper(
            engine_inputs(params), action_kind, observes_truth, simd_level(level)
        )

    def observe_start(self) -> SteppedObservation:
        """As `Stepper.observe_start`."""
        return SteppedObservation(*self._batch.observe_start())

    def step(self, actions: NDArray[np.int32], num_decisions: int) -> SteppedObservation:
        """As `Stepper.step`."""
        return SteppedObservation(*self._batch.step(actions, num_decisions))

    def restart(self, rows: NDArray[np.int64], params: StepParameters) -> SteppedObservation:
        """Begin new simulations in some rows.

        Args:
            rows: Positions in the batch at which new simulations begin, without repetition.
            params: Parameters of the new simulations, in the order of `rows`. Road, seed and
                number of slots must be the same as at the start, because the batch has one of each;
                the scenario indices give new simulations other random numbers.

        Returns:
            The observations at their start, shape (row, `OBSERVATION_SIZE`).
        """
        return SteppedObservation(*self._batch.restart(rows, engine_inputs(params)))


@dataclass(frozen=True, slots=True, kw_only=True)
class BeliefTrace:
    """Beliefs of the egos of a batch at each decision, 20 a second, beside the truth.

    All values are NaN after the end of a simulation.

    Attributes:
        ego: Columns of the egos, shape (decision, simulation, `EGO_COLUMNS`).
        believed: Columns of the neighbours as the egos' model drivers believe them to be, shape
            (decision, simulation, `NEIGHBOUR_ROLES`, `NEIGHBOUR_COLUMNS`).
        true: The same columns with their true values.
    """

    ego: F32
    believed: F32
    true: F32


def new_stepper(
    params: StepParameters,
    action_kind: str | None,
    *,
    observes_truth: bool,
    simulator: str = "engine",
    level: str | None = None,
) -> Stepper:
    """A batch before its first decision.

    Args:
        params: Parameters of the batch.
        action_kind: A name in `model.driver_interface.ACTION_KINDS`; None lets the model driver
            drive.
        observes_truth: Whether observations hold the true neighbours; if not, the beliefs of the
            model driver.
        simulator: `engine` or `reference`.
        level: SIMD level of the engine; None for `OVERTAKING_SIMD` or the best of this CPU.

    Raises:
        ConfigError: The simulator or the SIMD level is unknown, or this CPU does not have the
            level.
    """
    check_choice(simulator, _SIMULATORS, what="simulator", where="stepper")
    if simulator == "reference":
        # Commands that use the engine do not spend the time to import the reference.
        from overtaking.sim.reference.simulation import ReferenceStepper

        return ReferenceStepper(params, action_kind, observes_truth=observes_truth)
    return EngineStepper(params, action_kind, observes_truth=observes_truth, level=level)


def trace_beliefs(
    scenario: Scenario, actions: Actions | None = None, simulator: str = "engine"
) -> BeliefTrace:
    """Simulate a batch again, and return the beliefs of the egos at every decision.

    Args:
        scenario: A batch of scenarios.
        actions: Recorded actions of an external driver; None if the model driver drove the ego.
        simulator: `engine` or `reference`; both give the same beliefs.
    """
    # A stepper observes either beliefs or truth, so the same simulation runs twice. The columns of
    # the ego are the same in both.
    believed = _trace_observations(scenario, actions, simulator, observes_truth=False)
    true = _trace_observations(scenario, actions, simulator, observes_truth=True)
    return BeliefTrace(ego=believed.ego, believed=believed.neighbours, true=true.neighbours)


def _trace_observations(
    scenario: Scenario, actions: Actions | None, simulator: str, *, observes_truth: bool
) -> SplitObservation:
    """Observations of the egos at all decisions, along a first axis of decisions."""
    if not scenario.num_simulations:  # Steppers need at least one simulation.
        return split_observation(np.zeros((0, 0, OBSERVATION_SIZE), np.float32))
    action_kind = None if actions is None else actions.kind
    stepper = new_stepper(
        step_parameters(scenario), action_kind, observes_truth=observes_truth, simulator=simulator
    )
    # `step` needs actions even if the model driver drives; they are then ignored.
    no_action = np.zeros((scenario.num_simulations, MAX_ACTION_PARTS), np.int32)
    tables: list[F32] = []
    observed = stepper.observe_start()
    while observed.is_running.any():
        action = no_action if actions is None else _actions_at(actions, len(tables))
        tables.append(np.where(observed.is_running[:, None], observed.table, np.float32(np.nan)))
        observed = stepper.step(action, 1)
    return split_observation(np.stack(tables))


def _actions_at(actions: Actions, decision: int) -> np.ndarray:
    """Recorded actions at a decision; after the end of the record, the last recorded actions.

    The simulators repeat a shorter record in the same way.
    """
    last_decision = actions.values.shape[1] - 1
    return np.ascontiguousarray(actions.values[:, min(decision, last_decision)])
