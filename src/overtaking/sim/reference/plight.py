"""How drivers go on in the other lane: past, back behind the other, or in haste.

The ego and the others follow the same rules; `who` selects the rows of the arrays.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import maximum, minimum
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.following import follow, needed_braking
from overtaking.sim.reference.intent import in_stage
from overtaking.sim.reference.moment import Moment
from overtaking.sim.reference.passing import (
    SLOWEST,
    is_solid,
    room_left,
    seen_ahead,
    speed_of_pass,
    time_to_pass,
)
from overtaking.sim.reference.state import (
    SLOW_LEAD,
    SLOW_REAR,
    Fields,
    State,
    Who,
    pick,
    road_velocity,
)
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters
from overtaking.world.weather_parameters import SimulationParameters

_FAR = np.float32(1e9)
_ZERO = np.float32(0.0)
_HALF = np.float32(0.5)
_TWO = np.float32(2.0)


@dataclass(slots=True, kw_only=True)
class Plight:
    """How drivers in the other lane stand; masks of the shape of `Who`.

    Attributes:
        yields: The driver falls back behind the vehicle that was to be passed.
        hurries: The driver wants to be back soon.
        pressed: It would take a small gap for that.
        fits: There will be room behind that vehicle, and the next one in its lane, once they are
            no faster.
    """

    yields: Mask
    hurries: Mask
    pressed: Mask
    fits: Mask


def weigh(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    who: Who,
) -> Plight:
    """Whether drivers go on with their pass, and how.

    Until they are abreast they give up where they would not be back a moment before the oncomer is
    there, and falling back lacks less time than going on. Later those who have no time to pass the
    next one, too, take the room beside them, at once where it is less than they would ask for; they
    fall back where it is none, or where they are not past sooner than back. They are in a hurry
    where little would be to spare, and pressed; those who heed lines also where they would return
    across a solid one.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        moment: What drivers know; there is oncoming traffic on the road.
        who: The drivers.
    """
    assert moment.met is not None
    c, own, coming = given.constants, p.at_slots(who), moment.met.coming
    near, believed = moment.near, moment.believed
    out = _is_passing(state, who)
    along, _ = road_velocity(state)
    speed, other = along[who], pick(along, state.target[who])
    lead, bodies = _to_fall_in(state, given, p, who)
    faster = speed - other
    aside = _HALF * q.urgent_change_duration
    onwards = maximum(lead + bodies, _ZERO)
    rest = time_to_pass(c, own, onwards, speed, faster, other) + aside
    brake = c.abort_decel_share * own.max_assumed_decel
    backwards = maximum(bodies - lead, _ZERO)
    back = (faster + np.sqrt(faster * faster + _TWO * brake * backwards)) / brake + aside
    noticed = coming.detected[who]
    there = np.where(
        noticed, coming.believed_gap[who] / maximum(coming.closing[who], SLOWEST), _FAR
    )
    gives_up = (lead > 0) & (rest + c.abort_margin > there) & (back < rest)
    no_time = _is_confined(state, given, p, q, moment)[who]
    room = near.gap[SLOW_LEAD, who] + near.gap[SLOW_REAR, who]
    left = own.return_time_gap * room_left(c, p, state.target[who])
    cramped = no_time & (room < own.min_gap + (own.time_gap + left) * other)
    too_slow = onwards / maximum(faster, SLOWEST) > back
    trapped = no_time & ((room < c.min_return_space) | too_slow)
    yields = (gives_up | trapped | (state.yields[who] > 0)) & out
    beyond = (out | in_stage(state, who, Stage.RETURN)) & ~yields
    pressed = beyond & ((there - rest < c.urgent_return_margin) | cramped)
    late = is_solid(state, given, p, who, maximum(speed, _ZERO) * rest) & (
        own.heeds_solid_lines > 0
    )
    # Another than the target may be ahead in the lane, as that one may have pulled out itself.
    front = believed.gap[SLOW_LEAD, who]
    front = front - _gained(c, believed.closing[SLOW_LEAD, who], brake)
    return Plight(
        yields=yields,
        hurries=pressed | (beyond & late),
        pressed=pressed,
        fits=(lead - _gained(c, faster, brake) > bodies) & (front > c.min_return_gap),
    )


def _gained(c: ModelConstants, faster: F32, brake: F32) -> F32:
    """What is still gained on another while the brakes come on, and with them [m]."""
    faster = maximum(faster, _ZERO)
    return faster * (c.brake_ramp + faster / (_TWO * brake))


def _is_confined(
    state: State, given: StepParameters, p: Fields, q: SimulationParameters, moment: Moment
) -> Mask:
    """Who is past the one that it overtakes, and has no time to pass the next one as well.

    Who can no longer brake behind the next one goes on.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        moment: What drivers know; there is oncoming traffic on the road.

    Returns:
        Shape (vehicle, simulation).
    """
    assert moment.met is not None
    c, coming, everybody = given.constants, moment.met.coming, slice(None)
    past = in_stage(state, everybody, Stage.PASS) & (state.s > pick(state.s, state.target))
    gap, closing = moment.believed.gap[SLOW_LEAD], moment.believed.closing[SLOW_LEAD]
    next_one = state.vx - closing
    bodies = _TWO * (moment.near.half_length[SLOW_LEAD] + p.half_length)
    way = gap + bodies + c.min_return_gap
    longer = time_to_pass(c, p, way, state.vx, closing, next_one)
    longer = longer + _HALF * q.urgent_change_duration + c.urgent_return_margin
    late = seen_ahead(p, coming.believed_gap, coming.sight) < longer * coming.closing
    needed = needed_braking(c, state.vx, gap, closing, _ZERO)
    return past & late & (needed >= -(c.abort_decel_share * p.max_assumed_decel))


def goes_on(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    who: Who,
) -> Mask:
    """Who is past the one that it overtakes and comes beside the next one: it overtakes that now.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        moment: What drivers know; there is oncoming traffic on the road.
        who: The drivers.
    """
    near, confined = moment.near, _is_confined(state, given, p, q, moment)[who]
    past = in_stage(state, who, Stage.PASS) & (state.s[who] > pick(state.s, state.target[who]))
    beside = near.gap[SLOW_LEAD, who] < given.constants.min_return_gap
    follows = confined | (state.yields[who] > 0)
    return past & beside & (near.slot[SLOW_LEAD, who] >= 0) & ~follows


def _is_passing(state: State, who: Who) -> Mask:
    """Whether drivers are on their way past another."""
    return in_stage(state, who, Stage.PULL_OUT) | in_stage(state, who, Stage.PASS)


def can_fall_in(state: State, given: StepParameters, p: Fields, who: Who) -> Mask:
    """Whether who passes on a two-way road can give it up, still behind who is overtaken."""
    lead, bodies = _to_fall_in(state, given, p, who)
    return _is_passing(state, who) & (lead > bodies) & given.road.has_oncoming_traffic


def _to_fall_in(state: State, given: StepParameters, p: Fields, who: Who) -> tuple[F32, F32]:
    """How far ahead the target is, and has to be for a driver to fall in behind it [m]."""
    target = state.target[who]
    bodies = p.half_length[who] + pick(p.half_length, target)
    return pick(state.s, target) - state.s[who], bodies + given.constants.min_return_gap


def held_back(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
) -> F32:
    """The acceleration that drivers in the other lane do not go beyond [m/s^2].

    Who falls back brakes until it is slower than the vehicle that it was to pass. Who is past that
    keeps behind the next one, as it has to fit in between, unless time is left to pass that, too:
    with a part of its time gap, or in the middle of the room where that is nearer.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        moment: What drivers know; there is oncoming traffic on the road.

    Returns:
        Shape (vehicle, simulation).
    """
    c, near, believed = given.constants, moment.near, moment.believed
    along, _ = road_velocity(state)
    slow = along < pick(along, state.target) - c.abort_speed_difference
    brake = np.where(slow, _ZERO, -(c.abort_decel_share * p.max_assumed_decel))
    gap, closing = believed.gap[SLOW_LEAD], believed.closing[SLOW_LEAD]
    middle = _HALF * (near.gap[SLOW_LEAD] + near.gap[SLOW_REAR])
    nearest = maximum(middle - p.min_gap, _ZERO) / maximum(state.vx, c.slip_speed)
    kept, wished = (
        minimum(c.return_time_gap_share * p.time_gap, nearest),
        speed_of_pass(state, given, p),
    )
    fitting = follow(c, p, state.vx, wished, gap, closing, kept, believed.accel[SLOW_LEAD])
    fits_in = _is_confined(state, given, p, q, moment)
    return np.where(state.yields > 0, brake, np.where(fits_in, fitting, _FAR))
