"""Facts about a simulation as a whole: weather, class, outcome, events and target.

A fact is a predicate with values, such as `event(7,attempt,120)`. The keywords of the decorator
`fact` are the arguments of the predicate with their types. The function below it returns one column
of integers for each argument, with a row for each fact. The source has the recordings and labels of
a group of simulations; arrays named `simulation` are rows of the group.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic.fact_declaration import Fact, fact, no_facts
from overtaking.analysis.logic.vocabulary import (
    CLASS,
    EVENT,
    EVENT_NAMES,
    FRAME,
    LANE,
    OUTCOME,
    PERCENT,
    POLICY,
    SIMULATION,
    VEHICLE,
)
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE

if TYPE_CHECKING:
    from overtaking.analysis.logic.fact_declaration import FactColumns
    from overtaking.analysis.logic.fact_source import FactSource
    from overtaking.core.arrays import F32

SIMULATION_FACTS: dict[str, Fact] = {}
"""Facts about the conditions and the labels of a simulation, by name."""

EVENT_FACTS: dict[str, Fact] = {}
"""Facts about the events of the ego's overtake and its target, by name."""


@fact(SIMULATION_FACTS, "simulation", "S is the number of a simulation.", S=SIMULATION)
def _simulations(source: FactSource) -> FactColumns:
    return (source.simulation_ids,)


@fact(
    SIMULATION_FACTS,
    "rain",
    "Intensity of rain.",
    required_input="weather",
    S=SIMULATION,
    Percent=PERCENT,
)
def _rain(source: FactSource) -> FactColumns:
    return _percentages(source, source.trajectories.scenario.weather.rain)


@fact(
    SIMULATION_FACTS,
    "fog",
    "Density of fog.",
    required_input="weather",
    S=SIMULATION,
    Percent=PERCENT,
)
def _fog(source: FactSource) -> FactColumns:
    return _percentages(source, source.trajectories.scenario.weather.fog)


@fact(
    SIMULATION_FACTS,
    "wind",
    "Intensity of wind.",
    required_input="weather",
    S=SIMULATION,
    Percent=PERCENT,
)
def _wind(source: FactSource) -> FactColumns:
    return _percentages(source, source.trajectories.scenario.weather.wind)


def _percentages(source: FactSource, values: F32) -> FactColumns:
    """Number of each simulation, and its value of 0 to 100 rounded to whole per cent."""
    return source.simulation_ids, np.rint(values).astype(np.int64)


@fact(SIMULATION_FACTS, "night", "It is night.", required_input="weather", S=SIMULATION)
def _nights(source: FactSource) -> FactColumns:
    return (source.simulation_ids[source.trajectories.scenario.weather.night],)


# The criteria in Python have given the classes; the program of the law, `law.lp`, draws conclusions
# of its own, with which they can be compared.
@fact(
    SIMULATION_FACTS,
    "class",
    "Class of the simulation under a policy, by the Python rules.",
    S=SIMULATION,
    Policy=POLICY,
    Class=CLASS,
)
def _classes(source: FactSource) -> FactColumns:
    # Codes of shape (simulation, policy), with columns in the order of `POLICY`: a column's number
    # is the code of its policy.
    classes = source.group.classes
    if classes is None:  # The recordings are not labelled.
        return no_facts(3)
    num_simulations, num_policies = classes.shape
    policy = np.tile(np.arange(num_policies), num_simulations)
    return np.repeat(source.simulation_ids, num_policies), policy, classes.reshape(-1)


@fact(
    SIMULATION_FACTS,
    "outcome",
    "Outcome of the ego's overtake, without regard to the law.",
    S=SIMULATION,
    Outcome=OUTCOME,
)
def _outcomes(source: FactSource) -> FactColumns:
    outcome = source.group.outcome
    return no_facts(2) if outcome is None else (source.simulation_ids, outcome)


@fact(EVENT_FACTS, "event", "An event of the ego's overtake.", S=SIMULATION, Event=EVENT, F=FRAME)
def _events(source: FactSource) -> FactColumns:
    frames = np.stack([getattr(source.case.events, name) for name in EVENT_NAMES], axis=1)
    # `EVENT_NAMES` is in the order of the codes of `EVENT`.
    simulation, event = np.nonzero(frames != NEVER)
    return source.simulation_ids[simulation], event, frames[simulation, event]


@fact(
    EVENT_FACTS,
    "target",
    "The vehicle that the ego overtakes, or would overtake.",
    S=SIMULATION,
    V=VEHICLE,
)
def _targets(source: FactSource) -> FactColumns:
    slot = source.case.events.target_slot
    return source.simulation_ids[slot != NO_VEHICLE], slot[slot != NO_VEHICLE]


@fact(
    EVENT_FACTS,
    "original_lane",
    "Lane in which the overtake began.",
    S=SIMULATION,
    Lane=LANE,
)
def _original_lanes(source: FactSource) -> FactColumns:
    # Without an overtake it is the lane of the first frame. As a signed integer, code 255, beyond
    # the slow edge, is lane -1.
    return source.simulation_ids, source.case.events.original_lane.astype(np.uint8).view(np.int8)
