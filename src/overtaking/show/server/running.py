"""Serves a data set to the browser of this machine."""

from __future__ import annotations

import socket
import threading
from typing import TYPE_CHECKING

import uvicorn

from overtaking.core.errors import ConfigError
from overtaking.labels.law import choose_policy
from overtaking.labels.law import policy as policy_named
from overtaking.show.server.app import app
from overtaking.show.server.connections import KEEP_ALIVE_TIMEOUT, BoundedConnection
from overtaking.show.server.guard import Keys
from overtaking.show.server.library import Library

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.data.load import Dataset

_HOST = "127.0.0.1"


class _QueryCancellingServer(uvicorn.Server):
    """A server that does not wait for queries when it shuts down."""

    def __init__(self, library: Library, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._library = library

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        # Without this, Ctrl-C waits until the query exceeds its time.
        self._library.close()
        await super().shutdown(sockets)


class Server:
    """A server that listens on the loopback address, and on no other.

    Args:
        data: The data set.
        policy: Which rules count when the page opens; None for the default of the profile.
        port: To listen on; 0 lets the system choose.

    Attributes:
        url: Address of the page, with the token that opens it once.

    Raises:
        ConfigError: There is no such policy, or the port is taken.
    """

    def __init__(self, data: Dataset, policy: str | None, port: int) -> None:
        """Begin to listen; nothing is answered yet."""
        library = Library(data, policy_named(choose_policy(policy, data.profile)).name)
        self._socket = _listening(port)
        port = self._socket.getsockname()[1]
        keys, hosts = Keys(port), (f"{_HOST}:{port}", f"localhost:{port}")
        self.url = f"http://{hosts[0]}/#token={keys.token}"
        self._reader = threading.Thread(target=library.read, daemon=True)
        self._server = _QueryCancellingServer(
            library,
            uvicorn.Config(
                app(library, hosts, keys),
                access_log=False,
                http=BoundedConnection,
                lifespan="off",
                log_config=None,
                proxy_headers=False,
                server_header=False,
                timeout_keep_alive=KEEP_ALIVE_TIMEOUT,
                ws="none",
            ),
        )

    def run(self) -> None:
        """Answer until the process is interrupted, or `stop` is called."""
        self._reader.start()
        self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """Let `run` end."""
        self._server.should_exit = True


def serve(data: Dataset, *, policy: str | None, port: int, ready: Callable[[str], None]) -> None:
    """Serve a data set; see `overtaking.serve_view`."""
    server = Server(data, policy, port)
    ready(server.url)
    server.run()


def _listening(port: int) -> socket.socket:
    try:
        return socket.create_server((_HOST, port))
    except OSError as error:
        raise ConfigError.of(
            what=f"port {port}",
            where="view",
            expected="one that is free",
            got=error.strerror or error,
            next_step="choose another --port, or leave it out",
        ) from None
