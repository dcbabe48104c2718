"""L4: room behind the vehicle ahead in the lane that is entered."""

from overtaking.labels.law.alongside import beside
from overtaking.labels.law.beliefs import FRONT, belief, pull_out
from overtaking.labels.law.distances import margin_ahead, sure_decel
from overtaking.labels.law.frames import instant
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.signals.frames import at
from overtaking.model.labels import Case
from overtaking.model.signals import Around


def check(case: Case) -> Check:
    """When the line is crossed, the leader on the left is at a lawful gap, 3 s or more away."""
    seen, frame = case.signals, case.events.line_crossed
    other = beside(case, Around.LEFT_LEADER, frame)
    margin = margin_ahead(
        other.gap, at(seen.speed, frame), other.closing_speed, sure_decel(at(seen.friction, frame))
    )
    believed = belief(case, pull_out(case), {FRONT: margin_ahead})
    return instant(frame, margin, other.exists, belief=believed)


RULE = Rule(
    id="pt.ce.38-1.front@2013",
    code="L4",
    law="Article 38(1) and (2)(a)",
    title="Room ahead in the lane entered",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic in the "
    "same direction; the carriageway must be free over the length that is needed.",
    predicate="At line_crossed: gap to the leader in the lane on the left >= safe distance (as "
    "L3), and time to collision >= 3 s.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=check,
)
