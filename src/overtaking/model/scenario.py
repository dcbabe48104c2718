"""Scenarios, and the interventions of branches."""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, U8, U64
from overtaking.core.errors import convert_integers
from overtaking.model.batch import (
    AxisEnd,
    Batch,
    Constraint,
    FieldSpec,
    IdentityBatch,
    batch_fields,
)
from overtaking.model.road import MAX_LENGTH, Road
from overtaking.model.vehicles import EGO_SLOT, DriverTraits, VehicleSpecs
from overtaking.model.weather import LateralPushes, Weather

SLOT_CAPACITIES = (8, 16, 32)
"""Numbers of vehicle slots that the engine is compiled for.

A batch may have any number up to the last; the engine fills it up to the next of these.
"""

MAX_VEHICLES = SLOT_CAPACITIES[-1]
"""Most vehicles of a simulation."""

MAX_DURATION = 6000.0
"""Longest simulation, and longest recording of one overtake [s]."""

_VEHICLE_AXES = ("simulation", "vehicle")


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class Scenario(IdentityBatch):
    """Inputs of a batch of simulations on one road.

    Results of a batch are cached by the object (`model.batch.cached_per_batch`) through weak
    references. Therefore it equals no other object, and `equals` compares the content.

    Attributes:
        profile: Name of the profile that they were drawn from.
        road: The road, the same for the batch.
        seed: Seed of the random numbers, 0 <= seed < 2**64.
        frame_interval_ms: Time between recorded frames [ms]. Recordings may have any interval up
            to 1 s; `simulate` accepts only multiples of its time step, 10 ms.
        scenario_index: Number from which each simulation is drawn, shape (simulation,).
        horizon: Longest duration, shape (simulation,) [s].
        attempt_deadline: A simulation without an attempt ends here, shape (simulation,) [s]. It has
            no effect if it lies beyond the horizon.
        weight: Sampling weight p/q, shape (simulation,).
        vehicles: Bodies, (simulation, vehicle).
        drivers: People, (simulation, vehicle).
        weather: Weather, (simulation,).
        start_s: Position of the centre at the first frame, (simulation, vehicle) [m].
        start_lane: Lane index, 0 the slowest; on a two-way road the number of its lanes stands for
            the opposing lane, (simulation, vehicle).
        start_speed: Speed at the first frame, (simulation, vehicle) [m/s].
        pushes: Lateral pushes and a reduced sight distance instead of all physical effects of the
            weather (the road is dry), the same for the batch; None for the physical effects.
    """

    profile: str
    road: Road
    seed: Annotated[int, FieldSpec(low=0, high=2**64 - 1)]
    frame_interval_ms: Annotated[int, FieldSpec(unit="ms", low=1, high=1000)]
    scenario_index: Annotated[U64, FieldSpec("Number from which the scenario was drawn")]
    horizon: Annotated[F32, FieldSpec("Longest duration", "s", 0.0, MAX_DURATION, low_is_open=True)]
    attempt_deadline: Annotated[
        F32, FieldSpec("A simulation without an attempt ends here", "s", 0.0, 1e6, low_is_open=True)
    ]
    weight: Annotated[
        F64, FieldSpec("Sampling weight: natural over sampled probability", "1", 0.0, 1e12)
    ]
    vehicles: VehicleSpecs
    drivers: DriverTraits
    weather: Weather
    start_s: Annotated[
        F32,
        FieldSpec(
            "Position along the road before the first step",
            "m",
            -MAX_LENGTH,
            MAX_LENGTH,
            axes=_VEHICLE_AXES,
        ),
    ]
    start_lane: Annotated[
        U8, FieldSpec(low=0, high=AxisEnd("lane or oncoming"), axes=_VEHICLE_AXES)
    ]
    start_speed: Annotated[
        F32, FieldSpec("Speed before the first step", "m/s", 0.0, 150.0, axes=_VEHICLE_AXES)
    ]
    pushes: LateralPushes | None = None

    def __post_init__(self) -> None:
        """Accept a seed of NumPy."""
        convert_integers(self, "seed")

    @property
    def num_simulations(self) -> int:
        """Number of simulations in the batch."""
        return len(self.scenario_index)

    @property
    def num_slots(self) -> int:
        """Number of vehicle slots, filled or not."""
        return self.start_s.shape[1]

    @property
    def num_vehicles(self) -> NDArray[np.int64]:
        """Number of vehicles of each simulation, shape (simulation,)."""
        return self.vehicles.valid.sum(axis=1)

    def summary(self) -> Mapping[str, object]:
        """Origin and size of the batch, by name."""
        return {
            "profile": self.profile,
            "road": self.road.name,
            "seed": self.seed,
            "simulations": self.num_simulations,
            "vehicles": self.num_slots,
        }

    def axis_lengths(self) -> Mapping[str, int]:
        """Number of values of a lane index, by what may have one.

        `lane` counts the lanes alone. `lane or beyond` has one more value, for states of vehicles
        beyond the overtaking-side edge (`States.lane`). `lane or oncoming` has one more value on
        two-way roads, for the opposing lane. The largest index is one less (`AxisEnd`).
        """
        lanes = self.road.num_lanes
        ways = {"lane": lanes, "lane or beyond": lanes + 1}
        return ways | {"lane or oncoming": lanes + self.road.is_two_way}

    def constraints(self) -> Iterable[Constraint]:
        """Vehicles start before the end of the road."""
        is_beyond_end = self.vehicles.valid & (self.start_s > self.road.length)
        expected = f"at most {self.road.length:g} m, the length of the road"
        yield Constraint("start_s", expected, is_beyond_end, self.start_s)


class ForcedDecision(IntEnum):
    """A decision that can be forced on the ego, from the first instant that allows it."""

    FREE = 0  # Nothing is forced; ends what an earlier intervention forced.
    PULL_OUT = 1  # Begin the overtake, regardless of the gaps.
    CANCEL = 2  # Turn back while pulling out.
    RETURN = 3  # Change back to the slower lane, regardless of the gaps.
    STAY = 4  # Never begin an overtake.


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervention:
    """Changes of a simulation from a frame on. A field with its default changes nothing.

    `overtaking.branch` checks the ranges of the fields, not the constructor.

    Attributes:
        frame: First frame that it can affect; at 0 the start itself changes.
        decision: Forced on every ego, until an intervention at a later frame forces another one;
            None leaves the decision that an earlier intervention forced.
        weather: Weather from then on, shape (simulation,) or of one simulation for all.
        without: Factors removed from the weather: names in `model.weather.REMOVABLE_FACTORS`.
        slot: Slot of the vehicle that the fields below change.
        traits: Traits of its driver, names in `model.vehicles.DriverTraits`, SI units.
        position_change: Distance by which it is displaced in its direction of travel [m]. The
            positions that drivers perceived before are displaced too: no driver sees a jump.
        speed_change: Increase of its speed and of its desired speed [m/s].
        remove: Whether to remove it, which is impossible for the ego. The vehicle goes far behind
            the road, where no other vehicle meets it. Drivers who have noticed it look anew at
            once.
    """

    frame: Annotated[int, FieldSpec(low=0, high=2**31 - 1)] = 0
    decision: ForcedDecision | None = None
    weather: Weather | None = None
    without: tuple[str, ...] = ()
    slot: Annotated[int, FieldSpec(low=0, high=MAX_VEHICLES - 1)] = EGO_SLOT
    traits: Mapping[str, float] = field(default_factory=dict[str, float])
    position_change: Annotated[float, FieldSpec(unit="m", low=-1e4, high=1e4)] = 0.0
    speed_change: Annotated[float, FieldSpec(unit="m/s", low=-100.0, high=100.0)] = 0.0
    remove: bool = False

    def __post_init__(self) -> None:
        """Accept integers of NumPy."""
        convert_integers(self, "frame", "slot")

    def to_dict(self) -> dict[str, Any]:
        """Its changes as plain values, from which `from_dict` makes an equal intervention."""
        values: dict[str, Any] = {"frame": self.frame}
        if self.decision is not None:
            values["decision"] = self.decision.name
        if self.weather is not None:
            names = [field.name for field in dataclasses.fields(self.weather)]
            values["weather"] = {name: getattr(self.weather, name).tolist() for name in names}
        for name in ("without", "traits", "position_change", "speed_change", "remove"):
            if value := getattr(self, name):
                values[name] = list(value) if isinstance(value, tuple) else value
        if self.is_about_vehicle:
            values["slot"] = self.slot
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Intervention":
        """The intervention that `to_dict` has written.

        Raises:
            KeyError, TypeError, ValueError: The values describe no intervention.
        """
        fields = dict(values)
        if "decision" in fields:
            fields["decision"] = ForcedDecision[fields["decision"]]
        if "weather" in fields:
            fields["weather"] = Weather(**_weather_arrays(fields["weather"]))
        fields["without"] = tuple(fields.get("without", ()))
        return cls(**fields)

    @property
    def is_about_vehicle(self) -> bool:
        """Whether it changes a single vehicle."""
        return bool(self.traits or self.position_change or self.speed_change or self.remove)


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchOrigin(Batch):
    """Origin of a batch of branches.

    Attributes:
        scenario: The scenarios before any intervention.
        interventions: All of them, in the order of their frames.
    """

    scenario: Scenario
    interventions: tuple[Intervention, ...]


def _weather_arrays(columns: Mapping[str, list[Any]]) -> dict[str, Any]:
    """The fields of a weather as arrays of their dtypes."""
    fields = batch_fields(Weather)
    return {name: np.array(values, fields[name].dtype) for name, values in columns.items()}
