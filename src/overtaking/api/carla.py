"""CARLA: serve its clients without it, measure its limits, replay simulations in it."""

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
    """Measure the limits of CARLA's Traffic Manager that the study met.

    Raises:
        MissingExtraError: CARLA's client is not installed.
        ConfigError: The server that `OVERTAKING_CARLA` names is not there or of another version.
        SimulationLostError: Client or server failed several times.
    """
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
    """Play recorded simulations in CARLA pose by pose, and film them from behind and from above.

    Args:
        dataset: The data set, or its folder; omitted frames are simulated again.
        out: Folder for the films; made if missing. Each appears when it is complete.
        simulation_ids: Numbers of the simulations.
        size: Width and height of the pictures, even numbers [pixels].
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        The films of each simulation.

    Raises:
        ConfigError: There is no such simulation or size, or the server that `OVERTAKING_CARLA`
            names is not there or of another version.
        MissingExtraError: CARLA's client or the encoder of films is not installed.
        SimulationLostError: Client or server failed several times.
    """
    from overtaking.recordings.opendrive_writer import write_opendrive
    from overtaking.simulators.carla import processes, replay

    source = load_dataset(dataset)
    folder, numbers = Path(out), list(simulation_ids)
    replay.check_size(size)
    films: list[Replayed] = []
    for number in numbers:
        run = source.trajectory(number)
        job = replay.ReplayJob(
            run=run,
            folder=folder.resolve(),
            name=f"{number:06d}",
            size=size,
            opendrive=None if replay.map_of(run) else write_opendrive(run.road),
        )
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
    """Answer clients of CARLA 0.9.16 without CARLA, until the process is interrupted.

    Args:
        port: For calls; streams get the next one. 0 lets the system choose both.
        host: Address to listen on; every program that can reach it can use the server.
        maps: Each a road of the package, or an OpenDRIVE file, which clients load by its name
            without the suffix. The first is there from the beginning.
        seed: Seed of gusts and puddles, 0 <= seed < 2**64.
        ready: Called with the ports of calls and streams when clients may come.
        log: Called with a line when something happens that a person may want to know.

    Raises:
        ConfigError: An argument cannot be used, or the port is taken.
        MissingExtraError: A map is a file, and CARLA's wheel is not there to read it.
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
    """Report nothing."""
