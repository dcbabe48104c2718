"""The calls that change the motion and the body of a vehicle, and what describes the body."""

# No `from __future__ import annotations`: `call` reads the types when a function is declared.

import math
from typing import NamedTuple

from overtaking.simulators.carla_server.actors import UPRIGHT, Vehicle
from overtaking.simulators.carla_server.arguments import (
    Flag,
    Id,
    Physics,
    Transform,
    Vector,
    Wheel,
)
from overtaking.simulators.carla_server.motion import SteeringLimits, VehicleDynamics, rotate
from overtaking.simulators.carla_server.protocol import Refused, call
from overtaking.simulators.carla_server.world import World
from overtaking.world.constants import model_constants

WHEEL_RADIUS = 0.35
"""Radius of every wheel that the server reports [m]."""

_TYRE_FRICTION = 3.5
"""Tyre friction of CARLA's vehicles outside friction triggers."""

_CM_PER_M = 100.0
_LIGHTEST, _HEAVIEST = 50.0, 100_000.0

_TURN = math.radians(1.0) / _CM_PER_M**2
"""From CARLA's unit of angular momentum, kg cm^2 degrees/s, to kg m^2/s."""


@call(command=8)
def set_actor_target_velocity(world: World, actor: Id, velocity: Vector) -> None:
    """Set the velocity of a vehicle [m/s]."""
    world.set_velocity(actor, velocity)


@call(command=9)
def set_actor_target_angular_velocity(world: World, actor: Id, turning: Vector) -> None:
    """Set the yaw rate of a vehicle, clockwise seen from above [degrees/s]."""
    world.fleet.set_yaw_rate(world.vehicle(actor).actor_id, -math.radians(turning.z))


@call(command=10)
def add_actor_impulse(world: World, actor: Id, impulse: Vector) -> None:
    """Push a vehicle [N s]; the upward part has no effect."""
    world.fleet.push(world.vehicle(actor).actor_id, *world.map.to_ground(impulse))


@call()
def add_actor_impulse_at_location(
    world: World, actor: Id, impulse: Vector, location: Vector
) -> None:
    """Push a vehicle at a point of the world [N s]."""
    add_actor_impulse(world, actor, impulse)
    world.fleet.spin(actor, _moment(world, actor, impulse, location))


@call(command=11)
def add_actor_force(world: World, actor: Id, force: Vector) -> None:
    """Apply a force to a vehicle during the next tick [N]."""
    world.fleet.force(world.vehicle(actor).actor_id, *world.map.to_ground(force))


@call()
def add_actor_force_at_location(world: World, actor: Id, force: Vector, location: Vector) -> None:
    """Apply a force at a point of the world during the next tick [N]."""
    add_actor_force(world, actor, force)
    world.fleet[actor].torque += _moment(world, actor, force, location)


@call(command=12)
def add_actor_angular_impulse(world: World, actor: Id, impulse: Vector) -> None:
    """Spin a vehicle about the vertical, clockwise seen from above [kg cm^2 degrees/s]."""
    world.fleet.spin(world.vehicle(actor).actor_id, -_TURN * impulse.z)


@call(command=13)
def add_actor_torque(world: World, actor: Id, torque: Vector) -> None:
    """Apply a torque about the vertical during the next tick, clockwise [kg cm^2 degrees/s^2]."""
    world.fleet[world.vehicle(actor).actor_id].torque -= _TURN * torque.z


def _moment(world: World, actor: int, force: Vector, location: Vector) -> float:
    """Moment about the vertical of a force or impulse at a point, anticlockwise."""
    here, there = world.fleet.motion(actor), world.map.motion(Transform(location, UPRIGHT))
    along, across = world.map.to_ground(force)
    return (there.s - here.s) * across - (there.d - here.d) * along


@call()
def enable_actor_constant_velocity(world: World, actor: Id, velocity: Vector) -> None:
    """Keep a velocity in the axes of a vehicle, whatever pedals and forces do [m/s]."""
    # CARLA's y axis points to the right.
    world.fleet[world.vehicle(actor).actor_id].held_velocity = (velocity.x, -velocity.y)


@call()
def disable_actor_constant_velocity(world: World, actor: Id) -> None:
    """Let pedals and forces decide about the velocity of a vehicle again."""
    world.fleet[world.vehicle(actor).actor_id].held_velocity = None


@call(command=15)
def set_actor_enable_gravity(world: World, actor: Id, enabled: Flag) -> None:
    """Refused where it switches gravity off: vehicles stay on the ground."""
    world.actor(actor)
    if not enabled:
        raise Refused("vehicles of this headless server stay on the ground")


def physics_control(world: World, vehicle: Vehicle) -> Physics:
    """`carla.VehiclePhysicsControl` of a body.

    Mass, drag and steering are those that the server drives with. Engine, gears and wheels, which
    our bodies do not have, are made up so that a client that looks at them finds a car.
    """
    body, steering = vehicle.body, world.fleet[vehicle.actor_id].steering
    trigger_friction = world.friction_of(vehicle)
    friction = _TYRE_FRICTION if trigger_friction is None else trigger_friction
    return Physics(
        torque_curve=((0.0, 500.0), (1890.0, 500.0), (5729.0, 400.0)),
        max_rpm=5800.0,
        moi=1.0,
        damping_rate_full_throttle=0.15,
        damping_rate_zero_throttle_clutch_engaged=2.0,
        damping_rate_zero_throttle_clutch_disengaged=0.35,
        use_gear_autobox=True,
        gear_switch_time=0.5,
        clutch_strength=10.0,
        final_ratio=4.0,
        forward_gears=((4.0, 0.5, 0.65), (2.0, 0.5, 0.65), (1.0, 0.5, 0.65)),
        mass=body["mass"],
        drag_coefficient=body["drag_area"] / _frontal_area(vehicle),
        center_of_mass=Vector(0.0, 0.0, 0.0),
        steering_curve=steering.curve,
        wheels=tuple(_wheel(vehicle, k, math.degrees(steering.lock), friction) for k in range(4)),
        use_sweep_wheel_collision=True,
    )


@call(command=5)
def apply_physics_control(world: World, actor: Id, wanted: Physics) -> None:
    """Change mass, drag and steering of a vehicle.

    A heavier vehicle has the same engine and turns as slowly as its mass asks; its brakes stop it
    as before, because grip decides that.

    Raises:
        Refused: A value cannot be, or something else was changed as well, which has no effect.
    """
    vehicle = world.vehicle(actor)
    now = physics_control(world, vehicle)
    lock_deg = max((one.max_steer_angle for one in wanted.wheels[:2]), default=0.0)
    steering = SteeringLimits(math.radians(lock_deg), wanted.steering_curve)
    if not (
        _LIGHTEST <= wanted.mass <= _HEAVIEST
        and wanted.drag_coefficient >= 0.0
        and 0.0 < steering.lock < 0.5 * math.pi
        and steering.is_valid()
    ):
        raise Refused("mass, drag, steering angle or steering curve is out of range")
    heavier = wanted.mass / now.mass
    body = vehicle.body | {
        "mass": wanted.mass,
        "yaw_inertia": vehicle.body["yaw_inertia"] * heavier,
        "launch_accel": vehicle.body["launch_accel"] / heavier,
        "drag_area": wanted.drag_coefficient * _frontal_area(vehicle),
    }
    vehicle.body = body
    world.fleet.set_body(actor, body, steering)
    if ignored := _ignored(now, wanted):
        raise Refused(f"this headless server does not change {', '.join(ignored)} of a vehicle")


_TAKEN = ("mass", "drag_coefficient", "steering_curve", "wheels")


def _ignored(now: Physics, wanted: Physics) -> list[str]:
    """Changes without effect."""
    names = [name for name in Physics._fields if name not in _TAKEN]
    found = [name for name in names if not _same(getattr(now, name), getattr(wanted, name))]
    if len(now.wheels) != len(wanted.wheels):
        return [*found, "number of wheels"]
    for a, b in zip(now.wheels, wanted.wheels, strict=True):
        b = b._replace(max_steer_angle=a.max_steer_angle, position=a.position)
        found += [name for name, x, y in zip(Wheel._fields, a, b, strict=True) if not _same(x, y)]
    return sorted(set(found))


def _same(one: object, other: object) -> bool:
    """Whether two values are the same but for rounding to 32 bits."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-5, abs_tol=1e-9)
    return one == other


def _frontal_area(vehicle: Vehicle) -> float:
    """The area of CARLA's drag: width times height [m^2]."""
    return vehicle.body["width"] * vehicle.body["height"]


def _wheel(vehicle: Vehicle, k: int, lock_deg: float, friction: float) -> Wheel:
    """`carla.WheelPhysicsControl`: front left, front right, rear left, rear right."""
    body, pose = vehicle.body, vehicle.pose
    is_front = k < 2
    ahead = body["cg_to_front"] if is_front else body["cg_to_front"] - body["wheelbase"]
    aside = (0.5 if k % 2 else -0.5) * body["track_width"]
    x, y = rotate(ahead, aside, math.radians(pose.rotation.yaw))
    at = (pose.location.x + x, pose.location.y + y, pose.location.z + WHEEL_RADIUS)
    place = Vector(*(_CM_PER_M * part for part in at))
    return Wheel(
        tire_friction=friction,
        damping_rate=0.25,
        max_steer_angle=lock_deg if is_front else 0.0,
        radius=_CM_PER_M * WHEEL_RADIUS,
        max_brake_torque=1500.0,
        max_handbrake_torque=0.0 if is_front else 3000.0,
        lat_stiff_max_load=2.0,
        lat_stiff_value=17.0,
        long_stiff_value=1000.0,
        position=place,
    )


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
    """Telemetry of a vehicle; engine speed and longitudinal slip are unknown and given as 0.

    Loads and side forces are those of steady cornering, with load transfer by both accelerations.

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapters 1 and 6.
    """
    now = world.fleet.dynamics(vehicle.actor_id)
    control = vehicle.control
    speed = vehicle.forward_speed
    gear = -1 if control.reverse else 1
    drag = (
        float(model_constants().half_air_density) * vehicle.body["drag_area"] * speed * abs(speed)
    )
    wheels = [_wheel_telemetry(vehicle, now, speed, drag, k) for k in range(4)]
    return [speed, control.steer, control.throttle, control.brake, 0.0, gear, drag, wheels]


def _wheel_telemetry(
    vehicle: Vehicle, now: VehicleDynamics, speed: float, drag: float, k: int
) -> WheelTelemetry:
    """Front left, front right, rear left, rear right."""
    body, is_front, is_right = vehicle.body, k < 2, bool(k % 2)
    gravity = float(model_constants().gravity)
    wheelbase, front = body["wheelbase"], body["cg_to_front"]
    arm = front if is_front else wheelbase - front
    share = 1.0 - arm / wheelbase
    rest = 0.5 * share * body["mass"] * gravity
    lift = 0.5 * body["mass"] * now.accel_lon * body["cg_height"] / wheelbase
    lean = share * body["mass"] * now.accel_lat * body["cg_height"] / body["track_width"]
    lean = 0.0 if body["two_wheeler"] else lean
    load = max(rest + (-lift if is_front else lift) + (lean if is_right else -lean), 0.0)
    normal = load / rest
    resistance = drag + body["rolling_resistance"] * body["mass"] * gravity * (speed != 0.0)
    force = body["mass"] * now.accel_lon + resistance
    driven = body["front_drive_share"] if is_front else 1.0 - body["front_drive_share"]
    along = 0.5 * force * (driven if force > 0.0 else share)
    across = -share * body["mass"] * now.accel_lat * normal / 2.0
    return WheelTelemetry(
        tire_friction=now.mu_right if is_right else now.mu_left,
        lat_slip=_slip(now, arm if is_front else -arm, now.wheel_angle if is_front else 0.0),
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


def _slip(now: VehicleDynamics, ahead: float, angle: float) -> float:
    """Slip angle of an axle, to the right [degrees]."""
    if now.vx < _AT_REST:
        return 0.0
    return math.degrees(angle - math.atan2(now.vy + now.yaw_rate * ahead, now.vx))
