"""Counter-based random numbers: Philox 4x32-10.

The generator has no state. It maps four numbers to a block of four random 32-bit words:

seed: 64-bit number that the user chooses for a data set.
scenario index: 64-bit number of a scenario (road, traffic and weather at the start of a
    simulation).
stream: purpose of the draws, a `Stream`. Purposes that concern single vehicles add the slot (the
    number of a vehicle in its simulation) or the role of a neighbour (leader, follower, ...), both
    less than 256.
block number: 0 for the first four words of a stream, 1 for the next.

So a simulation has the same random numbers in any batch (simulations computed together), in any
process and with CPU vectors of any width. `core.native` has the same functions, compiled.

Source:
    Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11; constants and
    known-answer vectors of the Random123 library.
"""

import enum

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U32, U64
from overtaking.core.float32_math import HALF, TAU, log, sincos

_MULTIPLIER_0 = np.uint64(0xD251_1F53)
_MULTIPLIER_1 = np.uint64(0xCD9E_8D57)
_KEY_STEP_0 = 0x9E37_79B9
_KEY_STEP_1 = 0xBB67_AE85
_LOW_32_BITS = np.uint64(0xFFFF_FFFF)
_ROUNDS = 10


class Stream(enum.IntEnum):
    """The purposes of draws; each stream of a simulation is independent of the others.

    A new purpose gets a new number, so that existing purposes keep their random numbers.
    """

    WEATHER = 1
    LAYOUT = 2  # Positions and speeds of the vehicles at the start.
    WIND_AND_WATER = 3  # Wind, and positions of puddles.
    MATCHED_INSTANT = 4  # Instant at which features describe a simulation without an overtake.
    SIMULATOR = 5  # Seeds for other simulators, such as SUMO.
    PROPOSAL = 6  # In importance sampling: the distribution from which a scenario is drawn.
    EXTERNAL_DRIVER = 7  # For a function of the user that drives the ego, the vehicle under study.
    # Purposes that draw for each slot or for each role leave 256 numbers to the next purpose.
    VEHICLE = 0x100  # + slot: size and performance of the vehicle
    DRIVER = 0x200  # + slot: traits of its driver
    MOTION = 0x300  # + slot: gusts, errors of perception and wandering in the lane
    GLANCES = 0x400  # + slot: looks over the shoulder before a lane change
    SENSOR = 0x500  # + role of the sensed neighbour: errors of a sensor for an external driver
    BEING_PASSED = 0x600  # + slot: reactions of a driver to a vehicle that passes


def philox4x32(
    counter: tuple[U32, U32, U32, U32], key: tuple[int, int]
) -> tuple[U32, U32, U32, U32]:
    """Map each counter of four 32-bit words to a block of four random words.

    Args:
        counter: The first, second, third and fourth words of the counters, arrays of one shape.
        key: Two 32-bit words; another key maps the same counters to other blocks.

    Returns:
        The first, second, third and fourth words of the blocks, each with that shape.
    """
    # In 64 bits, because each round needs the upper and the lower half of a product.
    c0, c1, c2, c3 = (np.asarray(word, dtype=np.uint64) for word in counter)
    k0, k1 = key
    for _ in range(_ROUNDS):
        product0 = c0 * _MULTIPLIER_0
        product1 = c2 * _MULTIPLIER_1
        c0, c1, c2, c3 = (
            (product1 >> np.uint64(32)) ^ c1 ^ np.uint64(k0),
            product1 & _LOW_32_BITS,
            (product0 >> np.uint64(32)) ^ c3 ^ np.uint64(k1),
            product0 & _LOW_32_BITS,
        )
        k0 = (k0 + _KEY_STEP_0) & 0xFFFF_FFFF
        k1 = (k1 + _KEY_STEP_1) & 0xFFFF_FFFF
    return (c0.astype(np.uint32), c1.astype(np.uint32), c2.astype(np.uint32), c3.astype(np.uint32))


def philox_words(
    seed: int, scenario_index: U64, stream: U32 | int, block_number: int
) -> tuple[U32, U32, U32, U32]:
    """The block of four random words for each scenario and stream.

    Args:
        seed: Seed of the data set, 0 <= seed < 2**64.
        scenario_index: Index of each scenario; broadcasts with `stream`.
        stream: A `Stream`, plus slots or roles for some purposes.
        block_number: Block number in the stream, 0 <= block_number < 2**32. Draws at a decision of
            a driver take the number of the decision, so they do not depend on earlier draws.

    Returns:
        The four words, each with the common shape of `scenario_index` and `stream`.
    """
    scenario_index, streams = np.broadcast_arrays(
        np.asarray(scenario_index, np.uint64), np.asarray(stream, np.uint32)
    )
    low = (scenario_index & _LOW_32_BITS).astype(np.uint32)
    high = (scenario_index >> np.uint64(32)).astype(np.uint32)
    block_numbers = np.full(scenario_index.shape, block_number, dtype=np.uint32)
    return philox4x32((block_numbers, streams, low, high), (seed & 0xFFFF_FFFF, seed >> 32))


def uniform_from_word(word: U32) -> F32:
    """Convert 32-bit words to numbers in the open interval (0, 1).

    Only the upper 23 bits of the word count: together with the digit of the added half they fill
    the 24 binary digits of a float32, so the sum is exact. The half excludes 0, because
    `box_muller` takes the logarithm.
    """
    return ((word >> np.uint32(9)).astype(np.float32) + HALF) * np.float32(2.0**-23)


def box_muller(u: F32, v: F32) -> tuple[F32, F32]:
    """Convert two uniform numbers to two independent standard normal ones (Box and Muller 1958).

    Args:
        u: Numbers in (0, 1).
        v: Other numbers in (0, 1), of the same shape.
    """
    radius = np.sqrt(np.float32(-2.0) * log(u))
    sine, cosine = sincos(TAU * v)
    return radius * cosine, radius * sine


class PhiloxStream:
    """Successive uniform and normal numbers of a stream, for a batch of simulations.

    Each call of a method returns one number for each scenario and stream, as an array with the
    common shape of `scenario_index` and `stream`. The n-th number of a stream is the same in every
    batch.

    Args:
        seed: Seed of the data set, 0 <= seed < 2**64.
        scenario_index: Index of the scenario of each simulation; broadcasts with `stream`.
        stream: A `Stream`, plus slots or roles for some purposes.
    """

    def __init__(self, seed: int, scenario_index: U64, stream: U32 | int) -> None:
        """Start at the first number of the stream."""
        self._seed, self._scenario_index, self._stream = seed, scenario_index, stream
        self._next_block = 0
        self._unused_words: list[U32] = []  # Words of the last block that are left, in order.

    def next_word(self) -> U32:
        """The next random 32-bit word."""
        if not self._unused_words:
            self._unused_words = list(self._block_words(self._next_block))
            self._next_block += 1
        return self._unused_words.pop(0)

    def _block_words(self, block_number: int) -> tuple[U32, U32, U32, U32]:
        """The four words of a block; `core.native` overrides this method."""
        return philox_words(self._seed, self._scenario_index, self._stream, block_number)

    def uniform(self, low: float = 0.0, high: float = 1.0) -> F32:
        """The next number between `low` and `high`.

        By default it is never 0 or 1. With other limits, rounding can make it equal to a limit.
        """
        low32, high32 = np.float32(low), np.float32(high)
        return low32 + (high32 - low32) * uniform_from_word(self.next_word())

    def normal(self) -> F32:
        """The next standard normal number.

        It takes two words. It drops the second number of `box_muller`, so that every call takes the
        same number of words.
        """
        u, v = (uniform_from_word(self.next_word()) for _ in range(2))
        return box_muller(u, v)[0]

    def integer(self, count: int) -> NDArray[np.int32]:
        """The next integer in [0, count).

        Args:
            count: Number of possible values, at most 65536. The probability of a value differs from
                1 / count by less than 2**-16, because 2**16 numbers are mapped to `count` values.
        """
        # Only 16 bits of the word: their product with `count` fits into 32 bits.
        upper_bits = self.next_word() >> np.uint32(16)
        return (upper_bits * np.uint32(count) >> np.uint32(16)).astype(np.int32)
