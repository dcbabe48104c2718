"""Number of processors for this process."""

import os
from contextlib import suppress
from pathlib import Path

THREADS_VARIABLE = "RAYON_NUM_THREADS"
"""Environment variable that says how many the engine may use."""

QUOTA = Path("/sys/fs/cgroup/cpu.max")
"""Linux's file with the CPU quota of a container: microseconds of quota and of its period."""


def usable() -> int:
    """Processors that the system lets this process use."""
    known = os.cpu_count() or 1
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else known
    with suppress(OSError, ValueError):  # No container, or one without a limit.
        time, period = QUOTA.read_text(encoding="ascii").split()
        return max(1, min(allowed, int(time) // int(period)))
    return allowed


def wanted() -> int:
    """Processors to use: those that it may use, or fewer if the environment asks for fewer."""
    asked = os.environ.get(THREADS_VARIABLE, "")
    limit = int(asked) if asked.isascii() and asked.isdigit() else 0
    return min(usable(), limit) if limit else usable()
