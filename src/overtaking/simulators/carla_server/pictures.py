"""Draws the pictures of cameras in a thread of its own, so that calls are answered meanwhile."""

import asyncio
import copy
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

from overtaking.simulators.carla_server import snapshot
from overtaking.simulators.carla_server.actors import Prop, Vehicle
from overtaking.simulators.carla_server.arguments import Transform
from overtaking.simulators.carla_server.camera import RoadScene
from overtaking.simulators.carla_server.maps import Map


class Shot(NamedTuple):
    """What a camera sees at one moment.

    Attributes:
        stream: Stream of the camera.
        header: First bytes of the message.
        pose: Pose of the camera in the world.
        size: Width and height of the picture [pixels].
        fov_deg: Horizontal field of view [degrees].
    """

    stream: int
    header: bytes
    pose: Transform
    size: tuple[int, int]
    fov_deg: float


class PictureThread:
    """One thread that draws pictures in order.

    Memory is bounded: a camera has at most one unfinished picture.

    Args:
        send: Sends a message to the listeners of a stream; called where the event loop runs.
    """

    def __init__(self, send: Callable[[int, bytes], None]) -> None:
        """Start without pictures; the first one starts the thread."""
        self._send = send
        self._executor = ThreadPoolExecutor(1, "pictures")
        self._unfinished: dict[int, asyncio.Future[bytes]] = {}
        self._scene: tuple[Map, RoadScene] | None = None

    def is_drawing(self, stream: int) -> bool:
        """Whether the last picture of a stream is unfinished."""
        return stream in self._unfinished

    def draw(
        self,
        shots: Sequence[Shot],
        road: Map,
        bodies: Iterable[Vehicle | Prop],
        weather: Sequence[float],
    ) -> None:
        """Draw the pictures of one moment; each is sent when it is finished.

        Args:
            shots: The pictures.
            road: The map.
            bodies: Vehicles and props; they are copied because they move while the thread draws.
            weather: The fourteen numbers of `carla.WeatherParameters`.
        """
        copies = [copy.copy(body) for body in bodies]
        loop = asyncio.get_running_loop()
        for shot in shots:
            drawing = loop.run_in_executor(
                self._executor, self._message, shot, road, copies, tuple(weather)
            )
            self._unfinished[shot.stream] = drawing
            drawing.add_done_callback(lambda done, shot=shot: self._finish(shot, done))

    async def wait(self) -> None:
        """Wait until all pictures are sent, so that a client that ticks misses none."""
        while self._unfinished:
            await asyncio.wait(list(self._unfinished.values()))

    def close(self) -> None:
        """Draw no more pictures."""
        self._executor.shutdown(wait=False, cancel_futures=True)

    def _message(
        self, shot: Shot, road: Map, bodies: Sequence[Vehicle | Prop], weather: Sequence[float]
    ) -> bytes:
        """The message with a picture; runs in the thread."""
        if self._scene is None or self._scene[0] is not road:
            self._scene = (road, RoadScene(road))
        pixels = self._scene[1].draw(shot.pose, shot.size, shot.fov_deg, bodies, weather)
        return shot.header + snapshot.image(*shot.size, shot.fov_deg, pixels.tobytes())

    def _finish(self, shot: Shot, done: asyncio.Future[bytes]) -> None:
        del self._unfinished[shot.stream]
        if not done.cancelled():
            self._send(shot.stream, done.result())
