"""The calls about actors: vehicles, sensors and the spectator."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from overtaking.simulators.carla_server import answers, commands, physics
from overtaking.simulators.carla_server.actors import EMPTY_BOX, bounding_box
from overtaking.simulators.carla_server.answers import NOTHING, Refused, value
from overtaking.simulators.carla_server.arguments import (
    ackermann_gains,
    ackermann_target,
    anything,
    control,
    description,
    listed,
    one_of,
    physics_control,
    record,
    text,
    transform,
    unsigned,
    vector,
    yes_or_no,
)
from overtaking.simulators.carla_server.catalogue import definitions
from overtaking.simulators.carla_server.protocol import call
from overtaking.simulators.carla_server.telemetry import telemetry

if TYPE_CHECKING:
    from overtaking.simulators.carla_server.answers import Answer
    from overtaking.simulators.carla_server.arguments import (
        Control,
        Description,
        Gains,
        Physics,
        Target,
        Transform,
        Vector,
    )
    from overtaking.simulators.carla_server.protocol import Session


@call()
def get_actor_definitions(_: Session) -> Answer:
    """The blueprints."""
    return value(definitions())


@call()
def get_spectator(session: Session) -> Answer:
    """The camera of the window that is not there."""
    world = session.world
    return value(world.layout(world.spectator))


@call(listed(unsigned))
def get_actors_by_id(session: Session, ids: tuple[int, ...]) -> Answer:
    """Those of some actors that are there."""
    world = session.world
    return value([world.layout(world.actors[one]) for one in ids if one in world.actors])


@call(description, transform)
def spawn_actor(session: Session, wanted: Description, pose: Transform) -> Answer:
    """Put an actor into the world."""
    world = session.world
    return value(world.layout(world.spawn(wanted, pose)))


@call(description, transform, unsigned, anything, text)
def spawn_actor_with_parent(
    session: Session, wanted: Description, pose: Transform, parent: int, _: Any, __: str
) -> Answer:
    """Attach an actor to another; all attachments are rigid."""
    world = session.world
    return value(world.layout(world.spawn(wanted, pose, parent)))


@call(unsigned)
def destroy_actor(session: Session, actor: int) -> Answer:
    """Take an actor away; the client turns the error for one that is gone into `False`."""
    if not session.world.destroy(actor):
        raise Refused(f"unable to destroy actor {actor}: not found")
    return value(True)


@call(unsigned)
def get_actor_bounding_box(session: Session, actor: int) -> Answer:
    """The box of an actor; an empty one if it is gone.

    Traffic Managers ask for vehicles that have just been destroyed. An error would end the client.
    """
    found = session.world.actors.get(actor)
    return value(bounding_box(found) if found else EMPTY_BOX)


@call(unsigned, transform, void=True)
def set_actor_transform(session: Session, actor: int, pose: Transform) -> Answer:
    """Put an actor elsewhere."""
    session.world.place_actor(actor, pose)
    return NOTHING


@call(unsigned, vector, void=True)
def set_actor_location(session: Session, actor: int, location: Vector) -> Answer:
    """Put an actor elsewhere, turned as it is."""
    world = session.world
    world.place_actor(actor, world.actor(actor).pose._replace(location=location))
    return NOTHING


@call(unsigned, vector, void=True)
def set_actor_target_velocity(session: Session, actor: int, velocity: Vector) -> Answer:
    """Give a vehicle a velocity."""
    session.world.set_velocity(actor, velocity)
    return NOTHING


@call(unsigned, vector, void=True)
def set_actor_target_angular_velocity(session: Session, actor: int, turning: Vector) -> Answer:
    """Give a vehicle a yaw rate [degrees/s]."""
    physics.set_turning(session.world, actor, turning)
    return NOTHING


@call(unsigned, vector, void=True)
def add_actor_impulse(session: Session, actor: int, impulse: Vector) -> Answer:
    """Push a vehicle [N s]."""
    physics.push(session.world, actor, impulse)
    return NOTHING


@call(unsigned, vector, void=True)
def add_actor_force(session: Session, actor: int, force: Vector) -> Answer:
    """Let a force act during the next tick [N]."""
    physics.force(session.world, actor, force)
    return NOTHING


@call(unsigned, vector, vector, void=True)
def add_actor_impulse_at_location(
    session: Session, actor: int, impulse: Vector, location: Vector
) -> Answer:
    """Push a vehicle at a place of the world [N s]."""
    physics.push_at(session.world, actor, impulse, location)
    return NOTHING


@call(unsigned, vector, vector, void=True)
def add_actor_force_at_location(
    session: Session, actor: int, force: Vector, location: Vector
) -> Answer:
    """Let a force act at a place of the world during the next tick [N]."""
    physics.force_at(session.world, actor, force, location)
    return NOTHING


@call(unsigned, vector, void=True)
def add_actor_angular_impulse(session: Session, actor: int, impulse: Vector) -> Answer:
    """Spin a vehicle about the vertical."""
    physics.spin(session.world, actor, impulse)
    return NOTHING


@call(unsigned, vector, void=True)
def add_actor_torque(session: Session, actor: int, torque: Vector) -> Answer:
    """Let a torque about the vertical act during the next tick."""
    physics.twist(session.world, actor, torque)
    return NOTHING


@call(unsigned, vector, void=True)
def enable_actor_constant_velocity(session: Session, actor: int, velocity: Vector) -> Answer:
    """Keep a velocity in the axes of a vehicle."""
    physics.hold_velocity(session.world, actor, velocity)
    return NOTHING


@call(unsigned, void=True)
def disable_actor_constant_velocity(session: Session, actor: int) -> Answer:
    """Leave the velocity of a vehicle to pedals and forces again."""
    physics.release_velocity(session.world, actor)
    return NOTHING


@call(unsigned, yes_or_no, void=True)
def set_actor_simulate_physics(session: Session, actor: int, moves: bool) -> Answer:
    """Whether physics moves a vehicle."""
    session.world.fleet.set_moves(session.world.vehicle(actor).actor_id, moves=moves)
    return NOTHING


@call(unsigned, yes_or_no, void=True)
def set_actor_enable_gravity(session: Session, actor: int, enabled: bool) -> Answer:
    """Nothing: vehicles stay on the ground."""
    physics.set_gravity(session.world, actor, enabled)
    return NOTHING


@call(unsigned, control, void=True)
def apply_control_to_vehicle(session: Session, actor: int, wanted: Control) -> Answer:
    """Set pedals and steering."""
    session.world.vehicle(actor).drive(wanted)
    return NOTHING


@call(unsigned, ackermann_target, void=True)
def apply_ackermann_control_to_vehicle(session: Session, actor: int, wanted: Target) -> Answer:
    """Let CARLA's Ackermann controller set pedals and steering."""
    session.world.vehicle(actor).make_for(wanted)
    return NOTHING


@call(unsigned)
def get_ackermann_controller_settings(session: Session, actor: int) -> Answer:
    """Gains of the Ackermann controller."""
    return value(session.world.vehicle(actor).gains)


@call(unsigned, ackermann_gains, void=True)
def apply_ackermann_controller_settings(session: Session, actor: int, gains: Gains) -> Answer:
    """Change the gains of the Ackermann controller."""
    session.world.vehicle(actor).gains = gains
    return NOTHING


@call(unsigned)
def get_physics_control(session: Session, actor: int) -> Answer:
    """What CARLA would say of a body like this one."""
    return value(physics.physics_control(session.world, session.world.vehicle(actor)))


@call(unsigned, physics_control, void=True)
def apply_physics_control(session: Session, actor: int, wanted: Physics) -> Answer:
    """Change mass, drag and steering of a vehicle; all else is refused."""
    physics.apply_physics_control(session.world, actor, wanted)
    return NOTHING


@call(unsigned)
def get_telemetry_data(session: Session, actor: int) -> Answer:
    """What is known of a vehicle and its wheels."""
    return value(telemetry(session.world, session.world.vehicle(actor)))


@call(unsigned, one_of(range(4)))
def get_wheel_steer_angle(session: Session, actor: int, wheel: int) -> Answer:
    """Angle of a wheel, to the right [degrees]; 0 and 1 are in front."""
    angle = session.world.fleet.driven(session.world.vehicle(actor).actor_id).angle
    return value(-math.degrees(angle) if wheel < 2 else 0.0)


@call(unsigned)
def get_vehicle_light_state(session: Session, actor: int) -> Answer:
    """Which lamps are on."""
    return value([session.world.vehicle(actor).lights])


@call(unsigned, record(int, unsigned), void=True)
def set_vehicle_light_state(session: Session, actor: int, lights: int) -> Answer:
    """Switch lamps."""
    session.world.vehicle(actor).lights = lights
    return NOTHING


@call()
def get_vehicle_light_states(session: Session) -> Answer:
    """Which lamps of which vehicles are on."""
    return value([[one.actor_id, one.lights] for one in session.world.vehicles])


@call(unsigned, yes_or_no, void=True)
def show_vehicle_debug_telemetry(_: Session, __: int, ___: bool) -> Answer:
    """Nothing: there is no window."""
    raise Refused("this headless server has no window to show it in")


@call(listed(commands.command), yes_or_no, refuse=answers.batch_refusal)
def apply_batch(session: Session, wanted: tuple[commands.Command, ...], ticks: bool) -> Answer:
    """Do several things; the only answer that is not wrapped."""
    done = [commands.apply(session, one) for one in wanted]
    if ticks and session.world.settings.synchronous:
        session.world.tick()
    return done
