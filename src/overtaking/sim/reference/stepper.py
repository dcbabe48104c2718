"""A batch that waits at every decision for what another driver orders."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.sim.reference.environment import at_limits
from overtaking.sim.reference.observation import observe
from overtaking.sim.reference.orders import Orders, orders_of
from overtaking.sim.reference.run import act, advance, perceive
from overtaking.sim.reference.state import initial_state
from overtaking.world.parameters import SUBSTEPS, Parameters


class Stepper:
    """The reference, decision by decision.

    Args:
        given: Parameters of a batch.
        kind: A name in `model.actions.KINDS`; None where the model's own driver decides.
        is_true: Whether the truth is observed, not what the ego believes.
    """

    def __init__(self, given: Parameters, kind: str | None, *, is_true: bool) -> None:
        """Stand before the first decision."""
        self._given, self._kind, self._is_true = given, kind, is_true
        self._p, self._q = given.of_vehicles, given.of_simulations
        self._here = self._p
        self._stride = SUBSTEPS if given.record_every % SUBSTEPS == 0 else 1
        self._state, self._step = initial_state(given), 0
        self._ran = np.ones(given.index.shape, np.bool_)

    def begin(self) -> tuple[F32, Mask]:
        """What is observed at first: numbers of shape (simulation, `WIDTH`), and who runs."""
        return self._look()

    def step(self, values: NDArray[np.int32], decisions: int) -> tuple[F32, Mask]:
        """What is observed after some decisions with the same orders.

        Args:
            values: Steps of each number of the action, shape (simulation, `MOST_PARTS`).
            decisions: How many, one at least.
        """
        orders = None if self._kind is None else orders_of(self._kind, values)
        for _ in range(decisions - 1):
            self._act(orders)
            self._perceive()
        self._act(orders)
        return self._look()

    def _look(self) -> tuple[F32, Mask]:
        runs = np.float32(self._step) <= self._state.end_step
        self._perceive()
        state, given, p = self._state, self._given, self._here
        decision = self._step // SUBSTEPS
        table = observe(state, given, p, self._q, self._moment, decision, is_true=self._is_true)
        told = np.where(self._ran[:, None], table, np.float32(0.0))
        self._ran = runs
        return told, runs

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
