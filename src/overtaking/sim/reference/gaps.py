"""Gap acceptance: what drivers set out to do, from what they believe of the gaps around them.

They are the ego, and on two-way roads everybody by the same rules: `who` says of whom arrays tell.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import exp, maximum, minimum
from overtaking.model.scenario import ForcedDecision
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
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
from overtaking.sim.reference.mobil import soon
from overtaking.sim.reference.moment import Moment
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.passing import may_meet, outlook, room_left
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.plight import Plight
from overtaking.sim.reference.state import (
    FAST_LEAD,
    FAST_REAR,
    LEAD,
    REAR,
    SLOW_LEAD,
    SLOW_REAR,
    Fields,
    State,
    Who,
    pick,
)
from overtaking.world.step_parameters import StepParameters
from overtaking.world.weather_parameters import SimulationParameters

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
    given: StepParameters,
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
    own = p.at_slots(who)
    waited = state.waited[who] * own.inverse_patience
    impatience = maximum(exp(-waited), given.constants.patience_floor)
    gap, closing = believed.gap[:, who], believed.closing[:, who]
    demand = own.gap_demand_factor * impatience
    told = ordered = np.zeros(demand.shape, bool)
    if who == EGO_SLOT:
        told = is_told(p)
        seen = told & believed.detected[LEAD, who]
        ordered = seen & (faster(state, near) > own.min_speed_gain)
    bounded = minimum(
        own.safe_decel / maximum(demand, _LEAST_DEMAND), given.constants.max_imposed_decel
    )
    return View(
        who=who,
        own=own,
        speed=state.vx[who],
        gap=gap,
        closing=closing,
        detected=believed.detected[:, who],
        leader_speed=state.vx[who] - closing[LEAD],
        demand=demand,
        imposes=minimum(bounded, own.max_assumed_decel),
        impatience=impatience,
        room_left=room_left(given.constants, p, near.slot[LEAD, who])
        if given.road.has_oncoming_traffic
        else _ONE,
        told=told,
        ordered=ordered,
        command=q.forced_decision if who == EGO_SLOT else np.zeros_like(q.forced_decision),
    )


def is_told(p: Fields) -> Mask:
    """Whether the ego is told to change lanes, as in the study: it demands no gap."""
    return p.at_slots(EGO_SLOT).gap_demand_factor <= 0


def faster(state: State, near: Neighbours) -> F32:
    """By how much the ego is in truth faster than its leader, which decides where it is told."""
    return state.vx[EGO_SLOT] - pick(state.vx, near.slot[LEAD, EGO_SLOT])


def own_braking(given: StepParameters, view: View, gap: F32, closing: F32) -> F32:
    """Acceleration that a vehicle ahead forces on a driver at the gap demanded now."""
    time_gap = view.own.time_gap * view.demand
    return forced_braking(given.constants, view.own, view.speed, gap, closing, time_gap)


def their_braking(given: StepParameters, view: View, gap: F32, closing: F32) -> F32:
    """Acceleration that a driver in front would force on a vehicle behind."""
    time_gap = view.own.time_gap * view.demand
    return forced_braking(given.constants, view.own, view.speed + closing, gap, closing, time_gap)


def wants_to_pass(given: StepParameters, view: View) -> Mask:
    """Whether the leader is slow enough, and near enough, that an overtake is wanted now."""
    own = view.own
    slower = own.desired_speed - view.leader_speed > own.min_speed_gain * view.impatience
    soon = view.gap[LEAD] < own.pull_out_ttc * view.closing[LEAD]
    kept = own.time_gap * view.room_left
    near = given.constants.close_time_gap * kept * view.speed + own.min_gap
    close = view.gap[LEAD] < near
    return view.detected[LEAD] & slower & (soon | close)


def may_pull_out(given: StepParameters, view: View) -> Mask:
    """Whether the next lane looks free enough, and faster, to this driver.

    The lane of oncoming traffic is free while no other is seen to overtake there.
    """
    c, own = given.constants, view.own
    front = own_braking(given, view, view.gap[FAST_LEAD], view.closing[FAST_LEAD]) >= -own.decel
    gap, closing = view.gap[FAST_REAR], view.closing[FAST_REAR]
    now = their_braking(given, view, gap, closing)
    rear = minimum(now, their_braking(given, view, *soon(given, gap, closing))) >= -view.imposes
    rear = rear & (gap > c.min_rear_gap * view.demand)
    if given.road.has_oncoming_traffic:
        return rear & ~view.detected[FAST_LEAD]
    next_speed = view.speed - view.closing[FAST_LEAD]
    gain = next_speed - view.leader_speed > own.min_speed_gain * view.impatience
    far = view.gap[FAST_LEAD] > view.gap[LEAD] + c.waiting_time_gap * view.speed
    return front & rear & (gain | far | ~view.detected[FAST_LEAD])


def may_return(given: StepParameters, view: View, room_left: F32 | np.float32 = _ONE) -> Mask:
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
    if given.road.has_oncoming_traffic:
        return rear & front & (view.gap[SLOW_LEAD] > c.min_return_gap)
    return rear & front & (view.gap[SLOW_LEAD] > c.stay_time * view.closing[SLOW_LEAD])


def must_abort(given: StepParameters, view: View, lead: int, rear: int) -> Mask:
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
    bad = (imposed < -(c.abort_imposed_factor * view.imposes)) | (
        braking < -(c.abort_factor * own.decel)
    )
    back = needed_braking(c, view.speed, view.gap[lead], view.closing[lead], _STEADY)
    return bad & (back >= -own.max_assumed_decel) & (view.gap[rear] > c.min_rear_gap)


def may_squeeze(given: StepParameters, q: SimulationParameters, view: View) -> Mask:
    """Whether the lane beside has room enough for a driver in a hurry when the line is crossed."""
    c, closing = given.constants, view.closing[SLOW_LEAD]
    crossing = np.float32(0.5) * q.urgent_change_duration
    front = view.gap[SLOW_LEAD] - crossing * closing
    rear = view.gap[SLOW_REAR] - crossing * maximum(view.closing[SLOW_REAR], _STEADY)
    squeezed = minimum(rear, front) > c.min_return_gap
    # It brakes on the way: who waits until it need not never gets behind a slow vehicle in time.
    ahead = needed_braking(c, view.speed, view.gap[SLOW_LEAD], closing, _STEADY)
    return squeezed & (ahead >= -(c.abort_factor * view.own.decel))


def has_room_behind(given: StepParameters, view: View) -> Mask:
    """Whether nobody is close behind in the slower lane."""
    return view.gap[SLOW_REAR] > given.constants.min_rear_gap


def intend(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    who: Who,
    plight: Plight | None,
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
    view = look(state, given, p, q, moment.near, moment.believed, who)
    looks = moment.looks[who]
    arrived = has_arrived(state, who)
    passed = has_passed(state, given, p, who)
    start = _starts(state, given, p, moment, view, arrived)
    back = _turns_back(state, given, p, q, view, passed, looks, plight)
    signal(state, given, who, start, back)
    ready = state.signalled[who] > view.own.indicator_lead_time
    sure = (looks & ~moment.waits[who]) | view.told
    abort = _gives_up(state, given, view, looks)
    remain = _stays_out(state, given, view, looks)
    back_now = ready
    if plight is not None:
        falls_in = plight.yields & plight.fits & has_room_behind(given, view)
        back_now = (ready | plight.hurries) & ~falls_in
        abort = abort | falls_in
        remain = np.zeros_like(remain)  # The other lane is no place to stay.
    return Intent(
        start=start,
        back=back,
        go_out=start & ready & (sure | (view.command == ForcedDecision.PULL_OUT)),
        go_back=back & back_now & (sure | (view.command == ForcedDecision.RETURN)),
        abort=abort,
        remain=remain,
        passed=passed,
        arrived=arrived,
    )


def _starts(
    state: State, given: StepParameters, p: Fields, moment: Moment, view: View, arrived: Mask
) -> Mask:
    """Whether an overtake is wanted and looked possible, or is forced by a branch."""
    c, who, met = given.constants, view.who, moment.met
    rested = state.since_change[who] >= c.abort_cooldown
    has_lane = state.lane[who] < np.float32(given.road.num_lanes - 1)
    free = in_stage(state, who, Stage.FOLLOW) & arrived & rested & has_lane
    seen = wants_to_pass(given, view) & may_pull_out(given, view)
    if met is not None:
        leader = view.gap[LEAD], view.leader_speed
        ahead = outlook(state, given, p, moment.near, met.coming, who, leader)
        seen = seen & may_meet(given, view.own, view.speed, view.impatience, ahead)
        seen = seen & ~met.leader_goes[who]
    seen = np.where(view.told, view.ordered, seen)
    wanted = np.where(moment.looks[who] | view.told, seen, state.wanted[who] > 0)
    wanted = wanted & (view.command != ForcedDecision.STAY)
    forced = (view.command == ForcedDecision.PULL_OUT) & (state.attempted == 0)
    return free & (wanted | forced)


def _turns_back(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    view: View,
    passed: Mask,
    looks: Mask,
    plight: Plight | None,
) -> Mask:
    """Whether drivers may return: past the target, or stuck beside it, or forced by a branch."""
    c, who = given.constants, view.who
    has_lane = in_stage(state, who, Stage.PASS) & (state.lane[who] >= np.float32(1.0))
    late = state.stage_time[who] > c.give_up_after
    stuck = late & (state.s[who] < pick(state.s, state.target[who]))
    rested = state.since_change[who] >= c.abort_cooldown
    if plight is None:
        may = may_return(given, view) & (passed | stuck)
    else:
        room = room_left(c, p, state.target[who])
        hurried = plight.pressed & may_squeeze(given, q, view) & passed
        may = (may_return(given, view, room) & (passed | stuck)) | hurried
        rested = rested | hurried
    seen = np.where(view.told, passed, may) & rested
    wanted = np.where(looks | view.told, seen, state.wanted[who] < 0)
    return has_lane & (wanted | (view.command == ForcedDecision.RETURN))


def _gives_up(state: State, given: StepParameters, view: View, looks: Mask) -> Mask:
    """Whether drivers go back while pulling out: in danger, or forced by a branch."""
    danger = looks & ~view.told & must_abort(given, view, SLOW_LEAD, SLOW_REAR)
    forced = view.command == ForcedDecision.CANCEL
    return can_abort(state, given, view.who) & (danger | forced)


def _stays_out(state: State, given: StepParameters, view: View, looks: Mask) -> Mask:
    """Whether drivers give up their way back in danger, unless a branch forces a return."""
    danger = looks & ~view.told & must_abort(given, view, FAST_LEAD, FAST_REAR)
    return can_remain(state, given, view.who) & danger & (view.command != ForcedDecision.RETURN)
