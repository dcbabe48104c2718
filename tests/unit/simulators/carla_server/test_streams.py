"""Listeners that do not read, and too many of them."""

from __future__ import annotations

import asyncio
import struct
from typing import TYPE_CHECKING
from unittest.mock import Mock

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


def test_a_connection_that_is_closed_while_it_names_its_stream_does_not_listen(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(module, "MAX_LISTENERS", 1)
    streams = Streams(lambda _: None)
    stream = streams.open()
    writer = Mock()

    async def name_stream_and_lose_place() -> None:
        reader = asyncio.StreamReader()
        serving = asyncio.create_task(streams.serve(reader, writer))
        await asyncio.sleep(0)
        reader.feed_data(struct.pack("<I", stream))
        streams._make_room()  # As for a new connection, before the first one reads on.
        await serving

    asyncio.run(name_stream_and_lose_place())
    assert not streams.is_heard(stream)
    writer.transport.abort.assert_called_once()


def test_many_other_connections_do_not_close_the_only_listener_of_a_stream(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(module, "MAX_LISTENERS", 20)
    streams = Streams(lambda _: None)
    crowded, lonely = streams.open(), streams.open()
    writers: list[asyncio.StreamWriter] = []

    async def listen(port: int, request: bytes) -> asyncio.StreamReader:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writers.append(writer)
        writer.write(request)
        return reader

    async def connect() -> None:
        join_crowd = struct.pack("<I", crowded)
        async with (
            await asyncio.start_server(streams.serve, "127.0.0.1", 0) as server,
            asyncio.timeout(60.0),
        ):
            port = server.sockets[0].getsockname()[1]
            for request in [b""] * 50 + [join_crowd] * 50:
                await listen(port, request)
            reader = await listen(port, struct.pack("<I", lonely))
            while not streams.is_heard(lonely):
                await asyncio.sleep(0.01)
            for _ in range(50):
                await listen(port, join_crowd)
            streams.send(lonely, b"picture")
            assert await reader.readexactly(11) == struct.pack("<I", 7) + b"picture"
            for writer in writers:
                writer.close()

    asyncio.run(connect())
