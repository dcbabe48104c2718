"""Handles a full disk and a request of the system to stop while a data set is written."""

import os
import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

from overtaking.core.errors import DatasetError, OvertakingError
from overtaking.core.process_limits import refusal_of


class Terminated(BaseException):
    """The system asked the process to end (SIGTERM)."""


@contextmanager
def termination_raises() -> Generator[None]:
    """Make SIGTERM raise `Terminated` in the block, as Ctrl-C raises `KeyboardInterrupt`.

    Python runs handlers in the main thread only. In other threads, and where there is a handler
    already, nothing changes.
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


@contextmanager
def all_or_nothing(where: object, expected: str, after: str) -> Generator[None]:
    """Turn what ends a block early into errors that say what to do.

    Args:
        where: The data set.
        expected: What the block was to do, as in *time to ...*.
        after: State of the data set after the failure, with the next step.

    Raises:
        DatasetError: The system refused to write, or asked the process to end.
    """
    try:
        with termination_raises():
            yield
    except OSError as error:
        error.filename = None  # A file in a staging folder that is gone.
        raise cannot_write(where, error, f"make room and {after}") from error
    except Terminated:
        raise DatasetError(
            what="data set", where=str(where), expected=expected, got="SIGTERM", next_step=after
        ) from None


def cannot_write(where: object, error: OSError, next_step: str) -> OvertakingError:
    """The error for what the system refused, with the next step."""
    return refusal_of(error, str(where)) or DatasetError(
        what="writing",
        where=str(error.filename or where),
        expected="room and permission to write",
        got=os.strerror(error.errno) if error.errno else str(error),
        next_step=next_step,
    )
