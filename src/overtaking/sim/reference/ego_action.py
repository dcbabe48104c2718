"""Actions of an external driver of the ego, carried out as far as that is possible."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import ONE, ZERO
from overtaking.model.driver_interface import ACTION_KINDS, Actions, Move
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.gap_acceptance import (
    Intent,
    can_cancel_pull_out,
    can_cancel_return,
    has_passed_target,
    update_indicator,
)
from overtaking.sim.reference.pass_continuation import can_abort_pass
from overtaking.sim.reference.state import NO_ACCEL_LIMIT, State
from overtaking.world.step_parameters import StepParameters


@dataclass(slots=True, kw_only=True)
class EgoAction:
    """Action of an external driver at a decision.

    Attributes:
        kind: A name in `ACTION_KINDS`.
        values: Its numbers in SI units, each of shape (simulation,).
    """

    kind: str
    values: tuple[F32, ...]

    def value(self, name: str) -> F32 | None:
        """The number of a part of the action; None if its kind does not have the part."""
        names = [part.name for part in ACTION_KINDS[self.kind]]
        return self.values[names.index(name)] if name in names else None

    @property
    def steers_wheels(self) -> bool:
        """Whether the external driver sets the wheel angle."""
        return self.value("wheel_angle") is not None


class RequestedCancels(NamedTuple):
    """Manoeuvres that the external driver cancels, each (simulation,)."""

    pull_out: Mask
    return_: Mask
    passing: Mask  # A pass in the opposing lane.


def action_at(actions: Actions | None, decision_index: int) -> EgoAction | None:
    """The action at a decision; after the last recorded one, the last one."""
    if actions is None:
        return None
    row = actions.values[:, min(decision_index, actions.values.shape[1] - 1)]
    return action_from_integers(actions.kind, row)


def action_from_integers(kind: str, integers: NDArray[np.int32]) -> EgoAction:
    """An action from multiples of the resolution of each part, shape (simulation, part)."""
    scales = [np.float32(round(1.0 / part.resolution)) for part in ACTION_KINDS[kind]]
    values = (integers[:, k].astype(np.float32) / scale for k, scale in enumerate(scales))
    return EgoAction(kind=kind, values=tuple(values))


def with_requested_accel(
    action: EgoAction | None, leader_accel: F32, old_leader_accel: F32
) -> tuple[F32, F32]:
    """Both accelerations of `apply_pedals`, for the ego replaced by the action's, if it has one."""
    ego_accel = None if action is None else action.value("accel")
    if ego_accel is None:
        return leader_accel, old_leader_accel
    leader_accel, old_leader_accel = leader_accel.copy(), old_leader_accel.copy()
    leader_accel[EGO_SLOT], old_leader_accel[EGO_SLOT] = ego_accel, NO_ACCEL_LIMIT
    return leader_accel, old_leader_accel


def requested_wheel_angle(action: EgoAction | None) -> F32 | None:
    """Wheel angle of the action, (simulation,) [rad]; None without one."""
    return None if action is None else action.value("wheel_angle")


def set_requested_indicator(state: State, action: EgoAction) -> None:
    """Set the ego's indicator if the action names a side.

    With a wheel angle, the lane of the action only sets the indicator. A `Move` that names a side
    sets it whether or not the scenario's driver uses indicators.
    """
    if action.kind not in ("accel_move", "accel_steer_signal"):
        return
    side, indicator = _requested_side(action), state.controls.indicator
    sets_indicator = (state.motion.is_wreck[EGO_SLOT] == 0) & (action.steers_wheels | (side != 0))
    indicator[EGO_SLOT] = np.where(sets_indicator, side, indicator[EGO_SLOT])


def can_pull_out(state: State, params: StepParameters) -> Mask:
    """Whether the ego has a lane on its left and is not changing lanes, (simulation,)."""
    follows = state.is_in_stage(Stage.FOLLOW, EGO_SLOT)
    is_ready = follows | state.is_in_stage(Stage.PASS, EGO_SLOT)
    has_lane = state.lane_choice.lane[EGO_SLOT] < np.float32(params.road.num_lanes - 1)
    return is_ready & state.has_finished_lane_change(EGO_SLOT) & has_lane


def can_return(state: State) -> Mask:
    """Whether the ego follows or passes and has a lane on its right, (simulation,)."""
    follows = state.is_in_stage(Stage.FOLLOW, EGO_SLOT) & state.has_finished_lane_change(EGO_SLOT)
    has_lane = state.lane_choice.lane[EGO_SLOT] >= ONE
    return (follows | state.is_in_stage(Stage.PASS, EGO_SLOT)) & has_lane


def intent_from_action(state: State, params: StepParameters, action: EgoAction) -> Intent:
    """Intent of the ego: the request of the external driver, where it is possible."""
    if action.steers_wheels:
        return _intent_from_position(state, params)
    side = _requested_side(action)
    # A driver that changes to the other side must indicate anew for the whole lead time.
    turns_round = state.lane_choice.wanted_side[EGO_SLOT] * side < 0
    state.overtake.time_indicating[EGO_SLOT] = np.where(
        turns_round, ZERO, state.overtake.time_indicating[EGO_SLOT]
    )
    wants_to_pull_out = can_pull_out(state, params) & (side > 0)
    wants_to_return = can_return(state) & (side < 0)
    update_indicator(state, params, EGO_SLOT, wants_to_pull_out, wants_to_return)
    starts_now = _moves_over_now(state, params, action)
    cancels = _requested_cancels(action)
    return Intent(
        wants_to_pull_out=wants_to_pull_out,
        wants_to_return=wants_to_return,
        starts_pull_out=wants_to_pull_out & starts_now,
        starts_return=wants_to_return & starts_now,
        cancels_pull_out=(can_cancel_pull_out(state, params, EGO_SLOT) & cancels.pull_out)
        | (can_abort_pass(state, params, EGO_SLOT) & cancels.passing),
        cancels_return=can_cancel_return(state, params, EGO_SLOT) & cancels.return_,
        has_passed_target=has_passed_target(state, params, EGO_SLOT),
        has_finished_lane_change=state.has_finished_lane_change(EGO_SLOT),
    )


def _requested_side(action: EgoAction) -> F32:
    """Side of the requested lane change: 1 to the left, -1 to the right, 0 for no change."""
    if (lane_change := action.value("lane_change")) is not None:
        return lane_change
    move = action.value("move")
    to_left = (move == np.float32(Move.INDICATE_PULL_OUT)) | (move == np.float32(Move.PULL_OUT))
    to_right = (move == np.float32(Move.INDICATE_RETURN)) | (move == np.float32(Move.RETURN))
    return np.where(to_left, ONE, np.where(to_right, -ONE, ZERO))


def _moves_over_now(state: State, params: StepParameters, action: EgoAction) -> Mask:
    """Whether the ego moves over now: by its `Move`, else after its indicator lead time."""
    if (move := action.value("move")) is None:
        lead_time = params.vehicles.indicator_lead_time[EGO_SLOT]
        return state.overtake.time_indicating[EGO_SLOT] > lead_time
    return (move == np.float32(Move.PULL_OUT)) | (move == np.float32(Move.RETURN))


def _requested_cancels(action: EgoAction) -> RequestedCancels:
    """Manoeuvres that the action cancels if they are under way."""
    if (side := action.value("lane_change")) is not None:
        return RequestedCancels(
            pull_out=side < 0, return_=side > 0, passing=np.zeros(side.shape, np.bool_)
        )
    cancels = np.asarray(action.value("move") == np.float32(Move.CANCEL))
    return RequestedCancels(pull_out=cancels, return_=cancels, passing=cancels)


def _intent_from_position(state: State, params: StepParameters) -> Intent:
    """Intent of an ego that is steered by a wheel angle, from the lane that its centre is in.

    Its lane changes are known only once the centre has crossed a line, so it wants nothing before.
    """
    road, d = params.road, state.motion.d[EGO_SLOT]
    lane = np.zeros_like(state.overtake.stage[EGO_SLOT])
    for k in range(1, road.num_lanes):
        lane = np.where(d >= road.boundaries[k], np.float32(k), lane)
    is_left_of_lane = lane > state.lane_choice.lane[EGO_SLOT]
    is_right_of_lane = lane < state.lane_choice.lane[EGO_SLOT]
    pulls_out = state.is_in_stage(Stage.PULL_OUT, EGO_SLOT)
    returns = state.is_in_stage(Stage.RETURN, EGO_SLOT)
    goes_back = returns | state.is_in_stage(Stage.ABORT, EGO_SLOT)
    no_wish = np.zeros_like(pulls_out)
    update_indicator(state, params, EGO_SLOT, no_wish, no_wish)
    return Intent(
        wants_to_pull_out=no_wish,
        wants_to_return=no_wish,
        starts_pull_out=is_left_of_lane & ~goes_back,
        starts_return=is_right_of_lane & ~pulls_out,
        cancels_pull_out=is_right_of_lane & pulls_out,
        cancels_return=is_left_of_lane & goes_back,
        has_passed_target=has_passed_target(state, params, EGO_SLOT),
        has_finished_lane_change=state.has_finished_lane_change(EGO_SLOT),
    )
