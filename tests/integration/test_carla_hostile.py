"""What no client of CARLA sends: hostile bytes, wrong arguments; and how the server ends."""

from __future__ import annotations

import os
import random
import socket
import struct
from contextlib import ExitStack, suppress

import pytest
from tests.support.carla import (
    PATIENCE,
    Address,
    answer_of,
    headless_server,
    memory_kb,
    needs_wheel,
    stopped_by_signals,
)
from tests.support.processes import listening_addresses

from overtaking.simulators.carla_server.wire import encode

pytestmark = [
    needs_wheel,
    stopped_by_signals,
]


HOSTILE = {
    "an array of four thousand million": b"\xdd\xff\xff\xff\xff",
    "a text of four thousand million": b"\xdb\xff\xff\xff\xff",
    "endless nesting": b"\x91" * 100_000,
    "a map": b"\x81\x01\x02",
    "an extension": b"\xc7\x01\x00\x00",
    "another protocol": b"GET / HTTP/1.1\r\n\r\n",
    "an answer nobody asked for": encode([1, 1, None, None]),
    "a call without its first parameter": encode([0, 1, "version", []]),
    "text that is not UTF-8": b"\x94\x00\x01\xa2\xff\xfe\x90",
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_bytes_that_no_client_sends_end_their_connection_only(server: Address, data: bytes):
    with socket.create_connection(("127.0.0.1", server.port), timeout=5.0) as plug:
        plug.sendall(data)
        with suppress(ConnectionResetError):  # Some of it had not been read.
            assert plug.recv(1) == b""
    assert answer_of(server.port, "version", [[False]]) == [1, 1, None, [[1, "0.9.16"]]]


WRONG = {
    "no such call": ("open_door", [[False]]),
    "an argument too many": ("version", [[False], 1]),
    "a number that is none": ("set_actor_location", [[True], 21, [0.0, float("nan"), 0.0]]),
    "a text for a number": ("set_actor_location", [[True], 21, [0.0, "1.0", 0.0]]),
    "a number for a yes": ("set_actor_simulate_physics", [[True], 21, 1]),
    "pedals without a gear": ("apply_control_to_vehicle", [[True], 21, [0.0] * 3 + [False] * 3]),
    "an optional value that is not there": (
        "set_episode_settings",
        [[False], [True, False, [True], True, 0.01, 10, 0.0, True, 3e3, 2e3, True]],
    ),
    "a tick of an hour": (
        "set_episode_settings",
        [[False], [True, False, [True, 3600.0], True, 0.01, 10, 0.0, True, 3e3, 2e3, True]],
    ),
}


@pytest.mark.parametrize(("name", "parameters"), WRONG.values(), ids=WRONG)
def test_a_call_with_wrong_arguments_is_told_so(server: Address, name: str, parameters: list):
    kind, number, error, result = answer_of(server.port, name, parameters)  # type: ignore[misc]
    assert (kind, number, error) == (1, 1, None)
    ((is_error, (message,)),) = result  # What the client raises as it is; `error` it would hide.
    assert is_error in (0, True)
    assert message.startswith(f"{name}: ")


def test_an_actor_that_is_not_there_is_an_answer_and_no_accident(server: Address):
    answer = answer_of(
        server.port, "apply_control_to_vehicle", [[True], 9999, [0.0] * 3 + [False] * 3 + [0]]
    )
    assert answer == [1, 1, None, [[True, ["there is no actor 9999"]]]]


POSE = [[300.0, 244.0, 0.3], [0.0, 0.0, 0.0]]
PEDALS = [0.5, 0.0, 0.0, False, False, False, 0]
GOOD = (
    encode([0, 1, "spawn_actor", [[False], [1, "vehicle.audi.a2", []], POSE]]),
    encode([0, 2, "apply_batch", [[False], [[[2, [21, PEDALS]]]], False]]),
    encode([0, 3, "get_actors_by_id", [[False], [21, 22, 23]]]),
    encode([0, 4, "set_weather_parameters", [[True], [50.0] * 14]]),
)


@pytest.mark.ci
def test_thousands_of_damaged_messages_leave_the_server_up_and_no_larger(server: Address):
    chance = random.Random(1)
    before = 0
    for count in range(2000):
        data = bytearray(chance.choice(GOOD))
        for _ in range(chance.randrange(1, 4)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        _throw(server.port, bytes(data))
        if count == 500:
            before = memory_kb(server.process)
    assert answer_of(server.port, "version", [[False]]) == [1, 1, None, [[1, "0.9.16"]]]
    assert memory_kb(server.process) < before + 20_000


def _throw(port: int, data: bytes) -> None:
    """Send bytes on a connection of their own, and wait until the server is done with it."""
    with socket.create_connection(("127.0.0.1", port), timeout=5.0) as plug:
        plug.sendall(data)
        plug.shutdown(socket.SHUT_WR)
        with suppress(ConnectionResetError):
            while plug.recv(1 << 16):
                pass


def test_streams_that_are_not_there_are_closed_and_half_a_request_is_waited_for(server: Address):
    with socket.create_connection(("127.0.0.1", server.streams), timeout=5.0) as plug:
        plug.sendall(struct.pack("<I", 999_999))
        assert plug.recv(1) == b""
    half = socket.create_connection(("127.0.0.1", server.streams), timeout=5.0)
    half.sendall(b"\x01")
    assert answer_of(server.port, "version", [[False]]) is not None
    half.close()


def test_the_server_listens_on_loopback_only(server: Address):
    for port in (server.port, server.streams):
        assert listening_addresses(port) == {"127.0.0.1"}


@pytest.mark.ci
def test_it_ends_when_told_to():
    with headless_server() as address:
        pass
    with pytest.raises(ProcessLookupError):
        os.kill(address.process, 0)


@pytest.mark.ci
def test_it_ends_without_a_word_while_clients_are_connected(capfd: pytest.CaptureFixture[str]):
    with ExitStack() as connected, headless_server() as address:
        calls, snapshots = (
            connected.enter_context(socket.create_connection(("127.0.0.1", port), PATIENCE))
            for port in (address.port, address.streams)
        )
        calls.sendall(encode([0, 1, "version", [[False]]]))
        snapshots.sendall(struct.pack("<I", 1))
        assert calls.recv(1)
        assert snapshots.recv(1)
    assert capfd.readouterr().err == ""
