"""Data sets as folders of facts, with the background theory beside them."""

from __future__ import annotations

import os
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic import facts as writing
from overtaking.analysis.logic.source import Group, groups
from overtaking.core.errors import check_in_range
from overtaking.core.files import atomic_folder, write_new_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from overtaking.core.arrays import I64
    from overtaking.core.progress import ProgressCallback
    from overtaking.data.load import Dataset

PROGRAMS = Path(__file__).with_name("programs")
FILE_SIMULATIONS = 1000
"""Numbers of simulations of one file: what a reasoner loads at a time."""

_THEORIES = {"asp": ("theory.lp", "law.lp"), "prolog": ("theory.pl",)}


def write_facts(
    data: Dataset,
    out: Path,
    *,
    language: str,
    chosen: I64 | None = None,
    every: int = writing.EVERY,
    with_law: bool = False,
    progress: ProgressCallback | None = None,
) -> int:
    """Write simulations as facts: one file for each thousand numbers, and the theory.

    Args:
        data: The data set.
        out: Folder for the files; it must not exist, or be empty. It appears when it is complete.
        language: One of `facts.LANGUAGES`.
        chosen: Numbers of its simulations in order; all of them if left out.
        every: Interval between written positions and speeds [frames].
        with_law: Whether to write what only the law reads too, in every frame.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Number of facts written.

    Raises:
        ConfigError: The folder is taken, or a number cannot be used.
        DatasetError: The data set is damaged.
        OSError: A file cannot be written.
    """
    check_in_range(every, 1, what="--frame-step", where="logic", unit="frame")
    demand, num_facts = writing.everything(with_law=with_law), 0
    title = f"Simulations of {data.profile}, data set {data.content_hash}"
    head = writing.header(title, demand, language).encode()
    with atomic_folder(out) as folder:
        for number, parts in groupby(_parts(groups(data, chosen)), key=_file_of):
            path = folder / f"facts-{number:05d}{writing.LANGUAGES[language]}"
            with path.open("xb") as file:
                file.write(head)
                for index, part in enumerate(parts):
                    shared = {} if index else writing.shared_facts(part.case.trajectories, demand)
                    found = shared | writing.facts(part, demand, every=every)
                    file.write(writing.text(found))
                    num_facts += writing.num_facts(found)
                    if progress is not None:
                        progress(part.done, len(data))
                file.flush()
                os.fsync(file.fileno())
        for name in _THEORIES[language]:
            if with_law or name != "law.lp":
                write_new_file(folder / name, (PROGRAMS / name).read_text(encoding="utf-8"))
    return num_facts


def _parts(found: Iterable[Group]) -> Iterator[Group]:
    """The groups, cut where a file ends."""
    for group in found:
        files = group.numbers // FILE_SIMULATIONS
        yield from (group.select(files == number) for number in np.unique(files))


def _file_of(group: Group) -> int:
    return int(group.numbers[0]) // FILE_SIMULATIONS
