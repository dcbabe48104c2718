"""L23: no lane change that makes others brake hard."""

import numpy as np
from numpy.typing import NDArray

from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.physics.constants import known
from overtaking.physics.measures import drac
from overtaking.rules.frames import Span, always_at, frames_of, manoeuvre
from overtaking.rules.rule import Check, Grade, Rule

Index = NDArray[np.intp]


def check(case: Case) -> Check:
    """For 3 s after the ego has come into a lane, it forces no hard braking on its follower."""
    rows, frames = _after_changes(case)
    place = Around.FOLLOWER
    there = case.signals.vehicle[rows, place, frames] != NO_VEHICLE
    rows, frames = rows[there], frames[there]
    gap, closing = (
        of[rows, place, frames] for of in (case.signals.gap, case.signals.closing_speed)
    )
    forced = np.minimum(drac(gap, closing), known("law.obstruction.most"))
    margin = known("law.obstruction.braking") - forced
    return always_at(margin, rows, frames, case.signals.num_simulations)


def _after_changes(case: Case) -> tuple[Index, Index]:
    """Simulations and frames within 3 s after a change of lane, in the manoeuvre."""
    span, lane = manoeuvre(case), case.signals.lane
    row, before = np.nonzero(lane[:, 1:] != lane[:, :-1])
    inside = (before + 1 >= span.start[row]) & (before < span.stop[row])
    row, begin = row[inside], before[inside] + 1
    # Until the next change of the same simulation, so that no frame comes twice.
    following = np.append(np.where(row[1:] == row[:-1], begin[1:], 2**31 - 1), 2**31 - 1)[
        : row.size
    ]
    end = begin + frames_of(case, known("law.obstruction.duration"))
    stop = np.minimum(np.minimum(end, following - 1), span.stop[row])
    which, frames = Span(start=begin.astype(np.int32), stop=stop.astype(np.int32)).frames()
    return row[which], frames


RULE = Rule(
    id="pt.ce.35.obstruction@2013",
    code="L23",
    law="Article 35",
    title="No obstruction",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    predicate="In the 3 s after each change of lane: closing speed^2 / (2 gap) of the vehicle "
    "behind the ego <= 2 m/s^2.",
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    check=check,
)
