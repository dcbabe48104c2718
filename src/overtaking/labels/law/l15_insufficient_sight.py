"""L15 and L15s: do not overtake where one does not see far enough."""

import numpy as np

from overtaking.core.elementary import F32
from overtaking.labels.law.air import optical_range
from overtaking.labels.law.engine import excess
from overtaking.labels.law.frames import (
    Span,
    Stretch,
    always,
    is_two_way,
    manoeuvre,
    never_negative,
)
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.signals.frames import at, seconds_of
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.world.constants import known


def check_air(case: Case) -> Check:
    """From the start until the target is passed, the air lets one see the carriageway."""
    sight, span = optical_range(case), _until_passed(case)
    if is_two_way(case.trajectories.road):
        whole = np.broadcast_to(sight[:, None], case.signals.lane.shape)
        return always(_with_oncoming(case, whole), span)
    found = Stretch(low=sight - known("law.sight.least"), first=span.start, last=span.stop)
    return never_negative(found, span)


def check_unlit(case: Case) -> Check:
    """From the start until the target is passed, an unlit obstacle is seen far enough away."""
    sight, span = case.signals.sight_unlit, _until_passed(case)
    if is_two_way(case.trajectories.road):
        return always(_with_oncoming(case, sight), span)
    return never_negative(excess(sight, known("law.sight.least"), span), span)


def _until_passed(case: Case) -> Span:
    """From the attempt until the target is passed, or to the end; empty without an attempt."""
    events, stop = case.events, manoeuvre(case).stop
    passed = np.where(events.overlap_end != NEVER, np.minimum(events.overlap_end, stop), stop)
    return Span(start=np.where(events.attempted, events.attempt, passed + 1), stop=passed)


def _with_oncoming(case: Case, sight: F32) -> F32:
    """Margin of a sight, and at the attempt that of the sight of oncoming traffic [m]."""
    margin = sight - known("law.sight.least")
    row = np.flatnonzero(case.events.attempted)
    first = case.events.attempt[row]
    clear = case.signals.sight_lit[row, first] - passing_sight(case)[row]
    margin[row, first] = np.minimum(margin[row, first], clear)
    return margin


def passing_sight(case: Case) -> F32:
    """Sight that an overtake against oncoming traffic takes, shape (simulation,) [m].

    The ways of ego and an oncoming vehicle at the speed limit in the time that the ego was on the
    left, and 1 s more. Where it did not come back, that time is nil.

    Source:
        AASHTO (2018), section 3.2.4, in the form of a time on the left at both speeds.
    """
    events = case.events
    back = np.where(events.return_end != NEVER, events.return_end, events.back)
    was_out = (events.line_crossed != NEVER) & (back != NEVER)
    out = seconds_of(case, np.where(was_out, back - events.line_crossed, 0))
    both = at(case.signals.speed, events.attempt) + np.float32(case.trajectories.road.speed_limit)
    return both * (out + known("law.sight.oncoming_margin"))


_GLOSS = (
    "Do not overtake where visibility is insufficient, that is, where the carriageway cannot be"
    " seen over 50 m; with oncoming traffic, where it is not clear over the length that is "
    "needed."
)
_PREDICATE = (
    "From attempt to overlap_end, or to the end: {}. Two-way roads, at attempt: a lit vehicle "
    "is seen at (v + limit) (time on the left + 1 s) or more."
)


RULE = Rule(
    id="pt.ce.41-1-f@2013",
    code="L15",
    law="Articles 41(1)(f) and 19",
    title="Sufficient visibility",
    gloss=_GLOSS,
    predicate=_PREDICATE.format("the meteorological optical range is 50 m or more"),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=check_air,
)

STRICT_RULE = Rule(
    id="pt.ce.41-1-f.unlit@2013",
    code="L15s",
    law="Articles 41(1)(f) and 19, strictly",
    title="Sufficient visibility, for the unlit",
    gloss=_GLOSS,
    predicate=_PREDICATE.format("an unlit obstacle is seen at 50 m or more"),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather", "lamps"]),
    check=check_unlit,
)
