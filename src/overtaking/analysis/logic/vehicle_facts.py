"""Facts about the vehicles of a simulation: sizes, lanes, lamps, neighbours, contacts, motion.

A fact is a predicate with values, such as `speed(7,0,120,27500)`. The keywords of the decorator
`fact` are the arguments of the predicate with their types. The function below it returns one column
of integers for each argument, with a row for each fact. The source has the recordings of a group of
simulations; arrays named `simulation` are rows of the group.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic.fact_declaration import Fact, concatenate_facts, fact
from overtaking.analysis.logic.vocabulary import (
    FRAME,
    KIND,
    LANE,
    MM,
    ROLE,
    SIDE,
    SIMULATION,
    SIZE,
    SPEED,
    VEHICLE,
    rounded_up_thousandths,
)
from overtaking.labels.snapshots import (
    indicator_to_kerb_side,
    indicator_to_overtaking_side,
    is_oncoming,
)
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import EGO_SLOT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.analysis.logic.fact_declaration import FactColumns
    from overtaking.analysis.logic.fact_source import FactSource
    from overtaking.core.arrays import I64, Mask

VEHICLE_FACTS: dict[str, Fact] = {}
"""Facts about vehicles, their lanes, lamps, neighbours and contacts, by name."""

MOTION_FACTS: dict[str, Fact] = {}
"""Facts about directions, positions and speeds, by name."""


@fact(VEHICLE_FACTS, "ego", "The vehicle whose overtaking is studied.", S=SIMULATION, V=VEHICLE)
def _egos(source: FactSource) -> FactColumns:
    return source.simulation_ids, np.full(len(source.simulation_ids), EGO_SLOT)


@fact(
    VEHICLE_FACTS,
    "vehicle",
    "A vehicle: its class, its length and its width, rounded up.",
    S=SIMULATION,
    V=VEHICLE,
    Kind=KIND,
    Length=SIZE,
    Width=SIZE,
)
def _vehicles(source: FactSource) -> FactColumns:
    vehicles = source.trajectories.scenario.vehicles
    index = simulation, slot = np.nonzero(vehicles.valid)
    return (
        source.simulation_ids[simulation],
        slot,
        vehicles.kind[index],
        rounded_up_thousandths(vehicles.length[index]),
        rounded_up_thousandths(vehicles.width[index]),
    )


@fact(
    VEHICLE_FACTS,
    "kind_unknown",
    "The recording lacks the class of the vehicle, or its length contradicts the class.",
    S=SIMULATION,
    V=VEHICLE,
)
def _vehicles_of_unknown_kind(source: FactSource) -> FactColumns:
    trajectories = source.trajectories
    simulation, slot = np.nonzero(trajectories.scenario.vehicles.valid & ~trajectories.known_kinds)
    return source.simulation_ids[simulation], slot


def _runs_of_frames(values: NDArray[np.integer], valid: Mask) -> tuple[I64, ...]:
    """Runs of frames in which values stay the same.

    Args:
        values: Shape (..., frame).
        valid: Whether each value counts, same shape; the other values interrupt a run.

    Returns:
        For each run: its index along every leading axis, its value, its first and its last frame.
    """
    is_continued = valid[..., 1:] & valid[..., :-1] & (values[..., 1:] == values[..., :-1])
    is_first, is_last = valid.copy(), valid.copy()
    is_first[..., 1:] &= ~is_continued
    is_last[..., :-1] &= ~is_continued
    *index, first_frame = np.nonzero(is_first)
    last_frame = np.nonzero(is_last)[-1]
    value = values[(*index, first_frame)]
    return *index, value.astype(np.int64), first_frame, last_frame


@fact(
    VEHICLE_FACTS,
    "recorded",
    "The vehicle was recorded from frame to frame.",
    S=SIMULATION,
    V=VEHICLE,
    First=FRAME,
    Last=FRAME,
)
def _recorded_spans(source: FactSource) -> FactColumns:
    # All values are 0, so a run ends only where the vehicle is not recorded.
    simulation, slot, _, first, last = _runs_of_frames(
        np.zeros_like(source.states.lane), source.trajectories.state_mask
    )
    return source.simulation_ids[simulation], slot, first, last


@fact(
    VEHICLE_FACTS,
    "lane",
    "The vehicle's centre is in a lane.",
    S=SIMULATION,
    V=VEHICLE,
    Lane=LANE,
    First=FRAME,
    Last=FRAME,
)
def _lane_spans(source: FactSource) -> FactColumns:
    # As signed integers: code 255, beyond the slow edge, is lane -1.
    lanes = source.states.lane.view(np.int8)
    simulation, slot, lane, first, last = _runs_of_frames(lanes, source.trajectories.state_mask)
    return source.simulation_ids[simulation], slot, lane, first, last


@fact(
    VEHICLE_FACTS,
    "indicator",
    "The vehicle indicates.",
    required_input="indicators",
    S=SIMULATION,
    V=VEHICLE,
    Side=SIDE,
    First=FRAME,
    Last=FRAME,
)
def _indicator_spans(source: FactSource) -> FactColumns:
    indicators = indicator_to_kerb_side(source.road), indicator_to_overtaking_side(source.road)
    parts: list[FactColumns] = []
    # In facts, right is the kerb side and left the overtaking side, also in left-hand traffic. The
    # order follows `vocabulary.SIDES`, so the index is the code of the side.
    for side_code, indicator in enumerate(indicators):
        is_lit = (source.states.lights & np.uint8(indicator)) != 0
        is_lit &= source.trajectories.state_mask
        simulation, slot, _, first, last = _runs_of_frames(np.zeros(is_lit.shape, np.uint8), is_lit)
        side_codes = np.full(len(simulation), side_code)
        parts.append((source.simulation_ids[simulation], slot, side_codes, first, last))
    return concatenate_facts(parts, num_arguments=5)


@fact(
    VEHICLE_FACTS,
    "neighbour",
    "The nearest vehicle in a role around the ego.",
    unused_constants={"Role": ("target",)},
    S=SIMULATION,
    Role=ROLE,
    V=VEHICLE,
    First=FRAME,
    Last=FRAME,
)
def _neighbour_spans(source: FactSource) -> FactColumns:
    slots = source.signals.neighbour_slot
    has_neighbour = source.signals.valid[:, None, :] & (slots != NO_VEHICLE)
    simulation, role, slot, first, last = _runs_of_frames(slots, has_neighbour)
    return source.simulation_ids[simulation], role, slot, first, last


@fact(
    VEHICLE_FACTS,
    "contact",
    "First frame at or after the first contact of A with B.",
    S=SIMULATION,
    A=VEHICLE,
    B=VEHICLE,
    F=FRAME,
)
def _contact_frames(source: FactSource) -> FactColumns:
    contacts = source.contacts
    simulation_ids = source.simulation_ids[contacts.simulation]
    return simulation_ids, contacts.slot, contacts.partner, contacts.frame


@fact(
    MOTION_FACTS,
    "drives_against",
    "The vehicle drives in the opposite direction of the road.",
    S=SIMULATION,
    V=VEHICLE,
)
def _vehicles_of_other_direction(source: FactSource) -> FactColumns:
    simulation, slot = np.nonzero(is_oncoming(source.trajectories))
    return source.simulation_ids[simulation], slot


@fact(MOTION_FACTS, "frame", "A frame with positions and speeds.", S=SIMULATION, F=FRAME)
def _written_frames(source: FactSource) -> FactColumns:
    simulation, frame = np.nonzero(source.is_written_frame)
    return source.simulation_ids[simulation], frame


@fact(
    MOTION_FACTS,
    "next",
    "G is the next frame with positions and speeds after F.",
    S=SIMULATION,
    F=FRAME,
    G=FRAME,
)
def _pairs_of_written_frames(source: FactSource) -> FactColumns:
    simulation, frame = np.nonzero(source.is_written_frame)
    is_same_simulation = simulation[1:] == simulation[:-1]
    simulation_ids = source.simulation_ids[simulation[1:][is_same_simulation]]
    return simulation_ids, frame[:-1][is_same_simulation], frame[1:][is_same_simulation]


@fact(
    MOTION_FACTS,
    "position",
    "Position of the vehicle's centre along the road.",
    S=SIMULATION,
    V=VEHICLE,
    F=FRAME,
    X=MM,
)
def _positions(source: FactSource) -> FactColumns:
    return _values_of_near_vehicles(source, source.states.s)


@fact(
    MOTION_FACTS,
    "speed",
    "Speed of the vehicle.",
    S=SIMULATION,
    V=VEHICLE,
    F=FRAME,
    Speed=SPEED,
)
def _speeds(source: FactSource) -> FactColumns:
    return _values_of_near_vehicles(source, source.states.speed)


def _values_of_near_vehicles(source: FactSource, values: NDArray[np.integer]) -> FactColumns:
    """Values of the vehicles near the ego, in the frames with positions.

    Args:
        source: The recordings. `is_near` selects the vehicles, `is_written_frame` the frames.
        values: Shape (simulation, vehicle, frame).
    """
    is_written = source.is_near & source.is_written_frame[:, None, :]
    index = simulation, slot, frame = np.nonzero(is_written)
    return source.simulation_ids[simulation], slot, frame, values[index]
