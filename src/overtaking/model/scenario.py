"""A batch of scenarios: everything that is decided before the first frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32
from overtaking.model.batch import Batch
from overtaking.model.drivers import Drivers
from overtaking.model.road import Road
from overtaking.model.vehicles import VehicleSpecs
from overtaking.model.weather import Weather

SLOTS = (8, 16, 32)
"""The engine is compiled for so many vehicle slots; a batch may have any number up to the last."""

MAX_VEHICLES = SLOTS[-1]
"""Most vehicles of a simulation."""


def slots_for(vehicles: int) -> int:
    """The fewest slots with room for a number of vehicles, 0 <= vehicles <= `MAX_VEHICLES`."""
    return max(vehicles, 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, weakref_slot=True)
class Scenario(Batch):
    """Inputs of a batch of simulations on one road.

    Attributes:
        profile: Name of the profile that they were drawn from.
        road: The road, the same for the batch.
        seed: Seed of the random numbers, 0 <= seed < 2**64.
        frame_interval_ms: Time between recorded frames, a multiple of 10 [ms].
        index: Number of each simulation, shape (simulation,).
        horizon: Longest duration, shape (simulation,) [s].
        attempt_deadline: A simulation without an attempt ends here, shape (simulation,) [s].
        weight: Sampling weight p/q, shape (simulation,).
        vehicles: Bodies, (simulation, vehicle).
        drivers: People, (simulation, vehicle).
        weather: Weather, (simulation,).
        start_s: Position of the centre at the first frame, (simulation, vehicle) [m].
        start_lane: Lane index, 0 the slowest, (simulation, vehicle).
        start_speed: Speed at the first frame, (simulation, vehicle) [m/s].
    """

    profile: str
    road: Road
    seed: int
    frame_interval_ms: int
    index: NDArray[np.uint64]
    horizon: F32
    attempt_deadline: F32
    weight: NDArray[np.float64]
    vehicles: VehicleSpecs
    drivers: Drivers
    weather: Weather
    start_s: F32
    start_lane: NDArray[np.uint8]
    start_speed: F32

    @property
    def num_simulations(self) -> int:
        """Number of simulations in the batch."""
        return len(self.index)

    @property
    def num_slots(self) -> int:
        """Number of vehicle slots, filled or not."""
        return self.start_s.shape[1]

    @property
    def num_vehicles(self) -> NDArray[np.int64]:
        """Number of vehicles of each simulation, shape (simulation,)."""
        return self.vehicles.valid.sum(axis=1)
