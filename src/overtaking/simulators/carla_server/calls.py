"""The calls of CARLA's clients. Importing this module declares all of them, those of batches too.

A call is a function of the world, or of the session where it needs the connection; the types of its
other arguments are those that the client has to send. A parameter `_` is ignored.
"""

# No `from __future__ import annotations`: `call` reads the types when a function is declared.

import math
from typing import Annotated, Any

from pydantic import Field

from overtaking.simulators.carla_server import commands, physics, rays
from overtaking.simulators.carla_server.actors import EMPTY_BOX, Prop, bounding_box
from overtaking.simulators.carla_server.arguments import (
    Control,
    Description,
    Flag,
    Gains,
    Id,
    Number,
    Settings,
    Target,
    Text,
    Transform,
    Vector,
    Weather,
    Whole,
)
from overtaking.simulators.carla_server.catalogue import definitions
from overtaking.simulators.carla_server.physics import telemetry
from overtaking.simulators.carla_server.protocol import (
    CALLS,
    VERSION,
    Refused,
    Session,
    call,
    declared,
)
from overtaking.simulators.carla_server.world import World

__all__ = ["CALLS", "commands"]

PACE = 0.002
"""Shortest time from the request of a tick to its snapshot where Traffic Managers run [s].

The client of 0.9.16 wakes its Traffic Manager without holding the lock that the manager waits with.
It never notices a tick that comes too soon after the last one, and waits for ever.
"""

Rows = list[Any]

# --- server and map ---


@call()
def version(_: World) -> str:
    """The version of the server."""
    return VERSION


@call()
def get_episode_info(world: World) -> Rows:
    """Number of the episode, and the stream of its snapshots."""
    return [world.episode, [world.streams.token(world.world_stream)]]


@call()
def get_sensor_token(world: World, stream: Id) -> Rows:
    """Address of a stream, for a client that is about to listen."""
    world.streams.announce(stream)
    return [world.streams.token(stream)]


@call()
def get_episode_settings(world: World) -> Rows:
    """Settings of the world."""
    synchronous, no_rendering, delta, *others = world.settings
    return [synchronous, no_rendering, [False] if delta is None else [True, delta], *others]


@call()
def set_episode_settings(world: World, settings: Settings) -> int:
    """Change the settings; the frame from which they hold."""
    world.settings = settings
    return world.frame


@call()
def get_map_info(world: World) -> Rows:
    """Name and spawn points of the map."""
    return [f"Carla/Maps/{world.map.name}", world.map.spawn_points()]


@call()
def get_map_data(world: World) -> str:
    """OpenDRIVE text of the map."""
    return world.map.opendrive


@call()
def get_available_maps(world: World) -> Rows:
    """Names of the maps."""
    return [f"/Game/Carla/Maps/{name}" for name in world.atlas.names()]


@call()
def load_new_episode(world: World, name: Text, reset_settings: Flag, _: Whole) -> None:
    """Load a map, or the same one again."""
    world.load(name, reset_settings=reset_settings)


@call()
def copy_opendrive_to_file(world: World, opendrive: Text, _: Any) -> None:
    """Take an OpenDRIVE text as the map that is loaded next."""
    world.atlas.learn(opendrive)


# --- time ---


@call()
def tick_cue(session: Session) -> int:
    """Simulate one tick where the client decides when; the frame."""
    world = session.world
    if world.settings.synchronous:
        world.tick(pace=PACE if session.managers else 0.0)
    return world.frame


# --- weather and surroundings ---


@call()
def get_weather_parameters(world: World) -> Rows:
    """The weather."""
    return list(world.weather)


@call()
def set_weather_parameters(world: World, weather: Weather) -> None:
    """Change the weather."""
    world.set_weather(weather)


@call()
def project_point(world: World, location: Vector, direction: Vector, distance: Number) -> Rows:
    """The first hit of a ray from a point in a direction."""
    hit = rays.project(world, location, direction, distance)
    return [hit is not None, hit or [[0.0, 0.0, 0.0], 0]]


@call()
def cast_ray(world: World, start: Vector, end: Vector) -> Rows:
    """All hits of a ray between two points."""
    return list(rays.cast(world, start, end))


def _none(_: World, __: Any) -> Rows:
    """What a real server lists and this one has none of."""
    return []


LISTS = ("get_required_files", "query_lights_state", "get_environment_objects", "get_all_level_BBs")
"""Calls for files to fetch, street lamps, houses and trees, and the boxes of these."""

CALLS.update((name, declared(_none)) for name in LISTS)


@call()
def reset_all_traffic_lights(_: World) -> None:
    """Nothing: there are no traffic lights."""


@call()
def freeze_all_traffic_lights(_: World, __: Flag) -> None:
    """Nothing: there are no traffic lights."""


@call()
def draw_debug_shape(_: World, __: Any) -> None:
    """Refused: there is no window."""
    raise Refused("this headless server has no window to draw in")


@call()
def show_vehicle_debug_telemetry(_: World, __: Id, ___: Flag) -> None:
    """Refused: there is no window."""
    raise Refused("this headless server has no window to show it in")


# --- Traffic Managers, which run in the clients ---


@call()
def is_traffic_manager_running(session: Session, port: Id) -> bool:
    """Whether a client runs one at this port."""
    return port in session.managers


@call()
def get_traffic_manager_running(session: Session, port: Id) -> Rows:
    """Its address."""
    return [session.managers.get(port, ""), port if port in session.managers else 0]


@call()
def add_traffic_manager_running(session: Session, address: tuple[Text, Id]) -> bool:
    """A client has started one; whether the port was free."""
    host, port = address
    if port in session.managers:
        return False
    session.managers[port] = host
    session.own_managers.add(port)
    return True


@call()
def destroy_traffic_manager(session: Session, port: Id) -> bool:
    """A client has stopped one; whether it was registered."""
    session.own_managers.discard(port)
    return session.managers.pop(port, None) is not None


# --- actors ---


@call()
def get_actor_definitions(_: World) -> Rows:
    """The blueprints."""
    return definitions()


@call()
def get_spectator(world: World) -> Rows:
    """The camera of the window that a real server has."""
    return world.layout(world.spectator)


@call()
def get_actors_by_id(world: World, ids: tuple[Id, ...]) -> Rows:
    """The actors among `ids` that exist."""
    return [world.layout(world.actors[one]) for one in ids if one in world.actors]


@call()
def spawn_actor(world: World, wanted: Description, pose: Transform) -> Rows:
    """Add an actor."""
    return world.layout(world.spawn(wanted, pose))


@call()
def spawn_actor_with_parent(
    world: World, wanted: Description, pose: Transform, parent: Id, _: Any, __: str
) -> Rows:
    """Attach a new actor to another; all attachments are rigid."""
    return world.layout(world.spawn(wanted, pose, parent))


@call(command=1)
def destroy_actor(world: World, actor: Id) -> bool:
    """Remove an actor; the client turns the error for a missing one into `False`."""
    if not world.destroy(actor):
        raise Refused(f"unable to destroy actor {actor}: not found")
    return True


@call()
def get_actor_bounding_box(world: World, actor: Id) -> Rows:
    """The box of an actor; an empty one if it does not exist.

    Traffic Managers ask for vehicles that have just been destroyed. An error would end the client.
    """
    found = world.actors.get(actor)
    return bounding_box(found) if found else EMPTY_BOX


@call(command=6)
def set_actor_transform(world: World, actor: Id, pose: Transform) -> None:
    """Move an actor to a pose."""
    world.place_actor(actor, pose)


@call(command=19)
def set_actor_location(world: World, actor: Id, location: Vector) -> None:
    """Move an actor to a location; it keeps its rotation."""
    world.place_actor(actor, world.actor(actor).pose._replace(location=location))


# --- vehicles ---


@call(command=14)
def set_actor_simulate_physics(world: World, actor: Id, moves: Flag) -> None:
    """Whether physics moves a vehicle or a prop."""
    prop = world.actor(actor)
    if isinstance(prop, Prop):
        world.set_prop_physics(prop, has_physics=moves)
        return
    world.fleet[world.vehicle(actor).actor_id].has_physics = moves


@call(command=2)
def apply_control_to_vehicle(world: World, actor: Id, control: Control) -> None:
    """Set pedals and steering."""
    world.vehicle(actor).drive(control)


@call(command=3)
def apply_ackermann_control_to_vehicle(world: World, actor: Id, target: Target) -> None:
    """Let CARLA's Ackermann controller set pedals and steering."""
    world.vehicle(actor).make_for(target)


@call()
def get_ackermann_controller_settings(world: World, actor: Id) -> Gains:
    """Gains of the Ackermann controller."""
    return world.vehicle(actor).gains


@call()
def apply_ackermann_controller_settings(world: World, actor: Id, gains: Gains) -> None:
    """Change the gains of the Ackermann controller."""
    world.vehicle(actor).gains = gains


@call()
def get_physics_control(world: World, actor: Id) -> Rows:
    """`carla.VehiclePhysicsControl` of a vehicle."""
    return list(physics.physics_control(world, world.vehicle(actor)))


@call()
def get_telemetry_data(world: World, actor: Id) -> Rows:
    """`carla.VehicleTelemetryData` of a vehicle."""
    return telemetry(world, world.vehicle(actor))


@call()
def get_wheel_steer_angle(world: World, actor: Id, wheel: Annotated[Id, Field(lt=4)]) -> float:
    """Angle of a wheel, to the right [degrees]; 0 and 1 are in front."""
    angle = world.fleet.dynamics(world.vehicle(actor).actor_id).wheel_angle
    return -math.degrees(angle) if wheel < 2 else 0.0


@call()
def get_vehicle_light_state(world: World, actor: Id) -> Rows:
    """The lamps of a vehicle that are on."""
    return [world.vehicle(actor).lights]


@call()
def set_vehicle_light_state(world: World, actor: Id, lights: tuple[Id]) -> None:
    """Switch the lamps of a vehicle."""
    world.vehicle(actor).lights = lights[0]


@call()
def get_vehicle_light_states(world: World) -> Rows:
    """The lamps of every vehicle that are on."""
    return [[one.actor_id, one.lights] for one in world.vehicles]
