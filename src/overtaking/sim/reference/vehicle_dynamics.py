"""Motion over one step: single-track model with Fiala tyres, leaning point mass, sliding wreck.

The sideways motion on four wheels is fast compared with a step of 50 ms, and stiff at low speed. A
linearly implicit step therefore advances side speed and yaw rate together: it computes the forces
and their slopes once, and solves two linear equations. docs/explanation/model.md derives it.

Velocities are in the vehicle's axes: `vx` ahead, `vy` to the left. Lateral positions, forces,
angles and yaw rates are positive to the left. A wreck is a vehicle that has collided or has left
the road.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, ZERO, clamp, maximum, minimum, sincos
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters

_MIN_SLIDING_SPEED = np.float32(1e-3)  # Keeps the direction of a wreck at rest finite [m/s].
_MIN_SQUARED_LATERAL_GRIP = np.float32(1.0)
"""Smallest square of the largest lateral force [N^2].

`fiala_force` divides by that force, which would be 0 at full braking.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MidStep:
    """Length of a step, and motion and controls in its middle, (vehicle, simulation).

    Attributes:
        step_length: Length of the step [s].
        speed: Speed, extrapolated by the acceleration of the last step [m/s].
        inverse_speed: One over the speed, or over `slip_speed` at lower speeds, where the equations
            of tyre slip are stiff [s/m].
        wheel_angle: Front wheel angle [rad], or requested lean of a two-wheeler as the lateral
            acceleration that it balances [m/s^2].
        level_resistance: Air drag and rolling resistance [N].
        resistance: Air drag, rolling resistance and the pull of the slope [N].
    """

    step_length: np.float32
    speed: F32
    inverse_speed: F32
    wheel_angle: F32
    level_resistance: F32
    resistance: F32


@dataclass(slots=True, kw_only=True)
class Axle:
    """Loads and forces of one axle; arrays of shape (vehicle, simulation).

    Attributes:
        load: Load [N].
        force_lon: Longitudinal force [N].
        force_difference: Longitudinal force of the right side minus the left side's [N].
        max_lateral_force: Largest lateral force [N].
    """

    load: F32
    force_lon: F32
    force_difference: F32
    max_lateral_force: F32


class Axles(NamedTuple):
    """Both axles of each vehicle."""

    front: Axle
    rear: Axle


class TyreForce(NamedTuple):
    """Lateral force of an axle."""

    force: F32  # Against the slip, positive to the left [N].
    slope: F32  # Growth of its size per slip; slip is side speed over speed [N].


@dataclass(slots=True, kw_only=True)
class MotionStep:
    """Result of a step; arrays of shape (vehicle, simulation).

    Attributes:
        accel_lon, accel_lat: Mean of all forces over the mass, along and across the vehicle
            [m/s^2]. The velocities change by the turning of the vehicle's axes as well.
        vx, vy, yaw_rate: Velocity [m/s] and yaw rate [rad/s] at the end.
        mean_yaw_rate: Mean yaw rate [rad/s].
    """

    accel_lon: F32
    accel_lat: F32
    vx: F32
    vy: F32
    yaw_rate: F32
    mean_yaw_rate: F32


def fiala_force(
    stiffness: F32, velocity_across: F32, velocity_along: F32, max_force: F32
) -> TyreForce:
    """Lateral force of an axle, and its slope.

    Args:
        stiffness: Cornering stiffness of the axle [N/rad].
        velocity_across: Velocity of its wheels across their planes, of any unit.
        velocity_along: Velocity along them, > 0, in the same unit.
        max_force: Largest lateral force, > 0 [N].

    Source:
        Fiala 1954; the brush form in Pacejka, Tyre and Vehicle Dynamics (2012), section 3.2.
    """
    # Slip over the slip from which the whole contact patch slides.
    z = stiffness * velocity_across / (np.float32(3.0) * max_force * velocity_along)
    # Share of the contact patch that sticks.
    sticking_share = maximum(ONE - np.abs(z), ZERO)
    size = max_force * (ONE - sticking_share * sticking_share * sticking_share)
    force = np.where(z < 0, size, -size)
    return TyreForce(force, stiffness * (sticking_share * sticking_share))


def requested_force(params: StepParameters, requested_accel: F32, mid: MidStep) -> F32:
    """Tyre force requested for an acceleration, within engine, governor and brakes [N]."""
    vehicles, constants = params.vehicles, params.constants
    force = vehicles.mass * requested_accel + mid.resistance
    engine_force = minimum(vehicles.launch_force, vehicles.power * mid.inverse_speed)
    # The governor closes the throttle over a band of speeds above the largest speed.
    speed_margin = vehicles.max_speed + constants.governor_band - mid.speed
    throttle = clamp(speed_margin * (ONE / constants.governor_band), ZERO, ONE)
    return maximum(minimum(force, engine_force * throttle), -vehicles.max_brake_force)


def axle_forces(params: StepParameters, state: State, force: F32, load: F32) -> Axle:
    """Forces of one axle for a requested longitudinal force [N] under a load [N].

    Each side transmits as much as its own friction allows, which turns the vehicle on split
    friction. Traction control lets the engine use a smaller share of the friction than anti-lock
    brakes let the brakes use: driven wheels at their limit could not keep the vehicle on course.
    A two-wheeler, a point mass without tyre slip, stays on course without it.
    """
    constants, friction = params.constants, state.friction_and_wind
    half_load = HALF * load
    has_traction_control = (force > 0) & (params.vehicles.two_wheeler == 0)
    share = np.where(has_traction_control, constants.traction_share, constants.abs_share)
    max_left = share * friction.mu_left * half_load
    max_right = share * friction.mu_right * half_load
    left = clamp(HALF * force, -max_left, max_left)
    right = clamp(HALF * force, -max_right, max_right)
    force_lon = left + right
    # Friction circle: longitudinal and lateral force together are at most the grip.
    grip = (friction.mu_left + friction.mu_right) * half_load
    squared_lateral_grip = maximum(grip * grip - force_lon * force_lon, _MIN_SQUARED_LATERAL_GRIP)
    return Axle(
        load=load,
        force_lon=force_lon,
        force_difference=right - left,
        max_lateral_force=np.sqrt(squared_lateral_grip),
    )


def advance_motion(
    state: State, params: StepParameters, wheel_angle: F32, step_length: np.float32
) -> None:
    """Advance every vehicle by one step: first its velocity, then its position by the trapezoid.

    Args:
        state: State with the acceleration of the last step; it changes.
        params: Parameters of the batch.
        wheel_angle: As `MidStep.wheel_angle`.
        step_length: Length of the step [s].
    """
    vehicles = params.vehicles
    mid = _mid_step(state, params, wheel_angle, step_length)
    force = requested_force(params, state.controls.requested_accel, mid)
    axles = _axles(state, params, force, mid)
    on_four_wheels = _single_track_step(state, params, axles, mid)
    tyre_force = axles.front.force_lon + axles.rear.force_lon
    accel_lon = (tyre_force - mid.resistance) * vehicles.inverse_mass
    on_two_wheels = _leaning_step(state, params, accel_lon, mid)
    motion_step = _select(vehicles.two_wheeler > 0, on_two_wheels, on_four_wheels)
    motion_step.vx = maximum(motion_step.vx, ZERO)  # Vehicles do not reverse.
    _stop_when_creeping(state, params, motion_step)
    _update_position(state, params, motion_step, step_length)


def _mid_step(
    state: State, params: StepParameters, wheel_angle: F32, step_length: np.float32
) -> MidStep:
    """Speed and resistance in the middle of the step, by the acceleration of the last one."""
    vehicles, constants, motion = params.vehicles, params.constants, state.motion
    speed = maximum(motion.vx + HALF * step_length * motion.accel_lon, ZERO)
    air_speed = speed - state.friction_and_wind.tail_wind
    level_resistance = vehicles.drag * air_speed * np.abs(air_speed) + vehicles.rolling
    slope_force = constants.gravity * vehicles.mass * state.road.sin_slope
    return MidStep(
        step_length=step_length,
        speed=speed,
        inverse_speed=ONE / maximum(speed, constants.slip_speed),
        wheel_angle=wheel_angle,
        level_resistance=level_resistance,
        resistance=level_resistance + slope_force,
    )


def _axles(state: State, params: StepParameters, force: F32, mid: MidStep) -> Axles:
    """Loads and forces of both axles for a requested force [N].

    The loads depend on the acceleration of this step, which depends on the loads. They are computed
    from an estimate of the acceleration: the requested force, limited by friction under the loads
    of the last step, minus resistance and the backward part of the side force at the turned front
    wheels.

    Source:
        The single-track model with load transfer of Althoff, Koschi and Manzinger (CommonRoad).
    """
    vehicles, constants = params.vehicles, params.constants
    is_two_wheeler = vehicles.two_wheeler > 0
    # The acceleration of the last step contains the pull of the slope, which should not count (see
    # below). This error reaches the estimate by `steering_loss`, and where friction limits the
    # force of an axle. Unlimited, both forces add up to `force` at any load.
    front_load_share = _front_load_share(params, state.motion.accel_lon)
    # `front_drive` is the share of the engine's force at the front axle.
    front_force_share = np.where(force < 0, front_load_share, vehicles.front_drive)
    max_accel = np.where(
        (force > 0) & ~is_two_wheeler, constants.traction_share, constants.abs_share
    ) * _max_friction_accel(state, params)
    accel = force * vehicles.inverse_mass
    max_front, max_rear = max_accel * front_load_share, max_accel * (ONE - front_load_share)
    front_accel = clamp(front_force_share * accel, -max_front, max_front)
    rear_accel = clamp((ONE - front_force_share) * accel, -max_rear, max_rear)
    accel = front_accel + rear_accel
    # In steady cornering the front axle carries this share of the side force too; the angle stands
    # for its sine.
    steering_loss = np.where(
        is_two_wheeler, ZERO, state.motion.accel_lat * front_load_share * mid.wheel_angle
    )
    # The pull of a slope has no moment about the centre of gravity, so it is not subtracted. Air
    # drag counts as if it acted at the road.
    front_load_share = _front_load_share(
        params, accel - mid.level_resistance * vehicles.inverse_mass - steering_loss
    )
    # Brakes follow the load, so that no axle locks before the other (required by UN R13-H).
    front_force_share = np.where(force < 0, front_load_share, vehicles.front_drive)
    weight = constants.gravity * vehicles.mass
    return Axles(
        front=axle_forces(params, state, front_force_share * force, weight * front_load_share),
        rear=axle_forces(
            params, state, (ONE - front_force_share) * force, weight * (ONE - front_load_share)
        ),
    )


def _front_load_share(params: StepParameters, accel: F32) -> F32:
    """Share of the load on the front axle at an acceleration, 0 to 1.

    It is never negative: an axle can lift off the road, but not pull at it.
    """
    vehicles, constants = params.vehicles, params.constants
    # An acceleration moves the load backwards, as if the centre of gravity lay so much farther back
    # [m].
    shift = accel * vehicles.cg_height * (ONE / constants.gravity)
    return vehicles.inverse_wheelbase * (
        vehicles.cg_rear - clamp(shift, -vehicles.cg_front, vehicles.cg_rear)
    )


def _max_friction_accel(state: State, params: StepParameters) -> F32:
    """Largest acceleration that friction allows [m/s^2]."""
    friction = state.friction_and_wind
    return params.constants.gravity * HALF * (friction.mu_left + friction.mu_right)


def _single_track_step(
    state: State, params: StepParameters, axles: Axles, mid: MidStep
) -> MotionStep:
    """A step of the single-track model; side speed and yaw rate by the linearised equations.

    Source:
        Hairer and Wanner, Solving Ordinary Differential Equations II (1996), section IV.7: the
        Rosenbrock method of one stage with gamma = 1/2.
    """
    vehicles, motion, wind = params.vehicles, state.motion, state.friction_and_wind
    front, rear, inverse_speed = axles.front, axles.rear, mid.inverse_speed
    step_length, half_step = mid.step_length, HALF * mid.step_length
    sine, cosine = sincos(mid.wheel_angle)

    # Side speed of each axle over the speed; the front wheels are turned by the wheel angle.
    u = (motion.vy + vehicles.cg_front * motion.yaw_rate) * inverse_speed
    front_tyre = fiala_force(
        vehicles.front_stiffness * front.load,
        u * cosine - sine,
        cosine + u * sine,
        front.max_lateral_force,
    )
    u = (motion.vy - vehicles.cg_rear * motion.yaw_rate) * inverse_speed
    rear_tyre = fiala_force(
        vehicles.rear_stiffness * rear.load, u, np.ones_like(u), rear.max_lateral_force
    )
    front_slope, rear_slope = front_tyre.slope * inverse_speed, rear_tyre.slope * inverse_speed

    # Rates of change of side speed and yaw rate at the start of the step.
    front_side_force = front_tyre.force * cosine + front.force_lon * sine
    # Moment of unequal longitudinal forces on the two sides.
    split_moment = vehicles.half_track * (front.force_difference + rear.force_difference)
    side_force = front_side_force + rear_tyre.force + wind.wind_force
    vy_rate = side_force * vehicles.inverse_mass - mid.speed * motion.yaw_rate
    extra_moment = split_moment + _stability_control(state, params, mid.speed, mid.wheel_angle)
    moment = (
        vehicles.cg_front * front_side_force
        - vehicles.cg_rear * rear_tyre.force
        + wind.wind_moment
        + extra_moment
    )
    yaw_accel = moment * vehicles.inverse_inertia

    # (1 - h/2 J) (change of vy, change of the yaw rate) = h (rates). J is the derivative of the
    # rates by side speed and yaw rate: slopes of the side forces, and the term speed * yaw_rate. It
    # neglects terms of second order in the wheel angle, and stability control.
    front_arm = vehicles.cg_front * (front_slope * cosine)
    rear_arm = vehicles.cg_rear * rear_slope
    per_mass, per_inertia = half_step * vehicles.inverse_mass, half_step * vehicles.inverse_inertia
    a11 = ONE + per_mass * (front_slope * cosine + rear_slope)
    a12 = per_mass * (front_arm - rear_arm) + half_step * mid.speed
    a21 = per_inertia * (front_arm - rear_arm)
    a22 = ONE + per_inertia * (vehicles.cg_front * front_arm + vehicles.cg_rear * rear_arm)
    scale = step_length / (a11 * a22 - a12 * a21)
    vy_change = scale * (a22 * vy_rate - a12 * yaw_accel)
    yaw_rate_change = scale * (a11 * yaw_accel - a21 * vy_rate)

    # The side force of turned front wheels points partly backwards, and so decelerates the vehicle.
    # It is taken in the middle of the step.
    side_speed_change = HALF * (vy_change + vehicles.cg_front * yaw_rate_change)
    front_force_mid = front_tyre.force - front_slope * side_speed_change
    force_lon = front.force_lon * cosine - front_force_mid * sine + rear.force_lon - mid.resistance
    accel_lon = force_lon * vehicles.inverse_mass
    mean_yaw_rate = motion.yaw_rate + HALF * yaw_rate_change
    mean_vy = motion.vy + HALF * vy_change
    return MotionStep(
        accel_lon=accel_lon,
        # The turning of the axes takes `speed * yaw_rate` off the rate of `vy`.
        accel_lat=vy_change * (ONE / step_length) + mid.speed * mean_yaw_rate,
        vx=motion.vx + step_length * (accel_lon + mean_vy * mean_yaw_rate),
        vy=motion.vy + vy_change,
        yaw_rate=motion.yaw_rate + yaw_rate_change,
        mean_yaw_rate=mean_yaw_rate,
    )


def _stability_control(state: State, params: StepParameters, speed: F32, wheel_angle: F32) -> F32:
    """Yaw moment of stability control, which brakes single wheels [N m].

    It reacts to a yaw rate that differs by more than a threshold from the one that the wheel angle
    requests and friction allows. It uses at most the braking force of one wheel. The loss of speed
    by this braking is neglected.

    Source:
        van Zanten, Erhardt and Pfaff 1995 (control of the yaw rate by the single-track model).
    """
    vehicles, constants = params.vehicles, params.constants
    max_accel = _max_friction_accel(state, params)
    max_yaw_rate = max_accel / maximum(speed, constants.slip_speed)
    requested = speed * wheel_angle / (vehicles.wheelbase + vehicles.understeer * (speed * speed))
    error = state.motion.yaw_rate - clamp(requested, -max_yaw_rate, max_yaw_rate)
    threshold = constants.stability_threshold
    error = error - clamp(error, -threshold, threshold)
    # A wheel carries a quarter of the weight.
    max_moment = np.float32(0.25) * max_accel * vehicles.mass * vehicles.half_track
    # The moment that would remove the error within `stability_time`.
    moment = -error * (ONE / constants.stability_time) / vehicles.inverse_inertia
    return clamp(moment, -max_moment, max_moment)


def _leaning_step(state: State, params: StepParameters, accel_lon: F32, mid: MidStep) -> MotionStep:
    """A step of a two-wheeler: a point mass that leans by its driver's request and the wind.

    It turns at once as it leans, so its yaw rate at the end is the one in the middle of the step.
    """
    vehicles = params.vehicles
    max_accel = _max_friction_accel(state, params)
    wind_accel = state.friction_and_wind.wind_force * vehicles.inverse_mass
    accel_lat = clamp(mid.wheel_angle + wind_accel, -max_accel, max_accel)
    vx = state.motion.vx + mid.step_length * accel_lon
    yaw_rate = accel_lat * mid.inverse_speed
    return MotionStep(
        accel_lon=accel_lon,
        accel_lat=accel_lat,
        vx=vx,
        vy=np.zeros_like(vx),
        yaw_rate=yaw_rate,
        mean_yaw_rate=yaw_rate,
    )


def _select(mask: Mask, step_if: MotionStep, step_else: MotionStep) -> MotionStep:
    """Field by field the first step where the mask is set, else the second."""
    return MotionStep(
        **{
            name: np.where(mask, getattr(step_if, name), getattr(step_else, name))
            for name in MotionStep.__slots__
        }
    )


def _stop_when_creeping(state: State, params: StepParameters, motion_step: MotionStep) -> None:
    """Stop vehicles that hardly move and whose drivers do not request acceleration."""
    standstill = params.constants.standstill
    creeps = (motion_step.vx < standstill) & (np.abs(motion_step.vy) < standstill)
    stops = creeps & (state.controls.requested_accel <= 0)
    for name in ("vx", "vy", "yaw_rate"):
        setattr(motion_step, name, np.where(stops, ZERO, getattr(motion_step, name)))
    # The yaw rate falls from its present value to 0 during the step.
    motion_step.mean_yaw_rate = np.where(
        stops, HALF * state.motion.yaw_rate, motion_step.mean_yaw_rate
    )


def _update_position(
    state: State, params: StepParameters, motion_step: MotionStep, step_length: np.float32
) -> None:
    """Move vehicles by the mean of the old and the new velocity, and store the new motion.

    Each vehicle measures `s` in its own direction of travel. In a bend the road turns under the
    vehicle by its curvature times the driven distance. A wreck with locked wheels keeps the
    direction of its velocity over ground until it rests, even if its body or the road turns.

    Source:
        The equations of motion along a curve, in the frame of its tangent: Rajamani, Vehicle
        Dynamics and Control (2012), section 2.7.
    """
    vehicles, constants, motion = params.vehicles, params.constants, state.motion
    is_wreck, half_step, per_second = motion.is_wreck > 0, HALF * step_length, ONE / step_length
    sine, cosine = sincos(motion.heading)
    along = motion.vx * cosine - motion.vy * sine
    across = motion.vx * sine + motion.vy * cosine

    # Sliding friction takes a share of a wreck's speed, and its moment slows the spin. The
    # formula assumes a body that only spins, with its weight at half the wheelbase from the centre.
    # `sliding_ratio` is the sliding friction over the peak friction.
    sliding_decel = constants.sliding_ratio * _max_friction_accel(state, params)
    speed = np.sqrt(along * along + across * across)
    lost_share = minimum(sliding_decel * step_length, speed) / maximum(speed, _MIN_SLIDING_SPEED)
    max_spin_change = (
        sliding_decel
        * vehicles.mass
        * vehicles.inverse_inertia
        * HALF
        * vehicles.wheelbase
        * step_length
    )
    spin_change = clamp(motion.yaw_rate, -max_spin_change, max_spin_change)
    yaw_rate = np.where(is_wreck, motion.yaw_rate - spin_change, motion_step.yaw_rate)
    sliding_rate = -(lost_share * per_second)
    motion.accel_lon = np.where(is_wreck, sliding_rate * motion.vx, motion_step.accel_lon)
    motion.accel_lat = np.where(is_wreck, sliding_rate * motion.vy, motion_step.accel_lat)
    mean_yaw_rate = np.where(
        is_wreck, HALF * (motion.yaw_rate + yaw_rate), motion_step.mean_yaw_rate
    )

    # The new speed along the road depends on this turn, so the mean speed is extrapolated instead.
    # The angle to the road is neglected in it. `curvature` belongs to the vehicle's path
    # along the road, positive to the left.
    road_turn = step_length * (state.road.curvature * (along + half_step * motion.accel_lon))
    motion.heading = motion.heading + step_length * mean_yaw_rate - road_turn
    turn_sine, turn_cosine = sincos(road_turn)
    sine, cosine = sincos(motion.heading)
    # The axes of the road turn by `road_turn`, so a constant velocity turns back against them.
    kept_share = ONE - lost_share
    new_along = np.where(
        is_wreck,
        (along * turn_cosine + across * turn_sine) * kept_share,
        motion_step.vx * cosine - motion_step.vy * sine,
    )
    new_across = np.where(
        is_wreck,
        (across * turn_cosine - along * turn_sine) * kept_share,
        motion_step.vx * sine + motion_step.vy * cosine,
    )
    motion.s = motion.s + half_step * (along + new_along) * state.road.station_per_metre
    motion.d = motion.d + half_step * (across + new_across)
    motion.vx = np.where(is_wreck, new_along * cosine + new_across * sine, motion_step.vx)
    motion.vy = np.where(is_wreck, new_across * cosine - new_along * sine, motion_step.vy)
    motion.yaw_accel = (yaw_rate - motion.yaw_rate) * per_second
    motion.yaw_rate = yaw_rate
