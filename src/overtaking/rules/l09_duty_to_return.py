"""L9: return to the right as soon as that is safe."""

import numpy as np
from numpy.typing import NDArray

from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.physics.constants import known
from overtaking.rules.distances import lawful_gap, sure_decel
from overtaking.rules.frames import Span, frames_of, manoeuvre
from overtaking.rules.room import slow_lane_room
from overtaking.rules.rule import Check, Grade, Rule, decided
from overtaking.signals.frames import seconds_of

Index = NDArray[np.intp]


def check(case: Case) -> Check:
    """With the target behind and room in the slower lane, the ego does not stay for over 8 s."""
    events, seen = case.events, case.signals
    passed, stop = events.overlap_end != NEVER, manoeuvre(case).stop
    over = Span(start=np.where(passed, events.overlap_end, stop + 1), stop=stop)
    rows, frames = over.frames()
    lane = seen.lane[rows, frames]
    away = (lane != events.original_lane[rows]) & (lane < case.trajectories.road.num_lanes)
    rows, frames = _behind(case, rows[away], frames[away])
    due = slow_lane_room(case, rows, frames) >= 0
    first, length = longest_run(rows[due], frames[due], seen.num_simulations)
    allowed = frames_of(case, known("law.return.within"))
    margin = known("law.return.within") - seconds_of(case, length)
    # The frame in which it had been due for so long, up to the last in which it still was.
    return decided(passed & over.exists, margin, first + allowed, first + length - 1)


def longest_run(rows: Index, frames: Index, num_simulations: int) -> tuple[Index, Index]:
    """Longest run of consecutive frames of each simulation: first frame and number of frames.

    Args:
        rows: Simulation of each frame, in order.
        frames: The frames, in order within each simulation.
        num_simulations: Length of the results.
    """
    first, length = np.full(num_simulations, int(NEVER)), np.zeros(num_simulations, np.intp)
    if rows.size:
        begins = np.ones(rows.size, np.bool_)
        begins[1:] = (rows[1:] != rows[:-1]) | (frames[1:] != frames[:-1] + 1)
        start = np.flatnonzero(begins)
        size = np.diff(start, append=rows.size)
        # Stable, so that of runs of one length the last stays, and then the first is asked for.
        order = np.argsort(size[::-1], kind="stable")
        best = start[::-1][order]
        length[rows[best]], first[rows[best]] = size[::-1][order], frames[best]
    return first, length


def _behind(case: Case, rows: Index, frames: Index) -> tuple[Index, Index]:
    """Those of single frames in which the target is far enough behind."""
    seen, target, here = case.signals, case.target, (rows, frames)
    speed = target.speed[here]
    lawful = lawful_gap(speed, speed - seen.speed[here], sure_decel(seen.friction[here]))
    wanted = np.maximum(known("law.return.time_gap") * speed, lawful)
    enough = (target.lead[here] > 0) & (target.gap[here] >= wanted)
    return rows[enough], frames[enough]


RULE = Rule(
    id="pt.ce.38-4@2013",
    code="L9",
    law="Articles 38(4) and 13(3)",
    title="Duty to return",
    gloss="Return to the right as soon as the manoeuvre is done and this is safe.",
    predicate="From overlap_end on: the ego never stays out of its original lane for more than 8 "
    "s on end in which the target is max(2 s, safe distance) or more behind it and the lane to "
    "the right is free: room ahead and behind, and no vehicle reached within 10 s. Not in the "
    "lane of oncoming traffic, for which there is L24.",
    unit="s",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=check,
)
