"""The vehicle that is overtaken, frame by frame, once it is known which one it is."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import as_f32
from overtaking.model.events import Events
from overtaking.model.signals import Signals, TargetSignals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import Role
from overtaking.signals.reference import METRES, footprint, lateral_speed


def target_signals(trajectories: Trajectories, seen: Signals, events: Events) -> TargetSignals:
    """The target of each simulation, frame by frame.

    Args:
        trajectories: The batch.
        seen: Its signals.
        events: What names the targets.
    """
    return signals_of(trajectories, seen, events.target)


def signals_of(
    trajectories: Trajectories, seen: Signals, vehicle: NDArray[np.uint8]
) -> TargetSignals:
    """The same of any vehicle, `NO_VEHICLE` where there is none, shape (simulation,)."""
    states, bodies = trajectories.states, trajectories.scenario.vehicles
    row = np.arange(len(vehicle))
    slot = np.where(vehicle == NO_VEHICLE, 0, vehicle).astype(np.intp)
    valid = (vehicle != NO_VEHICLE)[:, None] & trajectories.frame_valid
    if trajectories.present is not None:
        valid = valid & trajectories.present[row, slot]
    length = bodies.length[row, slot]
    half = np.float32(0.5) * (bodies.length[:, Role.EGO] + length)
    lead = as_f32(states.s[:, Role.EGO] - states.s[row, slot]) * METRES
    gap = np.abs(lead) - half[:, None]
    across, reach = footprint(
        trajectories.road,
        states.d[row, slot],
        states.heading[row, slot],
        length,
        bodies.width[row, slot],
    )
    own_reach = (seen.left_reach - seen.right_reach) * np.float32(0.5)
    return TargetSignals(
        valid=valid,
        vehicle=vehicle,
        length=length,
        lead=lead,
        overlaps=valid & (gap < 0),
        gap=gap,
        lateral=across,
        lateral_gap=np.abs(across - seen.lateral) - (own_reach + reach),
        lane=states.lane[row, slot],
        speed=as_f32(states.speed[row, slot]) * METRES,
        accel=as_f32(states.accel_lon[row, slot]) * METRES,
        lateral_speed=lateral_speed(trajectories, states.d[row, slot]),
    )
