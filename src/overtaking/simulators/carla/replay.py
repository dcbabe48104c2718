"""Plays a recorded simulation in CARLA, pose by pose, and films it with CARLA's cameras.

Physics is off: in each frame every vehicle has its recorded pose. On a real server the films, and
the data of other sensors, are photorealistic.
"""

import contextlib
import math
import os
import queue
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError, MissingExtraError
from overtaking.model.trajectories import ANGLE_RESOLUTION, POSITION_RESOLUTION, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.simulators.carla.library import CALL_TIME, LOAD_TIME
from overtaking.simulators.carla.world import (
    MAPS,
    Lamps,
    SimulationLostError,
    blueprint_of,
    fresh_world,
    leave,
    set_weather,
    synchronous,
)

VIEWS = ("behind", "above")
"""The cameras: after the ego, and over it."""

PARTIAL = ".partial"
"""Folder for films that are not finished."""

_PATIENCE = 20.0  # For the picture of a tick [s].
_HIDDEN_DEPTH = -60.0  # Where vehicles wait that are not there yet [m].
_HEIGHT_ABOVE = 32.0
_FOV_DEG = 90.0
_CRF = "20"
_WHERE = "carla replay"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayJob:
    """A simulation to play.

    Attributes:
        run: A batch of one.
        folder: Where the films go; it exists.
        name: How their names begin.
        size: Width and height, even numbers [pixels].
        opendrive: The road as a map, None where CARLA has it.
    """

    run: Trajectories
    folder: Path
    name: str
    size: tuple[int, int]
    opendrive: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed(ContentEquality):
    """A replayed simulation.

    Attributes:
        files: The films, in the order of `VIEWS`.
        num_frames: Frames of each.
    """

    files: tuple[Path, ...]
    num_frames: int


def check_size(size: tuple[int, int]) -> None:
    """Refuse pictures that no encoder takes, or no memory."""
    width, height = size
    if width % 2 or height % 2 or not (16 <= width <= 1920 and 16 <= height <= 1080):
        raise ConfigError(
            what="size",
            where="carla replay",
            expected="even numbers from 16x16 to 1920x1080",
            got=f"{width}x{height}",
            next_step="choose another size, such as 1280x720",
        )


def encoder() -> ModuleType:
    """PyAV.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        import av
    except ImportError:
        raise MissingExtraError.for_extra(
            "video", what="PyAV, which encodes films", where="carla replay"
        ) from None
    return av


def replay(
    carla: Any, client: Any, send_heartbeat: Callable[[], None], *, job: ReplayJob
) -> Replayed:
    """Play and film a simulation.

    Args:
        carla: The module.
        client: A connected client.
        send_heartbeat: Called after every tick.
        job: What is played.

    Raises:
        ConfigError: The server has no such map.
        SimulationLostError: A vehicle could not be spawned, or a picture did not come.
    """
    replay = _Replay(carla, _world(client, job), job.run)
    partial = job.folder / PARTIAL
    partial.mkdir(exist_ok=True)
    films = [
        _Film(encoder(), partial / f"{job.name}-{view}.mp4", job.size, replay.rate)
        for view in VIEWS
    ]
    try:
        cameras = [replay.camera(view, job.size) for view in VIEWS]
        for frame in range(replay.num_frames):
            number = replay.show(frame)
            for film, camera in zip(films, cameras, strict=True):
                film.add(_picture(camera, number))
            send_heartbeat()
        files = tuple(film.close(job.folder) for film in films)
    finally:
        replay.tear_down()
        for film in films:
            film.drop()
        with contextlib.suppress(OSError):  # Another one is still being made.
            partial.rmdir()
    return Replayed(files=files, num_frames=replay.num_frames)


def _world(client: Any, job: ReplayJob) -> Any:
    """An empty world of the map with the road, with a tick for each frame."""
    delta = 1e-3 * job.run.scenario.frame_interval_ms
    if job.opendrive is None:
        return fresh_world(client, job.run.road, delta=delta)
    client.set_timeout(LOAD_TIME)
    world = client.generate_opendrive_world(job.opendrive)
    client.set_timeout(CALL_TIME)
    synchronous(world, delta=delta)
    return world


def map_of(run: Trajectories) -> str | None:
    """CARLA's name of the map that has the road, None if there is none."""
    return MAPS.get(run.road.name)


@dataclass(slots=True)
class _Replay:
    """The recorded vehicles in a world."""

    carla: Any
    world: Any
    run: Trajectories
    _actors: dict[int, Any] = field(default_factory=dict)
    _offsets: dict[int, float] = field(default_factory=dict)
    _cameras: list[Any] = field(default_factory=list)
    _lamps: Lamps = field(init=False)
    _ground: float = 0.0

    def __post_init__(self) -> None:
        """Set weather and vehicles."""
        scenario, carla = self.run.scenario, self.carla
        set_weather(carla, self.world, scenario)
        self._lamps = Lamps(carla, self._actors)
        here = self.world.get_map().get_waypoint(self._pose(EGO_SLOT, 0).location)
        start = float(self.run.road.height_at(self._station(EGO_SLOT, 0)))
        self._ground = here.transform.location.z - start if here else 0.0
        for slot in np.flatnonzero(scenario.vehicles.valid[0]).tolist():
            self._spawn(slot)

    @property
    def num_frames(self) -> int:
        """Recorded frames."""
        return int(self.run.num_frames[0])

    @property
    def rate(self) -> int:
        """Frames a second."""
        return round(1000 / self.run.scenario.frame_interval_ms)

    def show(self, frame: int) -> int:
        """Move all vehicles to their recorded poses; the number of the tick."""
        for slot, actor in self._actors.items():
            actor.set_transform(self._pose(slot, frame))
            self._lamps.switch(slot, int(self.run.states.lights[0, slot, frame]))
        self.world.get_spectator().set_transform(self._over(frame))
        return int(self.world.tick())

    def camera(self, view: str, size: tuple[int, int]) -> "queue.Queue[Any]":
        """A camera on the ego, and where its pictures come."""
        carla = self.carla
        blueprint = self.world.get_blueprint_library().find("sensor.camera.rgb")
        values = {"image_size_x": size[0], "image_size_y": size[1], "fov": _FOV_DEG}
        for name, value in values.items():
            blueprint.set_attribute(name, str(value))
        tall = float(self.run.scenario.vehicles.height[0, EGO_SLOT])
        back = 4.0 + float(self.run.scenario.vehicles.length[0, EGO_SLOT])
        if view == "behind":
            place, pitch = carla.Location(x=-back, z=tall + 2.0), -12.0
        else:
            place, pitch = carla.Location(x=8.0, z=_HEIGHT_ABOVE), -90.0
        pose = carla.Transform(place, carla.Rotation(pitch=pitch))
        camera = self.world.spawn_actor(blueprint, pose, attach_to=self._actors[EGO_SLOT])
        pictures: queue.Queue[Any] = queue.Queue()
        camera.listen(pictures.put)
        self._cameras.append(camera)
        return pictures

    def tear_down(self) -> None:
        """Remove all actors and let the server run freely, as before."""
        leave(self.world, self._cameras, list(self._actors.values()))

    def _spawn(self, slot: int) -> None:
        """Spawn a vehicle above the traffic and switch its physics off."""
        blueprint = blueprint_of(self.world, self.run.scenario, slot)
        pose = self._pose(slot, 0)
        pose.location.z += 2.0
        actor = self.world.try_spawn_actor(blueprint, pose)
        if actor is None:  # Recorded vehicles may touch: this one comes in from aside.
            pose.location.y += 40.0 + 20.0 * slot
            actor = self.world.try_spawn_actor(blueprint, pose)
        if actor is None:
            refusal = "a refusal of the server"
            raise SimulationLostError.because(_WHERE, f"vehicle {slot}", "room for it", refusal)
        actor.set_simulate_physics(False)
        self._actors[slot] = actor
        self._offsets[slot] = float(actor.bounding_box.location.x)

    def _pose(self, slot: int, frame: int) -> Any:
        """Where a vehicle was recorded, as CARLA has it; its y points to the right."""
        states, carla = self.run.states, self.carla
        heading = float(states.heading[0, slot, frame]) * ANGLE_RESOLUTION
        back = self._offsets.get(slot, 0.0)
        x = float(states.x[0, slot, frame]) * POSITION_RESOLUTION - back * math.cos(heading)
        y = float(states.y[0, slot, frame]) * POSITION_RESOLUTION - back * math.sin(heading)
        is_there = bool(self.run.state_mask[0, slot, frame])
        road, s = self.run.road, self._station(slot, frame)
        slope = float(road.grade_at(s)) * math.cos(heading - float(road.heading_at(s)))
        z = self._ground + float(road.height_at(s)) if is_there else _HIDDEN_DEPTH
        turned = carla.Rotation(yaw=-math.degrees(heading), pitch=math.degrees(math.atan(slope)))
        return carla.Transform(carla.Location(x, -y, z), turned)

    def _station(self, slot: int, frame: int) -> float:
        """Where along the road a vehicle was recorded [m]."""
        return float(self.run.states.s[0, slot, frame]) * POSITION_RESOLUTION

    def _over(self, frame: int) -> Any:
        """Where a person looks at the ego from."""
        carla, pose = self.carla, self._pose(EGO_SLOT, frame)
        pose.location.z += _HEIGHT_ABOVE
        pose.rotation = carla.Rotation(pitch=-90.0, yaw=pose.rotation.yaw)
        return pose


def _picture(pictures: "queue.Queue[Any]", frame: int) -> Any:
    """The picture of a tick."""
    try:
        while True:
            picture = pictures.get(timeout=_PATIENCE)
            if picture.frame >= frame:
                break
    except queue.Empty:
        expected = f"a picture within {_PATIENCE:g} s"
        raise SimulationLostError.because(_WHERE, "camera", expected, "none") from None
    rows = np.frombuffer(picture.raw_data, np.uint8)
    return rows.reshape(picture.height, picture.width, 4)[:, :, :3]


class _Film:
    """An mp4 file that appears when it is complete.

    Args:
        av: PyAV.
        path: Of the unfinished file.
        size: Width and height [pixels].
        rate: Frames a second.
    """

    def __init__(self, av: ModuleType, path: Path, size: tuple[int, int], rate: int) -> None:
        """Begin."""
        self._av, self._path = av, path
        self._container = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        self._stream = self._container.add_stream("libx264", rate=rate)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"
        self._stream.options = {"crf": _CRF, "preset": "veryfast"}

    def add(self, picture: Any) -> None:
        """Add a picture: blue, green, red, shape (height, width, 3)."""
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
        for packet in self._stream.encode(frame):
            self._container.mux(packet)

    def close(self, folder: Path) -> Path:
        """Complete the file and put it where it belongs."""
        for packet in self._stream.encode():
            self._container.mux(packet)
        self._container.close()
        with self._path.open("rb+") as file:
            os.fsync(file.fileno())
        return self._path.replace(folder / self._path.name)

    def drop(self) -> None:
        """Leave nothing of a film that was not completed."""
        self._container.close()
        self._path.unlink(missing_ok=True)
