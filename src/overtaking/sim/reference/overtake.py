"""Overtaking as a state machine: follow, pull out, pass, return, or give up.

The ego goes through it, and on two-way roads everybody by the same rules: `who` says of whom arrays
tell.
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
    is_in_stage,
)
from overtaking.world.constants import SUBSTEPS, ModelConstants
from overtaking.world.step_parameters import StepParameters, VehicleParameters
from overtaking.world.weather_parameters import SimulationParameters

_ZERO = np.float32(0.0)


_ONE = np.float32(1.0)


OTHERS = slice(EGO_SLOT + 1, None)  # Everybody but the ego.


def decide_ego(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    moment: DecisionContext,
    recorder: Recorder | None,
    step: int,
    orders: EgoAction | None = None,
) -> None:
    """One decision of every ego; what it intends holds until it looks around again."""
    ego = EGO_SLOT
    # Oncoming traffic changes the pedals and the haste of the ego, also under another driver.
    plight = _update_pass_continuation(state, given, p, q, moment, ego)
    if orders is None:
        intent = form_intent(state, given, p, q, moment, ego, plight)
    else:
        intent = intent_from_action(state, given, p, orders)
    _count_waiting_time(state, given, p, moment.beliefs, ego)
    # Roles in the order of `PerceivedVehicle`.
    front = LEFT_LEADER if moment.oncoming is None else ONCOMING_ROLE
    for mask, kind, roles in (
        (intent.starts_pull_out, ManoeuvreKind.PULL_OUT, (LEADER, front, LEFT_FOLLOWER)),
        (intent.cancels_pull_out, ManoeuvreKind.CANCEL, (LEADER, RIGHT_LEADER, RIGHT_FOLLOWER)),
        (intent.cancels_return, ManoeuvreKind.CANCEL, (LEADER, LEFT_LEADER, LEFT_FOLLOWER)),
        (intent.starts_return, ManoeuvreKind.RETURN, (LEADER, RIGHT_LEADER, RIGHT_FOLLOWER)),
    ):
        if recorder is not None:
            coming = None if moment.oncoming is None else moment.oncoming.nearest
            recorder.record_percepts(
                state, moment.neighbours, moment.beliefs, mask, kind, roles, step, coming
            )
    next_stage = _next_stage(state, given, moment.neighbours, ego, intent)
    _carry_out_intent(state, given, p, q, moment, ego, intent, step // SUBSTEPS)
    if orders is not None:
        set_requested_indicator(state, orders)
    _set_end_step(state, given, q, intent, next_stage, step)
    _set_stage(state, ego, next_stage)


def decide_others(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    moment: DecisionContext,
    step: int,
) -> None:
    """One decision of everybody else on a two-way road; who has overtaken may do so again."""
    plight = _update_pass_continuation(state, given, p, q, moment, OTHERS)
    intent = form_intent(state, given, p, q, moment, OTHERS, plight)
    _count_waiting_time(state, given, p, moment.beliefs, OTHERS)
    stage = _next_stage(state, given, moment.neighbours, OTHERS, intent)
    _carry_out_intent(state, given, p, q, moment, OTHERS, intent, step // SUBSTEPS)
    done = stage == np.float32(Stage.DONE)
    state.waited[OTHERS] = np.where(done, _ZERO, state.waited[OTHERS])
    _set_stage(state, OTHERS, np.where(done, np.float32(Stage.FOLLOW), stage))


def _set_stage(state: State, who: SlotSelection, stage: F32) -> None:
    """Go on to the next stage, or stay."""
    changed = stage != state.stage[who]
    state.stage_time[who] = np.where(changed, _ZERO, state.stage_time[who])
    state.stage[who] = stage


def _update_pass_continuation(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    moment: DecisionContext,
    who: SlotSelection,
) -> PassContinuation | None:
    """How drivers stand to oncoming traffic, remembered; None where there is none on the road."""
    if moment.oncoming is None:
        return None
    plight = decide_pass_continuation(state, given, p, q, moment, who)
    state.yields[who] = np.where(plight.must_abort, _ONE, _ZERO)
    state.hurries[who] = np.where(plight.must_return_urgently, _ONE, _ZERO)
    return plight


def _urgent_change_durations(
    state: State, c: ModelConstants, q: SimulationParameters, who: SlotSelection
) -> F32:
    """How long hurried drivers take to change lanes, 0 for everybody else [s].

    At a walking pace a change takes longer, as the wheels turn only so far.
    """
    hasty = np.zeros_like(state.s)
    hurried = (state.hurries[who] > 0) | (state.yields[who] > 0)
    turned = c.min_change_distance / maximum(state.vx[who], c.slip_speed)
    hasty[who] = np.where(hurried, maximum(q.urgent_change_duration, turned), _ZERO)
    return hasty


def _count_waiting_time(
    state: State, given: StepParameters, p: VehicleParameters, believed: Beliefs, who: SlotSelection
) -> None:
    """Count the time behind a slower leader."""
    c, speed = given.constants, state.vx[who]
    queues = believed.gap[LEADER, who] < c.waiting_time_gap * speed
    slower = p.desired_speed[who] > speed - believed.closing_speed[LEADER, who]
    follows = is_in_stage(state, who, Stage.FOLLOW)
    waits = follows & believed.is_detected[LEADER, who] & queues & slower
    waited = state.waited[who]
    state.waited[who] = np.where(waits, waited + c.decision, waited)


def _next_stage(
    state: State, given: StepParameters, near: Neighbours, who: SlotSelection, intent: Intent
) -> F32:
    """The stage after this decision; an abort wins over an arrival, a return over both."""
    centre = np.float32(0.5) * (near.lane_right_edge[who] + near.lane_left_edge[who])
    settled = np.abs(state.d[who] - centre) < given.constants.settled_offset
    finished = intent.has_finished_lane_change & settled
    returning = np.where(
        intent.has_passed_target, np.float32(Stage.RETURN), np.float32(Stage.ABORT)
    )
    stage = np.where(intent.starts_pull_out, np.float32(Stage.PULL_OUT), state.stage[who])
    entered = is_in_stage(state, who, Stage.PULL_OUT) & intent.has_finished_lane_change
    stage = np.where(entered, np.float32(Stage.PASS), stage)
    stage = np.where(intent.cancels_pull_out, np.float32(Stage.ABORT), stage)
    stage = np.where(intent.starts_return & is_in_stage(state, who, Stage.PASS), returning, stage)
    stage = np.where(
        is_in_stage(state, who, Stage.RETURN) & finished, np.float32(Stage.DONE), stage
    )
    stage = np.where(
        is_in_stage(state, who, Stage.ABORT) & finished, np.float32(Stage.FOLLOW), stage
    )
    return np.where(intent.cancels_return, np.float32(Stage.PASS), stage)


def _carry_out_intent(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    moment: DecisionContext,
    who: SlotSelection,
    intent: Intent,
    decision: int,
) -> None:
    """Move over and show it; who pulls out remembers whom to overtake."""
    near = moment.neighbours
    target = np.where(intent.starts_pull_out, near.slot[LEADER, who], state.target[who])
    if given.road.has_oncoming_traffic:
        beside = overtakes_next_vehicle(state, given, p, q, moment, who)
        target = np.where(beside, near.slot[RIGHT_LEADER, who], target)
    state.target[who] = target
    if who == EGO_SLOT:
        state.attempted = np.where(intent.starts_pull_out, _ONE, state.attempted)
    fast, slow, back = (np.zeros(state.s.shape, bool) for _ in range(3))
    fast[who] = intent.starts_pull_out | intent.cancels_return
    slow[who] = intent.starts_return | intent.cancels_pull_out
    back[who] = intent.cancels_pull_out | intent.cancels_return
    hasty = (
        _urgent_change_durations(state, given.constants, q, who)
        if given.road.has_oncoming_traffic
        else None
    )
    start_lane_changes(state, given, p, (fast, slow, back), moment.beliefs, decision, hasty)
    _set_indicator(state, p, intent, (fast | slow)[who], who)


def _set_indicator(
    state: State, p: VehicleParameters, intent: Intent, moved: Mask, who: SlotSelection
) -> None:
    """Signal an intention while it lasts; during a lane change its own indicator stays on."""
    signalled, used = state.signalled[who], p.uses_indicator[who]
    kept = np.where(signalled > 0, state.indicator[who], _ZERO)
    shown = np.where(intent.wants_to_pull_out, used, np.where(intent.wants_to_return, -used, kept))
    straight = intent.has_finished_lane_change & ~moved
    state.indicator[who] = np.where(straight, shown, state.indicator[who])
    state.signalled[who] = np.where(moved, _ZERO, signalled)


def _set_end_step(
    state: State,
    given: StepParameters,
    q: SimulationParameters,
    intent: Intent,
    next_stage: F32,
    step: int,
) -> None:
    """End the simulation some time after the overtake, or at the deadline without an attempt."""
    c, done = given.constants, np.float32(Stage.DONE)
    now = np.float32(step)
    over = (next_stage == done) & (state.stage[EGO_SLOT] != done)
    after = now + np.rint(c.after_overtake / c.step)
    state.end_step = np.where(over, minimum(state.end_step, after), state.end_step)
    idle = is_in_stage(state, EGO_SLOT, Stage.FOLLOW) & ~intent.wants_to_pull_out
    late = idle & (now >= q.deadline_step)
    state.end_step = np.where(late, minimum(state.end_step, now), state.end_step)
