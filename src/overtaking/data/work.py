"""The work on one shard, as data: carried out in this process or sent to another one."""

import dataclasses
import socket
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import DatasetError
from overtaking.core.process_limits import ordered_map
from overtaking.data import plan, shards
from overtaking.data.location import Location, location_of
from overtaking.data.manifest import ShardRecord, read_manifest
from overtaking.data.plan import Shard
from overtaking.data.recipe import Keep, Recipe, Simulator
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import schema_of
from overtaking.scenarios.sampler import ScenarioSource

OnDone = Callable[[int], None]
"""Called with a number of simulations that have just been written."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """The part of the work that all shards share. With a `Task` it decides every byte of a shard.

    Attributes:
        recipe: The data set to make.
        simulator: What simulates.
        fingerprint: Of the identity of the data set.
        is_resumed: Whether a shard that is there already is kept.
    """

    recipe: Recipe
    simulator: Simulator
    fingerprint: str
    is_resumed: bool

    def for_one_core(self) -> "Job":
        """The same job for a process that has one core: simulated with one thread."""
        return dataclasses.replace(self, simulator=dataclasses.replace(self.simulator, threads=1))

    def location(self, where: str) -> Location:
        """The location of the data set; see `visible_location`."""
        return visible_location(where, self.fingerprint)

    def make(self, task: "Task", location: Location, on_done: OnDone) -> ShardRecord:
        """Make a shard; see `make_shard`."""
        return make_shard(self, task, location, on_done)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One shard.

    Attributes:
        shard: Which simulations.
        index: Number of each among the candidates, shape (simulation,); None where all are taken.
        weight: Weight of the cell of each in a balanced data set, shape (simulation,); or None.
        known: What a complete data set says of it; a shard that differs is made again.
    """

    shard: Shard
    index: NDArray[np.uint64] | None = None
    weight: NDArray[np.float64] | None = None
    known: ShardRecord | None = None


class HasShard(Protocol):
    """A task, which is about a shard."""

    @property
    def shard(self) -> Shard:
        """Which one."""
        ...


class Work(Protocol):
    """What executors need of a job, such as `Job`: pickled, it goes to other processes."""

    def for_one_core(self) -> "Work":
        """The same for a process that has one core."""
        ...

    def location(self, where: str) -> Location:
        """The location of the result, as the process sees it that makes a shard."""
        ...

    def make(self, task: Any, location: Location, on_done: OnDone) -> ShardRecord:
        """Put the shard of a task into its place."""
        ...


class Executor(Protocol):
    """Carries out tasks, in any processes and in any order."""

    def __call__(
        self, job: Work, tasks: Iterable[HasShard], location: Location, on_done: OnDone
    ) -> Generator[ShardRecord]:
        """Make shards.

        Args:
            job: What all shards share.
            tasks: The shards.
            location: Where to put them.
            on_done: Called whenever some simulations are done.

        Yields:
            The record of each shard, once it is in its place.
        """
        ...


def in_this_process(
    job: Work, tasks: Iterable[HasShard], location: Location, on_done: OnDone
) -> Generator[ShardRecord]:
    """The `Executor` that carries out one task after the other, with the simulator's threads."""
    for task in tasks:
        yield job.make(task, location, on_done)


def make_shard(job: Job, task: Task, location: Location, on_done: OnDone) -> ShardRecord:
    """Put a shard into its place, unless it is there and intact.

    Raises:
        OSError: It cannot be written.
    """
    tables = job.recipe.tables
    if job.is_resumed:
        known = shards.finished_shard(
            location, task.shard, tables=tables, fingerprint=job.fingerprint
        )
        if known is not None and task.known in (None, known):
            on_done(task.shard.num_simulations)
            return known
    clipped: list[int] = []
    return shards.write_shard(
        location,
        task.shard,
        _pieces(job, task, clipped),
        fingerprint=job.fingerprint,
        on_piece=on_done,
        schemas={name: schema_of(name, job.simulator.unknown) for name in tables},
        clipped=clipped if job.recipe.policy else None,
    )


@cache
def visible_location(where: str, fingerprint: str) -> Location:
    """The location of a data set, if this process sees the same one as the sender of the task.

    Args:
        where: The text of its resolved location.
        fingerprint: Of the identity of the data set.

    Raises:
        DatasetError: Something else is there, or nothing.
    """
    location = location_of(where)
    try:
        found = read_manifest(location).identity.fingerprint
    except DatasetError:
        found = None
    if found == fingerprint:
        return location
    raise DatasetError(
        what="location",
        where=where,
        expected="one that every worker sees",
        got=f"{'nothing' if found is None else 'another data set'} there on {socket.gethostname()}",
        next_step="choose a folder that all machines share, or a store, such as s3://bucket/data",
    )


def _pieces(job: Job, task: Task, clipped: list[int]) -> Iterator[shards.Piece]:
    """The tables of a shard, as many simulations at a time as memory is meant to hold."""
    spec, keeps_frames = job.recipe.spec.to_dict(), job.recipe.keep is Keep.FRAMES
    size = plan.batch_size(spec, job.simulator.chunk_size, keeps_frames=keeps_frames)

    piece = partial(_piece, job, task, clipped)
    return ordered_map(piece, plan.chunks(task.shard, size), job.simulator.threads)


def _piece(job: Job, task: Task, clipped: list[int], chunk: range) -> shards.Piece:
    """The tables of some simulations of a shard; appends how many answers were clipped."""
    recipe, numbers = job.recipe, np.arange(chunk.start, chunk.stop)
    part = slice(chunk.start - task.shard.first, chunk.stop - task.shard.first)
    index = numbers.astype(np.uint64) if task.index is None else task.index[part]
    scenario = ScenarioSource(recipe.spec, recipe.road, recipe.seed).sample(index)
    run = job.simulator.simulate(scenario)
    if run.actions is not None and run.actions.num_clipped is not None:
        clipped.append(int(run.actions.num_clipped.sum()))
    weight = scenario.weight if task.weight is None else scenario.weight * task.weight[part]
    return len(chunk), contents(run, numbers, recipe.tables, balance_weight=weight)
