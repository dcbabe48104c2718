"""One frame with something drawn on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.video.canvas import HEIGHT, Canvas, blank
from overtaking.video.display import Display

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.video.display import Part


def drawn(
    paint: Callable[[Part], object],
    luma: int = 16,
    chroma: int = 128,
    *,
    top: int = 0,
    bottom: int = HEIGHT,
) -> Canvas:
    """What becomes of a frame of one colour when something is drawn on some of its rows."""
    frame = blank()
    canvas = Canvas(frame)
    canvas.luma[...], canvas.chroma[...] = luma, chroma
    display = Display(1)
    paint(display.part(top, bottom))
    display.draw(0, frame)
    return canvas
