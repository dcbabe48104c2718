"""Draws and elementary functions of many numbers by the compiled engine.

They are those of `philox` and `elementary`, bit for bit. Scenarios are drawn with these; the
reference keeps to the readable ones, so that it depends on nothing compiled.
"""

from typing import Any

import numpy as np

from overtaking import _core
from overtaking.core import philox
from overtaking.core.elementary import F32, F32Like
from overtaking.core.philox import U32, U64


class Draws(philox.Draws):
    """Successive numbers of one stream, as `philox.Draws`."""

    def __init__(self, seed: int, index: U64, stream: U32 | int) -> None:
        """Start at draw 0 of `stream`."""
        super().__init__(seed, index, stream)
        indices, streams = np.broadcast_arrays(
            np.asarray(index, np.uint64), np.asarray(stream, np.uint32)
        )
        self._shape = indices.shape
        self._indices = np.ascontiguousarray(indices).reshape(-1)
        self._streams = np.ascontiguousarray(streams).reshape(-1)

    def _words(self, draw: int) -> tuple[U32, U32, U32, U32]:
        found = _core.words(seed=self._seed, index=self._indices, stream=self._streams, draw=draw)
        first, second, third, fourth = (word.reshape(self._shape) for word in found)
        return first, second, third, fourth


def exp(x: F32Like) -> F32:
    """E to the power `x`, as `elementary.exp`."""
    values = np.array(x, np.float32, order="C")
    _core.exponentials(values.reshape(-1))
    return values


def normal_pair(u: F32, v: F32) -> tuple[F32, F32]:
    """Two independent standard normal numbers, as `philox.normal_pair`."""
    first, second = (_copied(each) for each in np.broadcast_arrays(u, v))
    _core.normal_pairs(first.reshape(-1), second.reshape(-1))
    return first, second


def _copied(values: Any) -> F32:
    return np.array(values, np.float32, order="C")
