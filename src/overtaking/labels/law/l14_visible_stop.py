"""L14 and L14s: be able to stop in the visible distance."""

from overtaking.labels.law.frames import conduct, never_negative
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.law.stops import stop_for_lit, stop_for_unlit
from overtaking.model.labels import Case


def check_lit(case: Case) -> Check:
    """The stopping distance is at most the distance at which a lit vehicle is seen."""
    return never_negative(stop_for_lit(case), conduct(case))


def check_unlit(case: Case) -> Check:
    """The stopping distance is at most the distance at which an unlit obstacle is seen."""
    return never_negative(stop_for_unlit(case), conduct(case))


_GLOSS = (
    "Adapt speed to road, weather and traffic, so that the vehicle can be stopped in the free "
    "and visible space ahead."
)
_PREDICATE = (
    "At every frame: v t + v^2 / (2 0.9 mu g) <= {}, t = 1 s. A leader does not shorten the "
    "visible space: its brake lamps announce what it meets, and L3 is the rule for it."
)

RULE = Rule(
    id="pt.ce.24-1@2013",
    code="L14",
    law="Article 24(1)",
    title="Stop in the visible space",
    gloss=_GLOSS,
    predicate=_PREDICATE.format("the distance at which a lit vehicle is seen"),
    unit="m",
    grade=Grade.SERIOUS,
    needs=frozenset(["weather"]),
    without_attempt=True,
    check=check_lit,
)

STRICT_RULE = Rule(
    id="pt.ce.24-1.unlit@2013",
    code="L14s",
    law="Article 24(1), strictly",
    title="Stop in the visible space, for the unlit",
    gloss=_GLOSS,
    predicate=_PREDICATE.format("the distance at which an unlit obstacle is seen"),
    unit="m",
    grade=Grade.SERIOUS,
    needs=frozenset(["weather", "lamps"]),
    without_attempt=True,
    check=check_unlit,
)
