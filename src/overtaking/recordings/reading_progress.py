"""Progress while a recording is read and examined, in bytes of its files.

Each byte counts three times (`NUM_PASSES`): when the hash of the file is computed, when its table
is read, and when the recording is examined. The examination takes most of the time of a Parquet
file, so a count of the bytes that are read would be complete long before the recording is.
"""

from __future__ import annotations

import io
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from pathlib import Path

    from overtaking.core.progress import ProgressCallback

NUM_PASSES = 3
"""Passes over each byte: hash, table, examination."""

STAGES = {"rows": 0.25, "tracks": 0.4, "examination": 0.45, "neighbours": 0.6, "candidates": 0.65}
"""Share of the third pass that is done at the end of each stage, as measured on a Parquet file of
8 million rows. Choosing the vehicles of each simulation is the last stage, up to 1.0."""

_MIN_SHARE = 1 / 500  # Of all bytes between two reports: more would only slow the reading down.

_progress: ContextVar[ProgressCallback | None] = ContextVar("_progress", default=None)
_counter: ContextVar[_ByteCounter | None] = ContextVar("_counter", default=None)


class _ByteCounter:
    """Counts the bytes of the files of one recording in each pass.

    Args:
        file_bytes: Bytes of all files.
        progress: Called with the number of bytes that are done in all passes, and of all.
    """

    def __init__(self, file_bytes: int, progress: ProgressCallback) -> None:
        self._file_bytes, self._total, self._progress = (
            file_bytes,
            NUM_PASSES * file_bytes,
            progress,
        )
        self._positions: dict[tuple[str, Path], int] = {}
        self._last_report = 0

    def set_position(self, step: str, path: Path, position: int) -> None:
        """Take note that a pass has come to a position; going back changes nothing."""
        key = (step, path)
        self._positions[key] = max(position, self._positions.get(key, 0))
        self._report_if_due(sum(self._positions.values()))

    def set_examined_share(self, share: float) -> None:
        """Take note of the share of the examination that is done.

        The first two passes count as complete then: the last position that Arrow reports may lie a
        few bytes before the end of the file.
        """
        self._report_if_due((NUM_PASSES - 1) * self._file_bytes + int(share * self._file_bytes))

    def _report_if_due(self, done: int) -> None:
        done = min(done, self._total)
        if done - self._last_report >= _MIN_SHARE * self._total:
            self._report(done)

    def finish(self) -> None:
        """Report that all bytes are read and examined."""
        if self._last_report < self._total:
            self._report(self._total)

    def _report(self, done: int) -> None:
        self._last_report = done
        self._progress(done, self._total)


class _CountedFile(io.FileIO):
    """A file whose position is reported as it is read, perhaps by a thread of Arrow."""

    def __init__(self, path: Path, step: str, counter: _ByteCounter) -> None:
        super().__init__(path)
        self._path, self._step, self._counter = path, step, counter

    def readinto(self, buffer: Any, /) -> int:
        """Read into a buffer; returns the number of bytes, 0 at the end."""
        count = super().readinto(buffer)
        self._counter.set_position(self._step, self._path, self.tell())
        return count


@contextmanager
def report_reading(progress: ProgressCallback | None) -> Generator[None]:
    """Report how much of each recording this thread has read and examined within the context.

    Args:
        progress: Called with the number of bytes that are done in all passes, and of all; None to
            report nothing. The thread that calls it may be another one.
    """
    token = _progress.set(progress)
    try:
        yield
    finally:
        _progress.reset(token)


@contextmanager
def count_bytes(paths: Sequence[Path]) -> Generator[None]:
    """Count the bytes of the files of one recording in all passes.

    Args:
        paths: The files.
    """
    if (progress := _progress.get()) is None:
        yield
        return
    sizes = [path.stat().st_size for path in paths if path.is_file()]
    counter = _ByteCounter(sum(sizes), progress)
    token = _counter.set(counter)
    try:
        yield
        counter.finish()
    finally:
        _counter.reset(token)


def report_stage(name: str) -> None:
    """Report that a stage of the examination is done.

    Args:
        name: A key of `STAGES`.
    """
    if (counter := _counter.get()) is not None:
        counter.set_examined_share(STAGES[name])


def report_chosen_vehicles(num_done: int, num_simulations: int) -> None:
    """Report for how many simulations the vehicles are chosen, the last stage of the examination.

    Args:
        num_done: Number of simulations whose vehicles are chosen.
        num_simulations: Number of all simulations of the recording.
    """
    if (counter := _counter.get()) is not None:
        begin = STAGES["candidates"]
        counter.set_examined_share(begin + (1.0 - begin) * num_done / num_simulations)


def is_counting() -> bool:
    """Whether somebody receives reports of bytes that are read."""
    return _counter.get() is not None


def open_counted(path: Path, step: str) -> io.BufferedReader:
    """A file to read, whose bytes are counted.

    Args:
        path: The file.
        step: Name of the pass.
    """
    if (counter := _counter.get()) is None:
        return path.open("rb")
    return io.BufferedReader(_CountedFile(path, step, counter))


def report_share(path: Path, step: str, share: float) -> None:
    """Count bytes of a file that is read by other means.

    Args:
        path: The file.
        step: Name of the pass.
        share: Share of the file that is read.
    """
    if (counter := _counter.get()) is not None:
        counter.set_position(step, path, int(share * path.stat().st_size))
