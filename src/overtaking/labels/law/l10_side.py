"""L10: enough distance to the side of a motor vehicle."""

from overtaking.core.elementary import F32
from overtaking.labels.law.alongside import Alongside, alongside
from overtaking.labels.law.frames import always_at
from overtaking.labels.law.kinds import target_may_be_motor
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.model.labels import Case
from overtaking.world.constants import known


def check(case: Case) -> Check:
    """Alongside a motor vehicle, the bodies are at least 0.8 m apart."""
    found, margin = margins(case)
    return always_at(margin, found.rows, found.frames, case.signals.num_simulations)


def margins(case: Case) -> tuple[Alongside, F32]:
    """The frames alongside a motor vehicle, and the margin in each, shape (instant,) [m]."""
    found = alongside(case)
    found = found.where(target_may_be_motor(case)[found.rows])
    return found, found.lateral_gap - known("law.side.motor")


RULE = Rule(
    id="pt.ce.18-2@2013",
    code="L10",
    law="Article 18(2)",
    title="Lateral distance",
    gloss="Keep a lateral distance to vehicles on the same carriageway that avoids accidents.",
    predicate="While ego and target overlap, the target being no bicycle: distance between their "
    "sides >= 0.8 m.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["kinds"]),
    check=check,
)
