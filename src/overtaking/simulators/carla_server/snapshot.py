"""What the server pushes to clients: packed bytes behind a header, one layout for each sensor."""

import struct
from collections.abc import Iterable
from enum import IntEnum

from overtaking.simulators.carla_server.actors import Actor, Vehicle
from overtaking.simulators.carla_server.arguments import Transform, Vector
from overtaking.simulators.carla_server.wire import encode

_HEADER = struct.Struct("<QQd6f")
_EPISODE = struct.Struct("<Qdf3iI")
_ACTOR = struct.Struct("<IB15f")
_VEHICLE = struct.Struct("<fff???ifB?IB")
_ACTOR_STATE_BYTES = 54
_IMAGE = struct.Struct("<IIf")
_TOKEN = struct.Struct("<IHBB16s")
_ACTIVE = 1
_GREEN = 2
_TCP = 1
_USE_RPC_HOST = 0


class SensorType(IntEnum):
    """Places of the sensors in the client's registry."""

    COLLISION = 0
    CAMERA = 13
    WORLD = 17


def token(stream: int, port: int) -> bytes:
    """Where a client finds a stream: this port on the host that it knows already."""
    return _TOKEN.pack(stream, port, _TCP, _USE_RPC_HOST, bytes(16))


def header(kind: SensorType, frame: int, time: float, pose: Transform) -> bytes:
    """What every message of a stream begins with; `time` is that of the simulation [s]."""
    return _HEADER.pack(kind, frame, time, *pose.location, *pose.rotation)


def world(episode: int, time: float, delta: float, states: Iterable[bytes]) -> bytes:
    """The body of a snapshot.

    Args:
        episode: Its number; a new one tells clients that the map has changed.
        time: Of the platform; the simulation's own, so that nothing depends on a clock [s].
        delta: Length of the last tick [s].
        states: Of all actors, see `state`.
    """
    return _EPISODE.pack(episode, time, delta, 0, 0, 0, 0) + b"".join(states)


def state(actor: Actor, pose: Transform, speed_limit_kmh: float) -> bytes:
    """An actor in a snapshot, in CARLA's frame; angles in degrees.

    Args:
        actor: The actor.
        pose: Where it is in the world.
        speed_limit_kmh: Limit that the vehicle reads.
    """
    rates, rest = (0.0,) * 9, b""
    if isinstance(actor, Vehicle):
        rates = (*actor.velocity, 0.0, 0.0, actor.turning, *actor.acceleration)
        rest = _VEHICLE.pack(*actor.control, speed_limit_kmh, _GREEN, False, 0, 0)
    head = _ACTOR.pack(actor.actor_id, _ACTIVE, *pose.location, *pose.rotation, *rates)
    return head + rest.ljust(_ACTOR_STATE_BYTES, b"\0")


def collision(own: object, other: object, impulse: Vector) -> bytes:
    """The body of a collision: both actors, and the impulse on the first [N s]."""
    return encode([own, other, list(impulse)])


def image(width: int, height: int, fov_deg: float, pixels: bytes) -> bytes:
    """The body of a picture: four bytes a pixel, blue first."""
    return _IMAGE.pack(width, height, fov_deg) + pixels
