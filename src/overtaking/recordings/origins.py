"""Origins for roads whose files have large coordinates, such as UTM.

Recorded positions are int32 millimetres and hold at most 2147 km, so positions are counted from an
origin near the road, which `Road.origin_x` and `Road.origin_y` keep.
"""

import numpy as np
from numpy.typing import ArrayLike

FAR = 1.0e6
"""Coordinates beyond this are counted from another origin [m]."""

_GRID = 1000.0  # Origins are whole kilometres, so that positions keep the decimals of the file [m].


def origin_near(x: ArrayLike, y: ArrayLike) -> tuple[float, float]:
    """The origin (x, y) from which the coordinates of points are counted [m].

    Args:
        x: x of the points in the file, any shape [m].
        y: y of the points, same shape [m].

    Returns:
        Zeros if all coordinates are within `FAR`, else the smallest x and y in whole kilometres.
    """
    least = np.array([np.min(x), np.min(y)])
    if max(np.abs(least).max(), np.max(x), np.max(y)) <= FAR:
        return 0.0, 0.0
    east, north = (np.round(least / _GRID) * _GRID).tolist()
    return east, north
