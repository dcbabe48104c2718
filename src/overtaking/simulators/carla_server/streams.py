"""Streams of sensor data and their listeners; slow listeners are closed."""

import asyncio
import contextlib
import random
import struct
from collections.abc import Callable

from overtaking.simulators.carla_server import snapshot

MAX_WAITING_BYTES = 64 << 20
"""A listener with more unsent bytes than this is closed; a picture has up to 8 MB."""

MAX_ALL_WAITING_BYTES = 4 * MAX_WAITING_BYTES
"""If all listeners together have more unsent bytes than this, the slowest is closed."""

MAX_LISTENERS = 512
"""Most listeners at a time; a genuine client has one for each sensor."""

SETTLING_TIME = 0.5
"""Longest wait for an announced listener [s]."""

HANDSHAKE_TIME = 10.0
"""A connection that has not named its stream by then is closed [s]."""

_LENGTH = struct.Struct("<I")


def _waiting(writer: asyncio.StreamWriter) -> int:
    """Unsent bytes of a listener."""
    return writer.transport.get_write_buffer_size()


class Streams:
    """All streams of a server, by number."""

    def __init__(self, log: Callable[[str], None]) -> None:
        """Begin without streams."""
        self._log = log
        self._listeners: dict[int, set[asyncio.StreamWriter]] = {}
        self._next = 0
        self._unnamed: dict[asyncio.StreamWriter, None] = {}
        self._has_warned = self._is_crowded = False
        self._announced: set[int] = set()
        self._arrival = asyncio.Event()
        self.port = 0

    def open(self) -> int:
        """A new stream."""
        self._next += 1
        self._listeners[self._next] = set()
        return self._next

    def close(self, stream: int) -> None:
        """End a stream and close its listeners."""
        self._announced.discard(stream)
        for writer in self._listeners.pop(stream, set()):
            writer.close()

    def token(self, stream: int) -> bytes:
        """Address and id that a client needs to listen to a stream."""
        return snapshot.token(stream, self.port)

    def announce(self, stream: int) -> None:
        """Expect a listener: a client has asked for the address of a stream."""
        if stream in self._listeners:
            self._announced.add(stream)

    async def settle(self) -> None:
        """Wait for expected listeners, so that they miss nothing of the next tick."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(SETTLING_TIME):
                while self._announced:
                    self._arrival.clear()
                    await self._arrival.wait()
        self._announced.clear()

    def is_heard(self, stream: int) -> bool:
        """Whether a stream has listeners."""
        return bool(self._listeners.get(stream))

    def send(self, stream: int, message: bytes) -> None:
        """Send a message to all listeners."""
        data = _LENGTH.pack(len(message)) + message
        piled_up = False
        for writer in self._listeners.get(stream, ()):
            if not writer.is_closing():
                piled_up |= _waiting(writer) > 0
                writer.write(data)
        if piled_up:
            self._let_go_of_the_slow()

    def _let_go_of_the_slow(self) -> None:
        """Close the listeners with too many unsent bytes, the slowest first."""
        slow = [
            (_waiting(writer), stream, writer)
            for stream, listeners in self._listeners.items()
            for writer in listeners
            if _waiting(writer)
        ]
        total = sum(size for size, _, _ in slow)
        for size, stream, writer in sorted(slow, key=lambda one: one[0], reverse=True):
            if size <= MAX_WAITING_BYTES and total <= MAX_ALL_WAITING_BYTES:
                return
            total -= size
            self._log(f"a listener of stream {stream} does not read; let go")
            self._listeners[stream].discard(writer)
            writer.transport.abort()

    def _tell_of_unknown(self, stream: int) -> None:
        """Say once that a stream never was; clients ask again for that of a destroyed sensor."""
        if stream > self._next and not self._has_warned:
            self._has_warned = True
            self._log(f"somebody asked for stream {stream}, which never was; said once")

    def _make_room(self) -> None:
        """Close a connection if `MAX_LISTENERS` are open.

        The oldest connection that has not named its stream is closed first. If all have, a random
        listener of the stream with the most listeners is closed, so that a client with very many
        connections to one stream loses its own.
        """
        num_listeners = sum(map(len, self._listeners.values()))
        if num_listeners + len(self._unnamed) < MAX_LISTENERS:
            return
        if self._unnamed:
            closed = next(iter(self._unnamed))
            del self._unnamed[closed]
        else:
            listeners = max(self._listeners.values(), key=len)
            closed = random.choice(list(listeners))
            listeners.discard(closed)
        if not self._is_crowded:
            self._is_crowded = True
            self._log(
                f"{MAX_LISTENERS} listeners are connected; each new one now closes an old one"
            )
        closed.transport.abort()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection: it names its stream and then only listens."""
        stream = -1
        self._make_room()
        self._unnamed[writer] = None
        try:
            head = await asyncio.wait_for(reader.readexactly(_LENGTH.size), HANDSHAKE_TIME)
            (stream,) = _LENGTH.unpack(head)
            if stream not in self._listeners:
                self._tell_of_unknown(stream)
                return
            if writer not in self._unnamed:
                return  # It was closed for another one just when it named its stream.
            del self._unnamed[writer]
            self._listeners[stream].add(writer)
            self._announced.discard(stream)
            self._arrival.set()
            # Nothing more is expected; whatever comes is thrown away until the end.
            while await reader.read(1024):
                pass
        except (asyncio.IncompleteReadError, TimeoutError, ConnectionError):
            pass
        finally:
            self._unnamed.pop(writer, None)
            self._listeners.get(stream, set()).discard(writer)
            writer.close()
