"""The connections of clients, and the one to close when there are too many."""

import asyncio
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field

MAX_CONNECTIONS = 64

NUM_CALLS_OF_CLIENT = 4
"""Number of calls that CARLA's own client makes when it connects. A connection with fewer calls may
belong to another kind of program, so it gives way first."""

MIN_SILENCE = 1.0
"""A connection with `NUM_CALLS_OF_CLIENT` calls gives way only if silent this long [s]."""


class CrowdedError(Exception):
    """There is no room for another client."""


@dataclass(slots=True, eq=False)
class Connection:
    """One connection.

    Attributes:
        writer: Stream for the answers.
        host: Address of the client's machine.
        port: Port of the client.
        last_call_time: Time of its last call, or of its beginning, by the event loop's clock [s].
        num_calls: Number of calls that it has made.
        told: Logged messages about its calls without effect; each is logged once.
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
        """Count a call that it has made, and note the time."""
        self.last_call_time = asyncio.get_running_loop().time()
        self.num_calls += 1


class Connections:
    """All open connections.

    Silence alone ends no connection: CARLA's own client connects before its first call, and may
    listen to sensors for hours without another call. Only when `MAX_CONNECTIONS` are open, a new
    connection closes an old one: of the machines with the most connections those with the fewest
    calls (all counts from `NUM_CALLS_OF_CLIENT` on are equal), and of these the one whose last
    call is the longest time ago.

    Args:
        log: Receives a line when a connection is closed for a new one.
    """

    def __init__(self, log: Callable[[str], None]) -> None:
        """Start without connections."""
        self._log = log
        self._open: list[Connection] = []

    @contextmanager
    def enter(self, writer: asyncio.StreamWriter) -> Generator[Connection]:
        """Hold a new connection open for as long as the context lasts.

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
        """Close the connection that gives way to a new one, see the class.

        Raises:
            CrowdedError: Even that one has made a call within the last `MIN_SILENCE`.
        """
        num_connections = Counter(connection.host for connection in self._open)
        max_connections = max(num_connections.values())
        oldest = min(
            (
                connection
                for connection in self._open
                if num_connections[connection.host] == max_connections
            ),
            key=lambda connection: (
                min(connection.num_calls, NUM_CALLS_OF_CLIENT),
                connection.last_call_time,
            ),
        )
        silence = now - oldest.last_call_time
        if oldest.num_calls >= NUM_CALLS_OF_CLIENT and silence < MIN_SILENCE:
            raise CrowdedError(
                f"{MAX_CONNECTIONS} clients are connected and all made calls within the last"
                f" {MIN_SILENCE:g} s; end one of them"
            )
        self._log(
            f"client {oldest.name} was closed to make room: of {MAX_CONNECTIONS} connections it"
            f" has made the fewest calls or was silent for the longest time ({silence:.0f} s)"
        )
        self._open.remove(oldest)
        oldest.writer.transport.abort()
