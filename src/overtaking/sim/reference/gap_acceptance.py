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
    has_finished_lane_change,
    is_in_stage,
    value_at_slot,
)
from overtaking.world.step_parameters import StepParameters, VehicleParameters
from overtaking.world.weather_parameters import SimulationParameters

_STEADY = np.float32(0.0)

_ONE = np.float32(1.0)

_MIN_GAP_FACTOR = np.float32(1e-6)  # Keeps what is imposed finite for who demands nothing [1].


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
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    near: Neighbours,
    believed: Beliefs,
    who: SlotSelection,
) -> GapAcceptanceInputs:
    """What drivers believe, and how much they demand after their wait.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        near: Neighbours.
        believed: What drivers believe of them.
        who: The drivers.
    """
    own = p.at_slots(who)
    waited = state.waited[who] * own.inverse_patience
    impatience = maximum(exp(-waited), given.constants.patience_floor)
    gap, closing = believed.gap[:, who], believed.closing_speed[:, who]
    demand = own.gap_demand_factor * impatience
    told = ordered = np.zeros(demand.shape, bool)
    if who == EGO_SLOT:
        told = is_scripted(p)
        seen = told & believed.is_detected[LEADER, who]
        ordered = seen & (true_closing_speed_to_leader(state, near) > own.min_speed_gain)
    bounded = minimum(
        own.safe_decel / maximum(demand, _MIN_GAP_FACTOR), given.constants.max_imposed_decel
    )
    return GapAcceptanceInputs(
        slots=who,
        vehicle=own,
        speed=state.vx[who],
        gap=gap,
        closing_speed=closing,
        is_detected=believed.is_detected[:, who],
        leader_speed=state.vx[who] - closing[LEADER],
        gap_factor=demand,
        acceptable_imposed_decel=minimum(bounded, own.max_assumed_decel),
        patience_left=impatience,
        tall_vehicle_gap_factor=tall_vehicle_gap_factor(given.constants, p, near.slot[LEADER, who])
        if given.road.has_oncoming_traffic
        else _ONE,
        is_scripted=told,
        pulls_out_by_script=ordered,
        forced_decision=q.forced_decision if who == EGO_SLOT else np.zeros_like(q.forced_decision),
    )


def is_scripted(p: VehicleParameters) -> Mask:
    """Whether the ego is told to change lanes, as in the study: it demands no gap."""
    return p.at_slots(EGO_SLOT).gap_demand_factor <= 0


def true_closing_speed_to_leader(state: State, near: Neighbours) -> F32:
    """By how much the ego is in truth faster than its leader, which decides where it is told."""
    return state.vx[EGO_SLOT] - value_at_slot(state.vx, near.slot[LEADER, EGO_SLOT])


def imposed_accel_on_driver(
    given: StepParameters, view: GapAcceptanceInputs, gap: F32, closing: F32
) -> F32:
    """Acceleration that a vehicle ahead forces on a driver at the gap demanded now."""
    time_gap = view.vehicle.time_gap * view.gap_factor
    return imposed_accel(given.constants, view.vehicle, view.speed, gap, closing, time_gap)


def imposed_accel_by_driver(
    given: StepParameters, view: GapAcceptanceInputs, gap: F32, closing: F32
) -> F32:
    """Acceleration that a driver in front would force on a vehicle behind."""
    time_gap = view.vehicle.time_gap * view.gap_factor
    return imposed_accel(
        given.constants, view.vehicle, view.speed + closing, gap, closing, time_gap
    )


def wants_to_overtake(given: StepParameters, view: GapAcceptanceInputs) -> Mask:
    """Whether the leader is slow enough, and near enough, that an overtake is wanted now."""
    own = view.vehicle
    slower = own.desired_speed - view.leader_speed > own.min_speed_gain * view.patience_left
    soon = view.gap[LEADER] < own.pull_out_ttc * view.closing_speed[LEADER]
    kept = own.time_gap * view.tall_vehicle_gap_factor
    near = given.constants.close_time_gap * kept * view.speed + own.min_gap
    close = view.gap[LEADER] < near
    return view.is_detected[LEADER] & slower & (soon | close)


def accepts_pull_out_gaps(given: StepParameters, view: GapAcceptanceInputs) -> Mask:
    """Whether the next lane looks free enough, and faster, to this driver.

    The lane of oncoming traffic is free while no other is seen to overtake there.
    """
    c, own = given.constants, view.vehicle
    front = (
        imposed_accel_on_driver(given, view, view.gap[LEFT_LEADER], view.closing_speed[LEFT_LEADER])
        >= -own.decel
    )
    gap, closing = view.gap[LEFT_FOLLOWER], view.closing_speed[LEFT_FOLLOWER]
    now = imposed_accel_by_driver(given, view, gap, closing)
    rear = (
        minimum(
            now, imposed_accel_by_driver(given, view, *anticipated_follower(given, gap, closing))
        )
        >= -view.acceptable_imposed_decel
    )
    rear = rear & (gap > c.min_rear_gap * view.gap_factor)
    if given.road.has_oncoming_traffic:
        return rear & ~view.is_detected[LEFT_LEADER]
    next_speed = view.speed - view.closing_speed[LEFT_LEADER]
    gain = next_speed - view.leader_speed > own.min_speed_gain * view.patience_left
    far = view.gap[LEFT_LEADER] > view.gap[LEADER] + c.waiting_time_gap * view.speed
    return front & rear & (gain | far | ~view.is_detected[LEFT_LEADER])


def accepts_return_gaps(
    given: StepParameters, view: GapAcceptanceInputs, room_left: F32 | np.float32 = _ONE
) -> Mask:
    """Whether the slower lane has room: behind when the line is crossed, ahead at the end.

    Args:
        given: All inputs.
        view: What drivers know.
        room_left: How much more room is left behind than to a car [1].
    """
    own, zero = view.vehicle, np.float32(0.0)
    closing, ahead = view.closing_speed[RIGHT_FOLLOWER], view.closing_speed[RIGHT_LEADER]
    crossing = np.float32(0.5) * own.lane_change_duration
    gap = view.gap[RIGHT_FOLLOWER] - crossing * minimum(closing, zero)
    left = gap >= own.return_time_gap * (view.speed + closing) * view.patience_left * room_left
    rear = left & (
        imposed_accel_by_driver(given, view, gap, closing) >= -view.acceptable_imposed_decel
    )
    room = view.gap[RIGHT_LEADER] - own.lane_change_duration * maximum(ahead, zero)
    front = imposed_accel_on_driver(given, view, room, ahead) >= -own.decel
    c = given.constants
    # On a two-way road one returns even if one will soon catch up with the next vehicle.
    if given.road.has_oncoming_traffic:
        return rear & front & (view.gap[RIGHT_LEADER] > c.min_return_gap)
    return rear & front & (view.gap[RIGHT_LEADER] > c.stay_time * view.closing_speed[RIGHT_LEADER])


def lane_change_is_dangerous(
    given: StepParameters, view: GapAcceptanceInputs, lead: int, rear: int
) -> Mask:
    """Whether the lane being entered has turned dangerous, and the old one still has room.

    Args:
        given: All inputs.
        view: What drivers know.
        lead: Role of the vehicle ahead in the old lane.
        rear: Role of the vehicle behind in the old lane.
    """
    c, own = given.constants, view.vehicle
    imposed = imposed_accel_by_driver(given, view, view.gap[FOLLOWER], view.closing_speed[FOLLOWER])
    braking = imposed_accel_on_driver(given, view, view.gap[LEADER], view.closing_speed[LEADER])
    bad = (imposed < -(c.abort_imposed_factor * view.acceptable_imposed_decel)) | (
        braking < -(c.abort_factor * own.decel)
    )
    back = cah_accel(c, view.speed, view.gap[lead], view.closing_speed[lead], _STEADY)
    return bad & (back >= -own.max_assumed_decel) & (view.gap[rear] > c.min_rear_gap)


def accepts_urgent_return_gaps(
    given: StepParameters, q: SimulationParameters, view: GapAcceptanceInputs
) -> Mask:
    """Whether the lane beside has room enough for a driver in a hurry when the line is crossed."""
    c, closing = given.constants, view.closing_speed[RIGHT_LEADER]
    crossing = np.float32(0.5) * q.urgent_change_duration
    front = view.gap[RIGHT_LEADER] - crossing * closing
    rear = view.gap[RIGHT_FOLLOWER] - crossing * maximum(
        view.closing_speed[RIGHT_FOLLOWER], _STEADY
    )
    squeezed = minimum(rear, front) > c.min_return_gap
    # It brakes on the way: who waits until it need not never gets behind a slow vehicle in time.
    ahead = cah_accel(c, view.speed, view.gap[RIGHT_LEADER], closing, _STEADY)
    return squeezed & (ahead >= -(c.abort_factor * view.vehicle.decel))


def has_gap_behind(given: StepParameters, view: GapAcceptanceInputs) -> Mask:
    """Whether nobody is close behind in the slower lane."""
    return view.gap[RIGHT_FOLLOWER] > given.constants.min_rear_gap


def form_intent(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    moment: DecisionContext,
    who: SlotSelection,
    plight: PassContinuation | None,
) -> Intent:
    """What drivers want, and what of it is done now that they have signalled long enough.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        moment: What drivers know.
        who: The drivers.
        plight: How they stand to oncoming traffic; None where there is none on the road.
    """
    view = gap_acceptance_inputs(state, given, p, q, moment.neighbours, moment.beliefs, who)
    looks = moment.checks_mirrors[who]
    arrived = has_finished_lane_change(state, who)
    passed = has_passed_target(state, given, p, who)
    start = _wants_to_pull_out(state, given, p, moment, view, arrived)
    back = _wants_to_return(state, given, p, q, view, passed, looks, plight)
    update_indicator(state, given, who, start, back)
    ready = state.signalled[who] > view.vehicle.indicator_lead_time
    sure = (looks & ~moment.gives_way[who]) | view.is_scripted
    abort = _cancels_pull_out(state, given, view, looks)
    remain = _cancels_return(state, given, view, looks)
    back_now = ready
    if plight is not None:
        falls_in = plight.must_abort & plight.fits_into_lane & has_gap_behind(given, view)
        back_now = (ready | plight.must_return_urgently) & ~falls_in
        abort = abort | falls_in
        remain = np.zeros_like(remain)  # The other lane is no place to stay.
    return Intent(
        wants_to_pull_out=start,
        wants_to_return=back,
        starts_pull_out=start & ready & (sure | (view.forced_decision == ForcedDecision.PULL_OUT)),
        starts_return=back & back_now & (sure | (view.forced_decision == ForcedDecision.RETURN)),
        cancels_pull_out=abort,
        cancels_return=remain,
        has_passed_target=passed,
        has_finished_lane_change=arrived,
    )


def _wants_to_pull_out(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    moment: DecisionContext,
    view: GapAcceptanceInputs,
    arrived: Mask,
) -> Mask:
    """Whether an overtake is wanted and looked possible, or is forced by a branch."""
    c, who, met = given.constants, view.slots, moment.oncoming
    rested = state.since_change[who] >= c.abort_cooldown
    has_lane = state.lane[who] < np.float32(given.road.num_lanes - 1)
    free = is_in_stage(state, who, Stage.FOLLOW) & arrived & rested & has_lane
    seen = wants_to_overtake(given, view) & accepts_pull_out_gaps(given, view)
    if met is not None:
        leader = view.gap[LEADER], view.leader_speed
        ahead = passing_opportunity(state, given, p, moment.neighbours, met.nearest, who, leader)
        seen = seen & accepts_oncoming_gap(
            given, view.vehicle, view.speed, view.patience_left, ahead
        )
        seen = seen & ~met.leader_pulls_out[who]
    seen = np.where(view.is_scripted, view.pulls_out_by_script, seen)
    wanted = np.where(moment.checks_mirrors[who] | view.is_scripted, seen, state.wanted[who] > 0)
    wanted = wanted & (view.forced_decision != ForcedDecision.STAY)
    forced = (view.forced_decision == ForcedDecision.PULL_OUT) & (state.attempted == 0)
    return free & (wanted | forced)


def _wants_to_return(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    view: GapAcceptanceInputs,
    passed: Mask,
    looks: Mask,
    plight: PassContinuation | None,
) -> Mask:
    """Whether drivers may return: past the target, or stuck beside it, or forced by a branch."""
    c, who = given.constants, view.slots
    has_lane = is_in_stage(state, who, Stage.PASS) & (state.lane[who] >= np.float32(1.0))
    late = state.stage_time[who] > c.give_up_after
    stuck = late & (state.s[who] < value_at_slot(state.s, state.target[who]))
    rested = state.since_change[who] >= c.abort_cooldown
    if plight is None:
        may = accepts_return_gaps(given, view) & (passed | stuck)
    else:
        room = tall_vehicle_gap_factor(c, p, state.target[who])
        hurried = plight.accepts_small_gap & accepts_urgent_return_gaps(given, q, view) & passed
        may = (accepts_return_gaps(given, view, room) & (passed | stuck)) | hurried
        rested = rested | hurried
    seen = np.where(view.is_scripted, passed, may) & rested
    wanted = np.where(looks | view.is_scripted, seen, state.wanted[who] < 0)
    return has_lane & (wanted | (view.forced_decision == ForcedDecision.RETURN))


def _cancels_pull_out(
    state: State, given: StepParameters, view: GapAcceptanceInputs, looks: Mask
) -> Mask:
    """Whether drivers go back while pulling out: in danger, or forced by a branch."""
    danger = (
        looks
        & ~view.is_scripted
        & lane_change_is_dangerous(given, view, RIGHT_LEADER, RIGHT_FOLLOWER)
    )
    forced = view.forced_decision == ForcedDecision.CANCEL
    return can_cancel_pull_out(state, given, view.slots) & (danger | forced)


def _cancels_return(
    state: State, given: StepParameters, view: GapAcceptanceInputs, looks: Mask
) -> Mask:
    """Whether drivers give up their way back in danger, unless a branch forces a return."""
    danger = (
        looks
        & ~view.is_scripted
        & lane_change_is_dangerous(given, view, LEFT_LEADER, LEFT_FOLLOWER)
    )
    return (
        can_cancel_return(state, given, view.slots)
        & danger
        & (view.forced_decision != ForcedDecision.RETURN)
    )


def has_passed_target(
    state: State, given: StepParameters, p: VehicleParameters, who: SlotSelection
) -> Mask:
    """Whether the target's front is visibly behind the own rear."""
    behind = state.s[who] - value_at_slot(state.s, state.target[who])
    bodies = p.half_length[who] + value_at_slot(p.half_length, state.target[who])
    return behind > bodies + given.constants.return_clearance


def is_quicker_to_turn_back(state: State, given: StepParameters, who: SlotSelection) -> Mask:
    """Whether going back is shorter than going on."""
    return state.path_time[who] < given.constants.abort_until * state.path_duration[who]


def can_cancel_pull_out(state: State, given: StepParameters, who: SlotSelection) -> Mask:
    """Whether drivers pull out, and going back is shorter than going on."""
    return is_in_stage(state, who, Stage.PULL_OUT) & is_quicker_to_turn_back(state, given, who)


def can_cancel_return(state: State, given: StepParameters, who: SlotSelection) -> Mask:
    """Whether drivers change back by a whole lane, and going back is shorter than going on."""
    comes_back = is_in_stage(state, who, Stage.RETURN) | is_in_stage(state, who, Stage.ABORT)
    _, whole = lane_change_direction(state, given)
    return comes_back & is_quicker_to_turn_back(state, given, who) & whole[who]


def update_indicator(
    state: State, given: StepParameters, who: SlotSelection, start: Mask, back: Mask
) -> None:
    """Remember the side that is wanted, and for how long it has been shown."""
    decision, zero, one = given.constants.decision, np.float32(0.0), np.float32(1.0)
    state.wanted[who] = np.where(start, one, np.where(back, -one, zero))
    # Doubts while waiting do not switch the indicator off at once.
    fading = maximum(state.signalled[who] - decision, zero)
    state.signalled[who] = np.where(start | back, state.signalled[who] + decision, fading)
