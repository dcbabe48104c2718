"""Lane changes by MOBIL: incentives, safety, cancelling, and the start of a lane change.

MOBIL (Kesting, Treiber, Helbing 2007) weighs a driver's gain in acceleration against the loss of
its followers. On one-way roads all drivers but the ego decide by it. `start_lane_changes` starts
the lane changes of all drivers. Left is the overtaking side; lanes are numbered from the right.
During a lane change the driver's lane is the one that it enters, and its old lane the one that it
leaves. Beliefs about a neighbour that is not detected are a gap of 1000 m and a closing speed of 0.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, TWO, ZERO, maximum, minimum
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.car_following import (
    Follower,
    Leader,
    acc_accel,
    cah_accel,
    imposed_accel,
)
from overtaking.sim.reference.decision_context import Beliefs, DecisionContext
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
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters, VehicleParameters

# Keeps the time until a gap is closed finite. It matters only at gaps below about a metre [m/s].
_MIN_CLOSING_SPEED = np.float32(0.1)


class MobilIncentives(NamedTuple):
    """Gain in acceleration by a lane change, less the weighted loss of a follower [m/s^2]."""

    to_left: F32
    to_right: F32


class LaneClaims(NamedTuple):
    """Lanes that drivers claim by their indicators, (vehicle, simulation)."""

    lane: F32  # Lane in which the vehicle is.
    side: F32  # Side that it indicates before it moves over: 1 left, -1 right, 0 for neither.


class LaneChangeDirection(NamedTuple):
    """Direction of the lane change that is under way, or of the last one, (vehicle, simulation)."""

    is_to_left: Mask
    is_whole_lane: Mask  # Whether it crosses a whole lane; a cancelled lane change does not.


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneMoves:
    """Lane changes that start at a decision; arrays of shape (vehicle, simulation).

    Attributes:
        to_left: Whether the vehicle moves to the left.
        to_right: Whether it moves to the right.
        is_cancelled: Whether the move cancels a lane change, and so is shorter.
        urgent_duration: Duration of an urgent lane change, 0 for one of the usual duration; None
            if no change is urgent [s].
    """

    to_left: Mask
    to_right: Mask
    is_cancelled: Mask
    urgent_duration: F32 | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneChangeRisk:
    """Lane changes that are under way, as their drivers judge them.

    Attributes:
        vehicle: Parameters of the drivers and their vehicles.
        speed: Speed of the driver [m/s].
        time_gap: Time gap that it asks for, behind its leader and for its follower [s].
        acceptable_imposed_decel: Braking that it may impose on a follower when it starts a lane
            change, positive [m/s^2].
        leader: Leader in the new lane.
        follower_gap: Gap to the follower in the new lane [m].
        follower_closing_speed: Speed of that follower minus the driver's [m/s].
        old_leader: Leader in the old lane.
        old_follower_gap: Gap to the follower in the old lane [m].
    """

    vehicle: VehicleParameters
    speed: F32
    time_gap: F32
    acceptable_imposed_decel: F32
    leader: Leader
    follower_gap: F32
    follower_closing_speed: F32
    old_leader: Leader
    old_follower_gap: F32


def lane_change_is_dangerous(constants: ModelConstants, risk: LaneChangeRisk) -> Mask:
    """Whether the new lane has become dangerous, and the old one still has space.

    The limits are clearly above those for starting a lane change. The new lane is dangerous if its
    follower must brake harder than `abort_imposed_factor` times the acceptable braking, or if the
    driver must brake harder than `abort_factor` times its comfortable braking.

    Args:
        constants: Constants of the model.
        risk: The lane changes and the gaps around their drivers.

    Returns:
        True where the driver should go back; of the shape of the fields of `risk`.
    """
    vehicle, speed = risk.vehicle, risk.speed
    driver = Leader(gap=risk.follower_gap, closing_speed=risk.follower_closing_speed)
    follower_speed = speed + risk.follower_closing_speed
    follower_accel = imposed_accel(constants, vehicle, follower_speed, risk.time_gap, driver)
    max_imposed_decel = constants.abort_imposed_factor * risk.acceptable_imposed_decel
    endangers_follower = follower_accel < -max_imposed_decel
    accel = imposed_accel(constants, vehicle, speed, risk.time_gap, risk.leader)
    must_brake_hard = accel < -(constants.abort_factor * vehicle.decel)
    # Back in the old lane the driver only needs to avoid a contact with its old leader.
    old_leader_accel = cah_accel(constants, speed, risk.old_leader)
    can_brake = old_leader_accel >= -vehicle.max_assumed_decel
    has_space_behind = risk.old_follower_gap > constants.min_rear_gap
    return (endangers_follower | must_brake_hard) & can_brake & has_space_behind


def imposed_accel_on_follower(
    params: StepParameters, vehicle: VehicleParameters, speed: F32, gap: F32, closing_speed: F32
) -> F32:
    """Acceleration that a vehicle in front would impose on a follower, as a driver sees it [m/s^2].

    The driver assumes that the follower is like itself and keeps the same time gap.

    Args:
        params: Parameters of the batch.
        vehicle: Parameters of the driver that judges.
        speed: Speed of the vehicle in front, which may be the driver's own [m/s].
        gap: Gap from that vehicle to the follower [m].
        closing_speed: Speed of the follower minus `speed` [m/s].
    """
    front_vehicle = Leader(gap=gap, closing_speed=closing_speed)
    follower_speed = speed + closing_speed
    return imposed_accel(params.constants, vehicle, follower_speed, vehicle.time_gap, front_vehicle)


def mobil_incentives(
    params: StepParameters,
    driver: Follower,
    beliefs: Beliefs,
    accel: F32,
    accel_limit: F32 | np.float32 = NO_ACCEL_LIMIT,
) -> MobilIncentives:
    """MOBIL's incentives to change to the left and to the right [m/s^2].

    European rule: for a change to the left only the new follower counts, for a change to the right
    only the old one. Above `no_passing_right_speed`, 60 km/h, no driver passes on the right.

    Args:
        params: Parameters of the batch.
        driver: The drivers, of all vehicles or of one.
        beliefs: Beliefs of the drivers about their neighbours.
        accel: Acceleration behind the present leader [m/s^2].
        accel_limit: Largest acceleration in any lane, for a lower speed limit ahead [m/s^2].

    Source:
        Kesting, Treiber, Helbing 2007, equations 10 to 13.
    """
    constants, vehicle, speed = params.constants, driver.vehicle, driver.speed
    gap, closing_speed = beliefs.gap, beliefs.closing_speed

    def accel_behind(role: int) -> F32:
        leader = Leader(gap=gap[role], closing_speed=closing_speed[role])
        return minimum(acc_accel(constants, driver, leader), accel_limit)

    accel_left, accel_right = accel_behind(LEFT_LEADER), accel_behind(RIGHT_LEADER)
    # A driver that never passes on the right accelerates no more than the next lane on its left
    # allows. The left lane limits the acceleration in the present lane, and the present lane limits
    # the acceleration in the right lane.
    never_passes_right = speed > constants.no_passing_right_speed
    reference_accel = np.where(never_passes_right, minimum(accel, accel_left), accel)
    accel_right = np.where(never_passes_right, minimum(accel_right, accel), accel_right)
    length = TWO * vehicle.half_length
    # The new follower is behind the left leader now, and behind the driver after the change.
    follower_gap, follower_closing = gap[LEFT_FOLLOWER], closing_speed[LEFT_FOLLOWER]
    new_follower_accel_after = imposed_accel_on_follower(
        params, vehicle, speed, follower_gap, follower_closing
    )
    new_follower_accel_now = imposed_accel_on_follower(
        params,
        vehicle,
        speed - closing_speed[LEFT_LEADER],
        follower_gap + gap[LEFT_LEADER] + length,
        follower_closing + closing_speed[LEFT_LEADER],
    )
    # The old follower is behind the driver now, and behind the driver's leader after the change.
    old_follower_gap_after = gap[FOLLOWER] + gap[LEADER] + length
    old_follower_accel_now = imposed_accel_on_follower(
        params, vehicle, speed, gap[FOLLOWER], closing_speed[FOLLOWER]
    )
    old_follower_accel_after = imposed_accel_on_follower(
        params,
        vehicle,
        speed - closing_speed[LEADER],
        old_follower_gap_after,
        closing_speed[FOLLOWER] + closing_speed[LEADER],
    )
    new_follower_change = new_follower_accel_after - new_follower_accel_now
    old_follower_change = old_follower_accel_after - old_follower_accel_now
    to_left = accel_left - reference_accel + vehicle.politeness * new_follower_change
    to_right = accel_right - accel + vehicle.politeness * old_follower_change
    return MobilIncentives(to_left - vehicle.keep_right_bias, to_right + vehicle.keep_right_bias)


def is_safe_lane_change(
    params: StepParameters, driver: Follower, beliefs: Beliefs, leader_role: int
) -> Mask:
    """Whether a lane change endangers neither the driver nor the new follower.

    The new follower is judged as it is now, and as `anticipated_follower` expects it.

    Args:
        params: Parameters of the batch.
        driver: The drivers, of all vehicles or of one.
        beliefs: Beliefs of the drivers about their neighbours.
        leader_role: Role of the leader in the new lane. The follower there has the next number.
    """
    constants, vehicle, speed = params.constants, driver.vehicle, driver.speed
    gap, closing_speed = beliefs.gap[leader_role], beliefs.closing_speed[leader_role]
    rear_gap, rear_closing_speed = (
        beliefs.gap[leader_role + 1],
        beliefs.closing_speed[leader_role + 1],
    )
    rear_accel_now = imposed_accel_on_follower(params, vehicle, speed, rear_gap, rear_closing_speed)
    rear_accel_soon = imposed_accel_on_follower(
        params, vehicle, speed, *anticipated_follower(params, rear_gap, rear_closing_speed)
    )
    leader = Leader(gap=gap, closing_speed=closing_speed)
    accel = imposed_accel(constants, vehicle, speed, vehicle.time_gap, leader)
    # `min_rear_gap` is the least gap to the follower, and in this model also to the leader.
    has_space = (rear_gap > constants.min_rear_gap) & (gap > constants.min_rear_gap)
    is_safe_for_follower = minimum(rear_accel_now, rear_accel_soon) >= -vehicle.safe_decel
    return has_space & is_safe_for_follower & (accel >= -vehicle.safe_decel)


def anticipated_follower(params: StepParameters, gap: F32, closing_speed: F32) -> tuple[F32, F32]:
    """Gap [m] and closing speed [m/s] of a follower after it has accelerated for `foresight`.

    In this time, 2 s, the follower cannot react yet to a driver that starts to change lanes.
    """
    constants = params.constants
    speed_gain = constants.foresight_accel * constants.foresight
    later_gap = gap - constants.foresight * (closing_speed + HALF * speed_gain)
    return later_gap, closing_speed + speed_gain


def change_lanes_by_mobil(
    state: State, params: StepParameters, context: DecisionContext, accel: F32
) -> None:
    """Let all drivers but the ego change lanes where it pays and is safe, or cancel in danger.

    Args:
        state: `controls.indicator`, `lane_choice` and `path` change.
        params: Parameters of the batch.
        context: Perception of the drivers at this decision.
        accel: Acceleration behind the present leader, (vehicle, simulation) [m/s^2].
    """
    vehicles, beliefs, choice = params.vehicles, context.beliefs, state.lane_choice
    checks_mirrors = context.checks_mirrors
    # Claims from before any indicator changes at this decision: all drivers decide by the same.
    claims = lane_claims(state)
    driver = Follower(
        vehicle=vehicles,
        speed=state.motion.vx,
        desired_speed=vehicles.desired_speed,
        time_gap=vehicles.time_gap,
    )
    incentives = mobil_incentives(params, driver, beliefs, accel, state.road.accel_limit)
    can_change = checks_mirrors & _is_ready_for_lane_change(state, params)
    has_left_lane = choice.lane < np.float32(params.road.num_lanes - 1)
    has_right_lane = choice.lane >= ONE
    is_safe_left = is_safe_lane_change(params, driver, beliefs, LEFT_LEADER)
    is_safe_right = is_safe_lane_change(params, driver, beliefs, RIGHT_LEADER)
    # The right lane must be free far ahead, or the driver would soon have to pull out again. Speeds
    # do not count, because a driver cannot judge the speed of a distant vehicle.
    is_free_ahead = beliefs.gap[RIGHT_LEADER] > params.constants.free_ahead_time * state.motion.vx
    pays_left = incentives.to_left > vehicles.lane_change_threshold
    pays_right = incentives.to_right > vehicles.lane_change_threshold
    to_left = can_change & has_left_lane & is_safe_left & pays_left
    to_right = can_change & has_right_lane & is_safe_right & pays_right & is_free_ahead & ~to_left
    side = _signed_side(to_left, to_right)
    sets_indicator = checks_mirrors & (state.path.elapsed >= state.path.duration)
    sets_indicator[EGO_SLOT] = False
    state.controls.indicator = np.where(
        sets_indicator, side * vehicles.uses_indicator, state.controls.indicator
    )
    starts = update_wanted_side(state, params, side, checks_mirrors) & ~gives_way(
        state, params, side, claims
    )
    direction = lane_change_direction(state, params)
    cancels = checks_mirrors & _cancels_lane_change(state, params, beliefs, direction)
    # A cancelled lane change goes back, to the other side.
    moves = LaneMoves(
        to_left=(to_left & starts) | (cancels & ~direction.is_to_left),
        to_right=(to_right & starts) | (cancels & direction.is_to_left),
        is_cancelled=cancels,
    )
    start_lane_changes(state, params, context, moves)


def update_wanted_side(
    state: State, params: StepParameters, side: F32, checks_mirrors: Mask
) -> Mask:
    """Store the wanted side; return whether drivers have wanted it for their indicator lead time.

    Args:
        state: Its `lane_choice` changes.
        params: Parameters of the batch.
        side: Side of the wanted lane change: 1 left, -1 right, 0 for neither.
        checks_mirrors: Whether drivers check their mirrors now; the others keep their side.
    """
    # `simulation.perceive` adds the time between decisions to `time_wanted`.
    choice = state.lane_choice
    is_unchanged = (side == choice.wanted_side) & (side != 0)
    decides = checks_mirrors.copy()
    decides[EGO_SLOT] = False
    choice.time_wanted = np.where(decides & ~is_unchanged, ZERO, choice.time_wanted)
    choice.wanted_side = np.where(decides, side, choice.wanted_side)
    return decides & is_unchanged & (choice.time_wanted >= params.vehicles.indicator_lead_time)


def lane_claims(state: State) -> LaneClaims:
    """The lane of each vehicle, and the side that it indicates before it moves over."""
    keeps_lane = (state.path.elapsed >= state.path.duration) & (state.motion.is_wreck == 0)
    side = np.where(keeps_lane, state.controls.indicator, ZERO)
    return LaneClaims(lane=state.lane_choice.lane.copy(), side=side)


def gives_way(state: State, params: StepParameters, side: F32, claims: LaneClaims) -> Mask:
    """Whether a driver beyond the wanted lane that indicates into this lane as well goes first.

    The driver farther ahead goes first, and of two that are abreast the one that moves to the left
    (a choice of this model).

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        side: Side to which drivers want to move: 1 left, -1 right, 0 for neither, (vehicle,
            simulation).
        claims: `lane_claims` at the start of the decision.
    """
    max_distance = params.constants.claim_time * state.motion.vx
    # Another driver wants the same lane if it is two lanes away and moves towards this driver.
    lane_beyond = state.lane_choice.lane + TWO * side
    must_wait = np.zeros(state.motion.s.shape, bool)
    for other_lane, other_side, other_s in zip(*claims, state.motion.s, strict=True):
        distance_ahead = nearest_image(params, other_s - state.motion.s)
        wants_same_lane = (other_side == -side) & (other_lane == lane_beyond) & (side != 0)
        is_close = np.abs(distance_ahead) < max_distance
        goes_first = (distance_ahead > 0) | ((distance_ahead == 0) & (side < 0))
        must_wait = must_wait | (wants_same_lane & is_close & goes_first)
    return must_wait


def lane_change_direction(state: State, params: StepParameters) -> LaneChangeDirection:
    """Direction of the last lane change, and whether it crosses a whole lane."""
    right_edge, left_edge = lane_borders(state, params, offset=0.0)
    # `coefficients[0]` is the lateral position at which the path began.
    distance = HALF * (right_edge + left_edge) - state.path.coefficients[0]
    return LaneChangeDirection(
        is_to_left=distance > 0, is_whole_lane=np.abs(distance) > HALF * (left_edge - right_edge)
    )


def _cancels_lane_change(
    state: State, params: StepParameters, beliefs: Beliefs, direction: LaneChangeDirection
) -> Mask:
    """Whether drivers cancel a lane change that has become dangerous.

    No driver cancels the way back of a cancelled lane change. Without this rule vehicles swung
    back and forth until they left the road.
    """
    vehicles, constants = params.vehicles, params.constants
    gap, closing_speed = beliefs.gap, beliefs.closing_speed
    # After a change to the left, the old lane is the one on the right.
    old_leader_gap, old_leader_closing_speed = (
        np.where(direction.is_to_left, values[RIGHT_LEADER], values[LEFT_LEADER])
        for values in (gap, closing_speed)
    )
    old_follower_gap = np.where(direction.is_to_left, gap[RIGHT_FOLLOWER], gap[LEFT_FOLLOWER])
    risk = LaneChangeRisk(
        vehicle=vehicles,
        speed=state.motion.vx,
        time_gap=vehicles.time_gap,
        acceptable_imposed_decel=vehicles.safe_decel,
        leader=Leader(gap=gap[LEADER], closing_speed=closing_speed[LEADER]),
        follower_gap=gap[FOLLOWER],
        follower_closing_speed=closing_speed[FOLLOWER],
        old_leader=Leader(gap=old_leader_gap, closing_speed=old_leader_closing_speed),
        old_follower_gap=old_follower_gap,
    )
    is_dangerous = lane_change_is_dangerous(constants, risk)
    # After `abort_until`, half of its duration, a lane change is completed sooner than undone.
    is_early = state.path.elapsed < constants.abort_until * state.path.duration
    has_mobil_driver = (state.motion.is_wreck == 0) & (vehicles.valid > 0)
    has_mobil_driver[EGO_SLOT] = False
    return is_dangerous & is_early & direction.is_whole_lane & has_mobil_driver


def _is_ready_for_lane_change(state: State, params: StepParameters) -> Mask:
    """Whether MOBIL drivers may change lanes: the pause after their last lane change is over."""
    has_finished = state.path.elapsed >= state.path.duration
    has_paused = state.lane_choice.time_since_lane_change >= params.constants.cooldown
    is_sound = state.motion.is_wreck == 0
    is_ready = has_finished & has_paused & is_sound & (params.vehicles.valid > 0)
    is_ready[EGO_SLOT] = False
    return is_ready


def start_lane_changes(
    state: State, params: StepParameters, context: DecisionContext, moves: LaneMoves
) -> None:
    """Start lane changes, with the indicator of drivers that use it.

    A lane change takes the driver's usual time, or less if the vehicle would reach its old leader
    before it has left the old lane.
    """
    vehicles, constants, choice = params.vehicles, params.constants, state.lane_choice
    beliefs = context.beliefs
    lane_step, is_moving = (
        _signed_side(moves.to_left, moves.to_right),
        moves.to_left | moves.to_right,
    )
    choice.lane = choice.lane + lane_step
    right_edge, left_edge = lane_borders(state, params, offset=0.0)
    # The beliefs are from before the lane change: `LEADER` is the leader in the old lane.
    time_to_old_leader = beliefs.gap[LEADER] / maximum(
        beliefs.closing_speed[LEADER], _MIN_CLOSING_SPEED
    )
    # The vehicle leaves the old lane at `lane_cleared_share` of the duration. This must be
    # `lane_clearance_time` before it would reach the old leader.
    shortened_duration = maximum(
        (time_to_old_leader - constants.lane_clearance_time) / constants.lane_cleared_share,
        constants.min_lane_change_duration,
    )
    duration = np.where(
        moves.is_cancelled,
        constants.abort_duration_share * vehicles.lane_change_duration,
        minimum(vehicles.lane_change_duration, shortened_duration),
    )
    if moves.urgent_duration is not None:
        duration = np.where(moves.urgent_duration > 0, moves.urgent_duration, duration)
    start_path(state, is_moving, HALF * (right_edge + left_edge), duration)
    state.controls.indicator = np.where(
        is_moving, lane_step * vehicles.uses_indicator, state.controls.indicator
    )
    choice.wanted_side = np.where(is_moving, ZERO, choice.wanted_side)
    # Draws whether the driver will look over its shoulder before its next lane change.
    draw_shoulder_check(state, params, is_moving, context.decision_index)


def _signed_side(to_left: Mask, to_right: Mask) -> F32:
    """1 to the left, -1 to the right, 0 for neither."""
    return np.where(to_left, ONE, ZERO) - np.where(to_right, ONE, ZERO)
