"""Which simulations belong to which file: a pure function of how many there are."""

from collections.abc import Iterator
from dataclasses import dataclass

SHARD_SIZE = 4096
"""Simulations a shard: files of some ten megabytes, and at most that much to do again."""

CHUNK_SIZE = 512
"""Simulations in memory at a time; each becomes a row group, the least that is read for one."""


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


def shards(num_simulations: int, shard_size: int = SHARD_SIZE) -> tuple[Shard, ...]:
    """The shards of a data set: every simulation in exactly one of them, in order."""
    starts = range(0, num_simulations, shard_size)
    return tuple(
        Shard(number=number, first=first, stop=min(first + shard_size, num_simulations))
        for number, first in enumerate(starts)
    )


def chunks(shard: Shard, chunk_size: int = CHUNK_SIZE) -> Iterator[range]:
    """The simulations of a shard in runs that fit into memory."""
    for first in range(shard.first, shard.stop, chunk_size):
        yield range(first, min(first + chunk_size, shard.stop))
