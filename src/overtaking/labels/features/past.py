"""How far a vehicle is past the place where the ego's rear was."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.signals.frames import first_true
from overtaking.labels.signals.reference import METRES
from overtaking.model.labels import Case
from overtaking.model.vehicles import Role

Index = NDArray[np.intp]
I32 = NDArray[np.int32]


def halves(case: Case, rows: Index, slot: Index) -> F32:
    """Half of both lengths, of the ego and of one vehicle of some simulations [m]."""
    length = case.trajectories.scenario.vehicles.length
    return np.float32(0.5) * (length[rows, Role.EGO] + length[rows, slot])


def past(case: Case, rows: Index, slot: Index, begin: I32, frame: I32) -> F32:
    """How far a front bumper is past the place of the ego's rear bumper at an earlier frame [m].

    Args:
        case: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        begin: When the ego's rear bumper was there.
        frame: When the front bumper is looked at.
    """
    s = case.trajectories.states.s
    # Integers are subtracted before they are rounded: no digit is lost far along the road.
    way = as_f32(s[rows, slot, frame] - s[rows, Role.EGO, begin]) * METRES
    return way + halves(case, rows, slot)


def first_past(case: Case, rows: Index, slot: Index, begin: I32) -> I32:
    """First recorded frame in which it is there or past it, `NEVER` without one; as in `past`."""
    run = case.trajectories
    s = run.states.s
    way = as_f32(s[rows, slot] - s[rows, Role.EGO, begin][:, None]) * METRES
    recorded = np.arange(s.shape[2]) < run.num_frames[rows, None]
    if run.present is not None:
        recorded = recorded & run.present[rows, slot]
    is_past = way + halves(case, rows, slot)[:, None] >= 0
    return first_true(recorded & is_past & (np.arange(s.shape[2]) >= begin[:, None]))
