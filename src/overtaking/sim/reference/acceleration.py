"""How hard each driver accelerates or brakes from here to the next decision."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import clamp, maximum, minimum
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.car_following import acc_accel
from overtaking.sim.reference.decision_context import Beliefs, Neighbours, OncomingTraffic
from overtaking.sim.reference.neighbour_search import lane_borders
from overtaking.sim.reference.passing import current_passing_speed, tall_vehicle_gap_factor
from overtaking.sim.reference.state import LEADER, LEFT_LEADER, RIGHT_LEADER, State, value_at_slot
from overtaking.sim.reference.steering import start_path
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters

_FREE = np.float32(1e9)

_MIN_SPEED = np.float32(0.1)  # Keeps the time until vehicles meet finite [m/s].

_MIN_MEETING_TIME = np.float32(0.1)  # Keeps braking finite for a vehicle that is there already [s].

_HALF = np.float32(0.5)


def accel_behind_leader(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    beliefs: Beliefs,
    oncoming: OncomingTraffic | None,
) -> F32:
    """Acceleration behind the leader of the lane that is driven in or being entered [m/s^2].

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        neighbours: Neighbours.
        beliefs: What drivers believe of them.
        oncoming: Oncoming traffic; None on one-way roads.
    """
    vehicles = params.vehicles
    desired = _current_desired_speed(state, params, oncoming)
    constants = params.constants
    gap, closing = beliefs.gap[LEADER], beliefs.closing_speed[LEADER]
    passing = state.is_before_return(slice(None))
    # A driver about to pull out accepts a smaller gap.
    about_to = (state.overtake.time_indicating > 0) & (
        state.overtake.stage == np.float32(Stage.FOLLOW)
    )
    kept = np.where(about_to, constants.signalling_time_gap * vehicles.time_gap, vehicles.time_gap)
    if params.road.has_oncoming_traffic:
        follows = state.overtake.stage == np.float32(Stage.FOLLOW)
        kept = np.where(
            follows, kept * tall_vehicle_gap_factor(params, neighbours.slot[LEADER]), kept
        )
    wanted = acc_accel(
        constants, vehicles, state.motion.vx, desired, gap, closing, kept, beliefs.accel[LEADER]
    )
    wanted = np.where(passing, wanted, minimum(wanted, state.road.accel_limit))
    eager = np.where(
        state.overtake.must_return_urgently > 0,
        constants.urgent_accel_factor,
        constants.accelerate_gain,
    )
    return wanted * np.where(passing & (wanted > 0), eager, np.float32(1.0))


def _current_desired_speed(
    state: State, params: StepParameters, oncoming: OncomingTraffic | None
) -> F32:
    vehicles = params.vehicles
    desired, passing = vehicles.desired_speed, vehicles.passing_speed
    if oncoming is not None:
        passing = current_passing_speed(state, params)
        desired = np.where(
            oncoming.is_being_passed, desired * vehicles.speed_factor_when_passed, desired
        )
    return minimum(
        np.where(state.is_before_return(slice(None)), passing, desired), state.road.bend_speed
    )


def accel_behind_old_leader(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    beliefs: Beliefs,
    oncoming: OncomingTraffic | None,
) -> F32:
    """Acceleration behind the one whose lane is being left, as long as the bodies still overlap.

    Drivers brake by what their way lacks to clear the other a moment before the gap is closed, and
    no harder than behind a leader. The moment covers errors of judgement: without it a leader that
    is believed farther off is hit.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        neighbours: Neighbours.
        beliefs: What drivers believe of them.
        oncoming: Oncoming traffic; None on one-way roads.
    """
    vehicles = params.vehicles
    constants = params.constants
    changing = state.path.elapsed < state.path.duration
    to_fast = (
        np.float32(0.5) * (neighbours.lane_right_edge + neighbours.lane_left_edge) > state.motion.d
    )
    slot = np.where(to_fast, neighbours.slot[RIGHT_LEADER], neighbours.slot[LEFT_LEADER])
    gap = np.where(to_fast, beliefs.gap[RIGHT_LEADER], beliefs.gap[LEFT_LEADER])
    closing = np.where(
        to_fast, beliefs.closing_speed[RIGHT_LEADER], beliefs.closing_speed[LEFT_LEADER]
    )
    accel = np.where(to_fast, beliefs.accel[RIGHT_LEADER], beliefs.accel[LEFT_LEADER])
    aside = np.abs(
        np.where(
            to_fast,
            neighbours.lateral_distance[RIGHT_LEADER],
            neighbours.lateral_distance[LEFT_LEADER],
        )
    )
    overlaps = (
        aside
        < vehicles.half_width
        + value_at_slot(vehicles.half_width, slot)
        + constants.footprint_margin
    )
    # At 0.6 of its duration the path has moved by more than a car's width. The margin covers
    # misjudged distances: at night the belief is off by a fifth and more, and the leader was hit.
    left = maximum(
        constants.lane_cleared_share * state.path.duration - state.path.elapsed, np.float32(0.0)
    )
    needed = (
        _braking_until_clear(
            constants, gap - vehicles.min_gap, closing, left + constants.lane_clearance_time
        )
        - accel
    )
    matters = changing & (slot >= 0) & overlaps & (needed > 0)
    desired = _current_desired_speed(state, params, oncoming)
    kept = acc_accel(
        constants, vehicles, state.motion.vx, desired, gap, closing, vehicles.time_gap, accel
    )
    return np.where(matters, maximum(kept, -needed), _FREE)


def _braking_until_clear(constants: ModelConstants, room: F32, closing: F32, time: F32) -> F32:
    """Constant braking with which the room lasts a time, below 0 if it does so without [m/s^2].

    Where the closing would end before that time, it is the braking that ends it within the room.
    """
    two, room = np.float32(2.0), maximum(room, constants.min_effective_gap)
    way = closing * time
    return np.where(
        way < two * room, two * (way - room) / (time * time), closing * closing / (two * room)
    )


def apply_pedals(state: State, params: StepParameters, leader: F32, old_leader: F32) -> None:
    """Move the pedals towards the wanted acceleration, as fast as it is urgent.

    A driver that needs more brakes beyond the friction that it believes in: anti-lock brakes and
    the road decide.

    Source:
        Markkula and others 2016: the ramp of emergency braking grows with its urgency.
    """
    vehicles = params.vehicles
    constants = params.constants
    wanted = maximum(
        minimum(leader, old_leader), -(vehicles.max_brake_force * vehicles.inverse_mass)
    )
    up = (
        np.where(state.controls.requested_accel < 0, constants.jerk_release, constants.jerk_up)
        * constants.decision
    )
    down = maximum(-wanted / constants.brake_ramp, constants.jerk_down) * constants.decision
    changed = state.controls.requested_accel + clamp(
        wanted - state.controls.requested_accel, -down, up
    )
    state.controls.requested_accel = np.where(state.motion.is_wreck > 0, np.float32(0.0), changed)


def accel_for_oncoming(state: State, params: StepParameters, oncoming: OncomingTraffic) -> F32:
    """Largest acceleration of drivers with an oncoming vehicle in their own lane [m/s^2].

    They flash the headlamps and lift the accelerator, then brake so as to stop within their half of
    the distance, and move to the edge of the lane. The overtaking driver's reaction is in
    `pass_continuation`. A driver that is being passed may move to the edge, too.
    """
    vehicles, constants = params.vehicles, params.constants
    in_own_lane = oncoming.in_own_lane
    out = state.is_overtaking()
    meets = in_own_lane.is_detected & (state.motion.is_wreck == 0) & ~out
    time = in_own_lane.believed_gap / maximum(in_own_lane.closing_speed, _MIN_SPEED)
    lifts, brakes = (
        meets & (time < constants.oncoming_flash_time),
        meets & (time < constants.oncoming_brake_time),
    )
    state.controls.flashes_high_beam = np.where(lifts, np.float32(1.0), np.float32(0.0))
    halved = np.float32(2.0) * maximum(time, _MIN_MEETING_TIME)
    braking = clamp(
        state.motion.vx / halved, constants.oncoming_min_decel, constants.oncoming_max_decel
    )
    _shift_to_edge(
        state,
        params,
        brakes,
        np.where(oncoming.is_being_passed, vehicles.edge_shift_when_passed, np.float32(0.0)),
        out,
    )
    return np.where(brakes, -braking, np.where(lifts, -constants.oncoming_lift_decel, _FREE))


def _shift_to_edge(
    state: State, params: StepParameters, brakes: Mask, room: F32, out: Mask
) -> None:
    """Move to the edge of the lane for an oncoming or a passing vehicle, and back afterwards.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        brakes: Drivers who brake for an oncoming vehicle.
        room: How far the others move for a passing vehicle [m].
        out: Drivers who overtake, and keep to the path of that.
    """
    vehicles = params.vehicles
    constants = params.constants
    wanted = np.where(brakes, constants.edge_shift, room)
    arrived = state.path.elapsed >= state.path.duration
    moved = (wanted > state.lane_choice.edge_shift) | (
        arrived & (wanted < state.lane_choice.edge_shift)
    )
    moved = moved & (state.motion.is_wreck == 0) & (vehicles.valid > 0) & ~out
    low, high = lane_borders(state, params, 0.0)
    duration = np.where(
        brakes, constants.edge_shift_duration, np.float32(2.0) * constants.edge_shift_duration
    )
    start_path(state, moved, _HALF * (low + high) - wanted, duration)
    state.lane_choice.edge_shift = np.where(
        out, np.float32(0.0), np.where(moved, wanted, state.lane_choice.edge_shift)
    )
