"""Facts about the ego in every frame: the measurements that the law is applied to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.logic.rounding import beside, down, up
from overtaking.analysis.logic.scene import PLACES_AHEAD, Columns
from overtaking.analysis.logic.vocabulary import BRAKING, PLACE
from overtaking.labels.law.distances import lawful_gap, sure_decel
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role
from overtaking.world.measures import drac

if TYPE_CHECKING:
    from collections.abc import Collection

    from overtaking.model.labels import Case

I64 = NDArray[np.int64]
Index = NDArray[np.intp]

_SLOW = 10_000
"""Vehicles below this speed are written as slow ones [mm/s]."""

_MOST_BRAKING = BRAKING.high * 1e-3
"""Where there is no room left to brake in [m/s^2]."""


def ego_facts(
    case: Case, numbers: I64, wanted: Collection[str], places: Collection[str]
) -> dict[str, Columns]:
    """Measurements of the ego, in every frame.

    Args:
        case: The recordings.
        numbers: Their numbers.
        wanted: Names of the predicates to write.
        places: Which places around the ego are asked for.
    """
    facts: dict[str, Columns] = {}
    if "ego_speed" in wanted:
        row, frame = np.nonzero(case.signals.valid)
        speed = case.trajectories.states.speed[row, Role.EGO, frame]
        facts["ego_speed"] = (numbers[row], frame, speed)
    if "reach" in wanted:
        facts["reach"] = _reach(case, numbers)
    if "slow_vehicle" in wanted:
        facts["slow_vehicle"] = _slow_vehicles(case, numbers)
    if {"target_lead", "target_speed"} & {*wanted}:
        facts |= _target(case, numbers)
    if {"spacing", "forced_braking"} & {*wanted}:
        facts |= _around(case, numbers, places)
    return {name: columns for name, columns in facts.items() if name in wanted}


def _reach(case: Case, numbers: I64) -> Columns:
    seen = case.signals
    row, frame = np.nonzero(seen.valid)
    right, left = (of[row, frame] for of in (seen.right_reach, seen.left_reach))
    return numbers[row], frame, down(right), up(left)


def _slow_vehicles(case: Case, numbers: I64) -> Columns:
    states = case.trajectories.states
    slow = case.trajectories.state_valid & (states.speed < _SLOW)
    slow[:, Role.EGO] = False
    row, slot, frame = np.nonzero(slow)
    away = np.abs(states.s[row, slot, frame] - states.s[row, Role.EGO, frame])
    return numbers[row], frame, slot, states.speed[row, slot, frame], away


def _target(case: Case, numbers: I64) -> dict[str, Columns]:
    states, target = case.trajectories.states, case.target
    row, frame = np.nonzero(target.valid)
    slot = target.vehicle[row].astype(np.intp)
    lead = states.s[row, Role.EGO, frame] - states.s[row, slot, frame]
    return {
        "target_lead": (numbers[row], frame, lead),
        "target_speed": (numbers[row], frame, states.speed[row, slot, frame]),
    }


def _around(case: Case, numbers: I64, places: Collection[str]) -> dict[str, Columns]:
    """Gaps to the neighbours and to the target, and the braking that those behind are forced to."""
    spacings: list[Columns] = []
    brakings: list[Columns] = []
    for name in sorted(places, key=PLACE.names.index):
        code = PLACE.names.index(name)
        if name == "target":
            spacings.append(_spacing_of_target(case, numbers, code))
            continue
        place = Around(code)
        spacings.append(_spacing(case, numbers, place))
        if place not in PLACES_AHEAD:
            brakings.append(_braking(case, numbers, place))
    return {"spacing": _joined(spacings, 6), "forced_braking": _joined(brakings, 4)}


def _joined(parts: list[Columns], width: int) -> Columns:
    if not parts:
        return (np.zeros(0, np.int64),) * width
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))


def _there(case: Case, place: Around) -> tuple[Index, Index]:
    seen = case.signals
    row, frame = np.nonzero(seen.valid & (seen.vehicle[:, place] != NO_VEHICLE))
    return row, frame


def _spacing(case: Case, numbers: I64, place: Around) -> Columns:
    """Of one place: the lawful gap is that of whoever is behind."""
    seen, (row, frame) = case.signals, _there(case, place)
    here = (row, place, frame)
    gap, closing, speed = seen.gap[here], seen.closing_speed[here], seen.speed[row, frame]
    rear = speed if place in PLACES_AHEAD else speed + closing
    lawful = lawful_gap(rear, closing, sure_decel(seen.friction[row, frame]))
    states = case.trajectories.states.speed
    own = states[row, Role.EGO, frame]
    other = states[row, seen.vehicle[here].astype(np.intp), frame]
    exact = own - other if place in PLACES_AHEAD else other - own
    code = np.full(len(row), int(place))
    return numbers[row], code, frame, down(gap), exact, beside(lawful, gap)


def _spacing_of_target(case: Case, numbers: I64, code: int) -> Columns:
    """Of the target, wherever it is: the lawful gap is its own, behind the ego."""
    seen, target, states = case.signals, case.target, case.trajectories.states.speed
    row, frame = np.nonzero(target.valid)
    here = (row, frame)
    gap, speed = target.gap[here], target.speed[here]
    lawful = lawful_gap(speed, speed - seen.speed[here], sure_decel(seen.friction[here]))
    slot = target.vehicle[row].astype(np.intp)
    closing = states[row, slot, frame] - states[row, Role.EGO, frame]
    place = np.full(len(row), code)
    return numbers[row], place, frame, down(gap), closing, beside(lawful, gap)


def _braking(case: Case, numbers: I64, place: Around) -> Columns:
    seen, (row, frame) = case.signals, _there(case, place)
    closing = seen.closing_speed[row, place, frame]
    closes = closing > 0
    row, frame, closing = row[closes], frame[closes], closing[closes]
    forced = drac(seen.gap[row, place, frame], closing)
    forced = np.minimum(forced, np.float32(_MOST_BRAKING))
    return numbers[row], np.full(len(row), int(place)), frame, up(forced)
