"""The picture of a camera: lanes, lines and boxes in plain colours, with a line that says so.

It shows where things are and what the weather is, so that code which looks at pictures can be run.
It is no substitute for CARLA's own camera, and every picture says that.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.simulators.carla_server.boxes import Face, faces
from overtaking.simulators.carla_server.lettering import stamp
from overtaking.simulators.carla_server.raster import Lens, fill, project, projected

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from overtaking.simulators.carla_server.actors import Vehicle
    from overtaking.simulators.carla_server.arguments import Transform
    from overtaking.simulators.carla_server.places import Lanes, Place

Image = NDArray[np.uint8]
Points = NDArray[np.float64]
Colour = tuple[float, float, float]
"""Blue, green and red, 0 to 255."""

NOTE = "OVERTAKING: DRAWN, NOT UNREAL"

FAR = 300.0
"""What is farther away than this is not drawn [m]."""

_LINE_WIDTH = 0.15
_DASH, _PERIOD = 4.0, 10.0  # Of broken lines [m].
_ASPHALT: Colour = (92.0, 90.0, 88.0)
_VERGE: Colour = (78.0, 118.0, 92.0)
_PAINT: Colour = (235.0, 238.0, 240.0)
_SKY_HIGH: Colour = (214.0, 158.0, 96.0)
_SKY_LOW: Colour = (238.0, 218.0, 192.0)
_CLOUD: Colour = (176.0, 172.0, 168.0)
_LEAST_LIGHT = 0.28
_FOG_RANGE = 50.0  # Where the thickest fog leaves 1/e of the contrast [m].
_RAIN_WETS = 0.35  # By how much water darkens the road.


class Air(NamedTuple):
    """What weather does to a picture.

    Attributes:
        light: Brightness, 1 by day.
        haze: Extinction of fog and rain [1/m].
        cloud: Cover of the sky, 0 to 1.
        wet: Water on the road, 0 to 1.
    """

    light: float
    haze: float
    cloud: float
    wet: float

    @property
    def horizon(self) -> NDArray[np.float64]:
        """Colour of the sky at the horizon, which far things fade into."""
        return self.light * _mixed(_SKY_LOW, _CLOUD, self.cloud)


class Scene:
    """The lanes of a map, ready to be drawn from anywhere.

    Args:
        place: The map.
    """

    def __init__(self, place: Place) -> None:
        """Lay out the surfaces and lines."""
        self._asphalt = _surfaces(place.lanes)
        self._lines = _lines(place.lanes)

    def draw(
        self,
        pose: Transform,
        size: tuple[int, int],
        fov_deg: float,
        vehicles: Iterable[Vehicle],
        weather: Sequence[float],
    ) -> Image:
        """A picture.

        Args:
            pose: Of the camera, in CARLA's frame.
            size: Width and height [pixels].
            fov_deg: Horizontal field of view [degrees].
            vehicles: What is on the road.
            weather: The fourteen numbers of `carla.WeatherParameters`.

        Returns:
            Blue, green, red and opacity of each pixel, shape (height, width, 4).
        """
        lens = Lens.of(pose, size, fov_deg)
        air = air_of(weather)
        image = np.full((size[1], size[0], 4), 255, np.uint8)
        _backdrop(image, lens, air)
        asphalt = (1.0 - _RAIN_WETS * air.wet) * np.array(_ASPHALT)
        _flat(image, lens, air, self._asphalt, asphalt)
        _flat(image, lens, air, self._lines, np.array(_PAINT))
        _vehicles(image, lens, air, vehicles)
        stamp(image, NOTE)
        return image


def air_of(weather: Sequence[float]) -> Air:
    """What `carla.WeatherParameters` does to a picture."""
    cloudiness, rain, puddles, _, _, altitude, fog, *_ = weather
    light = min(max((altitude + 8.0) / 30.0, _LEAST_LIGHT), 1.0)
    haze = (fog / 100.0) ** 2 / _FOG_RANGE + 0.1 * rain / 100.0 / _FOG_RANGE
    return Air(light, haze, cloudiness / 100.0, max(rain, puddles) / 100.0)


def _mixed(one: Sequence[float], other: Sequence[float], share: float) -> NDArray[np.float64]:
    return (1.0 - share) * np.array(one) + share * np.array(other)


def _quads(place: Points, yaw: Points, along: Points, aside: tuple[Points, Points]) -> Points:
    """Flat rectangles on the road, shape (quad, 4, 3).

    Args:
        place: Points of the lanes' middles, shape (quad, 3) [m].
        yaw: Headings in CARLA's frame [rad].
        along: Lengths, the point in the middle [m].
        aside: Where they begin and end to the right of the middle [m].
    """
    ahead = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    right = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=1)
    half = 0.5 * along[:, None] * ahead
    corners = [
        place + sign * half + side[:, None] * right
        for sign, side in ((1, aside[0]), (1, aside[1]), (-1, aside[1]), (-1, aside[0]))
    ]
    return np.stack(corners, axis=1)


def _surfaces(lanes: Lanes) -> Points:
    """The surface of every lane; a little longer than its piece, so that no gaps show."""
    half = 0.5 * lanes.width
    return _quads(lanes.place, lanes.yaw, lanes.length * 1.02, (-half, half))


def _lines(lanes: Lanes) -> Points:
    """The painted lines."""
    found: list[Points] = []
    for column, side in ((0, -1.0), (1, 1.0)):
        edge = side * 0.5 * lanes.width
        strip = (edge - 0.5 * _LINE_WIDTH, edge + 0.5 * _LINE_WIDTH)
        kind = lanes.marks[:, column]
        # A piece as long as the period has one dash; a shorter one is part of a dash, or none.
        dashed = (lanes.length >= _PERIOD) | (lanes.station % _PERIOD < _DASH)
        length = np.where(kind == 1, lanes.length * 1.02, np.minimum(lanes.length, _DASH))
        drawn = (kind == 1) | ((kind == 2) & dashed)
        every = _quads(lanes.place, lanes.yaw, length, strip)
        found.append(every[drawn])
    return np.concatenate(found)


def _backdrop(image: Image, lens: Lens, air: Air) -> None:
    """Sky above the horizon, verge below."""
    height = image.shape[0]
    rows = np.arange(height)
    horizon = int(np.clip(lens.horizon, 0, height))
    high = air.light * _mixed(_SKY_HIGH, _CLOUD, air.cloud)
    share = np.clip((horizon - rows) / max(0.6 * height, 1.0), 0.0, 1.0)[:, None]
    image[:, :, :3] = (air.horizon * (1.0 - share) + high * share).astype(np.uint8)[:, None]
    # The nearer the horizon, the farther the ground and the thicker the haze before it.
    depth = lens.focal * max(lens.place[2], 1.0) / np.maximum(rows[horizon:] - lens.horizon, 0.5)
    clear = np.exp(-air.haze * np.minimum(depth, 2.0 * FAR))[:, None]
    ground = air.light * np.array(_VERGE)
    image[horizon:, :, :3] = (ground * clear + air.horizon * (1.0 - clear)).astype(np.uint8)[
        :, None
    ]


def _flat(image: Image, lens: Lens, air: Air, quads: Points, colour: Points) -> None:
    """Draw what lies on the ground and is near enough."""
    centre = quads.mean(axis=1) - np.array(lens.place)
    distance = np.hypot(centre[:, 0], centre[:, 1])
    near = distance < FAR
    for k, corners in projected(lens, quads[near]):
        fill(image, corners, _faded(air, air.light * colour, float(distance[near][k])))


def _faded(air: Air, colour: Points, distance: float) -> Points:
    clear = math.exp(-air.haze * distance)
    return colour * clear + air.horizon * (1.0 - clear)


def _vehicles(image: Image, lens: Lens, air: Air, vehicles: Iterable[Vehicle]) -> None:
    """Draw vehicles, the farthest first."""
    eye = np.array(lens.place)
    for vehicle in sorted(vehicles, key=lambda one: -math.dist(one.pose.location, lens.place)):
        seen: list[tuple[float, Face]] = [
            (float(np.linalg.norm(face.corners.mean(axis=0) - eye)), face)
            for face in faces(vehicle, eye)
        ]
        for distance, face in sorted(seen, key=lambda pair: (pair[1].glows, -pair[0])):
            corners = project(lens, face.corners)
            light = 1.0 if face.glows else air.light
            if corners is not None and distance < FAR:
                fill(image, corners, _faded(air, light * np.array(face.colour), distance))
