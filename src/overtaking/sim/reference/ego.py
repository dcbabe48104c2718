"""Overtaking as a state machine: follow, pull out, pass, return, or give up.

The ego goes through it, and on two-way roads everybody by the same rules: `who` says of whom arrays
tell.
"""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import maximum, minimum
from overtaking.model.trajectories import ManoeuvreKind, Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.gaps import intend
from overtaking.sim.reference.intent import Intent, in_stage
from overtaking.sim.reference.mobil import turn_to_lane
from overtaking.sim.reference.moment import Moment
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.orders import Orders, obey, show
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.plight import Plight, goes_on, weigh
from overtaking.sim.reference.recording import Recorder
from overtaking.sim.reference.state import (
    FAST_LEAD,
    FAST_REAR,
    LEAD,
    ONCOMING,
    SLOW_LEAD,
    SLOW_REAR,
    Fields,
    State,
    Who,
)
from overtaking.world.constants import SUBSTEPS, ModelConstants
from overtaking.world.step_parameters import StepParameters
from overtaking.world.weather_parameters import SimulationParameters

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_OTHERS = slice(EGO_SLOT + 1, None)  # Everybody but the ego.


def decide(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    recorder: Recorder | None,
    step: int,
    orders: Orders | None = None,
) -> None:
    """One decision of every ego; what it intends holds until it looks around again."""
    ego = EGO_SLOT
    # Oncoming traffic changes the pedals and the haste of the ego, also under another driver.
    plight = _face(state, given, p, q, moment, ego)
    if orders is None:
        intent = intend(state, given, p, q, moment, ego, plight)
    else:
        intent = obey(state, given, p, orders)
    _wait(state, given, p, moment.believed, ego)
    # Roles in the order of `PerceivedVehicle`.
    front = FAST_LEAD if moment.met is None else ONCOMING
    for mask, kind, roles in (
        (intent.go_out, ManoeuvreKind.PULL_OUT, (LEAD, front, FAST_REAR)),
        (intent.abort, ManoeuvreKind.CANCEL, (LEAD, SLOW_LEAD, SLOW_REAR)),
        (intent.remain, ManoeuvreKind.CANCEL, (LEAD, FAST_LEAD, FAST_REAR)),
        (intent.go_back, ManoeuvreKind.RETURN, (LEAD, SLOW_LEAD, SLOW_REAR)),
    ):
        if recorder is not None:
            coming = None if moment.met is None else moment.met.coming
            recorder.percepts(state, moment.near, moment.believed, mask, kind, roles, step, coming)
    next_stage = _next_stage(state, given, moment.near, ego, intent)
    _act(state, given, p, q, moment, ego, intent, step // SUBSTEPS)
    if orders is not None:
        show(state, orders)
    _end(state, given, q, intent, next_stage, step)
    _enter(state, ego, next_stage)


def decide_others(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    step: int,
) -> None:
    """One decision of everybody else on a two-way road; who has overtaken may do so again."""
    plight = _face(state, given, p, q, moment, _OTHERS)
    intent = intend(state, given, p, q, moment, _OTHERS, plight)
    _wait(state, given, p, moment.believed, _OTHERS)
    stage = _next_stage(state, given, moment.near, _OTHERS, intent)
    _act(state, given, p, q, moment, _OTHERS, intent, step // SUBSTEPS)
    done = stage == np.float32(Stage.DONE)
    state.waited[_OTHERS] = np.where(done, _ZERO, state.waited[_OTHERS])
    _enter(state, _OTHERS, np.where(done, np.float32(Stage.FOLLOW), stage))


def _enter(state: State, who: Who, stage: F32) -> None:
    """Go on to the next stage, or stay."""
    changed = stage != state.stage[who]
    state.stage_time[who] = np.where(changed, _ZERO, state.stage_time[who])
    state.stage[who] = stage


def _face(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    who: Who,
) -> Plight | None:
    """How drivers stand to oncoming traffic, remembered; None where there is none on the road."""
    if moment.met is None:
        return None
    plight = weigh(state, given, p, q, moment, who)
    state.yields[who] = np.where(plight.yields, _ONE, _ZERO)
    state.hurries[who] = np.where(plight.hurries, _ONE, _ZERO)
    return plight


def _haste(state: State, c: ModelConstants, q: SimulationParameters, who: Who) -> F32:
    """How long hurried drivers take to change lanes, 0 for everybody else [s].

    At a walking pace a change takes longer, as the wheels turn only so far.
    """
    hasty = np.zeros_like(state.s)
    hurried = (state.hurries[who] > 0) | (state.yields[who] > 0)
    turned = c.min_change_distance / maximum(state.vx[who], c.slip_speed)
    hasty[who] = np.where(hurried, maximum(q.urgent_change_duration, turned), _ZERO)
    return hasty


def _wait(state: State, given: StepParameters, p: Fields, believed: Beliefs, who: Who) -> None:
    """Count the time behind a slower leader."""
    c, speed = given.constants, state.vx[who]
    queues = believed.gap[LEAD, who] < c.waiting_time_gap * speed
    slower = p.desired_speed[who] > speed - believed.closing[LEAD, who]
    follows = in_stage(state, who, Stage.FOLLOW)
    waits = follows & believed.detected[LEAD, who] & queues & slower
    waited = state.waited[who]
    state.waited[who] = np.where(waits, waited + c.decision, waited)


def _next_stage(
    state: State, given: StepParameters, near: Neighbours, who: Who, intent: Intent
) -> F32:
    """The stage after this decision; an abort wins over an arrival, a return over both."""
    centre = np.float32(0.5) * (near.lane_low[who] + near.lane_high[who])
    settled = np.abs(state.d[who] - centre) < given.constants.settled_offset
    finished = intent.arrived & settled
    returning = np.where(intent.passed, np.float32(Stage.RETURN), np.float32(Stage.ABORT))
    stage = np.where(intent.go_out, np.float32(Stage.PULL_OUT), state.stage[who])
    entered = in_stage(state, who, Stage.PULL_OUT) & intent.arrived
    stage = np.where(entered, np.float32(Stage.PASS), stage)
    stage = np.where(intent.abort, np.float32(Stage.ABORT), stage)
    stage = np.where(intent.go_back & in_stage(state, who, Stage.PASS), returning, stage)
    stage = np.where(in_stage(state, who, Stage.RETURN) & finished, np.float32(Stage.DONE), stage)
    stage = np.where(in_stage(state, who, Stage.ABORT) & finished, np.float32(Stage.FOLLOW), stage)
    return np.where(intent.remain, np.float32(Stage.PASS), stage)


def _act(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    who: Who,
    intent: Intent,
    decision: int,
) -> None:
    """Move over and show it; who pulls out remembers whom to overtake."""
    near = moment.near
    target = np.where(intent.go_out, near.slot[LEAD, who], state.target[who])
    if given.road.has_oncoming_traffic:
        beside = goes_on(state, given, p, q, moment, who)
        target = np.where(beside, near.slot[SLOW_LEAD, who], target)
    state.target[who] = target
    if who == EGO_SLOT:
        state.attempted = np.where(intent.go_out, _ONE, state.attempted)
    fast, slow, back = (np.zeros(state.s.shape, bool) for _ in range(3))
    fast[who] = intent.go_out | intent.remain
    slow[who] = intent.go_back | intent.abort
    back[who] = intent.abort | intent.remain
    hasty = _haste(state, given.constants, q, who) if given.road.has_oncoming_traffic else None
    turn_to_lane(state, given, p, (fast, slow, back), moment.believed, decision, hasty)
    _show(state, p, intent, (fast | slow)[who], who)


def _show(state: State, p: Fields, intent: Intent, moved: Mask, who: Who) -> None:
    """Signal an intention while it lasts; during a lane change its own indicator stays on."""
    signalled, used = state.signalled[who], p.uses_indicator[who]
    kept = np.where(signalled > 0, state.indicator[who], _ZERO)
    shown = np.where(intent.start, used, np.where(intent.back, -used, kept))
    straight = intent.arrived & ~moved
    state.indicator[who] = np.where(straight, shown, state.indicator[who])
    state.signalled[who] = np.where(moved, _ZERO, signalled)


def _end(
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
    idle = in_stage(state, EGO_SLOT, Stage.FOLLOW) & ~intent.start
    late = idle & (now >= q.deadline_step)
    state.end_step = np.where(late, minimum(state.end_step, now), state.end_step)
