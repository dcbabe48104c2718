"""Types, predicates, and the rounding of measurements to integers.

A fact is a predicate with values, such as `event(7,attempt,120)`. Facts, programs and queries use
predicates whose arguments have declared types. A type is a range of integers or a set of constants,
which columns of facts hold as codes, their positions in the set. The ranges of the types bound
every term of a program, so that clingo computes within 32 bits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from overtaking.labels.law.judging import STORED_POLICIES
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import Outcome
from overtaking.model.road import RoadMark
from overtaking.model.road_course import ZoneKind
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.model.trajectories import UNKNOWNS
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import OvertakeClass, Verdict

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from overtaking.core.arrays import F32, I64

INT_BITS = 32
"""Width of clingo's integers; sums and products beyond it wrap silently."""

MAX_INT = 2 ** (INT_BITS - 1) - 1
"""Largest integer of clingo."""


@dataclass(frozen=True, slots=True)
class ArgumentType:
    """The type of an argument: a range of integers, or a set of constants.

    Attributes:
        name: Its name in declarations.
        meaning: A few words, with the unit.
        low: Smallest integer; unused for constants.
        high: Largest integer; unused for constants.
        constants: The constants in the order of their codes; empty for integers.
    """

    name: str
    meaning: str
    low: int = 0
    high: int = 0
    constants: tuple[str, ...] = ()


def _enumeration(name: str, meaning: str, *constants: str) -> ArgumentType:
    """A type of constants, in lower case: in ASP and Prolog a capital letter begins a variable."""
    return ArgumentType(name, meaning, constants=tuple(constant.lower() for constant in constants))


EVENT_NAMES = (
    *("first", "last"),
    *("following_begin", "attempt", "line_crossed", "overlap_begin", "overlap_end"),
    *("return_begin", "return_end", "abort", "abort_end"),
    *("collision", "road_departure", "spin", "drift"),
)
"""Fields of `OvertakeEvents` that become facts; `first` and `last` happen in every simulation."""

SIDES = ("right", "left")
"""Sides in the order of their codes; left is the overtaking side."""

RULE_CODES = (
    *("L1", "L2", "L3", "L5", "L8", "L9", "L12", "L13", "L16", "L17", "L18", "L20", "L21"),
    *("L24", "L25", "L26", "L28", "L29"),
)
"""The Portuguese rules in `law.lp`."""

MAX_FRAME = 1_000_000
"""Largest frame: 10,000 s in steps of the simulator, 10 ms."""

# Largest length, 500 km, and largest speed, 720 km/h. With them the largest terms of the programs
# stay within 32 bits: twice the difference of two positions (4 `MAX_MM`), and a speed times a time
# of at most 10,000 hundredths of a second.
# `tests/unit/analysis/logic/test_ranges.py` computes the ranges of all terms.
MAX_MM = 500_000_000
MAX_SPEED = 200_000

# Each type has a name, a meaning, and its smallest and largest value. A road has at most 8 driving
# lanes (`model.road.MAX_LANES`); other large ends are choices.

SIMULATION = ArgumentType("simulation", "number of a simulation in its data set", 0, 10**9)
VEHICLE = ArgumentType("vehicle", "slot of a vehicle, 0 for the ego", 0, MAX_VEHICLES - 1)
LANE = ArgumentType("lane", "lane index, 0 for the slowest, -1 beyond the slow edge", -1, 16)
FRAME = ArgumentType("frame", "number of a frame", 0, MAX_FRAME)
COUNT = ArgumentType("count", "number of frames or vehicles", 0, MAX_FRAME)
PERCENT = ArgumentType("percent", "hundredths of the largest value", 0, 100)
MILLISECONDS = ArgumentType("ms", "duration of a frame in milliseconds", 1, 1000)
MM = ArgumentType("mm", "length in millimetres", -MAX_MM, MAX_MM)
SIZE = ArgumentType("size", "length or width of a vehicle in millimetres", 0, 100_000)
SPEED = ArgumentType("mm_per_s", "speed in millimetres per second", -MAX_SPEED, MAX_SPEED)
BRAKING = ArgumentType("mm_per_s2", "deceleration in millimetres per second squared", 0, 1_000_000)
KIND = _enumeration("kind", "class of vehicle", *(kind.code for kind in VehicleKind))
EVENT = _enumeration("event", "event of an overtake", *EVENT_NAMES)
ROLE = _enumeration(
    "role", "role of a vehicle beside the ego", *(role.name for role in NeighbourRole), "target"
)
SIDE = _enumeration("side", "left is the overtaking side", *SIDES)
MARK = _enumeration("mark", "line as seen from one side", *(mark.name for mark in RoadMark))
ZONE_KIND = _enumeration("zone_kind", "kind of zone", *(kind.name for kind in ZoneKind))
# Roads of all further kinds are "other".
ROAD = _enumeration("road", "kind of road", "motorway", "other", "town")
POLICY = _enumeration("policy", "set of rules that count", *(p.name for p in STORED_POLICIES))
CLASS = _enumeration("class", "class of a simulation", *(c.title for c in OvertakeClass))
OUTCOME = _enumeration("outcome", "end of the overtake", *(outcome.name for outcome in Outcome))
UNKNOWN = _enumeration("unknown", "input that a recording may lack", *UNKNOWNS)
RULE = _enumeration("rule", "rule of law", *RULE_CODES)
VERDICT = _enumeration("verdict", "verdict of a rule", *(verdict.name for verdict in Verdict))

ARGUMENT_TYPES = {
    argument_type.name: argument_type
    for argument_type in (
        *(SIMULATION, VEHICLE, LANE, FRAME, COUNT, PERCENT, MILLISECONDS, MM, SIZE, SPEED),
        *(BRAKING, KIND, EVENT, ROLE, SIDE, MARK, ROAD, POLICY, CLASS, OUTCOME, UNKNOWN, RULE),
        *(VERDICT, ZONE_KIND),
        # These types occur in the programs only.
        ArgumentType("km_per_h", "speed in kilometres per hour", 0, 1000),
        ArgumentType("duration", "time in milliseconds", 0, 3_600_000),
        ArgumentType("hundredths", "time in hundredths of a second", 0, 10_000),
        _enumeration("limits", "class of vehicle by its speed limits", "light", "van", "heavy"),
    )
}
"""Every type by its name."""

Signature = tuple[str, int]
"""Name and number of arguments of a predicate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicate:
    """A predicate of facts or of a program.

    Attributes:
        name: Its name.
        meaning: Its statement about its arguments.
        arguments: Type of each argument by its label.
        unused_constants: By label, constants of the type that the argument has in no fact; a query
            with one of them is refused, because it has no answer.
    """

    name: str
    meaning: str
    arguments: Mapping[str, ArgumentType]
    unused_constants: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def signature(self) -> Signature:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    @property
    def types(self) -> tuple[ArgumentType, ...]:
        """The types of the arguments in order."""
        return tuple(self.arguments.values())

    @property
    def signature_text(self) -> str:
        """The atom with the labels of its arguments."""
        return f"{self.name}({', '.join(self.arguments)})"

    def constants(self, label: str) -> frozenset[str]:
        """The constants that an argument can have in facts; empty for integers."""
        return frozenset(self.arguments[label].constants) - {*self.unused_constants.get(label, ())}


_THOUSANDTHS_PER_UNIT = 1000.0

# The following functions turn m, m/s and m/s^2 into integers of thousandths: mm, mm/s, mm/s^2.
# Thresholds of the law are such integers. A measurement with a lower limit is rounded down, one
# with an upper limit is rounded up: the integer then lies on the same side of the limit.


def rounded_down_thousandths(values: F32) -> I64:
    """Thousandths, rounded down: `value >= limit` stays as it is for every integer limit."""
    return np.floor(values.astype(np.float64) * _THOUSANDTHS_PER_UNIT).astype(np.int64)


def rounded_up_thousandths(values: F32) -> I64:
    """Thousandths, rounded up: `value <= limit` stays as it is for every integer limit."""
    return np.ceil(values.astype(np.float64) * _THOUSANDTHS_PER_UNIT).astype(np.int64)


def nearest_thousandths(values: NDArray[np.floating]) -> I64:
    """Thousandths, rounded half up."""
    return np.floor(values.astype(np.float64) * _THOUSANDTHS_PER_UNIT + 0.5).astype(np.int64)


def round_limits_in_order(limits: F32, values: F32) -> I64:
    """Limits in thousandths that compare with the rounded values as limits compare with values.

    Where a limit is near its value, rounding both could make them equal or change their order. So
    such a limit is moved to its side of the rounded value.

    Args:
        limits: The limits, of any shape.
        values: The values, of the same shape, which `rounded_down_thousandths` rounds.

    Returns:
        The limits rounded up, or the nearest integer on their side of the rounded value.
    """
    rounded_limits = rounded_up_thousandths(limits)
    rounded_values = rounded_down_thousandths(values)
    is_above, is_below = limits > values, limits < values
    shifted = np.where(is_above, np.maximum(rounded_limits, rounded_values + 1), rounded_limits)
    shifted = np.where(is_below, np.minimum(shifted, rounded_values - 1), shifted)
    return np.where(is_above | is_below, shifted, rounded_values)
