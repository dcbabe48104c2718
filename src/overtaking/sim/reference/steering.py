"""Where in the lane to be, and the wheel angle that gets there."""

import numpy as np

from overtaking.core.elementary import F32, Mask, clamp, maximum, minimum, sincos
from overtaking.sim.reference.state import Fields, State
from overtaking.world.constants import Constants


def begin_path(state: State, moved: Mask, centre: F32, duration: F32) -> None:
    """Lay a quintic from where a vehicle's path is now to the centre of another lane.

    Position, velocity and acceleration are continuous; the path ends at rest sideways.

    Source:
        Werling et al. 2010; Wang, Li and Li 2014 found quintic kernels in measured lane changes.
    """
    place, speed, accel = path_now(state)
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
        state.path[k] = np.where(moved, value, state.path[k])
    state.path_time = np.where(moved, np.float32(0.0), state.path_time)
    state.path_duration = np.where(moved, duration, state.path_duration)
    state.since_change = np.where(moved, np.float32(0.0), state.since_change)


def path_now(state: State) -> tuple[F32, F32, F32]:
    """Position, velocity and acceleration of the lateral path now."""
    t = minimum(state.path_time, state.path_duration)
    c0, c1, c2, c3, c4, c5 = state.path
    two, three, four, five = (np.float32(k) for k in (2.0, 3.0, 4.0, 5.0))
    place = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
    speed = c1 + t * (two * c2 + t * (three * c3 + t * (four * c4 + t * (five * c5))))
    accel = two * c2 + t * (
        np.float32(6.0) * c3 + t * (np.float32(12.0) * c4 + t * (np.float32(20.0) * c5))
    )
    return place, speed, accel


def wind_trim(p: Fields, force: F32, moment: F32) -> F32:
    """Wheel angle, or lean, that holds a straight course in a side wind [rad or m/s^2].

    The steady single-track equations with lateral force F and yaw moment M and no yaw rate:
    delta = -K F / m - M (1 / C_f + 1 / C_r) / l with the understeer gradient K.
    """
    pushed = force * p.inverse_mass
    angle = p.understeer * pushed + moment * p.moment_angle
    return -np.where(p.two_wheeler > 0, pushed, angle)


def hold_against_wind(state: State, c: Constants, p: Fields, step: int) -> None:
    """Answer the side wind after a lag; at the first frame it is held already."""
    target = wind_trim(p, state.wind_force, state.wind_moment)
    if step == 0:
        state.trim = target
    state.trim = state.trim + (target - state.trim) * (c.decision / c.wind_lag)


def steer(state: State, c: Constants, p: Fields, side_accel: F32) -> None:
    """Turn the front wheels, or lean, towards the path for one step."""
    place, speed, accel = path_now(state)
    sine, cosine = sincos(state.psi)
    sideways = state.vx * sine + state.vy * cosine
    wanted = accel + c.velocity_gain * (speed - sideways)
    wanted = wanted + c.position_gain * (place + c.lane_deviation * state.wander - state.d)
    wanted = clamp(wanted, -side_accel, side_accel)
    inverse_speed = np.float32(1.0) / maximum(state.vx, c.slip_speed)
    felt = wanted + c.yaw_gain * (wanted - state.vx * state.r)
    angle = felt * (p.wheelbase * (inverse_speed * inverse_speed) + p.understeer) + state.trim
    # Beyond this slip more angle gives no more force; a sliding vehicle is steered into the slide.
    slip = (state.vy + p.cg_front * state.r) * inverse_speed
    reach = c.slip_share * np.float32(0.5) * (state.mu_fast + state.mu_slow) / p.front_stiffness
    angle = clamp(clamp(angle, slip - reach, slip + reach), -c.steering_limit, c.steering_limit)
    turn = (angle - state.wheel) * (c.step / c.steering_lag)
    turn = clamp(turn, -c.steering_rate * c.step, c.steering_rate * c.step)
    lean = (wanted + state.trim - state.wheel) * (c.step / c.two_wheeler_lag)
    moved = np.where(p.two_wheeler > 0, state.wheel + lean, state.wheel + turn)
    state.wheel = np.where(state.crashed > 0, np.float32(0.0), moved)
    state.path_time = state.path_time + c.step
