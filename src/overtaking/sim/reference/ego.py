"""Decisions about overtaking: follow, pull out, pass, return, or give up.

They are those of the ego, and on two-way roads of everybody by the same rules: `who` says of whom
arrays tell.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, Mask, exp, maximum, minimum
from overtaking.model.decision import Decision
from overtaking.model.trajectory import DecisionKind, Stage
from overtaking.model.vehicles import Role
from overtaking.sim.reference.following import forced_braking, needed_braking
from overtaking.sim.reference.intent import (
    Intent,
    can_abort,
    can_remain,
    has_arrived,
    has_passed,
    in_stage,
    signal,
)
from overtaking.sim.reference.mobil import (
    must_wait,
    soon,
    time_left,
    turn_to_lane,
)
from overtaking.sim.reference.moment import Moment
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.orders import Orders, obey, show
from overtaking.sim.reference.passing import goes_on, may_meet, outlook, room_left, weigh
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.recording import Recorder
from overtaking.sim.reference.state import (
    FAST_LEAD,
    FAST_REAR,
    LEAD,
    ONCOMING,
    OTHERS,
    REAR,
    SLOW_LEAD,
    SLOW_REAR,
    Fields,
    State,
    Who,
    pick,
)
from overtaking.world.parameters import SUBSTEPS, Parameters, SimulationParameters

_STEADY = np.float32(0.0)
_ONE = np.float32(1.0)
_LEAST_DEMAND = np.float32(1e-6)  # Keeps what is imposed finite for who demands nothing [1].


@dataclass(slots=True, kw_only=True)
class View:
    """What drivers know when they decide; arrays of the shape of `Who`, or one for each role.

    Attributes:
        who: Who they are.
        own: Their parameters.
        speed: Their speed [m/s].
        gap: Believed gaps, by role [m].
        closing: Believed speeds of approach, by role [m/s].
        detected: Whether they have noticed the neighbour, by role.
        leader_speed: Believed speed of the leader [m/s].
        demand: Factor on the gaps that they ask for now [1].
        imposes: Braking that they ask of others at most, positive [m/s^2].
        impatience: What waiting has left of their demands, 1 at first [1].
        room_left: How much more room they leave to the leader than to a car [1].
        told: Whether the ego is told to change lanes, as in the study: who demands no gap looks at
            nobody beside it, and gives nothing up.
        ordered: Whether it is told to pull out now: a vehicle in sight ahead is slower.
        command: Decision that is forced on the ego, 0 for none.
    """

    who: Who
    own: Fields
    speed: F32
    gap: F32
    closing: F32
    detected: Mask
    leader_speed: F32
    demand: F32
    imposes: F32
    impatience: F32
    room_left: F32 | np.float32
    told: Mask
    ordered: Mask
    command: F32


def look(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    believed: Beliefs,
    who: Who,
) -> View:
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
    own = p.of(who)
    waited = state.waited[who] * own.inverse_patience
    impatience = maximum(exp(-waited), given.constants.patience_floor)
    gap, closing = believed.gap[:, who], believed.closing[:, who]
    demand = own.gap_acceptance * impatience
    told = ordered = np.zeros(demand.shape, bool)
    if who == Role.EGO:
        told = is_told(p)
        seen = told & believed.detected[LEAD, who]
        ordered = seen & (faster(state, near) > own.passing_gain)
    bounded = minimum(own.safe_decel / maximum(demand, _LEAST_DEMAND), given.constants.most_imposed)
    return View(
        who=who,
        own=own,
        speed=state.vx[who],
        gap=gap,
        closing=closing,
        detected=believed.detected[:, who],
        leader_speed=state.vx[who] - closing[LEAD],
        demand=demand,
        imposes=minimum(bounded, own.hardest_decel),
        impatience=impatience,
        room_left=room_left(given.constants, p, near.slot[LEAD, who])
        if given.road.two_way
        else _ONE,
        told=told,
        ordered=ordered,
        command=q.command if who == Role.EGO else np.zeros_like(q.command),
    )


def is_told(p: Fields) -> Mask:
    """Whether the ego is told to change lanes, as in the study: it demands no gap."""
    return p.of(Role.EGO).gap_acceptance <= 0


def faster(state: State, near: Neighbours) -> F32:
    """By how much the ego is in truth faster than its leader, which decides where it is told."""
    return state.vx[Role.EGO] - pick(state.vx, near.slot[LEAD, Role.EGO])


@dataclass(slots=True, kw_only=True)
class Meeting:
    """What oncoming traffic lets drivers do; masks of the shape of `Who`.

    Attributes:
        may_go: The other lane is believed to be free for long enough to pass.
        hurries: Little time is left to be past.
        squeezes: A driver in a hurry has room to squeeze back in.
        falls_in: A driver who gives up has room to fall in behind the other.
        room_left: How much more room is left to the passed vehicle than to a car [1].
    """

    may_go: Mask
    hurries: Mask
    squeezes: Mask
    falls_in: Mask
    room_left: F32


def own_braking(given: Parameters, view: View, gap: F32, closing: F32) -> F32:
    """Acceleration that a vehicle ahead forces on a driver at the gap demanded now."""
    time_gap = view.own.time_gap * view.demand
    return forced_braking(given.constants, view.own, view.speed, gap, closing, time_gap)


def their_braking(given: Parameters, view: View, gap: F32, closing: F32) -> F32:
    """Acceleration that a driver in front would force on a vehicle behind."""
    time_gap = view.own.time_gap * view.demand
    return forced_braking(given.constants, view.own, view.speed + closing, gap, closing, time_gap)


def wants_to_pass(given: Parameters, view: View) -> Mask:
    """Whether the leader is slow enough, and near enough, that an overtake is wanted now."""
    own = view.own
    slower = own.desired_speed - view.leader_speed > own.passing_gain * view.impatience
    soon = view.gap[LEAD] < own.pull_out_time * view.closing[LEAD]
    kept = own.time_gap * view.room_left
    near = given.constants.close_time_gap * kept * view.speed + own.min_gap
    close = view.gap[LEAD] < near
    return view.detected[LEAD] & slower & (soon | close)


def may_pull_out(given: Parameters, view: View) -> Mask:
    """Whether the next lane looks free enough, and faster, to this driver.

    The lane of oncoming traffic is free while no other is seen to overtake there.
    """
    c, own = given.constants, view.own
    front = own_braking(given, view, view.gap[FAST_LEAD], view.closing[FAST_LEAD]) >= -own.decel
    gap, closing = view.gap[FAST_REAR], view.closing[FAST_REAR]
    now = their_braking(given, view, gap, closing)
    rear = minimum(now, their_braking(given, view, *soon(given, gap, closing))) >= -view.imposes
    rear = rear & (gap > c.smallest_rear_gap * view.demand)
    if given.road.two_way:
        return rear & ~view.detected[FAST_LEAD]
    next_speed = view.speed - view.closing[FAST_LEAD]
    gain = next_speed - view.leader_speed > own.passing_gain * view.impatience
    far = view.gap[FAST_LEAD] > view.gap[LEAD] + c.waiting_time_gap * view.speed
    return front & rear & (gain | far | ~view.detected[FAST_LEAD])


def may_return(given: Parameters, view: View, room_left: F32 | np.float32 = _ONE) -> Mask:
    """Whether the slower lane has room: behind when the line is crossed, ahead at the end.

    Args:
        given: All inputs.
        view: What drivers know.
        room_left: How much more room is left behind than to a car [1].
    """
    own, zero = view.own, np.float32(0.0)
    closing, ahead = view.closing[SLOW_REAR], view.closing[SLOW_LEAD]
    crossing = np.float32(0.5) * own.lane_change_duration
    gap = view.gap[SLOW_REAR] - crossing * minimum(closing, zero)
    left = gap >= own.return_time_gap * (view.speed + closing) * view.impatience * room_left
    rear = left & (their_braking(given, view, gap, closing) >= -view.imposes)
    room = view.gap[SLOW_LEAD] - own.lane_change_duration * maximum(ahead, zero)
    front = own_braking(given, view, room, ahead) >= -own.decel
    c = given.constants
    # On a two-way road one returns even if one will soon catch up with the next vehicle.
    if given.road.two_way:
        return rear & front & (view.gap[SLOW_LEAD] > c.squeeze_gap)
    return rear & front & (view.gap[SLOW_LEAD] > c.stay_time * view.closing[SLOW_LEAD])


def must_abort(given: Parameters, view: View, lead: int, rear: int) -> Mask:
    """Whether the lane being entered has turned dangerous, and the old one still has room.

    Args:
        given: All inputs.
        view: What drivers know.
        lead: Role of the vehicle ahead in the old lane.
        rear: Role of the vehicle behind in the old lane.
    """
    c, own = given.constants, view.own
    imposed = their_braking(given, view, view.gap[REAR], view.closing[REAR])
    braking = own_braking(given, view, view.gap[LEAD], view.closing[LEAD])
    bad = (imposed < -(c.abort_imposed * view.imposes)) | (braking < -(c.abort_factor * own.decel))
    back = needed_braking(c, view.speed, view.gap[lead], view.closing[lead], _STEADY)
    return bad & (back >= -own.hardest_decel) & (view.gap[rear] > c.smallest_rear_gap)


def decide(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    recorder: Recorder | None,
    step: int,
    orders: Orders | None = None,
) -> None:
    """One decision of every ego; what it intends holds until it looks around again."""
    view = look(state, given, p, q, moment.near, moment.believed, Role.EGO)
    _wait(state, given, view)
    # Oncoming traffic changes the pedals and the haste of the ego, also under another driver.
    meets = _meet(state, given, p, q, moment, view)
    if orders is None:
        intent = _intend(state, given, p, moment, view, meets)
    else:
        intent = obey(state, given, p, orders)
    front = FAST_LEAD if moment.met is None else ONCOMING
    for mask, kind, roles in (
        (intent.go_out, DecisionKind.PULL_OUT, (LEAD, front, FAST_REAR)),
        (intent.abort, DecisionKind.ABORT, (LEAD, SLOW_LEAD, SLOW_REAR)),
        (intent.remain, DecisionKind.ABORT, (LEAD, FAST_LEAD, FAST_REAR)),
        (intent.go_back, DecisionKind.RETURN, (LEAD, SLOW_LEAD, SLOW_REAR)),
    ):
        if recorder is not None:
            coming = None if moment.met is None else moment.met.coming
            recorder.percepts(state, moment.near, moment.believed, mask, kind, roles, step, coming)
    next_stage = _next_stage(state, given, moment.near, view.who, intent)
    _act(state, given, p, q, moment, view, intent, step // SUBSTEPS)
    if orders is not None:
        show(state, orders)
    _end(state, given, q, intent, next_stage, step)
    _enter(state, view.who, next_stage)


def decide_others(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    step: int,
) -> None:
    """One decision of everybody else on a two-way road; who has overtaken may do so again."""
    view = look(state, given, p, q, moment.near, moment.believed, OTHERS)
    _wait(state, given, view)
    intent = _intend(state, given, p, moment, view, _meet(state, given, p, q, moment, view))
    stage = _next_stage(state, given, moment.near, OTHERS, intent)
    _act(state, given, p, q, moment, view, intent, step // SUBSTEPS)
    done = stage == np.float32(Stage.DONE)
    state.waited[OTHERS] = np.where(done, _STEADY, state.waited[OTHERS])
    _enter(state, OTHERS, np.where(done, np.float32(Stage.FOLLOW), stage))


def _enter(state: State, who: Who, stage: F32) -> None:
    """Go on to the next stage, or stay."""
    changed = stage != state.stage[who]
    state.stage_time[who] = np.where(changed, _STEADY, state.stage_time[who])
    state.stage[who] = stage


def _meet(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    view: View,
) -> Meeting | None:
    """What oncoming traffic lets drivers do, remembered; None where there is none on the road."""
    if moment.met is None:
        return None
    who, coming = view.who, moment.met.coming
    leader = view.gap[LEAD], view.leader_speed
    ahead = outlook(state, given, p, moment.near, coming, who, leader)
    plight = weigh(state, given, p, q, moment, who)
    state.yields[who] = np.where(plight.yields, _ONE, _STEADY)
    state.hurries[who] = np.where(plight.hurries, _ONE, _STEADY)
    return Meeting(
        may_go=may_meet(given, view.own, view.speed, view.impatience, ahead)
        & ~moment.met.leader_goes[who],
        hurries=plight.hurries,
        squeezes=plight.pressed & may_squeeze(given, q, view),
        falls_in=plight.yields & plight.fits & has_room_behind(given, view),
        room_left=room_left(given.constants, p, state.target[who]),
    )


def may_squeeze(given: Parameters, q: SimulationParameters, view: View) -> Mask:
    """Whether the lane beside has room enough for a driver in a hurry when the line is crossed."""
    c, closing = given.constants, view.closing[SLOW_LEAD]
    crossing = np.float32(0.5) * q.hasty_change
    front = view.gap[SLOW_LEAD] - crossing * closing
    rear = view.gap[SLOW_REAR] - crossing * maximum(view.closing[SLOW_REAR], _STEADY)
    squeezed = minimum(rear, front) > c.squeeze_gap
    # It brakes on the way: who waits until it need not never gets behind a slow vehicle in time.
    ahead = needed_braking(c, view.speed, view.gap[SLOW_LEAD], closing, _STEADY)
    return squeezed & (ahead >= -(c.abort_factor * view.own.decel))


def has_room_behind(given: Parameters, view: View) -> Mask:
    """Whether nobody is close behind in the slower lane."""
    return view.gap[SLOW_REAR] > given.constants.smallest_rear_gap


def _haste(state: State, q: SimulationParameters, who: Who) -> F32:
    """How long hurried drivers take to change lanes, 0 for everybody else [s]."""
    hasty = np.zeros_like(state.s)
    hurried = (state.hurries[who] > 0) | (state.yields[who] > 0)
    hasty[who] = np.where(hurried, q.hasty_change, _STEADY)
    return hasty


def _wait(state: State, given: Parameters, view: View) -> None:
    """Count the time behind a slower leader."""
    c = given.constants
    queues = view.gap[LEAD] < c.waiting_time_gap * view.speed
    slower = view.own.desired_speed > view.leader_speed
    waits = in_stage(state, view.who, Stage.FOLLOW) & view.detected[LEAD] & queues & slower
    waited = state.waited[view.who]
    state.waited[view.who] = np.where(waits, waited + c.decision, waited)


def _intend(
    state: State,
    given: Parameters,
    p: Fields,
    moment: Moment,
    view: View,
    meets: Meeting | None,
) -> Intent:
    """What drivers want, and what of it is done now that they have signalled long enough."""
    who = view.who
    looks = moment.looks[who]
    waits = must_wait(state, given, state.wanted, moment.claims)[who]
    arrived = has_arrived(state, who)
    passed = has_passed(state, given, p, who)
    start = _starts(state, given, view, arrived, looks, meets)
    back = _turns_back(state, given, view, passed, looks, meets)
    signal(state, given, who, start, back)
    ready = state.signalled[who] > view.own.signal_time
    sure = (looks & ~waits) | view.told
    abort = _gives_up(state, given, view, looks)
    remain = _stays_out(state, given, view, looks)
    back_now = ready
    if meets is not None:
        back_now = (ready | meets.hurries) & ~meets.falls_in
        abort = abort | meets.falls_in
        remain = np.zeros_like(remain)  # The other lane is no place to stay.
    return Intent(
        start=start,
        back=back,
        go_out=start & ready & (sure | (view.command == Decision.PULL_OUT)),
        go_back=back & back_now & (sure | (view.command == Decision.RETURN)),
        abort=abort,
        remain=remain,
        passed=passed,
        arrived=arrived,
    )


def _starts(
    state: State,
    given: Parameters,
    view: View,
    arrived: Mask,
    looks: Mask,
    meets: Meeting | None,
) -> Mask:
    """Whether an overtake is wanted and looked possible, or is forced by a branch."""
    c, who = given.constants, view.who
    rested = state.since_change[who] >= c.abort_cooldown
    has_lane = state.lane[who] < np.float32(given.road.num_lanes - 1)
    free = in_stage(state, who, Stage.FOLLOW) & arrived & rested & has_lane
    seen = wants_to_pass(given, view) & may_pull_out(given, view)
    if meets is not None:
        seen = seen & meets.may_go
    seen = np.where(view.told, view.ordered, seen)
    wanted = np.where(looks | view.told, seen, state.wanted[who] > 0)
    wanted = wanted & (view.command != Decision.STAY)
    forced = (view.command == Decision.PULL_OUT) & (state.attempted == 0)
    return free & (wanted | forced)


def _turns_back(
    state: State,
    given: Parameters,
    view: View,
    passed: Mask,
    looks: Mask,
    meets: Meeting | None,
) -> Mask:
    """Whether drivers may return: past the target, or stuck beside it, or forced by a branch."""
    c, who = given.constants, view.who
    has_lane = in_stage(state, who, Stage.PASS) & (state.lane[who] >= np.float32(1.0))
    late = state.stage_time[who] > c.give_up_after
    stuck = late & (state.s[who] < pick(state.s, state.target[who]))
    rested = state.since_change[who] >= c.abort_cooldown
    if meets is None:
        may = may_return(given, view) & (passed | stuck)
    else:
        hurried = meets.squeezes & passed
        may = (may_return(given, view, meets.room_left) & (passed | stuck)) | hurried
        rested = rested | hurried
    seen = np.where(view.told, passed, may) & rested
    wanted = np.where(looks | view.told, seen, state.wanted[who] < 0)
    return has_lane & (wanted | (view.command == Decision.RETURN))


def _gives_up(state: State, given: Parameters, view: View, looks: Mask) -> Mask:
    """Whether drivers go back while pulling out: in danger, or forced by a branch."""
    danger = looks & ~view.told & must_abort(given, view, SLOW_LEAD, SLOW_REAR)
    forced = view.command == Decision.ABORT
    return can_abort(state, given, view.who) & (danger | forced)


def _stays_out(state: State, given: Parameters, view: View, looks: Mask) -> Mask:
    """Whether drivers give up their way back in danger, unless a branch forces a return."""
    danger = looks & ~view.told & must_abort(given, view, FAST_LEAD, FAST_REAR)
    return can_remain(state, given, view.who) & danger & (view.command != Decision.RETURN)


def _next_stage(state: State, given: Parameters, near: Neighbours, who: Who, intent: Intent) -> F32:
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
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    view: View,
    intent: Intent,
    decision: int,
) -> None:
    """Move over and show it; who pulls out remembers whom to overtake."""
    who, near = view.who, moment.near
    target = np.where(intent.go_out, near.slot[LEAD, who], state.target[who])
    if given.road.two_way:
        beside = goes_on(state, given, p, q, moment, who)
        target = np.where(beside, near.slot[SLOW_LEAD, who], target)
    state.target[who] = target
    if who == Role.EGO:
        state.attempted = np.where(intent.go_out, _ONE, state.attempted)
    fast, slow, back = (np.zeros(state.s.shape, bool) for _ in range(3))
    fast[who] = intent.go_out | intent.remain
    slow[who] = intent.go_back | intent.abort
    back[who] = intent.abort | intent.remain
    left = np.zeros_like(state.s)
    left[who] = time_left(view.gap[LEAD], view.closing[LEAD])
    hasty = _haste(state, q, who) if given.road.two_way else None
    turn_to_lane(state, given, p, (fast, slow, back), left, decision, hasty)
    _show(state, view, intent, (fast | slow)[who])


def _show(state: State, view: View, intent: Intent, moved: Mask) -> None:
    """Signal an intention while it lasts; during a lane change its own indicator stays on."""
    who, signalled = view.who, state.signalled[view.who]
    kept = np.where(signalled > 0, state.indicator[who], _STEADY)
    used = view.own.uses_indicator
    shown = np.where(intent.start, used, np.where(intent.back, -used, kept))
    straight = intent.arrived & ~moved
    state.indicator[who] = np.where(straight, shown, state.indicator[who])
    state.signalled[who] = np.where(moved, _STEADY, signalled)


def _end(
    state: State,
    given: Parameters,
    q: SimulationParameters,
    intent: Intent,
    next_stage: F32,
    step: int,
) -> None:
    """End the simulation some time after the overtake, or at the deadline without an attempt."""
    c, done = given.constants, np.float32(Stage.DONE)
    now = np.float32(step)
    over = (next_stage == done) & (state.stage[Role.EGO] != done)
    after = now + np.rint(c.after_overtake / c.step)
    state.end_step = np.where(over, minimum(state.end_step, after), state.end_step)
    idle = in_stage(state, Role.EGO, Stage.FOLLOW) & ~intent.start
    late = idle & (now >= q.deadline_step)
    state.end_step = np.where(late, minimum(state.end_step, now), state.end_step)
