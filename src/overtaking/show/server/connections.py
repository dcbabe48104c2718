"""Connections with deadlines for requests and answers, and an upper limit of their number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

if TYPE_CHECKING:
    import asyncio

MAX_CONNECTIONS = 128
"""Most open connections. Some systems allow a process only 256 open files and sockets."""

REQUEST_TIMEOUT = 10.0
"""Longest time for a request to arrive, from its first byte to its last byte [s].

For the first request of a connection the time begins when the connection is made.
"""

ANSWER_TIMEOUT = 10.0
"""Longest time that a client may leave a full buffer of its answer unread [s]."""

KEEP_ALIVE_TIMEOUT = 10
"""Longest time from an answer to the next request [s]."""


class BoundedConnection(H11Protocol):
    """The HTTP connection of uvicorn, with deadlines for requests and answers.

    uvicorn itself bounds only the pause between two requests. Its `limit_concurrency` counts silent
    connections too, so that these could lock out all other clients. Here a new connection is always
    accepted. Beyond `MAX_CONNECTIONS`, the server closes the connection that has waited longest for
    a complete request.
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
        """Read the bytes that have arrived, and set the deadline of an incomplete request."""
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
        """Set the deadline at which the client must have read its answer."""
        super().pause_writing()
        self._reading_deadline = self.loop.call_later(ANSWER_TIMEOUT, self.transport.abort)

    def resume_writing(self) -> None:
        """Remove the deadline, as the client has read."""
        self._reading_deadline = _cancel(self._reading_deadline)
        super().resume_writing()

    def timeout_keep_alive_handler(self) -> None:
        """Close after a pause between requests.

        A transport with an unread answer would stay open after a close, so it is aborted.
        """
        if self.transport.get_write_buffer_size():
            self.transport.abort()
        super().timeout_keep_alive_handler()

    def shutdown(self) -> None:
        """Close at once when the server ends, so that no unfinished request delays the end."""
        self.transport.abort()

    def _is_waiting(self) -> bool:
        """Whether no request of the connection is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def _is_receiving(self) -> bool:
        """Whether a part of a request has arrived, but not all of it."""
        state, (unread, _) = self.conn.their_state, self.conn.trailing_data
        return state is h11.SEND_BODY or (state is h11.IDLE and bool(unread))

    def _make_room(self) -> None:
        """If too many connections are open, close the one that has waited longest for a request."""
        # Connections that are being closed stay in the set until the next turn of the loop.
        connections = [
            connection
            for connection in self.connections
            if isinstance(connection, BoundedConnection) and not connection.transport.is_closing()
        ]
        if len(connections) > MAX_CONNECTIONS:
            # The new connection waits as well, so there is always one to close.
            waiting = [
                connection
                for connection in connections
                if connection._is_waiting() or connection._is_receiving()
            ]
            oldest = min(waiting, key=lambda connection: connection._waiting_since)
            oldest.transport.abort()


def _cancel(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()
