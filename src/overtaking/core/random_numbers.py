"""Counter-based random numbers: Philox 4x32-10.

A draw is a pure function of (seed, simulation, stream, draw number), so a simulation is the same in
any batch, on any worker and at any SIMD width.

Source:
    Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11; constants and
    known-answer vectors of the Random123 library.
"""

import enum

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U32, U64
from overtaking.core.float32_math import HALF, TAU, log, sincos

_M0 = np.uint64(0xD251_1F53)
_M1 = np.uint64(0xCD9E_8D57)
_W0 = 0x9E37_79B9
_W1 = 0xBB67_AE85
_LOW = np.uint64(0xFFFF_FFFF)
_ROUNDS = 10


class Stream(enum.IntEnum):
    """The purposes of draws; each stream of a simulation is independent of the others."""

    WEATHER = 1
    LAYOUT = 2
    WIND_AND_WATER = 3
    MATCHED_INSTANT = 4
    SIMULATOR = 5  # Seeds for simulators with random numbers of their own.
    PROPOSAL = 6  # Whether a simulation is drawn from where more happens.
    EXTERNAL_DRIVER = 7  # For another driver of the ego to draw from.
    VEHICLE = 0x100  # + slot: the vehicle's body
    DRIVER = 0x200  # + slot: the person in it
    MOTION = 0x300  # + slot: gusts and errors of perception while driving
    GLANCES = 0x400  # + slot: looks over the shoulder
    SENSOR = 0x500  # + role: errors of another driver's sensors
    BEING_PASSED = 0x600  # + slot: reactions of a driver to a vehicle that passes


def philox4x32(
    counter: tuple[U32, U32, U32, U32], key: tuple[int, int]
) -> tuple[U32, U32, U32, U32]:
    """One block of four 32-bit words for each counter.

    Args:
        counter: Four arrays of the same shape.
        key: Two 32-bit words.
    """
    c0, c1, c2, c3 = (np.asarray(word, dtype=np.uint64) for word in counter)
    k0, k1 = key
    for _ in range(_ROUNDS):
        product0 = c0 * _M0
        product1 = c2 * _M1
        c0, c1, c2, c3 = (
            (product1 >> np.uint64(32)) ^ c1 ^ np.uint64(k0),
            product1 & _LOW,
            (product0 >> np.uint64(32)) ^ c3 ^ np.uint64(k1),
            product0 & _LOW,
        )
        k0 = (k0 + _W0) & 0xFFFF_FFFF
        k1 = (k1 + _W1) & 0xFFFF_FFFF
    return (c0.astype(np.uint32), c1.astype(np.uint32), c2.astype(np.uint32), c3.astype(np.uint32))


def philox_words(
    seed: int, scenario_index: U64, stream: U32 | int, draw: int
) -> tuple[U32, U32, U32, U32]:
    """Four words of `stream` for each simulation.

    Args:
        seed: Seed of the data set, 0 <= seed < 2**64.
        scenario_index: Simulation numbers; broadcast against `stream`.
        stream: `Stream` number(s), plus the vehicle slot where one applies.
        draw: Number of the block inside the stream.
    """
    scenario_index, streams = np.broadcast_arrays(
        np.asarray(scenario_index, np.uint64), np.asarray(stream, np.uint32)
    )
    low = (scenario_index & _LOW).astype(np.uint32)
    high = (scenario_index >> np.uint64(32)).astype(np.uint32)
    draws = np.full(scenario_index.shape, draw, dtype=np.uint32)
    return philox4x32((draws, streams, low, high), (seed & 0xFFFF_FFFF, seed >> 32))


def uniform_from_word(word: U32) -> F32:
    """A 32-bit word as a number in the open interval (0, 1): 23 bits, exactly representable."""
    return ((word >> np.uint32(9)).astype(np.float32) + HALF) * np.float32(2.0**-23)


def box_muller(u: F32, v: F32) -> tuple[F32, F32]:
    """Two independent standard normal numbers from two uniform ones (Box and Muller 1958)."""
    radius = np.sqrt(np.float32(-2.0) * log(u))
    sine, cosine = sincos(TAU * v)
    return radius * cosine, radius * sine


class PhiloxStream:
    """Successive uniform and normal numbers of one stream, for a batch of simulations.

    The n-th number of a stream is the same in every batch. The numbers are arrays with the shape of
    `scenario_index` broadcast against `stream`.

    Args:
        seed: Seed of the data set, 0 <= seed < 2**64.
        scenario_index: Number of the scenario of each simulation.
        stream: `Stream` number(s), plus the vehicle slot where one applies.
    """

    def __init__(self, seed: int, scenario_index: U64, stream: U32 | int) -> None:
        """Start at draw 0 of `stream`."""
        self._seed, self._index, self._stream = seed, scenario_index, stream
        self._block = 0
        self._ready: list[U32] = []

    def next_word(self) -> U32:
        """The next 32-bit word."""
        if not self._ready:
            self._ready = list(self._block_words(self._block))
            self._block += 1
        return self._ready.pop(0)

    def _block_words(self, draw: int) -> tuple[U32, U32, U32, U32]:
        """The words of a block."""
        return philox_words(self._seed, self._index, self._stream, draw)

    def uniform(self, low: float = 0.0, high: float = 1.0) -> F32:
        """The next number in (low, high)."""
        low32, high32 = np.float32(low), np.float32(high)
        return low32 + (high32 - low32) * uniform_from_word(self.next_word())

    def normal(self) -> F32:
        """The next standard normal number (two words; the second of the pair is not used)."""
        return box_muller(uniform_from_word(self.next_word()), uniform_from_word(self.next_word()))[
            0
        ]

    def integer(self, count: int) -> NDArray[np.int32]:
        """The next integer in [0, count), count <= 65536; bias below 2**-16."""
        return ((self.next_word() >> np.uint32(16)) * np.uint32(count) >> np.uint32(16)).astype(
            np.int32
        )
