"""The connections of clients, and the one to close when there are too many."""

import asyncio
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field

MAX_CONNECTIONS = 64

NUM_CALLS_OF_CLIENT = 4
"""The genuine client makes this many calls when it connects; fewer are no sign of a client."""

MIN_SILENCE = 1.0
"""A genuine client is closed for a new one only after so much silence [s]."""


class CrowdedError(Exception):
    """There is no room for another client."""


@dataclass(slots=True, eq=False)
class Connection:
    """One connection.

    Attributes:
        writer: Stream for the answers.
        host: Address of the client's machine.
        port: Port of the client.
        last_call_time: Time of its last call, or of its beginning [s].
        num_calls: Calls that it has made.
        told: Logged messages about its calls without effect.
    """

    writer: asyncio.StreamWriter
    host: str
    port: int
    last_call_time: float
    num_calls: int = 0
    told: set[str] = field(default_factory=set)

    @property
    def name(self) -> str:
        """Address of the client."""
        return f"{self.host}:{self.port}"

    def note_call(self) -> None:
        """Note that it has made a call."""
        self.last_call_time = asyncio.get_running_loop().time()
        self.num_calls += 1


class Connections:
    """All open connections.

    Silence alone ends none: the genuine client connects before its first call and may only listen
    to sensors for hours afterwards, without a sign of life. So silent ones give way only where a
    new one finds no room. The machine with the most connections gives way; of its connections
    those with the fewest calls, where these are fewer than a genuine client makes; of these the
    one that is silent for the longest time.

    Args:
        log: Told when one gives way.
    """

    def __init__(self, log: Callable[[str], None]) -> None:
        """Start without connections."""
        self._log = log
        self._open: list[Connection] = []

    @contextmanager
    def enter(self, writer: asyncio.StreamWriter) -> Generator[Connection]:
        """Take in a new connection, for as long as the context lasts.

        Raises:
            CrowdedError: There is no room, and all clients are making calls.
        """
        now = asyncio.get_running_loop().time()
        if len(self._open) >= MAX_CONNECTIONS:
            self._close_most_silent(now)
        host, port, *_ = writer.get_extra_info("peername") or ("?", 0)
        connection = Connection(writer, host, port, now)
        self._open.append(connection)
        try:
            yield connection
        finally:
            if connection in self._open:
                self._open.remove(connection)

    def _close_most_silent(self, now: float) -> None:
        """Close the connection that has to give way."""
        ((host, _),) = Counter(connection.host for connection in self._open).most_common(1)
        silent = min(
            (connection for connection in self._open if connection.host == host),
            key=lambda one: (min(one.num_calls, NUM_CALLS_OF_CLIENT), one.last_call_time),
        )
        silence = now - silent.last_call_time
        if silent.num_calls >= NUM_CALLS_OF_CLIENT and silence < MIN_SILENCE:
            raise CrowdedError(
                f"{MAX_CONNECTIONS} clients are connected and all made calls within the last"
                f" {MIN_SILENCE:g} s; end one of them"
            )
        self._log(
            f"client {silent.name} was closed to make room: of {MAX_CONNECTIONS} connections it"
            f" has made the fewest calls or was silent for the longest time ({silence:.0f} s)"
        )
        self._open.remove(silent)
        silent.writer.transport.abort()
