"""Pictures of cameras, drawn in a separate thread while the server answers calls."""

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
    """A picture to draw: a camera at one moment.

    Attributes:
        stream: Number of the camera's stream.
        header: Encoded header of the message, which precedes the picture.
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

    Callers draw for a stream only when `is_drawing` is False, so a camera has at most one
    unfinished picture and memory is bounded.

    Args:
        send: Sends a message to the listeners of a stream; called in the thread of the event loop.
    """

    def __init__(self, send: Callable[[int, bytes], None]) -> None:
        """Start without pictures; the first picture starts the thread."""
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
        """Begin to draw the pictures of one moment; each is sent when it is finished.

        Args:
            shots: The pictures.
            road: The map; the thread keeps what it has prepared for the last one.
            bodies: Vehicles and props; copied, because they move while the thread draws.
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
        """Wait until all pictures are sent, so that a synchronous client receives each of them."""
        while self._unfinished:
            await asyncio.wait(list(self._unfinished.values()))

    def close(self) -> None:
        """Stop the thread after the current picture."""
        self._executor.shutdown(wait=False, cancel_futures=True)

    def _message(
        self, shot: Shot, road: Map, bodies: Sequence[Vehicle | Prop], weather: Sequence[float]
    ) -> bytes:
        """The message with a picture; runs in the thread."""
        if self._scene is None or self._scene[0] is not road:
            self._scene = (road, RoadScene(road))
        pixels = self._scene[1].draw(shot.pose, shot.size, shot.fov_deg, bodies, weather)
        return shot.header + snapshot.image(*shot.size, shot.fov_deg, pixels.tobytes())

    def _finish(self, shot: Shot, picture: asyncio.Future[bytes]) -> None:
        del self._unfinished[shot.stream]
        if not picture.cancelled():
            self._send(shot.stream, picture.result())
