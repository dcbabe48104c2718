"""How drivers go on in the other lane: past, back behind the other, or in haste.

The ego and the others follow the same rules; `who` selects the rows of the arrays.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import maximum, minimum
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.car_following import acc_accel, cah_accel
from overtaking.sim.reference.decision_context import DecisionContext
from overtaking.sim.reference.passing import (
    MIN_CLOSING_SPEED,
    assumed_oncoming_gap,
    current_passing_speed,
    line_is_solid,
    tall_vehicle_gap_factor,
    time_to_pass,
)
from overtaking.sim.reference.state import (
    RIGHT_FOLLOWER,
    RIGHT_LEADER,
    SlotSelection,
    State,
    value_at_slot,
)
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters

_FAR = np.float32(1e9)


_ZERO = np.float32(0.0)


_HALF = np.float32(0.5)


_TWO = np.float32(2.0)


@dataclass(slots=True, kw_only=True)
class PassContinuation:
    """How drivers go on with a pass against oncoming traffic; masks of the shape of the slots.

    Attributes:
        must_abort: The driver falls back behind its target.
        must_return_urgently: The driver hurries to be back in its lane.
        accepts_small_gap: The driver returns into a gap that is smaller than it would usually ask
            for.
        fits_into_lane: Behind the target there is a gap to it and to the next leader, once the
            driver has braked to their speed.
    """

    must_abort: Mask
    must_return_urgently: Mask
    accepts_small_gap: Mask
    fits_into_lane: Mask


def decide_pass_continuation(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    slots: SlotSelection,
) -> PassContinuation:
    """Whether drivers go on with their pass, and how.

    Until they are abreast they give up where they would not be back a moment before the oncomer is
    there, and falling back lacks less time than going on. Later those who have no time to pass the
    next one, too, take the room beside them, at once where it is less than they would ask for; they
    fall back where it is none, or where they are not past sooner than back. They are in a hurry
    where little would be to spare, and pressed; those who heed lines also where they would return
    across a solid one.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        context: What drivers know; there is oncoming traffic on the road.
        slots: The drivers.
    """
    vehicles, simulations = params.vehicles, params.simulations
    assert context.oncoming is not None
    constants, own, coming = params.constants, vehicles.at_slots(slots), context.oncoming.nearest
    neighbours, beliefs = context.neighbours, context.beliefs
    out = state.is_before_return(slots)
    along, _ = state.road_velocity()
    speed, other = along[slots], value_at_slot(along, state.overtake.target_slot[slots])
    lead, bodies = _target_lead(state, params, slots)
    faster = speed - other
    aside = _HALF * simulations.urgent_change_duration
    onwards = maximum(lead + bodies, _ZERO)
    rest = time_to_pass(constants, own, onwards, speed, faster, other) + aside
    brake = constants.abort_decel_share * own.max_assumed_decel
    backwards = maximum(bodies - lead, _ZERO)
    back = (faster + np.sqrt(faster * faster + _TWO * brake * backwards)) / brake + aside
    noticed = coming.is_detected[slots]
    there = np.where(
        noticed,
        coming.believed_gap[slots] / maximum(coming.closing_speed[slots], MIN_CLOSING_SPEED),
        _FAR,
    )
    gives_up = (lead > 0) & (rest + constants.abort_margin > there) & (back < rest)
    no_time = _must_return_before_next(state, params, context)[slots]
    room = neighbours.gap[RIGHT_LEADER, slots] + neighbours.gap[RIGHT_FOLLOWER, slots]
    left = own.return_time_gap * tall_vehicle_gap_factor(params, state.overtake.target_slot[slots])
    cramped = no_time & (room < own.min_gap + (own.time_gap + left) * other)
    too_slow = onwards / maximum(faster, MIN_CLOSING_SPEED) > back
    trapped = no_time & ((room < constants.min_return_space) | too_slow)
    yields = (gives_up | trapped | (state.overtake.must_abort[slots] > 0)) & out
    beyond = (out | state.is_in_stage(Stage.RETURN, slots)) & ~yields
    pressed = beyond & ((there - rest < constants.urgent_return_margin) | cramped)
    late = line_is_solid(state, params, slots, maximum(speed, _ZERO) * rest) & (
        own.heeds_solid_lines > 0
    )
    # Another than the target may be ahead in the lane, as that one may have pulled out itself.
    front = beliefs.gap[RIGHT_LEADER, slots]
    front = front - _distance_gained_while_braking(
        constants, beliefs.closing_speed[RIGHT_LEADER, slots], brake
    )
    return PassContinuation(
        must_abort=yields,
        must_return_urgently=pressed | (beyond & late),
        accepts_small_gap=pressed,
        fits_into_lane=(lead - _distance_gained_while_braking(constants, faster, brake) > bodies)
        & (front > constants.min_return_gap),
    )


def _distance_gained_while_braking(constants: ModelConstants, faster: F32, brake: F32) -> F32:
    """What is still gained on another while the brakes come on, and with them [m]."""
    faster = maximum(faster, _ZERO)
    return faster * (constants.brake_ramp + faster / (_TWO * brake))


def _must_return_before_next(
    state: State,
    params: StepParameters,
    context: DecisionContext,
) -> Mask:
    """Who is past the one that it overtakes, and has no time to pass the next one as well.

    Who can no longer brake behind the next one goes on.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        context: What drivers know; there is oncoming traffic on the road.

    Returns:
        Shape (vehicle, simulation).
    """
    vehicles, simulations = params.vehicles, params.simulations
    assert context.oncoming is not None
    constants, coming, everybody = params.constants, context.oncoming.nearest, slice(None)
    past = state.is_in_stage(Stage.PASS, everybody) & (
        state.motion.s > value_at_slot(state.motion.s, state.overtake.target_slot)
    )
    gap, closing = context.beliefs.gap[RIGHT_LEADER], context.beliefs.closing_speed[RIGHT_LEADER]
    next_one = state.motion.vx - closing
    bodies = _TWO * (context.neighbours.half_length[RIGHT_LEADER] + vehicles.half_length)
    way = gap + bodies + constants.min_return_gap
    longer = time_to_pass(constants, vehicles, way, state.motion.vx, closing, next_one)
    longer = longer + _HALF * simulations.urgent_change_duration + constants.urgent_return_margin
    late = (
        assumed_oncoming_gap(vehicles, coming.believed_gap, coming.sight_distance)
        < longer * coming.closing_speed
    )
    needed = cah_accel(constants, state.motion.vx, gap, closing, _ZERO)
    return past & late & (needed >= -(constants.abort_decel_share * vehicles.max_assumed_decel))


def overtakes_next_vehicle(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    slots: SlotSelection,
) -> Mask:
    """Who is past the one that it overtakes and comes beside the next one: it overtakes that now.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        context: What drivers know; there is oncoming traffic on the road.
        slots: The drivers.
    """
    neighbours, confined = (
        context.neighbours,
        _must_return_before_next(state, params, context)[slots],
    )
    past = state.is_in_stage(Stage.PASS, slots) & (
        state.motion.s[slots] > value_at_slot(state.motion.s, state.overtake.target_slot[slots])
    )
    beside = neighbours.gap[RIGHT_LEADER, slots] < params.constants.min_return_gap
    follows = confined | (state.overtake.must_abort[slots] > 0)
    return past & beside & (neighbours.slot[RIGHT_LEADER, slots] >= 0) & ~follows


def can_abort_pass(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether who passes on a two-way road can give it up, still behind who is overtaken."""
    lead, bodies = _target_lead(state, params, slots)
    return state.is_before_return(slots) & (lead > bodies) & params.road.has_oncoming_traffic


def _target_lead(state: State, params: StepParameters, slots: SlotSelection) -> tuple[F32, F32]:
    """How far ahead the target is, and has to be for a driver to fall in behind it [m]."""
    vehicles = params.vehicles
    target = state.overtake.target_slot[slots]
    bodies = vehicles.half_length[slots] + value_at_slot(vehicles.half_length, target)
    return value_at_slot(state.motion.s, target) - state.motion.s[
        slots
    ], bodies + params.constants.min_return_gap


def accel_limit_while_passing(
    state: State,
    params: StepParameters,
    context: DecisionContext,
) -> F32:
    """The acceleration that drivers in the other lane do not go beyond [m/s^2].

    Who falls back brakes until it is slower than the vehicle that it was to pass. Who is past that
    keeps behind the next one, as it has to fit in between, unless time is left to pass that, too:
    with a part of its time gap, or in the middle of the room where that is nearer.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        context: What drivers know; there is oncoming traffic on the road.

    Returns:
        Shape (vehicle, simulation).
    """
    vehicles = params.vehicles
    constants, neighbours, beliefs = params.constants, context.neighbours, context.beliefs
    along, _ = state.road_velocity()
    slow = (
        along < value_at_slot(along, state.overtake.target_slot) - constants.abort_speed_difference
    )
    brake = np.where(slow, _ZERO, -(constants.abort_decel_share * vehicles.max_assumed_decel))
    gap, closing = beliefs.gap[RIGHT_LEADER], beliefs.closing_speed[RIGHT_LEADER]
    middle = _HALF * (neighbours.gap[RIGHT_LEADER] + neighbours.gap[RIGHT_FOLLOWER])
    nearest = maximum(middle - vehicles.min_gap, _ZERO) / maximum(
        state.motion.vx, constants.slip_speed
    )
    kept, wished = (
        minimum(constants.return_time_gap_share * vehicles.time_gap, nearest),
        current_passing_speed(state, params),
    )
    fitting = acc_accel(
        constants,
        vehicles,
        state.motion.vx,
        wished,
        gap,
        closing,
        kept,
        beliefs.accel[RIGHT_LEADER],
    )
    fits_in = _must_return_before_next(state, params, context)
    return np.where(state.overtake.must_abort > 0, brake, np.where(fits_in, fitting, _FAR))
