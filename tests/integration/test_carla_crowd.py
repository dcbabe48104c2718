"""Clients that take no answers, say nothing or are too many."""

from __future__ import annotations

import socket
from contextlib import ExitStack

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

from overtaking.simulators.carla_server.connections import MAX_CONNECTIONS
from overtaking.simulators.carla_server.maps import known_map
from overtaking.simulators.carla_server.wire import Decoder, encode

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


def _plug(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
