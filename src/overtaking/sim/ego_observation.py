"""The observations that an external driver of the ego gets at a decision.

`EgoObservation` gives names to the columns of a table from either simulator. `Observation` adds the
scenarios, from which a driver can draw random numbers that do not depend on the batch. The *model
driver* is the simulator's own driver of the ego, which the external one replaces.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from overtaking.core import random_numbers
from overtaking.core.arrays import F32, Mask
from overtaking.core.equality import ContentEquality
from overtaking.model.driver_interface import (
    NEIGHBOUR_ROLES,
    EgoColumns,
    NeighbourColumns,
    PassingColumns,
    SplitObservation,
    split_observation,
)
from overtaking.model.scenario import Scenario
from overtaking.world.step_parameters import VehicleParameters


@dataclass(frozen=True, kw_only=True)  # No slots: the views are cached in the instance.
class EgoObservation(ContentEquality):
    """Observations of the egos of a batch by name, such as `ego.speed` or `leader.gap`.

    Each column has shape (simulation,) and is a view of the table. Left is the overtaking side,
    also in left-hand traffic.

    Attributes:
        time: Time since the start of the simulation [s]; in `overtaking.gym`, since the start of
            the present step of the environment, because the path of an action begins then.
        is_running: Whether each simulation runs, shape (simulation,). The observations of
            simulations that have ended are zero. In `overtaking.gym` they keep their last values,
            because a reward compares two successive observations.
        table: All observed values in the order of `model.driver_interface`, which is also the input
            of an ONNX file, shape (simulation, `OBSERVATION_SIZE`).
        vehicle: Parameters of the ego's vehicle and of its model driver, each of shape
            (simulation,).
    """

    time: float
    is_running: Mask
    table: F32
    vehicle: VehicleParameters

    @cached_property
    def ego(self) -> EgoColumns:
        """The ego itself."""
        return EgoColumns._make(self._parts.ego.T)

    @cached_property
    def leader(self) -> NeighbourColumns:
        """The vehicle ahead in the ego's lane."""
        return self._neighbour("leader")

    @cached_property
    def follower(self) -> NeighbourColumns:
        """The vehicle behind in the ego's lane."""
        return self._neighbour("follower")

    @cached_property
    def left_leader(self) -> NeighbourColumns:
        """The vehicle ahead in the next lane on the overtaking side."""
        return self._neighbour("left_leader")

    @cached_property
    def left_follower(self) -> NeighbourColumns:
        """The vehicle behind in the next lane on the overtaking side."""
        return self._neighbour("left_follower")

    @cached_property
    def right_leader(self) -> NeighbourColumns:
        """The vehicle ahead in the next lane on the kerb side."""
        return self._neighbour("right_leader")

    @cached_property
    def right_follower(self) -> NeighbourColumns:
        """The vehicle behind in the next lane on the kerb side."""
        return self._neighbour("right_follower")

    @cached_property
    def oncoming(self) -> NeighbourColumns:
        """The nearest oncoming vehicle, in any lane."""
        return self._neighbour("oncoming")

    @cached_property
    def second_oncoming(self) -> NeighbourColumns:
        """The oncoming vehicle behind the nearest one."""
        return self._neighbour("second_oncoming")

    @cached_property
    def neighbours(self) -> NeighbourColumns:
        """All neighbours at once; each column has shape (`NEIGHBOUR_ROLES`, simulation)."""
        return NeighbourColumns._make(self._parts.neighbours.T)

    @cached_property
    def passing(self) -> PassingColumns:
        """A pass against oncoming traffic; zero on one-way roads."""
        return PassingColumns._make(self._parts.passing.T)

    @cached_property
    def _parts(self) -> SplitObservation:
        # A driver reads five or six groups at each decision, so the table is split only once.
        return split_observation(self.table)

    def _neighbour(self, role: str) -> NeighbourColumns:
        return NeighbourColumns._make(self._parts.neighbours[:, NEIGHBOUR_ROLES.index(role)].T)


@dataclass(frozen=True, kw_only=True)
class Observation(EgoObservation):
    """Observations of the egos of a batch at a decision, with their scenarios.

    Attributes:
        decision_index: Number of decisions since the start, 20 a second; 0 at the first decision.
        scenario: The scenarios, with index, road and weather of each simulation.
    """

    decision_index: int
    scenario: Scenario

    def uniform_numbers(self) -> F32:
        """Four random numbers in (0, 1) for a driver that draws, shape (simulation, 4).

        They depend on seed, scenario index and decision alone, not on the batch.
        """
        stream = int(random_numbers.Stream.EXTERNAL_DRIVER)
        return uniform_numbers(self.scenario, stream, self.decision_index)


DriverFunction = Callable[[Observation], NDArray[np.floating | np.integer]]
"""A function from the observations of all simulations to actions of shape (simulation, part).

`model.driver_interface.ACTION_KINDS` lists the parts of each kind of action, with their units."""


def uniform_numbers(
    scenario: Scenario, stream: int | NDArray[np.uint32], decision_index: int
) -> F32:
    """Four random numbers in (0, 1) of each simulation and stream.

    Args:
        scenario: A batch of scenarios, with their seed and their scenario indices.
        stream: A number in `core.random_numbers.Stream`, or an array that broadcasts with the
            scenario indices.
        decision_index: Number of the decision.

    Returns:
        The numbers along a new last axis: shape (simulation, 4) for one stream.
    """
    words = random_numbers.philox_words(
        scenario.seed, scenario.scenario_index, stream, decision_index
    )
    return np.stack([random_numbers.uniform_from_word(word) for word in words], axis=-1)
