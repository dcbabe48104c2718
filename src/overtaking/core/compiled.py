"""Draws and elementary functions of many numbers by the compiled engine.

They are those of `philox` and `elementary`, bit for bit. Scenarios are drawn with these; the
reference keeps to the readable ones, so that it depends on nothing compiled.
"""

from typing import Any

import numpy as np

from overtaking import _core
from overtaking.core import elementary, philox
from overtaking.core.arrays import F32, U32, U64, F32Like


# Without compiled draws a scenario takes 6 µs more, 2.7 % of the time of a data set of the study.
# The NumPy reference keeps to `philox` and `elementary`: it must not depend on the engine that it
# verifies.
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

    def uniform(self, low: float = 0.0, high: float = 1.0) -> F32:
        """The next number in (low, high)."""
        if (low, high) != (0.0, 1.0):
            return super().uniform(low, high)
        return _core.uniforms(self.word().reshape(-1)).reshape(self._shape)


def exp(x: F32Like) -> F32:
    """E to the power `x`, as `elementary.exp`."""
    values = _copied(x)
    _core.exponentials(values.reshape(-1))
    return values


def log(x: F32Like) -> F32:
    """Natural logarithm, as `elementary.log`."""
    values = _copied(x)
    _core.logarithms(values.reshape(-1))
    return values


def power(base: F32Like, exponent: F32Like) -> F32:
    """`base ** exponent`, as `elementary.power`."""
    return exp(np.asarray(exponent, np.float32) * log(base))


def maximum(a: F32Like, b: F32Like) -> F32:
    """The larger of two values; `b` where they are equal, as `elementary.maximum`."""
    if not _are_alike(a, b):
        return elementary.maximum(a, b)
    values = _copied(a)
    _core.larger(values.reshape(-1), _flat(b))
    return values


def minimum(a: F32Like, b: F32Like) -> F32:
    """The smaller of two values; `b` where they are equal, as `elementary.minimum`."""
    if not _are_alike(a, b):
        return elementary.minimum(a, b)
    values = _copied(a)
    _core.smaller(values.reshape(-1), _flat(b))
    return values


def clamp(value: F32Like, low: F32Like, high: F32Like) -> F32:
    """`value` limited to [low, high], as `elementary.clamp`."""
    if not (_are_alike(value, low) and _are_alike(value, high)):
        return elementary.clamp(value, low, high)
    values = _copied(value)
    flat = values.reshape(-1)
    _core.larger(flat, _flat(low))
    _core.smaller(flat, _flat(high))
    return values


def normal_pair(u: F32, v: F32) -> tuple[F32, F32]:
    """Two independent standard normal numbers, as `philox.normal_pair`."""
    first, second = (_copied(each) for each in np.broadcast_arrays(u, v))
    _core.normal_pairs(first.reshape(-1), second.reshape(-1))
    return first, second


def _are_alike(a: F32Like, b: F32Like) -> bool:
    """Whether `b` is one float32, or one for each of `a`."""
    return a.dtype == b.dtype == np.float32 and a.ndim > 0 and b.shape in ((), a.shape)


def _flat(values: F32Like) -> Any:
    """An array in one row, or the only number."""
    return np.ascontiguousarray(values).reshape(-1) if values.ndim else float(values)


def _copied(values: Any) -> F32:
    return np.array(values, np.float32, order="C")
