"""L17: places where overtaking is forbidden."""

import numpy as np

from overtaking.core.elementary import as_f32
from overtaking.labels.law.frames import instant, is_two_way
from overtaking.labels.law.rule import Check, Grade, Rule, inapplicable
from overtaking.model.labels import Case
from overtaking.model.trajectory import NO_VEHICLE

_STEP = np.float32(1e-3)
_HALF = np.float32(0.5)


def check(case: Case) -> Check:
    """On a two-way road the target is not itself over the line between the directions."""
    trajectories, events = case.trajectories, case.events
    n, road = case.signals.num_simulations, trajectories.road
    unclear = "road_kind" in trajectories.unknown
    if not (is_two_way(road) or unclear):
        return inapplicable(n)
    there = events.attempted & (case.target.vehicle != NO_VEHICLE)
    slot, row = np.where(there, case.target.vehicle, 0), np.arange(n)
    d = trajectories.states.d[row, slot, np.maximum(events.attempt, 0)]
    across = np.float32(road.side) * as_f32(d) * _STEP
    reach = trajectories.scenario.vehicles.width[row, slot] * _HALF
    line = np.float32(road.side * road.boundaries[-1])
    return instant(events.attempt, line - (across + reach), there)


RULE = Rule(
    id="pt.ce.41@2013",
    code="L17",
    law="Article 41(1)(a) to (e), (2) and (3)",
    title="Places and targets",
    gloss="Do not overtake on crests, at level crossings, junctions and crossings, in bends of "
    "reduced visibility, nor a vehicle that overtakes a third. None of this holds where there are"
    " two or more lanes in the same direction and the opposite side is not used.",
    predicate="The roads of this package are straight and level, without junctions and signs. So,"
    " on two-way roads, at attempt: the target's body is not over the line between the "
    "directions.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["road_kind"]),
    check=check,
)
