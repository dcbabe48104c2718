"""The vehicle that is overtaken, frame by frame, once it is known which one it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.labels.signals.reference import (
    METRES,
    footprint,
    lateral_speed,
    lateral_speed_at,
)
from overtaking.model.events import Events
from overtaking.model.signals import Signals, TargetSignals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import Role


def target_signals(trajectories: Trajectories, seen: Signals, events: Events) -> TargetSignals:
    """The target of each simulation, frame by frame.

    Args:
        trajectories: The batch.
        seen: Its signals.
        events: What names the targets.
    """
    return signals_of(trajectories, seen, events.target)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alongside:
    """Where the ego is along the road, seen from another vehicle; as in `TargetSignals`."""

    valid: Mask
    lead: F32
    gap: F32
    overlaps: Mask


def alongside(
    trajectories: Trajectories,
    vehicle: NDArray[np.uint8],
    simulation: NDArray[np.int64] | None = None,
) -> Alongside:
    """Where each ego is relative to a vehicle, `NO_VEHICLE` where there is none.

    Args:
        trajectories: The batch.
        vehicle: Slot of the vehicle, shape (simulation,).
        simulation: Which simulations of the batch, same shape; all of them if left out.
    """
    s, length = trajectories.states.s, trajectories.scenario.vehicles.length
    row = np.arange(len(vehicle)) if simulation is None else simulation
    slot = _slot(vehicle)
    valid = (vehicle != NO_VEHICLE)[:, None] & trajectories.frame_valid[row]
    if trajectories.present is not None:
        valid = valid & trajectories.present[row, slot]
    half = np.float32(0.5) * (length[row, Role.EGO] + length[row, slot])
    lead = as_f32(s[row, Role.EGO] - s[row, slot]) * METRES
    gap = np.abs(lead) - half[:, None]
    return Alongside(valid=valid, lead=lead, gap=gap, overlaps=valid & (gap < 0))


def _slot(vehicle: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Slot of each vehicle; the ego's where there is none."""
    return np.where(vehicle == NO_VEHICLE, Role.EGO, vehicle).astype(np.intp)


def signals_of(
    trajectories: Trajectories, seen: Signals, vehicle: NDArray[np.uint8]
) -> TargetSignals:
    """All signals of a vehicle of each simulation; arguments as in `alongside`."""
    states, bodies = trajectories.states, trajectories.scenario.vehicles
    row, slot = np.arange(len(vehicle)), _slot(vehicle)
    length = bodies.length[row, slot]
    along = alongside(trajectories, vehicle)
    across, reach = footprint(
        trajectories.road,
        states.d[row, slot],
        states.heading[row, slot],
        length,
        bodies.width[row, slot],
    )
    own_reach = (seen.left_reach - seen.right_reach) * np.float32(0.5)
    return TargetSignals(
        valid=along.valid,
        vehicle=vehicle,
        length=length,
        lead=along.lead,
        overlaps=along.overlaps,
        gap=along.gap,
        lateral=across,
        lateral_gap=np.abs(across - seen.lateral) - (own_reach + reach),
        lane=states.lane[row, slot],
        speed=as_f32(states.speed[row, slot]) * METRES,
        accel=as_f32(states.accel_lon[row, slot]) * METRES,
        lateral_speed=_lateral_speed(trajectories, row, slot),
    )


def _lateral_speed(
    trajectories: Trajectories, row: NDArray[np.intp], slot: NDArray[np.intp]
) -> F32:
    """Speed to the left of one vehicle of each simulation, shape (simulation, time) [m/s]."""
    if trajectories.present is None:
        return lateral_speed(trajectories, trajectories.states.d[row, slot])
    frames = np.arange(trajectories.states.d.shape[2])[None, :]
    return lateral_speed_at(trajectories, row[:, None], slot[:, None], frames)


@dataclass(frozen=True, slots=True, kw_only=True)
class Along:
    """The target along the road at one frame each, as in `TargetSignals`; shape (instant,).

    `valid` says where there is a target and it is recorded; elsewhere the values mean nothing.
    """

    valid: Mask
    lead: F32
    gap: F32
    speed: F32


def target_at(
    trajectories: Trajectories,
    target: TargetSignals,
    frames: NDArray[np.integer],
    rows: NDArray[np.intp] | None = None,
) -> Along:
    """The target at single frames, without those of all others; the first where one is negative.

    Args:
        trajectories: The batch.
        target: Signals of the targets.
        frames: Frames, shape (instant,).
        rows: Simulation of each, same shape; all of them, one after the other, if left out.
    """
    rows, frame = np.arange(len(frames)) if rows is None else rows, np.maximum(frames, 0)
    if not target.is_original:
        at = (rows, frame)
        return Along(
            valid=target.valid[at],
            lead=target.lead[at],
            gap=target.gap[at],
            speed=target.speed[at],
        )
    states, length = trajectories.states, trajectories.scenario.vehicles.length
    slot = _slot(target.vehicle)[rows]
    lead = as_f32(states.s[rows, Role.EGO, frame] - states.s[rows, slot, frame]) * METRES
    half = np.float32(0.5) * (length[rows, Role.EGO] + length[rows, slot])
    speed = as_f32(states.speed[rows, slot, frame]) * METRES
    there = (target.vehicle != NO_VEHICLE)[rows] & trajectories.frame_valid[rows, frame]
    if trajectories.present is not None:
        there &= trajectories.present[rows, slot, frame]
    return Along(valid=there, lead=lead, gap=np.abs(lead) - half, speed=speed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Instant:
    """A vehicle at one frame each, as in `TargetSignals`; arrays have shape (instant,)."""

    lead: F32
    gap: F32
    lateral: F32
    lateral_gap: F32
    lateral_speed: F32


def signals_at(
    trajectories: Trajectories,
    seen: Signals,
    rows: NDArray[np.intp],
    vehicle: NDArray[np.uint8],
    frames: NDArray[np.integer],
) -> Instant:
    """What `signals_of` says of single frames, without the others.

    Args:
        trajectories: The batch.
        seen: Its signals.
        rows: Simulations, shape (instant,).
        vehicle: Slot of the vehicle in each, same shape.
        frames: A frame of each, same shape.
    """
    states, bodies = trajectories.states, trajectories.scenario.vehicles
    slot = vehicle.astype(np.intp)
    length, place = bodies.length[rows, slot], (rows, slot, frames)
    lead = as_f32(states.s[rows, Role.EGO, frames] - states.s[place]) * METRES
    across, reach = footprint(
        trajectories.road,
        states.d[place][:, None],
        states.heading[place][:, None],
        length,
        bodies.width[rows, slot],
    )
    own = (rows, frames)
    own_reach = (seen.left_reach[own] - seen.right_reach[own]) * np.float32(0.5)
    aside = np.abs(across[:, 0] - seen.lateral[own])
    return Instant(
        lead=lead,
        gap=np.abs(lead) - np.float32(0.5) * (bodies.length[rows, Role.EGO] + length),
        lateral=across[:, 0],
        lateral_gap=aside - (own_reach + reach[:, 0]),
        lateral_speed=lateral_speed_at(trajectories, rows, slot, frames),
    )
