"""A batch that waits at every decision for what another driver orders."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.model.driver_interface import OBSERVATION_SIZE
from overtaking.sim.reference.environment import at_limits
from overtaking.sim.reference.observation import observe
from overtaking.sim.reference.orders import Orders, orders_of
from overtaking.sim.reference.run import act, advance, perceive
from overtaking.sim.reference.state import initial_state
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import StepParameters


class SteppedObservation(NamedTuple):
    """The observations of the egos of a batch after a step.

    Attributes:
        table: Observations of the egos, shape (simulation, `OBSERVATION_SIZE`). A simulation that
            ended within the step is observed at its end; one that ended earlier has zeros.
        runs: Whether each simulation continues, shape (simulation,).
        num_decisions: Number of decisions that each simulation carried out in this step, shape
            (simulation,).
    """

    table: F32
    runs: Mask
    num_decisions: NDArray[np.uint32]


class Stepper:
    """The reference, decision by decision.

    Args:
        given: Parameters of a batch.
        kind: A name in `model.driver_interface.ACTION_KINDS`; None where the model's own driver
            decides.
        is_true: Whether the truth is observed, not what the ego believes.
    """

    def __init__(self, given: StepParameters, kind: str | None, *, is_true: bool) -> None:
        """Stand before the first decision."""
        self._given, self._kind, self._is_true = given, kind, is_true
        self._p, self._q = given.vehicles, given.simulations
        self._here = self._p
        self._stride = SUBSTEPS if given.steps_per_frame % SUBSTEPS == 0 else 1
        self._state, self._step = initial_state(given), 0
        self._ran = np.ones(given.scenario_index.shape, np.bool_)

    def begin(self) -> SteppedObservation:
        """The observations at the start."""
        table, runs = self._observe()
        return SteppedObservation(table, runs, np.zeros(runs.shape, np.uint32))

    def step(self, values: NDArray[np.int32], decisions: int) -> SteppedObservation:
        """Carry out the same orders for some decisions.

        Args:
            values: Steps of each number of the action, shape (simulation, `MAX_ACTION_PARTS`).
            decisions: Number of decisions, at least 1.
        """
        orders = None if self._kind is None else orders_of(self._kind, values)
        num_decisions = np.zeros(self._ran.shape, np.uint32)
        table = np.zeros((len(self._ran), OBSERVATION_SIZE), np.float32)
        for _ in range(decisions):
            self._act(orders)
            num_decisions += self._ran
            observed, is_running = self._observe()
            # A simulation that has ended keeps the observation of its last decision.
            table = np.where(self._ran[:, None], observed, table)
            self._ran = is_running
        return SteppedObservation(table, self._ran, num_decisions)

    def _observe(self) -> tuple[F32, Mask]:
        """Observed numbers of all egos, ended simulations included, and which simulations run."""
        is_running = np.float32(self._step) <= self._state.end_step
        self._perceive()
        state, given, p = self._state, self._given, self._here
        decision = self._step // SUBSTEPS
        table = observe(
            state, given, p, self._q, self._moment, decision=decision, is_true=self._is_true
        )
        return table, is_running

    def _perceive(self) -> None:
        state, given, q = self._state, self._given, self._q
        self._here = at_limits(state, given, self._p, q)
        self._moment = perceive(state, given, self._here, q, self._step)

    def _act(self, orders: Orders | None) -> None:
        state, given, p, q = self._state, self._given, self._here, self._q
        pairs = act(state, given, p, q, self._moment, None, self._step, orders)
        for k in range(0, SUBSTEPS, self._stride):
            advance(state, given, p, q, pairs, self._step + k, self._stride, orders)
        self._step += SUBSTEPS
