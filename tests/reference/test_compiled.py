"""Compiled draws and elementary functions equal the readable ones bit for bit."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra import numpy as arrays

from overtaking import _core
from overtaking.core import float32_math, native, random_numbers

LEVELS = [name for name, available in _core.simd_levels() if available]

WORD, LONG = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
LENGTH = st.integers(0, 40)  # Blocks of sixteen, with and without a remainder.


@pytest.mark.parametrize("level", LEVELS)
@settings(max_examples=60, deadline=None)
@given(seed=LONG, first=LONG, stream=WORD, draw=WORD, length=LENGTH)
def test_compiled_words_equal_the_readable_generator(level, seed, first, stream, draw, length):
    step = np.arange(length, dtype=np.uint64)
    with np.errstate(over="ignore"):
        index, streams = np.uint64(first) + step, np.uint32(stream) + step.astype(np.uint32)
    expected = random_numbers.philox_words(seed, index, streams, draw)
    compiled = _core.random_words(seed=seed, index=index, stream=streams, draw=draw, level=level)
    assert [words.tolist() for words in compiled] == [words.tolist() for words in expected]


@pytest.mark.parametrize("level", LEVELS)
@settings(max_examples=60, deadline=None)
@given(arrays.arrays(np.float32, LENGTH, elements=st.floats(-1e3, 1e3, width=32)))
def test_compiled_exponentials_equal_the_readable_function(level, values):
    compiled = values.copy()
    _core.exp_in_place(compiled, level=level)
    assert compiled.tobytes() == float32_math.exp(values).astype(np.float32).tobytes()


@pytest.mark.parametrize("level", LEVELS)
@settings(max_examples=60, deadline=None)
@given(arrays.arrays(np.float32, LENGTH, elements=st.floats(-1.0, 2.0**99, width=32)))
def test_compiled_logarithms_equal_the_readable_function(level, values):
    compiled = values.copy()
    _core.log_in_place(compiled, level=level)
    assert compiled.tobytes() == float32_math.log(values).astype(np.float32).tobytes()


@settings(max_examples=60, deadline=None)
@given(arrays.arrays(np.uint32, LENGTH, elements=WORD))
def test_compiled_uniform_numbers_equal_the_readable_function(words):
    assert (
        _core.uniform_numbers(words).tobytes()
        == random_numbers.uniform_from_word(words).astype(np.float32).tobytes()
    )


NUMBER = st.sampled_from([0.0, -0.0, 1.0, np.inf, -np.inf]) | st.floats(-2.0, 2.0, width=32)
NUMBERS = arrays.arrays(np.float32, (3, 7), elements=NUMBER)


@pytest.mark.parametrize("name", ["maximum", "minimum", "power"])
@settings(max_examples=60, deadline=None)
@given(NUMBERS, NUMBERS | NUMBERS.map(lambda numbers: numbers[:, 2]) | NUMBER.map(np.float32))
def test_compiled_functions_of_two_numbers_equal_the_readable_functions(
    name, values, second_values
):
    """The sign of a zero counts; arrays are broadcast, also single numbers."""
    second_values = second_values[:, None] if second_values.shape == (3,) else second_values
    values = np.abs(values) if name == "power" else values
    compiled_function, readable_function = getattr(native, name), getattr(float32_math, name)
    for left, right in (
        (values, second_values),
        (second_values, values),
        (values.T, np.transpose(second_values)),
    ):
        with np.errstate(invalid="ignore"):
            compiled, expected = (
                compiled_function(left, right),
                readable_function(left, right).astype(np.float32),
            )
        assert compiled.shape == expected.shape
        assert compiled.dtype == np.float32
        assert np.ascontiguousarray(compiled).tobytes() == expected.tobytes()


@settings(max_examples=60, deadline=None)
@given(NUMBERS, NUMBERS | NUMBER.map(np.float32), NUMBERS | NUMBER.map(np.float32))
def test_compiled_clamping_equals_the_readable_function(values, low, high):
    compiled, expected = native.clamp(values, low, high), float32_math.clamp(values, low, high)
    assert compiled.tobytes() == expected.astype(np.float32).tobytes()


@pytest.mark.parametrize("name", ["maximum_in_place", "minimum_in_place"])
def test_others_of_another_length_are_refused(name):
    with pytest.raises(ValueError, match="others: expected 3 numbers, got 4"):
        getattr(_core, name)(np.zeros(3, np.float32), np.zeros(4, np.float32))


@pytest.mark.parametrize("level", LEVELS)
@settings(max_examples=60, deadline=None)
@given(seed=LONG, length=LENGTH)
def test_compiled_normal_numbers_equal_the_readable_function(level, seed, length):
    index = np.arange(length, dtype=np.uint64)
    u, v = (
        random_numbers.uniform_from_word(word)
        for word in random_numbers.philox_words(seed, index, 7, 0)[:2]
    )
    expected = random_numbers.box_muller(u, v)
    _core.normal_pairs_in_place(u, v, level=level)
    assert [u.tobytes(), v.tobytes()] == [numbers.tobytes() for numbers in expected]


def test_successive_compiled_draws_equal_the_readable_stream():
    index, slots = np.arange(5, dtype=np.uint64)[:, None], np.arange(3, dtype=np.uint32) + 0x200
    draws, expected = (
        stream(2**64 - 1, index, slots)
        for stream in (native.PhiloxStream, random_numbers.PhiloxStream)
    )
    for _ in range(3):
        for method in ("next_word", "normal", "uniform"):
            drawn, readable = getattr(draws, method)(), getattr(expected, method)()
            assert drawn.shape == (5, 3)
            assert drawn.dtype == readable.dtype
            np.testing.assert_array_equal(drawn, readable)


def test_compiled_functions_do_not_change_their_arguments():
    u, v = np.full(3, 0.25, np.float32), np.full(3, 0.75, np.float32)
    native.box_muller(u, v)
    for changed in (native.exp, native.log):
        changed(u)
    native.clamp(u, np.float32(0.5), v)
    assert (u.tolist(), v.tolist()) == ([0.25] * 3, [0.75] * 3)


def test_compiled_functions_accept_any_memory_order():
    values = np.arange(12, dtype=np.float32).reshape(3, 4).T
    np.testing.assert_array_equal(native.exp(values), float32_math.exp(values))
    np.testing.assert_array_equal(native.exp(np.float32(1.0)), float32_math.exp(np.float32(1.0)))


@pytest.mark.parametrize("level", ["none", "neon" if "neon" not in LEVELS else "avx2"])
def test_an_unsupported_simd_level_is_refused(level):
    with pytest.raises(ValueError, match="level"):
        _core.exp_in_place(np.zeros(1, np.float32), level=level)


def test_arrays_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="stream"):
        _core.random_words(
            seed=1, index=np.zeros(2, np.uint64), stream=np.zeros(1, np.uint32), draw=0
        )
    with pytest.raises(ValueError, match="v:"):
        _core.normal_pairs_in_place(np.zeros(2, np.float32), np.zeros(1, np.float32))
