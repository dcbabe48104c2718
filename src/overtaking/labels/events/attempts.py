"""What an attempt to overtake is, and what is only a drift.

An attempt needs a driving lane on the ego's left and a vehicle ahead. It is a movement to the left
by which a corner of the ego's body goes over the line, or by which the ego advances within a second
by more than gusts and wandering move its class, and then comes back. Every other movement that is
as wide, or goes over a line, is a drift.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.labels.events.movements import Movements, advances, movements, num_frames_of
from overtaking.labels.events.view import View
from overtaking.labels.signals.frames import at, first_true, only, since, until
from overtaking.model.events import NEVER
from overtaking.model.signals import Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.world.constants import known

I32 = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftMovements:
    """The movements of the egos to the left; arrays have shape (movement,).

    Attributes:
        all: Where they are.
        is_attempt: Whether each could be the beginning of an attempt.
        is_drift: Whether each is a drift, if it is no part of an attempt.
    """

    all: Movements
    is_attempt: Mask
    is_drift: Mask


def left_movements(view: View, seen: Signals) -> LeftMovements:
    """The movements of the egos to the left, and what each is.

    Args:
        view: What attempts are looked for in.
        seen: Signals of the batch.
    """
    speed = seen.lateral_speed
    # However slowly: who goes over the line leaves the lane.
    moving = view.valid & (
        (speed > known("labels.motion.least_speed")) | (view.is_out & (speed > 0))
    )
    found = movements(seen, moving, towards_left=True)
    begin, end = (found.simulation, found.begin), (found.simulation, found.end)
    trodden = np.cumsum(view.is_out, axis=1, dtype=np.int32)
    crosses = (trodden[end] > trodden[begin]) | view.is_out[begin]
    later, undone = _what_follows(view, seen, found, crosses)
    leaves = view.has_left[begin] & (crosses | later)
    returns = view.has_left[begin] & undone
    is_attempt = (leaves | returns) & (view.lately_ahead[begin] != NO_VEHICLE)
    # To leave a lane with nobody ahead is neither.
    is_drift = (found.wide | crosses) & ~leaves & ~is_attempt
    return LeftMovements(all=found, is_attempt=is_attempt, is_drift=is_drift)


def _what_follows(view: View, seen: Signals, found: Movements, crosses: Mask) -> tuple[Mask, Mask]:
    """What fast movements come to that do not cross the line themselves, within `back_time`.

    Args:
        view: What attempts are looked for in.
        seen: Signals of the batch.
        found: The movements.
        crosses: Which of them cross the line.

    Returns:
        Whether another movement leads over the line, and whether the ego comes back before.
    """
    second = num_frames_of(seen, "attempt.advance_time")
    reach = advances(view.lateral, (found.simulation, found.begin, found.end), second)
    fast = np.flatnonzero(~crosses & (reach >= view.least_advance[found.simulation]))
    chosen, begin = view.select(found.simulation[fast]), found.begin[fast]
    stop = found.end[fast] + np.int32(num_frames_of(seen, "attempt.back_time") + 1)
    during = chosen.valid & since(begin, view.num_frames) & until(stop, view.num_frames)
    crossed = first_true(during & chosen.is_out)
    undone = undone_at(chosen, during, begin)
    later, back = np.zeros_like(crosses), np.zeros_like(crosses)
    back[fast] = (undone != NEVER) & ((crossed == NEVER) | (undone < crossed))
    later[fast] = (crossed != NEVER) & ~back[fast]
    return later, back


def under_way(trajectories: Trajectories, attempt: I32) -> I32:
    """First frame where an attempt began before the recording, else `NEVER`, (simulation,).

    A movement that is there in the first frame of a recording had begun; in a simulation it begins.
    """
    return only(attempt, (attempt == 0) & trajectories.is_excerpt)


def undone_at(view: View, during: Mask, begun: I32) -> I32:
    """Where a movement that began at a frame is undone, `NEVER` if it is not, (simulation,).

    Args:
        view: What attempts are looked for in.
        during: Frames to look in, shape (simulation, time).
        begun: First frame of the movement of each simulation.
    """
    shift = view.lateral - at(view.lateral, begun)[:, None]
    moved = first_true(during & (shift >= known("labels.motion.least_shift")))
    settled = shift <= known("labels.motion.settled_shift")
    return first_true(during & since(moved, view.num_frames) & settled)
