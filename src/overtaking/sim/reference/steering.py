"""Where in the lane to be, and the wheel angle that gets there."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import atan, clamp, maximum, minimum, sincos
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters, VehicleParameters

_NOW = np.float32(0.0)


def start_path(state: State, moved: Mask, centre: F32, duration: F32) -> None:
    """Lay a quintic from where a vehicle's path is now to the centre of another lane.

    Position, velocity and acceleration are continuous; the path ends at rest sideways.

    Source:
        Werling et al. 2010; Wang, Li and Li 2014 found quintic kernels in measured lane changes.
    """
    (place, speed), accel = path_position(state), path_accel(state)
    t = duration
    rest = centre - place - speed * t - np.float32(0.5) * accel * (t * t)
    lost = -(speed + accel * t)
    bend = -accel
    t2 = t * t
    t3 = t2 * t
    c3 = (
        np.float32(10.0) * rest - np.float32(4.0) * (lost * t) + np.float32(0.5) * (bend * t2)
    ) / t3
    c4 = (np.float32(-15.0) * rest + np.float32(7.0) * (lost * t) - bend * t2) / (t3 * t)
    c5 = (np.float32(6.0) * rest - np.float32(3.0) * (lost * t) + np.float32(0.5) * (bend * t2)) / (
        t3 * t2
    )
    for k, value in enumerate((place, speed, np.float32(0.5) * accel, c3, c4, c5)):
        state.path.coefficients[k] = np.where(moved, value, state.path.coefficients[k])
    state.path.elapsed = np.where(moved, np.float32(0.0), state.path.elapsed)
    state.path.duration = np.where(moved, duration, state.path.duration)
    state.lane_choice.time_since_lane_change = np.where(
        moved, np.float32(0.0), state.lane_choice.time_since_lane_change
    )


def path_position(state: State, ahead: np.float32 = _NOW) -> tuple[F32, F32]:
    """Position and velocity of the lateral path now, or a time `ahead` [s]."""
    t = minimum(state.path.elapsed + ahead, state.path.duration)
    c0, c1, c2, c3, c4, c5 = state.path.coefficients
    two, three, four, five = (np.float32(k) for k in (2.0, 3.0, 4.0, 5.0))
    place = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
    speed = c1 + t * (two * c2 + t * (three * c3 + t * (four * c4 + t * (five * c5))))
    return place, speed


def path_accel(state: State, ahead: F32 | np.float32 = _NOW) -> F32:
    """Acceleration of the lateral path now, or a time `ahead` [s]."""
    t = minimum(state.path.elapsed + ahead, state.path.duration)
    _, _, c2, c3, c4, c5 = state.path.coefficients
    return np.float32(2.0) * c2 + t * (
        np.float32(6.0) * c3 + t * (np.float32(12.0) * c4 + t * (np.float32(20.0) * c5))
    )


def wind_trim(vehicle: VehicleParameters, force: F32, context: F32) -> F32:
    """Wheel angle, or lean, that holds a straight course in a side wind [rad or m/s^2].

    The steady single-track equations with lateral force F and yaw moment M and no yaw rate:
    delta = -K F / m - M (1 / C_f + 1 / C_r) / l with the understeer gradient K.
    """
    pushed = force * vehicle.inverse_mass
    angle = vehicle.understeer * pushed + context * vehicle.moment_angle
    return -np.where(vehicle.two_wheeler > 0, pushed, angle)


def update_wind_trim(state: State, params: StepParameters, step: int) -> None:
    """Answer the side wind after a lag; at the first frame it is held already."""
    vehicles, constants = params.vehicles, params.constants
    target = wind_trim(
        vehicles, state.friction_and_wind.wind_force, state.friction_and_wind.wind_moment
    )
    if step == 0:
        state.controls.wind_trim = target
    state.controls.wind_trim = state.controls.wind_trim + (target - state.controls.wind_trim) * (
        constants.decision / constants.wind_lag
    )


def settle_into_bend(state: State, params: StepParameters) -> None:
    """Drive steadily along the bend at the first frame, as if the vehicle had entered it before.

    The vehicle turns with the road; its tail hangs out by the slip of the rear tyres.

    Source:
        Steady-state cornering of the single-track model (Gillespie 1992, chapter 6).
    """
    vehicles, constants = params.vehicles, params.constants
    rides, v = vehicles.two_wheeler > 0, state.motion.vx
    rate = state.road.curvature * v
    accel = rate * v
    slips = vehicles.cg_rear * rate - v * (accel / (constants.gravity * vehicles.rear_stiffness))
    angle = state.road.curvature * (vehicles.wheelbase + vehicles.understeer * (v * v))
    state.controls.wheel_angle = np.where(rides, accel, angle)
    state.motion.vy = np.where(rides, _NOW, slips)
    state.motion.heading = -atan(state.motion.vy / maximum(v, constants.slip_speed))
    state.motion.yaw_rate, state.motion.accel_lat = rate, accel


def steer(
    state: State,
    params: StepParameters,
    side_accel: F32,
    step_length: np.float32,
    wheel: F32 | None = None,
) -> F32:
    """Turn the front wheels, or lean, towards the path for one step.

    Wheels and leaning answer with a lag, by the linearly implicit step of the motion: to what is
    asked for in the middle of the step, where the last step's accelerations lead.

    Args:
        state: State; its accelerations are those of the last step.
        params: Parameters of the batch.
        side_accel: Largest lateral acceleration that drivers ask for [m/s^2].
        step_length: Length of the step [s].
        wheel: Angle of the ego's front wheels that another driver asks for, (simulation,) [rad].

    Returns:
        Wheel angle, or lean, in the middle of the step.
    """
    vehicles, constants = params.vehicles, params.constants
    half = np.float32(0.5) * step_length
    angle, lean = _requested_steering(state, params, side_accel, half)
    if wheel is not None:
        angle[EGO_SLOT] = clamp(wheel, -constants.steering_limit, constants.steering_limit)
    most = constants.steering_rate * step_length
    turn = clamp(
        (angle - state.controls.wheel_angle) * (step_length / (constants.steering_lag + half)),
        -most,
        most,
    )
    lean = (lean - state.controls.wheel_angle) * (step_length / (constants.two_wheeler_lag + half))
    moved = np.where(vehicles.two_wheeler > 0, lean, turn)
    before = state.controls.wheel_angle
    is_sound = state.motion.is_wreck == 0
    state.controls.wheel_angle = np.where(is_sound, before + moved, np.float32(0.0))
    state.path.elapsed = state.path.elapsed + step_length
    return np.where(is_sound, before + np.float32(0.5) * moved, np.float32(0.0))


def _requested_steering(
    state: State, params: StepParameters, side_accel: F32, ahead: np.float32
) -> tuple[F32, F32]:
    """Wheel angle [rad] and lean [m/s^2] that drivers ask for, a time `ahead` [s].

    The acceleration of the path is asked for as much earlier as the vehicle answers later: by the
    lag of the wheels and the time m v / (C_f + C_r) in which tyres build up the side force.

    Source:
        The side-slip time constant of the single-track model (Gillespie 1992, chapter 6).
    """
    vehicles, constants = params.vehicles, params.constants
    place, speed = path_position(state, ahead)
    turns_late = constants.steering_lag + vehicles.side_lag * state.motion.vx
    late = np.where(vehicles.two_wheeler > 0, constants.two_wheeler_lag, turns_late)
    accel = path_accel(state, ahead + late)
    sine, cosine = sincos(state.motion.heading)
    sideways = state.motion.vx * sine + state.motion.vy * cosine
    d = state.motion.d + ahead * sideways
    sideways = sideways + ahead * (state.motion.accel_lon * sine + state.motion.accel_lat * cosine)
    vx = state.motion.vx + ahead * state.motion.accel_lon
    vy = state.motion.vy + ahead * (
        state.motion.accel_lat - state.motion.vx * state.motion.yaw_rate
    )
    r = state.motion.yaw_rate + ahead * state.motion.yaw_accel
    wanted = accel + constants.velocity_gain * (speed - sideways)
    wanted = wanted + constants.position_gain * (
        place + constants.lane_deviation * state.noise.lane_wander - d
    )
    wanted = clamp(wanted, -side_accel, side_accel) + state.road.curvature_ahead * (vx * vx)
    inverse_speed = np.float32(1.0) / maximum(vx, constants.slip_speed)
    felt = wanted + constants.yaw_gain * (wanted - vx * r)
    angle = (
        felt * (vehicles.wheelbase * (inverse_speed * inverse_speed) + vehicles.understeer)
        + state.controls.wind_trim
    )
    # Beyond this slip more angle gives no more force; a sliding vehicle is steered into the slide.
    slip = (vy + vehicles.cg_front * r) * inverse_speed
    reach = (
        constants.slip_share
        * np.float32(0.5)
        * (state.friction_and_wind.mu_left + state.friction_and_wind.mu_right)
        / vehicles.front_stiffness
    )
    angle = clamp(
        clamp(angle, slip - reach, slip + reach),
        -constants.steering_limit,
        constants.steering_limit,
    )
    return angle, wanted + state.controls.wind_trim
