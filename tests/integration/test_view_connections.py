"""The server of `overtaking view` with connections that are silent, slow, idle or too many."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from http.client import HTTPException
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.support.carla import stopped_by_signals
from tests.support.processes import eventually, listening_addresses
from tests.support.serving import Client, serving

import overtaking as ot
from overtaking.show.server import connections, index
from overtaking.show.server.connections import MAX_CONNECTIONS
from overtaking.show.server.library import Library

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from overtaking.data.load import Dataset

pytestmark = pytest.mark.ci

PATIENCE_S = 60.0
SHORT_S = 0.3


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("connections") / "data"
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=10, seed=1, out=folder, keep="features"
    )


@pytest.fixture
def url(data: Dataset) -> Iterator[str]:
    with serving(data) as address:
        yield address


def connect(url: str) -> socket.socket:
    host, port = url.split("/")[2].split(":")
    return socket.create_connection((host, int(port)), timeout=PATIENCE_S)


def post_head(url: str, length: int) -> bytes:
    host = url.split("/")[2]
    return (
        f"POST /api/session HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n"
        f"Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n"
    ).encode()


def is_closed(connection: socket.socket) -> bool:
    """Wait until the server closes a connection, whatever it has sent before."""
    try:
        while connection.recv(1 << 16):
            pass
    except ConnectionResetError:
        return True
    except TimeoutError:
        return False
    return True


def is_open(connection: socket.socket) -> bool:
    """Whether the server keeps a connection open on which it sends nothing."""
    connection.setblocking(False)
    try:
        connection.recv(1)
    except BlockingIOError:
        return True
    except ConnectionResetError:
        return False
    return False


@pytest.mark.parametrize("count", [63, 500])
def test_silent_connections_lock_no_client_out(url: str, count: int):
    with ExitStack() as stack:
        silent = [stack.enter_context(connect(url)) for _ in range(count)]
        client = Client(url)
        assert client.ask("GET", "/")[0] == 200
        client.enter()
        assert client.ask("GET", "/api/start")[0] == 200
        assert eventually(lambda: sum(map(is_open, silent)) <= MAX_CONNECTIONS)


def test_the_connection_that_waited_longest_gives_way(url: str):
    with ExitStack() as stack:
        oldest, *_, newest = [stack.enter_context(connect(url)) for _ in range(MAX_CONNECTIONS + 1)]
        assert is_closed(oldest)
        newest.sendall(f"GET / HTTP/1.1\r\nHost: {url.split('/')[2]}\r\n\r\n".encode())
        assert newest.recv(100).startswith(b"HTTP/1.1 200 ")


UNFINISHED = {
    "nothing": b"",
    "a part of the head": b"GET / HTTP/1.1\r\nHo",
    "a head without its body": None,
}


@pytest.mark.parametrize("start", UNFINISHED.values(), ids=UNFINISHED)
def test_a_request_that_does_not_end_is_closed(
    url: str, start: bytes | None, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(connections, "REQUEST_TIMEOUT", SHORT_S)
    with connect(url) as connection:
        connection.sendall(post_head(url, 100) if start is None else start)
        assert is_closed(connection)


@pytest.mark.parametrize("start", [b"GET / HTTP/1.1\r\nX: ", None], ids=["head", "body"])
def test_single_bytes_do_not_extend_the_deadline(
    url: str, start: bytes | None, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(connections, "REQUEST_TIMEOUT", SHORT_S)
    end = time.monotonic() + PATIENCE_S
    with connect(url) as connection:
        connection.sendall(post_head(url, 16_000) if start is None else start)
        while time.monotonic() < end:
            try:
                connection.sendall(b" ")
            except (BrokenPipeError, ConnectionResetError):
                return
            time.sleep(0.05)
    pytest.fail("the connection was not closed")


def test_the_deadline_holds_for_later_requests_of_a_connection(
    url: str, monkeypatch: pytest.MonkeyPatch
):
    with connect(url) as connection:
        connection.sendall(f"GET / HTTP/1.1\r\nHost: {url.split('/')[2]}\r\n\r\n".encode())
        answer = b""
        while b"</html>" not in answer.lower():
            answer += connection.recv(1 << 16)
        monkeypatch.setattr(connections, "REQUEST_TIMEOUT", SHORT_S)
        connection.sendall(post_head(url, 100))
        assert is_closed(connection)


def test_an_idle_connection_is_closed(data: Dataset, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("overtaking.show.server.running.KEEP_ALIVE_TIMEOUT", SHORT_S)
    with serving(data) as url, connect(url) as connection:
        connection.sendall(f"GET / HTTP/1.1\r\nHost: {url.split('/')[2]}\r\n\r\n".encode())
        assert is_closed(connection)


def test_answers_that_nobody_reads_are_given_up(url: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "ANSWER_TIMEOUT", SHORT_S)
    request = f"GET /viewer.js HTTP/1.1\r\nHost: {url.split('/')[2]}\r\n\r\n".encode()
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(PATIENCE_S)
        host, port = url.split("/")[2].split(":")
        connection.connect((host, int(port)))
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:  # The buffers of the system hold the first answers.
            try:
                connection.sendall(request)
            except (ConnectionResetError, BrokenPipeError):
                return
            time.sleep(0.01)
    pytest.fail("the connection was not closed")


def test_queries_beyond_the_limit_are_refused_and_delay_nothing_else(
    url: str, monkeypatch: pytest.MonkeyPatch
):
    """Twelve queries: eight are computed or wait, four are refused."""
    release, answers = threading.Event(), []

    def wait_for_release(_: Library, __: str) -> dict[str, bool]:
        release.wait(PATIENCE_S)
        return {"filters": False}

    monkeypatch.setattr(Library, "sql", wait_for_release)
    client = Client(url).enter()

    def ask(_: int) -> None:
        answers.append(client.ask("POST", "/api/sql", {"sql": "SELECT 1"}))

    try:
        with ThreadPoolExecutor(12) as pool:
            for number in range(12):
                pool.submit(ask, number)
            end = time.monotonic() + PATIENCE_S
            while len(answers) < 4 and time.monotonic() < end:
                time.sleep(0.02)
            assert [status for status, _, _ in answers] == [429] * 4
            assert client.ask("GET", "/api/start")[0] == 200
            assert client.rows()["total"] == 10
            assert client.ask("GET", "/api/runs/3")[0] == 200
            release.set()
    finally:
        release.set()
    assert sorted(status for status, _, _ in answers) == [200] * 8 + [429] * 4
    _, refusal, headers = next(answer for answer in answers if answer[0] == 429)
    assert refusal == {"error": "8 queries run or wait already: ask again in a moment"}
    assert headers["retry-after"] == "1"


VIEW = """
import sys
from overtaking.cli import main
from overtaking.show.server import library
library.SQL_SECONDS = 3600.0  # Longer than the patience of the tests.
sys.exit(main(sys.argv[1:]))
"""


def runs_query(server: int) -> bool:
    """Whether a server, by its process id, has a child process that answers a query (Linux)."""
    children = Path(f"/proc/{server}/task").glob("*/children")
    processes = [child for file in children for child in file.read_text("ascii").split()]
    commands = [Path(f"/proc/{process}/cmdline").read_bytes() for process in processes]
    return any(b"database.child" in command for command in commands)


@contextmanager
def view_command(data: Dataset) -> Generator[tuple[subprocess.Popen[str], str]]:
    """The process of `overtaking view` and the address of its page."""
    command = [sys.executable, "-c", VIEW, "view", str(data.path), "--port", "0"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    ) as server:
        try:
            assert server.stdout is not None
            url = next(m[0] for line in server.stdout if (m := re.search(r"http://\S+", line)))
            yield server, url
        finally:
            server.kill()


def test_a_closed_server_has_stopped_reading(data: Dataset, monkeypatch: pytest.MonkeyPatch):
    # No page asks for the list, so that the reader waits for one until the server ends. A thread
    # that still reads Parquet files when Python ends would abort the process.
    monkeypatch.setattr(index, "_HEAD_START_S", 10 * PATIENCE_S)
    with serving(data) as url:
        assert Client(url).ask("GET", "/")[0] == 200
        (reader,) = [thread for thread in threading.enumerate() if thread.name == "view-reader"]
    assert not reader.is_alive()


@stopped_by_signals
def test_ctrl_c_ends_with_an_unfinished_post_and_without_a_traceback(data: Dataset):
    with view_command(data) as (server, url):
        with connect(url) as unfinished, connect(url):
            unfinished.sendall(post_head(url, 100) + b"{")
            assert Client(url).ask("GET", "/")[0] == 200
            server.send_signal(signal.SIGINT)
            assert server.wait(PATIENCE_S) == 130
        assert server.stdout is not None
        assert "Traceback" not in server.stdout.read()


@stopped_by_signals
def test_ctrl_c_does_not_wait_for_a_query(data: Dataset):
    endless = "SELECT count(*) FROM range(1000000) a, range(1000000) b WHERE hash(a, b) = 7"
    with view_command(data) as (server, url), ThreadPoolExecutor(1) as pool:
        client = Client(url).enter()
        answer = pool.submit(client.ask, "POST", "/api/sql", {"sql": endless})
        assert eventually(lambda: runs_query(server.pid))
        server.send_signal(signal.SIGINT)
        assert server.wait(PATIENCE_S) == 130
        with suppress(ConnectionError, HTTPException):  # The server may end within the answer.
            status, refusal, _ = answer.result()
            assert (status, "end of the program" in refusal["error"]) == (400, True)
        assert server.stdout is not None
        assert "Traceback" not in server.stdout.read()


@stopped_by_signals
def test_the_server_listens_on_loopback_only(url: str):
    assert listening_addresses(int(url.split("/")[2].split(":")[1])) == {"127.0.0.1"}
