"""Connections that do not ask, ask too slowly or do not read their answer are closed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

if TYPE_CHECKING:
    import asyncio

MAX_CONNECTIONS = 128
"""Connections that are kept open. Some systems allow a process only 256 open files and sockets."""

REQUEST_TIMEOUT = 10.0
"""Longest time from the first byte of a request, or from the connection, to its last byte [s]."""

ANSWER_TIMEOUT = 10.0
"""Longest time that a client may leave a full buffer of its answer unread [s]."""

KEEP_ALIVE_TIMEOUT = 10
"""Longest time from an answer to the next request [s]."""


class BoundedConnection(H11Protocol):
    """The HTTP connection of uvicorn, with deadlines for requests and answers.

    uvicorn itself bounds only the pause between two requests. Its `limit_concurrency` counts silent
    connections too, so they would lock out everyone else. Here a new connection is always accepted:
    where there are too many, the connection that has been waiting for a request for the longest
    time is closed.
    """

    _deadline: asyncio.TimerHandle | None = None
    _reading_deadline: asyncio.TimerHandle | None = None
    _waiting_since = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for the first request."""
        super().connection_made(transport)
        self._waiting_since = self.loop.time()
        self._deadline = self.loop.call_later(REQUEST_TIMEOUT, transport.abort)
        self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop all clocks."""
        self._deadline = _cancel(self._deadline)
        self._reading_deadline = _cancel(self._reading_deadline)
        super().connection_lost(exc)

    def handle_events(self) -> None:
        """Read what has arrived; a request that has begun must be complete by its deadline."""
        super().handle_events()
        if not self._is_receiving():
            self._deadline = _cancel(self._deadline)
        elif self._deadline is None and not self.transport.is_closing():
            self._deadline = self.loop.call_later(REQUEST_TIMEOUT, self.transport.abort)

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self._waiting_since = self.loop.time()
        super().on_response_complete()

    def pause_writing(self) -> None:
        """Give the client time to read."""
        super().pause_writing()
        self._reading_deadline = self.loop.call_later(ANSWER_TIMEOUT, self.transport.abort)

    def resume_writing(self) -> None:
        """The client has read."""
        self._reading_deadline = _cancel(self._reading_deadline)
        super().resume_writing()

    def timeout_keep_alive_handler(self) -> None:
        """Close after a pause; an answer that nobody reads would keep a closed socket open."""
        if self.transport.get_write_buffer_size():
            self.transport.abort()
        super().timeout_keep_alive_handler()

    def shutdown(self) -> None:
        """Close at once when the server ends, so that no unfinished request delays the end."""
        self.transport.abort()

    def _is_waiting(self) -> bool:
        """Whether the connection has no request that is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def _is_receiving(self) -> bool:
        """Whether a part of a request has arrived."""
        state, (rest, _) = self.conn.their_state, self.conn.trailing_data
        return state is h11.SEND_BODY or (state is h11.IDLE and bool(rest))

    def _make_room(self) -> None:
        """Where there are too many, close the one that has waited longest for a request."""
        # Connections that are being closed stay in the set until the next turn of the loop.
        connections = [
            connection
            for connection in self.connections
            if isinstance(connection, BoundedConnection) and not connection.transport.is_closing()
        ]
        if len(connections) > MAX_CONNECTIONS:
            waiting = [one for one in connections if one._is_waiting() or one._is_receiving()]
            min(waiting, key=lambda one: one._waiting_since).transport.abort()


def _cancel(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()
