"""Another driver at the ego's wheel: what it asks for, as far as that is possible."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
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
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters

_FREE = np.float32(1e9)  # Without a leader [m/s^2].


@dataclass(slots=True, kw_only=True)
class EgoAction:
    """What another driver asks for at a decision.

    Attributes:
        kind: A name in `ACTION_KINDS`.
        values: Its numbers in SI units, each of shape (simulation,).
    """

    kind: str
    values: tuple[F32, ...]

    def value(self, name: str) -> F32 | None:
        """One of its numbers; None where it has none of that name."""
        names = [part.name for part in ACTION_KINDS[self.kind]]
        return self.values[names.index(name)] if name in names else None

    @property
    def steers_wheels(self) -> bool:
        """Whether the other driver turns the wheels itself."""
        return self.value("wheel_angle") is not None


def action_at(actions: Actions | None, decision_index: int) -> EgoAction | None:
    """The orders of a decision; those of the last one where there are no more."""
    if actions is None:
        return None
    row = actions.values[:, min(decision_index, actions.values.shape[1] - 1)]
    return action_from_integers(actions.kind, row)


def action_from_integers(kind: str, steps: np.ndarray) -> EgoAction:
    """Orders from whole numbers of steps, shape (simulation, part)."""
    scales = [np.float32(round(1.0 / part.resolution)) for part in ACTION_KINDS[kind]]
    values = (steps[:, k].astype(np.float32) / scale for k, scale in enumerate(scales))
    return EgoAction(kind=kind, values=tuple(values))


def with_requested_accel(action: EgoAction | None, leader: F32, old_leader: F32) -> tuple[F32, F32]:
    """The accelerations that drivers want for two reasons, the ego's as another driver asks."""
    asked = None if action is None else action.value("accel")
    if asked is None:
        return leader, old_leader
    leader, old_leader = leader.copy(), old_leader.copy()
    leader[EGO_SLOT], old_leader[EGO_SLOT] = asked, _FREE
    return leader, old_leader


def ordered_wheel_angle(action: EgoAction | None) -> F32 | None:
    """Angle of the front wheels that another driver asks for, (simulation,) [rad]."""
    return None if action is None else action.value("wheel_angle")


def set_requested_indicator(state: State, action: EgoAction) -> None:
    """Light the indicator that another driver asks for, if that is a part of its action.

    A wish for a lane beside a wheel angle is nothing but the indicator. A `Move` that names a side
    shows it, whether or not the scenario's driver uses indicators.
    """
    if action.kind not in ("accel_move", "accel_steer_signal"):
        return
    side = _requested_side(action)
    indicator = state.controls.indicator
    sets_indicator = (state.motion.is_wreck[EGO_SLOT] == 0) & (action.steers_wheels | (side != 0))
    indicator[EGO_SLOT] = np.where(sets_indicator, side, indicator[EGO_SLOT])


def can_pull_out(state: State, params: StepParameters) -> Mask:
    """Whether there is a faster lane for the ego, and no lane change under way, (simulation,)."""
    settled = state.is_in_stage(Stage.FOLLOW, EGO_SLOT) | state.is_in_stage(Stage.PASS, EGO_SLOT)
    has_lane = state.lane_choice.lane[EGO_SLOT] < np.float32(params.road.num_lanes - 1)
    return settled & state.has_finished_lane_change(EGO_SLOT) & has_lane


def can_return(state: State) -> Mask:
    """Whether there is a slower lane, and no change under way that cannot be given up."""
    follows = state.is_in_stage(Stage.FOLLOW, EGO_SLOT) & state.has_finished_lane_change(EGO_SLOT)
    return (follows | state.is_in_stage(Stage.PASS, EGO_SLOT)) & (
        state.lane_choice.lane[EGO_SLOT] >= np.float32(1.0)
    )


def intent_from_action(state: State, params: StepParameters, action: EgoAction) -> Intent:
    """What the ego intends: what the external driver asks for, where that is possible."""
    if action.steers_wheels:
        return _intent_from_position(state, params)
    side = _requested_side(action)
    # A driver that changes its mind indicates the other side for as long.
    turned = state.lane_choice.wanted_side[EGO_SLOT] * side < 0
    state.overtake.time_indicating[EGO_SLOT] = np.where(
        turned, np.float32(0.0), state.overtake.time_indicating[EGO_SLOT]
    )
    start = can_pull_out(state, params) & (side > 0)
    back = can_return(state) & (side < 0)
    update_indicator(state, params, EGO_SLOT, start, back)
    now = _moves_over_now(state, params, action)
    drops_out, drops_back, falls_in = _requested_cancels(action)
    return Intent(
        wants_to_pull_out=start,
        wants_to_return=back,
        starts_pull_out=start & now,
        starts_return=back & now,
        cancels_pull_out=(can_cancel_pull_out(state, params, EGO_SLOT) & drops_out)
        | (can_abort_pass(state, params, EGO_SLOT) & falls_in),
        cancels_return=can_cancel_return(state, params, EGO_SLOT) & drops_back,
        has_passed_target=has_passed_target(state, params, EGO_SLOT),
        has_finished_lane_change=state.has_finished_lane_change(EGO_SLOT),
    )


def _requested_side(action: EgoAction) -> F32:
    """Where the ego is to go: 1 towards the fast side, -1 towards the slow side, 0 nowhere."""
    if (wish := action.value("lane_change")) is not None:
        return wish
    move, one = action.value("move"), np.float32(1.0)
    out = (move == np.float32(Move.INDICATE_PULL_OUT)) | (move == np.float32(Move.PULL_OUT))
    back = (move == np.float32(Move.INDICATE_RETURN)) | (move == np.float32(Move.RETURN))
    return np.where(out, one, np.where(back, -one, np.float32(0.0)))


def _moves_over_now(state: State, params: StepParameters, action: EgoAction) -> Mask:
    """Whether the ego moves over now: when told to, or once it has signalled for its usual time."""
    vehicles = params.vehicles
    if (move := action.value("move")) is None:
        return state.overtake.time_indicating[EGO_SLOT] > vehicles.indicator_lead_time[EGO_SLOT]
    return (move == np.float32(Move.PULL_OUT)) | (move == np.float32(Move.RETURN))


def _requested_cancels(action: EgoAction) -> tuple[Mask, Mask, Mask]:
    """Whether the ego is to give up pulling out, changing back, and a pass that it is out for."""
    if (wish := action.value("lane_change")) is not None:
        return wish < 0, wish > 0, np.zeros(wish.shape, np.bool_)
    aborts = np.asarray(action.value("move") == np.float32(Move.CANCEL))
    return aborts, aborts, aborts


def _intent_from_position(state: State, params: StepParameters) -> Intent:
    """What the ego has set out to do, told from the lane that it is in: nothing is shown before."""
    road = params.road
    lane = np.zeros_like(state.overtake.stage[EGO_SLOT])
    for k in range(1, road.num_lanes):
        lane = np.where(state.motion.d[EGO_SLOT] >= road.boundaries[k], np.float32(k), lane)
    faster, slower = (
        lane > state.lane_choice.lane[EGO_SLOT],
        lane < state.lane_choice.lane[EGO_SLOT],
    )
    out = state.is_in_stage(Stage.PULL_OUT, EGO_SLOT)
    comes_back = state.is_in_stage(Stage.RETURN, EGO_SLOT) | state.is_in_stage(
        Stage.ABORT, EGO_SLOT
    )
    never = np.zeros_like(out)
    update_indicator(state, params, EGO_SLOT, never, never)
    return Intent(
        wants_to_pull_out=never,
        wants_to_return=never,
        starts_pull_out=faster & ~comes_back,
        starts_return=slower & ~out,
        cancels_pull_out=slower & out,
        cancels_return=faster & comes_back,
        has_passed_target=has_passed_target(state, params, EGO_SLOT),
        has_finished_lane_change=state.has_finished_lane_change(EGO_SLOT),
    )
