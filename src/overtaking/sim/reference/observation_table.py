"""The table that an external driver of the ego observes: beliefs of the model driver, or truth.

An external driver, such as a trained network, drives the ego, the vehicle under study, in place of
the model driver, which continues to perceive and judge. The target is the vehicle that the ego
overtakes. Vehicles have slot numbers; a role is a neighbour's place, such as leader in the ego's
lane. Lateral values and the indicator are positive to the left, the overtaking side.
`model.driver_interface` states unit and meaning of each column.
"""

from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, TWO, ZERO, minimum
from overtaking.model.driver_interface import (
    OBSERVATION_SIZE,
    EgoColumns,
    NeighbourColumns,
    PassingColumns,
    split_observation,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.decision_context import DecisionContext, Neighbours, OncomingVehicle
from overtaking.sim.reference.ego_action import can_pull_out, can_return
from overtaking.sim.reference.gap_acceptance import (
    can_cancel_pull_out,
    can_cancel_return,
    has_passed_target,
    is_scripted,
    true_closing_speed_to_leader,
)
from overtaking.sim.reference.oncoming import expected_closing_speed, observe_second_oncoming
from overtaking.sim.reference.pass_continuation import can_abort_pass, decide_pass_continuation
from overtaking.sim.reference.passing import gap_ahead_of, line_is_solid, tall_vehicle_gap_factor
from overtaking.sim.reference.state import LEADER, State, is_leader_role, value_at_slot
from overtaking.world.step_parameters import StepParameters


class NeighbourMotion(NamedTuple):
    """Motion of a neighbour relative to the ego, each of shape (simulation,).

    Attributes:
        is_detected: Whether the model driver has detected the neighbour; for an external driver
            that observes the truth, whether the neighbour exists.
        gap: Gap between the bumpers [m].
        closing_speed: Speed at which the gap shrinks [m/s].
        accel: Acceleration of the neighbour [m/s^2].
    """

    is_detected: Mask
    gap: F32
    closing_speed: F32
    accel: F32


def observation_table(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    *,
    observes_truth: bool,
) -> F32:
    """Observations of all egos, shape (simulation, `OBSERVATION_SIZE`).

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        context: Perception of the drivers at this decision.
        observes_truth: Whether the columns of neighbours are the truth instead of the model
            driver's beliefs. The columns about a pass are its judgements in both cases.
    """
    table = np.zeros((state.motion.s.shape[1], OBSERVATION_SIZE), np.float32)
    ego, neighbours, passing = split_observation(table)
    # On one-way roads the two oncoming vehicles keep this gap, and zeros in all other columns.
    neighbours[:, :, NeighbourColumns._fields.index("gap")] = params.constants.unseen_gap
    _fill_columns(ego, _ego_columns(state, params, context))
    for role in NeighbourRole:
        if observes_truth:
            motion = _true_motion(state, params, context.neighbours, role)
        else:
            motion = _believed_motion(state, params, context, role)
        columns = _neighbour_columns(state, params, context.neighbours, role=role, motion=motion)
        _fill_columns(neighbours[:, role], columns)
    if context.oncoming is not None:
        oncoming = context.oncoming.nearest
        second = observe_second_oncoming(state, params, context)
        for role, vehicle in enumerate((oncoming, second), len(NeighbourRole)):
            columns = _oncoming_columns(state, params, vehicle, observes_truth=observes_truth)
            _fill_columns(neighbours[:, role], columns)
        _fill_columns(passing, _passing_columns(state, params, context, oncoming=oncoming))
    return table


def _fill_columns(table: F32, columns: EgoColumns | NeighbourColumns | PassingColumns) -> None:
    """Write columns of shape (simulation,) into a table of shape (simulation, column)."""
    for index, values in enumerate(columns):
        table[:, index] = values


def _ego_columns(state: State, params: StepParameters, context: DecisionContext) -> EgoColumns:
    """The ego's own motion, and the state of its overtake."""
    ego, neighbours = EGO_SLOT, context.neighbours
    lane_centre = HALF * (neighbours.lane_right_edge[ego] + neighbours.lane_left_edge[ego])
    return EgoColumns(
        speed=state.motion.vx[ego],
        requested_accel=state.controls.requested_accel[ego],
        s=state.motion.s[ego],
        lateral_position=state.motion.d[ego],
        lane_offset=state.motion.d[ego] - lane_centre,
        heading=state.motion.heading[ego],
        yaw_rate=state.motion.yaw_rate[ego],
        lane=state.lane_choice.lane[ego],
        stage=state.overtake.stage[ego],
        time_in_stage=state.overtake.time_in_stage[ego],
        time_waiting=state.overtake.time_waiting[ego],
        time_indicating=state.overtake.time_indicating[ego],
        wanted_side=state.lane_choice.wanted_side[ego],
        time_since_lane_change=state.lane_choice.time_since_lane_change[ego],
        has_finished_lane_change=_flag(state.has_finished_lane_change(ego)),
        checks_mirrors=_flag(context.checks_mirrors[ego]),
        gives_way=_flag(context.gives_way[ego]),
        has_passed_target=_flag(has_passed_target(state, params, ego)),
        # Without a target, `value_at_slot` gives slot 0, the ego itself, so the flag is 0.
        is_behind_target=_flag(
            state.motion.s[ego] < value_at_slot(state.motion.s, state.overtake.target_slot[ego])
        ),
        can_pull_out=_flag(can_pull_out(state, params)),
        can_return=_flag(can_return(state)),
        can_cancel_lane_change=_flag(
            can_cancel_pull_out(state, params, ego) | can_cancel_return(state, params, ego)
        ),
    )


def _believed_motion(
    state: State, params: StepParameters, context: DecisionContext, role: NeighbourRole
) -> NeighbourMotion:
    """The model driver's beliefs about a neighbour; `unseen_gap` and zeros without detection.

    In the profile of the study by Pinto et al. (2023) the ego changes lanes by that study's script,
    which decides by the true closing speed to the leader: by its belief the ego would pull out too
    late. The column of such an ego shows the true speed too.
    """
    beliefs, ego = context.beliefs, EGO_SLOT
    is_detected, closing_speed = beliefs.is_detected[role, ego], beliefs.closing_speed[role, ego]
    if role == NeighbourRole.LEADER:
        uses_true_speed = is_scripted(params) & is_detected
        closing_speed = np.where(
            uses_true_speed, true_closing_speed_to_leader(state, context.neighbours), closing_speed
        )
    return NeighbourMotion(
        is_detected, beliefs.gap[role, ego], closing_speed, beliefs.accel[role, ego]
    )


def _true_motion(
    state: State, params: StepParameters, neighbours: Neighbours, role: NeighbourRole
) -> NeighbourMotion:
    """The true motion of a neighbour; `unseen_gap` and zeros without one."""
    slot = neighbours.slot[role, EGO_SLOT]
    exists = slot >= 0
    speeds, _ = state.road_velocity()  # Along the road [m/s].
    ego_speed, speed = speeds[EGO_SLOT], value_at_slot(speeds, slot)
    closing_speed = ego_speed - speed if is_leader_role(role) else speed - ego_speed
    return NeighbourMotion(
        is_detected=exists,
        gap=np.where(exists, neighbours.gap[role, EGO_SLOT], params.constants.unseen_gap),
        closing_speed=np.where(exists, closing_speed, ZERO),
        accel=np.where(exists, value_at_slot(state.motion.accel_lon, slot), ZERO),
    )


def _neighbour_columns(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    *,
    role: NeighbourRole,
    motion: NeighbourMotion,
) -> NeighbourColumns:
    """A neighbour's motion and appearance; without detection the appearance is zero."""
    vehicles, constants = params.vehicles, params.constants
    slot = neighbours.slot[role, EGO_SLOT]
    requested_accel = value_at_slot(state.controls.requested_accel, slot)
    # A wreck requests no braking, but slides with locked wheels; that it shows stop lamps is a
    # choice.
    is_wreck = value_at_slot(state.motion.is_wreck, slot) > 0
    stop_lamp = (requested_accel < -constants.stop_lamp_decel) | is_wreck

    def if_detected(values: F32) -> F32:
        return np.where(motion.is_detected, values, ZERO)

    return NeighbourColumns(
        is_detected=_flag(motion.is_detected),
        gap=motion.gap,
        closing_speed=motion.closing_speed,
        accel=motion.accel,
        lateral_distance=if_detected(neighbours.lateral_distance[role, EGO_SLOT]),
        indicator=if_detected(value_at_slot(state.controls.indicator, slot)),
        stop_lamp=if_detected(_flag(stop_lamp)),
        length=if_detected(TWO * neighbours.half_length[role, EGO_SLOT]),
        is_truck=if_detected(value_at_slot(vehicles.has_truck_tyres, slot)),
        is_two_wheeler=if_detected(value_at_slot(vehicles.two_wheeler, slot)),
    )


def _oncoming_columns(
    state: State,
    params: StepParameters,
    vehicle: OncomingVehicle,
    *,
    observes_truth: bool,
) -> NeighbourColumns:
    """Motion and appearance of an oncoming vehicle; `unseen_gap` and zeros without one."""
    vehicles = params.vehicles
    ego, slot = EGO_SLOT, vehicle.slot[EGO_SLOT]
    speeds, _ = state.road_velocity()
    # Lateral positions of all vehicles, counted like the ego's; oncoming vehicles count theirs from
    # the other side of the road.
    d = np.stack(
        [
            state.position_seen_by_each(params, other_slot)[1][ego]
            for other_slot in range(len(speeds))
        ]
    )
    if observes_truth:
        is_detected, gap = slot >= 0, vehicle.gap[ego]
        # The speed and acceleration of each vehicle count along its own direction of travel.
        closing_speed = speeds[ego] + value_at_slot(speeds, slot)
        accel = value_at_slot(state.motion.accel_lon, slot)
    else:
        is_detected, gap = vehicle.is_detected[ego], vehicle.believed_gap[ego]
        # Drivers do not judge the acceleration of an oncoming vehicle.
        closing_speed, accel = vehicle.closing_speed[ego], np.zeros_like(gap)

    def if_detected(values: F32) -> F32:
        return np.where(is_detected, values, ZERO)

    return NeighbourColumns(
        is_detected=_flag(is_detected),
        gap=np.where(is_detected, gap, params.constants.unseen_gap),
        closing_speed=if_detected(closing_speed),
        accel=if_detected(accel),
        lateral_distance=if_detected(value_at_slot(d, slot) - state.motion.d[ego]),
        # The left of an oncoming vehicle is the ego's right.
        indicator=if_detected(-value_at_slot(state.controls.indicator, slot)),
        stop_lamp=np.zeros_like(gap),  # Stop lamps are at the rear, which the ego does not see.
        length=if_detected(TWO * vehicle.half_length[ego]),
        is_truck=if_detected(value_at_slot(vehicles.has_truck_tyres, slot)),
        is_two_wheeler=if_detected(value_at_slot(vehicles.two_wheeler, slot)),
    )


def _passing_columns(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    *,
    oncoming: OncomingVehicle,
) -> PassingColumns:
    """The model driver's knowledge about a pass against oncoming traffic.

    `oncoming.is_certain` says that the driver has watched long enough to know whether a vehicle is
    oncoming.
    """
    ego = EGO_SLOT
    continuation = decide_pass_continuation(state, params, context, ego)
    leader_slot = context.neighbours.slot[LEADER, ego]
    is_following = state.is_in_stage(Stage.FOLLOW, ego)
    # Before an overtake the leader is the vehicle that the ego would pass.
    passed_slot = np.where(is_following, leader_slot, state.overtake.target_slot[ego])
    # As its name says, this column follows the leader also while the ego overtakes.
    gap_ahead_of_leader = gap_ahead_of(state, params, leader_slot, ego)
    return PassingColumns(
        sight_distance=oncoming.sight_distance[ego],
        is_certain=_flag(oncoming.is_certain[ego]),
        expected_closing_speed=expected_closing_speed(state, params)[ego],
        gap_ahead_of_leader=minimum(gap_ahead_of_leader, params.constants.unseen_gap),
        tall_vehicle_gap_factor=tall_vehicle_gap_factor(params, passed_slot),
        line_is_solid=_flag(line_is_solid(state, params, ego, params.constants.line_lookahead)),
        # 1 for an urgent return that also accepts a small gap, 0.5 for another urgent return.
        return_urgency=HALF * continuation.must_return_urgently
        + HALF * continuation.accepts_small_gap,
        # 1 for an abort with space behind the target, 0.5 for an abort without it yet.
        abort_state=HALF * continuation.must_abort
        + HALF * (continuation.must_abort & continuation.fits_into_lane),
        can_abort_pass=_flag(can_abort_pass(state, params, ego)),
    )


def _flag(mask: Mask) -> F32:
    """1 where the mask is true, else 0."""
    return mask.astype(np.float32)
