"""L14 and L14s: be able to stop in the visible distance."""

from collections.abc import Callable

import numpy as np

from overtaking.core.elementary import F32, as_f32
from overtaking.model.labels import Case
from overtaking.model.signals import Signals
from overtaking.physics.constants import known
from overtaking.physics.friction import stopping_distance
from overtaking.rules.frames import always, conduct
from overtaking.rules.rule import Check, Grade, Rule


def check_lit(case: Case) -> Check:
    """The stopping distance is at most the distance at which a lit vehicle is seen."""
    return _check(case, lambda seen: seen.sight_lit)


def check_unlit(case: Case) -> Check:
    """The stopping distance is at most the distance at which an unlit obstacle is seen."""
    return _check(case, lambda seen: seen.sight_unlit)


def _check(case: Case, sight: Callable[[Signals], F32]) -> Check:
    seen = case.signals
    # Beyond the end of a recording there is no friction, and none of this counts.
    grip = np.maximum(seen.friction, known("friction.table.floor"))
    decel = known("friction.table.usable_share") * known("model.nature.gravity") * grip
    stop = stopping_distance(seen.speed, as_f32(known("law.sight.reaction_time")), decel)
    return always(sight(seen) - stop, conduct(case))


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
