"""Scenarios, and what branches change in them."""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, U8, U64
from overtaking.core.errors import convert_integers
from overtaking.model.batch import AxisEnd, Batch, Constraint, FieldSpec, IdentityBatch
from overtaking.model.road import MAX_LENGTH, Road
from overtaking.model.vehicles import DriverTraits, Role, VehicleSpecs
from overtaking.model.weather import LateralPushes, Weather

SLOT_CAPACITIES = (8, 16, 32)
"""The engine is compiled for so many vehicle slots; a batch may have any number up to the last."""

MAX_VEHICLES = SLOT_CAPACITIES[-1]
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
    seed: Annotated[int, FieldSpec(low=0, high=2**64 - 1)]
    frame_interval_ms: Annotated[int, FieldSpec(unit="ms", low=1, high=1000)]
    index: U64
    horizon: Annotated[F32, FieldSpec(unit="s", low=0.0, high=MAX_DURATION, low_is_open=True)]
    attempt_deadline: Annotated[F32, FieldSpec(unit="s", low=0.0, high=1e6, low_is_open=True)]
    weight: Annotated[F64, FieldSpec(low=0.0, high=1e12)]
    vehicles: VehicleSpecs
    drivers: DriverTraits
    weather: Weather
    start_s: Annotated[F32, FieldSpec(unit="m", low=-MAX_LENGTH, high=MAX_LENGTH, axes=_EACH)]
    start_lane: Annotated[U8, FieldSpec(low=0, high=AxisEnd("lane or oncoming"), axes=_EACH)]
    start_speed: Annotated[F32, FieldSpec(unit="m/s", low=0.0, high=150.0, axes=_EACH)]
    pushes: LateralPushes | None = None

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

    def axis_lengths(self) -> Mapping[str, int]:
        """Lanes of the road; a place may also be beyond the fastest one."""
        lanes = self.road.num_lanes
        ways = {"lane": lanes, "lane or beyond": lanes + 1}
        return ways | {"lane or oncoming": lanes + self.road.is_two_way}

    def constraints(self) -> Iterable[Constraint]:
        """Vehicles start before the end of the road."""
        beyond = self.vehicles.valid & (self.start_s > self.road.length)
        end = f"at most {self.road.length:g} m, the length of the road"
        yield Constraint("start_s", end, beyond, self.start_s)


class ForcedDecision(IntEnum):
    """A decision that can be forced on the ego, from the first instant that allows it."""

    FREE = 0  # decide alone, as in an undisturbed simulation
    PULL_OUT = 1  # begin the overtake, whatever the gaps
    ABORT = 2  # go back while pulling out
    RETURN = 3  # change back to the slower lane, whatever is there
    STAY = 4  # never begin an overtake


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervention:
    """What is different from a frame on; what is left out stays.

    Attributes:
        frame: First frame that it can affect; at 0 the start itself is another one.
        decision: Forced on every ego until another change says something else.
        weather: Weather from then on, shape (simulation,) or of one simulation for all.
        without: What is taken away from the weather: names in `model.weather.REMOVABLE_FACTORS`.
        vehicle: Slot of the vehicle that the rest is about.
        traits: Traits of its driver, names in `model.vehicles.DriverTraits`, SI units.
        ahead: How much further along the road it is, also in the memory of all drivers [m].
        faster: How much faster it drives and wants to drive [m/s].
        removed: Whether it is taken away. Drivers who have noticed it look anew at once.
    """

    frame: Annotated[int, FieldSpec(low=0, high=2**31 - 1)] = 0
    decision: ForcedDecision | None = None
    weather: Weather | None = None
    without: tuple[str, ...] = ()
    vehicle: Annotated[int, FieldSpec(low=0, high=MAX_VEHICLES - 1)] = Role.EGO
    traits: Mapping[str, float] = field(default_factory=dict[str, float])
    ahead: Annotated[float, FieldSpec(unit="m", low=-1e4, high=1e4)] = 0.0
    faster: Annotated[float, FieldSpec(unit="m/s", low=-100.0, high=100.0)] = 0.0
    removed: bool = False

    def __post_init__(self) -> None:
        """Accept integers of NumPy."""
        convert_integers(self, "frame", "vehicle")

    def to_dict(self) -> dict[str, Any]:
        """Plain values of what is different, from which `from_json` makes an equal change."""
        found: dict[str, Any] = {"frame": self.frame}
        if self.decision is not None:
            found["decision"] = self.decision.name
        if self.weather is not None:
            rows = dataclasses.fields(self.weather)
            found["weather"] = {one.name: getattr(self.weather, one.name).tolist() for one in rows}
        for name in ("without", "traits", "ahead", "faster", "removed"):
            if value := getattr(self, name):
                found[name] = list(value) if isinstance(value, tuple) else value
        if self.about_vehicle:
            found["vehicle"] = self.vehicle
        return found

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Intervention":
        """The change that `as_json` has written.

        Raises:
            KeyError, TypeError, ValueError: It is none.
        """
        given = dict(values)
        if "decision" in given:
            given["decision"] = ForcedDecision[given["decision"]]
        if "weather" in given:
            given["weather"] = Weather(**_arrays(given["weather"]))
        given["without"] = tuple(given.get("without", ()))
        return cls(**given)

    @property
    def about_vehicle(self) -> bool:
        """Whether it is about a single vehicle."""
        return bool(self.traits or self.ahead or self.faster or self.removed)


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchOrigin(Batch):
    """What a batch branches from, and by what.

    Attributes:
        scenario: The scenarios before any change.
        changes: All changes, in the order of their frames.
    """

    scenario: Scenario
    changes: tuple[Intervention, ...]


def _arrays(columns: Mapping[str, list[Any]]) -> dict[str, Any]:
    """Columns of a weather with the types of its fields."""
    kinds = {"preset": np.uint8, "night": np.bool_, "horizon_line": np.bool_}
    return {name: np.array(one, kinds.get(name, np.float32)) for name, one in columns.items()}
