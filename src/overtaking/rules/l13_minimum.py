"""L13: the lowest speed on motorways."""

import numpy as np

from overtaking.model.labels import Case, Verdict
from overtaking.physics.constants import known
from overtaking.rules.frames import ENDLESS, always, conduct, lowest
from overtaking.rules.others import num_slow
from overtaking.rules.rule import Check, Grade, Rule, decided, inapplicable

_ANYWHERE = 1e6
"""Metres; congestion is judged by all that were recorded."""


def check(case: Case) -> Check:
    """On a motorway speed is at least 50 km/h, unless at least three others stand or crawl."""
    seen, road_known = case.signals, "road_kind" not in case.trajectories.unknown
    if road_known and case.trajectories.road.kind != "motorway":
        return inapplicable(seen.num_simulations)
    margin = seen.speed - known("law.minimum.speed")
    span = conduct(case)
    slow = np.flatnonzero(span.exists & (lowest(margin, span) < 0))
    row, frames = np.nonzero(span.mask(slow, seen.num_frames) & (margin[slow] < 0))
    rows = slow[row]
    if rows.size:
        crawling = num_slow(
            case,
            rows,
            frames.astype(np.int32),
            below=float(known("law.minimum.congestion_speed")),
            reach=_ANYWHERE,
        )
        congested = crawling >= known("law.minimum.congestion_vehicles")
        margin[rows[congested], frames[congested]] = ENDLESS
    found = always(margin, span)
    return found if road_known else _perhaps(found)


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
    "slower than 10 km/h. Frames above 50 km/h count in congestion too.",
    unit="m/s",
    grade=Grade.LIGHT,
    partly=frozenset(["road_kind"]),
    without_attempt=True,
    check=check,
)
