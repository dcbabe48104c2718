"""L5: room in front of the vehicle behind in the lane that is entered."""

from overtaking.labels.law.alongside import beside
from overtaking.labels.law.beliefs import REAR, belief, pull_out
from overtaking.labels.law.distances import margin_behind, sure_decel
from overtaking.labels.law.frames import instant
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.signals.frames import at
from overtaking.model.labels import Case
from overtaking.model.signals import Around


def check(case: Case) -> Check:
    """When the line is crossed, the follower on the left has a lawful gap and need not brake."""
    seen, frame = case.signals, case.events.line_crossed
    other = beside(case, Around.LEFT_FOLLOWER, frame)
    margin = margin_behind(
        other.gap, at(seen.speed, frame), other.closing_speed, sure_decel(at(seen.friction, frame))
    )
    believed = belief(case, pull_out(case), {REAR: margin_behind})
    return instant(frame, margin, other.exists, belief=believed)


RULE = Rule(
    id="pt.ce.35@2013",
    code="L5",
    law="Articles 35 and 38(2)(c)",
    title="Room behind in the lane entered",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    predicate="At line_crossed: gap to the follower in the lane on the left >= its safe distance "
    "(as L3), and the braking that is forced on it, closing speed^2 / (2 gap), <= 2 m/s^2.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=check,
)
