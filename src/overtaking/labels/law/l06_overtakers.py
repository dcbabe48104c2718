"""L6: nobody behind has begun to overtake."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, maximum
from overtaking.labels.law.frames import instant
from overtaking.labels.law.others import Others, others_at, out_indicator
from overtaking.labels.law.rule import Check, Grade, Rule
from overtaking.labels.law.steady import steady_speed_at
from overtaking.model.labels import Case
from overtaking.world.constants import known

T = TypeVar("T", bound=np.generic)
I32 = NDArray[np.int32]
Index = NDArray[np.intp]


def check(case: Case) -> Check:
    """At the start nobody comes up on the left within 4 s, and no follower is pulling out."""
    frame, attempted = case.events.attempt, case.events.attempted
    rows = np.flatnonzero(attempted)
    others, own_lane = (
        others_at(case, frame[rows], rows),
        case.signals.lane[rows, frame[rows], None],
    )
    behind = others.valid & ~others.oncoming & (others.lead > 0)
    left = behind & (others.lane == own_lane + 1)
    same = behind & (others.lane == own_lane) & (others.gap <= known("law.others.reach"))
    moving = same.copy()
    moving[same] = _moves_left(case, frame, rows, same)
    hidden = "indicators" in case.trajectories.unknown
    shown = same & ((others.lights & out_indicator(case)) != 0) & (not hidden)
    begun = (moving | shown).any(axis=1)
    arrival = np.where(begun, np.float32(0.0), _arrival(case, others, left, rows))
    return instant(
        frame,
        _spread(arrival - known("law.others.arrival"), attempted),
        _spread((left | same).any(axis=1), attempted),
        doubtful=_spread(same.any(axis=1) & hidden, attempted),
    )


def _moves_left(case: Case, frame: I32, rows: Index, some: Mask) -> Mask:
    """Whether some of the others move left at the attempts of some simulations, (instant,)."""
    limit = known("law.others.lateral_speed")
    place, slot = np.nonzero(some)
    which = rows[place]
    speed = steady_speed_at(case.trajectories, which, slot, frame[which], float(limit))
    return speed > limit


def _spread(values: NDArray[T], where: Mask) -> NDArray[T]:
    """Values of some simulations among all, 0 for the others."""
    spread = np.zeros(len(where), values.dtype)
    spread[where] = values
    return spread


def _arrival(case: Case, others: Others, left: Mask, rows: NDArray[np.intp]) -> F32:
    """Time until the first on the left is beside the ego at constant speeds [s], at most 60."""
    longest = known("law.others.longest_arrival")
    own = case.signals.speed[rows, case.events.attempt[rows], None]
    closing = others.speed - own
    comes = left & (closing > 0)
    time = maximum(others.gap, np.float32(0.0)) / np.where(comes, closing, np.float32(1.0))
    return np.where(comes & (time < longest), time, longest).min(axis=1)


RULE = Rule(
    id="pt.ce.38-2-c@2013",
    code="L6",
    law="Article 38(2)(c)",
    title="Nobody overtakes already",
    gloss="Do not begin to overtake if a follower in the same lane or in the one on the left has "
    "begun to.",
    predicate="At attempt: nobody behind in the lane on the left arrives beside the ego within 4 "
    "s, and nobody within 100 m behind in its lane signals left or moves left at over 0.2 m/s.",
    unit="s",
    grade=Grade.BY_ROAD,
    partly=frozenset(["indicators"]),
    check=check,
)
