"""Functions of `float32_math` and random numbers of `random_numbers` by the compiled engine."""

import os
from typing import Any

import numpy as np

from overtaking import _core
from overtaking.core import float32_math, random_numbers
from overtaking.core.arrays import F32, U32, U64, F32Like
from overtaking.core.errors import ConfigError


# Without compiled draws a scenario takes 6 µs more, 2.7 % of the time of a data set of the study.
# The NumPy reference keeps to `random_numbers` and `float32_math`: it must not depend on the engine
# that it verifies.
class PhiloxStream(random_numbers.PhiloxStream):
    """Successive numbers of one stream, as `random_numbers.PhiloxStream`."""

    def __init__(self, seed: int, scenario_index: U64, stream: U32 | int) -> None:
        """Start at draw 0 of `stream`."""
        super().__init__(seed, scenario_index, stream)
        indices, streams = np.broadcast_arrays(
            np.asarray(scenario_index, np.uint64), np.asarray(stream, np.uint32)
        )
        self._shape = indices.shape
        self._indices = np.ascontiguousarray(indices).reshape(-1)
        self._streams = np.ascontiguousarray(streams).reshape(-1)

    def _block_words(self, draw: int) -> tuple[U32, U32, U32, U32]:
        words = _core.words(seed=self._seed, index=self._indices, stream=self._streams, draw=draw)
        first, second, third, fourth = (word.reshape(self._shape) for word in words)
        return first, second, third, fourth

    def uniform(self, low: float = 0.0, high: float = 1.0) -> F32:
        """The next number in (low, high)."""
        if (low, high) != (0.0, 1.0):
            return super().uniform(low, high)
        return _core.uniforms(self.next_word().reshape(-1)).reshape(self._shape)


def exp(x: F32Like) -> F32:
    """E to the power `x`, as `float32_math.exp`."""
    values = _float32_copy(x)
    _core.exponentials(values.reshape(-1))
    return values


def log(x: F32Like) -> F32:
    """Natural logarithm, as `float32_math.log`."""
    values = _float32_copy(x)
    _core.logarithms(values.reshape(-1))
    return values


def power(base: F32Like, exponent: F32Like) -> F32:
    """`base ** exponent`, as `float32_math.power`."""
    return exp(np.asarray(exponent, np.float32) * log(base))


def maximum(a: F32Like, b: F32Like) -> F32:
    """The larger of two values; `b` where they are equal, as `float32_math.maximum`."""
    if not _broadcasts_simply(a, b):
        return float32_math.maximum(a, b)
    values = _float32_copy(a)
    _core.larger(values.reshape(-1), _as_vector(b))
    return values


def minimum(a: F32Like, b: F32Like) -> F32:
    """The smaller of two values; `b` where they are equal, as `float32_math.minimum`."""
    if not _broadcasts_simply(a, b):
        return float32_math.minimum(a, b)
    values = _float32_copy(a)
    _core.smaller(values.reshape(-1), _as_vector(b))
    return values


def clamp(value: F32Like, low: F32Like, high: F32Like) -> F32:
    """`value` limited to [low, high], as `float32_math.clamp`."""
    if not (_broadcasts_simply(value, low) and _broadcasts_simply(value, high)):
        return float32_math.clamp(value, low, high)
    values = _float32_copy(value)
    flat = values.reshape(-1)
    _core.larger(flat, _as_vector(low))
    _core.smaller(flat, _as_vector(high))
    return values


def box_muller(u: F32, v: F32) -> tuple[F32, F32]:
    """Two independent standard normal numbers, as `random_numbers.box_muller`."""
    first, second = map(_float32_copy, np.broadcast_arrays(u, v))
    _core.normal_pairs(first.reshape(-1), second.reshape(-1))
    return first, second


def _broadcasts_simply(a: F32Like, b: F32Like) -> bool:
    """Whether `b` is a float32 number or an array of the shape of `a`, as the engine requires."""
    return a.dtype == b.dtype == np.float32 and a.ndim > 0 and b.shape in ((), a.shape)


def _as_vector(values: F32Like) -> Any:
    """The elements of an array in one dimension; of an array without dimensions, the number."""
    return np.ascontiguousarray(values).reshape(-1) if values.ndim else float(values)


def _float32_copy(values: Any) -> F32:
    return np.array(values, np.float32, order="C")


SIMD_VARIABLE = "OVERTAKING_SIMD"
"""Environment variable that forces a SIMD level: avx512, avx2, sse2, neon or portable."""


def simd_level(level: str | None = None) -> str | None:
    """The SIMD level of the engine.

    Args:
        level: A level; None for the value of the environment variable `OVERTAKING_SIMD`.

    Returns:
        The level; None if the engine chooses the fastest one of this CPU.

    Raises:
        ConfigError: The level is unknown, or this CPU does not support it.
    """
    forced = level or os.environ.get(SIMD_VARIABLE) or None
    available = [name for name, is_available in _core.simd_levels() if is_available]
    if forced is not None and forced not in available:
        raise ConfigError(
            what="SIMD level",
            where=SIMD_VARIABLE,
            expected=", ".join(available),
            got=forced,
            next_step="unset it or choose another level",
        )
    return forced
