"""What a process and all that it started hold and use, looked at ten times a second. Linux only."""

import os
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

INTERVAL = 0.1
MIB = 2**20
_PARENT, _MEMORY, _CPU = 1, 21, slice(11, 15)
"""Fields of `/proc/N/stat` behind the name: parent, pages in memory, ticks of it and its dead."""


def stats() -> dict[int, list[int]]:
    """The numbers of `/proc/N/stat` of every process, those behind its name."""
    found: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            text = (folder / "stat").read_text()
        except OSError:
            continue
        found[int(folder.name)] = [int(one) for one in text.rpartition(") ")[2].split()[1:]]
    return found


def family(root: int) -> list[list[int]]:
    """The numbers of a process and of all that it and its children started."""
    known = stats()
    members, added = set[int](), {root}
    while added:
        members |= added
        added = {pid for pid, row in known.items() if row[_PARENT - 1] in members} - members
    return [known[pid] for pid in members if pid in known]


class Watch:
    """Looks at a family of processes as long as it is open.

    Attributes:
        peak: Most memory that all its processes held together [MiB].
        cpu: Time of all processors, in processes that had ended or were seen last [s].
    """

    def __init__(self, root: int) -> None:
        """Look at nothing yet.

        Args:
            root: The process that started the others.
        """
        self.peak = self.cpu = 0.0
        self._root = root
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> Self:
        """Begin to look."""
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Look away."""
        self._is_over.set()
        self._thread.join()

    def _look(self) -> None:
        page, tick = os.sysconf("SC_PAGE_SIZE"), os.sysconf("SC_CLK_TCK")
        while not self._is_over.wait(INTERVAL):
            rows = family(self._root)
            self.peak = max(self.peak, sum(row[_MEMORY - 1] for row in rows) * page / MIB)
            ticks = sum(sum(row[_CPU.start - 1 : _CPU.stop - 1]) for row in rows)
            self.cpu = max(self.cpu, ticks / tick)
