"""Philox against the vectors of its authors and against the implementation of randomgen."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from randomgen import Philox
from scipy import stats

from overtaking.core.random_numbers import (
    PhiloxStream,
    Stream,
    box_muller,
    philox4x32,
    philox_words,
    uniform_from_word,
)

# Random123, file tests/kat_vectors, the rows "philox4x32 10": counter, key, result.
KNOWN_ANSWERS = [
    (
        "00000000 00000000 00000000 00000000",
        "00000000 00000000",
        "6627e8d5 e169c58d bc57ac4c 9b00dbd8",
    ),
    (
        "ffffffff ffffffff ffffffff ffffffff",
        "ffffffff ffffffff",
        "408f276d 41c83b0e a20bc7c6 6d5451fd",
    ),
    (
        "243f6a88 85a308d3 13198a2e 03707344",
        "a4093822 299f31d0",
        "d16cfe09 94fdcceb 5001e420 24126ea1",
    ),
]

WORD = st.integers(0, 2**32 - 1)
SIMULATIONS = 60_000
# Seeds are fixed, so that each p-value is one number: a failure is a bug and not bad luck.
SMALLEST_P = 1e-3


def hexadecimal(text):
    return tuple(int(word, 16) for word in text.split())


def one_block(counter, key):
    first, second, third, fourth = np.array(counter, dtype=np.uint32)[:, None]
    return tuple(int(word[0]) for word in philox4x32((first, second, third, fourth), key))


def as_integer(low_to_high):
    """32-bit words, the lowest first, as one integer."""
    return sum(word << (32 * position) for position, word in enumerate(low_to_high))


@pytest.mark.parametrize(("counter", "key", "result"), KNOWN_ANSWERS)
def test_a_block_equals_the_published_result(counter, key, result):
    assert one_block(hexadecimal(counter), hexadecimal(key)) == hexadecimal(result)


@settings(max_examples=50, deadline=None)
@given(st.tuples(WORD, WORD, WORD, WORD), st.tuples(WORD, WORD))
def test_any_block_equals_the_implementation_of_randomgen(counter, key):
    # The other generator counts up before each block, so it starts one below.
    counter_before = (as_integer(counter) - 1) % 2**128
    generator = Philox(counter=counter_before, key=as_integer(key), number=4, width=32)
    expected = tuple(int(word) for word in np.asarray(generator.random_raw(4)))
    assert one_block(counter, key) == expected


def test_a_block_of_a_stream_is_the_block_of_its_counter():
    index = np.array([5, 2**40 + 7], dtype=np.uint64)
    words = philox_words(0x0123_4567_89AB_CDEF, index, Stream.DRIVER + 3, 11)
    for row, simulation in enumerate(int(number) for number in index):
        counter = (11, Stream.DRIVER + 3, simulation & 0xFFFF_FFFF, simulation >> 32)
        expected = one_block(counter, (0x89AB_CDEF, 0x0123_4567))
        assert tuple(int(word[row]) for word in words) == expected


@given(st.integers(0, 2**64 - 1), st.integers(0, 2**64 - 50), st.integers(1, 40))
@settings(max_examples=25, deadline=None)
def test_a_draw_does_not_depend_on_the_batch(seed, first, count):
    index = np.arange(first, first + count, dtype=np.uint64)
    together = PhiloxStream(seed, index[:, None], np.arange(4, dtype=np.uint32))
    alone = PhiloxStream(seed, index[-1:, None], np.array([3], dtype=np.uint32))
    for _ in range(6):
        np.testing.assert_array_equal(together.next_word()[-1, 3], alone.next_word()[0, 0])


@pytest.mark.ci
def test_streams_simulations_and_seeds_do_not_repeat_each_other():
    index = np.arange(500, dtype=np.uint64)
    streams = np.arange(500, dtype=np.uint32)
    words_of_seeds = [PhiloxStream(seed, index[:, None], streams).next_word() for seed in (1, 2)]
    all_words = np.stack([np.ravel(block) for block in words_of_seeds])
    assert np.unique(all_words).size > all_words.size * (1 - 2 * all_words.size / 2**32)


@pytest.mark.parametrize("word", [0, 1, 511, 512, 2**31, 2**32 - 1])
def test_a_uniform_number_is_never_zero_or_one(word):
    number = uniform_from_word(np.array([word], dtype=np.uint32))[0]
    assert 0.0 < number < 1.0
    assert number == ((word >> 9) + 0.5) / 2**23


@pytest.fixture
def draws():
    return PhiloxStream(20, np.arange(SIMULATIONS, dtype=np.uint64), Stream.VEHICLE)


def test_uniform_numbers_are_uniform(draws):
    for _ in range(5):
        assert stats.kstest(draws.uniform(), "uniform").pvalue > SMALLEST_P


def test_uniform_numbers_fill_their_range(draws):
    numbers = draws.uniform(-3.0, 5.0)
    assert stats.kstest(numbers, stats.uniform(-3.0, 8.0).cdf).pvalue > SMALLEST_P
    assert numbers.min() >= -3.0
    assert numbers.max() <= 5.0


def test_normal_numbers_are_normal(draws):
    numbers = draws.normal()
    assert stats.kstest(numbers, "norm").pvalue > SMALLEST_P
    assert abs(stats.skew(numbers)) < 0.03
    assert abs(stats.kurtosis(numbers)) < 0.06


def test_a_normal_pair_is_two_independent_normal_numbers(draws):
    first, second = box_muller(draws.uniform(), draws.uniform())
    for numbers in (first, second):
        assert stats.kstest(numbers, "norm").pvalue > SMALLEST_P
    for left, right in ((first, second), (first**2, second**2)):
        assert abs(np.corrcoef(left, right)[0, 1]) < 5.0 / np.sqrt(SIMULATIONS)


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_integers_are_equally_likely(draws, count):
    numbers = draws.integer(count)
    counts = np.bincount(numbers, minlength=count)
    assert counts.size == count
    if count > 1:
        assert stats.chisquare(counts).pvalue > SMALLEST_P


def test_successive_draws_are_uncorrelated(draws):
    sample = np.stack([draws.uniform() for _ in range(8)])
    correlation = np.corrcoef(sample) - np.eye(8)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(SIMULATIONS)


def test_streams_are_uncorrelated():
    index = np.arange(SIMULATIONS, dtype=np.uint64)[:, None]
    streams = np.uint32(Stream.DRIVER) + np.arange(8, dtype=np.uint32)
    sample = PhiloxStream(3, index, streams).uniform()
    correlation = np.corrcoef(sample.T) - np.eye(8)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(SIMULATIONS)
