"""L18: indicate a lane change in time."""

import numpy as np
from numpy.typing import NDArray

from overtaking.labels.law.engine import below, dark
from overtaking.labels.law.frames import Span
from overtaking.labels.law.others import back_indicator, out_indicator
from overtaking.labels.law.rule import Check, Grade, Rule, decided
from overtaking.labels.signals.frames import at, seconds_of
from overtaking.model.events import NEVER
from overtaking.model.labels import Case

I32 = NDArray[np.int32]


def check(case: Case) -> Check:
    """The indicator is on from 2 s before either line is crossed to 1 s after."""
    out, back = case.events.line_crossed, return_crossed(case)
    dark_out, first_out, last_out = dark(case, out, out_indicator(case))
    dark_back, first_back, last_back = dark(case, back, back_indicator(case))
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
    return below(case.signals.right_reach, border, span).first


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
