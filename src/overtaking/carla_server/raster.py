"""A pinhole camera and the filling of convex polygons, in NumPy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from overtaking.carla_server.arguments import Transform

Points = NDArray[np.float64]

NEAR = 0.3
"""What is nearer than this to the camera is cut off [m]."""

_BEYOND = 1e6  # Pixels; keeps what lies nearly in the plane of the camera finite.


class Lens(NamedTuple):
    """A camera in CARLA's frame.

    Attributes:
        place: Where it is [m].
        forward, right, down: Its axes.
        focal: Focal length [pixels].
        width, height: Of the picture [pixels].
        horizon: Row of the horizon, possibly outside the picture.
    """

    place: tuple[float, float, float]
    forward: tuple[float, float, float]
    right: tuple[float, float, float]
    down: tuple[float, float, float]
    focal: float
    width: int
    height: int
    horizon: float

    @classmethod
    def of(cls, pose: Transform, size: tuple[int, int], fov_deg: float) -> Lens:
        """The camera of a pose; roll is left out."""
        pitch, yaw = (math.radians(angle) for angle in pose.rotation[:2])
        cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
        focal = 0.5 * size[0] / math.tan(0.5 * math.radians(fov_deg))
        slope = sp / max(cp, 1e-6)
        horizon = min(max(0.5 * size[1] + focal * slope, -_BEYOND), _BEYOND)
        return cls(
            place=(pose.location.x, pose.location.y, pose.location.z),
            forward=(cp * cy, cp * sy, sp),
            right=(-sy, cy, 0.0),
            down=(sp * cy, sp * sy, -cp),
            focal=focal,
            width=size[0],
            height=size[1],
            horizon=horizon,
        )


def project(lens: Lens, corners: Points) -> Points | None:
    """A polygon of the world on the picture, shape (corner, 2); None if it cannot be seen.

    Args:
        lens: The camera.
        corners: Shape (corner, 3) [m].
    """
    axes = np.array((lens.right, lens.down, lens.forward))
    seen = _before((corners - np.array(lens.place)) @ axes.T)
    if len(seen) < 3:
        return None
    scale = lens.focal / seen[:, 2]
    across = 0.5 * lens.width + seen[:, 0] * scale
    below = 0.5 * lens.height + seen[:, 1] * scale
    outside = (
        across.max() < 0
        or across.min() > lens.width
        or below.max() < 0
        or below.min() > lens.height
    )
    if outside:
        return None
    return np.clip(np.stack([across, below], axis=1), -_BEYOND, _BEYOND)


def _before(points: Points) -> Points:
    """The part of a polygon that lies before the camera (Sutherland and Hodgman 1974)."""
    if (points[:, 2] >= NEAR).all():
        return points
    kept: list[Points] = []
    for here, there in zip(points, np.roll(points, -1, axis=0), strict=True):
        if here[2] >= NEAR:
            kept.append(here)
        if (here[2] >= NEAR) != (there[2] >= NEAR):
            share = (NEAR - here[2]) / (there[2] - here[2])
            kept.append(here + share * (there - here))
    return np.array(kept).reshape(-1, 3)


def fill(image: NDArray[np.uint8], corners: Points, colour: Points) -> None:
    """Fill a convex polygon.

    Args:
        image: Shape (height, width, 4), changed in place.
        corners: Column and row of each corner [pixels].
        colour: Blue, green, red, 0 to 255.
    """
    height, width = image.shape[:2]
    x, y = corners[:, 0], corners[:, 1]
    first, last = max(math.ceil(y.min() - 0.5), 0), min(math.ceil(y.max() - 0.5), height)
    if first >= last:
        return
    rows = np.arange(first, last)[:, None] + 0.5
    x2, y2 = np.roll(x, -1), np.roll(y, -1)
    rise = np.where(y2 == y, 1.0, y2 - y)
    crossing = x + (rows - y) * ((x2 - x) / rise)
    crossed = (np.minimum(y, y2) <= rows) & (rows < np.maximum(y, y2))
    left = np.where(crossed, crossing, np.inf).min(axis=1)
    right = np.where(crossed, crossing, -np.inf).max(axis=1)
    begin = np.ceil(np.clip(left - 0.5, 0, width)).astype(int).tolist()
    end = np.ceil(np.clip(right - 0.5, 0, width)).astype(int).tolist()
    paint = np.clip(colour, 0.0, 255.0).astype(np.uint8)
    for row, a, b in zip(range(first, last), begin, end, strict=True):
        if a < b:
            image[row, a:b, :3] = paint
