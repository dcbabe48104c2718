"""The calls about actors: vehicles, sensors and the spectator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from overtaking.carla_server import answers, commands, physics
from overtaking.carla_server.actors import EMPTY_BOX, bounding_box
from overtaking.carla_server.answers import NOTHING, Refused, value
from overtaking.carla_server.arguments import (
    anything,
    control,
    description,
    listed,
    number,
    record,
    text,
    transform,
    unsigned,
    vector,
    yes_or_no,
)
from overtaking.carla_server.catalogue import definitions
from overtaking.carla_server.protocol import call

if TYPE_CHECKING:
    from overtaking.carla_server.answers import Answer
    from overtaking.carla_server.arguments import Control, Description, Transform, Vector
    from overtaking.carla_server.protocol import Session


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


@call(unsigned, yes_or_no, void=True)
def set_actor_simulate_physics(session: Session, actor: int, moves: bool) -> Answer:
    """Whether physics moves a vehicle."""
    session.world.fleet.set_moves(session.world.vehicle(actor).actor_id, moves=moves)
    return NOTHING


@call(unsigned, yes_or_no, void=True)
def set_actor_enable_gravity(session: Session, actor: int, _: bool) -> Answer:
    """Nothing: vehicles stay on the ground."""
    session.world.actor(actor)
    return NOTHING


@call(unsigned, control, void=True)
def apply_control_to_vehicle(session: Session, actor: int, wanted: Control) -> Answer:
    """Set pedals and steering."""
    session.world.vehicle(actor).control = wanted
    return NOTHING


@call(unsigned)
def get_physics_control(session: Session, actor: int) -> Answer:
    """What CARLA would say of a body like this one."""
    return value(physics.physics_control(session.world.vehicle(actor)))


@call(unsigned, anything, void=True)
def apply_physics_control(session: Session, actor: int, _: Any) -> Answer:
    """Refused: bodies are those of our vehicle classes."""
    session.world.vehicle(actor)
    return answers.void_refusal("this headless server does not change the bodies of vehicles")


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


@call(unsigned, number, void=True)
def show_vehicle_debug_telemetry(_: Session, __: int, ___: float) -> Answer:
    """Nothing: there is no window."""
    return NOTHING


@call(listed(commands.command), yes_or_no)
def apply_batch(session: Session, wanted: tuple[commands.Command, ...], ticks: bool) -> Answer:
    """Do several things; the only answer that is not wrapped."""
    done = [commands.apply(session.world, one) for one in wanted]
    if ticks and session.world.settings.synchronous:
        session.world.tick()
    return done
