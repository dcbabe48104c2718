"""What the ego sets out to do at a decision, whoever decides, and what it is free to do."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import Mask, maximum
from overtaking.model.trajectory import Stage
from overtaking.model.vehicles import Role
from overtaking.sim.reference.mobil import change_of
from overtaking.sim.reference.state import Fields, State, pick
from overtaking.world.parameters import Parameters


@dataclass(slots=True, kw_only=True)
class Intent:
    """What the ego sets out to do at a decision; masks of shape (simulation,).

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


def in_stage(state: State, stage: Stage) -> Mask:
    """Whether the ego is sound and in a stage."""
    return (state.crashed[Role.EGO] == 0) & (state.stage == np.float32(stage))


def has_arrived(state: State) -> Mask:
    """Whether the last lane change of the ego is over."""
    return state.path_time[Role.EGO] >= state.path_duration[Role.EGO]


def has_passed(state: State, given: Parameters, p: Fields) -> Mask:
    """Whether the target's front is visibly behind the ego's rear."""
    behind = state.s[Role.EGO] - pick(state.s, state.target)
    bodies = p.half_length[Role.EGO] + pick(p.half_length, state.target)
    return behind > bodies + given.constants.clear_ahead


def is_early(state: State, given: Parameters) -> Mask:
    """Whether going back is shorter than going on."""
    halfway = given.constants.abort_until * state.path_duration[Role.EGO]
    return state.path_time[Role.EGO] < halfway


def can_go_out(state: State, given: Parameters) -> Mask:
    """Whether there is a faster lane, and no lane change under way."""
    settled = in_stage(state, Stage.FOLLOW) | in_stage(state, Stage.PASS)
    has_lane = state.lane[Role.EGO] < np.float32(given.road.num_lanes - 1)
    return settled & has_arrived(state) & has_lane


def can_go_back(state: State) -> Mask:
    """Whether there is a slower lane, and no lane change under way that cannot be given up."""
    follows = in_stage(state, Stage.FOLLOW) & has_arrived(state)
    return (follows | in_stage(state, Stage.PASS)) & (state.lane[Role.EGO] >= np.float32(1.0))


def can_abort(state: State, given: Parameters) -> Mask:
    """Whether the ego pulls out, and going back is shorter than going on."""
    return in_stage(state, Stage.PULL_OUT) & is_early(state, given)


def can_remain(state: State, given: Parameters) -> Mask:
    """Whether the ego changes back by a whole lane, and going back is shorter than going on."""
    comes_back = in_stage(state, Stage.RETURN) | in_stage(state, Stage.ABORT)
    _, whole = change_of(state, given)
    return comes_back & is_early(state, given) & whole[Role.EGO]


def signal(state: State, given: Parameters, start: Mask, back: Mask) -> None:
    """Remember the side that is wanted, and for how long it has been shown."""
    decision, zero, one = given.constants.decision, np.float32(0.0), np.float32(1.0)
    state.wanted[Role.EGO] = np.where(start, one, np.where(back, -one, zero))
    # Doubts while waiting do not switch the indicator off at once.
    fading = maximum(state.signalled - decision, zero)
    state.signalled = np.where(start | back, state.signalled + decision, fading)
