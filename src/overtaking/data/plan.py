"""Which simulations belong to which file: a pure function of how many there are."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from overtaking.model.scenario import MAX_VEHICLES
from overtaking.model.trajectories import BYTES_PER_STATE

SHARD_SIZE = 4096
"""Simulations a shard: files of some ten megabytes, and at most that much to do again."""

MAX_SIMULATIONS = 10**12
"""A larger number is a typing error."""

MAX_SHARDS = 10_000
"""With that many shards the manifest takes 200 MB of memory and a second to read."""

CHUNK_SIZE = 512
"""Most simulations in memory at a time; each chunk becomes a row group, the least that is read for
one simulation."""

LARGE_CHUNK_SIZE = 2048
"""The same where no frames are kept. The fixed cost of a chunk is a tenth of the time at 512, and a
quarter of that at 2,048."""

RECORDED_CHUNK_SIZE = 64
"""The same for simulations that were made from a recording."""

CHUNK_STATES = 5_000_000
"""Rows of the states in memory at a time, where the largest worlds would take more."""

BYTES_PER_CHUNK_BYTE = 2.5
"""Memory for the states of a chunk, its signals and its tables, in sizes of the states. For 600
simulations of `motorway` on two threads it was 2.3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shard:
    """A run of simulations that is written to one file per table.

    Attributes:
        number: Number of the shard.
        first: Number of its first simulation.
        stop: Number after that of its last simulation.
    """

    number: int
    first: int
    stop: int

    @property
    def num_simulations(self) -> int:
        """Number of simulations in the shard."""
        return self.stop - self.first

    @property
    def file_name(self) -> str:
        """Name of its file in the folder of each table."""
        return f"part-{self.number:05d}.parquet"


def num_shards(num_simulations: int, shard_size: int) -> int:
    """Number of shards of a data set."""
    return -(-num_simulations // shard_size)


def shards(num_simulations: int, shard_size: int = SHARD_SIZE) -> tuple[Shard, ...]:
    """The shards of a data set: every simulation in exactly one of them, in order."""
    starts = range(0, num_simulations, shard_size)
    return tuple(
        Shard(number=number, first=first, stop=min(first + shard_size, num_simulations))
        for number, first in enumerate(starts)
    )


def chunk_size(spec: Mapping[str, Any], most: int = CHUNK_SIZE) -> int:
    """Number of simulations in memory at a time.

    Recordings have no specification; their simulations are long and full of vehicles.
    """
    if not spec:
        return RECORDED_CHUNK_SIZE
    return max(1, min(most, int(CHUNK_STATES / _most_states(spec))))


def working_bytes(spec: Mapping[str, Any], simulations: int, threads: int) -> int:
    """Memory to simulate, label and write chunks of a data set at the same time [bytes].

    Args:
        spec: The specification, resolved.
        simulations: Simulations of a chunk.
        threads: Chunks that are made at a time; one more waits to be written.
    """
    chunk_bytes = simulations * _most_states(spec) * BYTES_PER_STATE
    return round(BYTES_PER_CHUNK_BYTE * chunk_bytes * (threads + 1))


def _most_states(spec: Mapping[str, Any]) -> float:
    """Most rows of the states of a simulation."""
    frames = 1000.0 * spec["time"]["horizon_s"] / spec["profile"]["frame_interval_ms"] + 1.0
    # Two-way traffic does not count its vehicles: it fills the slots.
    vehicles = spec["traffic"].get("vehicles", (1, MAX_VEHICLES))
    return vehicles[1] * frames


def batch_size(spec: Mapping[str, Any], simulator_size: int, *, keeps_frames: bool = True) -> int:
    """Number of simulations that a simulator gets at a time.

    Args:
        spec: The specification.
        simulator_size: Most that it wants, `CHUNK_SIZE` if it does not mind.
        keeps_frames: Whether frames are written.
    """
    if keeps_frames or simulator_size < CHUNK_SIZE:
        return min(chunk_size(spec), simulator_size)
    return chunk_size(spec, LARGE_CHUNK_SIZE)


def chunks(shard: Shard, size: int = CHUNK_SIZE) -> Iterator[range]:
    """The simulations of a shard in runs of at most `size`, which fit into memory."""
    return runs(shard.first, shard.stop, size)


def runs(first: int, stop: int, size: int) -> Iterator[range]:
    """The numbers from `first` to before `stop` in runs of at most `size`."""
    for begin in range(first, stop, size):
        yield range(begin, min(begin + size, stop))
