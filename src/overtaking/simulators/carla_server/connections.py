"""The connections of clients, and the one to close when there are too many."""

import asyncio
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field

MAX_CONNECTIONS = 64

IDLE_TIME = 300.0
"""A client silent for this long may be closed for a new one [s]."""


class CrowdedError(Exception):
    """There is no room for another client."""


@dataclass(slots=True, eq=False)
class Connection:
    """One connection.

    Attributes:
        writer: Stream for the answers.
        name: Address of the client.
        heard: Time of its last call, or of its beginning [s].
        has_called: Whether it ever made a call.
        told: Logged messages about its calls without effect.
    """

    writer: asyncio.StreamWriter
    name: str
    heard: float
    has_called: bool = False
    told: set[str] = field(default_factory=set)

    def hear(self) -> None:
        """Note that it has made a call."""
        self.heard, self.has_called = asyncio.get_running_loop().time(), True


class Connections:
    """All open connections.

    Silence alone ends none: the genuine client connects before its first call and may only listen
    to sensors for hours afterwards, without a sign of life. So silent ones give way only where a
    new one finds no room: first those that never made a call, the longest silent first.

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
            CrowdedError: There is no room, and no client has been silent long enough to be closed.
        """
        now = asyncio.get_running_loop().time()
        if len(self._open) >= MAX_CONNECTIONS:
            self._make_room(now)
        host, port, *_ = writer.get_extra_info("peername") or ("?", 0)
        connection = Connection(writer, f"{host}:{port}", now)
        self._open.append(connection)
        try:
            yield connection
        finally:
            if connection in self._open:
                self._open.remove(connection)

    def _make_room(self, now: float) -> None:
        """End the longest silent connection."""
        idle = [one for one in self._open if now - one.heard > IDLE_TIME]
        candidates = [one for one in self._open if not one.has_called] or idle
        if not candidates:
            raise CrowdedError(
                f"{MAX_CONNECTIONS} clients are connected and all made calls within the last"
                f" {IDLE_TIME:g} s; end one of them"
            )
        longest = min(candidates, key=lambda one: one.heard)
        self._log(
            f"client {longest.name} was closed to make room: of {MAX_CONNECTIONS} clients it was"
            f" silent for the longest time, {now - longest.heard:.0f} s"
        )
        self._open.remove(longest)
        longest.writer.transport.abort()
