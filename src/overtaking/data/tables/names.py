"""The names that enumeration columns can hold, in the order of their codes in memory."""

from overtaking.labels.law.judging import STORED_POLICIES
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.driver_interface import Move
from overtaking.model.overtake_events import Outcome, OutcomeDetail
from overtaking.model.road import RoadMark
from overtaking.model.trajectories import (
    ManoeuvreKind,
    PerceivedVehicle,
    Stage,
)
from overtaking.model.vehicles import Colour, VehicleKind
from overtaking.model.verdicts import Belief, OvertakeClass, Severity, Verdict

ROLES = ("ego", "other")
KINDS = tuple(kind.code for kind in VehicleKind)
COLOURS = tuple(colour.name.lower() for colour in Colour)
MARKS = tuple(mark.value for mark in RoadMark)
STAGES = tuple(stage.name for stage in Stage)
MANOEUVRE_KINDS = tuple(kind.name for kind in ManoeuvreKind)
MOVES = tuple(move.name for move in Move)
INDICATORS = ("off", "left", "right", "both")
"""In the order of the two indicator bits of `Lights`."""

FLAGS = ("brake", "low_beam", "high_beam", "rear_fog")
"""The bits of the `lights` column: those of `Lights` above the two of the indicator."""

NEIGHBOURS = tuple(vehicle.name.lower() for vehicle in PerceivedVehicle)
"""Names of the vehicles of a percept, the prefixes of their columns."""

EVENTS = (
    *("following_begin", "attempt", "line_crossed", "overlap_begin", "overlap_end"),
    *("return_begin", "return_end", "abort", "abort_end"),
    *("collision", "road_departure", "spin", "drift", "began_before_recording"),
)
"""Attributes of `OvertakeEvents`, each of which has a row if it happened."""

RULES = PORTUGAL.codes
ARTICLES = tuple(dict.fromkeys(rule.article for rule in PORTUGAL.rules))
POLICY_NAMES = tuple(policy.name for policy in STORED_POLICIES)
READINGS = ("paper", "matched")
"""Ways to measure the features, see `labels.paper_features`."""

VERDICTS = tuple(one.name.lower() for one in Verdict)
BELIEFS = tuple(one.name.lower() for one in Belief)
SEVERITIES = tuple(one.name.lower() for one in Severity)
OUTCOMES = tuple(one.name.lower() for one in Outcome)
DETAILS = tuple(one.name.lower() for one in OutcomeDetail)
CLASSES = tuple(one.title for one in OvertakeClass)


def choose_reading(name: str | None, policy: str) -> str:
    """Name of the reading to use: the named one, or the default of the policy.

    Args:
        name: One of `READINGS`; None for the default.
        policy: Name of the policy that decides the classes.
    """
    return name or ("paper" if policy == "paper" else "matched")
