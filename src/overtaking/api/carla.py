"""Public functions for CARLA, the driving simulator: `overtaking.carla`, and `overtaking carla`.

CARLA consists of a server, which simulates and draws, and a client, a Python library. `serve` runs
a server of this package that speaks CARLA's protocol (the *headless* server): programs written for
CARLA 0.9.16 run on it without CARLA's server. `replay` films simulations of a data set, and
`measure_limits` measures two faults of CARLA's own traffic. `replay` and `measure_limits` use the
client; the environment variable `OVERTAKING_CARLA` names their server as `HOST:PORT`. If the
variable is unset or `headless`, they start a headless server for themselves. On CARLA's server
films are photorealistic; the headless server draws vehicles as boxes.

`check_arguments` raises a `ConfigError` for an argument of another type than its annotation. The
modules that do the work are imported inside the functions, so `import overtaking` stays fast.
"""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.api.datasets import load_dataset
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.simulators.carla.limits import Limits
    from overtaking.simulators.carla.replay import Replayed


def measure_limits() -> "Limits":
    """Measure up to which speed CARLA's Traffic Manager carries out lane changes, and how often.

    The Traffic Manager is the part of CARLA's client that drives vehicles. Above some speed it
    ignores the command to change lanes, and for some time after one lane change it ignores the next
    command. The study that this package reproduces (Pinto, Dutra and Fonseca 2023) met both limits.

    Returns:
        `speeds_kmh`, the speeds that were tried; `trials`, the number of vehicles at each speed;
        `changed`, how many of them obeyed; and `again_after`, the time until a second change is
        obeyed [s], None if it never was.

    Raises:
        MissingExtraError: CARLA's client is not installed.
        ConfigError: The server is missing, or has another version than the client.
        SimulationLostError: Client or server failed, also in two repetitions.
    """
    # `processes` runs CARLA's client in a process of its own, because the client can crash.
    from overtaking.simulators.carla import processes

    return processes.limits()


@check_arguments
def replay(
    dataset: Dataset | str | Path,
    out: str | Path,
    *,
    simulation_ids: Iterable[int],
    size: tuple[int, int] = (800, 450),
    progress: ProgressCallback | None = None,
) -> "list[Replayed]":
    """Show recorded simulations in CARLA; film them from behind the ego and from above it.

    The ego is the vehicle whose overtaking is studied. In each frame every vehicle is put at its
    recorded position; CARLA computes no motion.

    Args:
        dataset: The data set, or its folder or URL. If it keeps no positions
            (`keep="features"`), the simulations are computed again.
        out: Folder for the films; made if missing. Each file appears when it is complete.
        simulation_ids: Numbers of the simulations in the data set, from 0.
        size: Width and height of the pictures [pixels]: even numbers, as the video format
            requires, from 16 x 16 to 1920 x 1080.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        For each simulation `files`, the paths of its two films (behind, above), and `num_frames`.

    Raises:
        ConfigError: No simulation has such a number, the size is not possible, or the server is
            missing or has another version than the client.
        MissingExtraError: CARLA's client or the video encoder (extra `video`) is not installed.
        SimulationLostError: Client or server failed, also in two repetitions.
    """
    from overtaking.recordings.opendrive_writer import write_opendrive

    # `filming` describes the work. `processes` runs it in a process of its own, because CARLA's
    # client can crash.
    from overtaking.simulators.carla import processes
    from overtaking.simulators.carla import replay as filming

    source = load_dataset(dataset)
    folder, numbers = Path(out), list(simulation_ids)
    filming.check_size(size)
    films: list[Replayed] = []
    for number in numbers:
        trajectories = source.trajectory(number)  # A batch of one.
        # CARLA has maps of some roads itself; any other road is sent as an OpenDRIVE file.
        has_carla_map = filming.map_of(trajectories) is not None
        job = filming.ReplayJob(
            run=trajectories,
            folder=folder.resolve(),  # For the other process.
            name=f"{number:06d}",  # The start of both file names; zeros make them sort.
            size=size,
            opendrive=None if has_carla_map else write_opendrive(trajectories.road),
        )
        # Made only now, so that an unknown simulation number leaves no empty folder.
        folder.mkdir(parents=True, exist_ok=True)
        films.append(processes.replay(job))
        if progress is not None:
            progress(len(films), len(numbers))
    return films


@check_arguments
def serve(
    *,
    port: int = 2000,
    host: str = "127.0.0.1",
    maps: Sequence[str | Path] = ("town06",),
    seed: int = 1,
    ready: Callable[[int, int], None] | None = None,
    log: Callable[[str], None] | None = None,
) -> None:
    """Run a headless server for CARLA 0.9.16 clients, until Ctrl-C or SIGTERM.

    Args:
        port: Port for calls, 0 to 65535; 2000 is CARLA's own. The next port is for streams of
            sensor data. 0 lets the system choose both.
        host: Address to listen on. There is no password: every program that can reach the address
            can use the server.
        maps: Maps that clients can load: each the name of a road of the package, or an OpenDRIVE
            file, which clients name without the suffix. The first is loaded at the start; `town06`
            is the road of the reproduced study.
        seed: Seed of the random parts of the weather (gusts and puddles), 0 <= seed < 2**64.
        ready: Called once, when clients can connect, with the port for calls and the port for
            streams.
        log: Called with a line of text about an event that a person may want to know, such as a
            call that the server does not offer.

    Raises:
        ConfigError: An argument cannot be used, or the port is taken.
        MissingExtraError: A map is a file, and CARLA's client, with which the server reads it, is
            not installed.
    """
    from overtaking.simulators.carla_server.running import run_server

    run_server(
        port=port,
        host=host,
        maps=maps,
        seed=seed,
        ready=ready or _ignore,
        log=log or _ignore,
    )


def _ignore(*_: object) -> None:
    """Accept a report and do nothing, for a caller that passed no function."""
