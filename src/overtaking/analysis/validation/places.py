"""Who is next ahead or behind of single vehicles at single frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array
    from overtaking.analysis.validation.traffic import Batch


@dataclass(frozen=True, slots=True, kw_only=True)
class Moments:
    """Vehicles at frames; every array has shape (moment,).

    Attributes:
        simulation: Place of the simulation in the batch.
        vehicle: Slot.
        frame: Frame.
    """

    simulation: Array
    vehicle: Array
    frame: Array

    @property
    def place(self) -> tuple[Array, Array, Array]:
        """Where their values lie in arrays (simulation, vehicle, time)."""
        return self.simulation, self.vehicle, self.frame

    def where(self, chosen: Array) -> Moments:
        """Some of them."""
        return Moments(
            simulation=self.simulation[chosen],
            vehicle=self.vehicle[chosen],
            frame=self.frame[chosen],
        )


def next_to(batch: Batch, at: Moments, lane: Array, *, ahead: bool) -> tuple[Array, Array]:
    """The next vehicle in a lane ahead of some, or behind them.

    Args:
        batch: The batch.
        at: Whose next vehicle.
        lane: In which lane of each, shape (moment,).
        ahead: Whether ahead or behind.

    Returns:
        The gap between the bumpers [m], infinite where no vehicle is, and the slot.
    """
    states, length = batch.runs.states, batch.runs.scenario.vehicles.length
    slots = (at.simulation, slice(None), at.frame)
    there = batch.sound[slots] & (states.lane[slots] == lane[:, None])
    away = 1e-3 * (states.s[slots].astype(np.int64) - states.s[at.place][:, None])
    away = away if ahead else -away
    distance = np.where(there & (away > 0.0), away, np.inf)
    slot = distance.argmin(axis=1)
    rows = np.arange(len(slot))
    halves = 0.5 * (length[at.simulation, at.vehicle] + length[at.simulation, slot])
    return distance[rows, slot] - halves, slot
