"""When snapshots are sent around the loading of an episode."""

from __future__ import annotations

import asyncio
import math
from contextlib import suppress
from time import monotonic
from typing import TYPE_CHECKING, Any

from overtaking.simulators.carla_server import server as module
from overtaking.simulators.carla_server.maps import Atlas, known_map
from overtaking.simulators.carla_server.streams import Streams
from overtaking.simulators.carla_server.survey import survey
from overtaking.simulators.carla_server.wire import Decoder, encode
from overtaking.simulators.carla_server.world import World

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    import pytest

LOAD = ("load_new_episode", [[False], "", True, 65535])
ASK = ("get_episode_info", [[False]])
Call = tuple[str, list[Any]]


class Clock(World):
    """A world that notes when it ticked."""

    last_tick = -math.inf

    def tick(self, *, pace: float = 0.0) -> None:
        super().tick(pace=pace)
        self.last_tick = monotonic()


def tried(script: Callable[[World, Callable[[Call], Awaitable[None]]], Awaitable[Any]]) -> Any:
    """What a script finds that runs while free time passes; it gets the world and makes calls."""
    world = Clock(Atlas([known_map("town06")], survey), Streams(print), 1)
    server = module.Server(world, print)

    async def run() -> Any:
        passing = asyncio.create_task(server.run_free())
        async with await asyncio.start_server(server.serve_calls, "127.0.0.1", 0) as listening:
            port = listening.sockets[0].getsockname()[1]
            reader, writer = await asyncio.open_connection("127.0.0.1", port)

            async def make(call: Call) -> None:
                writer.write(encode([0, 1, *call]))
                while not Decoder().feed(await reader.read(1 << 16)):
                    pass

            async with asyncio.timeout(60.0):
                await ticks(world, 1)
                found = await script(world, make)
            writer.close()
            passing.cancel()
        with suppress(asyncio.CancelledError):
            await passing
        return found

    return asyncio.run(run())


async def ticks(world: World, count: int) -> None:
    """Wait for so many ticks."""
    frame = world.frame + count
    while world.frame < frame:
        await asyncio.sleep(0.01)


def test_no_snapshot_is_near_the_answer_to_a_load(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "SETTLING_TIME", math.inf)
    monkeypatch.setattr(module, "LOADING_TIME", 0.3)

    async def script(world: Clock, make: Callable[[Call], Awaitable[None]]) -> list[float]:
        await make(LOAD)
        quiet, frame = monotonic() - world.last_tick, world.frame
        await asyncio.sleep(0.3)
        ticked = world.frame - frame
        await make(ASK)
        await ticks(world, 2)
        return [quiet, ticked]

    quiet, ticked = tried(script)
    assert quiet >= 0.3
    assert ticked == 0


def test_time_goes_on_where_a_client_does_not_ask_for_the_new_episode():
    async def script(world: Clock, make: Callable[[Call], Awaitable[None]]) -> bool:
        await make(LOAD)
        await ticks(world, 2)
        return True

    assert tried(script)
