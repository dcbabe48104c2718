"""Compiled versions of functions of `core.float32_math` and `core.random_numbers`.

The engine (Rust, module `overtaking._core`) computes them. Results have the same bits as in those
two modules, whose docstrings describe the functions. This module serves the code that draws
scenarios (the road, traffic and weather at the start of a simulation). The readable simulator in
`sim.reference` uses the other two: it must not depend on the engine, which it verifies.
"""

import os
from typing import Any

import numpy as np

from overtaking import _core
from overtaking.core import float32_math, random_numbers
from overtaking.core.arrays import F32, U32, U64, F32Like
from overtaking.core.errors import ConfigError


# For speed: in pure Python the random numbers of a scenario take 6 µs more, 2.7 % of the time to
# make a data set with the profile `pinto2023` (the traffic of the study reproduced here).
class PhiloxStream(random_numbers.PhiloxStream):
    """Successive random numbers, with the arguments of `random_numbers.PhiloxStream`."""

    def __init__(self, seed: int, scenario_index: U64, stream: U32 | int) -> None:
        """Start at the first number of the stream."""
        super().__init__(seed, scenario_index, stream)
        indices, streams = np.broadcast_arrays(
            np.asarray(scenario_index, np.uint64), np.asarray(stream, np.uint32)
        )
        self._shape = indices.shape
        # The engine takes arrays with one axis, contiguous in memory.
        self._flat_indices = np.ascontiguousarray(indices).reshape(-1)
        self._flat_streams = np.ascontiguousarray(streams).reshape(-1)

    def _block_words(self, block_number: int) -> tuple[U32, U32, U32, U32]:
        """Four random words for each scenario and stream; `next_word` returns them one by one."""
        words = _core.random_words(
            seed=self._seed,
            index=self._flat_indices,
            stream=self._flat_streams,
            draw=block_number,  # The engine calls the block number `draw`.
        )
        first, second, third, fourth = (word.reshape(self._shape) for word in words)
        return first, second, third, fourth

    def uniform(self, low: float = 0.0, high: float = 1.0) -> F32:
        """The next number between `low` and `high`; by default it is never 0 or 1."""
        if (low, high) != (0.0, 1.0):  # The engine has no function for other limits.
            return super().uniform(low, high)
        return _core.uniform_numbers(self.next_word().reshape(-1)).reshape(self._shape)


# The engine replaces the numbers of an array by their function values, so the functions below pass
# it a copy of their argument. Of an array without axes, `reshape(-1)` makes one of one element.


def exp(x: F32Like) -> F32:
    """The number e to the power `x`; an `x` below -87 or above 88 counts as that limit.

    So the result is neither 0 nor infinite.
    """
    values = _float32_copy(x)
    _core.exp_in_place(values.reshape(-1))
    return values


def log(x: F32Like) -> F32:
    """Natural logarithm; an `x` below 2**-126 (1.2e-38) counts as 2**-126.

    So the result is never infinite.
    """
    values = _float32_copy(x)
    _core.log_in_place(values.reshape(-1))
    return values


def power(base: F32Like, exponent: F32Like) -> F32:
    """`base ** exponent` for a positive base."""
    return exp(np.asarray(exponent, np.float32) * log(base))


def maximum(a: F32Like, b: F32Like) -> F32:
    """The larger of two values; `b` where they are equal or one of them is NaN."""
    if not _has_engine_shapes(a, b):
        return float32_math.maximum(a, b)
    values = _float32_copy(a)
    _core.maximum_in_place(values.reshape(-1), _flat_or_number(b))
    return values


def minimum(a: F32Like, b: F32Like) -> F32:
    """The smaller of two values; `b` where they are equal or one of them is NaN."""
    if not _has_engine_shapes(a, b):
        return float32_math.minimum(a, b)
    values = _float32_copy(a)
    _core.minimum_in_place(values.reshape(-1), _flat_or_number(b))
    return values


def clamp(value: F32Like, low: F32Like, high: F32Like) -> F32:
    """`value` limited to [low, high]; `low` where `value` is NaN."""
    if not (_has_engine_shapes(value, low) and _has_engine_shapes(value, high)):
        return float32_math.clamp(value, low, high)
    values = _float32_copy(value)
    flat = values.reshape(-1)
    _core.maximum_in_place(flat, _flat_or_number(low))
    _core.minimum_in_place(flat, _flat_or_number(high))
    return values


def box_muller(u: F32, v: F32) -> tuple[F32, F32]:
    """Convert uniform numbers `u` and `v` in (0, 1) to two independent standard normal ones."""
    first, second = map(_float32_copy, np.broadcast_arrays(u, v))
    _core.normal_pairs_in_place(first.reshape(-1), second.reshape(-1))
    return first, second


def _has_engine_shapes(a: F32Like, b: F32Like) -> bool:
    """Whether the engine takes the pair: `a` an array, `b` a number or an array of the same shape.

    Other pairs go to `float32_math`, where NumPy broadcasts them.
    """
    return a.dtype == b.dtype == np.float32 and a.ndim > 0 and b.shape in ((), a.shape)


def _flat_or_number(values: F32Like) -> Any:
    """The elements of an array along one axis, or the number if `values` has no axes."""
    return np.ascontiguousarray(values).reshape(-1) if values.ndim else float(values)


def _float32_copy(values: Any) -> F32:
    """A copy in float32 that is contiguous in memory, so that `reshape(-1)` of it is a view."""
    return np.array(values, np.float32, order="C")


SIMD_VARIABLE = "OVERTAKING_SIMD"
"""Environment variable that forces a SIMD level: avx512, avx2, sse2, neon or portable.

A level is a set of vector instructions of a CPU for which the engine is compiled. Results do not
depend on it; tests compare all levels of a CPU.
"""


def simd_level(level: str | None = None) -> str | None:
    """Choose the SIMD level that the caller passes to the engine.

    Args:
        level: A level; None for the value of the environment variable `OVERTAKING_SIMD`.

    Returns:
        The level; None if neither `level` nor the variable states one. With None the engine takes
        the fastest level of this CPU.

    Raises:
        ConfigError: The level is unknown, or this CPU does not support it.
    """
    forced = level or os.environ.get(SIMD_VARIABLE) or None  # An empty variable counts as unset.
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
