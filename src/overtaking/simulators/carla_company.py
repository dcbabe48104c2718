"""Server and worker processes: started when needed, watched, and ended with this process."""

import atexit
import contextlib
import dataclasses
import json
import queue
import socket
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from overtaking.core.errors import ConfigError, OvertakingError
from overtaking.core.messages import receive, send
from overtaking.model.batch import Batch, concatenate
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import NO_VEHICLE, States, Trajectories
from overtaking.sim.version import MODEL_VERSION
from overtaking.simulators.carla_library import (
    HEADLESS,
    VERSION,
    Address,
    chosen_server,
    library,
    parse_address,
)
from overtaking.simulators.carla_limits import Limits
from overtaking.simulators.carla_messages import (
    LOADING,
    Alive,
    Job,
    LimitsJob,
    Request,
    Result,
    lost,
)
from overtaking.simulators.carla_ports import free_port
from overtaking.simulators.carla_replay import Replayed, ReplayJob, encoder
from overtaking.simulators.carla_stage import SimulationLostError

ATTEMPTS = 3
"""How often a simulation is tried before it is given up."""

_START_TIME = 30.0
_GLANCE = 2.0  # Between two looks at whether the server is still there [s].
_ADAPTER = "1"
"""Changes whenever this package asks CARLA for something else."""


def version(driver: str) -> str:
    """What identifies the results: who drives, which client, and which server."""
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
    library()  # What is missing is said before any work.
    done: list[Trajectories] = []
    missing: list[tuple[int, str]] = []
    for row in range(scenario.num_simulations):
        one = scenario.select(slice(row, row + 1))
        try:
            job = Job(driver, one, (free_port(), free_port()))
            done.append(_simulated(_with_patience(job, keep=driver == "own")))
        except SimulationLostError as error:
            missing.append((int(scenario.index[row]), str(error)))
    if missing:
        numbers = ", ".join(str(number) for number, _ in missing)
        raise SimulationLostError.of(
            what=f"simulations {numbers}",
            where=f"CARLA server {chosen_server()}",
            expected=f"a result within {ATTEMPTS} attempts each",
            got=missing[0][1],
            next_step="look at the server, then go on with --resume",
        )
    return joined(done, scenario)


def limits() -> Limits:
    """Measure the limits of the Traffic Manager; errors as in `simulate`."""
    library()
    found = _with_patience(LimitsJob(free_port()), keep=False)
    assert isinstance(found, Limits)
    return found


def replay(job: ReplayJob) -> Replayed:
    """Play and film a recorded simulation; errors as in `simulate`."""
    library()
    encoder()
    found = _with_patience(job, keep=True)
    assert isinstance(found, Replayed)
    return found


def _simulated(found: Result) -> Trajectories:
    assert isinstance(found, Trajectories)
    return found


def _with_patience(job: Request, *, keep: bool) -> Result:
    """One result, asked for again of a new worker where it is lost.

    Args:
        job: What is asked for.
        keep: Whether the worker may be used again: a Traffic Manager that was shut down leaves some
            of its state in the client.
    """
    for attempt in range(1, ATTEMPTS + 1):
        try:
            return _company().run(job)
        except SimulationLostError:
            dismiss()
            if attempt == ATTEMPTS:
                raise
        except ConfigError as error:
            if attempt == 1:
                raise
            raise lost(job, str(error)) from None  # It was there before.
        finally:
            if not keep:
                _dismiss_worker()
    raise AssertionError("unreachable")


def joined(parts: list[Trajectories], scenario: Scenario) -> Trajectories:
    """Simulations of different lengths as one batch, padded with zeros.

    Args:
        parts: Batches of one.
        scenario: What was asked for; road and bodies are those that CARLA had.
    """
    longest = max(int(part.num_frames[0]) for part in parts)
    padded = [_padded(part, longest) for part in parts]
    vehicles = concatenate([part.scenario.vehicles for part in parts])
    whole = scenario.replace(vehicles=vehicles, road=parts[0].scenario.road)
    every = [part.replace(scenario=parts[0].scenario) for part in padded]
    fields = {
        field.name: _joined([getattr(part, field.name) for part in every])
        for field in dataclasses.fields(Trajectories)
        if field.name not in ("scenario", "unknown", "present")
    }
    return Trajectories(scenario=whole, unknown=parts[0].unknown, **fields)


def _joined(values: list[Any]) -> Any:
    return concatenate(values) if isinstance(values[0], Batch) else np.concatenate(values)


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


# --- processes ---


@dataclass(slots=True)
class Worker:
    """A process with CARLA's client in it.

    Attributes:
        process: The process.
        address: The server that its client talks to.
        answers: What it has said, filled by a thread of its own.
        errors: What it has printed.
        listener: The thread that hears the answers.
    """

    process: "subprocess.Popen[bytes]"
    address: Address
    answers: "queue.Queue[Any]"
    errors: IO[bytes]
    listener: threading.Thread

    @classmethod
    def start(cls, address: Address) -> "Worker":
        """Start one for a server."""
        command = [sys.executable, "-P", "-m", "overtaking.simulators.carla_worker"]
        errors = tempfile.TemporaryFile()  # noqa: SIM115 - it goes with the worker.
        process = subprocess.Popen(
            [*command, address.host, str(address.port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
        )
        answers: queue.Queue[Any] = queue.Queue()
        listener = threading.Thread(target=_listen, args=(process, answers), daemon=True)
        listener.start()
        return cls(process, address, answers, errors, listener)

    def run(self, job: Request) -> Result:
        """One result; `SimulationLostError` if the worker dies or falls silent."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):  # Its end is heard below.
            send(self.process.stdin, job)
        patience = LOADING
        while True:
            answer = self._next_answer(job, patience)
            if isinstance(answer, Trajectories | Limits | Replayed):
                return answer
            if isinstance(answer, OvertakingError):
                raise answer
            if isinstance(answer, Alive):
                patience = answer.patience
            else:
                raise lost(job, self._last_words())

    def _next_answer(self, job: Request, patience: float) -> Any:
        """What it says next; meanwhile the server is looked after, which the client does not do."""
        begin = time.monotonic()
        while (waited := time.monotonic() - begin) < patience:
            try:
                return self.answers.get(timeout=min(_GLANCE, patience - waited))
            except queue.Empty:
                if not _listens(self.address):
                    raise lost(job, "nobody listens there any more") from None
        raise lost(job, f"no sign of life for {patience:g} s")

    def end(self) -> None:
        """End the process."""
        _end(self.process)
        self.listener.join()
        for stream in (self.process.stdin, self.process.stdout, self.errors):
            if stream is not None:
                with contextlib.suppress(OSError):  # A job that nobody reads any more.
                    stream.close()

    def _last_words(self) -> str:
        """How it ended, and what it said last."""
        status = self.process.wait()
        self.errors.seek(0)
        lines = self.errors.read().decode(errors="replace").strip().split("\n")
        return f"the client ended with status {status}: {lines[-1]}"


def _listens(address: Address) -> bool:
    """Whether somebody takes connections there."""
    try:
        with socket.create_connection((address.host, address.port), timeout=_GLANCE):
            return True
    except TimeoutError:
        return True  # Too busy is not gone.
    except OSError:
        return False


def _listen(process: "subprocess.Popen[bytes]", answers: "queue.Queue[Any]") -> None:
    """Hear what a worker says until it says no more."""
    assert process.stdout is not None
    try:
        while True:
            answers.put(receive(process.stdout))
    except (EOFError, OSError):
        answers.put(None)


def _end(process: "subprocess.Popen[Any]") -> None:
    process.kill()
    process.wait()


_WORKERS: dict[str, Worker] = {}
_SERVERS: dict[str, "subprocess.Popen[str]"] = {}
_ADDRESSES: dict[str, Address] = {}


def workers() -> list[int]:
    """Process ids of the clients that run now."""
    return [worker.process.pid for worker in _WORKERS.values()]


def servers() -> list[int]:
    """Process ids of the headless servers that run now."""
    return [server.pid for server in _SERVERS.values() if server.poll() is None]


def _company() -> Worker:
    """The worker for the chosen server; both are started if need be."""
    chosen = chosen_server()
    worker = _WORKERS.get(chosen)
    if worker is None or worker.process.poll() is not None:
        worker = _WORKERS[chosen] = Worker.start(_address(chosen))
    return worker


def _address(chosen: str) -> Address:
    """Where the chosen server is."""
    if chosen != HEADLESS:
        return parse_address(chosen)
    running = _SERVERS.get(chosen)
    if running is None or running.poll() is not None:
        _ADDRESSES[chosen] = _start_headless()
    return _ADDRESSES[chosen]


def _start_headless() -> Address:
    """Start a server of our own on free ports."""
    command = [sys.executable, "-P", "-m", "overtaking.carla_server.child"]
    # It ends with its standard input, so also when this process is killed.
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    _SERVERS[HEADLESS] = process
    said: list[str] = []
    reader = threading.Thread(target=_read_ready, args=(process, said), daemon=True)
    reader.start()
    reader.join(_START_TIME)
    try:
        return Address("127.0.0.1", int(json.loads("".join(said))["port"]))
    except ValueError:
        _end_server(process)
        raise SimulationLostError.of(
            what="headless server",
            where="this machine",
            expected=f"to be ready within {_START_TIME:g} s",
            got="".join(said) or "nothing",
            next_step="try overtaking carla serve by hand",
        ) from None


def _read_ready(process: "subprocess.Popen[str]", said: list[str]) -> None:
    """Collect what a server says until it is ready."""
    assert process.stdout is not None
    for line in process.stdout:
        said.append(line)
        return  # The first line says all.


def _dismiss_worker() -> None:
    worker = _WORKERS.pop(chosen_server(), None)
    if worker is not None:
        worker.end()


def dismiss() -> None:
    """End worker and server of our own; whatever was wrong with them is gone."""
    _dismiss_worker()
    server = _SERVERS.pop(chosen_server(), None)
    if server is not None:
        _end_server(server)


@atexit.register
def _go() -> None:
    for worker in _WORKERS.values():
        worker.end()
    for server in _SERVERS.values():
        _end_server(server)


def _end_server(server: "subprocess.Popen[str]") -> None:
    _end(server)
    for stream in (server.stdin, server.stdout):
        if stream is not None:
            stream.close()
