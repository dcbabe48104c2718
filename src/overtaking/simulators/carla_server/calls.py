"""The calls about the server, its maps, time, weather and Traffic Managers.

A call is a function of the session and its arguments; its decorator says which arguments it takes.
What it returns goes to the client as it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from overtaking.simulators.carla_server import rays
from overtaking.simulators.carla_server.answers import NOTHING, Refused, value
from overtaking.simulators.carla_server.arguments import (
    anything,
    number,
    record,
    settings,
    text,
    unsigned,
    vector,
    weather,
    whole,
    yes_or_no,
)
from overtaking.simulators.carla_server.protocol import VERSION, call

if TYPE_CHECKING:
    from overtaking.simulators.carla_server.answers import Answer
    from overtaking.simulators.carla_server.arguments import Settings, Vector
    from overtaking.simulators.carla_server.protocol import Session

PACE = 0.002
"""Least time between a tick being asked for and its snapshot where Traffic Managers run [s].

The client of 0.9.16 wakes its Traffic Manager without holding the lock that the manager waits with,
so a tick that comes too soon after the last is never seen and the client waits for ever.
"""

# --- server and map ---


@call()
def version(_: Session) -> Answer:
    """The version of the server."""
    return value(VERSION)


@call()
def get_episode_info(session: Session) -> Answer:
    """Number of the episode, and where its snapshots come from."""
    world = session.world
    return value([world.episode, [world.streams.token(world.world_stream)]])


@call(unsigned)
def get_sensor_token(session: Session, stream: int) -> Answer:
    """Where a stream is; who asks is about to listen."""
    session.world.streams.announce(stream)
    return value([session.world.streams.token(stream)])


@call()
def get_episode_settings(session: Session) -> Answer:
    """Settings of the world."""
    now = session.world.settings
    delta = [False] if now.fixed_delta is None else [True, now.fixed_delta]
    return value(now._replace(fixed_delta=delta))  # type: ignore[arg-type]


@call(settings)
def set_episode_settings(session: Session, wanted: Settings) -> Answer:
    """Change the settings; the frame from which on they hold."""
    session.world.settings = wanted
    return value(session.world.frame)


@call()
def get_map_info(session: Session) -> Answer:
    """Name and spawn points of the map."""
    place = session.world.place
    return value([f"Carla/Maps/{place.name}", place.spawn_points()])


@call()
def get_map_data(session: Session) -> Answer:
    """OpenDRIVE text of the map."""
    return value(session.world.place.opendrive)


@call(text)
def get_required_files(_: Session, __: str) -> Answer:
    """Files that a client should fetch: none, it works everything out from the OpenDRIVE."""
    return value([])


@call()
def get_available_maps(session: Session) -> Answer:
    """Names of the maps."""
    return value([f"/Game/Carla/Maps/{name}" for name in session.world.atlas.names()])


@call(text, yes_or_no, whole, void=True)
def load_new_episode(session: Session, name: str, reset_settings: bool, _: int) -> Answer:
    """Load a map, or the same one again."""
    session.world.load(name, reset_settings=reset_settings)
    return NOTHING


@call(text, anything, void=True)
def copy_opendrive_to_file(session: Session, opendrive: str, _: Any) -> Answer:
    """Take an OpenDRIVE text as the map that is loaded next."""
    session.world.atlas.learn(opendrive)
    return NOTHING


# --- time ---


@call()
def tick_cue(session: Session) -> Answer:
    """Let one tick pass."""
    world = session.world
    if world.settings.synchronous:
        world.tick(pace=PACE if session.managers else 0.0)
    return value(world.frame)


# --- weather and what stands in the world ---


@call()
def get_weather_parameters(session: Session) -> Answer:
    """The weather."""
    return value(list(session.world.weather))


@call(weather, void=True)
def set_weather_parameters(session: Session, wanted: tuple[float, ...]) -> Answer:
    """Change the weather."""
    session.world.set_weather(wanted)
    return NOTHING


@call(anything)
def query_lights_state(_: Session, __: Any) -> Answer:
    """Street lamps: there are none."""
    return value([])


@call(anything)
def get_environment_objects(_: Session, __: Any) -> Answer:
    """Houses and trees: there are none."""
    return value([])


@call(anything)
def get_all_level_BBs(_: Session, __: Any) -> Answer:
    """Boxes of houses and trees: there are none."""
    return value([])


@call(vector, vector, number)
def project_point(session: Session, location: Vector, direction: Vector, distance: float) -> Answer:
    """The first thing on the way from a point in a direction."""
    hit = rays.project(session.world, location, direction, distance)
    return value([hit is not None, hit or [[0.0, 0.0, 0.0], 0]])


@call(vector, vector)
def cast_ray(session: Session, start: Vector, end: Vector) -> Answer:
    """Everything on the way from one point to another."""
    return value(rays.cast(session.world, start, end))


@call(void=True)
def reset_all_traffic_lights(_: Session) -> Answer:
    """Nothing: there are no traffic lights."""
    return NOTHING


@call(yes_or_no, void=True)
def freeze_all_traffic_lights(_: Session, __: bool) -> Answer:
    """Nothing: there are no traffic lights."""
    return NOTHING


@call(anything, void=True)
def draw_debug_shape(_: Session, __: Any) -> Answer:
    """Nothing: there is no window."""
    raise Refused("this headless server has no window to draw in")


# --- Traffic Managers, which run in the clients ---


@call(unsigned)
def is_traffic_manager_running(session: Session, port: int) -> Answer:
    """Whether a client has one at this port."""
    return value(port in session.managers)


@call(unsigned)
def get_traffic_manager_running(session: Session, port: int) -> Answer:
    """Where it is."""
    return value([session.managers.get(port, ""), port if port in session.managers else 0])


@call(record(lambda *pair: pair, text, unsigned))
def add_traffic_manager_running(session: Session, where: tuple[str, int]) -> Answer:
    """A client has started one; whether the port was free."""
    host, port = where
    if port in session.managers:
        return value(False)
    session.managers[port] = host
    session.own_managers.add(port)
    return value(True)


@call(unsigned)
def destroy_traffic_manager(session: Session, port: int) -> Answer:
    """A client has stopped one; whether it was there."""
    session.own_managers.discard(port)
    return value(session.managers.pop(port, None) is not None)
