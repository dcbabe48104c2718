"""The other vehicles at single frames: where they are, what they are, how fast they move across."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.float32_math import as_f32, sincos
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.instants import (
    METRES,
    RADIANS,
    Frames,
    half_window,
    lateral_speed_at,
    slot_of,
)
from overtaking.model.road import DrivingSide
from overtaking.model.trajectories import NO_VEHICLE, Lights, Trajectories
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case

_THIRD = np.array([-1.0, 3.0, -3.0, 1.0])
"""A third difference: 0 for a parabola, with 20 times the variance of the noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Others:
    """All vehicles at one frame of each simulation; arrays have shape (simulation, vehicle).

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


def others_at(case: Case, frame: I32, rows: IndexArray | None = None) -> Others:
    """All vehicles at one frame of some simulations; frame 0 where that is negative.

    Args:
        case: The batch.
        frame: A frame of each, shape (simulation,).
        rows: Which simulations, same shape; all of them if left out.
    """
    run, states = case.trajectories, case.trajectories.states
    rows, frame = np.arange(len(frame)) if rows is None else rows, np.maximum(frame, 0)
    place = (rows[:, None], np.arange(states.s.shape[1])[None, :], frame[:, None])
    half = run.scenario.vehicles.length[rows] * np.float32(0.5)
    s = states.s[place]
    lead = as_f32(s[:, [EGO_SLOT]] - s) * METRES
    headings, direction = run.headings_and_origin
    heading = as_f32(headings[place]) * RADIANS - np.float32(direction)
    return Others(
        valid=_others_there(run, rows, frame),
        lead=lead,
        gap=np.abs(lead) - (half + half[:, [EGO_SLOT]]),
        speed=as_f32(states.speed[place]) * METRES,
        lane=states.lane[place],
        lights=states.lights[place],
        oncoming=sincos(heading)[1] < 0,
    )


def coming(others: Others) -> Mask:
    """Whether a vehicle is ahead of the ego and drives towards it, shape (instant, vehicle)."""
    return others.valid & others.oncoming & (others.lead < 0)


def num_slow(case: Case, rows: IndexArray, frames: Frames, *, below: float, reach: float) -> I32:
    """Number of others slower than `below` [m/s] and nearer than `reach` [m] at single frames.

    Args:
        case: The batch.
        rows: Simulations, shape (instant,).
        frames: A frame of each, same shape.
        below: [m/s].
        reach: Along the road, from centre to centre [m].
    """
    states, s = case.trajectories.states, case.trajectories.states.s[rows, :, frames]
    near = np.abs(s - s[:, [EGO_SLOT]]) <= reach * 1000.0
    slow = near & (states.speed[rows, :, frames] < below * 1000.0)
    slow &= _others_there(case.trajectories, rows, frames)
    return slow.sum(axis=1, dtype=np.int32)


def _others_there(run: Trajectories, rows: IndexArray, frames: Frames) -> Mask:
    """Which vehicles but the ego are recorded at single frames, shape (instant, vehicle)."""
    valid = run.scenario.vehicles.valid[rows]
    valid[:, EGO_SLOT] = False
    return valid if run.is_recorded is None else valid & run.is_recorded[rows, :, frames]


def out_indicator(case: Case) -> int:
    """The `Lights` bit that announces a move to the fast side."""
    right_hand = case.trajectories.road.driving_side is DrivingSide.RIGHT
    return int(Lights.INDICATOR_LEFT if right_hand else Lights.INDICATOR_RIGHT)


def back_indicator(case: Case) -> int:
    """The `Lights` bit that announces a move to the slow side."""
    both = int(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
    return both - out_indicator(case)


def ego_may_be(case: Case, kind: VehicleKind) -> Mask:
    """Whether the ego is of a kind, or its kind is unknown, shape (simulation,)."""
    is_one = case.trajectories.scenario.vehicles.kind[:, EGO_SLOT] == kind
    return is_one | ("kinds" in case.trajectories.unknown)


def target_may_be(case: Case, *, bicycle: bool) -> Mask:
    """Whether there is a target that is a bicycle, or is none, or may be; shape (simulation,)."""
    vehicle, kind = case.target.slot, case.trajectories.scenario.vehicles.kind
    is_bicycle = kind[np.arange(len(vehicle)), slot_of(vehicle)] == VehicleKind.BICYCLE
    unknown = "kinds" in case.trajectories.unknown
    return (vehicle != NO_VEHICLE) & ((is_bicycle == bicycle) | unknown)


def steady_speed_at(
    run: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames, limit: float
) -> F32:
    """Speed of vehicles to the left at single frames, all arrays of shape (instant,) [m/s].

    In a recording the central difference over about 0.2 s is widened, up to 2 s, until its standard
    error is a quarter of the limit. The noise of a position is the root mean square of its third
    differences within a second, over the root of 20; the error of a difference over 2 h is the
    noise times the root of 2, over 2 h. Simulations have no noise.

    Args:
        run: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        frames: A frame of each in which it is recorded.
        limit: The speed with which it is compared [m/s].
    """
    if not run.unknown:
        return lateral_speed_at(run, rows, slot, frames)
    interval = run.scenario.frame_interval_ms
    around = int(float(constant("law.others.noise_time")) * 1000.0 / interval)
    accepted = float(constant("law.others.error_share")) * limit
    wanted = np.sqrt(2.0) * _noise(run, rows, slot, frames, max(2, around)) / accepted
    half = np.ceil(wanted / 2.0 * 1000.0 / interval)
    narrow = half_window(interval)
    half = np.clip(half, narrow, max(narrow, around)).astype(np.int32)
    return lateral_speed_at(run, rows, slot, frames, half)


def _noise(
    run: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames, around: int
) -> NDArray[np.float64]:
    """Standard deviation of the noise of a lateral position, from frames around it [m]."""
    frame = frames[:, None] + np.arange(-around, around + 1)
    inside = (frame >= 0) & (frame < run.num_frames[rows, None])
    place = (rows[:, None], slot[:, None], np.where(inside, frame, 0))
    inside &= run.state_mask[place]
    d = run.states.d[place] * float(METRES)
    count = frame.shape[1] - len(_THIRD) + 1
    pieces = [(d[:, k : k + count], inside[:, k : k + count]) for k in range(len(_THIRD))]
    third = sum(weight * values for weight, (values, _) in zip(_THIRD, pieces, strict=True))
    whole = np.logical_and.reduce([there for _, there in pieces])
    squares = np.where(whole, third**2, 0.0).sum(axis=1)
    return np.sqrt(squares / np.maximum(whole.sum(axis=1), 1) / (_THIRD**2).sum())
