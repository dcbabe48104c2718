"""A worker process that makes one shard after the other for its parent."""

import pickle
import traceback
from contextlib import suppress

from overtaking.core.errors import OvertakingError
from overtaking.core.parent import Parent
from overtaking.data.elsewhere import seen
from overtaking.data.interruption import Terminated, termination_raises
from overtaking.data.manifest import ShardRecord
from overtaking.data.orders import Order, Task, carry_out


def main(parent: Parent) -> None:
    """Carry out tasks; each message is an `Order`, the text of a place, and a `Task`.

    The answers to each are numbers of simulations that are done, then its record or an exception.
    """
    # An `OSError` is one of the pipe: the parent has ended.
    with suppress(Terminated, OSError), termination_raises():
        for order, where, task in parent:
            parent.send(_outcome(parent, order, task, where))


def _outcome(parent: Parent, order: Order, task: Task, where: str) -> ShardRecord | Exception:
    """The record of a shard, or the error that prevented it."""
    try:
        return carry_out(order, task, seen(where, order.fingerprint), parent.send)
    except Exception as error:
        return _portable(error)


def _portable(error: Exception) -> Exception:
    """An error that can be unpickled; an unexpected one has its traceback in a note."""
    if isinstance(error, OvertakingError | OSError | MemoryError):
        return error
    where = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(f"In a worker process:\n{where}")
    return error
