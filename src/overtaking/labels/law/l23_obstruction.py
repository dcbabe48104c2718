"""L23: no lane change that makes others brake hard."""

from overtaking.labels.law.engine import braking_margin
from overtaking.labels.law.frames import manoeuvre, never_negative
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.model.labels import Case


def check(case: Case) -> Check:
    """For 3 s after the ego has come into a lane, it forces no hard braking on its follower."""
    span = manoeuvre(case)
    return never_negative(braking_margin(case, span), span)


RULE = Rule(
    id="pt.ce.35.obstruction@2013",
    code="L23",
    law="Article 35",
    title="No obstruction",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    predicate="In the 3 s after each change of lane: closing speed^2 / (2 gap) of the vehicle "
    "behind the ego <= 2 m/s^2.",
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    check=check,
)
