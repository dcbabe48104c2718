"""What to say when writing a data set could not go on."""

import os

from overtaking.core.errors import DatasetError


def no_room(out: object, error: OSError, next_step: str) -> DatasetError:
    """What the system refused, with what can be done about it."""
    return DatasetError.of(
        what="writing",
        where=str(error.filename or out),
        expected="room and permission to write",
        got=os.strerror(error.errno) if error.errno else str(error),
        next_step=next_step,
    )


def asked_to_end(out: object, expected: str, next_step: str) -> DatasetError:
    """That the process was asked to end before it was done."""
    return DatasetError.of(
        what="data set", where=str(out), expected=expected, got="SIGTERM", next_step=next_step
    )
