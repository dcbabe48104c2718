"""Which connection gives way where there are too many."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import pytest

from overtaking.simulators.carla_server import connections
from overtaking.simulators.carla_server.connections import Connections, CrowdedError


def test_where_all_have_called_the_longest_idle_gives_way_and_nobody_else(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 2)
    log: list[str] = []
    crowd = Connections(log.append)

    async def come_and_go() -> None:
        one, two, three = writers = await _connected(3)
        with crowd.enter(one) as first, crowd.enter(two) as second:
            first.hear()
            second.hear()
            with pytest.raises(CrowdedError, match="2 clients"), crowd.enter(three):
                pass
            second.heard -= connections.IDLE_TIME + 1.0
            with crowd.enter(three):
                assert two.is_closing()
                assert not one.is_closing()
        for writer in writers:
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()

    asyncio.run(come_and_go())
    (line,) = log
    assert "was closed to make room" in line


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
