"""Post-encroachment times: how soon another vehicle came where the ego has just been."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.features.engine import first_past
from overtaking.labels.features.past import past
from overtaking.labels.signals.frames import at
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE

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
    found = first_past(case, rows, slot, begin)
    first = np.maximum(found, begin)
    in_lane = case.trajectories.states.lane[rows, slot, first] == lane[rows]
    came = (found != NEVER) & in_lane
    # Between two frames both drive on evenly.
    before = np.maximum(first - 1, begin)
    missing = -past(case, rows, slot, begin, before)
    step = past(case, rows, slot, begin, first) + missing
    part = np.maximum(missing, np.float32(0.0)) / np.where(step > 0, step, np.float32(1.0))
    frames = as_f32(before - begin) + part
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    time[rows] = np.where(came, frames * interval, np.float32(np.inf))
    return time
