"""Calls whose answers the genuine client throws away."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Any

from overtaking.simulators.carla_server.maps import Atlas, known_map
from overtaking.simulators.carla_server.server import MAX_TOLD, Server
from overtaking.simulators.carla_server.streams import Streams
from overtaking.simulators.carla_server.survey import survey
from overtaking.simulators.carla_server.wire import Decoder, encode
from overtaking.simulators.carla_server.world import World

CAR = [1, "vehicle.audi.a2", []]
POSE = [[300.0, 244.65, 0.3], [0.0, 0.0, 0.0]]


def told(*calls: tuple[str, list[Any]], clients: int = 1) -> tuple[list[str], list[Any]]:
    """What the server says, and what it answers to the last client, when clients make calls."""
    log: list[str] = []
    world = World(Atlas([known_map("town06")], survey), Streams(log.append), 1)
    server = Server(world, log.append)
    answers: list[Any] = []

    async def all_of_them() -> None:
        async with await asyncio.start_server(server.serve_calls, "127.0.0.1", 0) as listening:
            port = listening.sockets[0].getsockname()[1]
            for _ in range(clients):
                answers[:] = await _answers(port, calls)

    asyncio.run(all_of_them())
    return log, answers


async def _answers(port: int, calls: tuple[tuple[str, list[Any]], ...]) -> list[Any]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    decoder, found = Decoder(), []
    for number, (name, parameters) in enumerate(calls):
        writer.write(encode([0, number, name, parameters]))
    async with asyncio.timeout(60.0):
        while len(found) < len(calls):
            found += decoder.feed(await reader.read(1 << 16))
    writer.close()
    with suppress(ConnectionError):
        await writer.wait_closed()
    return [answer[3] for answer in found]


def test_a_call_that_is_not_offered_is_told_once_for_each_client():
    call = ("open_vehicle_door", [[True], 21, 0])
    log, _ = told(call, call, call, clients=2)
    assert len(log) == 2
    for line in log:
        assert line.endswith(
            "may not see that a call had no effect:"
            " open_vehicle_door: the headless server does not offer this call"
        )


def test_what_a_client_waits_for_is_its_own_answer_and_not_told():
    log, answers = told(("get_actor_bone_names", [[False], 21]), ("load_map_layer", [[False], 1]))
    assert log == []
    assert answers == [
        [[0, ["get_actor_bone_names: the headless server does not offer this call"]]],
        [[True, ["load_map_layer: the headless server does not offer this call"]]],
    ]


def test_an_actor_that_is_gone_is_told_where_the_client_does_not_wait():
    log, _ = told(("set_actor_location", [[True], 99, [0.0, 0.0, 0.0]]))
    (line,) = log
    assert "set_actor_location: there is no actor 99" in line


def test_one_command_that_is_not_offered_leaves_the_others_of_its_batch():
    walk, lamps = [[4, [21, [[1.0, 0.0, 0.0], 1.0, False]]]], [[18, [22, 3]]]
    spawn = [[0, [CAR, POSE, [False], 0, "", [walk, lamps]]]]
    log, answers = told(
        ("apply_batch", [[False], [spawn, walk], False]),
        ("get_vehicle_light_state", [[False], 22]),
    )
    refused = "the headless server does not offer the command ApplyWalkerControl"
    assert answers == [[[[1, 22]], [[0, [refused]]]], [[1, [3]]]]
    (line,) = log  # What comes behind a spawn has no answer of its own.
    assert line.endswith(f"apply_batch: {refused}")


def test_a_spawn_that_a_batch_refuses_is_logged():
    walker = [[0, [[1, "walker.pedestrian.0001", []], POSE, [False], 0, "", []]]]
    log, answers = told(("apply_batch", [[False], [walker], False]))
    assert answers == [[[[0, ["this headless server has no walkers"]]]]]
    (line,) = log
    assert line.endswith("apply_batch: this headless server has no walkers")


def test_nobody_fills_the_log():
    calls = [(f"call_{k}" + 1000 * "x", [[True]]) for k in range(10 * MAX_TOLD)]
    log, _ = told(*calls)
    assert len(log) == MAX_TOLD
    assert max(map(len, log)) < 400
