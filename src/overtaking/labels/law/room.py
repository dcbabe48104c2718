"""Whether the slower lane has room for the ego."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, clamp, maximum, minimum
from overtaking.labels.law.distances import lawful_gap, sure_decel
from overtaking.labels.signals.engine import neighbours_at
from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.world.constants import known

Index = NDArray[np.intp]


def slow_lane_room(case: Case, rows: Index, frames: Index) -> F32:
    """Room for the ego in the lane to its right, negative where it is taken [m].

    The smallest of three margins: to the safe distance ahead and behind, and to the vehicle ahead
    being reached within 10 s; at most 200 m either way. A lane that does not exist counts as empty.

    Args:
        case: The batch.
        rows: Simulations, shape (instant,).
        frames: A frame of each, same shape.
    """
    seen = case.signals
    reach = known("law.return.reach")
    speed, decel = seen.speed[rows, frames], sure_decel(seen.friction[rows, frames])
    room = np.full(len(rows), reach, np.float32)
    for place in (Around.RIGHT_LEADER, Around.RIGHT_FOLLOWER):
        other = neighbours_at(case.trajectories, seen, place, rows, frames)
        closing = other.closing_speed
        behind = speed if place is Around.RIGHT_LEADER else speed + closing
        needed = lawful_gap(behind, closing, decel)
        if place is Around.RIGHT_LEADER:
            needed = maximum(needed, known("law.return.free_time") * closing)
        room = np.where(other.exists, minimum(room, other.gap - needed), room)
    return clamp(room, -reach, reach)
