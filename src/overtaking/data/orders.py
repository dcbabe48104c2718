"""What is to be made, shard by shard: pure orders, carried out here or on another machine."""

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.data import plan, write
from overtaking.data.ahead import in_order
from overtaking.data.contents import contents
from overtaking.data.manifest import ShardRecord
from overtaking.data.place import Place
from overtaking.data.plan import Shard
from overtaking.data.recipe import Keep, Recipe, Simulator
from overtaking.data.tables.unknown import schema_of
from overtaking.scenarios import sample

Told = Callable[[int], None]
"""Called with a number of simulations that are done now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What all shards of a data set share. With a task it decides every byte of a shard.

    Attributes:
        recipe: What to make.
        simulator: What simulates.
        fingerprint: Of the identity of the data set.
        is_resumed: Whether a shard that is there already is kept.
    """

    recipe: Recipe
    simulator: Simulator
    fingerprint: str
    is_resumed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One shard.

    Attributes:
        shard: Which simulations.
        index: Number of each among the candidates, shape (simulation,); None where all are taken.
        weight: Weight of the cell of each in a balanced data set, shape (simulation,); or None.
        known: What a complete data set says of it; then nothing else is kept.
    """

    shard: Shard
    index: NDArray[np.uint64] | None = None
    weight: NDArray[np.float64] | None = None
    known: ShardRecord | None = None


class Crew(Protocol):
    """Carries out tasks, wherever and in whatever order."""

    def __call__(
        self, order: Order, tasks: Iterable[Task], place: Place, on_done: Told
    ) -> Generator[ShardRecord]:
        """The record of each shard, once it is in its place."""
        ...


def here(
    order: Order, tasks: Iterable[Task], place: Place, on_done: Told
) -> Generator[ShardRecord]:
    """Carry out one task after the other in this process, with the simulator's threads.

    Args:
        order: What is to be made.
        tasks: The shards.
        place: Where they belong.
        on_done: Told about every few hundred simulations.
    """
    for task in tasks:
        yield carry_out(order, task, place, on_done)


def carry_out(order: Order, task: Task, place: Place, on_done: Told) -> ShardRecord:
    """Put a shard into its place, if it is not there.

    Raises:
        OSError: It cannot be written.
    """
    tables = order.recipe.keep.tables
    if order.is_resumed:
        known = write.finished_shard(
            place, task.shard, tables=tables, fingerprint=order.fingerprint
        )
        if known is not None and task.known in (None, known):
            on_done(task.shard.num_simulations)
            return known
    return write.write_shard(
        place,
        task.shard,
        _pieces(order, task),
        tables=tables,
        fingerprint=order.fingerprint,
        on_piece=on_done,
        schemas={name: schema_of(name, order.simulator.unknown) for name in tables},
    )


def _pieces(order: Order, task: Task) -> Iterator[Mapping[str, pa.Table]]:
    """The tables of a shard, as many simulations at a time as memory is meant to hold."""
    simulator = order.simulator
    size = plan.batch_size(
        order.recipe.spec.resolved(),
        simulator.chunk_size,
        keeps_frames=order.recipe.keep is Keep.FRAMES,
    )

    def piece(chunk: range) -> Mapping[str, pa.Table]:
        return _tables(order, task, chunk)

    return in_order(piece, plan.chunks(task.shard, size), simulator.threads)


def _tables(order: Order, task: Task, chunk: range) -> Mapping[str, pa.Table]:
    """The tables of some simulations of a shard."""
    recipe, numbers = order.recipe, np.arange(chunk.start, chunk.stop)
    part = slice(chunk.start - task.shard.first, chunk.stop - task.shard.first)
    index = numbers.astype(np.uint64) if task.index is None else task.index[part]
    scenario = sample(recipe.spec, recipe.road, recipe.seed, index)
    run = order.simulator.simulate(scenario)
    weight = scenario.weight if task.weight is None else scenario.weight * task.weight[part]
    return contents(run, numbers, recipe.keep.tables, class_weight=weight)
