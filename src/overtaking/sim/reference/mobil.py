"""Lane changes of everybody but the ego."""

import numpy as np

from overtaking.core.elementary import F32, Mask, minimum
from overtaking.model.vehicles import Role
from overtaking.sim.reference.following import follow, forced_braking
from overtaking.sim.reference.neighbours import lane_borders
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.state import (
    FAST_LEAD,
    FAST_REAR,
    LEAD,
    REAR,
    SLOW_LEAD,
    SLOW_REAR,
    Fields,
    State,
)
from overtaking.sim.reference.steering import begin_path
from overtaking.world.constants import Constants
from overtaking.world.parameters import Parameters


def is_due(c: Constants, decision: int) -> bool:
    """Whether lane changes are considered at a decision."""
    return decision % int(c.mobil_interval) == 0


def imposed(given: Parameters, p: Fields, speed: F32, gap: F32, closing: F32) -> F32:
    """Acceleration imposed on a follower, judged by the standard of the driver in front [m/s^2]."""
    return forced_braking(given.constants, p, speed + closing, gap, closing, p.time_gap)


def incentives(
    state: State, given: Parameters, p: Fields, believed: Beliefs, own: F32
) -> tuple[F32, F32]:
    """MOBIL's incentives to change to the fast and to the slow side [m/s^2].

    European rule: to the fast side only the new follower counts, to the slow side the old one;
    above 60 km/h nobody expects to be faster than the traffic on the fast side.

    Source:
        Kesting, Treiber, Helbing 2007, equations 10 to 13.
    """
    c = given.constants
    v, gap, closing = state.vx, believed.gap, believed.closing
    desired, time = p.desired_speed, p.time_gap
    fast = follow(c, p, v, desired, gap[FAST_LEAD], closing[FAST_LEAD], time)
    slow = follow(c, p, v, desired, gap[SLOW_LEAD], closing[SLOW_LEAD], time)
    no_passing = v > c.no_passing_right_speed
    here = np.where(no_passing, minimum(own, fast), own)
    there = np.where(no_passing, minimum(slow, own), slow)
    body = np.float32(2.0) * p.half_length
    after = imposed(given, p, v, gap[FAST_REAR], closing[FAST_REAR])
    open_gap = gap[FAST_REAR] + gap[FAST_LEAD] + body
    before = imposed(
        given, p, v - closing[FAST_LEAD], open_gap, closing[FAST_REAR] + closing[FAST_LEAD]
    )
    relieved_gap = gap[REAR] + gap[LEAD] + body
    now = imposed(given, p, v, gap[REAR], closing[REAR])
    relieved = imposed(given, p, v - closing[LEAD], relieved_gap, closing[REAR] + closing[LEAD])
    to_fast = fast - here + p.politeness * (after - before) - p.bias
    to_slow = there - own + p.politeness * (relieved - now) + p.bias
    return to_fast, to_slow


def is_safe(
    state: State, given: Parameters, p: Fields, believed: Beliefs, front: int, rear: int
) -> Mask:
    """Whether a lane change endangers neither the driver nor the new follower."""
    c = given.constants
    v, gap, closing = state.vx, believed.gap, believed.closing
    braking = imposed(given, p, v, gap[rear], closing[rear])
    own = forced_braking(c, p, v, gap[front], closing[front], p.time_gap)
    room = (gap[rear] > c.smallest_rear_gap) & (gap[front] > c.smallest_rear_gap)
    return room & (braking >= -p.safe_decel) & (own >= -p.safe_decel)


def change_lanes(state: State, given: Parameters, p: Fields, believed: Beliefs, own: F32) -> None:
    """Let everybody but the ego change lanes where it pays and is safe.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        believed: What drivers believe about their neighbours.
        own: Acceleration behind the present leader, (vehicle, simulation) [m/s^2].
    """
    to_fast, to_slow = incentives(state, given, p, believed, own)
    ready = _is_ready(state, given, p)
    has_fast = state.lane < np.float32(given.road.num_lanes - 1)
    has_slow = state.lane >= np.float32(1.0)
    safe_fast = is_safe(state, given, p, believed, FAST_LEAD, FAST_REAR)
    safe_slow = is_safe(state, given, p, believed, SLOW_LEAD, SLOW_REAR)
    # Who would have to pull out again soon stays; how fast a distant vehicle is, nobody can see.
    worth = believed.gap[SLOW_LEAD] > given.constants.free_ahead_time * state.vx
    fast = ready & has_fast & safe_fast & (to_fast > p.threshold)
    slow = ready & has_slow & safe_slow & (to_slow > p.threshold) & worth & ~fast
    wanted = _side(fast, slow)
    decided = decide(state, given, p, wanted)
    turn_to_lane(state, given, p, fast & decided, slow & decided)
    done = state.path_time >= state.path_duration
    shown = wanted * p.uses_indicator
    state.indicator[1:] = np.where(done[1:], shown[1:], state.indicator[1:])


def decide(state: State, given: Parameters, p: Fields, wanted: F32) -> Mask:
    """Who has wanted the same for as long as they signal, and so has looked; remembers it."""
    same = (wanted == state.wanted) & (wanted != 0)
    longer = state.wanted_time + given.constants.mobil_interval * given.constants.decision
    state.wanted_time = np.where(same, longer, np.float32(0.0))
    state.wanted = wanted
    return state.wanted_time >= p.signal_time


def _is_ready(state: State, given: Parameters, p: Fields) -> Mask:
    """Who may change lanes by MOBIL: everybody sound but the ego, a while after the last change."""
    arrived = state.path_time >= state.path_duration
    rested = state.since_change >= given.constants.cooldown
    ready = arrived & rested & (state.crashed == 0) & (p.valid > 0)
    ready[Role.EGO] = False
    return ready


def turn_to_lane(state: State, given: Parameters, p: Fields, fast: Mask, slow: Mask) -> None:
    """Begin a lane change of the masked vehicles, with the indicator where it is used."""
    step = _side(fast, slow)
    state.lane = state.lane + step
    low, high = lane_borders(state, given, 0.0)
    begin_path(state, fast | slow, np.float32(0.5) * (low + high), p.lane_change_duration)
    state.indicator = np.where(fast | slow, step * p.uses_indicator, state.indicator)


def _side(fast: Mask, slow: Mask) -> F32:
    """1 towards the fast side, -1 towards the slow side, 0 for neither."""
    one, zero = np.float32(1.0), np.float32(0.0)
    return np.where(fast, one, zero) - np.where(slow, one, zero)
