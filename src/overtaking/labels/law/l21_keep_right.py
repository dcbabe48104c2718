"""L21: keep to the right-most lane that is free."""

import numpy as np

from overtaking.labels.law.frames import driving_end, instant
from overtaking.labels.law.room import slow_lane_room
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.signals.frames import at
from overtaking.model.labels import Case


def check(case: Case) -> Check:
    """At the first frame the ego is in the slowest lane, or the next slower one is taken."""
    frame = case.events.first
    lane = at(case.signals.lane, frame)
    applies = (lane > 0) & (lane < case.trajectories.road.num_lanes) & (driving_end(case) >= frame)
    room = slow_lane_room(case, np.arange(len(frame)), np.maximum(frame, 0).astype(np.intp))
    return instant(frame, -room, applies)


RULE = Rule(
    id="pt.ce.13-3@2013",
    code="L21",
    law="Article 13(3)",
    title="Keep right",
    gloss="With two or more lanes in the same direction use the right-most; others only if there "
    "is no room in it, to overtake or to change direction.",
    predicate="At first, the ego not being in the slowest lane: the lane to the right is taken, "
    "that is, without the room that L9 asks for. The margin is by how much, 200 m at most.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    without_attempt=True,
    check=check,
)
