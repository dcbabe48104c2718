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
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import VehicleParameters

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
    c: ModelConstants,
    p: VehicleParameters,
    accel: F32,
    resistance: F32,
    speed: F32,
    inverse_speed: F32,
) -> F32:
    """Force asked of the tyres for an acceleration, within engine, governor and brakes [N]."""
    wanted = p.mass * accel + resistance
    engine = minimum(p.launch_force, p.power * inverse_speed)
    left = (p.max_speed + c.governor_band - speed) * (_ONE / c.governor_band)
    throttle = clamp(left, _ZERO, _ONE)
    return maximum(minimum(wanted, engine * throttle), -p.max_brake_force)


def axle_forces(
    c: ModelConstants, p: VehicleParameters, state: State, force: F32, load: F32
) -> Axle:
    """Forces of one axle under a load [N] that is asked for a longitudinal force [N].

    Each side transmits what its own friction allows, which turns the vehicle on split friction. Of
    that, traction control lets the engine have less than anti-lock brakes let the brakes have:
    driven wheels that use all of it would have none left to keep the vehicle on its course.

    """
    half_load = _HALF * load
    controlled = (force > 0) & (p.two_wheeler == 0)
    share = np.where(controlled, c.traction_share, c.abs_share)
    bound_fast = share * state.mu_fast * half_load
    bound_slow = share * state.mu_slow * half_load
    fast = clamp(_HALF * force, -bound_fast, bound_fast)
    slow = clamp(_HALF * force, -bound_slow, bound_slow)
    total = fast + slow
    grip = (state.mu_fast + state.mu_slow) * half_load
    left = maximum(grip * grip - total * total, _MIN_LATERAL_GRIP)
    return Axle(
        load=load, force_lon=total, force_difference=slow - fast, max_lateral_force=np.sqrt(left)
    )


def advance_motion(
    state: State, c: ModelConstants, p: VehicleParameters, angle: F32, length: np.float32
) -> None:
    """Advance every vehicle by one step: new velocity first, then the position by the trapezoid.

    Args:
        state: State; its acceleration is that of the last step.
        c: Constants.
        p: Parameters.
        angle: Front wheel angle, or lean of a two-wheeler, in the middle of the step.
        length: Length of the step [s].
    """
    wrecked = state.crashed > 0
    speed = maximum(state.vx + _HALF * length * state.a_lon, _ZERO)
    inverse_speed = _ONE / maximum(speed, c.slip_speed)
    air = speed - state.tail_wind
    held_back = p.drag * air * np.abs(air) + p.rolling
    resistance = held_back + c.gravity * p.mass * state.slope
    force = requested_force(c, p, state.accel, resistance, speed, inverse_speed)
    front, rear = _axles(state, c, p, force, held_back, angle)
    drives = _single_track_step(
        state, c, p, (front, rear), resistance, (speed, inverse_speed), angle, length
    )
    straight = (front.force_lon + rear.force_lon - resistance) * p.inverse_mass
    leans = _leaning_step(state, c, p, straight, inverse_speed, angle, length)
    motion = _select(p.two_wheeler > 0, leans, drives)
    motion.vx = maximum(motion.vx, _ZERO)
    _stop_when_creeping(state, c, motion)
    _update_position(state, c, p, motion, wrecked, length)


def _axles(
    state: State, c: ModelConstants, p: VehicleParameters, force: F32, resistance: F32, angle: F32
) -> tuple[Axle, Axle]:
    """Loads and forces of the front and the rear axle.

    Loads follow the acceleration of this step, as far as it is known before the forces are: what
    the pedals ask for and friction allows under the loads of the last step, less what the turned
    wheels hold back of the side force, which is that of the last step.

    Source:
        The single-track model with load transfer of Althoff, Koschi and Manzinger (CommonRoad).
    """
    rides = p.two_wheeler > 0
    weight = _front_load_share(c, p, state.a_lon)
    share = np.where(force < 0, weight, p.front_drive)
    limit = np.where((force > 0) & ~rides, c.traction_share, c.abs_share) * _max_friction_accel(
        state, c
    )
    asked = force * p.inverse_mass
    front, rear = limit * weight, limit * (_ONE - weight)
    asked = clamp(share * asked, -front, front) + clamp((_ONE - share) * asked, -rear, rear)
    held = np.where(rides, _ZERO, state.a_lat * weight * angle)
    weight = _front_load_share(c, p, asked - resistance * p.inverse_mass - held)
    # Brakes follow the load, so that no axle locks before the other (UN R13-H asks for it).
    share = np.where(force < 0, weight, p.front_drive)
    whole = c.gravity * p.mass
    return (
        axle_forces(c, p, state, share * force, whole * weight),
        axle_forces(c, p, state, (_ONE - share) * force, whole * (_ONE - weight)),
    )


def _front_load_share(c: ModelConstants, p: VehicleParameters, accel: F32) -> F32:
    """Share of the load on the front axle at an acceleration, 0 to 1.

    It is never negative: an axle can leave the road, but not pull at it.
    """
    lifted = accel * p.cg_height * (_ONE / c.gravity)
    return p.inverse_wheelbase * (p.cg_rear - clamp(lifted, -p.cg_front, p.cg_rear))


def _max_friction_accel(state: State, c: ModelConstants) -> F32:
    """Largest acceleration that friction allows [m/s^2]."""
    return c.gravity * _HALF * (state.mu_fast + state.mu_slow)


def _single_track_step(
    state: State,
    c: ModelConstants,
    p: VehicleParameters,
    axles: tuple[Axle, Axle],
    resistance: F32,
    speeds: tuple[F32, F32],
    angle: F32,
    length: np.float32,
) -> MotionStep:
    """A step of the single-track model; side speed and yaw rate by the linearised equations.

    Source:
        Hairer and Wanner, Solving Ordinary Differential Equations II (1996), section IV.7: the
        Rosenbrock method of one stage with gamma = 1/2.
    """
    (front, rear), (speed, inverse_speed) = axles, speeds
    half = _HALF * length
    sine, cosine = sincos(angle)
    u = (state.vy + p.cg_front * state.r) * inverse_speed
    front_y, front_k = fiala_force(
        p.front_stiffness * front.load,
        u * cosine - sine,
        cosine + u * sine,
        front.max_lateral_force,
    )
    u = (state.vy - p.cg_rear * state.r) * inverse_speed
    rear_y, rear_k = fiala_force(
        p.rear_stiffness * rear.load, u, np.ones_like(u), rear.max_lateral_force
    )
    front_k, rear_k = front_k * inverse_speed, rear_k * inverse_speed
    side = front_y * cosine + front.force_lon * sine
    moment = p.half_track * (front.force_difference + rear.force_difference)
    across = (side + rear_y + state.wind_force) * p.inverse_mass - speed * state.r
    moment = moment + _stability_control(state, c, p, speed, angle)
    turn = p.cg_front * side - p.cg_rear * rear_y + state.wind_moment + moment
    turn = turn * p.inverse_inertia
    ahead, behind = p.cg_front * (front_k * cosine), p.cg_rear * rear_k
    by_mass, by_inertia = half * p.inverse_mass, half * p.inverse_inertia
    a11 = _ONE + by_mass * (front_k * cosine + rear_k)
    a12 = by_mass * (ahead - behind) + half * speed
    a21 = by_inertia * (ahead - behind)
    a22 = _ONE + by_inertia * (p.cg_front * ahead + p.cg_rear * behind)
    share = length / (a11 * a22 - a12 * a21)
    more_vy = share * (a22 * across - a12 * turn)
    more_r = share * (a11 * turn - a21 * across)
    r = state.r + _HALF * more_r
    middle_y = front_y - front_k * (_HALF * (more_vy + p.cg_front * more_r))
    along = front.force_lon * cosine - middle_y * sine + rear.force_lon - resistance
    a_lon = along * p.inverse_mass
    return MotionStep(
        accel_lon=a_lon,
        accel_lat=more_vy * (_ONE / length) + speed * r,
        vx=state.vx + length * (a_lon + (state.vy + _HALF * more_vy) * r),
        vy=state.vy + more_vy,
        yaw_rate=state.r + more_r,
        mean_yaw_rate=r,
    )


def _stability_control(
    state: State, c: ModelConstants, p: VehicleParameters, speed: F32, angle: F32
) -> F32:
    """Yaw moment of stability control, which brakes single wheels [N m].

    It answers a yaw rate that is off, by more than a threshold, from what the wheel angle asks for
    and friction allows, with at most the braking force of one wheel. What that takes from the speed
    is left out.

    Source:
        van Zanten, Erhardt and Pfaff 1995 (control of the yaw rate by the single-track model).
    """
    grip = _max_friction_accel(state, c)
    reach = grip / maximum(speed, c.slip_speed)
    asked = speed * angle / (p.wheelbase + p.understeer * (speed * speed))
    off = state.r - clamp(asked, -reach, reach)
    off = off - clamp(off, -c.stability_threshold, c.stability_threshold)
    most = np.float32(0.25) * grip * p.mass * p.half_track
    return clamp(-off * (_ONE / c.stability_time) / p.inverse_inertia, -most, most)


def _leaning_step(
    state: State,
    c: ModelConstants,
    p: VehicleParameters,
    a_lon: F32,
    inverse_speed: F32,
    angle: F32,
    length: np.float32,
) -> MotionStep:
    """A step of a point mass that leans as far as its driver and the wind ask, and grip allows.

    It turns at once as it leans, so its yaw rate is that of the middle of the step.
    """
    grip = _max_friction_accel(state, c)
    lean = clamp(angle + state.wind_force * p.inverse_mass, -grip, grip)
    vx = state.vx + length * a_lon
    r = lean * inverse_speed
    return MotionStep(
        accel_lon=a_lon, accel_lat=lean, vx=vx, vy=np.zeros_like(vx), yaw_rate=r, mean_yaw_rate=r
    )


def _select(mask: np.ndarray, a: MotionStep, b: MotionStep) -> MotionStep:
    names = MotionStep.__slots__
    return MotionStep(
        **{name: np.where(mask, getattr(a, name), getattr(b, name)) for name in names}
    )


def _stop_when_creeping(state: State, c: ModelConstants, motion: MotionStep) -> None:
    """Stop who hardly moves and is not asked to accelerate."""
    creeps = (motion.vx < c.standstill) & (np.abs(motion.vy) < c.standstill)
    stands = creeps & (state.accel <= 0)
    for name in ("vx", "vy", "yaw_rate"):
        setattr(motion, name, np.where(stands, _ZERO, getattr(motion, name)))
    motion.mean_yaw_rate = np.where(stands, _HALF * state.r, motion.mean_yaw_rate)


def _update_position(
    state: State,
    c: ModelConstants,
    p: VehicleParameters,
    motion: MotionStep,
    wrecked: np.ndarray,
    length: np.float32,
) -> None:
    """New place with the mean of the old and the new velocity.

    In a bend the road turns under the vehicle by the curvature of its way times that way. A wreck
    slides straight on with locked wheels, however it and the road turn, and comes to rest.

    Source:
        The equations of motion along a curve, in the frame of its tangent: Rajamani, Vehicle
        Dynamics and Control (2012), section 2.7.
    """
    half = _HALF * length
    sine, cosine = sincos(state.psi)
    along = state.vx * cosine - state.vy * sine
    across = state.vx * sine + state.vy * cosine
    friction = c.sliding_ratio * _max_friction_accel(state, c)
    speed = np.sqrt(along * along + across * across)
    lost = minimum(friction * length, speed) / maximum(speed, _MIN_SLIDING_SPEED)
    spin = friction * p.mass * p.inverse_inertia * _HALF * p.wheelbase * length
    r = np.where(wrecked, state.r - clamp(state.r, -spin, spin), motion.yaw_rate)
    state.a_lon = np.where(wrecked, -(lost * (_ONE / length)) * state.vx, motion.accel_lon)
    state.a_lat = np.where(wrecked, -(lost * (_ONE / length)) * state.vy, motion.accel_lat)
    mean_r = np.where(wrecked, _HALF * (state.r + r), motion.mean_yaw_rate)
    turned = length * (state.curve * (along + half * state.a_lon))
    state.psi = state.psi + length * mean_r - turned
    aside, ahead = sincos(turned)
    sine, cosine = sincos(state.psi)
    kept = _ONE - lost
    new_along = np.where(
        wrecked, (along * ahead + across * aside) * kept, motion.vx * cosine - motion.vy * sine
    )
    new_across = np.where(
        wrecked, (across * ahead - along * aside) * kept, motion.vx * sine + motion.vy * cosine
    )
    state.s = state.s + half * (along + new_along) * state.stretch
    state.d = state.d + half * (across + new_across)
    state.vx = np.where(wrecked, new_along * cosine + new_across * sine, motion.vx)
    state.vy = np.where(wrecked, new_across * cosine - new_along * sine, motion.vy)
    state.yaw_accel = (r - state.r) * (_ONE / length)
    state.r = r
