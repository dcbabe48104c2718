"""Estimates size and time of a data set from a few simulations, before anything is written."""

import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from overtaking.core import process_limits
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.data.location import Folder, Location
from overtaking.data.plan import Shard
from overtaking.data.recipe import Recipe, Simulator
from overtaking.data.work import Job, Task, make_shard

SAMPLE = 64
"""Simulations for the estimate, or fewer if each takes long."""

LEAST_SAMPLES = 64
"""Work of fewer such samples is just begun: the estimate would be a good part of it."""

LARGE_BYTES = 10_000_000_000
LARGE_SIMULATIONS = 1_000_000
"""A data set beyond one of these limits needs explicit permission."""

LONG_S = 60.0
_GB = 1e9
_S_PER_H = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Size and time of a data set, accurate to about a fifth.

    Attributes:
        simulations: How many.
        rows: Rows of all tables.
        size_bytes: Size of all files [bytes].
        free_bytes: Room where they belong; None in a store [bytes].
        seconds: Time on the processors of this machine, without that to look for the candidates of
            a balanced data set [s].
    """

    simulations: int
    rows: int
    size_bytes: int
    free_bytes: int | None
    seconds: float

    @property
    def is_large(self) -> bool:
        """Whether it needs explicit permission."""
        return self.size_bytes > LARGE_BYTES or self.simulations > LARGE_SIMULATIONS

    @property
    def is_long(self) -> bool:
        """Whether a person wants to know before the work begins."""
        return self.is_large or self.seconds > LONG_S

    def __str__(self) -> str:
        """The same in a few words."""
        free = "" if self.free_bytes is None else f" ({self.free_bytes / _GB:.3g} GB are free)"
        return (
            f"{self.simulations:,} simulations: about {self.rows:,} rows, "
            f"{self.size_bytes / _GB:.2g} GB{free}, {self.seconds / _S_PER_H:.2g} h "
            f"on {process_limits.processors_to_use()} processors"
        )


Allowed = bool | Callable[[Estimate], bool]
"""Permission to make a large data set, or a function that decides for each estimate."""


def refuse_too_large(
    recipe: Recipe, location: Location, simulator: Simulator, allowed: Allowed
) -> None:
    """Refuse a data set that does not fit on the disk, or that is large without permission.

    Args:
        recipe: The data set to make.
        location: Where.
        simulator: What simulates.
        allowed: Whether a large one may be made; asked about every one that is estimated.

    Raises:
        ConfigError: It is large, and the caller has not confirmed it.
        DatasetError: It does not fit on the disk.
    """
    count = min(SAMPLE, simulator.chunk_size)
    if recipe.num_simulations < LEAST_SAMPLES * count:
        return
    found = estimate(recipe, location, simulator, count)
    if found.free_bytes is not None and found.size_bytes > found.free_bytes:
        raise DatasetError(
            what="disk",
            where=str(location),
            expected=f"room for about {found.size_bytes / _GB:.3g} GB",
            got=f"{found.free_bytes / _GB:.3g} GB",
            next_step="ask for fewer simulations, leave out the frames (--keep features) or choose "
            "another folder",
        )
    is_allowed = allowed(found) if callable(allowed) else allowed or not found.is_large
    if not is_allowed:
        raise ConfigError(
            what="size",
            where="generate",
            expected=f"at most {LARGE_BYTES / _GB:g} GB and {LARGE_SIMULATIONS:,} simulations, or "
            "that more is allowed",
            got=str(found),
            next_step="add --yes (allow_large=True in Python)",
        )


def estimate(
    recipe: Recipe, location: Location, simulator: Simulator, count: int = SAMPLE
) -> Estimate:
    """Estimate size and time of a data set from its first simulations.

    Args:
        recipe: The data set to make.
        location: Where; nothing is written there.
        simulator: What simulates.
        count: How many simulations are made to learn it, 2 or more.
    """
    begin = time.process_time()
    rows, size = _made(recipe, simulator, count)
    seconds = time.process_time() - begin
    least_rows, least = _made(recipe, simulator, 1)  # Nearly all of it is the frame of the files.
    factor = (recipe.num_simulations - 1) / (count - 1)
    return Estimate(
        simulations=recipe.num_simulations,
        rows=round(least_rows + (rows - least_rows) * factor),
        size_bytes=round(least + (size - least) * factor),
        free_bytes=_free(location),
        seconds=seconds * recipe.num_simulations / count / process_limits.processors_to_use(),
    )


def _made(recipe: Recipe, simulator: Simulator, count: int) -> tuple[int, int]:
    """Rows and bytes of the first simulations."""
    job = Job(recipe=recipe, simulator=simulator, fingerprint="", is_resumed=False)
    task = Task(shard=Shard(number=0, first=0, stop=count))
    with tempfile.TemporaryDirectory(prefix="overtaking-") as folder:
        location = Folder(Path(folder))
        location.prepare(recipe.tables)
        facts = make_shard(job.for_one_core(), task, location, lambda _: None).tables.values()
    return sum(one.rows for one in facts), sum(one.size_bytes for one in facts)


def _free(location: Location) -> int | None:
    """Room where a data set belongs [bytes]; None in a store."""
    if not isinstance(location, Folder):
        return None
    there = location.path.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    return shutil.disk_usage(there).free
