"""Gap acceptance: what drivers intend, from the gaps that they believe to be around them.

The ego decides so, and on two-way roads every driver; `slots` selects the rows of the arrays.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import exp, maximum, minimum
from overtaking.model.scenario import ForcedDecision
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.car_following import cah_accel, imposed_accel
from overtaking.sim.reference.decision_context import Beliefs, DecisionContext, Neighbours
from overtaking.sim.reference.lane_change import anticipated_follower, lane_change_direction
from overtaking.sim.reference.pass_continuation import PassContinuation
from overtaking.sim.reference.passing import (
    accepts_oncoming_gap,
    passing_opportunity,
    tall_vehicle_gap_factor,
)
from overtaking.sim.reference.state import (
    FOLLOWER,
    LEADER,
    LEFT_FOLLOWER,
    LEFT_LEADER,
    RIGHT_FOLLOWER,
    RIGHT_LEADER,
    SlotSelection,
    State,
    value_at_slot,
)
from overtaking.world.step_parameters import StepParameters, VehicleParameters

_STEADY = np.float32(0.0)

_ONE = np.float32(1.0)

_MIN_GAP_FACTOR = np.float32(1e-6)  # Keeps the imposed braking finite without demands [1].


@dataclass(slots=True, kw_only=True)
class GapAcceptanceInputs:
    """What drivers know when they decide; arrays of the shape of `slots`, or one for each role.

    Attributes:
        slots: Slots of the drivers.
        vehicle: Parameters of the drivers and their vehicles.
        speed: Speed [m/s].
        gap: Believed gaps, by role [m].
        closing_speed: Believed closing speeds, by role [m/s].
        is_detected: Whether the driver has detected the neighbour, by role.
        leader_speed: Believed speed of the leader [m/s].
        gap_factor: Factor on the gaps that the driver asks for now [1].
        acceptable_imposed_decel: Largest braking that the driver imposes on others, positive
            [m/s^2].
        patience_left: Share of its demands that a waiting driver still has, 1 at first [1].
        tall_vehicle_gap_factor: Factor on the gap to a leader that blocks the view [1].
        is_scripted: Whether the ego changes lanes by the script of the study: it then asks for no
            gap, ignores vehicles beside it, and cancels nothing.
        pulls_out_by_script: Whether the script makes it pull out now: it has detected a slower
            leader.
        forced_decision: `ForcedDecision` of a branch, 0 for none.
    """

    slots: SlotSelection
    vehicle: VehicleParameters
    speed: F32
    gap: F32
    closing_speed: F32
    is_detected: Mask
    leader_speed: F32
    gap_factor: F32
    acceptable_imposed_decel: F32
    patience_left: F32
    tall_vehicle_gap_factor: F32 | np.float32
    is_scripted: Mask
    pulls_out_by_script: Mask
    forced_decision: F32


@dataclass(slots=True, kw_only=True)
class Intent:
    """What drivers intend and start at a decision; masks of the shape of the selected slots.

    Attributes:
        wants_to_pull_out: Wants to pull out, and indicates it.
        wants_to_return: Wants to return, and indicates it.
        starts_pull_out: Starts to pull out now.
        starts_return: Starts to return now.
        cancels_pull_out: Gives up pulling out, or passing, and goes back now.
        cancels_return: Gives up returning and goes back to the left now.
        has_passed_target: The target's front is visibly behind the own rear.
        has_finished_lane_change: The last lane change is over.
    """

    wants_to_pull_out: Mask
    wants_to_return: Mask
    starts_pull_out: Mask
    starts_return: Mask
    cancels_pull_out: Mask
    cancels_return: Mask
    has_passed_target: Mask
    has_finished_lane_change: Mask


def gap_acceptance_inputs(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    beliefs: Beliefs,
    slots: SlotSelection,
) -> GapAcceptanceInputs:
    """What drivers believe, and how much they demand after their wait.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        neighbours: Neighbours.
        beliefs: What drivers believe of them.
        slots: The drivers.
    """
    vehicles, simulations = params.vehicles, params.simulations
    own = vehicles.at_slots(slots)
    waited = state.overtake.time_waiting[slots] * own.inverse_patience
    impatience = maximum(exp(-waited), params.constants.patience_floor)
    gap, closing = beliefs.gap[:, slots], beliefs.closing_speed[:, slots]
    demand = own.gap_demand_factor * impatience
    told = ordered = np.zeros(demand.shape, bool)
    if slots == EGO_SLOT:
        told = is_scripted(params)
        seen = told & beliefs.is_detected[LEADER, slots]
        ordered = seen & (true_closing_speed_to_leader(state, neighbours) > own.min_speed_gain)
    # Waiting lowers the gaps that a driver asks for itself; it does not raise the braking that it
    # may impose on others (UN R157).
    bounded = minimum(
        own.safe_decel / maximum(demand, _MIN_GAP_FACTOR), params.constants.max_imposed_decel
    )
    return GapAcceptanceInputs(
        slots=slots,
        vehicle=own,
        speed=state.motion.vx[slots],
        gap=gap,
        closing_speed=closing,
        is_detected=beliefs.is_detected[:, slots],
        leader_speed=state.motion.vx[slots] - closing[LEADER],
        gap_factor=demand,
        acceptable_imposed_decel=minimum(bounded, own.max_assumed_decel),
        patience_left=impatience,
        tall_vehicle_gap_factor=tall_vehicle_gap_factor(params, neighbours.slot[LEADER, slots])
        if params.road.has_oncoming_traffic
        else _ONE,
        is_scripted=told,
        pulls_out_by_script=ordered,
        forced_decision=simulations.forced_decision
        if slots == EGO_SLOT
        else np.zeros_like(simulations.forced_decision),
    )


def is_scripted(params: StepParameters) -> Mask:
    """Whether the ego changes lanes by the script of the study: it demands no gap."""
    vehicles = params.vehicles
    return vehicles.at_slots(EGO_SLOT).gap_demand_factor <= 0


def true_closing_speed_to_leader(state: State, neighbours: Neighbours) -> F32:
    """True speed of the ego over that of its leader, by which the script decides [m/s]."""
    return state.motion.vx[EGO_SLOT] - value_at_slot(
        state.motion.vx, neighbours.slot[LEADER, EGO_SLOT]
    )


def imposed_accel_on_driver(
    params: StepParameters, inputs: GapAcceptanceInputs, gap: F32, closing: F32
) -> F32:
    """Acceleration that a vehicle ahead forces on a driver at the gap demanded now."""
    time_gap = inputs.vehicle.time_gap * inputs.gap_factor
    return imposed_accel(params.constants, inputs.vehicle, inputs.speed, gap, closing, time_gap)


def imposed_accel_by_driver(
    params: StepParameters, inputs: GapAcceptanceInputs, gap: F32, closing: F32
) -> F32:
    """Acceleration that a driver in front would force on a vehicle behind."""
    time_gap = inputs.vehicle.time_gap * inputs.gap_factor
    return imposed_accel(
        params.constants, inputs.vehicle, inputs.speed + closing, gap, closing, time_gap
    )


def wants_to_overtake(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether the leader is slow enough, and near enough, that an overtake is wanted now."""
    own = inputs.vehicle
    slower = own.desired_speed - inputs.leader_speed > own.min_speed_gain * inputs.patience_left
    soon = inputs.gap[LEADER] < own.pull_out_ttc * inputs.closing_speed[LEADER]
    kept = own.time_gap * inputs.tall_vehicle_gap_factor
    neighbours = params.constants.close_time_gap * kept * inputs.speed + own.min_gap
    close = inputs.gap[LEADER] < neighbours
    return inputs.is_detected[LEADER] & slower & (soon | close)


def accepts_pull_out_gaps(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether the next lane looks free enough, and faster, to this driver.

    The lane of oncoming traffic is free while no other is seen to overtake there.
    """
    constants, own = params.constants, inputs.vehicle
    front = (
        imposed_accel_on_driver(
            params, inputs, inputs.gap[LEFT_LEADER], inputs.closing_speed[LEFT_LEADER]
        )
        >= -own.decel
    )
    gap, closing = inputs.gap[LEFT_FOLLOWER], inputs.closing_speed[LEFT_FOLLOWER]
    now = imposed_accel_by_driver(params, inputs, gap, closing)
    rear = (
        minimum(
            now,
            imposed_accel_by_driver(params, inputs, *anticipated_follower(params, gap, closing)),
        )
        >= -inputs.acceptable_imposed_decel
    )
    rear = rear & (gap > constants.min_rear_gap * inputs.gap_factor)
    if params.road.has_oncoming_traffic:
        return rear & ~inputs.is_detected[LEFT_LEADER]
    next_speed = inputs.speed - inputs.closing_speed[LEFT_LEADER]
    gain = next_speed - inputs.leader_speed > own.min_speed_gain * inputs.patience_left
    far = inputs.gap[LEFT_LEADER] > inputs.gap[LEADER] + constants.waiting_time_gap * inputs.speed
    return front & rear & (gain | far | ~inputs.is_detected[LEFT_LEADER])


def accepts_return_gaps(
    params: StepParameters, inputs: GapAcceptanceInputs, room_left: F32 | np.float32 = _ONE
) -> Mask:
    """Whether the slower lane has room: behind when the line is crossed, ahead at the end.

    Args:
        params: Parameters of the batch.
        inputs: What drivers know.
        room_left: How much more room is left behind than to a car [1].
    """
    own, zero = inputs.vehicle, np.float32(0.0)
    closing, ahead = inputs.closing_speed[RIGHT_FOLLOWER], inputs.closing_speed[RIGHT_LEADER]
    crossing = np.float32(0.5) * own.lane_change_duration
    gap = inputs.gap[RIGHT_FOLLOWER] - crossing * minimum(closing, zero)
    left = gap >= own.return_time_gap * (inputs.speed + closing) * inputs.patience_left * room_left
    rear = left & (
        imposed_accel_by_driver(params, inputs, gap, closing) >= -inputs.acceptable_imposed_decel
    )
    room = inputs.gap[RIGHT_LEADER] - own.lane_change_duration * maximum(ahead, zero)
    front = imposed_accel_on_driver(params, inputs, room, ahead) >= -own.decel
    constants = params.constants
    # On a two-way road one returns even if one will soon catch up with the next vehicle.
    if params.road.has_oncoming_traffic:
        return rear & front & (inputs.gap[RIGHT_LEADER] > constants.min_return_gap)
    return (
        rear
        & front
        & (inputs.gap[RIGHT_LEADER] > constants.stay_time * inputs.closing_speed[RIGHT_LEADER])
    )


def lane_change_is_dangerous(
    params: StepParameters, inputs: GapAcceptanceInputs, lead: int, rear: int
) -> Mask:
    """Whether the lane being entered has turned dangerous, and the old one still has room.

    Args:
        params: Parameters of the batch.
        inputs: What drivers know.
        lead: Role of the vehicle ahead in the old lane.
        rear: Role of the vehicle behind in the old lane.
    """
    constants, own = params.constants, inputs.vehicle
    imposed = imposed_accel_by_driver(
        params, inputs, inputs.gap[FOLLOWER], inputs.closing_speed[FOLLOWER]
    )
    braking = imposed_accel_on_driver(
        params, inputs, inputs.gap[LEADER], inputs.closing_speed[LEADER]
    )
    bad = (imposed < -(constants.abort_imposed_factor * inputs.acceptable_imposed_decel)) | (
        braking < -(constants.abort_factor * own.decel)
    )
    back = cah_accel(constants, inputs.speed, inputs.gap[lead], inputs.closing_speed[lead], _STEADY)
    return bad & (back >= -own.max_assumed_decel) & (inputs.gap[rear] > constants.min_rear_gap)


def accepts_urgent_return_gaps(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether the lane beside has room enough for a driver in a hurry when the line is crossed."""
    simulations = params.simulations
    constants, closing = params.constants, inputs.closing_speed[RIGHT_LEADER]
    crossing = np.float32(0.5) * simulations.urgent_change_duration
    front = inputs.gap[RIGHT_LEADER] - crossing * closing
    rear = inputs.gap[RIGHT_FOLLOWER] - crossing * maximum(
        inputs.closing_speed[RIGHT_FOLLOWER], _STEADY
    )
    squeezed = minimum(rear, front) > constants.min_return_gap
    # It brakes on the way: waiting until it need not brake would be too late behind a slow vehicle.
    ahead = cah_accel(constants, inputs.speed, inputs.gap[RIGHT_LEADER], closing, _STEADY)
    return squeezed & (ahead >= -(constants.abort_factor * inputs.vehicle.decel))


def has_gap_behind(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether no vehicle is close behind in the right lane."""
    return inputs.gap[RIGHT_FOLLOWER] > params.constants.min_rear_gap


def form_intent(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    slots: SlotSelection,
    continuation: PassContinuation | None,
) -> Intent:
    """What drivers want, and what of it is done now that they have signalled long enough.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        context: What drivers perceive at this decision.
        slots: The drivers.
        continuation: How their pass goes on; None on one-way roads.
    """
    inputs = gap_acceptance_inputs(state, params, context.neighbours, context.beliefs, slots)
    checks_mirrors = context.checks_mirrors[slots]
    arrived = state.has_finished_lane_change(slots)
    passed = has_passed_target(state, params, slots)
    start = _wants_to_pull_out(state, params, context, inputs, arrived)
    back = _wants_to_return(state, params, inputs, passed, checks_mirrors, continuation)
    update_indicator(state, params, slots, start, back)
    ready = state.overtake.time_indicating[slots] > inputs.vehicle.indicator_lead_time
    sure = (checks_mirrors & ~context.gives_way[slots]) | inputs.is_scripted
    abort = _cancels_pull_out(state, params, inputs, checks_mirrors)
    remain = _cancels_return(state, params, inputs, checks_mirrors)
    back_now = ready
    if continuation is not None:
        falls_in = (
            continuation.must_abort & continuation.fits_into_lane & has_gap_behind(params, inputs)
        )
        back_now = (ready | continuation.must_return_urgently) & ~falls_in
        abort = abort | falls_in
        remain = np.zeros_like(remain)  # The other lane is no place to stay.
    return Intent(
        wants_to_pull_out=start,
        wants_to_return=back,
        starts_pull_out=start
        & ready
        & (sure | (inputs.forced_decision == ForcedDecision.PULL_OUT)),
        starts_return=back & back_now & (sure | (inputs.forced_decision == ForcedDecision.RETURN)),
        cancels_pull_out=abort,
        cancels_return=remain,
        has_passed_target=passed,
        has_finished_lane_change=arrived,
    )


def _wants_to_pull_out(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    inputs: GapAcceptanceInputs,
    arrived: Mask,
) -> Mask:
    """Whether an overtake is wanted and looked possible, or is forced by a branch."""
    constants, slots, oncoming = params.constants, inputs.slots, context.oncoming
    rested = state.lane_choice.time_since_lane_change[slots] >= constants.abort_cooldown
    has_lane = state.lane_choice.lane[slots] < np.float32(params.road.num_lanes - 1)
    free = state.is_in_stage(Stage.FOLLOW, slots) & arrived & rested & has_lane
    seen = wants_to_overtake(params, inputs) & accepts_pull_out_gaps(params, inputs)
    if oncoming is not None:
        opportunity = passing_opportunity(state, params, context, slots)
        seen = seen & accepts_oncoming_gap(
            params, inputs.vehicle, inputs.speed, inputs.patience_left, opportunity
        )
        seen = seen & ~oncoming.leader_pulls_out[slots]
    seen = np.where(inputs.is_scripted, inputs.pulls_out_by_script, seen)
    wanted = np.where(
        context.checks_mirrors[slots] | inputs.is_scripted,
        seen,
        state.lane_choice.wanted_side[slots] > 0,
    )
    wanted = wanted & (inputs.forced_decision != ForcedDecision.STAY)
    forced = (inputs.forced_decision == ForcedDecision.PULL_OUT) & (
        state.overtake.has_attempted == 0
    )
    return free & (wanted | forced)


def _wants_to_return(
    state: State,
    params: StepParameters,
    inputs: GapAcceptanceInputs,
    passed: Mask,
    checks_mirrors: Mask,
    continuation: PassContinuation | None,
) -> Mask:
    """Whether drivers may return: past the target, or stuck beside it, or forced by a branch."""
    constants, slots = params.constants, inputs.slots
    has_lane = state.is_in_stage(Stage.PASS, slots) & (
        state.lane_choice.lane[slots] >= np.float32(1.0)
    )
    late = state.overtake.time_in_stage[slots] > constants.give_up_after
    stuck = late & (
        state.motion.s[slots] < value_at_slot(state.motion.s, state.overtake.target_slot[slots])
    )
    rested = state.lane_choice.time_since_lane_change[slots] >= constants.abort_cooldown
    if continuation is None:
        may = accepts_return_gaps(params, inputs) & (passed | stuck)
    else:
        room = tall_vehicle_gap_factor(params, state.overtake.target_slot[slots])
        hurried = (
            continuation.accepts_small_gap & accepts_urgent_return_gaps(params, inputs) & passed
        )
        may = (accepts_return_gaps(params, inputs, room) & (passed | stuck)) | hurried
        rested = rested | hurried
    seen = np.where(inputs.is_scripted, passed, may) & rested
    wanted = np.where(
        checks_mirrors | inputs.is_scripted, seen, state.lane_choice.wanted_side[slots] < 0
    )
    return has_lane & (wanted | (inputs.forced_decision == ForcedDecision.RETURN))


def _cancels_pull_out(
    state: State, params: StepParameters, inputs: GapAcceptanceInputs, checks_mirrors: Mask
) -> Mask:
    """Whether drivers go back while pulling out: in danger, or forced by a branch."""
    danger = (
        checks_mirrors
        & ~inputs.is_scripted
        & lane_change_is_dangerous(params, inputs, RIGHT_LEADER, RIGHT_FOLLOWER)
    )
    forced = inputs.forced_decision == ForcedDecision.CANCEL
    return can_cancel_pull_out(state, params, inputs.slots) & (danger | forced)


def _cancels_return(
    state: State, params: StepParameters, inputs: GapAcceptanceInputs, checks_mirrors: Mask
) -> Mask:
    """Whether drivers give up their way back in danger, unless a branch forces a return."""
    danger = (
        checks_mirrors
        & ~inputs.is_scripted
        & lane_change_is_dangerous(params, inputs, LEFT_LEADER, LEFT_FOLLOWER)
    )
    return (
        can_cancel_return(state, params, inputs.slots)
        & danger
        & (inputs.forced_decision != ForcedDecision.RETURN)
    )


def has_passed_target(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether the target's front is visibly behind the own rear."""
    vehicles = params.vehicles
    behind = state.motion.s[slots] - value_at_slot(
        state.motion.s, state.overtake.target_slot[slots]
    )
    bodies = vehicles.half_length[slots] + value_at_slot(
        vehicles.half_length, state.overtake.target_slot[slots]
    )
    return behind > bodies + params.constants.return_clearance


def is_quicker_to_turn_back(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether going back is shorter than going on."""
    return state.path.elapsed[slots] < params.constants.abort_until * state.path.duration[slots]


def can_cancel_pull_out(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether drivers pull out, and going back is shorter than going on."""
    return state.is_in_stage(Stage.PULL_OUT, slots) & is_quicker_to_turn_back(state, params, slots)


def can_cancel_return(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether drivers change back by a whole lane, and going back is shorter than going on."""
    comes_back = state.is_in_stage(Stage.RETURN, slots) | state.is_in_stage(Stage.ABORT, slots)
    _, whole = lane_change_direction(state, params)
    return comes_back & is_quicker_to_turn_back(state, params, slots) & whole[slots]


def update_indicator(
    state: State, params: StepParameters, slots: SlotSelection, start: Mask, back: Mask
) -> None:
    """Remember the side that is wanted, and for how long it has been shown."""
    decision_index, zero, one = params.constants.decision, np.float32(0.0), np.float32(1.0)
    state.lane_choice.wanted_side[slots] = np.where(start, one, np.where(back, -one, zero))
    # Doubts while waiting do not switch the indicator off at once.
    fading = maximum(state.overtake.time_indicating[slots] - decision_index, zero)
    state.overtake.time_indicating[slots] = np.where(
        start | back, state.overtake.time_indicating[slots] + decision_index, fading
    )
