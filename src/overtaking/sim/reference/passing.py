"""How the ego passes against oncoming traffic: the decision, giving it up, and being in a hurry."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, Mask, maximum, minimum
from overtaking.model.trajectory import Stage
from overtaking.model.vehicles import Role
from overtaking.sim.reference.following import follow
from overtaking.sim.reference.intent import in_stage
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.oncoming import Oncoming
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.state import (
    LEAD,
    SLOW_LEAD,
    Fields,
    State,
    pick,
    road_velocity,
)
from overtaking.world.constants import Constants
from overtaking.world.parameters import Parameters, SimulationParameters

_FAR = np.float32(1e9)
_SLOWEST = np.float32(0.5)  # Least surplus of speed to be past with [m/s].
_LEAST_ACCEL = np.float32(0.1)  # Keeps the time of accelerating finite [m/s^2].
_ZERO = np.float32(0.0)
_HALF = np.float32(0.5)
_TWO = np.float32(2.0)


def time_to_gain(way: F32, faster: F32, top: F32, accel: F32) -> F32:
    """Time to gain a way on another vehicle, at constant acceleration up to a top speed [s].

    Args:
        way: The way [m].
        faster: How much faster one is now [m/s].
        top: How much faster one gets at most [m/s].
        accel: Acceleration [m/s^2].
    """
    a, most = maximum(accel, _LEAST_ACCEL), maximum(top, _SLOWEST)
    v = minimum(maximum(faster, _ZERO), most)
    ramp = (most - v) / a
    covered = _HALF * (v + most) * ramp
    within = (np.sqrt(v * v + _TWO * a * way) - v) / a
    return np.where(way < covered, within, ramp + (way - covered) / most)


def top_speed(own: Fields, c_surplus: np.float32, leader: F32) -> F32:
    """The speed that is passed at: well above that of the other, if the vehicle can [m/s]."""
    return minimum(maximum(own.pass_speed, leader + c_surplus), own.max_speed)


def speed_of_pass(state: State, given: Parameters, p: Fields) -> F32:
    """The speed that an ego which passes wants now, (simulation,) [m/s]."""
    c, own = given.constants, p.of(Role.EGO)
    along, _ = road_velocity(state)
    top = top_speed(own, c.passing_surplus, pick(along, state.target))
    return minimum(np.where(state.hurries > 0, c.hurry_speed * top, top), own.max_speed)


def seen_ahead(c: Constants, gap: F32, sight: F32) -> F32:
    """The way up to who comes, or may come from where the road is not seen, (simulation,) [m].

    Few reckon with somebody at the very end of what they see: who does come then comes in sight
    while they pass.

    Args:
        c: Constants of the model.
        gap: Believed gap to who comes [m].
        sight: How far the other lane is seen [m].
    """
    return minimum(gap, c.unseen_trust * sight)


def room_left(c: Constants, p: Fields, slot: F32) -> F32:
    """How much more room drivers leave to the vehicle in a slot than to a car, (simulation,)."""
    return np.where(pick(p.tall, slot) > 0, c.tall_room, np.float32(1.0))


@dataclass(slots=True, kw_only=True)
class Outlook:
    """What the ego knows of the other lane before it pulls out; arrays of shape (simulation,).

    Attributes:
        gap: Believed gap to the leader [m].
        leader: Believed speed of the leader [m/s].
        length: Length of the leader [m].
        room: Gap ahead of the leader [m].
        seen: How far the other lane is seen to be free [m].
        closing: Believed speed of approach of who comes, or may come [m/s].
        sure: Whether it has looked for long enough.
        solid: Whether the line is not to be crossed.
        room_left: How much more room it leaves to the leader at its return than to a car [1].
    """

    gap: F32
    leader: F32
    length: F32
    room: F32
    seen: F32
    closing: F32
    sure: Mask
    solid: Mask
    room_left: F32


def outlook(
    state: State,
    given: Parameters,
    p: Fields,
    near: Neighbours,
    oncoming: Oncoming,
    gap: F32,
    leader: F32,
) -> Outlook:
    """What the ego knows of the other lane; its leader is believed at a gap [m], with a speed."""
    ego = Role.EGO
    return Outlook(
        gap=gap,
        leader=leader,
        length=_TWO * near.half_length[LEAD, ego],
        room=room_ahead(state, p, near.slot[LEAD, ego]),
        seen=seen_ahead(given.constants, oncoming.believed_gap[ego], oncoming.sight),
        closing=oncoming.closing[ego],
        sure=oncoming.sure[ego],
        solid=is_solid(state, given),
        room_left=room_left(given.constants, p, near.slot[LEAD, ego]),
    )


def may_meet(
    given: Parameters,
    own: Fields,
    q: SimulationParameters,
    speed: F32,
    impatience: F32,
    ahead: Outlook,
) -> Mask:
    """Whether the other lane is believed to be free for long enough, (simulation,).

    The time that passing takes, as the ego misjudges it, with something to spare, is held against
    the time until the nearest oncomer is met; a road that is not seen counts as an oncomer. Passing
    takes half a lane change before speed is gained, and half of one back at its end. Who waits
    spares less, but not less than a part of what it spared at first.

    Args:
        given: All inputs.
        own: Parameters of the ego.
        q: Simulation parameters.
        speed: Of the ego [m/s].
        impatience: What waiting has left of its demands, 1 at first [1].
        ahead: What it knows of the other lane.
    """
    c, leader = given.constants, ahead.leader
    bodies = ahead.length + _TWO * own.half_length
    returns = own.return_time_gap * impatience * ahead.room_left * leader
    way = ahead.gap + bodies + returns
    top = top_speed(own, c.passing_surplus, leader) - leader
    gaining = time_to_gain(way, speed - leader, top, c.accelerate_gain * own.accel)
    need = q.need_factor * (gaining + own.lane_change_duration)
    closing = ahead.closing + _HALF * maximum(top + leader - speed, _ZERO)
    spare = q.spare * maximum(impatience, c.spare_kept)
    enough = ahead.seen > need * (np.float32(1.0) + spare) * closing
    least = _TWO * own.half_length + c.squeeze_gap + returns
    room = ahead.room > least + c.fit_share * own.time_gap * leader
    return enough & ahead.sure & room & ~(ahead.solid & (q.heeds_lines > 0))


def room_ahead(state: State, p: Fields, slot: F32) -> F32:
    """Gap between the vehicle in a slot and the one ahead of it, (simulation,) [m]."""
    place = pick(state.s, slot)
    front = place + pick(p.half_length, slot)
    room = np.full_like(front, _FAR)
    for j in range(Role.EGO + 1, len(state.s)):
        beyond = (p.valid[j] > 0) & (p.direction[j] == p.direction[Role.EGO])
        beyond = beyond & (state.s[j] > place) & (slot != np.float32(j))
        room = np.where(beyond, minimum(room, (state.s[j] - p.half_length[j]) - front), room)
    return room


def is_solid(state: State, given: Parameters) -> Mask:
    """Whether the line is not to be crossed where the ego is, or soon will be, (simulation,)."""
    stations, solid = given.road.line
    found, here = [], state.s[Role.EGO]
    for place in (here, here + given.constants.line_ahead * state.vx[Role.EGO]):
        here = np.zeros_like(place)
        for k in range(len(stations)):
            here = np.where(place >= stations[k], solid[k], here)
        found.append(here > 0)
    return found[0] | found[1]


@dataclass(slots=True, kw_only=True)
class Plight:
    """How an ego in the other lane stands; masks of shape (simulation,).

    Attributes:
        yields: It falls back behind the vehicle that it was to pass.
        hurries: It is short of time to be past.
        fits: There is room behind that vehicle to fall in.
    """

    yields: Mask
    hurries: Mask
    fits: Mask


def weigh(
    state: State, given: Parameters, p: Fields, q: SimulationParameters, oncoming: Oncoming
) -> Plight:
    """Whether the ego goes on with its pass, and how.

    Until it is abreast it gives up where it would not be back a moment before the oncomer is there,
    and falling back lacks less time than going on; later where there is no room to return to, once
    falling back takes nearly all the time left. It is in a hurry where little would be to spare.
    """
    c, ego, own = given.constants, Role.EGO, p.of(Role.EGO)
    out = is_passing(state)
    along, _ = road_velocity(state)
    speed, other = along[ego], pick(along, state.target)
    lead, bodies = _to_fall_in(state, given, p)
    faster, top = speed - other, top_speed(own, c.passing_surplus, other) - other
    aside = _HALF * q.hasty_change
    onwards = maximum(lead + bodies, _ZERO)
    rest = time_to_gain(onwards, faster, top, c.accelerate_gain * own.accel) + aside
    brake = c.fall_back_share * own.hardest_decel
    backwards = maximum(bodies - lead, _ZERO)
    back = (faster + np.sqrt(faster * faster + _TWO * brake * backwards)) / brake + aside
    there = np.where(
        oncoming.detected[ego], oncoming.believed_gap[ego] / oncoming.closing[ego], _FAR
    )
    gives_up = (lead > 0) & (rest + c.abort_margin > there) & (back < rest)
    room = room_ahead(state, p, state.target) > _TWO * (own.half_length + c.squeeze_gap)
    waits_no_more = there < back + c.calm_margin
    trapped = (lead <= 0) & oncoming.detected[ego] & ~room & waits_no_more
    yields = (gives_up | trapped | (state.yields > 0)) & out
    hurries = (out | in_stage(state, Stage.RETURN)) & ~yields & (there - rest < c.calm_margin)
    return Plight(yields=yields, hurries=hurries, fits=lead > bodies)


def is_passing(state: State) -> Mask:
    """Whether the ego is on its way past another, (simulation,)."""
    return in_stage(state, Stage.PULL_OUT) | in_stage(state, Stage.PASS)


def can_fall_in(state: State, given: Parameters, p: Fields) -> Mask:
    """Whether the ego of a two-way road can give up its pass: it is behind who is overtaken."""
    lead, bodies = _to_fall_in(state, given, p)
    return is_passing(state) & (lead > bodies) & given.road.two_way


def _to_fall_in(state: State, given: Parameters, p: Fields) -> tuple[F32, F32]:
    """How far ahead the target is, and has to be for the ego to fall in behind it [m]."""
    lead = pick(state.s, state.target) - state.s[Role.EGO]
    bodies = p.half_length[Role.EGO] + pick(p.half_length, state.target)
    return lead, bodies + given.constants.squeeze_gap


def held_back(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    near: Neighbours,
    oncoming: Oncoming,
    believed: Beliefs,
) -> F32:
    """The acceleration that an ego in the other lane does not go beyond, (simulation,) [m/s^2].

    Who falls back brakes until it is slower than the vehicle that it was to pass. Who is past that
    keeps behind the next one, as it has to fit in between, unless time is left to pass that, too.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        near: Neighbours.
        oncoming: Who comes.
        believed: What drivers believe of their neighbours.
    """
    c, ego, own = given.constants, Role.EGO, p.of(Role.EGO)
    along, _ = road_velocity(state)
    slow = along[ego] < pick(along, state.target) - c.fall_back_speed
    brake = np.where(slow, _ZERO, -(c.fall_back_share * own.hardest_decel))
    past = in_stage(state, Stage.PASS) & (state.s[ego] > pick(state.s, state.target))
    gap, closing = believed.gap[SLOW_LEAD, ego], believed.closing[SLOW_LEAD, ego]
    kept, wished = c.fit_share * own.time_gap, speed_of_pass(state, given, p)
    next_one = state.vx[ego] - closing
    top = top_speed(own, c.passing_surplus, next_one) - next_one
    onwards = gap + _TWO * (near.half_length[SLOW_LEAD, ego] + own.half_length) + c.squeeze_gap
    longer = time_to_gain(onwards, closing, top, c.accelerate_gain * own.accel)
    longer = longer + _HALF * q.hasty_change + c.calm_margin
    seen = seen_ahead(c, oncoming.believed_gap[ego], oncoming.sight)
    fits_in = past & (seen < longer * oncoming.closing[ego])
    fitting = follow(
        c, own, state.vx[ego], wished, gap, closing, kept, believed.accel[SLOW_LEAD, ego]
    )
    return np.where(state.yields > 0, brake, np.where(fits_in, fitting, _FAR))
