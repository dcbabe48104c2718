"""Limits of memory, threads, files and processors; the error names the resource that is refused."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pyarrow as pa
import pytest

from overtaking.core import process_limits
from overtaking.core.errors import ConfigError, DatasetError, SystemLimitError
from overtaking.core.files import unreadable_error
from overtaking.core.process_limits import check_memory, explain_refusals, refusal_of

MIB = 1 << 20


@pytest.mark.parametrize(
    ("error", "resource"),
    [
        (MemoryError(), "memory"),
        (pa.ArrowMemoryError("malloc of size 64 failed"), "memory"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "memory"),
        (ImportError("libarrow.so: failed to map segment from shared object"), "memory"),
        (RuntimeError("std::bad_alloc"), "memory"),
        (RuntimeError("can't start new thread"), "threads"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "threads"),
        (pa.ArrowException("Unknown error: Failed to launch worker thread: no"), "threads"),
        (OSError(errno.EMFILE, "Too many open files"), "open files"),
    ],
)
def test_a_refusal_of_the_system_is_named_with_a_next_step(error, resource):
    with (
        pytest.raises(SystemLimitError, match=f"^work: {resource}: expected .*ulimit -"),
        explain_refusals("work"),
    ):
        raise error


@pytest.mark.parametrize(
    "error",
    [
        ValueError("expected 3"),
        OSError(errno.ENOSPC, "No space left on device"),
        PermissionError(errno.EACCES, "Permission denied"),
        ConfigError("a worker that lives, got: can't start new thread"),
        RuntimeError("dictionary changed size"),
    ],
)
def test_other_errors_stay_as_they_are(error):
    assert refusal_of(error, "work") is None
    with pytest.raises(type(error)) as caught, explain_refusals("work"):
        raise error
    assert caught.value is error


@pytest.mark.parametrize("number", [errno.EACCES, errno.EPERM, errno.EIO, errno.ESTALE])
def test_a_file_that_cannot_be_read_is_not_called_damaged(number):
    error = unreadable_error(OSError(number, "no"), "a.parquet", DatasetError)
    assert isinstance(error, DatasetError)
    assert str(error) == (
        "a.parquet: file: expected a file that this process can read, got no; "
        "check its permissions and its disk, and try again"
    )


@pytest.mark.parametrize(
    "error", [FileNotFoundError(errno.ENOENT, "no"), OSError("no Parquet"), ValueError("no")]
)
def test_a_missing_file_and_wrong_content_are_no_refusal(error):
    assert unreadable_error(error, "a.parquet", DatasetError) is None


def write_group(folder: Path, limit_file: str, limit: str, stat: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / limit_file).write_text(f"{limit}\n")
    (folder / "memory.stat").write_text(stat)


def test_each_cgroup_of_version_2_above_a_process_counts(tmp_path):
    groups, mount = tmp_path / "cgroup", tmp_path / "mount"
    groups.write_text("0::/user/work\n")
    write_group(mount / "user/work", "memory.max", "max", "anon 5\nfile 900\n")
    write_group(mount / "user", "memory.max", str(64 * MIB), f"anon {MIB}\nfile {60 * MIB}\n")
    assert list(process_limits._memory_of_cgroups(groups, mount)) == [(64 * MIB, MIB)]


def test_a_cgroup_of_version_1_has_its_own_files(tmp_path):
    groups, mount = tmp_path / "cgroup", tmp_path / "mount"
    groups.write_text("5:cpu:/a\n4:memory:/a\n0::/\n")
    stat = f"rss 1\ntotal_rss {3 * MIB}\n"
    write_group(mount / "memory" / "a", "memory.limit_in_bytes", str(32 * MIB), stat)
    assert list(process_limits._memory_of_cgroups(groups, mount)) == [(32 * MIB, 3 * MIB)]


def test_a_container_finds_its_group_at_the_mount(tmp_path):
    groups, mount = tmp_path / "cgroup", tmp_path / "mount"
    groups.write_text("0::/docker/0123\n")
    write_group(mount, "memory.max", str(32 * MIB), f"anon {MIB}\n")
    assert list(process_limits._memory_of_cgroups(groups, mount)) == [(32 * MIB, MIB)]


def test_work_larger_than_the_rest_of_a_cgroup_is_refused(monkeypatch):
    monkeypatch.setattr(process_limits, "_cgroup_memory", lambda: iter([(64 * MIB, 60 * MIB)]))
    check_memory(4 * MIB, "simulate", "simulate fewer")
    with pytest.raises(SystemLimitError, match="the limit of 67 MB of its cgroup leaves, got"):
        check_memory(4 * MIB + 1, "simulate", "simulate fewer")


def test_work_larger_than_the_rest_of_the_address_space_is_refused(monkeypatch):
    limit = process_limits._bytes_in_use(process_limits._ADDRESS_SPACE)
    assert limit is not None
    room = 300 * MIB + process_limits.WORKING_BYTES
    monkeypatch.setattr(process_limits, "_address_space_limit", lambda: limit + room)
    check_memory(200 * MIB, "simulate", "simulate fewer")
    with pytest.raises(SystemLimitError, match=r"leaves \(ulimit -v\), got work that needs 419 MB"):
        check_memory(400 * MIB, "simulate", "simulate fewer")


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


SPINS = """
from overtaking.core.process_limits import limit_process
limit_process(64, processor_s=1)
while True:
    pass
"""


@pytest.mark.ci
def test_a_process_that_exceeds_its_processor_time_ends_by_a_signal():
    pytest.importorskip("resource", reason="Windows bounds no process")
    assert subprocess.run([sys.executable, "-c", SPINS], check=False).returncode == -signal.SIGXCPU


def test_no_number_of_arrow_threads_and_zero_both_mean_one_for_each_processor(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    expected = process_limits._missing_threads()
    monkeypatch.setenv("OMP_NUM_THREADS", "0")
    assert process_limits._missing_threads() == expected
