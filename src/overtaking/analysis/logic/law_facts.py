"""Measurements of the ego in every frame; only the logic program of the law, `law.lp`, reads them.

The program decides on breaches; no fact here is a verdict. Values are in mm, mm/s and mm/s^2, the
units of recorded states; the signals of the ego are in m, m/s and m/s^2. Approaching vehicles are
oncoming vehicles that are still ahead of the ego (`FactSource.approaching`).

A fact is a predicate with values, such as `ego_speed(7,120,27500)`. The keywords of the decorator
`fact` are the arguments of the predicate with their types. The function below it returns one column
of integers for each argument, with a row for each fact. The source has the recordings of a group of
simulations; arrays named `simulation` are rows of the group.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic.fact_declaration import Fact, concatenate_facts, fact, no_facts
from overtaking.analysis.logic.vocabulary import (
    BRAKING,
    FRAME,
    MM,
    ROLE,
    SIMULATION,
    SPEED,
    VEHICLE,
    round_limits_in_order,
    rounded_down_thousandths,
    rounded_up_thousandths,
)
from overtaking.labels.law.criteria.oncoming_traffic import distance_over_outer_edge
from overtaking.labels.law.criteria.zones import target_left_edge
from overtaking.labels.law.safe_distance import decel_for_safe_distance, lawful_gap
from overtaking.labels.snapshots import VehicleInstants
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import EGO_SLOT
from overtaking.world.surrogate_safety import drac

if TYPE_CHECKING:
    from overtaking.analysis.logic.fact_declaration import FactColumns
    from overtaking.analysis.logic.fact_source import FactSource
    from overtaking.core.arrays import IndexArray

LAW_FACTS: dict[str, Fact] = {}
"""Facts that only the program of the law reads, by name."""

SLOW_BELOW_MMPS = 10_000
"""`slow_vehicle` lists vehicles below this speed [mm/s].

It must exceed every speed with which the program compares: vehicles in a queue (rule L1) drive less
than 30 km/h, in congestion (L13) less than 10 km/h.
"""

_MAX_BRAKING = np.float32(BRAKING.high * 1e-3)
"""Cap of the forced braking, which is infinite where no gap remains to brake in [m/s^2].

The largest value of the type, 1000 m/s^2, is far above the abrupt braking of the law, 2 m/s^2.
"""

_ROLES_AHEAD = (NeighbourRole.LEADER, NeighbourRole.LEFT_LEADER, NeighbourRole.RIGHT_LEADER)

_TARGET_CODE = len(NeighbourRole)
"""Code of the constant `target` of `ROLE`, after the neighbours."""


@fact(LAW_FACTS, "ego_speed", "Speed of the ego.", S=SIMULATION, F=FRAME, Speed=SPEED)
def _ego_speed(source: FactSource) -> FactColumns:
    simulation, frame = np.nonzero(source.signals.valid)
    speed = source.states.speed[simulation, EGO_SLOT, frame]
    return source.simulation_ids[simulation], frame, speed


@fact(
    LAW_FACTS,
    "ego_edges",
    "Lateral positions of the right and the left side of the ego's body, rounded outwards.",
    S=SIMULATION,
    F=FRAME,
    Right=MM,
    Left=MM,
)
def _ego_edges(source: FactSource) -> FactColumns:
    index = simulation, frame = np.nonzero(source.signals.valid)
    right = rounded_down_thousandths(source.signals.right_edge[index])
    left = rounded_up_thousandths(source.signals.left_edge[index])
    return source.simulation_ids[simulation], frame, right, left


@fact(
    LAW_FACTS,
    "spacing",
    "Gap between the bumpers of ego and neighbour, rounded down; speed at which it closes; gap "
    "that Article 18(1) requires of the rear vehicle, rounded to keep its order with the gap.",
    S=SIMULATION,
    Role=ROLE,
    F=FRAME,
    Gap=MM,
    Closing=SPEED,
    Lawful=MM,
)
def _spacing(source: FactSource) -> FactColumns:
    # `roles` are the roles that the requested rules read; an ego may have several neighbours.
    # Sorted, because the order of a set of strings differs between processes, but the order of
    # facts must not.
    codes = sorted(ROLE.constants.index(role) for role in source.roles)
    return concatenate_facts([_spacing_to(source, code) for code in codes], num_arguments=6)


def _spacing_to(source: FactSource, role_code: int) -> FactColumns:
    """`spacing` to the vehicle in one role, a code of `ROLE`.

    Article 18(1) of the Portuguese Highway Code requires the gap of the rear vehicle: of the ego
    behind a leader, of a follower behind the ego. The target is taken as the rear vehicle in all
    frames, because the program reads its lawful gap only after the ego has passed it (rule L9), and
    its closing speed never. Its gap is the gap between the bumpers, whichever vehicle is ahead.

    Rounding keeps `gap < lawful` true or false as it is for the unrounded gaps.
    """
    signals, target = source.signals, source.case.target
    is_target, is_ahead = role_code == _TARGET_CODE, role_code in _ROLES_AHEAD
    instants = simulation, frame = _instants_with_vehicle(source, role_code)
    role_index = (simulation, role_code, frame)
    gap = target.gap[instants] if is_target else signals.gap[role_index]
    if is_target:
        rear_speed = target.speed[instants]
        closing_speed = rear_speed - signals.speed[instants]
    else:
        closing_speed = signals.closing_speed[role_index]
        ego_speed = signals.speed[instants]
        rear_speed = ego_speed if is_ahead else ego_speed + closing_speed
    required_gap = lawful_gap(
        rear_speed, closing_speed, decel_for_safe_distance(signals.friction[instants])
    )
    other_slot = target.slot[simulation] if is_target else signals.neighbour_slot[role_index]
    # The closing speed of the fact is exact, because the recorded speeds are integers. The signals
    # are rounded floats.
    speed_mmps = source.states.speed
    ego_mmps = speed_mmps[simulation, EGO_SLOT, frame]
    other_mmps = speed_mmps[simulation, other_slot.astype(np.intp), frame]
    closing_mmps = ego_mmps - other_mmps if is_ahead else other_mmps - ego_mmps
    return (
        source.simulation_ids[simulation],
        np.full(len(simulation), role_code),
        frame,
        rounded_down_thousandths(gap),
        closing_mmps,
        round_limits_in_order(required_gap, gap),
    )


def _instants_with_vehicle(source: FactSource, role_code: int) -> tuple[IndexArray, IndexArray]:
    """Rows of simulations and frames in which a vehicle has the role."""
    if role_code == _TARGET_CODE:
        simulation, frame = np.nonzero(source.case.target.valid)
    else:
        has_neighbour = source.signals.neighbour_slot[:, role_code] != NO_VEHICLE
        simulation, frame = np.nonzero(source.signals.valid & has_neighbour)
    return simulation, frame


@fact(
    LAW_FACTS,
    "forced_braking",
    "Deceleration that a closing gap forces on the neighbour behind, rounded up; at most 1 km/s2.",
    unused_constants={"Role": ("leader", "left_leader", "right_leader", "target")},
    S=SIMULATION,
    Role=ROLE,
    F=FRAME,
    Braking=BRAKING,
)
def _forced_braking(source: FactSource) -> FactColumns:
    roles_behind = [
        role
        for role in NeighbourRole
        if role not in _ROLES_AHEAD and role.name.lower() in source.roles
    ]
    return concatenate_facts(
        [_forced_braking_of(source, role) for role in roles_behind], num_arguments=4
    )


def _forced_braking_of(source: FactSource, role: NeighbourRole) -> FactColumns:
    """`forced_braking` of the neighbour in one role."""
    simulation, frame = _instants_with_vehicle(source, role)
    closing_speed = source.signals.closing_speed[simulation, role, frame]
    is_closing = closing_speed > 0
    simulation, frame = simulation[is_closing], frame[is_closing]
    decel = drac(source.signals.gap[simulation, role, frame], closing_speed[is_closing])
    decel = rounded_up_thousandths(np.minimum(decel, _MAX_BRAKING))  # [mm/s^2]
    return source.simulation_ids[simulation], np.full(len(simulation), int(role)), frame, decel


@fact(LAW_FACTS, "ego_lead", "How far the ego is ahead of its target.", S=SIMULATION, F=FRAME, X=MM)
def _ego_lead(source: FactSource) -> FactColumns:
    simulation, slot, frame = _target_instants(source)
    s = source.states.s
    ego_lead = s[simulation, EGO_SLOT, frame] - s[simulation, slot, frame]
    return source.simulation_ids[simulation], frame, ego_lead


@fact(LAW_FACTS, "target_speed", "Speed of the target.", S=SIMULATION, F=FRAME, Speed=SPEED)
def _target_speed(source: FactSource) -> FactColumns:
    simulation, slot, frame = _target_instants(source)
    speed = source.states.speed[simulation, slot, frame]
    return source.simulation_ids[simulation], frame, speed


def _target_instants(source: FactSource) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Rows of simulations, slots of the targets and frames in which the target is recorded."""
    target = source.case.target
    simulation, frame = np.nonzero(target.valid)
    return simulation, target.slot[simulation].astype(np.intp), frame


@fact(
    LAW_FACTS,
    "ego_position",
    "Position of the ego's centre along a road that changes, or has oncoming traffic.",
    S=SIMULATION,
    F=FRAME,
    X=MM,
)
def _ego_position(source: FactSource) -> FactColumns:
    # A course holds everything that changes along the road, such as speed limits and zones. On
    # other roads without oncoming traffic no rule reads the position, so these facts, one for each
    # frame, are left out.
    if not (source.road.is_two_way or source.road.course):
        return no_facts(3)
    simulation, frame = np.nonzero(source.signals.valid)
    s = source.states.s[simulation, EGO_SLOT, frame]
    return source.simulation_ids[simulation], frame, s


@fact(
    LAW_FACTS,
    "approaching",
    "A vehicle that approaches the ego: gap between the bumpers, rounded down, and its speed.",
    S=SIMULATION,
    F=FRAME,
    V=VEHICLE,
    Gap=MM,
    Speed=SPEED,
)
def _approaching_vehicles(source: FactSource) -> FactColumns:
    vehicles = source.approaching
    index = simulation, slot, frame = vehicles.simulation, vehicles.slot, vehicles.frame
    speed = source.states.speed[index]
    return (
        source.simulation_ids[simulation],
        frame,
        slot,
        rounded_down_thousandths(vehicles.gap),
        speed,
    )


@fact(
    LAW_FACTS,
    "approaching_brakes",
    "Deceleration of a vehicle that approaches the ego, if it brakes.",
    S=SIMULATION,
    F=FRAME,
    V=VEHICLE,
    Braking=BRAKING,
)
def _braking_of_approaching_vehicles(source: FactSource) -> FactColumns:
    vehicles = source.approaching
    simulation, slot, frame = vehicles.simulation, vehicles.slot, vehicles.frame
    # Recorded along the vehicle's own heading: negative is braking in either direction.
    decel = -source.states.accel_lon[simulation, slot, frame].astype(np.int64)
    brakes = decel > 0
    simulation_ids = source.simulation_ids[simulation[brakes]]
    return simulation_ids, frame[brakes], slot[brakes], decel[brakes]


@fact(
    LAW_FACTS,
    "approaching_leaves_lane",
    "How far an approaching vehicle reaches over the outer edge of its lane, rounded up.",
    S=SIMULATION,
    F=FRAME,
    V=VEHICLE,
    Over=MM,
)
def _excursions_of_approaching_vehicles(source: FactSource) -> FactColumns:
    vehicles = source.approaching
    simulation, slot, frame = vehicles.simulation, vehicles.slot, vehicles.frame
    # On one-way roads nothing approaches, and `distance_over_outer_edge` requires a two-way road.
    if not simulation.size:
        return no_facts(4)
    instants = VehicleInstants(simulation, slot, frame)
    excursion = rounded_up_thousandths(distance_over_outer_edge(source.case, instants))
    is_over = excursion > 0
    simulation_ids = source.simulation_ids[simulation[is_over]]
    return simulation_ids, frame[is_over], slot[is_over], excursion[is_over]


@fact(
    LAW_FACTS,
    "target_left_edge",
    "Lateral position of the target's left side as the attempt begins, rounded up.",
    S=SIMULATION,
    Left=MM,
)
def _target_left_edge(source: FactSource) -> FactColumns:
    has_attempt = source.case.events.attempt != NEVER
    simulation = np.flatnonzero(has_attempt & (source.case.target.slot != NO_VEHICLE))
    left_edge = rounded_up_thousandths(target_left_edge(source.case)[simulation])
    return source.simulation_ids[simulation], left_edge


@fact(
    LAW_FACTS,
    "slow_vehicle",
    "Another vehicle slower than 10 m/s, its speed, and its distance from the ego.",
    S=SIMULATION,
    F=FRAME,
    V=VEHICLE,
    Speed=SPEED,
    Away=MM,
)
def _slow_vehicles(source: FactSource) -> FactColumns:
    s, speed = source.states.s, source.states.speed
    is_slow = source.trajectories.state_mask & (speed < SLOW_BELOW_MMPS)
    is_slow[:, EGO_SLOT] = False
    index = simulation, slot, frame = np.nonzero(is_slow)
    distance = np.abs(s[index] - s[simulation, EGO_SLOT, frame])
    return source.simulation_ids[simulation], frame, slot, speed[index], distance
