"""Which connection gives way where there are too many."""

from __future__ import annotations

import asyncio
import math
from contextlib import ExitStack, suppress
from typing import Any, cast

import pytest

from overtaking.simulators.carla_server import connections
from overtaking.simulators.carla_server.connections import (
    NUM_CALLS_OF_CLIENT,
    Connections,
    CrowdedError,
)


def test_a_connection_with_few_calls_gives_way_first(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 2)
    log: list[str] = []
    crowd = Connections(log.append)

    async def come_and_go() -> None:
        client_writer, other_writer, third_writer = writers = await _connected(3)
        with crowd.enter(client_writer) as client, crowd.enter(other_writer) as other_client:
            for _ in range(NUM_CALLS_OF_CLIENT):
                client.note_call()
            other_client.note_call()
            client.last_call_time -= 3600.0  # As a client that only listens to a sensor.
            with crowd.enter(third_writer):
                assert other_writer.is_closing()
                assert not client_writer.is_closing()
        await _close(writers)

    asyncio.run(come_and_go())
    (line,) = log
    assert "was closed to make room" in line


def test_clients_that_are_making_calls_stay_and_the_most_silent_gives_way(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 2)
    crowd = Connections(lambda _: None)

    async def come_and_go() -> None:
        first_writer, second_writer, third_writer = writers = await _connected(3)
        with crowd.enter(first_writer) as first, crowd.enter(second_writer) as second:
            first.num_calls = second.num_calls = NUM_CALLS_OF_CLIENT
            first.last_call_time = second.last_call_time = math.inf
            with pytest.raises(CrowdedError, match="2 clients"), crowd.enter(third_writer):
                pass
            second.last_call_time = -math.inf
            with crowd.enter(third_writer):
                assert second_writer.is_closing()
                assert not first_writer.is_closing()
        await _close(writers)

    asyncio.run(come_and_go())


class RemoteWriter:
    """A stand-in for the writer of a connection from a machine with this address."""

    def __init__(self, host: str) -> None:
        self.host, self.is_aborted = host, False

    @property
    def transport(self) -> RemoteWriter:
        return self

    def abort(self) -> None:
        self.is_aborted = True

    def get_extra_info(self, _: str) -> tuple[str, int]:
        return self.host, 1


def test_the_machine_with_the_most_connections_gives_way(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 4)
    crowd = Connections(lambda _: None)
    hosts = ["10.0.0.1", "10.0.0.2", "10.0.0.2", "10.0.0.2"]
    writers: list[Any] = [RemoteWriter(host) for host in hosts]
    newcomer: Any = RemoteWriter("10.0.0.3")

    async def come_and_go() -> None:
        with ExitStack() as stack:
            for writer in writers:
                stack.enter_context(crowd.enter(writer))
            stack.enter_context(crowd.enter(newcomer))

    asyncio.run(come_and_go())
    # The first one has been silent for longer, but its machine has no other connection.
    assert [writer.is_aborted for writer in writers] == [False, True, False, False]


def test_of_machines_with_equally_many_connections_the_silent_one_gives_way(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 2)
    crowd = Connections(lambda _: None)
    client_writer, silent_writer, newcomer = (
        RemoteWriter(f"10.0.0.{number}") for number in range(3)
    )

    async def come_and_go() -> None:
        with ExitStack() as stack:
            client, _ = (
                stack.enter_context(crowd.enter(cast("Any", writer)))
                for writer in (client_writer, silent_writer)
            )
            for _ in range(NUM_CALLS_OF_CLIENT):
                client.note_call()
            stack.enter_context(crowd.enter(cast("Any", newcomer)))

    asyncio.run(come_and_go())
    assert (client_writer.is_aborted, silent_writer.is_aborted) == (False, True)


async def _close(writers: list[asyncio.StreamWriter]) -> None:
    for writer in writers:
        writer.close()
        with suppress(ConnectionError):
            await writer.wait_closed()


async def _connected(count: int) -> list[asyncio.StreamWriter]:
    """Writers of so many connections."""

    async def wait(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read()
        writer.close()

    server = await asyncio.start_server(wait, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    writers = [(await asyncio.open_connection("127.0.0.1", port))[1] for _ in range(count)]
    server.close()
    return writers
