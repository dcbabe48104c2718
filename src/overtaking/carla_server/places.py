"""The maps of the headless server: a road of ours, or somebody's OpenDRIVE file."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from overtaking.carla_server.arguments import Rotation, Transform, Vector
from overtaking.carla_server.motion import Ground, Motion
from overtaking.core.errors import ConfigError
from overtaking.exchange.opendrive_writer import write_opendrive
from overtaking.knowledge.roads import ROAD_NAMES
from overtaking.model.known_roads import known_road

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from overtaking.model.road import Road

ROAD_LENGTH = 3000.0
"""Length to which a road of ours is extended [m]: a minute and a half at motorway speed."""

SPAWN_SPACING = 30.0
"""Distance of the spawn points of a lane [m]."""

SPAWN_HEIGHT = 0.3
"""Spawn points float this high, as CARLA's do, so that nothing starts in the ground [m]."""

LEARNED = "OpenDriveMap"
"""Name that `carla.Client.generate_opendrive_world` loads."""

_CARLA_NAMES = {"town06": ("Town06", "40")}
"""Name that scripts know a road by, and its id in CARLA's own file."""


@dataclass(frozen=True, slots=True)
class Lanes:
    """Samples of all lanes of a map, for heights, spawn points and pictures; shape (sample, ...).

    Attributes:
        place: x, y and z in CARLA's frame [m].
        yaw: Heading in CARLA's frame [rad].
        width: Of the lane [m].
        length: Of road that the sample stands for [m].
        marks: Whether there is a left and a right line: 0 none, 1 solid, 2 broken.
        station: Along the lane, for the dashes [m].
        driving: Whether it is a lane to drive in.
    """

    place: NDArray[np.float64]
    yaw: NDArray[np.float64]
    width: NDArray[np.float64]
    length: NDArray[np.float64]
    marks: NDArray[np.int64]
    station: NDArray[np.float64]
    driving: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Place:
    """One map.

    Attributes:
        name: As `carla.Map.name` ends.
        opendrive: Its OpenDRIVE text.
        ground: What vehicles stand on, and whose frame they live in.
        lanes: Samples of its lanes.
        is_flat: Whether it lies at height zero.
    """

    name: str
    opendrive: str
    ground: Ground
    lanes: Lanes
    is_flat: bool = True
    _cells: dict[tuple[int, int], list[int]] = field(default_factory=dict, repr=False)

    def motion(self, pose: Transform) -> Motion:
        """A pose of CARLA in the frame of the ground, at rest."""
        road = self.ground.road
        s, d = road.road_coordinates(pose.location.x, -pose.location.y)
        psi = math.remainder(-math.radians(pose.rotation.yaw) - road.heading, math.tau)
        return Motion(float(s), float(d), psi, 0.0, 0.0, 0.0)

    def pose(self, motion: Motion) -> Transform:
        """A motion's place as a pose of CARLA, on the ground."""
        road = self.ground.road
        x, y = (float(value) for value in road.world(motion.s, motion.d))
        yaw = -math.degrees(math.remainder(motion.psi + road.heading, math.tau))
        return Transform(Vector(x, -y, self.height(x, -y)), Rotation(0.0, yaw, 0.0))

    def to_world(self, along: float, across: float) -> Vector:
        """A vector of the ground's frame in CARLA's."""
        cosine, sine = math.cos(self.ground.road.heading), math.sin(self.ground.road.heading)
        return Vector(along * cosine - across * sine, -(along * sine + across * cosine), 0.0)

    def to_ground(self, vector: Vector) -> tuple[float, float]:
        """A vector of CARLA's frame along and across the ground."""
        cosine, sine = math.cos(self.ground.road.heading), math.sin(self.ground.road.heading)
        return vector.x * cosine - vector.y * sine, -vector.y * cosine - vector.x * sine

    def height(self, x: float, y: float) -> float:
        """Height of the nearest lane [m]; 0 far from all of them."""
        if self.is_flat:
            return 0.0
        near = self._cells.get((math.floor(x / _CELL), math.floor(y / _CELL)), [])
        if not near:
            return 0.0
        apart = np.hypot(self.lanes.place[near, 0] - x, self.lanes.place[near, 1] - y)
        return float(self.lanes.place[near[int(np.argmin(apart))], 2])

    def spawn_points(self) -> list[Transform]:
        """Where vehicles may be put, lane by lane."""
        points: list[Transform] = []
        lanes = self.lanes
        last = -math.inf
        for k in np.nonzero(lanes.driving)[0]:
            station = float(lanes.station[k])
            if 0.0 <= station - last < SPAWN_SPACING:
                continue
            last = station
            x, y, z = (float(part) for part in lanes.place[k])
            turned = Rotation(0.0, math.degrees(float(lanes.yaw[k])), 0.0)
            points.append(Transform(Vector(x, y, z + SPAWN_HEIGHT), turned))
        return points


_CELL = 10.0


def cells_of(lanes: Lanes) -> dict[tuple[int, int], list[int]]:
    """Samples that are near each square of 10 m, for `Place.height`."""
    cells: dict[tuple[int, int], list[int]] = {}
    for k, (x, y, _) in enumerate(lanes.place):
        column, row = math.floor(x / _CELL), math.floor(y / _CELL)
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                cells.setdefault((column + i, row + j), []).append(k)
    return cells


def known_place(name: str) -> Place:
    """A road of ours as a map, under CARLA's name for it where it has one.

    Raises:
        ConfigError: There is no such road.
    """
    key = name.lower()
    if key not in ROAD_NAMES:
        raise ConfigError.of(
            what="map",
            where="the headless server",
            expected=" or ".join(ROAD_NAMES),
            got=repr(name),
            next_step="choose one of them, or start the server with an OpenDRIVE file",
        )
    road = known_road(key)
    road = road.extended(max(road.length, ROAD_LENGTH))
    carla_name, road_id = _CARLA_NAMES.get(key, (key, "1"))
    return Place(
        carla_name,
        write_opendrive(road, road_id=road_id),
        Ground(road, shelters=True),
        _sampled(road),
    )


class Atlas:
    """The maps that a server can load.

    Args:
        first: The one that it begins with.
        survey: Makes a map of a name and an OpenDRIVE text.
    """

    def __init__(self, first: Place, survey: Callable[[str, str], Place]) -> None:
        """Know the first map, and our roads."""
        self.first = first
        self._survey = survey
        self._learned = {first.name: first}

    def names(self) -> list[str]:
        """Names of all maps."""
        ours = {_CARLA_NAMES.get(name, (name,))[0] for name in ROAD_NAMES}
        return sorted(ours | set(self._learned))

    def find(self, name: str) -> Place:
        """The map of a name; ConfigError if there is none."""
        return self._learned.get(name) or known_place(name)

    def learn(self, opendrive: str) -> None:
        """Take an OpenDRIVE text as the map that clients call `OpenDriveMap`.

        Raises:
            OvertakingError: It cannot be read, or nothing is installed that reads it.
        """
        self._learned[LEARNED] = self._survey(LEARNED, opendrive)


_SAMPLE = 10.0
_NO_MARK, _SOLID, _BROKEN = 0, 1, 2


def _sampled(road: Road) -> Lanes:
    """Samples of the driving lanes of a straight road."""
    stations = np.arange(0.5 * _SAMPLE, road.length, _SAMPLE)
    every = len(stations)
    s = np.tile(stations, road.num_lanes)
    x, y = road.world(s, np.repeat(road.centres, every))
    marks = [[_kind(lane.left_mark.value), _kind(lane.right_mark.value)] for lane in road.lanes]
    return Lanes(
        place=np.stack([x, -y, np.zeros_like(x)], axis=1),
        yaw=np.full(len(s), -road.heading),
        width=np.repeat([lane.width for lane in road.lanes], every),
        length=np.full(len(s), _SAMPLE),
        marks=np.repeat(np.array(marks), every, axis=0),
        station=s,
        driving=np.ones(len(s), np.bool_),
    )


def _kind(mark: str) -> int:
    """How a mark, spelled as CARLA does, is drawn."""
    if mark in ("NONE", "Other", "Curb", "Grass"):
        return _NO_MARK
    return _BROKEN if mark.startswith(("Broken", "Botts")) else _SOLID
