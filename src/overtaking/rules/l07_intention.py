"""L7: the vehicle ahead does not itself pull out."""

import numpy as np

from overtaking.model.labels import Case
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.physics.constants import known
from overtaking.rules.frames import instant
from overtaking.rules.others import out_indicator
from overtaking.rules.rule import Check, Grade, Rule
from overtaking.signals.frames import at


def check(case: Case) -> Check:
    """At the start the target neither signals left nor moves left."""
    frame, target = case.events.attempt, case.target
    there = target.vehicle != NO_VEHICLE
    slot = np.where(there, target.vehicle, 0)
    states, row = case.trajectories.states, np.arange(len(slot))
    lights = states.lights[row, slot, np.maximum(frame, 0)]
    hidden = "indicators" in case.trajectories.unknown
    shown = ((lights & out_indicator(case)) != 0) & (not hidden)
    limit = known("law.others.lateral_speed")
    margin = limit - at(target.lateral_speed, frame)
    margin = np.where(shown, np.minimum(margin, -limit), margin)
    return instant(frame, margin, there, doubtful=np.full(len(slot), hidden))


RULE = Rule(
    id="pt.ce.38-2-d@2013",
    code="L7",
    law="Article 38(2)(d)",
    title="The driver ahead does not pull out",
    gloss="Do not begin to overtake if the driver ahead has signalled to overtake a third vehicle"
    " or to avoid an obstacle.",
    predicate="At attempt: the target does not signal left, and moves left at no more than 0.2 "
    "m/s. A signal alone counts as a margin of -0.2 m/s.",
    unit="m/s",
    grade=Grade.BY_ROAD,
    partly=frozenset(["indicators"]),
    check=check,
)
