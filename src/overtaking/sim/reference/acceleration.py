"""Acceleration that each driver requests until its next decision, 0.05 s later.

Arrays have shape (vehicle, simulation); those about neighbours, such as `beliefs.gap`, have the
role of the neighbour as first axis. Left is the overtaking side, and lateral positions grow to the
left. During a lane change the driver's lane is the one that it enters, and its old lane the one
that it leaves. A driver passes from its pull-out until it begins to return or to abort.
"""

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

# Keeps the time until vehicles meet finite. It matters only if both nearly stand [m/s].
_MIN_CLOSING_SPEED = np.float32(0.1)

# Keeps the braking finite right before vehicles meet. It matters only below 1.6 m/s: at higher
# speeds `oncoming_max_decel`, 8 m/s^2, limits the braking already [s].
_MIN_MEETING_TIME = np.float32(0.1)


def accel_behind_leader(state: State, params: StepParameters, context: DecisionContext) -> F32:
    """Acceleration behind the leader in the driver's lane [m/s^2]."""
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
    is_passing = state.is_before_return(slice(None))  # The slice selects all vehicles.
    # `accel_limit` slows drivers down for a lower speed limit ahead. In this model a passing driver
    # slows down for it only after the pass.
    accel = np.where(is_passing, accel, minimum(accel, state.road.accel_limit))
    # A passing driver uses more of the engine than in everyday driving: factors on its usual
    # acceleration, 1.3 while it passes and 2.0 if it must return urgently.
    engine_factor = np.where(
        state.overtake.must_return_urgently > 0,
        constants.urgent_accel_factor,
        constants.accelerate_gain,
    )
    return accel * np.where(is_passing & (accel > 0), engine_factor, ONE)


def _kept_time_gap(state: State, params: StepParameters, context: DecisionContext) -> F32:
    """Time gap that drivers keep: shorter before a pull-out, longer behind a tall leader [s]."""
    constants, time_gap = params.constants, params.vehicles.time_gap
    is_following = state.overtake.stage == np.float32(Stage.FOLLOW)
    is_about_to_pull_out = (state.overtake.time_indicating > 0) & is_following
    # `signalling_time_gap` is a share of the time gap.
    kept_time_gap = np.where(
        is_about_to_pull_out, constants.signalling_time_gap * time_gap, time_gap
    )
    if not params.road.has_oncoming_traffic:
        return kept_time_gap
    # On two-way roads drivers drop back behind a truck or van, to see oncoming traffic past it.
    gap_factor = tall_vehicle_gap_factor(params, context.neighbours.slot[LEADER])
    return np.where(is_following, kept_time_gap * gap_factor, kept_time_gap)


def _current_desired_speed(
    state: State, params: StepParameters, oncoming: OncomingTraffic | None
) -> F32:
    """Speed that drivers want now: while they pass, while they are passed, and in bends [m/s]."""
    vehicles = params.vehicles
    desired_speed, passing_speed = vehicles.desired_speed, vehicles.passing_speed
    if oncoming is not None:
        # On two-way roads the passing speed also depends on the target's speed and on urgency.
        passing_speed = current_passing_speed(state, params)
        desired_speed = np.where(
            oncoming.is_being_passed,
            desired_speed * vehicles.speed_factor_when_passed,
            desired_speed,
        )
    is_passing = state.is_before_return(slice(None))
    return minimum(np.where(is_passing, passing_speed, desired_speed), state.road.bend_speed)


def accel_behind_old_leader(state: State, params: StepParameters, context: DecisionContext) -> F32:
    """Acceleration behind the leader in the old lane, until the bodies are clear [m/s^2].

    The driver brakes so that the gap lasts until its vehicle has left the old lane, plus a margin
    of time. It brakes no harder than behind a leader in its own lane.
    """
    vehicles, constants = params.vehicles, params.constants
    neighbours, beliefs = context.neighbours, context.beliefs
    lane_centre = HALF * (neighbours.lane_right_edge + neighbours.lane_left_edge)
    # Until the vehicle arrives, its new lane's centre is on the side to which it moves.
    moves_left = lane_centre > state.motion.d

    def old_leader_value(values: F32) -> F32:
        # The old lane is on the right of a vehicle that moves left.
        return np.where(moves_left, values[RIGHT_LEADER], values[LEFT_LEADER])

    slot = old_leader_value(neighbours.slot)
    lateral_distance = np.abs(old_leader_value(neighbours.lateral_distance))
    leader = Leader(
        gap=old_leader_value(beliefs.gap),
        closing_speed=old_leader_value(beliefs.closing_speed),
        accel=old_leader_value(beliefs.accel),
    )
    half_widths = vehicles.half_width + value_at_slot(vehicles.half_width, slot)
    bodies_overlap = lateral_distance < half_widths + constants.footprint_margin
    # At `lane_cleared_share`, 0.6 of its duration, the lateral path has covered 2.4 of 3.5 m, more
    # than a car's width. `lane_clearance_time` allows for misjudged distances: at night they are
    # off by a fifth and more, and drivers without this margin hit the leader.
    time_to_clear = maximum(
        constants.lane_cleared_share * state.path.duration - state.path.elapsed, ZERO
    )
    # `leader.accel` is never positive: the driver adds the braking of its old leader.
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
    """Constant deceleration [m/s^2] with which a gap [m] lasts for a time [s].

    It is negative where the gap lasts without braking. Where the closing speed would fall to 0
    before that time, it is the deceleration with which the gap is just used up.
    """
    gap = maximum(gap, constants.min_effective_gap)
    unbraked_distance = closing_speed * time
    # The first deceleration leaves a closing speed of (2 gap - unbraked_distance) / time, which
    # must not be negative.
    return np.where(
        unbraked_distance < TWO * gap,
        TWO * (unbraked_distance - gap) / (time * time),
        closing_speed * closing_speed / (TWO * gap),
    )


def apply_pedals(
    state: State, params: StepParameters, leader_accel: F32, old_leader_accel: F32
) -> None:
    """Move the requested acceleration towards its target, faster if the target is hard braking.

    The target is the smaller one of the two accelerations in the arguments, limited by the force of
    the brakes but not by friction. In an emergency a driver requests more braking than it believes
    the road allows; tyres and anti-lock brakes then limit the actual braking.

    Args:
        state: Its `controls` change.
        params: Parameters of the batch.
        leader_accel: Acceleration behind the leader, or the smaller one that oncoming traffic or
            the pass demands [m/s^2].
        old_leader_accel: Acceleration behind the leader in the old lane [m/s^2].

    Source:
        Markkula et al. 2016: the ramp of emergency braking grows with its urgency.
    """
    vehicles, constants = params.vehicles, params.constants
    requested_accel = state.controls.requested_accel
    max_decel = vehicles.max_brake_force * vehicles.inverse_mass
    target_accel = maximum(minimum(leader_accel, old_leader_accel), -max_decel)
    # A foot leaves the brake faster than it presses the accelerator.
    jerk_up = np.where(requested_accel < 0, constants.jerk_release, constants.jerk_up)
    # Drivers reach any braking within `brake_ramp`, so hard braking builds up faster.
    jerk_down = maximum(-target_accel / constants.brake_ramp, constants.jerk_down)
    # `constants.decision` is the time between two decisions [s].
    change = clamp(
        target_accel - requested_accel,
        -(jerk_down * constants.decision),
        jerk_up * constants.decision,
    )
    is_wreck = state.motion.is_wreck > 0
    state.controls.requested_accel = np.where(is_wreck, ZERO, requested_accel + change)


def accel_for_oncoming(state: State, params: StepParameters, oncoming: OncomingTraffic) -> F32:
    """Largest acceleration of drivers with an oncoming vehicle in their own lane [m/s^2].

    They first flash the headlamps and release the accelerator. Later they move to the edge of the
    lane and brake so as to stop within their half of the distance. Some drivers also move to the
    edge while another vehicle passes them. `pass_continuation` has the overtaking driver's
    reaction.

    Args:
        state: `controls.flashes_high_beam`, `lane_choice.edge_shift` and `path` change.
        params: Parameters of the batch.
        oncoming: Oncoming traffic.
    """
    constants = params.constants
    meets_oncoming = (
        oncoming.in_own_lane.is_detected & (state.motion.is_wreck == 0) & ~state.is_overtaking()
    )
    meeting_time = _time_to_meet(oncoming.in_own_lane)
    releases_accelerator = meets_oncoming & (meeting_time < constants.oncoming_flash_time)
    brakes = meets_oncoming & (meeting_time < constants.oncoming_brake_time)
    state.controls.flashes_high_beam = np.where(releases_accelerator, ONE, ZERO)
    # This braking stops the driver within vx t, half of the gap if both vehicles are equally fast.
    decel = clamp(
        state.motion.vx / (TWO * maximum(meeting_time, _MIN_MEETING_TIME)),
        constants.oncoming_min_decel,
        constants.oncoming_max_decel,
    )
    _shift_to_edge(state, params, brakes, oncoming.is_being_passed)
    accel_limit = np.where(releases_accelerator, -constants.oncoming_lift_decel, NO_ACCEL_LIMIT)
    return np.where(brakes, -decel, accel_limit)


def _time_to_meet(oncoming: OncomingVehicle) -> F32:
    """Time until each driver believes to meet an oncoming vehicle [s]."""
    return oncoming.believed_gap / maximum(oncoming.closing_speed, _MIN_CLOSING_SPEED)


def _shift_to_edge(
    state: State, params: StepParameters, brakes: Mask, is_being_passed: Mask
) -> None:
    """Move to the right edge of the lane for an oncoming or passing vehicle, and back afterwards.

    Args:
        state: `lane_choice.edge_shift` and `path` change.
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
    # `offset` counts lanes to the left of the driver's lane.
    right_edge, left_edge = lane_borders(state, params, offset=0.0)
    # A choice of this model: without an oncoming vehicle the move takes twice as long.
    duration = np.where(brakes, constants.edge_shift_duration, TWO * constants.edge_shift_duration)
    start_path(state, starts, HALF * (right_edge + left_edge) - shift, duration)
    choice.edge_shift = np.where(overtakes, ZERO, np.where(starts, shift, choice.edge_shift))
