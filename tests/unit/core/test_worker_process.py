"""Messages between processes; nothing of a worker is left, however it or its parent ends."""

from __future__ import annotations

import gc
import io
import os
import signal
import subprocess
import sys
import threading
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.support.processes import eventually, is_running

from overtaking.core.worker_process import WORKER_ENDED, WorkerProcess, read_frame, write_frame

if TYPE_CHECKING:
    from collections.abc import Generator


MODULE = "tests.support.obedient"
ROUNDS = 8
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="sends signals")


def started(*arguments: str, **settings) -> WorkerProcess:
    """A worker that has begun to listen."""
    worker = WorkerProcess(MODULE, *arguments, **settings)
    assert worker.receive() == arguments
    return worker


def open_files() -> int:
    """Descriptors of this process; 0 where the system does not tell."""
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.exists() else 0


@contextmanager
def nothing_left() -> Generator[None]:
    """Check that a block leaves no descriptor, no thread and no warning."""
    gc.collect()
    before = open_files(), threading.active_count()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        yield
        gc.collect()
    assert [str(one.message) for one in said] == []
    assert (open_files(), threading.active_count()) == before


def test_messages_of_any_kind_are_answered_in_order():
    messages = [{"a": (1, 2.5)}, None, b"", b"\0" * 200_000, "last"]
    with started("one", "two") as worker:
        for message in messages:
            worker.send(message)
        assert [worker.receive() for _ in messages] == messages
        assert worker.is_running
    assert not worker.is_running


def test_the_next_message_comes_from_any_of_several_workers():
    receive = WorkerProcess.receive_from_any
    with WorkerProcess(MODULE, "a") as a, WorkerProcess(MODULE, "b") as b:
        assert dict(receive((a, b)) for _ in range(2)) == {
            a: ("a",),
            b: ("b",),
        }
        b.send("hello")
        assert receive((a, b)) == (b, "hello")
        a.send("hello")
        a.send("again")
        assert [receive((a, b)) for _ in range(2)] == [
            (a, "hello"),
            (a, "again"),
        ]
        with pytest.raises(TimeoutError):
            receive((a, b), 0.01)
        a.stop()
        assert receive((a, b)) == (a, WORKER_ENDED)


def test_a_worker_finds_the_same_modules_and_gets_more_variables():
    with started(variables={"EXTRA": "1"}) as worker:
        worker.send("environment")
        environment = worker.receive()
    assert environment["EXTRA"] == "1"
    assert environment["PYTHONPATH"].split(os.pathsep) == [
        str(Path(folder).absolute()) for folder in sys.path
    ]


def test_what_a_worker_prints_is_no_message(capfd):
    with started() as worker:
        worker.send("print")
        assert worker.receive() == ""  # And its standard input is empty.
        worker.send("next")
        assert worker.receive() == "next"
    assert capfd.readouterr() == ("", "")


def test_silence_is_a_timeout():
    with started() as worker:
        worker.send("hang")
        assert worker.receive() == "hanging"
        with pytest.raises(TimeoutError):
            worker.receive(0.01)


@pytest.mark.ci
def test_an_end_is_told_with_the_last_line_that_was_printed():
    with nothing_left():
        worker = started()
        worker.send(("exit", 3, "first\n" * 5000 + "out of luck\n\n"))
        assert worker.receive() is WORKER_ENDED
        worker.send("nobody hears this")
        assert worker.describe_exit() == "with exit status 3: out of luck"
        worker.close()


def test_a_module_that_is_missing_is_told_of():
    with WorkerProcess("tests.support.nobody") as worker:
        assert worker.receive() is WORKER_ENDED
        assert "No module named 'tests.support.nobody'" in worker.describe_exit()


def test_a_worker_that_is_asked_to_stop_ends_in_order():
    with started() as worker:
        worker.stop()
        assert worker.receive() is WORKER_ENDED
        assert worker.describe_exit() == "with exit status 0"


@posix_only
def test_a_worker_that_does_not_stop_is_killed():
    with started() as worker:
        worker.send("hang")
        assert worker.receive() == "hanging"
        worker.stop()
        worker.close(0.1)
        assert worker.receive() is WORKER_ENDED
        assert worker.describe_exit() == "by SIGKILL"


@pytest.mark.ci
@posix_only
def test_workers_killed_in_the_middle_of_a_call_leave_nothing():
    with nothing_left():
        for _ in range(ROUNDS):
            worker = started()
            worker.send("hang")
            assert worker.receive() == "hanging"
            os.kill(worker.pid, signal.SIGKILL)
            assert worker.receive() is WORKER_ENDED
            assert worker.describe_exit() == "by SIGKILL"


@pytest.mark.ci
def test_workers_closed_in_the_middle_of_a_call_leave_nothing():
    with nothing_left():
        for _ in range(ROUNDS):
            with started() as worker:
                worker.send("hang")
                worker.send(b"\0" * 200_000)  # More than a pipe holds.
            assert not is_running(worker.pid)
            worker.close()


@pytest.mark.ci
@posix_only
def test_a_process_that_cannot_start_leaves_nothing(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with nothing_left(), pytest.raises(FileNotFoundError):
        WorkerProcess(MODULE)


@posix_only
def test_ctrl_c_is_left_to_the_parent():
    with started() as worker:
        os.kill(worker.pid, signal.SIGINT)
        worker.send("still here")
        assert worker.receive() == "still here"


def parent(rest: str) -> subprocess.Popen[str]:
    """A process with a worker in the middle of a call; it prints its id and goes on."""
    script = f"""
import sys
from overtaking.core.worker_process import WorkerProcess
worker = WorkerProcess({MODULE!r})
worker.send("hang")
while worker.receive() != "hanging":
    pass
print(worker.pid, flush=True)
{rest}
"""
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_worker_ends_with_a_parent_that_is_killed():
    with parent("sys.stdin.read()") as process:
        assert process.stdout is not None
        worker = int(process.stdout.readline())
        assert is_running(worker)
        process.kill()
    assert eventually(lambda: not is_running(worker))


def test_a_worker_that_was_not_closed_ends_with_its_parent_in_silence():
    with parent("") as process:
        said, complaints = process.communicate(timeout=60)
    assert (process.returncode, complaints) == (0, "")
    assert not is_running(int(said))


FRAMES = [b"a word", b"", b"\0" * 70_000]


def test_frames_arrive_one_by_one_until_there_are_no_more():
    stream = io.BytesIO()
    for frame in FRAMES:
        write_frame(stream, frame)
    stream.seek(0)
    assert [read_frame(stream) for _ in FRAMES] == FRAMES
    with pytest.raises(EOFError):
        read_frame(stream)


@pytest.mark.parametrize("length", [1, 7, 8, 9, 20])
def test_a_frame_that_is_cut_off_is_the_end(length):
    stream = io.BytesIO()
    write_frame(stream, b"a sentence without an end")
    with pytest.raises(EOFError):
        read_frame(io.BytesIO(stream.getvalue()[:length]))
