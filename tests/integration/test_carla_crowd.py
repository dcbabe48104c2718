"""Clients that take no answers, say nothing or are too many."""

from __future__ import annotations

import asyncio
import socket
import struct
import threading
from contextlib import ExitStack, suppress

import numpy as np
import pytest
from tests.support.carla import (
    PATIENCE,
    answer_of,
    ask,
    headless_server,
    memory_kb,
    needs_wheel,
    stopped_by_signals,
)

from overtaking.simulators.carla_server import server as serving
from overtaking.simulators.carla_server.arguments import Description, Rotation, Transform, Vector
from overtaking.simulators.carla_server.camera import RoadScene
from overtaking.simulators.carla_server.connections import MAX_CONNECTIONS
from overtaking.simulators.carla_server.maps import Atlas, known_map
from overtaking.simulators.carla_server.streams import Streams
from overtaking.simulators.carla_server.survey import survey
from overtaking.simulators.carla_server.wire import Decoder, encode
from overtaking.simulators.carla_server.world import World

pytestmark = [
    needs_wheel,
    stopped_by_signals,
]

VERSION_CALL = encode([0, 1, "version", [[False]]])
VERSION = [1, 1, None, [[1, "0.9.16"]]]


@pytest.mark.ci
def test_answers_are_produced_no_faster_than_they_are_taken():
    road = known_map("town06").opendrive
    big = road.replace("</OpenDRIVE>", f"<!--{'x' * 3_000_000}--></OpenDRIVE>")
    questions = 100
    with headless_server() as server:
        answer_of(server.port, "copy_opendrive_to_file", [[False], big, None])
        answer_of(server.port, "load_new_episode", [[False], "OpenDriveMap", True, 0])
        before = memory_kb(server.process)
        with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as plug:
            asked = encode([0, 1, "get_map_data", [[False]]])
            plug.sendall(asked * questions)
            for _ in range(20):
                assert answer_of(server.port, "version", [[False]]) == VERSION
            assert memory_kb(server.process) < before + 50_000  # All of it would be 300 MB.
            decoder, taken = Decoder(), 0
            while taken < questions:
                taken += len(decoder.feed(plug.recv(1 << 20)))
        assert answer_of(server.port, "version", [[False]]) == VERSION
        assert memory_kb(server.process) < before + 50_000


def test_silent_connections_do_not_lock_a_client_out():
    with headless_server() as server, ExitStack() as stack:
        silent = [stack.enter_context(_plug(server.port)) for _ in range(2 * MAX_CONNECTIONS)]
        found = ask(server, "world.wait_for_tick(); print(json.dumps(True))")
        assert found
        assert silent[0].recv(1) == b""  # The longest silent gave way.


def test_a_client_that_called_stays_and_silent_ones_give_way():
    with headless_server() as server, ExitStack() as stack:
        plug = stack.enter_context(_plug(server.port))
        plug.sendall(VERSION_CALL)
        assert Decoder().feed(plug.recv(1 << 10)) == [VERSION]
        for _ in range(2 * MAX_CONNECTIONS):
            stack.enter_context(_plug(server.port))
        assert answer_of(server.port, "version", [[False]]) == VERSION
        plug.sendall(VERSION_CALL)
        assert Decoder().feed(plug.recv(1 << 10)) == [VERSION]


@pytest.mark.ci
@pytest.mark.parametrize("num_calls", [1, 3])
@pytest.mark.parametrize("count", [MAX_CONNECTIONS, 4 * MAX_CONNECTIONS])
def test_connections_that_call_and_fall_silent_lock_no_client_out(num_calls: int, count: int):
    with headless_server() as server, ExitStack() as stack:
        for _ in range(count):
            plug, decoder = stack.enter_context(_plug(server.port)), Decoder()
            for _ in range(num_calls):
                plug.sendall(VERSION_CALL)
                while not decoder.feed(plug.recv(1 << 10)):
                    pass
        assert answer_of(server.port, "version", [[False]]) == VERSION
        assert ask(server, "print(json.dumps([world.tick() > 0, world.tick() > 0]))") == [True] * 2


@pytest.mark.ci
def test_a_message_that_does_not_end_is_closed(monkeypatch: pytest.MonkeyPatch):
    """A byte now and then does not extend the deadline; whole messages do."""
    monkeypatch.setattr(serving, "MESSAGE_TIMEOUT", 0.5)
    log: list[str] = []
    world = World(Atlas([known_map("town06")], survey), Streams(log.append), 1)

    async def send_slowly() -> None:
        server = serving.Server(world, log.append)
        async with await asyncio.start_server(server.serve_calls, "127.0.0.1", 0) as listening:
            port = listening.sockets[0].getsockname()[1]
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(VERSION_CALL)
            async with asyncio.timeout(PATIENCE):
                assert Decoder().feed(await reader.read(1 << 10)) == [VERSION]
                await asyncio.sleep(1.0)
                writer.write(VERSION_CALL)  # A client may be silent between its calls.
                assert Decoder().feed(await reader.read(1 << 10)) == [VERSION]
                writer.write(b"\xdb\x00\x00\xff\xff")  # Head of a text.
                with suppress(ConnectionError):
                    while not reader.at_eof():
                        writer.write(b"x")
                        with suppress(TimeoutError):
                            await asyncio.wait_for(reader.read(1), 0.05)
            writer.close()

    asyncio.run(send_slowly())
    (line,) = log
    assert "did not complete a message" in line


@pytest.mark.ci
def test_cameras_do_not_delay_other_calls(monkeypatch: pytest.MonkeyPatch):
    """The thread that draws stands still here; calls and ticks of real time go on."""
    release = threading.Event()
    monkeypatch.setattr(RoadScene, "draw", lambda *_: release.wait(PATIENCE) and np.zeros(4))
    streams = Streams(print)
    world = World(Atlas([known_map("town06")], survey), streams, 1)
    lens = Description(1, "sensor.camera.rgb", ())
    camera = world.spawn(lens, Transform(Vector(300.0, 244.0, 2.0), Rotation(0.0, 0.0, 0.0)))

    async def listen_and_call() -> None:
        server = serving.Server(world, print)
        async with (
            await asyncio.start_server(server.serve_calls, "127.0.0.1", 0) as calls,
            await asyncio.start_server(streams.serve, "127.0.0.1", 0) as pushes,
            asyncio.timeout(PATIENCE),
        ):
            port = pushes.sockets[0].getsockname()[1]
            pictures, listener = await asyncio.open_connection("127.0.0.1", port)
            listener.write(struct.pack("<I", camera.stream))
            while not streams.is_heard(camera.stream or 0):
                await asyncio.sleep(0.01)
            for _ in range(3):
                world.tick()
            port = calls.sockets[0].getsockname()[1]
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(VERSION_CALL)
            assert Decoder().feed(await reader.read(1 << 10)) == [VERSION]
            assert world.frame == 3
            release.set()
            await world.pictures.wait()
            (length,) = struct.unpack("<I", await pictures.readexactly(4))
            frame = struct.unpack_from("<QQ", await pictures.readexactly(length))[1]
            assert frame == 1  # The next two were left out.
            writer.close()
            listener.close()
        world.pictures.close()

    asyncio.run(listen_and_call())


def _plug(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
