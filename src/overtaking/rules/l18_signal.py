"""L18: indicate a lane change in time."""

import numpy as np
from numpy.typing import NDArray

from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.vehicles import Role
from overtaking.physics.constants import known
from overtaking.rules.frames import Span, driving_end, frames_of
from overtaking.rules.others import back_indicator, out_indicator
from overtaking.rules.rule import Check, Grade, Rule, decided
from overtaking.signals.frames import at, seconds_of

I32 = NDArray[np.int32]


def check(case: Case) -> Check:
    """The indicator is on from 2 s before either line is crossed to 1 s after."""
    out, back = case.events.line_crossed, return_crossed(case)
    dark_out, first_out, last_out = _missing(case, out, out_indicator(case))
    dark_back, first_back, last_back = _missing(case, back, back_indicator(case))
    # In a short overtake the way back begins before the way out is done.
    first = np.where(dark_out > 0, first_out, first_back)
    first = np.where(dark_back > 0, np.minimum(first, first_back), first)
    last = np.where(dark_back > 0, last_back, last_out)
    last = np.where(dark_out > 0, np.maximum(last, last_out), last)
    missing = seconds_of(case, dark_out + dark_back)
    return decided((out != NEVER) | (back != NEVER), -missing, first, last)


def return_crossed(case: Case) -> I32:
    """First frame of the return with a corner over the line back, `NEVER` without one."""
    events, road = case.events, case.trajectories.road
    begin, end = (
        events.return_begin,
        np.where(events.return_end != NEVER, events.return_end, events.last),
    )
    span = Span(start=np.where(begin != NEVER, begin, end + 1), stop=end)
    # Of the lane in which the return begins, the border on its slow side.
    lane = np.minimum(at(case.signals.lane, begin), road.num_lanes)
    border = (road.side * road.boundaries).astype(np.float32)[lane]
    rows, frames = span.frames()
    over = case.signals.right_reach[rows, frames] < border[rows]
    crossed = np.full(len(begin), NEVER)
    # In reverse, so that the first frame of each simulation is written last.
    crossed[rows[over][::-1]] = frames[over][::-1]
    return crossed


def _missing(case: Case, crossed: I32, bit: int) -> tuple[I32, I32, I32]:
    """Frames around a crossing without a signal: their number, the first and the last."""
    before = frames_of(case, known("law.signal.before"))
    after = frames_of(case, known("law.signal.after"))
    frame = crossed[:, None] + np.arange(-before, after + 1, dtype=np.int32)
    end = driving_end(case)[:, None]
    asked = (crossed != NEVER)[:, None] & (frame >= case.events.first[:, None]) & (frame <= end)
    lights = case.trajectories.states.lights[:, Role.EGO]
    shown = np.take_along_axis(lights, np.clip(frame, 0, lights.shape[1] - 1), axis=1)
    dark = asked & ((shown & bit) == 0)
    row, last = np.arange(len(crossed)), dark.shape[1] - 1 - dark[:, ::-1].argmax(axis=1)
    return dark.sum(axis=1, dtype=np.int32), frame[row, dark.argmax(axis=1)], frame[row, last]


RULE = Rule(
    id="pt.ce.21@2013",
    code="L18",
    law="Article 21",
    title="Indicate",
    gloss="Signal a lane change and the start of an overtake with due anticipation, and "
    "throughout.",
    predicate="From 2 s before to 1 s after line_crossed: left indicator on. The same with the "
    "right one around the first corner over the line back. The margin is the time without it.",
    unit="s",
    grade=Grade.LIGHT,
    needs=frozenset(["indicators"]),
    check=check,
)
