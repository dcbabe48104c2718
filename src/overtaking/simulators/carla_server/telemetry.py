"""`carla.VehicleTelemetryData`: what the single-track model knows of a vehicle and its wheels."""

import math
from typing import NamedTuple

from overtaking.simulators.carla_server.actors import Vehicle
from overtaking.simulators.carla_server.motion import Driven
from overtaking.simulators.carla_server.physics import WHEEL_RADIUS
from overtaking.simulators.carla_server.world import World
from overtaking.world.constants import constants

_AT_REST = 0.5
"""Slower than this a tyre has no slip angle [m/s]."""


class WheelTelemetry(NamedTuple):
    """`carla.WheelTelemetryData`; slip in degrees, rad/s, N and N m, sideways to the right."""

    tire_friction: float
    lat_slip: float
    long_slip: float
    omega: float
    tire_load: float
    normalized_tire_load: float
    torque: float
    long_force: float
    lat_force: float
    normalized_long_force: float
    normalized_lat_force: float


def telemetry(world: World, vehicle: Vehicle) -> list[object]:
    """What is known of a vehicle; engine speed and longitudinal slip, which are not, are 0.

    Loads and side forces are those of steady cornering, with load transfer by both accelerations.

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapters 1 and 6.
    """
    now = world.fleet.driven(vehicle.actor_id)
    control = vehicle.control
    speed = vehicle.forward_speed
    gear = -1 if control.reverse else 1
    drag = float(constants().half_air_density) * vehicle.body["drag_area"] * speed * abs(speed)
    wheels = [_wheel(vehicle, now, speed, drag, k) for k in range(4)]
    return [speed, control.steer, control.throttle, control.brake, 0.0, gear, drag, wheels]


def _wheel(vehicle: Vehicle, now: Driven, speed: float, drag: float, k: int) -> WheelTelemetry:
    """Front left, front right, rear left, rear right."""
    body, is_front, is_right = vehicle.body, k < 2, bool(k % 2)
    gravity = float(constants().gravity)
    wheelbase, front = body["wheelbase"], body["cg_to_front"]
    arm = front if is_front else wheelbase - front
    share = 1.0 - arm / wheelbase
    rest = 0.5 * share * body["mass"] * gravity
    lift = 0.5 * body["mass"] * now.a_lon * body["cg_height"] / wheelbase
    lean = share * body["mass"] * now.a_lat * body["cg_height"] / body["track_width"]
    lean = 0.0 if body["two_wheeler"] else lean
    load = max(rest + (-lift if is_front else lift) + (lean if is_right else -lean), 0.0)
    normal = load / rest
    resistance = drag + body["rolling_resistance"] * body["mass"] * gravity * (speed != 0.0)
    force = body["mass"] * now.a_lon + resistance
    driven = body["front_drive_share"] if is_front else 1.0 - body["front_drive_share"]
    along = 0.5 * force * (driven if force > 0.0 else share)
    across = -share * body["mass"] * now.a_lat * normal / 2.0
    return WheelTelemetry(
        tire_friction=now.mu_right if is_right else now.mu_left,
        lat_slip=_slip(now, arm if is_front else -arm, now.angle if is_front else 0.0),
        long_slip=0.0,
        omega=speed / WHEEL_RADIUS,
        tire_load=load,
        normalized_tire_load=normal,
        torque=along * WHEEL_RADIUS,
        long_force=along,
        lat_force=across,
        normalized_long_force=abs(along) / rest,
        normalized_lat_force=abs(across) / rest,
    )


def _slip(now: Driven, ahead: float, angle: float) -> float:
    """Slip angle of an axle, to the right [degrees]."""
    if now.vx < _AT_REST:
        return 0.0
    return math.degrees(angle - math.atan2(now.vy + now.yaw_rate * ahead, now.vx))
