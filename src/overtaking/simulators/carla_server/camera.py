"""The picture of a camera: lanes, lines and boxes in plain colours, with a note.

It shows positions and weather, so that code which reads pictures can run. It is no substitute for
CARLA's own camera, and the note in each picture says that.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking._core import Canvas, Drawing
from overtaking.simulators.carla_server.actors import Prop, Vehicle
from overtaking.simulators.carla_server.arguments import Transform
from overtaking.simulators.carla_server.boxes import Colour, Face, faces
from overtaking.simulators.carla_server.maps import Lanes, Map
from overtaking.simulators.carla_server.raster import Lens, project, projected

Image = NDArray[np.uint8]
Points = NDArray[np.float64]

NOTE = "OVERTAKING: DRAWN, NOT UNREAL"

FAR = 300.0
"""Largest distance of drawn objects [m]."""

_LINE_WIDTH = 0.15
_DASH, _PERIOD = 4.0, 10.0  # Of broken lines [m].
_ASPHALT: Colour = (88.0, 90.0, 92.0)
_VERGE: Colour = (92.0, 118.0, 78.0)
_PAINT: Colour = (240.0, 238.0, 235.0)
_SKY_HIGH: Colour = (96.0, 158.0, 214.0)
_SKY_LOW: Colour = (192.0, 218.0, 238.0)
_CLOUD: Colour = (168.0, 172.0, 176.0)
_LEAST_LIGHT = 0.28
_FOG_RANGE = 50.0  # Where the thickest fog leaves 1/e of the contrast [m].
_RAIN_WETS = 0.35  # By how much water darkens the road.

_ROWS = 7
_COLUMNS = 5
# Each row of a letter as five bits, from the top.
_LETTERS = {
    "A": (14, 17, 17, 31, 17, 17, 17),
    "D": (30, 17, 17, 17, 17, 17, 30),
    "E": (31, 16, 16, 30, 16, 16, 31),
    "G": (14, 17, 16, 23, 17, 17, 14),
    "I": (14, 4, 4, 4, 4, 4, 14),
    "K": (17, 18, 20, 24, 20, 18, 17),
    "L": (16, 16, 16, 16, 16, 16, 31),
    "N": (17, 25, 21, 19, 17, 17, 17),
    "O": (14, 17, 17, 17, 17, 17, 14),
    "R": (30, 17, 17, 30, 20, 18, 17),
    "T": (31, 4, 4, 4, 4, 4, 4),
    "U": (17, 17, 17, 17, 17, 17, 14),
    "V": (17, 17, 17, 17, 17, 10, 4),
    "W": (17, 17, 17, 21, 21, 27, 17),
    ",": (0, 0, 0, 0, 4, 4, 8),
    ":": (0, 4, 0, 0, 0, 4, 0),
    " ": (0, 0, 0, 0, 0, 0, 0),
}
_MARGIN = 2


class Air(NamedTuple):
    """Effects of the weather on a picture.

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


class RoadScene:
    """The lanes of a map, ready to be drawn from anywhere.

    Args:
        town: The map.
    """

    def __init__(self, town: Map) -> None:
        """Lay out the surfaces and lines."""
        self._asphalt = _surfaces(town.lanes)
        self._lines = _lines(town.lanes)

    def draw(
        self,
        pose: Transform,
        size: tuple[int, int],
        fov_deg: float,
        bodies: Iterable[Vehicle | Prop],
        weather: Sequence[float],
    ) -> Image:
        """Draw a picture.

        Args:
            pose: Pose of the camera, in CARLA's frame.
            size: Width and height [pixels].
            fov_deg: Horizontal field of view [degrees].
            bodies: The vehicles and props on the road.
            weather: The fourteen numbers of `carla.WeatherParameters`.

        Returns:
            Blue, green, red and opacity of each pixel, shape (height, width, 4).
        """
        lens, air, drawing = Lens.of(pose, size, fov_deg), air_of(weather), Drawing()
        _backdrop(drawing, lens, air)
        asphalt = (1.0 - _RAIN_WETS * air.wet) * np.array(_ASPHALT)
        _flat(drawing, lens, air, self._asphalt, asphalt)
        _flat(drawing, lens, air, self._lines, np.array(_PAINT))
        _bodies(drawing, lens, air, bodies)
        stamp(drawing, size, NOTE)
        canvas = Canvas(*size, "#000000")
        canvas.draw(drawing)
        image = np.full((size[1], size[0], 4), 255, np.uint8)
        image[:, :, :3] = canvas.to_rgb()[:, :, ::-1]
        return image


def air_of(weather: Sequence[float]) -> Air:
    """What `carla.WeatherParameters` does to a picture."""
    cloudiness, rain, puddles, _, _, altitude, fog, *_ = weather
    light = min(max((altitude + 8.0) / 30.0, _LEAST_LIGHT), 1.0)
    haze = (fog / 100.0) ** 2 / _FOG_RANGE + 0.1 * rain / 100.0 / _FOG_RANGE
    return Air(light, haze, cloudiness / 100.0, max(rain, puddles) / 100.0)


def _mixed(one: Sequence[float], other: Sequence[float], share: float) -> NDArray[np.float64]:
    return (1.0 - share) * np.array(one) + share * np.array(other)


def _quads(middles: Points, yaw: Points, along: Points, aside: tuple[Points, Points]) -> Points:
    """Flat rectangles on the road, shape (quad, 4, 3).

    Args:
        middles: Points of the lanes' middles, shape (quad, 3) [m].
        yaw: Headings in CARLA's frame [rad].
        along: Lengths, the point in the middle [m].
        aside: Where they begin and end to the right of the middle [m].
    """
    ahead = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    right = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=1)
    half = 0.5 * along[:, None] * ahead
    corners = [
        middles + sign * half + side[:, None] * right
        for sign, side in ((1, aside[0]), (1, aside[1]), (-1, aside[1]), (-1, aside[0]))
    ]
    return np.stack(corners, axis=1)


def _surfaces(lanes: Lanes) -> Points:
    """The surface of every lane; a little longer than its piece, so that no gaps show."""
    half = 0.5 * lanes.width
    return _quads(lanes.position, lanes.yaw, lanes.length * 1.02, (-half, half))


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
        every = _quads(lanes.position, lanes.yaw, length, strip)
        found.append(every[drawn])
    return np.concatenate(found)


def _backdrop(drawing: Drawing, lens: Lens, air: Air) -> None:
    """Draw sky above the horizon and verge below, row by row."""
    rows = np.arange(lens.height)
    horizon = int(np.clip(lens.horizon, 0, lens.height))
    high = air.light * _mixed(_SKY_HIGH, _CLOUD, air.cloud)
    share = np.clip((horizon - rows) / max(0.6 * lens.height, 1.0), 0.0, 1.0)[:, None]
    colours = air.horizon * (1.0 - share) + high * share
    # The nearer the horizon, the farther the ground and the thicker the haze before it.
    depth = lens.focal * max(lens.position[2], 1.0) / np.maximum(rows[horizon:] - lens.horizon, 0.5)
    clear = np.exp(-air.haze * np.minimum(depth, 2.0 * FAR))[:, None]
    colours[horizon:] = air.light * np.array(_VERGE) * clear + air.horizon * (1.0 - clear)
    for row, colour in enumerate(colours):
        drawing.rect((0.0, lens.width), (row, row + 1), _named(colour))


def _flat(drawing: Drawing, lens: Lens, air: Air, quads: Points, colour: Points) -> None:
    """Draw flat shapes on the ground that are near enough."""
    centre = quads.mean(axis=1) - np.array(lens.position)
    distance = np.hypot(centre[:, 0], centre[:, 1])
    near = distance < FAR
    for k, corners in projected(lens, quads[near]):
        paint = _faded(air, air.light * colour, float(distance[near][k]))
        _fill(drawing, corners, paint)


def _faded(air: Air, colour: Points, distance: float) -> Points:
    clear = math.exp(-air.haze * distance)
    return colour * clear + air.horizon * (1.0 - clear)


def _fill(drawing: Drawing, corners: Points, colour: Points) -> None:
    """Add a polygon on the picture."""
    points: list[tuple[float, float]] = [(x, y) for x, y in corners.tolist()]
    drawing.polygon(points, _named(colour))


def _named(colour: Points) -> str:
    """Red, green and blue, 0 to 255, as `#rrggbb`."""
    return f"#{bytes(np.clip(colour, 0.0, 255.0).astype(np.uint8)).hex()}"


def _bodies(drawing: Drawing, lens: Lens, air: Air, bodies: Iterable[Vehicle | Prop]) -> None:
    """Draw vehicles and props, the farthest first."""
    eye = np.array(lens.position)
    for body in sorted(bodies, key=lambda one: -math.dist(one.pose.location, lens.position)):
        seen: list[tuple[float, Face]] = [
            (float(np.linalg.norm(face.corners.mean(axis=0) - eye)), face)
            for face in faces(body, eye)
        ]
        for distance, face in sorted(seen, key=lambda pair: (pair[1].glows, -pair[0])):
            corners = project(lens, face.corners)
            light = 1.0 if face.glows else air.light
            if corners is not None and distance < FAR:
                paint = _faded(air, light * np.array(face.colour), distance)
                _fill(drawing, corners, paint)


def dots(text: str) -> NDArray[np.bool_]:
    """A text as dots, shape (7, 6 per letter); KeyError for other letters."""
    columns = [
        [bool(row >> (_COLUMNS - 1 - k) & 1) for row in _LETTERS[letter]]
        if k < _COLUMNS
        else [False] * _ROWS
        for letter in text
        for k in range(_COLUMNS + 1)
    ]
    return np.array(columns).T


def stamp(drawing: Drawing, size: tuple[int, int], text: str) -> None:
    """Write a text on a dark strip at the bottom left, twice as large on a large picture.

    Args:
        drawing: Gets the shapes.
        size: Width and height of the picture [pixels]; the rest is cut off.
        text: Of the letters in this module.
    """
    width, height = size
    scale = max(1, min(width // 360, height // 180))
    pattern = np.kron(np.pad(dots(text), _MARGIN), np.ones((scale, scale), np.bool_))
    top, columns = max(height - len(pattern), 0), min(pattern.shape[1], width)
    drawing.rect((0.0, columns), (top, height), "#000000", opacity=0.67)
    covered = np.where(pattern[: height - top, :columns], np.uint8(255), np.uint8(0))
    drawing.mask(np.ascontiguousarray(covered), (0, top), "#ffffff")
