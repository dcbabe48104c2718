"""Progress while the files of a recording are read, in bytes."""

from __future__ import annotations

import io
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from pathlib import Path

    from overtaking.core.progress import ProgressCallback

_MIN_SHARE = 1 / 500  # Of all bytes between two reports: more would only slow the reading down.

_progress: ContextVar[ProgressCallback | None] = ContextVar("_progress", default=None)
_counter: ContextVar[_ByteCounter | None] = ContextVar("_counter", default=None)


class _ByteCounter:
    """Counts the bytes of files that are read, each of them in one or several passes.

    Args:
        total: Bytes of all files in all passes.
        progress: Called with the number of bytes that are read, and of all.
    """

    def __init__(self, total: int, progress: ProgressCallback) -> None:
        self._total, self._progress = total, progress
        self._positions: dict[tuple[str, Path], int] = {}
        self._last_report = 0

    def set_position(self, step: str, path: Path, position: int) -> None:
        """Take note that a pass has come to a position; going back changes nothing."""
        key = (step, path)
        self._positions[key] = max(position, self._positions.get(key, 0))
        done = min(sum(self._positions.values()), self._total)
        if done - self._last_report >= _MIN_SHARE * self._total:
            self._report(done)

    def finish(self) -> None:
        """Report that all bytes are read."""
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
    """Report how much of each recording is read by this thread within the context.

    Args:
        progress: Called with the number of bytes that are read, and of all; None to report
            nothing. The thread that calls it may be another one.
    """
    token = _progress.set(progress)
    try:
        yield
    finally:
        _progress.reset(token)


@contextmanager
def count_bytes(paths: Sequence[Path], num_passes: int) -> Generator[None]:
    """Count the bytes of the files of one recording.

    Args:
        paths: The files.
        num_passes: How often each of them is read.
    """
    if (progress := _progress.get()) is None:
        yield
        return
    sizes = [path.stat().st_size for path in paths if path.is_file()]
    counter = _ByteCounter(num_passes * sum(sizes), progress)
    token = _counter.set(counter)
    try:
        yield
        counter.finish()
    finally:
        _counter.reset(token)


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
