"""How many processors to use: those that there are, or fewer where fewer are asked for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from overtaking.core import processors


def test_processors_that_a_process_may_not_use_do_not_count(monkeypatch):
    monkeypatch.setattr(processors, "QUOTA", Path("/none"))
    if not hasattr(os, "sched_getaffinity"):  # Then all may be used.
        assert processors.usable() == os.cpu_count()
        return
    before = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(before)})
        assert processors.usable() == 1
    finally:
        os.sched_setaffinity(0, before)
    assert processors.usable() == len(before)


@pytest.mark.parametrize(
    ("limit", "expected"),
    [("max 100000", 8), ("250000 100000", 2), ("50000 100000", 1), ("1600000 100000", 8), ("", 8)],
)
def test_a_container_has_as_many_as_its_time_fills(limit, expected, tmp_path, monkeypatch):
    (tmp_path / "cpu.max").write_text(f"{limit}\n")
    monkeypatch.setattr(processors, "QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    assert processors.usable() == expected


@pytest.mark.parametrize(
    ("asked", "expected"), [("", 4), ("0", 4), ("3", 3), ("64", 4), ("-1", 4), ("some", 4)]
)
def test_the_environment_may_ask_for_fewer(asked, expected, monkeypatch):
    monkeypatch.setattr(processors, "usable", lambda: 4)
    monkeypatch.setenv(processors.THREADS_VARIABLE, asked)
    assert processors.wanted() == expected


def test_a_system_without_affinity_says_how_many_there_are(monkeypatch):
    monkeypatch.setattr(processors, "QUOTA", Path("/none"))
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processors.usable() == 1
