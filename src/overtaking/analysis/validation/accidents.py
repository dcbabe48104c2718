"""Accidents: connected contacts, and vehicles that leave the road or spin without one."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.traffic import limit
from overtaking.knowledge.toml_reader import constant
from overtaking.model.trajectories import (
    ANGLE_RESOLUTION,
    NO_VEHICLE,
    SPEED_RESOLUTION,
    Trajectories,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from overtaking.analysis.validation.tally import Array, Tally
    from overtaking.analysis.validation.traffic import Batch


class Severity(IntEnum):
    """How hard an accident is, by the largest change of speed of a vehicle."""

    NO_CONTACT = 0
    LIGHT = 1
    MODERATE = 2
    SEVERE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Accident:
    """One accident.

    Attributes:
        simulation: Its place in the batch.
        vehicles: Slots of those involved, in the order in which they were.
        time: When it began [s].
        delta_v: Largest change of speed of a vehicle by its first contact; 0 without one [m/s].
        closing_speed: Speed of approach in the first contact; 0 without one [m/s].
        is_spin: Without a contact, whether the vehicle spun before it left the road.
    """

    simulation: int
    vehicles: tuple[int, ...]
    time: float
    delta_v: float = 0.0
    closing_speed: float = 0.0
    is_spin: bool = False

    @property
    def is_contact(self) -> bool:
        """Whether vehicles touched."""
        return len(self.vehicles) > 1

    @property
    def severity(self) -> Severity:
        """How hard it was."""
        if not self.is_contact:
            return Severity.NO_CONTACT
        if self.delta_v < limit("light_impact"):
            return Severity.LIGHT
        return Severity.SEVERE if self.delta_v > limit("severe_impact") else Severity.MODERATE


def count(tally: Tally, batch: Batch) -> None:
    """Add the accidents of a batch to a tally."""
    found = first_of_each(accidents(batch.runs))
    simulation = np.array([one.simulation for one in found], np.intp)
    group, weight = batch.group[simulation], batch.weight[simulation]
    tally.add("accidents", group, weight)
    tally.add("accidents_squares", group, weight**2)
    for one in Severity:
        of_it = np.array([each.severity is one for each in found], np.bool_)
        tally.add(f"accidents_{one.name.lower()}", group, weight * of_it)
        tally.add(f"accidents_{one.name.lower()}_squares", group, weight**2 * of_it)
    touched = np.array([each.is_contact for each in found], np.bool_)
    closing = np.array([each.closing_speed for each in found], np.float64)
    tally.add("impacts", group, weight * touched)
    tally.add("impact_speed", group, weight * touched * closing)


def accidents(runs: Trajectories) -> list[Accident]:
    """The accidents of a batch, by simulation and time."""
    touched = (runs.contacts.partner != NO_VEHICLE) & runs.scenario.vehicles.valid
    off, across = _first(_is_off(runs)), _first(_is_across(runs))
    lost = ((off >= 0) | (across >= 0)) & ~touched
    found: list[Accident] = []
    for simulation in np.flatnonzero((touched | lost).any(axis=1)):
        found += _contacts(runs, int(simulation), touched[simulation])
        for slot in np.flatnonzero(lost[simulation]):
            frames = [int(one[simulation, slot]) for one in (off, across)]
            first = min(frame for frame in frames if frame >= 0)
            found.append(
                Accident(
                    simulation=int(simulation),
                    vehicles=(int(slot),),
                    time=1e-3 * first * runs.scenario.frame_interval_ms,
                    is_spin=frames[1] == first,
                )
            )
    return sorted(found, key=lambda one: (one.simulation, one.time, one.vehicles))


def first_of_each(found: Iterable[Accident]) -> list[Accident]:
    """The first accident of each simulation, as hard as the hardest that follows it.

    A simulation is some hundred metres of traffic for a minute or two. Later collisions behind the
    wrecks belong to the same accident, as in road statistics.

    Args:
        found: Accidents, by simulation and time.
    """
    return [
        dataclasses.replace(first, delta_v=max([first.delta_v, *(one.delta_v for one in later)]))
        for _, (first, *later) in itertools.groupby(found, lambda one: one.simulation)
    ]


def _contacts(runs: Trajectories, simulation: int, touched: Array) -> list[Accident]:
    """The accidents of one simulation in which vehicles touched: who is connected by contacts."""
    contacts, mass = runs.contacts, runs.scenario.vehicles.mass[simulation]
    time, partner = contacts.time[simulation], contacts.partner[simulation]
    groups: list[set[int]] = []
    for slot in np.flatnonzero(touched).tolist():
        pair = {slot, int(partner[slot])}
        joined = pair.union(*(one for one in groups if one & pair))
        groups = [*(one for one in groups if not one & pair), joined]
    found: list[Accident] = []
    for group in groups:
        slots = sorted(group, key=lambda slot: (int(time[slot]), slot))
        changes = contacts.impulse[simulation, slots] / mass[slots]
        closing = abs(float(contacts.closing_speed[simulation, slots[0]]))
        found.append(
            Accident(
                simulation=simulation,
                vehicles=tuple(slots),
                time=1e-3 * float(time[slots[0]]),
                delta_v=float(changes.max()),
                closing_speed=SPEED_RESOLUTION * closing,
            )
        )
    return found


def _is_off(runs: Trajectories) -> Array:
    """Where a vehicle is beyond the lanes, shape (simulation, vehicle, time)."""
    return (runs.states.lane >= runs.road.num_lanes) & _seen(runs)


def _is_across(runs: Trajectories) -> Array:
    """Where a vehicle stands so far across the road that it has spun, same shape."""
    half_turn = round(np.pi / ANGLE_RESOLUTION)
    headings, direction = runs.headings_and_origin
    turned = headings.astype(np.int32) - round(direction / ANGLE_RESOLUTION)
    angle = np.abs((turned + half_turn) % (2 * half_turn) - half_turn)
    return (angle > float(constant("model.departure.spin_angle")) / ANGLE_RESOLUTION) & _seen(runs)


def _seen(runs: Trajectories) -> Array:
    return runs.scenario.vehicles.valid[:, :, None] & runs.frame_mask[:, None, :]


def _first(holds: Array) -> Array:
    """First frame in which something holds, -1 if it never does, (simulation, vehicle)."""
    return np.where(holds.any(axis=2), holds.argmax(axis=2), -1)
