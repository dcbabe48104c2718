"""The vocabulary of the logic: every predicate with types, units and ranges of its arguments.

Facts, theory, law and questions are checked against it, and the headers of exported files are
written from it. `recorded.Recorded` has a method with the name of each fact, which measures it.
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
    *("first", "last", "follow", "attempt", "line_crossed", "overlap_begin", "overlap_end"),
    *("return_begin", "return_end", "abort", "back", "collision", "road_departure", "drift"),
)
"""Attributes of `model.events.Events` that become facts; `first` and `last` always happen."""

SIDES = ("right", "left")
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
KIND = _constants("kind", "class of vehicle", *(one.name for one in VehicleKind))
EVENT = _constants("event", "what happened, see the page on events", *EVENTS)
PLACE = _constants("place", "place around the ego", *(one.name for one in Around), "target")
SIDE = _constants("side", "left is where one overtakes", *SIDES)
MARK = _constants("mark", "line as seen from one side", *(one.name for one in RoadMark))
ROAD = _constants("road", "kind of road", "motorway", "other", "town")
POLICY = _constants("policy", "which rules count", *(one.name for one in POLICIES))
CLASS = _constants("class", "class of a simulation", *(one.title for one in OvertakeClass))
OUTCOME = _constants("outcome", "how it ended, legality aside", *(one.name for one in Outcome))
UNKNOWN = _constants("unknown", "what a recording does not tell", *UNKNOWNS)
RULE = _constants("rule", "rule of law", *PORTUGAL.codes)
VERDICT = _constants("verdict", "what a rule says", *(one.name for one in Verdict))

_OF_PROGRAMS = (
    COUNT,
    Type("km_per_h", "speed in kilometres per hour", 0, 1000),
    Type("duration", "time in milliseconds", 0, 3_600_000),
    _constants("limits", "class of vehicle by its speed limits", "light", "van", "heavy"),
)
"""Types of predicates that only the programs have."""

Signature = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Predicate:
    """One predicate.

    Attributes:
        name: Its name.
        about: What it says of its arguments.
        arguments: Name and type of each argument.
    """

    name: str
    about: str
    arguments: tuple[tuple[str, Type], ...]

    @property
    def signature(self) -> Signature:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    @property
    def head(self) -> str:
        """The atom with the names of its arguments."""
        return f"{self.name}({', '.join(name for name, _ in self.arguments)})"


def _of(name: str, about: str, **arguments: Type) -> Predicate:
    return Predicate(name, about, tuple(arguments.items()))


_SV = {"S": SIMULATION, "V": VEHICLE}
_SAB = {"S": SIMULATION, "A": VEHICLE, "B": VEHICLE}
_SPAN = {"First": FRAME, "Last": FRAME}
_AROUND = {"S": SIMULATION, "Place": PLACE, "F": FRAME}

ROAD_FACTS = (
    _of("interval", "Time between two frames.", Ms=INTERVAL),
    _of("road", "Kind of the road.", Kind=ROAD),
    _of("lanes", "Number of driving lanes in the direction of travel.", N=LANE),
    _of("oncoming", "The lane beyond the fastest one is for oncoming traffic.", Lane=LANE),
    _of("posted_limit", "Posted speed limit, rounded.", Limit=SPEED),
    _of("border", "Where the border on the slow side of a lane is.", Lane=LANE, D=MM),
    _of(
        "lane_width",
        "Width of a driving lane, rounded down; of the one beyond the fast edge too, if there is.",
        Lane=LANE,
        Width=MM,
    ),
    _of(
        "mark",
        "The line on the slow side of a lane, as seen from the right or from the left.",
        Lane=LANE,
        From=SIDE,
        Mark=MARK,
    ),
    _of("unknown", "What the recordings do not tell.", What=UNKNOWN),
)
"""Facts that every simulation of a data set shares."""

RECORDED = (
    _of("simulation", "There is such a simulation.", S=SIMULATION),
    _of("rain", "Intensity of rain.", S=SIMULATION, Percent=PERCENT),
    _of("fog", "Density of fog.", S=SIMULATION, Percent=PERCENT),
    _of("wind", "Intensity of wind.", S=SIMULATION, Percent=PERCENT),
    _of("night", "It is night.", S=SIMULATION),
    _of(
        "class",
        "Class of the simulation under a policy, as the Python rules have it.",
        S=SIMULATION,
        Policy=POLICY,
        Class=CLASS,
    ),
    _of("outcome", "How the ego's overtake ended, legality aside.", S=SIMULATION, Outcome=OUTCOME),
    _of("ego", "The vehicle that is studied.", **_SV),
    _of(
        "vehicle",
        "A vehicle: its class, its length and its width, rounded up.",
        **_SV,
        Kind=KIND,
        Length=SIZE,
        Width=SIZE,
    ),
    _of("present", "The vehicle was recorded from frame to frame.", **_SV, **_SPAN),
    _of("lane", "The vehicle's centre is in a lane.", **_SV, Lane=LANE, **_SPAN),
    _of("indicator", "The vehicle indicates.", **_SV, Side=SIDE, **_SPAN),
    _of(
        "neighbour",
        "The nearest vehicle in a place around the ego.",
        S=SIMULATION,
        Place=PLACE,
        V=VEHICLE,
        **_SPAN,
    ),
    _of("contact", "First frame after A has touched B.", **_SAB, F=FRAME),
    _of("event", "An event of the ego's overtake.", S=SIMULATION, Event=EVENT, F=FRAME),
    _of("target", "The vehicle that the ego overtakes, or would.", **_SV),
    _of("original_lane", "Lane in which the overtake began.", S=SIMULATION, Lane=LANE),
    _of("frame", "A frame in which positions and speeds are written.", S=SIMULATION, F=FRAME),
    _of("next", "G is the next such frame after F.", S=SIMULATION, F=FRAME, G=FRAME),
    _of("position", "Position of the vehicle's centre along the road.", **_SV, F=FRAME, X=MM),
    _of("speed", "Speed of the vehicle.", **_SV, F=FRAME, Speed=SPEED),
)
"""What was recorded of a simulation, and its class."""

MEASURED = (
    _of("ego_speed", "Speed of the ego.", S=SIMULATION, F=FRAME, Speed=SPEED),
    _of(
        "reach",
        "How far the ego's body reaches to the right and to the left, rounded outwards.",
        S=SIMULATION,
        F=FRAME,
        Right=MM,
        Left=MM,
    ),
    _of(
        "spacing",
        "Gap between the bumpers of ego and neighbour, rounded down; speed at which it closes; gap "
        "that Article 18(1) asks of the one behind, rounded so that it compares as it was.",
        **_AROUND,
        Gap=MM,
        Closing=SPEED,
        Lawful=MM,
    ),
    _of(
        "forced_braking",
        "Braking that a gap that closes asks of the neighbour behind, rounded up; at most 1 km/s2.",
        **_AROUND,
        Braking=BRAKING,
    ),
    _of("target_lead", "How far the ego is ahead of its target.", S=SIMULATION, F=FRAME, X=MM),
    _of("target_speed", "Speed of the target.", S=SIMULATION, F=FRAME, Speed=SPEED),
    _of(
        "slow_vehicle",
        "Another vehicle slower than 10 m/s, its speed, and how far it is from the ego.",
        S=SIMULATION,
        F=FRAME,
        V=VEHICLE,
        Speed=SPEED,
        Away=MM,
    ),
)
"""Measurements of the ego in every frame, which only the law reads; never a verdict."""

FACTS = (*ROAD_FACTS, *RECORDED, *MEASURED)
BY_NAME = {one.name: one for one in FACTS}

THEORY = (
    _of("in_lane", "V is in a lane in frame F.", **_SV, F=FRAME, Lane=LANE),
    _of("beside", "A and B overlap along the road.", **_SAB, F=FRAME),
    _of("clear_ahead", "The whole of A is ahead of the whole of B, in any lane.", **_SAB, F=FRAME),
    _of("ahead", "A is ahead of B in the same lane.", **_SAB, F=FRAME),
    _of("behind", "A is behind B in the same lane.", **_SAB, F=FRAME),
    _of("between", "Somebody is between A and B ahead of it.", **_SAB, F=FRAME),
    _of("left_of", "A is in a lane to the left of B's.", **_SAB, F=FRAME),
    _of("closing", "A is behind B in the same lane, and faster.", **_SAB, F=FRAME),
    _of("follows", "B is next ahead of A and less than 3 s away.", **_SAB, F=FRAME),
    _of("changes_lane", "V changes from lane K to lane L.", **_SV, K=LANE, L=LANE, F=FRAME),
    _of("leaves_behind", "A leaves lane K to the left, B ahead in it.", **_SAB, K=LANE, F=FRAME),
    _of("hidden", "Another one ahead is nearer to A, which pulls out.", **_SAB, F=FRAME),
    _of(
        "came_back",
        "A was back in the lane that it left in F before H.",
        S=SIMULATION,
        A=VEHICLE,
        F=FRAME,
        H=FRAME,
    ),
    _of("pulls_out", "A changes to the left behind B, next ahead of it.", **_SAB, F=FRAME),
    _of("passes", "The whole of A is ahead of B, and was not before.", **_SAB, F=FRAME),
    _of("returns", "A changes to the right into the lane of B, ahead of it.", **_SAB, F=FRAME),
    _of(
        "overtakes",
        "A is back in its lane, having left it behind B and passed B on the left.",
        **_SAB,
        F=FRAME,
    ),
    _of("collides", "A and B have touched.", **_SAB, F=FRAME),
)
"""What follows from the facts, in both languages."""

_SR = {"S": SIMULATION, "Rule": RULE}

LAW = (
    _of("verdict", "What a rule says of a simulation.", **_SR, Verdict=VERDICT),
    _of("legal", "A rule is kept.", **_SR),
    _of("illegal", "A rule is broken.", **_SR),
    _of("not_applicable", "A rule says nothing.", **_SR),
    _of("undecidable", "What is not known decides.", **_SR),
    _of("applies", "A rule is about a simulation.", **_SR),
    _of("breach", "A rule is broken in a frame.", **_SR, F=FRAME),
    _of("doubt", "A rule would be broken if what is unknown were so.", **_SR),
)
"""What the law says, in ASP; the program of law declares its other predicates."""

PREDICATES = {one.signature: one for one in (*FACTS, *THEORY, *LAW)}
"""Every predicate that a question may name."""

TYPES = {of.name: of for one in PREDICATES.values() for _, of in one.arguments} | {
    of.name: of for of in _OF_PROGRAMS
}
"""Every type by its name."""
