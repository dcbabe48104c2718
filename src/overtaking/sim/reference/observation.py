"""The table that an external driver of the ego observes: beliefs of the model driver, or truth."""

from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import minimum
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
from overtaking.sim.reference.gaps import faster, is_told
from overtaking.sim.reference.intent import (
    can_abort,
    can_remain,
    has_arrived,
    has_passed,
    in_stage,
)
from overtaking.sim.reference.moment import Moment
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.oncoming import Oncoming, look_beyond, usual_closing
from overtaking.sim.reference.orders import can_go_back, can_go_out
from overtaking.sim.reference.passing import is_solid, room_ahead, room_left
from overtaking.sim.reference.plight import can_fall_in, weigh
from overtaking.sim.reference.state import (
    LEAD,
    Fields,
    State,
    pick,
    road_velocity,
    seen_from_each,
)
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters
from overtaking.world.weather_parameters import SimulationParameters

_HALF = np.float32(0.5)
_TWO = np.float32(2.0)


class NeighbourMotion(NamedTuple):
    """Motion of a neighbour relative to the ego, each of shape (simulation,).

    Attributes:
        is_detected: Whether there is a vehicle that the ego notices.
        gap: Gap between the bumpers [m].
        closing_speed: Speed at which the gap shrinks [m/s].
        accel: Acceleration [m/s^2].
    """

    is_detected: Mask
    gap: F32
    closing_speed: F32
    accel: F32


def observe(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    *,
    decision: int,
    is_true: bool,
) -> F32:
    """Observations of all egos, shape (simulation, `OBSERVATION_SIZE`).

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        moment: Percepts and beliefs of the drivers.
        decision: Number of the decision.
        is_true: Whether to observe the true state instead of the ego's beliefs.
    """
    table = np.zeros((state.s.shape[1], OBSERVATION_SIZE), np.float32)
    ego, neighbours, passing = split_observation(table)
    neighbours[:, :, NeighbourColumns._fields.index("gap")] = given.constants.unseen_gap
    _fill_columns(ego, _ego_columns(state, given, p, moment))
    for role in NeighbourRole:
        if is_true:
            motion = _true_motion(state, moment.near, given, role)
        else:
            motion = _believed_motion(state, p, moment, role)
        columns = _neighbour_columns(
            state, given.constants, p, moment.near, role=role, motion=motion
        )
        _fill_columns(neighbours[:, role], columns)
    if moment.met is not None:
        oncoming = moment.met.coming
        second = look_beyond(state, given, p, q, moment.near, oncoming, decision)
        for role, vehicle in enumerate((oncoming, second), len(NeighbourRole)):
            columns = _oncoming_columns(state, given, p, vehicle, is_true=is_true)
            _fill_columns(neighbours[:, role], columns)
        _fill_columns(passing, _passing_columns(state, given, p, q, moment, oncoming=oncoming))
    return table


def _fill_columns(table: F32, columns: EgoColumns | NeighbourColumns | PassingColumns) -> None:
    """Write columns of shape (simulation,) into a table of shape (simulation, column)."""
    for index, values in enumerate(columns):
        table[:, index] = values


def _ego_columns(state: State, given: StepParameters, p: Fields, moment: Moment) -> EgoColumns:
    """The ego itself."""
    ego, near = EGO_SLOT, moment.near
    lane_centre = _HALF * (near.lane_low[ego] + near.lane_high[ego])
    return EgoColumns(
        speed=state.vx[ego],
        requested_accel=state.accel[ego],
        s=state.s[ego],
        lateral_position=state.d[ego],
        lane_offset=state.d[ego] - lane_centre,
        heading=state.psi[ego],
        yaw_rate=state.r[ego],
        lane=state.lane[ego],
        stage=state.stage[ego],
        time_in_stage=state.stage_time[ego],
        time_waiting=state.waited[ego],
        time_indicating=state.signalled[ego],
        wanted_side=state.wanted[ego],
        time_since_lane_change=state.since_change[ego],
        has_finished_lane_change=_flag(has_arrived(state, ego)),
        checks_mirrors=_flag(moment.looks[ego]),
        gives_way=_flag(moment.waits[ego]),
        has_passed_target=_flag(has_passed(state, given, p, ego)),
        is_behind_target=_flag(state.s[ego] < pick(state.s, state.target[ego])),
        can_pull_out=_flag(can_go_out(state, given)),
        can_return=_flag(can_go_back(state)),
        can_cancel_lane_change=_flag(can_abort(state, given, ego) | can_remain(state, given, ego)),
    )


def _believed_motion(
    state: State, p: Fields, moment: Moment, role: NeighbourRole
) -> NeighbourMotion:
    """The model driver's beliefs; true closing speeds if the driver is told to change lanes."""
    believed, ego = moment.believed, EGO_SLOT
    is_detected, closing_speed = believed.detected[role, ego], believed.closing[role, ego]
    if role == NeighbourRole.LEADER:
        knows_speed = is_told(p) & is_detected
        closing_speed = np.where(knows_speed, faster(state, moment.near), closing_speed)
    return NeighbourMotion(
        is_detected, believed.gap[role, ego], closing_speed, believed.accel[role, ego]
    )


def _true_motion(
    state: State, near: Neighbours, given: StepParameters, role: NeighbourRole
) -> NeighbourMotion:
    """The true motion of a neighbour; a large gap and zeros without one."""
    slot, zero = near.slot[role, EGO_SLOT], np.float32(0.0)
    exists = slot >= 0
    speeds, _ = road_velocity(state)
    ego_speed, speed = speeds[EGO_SLOT], pick(speeds, slot)
    is_ahead = role % 2 == 0
    closing_speed = ego_speed - speed if is_ahead else speed - ego_speed
    return NeighbourMotion(
        is_detected=exists,
        gap=np.where(exists, near.gap[role, EGO_SLOT], given.constants.unseen_gap),
        closing_speed=np.where(exists, closing_speed, zero),
        accel=np.where(exists, pick(state.a_lon, slot), zero),
    )


def _neighbour_columns(
    state: State,
    c: ModelConstants,
    p: Fields,
    near: Neighbours,
    *,
    role: NeighbourRole,
    motion: NeighbourMotion,
) -> NeighbourColumns:
    """A neighbour's motion and appearance; without a vehicle the appearance is zero."""
    slot = near.slot[role, EGO_SLOT]
    brakes = (pick(state.accel, slot) < -c.stop_lamp_decel) | (pick(state.crashed, slot) > 0)

    def if_detected(values: F32) -> F32:
        return np.where(motion.is_detected, values, np.float32(0.0))

    return NeighbourColumns(
        is_detected=_flag(motion.is_detected),
        gap=motion.gap,
        closing_speed=motion.closing_speed,
        accel=motion.accel,
        lateral_distance=if_detected(near.aside[role, EGO_SLOT]),
        indicator=if_detected(pick(state.indicator, slot)),
        stop_lamp=if_detected(_flag(brakes)),
        length=if_detected(_TWO * near.half_length[role, EGO_SLOT]),
        is_truck=if_detected(pick(p.has_truck_tyres, slot)),
        is_two_wheeler=if_detected(pick(p.two_wheeler, slot)),
    )


def _oncoming_columns(
    state: State, given: StepParameters, p: Fields, vehicle: Oncoming, *, is_true: bool
) -> NeighbourColumns:
    """One oncoming vehicle; a large gap and zeros without one."""
    ego, slot = EGO_SLOT, vehicle.slot[EGO_SLOT]
    speeds, _ = road_velocity(state)
    d = np.stack([seen_from_each(state, given, p, j)[1][ego] for j in range(len(state.s))])
    if is_true:
        is_detected, gap = slot >= 0, vehicle.gap[ego]
        closing_speed, accel = speeds[ego] + pick(speeds, slot), pick(state.a_lon, slot)
    else:
        is_detected, gap = vehicle.detected[ego], vehicle.believed_gap[ego]
        closing_speed, accel = vehicle.closing[ego], np.zeros_like(gap)

    def if_detected(values: F32) -> F32:
        return np.where(is_detected, values, np.float32(0.0))

    return NeighbourColumns(
        is_detected=_flag(is_detected),
        gap=np.where(is_detected, gap, given.constants.unseen_gap),
        closing_speed=if_detected(closing_speed),
        accel=if_detected(accel),
        lateral_distance=if_detected(pick(d, slot) - state.d[ego]),
        indicator=if_detected(-pick(state.indicator, slot)),
        stop_lamp=np.zeros_like(gap),
        length=if_detected(_TWO * vehicle.half_length[ego]),
        is_truck=if_detected(pick(p.has_truck_tyres, slot)),
        is_two_wheeler=if_detected(pick(p.two_wheeler, slot)),
    )


def _passing_columns(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    *,
    oncoming: Oncoming,
) -> PassingColumns:
    """The model driver's knowledge about a pass against oncoming traffic."""
    ego = EGO_SLOT
    plight = weigh(state, given, p, q, moment, ego)
    leader = moment.near.slot[LEAD, ego]
    overtaken = np.where(in_stage(state, ego, Stage.FOLLOW), leader, state.target[ego])
    gap_ahead_of_leader = room_ahead(state, p, leader, ego)
    return PassingColumns(
        sight_distance=oncoming.sight[ego],
        is_certain=_flag(oncoming.sure[ego]),
        expected_closing_speed=usual_closing(state, q)[ego],
        gap_ahead_of_leader=minimum(gap_ahead_of_leader, given.constants.unseen_gap),
        tall_vehicle_gap_factor=room_left(given.constants, p, overtaken),
        line_is_solid=_flag(is_solid(state, given, p, ego, given.constants.line_lookahead)),
        return_urgency=_HALF * plight.hurries + _HALF * plight.pressed,
        abort_state=_HALF * plight.yields + _HALF * (plight.yields & plight.fits),
        can_abort_pass=_flag(can_fall_in(state, given, p, ego)),
    )


def _flag(mask: Mask) -> F32:
    """1 where the mask is true, else 0."""
    return mask.astype(np.float32)
