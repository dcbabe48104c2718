"""A pinhole camera: from the world to pixels."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.simulators.carla_server.arguments import Transform

Points = NDArray[np.float64]

NEAR = 0.3
"""Distance of the near plane of the camera [m]."""

_BEYOND = 1e6  # Pixels; keeps what lies nearly in the plane of the camera finite.


class Lens(NamedTuple):
    """A camera in CARLA's frame.

    Attributes:
        position: Where it is [m].
        forward, right, down: Its axes.
        focal: Focal length [pixels].
        width, height: Of the picture [pixels].
        horizon: Row of the horizon, possibly outside the picture.
    """

    position: tuple[float, float, float]
    forward: tuple[float, float, float]
    right: tuple[float, float, float]
    down: tuple[float, float, float]
    focal: float
    width: int
    height: int
    horizon: float

    @classmethod
    def of(cls, pose: Transform, size: tuple[int, int], fov_deg: float) -> "Lens":
        """The camera of a pose; roll is left out."""
        pitch, yaw = (math.radians(angle) for angle in pose.rotation[:2])
        cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
        focal = 0.5 * size[0] / math.tan(0.5 * math.radians(fov_deg))
        slope = sp / max(cp, 1e-6)
        horizon = min(max(0.5 * size[1] + focal * slope, -_BEYOND), _BEYOND)
        return cls(
            position=(pose.location.x, pose.location.y, pose.location.z),
            forward=(cp * cy, cp * sy, sp),
            right=(-sy, cy, 0.0),
            down=(sp * cy, sp * sy, -cp),
            focal=focal,
            width=size[0],
            height=size[1],
            horizon=horizon,
        )


def project(lens: Lens, corners: Points) -> Points | None:
    """A polygon of the world on the picture, shape (corner, 2); None if it is out of view.

    Args:
        lens: The camera.
        corners: Shape (corner, 3) [m].
    """
    return next((found for _, found in projected(lens, corners[None])), None)


def projected(lens: Lens, polygons: Points) -> Iterator[tuple[int, Points]]:
    """The polygons in view, with their index in the list, on the picture.

    Args:
        lens: The camera.
        polygons: Shape (polygon, corner, 3) [m].
    """
    seen = _seen(lens, polygons)
    found, nearest = _pixels(lens, seen), seen[:, :, 2].min(axis=1)
    is_cut = (nearest < NEAR) & (seen[:, :, 2].max(axis=1) > NEAR)
    in_view = (nearest >= NEAR) & _overlaps(lens, found)
    for k in np.flatnonzero(in_view | is_cut).tolist():
        one = found[k] if in_view[k] else _pixels(lens, _before(seen[k]))
        if in_view[k] or _overlaps(lens, one):
            yield k, one


def _seen(lens: Lens, points: Points) -> Points:
    """World points in the axes of the camera: right, down and forward [m]."""
    axes = np.array((lens.right, lens.down, lens.forward))
    return (points - np.array(lens.position)) @ axes.T


def _pixels(lens: Lens, seen: Points) -> Points:
    """Points in the axes of the camera on the picture, shape (..., 2)."""
    scale = lens.focal / np.maximum(seen[..., 2:], NEAR)
    middle = (0.5 * lens.width, 0.5 * lens.height)
    return np.clip(seen[..., :2] * scale + middle, -_BEYOND, _BEYOND)


def _overlaps(lens: Lens, found: Points) -> NDArray[np.bool_]:
    """Whether polygons on the picture overlap it, shape (...) for (..., corner, 2)."""
    low, high = found.min(axis=-2), found.max(axis=-2)
    return ((high > 0) & (low < (lens.width, lens.height))).all(axis=-1)


def _before(points: Points) -> Points:
    """The part of a polygon that lies before the camera (Sutherland and Hodgman 1974)."""
    kept: list[Points] = []
    for here, there in zip(points, np.roll(points, -1, axis=0), strict=True):
        if here[2] >= NEAR:
            kept.append(here)
        if (here[2] >= NEAR) != (there[2] >= NEAR):
            share = (NEAR - here[2]) / (there[2] - here[2])
            kept.append(here + share * (there - here))
    return np.array(kept).reshape(-1, 3)
