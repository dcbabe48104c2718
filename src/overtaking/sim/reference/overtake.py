"""Overtaking as a state machine: follow, pull out, pass, return, or give up.

The ego goes through it, and on two-way roads every driver; `slots` selects the rows of the arrays.
"""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import maximum, minimum
from overtaking.model.trajectories import ManoeuvreKind, Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.decision_context import Beliefs, DecisionContext, Neighbours
from overtaking.sim.reference.ego_action import (
    EgoAction,
    intent_from_action,
    set_requested_indicator,
)
from overtaking.sim.reference.gap_acceptance import Intent, form_intent
from overtaking.sim.reference.lane_change import start_lane_changes
from overtaking.sim.reference.pass_continuation import (
    PassContinuation,
    decide_pass_continuation,
    overtakes_next_vehicle,
)
from overtaking.sim.reference.recorder import Recorder
from overtaking.sim.reference.state import (
    LEADER,
    LEFT_FOLLOWER,
    LEFT_LEADER,
    ONCOMING_ROLE,
    RIGHT_FOLLOWER,
    RIGHT_LEADER,
    SlotSelection,
    State,
)
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import StepParameters

_ZERO = np.float32(0.0)


_ONE = np.float32(1.0)


OTHERS = slice(EGO_SLOT + 1, None)  # All drivers but the ego.


def decide_ego(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    recorder: Recorder | None,
    step: int,
    action: EgoAction | None = None,
) -> None:
    """One decision of every ego; its intention holds until it checks its mirrors again."""
    ego = EGO_SLOT
    # Also with an external driver: the model controls the pedals that the action does not set.
    continuation = _update_pass_continuation(state, params, context, ego)
    if action is None:
        intent = form_intent(state, params, context, ego, continuation)
    else:
        intent = intent_from_action(state, params, action)
    _count_waiting_time(state, params, context.beliefs, ego)
    # Roles in the order of `PerceivedVehicle`.
    front = LEFT_LEADER if context.oncoming is None else ONCOMING_ROLE
    for mask, kind, roles in (
        (intent.starts_pull_out, ManoeuvreKind.PULL_OUT, (LEADER, front, LEFT_FOLLOWER)),
        (intent.cancels_pull_out, ManoeuvreKind.CANCEL, (LEADER, RIGHT_LEADER, RIGHT_FOLLOWER)),
        (intent.cancels_return, ManoeuvreKind.CANCEL, (LEADER, LEFT_LEADER, LEFT_FOLLOWER)),
        (intent.starts_return, ManoeuvreKind.RETURN, (LEADER, RIGHT_LEADER, RIGHT_FOLLOWER)),
    ):
        if recorder is not None:
            coming = None if context.oncoming is None else context.oncoming.nearest
            recorder.record_percepts(
                state, context.neighbours, context.beliefs, mask, kind, roles, step, coming
            )
    next_stage = _next_stage(state, params, context.neighbours, ego, intent)
    _carry_out_intent(state, params, context, ego, intent, step // SUBSTEPS)
    if action is not None:
        set_requested_indicator(state, action)
    _set_end_step(state, params, intent, next_stage, step)
    _set_stage(state, ego, next_stage)


def decide_others(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    step: int,
) -> None:
    """One decision of the other drivers on a two-way road; they may overtake several times."""
    continuation = _update_pass_continuation(state, params, context, OTHERS)
    intent = form_intent(state, params, context, OTHERS, continuation)
    _count_waiting_time(state, params, context.beliefs, OTHERS)
    stage = _next_stage(state, params, context.neighbours, OTHERS, intent)
    _carry_out_intent(state, params, context, OTHERS, intent, step // SUBSTEPS)
    done = stage == np.float32(Stage.DONE)
    state.overtake.time_waiting[OTHERS] = np.where(done, _ZERO, state.overtake.time_waiting[OTHERS])
    _set_stage(state, OTHERS, np.where(done, np.float32(Stage.FOLLOW), stage))


def _set_stage(state: State, slots: SlotSelection, stage: F32) -> None:
    """Go on to the next stage, or stay."""
    changed = stage != state.overtake.stage[slots]
    state.overtake.time_in_stage[slots] = np.where(
        changed, _ZERO, state.overtake.time_in_stage[slots]
    )
    state.overtake.stage[slots] = stage


def _update_pass_continuation(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    slots: SlotSelection,
) -> PassContinuation | None:
    """How drivers go on with their pass, kept in the state; None on one-way roads."""
    if context.oncoming is None:
        return None
    continuation = decide_pass_continuation(state, params, context, slots)
    state.overtake.must_abort[slots] = np.where(continuation.must_abort, _ONE, _ZERO)
    state.overtake.must_return_urgently[slots] = np.where(
        continuation.must_return_urgently, _ONE, _ZERO
    )
    return continuation


def _urgent_change_durations(state: State, params: StepParameters, slots: SlotSelection) -> F32:
    """Duration of an urgent lane change, 0 for drivers without urgency [s].

    Wheels turn only so far: two arcs of a turning circle of 11 m are 8 m long for a lane of 3.5 m,
    and drivers take twice that. With shorter changes, vehicles that had slowed to 9 km/h swung
    across their lane and left the road.
    """
    simulations, constants = params.simulations, params.constants
    hasty = np.zeros_like(state.motion.s)
    hurried = (state.overtake.must_return_urgently[slots] > 0) | (
        state.overtake.must_abort[slots] > 0
    )
    turned = constants.min_change_distance / maximum(state.motion.vx[slots], constants.slip_speed)
    hasty[slots] = np.where(hurried, maximum(simulations.urgent_change_duration, turned), _ZERO)
    return hasty


def _count_waiting_time(
    state: State, params: StepParameters, beliefs: Beliefs, slots: SlotSelection
) -> None:
    """Count the time behind a slower leader."""
    vehicles = params.vehicles
    constants, speed = params.constants, state.motion.vx[slots]
    queues = beliefs.gap[LEADER, slots] < constants.waiting_time_gap * speed
    slower = vehicles.desired_speed[slots] > speed - beliefs.closing_speed[LEADER, slots]
    follows = state.is_in_stage(Stage.FOLLOW, slots)
    waits = follows & beliefs.is_detected[LEADER, slots] & queues & slower
    waited = state.overtake.time_waiting[slots]
    state.overtake.time_waiting[slots] = np.where(waits, waited + constants.decision, waited)


def _next_stage(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    slots: SlotSelection,
    intent: Intent,
) -> F32:
    """The stage after this decision; an abort wins over an arrival, a return over both."""
    centre = np.float32(0.5) * (
        neighbours.lane_right_edge[slots] + neighbours.lane_left_edge[slots]
    )
    settled = np.abs(state.motion.d[slots] - centre) < params.constants.settled_offset
    finished = intent.has_finished_lane_change & settled
    returning = np.where(
        intent.has_passed_target, np.float32(Stage.RETURN), np.float32(Stage.ABORT)
    )
    stage = np.where(
        intent.starts_pull_out, np.float32(Stage.PULL_OUT), state.overtake.stage[slots]
    )
    entered = state.is_in_stage(Stage.PULL_OUT, slots) & intent.has_finished_lane_change
    stage = np.where(entered, np.float32(Stage.PASS), stage)
    stage = np.where(intent.cancels_pull_out, np.float32(Stage.ABORT), stage)
    stage = np.where(intent.starts_return & state.is_in_stage(Stage.PASS, slots), returning, stage)
    stage = np.where(
        state.is_in_stage(Stage.RETURN, slots) & finished, np.float32(Stage.DONE), stage
    )
    stage = np.where(
        state.is_in_stage(Stage.ABORT, slots) & finished, np.float32(Stage.FOLLOW), stage
    )
    return np.where(intent.cancels_return, np.float32(Stage.PASS), stage)


def _carry_out_intent(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    slots: SlotSelection,
    intent: Intent,
    decision_index: int,
) -> None:
    """Start the intended lane changes, with the indicator; a driver that pulls out has a target."""
    neighbours = context.neighbours
    target = np.where(
        intent.starts_pull_out, neighbours.slot[LEADER, slots], state.overtake.target_slot[slots]
    )
    if params.road.has_oncoming_traffic:
        beside = overtakes_next_vehicle(state, params, context, slots)
        target = np.where(beside, neighbours.slot[RIGHT_LEADER, slots], target)
    state.overtake.target_slot[slots] = target
    if slots == EGO_SLOT:
        state.overtake.has_attempted = np.where(
            intent.starts_pull_out, _ONE, state.overtake.has_attempted
        )
    fast, slow, back = (np.zeros(state.motion.s.shape, bool) for _ in range(3))
    fast[slots] = intent.starts_pull_out | intent.cancels_return
    slow[slots] = intent.starts_return | intent.cancels_pull_out
    back[slots] = intent.cancels_pull_out | intent.cancels_return
    hasty = (
        _urgent_change_durations(state, params, slots) if params.road.has_oncoming_traffic else None
    )
    start_lane_changes(state, params, (fast, slow, back), context.beliefs, decision_index, hasty)
    _set_indicator(state, params, intent, (fast | slow)[slots], slots)


def _set_indicator(
    state: State, params: StepParameters, intent: Intent, moved: Mask, slots: SlotSelection
) -> None:
    """Signal an intention while it lasts; during a lane change its own indicator stays on."""
    vehicles = params.vehicles
    signalled, used = state.overtake.time_indicating[slots], vehicles.uses_indicator[slots]
    kept = np.where(signalled > 0, state.controls.indicator[slots], _ZERO)
    shown = np.where(intent.wants_to_pull_out, used, np.where(intent.wants_to_return, -used, kept))
    straight = intent.has_finished_lane_change & ~moved
    state.controls.indicator[slots] = np.where(straight, shown, state.controls.indicator[slots])
    state.overtake.time_indicating[slots] = np.where(moved, _ZERO, signalled)


def _set_end_step(
    state: State,
    params: StepParameters,
    intent: Intent,
    next_stage: F32,
    step: int,
) -> None:
    """End the simulation some time after the overtake, or at the deadline without an attempt."""
    simulations = params.simulations
    constants, done = params.constants, np.float32(Stage.DONE)
    now = np.float32(step)
    over = (next_stage == done) & (state.overtake.stage[EGO_SLOT] != done)
    after = now + np.rint(constants.after_overtake / constants.step)
    state.end_step = np.where(over, minimum(state.end_step, after), state.end_step)
    idle = state.is_in_stage(Stage.FOLLOW, EGO_SLOT) & ~intent.wants_to_pull_out
    late = idle & (now >= simulations.deadline_step)
    state.end_step = np.where(late, minimum(state.end_step, now), state.end_step)
