"""The ego's decisions: follow, pull out, pass, return, or give up."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, Mask, exp, maximum, minimum
from overtaking.model.trajectory import DecisionKind, Stage
from overtaking.model.vehicles import Role
from overtaking.sim.parameters import Parameters
from overtaking.sim.reference.following import forced_braking
from overtaking.sim.reference.mobil import turn_to_lane
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.recording import Recorder
from overtaking.sim.reference.state import (
    FAST_LEAD,
    FAST_REAR,
    LEAD,
    REAR,
    SLOW_LEAD,
    SLOW_REAR,
    Fields,
    State,
    pick,
)

PULL_OUT_NOW, ABORT_NOW, RETURN_NOW, STAY = 1, 2, 3, 4
"""Decisions that `sim.branch` can force."""


@dataclass(slots=True, kw_only=True)
class View:
    """What the ego knows when it decides; arrays of shape (simulation,), or (role, simulation)."""

    own: Fields
    speed: F32
    gap: F32
    closing: F32
    detected: Mask
    leader_speed: F32
    demand: F32
    impatience: F32


def look(state: State, given: Parameters, p: Fields, believed: Beliefs) -> View:
    """The ego's beliefs and how much it demands after its wait."""
    own = Fields(tuple(p.__dict__), tuple(row[Role.EGO] for row in p.__dict__.values()))  # type: ignore[arg-type]
    impatience = maximum(
        exp(-(state.waited * own.inverse_patience)), given.constants.patience_floor
    )
    gap, closing = believed.gap[:, Role.EGO], believed.closing[:, Role.EGO]
    return View(
        own=own,
        speed=state.vx[Role.EGO],
        gap=gap,
        closing=closing,
        detected=believed.detected[:, Role.EGO],
        leader_speed=state.vx[Role.EGO] - closing[LEAD],
        demand=own.gap_acceptance * impatience,
        impatience=impatience,
    )


def own_braking(given: Parameters, view: View, role: int) -> F32:
    """Acceleration that the vehicle ahead in `role` forces on the ego, with the gap that it demands now."""
    time_gap = view.own.time_gap * view.demand
    return forced_braking(
        given.constants, view.own, view.speed, view.gap[role], view.closing[role], time_gap
    )


def their_braking(given: Parameters, view: View, role: int) -> F32:
    """Acceleration that the ego in front would force on the vehicle behind in `role`."""
    time_gap = view.own.time_gap * view.demand
    speed = view.speed + view.closing[role]
    return forced_braking(
        given.constants, view.own, speed, view.gap[role], view.closing[role], time_gap
    )


def wants_to_pass(given: Parameters, view: View) -> Mask:
    """Whether the leader is slow enough, and near enough, that an overtake is wanted now."""
    own = view.own
    slower = own.desired_speed - view.leader_speed > own.passing_gain * view.impatience
    soon = view.gap[LEAD] < own.pull_out_time * view.closing[LEAD]
    close = view.gap[LEAD] < np.float32(1.5) * own.time_gap * view.speed + own.min_gap
    return view.detected[LEAD] & slower & (soon | close)


def may_pull_out(given: Parameters, view: View) -> Mask:
    """Whether the next lane looks free enough, and faster, to this driver."""
    c, own = given.constants, view.own
    front = own_braking(given, view, FAST_LEAD) >= -own.decel
    rear = their_braking(given, view, FAST_REAR) >= -(own.safe_decel / view.demand)
    rear = rear & (view.gap[FAST_REAR] > c.smallest_rear_gap * view.demand)
    gain = (
        view.speed - view.closing[FAST_LEAD]
    ) - view.leader_speed > own.passing_gain * view.impatience
    far = view.gap[FAST_LEAD] > view.gap[LEAD] + c.waiting_time_gap * view.speed
    return front & rear & (gain | far | ~view.detected[FAST_LEAD])


def may_return(given: Parameters, view: View) -> Mask:
    """Whether the slower lane has room for the ego, ahead and behind."""
    own = view.own
    follower_speed = view.speed + view.closing[SLOW_REAR]
    left = view.gap[SLOW_REAR] >= own.return_time_gap * follower_speed * view.impatience
    rear = left & (their_braking(given, view, SLOW_REAR) >= -(own.safe_decel / view.demand))
    front = own_braking(given, view, SLOW_LEAD) >= -own.decel
    worth = view.gap[SLOW_LEAD] > given.constants.stay_time * view.closing[SLOW_LEAD]
    return rear & front & worth


def must_abort(given: Parameters, view: View) -> Mask:
    """Whether the lane that the ego is entering has turned dangerous, and the old one still has room."""
    c, own = given.constants, view.own
    bad_rear = their_braking(given, view, REAR) < -(c.abort_factor * own.safe_decel / view.demand)
    bad_front = own_braking(given, view, LEAD) < -(c.abort_factor * own.decel)
    room = (own_braking(given, view, SLOW_LEAD) >= -own.hardest_decel) & (
        view.gap[SLOW_REAR] > c.smallest_rear_gap
    )
    return (bad_rear | bad_front) & room


def has_passed(state: State, given: Parameters, p: Fields) -> Mask:
    """Whether the target's front is visibly behind the ego's rear."""
    behind = state.s[Role.EGO] - pick(state.s, state.target)
    bodies = p.half_length[Role.EGO] + pick(p.half_length, state.target)
    return behind > bodies + given.constants.clear_ahead


def decide(
    state: State,
    given: Parameters,
    p: Fields,
    q: Fields,
    near: Neighbours,
    believed: Beliefs,
    recorder: Recorder,
    step: int,
) -> None:
    """One decision of every ego."""
    c = given.constants
    view = look(state, given, p, believed)
    stage = state.stage
    sound = state.crashed[Role.EGO] == 0
    arrived = state.path_time[Role.EGO] >= state.path_duration[Role.EGO]
    is_stage = {each: sound & (stage == np.float32(each)) for each in Stage}
    state.stage_time = state.stage_time + c.decision

    queues = view.gap[LEAD] < c.waiting_time_gap * view.speed
    waits = (
        is_stage[Stage.FOLLOW]
        & view.detected[LEAD]
        & queues
        & (view.own.desired_speed > view.leader_speed)
    )
    state.waited = np.where(waits, state.waited + c.decision, state.waited)

    free = is_stage[Stage.FOLLOW] & arrived & (state.since_change[Role.EGO] >= c.abort_cooldown)
    free = free & (state.lane[Role.EGO] < np.float32(given.road.num_lanes - 1))
    start = free & wants_to_pass(given, view) & may_pull_out(given, view) & (q.command != STAY)
    start = start | (free & (q.command == PULL_OUT_NOW) & (state.attempted == 0))

    slower_lane = is_stage[Stage.PASS] & (state.lane[Role.EGO] >= np.float32(1.0))
    passed = has_passed(state, given, p)
    stuck = (state.stage_time > c.give_up_after) & (state.s[Role.EGO] < pick(state.s, state.target))
    back = slower_lane & may_return(given, view) & (passed | stuck)
    back = back | (slower_lane & (q.command == RETURN_NOW))

    signals = start | back
    state.signalled = np.where(signals, state.signalled + c.decision, np.float32(0.0))
    ready = state.signalled > view.own.signal_time
    go_out, go_back = start & ready, back & ready

    entering = is_stage[Stage.PULL_OUT]
    early = state.path_time[Role.EGO] < c.abort_until * state.path_duration[Role.EGO]
    abort = entering & early & (must_abort(given, view) | (q.command == ABORT_NOW))

    recorder.percepts(
        state, near, believed, go_out, DecisionKind.PULL_OUT, (LEAD, FAST_LEAD, FAST_REAR), step
    )
    recorder.percepts(
        state, near, believed, abort, DecisionKind.ABORT, (LEAD, SLOW_LEAD, SLOW_REAR), step
    )
    recorder.percepts(
        state, near, believed, go_back, DecisionKind.RETURN, (LEAD, SLOW_LEAD, SLOW_REAR), step
    )

    state.target = np.where(go_out, near.slot[LEAD, Role.EGO], state.target)
    state.attempted = np.where(go_out, np.float32(1.0), state.attempted)
    _move_over(state, given, p, go_out, go_back | abort)
    _show_indicator(state, view, start, back, arrived & ~go_out & ~go_back & ~abort)

    centre = np.float32(0.5) * (near.lane_low[Role.EGO] + near.lane_high[Role.EGO])
    finished = arrived & (np.abs(state.d[Role.EGO] - centre) < c.settled_offset)
    next_stage = np.where(go_out, np.float32(Stage.PULL_OUT), stage)
    next_stage = np.where(entering & arrived, np.float32(Stage.PASS), next_stage)
    next_stage = np.where(abort, np.float32(Stage.ABORT), next_stage)
    next_stage = np.where(
        go_back, np.where(passed, np.float32(Stage.RETURN), np.float32(Stage.ABORT)), next_stage
    )
    next_stage = np.where(is_stage[Stage.RETURN] & finished, np.float32(Stage.DONE), next_stage)
    next_stage = np.where(is_stage[Stage.ABORT] & finished, np.float32(Stage.FOLLOW), next_stage)
    state.stage_time = np.where(next_stage != stage, np.float32(0.0), state.stage_time)
    over = (next_stage == np.float32(Stage.DONE)) & (stage != np.float32(Stage.DONE))
    after = np.float32(step) + np.rint(c.after_overtake / c.step)
    state.end_step = np.where(over, minimum(state.end_step, after), state.end_step)
    idle = (
        is_stage[Stage.FOLLOW]
        & (state.attempted == 0)
        & ~start
        & (np.float32(step) >= q.deadline_step)
    )
    state.end_step = np.where(idle, minimum(state.end_step, np.float32(step)), state.end_step)
    state.stage = next_stage


def _move_over(state: State, given: Parameters, p: Fields, out: Mask, back: Mask) -> None:
    fast = np.zeros(state.s.shape, bool)
    slow = np.zeros(state.s.shape, bool)
    fast[Role.EGO], slow[Role.EGO] = out, back
    turn_to_lane(state, given, p, fast, slow)


def _show_indicator(state: State, view: View, start: Mask, back: Mask, straight: Mask) -> None:
    side = np.where(start, np.float32(1.0), np.where(back, np.float32(-1.0), np.float32(0.0)))
    shown = np.where(straight, side * view.own.uses_indicator, state.indicator[Role.EGO])
    state.indicator[Role.EGO] = shown
