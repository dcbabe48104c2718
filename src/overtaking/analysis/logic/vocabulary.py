"""The words of the logic: every predicate with the types, units and ranges of its arguments.

Facts, theory, law and questions are checked against this one list, and the headers of exported
files are written from it.
"""

from __future__ import annotations

from dataclasses import dataclass

from overtaking.labels.law import POLICIES, PORTUGAL
from overtaking.model.events import Outcome
from overtaking.model.labels import OvertakeClass, Verdict
from overtaking.model.road import RoadMark
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.model.signals import Around
from overtaking.model.trajectory import UNKNOWNS
from overtaking.model.vehicles import VehicleKind

INT_BITS = 32
"""Width of clingo's integers; sums and products beyond it wrap without a word."""

LARGEST = 2 ** (INT_BITS - 1) - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Type:
    """What an argument may be.

    Attributes:
        name: Its name in declarations.
        about: A few words, with the unit.
        low: Least integer; means nothing where there are names.
        high: Largest integer.
        names: The constants that it may be, in the order of their codes; empty for integers.
    """

    name: str
    about: str
    low: int = 0
    high: int = 0
    names: tuple[str, ...] = ()


def _number(name: str, about: str, low: int, high: int) -> Type:
    return Type(name=name, about=about, low=low, high=high)


def _names(name: str, about: str, names: tuple[str, ...]) -> Type:
    return Type(name=name, about=about, names=names)


def _atoms(words: tuple[str, ...]) -> tuple[str, ...]:
    """Words as constants of both languages, which begin with a small letter."""
    return tuple(word.lower() for word in words)


EVENTS = (
    "first",
    "last",
    "follow",
    "attempt",
    "line_crossed",
    "overlap_begin",
    "overlap_end",
    "return_begin",
    "return_end",
    "abort",
    "back",
    "collision",
    "road_departure",
    "drift",
)
"""The attributes of `model.events.Events` that become facts; `first` and `last` always happen."""

PLACES = (*_atoms(tuple(place.name for place in Around)), "target")
"""The places around the ego, and the vehicle that it overtakes, wherever that is."""

SIDES = ("right", "left")
MAX_FRAME = 1_000_000
MAX_MM = 500_000_000
MAX_SPEED = 200_000

SIMULATION = _number("simulation", "number of a simulation in its data set", 0, 10**9)
VEHICLE = _number("vehicle", "slot of a vehicle, the ego being 0", 0, MAX_VEHICLES - 1)
LANE = _number("lane", "lane index, 0 the slowest, -1 beyond the slow edge", -1, 16)
FRAME = _number("frame", "number of a frame", 0, MAX_FRAME)
COUNT = _number("count", "number of things", 0, MAX_FRAME)
PERCENT = _number("percent", "hundredths", 0, 100)
INTERVAL = _number("ms", "duration of a frame in milliseconds", 1, 1000)
MM = _number("mm", "length in millimetres", -MAX_MM, MAX_MM)
SIZE = _number("size", "length or width of a vehicle in millimetres", 0, 100_000)
SPEED = _number("mm_per_s", "speed in millimetres per second", -MAX_SPEED, MAX_SPEED)
BRAKING = _number("mm_per_s2", "deceleration in millimetres per second squared", 0, 1_000_000)
KMH = _number("km_per_h", "speed in kilometres per hour", 0, 1000)
DURATION = _number("duration", "time in milliseconds", 0, 3_600_000)
KIND = _names("kind", "class of vehicle", _atoms(tuple(one.name for one in VehicleKind)))
EVENT = _names("event", "what happened, see the page on events", EVENTS)
PLACE = _names("place", "place around the ego", PLACES)
SIDE = _names("side", "left is where one overtakes", SIDES)
MARK = _names("mark", "line as seen from one side", tuple(one.name.lower() for one in RoadMark))
ROAD = _names("road", "kind of road", ("motorway", "other", "town"))
POLICY = _names("policy", "which rules count", tuple(one.name for one in POLICIES))
CLASS = _names("class", "class of a simulation", _atoms(tuple(one.title for one in OvertakeClass)))
OUTCOME = _names("outcome", "how it ended, legality aside", _atoms(tuple(o.name for o in Outcome)))
UNKNOWN = _names("unknown", "what a recording does not tell", UNKNOWNS)
RULE = _names("rule", "rule of law", _atoms(PORTUGAL.codes))
VERDICT = _names("verdict", "what a rule says", _atoms(tuple(one.name for one in Verdict)))

LIMITS = _names("limits", "class of vehicle by its speed limits", ("light", "van", "heavy"))

TYPES = {
    one.name: one
    for one in (
        *(SIMULATION, VEHICLE, LANE, FRAME, COUNT, PERCENT, INTERVAL, DURATION, MM, SIZE, SPEED),
        *(
            BRAKING,
            KMH,
            KIND,
            EVENT,
            PLACE,
            SIDE,
            MARK,
            ROAD,
            POLICY,
            CLASS,
            OUTCOME,
            UNKNOWN,
            RULE,
            VERDICT,
        ),
        LIMITS,
    )
}
"""Every type by its name."""

Arguments = tuple[tuple[str, Type], ...]
Signature = tuple[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicate:
    """One predicate.

    Attributes:
        name: Its name.
        arguments: Name and type of each argument.
        about: What it says of them.
        is_of_law: Whether it is one of the measurements of the ego in every frame, which only the
            law reads.
    """

    name: str
    arguments: Arguments
    about: str
    is_of_law: bool = False

    @property
    def signature(self) -> Signature:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    @property
    def head(self) -> str:
        """How it is written, with the names of its arguments."""
        return f"{self.name}({', '.join(name for name, _ in self.arguments)})"


def _fact(name: str, about: str, *arguments: tuple[str, Type], law: bool = False) -> Predicate:
    return Predicate(name=name, arguments=arguments, about=about, is_of_law=law)


_S, _V, _F = ("S", SIMULATION), ("V", VEHICLE), ("F", FRAME)
_SPAN = (("First", FRAME), ("Last", FRAME))
_PLACE = ("Place", PLACE)

FACTS: tuple[Predicate, ...] = (
    _fact("interval", "Time between two frames.", ("Ms", INTERVAL)),
    _fact("road", "Kind of the road.", ("Kind", ROAD)),
    _fact("lanes", "Number of driving lanes in the direction of travel.", ("N", LANE)),
    _fact("oncoming", "The lane beyond the fastest one is for oncoming traffic.", ("Lane", LANE)),
    _fact("posted_limit", "Posted speed limit, rounded.", ("Limit", SPEED)),
    _fact("border", "Where the border on the slow side of a lane is.", ("Lane", LANE), ("D", MM)),
    _fact(
        "lane_width",
        "Width of a driving lane, rounded down; of the one beyond the fast edge too, if there is.",
        ("Lane", LANE),
        ("Width", MM),
    ),
    _fact(
        "mark",
        "The line on the slow side of a lane, as seen from the right or from the left.",
        ("Lane", LANE),
        ("From", SIDE),
        ("Mark", MARK),
    ),
    _fact("unknown", "What the recordings do not tell.", ("What", UNKNOWN)),
    _fact("simulation", "There is such a simulation.", _S),
    _fact("rain", "Intensity of rain.", _S, ("Percent", PERCENT)),
    _fact("fog", "Density of fog.", _S, ("Percent", PERCENT)),
    _fact("wind", "Intensity of wind.", _S, ("Percent", PERCENT)),
    _fact("night", "It is night.", _S),
    _fact(
        "class",
        "Class of the simulation under a policy, as the Python rules have it.",
        _S,
        ("Policy", POLICY),
        ("Class", CLASS),
    ),
    _fact(
        "outcome",
        "How the ego's overtake ended, legality aside.",
        _S,
        ("Outcome", OUTCOME),
    ),
    _fact("ego", "The vehicle that is studied.", _S, _V),
    _fact(
        "vehicle",
        "A vehicle: its class, its length and its width, rounded up.",
        _S,
        _V,
        ("Kind", KIND),
        ("Length", SIZE),
        ("Width", SIZE),
    ),
    _fact("present", "The vehicle was recorded from frame to frame.", _S, _V, *_SPAN),
    _fact("lane", "The vehicle's centre is in a lane.", _S, _V, ("Lane", LANE), *_SPAN),
    _fact("indicator", "The vehicle indicates.", _S, _V, ("Side", SIDE), *_SPAN),
    _fact("neighbour", "The nearest vehicle in a place around the ego.", _S, _PLACE, _V, *_SPAN),
    _fact("contact", "First frame after A has touched B.", _S, ("A", VEHICLE), ("B", VEHICLE), _F),
    _fact("event", "An event of the ego's overtake.", _S, ("Event", EVENT), _F),
    _fact("target", "The vehicle that the ego overtakes, or would.", _S, _V),
    _fact("original_lane", "Lane in which the overtake began.", _S, ("Lane", LANE)),
    _fact("frame", "A frame in which positions and speeds are written.", _S, _F),
    _fact("next", "G is the next such frame after F.", _S, _F, ("G", FRAME)),
    _fact("position", "Position of the vehicle's centre along the road.", _S, _V, _F, ("X", MM)),
    _fact("speed", "Speed of the vehicle.", _S, _V, _F, ("Speed", SPEED)),
    _fact("ego_speed", "Speed of the ego.", _S, _F, ("Speed", SPEED), law=True),
    _fact(
        "reach",
        "How far the ego's body reaches to the right and to the left, rounded outwards.",
        _S,
        _F,
        ("Right", MM),
        ("Left", MM),
        law=True,
    ),
    _fact(
        "spacing",
        "Gap between the bumpers of ego and neighbour, rounded down; speed at which it closes; gap "
        "that Article 18(1) asks of the one behind, rounded so that it compares as it was.",
        _S,
        _PLACE,
        _F,
        ("Gap", MM),
        ("Closing", SPEED),
        ("Lawful", MM),
        law=True,
    ),
    _fact(
        "forced_braking",
        "Braking that a gap that closes asks of the neighbour behind, rounded up; at most 1 km/s2.",
        _S,
        _PLACE,
        _F,
        ("Braking", BRAKING),
        law=True,
    ),
    _fact("target_lead", "How far the ego is ahead of its target.", _S, _F, ("X", MM), law=True),
    _fact("target_speed", "Speed of the target.", _S, _F, ("Speed", SPEED), law=True),
    _fact(
        "slow_vehicle",
        "Another vehicle slower than 10 m/s, its speed, and how far it is from the ego.",
        _S,
        _F,
        _V,
        ("Speed", SPEED),
        ("Away", MM),
        law=True,
    ),
)
"""What is written down of a recording: measurements, and never what a rule makes of them."""

_A, _B, _K, _H = ("A", VEHICLE), ("B", VEHICLE), ("K", LANE), ("H", FRAME)

THEORY: tuple[Predicate, ...] = (
    _fact("in_lane", "V is in a lane in frame F.", _S, _V, _F, ("Lane", LANE)),
    _fact("beside", "A and B overlap along the road.", _S, _A, _B, _F),
    _fact("clear_ahead", "The whole of A is ahead of the whole of B, in any lane.", _S, _A, _B, _F),
    _fact("ahead", "A is ahead of B in the same lane.", _S, _A, _B, _F),
    _fact("behind", "A is behind B in the same lane.", _S, _A, _B, _F),
    _fact("between", "Somebody is between A and B ahead of it.", _S, _A, _B, _F),
    _fact("left_of", "A is in a lane to the left of B's.", _S, _A, _B, _F),
    _fact("closing", "A is behind B in the same lane, and faster.", _S, _A, _B, _F),
    _fact("follows", "B is next ahead of A and less than 3 s away.", _S, _A, _B, _F),
    _fact("changes_lane", "V changes from lane K to lane L.", _S, _V, ("K", LANE), ("L", LANE), _F),
    _fact("leaves_behind", "A leaves lane K to the left, B ahead in it.", _S, _A, _B, _K, _F),
    _fact("hidden", "Another one ahead is nearer to A, which pulls out.", _S, _A, _B, _F),
    _fact("came_back", "A was back in the lane that it left in F before H.", _S, _A, _F, _H),
    _fact("pulls_out", "A changes to the left behind B, next ahead of it.", _S, _A, _B, _F),
    _fact("passes", "The whole of A is ahead of B, and was not before.", _S, _A, _B, _F),
    _fact("returns", "A changes to the right into the lane of B, ahead of it.", _S, _A, _B, _F),
    _fact(
        "overtakes",
        "A is back in its lane, having left it behind B and passed B on the left.",
        _S,
        _A,
        _B,
        _F,
    ),
    _fact("collides", "A and B have touched.", _S, _A, _B, _F),
)
"""What follows from the facts, in both languages."""

_R = ("Rule", RULE)

LAW: tuple[Predicate, ...] = (
    _fact("verdict", "What a rule says of a simulation.", _S, _R, ("Verdict", VERDICT)),
    _fact("legal", "A rule is kept.", _S, _R),
    _fact("illegal", "A rule is broken.", _S, _R),
    _fact("not_applicable", "A rule says nothing.", _S, _R),
    _fact("undecidable", "What is not known decides.", _S, _R),
    _fact("applies", "A rule is about a simulation.", _S, _R),
    _fact("breach", "A rule is broken in a frame.", _S, _R, _F),
    _fact("doubt", "A rule would be broken if what is unknown were so.", _S, _R),
)
"""What the law says, in ASP; its other predicates are its own."""
