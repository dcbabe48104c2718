"""A batch of scenarios: everything that is decided before the first frame."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, U8, U64
from overtaking.core.checks import convert_integers
from overtaking.model.batch import Constraint, IdentityBatch
from overtaking.model.drivers import Drivers
from overtaking.model.road import MAX_LENGTH, Road
from overtaking.model.values import within
from overtaking.model.vehicles import VehicleSpecs
from overtaking.model.weather import Pushes, Weather

SLOTS = (8, 16, 32)
"""The engine is compiled for so many vehicle slots; a batch may have any number up to the last."""

MAX_VEHICLES = SLOTS[-1]
"""Most vehicles of a simulation."""

MAX_DURATION = 6000.0
"""Longest simulation, and recording of one overtake [s]."""

_EACH = ("simulation", "vehicle")


def slots_for(vehicles: int) -> int:
    """The fewest slots with room for a number of vehicles, 0 <= vehicles <= `MAX_VEHICLES`."""
    return max(vehicles, 1)


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class Scenario(IdentityBatch):
    """Inputs of a batch of simulations on one road.

    Attributes:
        profile: Name of the profile that they were drawn from.
        road: The road, the same for the batch.
        seed: Seed of the random numbers, 0 <= seed < 2**64.
        frame_interval_ms: Time between recorded frames, a multiple of 10 to be simulated [ms].
        index: Number of each simulation, shape (simulation,).
        horizon: Longest duration, shape (simulation,) [s].
        attempt_deadline: A simulation without an attempt ends here, shape (simulation,) [s].
        weight: Sampling weight p/q, shape (simulation,).
        vehicles: Bodies, (simulation, vehicle).
        drivers: People, (simulation, vehicle).
        weather: Weather, (simulation,).
        start_s: Position of the centre at the first frame, (simulation, vehicle) [m].
        start_lane: Lane index, 0 the slowest; on a two-way road the number of its lanes stands for
            the lane of who comes the other way, (simulation, vehicle).
        start_speed: Speed at the first frame, (simulation, vehicle) [m/s].
        pushes: How weather acts instead of by physics, the same for the batch; None for physics.
    """

    profile: str
    road: Road
    seed: Annotated[int, within(0, 2**64 - 1)]
    frame_interval_ms: Annotated[int, within(1, 1000, "ms")]
    index: U64
    horizon: Annotated[F32, within(0.0, MAX_DURATION, "s", is_open=True)]
    attempt_deadline: Annotated[F32, within(0.0, 1e6, "s", is_open=True)]
    weight: Annotated[F64, within(0.0, 1e12)]
    vehicles: VehicleSpecs
    drivers: Drivers
    weather: Weather
    start_s: Annotated[F32, within(-MAX_LENGTH, MAX_LENGTH, "m", axes=_EACH)]
    start_lane: Annotated[U8, within(0, "lane or oncoming", axes=_EACH)]
    start_speed: Annotated[F32, within(0.0, 150.0, "m/s", axes=_EACH)]
    pushes: Pushes | None = None

    def __post_init__(self) -> None:
        """Accept a seed of NumPy."""
        convert_integers(self, "seed")

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

    def summary(self) -> Mapping[str, object]:
        """Where it comes from and how large it is."""
        return {
            "profile": self.profile,
            "road": self.road.name,
            "seed": self.seed,
            "simulations": self.num_simulations,
            "vehicles": self.num_slots,
        }

    def sizes(self) -> Mapping[str, int]:
        """Lanes of the road; a place may also be beyond the fastest one."""
        lanes = self.road.num_lanes
        ways = {"lane": lanes, "lane or beyond": lanes + 1}
        return ways | {"lane or oncoming": lanes + self.road.is_two_way}

    def constraints(self) -> Iterable[Constraint]:
        """Vehicles start before the end of the road."""
        beyond = self.vehicles.valid & (self.start_s > self.road.length)
        end = f"at most {self.road.length:g} m, the length of the road"
        yield Constraint("start_s", end, beyond, self.start_s)
