"""Gap acceptance: whether drivers pull out, return or cancel, by the gaps in which they believe.

On one-way roads the ego, the vehicle under study, decides by gap acceptance and the others by MOBIL
(`lane_change`). On two-way roads all drivers decide by it. `slots` selects the drivers: an int
gives arrays of shape (simulation,), a slice (vehicle, simulation). Left is the overtaking side. The
target is the vehicle that a driver overtakes. A branch is a what-if repetition of a simulation, in
which decisions can be forced on the ego.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, ZERO, exp, maximum, minimum
from overtaking.model.scenario import ForcedDecision
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.car_following import Leader, cah_accel, imposed_accel
from overtaking.sim.reference.decision_context import DecisionContext, Neighbours
from overtaking.sim.reference.lane_change import (
    LaneChangeRisk,
    anticipated_follower,
    lane_change_direction,
    lane_change_is_dangerous,
)
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

# Keeps the imposed braking finite for an ego with a script, whose gap factor is 0 [1].
_MIN_GAP_FACTOR = np.float32(1e-6)


@dataclass(slots=True, kw_only=True)
class GapAcceptanceInputs:
    """Beliefs and demands of drivers at a decision.

    Arrays have the shape of the slots. Those by role have the role as an additional first axis.

    Attributes:
        slots: Slots of the drivers.
        vehicle: Parameters of the drivers and their vehicles.
        speed: Speed [m/s].
        gap: Believed gaps, by role [m].
        closing_speed: Believed speeds at which the gaps shrink, by role [m/s].
        is_detected: Whether the driver has detected the neighbour, by role.
        leader_speed: Believed speed of the leader [m/s].
        gap_factor: Factor on the gaps that the driver asks for now, 0 with a script [1].
        acceptable_imposed_decel: Largest braking that the driver imposes on others, positive
            [m/s^2].
        patience_left: Share of its demands that a driver keeps after waiting, 1 at first [1].
        tall_vehicle_gap_factor: Factor on the gap to a leader that blocks the view [1].
        is_scripted: Whether the ego changes lanes by the script of the study by Pinto et al.
            (2023): it asks for no gap, ignores vehicles beside it, and cancels nothing.
        pulls_out_by_script: Whether the script makes it pull out now: it has detected a slower
            leader.
        forced_decision: Decision that a branch forces on the ego, a `ForcedDecision`; 0 without
            one.
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

    def leader(self, role: int) -> Leader:
        """The leader in a role as the driver believes, assumed to keep its speed."""
        return Leader(gap=self.gap[role], closing_speed=self.closing_speed[role])

    def lane_change_risk(self, old_leader_role: int) -> LaneChangeRisk:
        """The lane change that is under way, as the driver judges it.

        Args:
            old_leader_role: Role of the leader in the old lane, from which the driver moves. The
                follower of a lane has the role after its leader's.
        """
        return LaneChangeRisk(
            vehicle=self.vehicle,
            speed=self.speed,
            time_gap=self.vehicle.time_gap * self.gap_factor,
            acceptable_imposed_decel=self.acceptable_imposed_decel,
            leader=self.leader(LEADER),
            follower_gap=self.gap[FOLLOWER],
            follower_closing_speed=self.closing_speed[FOLLOWER],
            old_leader=self.leader(old_leader_role),
            old_follower_gap=self.gap[old_leader_role + 1],
        )


@dataclass(slots=True, kw_only=True)
class Intent:
    """Wishes and actions of drivers at a decision; masks of the shape of the selected slots.

    Attributes:
        wants_to_pull_out: Wants to pull out, and indicates it.
        wants_to_return: Wants to return, and indicates it.
        starts_pull_out: Starts to pull out now.
        starts_return: Starts to return now.
        cancels_pull_out: Gives up pulling out, or passing, and goes back to the right now.
        cancels_return: Gives up returning and goes back to the left now.
        has_passed_target: The target's front is visibly behind the driver's rear.
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
    state: State, params: StepParameters, context: DecisionContext, slots: SlotSelection
) -> GapAcceptanceInputs:
    """Beliefs of drivers, and their demands, which fall while they wait behind a slower leader."""
    constants, neighbours, beliefs = params.constants, context.neighbours, context.beliefs
    vehicle = params.vehicles.at_slots(slots)
    gap, closing_speed = beliefs.gap[:, slots], beliefs.closing_speed[:, slots]
    relative_wait = state.overtake.time_waiting[slots] * vehicle.inverse_patience
    patience_left = maximum(exp(-relative_wait), constants.patience_floor)
    gap_factor = vehicle.gap_demand_factor * patience_left
    # A driver that has waited also imposes harder braking on its follower. Two limits remain:
    # `max_imposed_decel`, 6 m/s^2 by UN Regulation 157, and the braking that the believed friction
    # allows (`max_assumed_decel`).
    imposed_decel = minimum(
        vehicle.safe_decel / maximum(gap_factor, _MIN_GAP_FACTOR), constants.max_imposed_decel
    )
    tall_factor = ONE
    if params.road.has_oncoming_traffic:
        tall_factor = tall_vehicle_gap_factor(params, neighbours.slot[LEADER, slots])
    # Only the ego can have a script or a forced decision.
    follows_script = pulls_out = np.zeros(gap_factor.shape, bool)
    forced_decision = np.zeros_like(params.simulations.forced_decision)
    if slots == EGO_SLOT:
        follows_script = is_scripted(params)
        has_slower_leader = true_closing_speed_to_leader(state, neighbours) > vehicle.min_speed_gain
        pulls_out = follows_script & beliefs.is_detected[LEADER, slots] & has_slower_leader
        forced_decision = params.simulations.forced_decision
    return GapAcceptanceInputs(
        slots=slots,
        vehicle=vehicle,
        speed=state.motion.vx[slots],
        gap=gap,
        closing_speed=closing_speed,
        is_detected=beliefs.is_detected[:, slots],
        leader_speed=state.motion.vx[slots] - closing_speed[LEADER],
        gap_factor=gap_factor,
        acceptable_imposed_decel=minimum(imposed_decel, vehicle.max_assumed_decel),
        patience_left=patience_left,
        tall_vehicle_gap_factor=tall_factor,
        is_scripted=follows_script,
        pulls_out_by_script=pulls_out,
        forced_decision=forced_decision,
    )


def is_scripted(params: StepParameters) -> Mask:
    """Whether the ego changes lanes by the script of the study: it asks for no gap."""
    return params.vehicles.at_slots(EGO_SLOT).gap_demand_factor <= 0


def true_closing_speed_to_leader(state: State, neighbours: Neighbours) -> F32:
    """True speed of the ego minus its leader's, 0 without a leader [m/s].

    The script decides by it. An ego that decided by its belief would pull out too late: it notices
    the closing speed only when the leader looms, and the study's egos pull out 31 to 56 m behind.
    """
    # Without a leader, `value_at_slot` takes slot 0, the ego itself.
    leader_slot = neighbours.slot[LEADER, EGO_SLOT]
    return state.motion.vx[EGO_SLOT] - value_at_slot(state.motion.vx, leader_slot)


def imposed_accel_on_driver(
    params: StepParameters, inputs: GapAcceptanceInputs, leader: Leader
) -> F32:
    """Acceleration, never positive, that a leader imposes on drivers [m/s^2].

    It follows from the time gap that the drivers ask for now.
    """
    time_gap = inputs.vehicle.time_gap * inputs.gap_factor
    return imposed_accel(params.constants, inputs.vehicle, inputs.speed, time_gap, leader)


def imposed_accel_by_driver(
    params: StepParameters, inputs: GapAcceptanceInputs, gap: F32, closing_speed: F32
) -> F32:
    """Acceleration, never positive, that drivers impose on a follower [m/s^2].

    It follows from the time gap that the drivers ask for now: they assume that the follower is like
    themselves.

    Args:
        params: Parameters of the batch.
        inputs: Beliefs and demands of the driver.
        gap: Gap to the follower [m].
        closing_speed: Speed of the follower minus the driver's [m/s].
    """
    driver = Leader(gap=gap, closing_speed=closing_speed)
    time_gap = inputs.vehicle.time_gap * inputs.gap_factor
    follower_speed = inputs.speed + closing_speed
    return imposed_accel(params.constants, inputs.vehicle, follower_speed, time_gap, driver)


def wants_to_overtake(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether the leader is so slow and so near that the driver wants to overtake now."""
    vehicle, leader = inputs.vehicle, inputs.leader(LEADER)
    speed_gain = vehicle.desired_speed - inputs.leader_speed
    is_slow = speed_gain > vehicle.min_speed_gain * inputs.patience_left
    is_reached_soon = leader.gap < vehicle.pull_out_ttc * leader.closing_speed
    kept_time_gap = vehicle.time_gap * inputs.tall_vehicle_gap_factor
    # `close_time_gap` is a factor: a leader within 1.5 time gaps holds the driver up.
    near_gap = params.constants.close_time_gap * kept_time_gap * inputs.speed + vehicle.min_gap
    is_near = leader.gap < near_gap
    return inputs.is_detected[LEADER] & is_slow & (is_reached_soon | is_near)


def accepts_pull_out_gaps(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether the lane on the left looks free enough and, on one-way roads, better.

    It is better if its leader is faster, farther away by `waiting_time_gap`, or not detected.
    On two-way roads the left lane is the opposing lane. A leader there is overtaking too, and the
    driver waits for it. `accepts_oncoming_gap` judges oncoming vehicles.
    """
    constants, vehicle = params.constants, inputs.vehicle
    leader = inputs.leader(LEFT_LEADER)
    accel = imposed_accel_on_driver(params, inputs, leader)
    is_free_ahead = accel >= -vehicle.decel
    gap, closing_speed = inputs.gap[LEFT_FOLLOWER], inputs.closing_speed[LEFT_FOLLOWER]
    follower_accel_now = imposed_accel_by_driver(params, inputs, gap, closing_speed)
    # `anticipated_follower` gives gap and closing speed of a follower that accelerates for 2 s.
    follower_accel_soon = imposed_accel_by_driver(
        params, inputs, *anticipated_follower(params, gap, closing_speed)
    )
    follower_accel = minimum(follower_accel_now, follower_accel_soon)
    is_free_behind = (follower_accel >= -inputs.acceptable_imposed_decel) & (
        gap > constants.min_rear_gap * inputs.gap_factor
    )
    has_no_leader = ~inputs.is_detected[LEFT_LEADER]
    if params.road.has_oncoming_traffic:
        return is_free_behind & has_no_leader
    # Speed of the left leader minus the speed of the present leader.
    speed_gain = (inputs.speed - leader.closing_speed) - inputs.leader_speed
    is_faster = speed_gain > vehicle.min_speed_gain * inputs.patience_left
    extra_gap = constants.waiting_time_gap * inputs.speed
    is_far = leader.gap > inputs.gap[LEADER] + extra_gap
    return is_free_ahead & is_free_behind & (is_faster | is_far | has_no_leader)


def accepts_return_gaps(
    params: StepParameters, inputs: GapAcceptanceInputs, target_gap_factor: F32 | np.float32 = ONE
) -> Mask:
    """Whether the lane on the right has space for the return.

    Drivers judge the gap behind for the time when they cross the line, half-way through the lane
    change, and the gap ahead for the end of the lane change.

    Args:
        params: Parameters of the batch.
        inputs: Beliefs and demands of the drivers.
        target_gap_factor: Factor on the gap that drivers leave to their target, 1 for a car [1].
    """
    constants, vehicle = params.constants, inputs.vehicle
    leader, closing_speed = inputs.leader(RIGHT_LEADER), inputs.closing_speed[RIGHT_FOLLOWER]
    time_to_line = HALF * vehicle.lane_change_duration
    # Only growth of the gap counts here: the imposed braking already covers a gap that shrinks.
    follower_gap = inputs.gap[RIGHT_FOLLOWER] - time_to_line * minimum(closing_speed, ZERO)
    follower_speed = inputs.speed + closing_speed
    min_gap = vehicle.return_time_gap * follower_speed * inputs.patience_left * target_gap_factor
    follower_accel = imposed_accel_by_driver(params, inputs, follower_gap, closing_speed)
    is_free_behind = (follower_gap >= min_gap) & (
        follower_accel >= -inputs.acceptable_imposed_decel
    )
    leader_gap = leader.gap - vehicle.lane_change_duration * maximum(leader.closing_speed, ZERO)
    leader_at_end = Leader(gap=leader_gap, closing_speed=leader.closing_speed)
    is_free_ahead = imposed_accel_on_driver(params, inputs, leader_at_end) >= -vehicle.decel
    # On a two-way road drivers return even if they soon reach the next vehicle.
    if params.road.has_oncoming_traffic:
        return is_free_behind & is_free_ahead & (leader.gap > constants.min_return_gap)
    # On a one-way road a driver stays left if it would have to pull out again within `stay_time`.
    stays_free = leader.gap > constants.stay_time * leader.closing_speed
    return is_free_behind & is_free_ahead & stays_free


def accepts_urgent_return_gaps(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether the lane on the right has the least space for an urgent return.

    Drivers judge both gaps for the time when they cross the line. They accept braking behind the
    leader, up to the limit at which they would cancel a lane change: if they waited for a gap
    without braking, they would return too late behind a slow vehicle.
    """
    constants = params.constants
    leader, closing_speed = inputs.leader(RIGHT_LEADER), inputs.closing_speed[RIGHT_FOLLOWER]
    time_to_line = HALF * params.simulations.urgent_change_duration
    # The gap ahead may also grow until then, so a driver slower than the leader need not wait for
    # it. Of the gap behind, which no imposed braking covers here, only shrinking counts (a choice).
    leader_gap = leader.gap - time_to_line * leader.closing_speed
    follower_gap = inputs.gap[RIGHT_FOLLOWER] - time_to_line * maximum(closing_speed, ZERO)
    has_space = minimum(follower_gap, leader_gap) > constants.min_return_gap
    accel = cah_accel(constants, inputs.speed, leader)
    # `abort_factor` is a factor on the comfortable deceleration.
    return has_space & (accel >= -(constants.abort_factor * inputs.vehicle.decel))


def has_gap_behind(params: StepParameters, inputs: GapAcceptanceInputs) -> Mask:
    """Whether drivers believe that no vehicle is close behind them in the right lane."""
    return inputs.gap[RIGHT_FOLLOWER] > params.constants.min_rear_gap


def form_intent(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    slots: SlotSelection,
    continuation: PassContinuation | None,
) -> Intent:
    """Wishes of drivers, and the lane changes that they start or cancel now.

    Args:
        state: `lane_choice.wanted_side` and `overtake.time_indicating` change.
        params: Parameters of the batch.
        context: Perception of the drivers at this decision.
        slots: Slots of the drivers.
        continuation: Whether the drivers complete or abort their pass; None on one-way roads.
    """
    inputs = gap_acceptance_inputs(state, params, context, slots)
    wants_to_pull_out = _wants_to_pull_out(state, params, context, inputs)
    wants_to_return = _wants_to_return(state, params, context, inputs, continuation)
    store_wanted_side(state, params, slots, wants_to_pull_out, wants_to_return)
    has_indicated = state.overtake.time_indicating[slots] > inputs.vehicle.indicator_lead_time
    # A driver moves over only right after a check of its mirrors. It gives way to another driver
    # that indicates into the same lane and goes first.
    may_move_over = (context.checks_mirrors[slots] & ~context.gives_way[slots]) | inputs.is_scripted
    forced_decision = inputs.forced_decision
    cancels_pull_out = _cancels_pull_out(state, params, context, inputs)
    cancels_return = _cancels_return(state, params, context, inputs)
    may_return = has_indicated
    if continuation is not None:
        # A driver that aborts does not wait for mirrors or indicator. It goes back behind its
        # target as soon as braking will leave a gap to the target and to the leader in the right
        # lane. `overtake` carries this out as a cancelled pull-out.
        falls_back = (
            continuation.must_abort & continuation.fits_into_lane & has_gap_behind(params, inputs)
        )
        # An urgent return does not wait for the indicator lead time.
        may_return = (has_indicated | continuation.must_return_urgently) & ~falls_back
        cancels_pull_out = cancels_pull_out | falls_back
        # On two-way roads no driver cancels a return: it cannot stay in the opposing lane.
        cancels_return = np.zeros_like(cancels_return)
    return Intent(
        wants_to_pull_out=wants_to_pull_out,
        wants_to_return=wants_to_return,
        starts_pull_out=wants_to_pull_out
        & has_indicated
        & (may_move_over | (forced_decision == ForcedDecision.PULL_OUT)),
        starts_return=wants_to_return
        & may_return
        & (may_move_over | (forced_decision == ForcedDecision.RETURN)),
        cancels_pull_out=cancels_pull_out,
        cancels_return=cancels_return,
        has_passed_target=has_passed_target(state, params, slots),
        has_finished_lane_change=state.has_finished_lane_change(slots),
    )


def _wants_to_pull_out(
    state: State, params: StepParameters, context: DecisionContext, inputs: GapAcceptanceInputs
) -> Mask:
    """Whether drivers want to overtake and accept the gaps, or a branch forces them to."""
    constants, slots, oncoming = params.constants, inputs.slots, context.oncoming
    # The pause keeps a driver that has cancelled a lane change from starting it again at once.
    has_paused = state.lane_choice.time_since_lane_change[slots] >= constants.abort_cooldown
    has_left_lane = state.lane_choice.lane[slots] < np.float32(params.road.num_lanes - 1)
    follows = state.is_in_stage(Stage.FOLLOW, slots)
    can_pull_out = follows & state.has_finished_lane_change(slots) & has_paused & has_left_lane
    wants_now = wants_to_overtake(params, inputs) & accepts_pull_out_gaps(params, inputs)
    if oncoming is not None:
        opportunity = passing_opportunity(state, params, context, slots)
        wants_now = wants_now & accepts_oncoming_gap(
            params, inputs.vehicle, inputs.speed, inputs.patience_left, opportunity
        )
        wants_now = wants_now & ~oncoming.leader_pulls_out[slots]
    wants_now = np.where(inputs.is_scripted, inputs.pulls_out_by_script, wants_now)
    # Between two checks of the mirrors drivers keep their intention.
    decides = context.checks_mirrors[slots] | inputs.is_scripted
    wants = np.where(decides, wants_now, state.lane_choice.wanted_side[slots] > 0)
    wants = wants & (inputs.forced_decision != ForcedDecision.STAY)
    # A branch forces the first attempt only; later ones are the driver's own.
    is_forced = (inputs.forced_decision == ForcedDecision.PULL_OUT) & (
        state.overtake.has_attempted == 0
    )
    return can_pull_out & (wants | is_forced)


def _wants_to_return(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    inputs: GapAcceptanceInputs,
    continuation: PassContinuation | None,
) -> Mask:
    """Whether drivers want to return: past the target, stuck beside it, or forced by a branch."""
    constants, slots = params.constants, inputs.slots
    target_slot = state.overtake.target_slot[slots]
    has_right_lane = state.lane_choice.lane[slots] >= ONE
    can_return = state.is_in_stage(Stage.PASS, slots) & has_right_lane
    is_behind_target = state.motion.s[slots] < value_at_slot(state.motion.s, target_slot)
    is_stuck = is_behind_target & (state.overtake.time_in_stage[slots] > constants.give_up_after)
    has_passed = has_passed_target(state, params, slots)
    has_paused = state.lane_choice.time_since_lane_change[slots] >= constants.abort_cooldown
    if continuation is None:
        accepts_gaps = accepts_return_gaps(params, inputs) & (has_passed | is_stuck)
    else:
        target_gap_factor = tall_vehicle_gap_factor(params, target_slot)
        accepts_usual_gaps = accepts_return_gaps(params, inputs, target_gap_factor)
        accepts_small_gaps = (
            continuation.accepts_small_gap & accepts_urgent_return_gaps(params, inputs) & has_passed
        )
        accepts_gaps = (accepts_usual_gaps & (has_passed | is_stuck)) | accepts_small_gaps
        # An urgent return does not wait for the pause after the pull-out.
        has_paused = has_paused | accepts_small_gaps
    wants_now = np.where(inputs.is_scripted, has_passed, accepts_gaps) & has_paused
    decides = context.checks_mirrors[slots] | inputs.is_scripted
    wants = np.where(decides, wants_now, state.lane_choice.wanted_side[slots] < 0)
    return can_return & (wants | (inputs.forced_decision == ForcedDecision.RETURN))


def _cancels_pull_out(
    state: State, params: StepParameters, context: DecisionContext, inputs: GapAcceptanceInputs
) -> Mask:
    """Whether drivers cancel a pull-out: it has become dangerous, or a branch forces them."""
    decides = context.checks_mirrors[inputs.slots] & ~inputs.is_scripted
    risk = inputs.lane_change_risk(old_leader_role=RIGHT_LEADER)
    is_dangerous = decides & lane_change_is_dangerous(params.constants, risk)
    is_forced = inputs.forced_decision == ForcedDecision.CANCEL
    return can_cancel_pull_out(state, params, inputs.slots) & (is_dangerous | is_forced)


def _cancels_return(
    state: State, params: StepParameters, context: DecisionContext, inputs: GapAcceptanceInputs
) -> Mask:
    """Whether drivers cancel a return that has become dangerous, unless a branch forces it."""
    decides = context.checks_mirrors[inputs.slots] & ~inputs.is_scripted
    risk = inputs.lane_change_risk(old_leader_role=LEFT_LEADER)
    is_dangerous = decides & lane_change_is_dangerous(params.constants, risk)
    must_return = inputs.forced_decision == ForcedDecision.RETURN
    return can_cancel_return(state, params, inputs.slots) & is_dangerous & ~must_return


def has_passed_target(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether the target's front is visibly behind the driver's rear."""
    s, half_length = state.motion.s, params.vehicles.half_length
    target_slot = state.overtake.target_slot[slots]
    lead_over_target = s[slots] - value_at_slot(s, target_slot)
    half_lengths = half_length[slots] + value_at_slot(half_length, target_slot)
    return lead_over_target > half_lengths + params.constants.return_clearance


def is_quicker_to_turn_back(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether a lane change has just begun, so that turning back is quicker than finishing it."""
    return state.path.elapsed[slots] < params.constants.abort_until * state.path.duration[slots]


def can_cancel_pull_out(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether drivers have just begun to pull out."""
    return state.is_in_stage(Stage.PULL_OUT, slots) & is_quicker_to_turn_back(state, params, slots)


def can_cancel_return(state: State, params: StepParameters, slots: SlotSelection) -> Mask:
    """Whether drivers have just begun to go back by a whole lane, not from a cancelled pull-out."""
    goes_back = state.is_in_stage(Stage.RETURN, slots) | state.is_in_stage(Stage.ABORT, slots)
    is_early = is_quicker_to_turn_back(state, params, slots)
    return goes_back & is_early & lane_change_direction(state, params).is_whole_lane[slots]


def store_wanted_side(
    state: State,
    params: StepParameters,
    slots: SlotSelection,
    wants_to_pull_out: Mask,
    wants_to_return: Mask,
) -> None:
    """Store the side that drivers want, 1 left, -1 right or 0, and how long they have wanted it."""
    interval, wants_change = params.constants.decision, wants_to_pull_out | wants_to_return
    side = np.where(wants_to_pull_out, ONE, np.where(wants_to_return, -ONE, ZERO))
    state.lane_choice.wanted_side[slots] = side
    # The time counts whether or not the driver uses its indicator. Without a wish it falls to 0 as
    # fast as it has grown, so a short doubt does not restart the lead time.
    time_indicating = state.overtake.time_indicating[slots]
    state.overtake.time_indicating[slots] = np.where(
        wants_change, time_indicating + interval, maximum(time_indicating - interval, ZERO)
    )
