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
    params: StepParameters, vehicle: VehicleParameters, speed: F32, gap: F32, closing: F32
) -> F32:
    """Acceleration imposed on a follower, judged by the standard of the driver in front [m/s^2]."""
    return imposed_accel(params.constants, vehicle, speed + closing, gap, closing, vehicle.time_gap)


def mobil_incentives(
    params: StepParameters,
    vehicle: VehicleParameters,
    v: F32,
    beliefs: Beliefs,
    own: F32,
    most: F32 | np.float32 = NO_ACCEL_LIMIT,
) -> tuple[F32, F32]:
    """MOBIL's incentives to change to the fast and to the slow side [m/s^2].

    European rule: to the fast side only the new follower counts, to the slow side the old one;
    above 60 km/h no driver expects to be faster than the traffic on the fast side.

    Args:
        params: Parameters of the batch.
        vehicle: Driver parameters, of all vehicles or of one.
        v: Own speed [m/s].
        beliefs: What drivers believe about their neighbours.
        own: Acceleration behind the present leader [m/s^2].
        most: Acceleration that drivers do not go beyond, in whatever lane [m/s^2].

    Source:
        Kesting, Treiber, Helbing 2007, equations 10 to 13.
    """
    constants = params.constants
    gap, closing = beliefs.gap, beliefs.closing_speed
    desired, time = vehicle.desired_speed, vehicle.time_gap
    fast = minimum(
        acc_accel(constants, vehicle, v, desired, gap[LEFT_LEADER], closing[LEFT_LEADER], time),
        most,
    )
    slow = minimum(
        acc_accel(constants, vehicle, v, desired, gap[RIGHT_LEADER], closing[RIGHT_LEADER], time),
        most,
    )
    no_passing = v > constants.no_passing_right_speed
    here = np.where(no_passing, minimum(own, fast), own)
    there = np.where(no_passing, minimum(slow, own), slow)
    body = np.float32(2.0) * vehicle.half_length
    after = imposed_accel_on_follower(
        params, vehicle, v, gap[LEFT_FOLLOWER], closing[LEFT_FOLLOWER]
    )
    open_gap = gap[LEFT_FOLLOWER] + gap[LEFT_LEADER] + body
    before = imposed_accel_on_follower(
        params,
        vehicle,
        v - closing[LEFT_LEADER],
        open_gap,
        closing[LEFT_FOLLOWER] + closing[LEFT_LEADER],
    )
    relieved_gap = gap[FOLLOWER] + gap[LEADER] + body
    now = imposed_accel_on_follower(params, vehicle, v, gap[FOLLOWER], closing[FOLLOWER])
    relieved = imposed_accel_on_follower(
        params, vehicle, v - closing[LEADER], relieved_gap, closing[FOLLOWER] + closing[LEADER]
    )
    to_fast = fast - here + vehicle.politeness * (after - before) - vehicle.keep_right_bias
    to_slow = there - own + vehicle.politeness * (relieved - now) + vehicle.keep_right_bias
    return to_fast, to_slow


def is_safe_lane_change(
    params: StepParameters,
    vehicle: VehicleParameters,
    v: F32,
    beliefs: Beliefs,
    front: int,
    rear: int,
) -> Mask:
    """Whether a lane change endangers neither the driver nor the new follower, now and soon.

    Args:
        params: Parameters of the batch.
        vehicle: Driver parameters, of all vehicles or of one.
        v: Own speed [m/s].
        beliefs: What drivers believe about their neighbours.
        front: Role of the vehicle ahead in the new lane.
        rear: Role of the one behind.
    """
    constants = params.constants
    gap, closing = beliefs.gap, beliefs.closing_speed
    braking = minimum(
        imposed_accel_on_follower(params, vehicle, v, gap[rear], closing[rear]),
        imposed_accel_on_follower(
            params, vehicle, v, *anticipated_follower(params, gap[rear], closing[rear])
        ),
    )
    own = imposed_accel(constants, vehicle, v, gap[front], closing[front], vehicle.time_gap)
    room = (gap[rear] > constants.min_rear_gap) & (gap[front] > constants.min_rear_gap)
    return room & (braking >= -vehicle.safe_decel) & (own >= -vehicle.safe_decel)


def anticipated_follower(params: StepParameters, gap: F32, closing: F32) -> tuple[F32, F32]:
    """Gap [m] to a follower, and how fast it closes [m/s], if it speeds up for some seconds."""
    constants = params.constants
    faster = constants.foresight_accel * constants.foresight
    return gap - constants.foresight * (closing + np.float32(0.5) * faster), closing + faster


def change_lanes_by_mobil(
    state: State,
    params: StepParameters,
    beliefs: Beliefs,
    own: F32,
    checks_mirrors: Mask,
    decision_index: int,
) -> None:
    """Let the other vehicles change lanes where it pays and is safe, or back in danger.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        beliefs: What drivers believe about their neighbours.
        own: Acceleration behind the present leader, (vehicle, simulation) [m/s^2].
        checks_mirrors: Which drivers look around, (vehicle, simulation).
        decision_index: Number of the decision.
    """
    vehicles = params.vehicles
    claims = lane_claims(state)
    to_fast, to_slow = mobil_incentives(
        params, vehicles, state.motion.vx, beliefs, own, state.road.accel_limit
    )
    ready = checks_mirrors & _is_ready_for_lane_change(state, params)
    has_fast = state.lane_choice.lane < np.float32(params.road.num_lanes - 1)
    has_slow = state.lane_choice.lane >= np.float32(1.0)
    safe_fast = is_safe_lane_change(
        params, vehicles, state.motion.vx, beliefs, LEFT_LEADER, LEFT_FOLLOWER
    )
    safe_slow = is_safe_lane_change(
        params, vehicles, state.motion.vx, beliefs, RIGHT_LEADER, RIGHT_FOLLOWER
    )
    # A driver that would have to pull out again soon stays; it cannot see how fast a distant
    # vehicle is.
    worth = beliefs.gap[RIGHT_LEADER] > params.constants.free_ahead_time * state.motion.vx
    fast = ready & has_fast & safe_fast & (to_fast > vehicles.lane_change_threshold)
    slow = ready & has_slow & safe_slow & (to_slow > vehicles.lane_change_threshold) & worth & ~fast
    wanted = _signed_side(fast, slow)
    shows = checks_mirrors & (state.path.elapsed >= state.path.duration)
    shows[EGO_SLOT] = False
    state.controls.indicator = np.where(
        shows, wanted * vehicles.uses_indicator, state.controls.indicator
    )
    decided = update_wanted_side(state, params, wanted, checks_mirrors) & ~gives_way(
        state, params, wanted, claims
    )
    back, to_fast = _cancels_lane_change(state, params, beliefs)
    back = back & checks_mirrors
    fast, slow = (fast & decided) | (back & ~to_fast), (slow & decided) | (back & to_fast)
    start_lane_changes(state, params, (fast, slow, back), beliefs, decision_index)


def update_wanted_side(
    state: State, params: StepParameters, wanted: F32, checks_mirrors: Mask
) -> Mask:
    """Remember the wanted side; whether drivers have indicated it for long enough."""
    vehicles = params.vehicles
    same = (wanted == state.lane_choice.wanted_side) & (wanted != 0)
    others = checks_mirrors.copy()
    others[EGO_SLOT] = False
    restarts = others & ~same
    state.lane_choice.time_wanted = np.where(
        restarts, np.float32(0.0), state.lane_choice.time_wanted
    )
    state.lane_choice.wanted_side = np.where(others, wanted, state.lane_choice.wanted_side)
    return others & same & (state.lane_choice.time_wanted >= vehicles.indicator_lead_time)


def lane_claims(state: State) -> LaneClaims:
    """The lane of each vehicle, and the side that it indicates before it moves over."""
    waits = (state.path.elapsed >= state.path.duration) & (state.motion.is_wreck == 0)
    return state.lane_choice.lane.copy(), np.where(waits, state.controls.indicator, np.float32(0.0))


def gives_way(state: State, params: StepParameters, side: F32, claims: LaneClaims) -> Mask:
    """Whether another driver that indicates for the same gap from its other side goes first.

    The driver farther ahead goes first, and of two that are abreast the one that moves to the left.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        side: Where drivers want to go, as `Controls.indicator`, (vehicle, simulation).
        claims: `lane_claims` at the start of the decision.
    """
    constants = params.constants
    waits = np.zeros(state.motion.s.shape, bool)
    for lane, towards, place in zip(*claims, state.motion.s, strict=True):
        ahead = nearest_image(params, place - state.motion.s)
        same = (
            (towards == -side)
            & (lane == state.lane_choice.lane + np.float32(2.0) * side)
            & (side != 0)
        )
        close = np.abs(ahead) < constants.claim_time * state.motion.vx
        waits = waits | (same & close & ((ahead > 0) | ((ahead == 0) & (side < 0))))
    return waits


def lane_change_direction(state: State, params: StepParameters) -> tuple[Mask, Mask]:
    """Whether each lane change is to the left, and over a whole lane, not a cancelled one."""
    low, high = lane_borders(state, params, 0.0)
    half = np.float32(0.5)
    way = half * (low + high) - state.path.coefficients[0]
    return way > 0, np.abs(way) > half * (high - low)


def _cancels_lane_change(
    state: State, params: StepParameters, beliefs: Beliefs
) -> tuple[Mask, Mask]:
    """Whether drivers cancel a lane change that has turned dangerous, and whether to the left.

    A cancelled lane change is not cancelled again: otherwise vehicles cancelled back and forth
    until they left the road.
    """
    vehicles = params.vehicles
    constants = params.constants
    v, gap, closing = state.motion.vx, beliefs.gap, beliefs.closing_speed
    to_fast, whole = lane_change_direction(state, params)
    front, behind = (
        tuple(np.where(to_fast, values[slow], values[fast]) for values in (gap, closing))
        for slow, fast in ((RIGHT_LEADER, LEFT_LEADER), (RIGHT_FOLLOWER, LEFT_FOLLOWER))
    )
    bad_rear = imposed_accel_on_follower(params, vehicles, v, gap[FOLLOWER], closing[FOLLOWER]) < -(
        constants.abort_imposed_factor * vehicles.safe_decel
    )
    own = imposed_accel(constants, vehicles, v, gap[LEADER], closing[LEADER], vehicles.time_gap)
    bad_front = own < -(constants.abort_factor * vehicles.decel)
    back = cah_accel(constants, v, front[0], front[1], _STEADY)
    room = (back >= -vehicles.max_assumed_decel) & (behind[0] > constants.min_rear_gap)
    early = state.path.elapsed < constants.abort_until * state.path.duration
    sound = (state.motion.is_wreck == 0) & (vehicles.valid > 0)
    sound[EGO_SLOT] = False
    return (bad_rear | bad_front) & room & early & whole & sound, to_fast


def _is_ready_for_lane_change(state: State, params: StepParameters) -> Mask:
    """Which vehicles may change lanes by MOBIL: sound ones but the ego, a pause after the last."""
    vehicles = params.vehicles
    arrived = state.path.elapsed >= state.path.duration
    rested = state.lane_choice.time_since_lane_change >= params.constants.cooldown
    ready = arrived & rested & (state.motion.is_wreck == 0) & (vehicles.valid > 0)
    ready[EGO_SLOT] = False
    return ready


def start_lane_changes(
    state: State,
    params: StepParameters,
    sides: tuple[Mask, Mask, Mask],
    beliefs: Beliefs,
    decision_index: int,
    hasty: F32 | None = None,
) -> None:
    """Begin a lane change of the masked vehicles, with the indicator where it is used.

    It takes the driver's usual time, or less where the leader would be reached before.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        sides: Drivers who move to the left, to the right, and those of them who cancel a lane
            change and so have less far to go; each (vehicle, simulation).
        beliefs: What drivers believe of the leader.
        decision_index: Number of the decision.
        hasty: Duration of an urgent lane change, 0 for the usual one, (vehicle, simulation) [s].
    """
    vehicles = params.vehicles
    constants, (fast, slow, back) = params.constants, sides
    step, moved = _signed_side(fast, slow), fast | slow
    state.lane_choice.lane = state.lane_choice.lane + step
    low, high = lane_borders(state, params, 0.0)
    left = beliefs.gap[LEADER] / maximum(beliefs.closing_speed[LEADER], _MIN_SPEED)
    hurried = maximum(
        (left - constants.lane_clearance_time) / constants.lane_cleared_share,
        constants.min_lane_change_duration,
    )
    usual = minimum(vehicles.lane_change_duration, hurried)
    duration = np.where(back, constants.abort_duration_share * vehicles.lane_change_duration, usual)
    if hasty is not None:
        duration = np.where(hasty > 0, hasty, duration)
    start_path(state, moved, np.float32(0.5) * (low + high), duration)
    state.controls.indicator = np.where(
        moved, step * vehicles.uses_indicator, state.controls.indicator
    )
    state.lane_choice.wanted_side = np.where(moved, np.float32(0.0), state.lane_choice.wanted_side)
    draw_shoulder_check(state, params, moved, decision_index)


def _signed_side(fast: Mask, slow: Mask) -> F32:
    """1 towards the fast side, -1 towards the slow side, 0 for neither."""
    one, zero = np.float32(1.0), np.float32(0.0)
    return np.where(fast, one, zero) - np.where(slow, one, zero)
