"""Runs of frames in which something stays the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from overtaking.core.elementary import Mask

I64 = NDArray[np.int64]


def runs(values: NDArray[np.integer], valid: Mask) -> tuple[I64, ...]:
    """Where values stay the same.

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
    """Frames whose value is another than in the frame before, of the same shape."""
    changed = np.zeros(valid.shape, np.bool_)
    changed[..., 1:] = valid[..., 1:] & valid[..., :-1] & (values[..., 1:] != values[..., :-1])
    return changed
