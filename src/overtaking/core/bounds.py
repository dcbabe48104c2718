"""Bounds of a question to a data set: rows, time and memory."""

from __future__ import annotations

from overtaking.core.errors import ConfigError


def check_bounds(where: str, *, max_rows: int, timeout_s: float, memory_mib: int) -> None:
    """Refuse bounds that no question can be answered in.

    Args:
        where: The command that asks.
        max_rows: Most rows of an answer, 1 to 1e9.
        timeout_s: Most time [s], 0.001 to 1e9.
        memory_mib: Most memory [MiB], 16 to 1e9.

    Raises:
        ConfigError: One of them is out of its range.
    """
    for what, value, low in (
        ("rows", max_rows, 1),
        ("time in seconds", timeout_s, 0.001),
        ("memory in MiB", memory_mib, 16),
    ):
        if not low <= value <= 1e9:
            raise ConfigError.of(
                what=what,
                where=where,
                expected=f"{low} or more",
                got=value,
                next_step="choose a number in that range",
            )
