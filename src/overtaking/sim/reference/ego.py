"""The ego's decisions: follow, pull out, pass, return, or give up."""

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
    Claims,
    must_wait,
    soon,
    time_left,
    turn_to_lane,
)
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.oncoming import Oncoming
from overtaking.sim.reference.orders import Orders, obey, show
from overtaking.sim.reference.passing import may_meet, outlook, room_left, weigh
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.recording import Recorder
from overtaking.sim.reference.state import (
    FAST_LEAD,
    FAST_REAR,
    LEAD,
    ONCOMING,
    REAR,
    SLOW_LEAD,
    SLOW_REAR,
    Fields,
    State,
    pick,
)
from overtaking.world.parameters import SUBSTEPS, Parameters, SimulationParameters

_STEADY = np.float32(0.0)
_ONE = np.float32(1.0)
_LEAST_DEMAND = np.float32(1e-6)  # Keeps what is imposed finite for who demands nothing [1].


@dataclass(slots=True, kw_only=True)
class View:
    """What the ego knows when it decides; arrays of shape (simulation,), or (role, simulation).

    Attributes:
        own: Its parameters.
        speed: Its speed [m/s].
        gap: Believed gaps, by role [m].
        closing: Believed speeds of approach, by role [m/s].
        detected: Whether it has noticed the neighbour, by role.
        leader_speed: Believed speed of the leader [m/s].
        demand: Factor on the gaps that it asks for now [1].
        imposes: Braking that it asks of others at most, positive [m/s^2].
        impatience: What waiting has left of its demands, 1 at first [1].
        told: Whether it is told to change lanes, as in the study: who demands no gap looks at
            nobody beside it, and gives nothing up.
        ordered: Whether it is told to pull out now: a vehicle in sight ahead is slower.
    """

    own: Fields
    speed: F32
    gap: F32
    closing: F32
    detected: Mask
    leader_speed: F32
    demand: F32
    imposes: F32
    impatience: F32
    told: Mask
    ordered: Mask


def look(state: State, given: Parameters, p: Fields, near: Neighbours, believed: Beliefs) -> View:
    """The ego's beliefs and how much it demands after its wait."""
    own = p.of(Role.EGO)
    impatience = maximum(
        exp(-(state.waited * own.inverse_patience)), given.constants.patience_floor
    )
    gap, closing = believed.gap[:, Role.EGO], believed.closing[:, Role.EGO]
    demand = own.gap_acceptance * impatience
    told = is_told(p)
    bounded = minimum(own.safe_decel / maximum(demand, _LEAST_DEMAND), given.constants.most_imposed)
    return View(
        own=own,
        speed=state.vx[Role.EGO],
        gap=gap,
        closing=closing,
        detected=believed.detected[:, Role.EGO],
        leader_speed=state.vx[Role.EGO] - closing[LEAD],
        demand=demand,
        imposes=minimum(bounded, own.hardest_decel),
        impatience=impatience,
        told=told,
        ordered=told & believed.detected[LEAD, Role.EGO] & (faster(state, near) > own.passing_gain),
    )


def is_told(p: Fields) -> Mask:
    """Whether the ego is told to change lanes, as in the study: it demands no gap."""
    return p.of(Role.EGO).gap_acceptance <= 0


def faster(state: State, near: Neighbours) -> F32:
    """By how much the ego is in truth faster than its leader, which decides where it is told."""
    return state.vx[Role.EGO] - pick(state.vx, near.slot[LEAD, Role.EGO])


@dataclass(slots=True, kw_only=True)
class Meeting:
    """What oncoming traffic lets the ego do; masks of shape (simulation,).

    Attributes:
        may_go: The other lane is believed to be free for long enough to pass.
        hurries: Little time is left to be past.
        squeezes: It is in a hurry, and there is room to squeeze back in.
        falls_in: It gives up, and there is room to fall in behind the other.
        room_left: How much more room it leaves to the passed vehicle than to a car [1].
    """

    may_go: Mask
    hurries: Mask
    squeezes: Mask
    falls_in: Mask
    room_left: F32


def own_braking(given: Parameters, view: View, gap: F32, closing: F32) -> F32:
    """Acceleration that a vehicle ahead forces on the ego at the gap demanded now."""
    time_gap = view.own.time_gap * view.demand
    return forced_braking(given.constants, view.own, view.speed, gap, closing, time_gap)


def their_braking(given: Parameters, view: View, gap: F32, closing: F32) -> F32:
    """Acceleration that the ego in front would force on a vehicle behind it."""
    time_gap = view.own.time_gap * view.demand
    return forced_braking(given.constants, view.own, view.speed + closing, gap, closing, time_gap)


def wants_to_pass(given: Parameters, view: View) -> Mask:
    """Whether the leader is slow enough, and near enough, that an overtake is wanted now."""
    own = view.own
    slower = own.desired_speed - view.leader_speed > own.passing_gain * view.impatience
    soon = view.gap[LEAD] < own.pull_out_time * view.closing[LEAD]
    near = given.constants.close_time_gap * own.time_gap * view.speed + own.min_gap
    close = view.gap[LEAD] < near
    return view.detected[LEAD] & slower & (soon | close)


def may_pull_out(given: Parameters, view: View) -> Mask:
    """Whether the next lane looks free enough, and faster, to this driver."""
    c, own = given.constants, view.own
    front = own_braking(given, view, view.gap[FAST_LEAD], view.closing[FAST_LEAD]) >= -own.decel
    gap, closing = view.gap[FAST_REAR], view.closing[FAST_REAR]
    now = their_braking(given, view, gap, closing)
    rear = minimum(now, their_braking(given, view, *soon(given, gap, closing))) >= -view.imposes
    rear = rear & (gap > c.smallest_rear_gap * view.demand)
    next_speed = view.speed - view.closing[FAST_LEAD]
    gain = next_speed - view.leader_speed > own.passing_gain * view.impatience
    far = view.gap[FAST_LEAD] > view.gap[LEAD] + c.waiting_time_gap * view.speed
    return front & rear & (gain | far | ~view.detected[FAST_LEAD])


def may_return(given: Parameters, view: View, room_left: F32 | np.float32 = _ONE) -> Mask:
    """Whether the slower lane has room: behind when the line is crossed, ahead at the end.

    Args:
        given: All inputs.
        view: What the ego knows.
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
    # On a two-way road the ego returns even if it will soon catch up with the next vehicle.
    if given.road.two_way:
        return rear & front & (view.gap[SLOW_LEAD] > c.squeeze_gap)
    return rear & front & (view.gap[SLOW_LEAD] > c.stay_time * view.closing[SLOW_LEAD])


def must_abort(given: Parameters, view: View, lead: int, rear: int) -> Mask:
    """Whether the lane being entered has turned dangerous, and the old one still has room.

    Args:
        given: All inputs.
        view: What the ego knows.
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
    near: Neighbours,
    believed: Beliefs,
    looks: Mask,
    claims: Claims,
    recorder: Recorder | None,
    step: int,
    orders: Orders | None = None,
    oncoming: Oncoming | None = None,
) -> None:
    """One decision of every ego; what it intends holds until it looks around again."""
    view = look(state, given, p, near, believed)
    _wait(state, given, view)
    # Oncoming traffic changes the pedals and the haste of the ego, also under another driver.
    meets = _meet(state, given, p, q, near, view, oncoming)
    if orders is None:
        waits = must_wait(state, given, state.wanted, claims)[Role.EGO]
        intent = _intend(state, given, p, q, view, looks, waits, meets)
    else:
        intent = obey(state, given, p, orders)
    front = FAST_LEAD if oncoming is None else ONCOMING
    for mask, kind, roles in (
        (intent.go_out, DecisionKind.PULL_OUT, (LEAD, front, FAST_REAR)),
        (intent.abort, DecisionKind.ABORT, (LEAD, SLOW_LEAD, SLOW_REAR)),
        (intent.remain, DecisionKind.ABORT, (LEAD, FAST_LEAD, FAST_REAR)),
        (intent.go_back, DecisionKind.RETURN, (LEAD, SLOW_LEAD, SLOW_REAR)),
    ):
        if recorder is not None:
            recorder.percepts(state, near, believed, mask, kind, roles, step, oncoming)
    next_stage = _next_stage(state, given, near, intent)
    hasty = None if oncoming is None else _haste(state, q)
    _act(state, given, p, near, view, intent, step // SUBSTEPS, hasty)
    if orders is not None:
        show(state, orders)
    _end(state, given, q, intent, next_stage, step)
    state.stage_time = np.where(next_stage != state.stage, np.float32(0.0), state.stage_time)
    state.stage = next_stage


def _meet(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    view: View,
    oncoming: Oncoming | None,
) -> Meeting | None:
    """What oncoming traffic lets the ego do, remembered; None where there is none on the road."""
    if oncoming is None:
        return None
    ahead = outlook(state, given, p, near, oncoming, view.gap[LEAD], view.leader_speed)
    plight = weigh(state, given, p, q, oncoming)
    state.yields = np.where(plight.yields, np.float32(1.0), _STEADY)
    state.hurries = np.where(plight.hurries, np.float32(1.0), _STEADY)
    return Meeting(
        may_go=may_meet(given, view.own, q, view.speed, view.impatience, ahead),
        hurries=plight.hurries,
        squeezes=plight.hurries & may_squeeze(given, q, view),
        falls_in=plight.yields & plight.fits & has_room_behind(given, view),
        room_left=room_left(given.constants, p, state.target),
    )


def may_squeeze(given: Parameters, q: SimulationParameters, view: View) -> Mask:
    """Whether the lane beside has room enough for an ego in a hurry."""
    c, closing = given.constants, view.closing[SLOW_LEAD]
    squeezed = minimum(view.gap[SLOW_REAR], view.gap[SLOW_LEAD]) > c.squeeze_gap
    room = view.gap[SLOW_LEAD] - q.hasty_change * maximum(closing, _STEADY)
    ahead = needed_braking(c, view.speed, room, closing, _STEADY)
    return squeezed & (ahead >= -(c.abort_factor * view.own.decel))


def has_room_behind(given: Parameters, view: View) -> Mask:
    """Whether nobody is close behind in the slower lane."""
    return view.gap[SLOW_REAR] > given.constants.smallest_rear_gap


def _haste(state: State, q: SimulationParameters) -> F32:
    """How long a hurried ego takes to change lanes, 0 for everybody else [s]."""
    hasty = np.zeros_like(state.s)
    hasty[Role.EGO] = np.where((state.hurries > 0) | (state.yields > 0), q.hasty_change, _STEADY)
    return hasty


def _wait(state: State, given: Parameters, view: View) -> None:
    """Count the time behind a slower leader."""
    c = given.constants
    queues = view.gap[LEAD] < c.waiting_time_gap * view.speed
    slower = view.own.desired_speed > view.leader_speed
    waits = in_stage(state, Stage.FOLLOW) & view.detected[LEAD] & queues & slower
    state.waited = np.where(waits, state.waited + c.decision, state.waited)


def _intend(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    view: View,
    looks: Mask,
    waits: Mask,
    meets: Meeting | None,
) -> Intent:
    """What the ego wants, and what of it is done now that it has signalled long enough."""
    arrived = has_arrived(state)
    passed = has_passed(state, given, p)
    start = _starts(state, given, q, view, arrived, looks, meets)
    back = _turns_back(state, given, q, view, passed, looks, meets)
    signal(state, given, start, back)
    ready = state.signalled > view.own.signal_time
    sure = (looks & ~waits) | view.told
    abort = _gives_up(state, given, q, view, looks)
    remain = _stays_out(state, given, q, view, looks)
    back_now = ready
    if meets is not None:
        back_now = (ready | meets.hurries) & ~meets.falls_in
        abort = abort | meets.falls_in
        remain = np.zeros_like(remain)  # The other lane is no place to stay.
    return Intent(
        start=start,
        back=back,
        go_out=start & ready & (sure | (q.command == Decision.PULL_OUT)),
        go_back=back & back_now & (sure | (q.command == Decision.RETURN)),
        abort=abort,
        remain=remain,
        passed=passed,
        arrived=arrived,
    )


def _starts(
    state: State,
    given: Parameters,
    q: SimulationParameters,
    view: View,
    arrived: Mask,
    looks: Mask,
    meets: Meeting | None,
) -> Mask:
    """Whether an overtake is wanted and looked possible, or is forced by a branch."""
    c = given.constants
    rested = state.since_change[Role.EGO] >= c.abort_cooldown
    has_lane = state.lane[Role.EGO] < np.float32(given.road.num_lanes - 1)
    free = in_stage(state, Stage.FOLLOW) & arrived & rested & has_lane
    seen = wants_to_pass(given, view) & may_pull_out(given, view)
    if meets is not None:
        seen = seen & meets.may_go
    seen = np.where(view.told, view.ordered, seen)
    wanted = np.where(looks | view.told, seen, state.wanted[Role.EGO] > 0) & (
        q.command != Decision.STAY
    )
    return free & (wanted | ((q.command == Decision.PULL_OUT) & (state.attempted == 0)))


def _turns_back(
    state: State,
    given: Parameters,
    q: SimulationParameters,
    view: View,
    passed: Mask,
    looks: Mask,
    meets: Meeting | None,
) -> Mask:
    """Whether the ego may return: past the target, or stuck beside it, or forced by a branch."""
    c = given.constants
    has_lane = in_stage(state, Stage.PASS) & (state.lane[Role.EGO] >= np.float32(1.0))
    late = state.stage_time > c.give_up_after
    stuck = late & (state.s[Role.EGO] < pick(state.s, state.target))
    rested = state.since_change[Role.EGO] >= c.abort_cooldown
    if meets is None:
        may = may_return(given, view) & (passed | stuck)
    else:
        hurried = meets.squeezes & passed
        may = (may_return(given, view, meets.room_left) & (passed | stuck)) | hurried
        rested = rested | hurried
    seen = np.where(view.told, passed, may) & rested
    wanted = np.where(looks | view.told, seen, state.wanted[Role.EGO] < 0)
    return has_lane & (wanted | (q.command == Decision.RETURN))


def _gives_up(
    state: State, given: Parameters, q: SimulationParameters, view: View, looks: Mask
) -> Mask:
    """Whether the ego goes back while pulling out: in danger, or forced by a branch."""
    danger = looks & ~view.told & must_abort(given, view, SLOW_LEAD, SLOW_REAR)
    forced = q.command == Decision.ABORT
    return can_abort(state, given) & (danger | forced)


def _stays_out(
    state: State, given: Parameters, q: SimulationParameters, view: View, looks: Mask
) -> Mask:
    """Whether the ego gives up its way back in danger, unless a branch forces it to return."""
    danger = looks & ~view.told & must_abort(given, view, FAST_LEAD, FAST_REAR)
    return can_remain(state, given) & danger & (q.command != Decision.RETURN)


def _next_stage(state: State, given: Parameters, near: Neighbours, intent: Intent) -> F32:
    """The stage after this decision; an abort wins over an arrival, a return over both."""
    centre = np.float32(0.5) * (near.lane_low[Role.EGO] + near.lane_high[Role.EGO])
    settled = np.abs(state.d[Role.EGO] - centre) < given.constants.settled_offset
    finished = intent.arrived & settled
    returning = np.where(intent.passed, np.float32(Stage.RETURN), np.float32(Stage.ABORT))
    stage = np.where(intent.go_out, np.float32(Stage.PULL_OUT), state.stage)
    entered = in_stage(state, Stage.PULL_OUT) & intent.arrived
    stage = np.where(entered, np.float32(Stage.PASS), stage)
    stage = np.where(intent.abort, np.float32(Stage.ABORT), stage)
    stage = np.where(intent.go_back & in_stage(state, Stage.PASS), returning, stage)
    stage = np.where(in_stage(state, Stage.RETURN) & finished, np.float32(Stage.DONE), stage)
    stage = np.where(in_stage(state, Stage.ABORT) & finished, np.float32(Stage.FOLLOW), stage)
    return np.where(intent.remain, np.float32(Stage.PASS), stage)


def _act(
    state: State,
    given: Parameters,
    p: Fields,
    near: Neighbours,
    view: View,
    intent: Intent,
    decision: int,
    hasty: F32 | None,
) -> None:
    """Move over and show it; who pulls out remembers whom it is overtaking."""
    state.target = np.where(intent.go_out, near.slot[LEAD, Role.EGO], state.target)
    state.attempted = np.where(intent.go_out, np.float32(1.0), state.attempted)
    fast, slow, back = (np.zeros(state.s.shape, bool) for _ in range(3))
    fast[Role.EGO] = intent.go_out | intent.remain
    slow[Role.EGO] = intent.go_back | intent.abort
    back[Role.EGO] = intent.abort | intent.remain
    left = np.zeros_like(state.s)
    left[Role.EGO] = time_left(view.gap[LEAD], view.closing[LEAD])
    turn_to_lane(state, given, p, (fast, slow, back), left, decision, hasty)
    _show(state, view, intent, (fast | slow)[Role.EGO])


def _show(state: State, view: View, intent: Intent, moved: Mask) -> None:
    """Signal an intention while it lasts; during a lane change its own indicator stays on."""
    fading = state.signalled > 0
    kept = np.where(fading, state.indicator[Role.EGO], np.float32(0.0))
    used = view.own.uses_indicator
    shown = np.where(intent.start, used, np.where(intent.back, -used, kept))
    straight = intent.arrived & ~moved
    state.indicator[Role.EGO] = np.where(straight, shown, state.indicator[Role.EGO])
    state.signalled = np.where(moved, np.float32(0.0), state.signalled)


def _end(
    state: State,
    given: Parameters,
    q: SimulationParameters,
    intent: Intent,
    next_stage: F32,
    step: int,
) -> None:
    """End the simulation some time after the overtake, or at the deadline without an attempt."""
    c = given.constants
    now = np.float32(step)
    over = (next_stage == np.float32(Stage.DONE)) & (state.stage != np.float32(Stage.DONE))
    after = now + np.rint(c.after_overtake / c.step)
    state.end_step = np.where(over, minimum(state.end_step, after), state.end_step)
    idle = in_stage(state, Stage.FOLLOW) & ~intent.start
    late = idle & (now >= q.deadline_step)
    state.end_step = np.where(late, minimum(state.end_step, now), state.end_step)
