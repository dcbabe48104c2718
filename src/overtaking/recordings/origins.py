"""Coordinates far from the origin, such as UTM, and the origin near them that a road keeps.

Recorded positions are int32 millimetres, which end at 2147 km.
"""

import numpy as np
from numpy.typing import ArrayLike

FAR = 1.0e6
"""Coordinates beyond this are counted from another origin [m]."""

_GRID = 1000.0  # Origins are whole kilometres, so that decimals stay those of the file.


def origin_near(x: ArrayLike, y: ArrayLike) -> tuple[float, float]:
    """The origin from which the coordinates of points are counted [m].

    Args:
        x: Their x in the file, any shape [m].
        y: Their y, same shape [m].

    Returns:
        Zeros where all points are within `FAR`, else whole kilometres at their least x and y.
    """
    least = np.array([np.min(x), np.min(y)])
    if max(np.abs(least).max(), np.max(x), np.max(y)) <= FAR:
        return 0.0, 0.0
    east, north = (np.round(least / _GRID) * _GRID).tolist()
    return east, north
