"""Overtaking as a state machine: follow, pull out, pass, return, or abort.

On one-way roads only the ego, the vehicle under study, goes through its stages, on two-way roads
every driver. `slots` selects the drivers: an int gives arrays of shape (simulation,), a slice
(vehicle, simulation). The target is the vehicle that a driver overtakes. All functions run at a
decision, every 0.05 s (`constants.decision`).
"""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, ZERO, maximum, minimum
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.decision_context import Beliefs, DecisionContext, Neighbours
from overtaking.sim.reference.ego_action import (
    EgoAction,
    intent_from_action,
    set_requested_indicator,
)
from overtaking.sim.reference.gap_acceptance import Intent, form_intent
from overtaking.sim.reference.lane_change import LaneMoves, start_lane_changes
from overtaking.sim.reference.pass_continuation import (
    PassContinuation,
    decide_pass_continuation,
    overtakes_next_vehicle,
)
from overtaking.sim.reference.recorder import Recorder
from overtaking.sim.reference.state import (
    LEADER,
    RIGHT_LEADER,
    SlotSelection,
    State,
)
from overtaking.world.step_parameters import StepParameters

OTHERS = slice(EGO_SLOT + 1, None)
"""Slots of all drivers but the ego."""


def decide_ego(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    *,
    step: int,
    action: EgoAction | None,
    recorder: Recorder | None,
) -> None:
    """Let the ego of every simulation decide, or carry out the action of an external driver.

    Args:
        state: It changes.
        params: Parameters of the batch.
        context: Perception of the drivers at this decision.
        step: Index of the integration step of 10 ms.
        action: Action of an external driver; None if the model's driver decides.
        recorder: Records the ego's beliefs at its manoeuvres; None without a recording.
    """
    # The state of the pass is also updated for an external driver: where its action leaves the
    # pedals to the model, the model brakes to abort and accelerates to return urgently.
    continuation = _update_pass_continuation(state, params, context, EGO_SLOT)
    if action is None:
        intent = form_intent(state, params, context, EGO_SLOT, continuation)
    else:
        intent = intent_from_action(state, params, action)
    _count_waiting_time(state, params, context.beliefs, EGO_SLOT)
    if recorder is not None:
        recorder.record_manoeuvres(state, context, intent, step)
    # The next stage is stored last, because the functions called before that read the present one.
    next_stage = _next_stage(state, params, context.neighbours, EGO_SLOT, intent)
    _carry_out_intent(state, params, context, EGO_SLOT, intent)
    has_attempted = state.overtake.has_attempted
    state.overtake.has_attempted = np.where(intent.starts_pull_out, ONE, has_attempted)
    if action is not None:
        set_requested_indicator(state, action)
    _set_end_step(state, params, intent, next_stage, step)
    _set_stage(state, EGO_SLOT, next_stage)


def decide_others(state: State, params: StepParameters, context: DecisionContext) -> None:
    """Let the other drivers on a two-way road decide; they may overtake several times."""
    continuation = _update_pass_continuation(state, params, context, OTHERS)
    intent = form_intent(state, params, context, OTHERS, continuation)
    _count_waiting_time(state, params, context.beliefs, OTHERS)
    next_stage = _next_stage(state, params, context.neighbours, OTHERS, intent)
    _carry_out_intent(state, params, context, OTHERS, intent)
    # After an overtake they follow again, and their waiting time starts at 0. The ego stays `DONE`:
    # a simulation has one completed overtake at most.
    is_done = next_stage == np.float32(Stage.DONE)
    time_waiting = state.overtake.time_waiting
    time_waiting[OTHERS] = np.where(is_done, ZERO, time_waiting[OTHERS])
    _set_stage(state, OTHERS, np.where(is_done, np.float32(Stage.FOLLOW), next_stage))


def _set_stage(state: State, slots: SlotSelection, stage: F32) -> None:
    """Store the stage, and set the time in it to 0 where it is new."""
    overtake = state.overtake
    is_new = stage != overtake.stage[slots]
    overtake.time_in_stage[slots] = np.where(is_new, ZERO, overtake.time_in_stage[slots])
    overtake.stage[slots] = stage


def _update_pass_continuation(
    state: State, params: StepParameters, context: DecisionContext, slots: SlotSelection
) -> PassContinuation | None:
    """Decide whether drivers complete or abort their pass, and store it; None on one-way roads."""
    if context.oncoming is None:
        return None
    continuation = decide_pass_continuation(state, params, context, slots)
    state.overtake.must_abort[slots] = np.where(continuation.must_abort, ONE, ZERO)
    state.overtake.must_return_urgently[slots] = np.where(
        continuation.must_return_urgently, ONE, ZERO
    )
    return continuation


def _urgent_change_durations(state: State, params: StepParameters, slots: SlotSelection) -> F32:
    """Duration of an urgent lane change, 0 for drivers without urgency, (vehicle, simulation) [s].

    At low speed the turning circle limits it: on a turning circle of 11 m a vehicle needs 8 m of
    road to move over by a lane of 3.5 m. Drivers take twice that, `min_change_distance`, because
    wheels take time to turn. In shorter lane changes, vehicles that had slowed to 9 km/h swung
    across their lane and left the road.
    """
    overtake, constants = state.overtake, params.constants
    is_urgent = (overtake.must_return_urgently[slots] > 0) | (overtake.must_abort[slots] > 0)
    # `slip_speed`, 3 m/s, is the least speed by which the model divides.
    speed = maximum(state.motion.vx[slots], constants.slip_speed)
    min_duration = constants.min_change_distance / speed
    duration = maximum(params.simulations.urgent_change_duration, min_duration)
    durations = np.zeros_like(state.motion.s)
    durations[slots] = np.where(is_urgent, duration, ZERO)
    return durations


def _count_waiting_time(
    state: State, params: StepParameters, beliefs: Beliefs, slots: SlotSelection
) -> None:
    """Count the time that drivers spend close behind a leader slower than they want to drive."""
    constants, speed = params.constants, state.motion.vx[slots]
    is_close = beliefs.gap[LEADER, slots] < constants.waiting_time_gap * speed
    leader_speed = speed - beliefs.closing_speed[LEADER, slots]
    is_slower = params.vehicles.desired_speed[slots] > leader_speed
    follows = state.is_in_stage(Stage.FOLLOW, slots)
    waits = follows & beliefs.is_detected[LEADER, slots] & is_close & is_slower
    time_waiting = state.overtake.time_waiting
    time_waiting[slots] = np.where(
        waits, time_waiting[slots] + constants.decision, time_waiting[slots]
    )


def _next_stage(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    slots: SlotSelection,
    intent: Intent,
) -> F32:
    """Stage after this decision.

    Of the rules below, in the order of an overtake, the last that applies wins: a driver that
    aborts at the end of its pull-out goes to `ABORT`, not to `PASS`.
    """
    # `has_finished_lane_change` is true at every decision at which no lane change is under way.
    centre = HALF * (neighbours.lane_right_edge[slots] + neighbours.lane_left_edge[slots])
    is_near_centre = np.abs(state.motion.d[slots] - centre) < params.constants.settled_offset
    is_back_in_lane = intent.has_finished_lane_change & is_near_centre
    pulls_out = state.is_in_stage(Stage.PULL_OUT, slots)
    has_pulled_out = pulls_out & intent.has_finished_lane_change
    # A return ahead of the target completes the overtake, a return behind it aborts it. An external
    # driver may also change to the right while it follows, which is no return.
    stage_of_return = np.where(
        intent.has_passed_target, np.float32(Stage.RETURN), np.float32(Stage.ABORT)
    )
    stage = state.overtake.stage[slots]
    for applies, next_stage in (
        (intent.starts_pull_out, np.float32(Stage.PULL_OUT)),
        (has_pulled_out, np.float32(Stage.PASS)),
        (intent.cancels_pull_out, np.float32(Stage.ABORT)),
        (intent.starts_return & state.is_in_stage(Stage.PASS, slots), stage_of_return),
        (state.is_in_stage(Stage.RETURN, slots) & is_back_in_lane, np.float32(Stage.DONE)),
        (state.is_in_stage(Stage.ABORT, slots) & is_back_in_lane, np.float32(Stage.FOLLOW)),
        (intent.cancels_return, np.float32(Stage.PASS)),
    ):
        stage = np.where(applies, next_stage, stage)
    return stage


def _carry_out_intent(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    slots: SlotSelection,
    intent: Intent,
) -> None:
    """Start the intended lane changes with their indicator, and store the target."""
    neighbour_slot, target_slot = context.neighbours.slot, state.overtake.target_slot[slots]
    target_slot = np.where(intent.starts_pull_out, neighbour_slot[LEADER, slots], target_slot)
    urgent_duration = None
    if params.road.has_oncoming_traffic:
        # A driver that has passed its target and goes on past the next vehicle in the right lane
        # takes that one as its target.
        passes_next = overtakes_next_vehicle(state, params, context, slots)
        target_slot = np.where(passes_next, neighbour_slot[RIGHT_LEADER, slots], target_slot)
        urgent_duration = _urgent_change_durations(state, params, slots)
    state.overtake.target_slot[slots] = target_slot
    to_left, to_right, is_cancelled = (np.zeros(state.motion.s.shape, bool) for _ in range(3))
    to_left[slots] = intent.starts_pull_out | intent.cancels_return
    to_right[slots] = intent.starts_return | intent.cancels_pull_out
    is_cancelled[slots] = intent.cancels_pull_out | intent.cancels_return
    moves = LaneMoves(
        to_left=to_left,
        to_right=to_right,
        is_cancelled=is_cancelled,
        urgent_duration=urgent_duration,
    )
    start_lane_changes(state, params, context, moves)
    _set_indicator(state, params, intent, (to_left | to_right)[slots], slots)


def _set_indicator(
    state: State, params: StepParameters, intent: Intent, is_moving: Mask, slots: SlotSelection
) -> None:
    """Set the indicator by the driver's intention: 1 left, -1 right, 0 off.

    During a lane change the indicator with which it started stays on.
    """
    overtake, controls = state.overtake, state.controls
    uses_indicator = params.vehicles.uses_indicator[slots]
    time_indicating = overtake.time_indicating[slots]
    # `store_wanted_side` counts `time_indicating` up while the driver wants a lane change, and
    # down to 0 when it no longer does. Until then the indicator stays on: a short doubt does not
    # switch it off.
    indicator = np.where(time_indicating > 0, controls.indicator[slots], ZERO)
    indicator = np.where(intent.wants_to_return, -uses_indicator, indicator)
    indicator = np.where(intent.wants_to_pull_out, uses_indicator, indicator)
    keeps_lane = intent.has_finished_lane_change & ~is_moving
    controls.indicator[slots] = np.where(keeps_lane, indicator, controls.indicator[slots])
    # The next lane change will be indicated anew.
    overtake.time_indicating[slots] = np.where(is_moving, ZERO, time_indicating)


def _set_end_step(
    state: State, params: StepParameters, intent: Intent, next_stage: F32, step: int
) -> None:
    """End the simulation some time after the overtake, or at the deadline without one under way.

    An attempt that was aborted before the deadline does not delay the end. An ego that indicates a
    pull-out at the deadline goes on with its attempt.
    """
    constants, stage_done = params.constants, np.float32(Stage.DONE)
    this_step = np.float32(step)
    is_completed = (next_stage == stage_done) & (state.overtake.stage[EGO_SLOT] != stage_done)
    last_step = this_step + np.rint(constants.after_overtake / constants.step)
    state.end_step = np.where(is_completed, minimum(state.end_step, last_step), state.end_step)
    makes_no_attempt = state.is_in_stage(Stage.FOLLOW, EGO_SLOT) & ~intent.wants_to_pull_out
    is_over = makes_no_attempt & (this_step >= params.simulations.deadline_step)
    state.end_step = np.where(is_over, minimum(state.end_step, this_step), state.end_step)
