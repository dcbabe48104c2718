"""L13: the lowest speed on motorways."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.labels.law.engine import excess
from overtaking.labels.law.frames import ENDLESS, Span, Stretch, conduct, never_negative, stretch
from overtaking.labels.law.others import num_slow
from overtaking.labels.law.rule import Check, Grade, Rule, decided, inapplicable
from overtaking.labels.signals.engine import neighbours_at
from overtaking.model.labels import Case, Verdict
from overtaking.model.signals import Around
from overtaking.world.constants import known

_ANYWHERE = 1e6
"""Metres; congestion is judged by all that were recorded."""


def check(case: Case) -> Check:
    """On a motorway speed is at least 50 km/h, unless others are in the way or stand or crawl."""
    seen, road_known = case.signals, "road_kind" not in case.trajectories.unknown
    if road_known and case.trajectories.road.kind != "motorway":
        return inapplicable(seen.num_simulations)
    span = conduct(case)
    found = excess(seen.speed, known("law.minimum.speed"), span)
    slow = np.flatnonzero(span.exists & (found.low < 0))
    found = never_negative(_but_in_jams(case, span, found, slow) if slow.size else found, span)
    return found if road_known else _perhaps(found)


def _but_in_jams(case: Case, span: Span, found: Stretch, slow: NDArray[np.intp]) -> Stretch:
    """The same, where in some simulations frames in a jam or in a queue do not count."""
    part = Span(start=span.start[slow], stop=span.stop[slow])
    margin = case.signals.speed[slow] - known("law.minimum.speed")
    inside = part.mask(np.arange(len(slow)), margin.shape[1])
    row, frames = np.nonzero(inside & (margin < 0))
    crawling = num_slow(
        case,
        slow[row],
        frames.astype(np.int32),
        below=float(known("law.minimum.congestion_speed")),
        reach=_ANYWHERE,
    )
    congested = crawling >= known("law.minimum.congestion_vehicles")
    congested |= _is_held_up(case, slow[row], frames)
    margin[row[congested], frames[congested]] = ENDLESS
    again = stretch(margin, part)
    found.low[slow], found.first[slow], found.last[slow] = again.low, again.first, again.last
    return found


def _is_held_up(case: Case, rows: NDArray[np.intp], frames: NDArray[np.intp]) -> Mask:
    """Whether a vehicle below the lowest speed is so near ahead that the ego has to follow it."""
    least = known("law.minimum.speed")
    ahead = neighbours_at(case.trajectories, case.signals, Around.LEADER, rows, frames)
    leader_speed = case.signals.speed[rows, frames] - ahead.closing_speed
    near = ahead.gap <= known("law.minimum.queue_time_gap") * least
    return ahead.exists & near & (leader_speed < least)


def _perhaps(found: Check) -> Check:
    """The same where it may be no motorway: slow driving is then in doubt, not a breach."""
    slow = found.margin < 0
    margin = np.where(slow, np.float32(0.0), found.margin)
    applies = found.verdict != Verdict.NOT_APPLICABLE
    return decided(applies, margin, found.first, found.last, doubtful=slow)


RULE = Rule(
    id="pt.ce.27-6@2013",
    code="L13",
    law="Article 27(6)",
    title="Lowest speed",
    gloss="On motorways do not drive slower than 50 km/h.",
    predicate="At every frame on a motorway: speed >= 50 km/h, unless at least 3 others are "
    "slower than 10 km/h, or the leader in the ego's lane is slower than 50 km/h and no farther "
    "ahead than 3 s at 50 km/h. Frames above 50 km/h count in congestion too.",
    unit="m/s",
    grade=Grade.LIGHT,
    partly=frozenset(["road_kind"]),
    without_attempt=True,
    check=check,
)
