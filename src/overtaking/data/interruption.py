"""Lets a request to stop end the work in order, instead of in the middle of a file."""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType


class Terminated(BaseException):
    """The system asked the process to end (SIGTERM)."""


@contextmanager
def termination_raises() -> Generator[None]:
    """Make SIGTERM raise `Terminated` where the work is, as Ctrl-C raises `KeyboardInterrupt`.

    Only the main thread hears signals; elsewhere, and where someone listens already, nothing
    changes.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise Terminated

    signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
