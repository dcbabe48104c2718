"""Acceleration that each driver requests until the next decision."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, TWO, ZERO, clamp, maximum, minimum
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.car_following import Follower, Leader, acc_accel
from overtaking.sim.reference.decision_context import (
    DecisionContext,
    OncomingTraffic,
    OncomingVehicle,
)
from overtaking.sim.reference.neighbour_search import lane_borders
from overtaking.sim.reference.passing import current_passing_speed, tall_vehicle_gap_factor
from overtaking.sim.reference.state import (
    LEADER,
    LEFT_LEADER,
    NO_ACCEL_LIMIT,
    RIGHT_LEADER,
    State,
    value_at_slot,
)
from overtaking.sim.reference.steering import start_path
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters

_MIN_CLOSING_SPEED = np.float32(0.1)  # Keeps the time until vehicles meet finite [m/s].
_MIN_MEETING_TIME = np.float32(0.1)  # Keeps the braking finite right before vehicles meet [s].


def accel_behind_leader(state: State, params: StepParameters, context: DecisionContext) -> F32:
    """Acceleration behind the leader of the lane that is driven in or entered [m/s^2]."""
    vehicles, constants, beliefs = params.vehicles, params.constants, context.beliefs
    follower = Follower(
        vehicle=vehicles,
        speed=state.motion.vx,
        desired_speed=_current_desired_speed(state, params, context.oncoming),
        time_gap=_kept_time_gap(state, params, context),
    )
    leader = Leader(
        gap=beliefs.gap[LEADER],
        closing_speed=beliefs.closing_speed[LEADER],
        accel=beliefs.accel[LEADER],
    )
    accel = acc_accel(constants, follower, leader)
    is_passing = state.is_before_return(slice(None))
    accel = np.where(is_passing, accel, minimum(accel, state.road.accel_limit))
    # A passing driver uses more of the engine than in everyday driving.
    factor = np.where(
        state.overtake.must_return_urgently > 0,
        constants.urgent_accel_factor,
        constants.accelerate_gain,
    )
    return accel * np.where(is_passing & (accel > 0), factor, ONE)


def _kept_time_gap(state: State, params: StepParameters, context: DecisionContext) -> F32:
    """Time gap that drivers keep: shorter before a pull-out, longer behind a tall leader [s]."""
    constants, time_gap = params.constants, params.vehicles.time_gap
    follows = state.overtake.stage == np.float32(Stage.FOLLOW)
    is_about_to_pull_out = (state.overtake.time_indicating > 0) & follows
    kept_time_gap = np.where(
        is_about_to_pull_out, constants.signalling_time_gap * time_gap, time_gap
    )
    if not params.road.has_oncoming_traffic:
        return kept_time_gap
    factor = tall_vehicle_gap_factor(params, context.neighbours.slot[LEADER])
    return np.where(follows, kept_time_gap * factor, kept_time_gap)


def _current_desired_speed(
    state: State, params: StepParameters, oncoming: OncomingTraffic | None
) -> F32:
    """Speed that drivers want now, also while they pass or are passed, and in bends [m/s]."""
    vehicles = params.vehicles
    desired_speed, passing_speed = vehicles.desired_speed, vehicles.passing_speed
    if oncoming is not None:
        passing_speed = current_passing_speed(state, params)
        desired_speed = np.where(
            oncoming.is_being_passed,
            desired_speed * vehicles.speed_factor_when_passed,
            desired_speed,
        )
    is_passing = state.is_before_return(slice(None))
    return minimum(np.where(is_passing, passing_speed, desired_speed), state.road.bend_speed)


def accel_behind_old_leader(state: State, params: StepParameters, context: DecisionContext) -> F32:
    """Acceleration behind the leader of the lane that is left, until the bodies are clear [m/s^2].

    The driver brakes so that the gap lasts until its body has left the lane, with a margin of time,
    and no harder than behind a leader in its own lane.
    """
    vehicles, constants = params.vehicles, params.constants
    neighbours, beliefs = context.neighbours, context.beliefs
    lane_centre = HALF * (neighbours.lane_right_edge + neighbours.lane_left_edge)
    moves_left = lane_centre > state.motion.d

    def of_old_leader(values: F32) -> F32:
        return np.where(moves_left, values[RIGHT_LEADER], values[LEFT_LEADER])

    slot = of_old_leader(neighbours.slot)
    lateral_distance = np.abs(of_old_leader(neighbours.lateral_distance))
    leader = Leader(
        gap=of_old_leader(beliefs.gap),
        closing_speed=of_old_leader(beliefs.closing_speed),
        accel=of_old_leader(beliefs.accel),
    )
    half_widths = vehicles.half_width + value_at_slot(vehicles.half_width, slot)
    bodies_overlap = lateral_distance < half_widths + constants.footprint_margin
    # At 0.6 of its duration the path has moved by more than a car's width. The margin covers
    # misjudged distances: at night the belief is off by a fifth and more, and the leader was hit.
    time_to_clear = maximum(
        constants.lane_cleared_share * state.path.duration - state.path.elapsed, ZERO
    )
    needed_decel = (
        _braking_until_clear(
            constants,
            leader.gap - vehicles.min_gap,
            leader.closing_speed,
            time_to_clear + constants.lane_clearance_time,
        )
        - leader.accel
    )
    is_changing_lanes = state.path.elapsed < state.path.duration
    must_brake = is_changing_lanes & (slot >= 0) & bodies_overlap & (needed_decel > 0)
    follower = Follower(
        vehicle=vehicles,
        speed=state.motion.vx,
        desired_speed=_current_desired_speed(state, params, context.oncoming),
        time_gap=vehicles.time_gap,
    )
    following_accel = acc_accel(constants, follower, leader)
    return np.where(must_brake, maximum(following_accel, -needed_decel), NO_ACCEL_LIMIT)


def _braking_until_clear(constants: ModelConstants, gap: F32, closing_speed: F32, time: F32) -> F32:
    """Constant deceleration with which a gap lasts for a time, negative if it lasts anyway [m/s^2].

    If the closing speed would fall to 0 before that time, it is the deceleration with which the gap
    is just used up.
    """
    gap = maximum(gap, constants.min_effective_gap)
    distance = closing_speed * time
    return np.where(
        distance < TWO * gap,
        TWO * (distance - gap) / (time * time),
        closing_speed * closing_speed / (TWO * gap),
    )


def apply_pedals(
    state: State, params: StepParameters, leader_accel: F32, old_leader_accel: F32
) -> None:
    """Move the requested acceleration towards the wanted one, faster the more urgent it is.

    In an emergency drivers request more than the friction that they believe in: anti-lock brakes
    and the road decide.

    Args:
        state: Its `controls` change.
        params: Parameters of the batch.
        leader_accel: Acceleration behind the leader, (vehicle, simulation) [m/s^2].
        old_leader_accel: Acceleration behind the leader of the lane that is left, same shape
            [m/s^2].

    Source:
        Markkula et al. 2016: the ramp of emergency braking grows with its urgency.
    """
    vehicles, constants = params.vehicles, params.constants
    requested_accel = state.controls.requested_accel
    max_decel = vehicles.max_brake_force * vehicles.inverse_mass
    target_accel = maximum(minimum(leader_accel, old_leader_accel), -max_decel)
    jerk_up = np.where(requested_accel < 0, constants.jerk_release, constants.jerk_up)
    jerk_down = maximum(-target_accel / constants.brake_ramp, constants.jerk_down)
    change = clamp(
        target_accel - requested_accel,
        -(jerk_down * constants.decision),
        jerk_up * constants.decision,
    )
    is_wreck = state.motion.is_wreck > 0
    state.controls.requested_accel = np.where(is_wreck, ZERO, requested_accel + change)


def accel_for_oncoming(state: State, params: StepParameters, oncoming: OncomingTraffic) -> F32:
    """Largest acceleration of drivers with an oncoming vehicle in their own lane [m/s^2].

    They flash the headlamps and lift the accelerator, then brake so as to stop within their half of
    the distance, and move to the edge of the lane. A driver that is being passed may move to the
    edge, too. The overtaking driver's reaction is in `pass_continuation`.

    Args:
        state: `controls.flashes_high_beam` and the lateral path change.
        params: Parameters of the batch.
        oncoming: Oncoming traffic.
    """
    constants = params.constants
    meets = oncoming.in_own_lane.is_detected & (state.motion.is_wreck == 0) & ~state.is_overtaking()
    meeting_time = _time_to_meet(oncoming.in_own_lane)
    lifts = meets & (meeting_time < constants.oncoming_flash_time)
    brakes = meets & (meeting_time < constants.oncoming_brake_time)
    state.controls.flashes_high_beam = np.where(lifts, ONE, ZERO)
    # This braking stops the driver within vx t, half of the gap if both vehicles are as fast.
    decel = clamp(
        state.motion.vx / (TWO * maximum(meeting_time, _MIN_MEETING_TIME)),
        constants.oncoming_min_decel,
        constants.oncoming_max_decel,
    )
    _shift_to_edge(state, params, brakes, oncoming.is_being_passed)
    accel_limit = np.where(lifts, -constants.oncoming_lift_decel, NO_ACCEL_LIMIT)
    return np.where(brakes, -decel, accel_limit)


def _time_to_meet(oncoming: OncomingVehicle) -> F32:
    """Time until each driver believes to meet an oncoming vehicle [s]."""
    return oncoming.believed_gap / maximum(oncoming.closing_speed, _MIN_CLOSING_SPEED)


def _shift_to_edge(
    state: State, params: StepParameters, brakes: Mask, is_being_passed: Mask
) -> None:
    """Move to the edge of the lane for an oncoming or a passing vehicle, and back afterwards.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        brakes: Whether the driver brakes for an oncoming vehicle.
        is_being_passed: Whether another vehicle passes the driver.
    """
    vehicles, constants, choice = params.vehicles, params.constants, state.lane_choice
    shift_when_passed = np.where(is_being_passed, vehicles.edge_shift_when_passed, ZERO)
    shift = np.where(brakes, constants.edge_shift, shift_when_passed)
    # Drivers move out at once, but back only when they have arrived at the edge.
    has_arrived = state.path.elapsed >= state.path.duration
    starts = (shift > choice.edge_shift) | (has_arrived & (shift < choice.edge_shift))
    # An overtaking driver keeps to the path of its lane change.
    overtakes = state.is_overtaking()
    starts = starts & (state.motion.is_wreck == 0) & (vehicles.valid > 0) & ~overtakes
    right_edge, left_edge = lane_borders(state, params, 0.0)
    # Without an oncoming vehicle the move is half as fast.
    duration = np.where(brakes, constants.edge_shift_duration, TWO * constants.edge_shift_duration)
    start_path(state, starts, HALF * (right_edge + left_edge) - shift, duration)
    choice.edge_shift = np.where(overtakes, ZERO, np.where(starts, shift, choice.edge_shift))
