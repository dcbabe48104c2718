"""Random numbers as the samplers want them, on top of `core.philox.Draws`.

Everything here is float32 and has the same bits on every machine: additions, multiplications,
divisions, square roots, comparisons and the elementary functions of `core`.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U8, U32, U64
from overtaking.core.compiled import Draws, clamp, normal_pair
from overtaking.knowledge import number

T = TypeVar("T", bound=np.generic)
Number: TypeAlias = float | np.floating[Any] | NDArray[np.float32]

REACH = np.float32(number("starts.toml", "noise.reach"))
"""Normal numbers are cut off at this many standard deviations."""


class Noise:
    """Successive random numbers of one stream, of which none of a pair is thrown away."""

    def __init__(self, seed: int, index: U64, stream: U32 | int) -> None:
        """Start at the first draw.

        Args:
            seed: Seed of the data set.
            index: Simulation numbers, any shape.
            stream: `core.philox.Stream`, plus slots that broadcast against `index`.
        """
        self._draws = Draws(seed, index, stream)
        self._spare: F32 | None = None

    def uniform(self) -> F32:
        """The next number in (0, 1)."""
        return self._draws.uniform()

    def normal(self) -> F32:
        """The next standard normal number, cut off at `REACH`."""
        return cut_off(self.unbounded_normal())

    def unbounded_normal(self) -> F32:
        """The next standard normal number, as far out as it may be."""
        if self._spare is not None:
            number, self._spare = self._spare, None
            return number
        first, self._spare = normal_pair(self._draws.uniform(), self._draws.uniform())
        return first

    def integer(self, count: int) -> NDArray[np.int32]:
        """The next integer in [0, count)."""
        return self._draws.integer(count)


def cut_off(normal: F32) -> F32:
    """Normal numbers, those beyond `REACH` at it."""
    return clamp(normal, -REACH, REACH)


def spread(u: F32, low: Number, high: Number) -> F32:
    """A number in (0, 1) as one in [low, high]."""
    low32, high32 = np.asarray(low, np.float32), np.asarray(high, np.float32)
    return clamp(low32 + (high32 - low32) * u, low32, high32)


def choose(u: F32, weights: Sequence[float]) -> U8:
    """Numbers in (0, 1) as positions in `weights`, each as likely as its weight says.

    Args:
        u: Any shape.
        weights: Not negative, not all zero; at most 255.
    """
    # Added one by one: since Python 3.12 `sum` rounds differently.
    *below, total = itertools.accumulate(weights)
    chosen = np.zeros(u.shape, np.uint8)
    last = max(index for index, weight in enumerate(weights) if weight > 0.0)
    for reached in below[:last]:
        chosen += u >= np.float32(reached / total)
    return chosen


def weights_of(given: Mapping[str, float], order: Sequence[str]) -> list[float]:
    """The weights of all names in `order`, zero for those that are not given."""
    return [given.get(name, 0.0) for name in order]


def in_order(values: NDArray[T], order: NDArray[np.intp]) -> list[NDArray[T]]:
    """The columns of an array (row, column), those of each row in the given order."""
    return list(np.ascontiguousarray(np.take_along_axis(values, order, axis=1).T))


def out_of_order(columns: list[F32], order: NDArray[np.intp]) -> F32:
    """The inverse of `in_order`."""
    values = np.empty(order.shape, np.float32)
    np.put_along_axis(values, order, np.stack(columns, axis=1), axis=1)
    return values
