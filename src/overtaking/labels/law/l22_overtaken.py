"""L22: who is overtaken does not accelerate. Not the ego's duty."""

from overtaking.labels.law.alongside import alongside
from overtaking.labels.law.frames import always_at
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.model.labels import Case
from overtaking.world.constants import known


def check(case: Case) -> Check:
    """While ego and target overlap, the target accelerates at no more than 0.3 m/s^2."""
    found = alongside(case)
    margin = known("law.overtaken.accel") - found.accel
    return always_at(margin, found.rows, found.frames, case.signals.num_simulations)


RULE = Rule(
    id="pt.ce.39@2013",
    code="L22",
    law="Article 39",
    title="Let others overtake",
    gloss="Who is overtaken gives way to the right as far as possible and does not accelerate.",
    predicate="While ego and target overlap: acceleration of the target <= 0.3 m/s^2. The duty is"
    " the target's; a breach never makes the ego's overtake illegal.",
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    of_ego=False,
    check=check,
)
