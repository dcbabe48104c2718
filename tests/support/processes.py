"""Processes, as the system sees them."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

_LISTENING = "0A"  # The state TCP_LISTEN in /proc/net/tcp.


def is_running(process: int) -> bool:
    """Whether a process exists and has not ended; on Linux a zombie has ended."""
    try:
        os.kill(process, 0)
        stat = Path(f"/proc/{process}/stat")
        return not stat.exists() or stat.read_text().rpartition(") ")[2][0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def eventually(condition: Callable[[], bool], patience: float = 60.0) -> bool:
    """Whether a condition becomes true in time; busy machines need patience [s]."""
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


def listening_addresses(port: int) -> set[str]:
    """IPv4 addresses at which a process of this machine listens on a port (Linux)."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text("ascii").splitlines()[1:]]
    local = [row[1].split(":") for row in rows if row[3] == _LISTENING]
    return {
        ".".join(str(part) for part in reversed(bytes.fromhex(address)))
        for address, number in local
        if int(number, 16) == port
    }
