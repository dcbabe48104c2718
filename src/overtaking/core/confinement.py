"""Bounds that the operating system holds a process to, where it knows them."""

from __future__ import annotations

import contextlib
from pathlib import Path

BYTES_PER_MIB = 1024 * 1024


def confine(
    memory_mib: int, *, open_files: int | None = None, processor_s: int | None = None
) -> None:
    """Forbid this process to write files, and bound its memory.

    Linux knows all of these bounds. macOS does not bound memory, Windows knows none.

    Args:
        memory_mib: Memory beyond what it uses now [MiB].
        open_files: Number of files that may be open, None for no bound.
        processor_s: Time of a processor after which SIGXCPU ends it [s], None for no bound.
    """
    try:
        import resource
    except ImportError:  # Windows.
        return
    statm = Path("/proc/self/statm")
    pages = int(statm.read_text(encoding="ascii").split()[5]) if statm.exists() else 0
    in_use = pages * resource.getpagesize()
    # Private memory that can be written. RLIMIT_AS would count what threads only reserve.
    memory = in_use + memory_mib * BYTES_PER_MIB
    bounds = {
        resource.RLIMIT_DATA: (memory, memory),
        resource.RLIMIT_FSIZE: (0, 0),
        resource.RLIMIT_CORE: (0, 0),
    }
    if open_files is not None:
        bounds[resource.RLIMIT_NOFILE] = (open_files, open_files)
    if processor_s is not None:
        # At the second of them the signal would be SIGKILL, which may come from anywhere.
        bounds[resource.RLIMIT_CPU] = (processor_s, processor_s + 1)
    for bound, value in bounds.items():
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(bound, value)
