"""L1: overtake on the left, in the next lane."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.labels.law.alongside import alongside
from overtaking.labels.law.frames import ENDLESS, always_at
from overtaking.labels.law.others import num_slow
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.signals.target import target_at
from overtaking.model.labels import Case
from overtaking.world.constants import known

_HALF_LANE = np.float32(0.5)
_LANE_AND_HALF = np.float32(1.5)


def check(case: Case) -> Check:
    """While alongside the target the ego is in the lane to its left, unless both are in queues."""
    found = alongside(case)
    rows, frames = found.rows, found.frames
    own, other = _index(case.signals.lane)[rows, frames], _index(found.lane)
    # A target that makes room to the right puts nobody in the wrong.
    entered = np.maximum(other, _index(case.events.original_lane)[rows])
    margin = np.minimum(own - other - _HALF_LANE, entered + _LANE_AND_HALF - own)
    wrong = np.flatnonzero(margin < 0)
    if wrong.size:
        queued = _in_queue(case, rows[wrong], frames[wrong])
        margin[wrong[queued]] = ENDLESS
    return always_at(margin, rows, frames, case.signals.num_simulations)


def _index(lane: NDArray[np.uint8]) -> NDArray[np.int8]:
    """Lane indices with -1 for what is beyond the slow edge."""
    return lane.view(np.int8)


def _in_queue(case: Case, rows: NDArray[np.intp], frames: NDArray[np.intp]) -> Mask:
    """Whether queues go on side by side at different speeds, which is no overtaking (42)."""
    slow = num_slow(
        case,
        rows,
        frames.astype(np.int32),
        below=float(known("law.queue.speed")),
        reach=float(known("law.queue.reach")),
    )
    target = target_at(case.trajectories, case.target, frames, rows)
    faster = case.signals.speed[rows, frames] - target.speed
    return (slow >= known("law.queue.vehicles")) & (faster <= known("law.queue.faster"))


RULE = Rule(
    id="pt.ce.36@2013",
    code="L1",
    law="Articles 36 and 38(3); exceptions 37 and 42",
    title="Overtake on the left",
    gloss="Overtaking is done on the left, in the lane next to that of the overtaken vehicle. "
    "Parallel queues that move at different speeds do not overtake each other.",
    predicate="While ego and target overlap: lane(ego) is left of lane(target), and at most one "
    "lane left of it or of the lane from which the overtake began, for the target may make room. "
    "Not where at least 3 others within 100 m are slower than 30 km/h and the ego is at most 20 "
    "km/h faster than the target.",
    unit="lanes",
    grade=Grade.BY_ROAD,
    check=check,
)
