"""Frames in the encoder's own form, YUV 4:2:0."""

import numpy as np
from numpy.typing import NDArray

U8 = NDArray[np.uint8]
U16 = NDArray[np.uint16]

WIDTH, HEIGHT = 1280, 400
"""Size of a frame [px]."""

FRAME_SHAPE = (HEIGHT * 3 // 2, WIDTH)
"""Shape of a frame in memory: luma, then the two chroma planes of half its width and height."""

OPAQUE = 256
"""Scale of opacity, so that a division is a shift."""


class Canvas:
    """A frame, or a part of its height, as planes.

    Args:
        frame: The whole frame, of `FRAME_SHAPE`.
        top: First row of the part, even.
        bottom: Row after its last one, even.
    """

    __slots__ = ("chroma", "luma")

    def __init__(self, frame: U8, top: int = 0, bottom: int = HEIGHT) -> None:
        """Look at a part of a frame."""
        planes = frame[HEIGHT:].reshape(2, HEIGHT // 2, WIDTH // 2)
        self.luma = frame[top:bottom]
        self.chroma = planes[:, top // 2 : bottom // 2]


def blank() -> U8:
    """A black frame."""
    frame = np.full(FRAME_SHAPE, 128, dtype=np.uint8)
    frame[:HEIGHT] = 16
    return frame


def rgb(frame: U8) -> U8:
    """A frame as people's tools want it.

    Args:
        frame: Of `FRAME_SHAPE`.

    Returns:
        Red, green and blue, shape (HEIGHT, WIDTH, 3).

    Source:
        ITU-R BT.601-7, the inverse of `palette.yuv`.
    """
    canvas = Canvas(frame)
    y = (canvas.luma.astype(np.float32) - 16.0) / 219.0
    u, v = ((plane.astype(np.float32) - 128.0) / 224.0 for plane in canvas.chroma)
    u, v = (np.repeat(np.repeat(plane, 2, axis=0), 2, axis=1) for plane in (u, v))
    red, blue = y + 1.402 * v, y + 1.772 * u
    green = y - 0.344_136 * u - 0.714_136 * v
    values = np.stack([red, green, blue], axis=-1) * 255.0
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)
