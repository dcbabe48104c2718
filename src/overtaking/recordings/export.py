"""Data sets as folders of files in the formats of recordings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from overtaking.core.errors import ConfigError
from overtaking.core.files import atomic_folder
from overtaking.model.road import DrivingSide

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from overtaking.model.road import Road
    from overtaking.model.trajectories import Trajectories

FORMATS = ("commonroad", "highd", "openscenario")
"""The formats that are written as one or more files for each simulation."""

MAX_SIMULATIONS = 100_000
"""More files than anyone wants in one folder."""


def write_folder(
    batches: Iterable[tuple[NDArray[np.integer], Trajectories]],
    out: Path,
    *,
    file_format: str,
    total: int,
    road: Road,
    events: Mapping[int, Mapping[str, float]] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Write all simulations of a data set.

    Args:
        batches: Numbers of some simulations, and what was recorded of them.
        out: Folder for the files; it must not exist, or be empty. It appears when it is complete.
        file_format: One of `FORMATS`.
        total: Number of simulations.
        road: Road of all of them.
        events: Instants of what happened by number and name [s], for formats that have a place.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Number of states written.

    Raises:
        ConfigError: The folder is taken, there are too many simulations, or the format cannot hold
            them.
        OSError: A file cannot be written.
    """
    _check(file_format, total, road)
    if file_format == "commonroad":
        from overtaking.recordings.commonroad_write import write_commonroad as write
    elif file_format == "openscenario":
        from overtaking.recordings.openscenario_write import write_openscenario

        write = partial(write_openscenario, events=events)
    else:
        from overtaking.recordings.highd_write import write_highd as write
    rows = done = 0
    with atomic_folder(out) as folder:
        for numbers, trajectories in batches:
            rows += write(trajectories, numbers, folder)
            done += len(numbers)
            if progress is not None:
                progress(done, total)
    return rows


def _check(file_format: str, total: int, road: Road) -> None:
    """Refuse what a format cannot hold."""
    if total > MAX_SIMULATIONS:
        raise ConfigError(
            what=f"export to {file_format}",
            where="export",
            expected=f"at most {MAX_SIMULATIONS} simulations, as each has files of its own",
            got=total,
            next_step="export the paper's table, or generate fewer",
        )
    if file_format == "highd" and road.driving_side is not DrivingSide.RIGHT:
        raise ConfigError(
            what="export to highd",
            where="export",
            expected="a road with right-hand traffic, as highD's lanes have",
            got="left-hand traffic",
            next_step="export to commonroad",
        )
