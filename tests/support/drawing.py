"""One grey picture with something drawn on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.show.video.canvas import HEIGHT, WIDTH, Canvas

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def drawn(paint: Callable[[Canvas], object], grey: int = 0) -> NDArray[np.float64]:
    """What becomes of a grey picture, its red from 0 to 255, when something is drawn on it."""
    canvas = Canvas(WIDTH, HEIGHT, f"#{grey:02x}{grey:02x}{grey:02x}")
    paint(canvas)
    return canvas.to_rgb()[:, :, 0].astype(np.float64)
