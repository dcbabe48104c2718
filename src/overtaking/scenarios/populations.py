"""Driver populations, as read from the knowledge base."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from overtaking.core.elementary import as_f32
from overtaking.core.errors import KnowledgeError
from overtaking.knowledge import (
    VEHICLE_CLASS_ORDER,
    Distribution,
    Quantity,
    quantities,
    vehicle_classes,
)
from overtaking.knowledge.reader import load
from overtaking.model.batch import FieldSpec, batch_fields
from overtaking.model.drivers import Drivers

_FILE = "drivers.toml"

SPEED_TRAITS = {
    "cruise_factor": FieldSpec("Desired speed of the traffic over the speed drawn for it"),
    "speed_over_leader": FieldSpec("How much faster than its leader an ego wants to drive", "m/s"),
    "wants_to_overtake": FieldSpec("Whether an ego wants to drive faster than its leader at all"),
}
"""The traits that `Drivers.desired_speed` is made from; it does not keep them."""

KEPT_TRAITS = {
    name: field for name, field in batch_fields(Drivers).items() if name != "desired_speed"
}
"""The traits that are fields of `Drivers`."""

TRAITS = {name: field.spec for name, field in KEPT_TRAITS.items()} | SPEED_TRAITS
"""Every trait that is drawn."""

CLASS_FACTORS = {
    "time_gap_factor": "time_gap",
    "accel_factor": "accel",
    "lane_change_factor": "lane_change_duration",
}
"""What a vehicle class may change in its drivers: key in the file, and trait that it multiplies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Population:
    """Drivers between two extremes.

    Attributes:
        careful: Distribution of each of `TRAITS` among drivers of temper 0, in the order in which
            they are drawn, which is that of the file.
        reckless: The same among drivers of temper 1.
        factors: By trait, the factor of each vehicle class on what a driver would do in a car, in
            the order of `VEHICLE_CLASS_ORDER`: those of `CLASS_FACTORS`, and the comfortable
            braking of the class.
    """

    careful: Mapping[str, Distribution]
    reckless: Mapping[str, Distribution]
    factors: Mapping[str, tuple[float, ...]]

    def __post_init__(self) -> None:
        """Refuse a missing trait, and one whose two distributions are of different kinds."""
        for name in TRAITS:
            if name not in self.careful or list(self.careful) != list(self.reckless):
                raise _wrong(name, "each trait in both extremes, in one order", "another list")
            kinds = (self.careful[name].kind, self.reckless[name].kind)
            if kinds[0] != kinds[1] or kinds[0] == "choice":
                expected = "one kind of distribution from careful to reckless, not a choice"
                raise _wrong(name, expected, f"{kinds[0]} and {kinds[1]}")


def population_names() -> tuple[str, ...]:
    """The populations that the package knows."""
    return tuple(load(_FILE))


@cache
def population(name: str) -> Population:
    """One of `population_names()`; KnowledgeError for any other name."""
    if name not in population_names():
        raise _wrong(f"population {name}", f"one of {', '.join(population_names())}", name)
    found = {key: one for key, one in quantities(_FILE).items() if key.startswith(f"{name}.")}
    factors = {
        trait: tuple(
            _factor(found.pop(f"{name}.classes.{kind}.{key}", None), key)
            for kind in VEHICLE_CLASS_ORDER
        )
        for key, trait in CLASS_FACTORS.items()
    }
    comfort = [one.comfort_decel.number for one in vehicle_classes().values()]
    car = vehicle_classes()["M"].comfort_decel.number
    factors["decel"] = tuple(one / car for one in comfort)
    ends: dict[str, dict[str, Distribution]] = {"careful": {}, "reckless": {}}
    for key, entry in found.items():
        _, end, trait = key.split(".", 2)
        if end not in ends or trait not in TRAITS:
            raise _wrong(
                f"unknown key {key}", "a trait of an extreme or a factor of a class", entry
            )
        ends[end][trait] = _distribution(entry, trait)
    return Population(**ends, factors=factors)


def drawn_range(name: str, trait: str) -> tuple[float, float]:
    """Least and largest number that a population has for a trait, in any vehicle."""
    who = population(name)
    ends = (who.careful[trait], who.reckless[trait])
    factors = as_f32(who.factors.get(trait, (1.0,)))
    low, high = min(end.low for end in ends), max(end.high for end in ends)
    return low * float(factors.min()), high * float(factors.max())


def _distribution(entry: Distribution | Quantity, trait: str) -> Distribution:
    """The distribution of a trait, which must have its unit."""
    unit = TRAITS[trait].unit
    if isinstance(entry, Distribution) and entry.unit == unit:
        return entry
    raise _wrong(trait, f"a distribution in {unit}", entry)


def _factor(entry: Distribution | Quantity | None, key: str) -> float:
    """A factor of a vehicle class; 1 where the file names no difference to a car."""
    if isinstance(entry, Distribution):
        raise _wrong(key, "a quantity", entry)
    return 1.0 if entry is None else entry.number


def _wrong(what: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError.of(
        what=what, where=_FILE, expected=expected, got=got, next_step="correct the entry"
    )
