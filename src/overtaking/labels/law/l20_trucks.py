"""L20: heavy goods vehicles keep to the two slowest lanes of a motorway."""

import numpy as np

from overtaking.core.elementary import as_f32
from overtaking.labels.law.frames import conduct, ends_in, reduced
from overtaking.labels.law.kinds import ego_may_be
from overtaking.labels.law.rule import Check, Grade, Rule, decided, inapplicable
from overtaking.model.labels import Case
from overtaking.model.vehicles import VehicleKind
from overtaking.world.constants import known

_HALF_LANE = np.float32(0.5)


def check(case: Case) -> Check:
    """On a motorway with three or more lanes a truck is in one of the two slowest."""
    seen, road = case.signals, case.trajectories.road
    trucks = ego_may_be(case, VehicleKind.T)
    motorway = road.kind == "motorway" or "road_kind" in case.trajectories.unknown
    if not (motorway and trucks.any() and road.num_lanes >= known("law.trucks.from_lanes")):
        return inapplicable(seen.num_simulations)
    span = conduct(case)
    # As signed numbers, so that what is beyond the slow edge, 255, counts as below lane 0.
    lane = seen.lane.view(np.int8)
    margin = known("law.trucks.lanes") - _HALF_LANE - as_f32(reduced(np.maximum, lane, span))
    applies = trucks & span.exists
    rows = np.flatnonzero(applies & (margin < 0))
    first, last = ends_in(span, rows, lane[rows] >= known("law.trucks.lanes"))
    return decided(applies, margin, first, last)


RULE = Rule(
    id="pt.ce.74@2013",
    code="L20",
    law="Article 74",
    title="Lanes for trucks",
    gloss="On motorways with three or more lanes in one direction, goods vehicles over 3.5 t use "
    "only the two right-most.",
    predicate="At every frame, the ego being a truck on such a motorway: its lane is one of the "
    "two slowest.",
    unit="lanes",
    grade=Grade.LIGHT,
    needs=frozenset(["kinds", "road_kind"]),
    without_attempt=True,
    check=check,
)
