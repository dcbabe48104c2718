"""Listeners that do not read."""

from __future__ import annotations

import asyncio
import struct
from typing import TYPE_CHECKING

from overtaking.simulators.carla_server import streams as module
from overtaking.simulators.carla_server.streams import Streams

if TYPE_CHECKING:
    import pytest

MB = 1 << 20


def test_listeners_together_hold_no_more_than_the_limit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "MAX_WAITING_BYTES", 4 * MB)
    monkeypatch.setattr(module, "MAX_ALL_WAITING_BYTES", 8 * MB)
    log: list[str] = []
    streams = Streams(log.append)
    stream, count = streams.open(), 8
    writers: list[asyncio.StreamWriter] = []

    async def listen(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.append(writer)
        await streams.serve(reader, writer)

    async def pile_up() -> None:
        async with await asyncio.start_server(listen, "127.0.0.1", 0) as server:
            port = server.sockets[0].getsockname()[1]
            silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(count)]
            for reader, writer in silent:
                reader._transport.pause_reading()  # type: ignore[attr-defined]
                writer.write(struct.pack("<I", stream))
            async with asyncio.timeout(60.0):
                while len(writers) < count or not streams.is_heard(stream):
                    await asyncio.sleep(0.01)
                while len(log) < count:
                    streams.send(stream, bytes(MB))
                    await asyncio.sleep(0.01)
                    waiting = [one.transport.get_write_buffer_size() for one in writers]
                    assert sum(waiting) <= 8 * MB
            for _, writer in silent:
                writer.close()

    asyncio.run(pile_up())
    assert log == [f"a listener of stream {stream} does not read; let go"] * count
