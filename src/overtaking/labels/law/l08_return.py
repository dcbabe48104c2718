"""L8: return to the right without danger to those there."""

import numpy as np

from overtaking.core.elementary import minimum
from overtaking.labels.law.alongside import beside
from overtaking.labels.law.beliefs import FRONT, REAR, belief, going_back
from overtaking.labels.law.distances import margin_behind, margin_of_gap, sure_decel
from overtaking.labels.law.frames import instant
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.signals.frames import at
from overtaking.model.labels import Case
from overtaking.model.signals import Around

_FAR = np.float32(3.0e38)


def check(case: Case) -> Check:
    """When the ego is back, the gaps behind and ahead of it are lawful."""
    seen, frame = case.signals, case.events.return_end
    speed, decel = at(seen.speed, frame), sure_decel(at(seen.friction, frame))
    margins, anybody = [], np.zeros(len(frame), np.bool_)
    for place, margin in ((Around.FOLLOWER, margin_behind), (Around.LEADER, margin_of_gap)):
        other = beside(case, place, frame)
        room = margin(other.gap, speed, other.closing_speed, decel)
        margins.append(np.where(other.exists, room, _FAR))
        anybody |= other.exists
    believed = belief(case, going_back(case), {REAR: margin_behind, FRONT: margin_of_gap})
    return instant(frame, minimum(*margins), anybody, belief=believed)


RULE = Rule(
    id="pt.ce.38-2-b@2013",
    code="L8",
    law="Article 38(2)(b)",
    title="Safe return",
    gloss="Overtake only if one can return to the right without danger to those who drive there.",
    predicate="At return_end: gap to the vehicle behind, the overtaken one or whoever came "
    "between, >= its safe distance (as L3); the braking forced on it <= 2 m/s^2; gap to the "
    "vehicle ahead >= the ego's safe distance.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=check,
)
