"""Post-encroachment times: how soon another vehicle came where the ego has just been."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role
from overtaking.signals.frames import at
from overtaking.signals.reference import METRES

Index = NDArray[np.intp]
I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]


def entry_encroachment(case: Case) -> F32:
    """PET of entering the lane on the left.

    From the frame in which the ego crosses the line to the arrival of the vehicle behind in that
    lane at the place where the ego's rear bumper was then, shape (simulation,) [s]. 0 alongside;
    infinite where nobody is behind, or it does not arrive in that lane within the recording.

    Source:
        Allen, Shin, Cooper (1978), Analysis of traffic conflicts and collisions.
    """
    frame = case.events.line_crossed
    row = np.arange(len(frame))
    behind = case.signals.vehicle[row, Around.LEFT_FOLLOWER, np.maximum(frame, 0)]
    return _encroachment(case, behind, frame, at(case.signals.lane, frame) + np.uint8(1))


def return_encroachment(case: Case) -> F32:
    """PET of the return: of the overtaken vehicle, from `return_end`; as `entry_encroachment`."""
    events = case.events
    return _encroachment(case, events.target, events.return_end, events.original_lane)


def _encroachment(case: Case, vehicle: U8, frame: I32, lane: U8) -> F32:
    """Time until the front of a vehicle is in a lane where the ego's rear is at a frame."""
    rows = np.flatnonzero((vehicle != NO_VEHICLE) & (frame != NEVER))
    time = np.full(len(frame), np.inf, np.float32)
    slot, begin = vehicle[rows].astype(np.intp), frame[rows]
    past, recorded = _past(case, rows, slot, begin)
    arrived = recorded & (past >= 0) & (np.arange(past.shape[1]) >= begin[:, None])
    first = arrived.argmax(axis=1)
    each = np.arange(len(rows))
    in_lane = case.trajectories.states.lane[rows, slot, first] == lane[rows]
    came = arrived[each, first] & in_lane
    # Between two frames both drive on evenly.
    before = np.maximum(first - 1, begin)
    missing, step = -past[each, before], past[each, first] - past[each, before]
    part = np.maximum(missing, np.float32(0.0)) / np.where(step > 0, step, np.float32(1.0))
    frames = as_f32(before - begin) + part
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    time[rows] = np.where(came, frames * interval, np.float32(np.inf))
    return time


def _past(case: Case, rows: Index, slot: Index, begin: I32) -> tuple[F32, Mask]:
    """How far a front bumper is past the place of the ego's rear bumper at a frame [m].

    Returns:
        The way, and whether it was recorded, shape (row, time).
    """
    run = case.trajectories
    s, length = run.states.s, run.scenario.vehicles.length
    halves = np.float32(0.5) * (length[rows, Role.EGO] + length[rows, slot])
    # Integers are subtracted before they are rounded: no digit is lost far along the road.
    way = as_f32(s[rows, slot] - s[rows, Role.EGO, begin][:, None]) * METRES
    recorded = np.arange(s.shape[2]) < run.num_frames[rows, None]
    if run.present is not None:
        recorded = recorded & run.present[rows, slot]
    return way + halves[:, None], recorded
