"""A process that makes one shard after the other for its parent.

It is told what to do on what was its standard input, and answers on what was its standard output;
whatever it prints goes to standard error. It ends with its parent, however that ends.
"""

import _thread
import os
import pickle
import signal
import threading
import time
import traceback
from contextlib import suppress
from queue import SimpleQueue
from typing import IO, TYPE_CHECKING, Any

from overtaking.core.errors import OvertakingError
from overtaking.core.messages import receive, send

if TYPE_CHECKING:
    from overtaking.datasets.manifest import ShardRecord
    from overtaking.datasets.orders import Order, Task, Told

READY = "ready"
"""The first answer: from now on it listens."""

PATIENCE = 5.0
"""Time that a worker has to end in order when it is told to [s]."""

Requests = SimpleQueue[Any]
"""An `Order` with the text of a place, then tasks; None when there are no more."""


def main() -> None:
    """Serve the parent until it says stop, or is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process of a terminal.
    heard, answers = _private_streams()
    requests: Requests = SimpleQueue()
    threading.Thread(target=_listen, args=(heard, requests), daemon=True).start()
    from overtaking.datasets.interruption import Terminated, termination_raises

    # Nobody reads an answer any more: there is nobody to tell, nor anything left to do.
    with suppress(Terminated, OSError), termination_raises():
        _work(requests, answers)


def _private_streams() -> tuple[IO[bytes], IO[bytes]]:
    """The two pipes, out of reach of what reads standard input or prints."""
    heard, answers = (os.fdopen(os.dup(number), mode) for number, mode in ((0, "rb"), (1, "wb")))
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return heard, answers


def _listen(heard: IO[bytes], requests: Requests) -> None:
    """Hear the parent, also while the work goes on."""
    try:
        while (request := receive(heard)) is not None:
            requests.put(request)
    except (EOFError, OSError):
        os._exit(1)  # The parent is gone; the system frees its lock, and others may write now.
    except Exception:
        traceback.print_exc()
        os._exit(1)  # The parent will ask for the last words of a worker that has ended.
    requests.put(None)
    _thread.interrupt_main(signal.SIGTERM)
    time.sleep(PATIENCE)
    os._exit(1)


def _work(requests: Requests, answers: IO[bytes]) -> None:
    """Carry out tasks and say what came of each."""
    from overtaking.datasets import orders

    del orders  # Loaded before anything is asked for, which is what takes the time.
    send(answers, READY)
    if (first := requests.get()) is None:
        return
    order, where = first
    while (task := requests.get()) is not None:
        send(answers, _outcome(order, task, where, lambda done: send(answers, done)))


def _outcome(order: "Order", task: "Task", where: str, told: "Told") -> "ShardRecord | Exception":
    """The record of a shard, or what went wrong."""
    from overtaking.datasets.elsewhere import seen
    from overtaking.datasets.orders import carry_out

    try:
        return carry_out(order, task, seen(where, order.fingerprint), told)
    except Exception as error:
        return _portable(error)


def _portable(error: Exception) -> Exception:
    """An error that arrives; one that nobody expected tells where it was."""
    if isinstance(error, OvertakingError | OSError | MemoryError):
        return error
    where = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(f"In a worker process:\n{where}")
    return error


if __name__ == "__main__":
    main()
