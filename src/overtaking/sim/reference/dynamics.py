"""Motion over one step: single-track with Fiala tyres, point mass on two wheels, wreck."""

import numpy as np

from overtaking.core.elementary import F32, clamp, maximum, minimum, sincos
from overtaking.sim.reference.state import Fields, State
from overtaking.world.constants import Constants

_ONE = np.float32(1.0)
_HALF = np.float32(0.5)
_TINY = np.float32(1e-3)  # Keeps the direction of a wreck at rest finite [m/s].
_LEAST_GRIP = np.float32(1.0)  # Left sideways by full braking, squared, to divide by [N^2].


def fiala(stiffness: F32, slope: F32, limit: F32) -> F32:
    """Lateral force of an axle [N], against the slip.

    Args:
        stiffness: Cornering stiffness of the axle [N/rad].
        slope: Tangent of its slip angle.
        limit: Largest lateral force, > 0 [N].

    Source:
        Fiala 1954; the brush form in Pacejka, Tyre and Vehicle Dynamics (2012), section 3.2.
    """
    z = stiffness * slope / (np.float32(3.0) * limit)
    size = np.abs(z)
    inner = np.float32(3.0) * z - np.float32(3.0) * z * size + z * z * z
    outer = np.where(z < 0, -_ONE, _ONE)
    return -limit * np.where(size < _ONE, inner, outer)


def drive_force(c: Constants, p: Fields, state: State, resistance: F32, inverse_speed: F32) -> F32:
    """Force asked of the tyres for an acceleration, within engine, governor and brakes [N]."""
    wanted = p.mass * state.accel + resistance
    engine = minimum(p.launch_force, p.power * inverse_speed)
    left = (p.max_speed + c.governor_band - state.vx) * (_ONE / c.governor_band)
    throttle = clamp(left, np.float32(0.0), _ONE)
    return maximum(minimum(wanted, engine * throttle), -p.brake_force)


def axle_forces(
    c: Constants, p: Fields, state: State, force: F32, load: F32
) -> tuple[F32, F32, F32]:
    """Longitudinal force, its imbalance and the lateral limit of one axle.

    Each side transmits what its own friction allows, which turns the vehicle on split friction. Of
    that, traction control lets the engine have less than anti-lock brakes let the brakes have:
    driven wheels that use all of it would have none left to keep the vehicle on its course.

    Returns:
        Force on the axle [N], force of the slow side minus that of the fast side [N], and the
        lateral force left by the friction circle [N].
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
    left = maximum(grip * grip - total * total, _LEAST_GRIP)
    return total, slow - fast, np.sqrt(left)


def move(state: State, c: Constants, p: Fields) -> None:
    """Advance every vehicle by one step: new velocity first, then the position by the trapezoid."""
    air = state.vx - state.tail_wind
    resistance = p.drag * air * np.abs(air) + p.rolling
    inverse_speed = _ONE / maximum(state.vx, c.slip_speed)
    force = drive_force(c, p, state, resistance, inverse_speed)
    tyre = _tyre_forces(state, c, p, force, inverse_speed)
    along, across, turn = _on_four_wheels(state, p, tyre, resistance)
    lean = clamp(
        state.wheel + state.wind_force * p.inverse_mass,
        -c.gravity * _HALF * (state.mu_fast + state.mu_slow),
        c.gravity * _HALF * (state.mu_fast + state.mu_slow),
    )
    rides = p.two_wheeler > 0
    a_lon = np.where(rides, (tyre[0] + tyre[1] - resistance) * p.inverse_mass, along)
    a_lat = np.where(rides, lean, across)
    wreck_lon, wreck_lat, wreck_turn = _wreck(state, c, p)
    wrecked = state.crashed > 0
    state.a_lon = np.where(wrecked, wreck_lon, a_lon)
    state.a_lat = np.where(wrecked, wreck_lat, a_lat)
    turned = np.where(rides, lean * inverse_speed, state.r + c.step * turn)
    _integrate(state, c, np.where(wrecked, state.r + wreck_turn, turned), rides & ~wrecked, wrecked)


def _tyre_forces(
    state: State, c: Constants, p: Fields, force: F32, inverse_speed: F32
) -> tuple[F32, F32, F32, F32, F32]:
    """Forces of the axles, and the yaw moment of split friction.

    Returns:
        Longitudinal front and rear [N], lateral front and rear [N], moment [N m].

    Source:
        The single-track model with load transfer of Althoff, Koschi and Manzinger (CommonRoad).
    """
    # The load of an axle is never negative: it can leave the road, but not pull at it.
    shift = clamp(state.a_lon * p.cg_height, -c.gravity * p.cg_front, c.gravity * p.cg_rear)
    front_weight = p.inverse_wheelbase * (c.gravity * p.cg_rear - shift)
    front_load = p.mass * front_weight
    rear_load = p.mass * p.inverse_wheelbase * (c.gravity * p.cg_front + shift)
    # Brakes follow the load, so that no axle locks before the other (UN R13-H asks for it).
    share = np.where(force < 0, front_weight * (_ONE / c.gravity), p.front_drive)
    front_x, front_split, front_limit = axle_forces(c, p, state, share * force, front_load)
    rear_x, rear_split, rear_limit = axle_forces(c, p, state, (_ONE - share) * force, rear_load)
    sine, cosine = sincos(state.wheel)
    slip = (state.vy + p.cg_front * state.r) * inverse_speed
    front_slope = (slip * cosine - sine) / (cosine + slip * sine)
    rear_slope = (state.vy - p.cg_rear * state.r) * inverse_speed
    front_y = fiala(p.front_stiffness * front_load, front_slope, front_limit)
    rear_y = fiala(p.rear_stiffness * rear_load, rear_slope, rear_limit)
    moment = p.half_track * (front_split + rear_split)
    return front_x, rear_x, front_y, rear_y, moment


def _on_four_wheels(
    state: State, p: Fields, tyre: tuple[F32, F32, F32, F32, F32], resistance: F32
) -> tuple[F32, F32, F32]:
    """Accelerations along and across the vehicle and of yaw, from the tyre forces."""
    front_x, rear_x, front_y, rear_y, moment = tyre
    sine, cosine = sincos(state.wheel)
    front_side = front_y * cosine + front_x * sine
    a_lon = (front_x * cosine - front_y * sine + rear_x - resistance) * p.inverse_mass
    a_lat = (front_side + rear_y + state.wind_force) * p.inverse_mass
    yaw = p.cg_front * front_side - p.cg_rear * rear_y + state.wind_moment + moment
    return a_lon, a_lat, yaw * p.inverse_inertia


def _wreck(state: State, c: Constants, p: Fields) -> tuple[F32, F32, F32]:
    """A wreck slides to rest with locked wheels: accelerations and change of yaw rate."""
    friction = c.sliding_ratio * c.gravity * _HALF * (state.mu_fast + state.mu_slow)
    speed = np.sqrt(state.vx * state.vx + state.vy * state.vy)
    share = minimum(friction, speed / c.step) / maximum(speed, _TINY)
    spin = friction * p.mass * p.inverse_inertia * _HALF * p.wheelbase * c.step
    return -share * state.vx, -share * state.vy, -clamp(state.r, -spin, spin)


def _integrate(state: State, c: Constants, r: F32, rides: np.ndarray, wrecked: np.ndarray) -> None:
    """New velocity, then new position with the mean of the old and the new velocity."""
    sine, cosine = sincos(state.psi)
    along = state.vx * cosine - state.vy * sine
    across = state.vx * sine + state.vy * cosine
    turning = state.r
    vx = state.vx + c.step * (state.a_lon + np.where(rides, np.float32(0.0), state.vy * state.r))
    vy = state.vy + c.step * (state.a_lat - state.vx * state.r)
    vy = np.where(rides, np.float32(0.0), vy)
    creeps = (vx < c.standstill) & (np.abs(vy) < c.standstill)
    stands = ~wrecked & creeps & (state.accel <= 0)
    vx = np.where(wrecked, vx, maximum(vx, np.float32(0.0)))
    state.vx = np.where(stands, np.float32(0.0), vx)
    state.vy = np.where(stands, np.float32(0.0), vy)
    state.r = np.where(stands, np.float32(0.0), r)
    half = c.step * np.float32(0.5)
    state.psi = state.psi + half * (turning + state.r)
    sine, cosine = sincos(state.psi)
    state.s = state.s + half * (along + (state.vx * cosine - state.vy * sine))
    state.d = state.d + half * (across + (state.vx * sine + state.vy * cosine))
