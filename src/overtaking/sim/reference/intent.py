"""What a driver intends at a decision, and which moves are open to it.

The ego decides so, on two-way roads every driver: `who` selects the rows of the arrays.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import Mask
from overtaking.core.float32_math import maximum
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.mobil import change_of
from overtaking.sim.reference.state import Fields, State, Who, pick
from overtaking.world.step_parameters import StepParameters


@dataclass(slots=True, kw_only=True)
class Intent:
    """What drivers set out to do at a decision; masks of the shape of `Who`.

    Attributes:
        start: Wants to pull out, and shows it.
        back: Wants to change back, and shows it.
        go_out: Pulls out now.
        go_back: Changes back now.
        abort: Gives up pulling out now.
        remain: Gives up changing back now.
        passed: The target is behind.
        arrived: The last lane change is over.
    """

    start: Mask
    back: Mask
    go_out: Mask
    go_back: Mask
    abort: Mask
    remain: Mask
    passed: Mask
    arrived: Mask


def in_stage(state: State, who: Who, stage: Stage) -> Mask:
    """Whether drivers are sound and in a stage."""
    return (state.crashed[who] == 0) & (state.stage[who] == np.float32(stage))


def has_arrived(state: State, who: Who) -> Mask:
    """Whether the last lane change is over."""
    return state.path_time[who] >= state.path_duration[who]


def has_passed(state: State, given: StepParameters, p: Fields, who: Who) -> Mask:
    """Whether the target's front is visibly behind the own rear."""
    behind = state.s[who] - pick(state.s, state.target[who])
    bodies = p.half_length[who] + pick(p.half_length, state.target[who])
    return behind > bodies + given.constants.return_clearance


def is_early(state: State, given: StepParameters, who: Who) -> Mask:
    """Whether going back is shorter than going on."""
    return state.path_time[who] < given.constants.abort_until * state.path_duration[who]


def can_abort(state: State, given: StepParameters, who: Who) -> Mask:
    """Whether drivers pull out, and going back is shorter than going on."""
    return in_stage(state, who, Stage.PULL_OUT) & is_early(state, given, who)


def can_remain(state: State, given: StepParameters, who: Who) -> Mask:
    """Whether drivers change back by a whole lane, and going back is shorter than going on."""
    comes_back = in_stage(state, who, Stage.RETURN) | in_stage(state, who, Stage.ABORT)
    _, whole = change_of(state, given)
    return comes_back & is_early(state, given, who) & whole[who]


def signal(state: State, given: StepParameters, who: Who, start: Mask, back: Mask) -> None:
    """Remember the side that is wanted, and for how long it has been shown."""
    decision, zero, one = given.constants.decision, np.float32(0.0), np.float32(1.0)
    state.wanted[who] = np.where(start, one, np.where(back, -one, zero))
    # Doubts while waiting do not switch the indicator off at once.
    fading = maximum(state.signalled[who] - decision, zero)
    state.signalled[who] = np.where(start | back, state.signalled[who] + decision, fading)
