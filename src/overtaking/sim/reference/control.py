"""How hard each driver accelerates or brakes from here to the next decision."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import clamp, maximum, minimum
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.following import follow
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.oncoming import Encounters
from overtaking.sim.reference.passing import room_left, speed_of_pass
from overtaking.sim.reference.perception import Beliefs
from overtaking.sim.reference.state import FAST_LEAD, LEAD, SLOW_LEAD, Fields, State, pick
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters

_FREE = np.float32(1e9)


def behind_leader(
    state: State,
    given: StepParameters,
    p: Fields,
    near: Neighbours,
    believed: Beliefs,
    met: Encounters | None,
) -> F32:
    """Acceleration behind the leader of the lane that is driven in or being entered [m/s^2].

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        near: Neighbours.
        believed: What drivers believe of them.
        met: Whom they meet; None on roads of one direction.
    """
    desired = _desired_speed(state, given, p, met)
    c = given.constants
    gap, closing = believed.gap[LEAD], believed.closing[LEAD]
    passing = _is_passing(state)
    # A driver about to pull out accepts a smaller gap.
    about_to = (state.signalled > 0) & (state.stage == np.float32(Stage.FOLLOW))
    kept = np.where(about_to, c.signalling_time_gap * p.time_gap, p.time_gap)
    if given.road.has_oncoming_traffic:
        follows = state.stage == np.float32(Stage.FOLLOW)
        kept = np.where(follows, kept * room_left(c, p, near.slot[LEAD]), kept)
    wanted = follow(c, p, state.vx, desired, gap, closing, kept, believed.accel[LEAD])
    wanted = np.where(passing, wanted, minimum(wanted, state.most_accel))
    eager = np.where(state.hurries > 0, c.urgent_accel_factor, c.accelerate_gain)
    return wanted * np.where(passing & (wanted > 0), eager, np.float32(1.0))


def _is_passing(state: State) -> Mask:
    return (state.stage == np.float32(Stage.PULL_OUT)) | (state.stage == np.float32(Stage.PASS))


def _desired_speed(state: State, given: StepParameters, p: Fields, met: Encounters | None) -> F32:
    desired, passing = p.desired_speed, p.passing_speed
    if met is not None:
        passing = speed_of_pass(state, given, p)
        desired = np.where(met.passed, desired * p.speed_factor_when_passed, desired)
    return minimum(np.where(_is_passing(state), passing, desired), state.bend_speed)


def behind_old_leader(
    state: State,
    given: StepParameters,
    p: Fields,
    near: Neighbours,
    believed: Beliefs,
    met: Encounters | None,
) -> F32:
    """Acceleration behind the one whose lane is being left, as long as the bodies still overlap.

    Drivers brake by what their way lacks to clear the other a moment before the gap is closed, and
    no harder than behind a leader. The moment covers errors of judgement: without it a leader that
    is believed farther off is hit.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        near: Neighbours.
        believed: What drivers believe of them.
        met: Whom they meet; None on roads of one direction.
    """
    c = given.constants
    changing = state.path_time < state.path_duration
    to_fast = np.float32(0.5) * (near.lane_low + near.lane_high) > state.d
    slot = np.where(to_fast, near.slot[SLOW_LEAD], near.slot[FAST_LEAD])
    gap = np.where(to_fast, believed.gap[SLOW_LEAD], believed.gap[FAST_LEAD])
    closing = np.where(to_fast, believed.closing[SLOW_LEAD], believed.closing[FAST_LEAD])
    accel = np.where(to_fast, believed.accel[SLOW_LEAD], believed.accel[FAST_LEAD])
    aside = np.abs(np.where(to_fast, near.aside[SLOW_LEAD], near.aside[FAST_LEAD]))
    overlaps = aside < p.half_width + pick(p.half_width, slot) + c.footprint_margin
    left = maximum(c.lane_cleared_share * state.path_duration - state.path_time, np.float32(0.0))
    needed = _braking_to_clear(c, gap - p.min_gap, closing, left + c.lane_clearance_time) - accel
    matters = changing & (slot >= 0) & overlaps & (needed > 0)
    desired = _desired_speed(state, given, p, met)
    kept = follow(c, p, state.vx, desired, gap, closing, p.time_gap, accel)
    return np.where(matters, maximum(kept, -needed), _FREE)


def _braking_to_clear(c: ModelConstants, room: F32, closing: F32, time: F32) -> F32:
    """Constant braking with which the room lasts a time, below 0 if it does so without [m/s^2].

    Where the closing would end before that time, it is the braking that ends it within the room.
    """
    two, room = np.float32(2.0), maximum(room, c.min_effective_gap)
    way = closing * time
    return np.where(
        way < two * room, two * (way - room) / (time * time), closing * closing / (two * room)
    )


def set_acceleration(
    state: State, given: StepParameters, p: Fields, leader: F32, old_leader: F32
) -> None:
    """Move the pedals towards the wanted acceleration, as fast as it is urgent.

    A driver that needs more brakes beyond the friction that it believes in: anti-lock brakes and
    the road decide.

    Source:
        Markkula and others 2016: the ramp of emergency braking grows with its urgency.
    """
    c = given.constants
    wanted = maximum(minimum(leader, old_leader), -(p.max_brake_force * p.inverse_mass))
    up = np.where(state.accel < 0, c.jerk_release, c.jerk_up) * c.decision
    down = maximum(-wanted / c.brake_ramp, c.jerk_down) * c.decision
    changed = state.accel + clamp(wanted - state.accel, -down, up)
    state.accel = np.where(state.crashed > 0, np.float32(0.0), changed)
