"""Intersections of rays with the ground and the boxes of vehicles and props."""

import math
from collections.abc import Callable
from typing import NamedTuple

from overtaking.simulators.carla_server.actors import Prop, Vehicle
from overtaking.simulators.carla_server.arguments import Vector
from overtaking.simulators.carla_server.maps import Map
from overtaking.simulators.carla_server.motion import rotate
from overtaking.simulators.carla_server.world import World

ROAD, TERRAIN = 1, 10
"""`carla.CityObjectLabel` of lanes, and of the ground beside them."""

_STEP = 1.0
_MOST_STEPS = 2000
_HALVINGS = 30
_PARALLEL = 1e-12


class Hit(NamedTuple):
    """`carla.LabelledPoint`: a point and the label of the object there."""

    location: Vector
    label: int


def cast(world: World, start: Vector, end: Vector) -> list[Hit]:
    """Everything that the way from one point to another enters, the nearest first.

    Args:
        world: The world.
        start: Where the ray begins [m].
        end: Where it ends [m].
    """
    found: list[tuple[float, int]] = []
    # This runs in a thread while calls add and remove actors, which a loop over the dict forbids.
    for body in list(world.actors.values()):
        if not isinstance(body, Vehicle | Prop):
            continue
        share = _share_before_entry(body, start, end)
        if share is not None:
            found.append((share, body.tag))
    share = _ground(world.map, start, end)
    if share is not None:
        on_lane = world.map.is_lane(*_at(start, end, share))
        found.append((share, ROAD if on_lane else TERRAIN))
    return [Hit(_at(start, end, share), label) for share, label in sorted(found)]


def project(world: World, start: Vector, direction: Vector, distance: float) -> Hit | None:
    """The first thing that a ray meets within a distance [m], or None."""
    length = math.hypot(*direction)
    if length < _PARALLEL or distance <= 0.0:
        return None
    end = Vector(*(a + distance / length * b for a, b in zip(start, direction, strict=True)))
    return next(iter(cast(world, start, end)), None)


def _at(start: Vector, end: Vector, share: float) -> Vector:
    return Vector(*(a + share * (b - a) for a, b in zip(start, end, strict=True)))


def _share_before_entry(vehicle: Vehicle | Prop, start: Vector, end: Vector) -> float | None:
    """Share of the way after which the box of a body is entered; the slab method."""
    centre = vehicle.pose.location
    yaw = math.radians(vehicle.pose.rotation.yaw)

    def inside(point: Vector) -> tuple[float, float, float]:
        upwards = point.z - centre.z - vehicle.extent.z
        return *rotate(point.x - centre.x, point.y - centre.y, -yaw), upwards

    enter, leave = 0.0, 1.0
    for a, b, half in zip(inside(start), inside(end), vehicle.extent, strict=True):
        if abs(b - a) < _PARALLEL:
            if abs(a) > half:
                return None
            continue
        sides = sorted(((-half - a) / (b - a), (half - a) / (b - a)))
        enter, leave = max(enter, sides[0]), min(leave, sides[1])
    return enter if enter <= leave else None


def _ground(town: Map, start: Vector, end: Vector) -> float | None:
    """Share of the way after which the ground is entered from above."""

    def above(share: float) -> float:
        point = _at(start, end, share)
        return point.z - town.surface(*point).height

    if town.is_flat:
        falls = start.z > 0.0 >= end.z
        return start.z / (start.z - end.z) if falls else None
    length = math.dist(start, end)
    steps = min(max(math.ceil(length / _STEP), 1), _MOST_STEPS)
    last = above(0.0)
    for step in range(1, steps + 1):
        now = above(step / steps)
        if last > 0.0 >= now:
            return _crossing(above, (step - 1) / steps, step / steps)
        last = now
    return None


def _crossing(above: Callable[[float], float], low: float, high: float) -> float:
    """Where a ray that is above the ground at `low` and below it at `high` enters it."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if above(middle) > 0.0 else (low, middle)
    return high
