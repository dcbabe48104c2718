"""How long a lane change takes and how fast it moves sideways, from the path across the road.

Paths have shape (change, frame) in metres, growing in the direction of the change; the centre of
the vehicle crosses the line in the frame in the middle. Three durations are in use, and they
differ by seconds: how long the vehicle moves sideways faster than a limit (Lee, Olsen and
Wierwille 2004), how long its body is over the line, and the first until it has come to rest
across the road.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.traffic import limit

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array

SMOOTHING_S = 0.25  # Half of the window that a lateral speed is taken over.


def lateral_speed(path: Array, interval_s: float) -> Array:
    """Central differences over half a second, 0 at both ends, shape (change, frame) [m/s]."""
    half = max(1, round(SMOOTHING_S / interval_s))
    speed = np.zeros(path.shape)
    speed[:, half:-half] = (path[:, 2 * half :] - path[:, : -2 * half]) / (2 * half * interval_s)
    return speed


def moving(speed: Array) -> tuple[Array, Array]:
    """The frames around the middle between which the vehicle moves visibly in the direction.

    Returns:
        The last slow frame before the middle and the first after it. Where no frame is slow, the
        movement is not recorded from begin to end, and both are the middle itself.
    """
    middle, slow = speed.shape[1] // 2, speed < limit("moving_aside")
    before = np.argmax(slow[:, middle::-1], axis=1)
    return middle - before, middle + np.argmax(slow[:, middle:], axis=1)


def settled(speed: Array, interval_s: float) -> Array:
    """The first frame from the middle on that begins a second without visible motion to any side.

    Without such a frame, the middle itself.
    """
    middle, wait = speed.shape[1] // 2, max(1, round(limit("settled_time") / interval_s))
    calm = np.cumsum(np.abs(speed[:, middle:]) < limit("moving_aside"), axis=1)
    still = np.zeros(calm.shape, np.bool_)
    still[:, 1 : calm.shape[1] - wait + 1] = calm[:, wait:] - calm[:, :-wait] == wait
    return middle + np.argmax(still, axis=1)


def straddling(path: Array, half_width: Array) -> tuple[Array, Array]:
    """The frames around the middle between which the body is over the line, as in `moving`.

    Args:
        path: Distance of the centre from the line.
        half_width: Of each vehicle, shape (change,) [m].
    """
    middle, off = path.shape[1] // 2, np.abs(path) >= half_width[:, None]
    return (
        middle - np.argmax(off[:, middle::-1], axis=1),
        middle + np.argmax(off[:, middle:], axis=1),
    )


def peak(speed: Array, begin: Array, end: Array) -> Array:
    """The largest lateral speed between two frames of each, shape (change,) [m/s]."""
    frame = np.arange(speed.shape[1])[None, :]
    inside = (frame >= begin[:, None]) & (frame <= end[:, None])
    return np.where(inside, speed, -np.inf).max(axis=1, initial=-np.inf)
