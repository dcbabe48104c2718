"""Bounds of a question to a data set: rows, time and memory."""

from __future__ import annotations

import sys
from typing import Any

from overtaking.core.confinement import BYTES_PER_MIB
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
            raise ConfigError.out_of_range(what, where, low, None, value)


ANSWER_SHARE = 8
"""The answer may take an eighth of the memory: the process that asks holds it, and makes a text of
it."""


def room_after(room: int | None, rows: object, where: str, memory_mib: int) -> int:
    """Memory left for an answer after further rows [bytes].

    Args:
        room: The remaining room; None at the beginning.
        rows: The rows.
        where: The command that asks.
        memory_mib: Most memory of the question [MiB].

    Raises:
        ConfigError: The answer is too large.
    """
    most_mib = memory_mib / ANSWER_SHARE
    left = (int(most_mib * BYTES_PER_MIB) if room is None else room) - size_of(rows)
    if left < 0:
        most = f"an answer of at most {most_mib:g} MiB, 1/{ANSWER_SHARE} of the memory"
        raise over(where, most, "a larger one")
    return left


def over(where: str, expected: str, got: str) -> ConfigError:
    """The error of a question that needs more than it may."""
    return ConfigError.of(
        what="query",
        where=where,
        expected=expected,
        got=got,
        next_step="ask for less, or allow more (--memory, --timeout)",
    )


def size_of(value: Any) -> int:
    """Memory that a value of an answer takes, with all that it holds [bytes]."""
    parts = value.values() if isinstance(value, dict) else value
    held = sum(map(size_of, parts)) if isinstance(value, dict | list | tuple) else 0
    return sys.getsizeof(value) + held
