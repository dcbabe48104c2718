"""A module that runs in a child process, and its messages; both ends."""

import _thread
import atexit
import importlib
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any, Final, Self

from overtaking.core.process_limits import explain_refusals, thread_error

_LENGTH = struct.Struct("<Q")


def write_frame(stream: IO[bytes], data: bytes) -> None:
    """Write one frame.

    Raises:
        OSError: The other end is closed.
    """
    stream.write(_LENGTH.pack(len(data)))
    stream.write(data)
    stream.flush()


def read_frame(stream: IO[bytes]) -> bytes:
    """Read one frame.

    Raises:
        EOFError: The other end was closed, before or within a frame.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return data


STOP_FRAME = b""
"""The frame that asks a worker to stop; no pickle is empty."""


class ParentConnection:
    """The process that started this one. Where it ends, this process ends at once."""

    def __init__(self) -> None:
        """Take over the standard streams; call it once, first of all."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process of a terminal.
        self._requests: SimpleQueue[bytes] = SimpleQueue()
        self._is_stopped = False
        requests, self._answers = _private_streams()
        threading.Thread(target=self._read_frames, args=(requests,), daemon=True).start()

    def __iter__(self) -> Iterator[Any]:
        """Messages, until this process is asked to stop."""
        while (frame := self._requests.get()) != STOP_FRAME and not self._is_stopped:
            yield pickle.loads(frame)

    def send(self, message: object) -> None:
        """Send a message.

        Raises:
            OSError: The parent has ended.
        """
        write_frame(self._answers, pickle.dumps(message))

    def _read_frames(self, requests: IO[bytes]) -> None:
        """Collect messages, also while the main thread works."""
        try:
            while True:
                frame = read_frame(requests)
                if frame == STOP_FRAME:
                    self._is_stopped = True
                    _thread.interrupt_main(signal.SIGTERM)  # Ignored unless the module handles it.
                self._requests.put(frame)
        except BaseException:  # The parent has ended, or a message is larger than the memory.
            # At once and without cleaning up: the lock of the parent on the folder is free from now
            # on, and another process may already write there.
            os._exit(1)


def run_worker() -> None:
    """Call the `main` of the module that the command line names, with its arguments."""
    parent = ParentConnection()
    module, *arguments = sys.argv[1:]
    importlib.import_module(module).main(parent, *arguments)


def _private_streams() -> tuple[IO[bytes], IO[bytes]]:
    """Both pipes, out of reach of code that reads standard input or prints."""
    requests, answers = (os.fdopen(os.dup(number), mode) for number, mode in ((0, "rb"), (1, "wb")))
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return requests, answers


SHUTDOWN_TIMEOUT = 5.0
"""Time that a worker has to end in order [s]."""
_START = "from overtaking.core.worker_process import run_worker; run_worker()"
_PRINTED_BYTES = 4096
_POLL = 1.0  # Windows handles Ctrl-C only between two waits [s].


class WorkerEnded:
    """Type of `ENDED`."""


WORKER_ENDED: Final = WorkerEnded()
"""The last message of every worker, however it ended."""


class Inbox:
    """Messages of one or more workers, in the order of their arrival."""

    def __init__(self) -> None:
        """Create an empty one."""
        self._frames: SimpleQueue[tuple[WorkerProcess, bytes | None]] = SimpleQueue()

    def put(self, worker: "WorkerProcess", frame: bytes | None) -> None:
        """Add a frame; None after the last one."""
        self._frames.put((worker, frame))

    def receive(self, timeout: float | None = None) -> "tuple[WorkerProcess, Any]":
        """Wait for the next message.

        Args:
            timeout: Longest time to wait [s]; None for as long as it takes.

        Returns:
            The worker and its message.

        Raises:
            TimeoutError: No message arrived in time.
        """
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            left = _POLL if end is None else max(0.0, min(_POLL, end - time.monotonic()))
            try:
                worker, frame = self._frames.get(timeout=left)
            except Empty:
                if end is not None and time.monotonic() >= end:
                    raise TimeoutError from None
            else:
                return worker, WORKER_ENDED if frame is None else pickle.loads(frame)


class WorkerProcess:
    """A child process that runs a module; a context that closes it.

    The child ends with this process, ignores Ctrl-C, and finds the modules that this process finds.

    Args:
        module: Name of the module.
        arguments: What its `main` gets after the parent.
        inbox: Where its messages go; None for an inbox of its own.
        variables: Environment variables of the child, in addition to those of this process.

    Raises:
        OSError: The process cannot be started.
        SystemLimitError: The system starts no more processes or threads, or grants no more memory.
    """

    def __init__(
        self,
        module: str,
        *arguments: str,
        inbox: Inbox | None = None,
        variables: Mapping[str, str] | None = None,
    ) -> None:
        """Start the process."""
        found = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
        self.inbox = inbox or Inbox()
        self._printed = b""
        # Not multiprocessing: its fork copies a process whose threads hold locks, and its spawn
        # runs the main module of the user again, so that every script would need a guard.
        with explain_refusals(module):
            self._process = subprocess.Popen(
                # Safe path (-P): the child searches where this process does, and nowhere else.
                [sys.executable, "-P", "-c", _START, module, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, **(variables or {}), "PYTHONPATH": found},
            )
        atexit.register(self.close)
        targets = (self._read_frames, self._read_printed)
        self._threads = [threading.Thread(target=one, daemon=True) for one in targets]
        try:
            for thread in self._threads:
                thread.start()
        except RuntimeError as error:
            self._process.kill()
            self.close()
            raise thread_error(module, str(error)) from error

    def __enter__(self) -> Self:
        """The worker itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    def send(self, message: object) -> None:
        """Send a message. Where the process has ended, `ENDED` says so, not this method."""
        self._send_frame(pickle.dumps(message))

    def receive(self, timeout: float | None = None) -> Any:
        """The next message of a worker with an inbox of its own; see `Inbox.receive`."""
        return self.inbox.receive(timeout)[1]

    def stop(self) -> None:
        """Ask the process to end; `close` gives it the time to clean up."""
        self._send_frame(STOP_FRAME)

    def close(self, timeout: float = 0.0) -> None:
        """End the process and free its pipes and threads. A second call does nothing.

        Args:
            timeout: Time that it has to end by itself before it is killed [s].
        """
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for thread in self._threads:
            if thread.ident is not None:  # It was started.
                thread.join()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            with suppress(OSError):  # A message that was not written completely.
                _open(stream).close()
        atexit.unregister(self.close)

    def describe_exit(self) -> str:
        """Close a worker that sent `ENDED`, and tell how it ended and what it printed last."""
        self.close(SHUTDOWN_TIMEOUT)
        status = self._process.returncode
        how = _signal_name(-status) if status < 0 else f"with exit status {status}"
        lines = self._printed.decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f"{how}: {last}" if last else how

    def _send_frame(self, data: bytes) -> None:
        with suppress(OSError):
            write_frame(_open(self._process.stdin), data)

    def _read_frames(self) -> None:
        try:
            with suppress(EOFError, OSError):
                while True:
                    self.inbox.put(self, read_frame(_open(self._process.stdout)))
        finally:
            self.inbox.put(self, None)

    def _read_printed(self) -> None:
        """Keep the last lines that the process prints."""
        while some := os.read(_open(self._process.stderr).fileno(), _PRINTED_BYTES):
            self._printed = (self._printed + some)[-_PRINTED_BYTES:]


def _open(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


def _signal_name(number: int) -> str:
    try:
        return f"by {signal.Signals(number).name}"
    except ValueError:
        return f"by signal {number}"
