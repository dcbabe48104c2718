"""The parent of a worker process, as the worker sees it.

The messages of the parent arrive on what was standard input, and the answers leave on what was
standard output. Whatever the worker prints goes to standard error.
"""

import _thread
import importlib
import os
import pickle
import signal
import sys
import threading
from collections.abc import Iterator
from queue import SimpleQueue
from typing import IO, Any

from overtaking.core.messages import read_frame, write_frame

STOP = b""
"""The frame that asks a worker to stop; no pickle is empty."""


class Parent:
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
        while (frame := self._requests.get()) != STOP and not self._is_stopped:
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
                if frame == STOP:
                    self._is_stopped = True
                    _thread.interrupt_main(signal.SIGTERM)  # Ignored unless the module handles it.
                self._requests.put(frame)
        except BaseException:  # The parent has ended, or a message is larger than the memory.
            # At once and without cleaning up: the lock of the parent on the folder is free from now
            # on, and another process may already write there.
            os._exit(1)


def run() -> None:
    """Call the `main` of the module that the command line names, with its arguments."""
    parent = Parent()
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
