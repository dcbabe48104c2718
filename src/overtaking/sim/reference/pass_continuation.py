"""Decisions during a pass on a two-way road: to complete it, to abort it, or to return urgently.

The target is the vehicle that a driver overtakes. A passing driver is in the opposing lane, and its
own lane is on its right. The right leader is the nearest vehicle there whose centre is ahead of the
driver's: at first the target, later the next vehicle. The right follower is the nearest one behind:
later the target. The ego and the others follow the same rules; `slots` selects the rows of arrays
of shape (vehicle, simulation).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, TWO, ZERO, maximum, minimum
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.car_following import Follower, Leader, acc_accel, cah_accel
from overtaking.sim.reference.decision_context import DecisionContext, OncomingVehicle
from overtaking.sim.reference.passing import (
    MIN_CLOSING_SPEED,
    PassingSpeeds,
    assumed_oncoming_gap,
    current_passing_speed,
    line_is_solid,
    tall_vehicle_gap_factor,
    time_to_pass,
)
from overtaking.sim.reference.state import (
    FAR,
    NO_ACCEL_LIMIT,
    RIGHT_FOLLOWER,
    RIGHT_LEADER,
    SlotSelection,
    State,
    value_at_slot,
)
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters, VehicleParameters


@dataclass(slots=True, kw_only=True)
class PassContinuation:
    """Decisions of passing drivers on a two-way road; masks of the shape of the slots.

    Attributes:
        must_abort: Whether the driver falls back behind its target.
        must_return_urgently: Whether the driver accelerates and returns as fast as it can.
        accepts_small_gap: Whether the driver returns into a smaller gap than usual.
        fits_into_lane: Whether a driver that falls back will have gaps to its target and to the
            leader in its own lane once it has braked.
    """

    must_abort: Mask
    must_return_urgently: Mask
    accepts_small_gap: Mask
    fits_into_lane: Mask


class TargetLead(NamedTuple):
    """Position of the target's centre minus the position of the driver's centre [m]."""

    now: F32
    needed: F32  # At this lead the driver has the smallest gap that it needs behind the target.


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeMotion:
    """A passing driver and its target, along the road.

    Attributes:
        target_slot: Slot of the target.
        speed: Speed of the driver [m/s].
        target_speed: Speed of the target [m/s].
        closing_speed: Speed of the driver minus the target's [m/s].
        target_lead: How far the target is ahead, now and as needed for an abort.
    """

    target_slot: F32
    speed: F32
    target_speed: F32
    closing_speed: F32
    target_lead: TargetLead


class PassTimes(NamedTuple):
    """Durations that a passing driver compares [s]."""

    complete: F32  # Time until it is past the target and back in its lane.
    abort: F32  # Time until it is back behind the target.
    meet: F32  # Time until it meets the oncoming vehicle, `FAR` without a detected one.


class ReturnSpace(NamedTuple):
    """Space beside a passing driver, between the two vehicles of its own lane."""

    size: F32  # Gap to the leader plus gap to the follower, without the driver's own length [m].
    is_cramped: Mask  # Whether the space is smaller than the driver's usual demand.


def decide_pass_continuation(
    state: State, params: StepParameters, context: DecisionContext, slots: SlotSelection
) -> PassContinuation:
    """Decide whether drivers complete a pass, abort it, or return urgently.

    A driver compares three durations: to complete the pass, to be back behind the target, and to
    meet the oncoming vehicle.

    - While its centre is behind the target's centre, it aborts if it would meet the oncoming
      vehicle too soon after the pass and aborting is quicker.
    - If its centre is past the target's centre and it has no time for the next vehicle, it returns
      between the two. If the space between them is too small, or falling back is quicker than
      gaining the distance that it still needs to return ahead of the target, it aborts.
    - It returns urgently, and accepts a small gap, if little time would be left after the pass, or
      if the space between the two is less than its usual demand. A driver that heeds solid lines
      also returns urgently if it would otherwise cross one, but keeps its usual gap.
    """
    assert context.oncoming is not None, "one-way roads have no oncoming traffic"
    vehicle = params.vehicles.at_slots(slots)
    motion = _relative_motion(state, params, slots)
    times = PassTimes(
        complete=_time_to_complete(params, vehicle, motion),
        abort=_time_to_abort(params, vehicle, motion),
        meet=_time_to_meet(context.oncoming.nearest, slots),
    )
    is_passing = state.is_before_return(slots)  # It pulls out or passes.
    must_return_now = _must_return_before_next(state, params, context)[slots]
    space = _return_space(params, context, vehicle, motion, slots)
    must_abort = is_passing & (
        _aborts_early(params, motion, times)
        | (must_return_now & _is_trapped(params, motion, times, space))
        | (state.overtake.must_abort[slots] > 0)  # An abort is final during the pass.
    )
    continues = (is_passing | state.is_in_stage(Stage.RETURN, slots)) & ~must_abort
    has_little_time = times.meet - times.complete < params.constants.urgent_return_margin
    accepts_small_gap = continues & (has_little_time | (must_return_now & space.is_cramped))
    # Crossing a solid line is no danger in itself: the driver hurries, but accepts no small gap.
    hurries_before_line = continues & _would_cross_solid_line(state, params, slots, motion, times)
    return PassContinuation(
        must_abort=must_abort,
        must_return_urgently=accepts_small_gap | hurries_before_line,
        accepts_small_gap=accepts_small_gap,
        fits_into_lane=_fits_after_braking(params, context, vehicle, motion, slots),
    )


def _relative_motion(state: State, params: StepParameters, slots: SlotSelection) -> RelativeMotion:
    """Speeds of drivers and their targets, and leads of the targets."""
    target_slot = state.overtake.target_slot[slots]
    along_road, _ = state.road_velocity()
    speed, target_speed = along_road[slots], value_at_slot(along_road, target_slot)
    return RelativeMotion(
        target_slot=target_slot,
        speed=speed,
        target_speed=target_speed,
        closing_speed=speed - target_speed,
        target_lead=_target_lead(state, params, slots),
    )


def _target_lead(state: State, params: StepParameters, slots: SlotSelection) -> TargetLead:
    """Lead of the target, now and as needed for an abort."""
    target_slot, half_length = state.overtake.target_slot[slots], params.vehicles.half_length
    half_lengths = half_length[slots] + value_at_slot(half_length, target_slot)
    return TargetLead(
        now=value_at_slot(state.motion.s, target_slot) - state.motion.s[slots],
        needed=half_lengths + params.constants.min_return_gap,
    )


def _distance_to_clear(motion: RelativeMotion) -> F32:
    """Distance that the driver still has to gain on its target to return ahead of it [m]."""
    # The smallest gap ahead of the target is the same as behind it.
    return maximum(motion.target_lead.now + motion.target_lead.needed, ZERO)


def _time_to_move_over(params: StepParameters) -> F32:
    """Half of an urgent lane change, after which a returning driver has crossed the line [s]."""
    return HALF * params.simulations.urgent_change_duration


def _abort_decel(params: StepParameters, vehicle: VehicleParameters) -> F32:
    """Braking of an aborting driver, positive [m/s^2].

    It is less than `max_assumed_decel`, the hardest braking that the driver believes possible: a
    choice.
    """
    return params.constants.abort_decel_share * vehicle.max_assumed_decel


def _time_to_complete(
    params: StepParameters, vehicle: VehicleParameters, motion: RelativeMotion
) -> F32:
    """Time until the driver is past its target and back in its lane [s]."""
    speeds = PassingSpeeds(
        passer=motion.speed, target=motion.target_speed, closing=motion.closing_speed
    )
    distance = _distance_to_clear(motion)
    return time_to_pass(params.constants, vehicle, distance, speeds) + _time_to_move_over(params)


def _time_to_abort(
    params: StepParameters, vehicle: VehicleParameters, motion: RelativeMotion
) -> F32:
    """Time until the braking driver is back behind its target [s]."""
    decel, closing_speed = _abort_decel(params, vehicle), motion.closing_speed
    distance = maximum(motion.target_lead.needed - motion.target_lead.now, ZERO)
    # The braking takes the time t that solves distance = decel * t^2 / 2 - closing_speed * t.
    root = np.sqrt(closing_speed * closing_speed + TWO * decel * distance)
    return (closing_speed + root) / decel + _time_to_move_over(params)


def _time_to_meet(oncoming: OncomingVehicle, slots: SlotSelection) -> F32:
    """Time until the driver believes that it meets the oncoming vehicle [s]."""
    closing_speed = maximum(oncoming.closing_speed[slots], MIN_CLOSING_SPEED)
    time = oncoming.believed_gap[slots] / closing_speed
    return np.where(oncoming.is_detected[slots], time, FAR)


def _return_space(
    params: StepParameters,
    context: DecisionContext,
    vehicle: VehicleParameters,
    motion: RelativeMotion,
    slots: SlotSelection,
) -> ReturnSpace:
    """The space between the two vehicles beside each driver, compared with its usual demand."""
    # The true gaps: that drivers judge the space beside them without error is a choice.
    gap = context.neighbours.gap
    size = gap[RIGHT_LEADER, slots] + gap[RIGHT_FOLLOWER, slots]
    # Drivers leave a longer gap ahead of a target that blocks the view, because such a vehicle
    # brakes worse.
    factor = tall_vehicle_gap_factor(params, motion.target_slot)
    return_time_gap = vehicle.return_time_gap * factor
    # The usual gap behind the next vehicle, plus the usual gap ahead of the target, at its speed.
    usual_size = vehicle.min_gap + (vehicle.time_gap + return_time_gap) * motion.target_speed
    return ReturnSpace(size=size, is_cramped=size < usual_size)


def _aborts_early(params: StepParameters, motion: RelativeMotion, times: PassTimes) -> Mask:
    """Whether the target is still ahead, the pass would end too late, and aborting is quicker."""
    meets_too_soon = times.complete + params.constants.abort_margin > times.meet
    return (motion.target_lead.now > 0) & meets_too_soon & (times.abort < times.complete)


def _is_trapped(
    params: StepParameters, motion: RelativeMotion, times: PassTimes, space: ReturnSpace
) -> Mask:
    """Whether the space is too small, or aborting is quicker than clearing the target."""
    closing_speed = maximum(motion.closing_speed, MIN_CLOSING_SPEED)
    # The time at the present speed, because the driver follows the next vehicle, which may be too
    # slow for it to get clear of the target. The lane change, which `times.abort` contains, is left
    # out: a choice, in favour of the pass.
    clears_target_late = _distance_to_clear(motion) / closing_speed > times.abort
    return (space.size < params.constants.min_return_space) | clears_target_late


def _would_cross_solid_line(
    state: State,
    params: StepParameters,
    slots: SlotSelection,
    motion: RelativeMotion,
    times: PassTimes,
) -> Mask:
    """Whether a driver that heeds solid lines would return across one."""
    # `line_is_solid` tests the line here and at this distance ahead, where the driver returns.
    distance = maximum(motion.speed, ZERO) * times.complete
    heeds_solid_lines = params.vehicles.heeds_solid_lines[slots] > 0
    return line_is_solid(state, params, slots, distance) & heeds_solid_lines


def _fits_after_braking(
    params: StepParameters,
    context: DecisionContext,
    vehicle: VehicleParameters,
    motion: RelativeMotion,
    slots: SlotSelection,
) -> Mask:
    """Whether an aborting driver has gaps to its target and in its lane once it has braked.

    The gaps are those at the end of the braking. With present gaps, drivers moved over too early
    and touched the vehicle ahead, because braking takes effect late.
    """
    constants, beliefs = params.constants, context.beliefs
    decel = _abort_decel(params, vehicle)
    # The lead over the target is the true one, as the gaps in `_return_space`: a choice.
    gained_on_target = _distance_gained_while_braking(constants, motion.closing_speed, decel)
    lead_after_braking = motion.target_lead.now - gained_on_target
    # The leader in the own lane may be another vehicle, if the target has pulled out itself. The
    # driver assumes that it keeps its speed.
    closing_speed = beliefs.closing_speed[RIGHT_LEADER, slots]
    gained_on_leader = _distance_gained_while_braking(constants, closing_speed, decel)
    gap = beliefs.gap[RIGHT_LEADER, slots] - gained_on_leader
    return (lead_after_braking > motion.target_lead.needed) & (gap > constants.min_return_gap)


def _distance_gained_while_braking(
    constants: ModelConstants, closing_speed: F32, decel: F32
) -> F32:
    """Distance that a braking driver still gains on a vehicle until both are equally fast [m]."""
    closing_speed = maximum(closing_speed, ZERO)
    # The closing speed lasts for `brake_ramp`, in which the brakes build up, and then falls to 0.
    return closing_speed * (constants.brake_ramp + closing_speed / (TWO * decel))


def _must_return_before_next(
    state: State, params: StepParameters, context: DecisionContext
) -> Mask:
    """Whether drivers are past their target and have no time to pass the next vehicle as well.

    A driver that can no longer brake behind the next vehicle goes on to pass it.

    Returns:
        Shape (vehicle, simulation).
    """
    assert context.oncoming is not None, "one-way roads have no oncoming traffic"
    vehicles, constants = params.vehicles, params.constants
    oncoming, beliefs = context.oncoming.nearest, context.beliefs
    # Along the vehicle's own axis, as in all car following; nearly the speed along the road.
    speed = state.motion.vx
    is_past_target = state.is_in_stage(Stage.PASS, slice(None)) & (
        state.motion.s > value_at_slot(state.motion.s, state.overtake.target_slot)
    )
    gap, closing_speed = beliefs.gap[RIGHT_LEADER], beliefs.closing_speed[RIGHT_LEADER]
    # To pass the next vehicle, the driver gains the gap, both lengths and the smallest return gap.
    lengths = TWO * (context.neighbours.half_length[RIGHT_LEADER] + vehicles.half_length)
    distance = gap + lengths + constants.min_return_gap
    speeds = PassingSpeeds(passer=speed, target=speed - closing_speed, closing=closing_speed)
    time = time_to_pass(constants, vehicles, distance, speeds)
    time = time + _time_to_move_over(params) + constants.urgent_return_margin
    # The driver also assumes an oncoming vehicle where the road is hidden. Without a detected
    # vehicle, `oncoming.closing_speed` is the closing speed of a vehicle at the usual speed.
    oncoming_gap = assumed_oncoming_gap(vehicles, oncoming.believed_gap, oncoming.sight_distance)
    would_be_late = oncoming_gap < time * oncoming.closing_speed
    next_vehicle = Leader(gap=gap, closing_speed=closing_speed)
    # The acceleration that just avoids a contact, if the next vehicle keeps its speed.
    needed_accel = cah_accel(constants, speed, next_vehicle)
    can_brake = needed_accel >= -_abort_decel(params, vehicles)
    return is_past_target & would_be_late & can_brake


def overtakes_next_vehicle(
    state: State, params: StepParameters, context: DecisionContext, slots: SlotSelection
) -> Mask:
    """Whether drivers are past their target and reach the next vehicle, their new target.

    "Past" compares the centres. A driver reaches the next vehicle when the gap falls below the
    smallest with which it could still return behind that vehicle.
    """
    neighbours = context.neighbours
    target_s = value_at_slot(state.motion.s, state.overtake.target_slot[slots])
    is_past_target = state.is_in_stage(Stage.PASS, slots) & (state.motion.s[slots] > target_s)
    reaches_next = neighbours.gap[RIGHT_LEADER, slots] < params.constants.min_return_gap
    has_next_vehicle = neighbours.slot[RIGHT_LEADER, slots] >= 0
    returns = _must_return_before_next(state, params, context)[slots]
    stays_behind = returns | (state.overtake.must_abort[slots] > 0)
    return is_past_target & reaches_next & has_next_vehicle & ~stays_behind


def can_abort_pass(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether passing drivers on a two-way road are far enough back to return behind the target."""
    lead = _target_lead(state, params, slots)
    return (
        state.is_before_return(slots)
        & (lead.now > lead.needed)
        & (params.road.has_oncoming_traffic)
    )


def accel_limit_while_passing(
    state: State, params: StepParameters, context: DecisionContext
) -> F32:
    """Largest acceleration of drivers in the opposing lane [m/s^2].

    An aborting driver brakes until it is slower than its target by a margin, then keeps its speed.
    A driver past its target without the time to pass the next vehicle as well must fit in between
    the two. It follows the next vehicle with a share of its time gap, or in the middle of the space
    if that is nearer.

    Returns:
        Shape (vehicle, simulation); `NO_ACCEL_LIMIT` for all other drivers.
    """
    vehicles, constants, beliefs = params.vehicles, params.constants, context.beliefs
    along_road, _ = state.road_velocity()
    target_speed = value_at_slot(along_road, state.overtake.target_slot)
    is_slow_enough = along_road < target_speed - constants.abort_speed_difference
    abort_accel = np.where(is_slow_enough, ZERO, -_abort_decel(params, vehicles))
    neighbour_gap = context.neighbours.gap  # True gaps, as in `_return_space`.
    gap_in_middle = HALF * (neighbour_gap[RIGHT_LEADER] + neighbour_gap[RIGHT_FOLLOWER])
    # Along the vehicle's own axis, as in all car following; nearly the speed along the road.
    speed = state.motion.vx
    # `slip_speed` is the least divisor wherever a formula divides by speed.
    time_gap_in_middle = maximum(gap_in_middle - vehicles.min_gap, ZERO) / maximum(
        speed, constants.slip_speed
    )
    follower = Follower(
        vehicle=vehicles,
        speed=speed,
        desired_speed=current_passing_speed(state, params),
        time_gap=minimum(constants.return_time_gap_share * vehicles.time_gap, time_gap_in_middle),
    )
    next_vehicle = Leader(
        gap=beliefs.gap[RIGHT_LEADER],
        closing_speed=beliefs.closing_speed[RIGHT_LEADER],
        accel=beliefs.accel[RIGHT_LEADER],
    )
    following_accel = acc_accel(constants, follower, next_vehicle)
    must_return = _must_return_before_next(state, params, context)
    limit = np.where(must_return, following_accel, NO_ACCEL_LIMIT)
    return np.where(state.overtake.must_abort > 0, abort_accel, limit)
