"""A module that runs in a child process, and its messages; both ends."""

import _thread
import atexit
import importlib
import math
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any, Final, Self

from overtaking.core.process_limits import explain_refusals, thread_error

# Messages of both directions are pickles in frames. A frame is its length and that many bytes.
_LENGTH = struct.Struct("<Q")


def write_frame(stream: IO[bytes], data: bytes) -> None:
    """Write one frame.

    Args:
        stream: A pipe.
        data: The content of the frame.

    Raises:
        OSError: The reader has closed its end.
    """
    stream.write(_LENGTH.pack(len(data)))
    stream.write(data)
    stream.flush()


def read_frame(stream: IO[bytes]) -> bytes:
    """Wait for one frame and read its content.

    Raises:
        EOFError: The writer has closed its end, before or within a frame.
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
"""The frame that asks a worker to stop. It cannot be a message, because no pickle is empty."""


class ParentConnection:
    """The connection of a worker to the process that started it.

    If that process ends, the worker ends at once.
    """

    def __init__(self) -> None:
        """Take over the standard streams: the first call in a worker, once."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process of a terminal.
        self._requests: SimpleQueue[bytes] = SimpleQueue()
        self._is_stopped = False
        requests, self._answers = _private_streams()
        threading.Thread(target=self._read_frames, args=(requests,), daemon=True).start()

    def __iter__(self) -> Iterator[Any]:
        """Messages, until the parent asks this process to stop."""
        while (frame := self._requests.get()) != STOP_FRAME and not self._is_stopped:
            yield pickle.loads(frame)

    def send(self, message: object) -> None:
        """Send a message.

        Raises:
            OSError: The parent has ended.
        """
        write_frame(self._answers, pickle.dumps(message))

    def _read_frames(self, requests: IO[bytes]) -> None:
        """Receive messages, also while the main thread works."""
        try:
            while True:
                frame = read_frame(requests)
                if frame == STOP_FRAME:
                    self._is_stopped = True
                    _thread.interrupt_main(signal.SIGTERM)  # Only a module with a handler notices.
                self._requests.put(frame)
        except BaseException:  # The parent has ended, or a message is larger than the memory.
            # At once and without cleaning up: the parent's lock on its folder is free from now on,
            # and another process may already write there.
            os._exit(1)


def run_worker() -> None:
    """Run a worker: call `main` of the module that the command line names, with its arguments."""
    parent = ParentConnection()
    module, *arguments = sys.argv[1:]
    importlib.import_module(module).main(parent, *arguments)


def _private_streams() -> tuple[IO[bytes], IO[bytes]]:
    """Move both pipes to other descriptors, for code that reads standard input or prints."""
    requests, answers = (os.fdopen(os.dup(number), mode) for number, mode in ((0, "rb"), (1, "wb")))
    null_device = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null_device, 0)
    os.close(null_device)
    os.dup2(2, 1)  # Printed text goes to standard error, which the parent keeps for messages.
    return requests, answers


SHUTDOWN_TIMEOUT = 5.0
"""Time for a worker to clean up before it is killed [s]."""

_START = "from overtaking.core.worker_process import run_worker; run_worker()"
_PRINTED_BYTES = 4096  # The end of the printed text that is kept: an exception and its cause.
_POLL = 1.0  # Windows handles Ctrl-C only between two waits [s].


class WorkerEnded:
    """Type of `WORKER_ENDED`."""


WORKER_ENDED: Final = WorkerEnded()
"""The last message from each worker, whether it has stopped or crashed."""


_frame_received = threading.Condition()
"""Guards the received frames of all workers; notified after each new one."""


class WorkerProcess:
    """A child process that runs a module; as a context manager it ends with the block.

    The child ends with this process, ignores Ctrl-C, and imports from the same folders.

    Args:
        module: Name of the module. Its `main` receives a `ParentConnection` and the arguments.
        arguments: Further arguments of `main`.
        variables: Environment variables to set in the child; it inherits the others.

    Raises:
        OSError: The process cannot be started.
        SystemLimitError: The system starts no more processes or threads, or grants no more memory.
    """

    def __init__(
        self, module: str, *arguments: str, variables: Mapping[str, str] | None = None
    ) -> None:
        """Start the process."""
        search_path = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
        self._frames: deque[bytes | None] = deque()  # None after the last one.
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
                env={**os.environ, **(variables or {}), "PYTHONPATH": search_path},
            )
        atexit.register(self.close)
        readers = (self._read_frames, self._read_printed)
        self._threads = [threading.Thread(target=reader, daemon=True) for reader in readers]
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
        """Close the worker."""
        self.close()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether the process is still running."""
        return self._process.poll() is None

    def send(self, message: object) -> None:
        """Send a message. After the end of the process it is lost; `receive` tells of the end."""
        self._send_frame(pickle.dumps(message))

    def receive(self, timeout: float | None = None) -> Any:
        """Wait for the next message from this worker; see `receive_from_any`."""
        return self.receive_from_any((self,), timeout)[1]

    @staticmethod
    def receive_from_any(
        workers: "Collection[WorkerProcess]", timeout: float | None = None
    ) -> "tuple[WorkerProcess, Any]":
        """Wait for the next message from one of several workers.

        Args:
            workers: The workers.
            timeout: Longest time to wait [s]; None waits without limit.

        Returns:
            The worker and its message, which after the end of the worker is `WORKER_ENDED`, once.

        Raises:
            TimeoutError: No message arrived in time.
        """
        end = math.inf if timeout is None else time.monotonic() + timeout
        with _frame_received:
            while (worker := next((worker for worker in workers if worker._frames), None)) is None:
                remaining = end - time.monotonic()
                if remaining <= 0.0:
                    raise TimeoutError
                _frame_received.wait(min(_POLL, remaining))
            frame = worker._frames.popleft()
        return worker, WORKER_ENDED if frame is None else pickle.loads(frame)

    def stop(self) -> None:
        """Ask the process to end; `close` gives it the time to clean up."""
        self._send_frame(STOP_FRAME)

    def close(self, timeout: float = 0.0) -> None:
        """End the process and free its pipes and threads. A second call does nothing.

        Args:
            timeout: Time to wait for the process to end before it is killed [s].
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
        """Close a worker after `WORKER_ENDED`, and describe its end.

        Returns:
            Its exit status or signal, and the last line that it printed.
        """
        self.close(SHUTDOWN_TIMEOUT)
        status = self._process.returncode
        cause = _signal_name(-status) if status < 0 else f"with exit status {status}"
        lines = self._printed.decode(errors="replace").split("\n")
        last_line = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f"{cause}: {last_line}" if last_line else cause

    def _send_frame(self, data: bytes) -> None:
        with suppress(OSError):
            write_frame(_open(self._process.stdin), data)

    def _read_frames(self) -> None:
        try:
            with suppress(EOFError, OSError):
                while True:
                    self._add_frame(read_frame(_open(self._process.stdout)))
        finally:
            self._add_frame(None)

    def _add_frame(self, frame: bytes | None) -> None:
        with _frame_received:
            self._frames.append(frame)
            _frame_received.notify_all()

    def _read_printed(self) -> None:
        """Keep the end of the text that the process prints."""
        while text := os.read(_open(self._process.stderr).fileno(), _PRINTED_BYTES):
            self._printed = (self._printed + text)[-_PRINTED_BYTES:]


def _open(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


def _signal_name(number: int) -> str:
    try:
        return f"by {signal.Signals(number).name}"
    except ValueError:
        return f"by signal {number}"
