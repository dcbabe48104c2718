"""Driver populations, as read from the knowledge base."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache

from overtaking.core.errors import KnowledgeError
from overtaking.knowledge import Distribution, Quantity, read_section
from overtaking.knowledge.reader import load

_FILE = "drivers.toml"

_CAR = Quantity(
    value=1.0,
    sigma=None,
    low=1.0,
    high=1.0,
    unit="1",
    quoted_unit="1",
    source="choice",
    rationale="As in a car, where the file names no difference",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Temper:
    """How every parameter spreads among drivers of one temper.

    The fields are those of `model.drivers.Drivers` that are not made from the three last ones.

    Attributes:
        time_gap: See `Drivers`, as all up to `limit_respect` [s].
        min_gap: [m].
        accel: [m/s^2].
        decel: [m/s^2].
        reaction_time: [s].
        caution: [1].
        politeness: [1].
        lane_change_threshold: [m/s^2].
        right_bias: [m/s^2].
        safe_decel: [m/s^2].
        lane_change_duration: [s].
        passing_gain: [m/s].
        patience: [s].
        pull_out_time: [s].
        gap_acceptance: [1].
        return_time_gap: [s].
        signal_time: [s].
        uses_indicator: [1].
        checks_blind_spot: [1].
        limit_respect: [1].
        cruise_factor: Desired speed of the traffic over the speed drawn for it [1].
        speed_over_leader: How much faster than its leader an ego wants to drive [m/s].
        wants_to_overtake: Whether an ego wants to drive faster than its leader at all.
    """

    time_gap: Distribution
    min_gap: Distribution
    accel: Distribution
    decel: Distribution
    reaction_time: Distribution
    caution: Distribution
    politeness: Distribution
    lane_change_threshold: Distribution
    right_bias: Distribution
    safe_decel: Distribution
    lane_change_duration: Distribution
    passing_gain: Distribution
    patience: Distribution
    pull_out_time: Distribution
    gap_acceptance: Distribution
    return_time_gap: Distribution
    signal_time: Distribution
    uses_indicator: Distribution
    checks_blind_spot: Distribution
    limit_respect: Distribution
    cruise_factor: Distribution
    speed_over_leader: Distribution
    wants_to_overtake: Distribution


TRAITS = tuple(field.name for field in fields(Temper))
"""The parameters in the order in which they are drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassFactors:
    """What a vehicle class changes in its drivers, as factors on what they would do in a car.

    Attributes:
        time_gap_factor: On `time_gap`.
        accel_factor: On `accel`.
        lane_change_factor: On `lane_change_duration`.
    """

    time_gap_factor: Quantity = _CAR
    accel_factor: Quantity = _CAR
    lane_change_factor: Quantity = _CAR


_AS_CARS = ClassFactors()


@dataclass(frozen=True, slots=True, kw_only=True)
class Classes:
    """`ClassFactors` of every vehicle class."""

    S: ClassFactors = _AS_CARS
    M: ClassFactors = _AS_CARS
    L: ClassFactors = _AS_CARS
    V: ClassFactors = _AS_CARS
    T: ClassFactors = _AS_CARS
    MC: ClassFactors = _AS_CARS
    B: ClassFactors = _AS_CARS


@dataclass(frozen=True, slots=True, kw_only=True)
class Population:
    """Drivers between two extremes.

    Attributes:
        careful: Drivers of temper 0.
        reckless: Drivers of temper 1.
        classes: What the vehicle changes.
    """

    careful: Temper
    reckless: Temper
    classes: Classes

    def __post_init__(self) -> None:
        """Refuse a parameter whose two distributions are of different kinds."""
        for name in TRAITS:
            ends = (getattr(self.careful, name), getattr(self.reckless, name))
            if ends[0].kind != ends[1].kind or ends[0].kind == "choice":
                raise KnowledgeError.of(
                    what=name,
                    where=_FILE,
                    expected="one kind of distribution from careful to reckless, not a choice",
                    got=f"{ends[0].kind} and {ends[1].kind}",
                    next_step="correct the entry",
                )


def population_names() -> tuple[str, ...]:
    """The populations that the package knows."""
    return tuple(load(_FILE))


@cache
def population(name: str) -> Population:
    """One of `population_names()`; KnowledgeError for any other name."""
    return read_section(Population, _FILE, name)
