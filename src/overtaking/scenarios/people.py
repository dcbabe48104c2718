"""Draws the drivers: a hidden temper for each, and traits that depend on it."""

from typing import Any

import numpy as np

from overtaking.core.arrays import F32, U8, U64
from overtaking.core.compiled import clamp, exp, log, maximum, minimum
from overtaking.core.elementary import as_f32
from overtaking.core.philox import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge import Distribution
from overtaking.model.drivers import Drivers
from overtaking.model.vehicles import Role
from overtaking.scenarios.noise import Noise, cut_off, spread
from overtaking.scenarios.populations import KEPT_TRAITS, Population, population
from overtaking.scenarios.proposal import Bend, as_met
from overtaking.scenarios.schema import People, Traffic

LEAD_SLOT = 1
"""The slot of the vehicle that the ego follows at the start."""


def sample_traits(
    people: People, seed: int, index: U64, kind: U8, bend: Bend = as_met
) -> dict[str, F32]:
    """The traits of each driver, before speeds are drawn.

    Args:
        people: What the specification says about drivers.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
        kind: Vehicle types, shape (simulation, vehicle).
        bend: Draws tempers and the ego's traits from where more happens (see `proposal`).

    Returns:
        `populations.TRAITS` by name, each of the shape of `kind`; yes or no is 1 or 0.
    """
    slots = np.uint32(Stream.DRIVER) + np.arange(kind.shape[1], dtype=np.uint32)
    noise = Noise(seed, index[:, None], slots)
    who = population(people.population)
    temper = noise.uniform()
    temper[:, Role.EGO] = bend("ego_temper", temper[:, Role.EGO])
    for slot in range(Role.EGO + 1, temper.shape[1]):
        temper[:, slot] = bend("others_temper", temper[:, slot])
    temper = spread(temper, *people.temper)
    traits = {name: _trait(name, who, temper, noise, bend) for name in who.careful}
    for name, factors in who.factors.items():
        traits[name] = traits[name] * as_f32(factors)[kind]
    for name, value in people.fixed.values().items():
        traits[name] = np.full(kind.shape, value, np.float32)
    for name, factor in (people.scale or {}).items():
        traits[name] = traits[name] * np.float32(factor)
    return traits


def drivers_of(traits: dict[str, F32], came_with: F32, max_speed: F32) -> Drivers:
    """Drivers with the speeds that they want.

    The traffic goes on at about the speed that it came with. The ego wants to be faster than its
    leader, unless it is one of the few who are content to follow.

    Args:
        traits: As `sample_traits` returns them.
        came_with: Speeds that were drawn for the vehicles, shape (simulation, vehicle) [m/s].
        max_speed: Top speeds, the same shape [m/s].
    """
    desired = came_with * traits["cruise_factor"]
    lead, own = desired[:, LEAD_SLOT], came_with[:, Role.EGO]
    wants = traits["wants_to_overtake"][:, Role.EGO] > 0
    faster = maximum(own, lead + traits["speed_over_leader"][:, Role.EGO])
    desired[:, Role.EGO] = np.where(wants, faster, minimum(own, lead))
    return drivers_with(traits, minimum(desired, max_speed))


def drivers_with(traits: dict[str, F32], desired_speed: F32) -> Drivers:
    """Drivers who want given speeds, shape (simulation, vehicle) [m/s]."""
    kept: dict[str, Any] = {
        name: traits[name] > 0 if field.is_flag else traits[name]
        for name, field in KEPT_TRAITS.items()
    }
    return Drivers(desired_speed=desired_speed, **kept)


def fastest_wish(people: People, traffic: Traffic) -> float:
    """The highest speed that anyone may want [m/s]."""
    who = population(people.population)
    gain = max(end["speed_over_leader"].high for end in (who.careful, who.reckless))
    cruise = most_cruise(people)
    came_with = mps_from_kmh(traffic.speed_kmh[1])
    lead = cruise * mps_from_kmh(traffic.lead_speed_kmh[1])
    return max(cruise * came_with, lead + gain)


def most_cruise(people: People) -> float:
    """The largest factor that anyone may have on the speed of their type."""
    who = population(people.population)
    return max(end["cruise_factor"].high for end in (who.careful, who.reckless))


def _trait(name: str, who: Population, temper: F32, noise: Noise, bend: Bend) -> F32:
    """One parameter of each driver, drawn from the distribution of its temper."""
    ends = (who.careful[name], who.reckless[name])
    kind = ends[0].kind
    if kind == "constant":
        return _between(temper, *(end.parameter("value") for end in ends))
    if kind == "bernoulli":
        probability = _between(temper, *(end.parameter("probability") for end in ends))
        drawn = noise.uniform()
        drawn[:, Role.EGO] = bend(f"ego_{name}", drawn[:, Role.EGO])
        return (drawn < probability).astype(np.float32)
    low, high = (
        _between(temper, *(getattr(end, side) for end in ends)) for side in ("low", "high")
    )
    if kind == "uniform":
        return spread(noise.uniform(), low, high)
    normal = noise.unbounded_normal()
    normal[:, Role.EGO] = bend(f"ego_{name}", normal[:, Role.EGO])
    deviation = _between(temper, *(end.parameter("sigma") for end in ends)) * cut_off(normal)
    return clamp(_shifted(kind, ends, temper, deviation), low, high)


def _shifted(
    kind: str, ends: tuple[Distribution, Distribution], temper: F32, deviation: F32
) -> F32:
    """Centre plus deviation of a normal, or their exponential of a lognormal."""
    if kind == "normal":
        return _between(temper, *(end.parameter("mean") for end in ends)) + deviation
    medians = log(as_f32([end.parameter("median") for end in ends]))
    return exp(_between(temper, float(medians[0]), float(medians[1])) + deviation)


def _between(temper: F32, careful: float, reckless: float) -> F32:
    """What lies between two ends in proportion to the temper."""
    start, end = np.float32(careful), np.float32(reckless)
    return start + (end - start) * temper
