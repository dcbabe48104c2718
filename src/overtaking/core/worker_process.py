"""Worker processes: child processes that run a module of this package, and exchange messages.

A process makes a `WorkerProcess` with the name of a module; the child calls the module's `main`
with a `ParentConnection`. Both ends send any objects that `pickle` can copy. Data sets are
generated in such processes, and queries, neural networks and clients of CARLA run in them, because
a child can have its own limits, for example of memory, and can crash or be killed without harm to
its parent.

Messages to the worker go through its standard input, messages from it through its standard output.
Text that the worker prints goes to its standard error, whose end `describe_exit` quotes.
"""

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

# A message is a pickle in a frame: the length of the pickle as a 64-bit integer, then its bytes. A
# pipe alone does not keep messages apart.
_LENGTH = struct.Struct("<Q")


def write_frame(stream: IO[bytes], data: bytes) -> None:
    """Write one frame.

    Args:
        stream: A pipe.
        data: Content of the frame, without its length.

    Raises:
        OSError: The reader has closed its end.
    """
    stream.write(_LENGTH.pack(len(data)))
    stream.write(data)
    stream.flush()


def read_frame(stream: IO[bytes]) -> bytes:
    """Wait for one frame and read its content.

    Args:
        stream: A pipe.

    Returns:
        Content of the frame, without its length.

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
    """The end of the connection in the worker: it receives messages from the parent and answers.

    The parent is the process that started the worker. When the parent ends or is killed, the worker
    ends at once.
    """

    def __init__(self) -> None:
        """Take over standard input and output.

        `run_worker` does this before it imports the module, which may print or read.
        """
        # Ctrl-C in a terminal also interrupts child processes; only the parent decides to stop.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._received_frames: SimpleQueue[bytes] = SimpleQueue()
        self._is_stopped = False
        from_parent, self._to_parent = _private_streams()
        # A thread, because it notices the end of the parent even while the main thread computes.
        threading.Thread(target=self._read_frames, args=(from_parent,), daemon=True).start()

    def __iter__(self) -> Iterator[Any]:
        """Wait for messages and yield them until the parent asks this process to stop.

        It drops messages that wait when this request arrives.
        """
        # The stop frame may wait behind other frames; `_is_stopped` is set as soon as it arrives.
        while (frame := self._received_frames.get()) != STOP_FRAME and not self._is_stopped:
            yield pickle.loads(frame)

    def send(self, message: object) -> None:
        """Send a message to the parent.

        Args:
            message: Any object that `pickle` can copy.

        Raises:
            OSError: The parent has ended.
        """
        write_frame(self._to_parent, pickle.dumps(message))

    def _read_frames(self, from_parent: IO[bytes]) -> None:
        """Queue the frames from the parent, and end this process when the parent has ended."""
        try:
            while True:
                frame = read_frame(from_parent)
                if frame == STOP_FRAME:
                    self._is_stopped = True
                    # Call the module's handler of SIGTERM, which can interrupt its work. Without a
                    # handler this does nothing, and the worker first finishes its present message.
                    _thread.interrupt_main(signal.SIGTERM)
                self._received_frames.put(frame)
        except BaseException:  # The parent has ended, or a message is larger than the memory.
            # At once and without cleaning up: if the parent was writing a data set, the system has
            # released its lock on the folder, and another process may already write there.
            os._exit(1)


def run_worker() -> None:
    """Call `main` of the module that the command line names: the main program of a worker.

    The command line has the name of the module, then the arguments of `main` after its
    `ParentConnection`.
    """
    parent = ParentConnection()
    module, *arguments = sys.argv[1:]
    importlib.import_module(module).main(parent, *arguments)


def _private_streams() -> tuple[IO[bytes], IO[bytes]]:
    """Move the pipes of standard input and output to descriptors that other code does not know.

    Otherwise text that a library prints would be read as a message.

    Returns:
        The pipe from the parent and the pipe to the parent.
    """
    from_parent = os.fdopen(os.dup(0), "rb")
    to_parent = os.fdopen(os.dup(1), "wb")
    null_device = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null_device, 0)  # From here on standard input is empty.
    os.close(null_device)
    os.dup2(2, 1)  # Printed text goes to standard error, which the parent quotes in errors.
    return from_parent, to_parent


SHUTDOWN_TIMEOUT = 5.0
"""Time for a worker to clean up before it is killed [s]. Chosen."""

_CHILD_PROGRAM = "from overtaking.core.worker_process import run_worker; run_worker()"

_MAX_PRINTED_BYTES = 4096
"""Length of the end of the printed text that is stored. Chosen: an exception and its cause fit."""

_MAX_WAIT = 1.0
"""Longest time of one wait [s]; longer waits are split, because on Windows Ctrl-C takes effect only
between two waits. Chosen."""


class WorkerEnded:
    """Type of `WORKER_ENDED`."""


WORKER_ENDED: Final = WorkerEnded()
"""The message that `receive` returns last, after the worker has stopped or crashed."""


_frame_received = threading.Condition()
"""Guards the received frames of all workers and is notified after each new frame. All workers share
it, because `receive_from_any` waits for several of them."""


class WorkerProcess:
    """The end of the connection in the parent: it starts a worker, and sends and receives messages.

    As a context manager it kills the worker at the end of the block. When this process ends, the
    worker ends as well. The worker ignores Ctrl-C, and imports modules from the same folders as
    this process.

    Args:
        module: Name of the module that the worker runs.
        arguments: Arguments of the module's `main` after its `ParentConnection`.
        variables: Environment variables to set in the worker; it inherits the others.

    Raises:
        OSError: The process cannot be started.
        SystemLimitError: The system starts no more processes or threads, or grants no more memory.
    """

    def __init__(
        self, module: str, *arguments: str, variables: Mapping[str, str] | None = None
    ) -> None:
        """Start the process."""
        search_path = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
        self._frames: deque[bytes | None] = deque()  # None stands for `WORKER_ENDED`.
        self._printed = b""
        # Not the module `multiprocessing`: its "fork" copies a process whose threads hold locks,
        # and its "spawn" runs the script of the user again, so that every script would need the
        # test `if __name__ == "__main__"`.
        with explain_refusals(module):  # Raises `SystemLimitError` if the system refuses.
            self._process = subprocess.Popen(
                # With -P Python does not add the working directory to the folders in which it
                # searches for modules: the worker searches only where this process does.
                [sys.executable, "-P", "-c", _CHILD_PROGRAM, module, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, **(variables or {}), "PYTHONPATH": search_path},
            )
        atexit.register(self.close)  # Until `close` itself unregisters it.
        readers = (self._read_frames, self._read_printed)
        self._threads = [threading.Thread(target=reader, daemon=True) for reader in readers]
        try:
            for thread in self._threads:
                thread.start()
        except RuntimeError as error:  # The system starts no more threads.
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
        """Send a message to the worker.

        If the worker has ended, the message is lost without an error; `receive` reports the end.

        Args:
            message: Any object that `pickle` can copy.
        """
        self._send_frame(pickle.dumps(message))

    def receive(self, timeout: float | None = None) -> Any:
        """Wait for the next message from this worker.

        Args:
            timeout: Longest time to wait [s]; None waits without limit.

        Returns:
            The message, or `WORKER_ENDED` once after the last message.

        Raises:
            TimeoutError: No message arrived in time.
        """
        return self.receive_from_any((self,), timeout)[1]

    @staticmethod
    def receive_from_any(
        workers: "Collection[WorkerProcess]", timeout: float | None = None
    ) -> "tuple[WorkerProcess, Any]":
        """Wait for the next message from one of several workers.

        Args:
            workers: The workers. If messages of several wait, the first worker has priority.
            timeout: Longest time to wait [s]; None waits without limit.

        Returns:
            The worker and its message, or `WORKER_ENDED` once after its last message.

        Raises:
            TimeoutError: No message arrived in time.
        """
        end = math.inf if timeout is None else time.monotonic() + timeout
        with _frame_received:
            while (worker := next((worker for worker in workers if worker._frames), None)) is None:
                remaining = end - time.monotonic()
                if remaining <= 0.0:
                    raise TimeoutError
                _frame_received.wait(min(_MAX_WAIT, remaining))
            frame = worker._frames.popleft()
        return worker, WORKER_ENDED if frame is None else pickle.loads(frame)

    def stop(self) -> None:
        """Ask the worker to end, and return at once; `close` with a timeout waits for the end."""
        self._send_frame(STOP_FRAME)

    def close(self, timeout: float = 0.0) -> None:
        """End the worker and free its pipes and threads. A second call does nothing.

        Args:
            timeout: Time to wait for the worker to end before it is killed [s]; 0 kills it at once.
        """
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for thread in self._threads:  # They end with the process, which closes its pipes.
            if thread.ident is not None:  # A thread that the system did not start cannot be joined.
                thread.join()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            # Closing a pipe writes the rest of a message, which fails without the worker.
            with suppress(OSError):
                _not_none(stream).close()
        atexit.unregister(self.close)

    def describe_exit(self) -> str:
        """Close a worker whose `receive` has returned `WORKER_ENDED`, and describe its end.

        Returns:
            "with exit status 3" or "by SIGKILL", then ": " and the last line that the worker
            printed.
        """
        self.close(SHUTDOWN_TIMEOUT)
        status = self._process.returncode
        cause = _describe_signal(-status) if status < 0 else f"with exit status {status}"
        lines = self._printed.decode(errors="replace").split("\n")
        last_line = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f"{cause}: {last_line}" if last_line else cause

    def _send_frame(self, data: bytes) -> None:
        with suppress(OSError):  # The worker has ended.
            write_frame(_not_none(self._process.stdin), data)

    def _read_frames(self) -> None:
        """Store the frames from the worker and, after its end, None: the work of a thread."""
        try:
            with suppress(EOFError, OSError):
                while True:
                    self._add_frame(read_frame(_not_none(self._process.stdout)))
        finally:
            self._add_frame(None)

    def _add_frame(self, frame: bytes | None) -> None:
        """Store a frame, and wake the threads that wait in `receive_from_any`."""
        with _frame_received:
            self._frames.append(frame)
            _frame_received.notify_all()

    def _read_printed(self) -> None:
        """Store the end of the text that the worker prints: the work of another thread.

        Without a reader, the pipe would fill up and the worker would wait when it prints.
        """
        while text := os.read(_not_none(self._process.stderr).fileno(), _MAX_PRINTED_BYTES):
            self._printed = (self._printed + text)[-_MAX_PRINTED_BYTES:]


def _not_none(pipe: IO[bytes] | None) -> IO[bytes]:
    """The pipe, for type checkers: each standard stream of a `WorkerProcess` is a pipe."""
    assert pipe is not None
    return pipe


def _describe_signal(number: int) -> str:
    try:
        return f"by {signal.Signals(number).name}"
    except ValueError:
        return f"by signal {number}"
