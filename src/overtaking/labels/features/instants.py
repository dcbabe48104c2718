"""Some frames of each simulation of a batch, side by side, and what they have in common."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32

Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Instants:
    """Frames in the order of the simulations; what is only looked at there costs only those.

    Attributes:
        rows: Simulation of each, shape (instant,).
        frames: Its frame, same shape.
        begins: Where in these the simulations that have any begin.
        count: Number of simulations, with instants or without.
    """

    rows: Index
    frames: Index
    begins: Index
    count: int

    @classmethod
    def of(cls, mask: Mask) -> Self:
        """The true elements of a mask of shape (simulation, time)."""
        count, num_frames = mask.shape
        flat = np.flatnonzero(mask)
        rows = flat // num_frames
        begins = np.flatnonzero(np.diff(rows, prepend=-1))
        return cls(rows=rows, frames=flat - rows * num_frames, begins=begins, count=count)

    @property
    def exists(self) -> Mask:
        """Which simulations have any, shape (simulation,)."""
        found = np.zeros(self.count, np.bool_)
        found[self.rows[self.begins]] = True
        return found

    def lowest(self, values: F32) -> F32:
        """The smallest of `values` (instant,) of each simulation, 0 for those without."""
        return self._reduced(np.minimum, values)

    def highest(self, values: F32) -> F32:
        """The largest of `values` (instant,) of each simulation, 0 for those without."""
        return self._reduced(np.maximum, values)

    def total(self, values: NDArray[Any]) -> F32:
        """The sum of `values` (instant,) of each simulation, one after the other in doubles."""
        return as_f32(np.bincount(self.rows, weights=values, minlength=self.count))

    def _reduced(self, by: np.ufunc, values: F32) -> F32:
        reduced = np.zeros(self.count, np.float32)
        if self.begins.size:
            reduced[self.rows[self.begins]] = by.reduceat(values, self.begins)
        return reduced
