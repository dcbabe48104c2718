"""Whether drivers pass against oncoming traffic: the way, the time for it, and what they see.

Everybody does so by the same rules, the ego and the others; `who` says of whom arrays tell.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import maximum, minimum
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.oncoming import Oncoming
from overtaking.sim.reference.state import (
    LEAD,
    Fields,
    State,
    Who,
    on_the_road,
    pick,
    road_velocity,
)
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters

SLOWEST = np.float32(0.5)
"""Least surplus of speed to be past with, and of approach [m/s]."""

_FAR = np.float32(1e9)
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
    a, most = maximum(accel, _LEAST_ACCEL), maximum(top, SLOWEST)
    v = minimum(maximum(faster, _ZERO), most)
    ramp = (most - v) / a
    covered = _HALF * (v + most) * ramp
    within = (np.sqrt(v * v + _TWO * a * way) - v) / a
    return np.where(way < covered, within, ramp + (way - covered) / most)


def reckoned_accel(c: ModelConstants, own: Fields, speed: F32, top: F32) -> F32:
    """The acceleration that drivers reckon with on the way up to a speed [m/s^2].

    It is the acceleration that they like to use, limited to what the engine can give halfway. The
    trait `passing_time_factor`, which has a source, is their error about the resulting time; they
    know what their vehicle can do.

    Args:
        c: Constants of the model.
        own: Parameters of the drivers.
        speed: Their own [m/s].
        top: The speed that they pass at [m/s].
    """
    halfway = _HALF * (speed + maximum(top, speed))
    engine = minimum(own.launch_force, own.power / maximum(halfway, c.slip_speed))
    left = (engine - (own.drag * halfway * halfway + own.rolling)) * own.inverse_mass
    return minimum(c.accelerate_gain * own.accel, left)


def top_speed(own: Fields, surplus: np.float32, leader: F32) -> F32:
    """The speed that is passed at: well above that of the other, if the vehicle can [m/s].

    Who heeds the limit on a free road heeds it as much while passing, and takes longer.

    Args:
        own: Parameters of the drivers.
        surplus: How much faster than the other drivers want to be [m/s].
        leader: Speed of the other [m/s].
    """
    wanted = maximum(own.passing_speed, leader + surplus)
    heeded = wanted - own.speed_limit_compliance * maximum(wanted - own.speed_limit, _ZERO)
    return minimum(heeded, own.max_speed)


def speed_of_pass(state: State, given: StepParameters, p: Fields) -> F32:
    """The speed that drivers who pass want now, (vehicle, simulation) [m/s]."""
    c = given.constants
    along, _ = road_velocity(state)
    top = top_speed(p, c.passing_speed_surplus, pick(along, state.target))
    return minimum(np.where(state.hurries > 0, c.urgent_speed_factor * top, top), p.max_speed)


def time_to_pass(
    c: ModelConstants, own: Fields, way: F32, speed: F32, faster: F32, other: F32
) -> F32:
    """How long drivers reckon to take to gain a way on another [s].

    Args:
        c: Constants of the model.
        own: Parameters of the drivers.
        way: The way [m].
        speed: Their own [m/s].
        faster: How much faster that is than the other [m/s].
        other: Speed of the other [m/s].
    """
    top = top_speed(own, c.passing_speed_surplus, other)
    return time_to_gain(way, faster, top - other, reckoned_accel(c, own, speed, top))


def seen_ahead(own: Fields, gap: F32, sight: F32) -> F32:
    """The way up to who comes, or may come from where the road is not seen [m].

    Few reckon with somebody at the very end of what they see: who does come then comes in sight
    while they pass.

    Args:
        own: Parameters of the drivers.
        gap: Believed gap to who comes [m].
        sight: How far the other lane is seen [m].
    """
    return minimum(gap, own.assumed_sight_factor * sight)


def room_left(c: ModelConstants, p: Fields, slot: F32) -> F32:
    """How much more room drivers leave to the vehicle in a slot than to a car [1].

    Source:
        The Highway Code, rule 164 (drop back behind large vehicles, to see and be seen).
    """
    return np.where(pick(p.blocks_view, slot) > 0, c.tall_vehicle_gap_factor, np.float32(1.0))


@dataclass(slots=True, kw_only=True)
class Outlook:
    """What drivers know of the other lane before they pull out; arrays of the shape of `Who`.

    Attributes:
        gap: Believed gap to the leader [m].
        leader: Believed speed of the leader [m/s].
        length: Length of the leader [m].
        room: Gap ahead of the leader [m].
        seen: How far the other lane is seen to be free [m].
        closing: Believed speed of approach of who comes, or may come [m/s].
        sure: Whether the driver has looked for long enough.
        solid: Whether the line is not to be crossed.
        room_left: How much more room is left to the leader at the return than to a car [1].
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
    given: StepParameters,
    p: Fields,
    near: Neighbours,
    coming: Oncoming,
    who: Who,
    leader: tuple[F32, F32],
) -> Outlook:
    """What drivers know of the other lane.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        near: Neighbours.
        coming: Who comes.
        who: The drivers.
        leader: Gap at which they believe their leaders to be [m], and speed of those [m/s].
    """
    gap, speed = leader
    slot = near.slot[LEAD, who]
    return Outlook(
        gap=gap,
        leader=speed,
        length=_TWO * near.half_length[LEAD, who],
        room=room_ahead(state, p, slot, who),
        seen=seen_ahead(p.at_slots(who), coming.believed_gap[who], coming.sight[who]),
        closing=coming.closing[who],
        sure=coming.sure[who],
        solid=is_solid(state, given, p, who, given.constants.line_lookahead),
        room_left=room_left(given.constants, p, slot),
    )


def may_meet(
    given: StepParameters,
    own: Fields,
    speed: F32,
    impatience: F32,
    ahead: Outlook,
) -> Mask:
    """Whether the other lane is believed to be free for long enough.

    The time that passing takes, as it is misjudged, with something to spare, is held against
    the time until the nearest oncomer is met; a road that is not seen counts as an oncomer. Passing
    takes half a lane change before speed is gained, and half of one back at its end. Who waits
    spares less, but not less than a part of what it spared at first.

    Args:
        given: All inputs.
        own: Parameters of the drivers.
        speed: Their own [m/s].
        impatience: What waiting has left of their demands, 1 at first [1].
        ahead: What they know of the other lane.
    """
    c, leader = given.constants, ahead.leader
    bodies = ahead.length + _TWO * own.half_length
    returns = own.return_time_gap * impatience * ahead.room_left * leader
    way = ahead.gap + bodies + returns
    top = top_speed(own, c.passing_speed_surplus, leader)
    gaining = time_to_pass(c, own, way, speed, speed - leader, leader)
    need = own.passing_time_factor * (gaining + own.lane_change_duration)
    closing = ahead.closing + _HALF * maximum(top - speed, _ZERO)
    spare = own.time_reserve_share * maximum(impatience, c.min_time_reserve_share)
    enough = ahead.seen > need * (np.float32(1.0) + spare) * closing
    least = _TWO * own.half_length + c.min_return_gap + returns
    room = ahead.room > least + c.return_time_gap_share * own.time_gap * leader
    return enough & ahead.sure & room & ~(ahead.solid & (own.heeds_solid_lines > 0))


def room_ahead(state: State, p: Fields, slot: F32, who: Who) -> F32:
    """Gap that drivers find between the vehicle in a slot and the one ahead of it [m]."""
    place = pick(state.s, slot)
    front = place + pick(p.half_length, slot)
    room = np.full_like(front, _FAR)
    numbers = np.arange(len(state.s), dtype=np.float32)[:, None][who]
    for j in range(len(state.s)):
        beyond = (p.valid[j] > 0) & (p.travel_sign[j] == p.travel_sign[who]) & (state.s[j] > place)
        beyond = beyond & (slot != np.float32(j)) & (numbers != np.float32(j))
        room = np.where(beyond, minimum(room, (state.s[j] - p.half_length[j]) - front), room)
    return room


def is_solid(
    state: State, given: StepParameters, p: Fields, who: Who, ahead: F32 | np.float32
) -> Mask:
    """Whether the line is not to be crossed where drivers are, or at a way ahead of them.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        who: The drivers.
        ahead: The way [m].
    """
    stations, along, against = given.road.solid_line
    here, direction = on_the_road(state, given, p)[0][who], p.travel_sign[who]
    solid = np.zeros(here.shape, bool)
    for place in (here, here + direction * ahead):
        knot = np.searchsorted(stations, place, side="right") - 1
        solid = solid | (np.where(direction < 0, against[knot], along[knot]) > 0)
    return solid
