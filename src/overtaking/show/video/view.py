"""From road to screen: a camera along the road, and one scale for both axes."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.model.road import Road
from overtaking.model.vehicles import EGO_SLOT
from overtaking.show.video.canvas import WIDTH
from overtaking.show.video.scene import FilmScene

Metres = TypeVar("Metres", float, "NDArray[np.float64]")
"""One offset, or many."""

SCENE_TOP, SCENE_BOTTOM = 40, 284
"""Rows of the frame that show the road."""

MAX_SCALE = 10.0  # More and the target leaves the picture too early [px/m].
_MIN_SCALE = 4.0
_MARGIN = 1.4  # Metres of verge on either side.
_WIDEST_NEIGHBOUR = 4.0  # Of a lane beside the driving lanes as much is shown [m].
_EGO_AWAY = 0.32  # Farthest that the ego is from the middle of the picture [widths].
_ALONE = 0.16  # The same without a target: more road ahead than behind.


@dataclass(frozen=True, slots=True)
class Camera:
    """From metres to pixels.

    Attributes:
        scale: [px/m].
        middle_d: `d` in the middle of the picture [m].
        left: Column of s = 0 seen from the left edge, negated and even, for each frame [px].
    """

    scale: float
    middle_d: float
    left: NDArray[np.int64]

    @property
    def height(self) -> int:
        """Rows of the picture of the road."""
        return SCENE_BOTTOM - SCENE_TOP

    def x(self, frame: int, s: float) -> float:
        """Column of a place along the road."""
        return s * self.scale - int(self.left[frame])

    def y(self, d: Metres) -> Metres:
        """Row of a place across the road, from the top of the picture of the road."""
        return 0.5 * self.height - (d - self.middle_d) * self.scale


def view(scene: FilmScene) -> Camera:
    """A camera that keeps the whole width of the road, and ego and target as long as both fit."""
    low, high = shown_width(scene.road)
    fitting = (SCENE_BOTTOM - SCENE_TOP) / (high - low + 2.0 * _MARGIN)
    scale = max(min(MAX_SCALE, fitting), _MIN_SCALE)
    ego = scene.s[EGO_SLOT]
    metres = WIDTH / scale
    if scene.target is None:
        middle = ego + _ALONE * metres
    else:
        away = np.clip(0.5 * (scene.s[scene.target] - ego), -_EGO_AWAY * metres, _EGO_AWAY * metres)
        middle = ego + away
    # Even columns: then the road moves by whole pixels of luma and chroma, and moves sharply.
    left = 2 * np.rint(0.5 * (middle - 0.5 * metres) * scale).astype(np.int64)
    return Camera(scale=scale, middle_d=0.5 * (low + high), left=left)


def shown_width(road: Road) -> tuple[float, float]:
    """Smallest and largest `d` of the paved surface [m]."""
    borders = road.lane_boundaries
    slow, fast = float(borders[0]), float(borders[-1])
    if road.kerb_side_neighbour is not None:
        slow -= road.overtaking_sign * min(road.kerb_side_neighbour.width, _WIDEST_NEIGHBOUR)
    if road.overtaking_side_neighbour is not None:
        fast += road.overtaking_sign * min(road.overtaking_side_neighbour.width, _WIDEST_NEIGHBOUR)
    return min(slow, fast), max(slow, fast)
