"""The page is served beside a running event loop, and announced once it answers."""

from __future__ import annotations

import asyncio
import http.client
import socket
import sys
import threading
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

import overtaking as ot
from overtaking.core.errors import OvertakingError
from overtaking.show.server import running
from overtaking.show.server.running import ViewServer

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.data.load import Dataset

TIMEOUT_S = 120.0


def request_page(url: str) -> int:
    """The status of the answer to a request of the page."""
    connection = http.client.HTTPConnection(url.split("/")[2], timeout=TIMEOUT_S)
    connection.request("GET", "/")
    status = connection.getresponse().status
    connection.close()
    return status


def is_open(url: str) -> bool:
    host, port = url.split("/")[2].split(":")
    try:
        socket.create_connection((host, int(port)), timeout=TIMEOUT_S).close()
    except ConnectionRefusedError:
        return False
    return True


def serve_in_a_loop(data: Dataset, ready: Callable[[str], None] | None = None) -> ViewServer:
    """What `serve_viewer` returns where an event loop runs."""

    async def call() -> Any:
        return ot.serve_viewer(data, port=0, ready=ready)

    server = asyncio.run(call())
    assert isinstance(server, ViewServer)
    return server


def test_inside_an_event_loop_the_call_returns_a_server(data: Dataset):
    server = serve_in_a_loop(data)
    assert request_page(server.url) == 200
    assert repr(server) == f"ViewServer(url='{server.url}')"
    server.close()
    server.close()
    assert not is_open(server.url)


def test_a_server_ends_with_its_block(data: Dataset):
    with serve_in_a_loop(data) as server:
        assert request_page(server.url) == 200
    assert not is_open(server.url)


def test_two_servers_run_beside_each_other(data: Dataset):
    with serve_in_a_loop(data) as first, serve_in_a_loop(data) as second:
        assert first.url != second.url
        assert request_page(first.url) == request_page(second.url) == 200


def test_the_thread_of_a_server_does_not_keep_the_process_alive(data: Dataset):
    before = set(threading.enumerate())
    with serve_in_a_loop(data):
        assert all(thread.daemon for thread in set(threading.enumerate()) - before)


def test_ready_is_called_when_requests_are_answered(data: Dataset):
    statuses: list[int] = []
    with serve_in_a_loop(data, ready=lambda url: statuses.append(request_page(url))) as server:
        assert statuses == [200]
        assert is_open(server.url)


def test_outside_an_event_loop_the_call_blocks_until_an_interrupt(
    data: Dataset, monkeypatch: pytest.MonkeyPatch
):
    urls: list[str] = []

    def interrupt(server: ViewServer) -> None:
        assert urls == [server.url]
        assert request_page(server.url) == 200
        raise KeyboardInterrupt

    monkeypatch.setattr(ViewServer, "wait", interrupt)
    with pytest.raises(KeyboardInterrupt):
        ot.serve_viewer(data, ready=urls.append)
    assert not is_open(urls[0])


def test_waiting_ends_with_the_server(data: Dataset):
    with ViewServer(data, "paper", 0) as server:
        closer = threading.Thread(target=server.close)
        closer.start()
        server.wait()
        closer.join()
        assert not is_open(server.url)


def test_an_error_in_ready_ends_the_server(data: Dataset):
    urls: list[str] = []

    def fail(url: str) -> None:
        urls.append(url)
        raise RuntimeError("no browser")

    with pytest.raises(RuntimeError, match="no browser"):
        ot.serve_viewer(data, ready=fail)
    assert not is_open(urls[0])


def test_a_server_without_an_answer_is_a_clear_error(
    data: Dataset, monkeypatch: pytest.MonkeyPatch
):
    async def refuse(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 503, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    monkeypatch.setattr(running, "app", lambda *_: refuse)
    urls: list[str] = []
    with pytest.raises(OvertakingError, match="first request: expected status 200, got 503"):
        ot.serve_viewer(data, ready=urls.append)
    assert urls == []


def test_without_ipython_the_address_is_printed(data: Dataset, capsys: pytest.CaptureFixture[str]):
    with serve_in_a_loop(data) as server:
        assert capsys.readouterr().out == f"{server.url}\n"


def test_ipython_shows_a_link(
    data: Dataset, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    shown: list[dict[str, str]] = []
    ipython = SimpleNamespace(get_ipython=object)
    displays = SimpleNamespace(display=lambda content, *, raw: shown.append(content) or raw)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", displays)
    urls: list[str] = []
    with serve_in_a_loop(data) as server, serve_in_a_loop(data, ready=urls.append) as second:
        pass
    links = [f'<a href="{url}" target="_blank">{url}</a>' for url in (server.url, second.url)]
    assert [content["text/html"] for content in shown] == links
    assert [content["text/plain"] for content in shown] == [server.url, second.url]
    assert urls == [second.url]
    assert capsys.readouterr().out == ""
