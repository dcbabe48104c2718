"""Pushes from outside, and what the server says about the physics of a vehicle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from overtaking.carla_server.fleet import MAX_WHEEL_ANGLE, STEERING_CURVE

if TYPE_CHECKING:
    from overtaking.carla_server.actors import Vehicle
    from overtaking.carla_server.arguments import Vector
    from overtaking.carla_server.world import World

_CM_PER_M = 100.0
_WHEEL_RADIUS = 0.35


def set_turning(world: World, actor: int, turning: Vector) -> None:
    """Give a vehicle a yaw rate, clockwise seen from above [degrees/s]."""
    world.fleet.set_yaw_rate(world.vehicle(actor).actor_id, -math.radians(turning.z))


def push(world: World, actor: int, impulse: Vector) -> None:
    """Push a vehicle [N s]; what points upwards is lost."""
    world.fleet.push(world.vehicle(actor).actor_id, *world.place.to_ground(impulse))


def force(world: World, actor: int, wanted: Vector) -> None:
    """Let a force act on a vehicle during the next tick [N]."""
    world.fleet.force(world.vehicle(actor).actor_id, *world.place.to_ground(wanted))


def physics_control(vehicle: Vehicle) -> list[object]:
    """`carla.VehiclePhysicsControl` of a body.

    Mass, drag and steering are those that the server drives with. Engine, gears and wheels, which
    our bodies do not have, are made up so that a client that looks at them finds a car.
    """
    body = vehicle.body
    lock = math.degrees(MAX_WHEEL_ANGLE)
    gears = [[4.0, 0.5, 0.65], [2.0, 0.5, 0.65], [1.0, 0.5, 0.65]]
    torque = [[0.0, 500.0], [1890.0, 500.0], [5729.0, 400.0]]
    steering = [list(knot) for knot in STEERING_CURVE]
    wheels = [_wheel(vehicle, k, lock) for k in range(4)]
    engine = [torque, 5800.0, 1.0, 0.15, 2.0, 0.35, True, 0.5, 10.0, 4.0, gears]
    centre = [0.0, 0.0, 0.0]
    return [*engine, body["mass"], body["drag_area"], centre, steering, wheels, True]


def _wheel(vehicle: Vehicle, k: int, lock_deg: float) -> list[object]:
    """`carla.WheelPhysicsControl`: front left, front right, rear left, rear right."""
    body, pose = vehicle.body, vehicle.pose
    is_front = k < 2
    ahead = body["cg_to_front"] if is_front else body["cg_to_front"] - body["wheelbase"]
    aside = (0.5 if k % 2 else -0.5) * body["track_width"]
    yaw = math.radians(pose.rotation.yaw)
    x = pose.location.x + math.cos(yaw) * ahead - math.sin(yaw) * aside
    y = pose.location.y + math.sin(yaw) * ahead + math.cos(yaw) * aside
    place = [_CM_PER_M * part for part in (x, y, pose.location.z + _WHEEL_RADIUS)]
    steered = lock_deg if is_front else 0.0
    brakes = [1500.0, 0.0 if is_front else 3000.0]
    tyre = [2.0, 17.0, 1000.0]
    return [3.5, 0.25, steered, _CM_PER_M * _WHEEL_RADIUS, *brakes, *tyre, place]
