"""Chooses the executor of a data set: threads, processes or a Ray cluster."""

import sys

from overtaking.core import process_limits
from overtaking.core.errors import ConfigError, check_choice
from overtaking.data.location import Folder, Location
from overtaking.data.processes import ProcessExecutor
from overtaking.data.recipe import Recipe, Simulator
from overtaking.data.work import Executor, in_this_process

EXECUTORS = ("auto", "threads", "processes", "ray")
"""Choices: automatic by size, threads of this process, processes of this machine, a Ray cluster."""

MIN_PIECES = 40
"""Least number of batches of a simulator for which starting processes pays."""


def executor_for_recipe(
    executor: str,
    recipe: Recipe,
    simulator: Simulator,
    location: Location,
    *,
    address: str | None = None,
    workers: int | None = None,
) -> Executor:
    """The executor of a data set.

    Args:
        executor: One of `EXECUTORS`.
        recipe: The data set to make.
        simulator: What simulates.
        location: Where it is to lie.
        address: Of a Ray cluster.
        workers: How many processes; with `auto` it asks for processes.

    Raises:
        ConfigError: One of them cannot be used, they do not go together, or there is no cluster.
    """
    check_choice(executor, EXECUTORS, what="executor", where="generate")
    if executor == "ray":
        return _ray(address, workers)
    _refuse_strangers(executor, address, workers)
    if executor == "threads":
        return in_this_process
    if executor == "auto" and workers is None and not _pays(recipe, simulator, location):
        return in_this_process
    if simulator.shares_world:
        raise ConfigError(
            what="executor",
            where="generate",
            expected="threads",
            got="processes",
            next_step=f"leave it out: all processes share the world of {simulator.name}",
        )
    return ProcessExecutor(
        workers=process_limits.processors_to_use() if workers is None else workers
    )


def executor_for_shards(
    executor: str, shards: int, *, address: str | None = None, workers: int | None = None
) -> Executor:
    """The executor of work without a simulator; `auto` takes processes for several shards.

    Args:
        executor: One of `EXECUTORS`.
        shards: How many there are to make.
        address: Of a Ray cluster.
        workers: How many processes; with `auto` it asks for processes.

    Raises:
        ConfigError: One of them cannot be used, they do not go together, or there is no cluster.
    """
    check_choice(executor, EXECUTORS, what="executor", where="import")
    if executor == "ray":
        return _ray(address, workers)
    _refuse_strangers(executor, address, workers)
    if executor == "threads" or (executor == "auto" and workers is None and shards == 1):
        return in_this_process
    return ProcessExecutor(
        workers=process_limits.processors_to_use() if workers is None else workers
    )


def _ray(address: str | None, workers: int | None) -> Executor:
    """The executor of a cluster that answers."""
    from overtaking.data.ray_executor import RayExecutor

    executor = RayExecutor(address=address, workers=workers)
    executor.refuse_unreachable()
    return executor


def _refuse_strangers(executor: str, address: str | None, workers: int | None) -> None:
    """Refuse options that executors of this machine do not have."""
    _refuse_beside(executor, "address", address, "ray")
    if executor == "threads":
        _refuse_beside(executor, "workers", workers, "processes or ray")


def _pays(recipe: Recipe, simulator: Simulator, location: Location) -> bool:
    """Whether processes can do the work for sure, and sooner than threads.

    Access to a store may have been set up in this process alone.
    """
    return (
        process_limits.processors_to_use() > 1
        and bool(sys.executable)  # Not a program with Python inside.
        and isinstance(location, Folder)
        and not simulator.shares_world
        and recipe.num_simulations > recipe.shard_size
        and recipe.num_simulations >= MIN_PIECES * simulator.chunk_size
    )


def _refuse_beside(executor: str, what: str, value: object, others: str) -> None:
    """Refuse an option that only other executors have."""
    if value is not None:
        raise ConfigError(
            what=what,
            where="generate",
            expected=f"the executor {others} beside it",
            got=f"{value} with {executor}",
            next_step=f"add --executor {others}, or leave it out",
        )
