"""How many processors to use: those that there are, or fewer where fewer are asked for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from overtaking.core import process_limits


def test_processors_that_a_process_may_not_use_do_not_count(monkeypatch):
    monkeypatch.setattr(process_limits, "CGROUP_QUOTA_FILE", Path("/none"))
    if not hasattr(os, "sched_getaffinity"):  # Then all may be used.
        assert process_limits.available_processors() == os.cpu_count()
        return
    before = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(before)})
        assert process_limits.available_processors() == 1
    finally:
        os.sched_setaffinity(0, before)
    assert process_limits.available_processors() == len(before)


@pytest.mark.parametrize(
    ("limit", "expected"),
    [("max 100000", 8), ("250000 100000", 2), ("50000 100000", 1), ("1600000 100000", 8), ("", 8)],
)
def test_a_container_has_as_many_as_its_time_fills(limit, expected, tmp_path, monkeypatch):
    (tmp_path / "cpu.max").write_text(f"{limit}\n")
    monkeypatch.setattr(process_limits, "CGROUP_QUOTA_FILE", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    assert process_limits.available_processors() == expected


@pytest.mark.parametrize(
    ("asked", "expected"), [("", 4), ("0", 4), ("3", 3), ("64", 4), ("-1", 4), ("some", 4)]
)
def test_the_environment_may_ask_for_fewer(asked, expected, monkeypatch):
    monkeypatch.setattr(process_limits, "available_processors", lambda: 4)
    monkeypatch.setenv(process_limits.THREADS_VARIABLE, asked)
    assert process_limits.processors_to_use() == expected


def test_a_system_without_affinity_says_how_many_there_are(monkeypatch):
    monkeypatch.setattr(process_limits, "CGROUP_QUOTA_FILE", Path("/none"))
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert process_limits.available_processors() == 1
