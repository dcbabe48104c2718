"""L11: 1.5 m to a bicycle, and slower."""

import numpy as np

from overtaking.labels.law.alongside import alongside
from overtaking.labels.law.frames import always_at
from overtaking.labels.law.kinds import target_may_be_bicycle
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.signals.frames import at
from overtaking.model.labels import Case
from overtaking.world.constants import known

_LEAST_SPEED = np.float32(1e-3)
"""One step of recorded speed, so that a start from rest can be divided by [m/s]."""


def check(case: Case) -> Check:
    """Alongside a bicycle, the bodies are 1.5 m apart and the ego no faster than at the start."""
    seen, found = case.signals, alongside(case)
    found = found.where(target_may_be_bicycle(case)[found.rows])
    rows, frames = found.rows, found.frames
    limit = known("law.side.bicycle")
    start = np.maximum(at(seen.speed, case.events.attempt), _LEAST_SPEED)[rows]
    room = (found.lateral_gap - limit) / limit
    slower = (start - seen.speed[rows, frames]) / start
    return always_at(np.minimum(room, slower), rows, frames, seen.num_simulations)


RULE = Rule(
    id="pt.ce.18-3@2013",
    code="L11",
    law="Articles 18(3) and 38(2)(e)",
    title="Overtaking a bicycle",
    gloss="Motor vehicles keep at least 1.5 m to the side of bicycles, and slow down to overtake "
    "them.",
    predicate="While ego and target overlap, the target being a bicycle: distance between their "
    "sides >= 1.5 m, and speed <= that at attempt. The margin is the smaller of the two, each as "
    "a share of its limit.",
    unit="1",
    grade=Grade.BY_ROAD,
    needs=frozenset(["kinds"]),
    check=check,
)
