"""What a policy is given at a decision."""

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from overtaking.core import random_numbers
from overtaking.core.arrays import F32, Mask
from overtaking.core.equality import ContentEquality
from overtaking.model.driver_interface import (
    EGO_COLUMNS,
    NEIGHBOUR_COLUMNS,
    NEIGHBOUR_ROLES,
    PASSING_COLUMNS,
)
from overtaking.model.scenario import Scenario
from overtaking.world.step_parameters import VehicleParameters

_OWN_PLACE = {name: place for place, name in enumerate(EGO_COLUMNS)}
_AROUND_PLACE = {name: place for place, name in enumerate(NEIGHBOUR_COLUMNS)}
_ROLE_PLACE = {name: place for place, name in enumerate(NEIGHBOUR_ROLES)}
_MEETING_PLACE = {name: place for place, name in enumerate(PASSING_COLUMNS)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen(ContentEquality):
    """What the egos of a batch observe, every row a simulation.

    Attributes:
        time: Time since the start [s].
        active: Which simulations run; the numbers of the others are zero, shape (simulation,).
        own: Numbers of the ego, named by `model.driver_interface.EGO_COLUMNS`, shape (simulation,
            `OWN`).
        around: Numbers of its neighbours, named by `ROLES` and `AROUND`, shape (simulation,
            `ROLES`, `AROUND`).
        meeting: Numbers about oncoming traffic, named by `MEETING`, shape (simulation, `MEETING`).
        driver: Parameters of the ego's vehicle, and of the driver that the scenario has put into
            it, each of shape (simulation,).
    """

    time: float
    active: Mask
    own: F32
    around: F32
    meeting: F32
    driver: VehicleParameters

    @property
    def table(self) -> F32:
        """All numbers as one row of each simulation, shape (simulation, `WIDTH`)."""
        around = self.around.reshape(len(self.own), -1)
        return np.concatenate([self.own, around, self.meeting], axis=1)

    def of(self, name: str, role: str | None = None) -> F32:
        """One number, shape (simulation,).

        Args:
            name: A name in `AROUND` with a role, or else in `OWN` or `MEETING`.
            role: A name in `ROLES`.

        Raises:
            KeyError: There is no such name.
        """
        if role is None and name in _MEETING_PLACE:
            return self.meeting[:, _MEETING_PLACE[name]]
        if role is None:
            return self.own[:, _place(name, _OWN_PLACE, "number of the ego")]
        number = _place(name, _AROUND_PLACE, "number of a neighbour")
        return self.around[:, _place(role, _ROLE_PLACE, "role"), number]


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation(Seen):
    """What the egos of a batch observe at a decision, every row a simulation.

    Attributes:
        decision: Number of the decision, 20 a second.
        scenario: Number, road and weather of each simulation, and all others in it.
    """

    decision: int
    scenario: Scenario

    def random(self) -> F32:
        """Four numbers in (0, 1) for a policy that draws, shape (simulation, 4).

        They follow from seed, number and decision alone, so what is drawn does not depend on the
        batch.
        """
        return uniforms(self.scenario, int(random_numbers.Stream.EXTERNAL_DRIVER), self.decision)


def _place(name: str, places: dict[str, int], what: str) -> int:
    """The place of a name.

    Raises:
        KeyError: There is no such name.
    """
    if (place := places.get(name)) is not None:
        return place
    hint = f"near are {', '.join(get_close_matches(name, places, cutoff=0.0))}"
    if name in _AROUND_PLACE:
        hint = "a neighbour has it: name a role, such as lead"
    elif name in _OWN_PLACE:
        hint = "the ego has it: leave out the role"
    raise KeyError(f"no {what} is named {name}; {hint}")


Policy = Callable[[Observation], NDArray[np.floating | np.integer]]
"""Observations of all simulations in, an action for each out."""


def uniforms(scenario: Scenario, stream: int | NDArray[np.uint32], decision: int) -> F32:
    """Four numbers in (0, 1) of each simulation and stream, along a last axis."""
    drawn = random_numbers.philox_words(scenario.seed, scenario.index, stream, decision)
    return np.stack([random_numbers.uniform_from_word(word) for word in drawn], axis=-1)
