"""From frames to an mp4 file that every player opens: H.264, 4:2:0, its index at the front."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from overtaking import _core
from overtaking.core.errors import DatasetError, MissingExtraError
from overtaking.core.files import atomic_file, fsync_folder
from overtaking.show.video.canvas import Canvas
from overtaking.show.video.scene import RATE

if TYPE_CHECKING:
    from collections.abc import Callable, Generator
    from pathlib import Path
    from types import ModuleType

    from av import VideoStream


class Pictures(Protocol):
    """Frames of one size, drawn one after the other."""

    @property
    def num_frames(self) -> int:
        """Number of frames, `RATE` of them a second."""
        ...

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        ...

    def draw(self, frame: int, out: Canvas) -> Canvas:
        """Draw a frame."""
        ...


# Flat areas that move as a whole need no search: the fastest preset finds them. A constant
# quantiser lets the encoder do without looking ahead, which is half of its work here.
_OPTIONS = {
    "preset": "ultrafast",
    "qp": "21",
    "x264-params": "threads=1:lookahead-threads=1:rc-lookahead=0:sync-lookahead=0:"
    "scenecut=0:weightp=0:aq-mode=0:keyint=100",
}
# x264 takes AVX-512 where there is any, which costs it a fifth more than AVX2 for pictures as small
# and as still as these.
_PARAMETERS_WITH_AVX512 = ":asm=avx2"
_BT601, _BT709, _LIMITED = 6, 1, 1  # As ISO/IEC 23091-2 numbers them.


class Interrupted(Exception):
    """The caller asked to stop; no part of the film was kept."""


def write_film(
    film: Pictures, path: Path, *, title: str = "", is_wanted: Callable[[], bool] = lambda: True
) -> None:
    """Write a film, or leave nothing.

    Args:
        film: What to write.
        path: The file, replaced as a whole; its folder exists.
        title: Title that players show.
        is_wanted: Asked before each frame; the answer no ends the work.

    Raises:
        Interrupted: It was not wanted any more.
        MissingExtraError: The encoder is not installed.
        DatasetError: The encoder failed, such as on a full disk.
        OSError: The file cannot be written.
    """
    av = require()
    with atomic_file(path) as partial:
        try:
            _encode(av, film, partial, title, is_wanted)
        except av.error.FFmpegError as error:
            raise _failed(path, error) from error
    fsync_folder(path.parent)


def require() -> ModuleType:
    """PyAV, with FFmpeg and x264 in its wheel.

    Raises:
        MissingExtraError: It or Pillow is not installed.
    """
    try:
        import av
        import PIL
    except ImportError:
        raise MissingExtraError.for_extra(
            "video", what="PyAV or Pillow, which encode films and write in them", where="video"
        ) from None
    del PIL
    return av


def _encode(
    av: ModuleType, film: Pictures, path: Path, title: str, is_wanted: Callable[[], bool]
) -> None:
    width, height = film.size
    with _opened(av, path, title, film.size) as (container, stream):
        canvas = Canvas(width, height, "#000000")
        drawn = np.empty((height * 3 // 2, width), np.uint8)
        # The same memory: the encoder takes its own copy of each frame before the next is drawn.
        target = av.VideoFrame.from_numpy_buffer(drawn, "yuv420p")
        for number in range(film.num_frames):
            if not is_wanted():
                raise Interrupted
            film.draw(number, canvas)
            canvas.write_yuv(drawn)
            target.pts = number
            for packet in stream.encode(target):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)


@contextmanager
def _opened(
    av: ModuleType, path: Path, title: str, size: tuple[int, int]
) -> Generator[tuple[Any, VideoStream]]:
    """A file with one stream."""
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        container.metadata["title"] = title
        stream = container.add_stream("libx264", rate=RATE)
        (stream.width, stream.height), stream.pix_fmt = size, "yuv420p"
        stream.thread_count = 1  # Films are made beside each other.
        context = stream.codec_context
        context.colorspace, context.color_range = _BT601, _LIMITED
        context.color_primaries = context.color_trc = _BT709
        stream.options = _options()
        yield container, stream


def _options() -> dict[str, str]:
    """The options of the encoder on this processor; the film is the same on all."""
    options = dict(_OPTIONS)
    if dict(_core.simd_levels()).get("avx512"):
        options["x264-params"] += _PARAMETERS_WITH_AVX512
    return options


def _failed(path: Path, error: Exception) -> DatasetError:
    return DatasetError(
        what="film",
        where=str(path),
        expected="an encoder that writes it",
        got=str(error),
        next_step="look at the free space of the disk: overtaking doctor",
    )
