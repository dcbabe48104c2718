"""Lane changes of the other vehicles."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import maximum, minimum
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.car_following import acc_accel, cah_accel, imposed_accel
from overtaking.sim.reference.decision_context import Beliefs
from overtaking.sim.reference.neighbour_search import lane_borders, nearest_image
from overtaking.sim.reference.perception import draw_shoulder_check
from overtaking.sim.reference.state import (
    FOLLOWER,
    LEADER,
    LEFT_FOLLOWER,
    LEFT_LEADER,
    NO_ACCEL_LIMIT,
    RIGHT_FOLLOWER,
    RIGHT_LEADER,
    State,
)
from overtaking.sim.reference.steering import start_path
from overtaking.world.step_parameters import StepParameters, VehicleParameters

_STEADY = np.float32(0.0)


_MIN_SPEED = np.float32(0.1)  # Keeps the time until a gap is closed finite [m/s].


LaneClaims = tuple[F32, F32]
"""Lanes and sides, each (vehicle, simulation), of `claimed`."""


def imposed_accel_on_follower(
    given: StepParameters, p: VehicleParameters, speed: F32, gap: F32, closing: F32
) -> F32:
    """Acceleration imposed on a follower, judged by the standard of the driver in front [m/s^2]."""
    return imposed_accel(given.constants, p, speed + closing, gap, closing, p.time_gap)


def mobil_incentives(
    given: StepParameters,
    p: VehicleParameters,
    v: F32,
    believed: Beliefs,
    own: F32,
    most: F32 | np.float32 = NO_ACCEL_LIMIT,
) -> tuple[F32, F32]:
    """MOBIL's incentives to change to the fast and to the slow side [m/s^2].

    European rule: to the fast side only the new follower counts, to the slow side the old one;
    above 60 km/h no driver expects to be faster than the traffic on the fast side.

    Args:
        given: All inputs.
        p: Driver parameters, of all vehicles or of one.
        v: Own speed [m/s].
        believed: What drivers believe about their neighbours.
        own: Acceleration behind the present leader [m/s^2].
        most: Acceleration that drivers do not go beyond, in whatever lane [m/s^2].

    Source:
        Kesting, Treiber, Helbing 2007, equations 10 to 13.
    """
    c = given.constants
    gap, closing = believed.gap, believed.closing_speed
    desired, time = p.desired_speed, p.time_gap
    fast = minimum(acc_accel(c, p, v, desired, gap[LEFT_LEADER], closing[LEFT_LEADER], time), most)
    slow = minimum(
        acc_accel(c, p, v, desired, gap[RIGHT_LEADER], closing[RIGHT_LEADER], time), most
    )
    no_passing = v > c.no_passing_right_speed
    here = np.where(no_passing, minimum(own, fast), own)
    there = np.where(no_passing, minimum(slow, own), slow)
    body = np.float32(2.0) * p.half_length
    after = imposed_accel_on_follower(given, p, v, gap[LEFT_FOLLOWER], closing[LEFT_FOLLOWER])
    open_gap = gap[LEFT_FOLLOWER] + gap[LEFT_LEADER] + body
    before = imposed_accel_on_follower(
        given, p, v - closing[LEFT_LEADER], open_gap, closing[LEFT_FOLLOWER] + closing[LEFT_LEADER]
    )
    relieved_gap = gap[FOLLOWER] + gap[LEADER] + body
    now = imposed_accel_on_follower(given, p, v, gap[FOLLOWER], closing[FOLLOWER])
    relieved = imposed_accel_on_follower(
        given, p, v - closing[LEADER], relieved_gap, closing[FOLLOWER] + closing[LEADER]
    )
    to_fast = fast - here + p.politeness * (after - before) - p.keep_right_bias
    to_slow = there - own + p.politeness * (relieved - now) + p.keep_right_bias
    return to_fast, to_slow


def is_safe_lane_change(
    given: StepParameters, p: VehicleParameters, v: F32, believed: Beliefs, front: int, rear: int
) -> Mask:
    """Whether a lane change endangers neither the driver nor the new follower, now and soon.

    Args:
        given: All inputs.
        p: Driver parameters, of all vehicles or of one.
        v: Own speed [m/s].
        believed: What drivers believe about their neighbours.
        front: Role of the vehicle ahead in the new lane.
        rear: Role of the one behind.
    """
    c = given.constants
    gap, closing = believed.gap, believed.closing_speed
    braking = minimum(
        imposed_accel_on_follower(given, p, v, gap[rear], closing[rear]),
        imposed_accel_on_follower(
            given, p, v, *anticipated_follower(given, gap[rear], closing[rear])
        ),
    )
    own = imposed_accel(c, p, v, gap[front], closing[front], p.time_gap)
    room = (gap[rear] > c.min_rear_gap) & (gap[front] > c.min_rear_gap)
    return room & (braking >= -p.safe_decel) & (own >= -p.safe_decel)


def anticipated_follower(given: StepParameters, gap: F32, closing: F32) -> tuple[F32, F32]:
    """Gap [m] to a follower, and how fast it closes [m/s], if it speeds up for some seconds."""
    c = given.constants
    faster = c.foresight_accel * c.foresight
    return gap - c.foresight * (closing + np.float32(0.5) * faster), closing + faster


def change_lanes_by_mobil(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    believed: Beliefs,
    own: F32,
    looks: Mask,
    decision: int,
) -> None:
    """Let the other vehicles change lanes where it pays and is safe, or back in danger.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        believed: What drivers believe about their neighbours.
        own: Acceleration behind the present leader, (vehicle, simulation) [m/s^2].
        looks: Which drivers look around, (vehicle, simulation).
        decision: Number of the decision.
    """
    claims = lane_claims(state)
    to_fast, to_slow = mobil_incentives(given, p, state.vx, believed, own, state.most_accel)
    ready = looks & _is_ready_for_lane_change(state, given, p)
    has_fast = state.lane < np.float32(given.road.num_lanes - 1)
    has_slow = state.lane >= np.float32(1.0)
    safe_fast = is_safe_lane_change(given, p, state.vx, believed, LEFT_LEADER, LEFT_FOLLOWER)
    safe_slow = is_safe_lane_change(given, p, state.vx, believed, RIGHT_LEADER, RIGHT_FOLLOWER)
    # Who would have to pull out again soon stays; how fast a distant vehicle is, nobody can see.
    worth = believed.gap[RIGHT_LEADER] > given.constants.free_ahead_time * state.vx
    fast = ready & has_fast & safe_fast & (to_fast > p.lane_change_threshold)
    slow = ready & has_slow & safe_slow & (to_slow > p.lane_change_threshold) & worth & ~fast
    wanted = _signed_side(fast, slow)
    shows = looks & (state.path_time >= state.path_duration)
    shows[EGO_SLOT] = False
    state.indicator = np.where(shows, wanted * p.uses_indicator, state.indicator)
    decided = update_wanted_side(state, p, wanted, looks) & ~gives_way(state, given, wanted, claims)
    back, to_fast = _cancels_lane_change(state, given, p, believed)
    back = back & looks
    fast, slow = (fast & decided) | (back & ~to_fast), (slow & decided) | (back & to_fast)
    start_lane_changes(state, given, p, (fast, slow, back), believed, decision)


def update_wanted_side(state: State, p: VehicleParameters, wanted: F32, looks: Mask) -> Mask:
    """Who has wanted the same for as long as they signal; remembers what is wanted."""
    same = (wanted == state.wanted) & (wanted != 0)
    others = looks.copy()
    others[EGO_SLOT] = False
    restarts = others & ~same
    state.wanted_time = np.where(restarts, np.float32(0.0), state.wanted_time)
    state.wanted = np.where(others, wanted, state.wanted)
    return others & same & (state.wanted_time >= p.indicator_lead_time)


def lane_claims(state: State) -> LaneClaims:
    """The lane of each vehicle, and to which side it signals without moving over yet."""
    waits = (state.path_time >= state.path_duration) & (state.crashed == 0)
    return state.lane.copy(), np.where(waits, state.indicator, np.float32(0.0))


def gives_way(state: State, given: StepParameters, side: F32, claims: LaneClaims) -> Mask:
    """Who lets somebody first who signals for the same place from the other side of it.

    That is who is farther ahead, or moves to the fast side where nobody is.

    Args:
        state: State at a decision.
        given: All inputs.
        side: Where drivers want to go, as `State.indicator`, (vehicle, simulation).
        claims: `claimed` at the begin of the decision.
    """
    c = given.constants
    waits = np.zeros(state.s.shape, bool)
    for lane, towards, place in zip(*claims, state.s, strict=True):
        ahead = nearest_image(given, place - state.s)
        same = (towards == -side) & (lane == state.lane + np.float32(2.0) * side) & (side != 0)
        close = np.abs(ahead) < c.claim_time * state.vx
        waits = waits | (same & close & ((ahead > 0) | ((ahead == 0) & (side < 0))))
    return waits


def lane_change_direction(state: State, given: StepParameters) -> tuple[Mask, Mask]:
    """Whether each lane change is to the fast side, and whole: a retreat has less far to go."""
    low, high = lane_borders(state, given, 0.0)
    half = np.float32(0.5)
    way = half * (low + high) - state.path[0]
    return way > 0, np.abs(way) > half * (high - low)


def _cancels_lane_change(
    state: State, given: StepParameters, p: VehicleParameters, believed: Beliefs
) -> tuple[Mask, Mask]:
    """Who gives up a lane change that has turned dangerous, and whether it is to the fast side."""
    c = given.constants
    v, gap, closing = state.vx, believed.gap, believed.closing_speed
    to_fast, whole = lane_change_direction(state, given)
    front, behind = (
        tuple(np.where(to_fast, values[slow], values[fast]) for values in (gap, closing))
        for slow, fast in ((RIGHT_LEADER, LEFT_LEADER), (RIGHT_FOLLOWER, LEFT_FOLLOWER))
    )
    bad_rear = imposed_accel_on_follower(given, p, v, gap[FOLLOWER], closing[FOLLOWER]) < -(
        c.abort_imposed_factor * p.safe_decel
    )
    own = imposed_accel(c, p, v, gap[LEADER], closing[LEADER], p.time_gap)
    bad_front = own < -(c.abort_factor * p.decel)
    back = cah_accel(c, v, front[0], front[1], _STEADY)
    room = (back >= -p.max_assumed_decel) & (behind[0] > c.min_rear_gap)
    early = state.path_time < c.abort_until * state.path_duration
    sound = (state.crashed == 0) & (p.valid > 0)
    sound[EGO_SLOT] = False
    return (bad_rear | bad_front) & room & early & whole & sound, to_fast


def _is_ready_for_lane_change(state: State, given: StepParameters, p: VehicleParameters) -> Mask:
    """Which vehicles may change lanes by MOBIL: sound ones but the ego, a pause after the last."""
    arrived = state.path_time >= state.path_duration
    rested = state.since_change >= given.constants.cooldown
    ready = arrived & rested & (state.crashed == 0) & (p.valid > 0)
    ready[EGO_SLOT] = False
    return ready


def start_lane_changes(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    sides: tuple[Mask, Mask, Mask],
    believed: Beliefs,
    decision: int,
    hasty: F32 | None = None,
) -> None:
    """Begin a lane change of the masked vehicles, with the indicator where it is used.

    It takes the driver's usual time, or less where the leader would be reached before.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        sides: Who moves to the fast side, who to the slow side, and who of them breaks off a lane
            change and so has less far to go; each (vehicle, simulation).
        believed: What drivers believe of the leader.
        decision: Number of the decision.
        hasty: How long it takes who is in a hurry, 0 for who is not, (vehicle, simulation) [s].
    """
    c, (fast, slow, back) = given.constants, sides
    step, moved = _signed_side(fast, slow), fast | slow
    state.lane = state.lane + step
    low, high = lane_borders(state, given, 0.0)
    left = believed.gap[LEADER] / maximum(believed.closing_speed[LEADER], _MIN_SPEED)
    hurried = maximum(
        (left - c.lane_clearance_time) / c.lane_cleared_share, c.min_lane_change_duration
    )
    usual = minimum(p.lane_change_duration, hurried)
    duration = np.where(back, c.abort_duration_share * p.lane_change_duration, usual)
    if hasty is not None:
        duration = np.where(hasty > 0, hasty, duration)
    start_path(state, moved, np.float32(0.5) * (low + high), duration)
    state.indicator = np.where(moved, step * p.uses_indicator, state.indicator)
    state.wanted = np.where(moved, np.float32(0.0), state.wanted)
    draw_shoulder_check(state, given, p, moved, decision)


def _signed_side(fast: Mask, slow: Mask) -> F32:
    """1 towards the fast side, -1 towards the slow side, 0 for neither."""
    one, zero = np.float32(1.0), np.float32(0.0)
    return np.where(fast, one, zero) - np.where(slow, one, zero)
