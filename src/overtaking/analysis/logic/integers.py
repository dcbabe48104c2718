"""From SI floats to integers that compare with a threshold as before, and runs of integers.

Thresholds of the law are whole millimetres. A quantity with a lower limit is rounded down, one with
an upper limit is rounded up: then the integer is on the same side of the limit as the number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F32, I64, Mask


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
    """Limits in thousandths that compare with `down(values)` as the limits compare with `values`.

    Args:
        limits: The limits, of any shape.
        values: Of the same shape.

    Returns:
        The limits rounded up, or the nearest integer on their side of the rounded value.
    """
    rounded, given = up(limits), down(values)
    over, under = limits > values, limits < values
    rounded = np.where(over, np.maximum(rounded, given + 1), rounded)
    rounded = np.where(under, np.minimum(rounded, given - 1), rounded)
    return np.where(over | under, rounded, given)


def runs(values: NDArray[np.integer], valid: Mask) -> tuple[I64, ...]:
    """Runs of frames in which values stay the same.

    Args:
        values: Shape (..., time).
        valid: Which of them count, same shape.

    Returns:
        For each run: its index along every leading axis, its value, its first and its last frame.
    """
    same = valid[..., 1:] & valid[..., :-1] & (values[..., 1:] == values[..., :-1])
    begins, ends = valid.copy(), valid.copy()
    begins[..., 1:] &= ~same
    ends[..., :-1] &= ~same
    *place, first = np.nonzero(begins)
    last = np.nonzero(ends)[-1]
    value = values[(*place, first)]
    return *place, value.astype(np.int64), first, last


def changes(values: NDArray[np.integer], valid: Mask) -> Mask:
    """Frames whose value differs from the frame before, of the same shape."""
    changed = np.zeros(valid.shape, np.bool_)
    changed[..., 1:] = valid[..., 1:] & valid[..., :-1] & (values[..., 1:] != values[..., :-1])
    return changed
