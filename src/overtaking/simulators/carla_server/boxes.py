"""Vehicles as boxes with windows and lamps, and props as boxes, for pictures."""

import math
from collections.abc import Iterator
from enum import IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.model.vehicles import VehicleKind
from overtaking.simulators.carla_server.actors import Prop, Vehicle

Points = NDArray[np.float64]
Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 255."""

GLASS: Colour = (48.0, 58.0, 70.0)
TYRE: Colour = (34.0, 36.0, 38.0)
_RED: Colour = (235.0, 40.0, 40.0)
_WHITE: Colour = (250.0, 245.0, 225.0)
_PROP: Colour = (214.0, 122.0, 52.0)
_AMBER: Colour = (250.0, 150.0, 30.0)
_SHADES = {"top": 1.0, "front": 0.82, "rear": 0.74, "left": 0.62, "right": 0.68}
_BONNET = 0.56  # Height of bonnet and boot over that of the body.
_CABIN = (-0.62, 0.32)  # Where a car's cabin begins and ends, over half its length.
_LAMP = 0.16  # Size of a lamp [m].


class LightBit(IntFlag):
    """Bits of `carla.VehicleLightState`."""

    POSITION = 1
    LOW_BEAM = 2
    HIGH_BEAM = 4
    BRAKE = 8
    RIGHT_BLINKER = 16
    LEFT_BLINKER = 32
    REVERSE = 64
    FOG = 128


class Face(NamedTuple):
    """A flat piece of a vehicle: corners in the world, shape (4, 3), and how it looks."""

    corners: Points
    colour: Colour
    glows: bool = False


def faces(body: Vehicle | Prop, eye: Points) -> Iterator[Face]:
    """The pieces of a vehicle or a prop that face the eye.

    Args:
        body: The vehicle or prop.
        eye: The point from which the picture is taken, in CARLA's frame [m].
    """
    length, width, height = body.extent
    rotation = _axes_to_world(body)
    eye_in_body_frame = (eye - np.array(body.pose.location)) @ rotation
    for box, colour in _parts(body, length, width, 2.0 * height):
        for name, corners in _sides(box, eye_in_body_frame):
            shade = _SHADES[name]
            paint = (shade * colour[0], shade * colour[1], shade * colour[2])
            yield _face_in_world(body, rotation, corners, paint)
    if isinstance(body, Vehicle):
        for corners, colour in _lamps(body, length, width, 2.0 * height, eye_in_body_frame):
            yield _face_in_world(body, rotation, corners, colour)._replace(glows=True)


Box = tuple[float, float, float, float, float, float]
"""Rear, front, left, right, bottom and top in the vehicle's axes [m]."""


def _parts(
    vehicle: Vehicle | Prop, length: float, width: float, height: float
) -> Iterator[tuple[Box, Colour]]:
    """The boxes of a vehicle and their colours; a prop is one box."""
    if isinstance(vehicle, Prop):
        yield (-length, length, -width, width, 0.0, height), _PROP
        return
    kind, paint = int(vehicle.body["kind"]), _paint(vehicle)
    ground = 0.18
    if kind in (VehicleKind.MOTORCYCLE, VehicleKind.BICYCLE):
        yield (-length, length, -0.12, 0.12, 0.0, 0.5 * height), TYRE
        yield (-0.4, 0.35, -0.5 * width, 0.5 * width, 0.4 * height, height), paint
    elif kind in (VehicleKind.TRUCK, VehicleKind.VAN):
        cab = length - min(0.5 * length, 2.0)
        yield (-length, cab, -width, width, ground, height), paint
        yield (cab, length, -width, width, ground, 0.9 * height), GLASS
    else:
        rear, front = (share * length for share in _CABIN)
        yield (-length, length, -width, width, ground, _BONNET * height), paint
        yield (rear, front, -0.9 * width, 0.9 * width, _BONNET * height, height), GLASS


def _paint(vehicle: Vehicle) -> Colour:
    try:
        red, green, blue = (float(x) for x in vehicle.attribute("color", "").split(","))
    except ValueError:
        return (160.0, 160.0, 160.0)
    return (red, green, blue)


def _sides(box: Box, eye: Points) -> Iterator[tuple[str, Points]]:
    """The sides of a box that face the eye, corners in the vehicle's axes."""
    rear, front, left, right, low, high = box
    if eye[2] > high:
        yield "top", _flat((rear, left, high), (front, left, high), (front, right, high))
    if eye[0] > front:
        yield "front", _flat((front, left, low), (front, right, low), (front, right, high))
    if eye[0] < rear:
        yield "rear", _flat((rear, left, low), (rear, right, low), (rear, right, high))
    if eye[1] > right:
        yield "right", _flat((rear, right, low), (front, right, low), (front, right, high))
    if eye[1] < left:
        yield "left", _flat((rear, left, low), (front, left, low), (front, left, high))


def _flat(*corners: tuple[float, float, float]) -> Points:
    """A parallelogram from three of its corners."""
    one, two, three = (np.array(corner) for corner in corners)
    return np.array([one, two, three, one + three - two])


def _lamps(
    vehicle: Vehicle, length: float, width: float, height: float, eye: Points
) -> Iterator[tuple[Points, Colour]]:
    """The lamps that are on and face the eye."""
    on, control = LightBit(vehicle.lights & 0xFF), vehicle.control
    behind = eye[0] < 0.0
    x = (-1.0 if behind else 1.0) * (length + 0.01)
    high = min(0.42 * height, 0.8)
    braking = control.brake > 0.0 or LightBit.BRAKE in on
    lit = bool(on & (LightBit.POSITION | LightBit.LOW_BEAM | LightBit.HIGH_BEAM | LightBit.FOG))
    size = _LAMP * (1.5 if braking and behind else 1.0)
    inner = 0.85 * width
    for side in (-1.0, 1.0):
        if (braking and behind) or lit:
            yield _square(x, side * inner, high, size), _RED if behind else _WHITE
        blinker = LightBit.LEFT_BLINKER if side < 0 else LightBit.RIGHT_BLINKER
        if blinker in on:
            yield _square(x, side * inner, high + 2.0 * _LAMP, _LAMP), _AMBER


def _square(x: float, y: float, z: float, size: float) -> Points:
    low, high = z - size, z + size
    return _flat((x, y - size, low), (x, y + size, low), (x, y + size, high))


def _axes_to_world(vehicle: Vehicle | Prop) -> Points:
    """From the vehicle's axes to the world's; pitch and roll are left out."""
    yaw = math.radians(vehicle.pose.rotation.yaw)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array(((cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)))


def _face_in_world(
    vehicle: Vehicle | Prop, rotation: Points, corners: Points, colour: Colour
) -> Face:
    return Face(corners @ rotation.T + np.array(vehicle.pose.location), colour)
