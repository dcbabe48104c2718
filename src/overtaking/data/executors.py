"""Chooses the executor of a data set: threads, processes or a Ray cluster."""

import sys

from overtaking.core import process_limits
from overtaking.core.errors import ConfigError, check_choice
from overtaking.data.location import Folder, Location
from overtaking.data.processes import ProcessExecutor
from overtaking.data.recipe import Recipe, Simulator
from overtaking.data.work import Executor, in_this_process

ENGINES = ("auto", "threads", "processes", "ray")
"""Choices: automatic by size, threads of this process, processes of this machine, a Ray cluster."""

MIN_PIECES = 40
"""Least number of batches of a simulator for which starting processes pays."""


def executor_of(
    engine: str,
    recipe: Recipe,
    simulator: Simulator,
    location: Location,
    *,
    address: str | None = None,
    workers: int | None = None,
) -> Executor:
    """The executor of an engine.

    Args:
        engine: One of `ENGINES`.
        recipe: The data set to make.
        simulator: What simulates.
        location: Where it is to lie.
        address: Of a Ray cluster.
        workers: How many processes; with `auto` it asks for processes.

    Raises:
        ConfigError: One of them cannot be used, they do not go together, or there is no cluster.
    """
    check_choice(engine, ENGINES, what="engine", where="generate")
    if engine == "ray":
        return _ray(address, workers)
    _refuse_strangers(engine, address, workers)
    if engine == "threads":
        return in_this_process
    if engine == "auto" and workers is None and not _pays(recipe, simulator, location):
        return in_this_process
    if simulator.shares_world:
        raise ConfigError(
            what="engine",
            where="generate",
            expected="threads",
            got="processes",
            next_step=f"leave it out: all processes share the world of {simulator.name}",
        )
    return ProcessExecutor(
        workers=process_limits.processors_to_use() if workers is None else workers
    )


def executor_for(
    engine: str, shards: int, *, address: str | None = None, workers: int | None = None
) -> Executor:
    """The executor of work without a simulator; `auto` takes processes for several shards.

    Args:
        engine: One of `ENGINES`.
        shards: How many there are to make.
        address: Of a Ray cluster.
        workers: How many processes; with `auto` it asks for processes.

    Raises:
        ConfigError: One of them cannot be used, they do not go together, or there is no cluster.
    """
    check_choice(engine, ENGINES, what="engine", where="import")
    if engine == "ray":
        return _ray(address, workers)
    _refuse_strangers(engine, address, workers)
    if engine == "threads" or (engine == "auto" and workers is None and shards == 1):
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


def _refuse_strangers(engine: str, address: str | None, workers: int | None) -> None:
    """Refuse what an engine of this machine has no use for."""
    _refuse_beside(engine, "address", address, "ray")
    if engine == "threads":
        _refuse_beside(engine, "workers", workers, "processes or ray")


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


def _refuse_beside(engine: str, what: str, value: object, others: str) -> None:
    """Refuse an option that only other engines have."""
    if value is not None:
        raise ConfigError(
            what=what,
            where="generate",
            expected=f"the engine {others} beside it",
            got=f"{value} with {engine}",
            next_step=f"add --engine {others}, or leave it out",
        )
