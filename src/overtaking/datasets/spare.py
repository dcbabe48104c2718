"""Memory that pieces of a data set use one after the other.

A piece of a thousand simulations takes more than a hundred megabytes while it is being made. The
system hands out fresh memory page by page, each filled with zeros, and takes it back after every
piece; that costs a tenth of what simulating costs.
"""

from collections.abc import Generator
from contextlib import contextmanager
from queue import Empty, SimpleQueue

from overtaking.sim.engine import Buffers


class Spare:
    """Buffers that nobody uses at the moment; as many as were ever in use at a time."""

    def __init__(self) -> None:
        """Start without any."""
        self._waiting: SimpleQueue[Buffers] = SimpleQueue()

    @contextmanager
    def lent(self) -> Generator[Buffers]:
        """Buffers for one piece, on any thread."""
        try:
            buffers = self._waiting.get_nowait()
        except Empty:
            buffers = Buffers()
        yield buffers
        # What a failed piece may still look at is not lent again.
        self._waiting.put(buffers)
