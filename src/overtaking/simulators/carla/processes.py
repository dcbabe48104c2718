"""Requests to CARLA's client, which runs in a worker process, and the retries of lost ones."""

import contextlib
import os
import socket
import time
from functools import partial
from typing import Any

import numpy as np

from overtaking.core.errors import ConfigError, OvertakingError
from overtaking.core.worker_process import WORKER_ENDED, WorkerProcess
from overtaking.model.batch import concatenate
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import NO_VEHICLE, States, Trajectories
from overtaking.sim import MODEL_VERSION
from overtaking.simulators.carla import replay as film
from overtaking.simulators.carla.jobs import LOADING, Alive, Job, drive
from overtaking.simulators.carla.library import (
    HEADLESS,
    VERSION,
    Address,
    chosen_server,
    library,
    parse_address,
)
from overtaking.simulators.carla.limits import Limits, measure
from overtaking.simulators.carla.world import SimulationLostError

ATTEMPTS = 3
"""How often a simulation is tried before it is given up."""

_START_TIME = 180.0
"""Longest time until a headless server is ready [s].

With eight programs for each processor it took more than 30 s. A server that ends is noticed at
once, so a longer time delays no error.
"""

_GLANCE = 2.0  # Time between two checks that the server still listens [s].
_ADAPTER = "1"
"""Changes whenever this package asks CARLA for something else."""


def version(driver: str) -> str:
    """The identity of the results: driver, client and server."""
    kind = HEADLESS if chosen_server() == HEADLESS else "server"
    return f"{_ADAPTER}+{driver}+{MODEL_VERSION}+carla{VERSION}+{kind}"


def simulate(scenario: Scenario, driver: str) -> Trajectories:
    """Simulate a batch, one simulation after the other.

    Args:
        scenario: A batch of scenarios.
        driver: `own` or `traffic-manager`.

    Raises:
        MissingExtraError: CARLA's client is not installed.
        ConfigError: The server is not there, of another version, or has no such map.
        SimulationLostError: Some could not be run; the message names them.
    """
    library()  # A missing package is reported before any work.
    done: list[Trajectories] = []
    missing: list[tuple[int, str]] = []
    for row in range(scenario.num_simulations):
        one = scenario.select(slice(row, row + 1))
        try:
            run = partial(drive, driver=driver, scenario=one, ports=[free_port(), free_port()])
            job = Job(f"simulation {int(scenario.scenario_index[row])}", run)
            done.append(_with_patience(job, keep=driver == "own"))
        except SimulationLostError as error:
            missing.append((int(scenario.scenario_index[row]), str(error)))
    if missing:
        numbers = ", ".join(str(number) for number, _ in missing)
        raise SimulationLostError(
            what=f"simulations {numbers}",
            where=f"CARLA server {chosen_server()}",
            expected=f"a result within {ATTEMPTS} attempts each",
            got=missing[0][1],
            next_step="look at the server, then go on with --resume",
        )
    return joined(done)


def limits() -> Limits:
    """Measure the limits of the Traffic Manager; errors as in `simulate`."""
    library()
    return _with_patience(Job("limits", partial(measure, port=free_port())), keep=False)


def replay(job: film.ReplayJob) -> film.Replayed:
    """Play and film a recorded simulation; errors as in `simulate`."""
    library()
    film.encoder()
    return _with_patience(Job(f"film {job.name}", partial(film.replay, job=job)), keep=True)


def _with_patience(job: Job, *, keep: bool) -> Any:
    """One result, asked for again of a new worker where it is lost.

    Args:
        job: The work.
        keep: Whether the worker may be used again: a Traffic Manager that was shut down leaves some
            of its state in the client.
    """
    for attempt in range(1, ATTEMPTS + 1):
        try:
            return _run(job)
        except SimulationLostError:
            dismiss()
            if attempt == ATTEMPTS:
                raise
        except ConfigError as error:
            if attempt == 1:
                raise
            raise job.lost(str(error)) from None  # It was there before.
        except BaseException:
            dismiss()  # Else its answer would be taken for that of the next job.
            raise
        finally:
            if not keep:
                _close(_WORKERS)
    raise AssertionError("unreachable")


def joined(parts: list[Trajectories]) -> Trajectories:
    """Simulations of different lengths as one batch, padded with zeros.

    Args:
        parts: Batches of one; road and bodies are those that CARLA had.
    """
    longest = max(int(part.num_frames[0]) for part in parts)
    return concatenate([_padded(part, longest) for part in parts])


def _padded(part: Trajectories, frames: int) -> Trajectories:
    """The same simulation with room for more frames."""
    more = frames - part.stage.shape[1]

    def pad(values: Any, fill: int = 0) -> Any:
        widths = [(0, 0)] * (values.ndim - 1) + [(0, more)]
        return np.pad(values, widths, constant_values=fill)

    states = {name: pad(getattr(part.states, name)) for name in States.__slots__}
    return part.replace(
        states=States(**states),
        stage=pad(part.stage),
        collided_with=pad(part.collided_with, int(NO_VEHICLE)),
    )


# --- ports for Traffic Managers, which the client opens and does not share ---

_PORTS = range(8000, 20_000)
_HANDED_OUT: list[int] = []


def free_port() -> int:
    """An unused port, outside the range from which outgoing connections get theirs."""
    start = os.getpid() % len(_PORTS)
    for port in (*_PORTS[start:], *_PORTS[:start]):
        if port in _HANDED_OUT:
            continue
        with contextlib.suppress(OSError), socket.socket() as plug:
            plug.bind(("", port))
            _HANDED_OUT.append(port)
            del _HANDED_OUT[: -len(_PORTS) // 2]
            return port
    raise SimulationLostError(
        what="port for a Traffic Manager",
        where="this machine",
        expected=f"a free one from {_PORTS.start} to {_PORTS.stop - 1}",
        got="none",
        next_step="end what uses them",
    )


# --- processes ---

_WORKERS: dict[str, WorkerProcess] = {}
_SERVERS: dict[str, WorkerProcess] = {}
_ADDRESSES: dict[str, Address] = {}
"""By chosen server: its client, the process of a headless one, and where it listens."""


def workers() -> list[int]:
    """Process ids of the clients that run now."""
    return [worker.pid for worker in _WORKERS.values() if worker.is_running]


def servers() -> list[int]:
    """Process ids of the headless servers that run now."""
    return [server.pid for server in _SERVERS.values() if server.is_running]


def dismiss() -> None:
    """End the client of the chosen server, and the server if it is our own."""
    _close(_WORKERS)
    _close(_SERVERS)


def _close(processes: dict[str, WorkerProcess]) -> None:
    worker = processes.pop(chosen_server(), None)
    if worker is not None:
        worker.close()


def _client() -> tuple[WorkerProcess, Address]:
    """The client of the chosen server, and where the server is; both are started if needed."""
    chosen = chosen_server()
    if chosen not in _WORKERS or not _WORKERS[chosen].is_running:
        _close(_WORKERS)
        address = _ADDRESSES[chosen] = _address(chosen)
        words = address.host, str(address.port)
        _WORKERS[chosen] = WorkerProcess("overtaking.simulators.carla.jobs", *words)
    return _WORKERS[chosen], _ADDRESSES[chosen]


def _address(chosen: str) -> Address:
    """Where the chosen server is."""
    if chosen != HEADLESS:
        return parse_address(chosen)
    if chosen not in _SERVERS or not _SERVERS[chosen].is_running:
        _close(_SERVERS)
        return _start_headless()
    return _ADDRESSES[chosen]


def _start_headless() -> Address:
    """Start a server of our own on free ports."""
    server = _SERVERS[HEADLESS] = WorkerProcess("overtaking.simulators.carla_server.running")
    try:
        port = server.receive(_START_TIME)
    except TimeoutError:
        port = None
    if isinstance(port, int):
        return Address("127.0.0.1", port)
    _close(_SERVERS)
    raise SimulationLostError(
        what="headless server",
        where="this machine",
        expected=f"to be ready within {_START_TIME:g} s",
        got=server.describe_exit(),
        next_step="try overtaking carla serve by hand",
    )


def _run(job: Job) -> Any:
    """The result of one job.

    Raises:
        ConfigError: The server is not there, of another version, or has no such map.
        SimulationLostError: The client or the server ended, or fell silent.
    """
    worker, address = _client()
    worker.send(job)
    patience = LOADING
    while True:
        answer = _next_answer(worker, address, job, patience)
        if answer is WORKER_ENDED:
            raise job.lost(f"the client ended {worker.describe_exit()}")
        if isinstance(answer, OvertakingError):
            raise answer
        if not isinstance(answer, Alive):
            return answer
        patience = answer.patience


def _next_answer(worker: WorkerProcess, address: Address, job: Job, patience: float) -> Any:
    """The next message of a client, which does not notice a server that has ended."""
    end = time.monotonic() + patience
    while (left := end - time.monotonic()) > 0:
        try:
            return worker.receive(min(_GLANCE, left))
        except TimeoutError:
            if not _listens(address):
                raise job.lost("nobody listens there any more") from None
    raise job.lost(f"no sign of life for {patience:g} s")


def _listens(address: Address) -> bool:
    """Whether a server accepts connections."""
    try:
        with socket.create_connection((address.host, address.port), timeout=_GLANCE):
            return True
    except TimeoutError:
        return True  # It is busy.
    except OSError:
        return False
