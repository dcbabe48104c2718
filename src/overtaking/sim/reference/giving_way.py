"""How drivers give way to who comes in their lane, and make room for who passes them."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import clamp, maximum
from overtaking.sim.reference.neighbours import lane_borders
from overtaking.sim.reference.oncoming import Encounters
from overtaking.sim.reference.state import Fields, State
from overtaking.sim.reference.steering import begin_path
from overtaking.sim.reference.traffic import is_out
from overtaking.world.step_parameters import StepParameters

_FREE = np.float32(1e9)  # For nobody [m/s^2].
_SLOWEST = np.float32(0.1)  # Keeps the time until vehicles meet finite [m/s].
_SHORTEST = np.float32(0.1)  # Keeps braking finite for who is there already [s].
_HALF = np.float32(0.5)


def give_way(state: State, given: StepParameters, p: Fields, met: Encounters) -> F32:
    """The acceleration that drivers do not go beyond for who comes in their lane [m/s^2].

    They flash and lift, then brake so as to stop within their part of the way, and move aside.
    What who overtakes does is told by `plight`. Those who are being passed may make room.
    """
    c, oncoming = given.constants, met.facing
    out = is_out(state)
    meets = oncoming.detected & (state.crashed == 0) & ~out
    time = oncoming.believed_gap / maximum(oncoming.closing, _SLOWEST)
    lifts, brakes = meets & (time < c.oncoming_flash_time), meets & (time < c.oncoming_brake_time)
    state.flashes = np.where(lifts, np.float32(1.0), np.float32(0.0))
    halved = np.float32(2.0) * maximum(time, _SHORTEST)
    braking = clamp(state.vx / halved, c.oncoming_min_decel, c.oncoming_max_decel)
    _move_aside(
        state,
        given,
        p,
        brakes,
        np.where(met.passed, p.edge_shift_when_passed, np.float32(0.0)),
        out,
    )
    return np.where(brakes, -braking, np.where(lifts, -c.oncoming_lift_decel, _FREE))


def _move_aside(
    state: State, given: StepParameters, p: Fields, brakes: Mask, room: F32, out: Mask
) -> None:
    """Move towards the edge of the lane for who comes in it, or passes; and back afterwards.

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        brakes: Who brakes for who comes.
        room: How far others move for who passes [m].
        out: Who overtakes, and keeps to the way of that.
    """
    c = given.constants
    wanted = np.where(brakes, c.edge_shift, room)
    arrived = state.path_time >= state.path_duration
    moved = (wanted > state.aside) | (arrived & (wanted < state.aside))
    moved = moved & (state.crashed == 0) & (p.valid > 0) & ~out
    low, high = lane_borders(state, given, 0.0)
    duration = np.where(brakes, c.edge_shift_duration, np.float32(2.0) * c.edge_shift_duration)
    begin_path(state, moved, _HALF * (low + high) - wanted, duration)
    state.aside = np.where(out, np.float32(0.0), np.where(moved, wanted, state.aside))
