"""L7: the vehicle ahead does not itself pull out."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32
from overtaking.labels.law.frames import instant
from overtaking.labels.law.others import out_indicator
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.law.steady import steady_speed_at
from overtaking.model.labels import Case
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.world.constants import known


def check(case: Case) -> Check:
    """At the start the target neither signals left nor moves left."""
    frame, vehicle = case.events.attempt, case.target.vehicle
    there = vehicle != NO_VEHICLE
    slot = np.where(there, vehicle, 0)
    run, row, first = case.trajectories, np.arange(len(slot)), np.maximum(frame, 0)
    lights = run.states.lights[row, slot, first]
    hidden = "indicators" in case.trajectories.unknown
    shown = ((lights & out_indicator(case)) != 0) & (not hidden)
    limit = known("law.others.lateral_speed")
    # Without an attempt the target need not be recorded in the frame that is looked at.
    speed = np.zeros(len(slot), np.float32)
    begun = np.flatnonzero(there & case.events.attempted)
    speed[begun] = _lateral_speed(case, begun, slot[begun].astype(np.intp), first[begun])
    margin = limit - speed
    margin = np.where(shown, np.minimum(margin, -limit), margin)
    return instant(frame, margin, there, doubtful=np.full(len(slot), hidden))


def _lateral_speed(
    case: Case, rows: NDArray[np.intp], slots: NDArray[np.intp], frames: NDArray[np.int32]
) -> F32:
    """Speed of the target to the left at one frame of each simulation [m/s]."""
    if not (case.target.is_original or case.trajectories.unknown):
        return case.target.lateral_speed[rows, frames]
    limit = float(known("law.others.lateral_speed"))
    return steady_speed_at(case.trajectories, rows, slots, frames, limit)


RULE = Rule(
    id="pt.ce.38-2-d@2013",
    code="L7",
    law="Article 38(2)(d)",
    title="The driver ahead does not pull out",
    gloss="Do not begin to overtake if the driver ahead has signalled to overtake a third vehicle"
    " or to avoid an obstacle.",
    predicate="At attempt: the target does not signal left, and moves left at no more than 0.2 "
    "m/s. A signal alone counts as a margin of -0.2 m/s.",
    unit="m/s",
    grade=Grade.BY_ROAD,
    partly=frozenset(["indicators"]),
    check=check,
)
