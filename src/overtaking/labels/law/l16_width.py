"""L16: the lane on the left is wide enough."""

import numpy as np

from overtaking.labels.law.frames import instant
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.model.labels import Case
from overtaking.model.road import Road
from overtaking.model.vehicles import Role
from overtaking.world.constants import known


def check(case: Case) -> Check:
    """At the start there is a driving lane on the left, with 0.2 m to spare on either side."""
    events = case.events
    widths = left_widths(case.trajectories.road)
    lane = np.minimum(events.original_lane, len(widths) - 1)
    spare = np.float32(2.0) * known("law.width.border")
    needed = case.trajectories.scenario.vehicles.width[:, Role.EGO] + spare
    return instant(events.attempt, widths[lane] - needed, events.attempted)


def left_widths(road: Road) -> np.ndarray:
    """Width of the driving lane to the left of each lane, 0 where there is none [m]."""
    beyond = road.fast_side_neighbour
    last = beyond.width if beyond is not None and beyond.kind == "driving" else 0.0
    return np.array([lane.width for lane in road.lanes[1:]] + [last], np.float32)


RULE = Rule(
    id="pt.ce.41-1-g@2013",
    code="L16",
    law="Articles 41(1)(g) and 38(2)(a)",
    title="Sufficient width",
    gloss="Do not overtake where the carriageway is not wide enough.",
    predicate="At attempt: the lane on the left is a driving lane and at least 0.4 m wider than "
    "the ego.",
    unit="m",
    grade=Grade.BY_ROAD,
    check=check,
)
