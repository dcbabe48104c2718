"""Actions of an external driver, a program that drives the ego in place of the model's driver.

The parts of an action depend on its kind (`ACTION_KINDS`):
    decision: `move`
    accel_lane: `accel`, `lane_change`
    accel_steer: `accel`, `wheel_angle`
    accel_move: `accel`, `move`
    accel_steer_signal: `accel`, `wheel_angle`, `lane_change`

`move` is a `Move`. `lane_change` is 1 to the left, -1 to the right, 0 for no change; left is the
overtaking side. The model operates pedals and steering where the action has no part for them. A
request that is impossible now has no effect.
"""

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
    store_wanted_side,
)
from overtaking.sim.reference.pass_continuation import can_abort_pass
from overtaking.sim.reference.state import NO_ACCEL_LIMIT, State
from overtaking.world.step_parameters import StepParameters


@dataclass(slots=True, kw_only=True)
class EgoAction:
    """Action of an external driver at a decision.

    Attributes:
        kind: A name in `ACTION_KINDS`.
        values: Its parts in SI units, each of shape (simulation,).
    """

    kind: str
    values: tuple[F32, ...]

    def value(self, name: str) -> F32 | None:
        """The part with this name; None if the kind of the action does not have it."""
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
    """The action at a decision; after the last recorded action, that one again."""
    if actions is None:
        return None
    # `actions.values` has shape (simulation, decision, part).
    row = actions.values[:, min(decision_index, actions.values.shape[1] - 1)]
    return action_from_integers(actions.kind, row)


def action_from_integers(kind: str, integers: NDArray[np.int32]) -> EgoAction:
    """An action from its recorded integers.

    Args:
        kind: A name in `ACTION_KINDS`.
        integers: Each part divided by its `ActionPart.resolution`, shape (simulation, part).
    """
    # A division by 1000 instead of a product with 0.001, because float32 holds only 1000 exactly.
    steps_per_unit = [np.float32(round(1.0 / part.resolution)) for part in ACTION_KINDS[kind]]
    values = (integers[:, k].astype(np.float32) / steps for k, steps in enumerate(steps_per_unit))
    return EgoAction(kind=kind, values=tuple(values))


def with_requested_accel(
    action: EgoAction | None, leader_accel: F32, old_leader_accel: F32
) -> tuple[F32, F32]:
    """Replace the ego's accelerations behind both leaders by the part `accel` of the action.

    Args:
        action: Action of an external driver; None if the model's driver decides.
        leader_accel: Acceleration behind the leader, (vehicle, simulation) [m/s^2].
        old_leader_accel: Acceleration behind the leader in the old lane, from which the vehicle
            moves, same shape [m/s^2].

    Returns:
        Both accelerations, unchanged if the action has no such part.
    """
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
    """Set the ego's indicator, whether or not the model's driver uses its indicator.

    Only two kinds of action contain the indicator; with the others `overtake` sets it. In
    "accel_move" a `Move` with a side sets it. In "accel_steer_signal" `lane_change` only sets the
    indicator, because the wheel angle changes lanes; 0 switches it off.
    """
    if action.kind not in ("accel_move", "accel_steer_signal"):
        return
    side, indicator = _requested_side(action), state.controls.indicator
    sets_indicator = (state.motion.is_wreck[EGO_SLOT] == 0) & (action.steers_wheels | (side != 0))
    indicator[EGO_SLOT] = np.where(sets_indicator, side, indicator[EGO_SLOT])


def can_pull_out(state: State, params: StepParameters) -> Mask:
    """Whether the ego follows or passes, is not changing lanes, and has a lane on its left.

    Returns:
        Shape (simulation,). A passing ego may change to yet another lane on its left.
    """
    follows = state.is_in_stage(Stage.FOLLOW, EGO_SLOT)
    is_ready = follows | state.is_in_stage(Stage.PASS, EGO_SLOT)
    has_left_lane = state.lane_choice.lane[EGO_SLOT] < np.float32(params.road.num_lanes - 1)
    return is_ready & state.has_finished_lane_change(EGO_SLOT) & has_left_lane


def can_return(state: State) -> Mask:
    """Whether the ego follows or passes and has a lane on its right.

    Returns:
        Shape (simulation,). An ego that follows may change to the right without an overtake. A
        passing ego need not have finished its lane change: after it has cancelled a return, it may
        return again at once.
    """
    follows = state.is_in_stage(Stage.FOLLOW, EGO_SLOT) & state.has_finished_lane_change(EGO_SLOT)
    has_right_lane = state.lane_choice.lane[EGO_SLOT] >= ONE
    return (follows | state.is_in_stage(Stage.PASS, EGO_SLOT)) & has_right_lane


def intent_from_action(state: State, params: StepParameters, action: EgoAction) -> Intent:
    """Intent of the ego: the request of the external driver, where it is possible.

    The function also updates the wanted side and the time of indicating.
    """
    if action.steers_wheels:
        return _intent_from_position(state, params)
    side = _requested_side(action)
    # A driver that now wants the other side must indicate for the whole lead time again.
    wants_other_side = state.lane_choice.wanted_side[EGO_SLOT] * side < 0
    state.overtake.time_indicating[EGO_SLOT] = np.where(
        wants_other_side, ZERO, state.overtake.time_indicating[EGO_SLOT]
    )
    wants_to_pull_out = can_pull_out(state, params) & (side > 0)
    wants_to_return = can_return(state) & (side < 0)
    store_wanted_side(state, params, EGO_SLOT, wants_to_pull_out, wants_to_return)
    starts_now = _moves_over_now(state, params, action)
    cancels = _requested_cancels(action)
    # An aborted pass counts as a cancelled pull-out: both go back to the right.
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
    """Whether the ego starts a wanted lane change now: by its `Move`, else after its lead time."""
    if (move := action.value("move")) is None:
        lead_time = params.vehicles.indicator_lead_time[EGO_SLOT]
        return state.overtake.time_indicating[EGO_SLOT] > lead_time
    return (move == np.float32(Move.PULL_OUT)) | (move == np.float32(Move.RETURN))


def _requested_cancels(action: EgoAction) -> RequestedCancels:
    """Manoeuvres that the action cancels if they are under way.

    A `lane_change` cancels a lane change to the other side. Only a `Move` can cancel a pass.
    """
    if (side := action.value("lane_change")) is not None:
        return RequestedCancels(
            pull_out=side < 0, return_=side > 0, passing=np.zeros(side.shape, np.bool_)
        )
    cancels = np.asarray(action.value("move") == np.float32(Move.CANCEL))
    return RequestedCancels(pull_out=cancels, return_=cancels, passing=cancels)


def _intent_from_position(state: State, params: StepParameters) -> Intent:
    """Intent of an ego that is steered by a wheel angle, from the lane that its centre is in.

    The model knows of a lane change only once the centre has crossed a line. So the ego wants no
    lane change in advance; the change starts at the first decision after the crossing.
    """
    road, d = params.road, state.motion.d[EGO_SLOT]
    present_lane = np.zeros_like(state.overtake.stage[EGO_SLOT])
    for k in range(1, road.num_lanes):
        # `boundaries[k]` is the right border of lane k.
        present_lane = np.where(d >= road.boundaries[k], np.float32(k), present_lane)
    # `lane_choice.lane` is the lane at the last decision; lanes are numbered from the right.
    has_crossed_left_line = present_lane > state.lane_choice.lane[EGO_SLOT]
    has_crossed_right_line = present_lane < state.lane_choice.lane[EGO_SLOT]
    pulls_out = state.is_in_stage(Stage.PULL_OUT, EGO_SLOT)
    returns = state.is_in_stage(Stage.RETURN, EGO_SLOT)
    goes_back = returns | state.is_in_stage(Stage.ABORT, EGO_SLOT)
    no_wish = np.zeros_like(pulls_out)
    store_wanted_side(state, params, EGO_SLOT, no_wish, no_wish)
    return Intent(
        wants_to_pull_out=no_wish,
        wants_to_return=no_wish,
        starts_pull_out=has_crossed_left_line & ~goes_back,
        starts_return=has_crossed_right_line & ~pulls_out,
        cancels_pull_out=has_crossed_right_line & pulls_out,
        cancels_return=has_crossed_left_line & goes_back,
        has_passed_target=has_passed_target(state, params, EGO_SLOT),
        has_finished_lane_change=state.has_finished_lane_change(EGO_SLOT),
    )
