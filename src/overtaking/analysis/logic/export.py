"""Data sets as folders of facts, with the background theory beside them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO, TYPE_CHECKING

from overtaking.analysis.logic import facts as writing
from overtaking.analysis.logic.header import LANGUAGES, header
from overtaking.analysis.logic.source import I64, Group, groups
from overtaking.core.errors import ConfigError
from overtaking.core.folders import put_file, whole_folder

if TYPE_CHECKING:
    from collections.abc import Callable

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
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Write simulations as facts: one file for each thousand numbers, and the theory.

    Args:
        data: The data set.
        out: Folder for the files; it must not exist, or be empty. It appears when it is complete.
        language: One of `LANGUAGES`.
        chosen: Numbers of its simulations in order; all of them if left out.
        every: Every how many frames positions and speeds are written.
        with_law: Whether what only the law reads is written too, in every frame.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Number of facts written.

    Raises:
        ConfigError: The folder is taken, or a number cannot be used.
        DatasetError: The data set is damaged.
        OSError: A file cannot be written.
    """
    check_every(every)
    demand = writing.everything(with_law=with_law)
    with whole_folder(out) as folder:
        files = _Files(folder, data, demand, language)
        try:
            for group in groups(data, chosen):
                files.write(group, every)
                if progress is not None:
                    progress(group.done, len(data))
        finally:
            files.close()
        for name in _THEORIES[language]:
            if with_law or name != "law.lp":
                put_file(folder / name, (PROGRAMS / name).read_text(encoding="utf-8"))
    return files.num_facts


def check_every(every: int) -> None:
    """Refuse what is no number of frames.

    Raises:
        ConfigError: It is below one.
    """
    if every < 1:
        raise ConfigError.of(
            what="--every",
            where="logic",
            expected="1 frame or more",
            got=every,
            next_step="choose a number in that range",
        )


class _Files:
    """The files of facts of a folder, one open at a time."""

    def __init__(self, folder: Path, data: Dataset, demand: writing.Demand, language: str) -> None:
        self.num_facts = 0
        self._folder, self._data, self._demand = folder, data, demand
        self._language = language
        self._number = -1
        self._file: IO[bytes] | None = None

    def write(self, group: Group, every: int) -> None:
        """Append the facts of a group, to as many files as its numbers belong to."""
        parts = group.numbers // FILE_SIMULATIONS
        for number in sorted(set(parts.tolist())):
            some = parts == number
            case = group.case.select(some)
            found = writing.facts(
                case,
                group.numbers[some],
                self._demand,
                every=every,
                labels=writing.Classes(
                    classes=group.labels.classes[some], outcome=group.labels.outcome[some]
                ),
            )
            self._opened(number, group).write(writing.text(found))
            self.num_facts += writing.num_facts(found)

    def _opened(self, number: int, group: Group) -> IO[bytes]:
        """The file of a number, begun if it is a new one."""
        if self._file is not None and number == self._number:
            return self._file
        self.close()
        path = self._folder / f"facts-{number:05d}{LANGUAGES[self._language]}"
        title = f"Simulations of {self._data.profile}, data set {self._data.content_hash}"
        recorded = group.case.trajectories
        shared = writing.shared_facts(
            recorded.road, recorded.unknown, recorded.scenario.frame_interval_ms, self._demand
        )
        file = path.open("xb")
        self._file, self._number = file, number
        file.write(header(title, self._demand, self._language).encode())
        file.write(writing.text(shared))
        self.num_facts += writing.num_facts(shared)
        return file

    def close(self) -> None:
        """Force what was written to the disk."""
        if self._file is not None:
            with self._file as file:
                file.flush()
                os.fsync(file.fileno())
            self._file = None
