"""Starts the server and stops it in an orderly way, in this process or as a worker."""

import asyncio
import signal
from collections.abc import Callable, Sequence
from pathlib import Path

from overtaking.core.errors import ConfigError
from overtaking.core.worker_process import ParentConnection
from overtaking.simulators.carla_server.maps import Atlas, Map, known_map
from overtaking.simulators.carla_server.server import serve
from overtaking.simulators.carla_server.survey import survey

LOOPBACK = "127.0.0.1"
PORT = 2000
"""The port that CARLA's clients try first."""

_MAX_FILE_BYTES = 256 << 20


def run_server(
    *,
    port: int = PORT,
    host: str = LOOPBACK,
    maps: Sequence[str | Path] = ("town06",),
    seed: int = 1,
    ready: Callable[[int, int], None],
    log: Callable[[str], None],
) -> None:
    """Serve CARLA's clients until the process is interrupted or asked to end.

    Args:
        port: For calls, 0 to 65535; streams get the next one. 0 lets the system choose both.
        host: Address to listen on; every program that can reach it can use the server.
        maps: Each one of `knowledge.roads.ROAD_NAMES`, or an OpenDRIVE file, which clients load by
            its name without the suffix. The first is loaded at the start.
        seed: Seed of gusts and puddles, 0 <= seed < 2**64.
        ready: Called with both ports when clients may come.
        log: Called with a line when something happens that a person may want to know.

    Raises:
        ConfigError: An argument cannot be used, or the port is taken.
        MissingExtraError: A map is a file, and CARLA's wheel is not there to read it.
    """
    if not 0 <= seed < 2**64:
        raise ConfigError.out_of_range(
            what="seed", where="run_server", low=0, high="2**64 - 1", got=seed
        )
    atlas = Atlas(_maps(maps), survey)

    async def until_told() -> None:
        loop, told = asyncio.get_running_loop(), asyncio.Event()
        for each in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(each, told.set)
        serving = asyncio.create_task(
            serve(atlas, host=host, port=port, seed=seed, ready=ready, log=log)
        )
        waiting = asyncio.create_task(told.wait())
        await asyncio.wait((serving, waiting), return_when=asyncio.FIRST_COMPLETED)
        if serving.done():
            serving.result()  # It only ends by an error.
        serving.cancel()
        waiting.cancel()
        await asyncio.gather(serving, waiting, return_exceptions=True)

    asyncio.run(until_told())


def _maps(maps: Sequence[str | Path]) -> list[Map]:
    """The maps, each with a name of its own."""
    found = [_map(one) for one in maps]
    names = [one.name for one in found]
    if not names or len(set(names)) < len(names):
        raise ConfigError(
            what="maps",
            where="run_server",
            expected="one or more, each with a name of its own",
            got=", ".join(names) or "none",
            next_step="name each map once; rename a file that has the name of another map",
        )
    return found


def _map(name: str | Path) -> Map:
    """A map by the name of a road, or from a file."""
    path = Path(name)
    if not path.suffix and not path.is_file():
        return known_map(str(name))
    if (size := path.stat().st_size) > _MAX_FILE_BYTES:
        raise ConfigError(
            what="map",
            where=str(path),
            expected=f"at most {_MAX_FILE_BYTES >> 20} MB",
            got=f"{size >> 20} MB",
            next_step="cut the map to what is needed",
        )
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ConfigError(
            what="map",
            where=str(path),
            expected="an OpenDRIVE file in UTF-8",
            got="other bytes",
            next_step="choose an OpenDRIVE file",
        ) from None
    return survey(path.stem, text)


def main(parent: ParentConnection) -> None:
    """Serve until the parent ends this process."""
    run_server(port=0, ready=lambda port, _: parent.send(port), log=lambda _: None)
