"""The vocabulary of the logic: every predicate with types, units and ranges of its arguments.

The predicates are declared in `vocabulary.toml`. Facts, theory, law and questions are checked
against it, and the headers of exported files are written from it. `recorded._Recorded` has a method
with the name of each fact, which measures it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.knowledge.toml_reader import load_toml
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

INT_BITS = 32
"""Width of clingo's integers; sums and products beyond it wrap silently."""

LARGEST = 2 ** (INT_BITS - 1) - 1


@dataclass(frozen=True, slots=True)
class Type:
    """The type of an argument.

    Attributes:
        name: Its name in declarations.
        about: A few words, with the unit.
        low: Smallest integer; meaningless for constants.
        high: Largest integer.
        names: The constants in the order of their codes; empty for integers.
    """

    name: str
    about: str
    low: int = 0
    high: int = 0
    names: tuple[str, ...] = ()


def _constants(name: str, about: str, *words: str) -> Type:
    """Words as constants of both languages, which begin with a small letter."""
    return Type(name, about, names=tuple(word.lower() for word in words))


EVENTS = (
    *(
        "first",
        "last",
        "following_begin",
        "attempt",
        "line_crossed",
        "overlap_begin",
        "overlap_end",
    ),
    *("return_begin", "return_end", "abort", "abort_end"),
    *("collision", "road_departure", "spin", "drift"),
)
"""Attributes of `OvertakeEvents` that become facts; `first` and `last` always happen."""

SIDES = ("right", "left")
CODES = (
    *("L1", "L2", "L3", "L5", "L8", "L9", "L12", "L13", "L16", "L17", "L18", "L20", "L21"),
    *("L24", "L25", "L26", "L28", "L29"),
)
"""The Portuguese rules that are written as a logic program too."""

MAX_FRAME = 1_000_000
MAX_MM = 500_000_000
MAX_SPEED = 200_000

SIMULATION = Type("simulation", "number of a simulation in its data set", 0, 10**9)
VEHICLE = Type("vehicle", "slot of a vehicle, the ego being 0", 0, MAX_VEHICLES - 1)
LANE = Type("lane", "lane index, 0 the slowest, -1 beyond the slow edge", -1, 16)
FRAME = Type("frame", "number of a frame", 0, MAX_FRAME)
COUNT = Type("count", "number of things", 0, MAX_FRAME)
PERCENT = Type("percent", "hundredths", 0, 100)
INTERVAL = Type("ms", "duration of a frame in milliseconds", 1, 1000)
MM = Type("mm", "length in millimetres", -MAX_MM, MAX_MM)
SIZE = Type("size", "length or width of a vehicle in millimetres", 0, 100_000)
SPEED = Type("mm_per_s", "speed in millimetres per second", -MAX_SPEED, MAX_SPEED)
BRAKING = Type("mm_per_s2", "deceleration in millimetres per second squared", 0, 1_000_000)
KIND = _constants("kind", "class of vehicle", *(kind.code for kind in VehicleKind))
EVENT = _constants("event", "what happened, see the page on events", *EVENTS)
PLACE = _constants("place", "place around the ego", *(one.name for one in NeighbourRole), "target")
SIDE = _constants("side", "left is where one overtakes", *SIDES)
MARK = _constants("mark", "line as seen from one side", *(one.name for one in RoadMark))
PLACE_KIND = _constants("place_kind", "what a stretch of road is", *(one.name for one in ZoneKind))
ROAD = _constants("road", "kind of road", "motorway", "other", "town")
POLICY = _constants("policy", "which rules count", *(one.name for one in STORED_POLICIES))
CLASS = _constants("class", "class of a simulation", *(one.title for one in OvertakeClass))
OUTCOME = _constants("outcome", "how it ended, legality aside", *(one.name for one in Outcome))
UNKNOWN = _constants("unknown", "what a recording does not tell", *UNKNOWNS)
RULE = _constants("rule", "rule of law", *CODES)
VERDICT = _constants("verdict", "what a rule says", *(one.name for one in Verdict))

Signature = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Predicate:
    """One predicate.

    Attributes:
        name: Its name.
        about: What it says of its arguments.
        arguments: Name and type of each argument.
        never: Constants of an argument's type that the argument never has, by its name.
    """

    name: str
    about: str
    arguments: tuple[tuple[str, Type], ...]
    never: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def signature(self) -> Signature:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    def constants(self, label: str) -> frozenset[str]:
        """The constants that an argument can have in facts; empty for numbers."""
        return frozenset(dict(self.arguments)[label].names) - {*self.never.get(label, ())}

    @property
    def head(self) -> str:
        """The atom with the names of its arguments."""
        return f"{self.name}({', '.join(name for name, _ in self.arguments)})"


TYPES = {
    of.name: of
    for of in (
        *(SIMULATION, VEHICLE, LANE, FRAME, COUNT, PERCENT, INTERVAL, MM, SIZE, SPEED, BRAKING),
        *(KIND, EVENT, PLACE, SIDE, MARK, ROAD, POLICY, CLASS, OUTCOME, UNKNOWN, RULE, VERDICT),
        PLACE_KIND,
        Type("km_per_h", "speed in kilometres per hour", 0, 1000),
        Type("duration", "time in milliseconds", 0, 3_600_000),
        Type("hundredths", "time in hundredths of a second", 0, 10_000),
        _constants("limits", "class of vehicle by its speed limits", "light", "van", "heavy"),
    )
}
"""Every type by its name; the last four occur in the programs only."""


def _declared(group: str) -> tuple[Predicate, ...]:
    """The predicates of a section of `vocabulary.toml`."""
    return tuple(
        Predicate(
            name,
            one["about"],
            tuple((label, TYPES[of]) for label, of in one["arguments"].items()),
            {label: tuple(names) for label, names in one.get("never", {}).items()},
        )
        for name, one in load_toml(Path(__file__).with_suffix(".toml"))[group].items()
    )


ROAD_FACTS, RECORDED, MEASURED = (_declared(group) for group in ("road", "recorded", "measured"))
FACTS = (*ROAD_FACTS, *RECORDED, *MEASURED)
BY_NAME = {one.name: one for one in FACTS}
THEORY, LAW = _declared("theory"), _declared("law")
PREDICATES = {one.signature: one for one in (*FACTS, *THEORY, *LAW)}
"""Every predicate that a question may name."""
