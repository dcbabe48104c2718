"""Lateral path of a lane change, and the wheel angle that follows it.

Lateral positions `d`, angles and forces are positive to the left, the overtaking side. The *lean*
of a two-wheeler is stated as the lateral acceleration that it balances, and takes the place of the
wheel angle. Drivers decide every 0.05 s; a *step* of the motion lasts as long or less.
"""

from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, TWO, ZERO, atan, clamp, maximum, minimum, sincos
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters, VehicleParameters


class PathPoint(NamedTuple):
    """Points of the lateral paths of lane changes, (vehicle, simulation)."""

    d: F32  # Lateral position [m].
    velocity: F32  # Velocity across the road [m/s].


def start_path(state: State, starts: Mask, end_d: F32, duration: F32) -> None:
    """Start a quintic path from the present path to another lateral position.

    Position, velocity and acceleration are continuous; at the end velocity and acceleration are 0.

    Args:
        state: Its `path` and the time since the last lane change are changed.
        starts: Whether the vehicle starts a path, (vehicle, simulation).
        end_d: Lateral position at the end [m].
        duration: Duration of the path [s].

    Source:
        Werling et al. 2010; Wang, Li and Li 2014 found quintic kernels in measured lane changes.
    """
    (d, velocity), accel = path_point(state), path_accel(state)  # Of the present path.
    t = duration
    # The terms of third to fifth order must bring about these changes by the end of the path.
    d_change = end_d - d - velocity * t - HALF * accel * (t * t)
    velocity_change = -(velocity + accel * t)
    accel_change = -accel
    t2 = t * t
    t3 = t2 * t
    c3 = (
        np.float32(10.0) * d_change
        - np.float32(4.0) * (velocity_change * t)
        + HALF * (accel_change * t2)
    ) / t3
    c4 = (
        np.float32(-15.0) * d_change + np.float32(7.0) * (velocity_change * t) - accel_change * t2
    ) / (t3 * t)
    c5 = (
        np.float32(6.0) * d_change
        - np.float32(3.0) * (velocity_change * t)
        + HALF * (accel_change * t2)
    ) / (t3 * t2)
    path, choice = state.path, state.lane_choice
    for k, coefficient in enumerate((d, velocity, HALF * accel, c3, c4, c5)):
        path.coefficients[k] = np.where(starts, coefficient, path.coefficients[k])
    path.elapsed = np.where(starts, ZERO, path.elapsed)
    path.duration = np.where(starts, duration, path.duration)
    choice.time_since_lane_change = np.where(starts, ZERO, choice.time_since_lane_change)


def path_point(state: State, lookahead: np.float32 = ZERO) -> PathPoint:
    """The point of the lateral path that each vehicle reaches in `lookahead` seconds."""
    t = minimum(state.path.elapsed + lookahead, state.path.duration)
    c0, c1, c2, c3, c4, c5 = state.path.coefficients
    three, four, five = (np.float32(k) for k in (3.0, 4.0, 5.0))
    d = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
    velocity = c1 + t * (TWO * c2 + t * (three * c3 + t * (four * c4 + t * (five * c5))))
    return PathPoint(d, velocity)


def path_accel(state: State, lookahead: F32 | np.float32 = ZERO) -> F32:
    """Acceleration of the lateral path now, or `lookahead` seconds ahead [m/s^2]."""
    t = minimum(state.path.elapsed + lookahead, state.path.duration)
    _, _, c2, c3, c4, c5 = state.path.coefficients
    return TWO * c2 + t * (
        np.float32(6.0) * c3 + t * (np.float32(12.0) * c4 + t * (np.float32(20.0) * c5))
    )


def wind_trim(vehicle: VehicleParameters, force: F32, moment: F32) -> F32:
    """Wheel angle [rad], or lean [m/s^2], that holds a straight course in a side wind.

    The steady single-track equations with lateral force F and yaw moment M and no yaw rate:
    delta = -K F / m - M (1 / C_f + 1 / C_r) / l with the understeer gradient K, the cornering
    stiffnesses C and the wheelbase l. The factor of M is `vehicle.moment_angle`.

    Args:
        vehicle: Parameters of the vehicles.
        force: Lateral force of the wind [N].
        moment: Its yaw moment [N m].
    """
    wind_accel = force * vehicle.inverse_mass
    angle = vehicle.understeer * wind_accel + moment * vehicle.moment_angle
    return -np.where(vehicle.two_wheeler > 0, wind_accel, angle)


def update_wind_trim(state: State, params: StepParameters, step: int) -> None:
    """Let drivers follow the side wind with a lag, once for each decision.

    At the first frame, `step` 0, they hold against the wind already.
    """
    wind, constants, controls = state.friction_and_wind, params.constants, state.controls
    target = wind_trim(params.vehicles, wind.wind_force, wind.wind_moment)
    if step == 0:
        controls.wind_trim = target
    # The share of the difference that drivers correct in `decision`, the time until the next one.
    lag_share = constants.decision / constants.wind_lag
    controls.wind_trim = controls.wind_trim + (target - controls.wind_trim) * lag_share


def settle_into_bend(state: State, params: StepParameters) -> None:
    """Let vehicles drive steadily along the bend at the first frame, as if they had entered before.

    A vehicle turns with the road. Its rear points outwards by the slip of the rear tyres, whose
    stiffness is stated per load.

    Source:
        Steady-state cornering of the single-track model (Gillespie 1992, chapter 6).
    """
    vehicles, constants, motion = params.vehicles, params.constants, state.motion
    is_two_wheeler, v = vehicles.two_wheeler > 0, motion.vx
    yaw_rate = state.road.curvature * v
    accel_lat = yaw_rate * v
    rear_slip = accel_lat / (constants.gravity * vehicles.rear_stiffness)
    vy = vehicles.cg_rear * yaw_rate - v * rear_slip
    angle = state.road.curvature * (vehicles.wheelbase + vehicles.understeer * (v * v))
    state.controls.wheel_angle = np.where(is_two_wheeler, accel_lat, angle)
    motion.vy = np.where(is_two_wheeler, ZERO, vy)
    # The centre moves along the road. `slip_speed` is the least divisor in place of a speed.
    motion.heading = -atan(motion.vy / maximum(v, constants.slip_speed))
    motion.yaw_rate, motion.accel_lat = yaw_rate, accel_lat


def steer(
    state: State,
    params: StepParameters,
    max_accel_lat: F32,
    step_length: np.float32,
    ego_wheel_angle: F32 | None = None,
) -> F32:
    """Turn the front wheels, or lean, towards the path for one step.

    Wheels and lean follow the driver's request with a lag. The request refers to the middle of the
    step, predicted by the accelerations of the last step, as in the linearly implicit step of
    `vehicle_dynamics`.

    Args:
        state: State with the accelerations of the last step; it changes.
        params: Parameters of the batch.
        max_accel_lat: Largest lateral acceleration that drivers request [m/s^2].
        step_length: Length of the step [s].
        ego_wheel_angle: Wheel angle by an external driver of the ego, (simulation,) [rad]; None if
            the model's driver steers.

    Returns:
        Wheel angle [rad], or lean [m/s^2], in the middle of the step.
    """
    constants, controls = params.constants, state.controls
    half_step = HALF * step_length
    angle, lean = _requested_steering(state, params, max_accel_lat, half_step)
    if ego_wheel_angle is not None:
        limit = constants.steering_limit
        angle[EGO_SLOT] = clamp(ego_wheel_angle, -limit, limit)
    # First-order lags, integrated by the trapezoidal rule; the wheels also have a largest rate.
    max_turn = constants.steering_rate * step_length
    turn = (angle - controls.wheel_angle) * (step_length / (constants.steering_lag + half_step))
    turn = clamp(turn, -max_turn, max_turn)
    lean_change = (lean - controls.wheel_angle) * (
        step_length / (constants.two_wheeler_lag + half_step)
    )
    change = np.where(params.vehicles.two_wheeler > 0, lean_change, turn)
    # A wreck slides whatever the angle of its wheels, so its angle is 0.
    is_sound = state.motion.is_wreck == 0
    start_angle = controls.wheel_angle
    controls.wheel_angle = np.where(is_sound, start_angle + change, ZERO)
    state.path.elapsed = state.path.elapsed + step_length
    return np.where(is_sound, start_angle + HALF * change, ZERO)


def _requested_steering(
    state: State, params: StepParameters, max_accel_lat: F32, lookahead: np.float32
) -> tuple[F32, F32]:
    """Wheel angle [rad] and lean [m/s^2] that drivers request `lookahead` seconds ahead.

    A vehicle follows its steering late: by the lag of the wheels and the time m v / (C_f + C_r) in
    which its tyres build up the side force. Drivers therefore request the acceleration of the path
    earlier by this time.

    Source:
        The side-slip time constant of the single-track model (Gillespie 1992, chapter 6).
    """
    vehicles, constants, motion = params.vehicles, params.constants, state.motion
    path = path_point(state, lookahead)
    car_lag = constants.steering_lag + vehicles.side_lag * motion.vx
    lag = np.where(vehicles.two_wheeler > 0, constants.two_wheeler_lag, car_lag)
    feedforward = path_accel(state, lookahead + lag)

    # State after the lookahead of half a step, by the accelerations of the last step. They are
    # forces over the mass, in the vehicle's axes. The turning of these axes changes `vy` as well;
    # its effect on `vx`, and the turning of the road in a bend, are neglected.
    sine, cosine = sincos(motion.heading)
    velocity_d_now = motion.vx * sine + motion.vy * cosine
    d = motion.d + lookahead * velocity_d_now
    velocity_d = velocity_d_now + lookahead * (motion.accel_lon * sine + motion.accel_lat * cosine)
    vx = motion.vx + lookahead * motion.accel_lon
    vy = motion.vy + lookahead * (motion.accel_lat - motion.vx * motion.yaw_rate)
    yaw_rate = motion.yaw_rate + lookahead * motion.yaw_accel

    # Error of the driver's aim [m]: a standard deviation times a process of unit variance.
    wander = constants.lane_deviation * state.noise.lane_wander
    accel = feedforward + constants.velocity_gain * (path.velocity - velocity_d)
    accel = accel + constants.position_gain * (path.d + wander - d)
    # The limit holds for moves within the road; drivers follow its bends in any case.
    # `curvature_ahead` is the curvature where the vehicle will be when it responds.
    accel = clamp(accel, -max_accel_lat, max_accel_lat) + state.road.curvature_ahead * (vx * vx)
    inverse_speed = ONE / maximum(vx, constants.slip_speed)
    # Feedback of the yaw rate damps the steering; without it, trucks weave.
    damped_accel = accel + constants.yaw_gain * (accel - vx * yaw_rate)
    angle_per_accel = vehicles.wheelbase * (inverse_speed * inverse_speed) + vehicles.understeer
    angle = damped_accel * angle_per_accel + state.controls.wind_trim

    # Beyond the slip angle `reach` a larger wheel angle gives hardly more side force (with a
    # `slip_share` of 3 the tyre would slide); so drivers steer a sliding vehicle into the slide.
    slip = (vy + vehicles.cg_front * yaw_rate) * inverse_speed
    friction = state.friction_and_wind
    reach = (
        constants.slip_share
        * HALF
        * (friction.mu_left + friction.mu_right)
        / vehicles.front_stiffness
    )
    limit = constants.steering_limit
    angle = clamp(clamp(angle, slip - reach, slip + reach), -limit, limit)
    # Two-wheelers have no tyre slip in this model, so `max_accel_lat` alone limits their lean.
    return angle, accel + state.controls.wind_trim
