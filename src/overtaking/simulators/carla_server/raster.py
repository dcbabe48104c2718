"""A pinhole camera and the filling of convex polygons, in NumPy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.simulators.carla_server.arguments import Transform

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


def projected(lens: Lens, polygons: Points) -> Iterator[tuple[int, Points]]:
    """Those of many polygons that can be seen, with their place in the list, on the picture.

    Args:
        lens: The camera.
        polygons: Shape (polygon, corner, 3) [m].
    """
    axes = np.array((lens.right, lens.down, lens.forward))
    seen = (polygons - np.array(lens.place)) @ axes.T
    depth = seen[:, :, 2]
    whole = (depth >= NEAR).all(axis=1)
    scale = lens.focal / np.maximum(depth, NEAR)
    across = 0.5 * lens.width + seen[:, :, 0] * scale
    below = 0.5 * lens.height + seen[:, :, 1] * scale
    inside = (across.max(axis=1) > 0) & (across.min(axis=1) < lens.width)
    inside &= (below.max(axis=1) > 0) & (below.min(axis=1) < lens.height)
    # What lies between two middles of rows or columns covers no pixel.
    rows = np.ceil(below.max(axis=1) - 0.5) > np.ceil(below.min(axis=1) - 0.5)
    columns = np.ceil(across.max(axis=1) - 0.5) > np.ceil(across.min(axis=1) - 0.5)
    corners = np.clip(np.stack([across, below], axis=2), -_BEYOND, _BEYOND)
    drawn = whole & inside & rows & columns
    uncut = frozenset(np.flatnonzero(whole).tolist())
    cut = ~whole & (depth.max(axis=1) > NEAR)
    for k in np.flatnonzero(drawn | cut).tolist():
        found = corners[k] if k in uncut else project(lens, polygons[k])
        if found is not None:
            yield k, found


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
    points: list[tuple[float, float]] = corners.tolist()
    rows = [y for _, y in points]
    first, last = max(math.ceil(min(rows) - 0.5), 0), min(math.ceil(max(rows) - 0.5), height)
    if first >= last:
        return
    left, right = [math.inf] * (last - first), [-math.inf] * (last - first)
    for k, (x, y) in enumerate(points):
        _cross(((x, y), points[k - 1]), first, last, left, right)
    paint = np.clip(colour, 0.0, 255.0).astype(np.uint8)
    for row, (low, high) in enumerate(zip(left, right, strict=True), first):
        begin, end = max(math.ceil(low - 0.5), 0), min(math.ceil(high - 0.5), width)
        if begin < end:
            image[row, begin:end, :3] = paint


Edge = tuple[tuple[float, float], tuple[float, float]]


def _cross(edge: Edge, first: int, last: int, left: list[float], right: list[float]) -> None:
    """Widen the span of each row whose middle an edge crosses; loops are short, so in Python."""
    (x1, y1), (x2, y2) = sorted(edge, key=lambda point: point[1])
    if y1 == y2:
        return
    slope = (x2 - x1) / (y2 - y1)
    for row in range(max(math.ceil(y1 - 0.5), first), min(math.ceil(y2 - 0.5), last)):
        x = x1 + (row + 0.5 - y1) * slope
        at = row - first
        left[at] = min(left[at], x)
        right[at] = max(right[at], x)
