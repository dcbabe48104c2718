"""Serves a data set to the browser of this machine."""

from __future__ import annotations

import asyncio
import atexit
import http.client
import socket
import threading
from html import escape
from typing import TYPE_CHECKING

import uvicorn

from overtaking.core.errors import ConfigError, OvertakingError
from overtaking.core.notebook import display
from overtaking.labels.law.judging import choose_policy
from overtaking.labels.law.judging import stored_policy as policy_named
from overtaking.show.server.app import app
from overtaking.show.server.connections import KEEP_ALIVE_TIMEOUT, BoundedConnection
from overtaking.show.server.guard import Keys
from overtaking.show.server.library import Library

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Self

    from overtaking.data.load import Dataset

_HOST = "127.0.0.1"

_START_TIMEOUT_S = 60.0
"""Longest time until the first request is answered, on a machine that does much else [s]."""

_INTERRUPT_INTERVAL_S = 0.5
"""Longest time until Ctrl-C is noticed; Windows interrupts no wait of a thread [s]."""


class _QueryCancellingServer(uvicorn.Server):
    """A server that does not wait for queries when it shuts down."""

    def __init__(self, library: Library, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._library = library

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        # Without this, Ctrl-C waits until the query exceeds its time.
        self._library.close()
        await super().shutdown(sockets)


class ViewServer:
    """A server in a daemon thread that listens on the loopback address, and on no other.

    As a context manager it closes itself.

    Args:
        data: The data set.
        policy: Which rules count when the page opens; None for the default of the profile.
        port: To listen on; 0 lets the system choose.

    Attributes:
        url: Address of the page, with the token that opens it once.

    Raises:
        ConfigError: There is no such policy, or the port is taken.
        OvertakingError: The server does not answer.
    """

    def __init__(self, data: Dataset, policy: str | None, port: int) -> None:
        """Begin to serve; the server has answered a request when this returns."""
        library = Library(data, policy_named(choose_policy(policy, data.profile)).name)
        listener = _listening(port)
        self._port = listener.getsockname()[1]
        keys = Keys(self._port)
        hosts = (f"{_HOST}:{self._port}", f"localhost:{self._port}")
        self.url = f"http://{hosts[0]}/#token={keys.token}"
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
        self._library = library
        self._reader = threading.Thread(target=library.read, name="view-reader", daemon=True)
        # The event loop of the caller, such as that of a notebook, cannot run a second server.
        self._thread = threading.Thread(target=self._server.run, args=([listener],), daemon=True)
        # Python aborts the process if it ends while a daemon thread is in compiled code, such as
        # that which reads Parquet files. So both threads end before, also in notebooks, which
        # rarely close their servers.
        atexit.register(self.close)
        self._reader.start()
        self._thread.start()
        try:
            self._check_answer()
        except BaseException:
            self.close()
            raise

    def wait(self) -> None:
        """Return when the server ends; Ctrl-C raises `KeyboardInterrupt`."""
        while self._thread.is_alive():
            self._thread.join(_INTERRUPT_INTERVAL_S)

    def close(self) -> None:
        """End the server, close all connections and stop reading the data set."""
        self._server.should_exit = True
        self._thread.join()
        self._library.close()  # A server that failed to start has not closed it.
        self._reader.join()
        atexit.unregister(self.close)

    def __enter__(self) -> Self:
        """The server, which ends with the block."""
        return self

    def __exit__(self, *exception: object) -> None:
        """End the server."""
        self.close()

    def __repr__(self) -> str:
        """The class and the address."""
        return f"{type(self).__name__}(url={self.url!r})"

    def _check_answer(self) -> None:
        """Request the page, and wait for the answer."""
        connection = http.client.HTTPConnection(_HOST, self._port, timeout=_START_TIMEOUT_S)
        try:
            connection.request("GET", "/", headers={"Connection": "close"})
            status: object = connection.getresponse().status
        except (OSError, http.client.HTTPException) as error:
            status = error
        finally:
            connection.close()
        if status != http.HTTPStatus.OK:
            raise OvertakingError(
                what="first request",
                where="view",
                expected="status 200",
                got=status,
                next_step="write a page with write_viewer_page or --export instead",
            )


def serve(
    data: Dataset, *, policy: str | None, port: int, ready: Callable[[str], None] | None
) -> ViewServer | None:
    """Serve a data set; see `overtaking.serve_viewer`."""
    server = ViewServer(data, policy, port)
    if _is_event_loop_running():
        link = f'<a href="{escape(server.url)}" target="_blank">{escape(server.url)}</a>'
        is_shown = display(html=link, text=server.url)
        if ready is not None or not is_shown:
            (ready or print)(server.url)
        return server
    with server:
        (ready or print)(server.url)
        server.wait()
    return None


def _is_event_loop_running() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


def _listening(port: int) -> socket.socket:
    try:
        return socket.create_server((_HOST, port))
    except OSError as error:
        raise ConfigError(
            what=f"port {port}",
            where="view",
            expected="one that is free",
            got=error.strerror or error,
            next_step="choose another --port, or leave it out",
        ) from None
