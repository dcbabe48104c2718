"""Inputs of simulations, and changes of them that make "what if" branches.

A `Scenario` is a batch of simulations on one road: array fields have one row per simulation. The
package `overtaking.scenarios` draws it from a profile, a file with the distributions of traffic,
drivers and weather. The engines simulate it; readers of recordings fill in one for real traffic.

Each simulation has the same number of vehicle slots. A slot holds one vehicle or is empty
(`vehicles.valid`); slot 0 holds the ego, the vehicle under study. An attempt is the start of an
overtake by the ego.

A branch repeats a simulation with the same random numbers and some `Intervention` objects: forced
decisions, other weather, other drivers or moved vehicles from a frame on.

`FieldSpec` declares description, unit, range and axes of a field; `model.checks` refuses other
values. `Batch` gives a class of arrays the methods `select` (rows), `replace` and `equals`.
"""

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
"""Numbers of vehicle slots for which the engine is compiled.

A batch may have any number up to the last; the engine adds empty slots up to the next of these.
"""

MAX_VEHICLES = SLOT_CAPACITIES[-1]
"""Most vehicles of a simulation."""

MAX_DURATION = 6000.0
"""Longest simulation, and longest recording of one overtake [s]. Chosen: far longer than any
overtake, and a bound of the memory that a damaged data set can ask for."""

_MAX_DEADLINE = 1e6
"""Largest attempt deadline [s]. Chosen: far beyond `MAX_DURATION`, so it ends no simulation."""

# Chosen: beyond any sensible value, to catch wrong units and damaged files.
_MAX_WEIGHT = 1e12
_MAX_SPEED = 150.0  # [m/s]

_VEHICLE_AXES = ("simulation", "vehicle")


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class Scenario(IdentityBatch):
    """Inputs of a batch of simulations on one road.

    Functions cache their results per `Scenario` object, through weak references
    (`model.batch.cached_per_batch`). Therefore `==` is true for the same object only, and `equals`
    compares the content.

    Attributes:
        profile: Name of the profile that the simulations were drawn from.
        road: The road of all simulations.
        seed: Seed of the random numbers, 0 <= seed < 2**64.
        frame_interval_ms: Time between recorded frames [ms]. Recordings may have any interval up
            to 1 s; `simulate` accepts only multiples of its time step, 10 ms.
        scenario_index: Number that together with profile and seed determines everything drawn for
            a simulation, shape (simulation,).
        horizon: Longest duration, shape (simulation,) [s].
        attempt_deadline: From this time on a simulation also ends in the first step in which the
            ego neither overtakes nor is about to overtake, because it never began or has given up.
            Shape (simulation,) [s]. No effect if it lies beyond the horizon.
        weight: Natural probability of the scenario over the probability with which it was drawn,
            shape (simulation,); 1 unless the profile oversamples rare events.
        vehicles: Bodies of the vehicles, shape (simulation, vehicle).
        drivers: Traits of their drivers, shape (simulation, vehicle).
        weather: Weather, shape (simulation,).
        start_s: Station of the centre of the body at the first frame, which is recorded before the
            first step; negative before the start of the road, shape (simulation, vehicle) [m].
        start_lane: Lane index at the first frame, shape (simulation, vehicle): 0 is the slowest
            lane; on a two-way road `road.num_lanes` is the opposing lane.
        start_speed: Speed at the first frame, not negative, also for oncoming vehicles, shape
            (simulation, vehicle) [m/s].
        pushes: None if weather acts physically, by friction, forces and sight. With `LateralPushes`
            it only pushes vehicles sideways and shortens sight, and the road stays dry, as in the
            reproduced study (`pinto2023`).
    """

    profile: str
    road: Road
    seed: Annotated[int, FieldSpec(low=0, high=2**64 - 1)]
    frame_interval_ms: Annotated[int, FieldSpec(unit="ms", low=1, high=1000)]
    scenario_index: Annotated[U64, FieldSpec("Number from which the scenario was drawn")]
    horizon: Annotated[F32, FieldSpec("Longest duration", "s", 0.0, MAX_DURATION, low_is_open=True)]
    attempt_deadline: Annotated[
        F32,
        FieldSpec(
            # Short for the table: a simulation also ends here if its attempt was given up before.
            "A simulation without an attempt ends here",
            "s",
            0.0,
            _MAX_DEADLINE,
            low_is_open=True,
        ),
    ]
    weight: Annotated[
        F64, FieldSpec("Sampling weight: natural over sampled probability", "1", 0.0, _MAX_WEIGHT)
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
        # Largest index: the entry "lane or oncoming" of `axis_lengths`, less one.
        U8,
        FieldSpec(low=0, high=AxisEnd("lane or oncoming"), axes=_VEHICLE_AXES),
    ]
    start_speed: Annotated[
        F32, FieldSpec("Speed before the first step", "m/s", 0.0, _MAX_SPEED, axes=_VEHICLE_AXES)
    ]
    pushes: LateralPushes | None = None

    def __post_init__(self) -> None:
        """Convert a seed of a NumPy integer type to a Python integer.

        Functions split the seed into words of 32 bits; narrow integers of NumPy would overflow.
        """
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
        """Origin and size of the batch, for its one-line representation."""
        return {
            "profile": self.profile,
            "road": self.road.name,
            "seed": self.seed,
            "simulations": self.num_simulations,
            "vehicles": self.num_slots,  # One number, although simulations may leave slots empty.
        }

    def axis_lengths(self) -> Mapping[str, int]:
        """Number of possible lane indices, by kind of index; `AxisEnd` limits fields by it.

        Returns:
            "lane": the driving lanes. "lane or beyond": one more, for recorded vehicles beyond the
            edge of the road on the overtaking side. "lane or oncoming": on two-way roads one more,
            for the opposing lane.
        """
        lanes = self.road.num_lanes
        return {
            "lane": lanes,
            "lane or beyond": lanes + 1,
            "lane or oncoming": lanes + self.road.is_two_way,
        }

    def constraints(self) -> Iterable[Constraint]:
        """The condition that vehicles start before the end of the road, for `model.checks`."""
        is_beyond_end = self.vehicles.valid & (self.start_s > self.road.length)
        expected = f"at most {self.road.length:g} m, the length of the road"
        yield Constraint("start_s", expected, is_beyond_end, self.start_s)


class ForcedDecision(IntEnum):
    """A decision that can be forced on the ego, carried out at the first instant that allows it."""

    FREE = 0  # Nothing is forced; this also ends the effect of an earlier intervention.
    PULL_OUT = 1  # Begin the overtake, regardless of the gaps.
    CANCEL = 2  # Turn back during the lane change that begins the overtake.
    RETURN = 3  # Change back to the slower lane, regardless of the gaps.
    STAY = 4  # Begin no overtake.


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervention:
    """Changes of all simulations of a batch from a frame on; a default value changes nothing.

    The constructor checks no ranges. The function `overtaking.branch`, which simulates branches,
    raises a `ConfigError` for a value out of range.

    Attributes:
        frame: First frame that can differ; at 0 the start itself changes.
        decision: Decision forced on every ego until an intervention at a later frame states another
            one; None leaves the decision that an earlier intervention forced.
        weather: Weather from this frame on, shape (simulation,), or (1,) for all simulations.
        without: Factors removed from the weather, also from a new one: names in
            `model.weather.REMOVABLE_FACTORS`.
        slot: Slot of the vehicle that the fields below change, in every simulation.
        traits: New traits of its driver: names of fields of `model.vehicles.DriverTraits` to values
            in SI units.
        position_change: Displacement in its direction of travel [m]. The positions that drivers
            perceived before are displaced too, so no driver sees a jump.
        speed_change: Increase of its speed and of its desired speed [m/s].
        remove: Whether to remove the vehicle; the ego cannot be removed. The vehicle is placed far
            before the start of the road, where no other vehicle meets it. Drivers who have noticed
            it look anew at once.
    """

    frame: Annotated[int, FieldSpec(low=0, high=2**31 - 1)] = 0
    decision: ForcedDecision | None = None
    weather: Weather | None = None
    without: tuple[str, ...] = ()
    slot: Annotated[int, FieldSpec(low=0, high=MAX_VEHICLES - 1)] = EGO_SLOT
    traits: Mapping[str, float] = field(default_factory=dict[str, float])
    # The ranges of both changes are chosen: wide enough for any question, to catch wrong units.
    position_change: Annotated[float, FieldSpec(unit="m", low=-1e4, high=1e4)] = 0.0
    speed_change: Annotated[float, FieldSpec(unit="m/s", low=-100.0, high=100.0)] = 0.0
    remove: bool = False

    def __post_init__(self) -> None:
        """Convert integers of NumPy types to Python integers."""
        convert_integers(self, "frame", "slot")

    def to_dict(self) -> dict[str, Any]:
        """The intervention as values for JSON, without defaults and without a meaningless `slot`.

        `from_dict` makes an intervention of the same effect.
        """
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
        """The intervention from the values of `to_dict`.

        Raises:
            KeyError, TypeError, ValueError: The values do not describe an intervention.
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
        """Whether it changes one vehicle, so that `slot` has a meaning."""
        return bool(self.traits or self.position_change or self.speed_change or self.remove)


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchOrigin(Batch):
    """Origin of a batch of branches, stored with their recording.

    Attributes:
        scenario: The scenarios from which the branches differ by the interventions alone.
        interventions: The interventions in each of the simulations, in the order of their frames.
    """

    scenario: Scenario
    interventions: tuple[Intervention, ...]


def _weather_arrays(columns: Mapping[str, list[Any]]) -> dict[str, Any]:
    """Fields of a `Weather`, from lists by field name to arrays of the declared dtypes."""
    fields = batch_fields(Weather)
    return {name: np.array(values, fields[name].dtype) for name, values in columns.items()}
