"""Drivers that are shipped, as policies on percepts that answer `decision`.

They decide about lanes; pedals and steering are those of the model's own driver.
"""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.model.driver_interface import Move
from overtaking.model.trajectories import Stage
from overtaking.sim.observation import Observation

Moves = NDArray[np.int64]

WORTH = 3.0
"""A leader that is slower than wanted by this is worth overtaking [m/s]."""

NEAR = 4.0
"""Time gap to it below which the overtake begins [s]."""

ROOM = 1.2
"""Time gap that is kept to vehicles ahead in the new lane, and left to those behind [s]."""

SIGNAL = 1.2
"""Time from the indicator to the movement; UN R79 asks for 1 s [s]."""

FORCED = 3.0
"""Braking that is forced on others at most (UN R79) [m/s^2]."""

EMERGENCY = 6.0
"""A lane change that would force more than this on others is given up [m/s^2]."""

REST = 8.0
"""Time between two lane changes that are not the return [s]."""

FITTING = 0.5
"""`yields` above it: there is room behind the leader; below it the ego brakes for that [1]."""

MARGIN = 3.0
"""Time to who comes that is to be left at the end of a pass [s]."""


def stay(seen: Observation) -> Moves:
    """Never change lanes."""
    return np.full(len(seen.active), int(Move.KEEP))


def rules(seen: Observation) -> Moves:
    """Change lanes by fixed rules: where it is worth it, and UN R79's gap is there and to spare.

    It decides when it looks into the mirrors, and goes on signalling in between.
    """
    looks, stage = seen.of("looks") > 0, seen.of("stage")
    out = (stage == Stage.FOLLOW) & (seen.of("can_go_out") > 0) & (seen.of("since_change") >= REST)
    out &= np.where(looks, _wants_out(seen), seen.of("wanted") > 0)
    back = (stage == Stage.PASS) & (seen.of("can_go_back") > 0) & (seen.of("passed") > 0)
    clear = _is_free_ahead(seen, "slow_lead") & _is_free_behind(seen, "slow_rear", FORCED)
    back &= np.where(looks, clear, seen.of("wanted") < 0)
    now = (seen.of("signalled") >= SIGNAL) & looks & (seen.of("contested") == 0)
    move = np.where(out, np.where(now, Move.PULL_OUT, Move.SHOW_OUT), Move.KEEP)
    move = np.where(back, np.where(now, Move.RETURN, Move.SHOW_BACK), move)
    pulls = (stage == Stage.PULL_OUT) & (seen.of("can_abort") > 0) & looks
    gives_up = pulls & ~_is_free_behind(seen, "fast_rear", EMERGENCY)
    falls_in = seen.of("yields") > FITTING
    return np.where(gives_up | falls_in, Move.ABORT, move)


def _wants_out(seen: Observation) -> Mask:
    """Whether the leader is slow and near, and there is room beside it."""
    leader = seen.of("speed") - seen.of("closing", "lead")
    slow = seen.driver.desired_speed - leader > WORTH
    near = (seen.of("detected", "lead") > 0) & (seen.of("gap", "lead") < NEAR * seen.of("speed"))
    room = _is_free_ahead(seen, "fast_lead") & _is_free_behind(seen, "fast_rear", FORCED)
    two_way = seen.of("expected") > 0  # Where roads run one way nobody is expected.
    back = seen.of("room") > 2.0 * ROOM * leader + 2.0 * seen.driver.half_length
    lawful = (seen.of("sure") > 0) & (seen.of("solid") == 0) & back & _is_in_time(seen)
    return slow & near & room & (lawful | ~two_way)


def _is_in_time(seen: Observation) -> Mask:
    """Whether the ego would be past and back `MARGIN` before anybody can be met.

    Whom it does not see may come at the end of its sight, as fast as is usual.
    """
    closing = seen.of("closing", "lead")
    leader = seen.of("speed") - closing
    bodies = seen.of("length", "lead") + 2.0 * seen.driver.half_length
    way = seen.of("gap", "lead") + bodies + ROOM * leader
    gained = np.maximum(seen.driver.desired_speed - leader, WORTH)
    needed = way / gained + seen.driver.lane_change_duration
    comes = seen.of("detected", "oncoming") > 0
    free = np.minimum(np.where(comes, seen.of("gap", "oncoming"), np.inf), seen.of("sight"))
    speed = np.where(comes, seen.of("closing", "oncoming"), 0.0)
    return free > (needed + MARGIN) * np.maximum(speed, seen.of("expected"))


def _is_free_ahead(seen: Observation, role: str) -> Mask:
    """Whether a vehicle ahead in the new lane is far enough, or there is none."""
    wanted = ROOM * seen.of("speed") + NEAR * np.maximum(seen.of("closing", role), 0.0)
    return (seen.of("detected", role) == 0) | (seen.of("gap", role) > wanted)


def _is_free_behind(seen: Observation, role: str, most: float) -> Mask:
    """Whether whoever is behind in the new lane need not brake harder than so."""
    faster: F32 = np.maximum(seen.of("closing", role), 0.0)
    theirs = seen.of("speed") + seen.of("closing", role)
    room = ROOM if most == FORCED else 0.0
    wanted = 0.4 * faster + faster * faster / (2.0 * most) + np.maximum(room * theirs, 2.0)
    return (seen.of("detected", role) == 0) | (seen.of("gap", role) > wanted)
