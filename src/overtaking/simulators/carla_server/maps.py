"""The maps of the headless server: roads of the package and OpenDRIVE files."""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError
from overtaking.model.known_roads import ROAD_NAMES, known_road
from overtaking.model.road import Road
from overtaking.recordings.opendrive_writer import write_opendrive
from overtaking.simulators.carla_server.arguments import Rotation, Transform, Vector
from overtaking.simulators.carla_server.motion import (
    LEVELS_APART,
    GroundFrame,
    PlanarMotion,
    rotate,
)

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
        position: x, y and z in CARLA's frame [m].
        yaw: Heading in CARLA's frame [rad].
        slope: Rise for each metre of travel.
        width: Of the lane [m].
        length: Of road that the sample stands for [m].
        marks: Whether there is a left and a right line: 0 none, 1 solid, 2 broken.
        station: Along the lane, for the dashes [m].
        driving: Whether it is a lane to drive in.
    """

    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    slope: NDArray[np.float64]
    width: NDArray[np.float64]
    length: NDArray[np.float64]
    marks: NDArray[np.int64]
    station: NDArray[np.float64]
    driving: NDArray[np.bool_]


class Surface(NamedTuple):
    """The ground at a point.

    Attributes:
        height: Of it [m].
        rise_x, rise_y: Rise for each metre along CARLA's axes.
    """

    height: float = 0.0
    rise_x: float = 0.0
    rise_y: float = 0.0


@dataclass(frozen=True, slots=True)
class Map:
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
    ground: GroundFrame
    lanes: Lanes
    is_flat: bool = True
    _cells: dict[tuple[int, int], list[int]] = field(default_factory=dict, repr=False)

    def motion(self, pose: Transform) -> PlanarMotion:
        """A pose of CARLA in the frame of the ground, at rest."""
        road = self.ground.road
        s, d = road.to_road(pose.location.x, -pose.location.y)
        psi = math.remainder(-math.radians(pose.rotation.yaw) - road.heading, math.tau)
        return PlanarMotion(float(s), float(d), psi, 0.0, 0.0, 0.0)

    def pose(self, motion: PlanarMotion, height: float) -> Transform:
        """A motion as a pose of CARLA, on the ground.

        Args:
            motion: Where in the frame of the ground.
            height: Where it was before, for roads above each other [m].
        """
        road = self.ground.road
        x, y = (float(value) for value in road.to_world(motion.s, motion.d))
        yaw = -math.remainder(motion.heading + road.heading, math.tau)
        here = self.surface(x, -y, height)
        rise = here.rise_x * math.cos(yaw) + here.rise_y * math.sin(yaw)
        rotation = Rotation(math.degrees(math.atan(rise)), math.degrees(yaw), 0.0)
        return Transform(Vector(x, -y, here.height), rotation)

    def limit(self, pose: Transform) -> float:
        """The limit that is posted at a pose [m/s]."""
        road = self.ground.road
        if not road.course:
            return road.speed_limit
        motion = self.motion(pose)
        is_oncoming = road.is_two_way and math.cos(motion.heading) < 0.0
        return float(road.speed_limit_at(motion.s, -1 if is_oncoming else 1))

    def to_world(self, along: float, across: float) -> Vector:
        """A vector of the ground's frame in CARLA's."""
        x, y = rotate(along, across, self.ground.road.heading)
        return Vector(x, -y, 0.0)

    def to_ground(self, vector: Vector) -> tuple[float, float]:
        """A vector of CARLA's frame along and across the ground."""
        return rotate(vector.x, -vector.y, -self.ground.road.heading)

    def surface(self, x: float, y: float, z: float) -> Surface:
        """The ground at a point; the level nearest to height `z` where there are several.

        Beside the lanes the ground is as high as the nearest of them, and 0 far from all.
        """
        found = self._sample(x, y, z)
        if found is None:
            return Surface()
        k, apart = found
        (x0, y0, z0), yaw = self.lanes.position[k].tolist(), float(self.lanes.yaw[k])
        if apart > _ON_LANE:
            return Surface(z0)
        slope = float(self.lanes.slope[k])
        rise_x, rise_y = slope * math.cos(yaw), slope * math.sin(yaw)
        return Surface(z0 + rise_x * (x - x0) + rise_y * (y - y0), rise_x, rise_y)

    def is_lane(self, x: float, y: float, z: float) -> bool:
        """Whether the ground at a point belongs to a lane."""
        if self.is_flat:
            road = self.ground.road
            s, d = road.to_road(x, -y)
            borders = sorted(_lane_borders(road))
            return bool(0.0 <= s <= road.length and borders[0] <= d <= borders[-1])
        found = self._sample(x, y, z)
        return found is not None and found[1] <= _ON_LANE

    def _sample(self, x: float, y: float, z: float) -> tuple[int, float] | None:
        """The sample that a point stands on, or the nearest, and how far from it [m]."""
        near = self._cells.get((math.floor(x / _CELL), math.floor(y / _CELL)), [])
        if not near:
            return None
        near_points = self.lanes.position[near]
        apart = np.hypot(near_points[:, 0] - x, near_points[:, 1] - y)
        heights = near_points[apart < max(_ON_LANE, float(apart.min()) + _LEVEL_REACH), 2]
        level = heights[np.argmin(np.abs(heights - z))]
        apart = np.where(np.abs(near_points[:, 2] - level) < LEVELS_APART, apart, np.inf)
        best = int(np.argmin(apart))
        return near[best], float(apart[best])

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
            x, y, z = (float(part) for part in lanes.position[k])
            pitch = math.degrees(math.atan(float(lanes.slope[k])))
            rotation = Rotation(pitch, math.degrees(float(lanes.yaw[k])), 0.0)
            points.append(Transform(Vector(x, y, z + SPAWN_HEIGHT), rotation))
        return points


_CELL = 10.0
_ON_LANE = 2.5
"""A point nearer than this to the centre of a lane is on the lane [m]."""
_LEVEL_REACH = 0.5
"""How much farther than the nearest lane one of another level may be [m]."""


def cells_of(lanes: Lanes) -> dict[tuple[int, int], list[int]]:
    """Samples that are near each square of 10 m, for `Map.surface`."""
    cells: dict[tuple[int, int], list[int]] = {}
    for k, (x, y, _) in enumerate(lanes.position):
        column, row = math.floor(x / _CELL), math.floor(y / _CELL)
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                cells.setdefault((column + i, row + j), []).append(k)
    return cells


def known_map(name: str) -> Map:
    """A road of ours as a map, under CARLA's name for it where it has one.

    Raises:
        ConfigError: There is no such road.
    """
    key = name.lower()
    if key not in ROAD_NAMES:
        raise _no_map(name, ROAD_NAMES, "an OpenDRIVE file")
    road = known_road(key)
    road = road.extend_to(max(road.length, ROAD_LENGTH))
    carla_name, road_id = _CARLA_NAMES.get(key, (key, "1"))
    return Map(
        carla_name,
        write_opendrive(road, road_id=road_id),
        # The wind-shelter model assumes that all traffic drives in the direction of the road.
        GroundFrame(road, shelters_wind=not road.is_two_way),
        _sampled(road),
    )


def _no_map(name: str, names: Iterable[str], otherwise: str) -> ConfigError:
    return ConfigError(
        what="map",
        where="the headless server",
        expected=" or ".join(names),
        got=repr(name),
        next_step=f"choose one of them, or start the server with {otherwise}",
    )


class Atlas:
    """The maps that a server can load.

    Args:
        maps: Those that it was started with; it begins with the first.
        survey: Makes a map of a name and an OpenDRIVE text.
    """

    def __init__(self, maps: Sequence[Map], survey: Callable[[str, str], Map]) -> None:
        """Know these maps, and our roads."""
        self.first = maps[0]
        self._survey = survey
        self._learned = {one.name: one for one in maps}

    def names(self) -> list[str]:
        """Names of all maps."""
        ours = {_CARLA_NAMES.get(name, (name,))[0] for name in ROAD_NAMES}
        return sorted(ours | set(self._learned))

    def find(self, name: str) -> Map:
        """The map of a name.

        Raises:
            ConfigError: There is none.
        """
        if name in self._learned:
            return self._learned[name]
        if name.lower() in ROAD_NAMES:
            return known_map(name)
        raise _no_map(name, self.names(), f"--map {name}.xodr as well")

    def learn(self, opendrive: str) -> None:
        """Take an OpenDRIVE text as the map that clients call `OpenDriveMap`.

        Raises:
            OvertakingError: It cannot be read, or nothing is installed that reads it.
        """
        self._learned[LEARNED] = self._survey(LEARNED, opendrive)


_SAMPLE = 10.0
_NO_MARK, _SOLID, _BROKEN = 0, 1, 2


def _lane_borders(road: Road) -> list[float]:
    """Lateral position `d` of the borders of all lanes, the oncoming one last [m]."""
    borders = road.lane_boundaries.tolist()
    if road.is_two_way and (opposing_lane := road.overtaking_side_neighbour) is not None:
        borders.append(borders[-1] + road.overtaking_sign * opposing_lane.width)
    return borders


def _sampled(road: Road) -> Lanes:
    """Samples of the driving lanes of a straight road with right-hand traffic, both directions."""
    stations = np.arange(0.5 * _SAMPLE, road.length, _SAMPLE)
    borders = _lane_borders(road)
    centre_marks = _overtaking_edge_marks(road, stations)
    tables: list[dict[str, NDArray[Any]]] = []
    for k, (start, end) in enumerate(itertools.pairwise(borders)):
        is_oncoming = k == road.num_lanes
        lane = road.overtaking_side_neighbour if is_oncoming else road.lanes[k]
        assert lane is not None
        # Stations grow in the direction of travel of the lane.
        s = road.length - stations if is_oncoming else stations
        x, y = road.to_world(s, np.full(len(s), 0.5 * (start + end)))
        left, right = (
            np.full(len(s), drawn_mark(mark.value)) for mark in (lane.left_mark, lane.right_mark)
        )
        if is_oncoming:
            # The road names left and right in its own direction, opposite to this lane's.
            left, right = centre_marks[::-1], left
        elif k == road.num_lanes - 1:
            left = centre_marks
        tables.append(
            {
                "position": np.stack([x, -y, np.zeros_like(x)], axis=1),
                "yaw": np.full(len(s), -road.heading - (math.pi if is_oncoming else 0.0)),
                "slope": np.zeros(len(s)),
                "width": np.full(len(s), lane.width),
                "length": np.full(len(s), _SAMPLE),
                "marks": np.stack([left, right], axis=1),
                "station": stations,
                "driving": np.ones(len(s), np.bool_),
            }
        )
    columns = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    return Lanes(**columns)


def _overtaking_edge_marks(road: Road, stations: NDArray[np.float64]) -> NDArray[np.int64]:
    """Drawn mark on the fast side of the driving lanes at each station, shape (station,)."""
    starts, marks = zip(*road.overtaking_edge_marks, strict=True)
    drawn = np.array([drawn_mark(mark.value) for mark in marks])
    return drawn[np.searchsorted(starts, stations, side="right") - 1]


def drawn_mark(mark: str) -> int:
    """How a line is drawn whose mark is spelled as CARLA does."""
    if mark in ("NONE", "Other", "Curb", "Grass"):
        return _NO_MARK
    return _BROKEN if mark.startswith(("Broken", "Botts")) else _SOLID
