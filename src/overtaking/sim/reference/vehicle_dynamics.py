"""Motion over one step: single-track with Fiala tyres, point mass on two wheels, wreck.

Beside a step of 50 ms the sideways motion on four wheels is quick, and stiff at low speed. So side
speed and yaw rate are advanced together by a linearly implicit step: forces and their slopes once,
two linear equations solved once. The derivation is in docs/explanation/model.md.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import clamp, maximum, minimum, sincos
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters

_ONE = np.float32(1.0)


_ZERO = np.float32(0.0)


_HALF = np.float32(0.5)


_MIN_SLIDING_SPEED = np.float32(1e-3)  # Keeps the direction of a wreck at rest finite [m/s].


_MIN_LATERAL_GRIP = np.float32(1.0)  # Left sideways by full braking, squared, to divide by [N^2].


@dataclass(slots=True, kw_only=True)
class Axle:
    """Loads and forces of one axle; arrays of shape (vehicle, simulation).

    Attributes:
        load: Load [N].
        force_lon: Longitudinal force [N].
        force_difference: That of the slow side minus that of the fast side [N].
        max_lateral_force: Largest lateral force [N].
    """

    load: F32
    force_lon: F32
    force_difference: F32
    max_lateral_force: F32


@dataclass(slots=True, kw_only=True)
class MotionStep:
    """What a step comes to; arrays of shape (vehicle, simulation).

    Attributes:
        accel_lon, accel_lat: Mean acceleration by tyre and wind forces, in the vehicle's axes
            [m/s^2].
        vx, vy, yaw_rate: Velocity and yaw rate at its end.
        mean_yaw_rate: Mean yaw rate [rad/s].
    """

    accel_lon: F32
    accel_lat: F32
    vx: F32
    vy: F32
    yaw_rate: F32
    mean_yaw_rate: F32


def fiala_force(stiffness: F32, across: F32, along: F32, limit: F32) -> tuple[F32, F32]:
    """Lateral force of an axle [N], against the slip, and how fast it grows with the slip [N].

    Args:
        stiffness: Cornering stiffness of the axle [N/rad].
        across: Velocity of its wheels across their planes, of any unit.
        along: The same along them, > 0.
        limit: Largest lateral force, > 0 [N].

    Source:
        Fiala 1954; the brush form in Pacejka, Tyre and Vehicle Dynamics (2012), section 3.2: of the
        contact patch the share `sticks`, the rest slides.
    """
    z = stiffness * across / (np.float32(3.0) * limit * along)
    sticks = maximum(_ONE - np.abs(z), _ZERO)
    size = limit * (_ONE - sticks * sticks * sticks)
    return np.where(z < 0, size, -size), stiffness * (sticks * sticks)


def requested_force(
    params: StepParameters,
    accel: F32,
    resistance: F32,
    speed: F32,
    inverse_speed: F32,
) -> F32:
    """Force asked of the tyres for an acceleration, within engine, governor and brakes [N]."""
    vehicles, constants = params.vehicles, params.constants
    wanted = vehicles.mass * accel + resistance
    engine = minimum(vehicles.launch_force, vehicles.power * inverse_speed)
    left = (vehicles.max_speed + constants.governor_band - speed) * (_ONE / constants.governor_band)
    throttle = clamp(left, _ZERO, _ONE)
    return maximum(minimum(wanted, engine * throttle), -vehicles.max_brake_force)


def axle_forces(params: StepParameters, state: State, force: F32, load: F32) -> Axle:
    """Forces of one axle under a load [N] that is asked for a longitudinal force [N].

    Each side transmits what its own friction allows, which turns the vehicle on split friction. Of
    that, traction control lets the engine have less than anti-lock brakes let the brakes have:
    driven wheels that use all of it would have none left to keep the vehicle on its course.

    """
    vehicles, constants = params.vehicles, params.constants
    half_load = _HALF * load
    controlled = (force > 0) & (vehicles.two_wheeler == 0)
    share = np.where(controlled, constants.traction_share, constants.abs_share)
    bound_fast = share * state.friction_and_wind.mu_left * half_load
    bound_slow = share * state.friction_and_wind.mu_right * half_load
    fast = clamp(_HALF * force, -bound_fast, bound_fast)
    slow = clamp(_HALF * force, -bound_slow, bound_slow)
    total = fast + slow
    grip = (state.friction_and_wind.mu_left + state.friction_and_wind.mu_right) * half_load
    left = maximum(grip * grip - total * total, _MIN_LATERAL_GRIP)
    return Axle(
        load=load, force_lon=total, force_difference=slow - fast, max_lateral_force=np.sqrt(left)
    )


def advance_motion(
    state: State, params: StepParameters, angle: F32, step_length: np.float32
) -> None:
    """Advance every vehicle by one step: new velocity first, then the position by the trapezoid.

    Args:
        state: State; its acceleration is that of the last step.
        params: Parameters of the batch.
        angle: Front wheel angle, or lean of a two-wheeler, in the middle of the step.
        step_length: Length of the step [s].
    """
    vehicles, constants = params.vehicles, params.constants
    wrecked = state.motion.is_wreck > 0
    speed = maximum(state.motion.vx + _HALF * step_length * state.motion.accel_lon, _ZERO)
    inverse_speed = _ONE / maximum(speed, constants.slip_speed)
    air = speed - state.friction_and_wind.tail_wind
    held_back = vehicles.drag * air * np.abs(air) + vehicles.rolling
    resistance = held_back + constants.gravity * vehicles.mass * state.road.sin_slope
    force = requested_force(
        params, state.controls.requested_accel, resistance, speed, inverse_speed
    )
    front, rear = _axles(state, params, force, held_back, angle)
    drives = _single_track_step(
        state, params, (front, rear), resistance, (speed, inverse_speed), angle, step_length
    )
    straight = (front.force_lon + rear.force_lon - resistance) * vehicles.inverse_mass
    leans = _leaning_step(state, params, straight, inverse_speed, angle, step_length)
    motion = _select(vehicles.two_wheeler > 0, leans, drives)
    motion.vx = maximum(motion.vx, _ZERO)
    _stop_when_creeping(state, params, motion)
    _update_position(state, params, motion, wrecked, step_length)


def _axles(
    state: State, params: StepParameters, force: F32, resistance: F32, angle: F32
) -> tuple[Axle, Axle]:
    """Loads and forces of the front and the rear axle.

    Loads follow the acceleration of this step, as far as it is known before the forces are: what
    the pedals ask for and friction allows under the loads of the last step, less what the turned
    wheels hold back of the side force, which is that of the last step.

    Source:
        The single-track model with load transfer of Althoff, Koschi and Manzinger (CommonRoad).
    """
    vehicles, constants = params.vehicles, params.constants
    rides = vehicles.two_wheeler > 0
    weight = _front_load_share(params, state.motion.accel_lon)
    share = np.where(force < 0, weight, vehicles.front_drive)
    limit = np.where(
        (force > 0) & ~rides, constants.traction_share, constants.abs_share
    ) * _max_friction_accel(state, params)
    asked = force * vehicles.inverse_mass
    front, rear = limit * weight, limit * (_ONE - weight)
    asked = clamp(share * asked, -front, front) + clamp((_ONE - share) * asked, -rear, rear)
    held = np.where(rides, _ZERO, state.motion.accel_lat * weight * angle)
    weight = _front_load_share(params, asked - resistance * vehicles.inverse_mass - held)
    # Brakes follow the load, so that no axle locks before the other (UN R13-H asks for it).
    share = np.where(force < 0, weight, vehicles.front_drive)
    whole = constants.gravity * vehicles.mass
    return (
        axle_forces(params, state, share * force, whole * weight),
        axle_forces(params, state, (_ONE - share) * force, whole * (_ONE - weight)),
    )


def _front_load_share(params: StepParameters, accel: F32) -> F32:
    """Share of the load on the front axle at an acceleration, 0 to 1.

    It is never negative: an axle can leave the road, but not pull at it.
    """
    vehicles, constants = params.vehicles, params.constants
    lifted = accel * vehicles.cg_height * (_ONE / constants.gravity)
    return vehicles.inverse_wheelbase * (
        vehicles.cg_rear - clamp(lifted, -vehicles.cg_front, vehicles.cg_rear)
    )


def _max_friction_accel(state: State, params: StepParameters) -> F32:
    """Largest acceleration that friction allows [m/s^2]."""
    constants = params.constants
    return (
        constants.gravity
        * _HALF
        * (state.friction_and_wind.mu_left + state.friction_and_wind.mu_right)
    )


def _single_track_step(
    state: State,
    params: StepParameters,
    axles: tuple[Axle, Axle],
    resistance: F32,
    speeds: tuple[F32, F32],
    angle: F32,
    step_length: np.float32,
) -> MotionStep:
    """A step of the single-track model; side speed and yaw rate by the linearised equations.

    Source:
        Hairer and Wanner, Solving Ordinary Differential Equations II (1996), section IV.7: the
        Rosenbrock method of one stage with gamma = 1/2.
    """
    vehicles = params.vehicles
    (front, rear), (speed, inverse_speed) = axles, speeds
    half = _HALF * step_length
    sine, cosine = sincos(angle)
    u = (state.motion.vy + vehicles.cg_front * state.motion.yaw_rate) * inverse_speed
    front_y, front_k = fiala_force(
        vehicles.front_stiffness * front.load,
        u * cosine - sine,
        cosine + u * sine,
        front.max_lateral_force,
    )
    u = (state.motion.vy - vehicles.cg_rear * state.motion.yaw_rate) * inverse_speed
    rear_y, rear_k = fiala_force(
        vehicles.rear_stiffness * rear.load, u, np.ones_like(u), rear.max_lateral_force
    )
    front_k, rear_k = front_k * inverse_speed, rear_k * inverse_speed
    side = front_y * cosine + front.force_lon * sine
    context = vehicles.half_track * (front.force_difference + rear.force_difference)
    across = (
        side + rear_y + state.friction_and_wind.wind_force
    ) * vehicles.inverse_mass - speed * state.motion.yaw_rate
    context = context + _stability_control(state, params, speed, angle)
    turn = (
        vehicles.cg_front * side
        - vehicles.cg_rear * rear_y
        + state.friction_and_wind.wind_moment
        + context
    )
    turn = turn * vehicles.inverse_inertia
    ahead, behind = vehicles.cg_front * (front_k * cosine), vehicles.cg_rear * rear_k
    by_mass, by_inertia = half * vehicles.inverse_mass, half * vehicles.inverse_inertia
    a11 = _ONE + by_mass * (front_k * cosine + rear_k)
    a12 = by_mass * (ahead - behind) + half * speed
    a21 = by_inertia * (ahead - behind)
    a22 = _ONE + by_inertia * (vehicles.cg_front * ahead + vehicles.cg_rear * behind)
    share = step_length / (a11 * a22 - a12 * a21)
    more_vy = share * (a22 * across - a12 * turn)
    more_r = share * (a11 * turn - a21 * across)
    r = state.motion.yaw_rate + _HALF * more_r
    middle_y = front_y - front_k * (_HALF * (more_vy + vehicles.cg_front * more_r))
    along = front.force_lon * cosine - middle_y * sine + rear.force_lon - resistance
    a_lon = along * vehicles.inverse_mass
    return MotionStep(
        accel_lon=a_lon,
        accel_lat=more_vy * (_ONE / step_length) + speed * r,
        vx=state.motion.vx + step_length * (a_lon + (state.motion.vy + _HALF * more_vy) * r),
        vy=state.motion.vy + more_vy,
        yaw_rate=state.motion.yaw_rate + more_r,
        mean_yaw_rate=r,
    )


def _stability_control(state: State, params: StepParameters, speed: F32, angle: F32) -> F32:
    """Yaw moment of stability control, which brakes single wheels [N m].

    It answers a yaw rate that is off, by more than a threshold, from what the wheel angle asks for
    and friction allows, with at most the braking force of one wheel. What that takes from the speed
    is left out.

    Source:
        van Zanten, Erhardt and Pfaff 1995 (control of the yaw rate by the single-track model).
    """
    vehicles, constants = params.vehicles, params.constants
    grip = _max_friction_accel(state, params)
    reach = grip / maximum(speed, constants.slip_speed)
    asked = speed * angle / (vehicles.wheelbase + vehicles.understeer * (speed * speed))
    off = state.motion.yaw_rate - clamp(asked, -reach, reach)
    off = off - clamp(off, -constants.stability_threshold, constants.stability_threshold)
    most = np.float32(0.25) * grip * vehicles.mass * vehicles.half_track
    return clamp(-off * (_ONE / constants.stability_time) / vehicles.inverse_inertia, -most, most)


def _leaning_step(
    state: State,
    params: StepParameters,
    a_lon: F32,
    inverse_speed: F32,
    angle: F32,
    step_length: np.float32,
) -> MotionStep:
    """A step of a point mass that leans as far as its driver and the wind ask, and grip allows.

    It turns at once as it leans, so its yaw rate is that of the middle of the step.
    """
    vehicles = params.vehicles
    grip = _max_friction_accel(state, params)
    lean = clamp(angle + state.friction_and_wind.wind_force * vehicles.inverse_mass, -grip, grip)
    vx = state.motion.vx + step_length * a_lon
    r = lean * inverse_speed
    return MotionStep(
        accel_lon=a_lon, accel_lat=lean, vx=vx, vy=np.zeros_like(vx), yaw_rate=r, mean_yaw_rate=r
    )


def _select(mask: np.ndarray, a: MotionStep, b: MotionStep) -> MotionStep:
    names = MotionStep.__slots__
    return MotionStep(
        **{name: np.where(mask, getattr(a, name), getattr(b, name)) for name in names}
    )


def _stop_when_creeping(state: State, params: StepParameters, motion: MotionStep) -> None:
    """Stop vehicles that hardly move and are not asked to accelerate."""
    constants = params.constants
    creeps = (motion.vx < constants.standstill) & (np.abs(motion.vy) < constants.standstill)
    stands = creeps & (state.controls.requested_accel <= 0)
    for name in ("vx", "vy", "yaw_rate"):
        setattr(motion, name, np.where(stands, _ZERO, getattr(motion, name)))
    motion.mean_yaw_rate = np.where(stands, _HALF * state.motion.yaw_rate, motion.mean_yaw_rate)


def _update_position(
    state: State,
    params: StepParameters,
    motion: MotionStep,
    wrecked: np.ndarray,
    step_length: np.float32,
) -> None:
    """New place with the mean of the old and the new velocity.

    In a bend the road turns under the vehicle by the curvature of its way times that way. A wreck
    slides straight on with locked wheels, however it and the road turn, and comes to rest.

    Source:
        The equations of motion along a curve, in the frame of its tangent: Rajamani, Vehicle
        Dynamics and Control (2012), section 2.7.
    """
    vehicles, constants = params.vehicles, params.constants
    half = _HALF * step_length
    sine, cosine = sincos(state.motion.heading)
    along = state.motion.vx * cosine - state.motion.vy * sine
    across = state.motion.vx * sine + state.motion.vy * cosine
    friction = constants.sliding_ratio * _max_friction_accel(state, params)
    speed = np.sqrt(along * along + across * across)
    lost = minimum(friction * step_length, speed) / maximum(speed, _MIN_SLIDING_SPEED)
    spin = (
        friction
        * vehicles.mass
        * vehicles.inverse_inertia
        * _HALF
        * vehicles.wheelbase
        * step_length
    )
    r = np.where(
        wrecked, state.motion.yaw_rate - clamp(state.motion.yaw_rate, -spin, spin), motion.yaw_rate
    )
    state.motion.accel_lon = np.where(
        wrecked, -(lost * (_ONE / step_length)) * state.motion.vx, motion.accel_lon
    )
    state.motion.accel_lat = np.where(
        wrecked, -(lost * (_ONE / step_length)) * state.motion.vy, motion.accel_lat
    )
    mean_r = np.where(wrecked, _HALF * (state.motion.yaw_rate + r), motion.mean_yaw_rate)
    turned = step_length * (state.road.curvature * (along + half * state.motion.accel_lon))
    state.motion.heading = state.motion.heading + step_length * mean_r - turned
    aside, ahead = sincos(turned)
    sine, cosine = sincos(state.motion.heading)
    kept = _ONE - lost
    new_along = np.where(
        wrecked, (along * ahead + across * aside) * kept, motion.vx * cosine - motion.vy * sine
    )
    new_across = np.where(
        wrecked, (across * ahead - along * aside) * kept, motion.vx * sine + motion.vy * cosine
    )
    state.motion.s = state.motion.s + half * (along + new_along) * state.road.station_per_metre
    state.motion.d = state.motion.d + half * (across + new_across)
    state.motion.vx = np.where(wrecked, new_along * cosine + new_across * sine, motion.vx)
    state.motion.vy = np.where(wrecked, new_across * cosine - new_along * sine, motion.vy)
    state.motion.yaw_accel = (r - state.motion.yaw_rate) * (_ONE / step_length)
    state.motion.yaw_rate = r
