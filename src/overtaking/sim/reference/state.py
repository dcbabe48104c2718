"""The state of a batch between two steps, and named access to its parameters."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import sincos
from overtaking.model.trajectories import Stage
from overtaking.world.step_parameters import StepParameters

HISTORY_LENGTH = 64
"""Decisions whose kinematics are remembered; longer than any reaction time."""


NEVER_LOOKED = np.float32(-2.0)
"""In `State.seen_id` before the first decision: nothing was looked at yet."""


LEADER, FOLLOWER, LEFT_LEADER, LEFT_FOLLOWER, RIGHT_LEADER, RIGHT_FOLLOWER = range(6)
"""Neighbours of a vehicle: in its lane, in the next lane to the fast side, and to the slow side."""


ONCOMING_ROLE = 6
"""Who comes the other way, among the roles of a decision that is written down."""


NO_SLOT = np.float32(-1.0)
"""Slot of a neighbour, a target or a partner that does not exist."""


# Before the first decision: no lane change holds anyone back, and on friction nothing depends yet.
_LONG_AGO = np.float32(10.0)


_ANY_FRICTION = np.float32(0.8)


_ANY_SPEED = np.float32(1e9)


_ANY_SIGHT = np.float32(1e9)


NO_ACCEL_LIMIT = np.float32(1e9)
"""In `State.most_accel` where no lower limit comes [m/s^2]."""


SlotSelection = int | slice
"""Of which vehicles arrays tell: (simulation,) of one slot, (vehicle, simulation) of several."""


@dataclass(slots=True, kw_only=True)
class State:
    """Everything that changes. Arrays are (vehicle, simulation), or (simulation,) for the ego.

    Attributes:
        s, d: Position of the centre; `d` grows towards the fast side [m].
        psi: Heading relative to the road, positive towards the fast side [rad].
        vx, vy: Velocity in the vehicle's axes [m/s].
        r: Yaw rate; of a two-wheeler, in the middle of the last step [rad/s].
        wheel: Front wheel angle, or the lateral acceleration of a two-wheeler [rad or m/s^2].
        trim: Part of the wheel angle, or of the lean, that holds against the wind [rad or m/s^2].
        accel: Acceleration asked of the vehicle [m/s^2].
        a_lon, a_lat: Mean acceleration by tyre and wind forces in the vehicle's axes over the last
            step [m/s^2].
        yaw_accel: Mean yaw acceleration over the last step [rad/s^2].
        crashed: 1 after a collision.
        path: Six coefficients of the lateral path, (6, vehicle, simulation).
        path_time: Time since the lane change began [s].
        path_duration: Its duration [s].
        lane: Lane driven in, or being changed to.
        since_change: Time since the last lane change was decided [s].
        indicator: +1 towards the fast side, -1 towards the slow side, 0 off.
        wanted: Side of the lane change that a driver has in mind, as `indicator`.
        wanted_time: Since when, of the other vehicles [s].
        checks: 1 if the driver looks over the shoulder before the next lane change.
        gust, distance_error, speed_error, wander: Ornstein-Uhlenbeck processes of unit variance.
        mu_fast, mu_slow: Friction under the wheels of either side.
        wind_force, wind_moment: Side force [N] and yaw moment [N m].
        tail_wind: Wind along the axis [m/s].
        seen_id, seen_time: Neighbour in each role, `UNKNOWN` at first, and for how long it has been
            in view, (6, vehicle, simulation).
        contact_partner, contact_time, contact_impulse, contact_speed: First collision.
        stage: Of an overtake; that of the others is `FOLLOW` on roads of one direction.
        target: Slot of the vehicle that is being overtaken.
        waited: Time spent waiting behind a slower leader [s].
        signalled: Time that the indicator has been on for the next manoeuvre [s].
        stage_time: Time in the current stage [s].
        attempted: 1 once the ego has begun an overtake.
        end_step: Last step of the simulation.
        num_percepts: Decisions written down.
        oncoming_id, oncoming_time: Oncoming vehicle in view, in any lane and in the own one,
            `UNKNOWN` at first, `NOBODY` for none, and for how long it has been that,
            (2, vehicle, simulation).
        aside: How far to the edge a driver moves within the lane for another [m].
        flashes: 1 while a driver flashes at who comes in its lane.
        yields: 1 while a driver falls back, who would not be past before an oncomer is there.
        hurries: 1 while a driver is short of time to be past.
        curve: Curvature of the way that a vehicle drives on, positive towards the fast side [1/m].
        curve_ahead: The same where the vehicle answers its steering [1/m].
        stretch: Way along the reference line for each metre that it drives on there.
        slope: Sine of the slope, positive uphill.
        bend_speed: Speed that drivers choose for the bends ahead [m/s].
        most_accel: Acceleration that drivers do not go beyond on the way to a lower limit [m/s^2].
        shown: How far the road lets its drivers see [m].
        history_s, history_v: Position and speed along the road at the last decisions,
            (HISTORY, vehicle, simulation).
    """

    s: F32
    d: F32
    psi: F32
    vx: F32
    vy: F32
    r: F32
    wheel: F32
    trim: F32
    accel: F32
    a_lon: F32
    a_lat: F32
    yaw_accel: F32
    crashed: F32
    path: F32
    path_time: F32
    path_duration: F32
    lane: F32
    since_change: F32
    indicator: F32
    wanted: F32
    wanted_time: F32
    checks: F32
    gust: F32
    distance_error: F32
    speed_error: F32
    wander: F32
    mu_fast: F32
    mu_slow: F32
    wind_force: F32
    wind_moment: F32
    tail_wind: F32
    seen_id: F32
    seen_time: F32
    contact_partner: F32
    contact_time: F32
    contact_impulse: F32
    contact_speed: F32
    stage: F32
    target: F32
    waited: F32
    signalled: F32
    stage_time: F32
    attempted: F32
    end_step: F32
    num_percepts: F32
    oncoming_id: F32
    oncoming_time: F32
    aside: F32
    flashes: F32
    yields: F32
    hurries: F32
    curve: F32
    curve_ahead: F32
    stretch: F32
    slope: F32
    bend_speed: F32
    most_accel: F32
    shown: F32
    history_s: F32
    history_v: F32


def initial_state(params: StepParameters) -> State:
    """The state at the first frame: all vehicles drive straight in lane at constant speed."""
    vehicles, simulations = params.vehicles, params.simulations
    zero = np.zeros_like(vehicles.start_s)
    ego = np.zeros_like(simulations.last_step)
    path = np.zeros((6, *zero.shape), np.float32)
    path[0] = vehicles.start_d
    return State(
        s=vehicles.start_s.copy(),
        d=vehicles.start_d.copy(),
        psi=zero.copy(),
        vx=vehicles.start_speed.copy(),
        vy=zero.copy(),
        r=zero.copy(),
        wheel=zero.copy(),
        trim=zero.copy(),
        accel=zero.copy(),
        a_lon=zero.copy(),
        a_lat=zero.copy(),
        yaw_accel=zero.copy(),
        crashed=zero.copy(),
        path=path,
        path_time=zero + 1.0,
        path_duration=zero + 1.0,
        lane=vehicles.start_lane.copy(),
        since_change=zero + _LONG_AGO,
        indicator=zero.copy(),
        wanted=zero.copy(),
        wanted_time=zero.copy(),
        checks=zero.copy(),
        gust=zero.copy(),
        distance_error=zero.copy(),
        speed_error=zero.copy(),
        wander=zero.copy(),
        mu_fast=zero + _ANY_FRICTION,
        mu_slow=zero + _ANY_FRICTION,
        wind_force=zero.copy(),
        wind_moment=zero.copy(),
        tail_wind=zero.copy(),
        seen_id=np.full((6, *zero.shape), NEVER_LOOKED),
        seen_time=np.zeros((6, *zero.shape), np.float32),
        contact_partner=zero + NO_SLOT,
        contact_time=zero.copy(),
        contact_impulse=zero.copy(),
        contact_speed=zero.copy(),
        stage=zero + np.float32(Stage.FOLLOW),
        target=zero + NO_SLOT,
        waited=zero.copy(),
        signalled=zero.copy(),
        stage_time=zero.copy(),
        attempted=ego.copy(),
        end_step=simulations.last_step.copy(),
        num_percepts=ego.copy(),
        oncoming_id=np.full((2, *zero.shape), NEVER_LOOKED),
        oncoming_time=np.zeros((2, *zero.shape), np.float32),
        aside=zero.copy(),
        flashes=zero.copy(),
        yields=zero.copy(),
        hurries=zero.copy(),
        curve=zero.copy(),
        curve_ahead=zero.copy(),
        stretch=zero + np.float32(1.0),
        slope=zero.copy(),
        bend_speed=zero + _ANY_SPEED,
        most_accel=zero + NO_ACCEL_LIMIT,
        shown=zero + _ANY_SIGHT,
        history_s=np.zeros((HISTORY_LENGTH, *zero.shape), np.float32),
        history_v=np.zeros((HISTORY_LENGTH, *zero.shape), np.float32),
    )


def value_at_slot(values: F32, slot: F32) -> F32:
    """The value of vehicle `slot` in each simulation; slot 0's without a vehicle.

    Args:
        values: Shape (vehicle, simulation).
        slot: Vehicle slots as whole numbers, or `NOBODY`, shape (..., simulation).
    """
    index = np.where(slot < 0, np.float32(0.0), slot).astype(np.int64)
    return values[index, np.arange(values.shape[1])]


def position_seen_by_each(state: State, params: StepParameters, j: int) -> tuple[F32, F32]:
    """Where vehicle `j` is in the frame of each vehicle, (vehicle, simulation) [m].

    Everybody has a frame of its own direction: that of oncoming vehicles is turned by half a turn.
    """
    vehicles = params.vehicles
    road, turned = params.road, vehicles.travel_sign[j] != vehicles.travel_sign
    along = np.where(turned, road.length - state.s[j], state.s[j])
    return along, np.where(turned, road.edge_sum - state.d[j], state.d[j])


def road_position(state: State, params: StepParameters) -> tuple[F32, F32]:
    """Where each vehicle is in the frame of the road [m]."""
    vehicles = params.vehicles
    road, turned = params.road, vehicles.travel_sign < 0
    along = np.where(turned, road.length - state.s, state.s)
    return along, np.where(turned, road.edge_sum - state.d, state.d)


def road_velocity(state: State) -> tuple[F32, F32]:
    """Velocity along and across the road [m/s]."""
    sine, cosine = sincos(state.psi)
    return state.vx * cosine - state.vy * sine, state.vx * sine + state.vy * cosine


def is_overtaking(state: State) -> Mask:
    """Who is overtaking, or on the way back from there, (vehicle, simulation)."""
    stage = state.stage
    away = (stage != np.float32(Stage.FOLLOW)) & (stage != np.float32(Stage.DONE))
    return away & (state.crashed == 0)


def is_before_return(state: State, slots: SlotSelection) -> Mask:
    """Whether drivers are on their way past another."""
    return is_in_stage(state, slots, Stage.PULL_OUT) | is_in_stage(state, slots, Stage.PASS)


def is_in_stage(state: State, slots: SlotSelection, stage: Stage) -> Mask:
    """Whether drivers are sound and in a stage."""
    return (state.crashed[slots] == 0) & (state.stage[slots] == np.float32(stage))


def has_finished_lane_change(state: State, slots: SlotSelection) -> Mask:
    """Whether the last lane change is over."""
    return state.path_time[slots] >= state.path_duration[slots]
