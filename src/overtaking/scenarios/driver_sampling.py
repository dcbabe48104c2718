"""Draws drivers from populations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.errors import KnowledgeError
from overtaking.core.float32_math import as_f32
from overtaking.core.native import clamp, exp, log, maximum, minimum
from overtaking.core.random_numbers import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.quantities import Distribution, Quantity
from overtaking.knowledge.toml_reader import all_quantities, load_toml
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES, vehicle_classes
from overtaking.model.batch import FieldSpec, batch_fields
from overtaking.model.vehicles import EGO_SLOT, DriverTraits
from overtaking.scenarios.random_draws import (
    NumberTransform,
    RandomStream,
    SampleBlock,
    identity_transform,
    scale_to_range,
    truncate,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from overtaking.core.arrays import F32, U8
    from overtaking.scenarios.specification import DriversSection
    from overtaking.scenarios.traffic_specification import PlacedTraffic

LEADER_SLOT = 1
"""The slot of the vehicle that the ego follows at the start."""

_FILE = "drivers.toml"

SPEED_TRAITS = {
    "cruise_factor": FieldSpec("Desired speed of the traffic over the speed drawn for it"),
    "speed_over_leader": FieldSpec("How much faster than its leader an ego wants to drive", "m/s"),
    "wants_to_overtake": FieldSpec("Whether an ego wants to drive faster than its leader at all"),
}
"""The traits that `DriverTraits.desired_speed` is made from; it does not keep them."""

RECORDED_TRAITS = {
    name: field for name, field in batch_fields(DriverTraits).items() if name != "desired_speed"
}
"""The traits that are fields of `DriverTraits`."""

ALL_TRAITS = {name: field.spec for name, field in RECORDED_TRAITS.items()} | SPEED_TRAITS
"""Every trait that is drawn."""

CLASS_FACTORS = {
    "time_gap_factor": "time_gap",
    "accel_factor": "accel",
    "lane_change_factor": "lane_change_duration",
}
"""Factors of a vehicle class on its drivers: key in the file, and trait that it multiplies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Population:
    """Drivers between two extremes.

    Attributes:
        careful: Distribution of each of `ALL_TRAITS` among drivers of driving style 0. The file's
            order is the order in which they are drawn.
        reckless: The same among drivers of driving style 1.
        factors: By trait, the factor of each vehicle class on what a driver would do in a car, in
            the order of `VEHICLE_CLASS_NAMES`: the factors of `CLASS_FACTORS`, and the comfortable
            braking of the class.
    """

    careful: Mapping[str, Distribution]
    reckless: Mapping[str, Distribution]
    factors: Mapping[str, tuple[float, ...]]

    def __post_init__(self) -> None:
        """Refuse a missing trait, and one whose two distributions are of different kinds."""
        for name in ALL_TRAITS:
            if name not in self.careful or list(self.careful) != list(self.reckless):
                raise _wrong(name, "each trait in both extremes, in one order", "another list")
            kinds = (self.careful[name].kind, self.reckless[name].kind)
            if kinds[0] != kinds[1] or kinds[0] == "choice":
                expected = "one kind of distribution from careful to reckless, not a choice"
                raise _wrong(name, expected, f"{kinds[0]} and {kinds[1]}")


def population_names() -> tuple[str, ...]:
    """The populations that the package knows."""
    return tuple(load_toml(_FILE))


@cache
def load_population(name: str) -> Population:
    """One of `population_names()`; KnowledgeError for any other name."""
    if name not in population_names():
        raise _wrong(f"population {name}", f"one of {', '.join(population_names())}", name)
    entries = {
        key: entry for key, entry in all_quantities(_FILE).items() if key.startswith(f"{name}.")
    }
    factors = {
        trait: tuple(
            _factor(entries.pop(f"{name}.classes.{kind}.{key}", None), key)
            for kind in VEHICLE_CLASS_NAMES
        )
        for key, trait in CLASS_FACTORS.items()
    }
    decels = [entry.comfort_decel.number for entry in vehicle_classes().values()]
    car_decel = vehicle_classes()["M"].comfort_decel.number
    factors["decel"] = tuple(decel / car_decel for decel in decels)
    ends: dict[str, dict[str, Distribution]] = {"careful": {}, "reckless": {}}
    for key, entry in entries.items():
        _, end, trait = key.split(".", 2)
        if end not in ends or trait not in ALL_TRAITS:
            raise _wrong(
                f"unknown key {key}", "a trait of an extreme or a factor of a class", entry
            )
        ends[end][trait] = _distribution(entry, trait)
    return Population(**ends, factors=factors)


def trait_range(name: str, trait: str) -> tuple[float, float]:
    """Least and largest number that a population has for a trait, in any vehicle."""
    population = load_population(name)
    ends = (population.careful[trait], population.reckless[trait])
    factors = as_f32(population.factors.get(trait, (1.0,)))
    low, high = min(end.low for end in ends), max(end.high for end in ends)
    return low * float(factors.min()), high * float(factors.max())


def _distribution(entry: Distribution | Quantity, trait: str) -> Distribution:
    """The distribution of a trait, which must have its unit."""
    unit = ALL_TRAITS[trait].unit
    if isinstance(entry, Distribution) and entry.unit == unit:
        return entry
    raise _wrong(trait, f"a distribution in {unit}", entry)


def _factor(entry: Distribution | Quantity | None, key: str) -> float:
    """A factor of a vehicle class; 1 where the file names no difference to a car."""
    if isinstance(entry, Distribution):
        raise _wrong(key, "a quantity", entry)
    return 1.0 if entry is None else entry.number


def _wrong(what: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError(
        what=what, where=_FILE, expected=expected, got=got, next_step="correct the entry"
    )


def sample_traits(
    block: SampleBlock, kind: U8, transform: NumberTransform = identity_transform
) -> dict[str, F32]:
    """Draw the traits of each driver, before speeds are drawn.

    Args:
        block: The simulations that are drawn together.
        kind: Vehicle classes, shape (simulation, vehicle).
        transform: Transforms the numbers of driving styles and of the ego's traits, see
            `ProposalSampler`.

    Returns:
        `ALL_TRAITS` by name, each of the shape of `kind`; yes or no is 1 or 0.
    """
    section = block.specification.drivers
    stream = block.slot_streams(Stream.DRIVER, kind.shape[1])
    population = load_population(section.population)
    driving_style = stream.uniform()
    driving_style[:, EGO_SLOT] = transform("ego_driving_style", driving_style[:, EGO_SLOT])
    for slot in range(EGO_SLOT + 1, driving_style.shape[1]):
        driving_style[:, slot] = transform("others_driving_style", driving_style[:, slot])
    driving_style = scale_to_range(driving_style, *section.driving_style)
    traits = {
        name: _trait(name, population, driving_style, stream, transform)
        for name in population.careful
    }
    for name, factors in population.factors.items():
        traits[name] = traits[name] * as_f32(factors)[kind]
    for name, value in section.fixed.values().items():
        traits[name] = np.full(kind.shape, value, np.float32)
    for name, factor in (section.scale or {}).items():
        traits[name] = traits[name] * np.float32(factor)
    return traits


def drivers_from_speeds(
    traits: Mapping[str, F32], drawn_speed: F32, max_speed: F32
) -> DriverTraits:
    """Drivers with the speeds that they want.

    The traffic goes on at about the speed that it came with. The ego wants to be faster than its
    leader, unless it is one of the few who are content to follow.

    Args:
        traits: As `sample_traits` returns them.
        drawn_speed: Speeds that were drawn for the vehicles, shape (simulation, vehicle) [m/s].
        max_speed: Top speeds, the same shape [m/s].
    """
    desired = drawn_speed * traits["cruise_factor"]
    leader, ego = desired[:, LEADER_SLOT], drawn_speed[:, EGO_SLOT]
    wants = traits["wants_to_overtake"][:, EGO_SLOT] > 0
    faster = maximum(ego, leader + traits["speed_over_leader"][:, EGO_SLOT])
    desired[:, EGO_SLOT] = np.where(wants, faster, minimum(ego, leader))
    return drivers_with_speed(traits, minimum(desired, max_speed))


def drivers_with_speed(traits: Mapping[str, F32], desired_speed: F32) -> DriverTraits:
    """Drivers who want given speeds, shape (simulation, vehicle) [m/s]."""
    recorded: dict[str, Any] = {
        name: traits[name] > 0 if field.is_flag else traits[name]
        for name, field in RECORDED_TRAITS.items()
    }
    return DriverTraits(desired_speed=desired_speed, **recorded)


def max_placed_desired_speed(people: DriversSection, traffic: PlacedTraffic) -> float:
    """The highest speed that anyone may want [m/s]."""
    population = load_population(people.population)
    gain = max(end["speed_over_leader"].high for end in (population.careful, population.reckless))
    cruise = max_cruise_factor(people)
    drawn_speed = mps_from_kmh(traffic.speed_kmh[1])
    lead = cruise * mps_from_kmh(traffic.leader_speed_kmh[1])
    return max(cruise * drawn_speed, lead + gain)


def max_cruise_factor(people: DriversSection) -> float:
    """The largest factor that anyone may have on the speed of their type."""
    population = load_population(people.population)
    return max(end["cruise_factor"].high for end in (population.careful, population.reckless))


def _trait(
    name: str,
    population: Population,
    driving_style: F32,
    stream: RandomStream,
    transform: NumberTransform,
) -> F32:
    """One trait of each driver, drawn from the distribution of its driving style."""
    ends = (population.careful[name], population.reckless[name])
    kind = ends[0].kind
    if kind == "constant":
        return _between(driving_style, *(end.parameter("value") for end in ends))
    if kind == "bernoulli":
        probability = _between(driving_style, *(end.parameter("probability") for end in ends))
        u = stream.uniform()
        u[:, EGO_SLOT] = transform(f"ego_{name}", u[:, EGO_SLOT])
        return (u < probability).astype(np.float32)
    low, high = (
        _between(driving_style, *(getattr(end, side) for end in ends)) for side in ("low", "high")
    )
    if kind == "uniform":
        return scale_to_range(stream.uniform(), low, high)
    normal = stream.unbounded_normal()
    normal[:, EGO_SLOT] = transform(f"ego_{name}", normal[:, EGO_SLOT])
    sigma = _between(driving_style, *(end.parameter("sigma") for end in ends))
    return clamp(
        _distribution_value(kind, ends, driving_style, sigma * truncate(normal)), low, high
    )


def _distribution_value(
    kind: str, ends: tuple[Distribution, Distribution], driving_style: F32, deviation: F32
) -> F32:
    """Centre plus deviation of a normal, or their exponential of a lognormal."""
    if kind == "normal":
        return _between(driving_style, *(end.parameter("mean") for end in ends)) + deviation
    medians = log(as_f32([end.parameter("median") for end in ends]))
    return exp(_between(driving_style, float(medians[0]), float(medians[1])) + deviation)


def _between(driving_style: F32, careful: float, reckless: float) -> F32:
    """The value between two ends that corresponds to the driving style."""
    start, end = np.float32(careful), np.float32(reckless)
    return start + (end - start) * driving_style
