"""Who makes the shards of a data set, by name."""

import sys
from collections.abc import Mapping

from overtaking.core import processors
from overtaking.core.errors import ConfigError
from overtaking.data.orders import Crew, here
from overtaking.data.place import Folder, Place
from overtaking.data.process_crew import ProcessCrew
from overtaking.data.recipe import Recipe, Simulator

ENGINES = ("auto", "threads", "processes", "ray")
"""Who makes the shards: what suits the size, the threads of this process, processes of this
machine, or a Ray cluster."""

MIN_PIECES = 40
"""Pieces of work, as large as a simulator is given, from which on the start of processes pays."""


def crew_of(
    engine: str,
    recipe: Recipe,
    simulator: Simulator,
    place: Place,
    *,
    address: str | None = None,
    workers: int | None = None,
) -> Crew:
    """Who makes a data set.

    Args:
        engine: One of `ENGINES`.
        recipe: What is to be made.
        simulator: What simulates.
        place: Where it is to lie.
        address: Of a Ray cluster.
        workers: How many processes; with `auto` it asks for processes.

    Raises:
        ConfigError: One of them cannot be used, they do not go together, or there is no cluster.
    """
    if engine not in ENGINES:
        raise _refused("engine", " or ".join(ENGINES), engine, "choose one of them")
    if engine == "ray":
        from overtaking.data.ray_crew import RayCrew

        crew = RayCrew(address=address, workers=workers)
        crew.refuse_unreachable()
        return crew
    _refuse_beside(engine, {"address": address})
    if engine == "threads":
        _refuse_beside(engine, {"workers": workers})
        return here
    if engine == "auto" and workers is None and not _pays(recipe, simulator, place):
        return here
    if simulator.shares_world:
        next_step = f"leave it out: all processes share the world of {simulator.name}"
        raise _refused("engine", "threads", "processes", next_step)
    return ProcessCrew(workers=processors.wanted() if workers is None else workers)


def _pays(recipe: Recipe, simulator: Simulator, place: Place) -> bool:
    """Whether processes are sure to do the work, and sooner than threads.

    What reaches a store may have been arranged in this process alone.
    """
    return (
        processors.wanted() > 1
        and bool(sys.executable)  # Not a program with Python inside.
        and isinstance(place, Folder)
        and not simulator.shares_world
        and recipe.num_simulations > recipe.shard_size
        and recipe.num_simulations >= MIN_PIECES * simulator.chunk_size
    )


def _refuse_beside(engine: str, words: Mapping[str, object]) -> None:
    """Refuse words that are about another engine."""
    for what, value in words.items():
        if value is not None:
            others = "ray" if what == "address" else "processes or ray"
            next_step = f"add --engine {others}, or leave it out"
            got = f"{value} with {engine}"
            raise _refused(what, f"the engine {others} beside it", got, next_step)


def _refused(what: str, expected: str, got: object, next_step: str) -> ConfigError:
    return ConfigError.of(
        what=what, where="generate", expected=expected, got=got, next_step=next_step
    )
