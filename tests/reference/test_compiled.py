"""Compiled draws and elementary functions are the readable ones, bit for bit."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra import numpy as arrays

from overtaking import _core
from overtaking.core import compiled, elementary, philox

LEVELS = [name for name, available in _core.simd_levels() if available]

WORD, LONG = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
LENGTH = st.integers(0, 40)  # Blocks of sixteen, with and without a rest.


@pytest.mark.parametrize("level", LEVELS)
@settings(max_examples=60, deadline=None)
@given(seed=LONG, first=LONG, stream=WORD, draw=WORD, length=LENGTH)
def test_words_are_those_of_the_readable_generator(level, seed, first, stream, draw, length):
    step = np.arange(length, dtype=np.uint64)
    with np.errstate(over="ignore"):
        index, streams = np.uint64(first) + step, np.uint32(stream) + step.astype(np.uint32)
    expected = philox.words(seed, index, streams, draw)
    found = _core.words(seed=seed, index=index, stream=streams, draw=draw, level=level)
    assert [one.tolist() for one in found] == [one.tolist() for one in expected]


@pytest.mark.parametrize("level", LEVELS)
@settings(max_examples=60, deadline=None)
@given(arrays.arrays(np.float32, LENGTH, elements=st.floats(-1e3, 1e3, width=32)))
def test_exponentials_are_those_of_the_readable_function(level, values):
    found = values.copy()
    _core.exponentials(found, level=level)
    assert found.tobytes() == elementary.exp(values).astype(np.float32).tobytes()


@pytest.mark.parametrize("level", LEVELS)
@settings(max_examples=60, deadline=None)
@given(seed=LONG, length=LENGTH)
def test_normal_numbers_are_those_of_the_readable_function(level, seed, length):
    index = np.arange(length, dtype=np.uint64)
    u, v = (philox.uniform(word) for word in philox.words(seed, index, 7, 0)[:2])
    expected = philox.normal_pair(u, v)
    _core.normal_pairs(u, v, level=level)
    assert [u.tobytes(), v.tobytes()] == [one.tobytes() for one in expected]


def test_draws_follow_each_other_and_have_the_shape_of_what_was_asked():
    index, slots = np.arange(5, dtype=np.uint64)[:, None], np.arange(3, dtype=np.uint32) + 0x200
    draws, expected = (one(2**64 - 1, index, slots) for one in (compiled.Draws, philox.Draws))
    for _ in range(3):
        for asked in ("word", "normal", "uniform"):
            one, other = getattr(draws, asked)(), getattr(expected, asked)()
            assert one.shape == (5, 3)
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)


def test_what_is_given_stays_as_it_is():
    u, v = np.full(3, 0.25, np.float32), np.full(3, 0.75, np.float32)
    compiled.normal_pair(u, v)
    compiled.exp(u)
    assert (u.tolist(), v.tolist()) == ([0.25] * 3, [0.75] * 3)


def test_numbers_in_any_order_in_memory_are_taken_as_they_stand():
    values = np.arange(12, dtype=np.float32).reshape(3, 4).T
    np.testing.assert_array_equal(compiled.exp(values), elementary.exp(values))
    np.testing.assert_array_equal(compiled.exp(np.float32(1.0)), elementary.exp(np.float32(1.0)))


@pytest.mark.parametrize("level", ["none", "neon" if "neon" not in LEVELS else "avx2"])
def test_a_level_that_this_machine_lacks_is_refused(level):
    with pytest.raises(ValueError, match="level"):
        _core.exponentials(np.zeros(1, np.float32), level=level)


def test_arrays_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="stream"):
        _core.words(seed=1, index=np.zeros(2, np.uint64), stream=np.zeros(1, np.uint32), draw=0)
    with pytest.raises(ValueError, match="v:"):
        _core.normal_pairs(np.zeros(2, np.float32), np.zeros(1, np.float32))
