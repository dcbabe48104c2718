"""L3: keep a safe distance to the vehicle ahead."""

import numpy as np

from overtaking.labels.law.beliefs import LEADER, belief, pull_out
from overtaking.labels.law.distances import margin_of_gap
from overtaking.labels.law.engine import follow_margin
from overtaking.labels.law.frames import Span, conduct, never_negative, time_to_regain
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.model.labels import Case


def check(case: Case) -> Check:
    """The gap to the leader is lawful, but for 3 s after it cut in or all began."""
    span = span_of(case)
    believed = belief(case, pull_out(case), {LEADER: margin_of_gap})
    return never_negative(follow_margin(case, span), span, belief=believed)


def span_of(case: Case) -> Span:
    """The frames in which the gap counts."""
    span = conduct(case)
    # What came before a recording is not known: its beginning is like a cut-in.
    settled = case.events.first + time_to_regain(case) + 1
    return Span(start=np.maximum(span.start, settled), stop=span.stop)


RULE = Rule(
    id="pt.ce.18-1@2013",
    code="L3",
    law="Article 18(1)",
    title="Safe distance",
    gloss="Keep a distance to the vehicle ahead that avoids a collision if it stops or slows "
    "suddenly.",
    predicate="At every frame: gap to the leader in the ego's lane >= v t + v^2 / (2 b) - "
    "v_lead^2 / (2 b), t = 1 s, b = min(8 m/s^2, 0.9 mu g); not in the 3 s after the leader cut "
    "in or the recording began.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    without_attempt=True,
    check=check,
)
