"""From SI floats to integers, so that what compares with a threshold compares as before.

Thresholds of the law are whole millimetres. What must be at least so much is rounded down, what
must be at most so much is rounded up: then the integer is on the same side as the number was.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from overtaking.core.elementary import F32

I64 = NDArray[np.int64]

_PER_UNIT = 1000.0


def down(values: F32) -> I64:
    """Thousandths, rounded down: no less than a whole number exactly where the value is."""
    return np.floor(values.astype(np.float64) * _PER_UNIT).astype(np.int64)


def up(values: F32) -> I64:
    """Thousandths, rounded up: no more than a whole number exactly where the value is."""
    return np.ceil(values.astype(np.float64) * _PER_UNIT).astype(np.int64)


def nearest(values: NDArray[np.floating]) -> I64:
    """Thousandths, rounded half up."""
    return np.floor(values.astype(np.float64) * _PER_UNIT + 0.5).astype(np.int64)


def beside(limits: F32, values: F32) -> I64:
    """Limits in thousandths that are below, at or above `down(values)` as they are of `values`.

    Args:
        limits: What the values are compared with, of any shape.
        values: Of the same shape.

    Returns:
        The limits rounded up, or the nearest integer on their side of the rounded value.
    """
    rounded, given = up(limits), down(values)
    over, under = limits > values, limits < values
    rounded = np.where(over, np.maximum(rounded, given + 1), rounded)
    rounded = np.where(under, np.minimum(rounded, given - 1), rounded)
    return np.where(over | under, rounded, given)
