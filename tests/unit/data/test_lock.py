"""Two processes never write one folder."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from overtaking.core.errors import LockedError
from overtaking.data.lock import FILE_NAME, locked

if TYPE_CHECKING:
    from pathlib import Path

HOLD = """
import sys
from pathlib import Path
from overtaking.data.lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path: Path):
    """Another process that holds the folder."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_folder_that_another_process_holds_is_refused_and_the_process_named(holder, tmp_path):
    with pytest.raises(LockedError, match=f"got process {holder.pid};") as caught, locked(tmp_path):
        pass
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def test_a_process_that_is_killed_holds_nothing(holder, tmp_path: Path):
    holder.kill()
    holder.wait(timeout=30)
    with locked(tmp_path):
        assert (tmp_path / FILE_NAME).read_text().strip() == str(os.getpid())


def test_a_folder_can_be_held_again_after_it_was_let_go(tmp_path: Path):
    for _ in range(2):
        with locked(tmp_path):
            assert (tmp_path / FILE_NAME).read_text().strip() == str(os.getpid())
        assert (tmp_path / FILE_NAME).read_text() == ""


def test_a_folder_is_let_go_when_the_work_fails(tmp_path: Path):
    with pytest.raises(ZeroDivisionError), locked(tmp_path):
        raise ZeroDivisionError
    with locked(tmp_path):
        pass


def test_a_thread_of_the_same_process_is_refused_too(tmp_path: Path):
    with (
        locked(tmp_path),
        pytest.raises(LockedError, match=f"got process {os.getpid()};"),
        locked(tmp_path),
    ):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="flock is of POSIX")
@pytest.mark.parametrize("code", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_is_refused_with_a_way_out(tmp_path, monkeypatch, code):
    def flock(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("fcntl.flock", flock)
    message = f"got {os.strerror(code)}; choose a folder on another file system, or set OVERT"
    with pytest.raises(LockedError, match=message), locked(tmp_path):
        pass
    monkeypatch.setenv("OVERTAKING_NO_LOCK", "1")
    with locked(tmp_path):
        assert not (tmp_path / FILE_NAME).read_text()
