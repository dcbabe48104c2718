"""Draws the traits of drivers.

A *trait* is a number or flag of a driver, such as the desired time gap. A *population* in
`knowledge/data/drivers.toml` has two distributions of each trait: among *careful* drivers (driving
style 0) and among *reckless* ones (1). A driving style is drawn for each driver, and its traits are
drawn from distributions in between. `sample_traits` draws all traits. Then `drivers_from_speeds` or
`drivers_with_speed` adds the desired speeds and returns the drivers as `DriverTraits`, a dataclass
of arrays.

The samplers of the three kinds of traffic call these functions. In *placed traffic* a few vehicles
start at random speeds in a short zone, the ego behind a leader, and desired speeds follow from the
drawn speeds. On motorways and two-way roads the samplers compute the desired speeds.

Arrays have shape (simulation, vehicle). The position of a vehicle in the second axis is its *slot*;
slot 0 is the ego, the driver whose overtaking is studied. Numbers are computed in float32 with the
functions of `core.native`, which give the same bits on every machine.
"""

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
"""In placed traffic, the slot of the leader: the vehicle that the ego follows at the start. In
other traffic the slot has no special meaning."""

_POPULATIONS_FILE = "drivers.toml"

SPEED_TRAITS = {
    "cruise_factor": FieldSpec(
        "Desired speed over the drawn speed (placed traffic) or the usual speed of the class"
    ),
    "speed_over_leader": FieldSpec(
        "Least excess of an ego's desired speed over its leader's", "m/s"
    ),
    "wants_to_overtake": FieldSpec("Whether an ego wants to drive faster than its leader at all"),
}
"""Traits from which desired speeds are computed; only placed traffic uses the last two. They are
not fields of `DriverTraits`, so their meanings and units are declared here."""

RECORDED_TRAITS = {
    name: field for name, field in batch_fields(DriverTraits).items() if name != "desired_speed"
}
"""Traits that scenarios store: the fields of `DriverTraits` except for the desired speed."""

ALL_TRAITS = {name: field.spec for name, field in RECORDED_TRAITS.items()} | SPEED_TRAITS
"""Meaning, unit and range of every trait that is drawn, by name."""

CLASS_FACTORS = {
    "time_gap_factor": "time_gap",
    "accel_factor": "accel",
    "lane_change_factor": "lane_change_duration",
}
"""Factors by which drivers of a vehicle class, such as trucks, differ from car drivers: key in
`drivers.toml`, and the trait that the factor multiplies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Population:
    """Distributions of traits at the two extremes of the driving style.

    Attributes:
        careful: Distribution of each of `ALL_TRAITS` among drivers of driving style 0, in the order
            in which they are drawn, which is the order of the file.
        reckless: The same among drivers of driving style 1.
        factors: For the traits of `CLASS_FACTORS` and for `decel`, the comfortable deceleration:
            the value in each vehicle class over the value in a car, in the order of
            `VEHICLE_CLASS_NAMES`.
    """

    careful: Mapping[str, Distribution]
    reckless: Mapping[str, Distribution]
    factors: Mapping[str, tuple[float, ...]]

    def __post_init__(self) -> None:
        """Refuse a missing trait, and extremes with different kinds of distribution.

        Drivers between the extremes have distributions with interpolated parameters, which only
        distributions of the same kind share.
        """
        for name in ALL_TRAITS:
            # The lists are compared with their order, because it decides which random number
            # each trait gets.
            if name not in self.careful or list(self.careful) != list(self.reckless):
                raise _file_error(name, "each trait in both extremes, in one order", "another list")
            kind, reckless_kind = self.careful[name].kind, self.reckless[name].kind
            if kind != reckless_kind:
                expected = "one kind of distribution from careful to reckless"
                raise _file_error(name, expected, f"{kind} and {reckless_kind}")


def population_names() -> tuple[str, ...]:
    """Names of the populations in `drivers.toml`, such as `motorway`."""
    return tuple(load_toml(_POPULATIONS_FILE))


@cache
def load_population(name: str) -> Population:
    """Read a population.

    Args:
        name: One of `population_names()`.

    Raises:
        KnowledgeError: The name is unknown, or an entry of the population is invalid.
    """
    if name not in population_names():
        raise _file_error(f"population {name}", f"one of {', '.join(population_names())}", name)
    # By dotted key: `<population>.careful.<trait>`, `<population>.reckless.<trait>` or
    # `<population>.classes.<vehicle class>.<factor>`. The factors are taken out first.
    entries = {
        key: entry
        for key, entry in all_quantities(_POPULATIONS_FILE).items()
        if key.startswith(f"{name}.")
    }
    factors = {
        trait: tuple(
            _class_factor(entries.pop(f"{name}.classes.{vehicle_class}.{key}", None), key)
            for vehicle_class in VEHICLE_CLASS_NAMES
        )
        for key, trait in CLASS_FACTORS.items()
    }
    # Populations state the comfortable deceleration of car drivers, without factors of classes.
    # These are quotients of the decelerations that `vehicle_classes.toml` states for each class;
    # "M", the medium car, is the reference.
    decels = [entry.comfort_decel.number for entry in vehicle_classes().values()]
    car_decel = vehicle_classes()["M"].comfort_decel.number
    factors["decel"] = tuple(decel / car_decel for decel in decels)
    extremes: dict[str, dict[str, Distribution]] = {"careful": {}, "reckless": {}}
    for key, entry in entries.items():
        _, extreme, trait = key.split(".", 2)
        if extreme not in extremes or trait not in ALL_TRAITS:
            raise _file_error(
                f"unknown key {key}", "a trait of an extreme or a factor of a class", entry
            )
        extremes[extreme][trait] = _trait_distribution(entry, trait)
    return Population(**extremes, factors=factors)


def trait_range(population_name: str, trait: str) -> tuple[float, float]:
    """Smallest and largest value of a trait that a driver of a population can draw, in its unit.

    The check of a specification multiplies them by the factors that the specification states.

    Args:
        population_name: One of `population_names()`.
        trait: One of `ALL_TRAITS`.
    """
    population = load_population(population_name)
    extremes = (population.careful[trait], population.reckless[trait])
    factors = as_f32(population.factors.get(trait, (1.0,)))  # Rounded as in `sample_traits`.
    low = min(distribution.low for distribution in extremes)
    high = max(distribution.high for distribution in extremes)
    return low * float(factors.min()), high * float(factors.max())


def _trait_distribution(entry: Distribution | Quantity, trait: str) -> Distribution:
    """The entry of a trait, checked: a distribution in the unit of the trait."""
    unit = ALL_TRAITS[trait].unit
    if isinstance(entry, Distribution) and entry.unit == unit:
        return entry
    raise _file_error(trait, f"a distribution in {unit}", entry)


def _class_factor(entry: Distribution | Quantity | None, key: str) -> float:
    """A factor of a vehicle class; 1, as for a car, where the file has no entry (None)."""
    if isinstance(entry, Distribution):
        raise _file_error(key, "a quantity", entry)
    return 1.0 if entry is None else entry.number


def _file_error(what: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError(
        what=what,
        where=_POPULATIONS_FILE,
        expected=expected,
        got=got,
        next_step="correct the entry",
    )


def sample_traits(
    block: SampleBlock, vehicle_class: U8, transform: NumberTransform = identity_transform
) -> dict[str, F32]:
    """Draw the traits of each driver.

    Args:
        block: The simulations that are drawn together, with their random numbers. Section
            `[drivers]` of its specification names the population, the range of driving styles, and
            traits that are fixed or scaled for all drivers.
        vehicle_class: Class of each vehicle, its position in `VEHICLE_CLASS_NAMES`, shape
            (simulation, vehicle).
        transform: Called with a name and random numbers, shape (simulation,); returns the numbers
            to use. Importance sampling replaces numbers here; by default they stay. The names are
            "ego_driving_style", "others_driving_style" (once for each other driver), and
            "ego_<trait>" for each trait of the ego that is not constant.

    Returns:
        Values of `ALL_TRAITS` by name, each with the shape of `vehicle_class`; flags are 1 or 0.
    """
    section = block.specification.drivers
    # Each driver has a random stream of its own; numbers have shape (simulation, vehicle).
    stream = block.slot_streams(Stream.DRIVER, vehicle_class.shape[1])
    population = load_population(section.population)
    driving_style = stream.uniform()
    driving_style[:, EGO_SLOT] = transform("ego_driving_style", driving_style[:, EGO_SLOT])
    for slot in range(EGO_SLOT + 1, driving_style.shape[1]):
        driving_style[:, slot] = transform("others_driving_style", driving_style[:, slot])
    driving_style = scale_to_range(driving_style, *section.driving_style)
    # All traits of a driver come from one stream, so the order of the population decides values.
    traits = {
        name: _draw_trait(name, population, driving_style, stream, transform)
        for name in population.careful
    }
    for name, factors in population.factors.items():
        traits[name] = traits[name] * as_f32(factors)[vehicle_class]
    # After the factors of vehicle classes: a fixed value holds in every vehicle.
    for name, value in section.fixed.value_by_trait().items():
        traits[name] = np.full(vehicle_class.shape, value, np.float32)
    # A trait may be both fixed and scaled; then the product holds.
    for name, factor in (section.scale or {}).items():
        traits[name] = traits[name] * np.float32(factor)
    return traits


def drivers_from_speeds(
    traits: Mapping[str, F32], drawn_speed: F32, max_speed: F32
) -> DriverTraits:
    """Drivers of placed traffic, whose desired speeds follow from the speeds at the start.

    The other drivers want their drawn speed times `cruise_factor`, which the ego does not use. An
    ego with the trait `wants_to_overtake` wants its drawn speed, but at least its leader's desired
    speed plus `speed_over_leader`. Any other ego wants its drawn speed, but at most its leader's
    desired speed. No driver wants more than the top speed of its vehicle.

    Args:
        traits: As `sample_traits` returns them.
        drawn_speed: Speeds drawn for the start, shape (simulation, vehicle) [m/s].
        max_speed: Top speeds of the vehicles, the same shape [m/s].
    """
    desired = drawn_speed * traits["cruise_factor"]
    leader, ego = desired[:, LEADER_SLOT], drawn_speed[:, EGO_SLOT]
    wants_to_overtake = traits["wants_to_overtake"][:, EGO_SLOT] > 0
    faster = maximum(ego, leader + traits["speed_over_leader"][:, EGO_SLOT])
    desired[:, EGO_SLOT] = np.where(wants_to_overtake, faster, minimum(ego, leader))
    return drivers_with_speed(traits, minimum(desired, max_speed))


def drivers_with_speed(traits: Mapping[str, F32], desired_speed: F32) -> DriverTraits:
    """Drivers with the given desired speeds, in traffic of any kind.

    Args:
        traits: As `sample_traits` returns them. `SPEED_TRAITS` are left out, because
            `desired_speed` takes their place.
        desired_speed: Desired speeds on a free road, shape (simulation, vehicle) [m/s].
    """
    recorded: dict[str, Any] = {
        name: traits[name] > 0 if field.is_flag else traits[name]
        for name, field in RECORDED_TRAITS.items()
    }
    return DriverTraits(desired_speed=desired_speed, **recorded)


def max_placed_desired_speed(drivers: DriversSection, traffic: PlacedTraffic) -> float:
    """Largest desired speed that `drivers_from_speeds` can give a driver [m/s].

    The sampler makes the road so long that no vehicle leaves it at this speed. A specification
    cannot fix or scale the traits of `SPEED_TRAITS`, so their distributions bound them.

    Args:
        drivers: Section `[drivers]` of the specification.
        traffic: Section `[traffic]` of the specification.
    """
    population = load_population(drivers.population)
    extremes = (population.careful, population.reckless)
    max_gain = max(distributions["speed_over_leader"].high for distributions in extremes)
    cruise_factor = max_cruise_factor(drivers)
    max_drawn_speed = mps_from_kmh(traffic.speed_kmh[1])  # Of all vehicles but the ego's leader.
    max_others_speed = cruise_factor * max_drawn_speed
    max_leader_speed = cruise_factor * mps_from_kmh(traffic.leader_speed_kmh[1])
    return max(max_drawn_speed, max_others_speed, max_leader_speed + max_gain)


def max_cruise_factor(drivers: DriversSection) -> float:
    """Largest value of the trait `cruise_factor` in the population of a section `[drivers]` [1].

    On motorways and two-way roads, the trait multiplies the usual speed of the vehicle class.
    """
    population = load_population(drivers.population)
    extremes = (population.careful, population.reckless)
    return max(distributions["cruise_factor"].high for distributions in extremes)


def _draw_trait(
    name: str,
    population: Population,
    driving_style: F32,
    stream: RandomStream,
    transform: NumberTransform,
) -> F32:
    """Draw one trait of each driver, shape (simulation, vehicle).

    A constant trait takes no random number from the stream, any other trait takes one: another
    count would change all traits drawn after it.
    """
    extremes = (population.careful[name], population.reckless[name])

    def interpolate_parameter(parameter: str) -> F32:
        careful, reckless = (entry.parameter(parameter) for entry in extremes)
        return _interpolate(driving_style, careful, reckless)

    distribution_kind = extremes[0].kind  # The same at both extremes, see `Population`.
    if distribution_kind == "constant":
        return interpolate_parameter("value")
    if distribution_kind == "bernoulli":
        u = stream.uniform()
        u[:, EGO_SLOT] = transform(f"ego_{name}", u[:, EGO_SLOT])
        return (u < interpolate_parameter("probability")).astype(np.float32)
    low = _interpolate(driving_style, *(entry.low for entry in extremes))
    high = _interpolate(driving_style, *(entry.high for entry in extremes))
    # `truncate` clips all normal numbers at 2.5 standard deviations, so that no driver is too
    # extreme for its style; `low` and `high` then exclude values that no style has. `truncate`
    # follows the transform, because the weights of importance sampling hold for numbers of the
    # unbounded normal distribution.
    z = stream.unbounded_normal()
    z[:, EGO_SLOT] = transform(f"ego_{name}", z[:, EGO_SLOT])
    deviation = interpolate_parameter("sigma") * truncate(z)
    if distribution_kind == "normal":
        return clamp(interpolate_parameter("mean") + deviation, low, high)
    # Lognormal: `sigma` is the standard deviation of the logarithm, and the logarithms of the
    # medians are interpolated.
    log_medians = log(as_f32([entry.parameter("median") for entry in extremes]))
    centre = _interpolate(driving_style, float(log_medians[0]), float(log_medians[1]))
    return clamp(exp(centre + deviation), low, high)


def _interpolate(driving_style: F32, careful: float, reckless: float) -> F32:
    """Linear interpolation: `careful` at driving style 0, `reckless` at 1."""
    careful32, reckless32 = np.float32(careful), np.float32(reckless)
    return careful32 + (reckless32 - careful32) * driving_style
