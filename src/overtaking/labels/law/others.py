"""All vehicles at one instant of each simulation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32, sincos
from overtaking.model.labels import Case
from overtaking.model.road import DrivingSide
from overtaking.model.trajectory import Lights, Trajectories
from overtaking.model.vehicles import Role

I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]
Index = NDArray[np.intp]

_STEP = np.float32(1e-3)
_RADIANS = np.float32(1e-4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Others:
    """Everybody at one frame of each simulation; arrays have shape (simulation, vehicle).

    Attributes:
        valid: Whether this is a vehicle other than the ego, recorded in that frame.
        lead: Centre of the ego minus its centre along the road: positive for those behind [m].
        gap: Between its bumper and the ego's, negative where they overlap [m].
        speed: Along its own direction [m/s].
        lane: Lane index.
        lights: `Lights`.
        oncoming: Whether it drives against the road.
    """

    valid: Mask
    lead: F32
    gap: F32
    speed: F32
    lane: U8
    lights: U8
    oncoming: Mask


def others_at(case: Case, frame: I32, rows: Index | None = None) -> Others:
    """Everybody at one frame of some simulations; frame 0 where that is negative.

    Args:
        case: The batch.
        frame: A frame of each, shape (simulation,).
        rows: Which simulations, same shape; all of them if left out.
    """
    trajectories, states = case.trajectories, case.trajectories.states
    rows = np.arange(len(frame)) if rows is None else rows
    frame = np.maximum(frame, 0)
    place = (rows[:, None], np.arange(states.s.shape[1])[None, :], frame[:, None])
    half = trajectories.scenario.vehicles.length[rows] * np.float32(0.5)
    s = states.s[place]
    lead = as_f32(s[:, [Role.EGO]] - s) * _STEP
    heading = as_f32(states.heading[place]) * _RADIANS - np.float32(trajectories.road.heading)
    return Others(
        valid=_recorded(trajectories, place),
        lead=lead,
        gap=np.abs(lead) - (half + half[:, [Role.EGO]]),
        speed=as_f32(states.speed[place]) * _STEP,
        lane=states.lane[place],
        lights=states.lights[place],
        oncoming=sincos(heading)[1] < 0,
    )


def num_slow(case: Case, row: NDArray[np.intp], frame: I32, *, below: float, reach: float) -> I32:
    """Number of others slower than `below` [m/s] and nearer than `reach` [m] at single frames.

    Args:
        case: The batch.
        row: Simulations, shape (instant,).
        frame: A frame of each, same shape.
        below: [m/s].
        reach: Along the road, from centre to centre [m].
    """
    trajectories, states = case.trajectories, case.trajectories.states
    speed = states.speed[row, :, frame]
    away = np.abs(states.s[row, :, frame] - states.s[row, Role.EGO, frame][:, None])
    there = trajectories.scenario.vehicles.valid[row].copy()
    there[:, Role.EGO] = False
    if trajectories.present is not None:
        there &= trajectories.present[row, :, frame]
    slow = there & (speed < below * 1000.0) & (away <= reach * 1000.0)
    return slow.sum(axis=1, dtype=np.int32)


def out_indicator(case: Case) -> int:
    """The `Lights` bit that announces a move to the fast side."""
    right_hand = case.trajectories.road.driving_side is DrivingSide.RIGHT
    return int(Lights.INDICATOR_LEFT if right_hand else Lights.INDICATOR_RIGHT)


def back_indicator(case: Case) -> int:
    """The `Lights` bit that announces a move to the slow side."""
    both = int(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
    return both - out_indicator(case)


def _recorded(trajectories: Trajectories, place: tuple[Index, Index, I32]) -> Mask:
    """Which vehicles but the ego are there, (simulation, vehicle)."""
    valid = trajectories.scenario.vehicles.valid[place[0][:, 0]]
    valid[:, Role.EGO] = False
    if trajectories.present is not None:
        valid &= trajectories.present[place]
    return valid
