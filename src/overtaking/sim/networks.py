"""Drivers in ONNX files, each of which is evaluated in a process of its own."""

import hashlib
import time
import weakref
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError, DriverError, OvertakingError, check_extra
from overtaking.core.worker_process import WORKER_ENDED, WorkerProcess
from overtaking.model.driver_interface import OBSERVATION_SIZE, PASSING_COLUMNS
from overtaking.sim.observation import Observation

MAX_BYTES = 1 << 28
"""Largest file that is read."""

MEMORY_MIB = 2048
"""Memory of the process beyond ONNX Runtime itself [MiB], which Linux enforces."""

TIMEOUT_S = 60.0
"""Longest time to load and check a network, and longest time of one decision [s]."""

READY = "ready"
"""First message of the process: ONNX Runtime is imported, the time limit begins."""

_MODULE = "overtaking.sim.network_process"
_START_TIMEOUT_S = 120.0
"""Longest time to start Python and import ONNX Runtime on a busy machine [s]."""


class OnnxDriver:
    """A driver in an ONNX file: from float32 numbers to an action.

    The input is `Observation.table`, of shape (simulation, `OBSERVATION_SIZE`): the columns of the
    ego, of each neighbour, and of a pass. It may leave out the pass. The first output has
    shape (simulation, part).

    A child process loads the network, checks it with zeros, and evaluates it at each decision. A
    network that passes the check may still crash or exhaust memory with other inputs, so this
    process never evaluates it. The child starts again at the next decision after a failure.

    Attributes:
        digest: SHA-256 of the file.
        num_parts: Number of parts of an action; an output of shape (simulation,) has one.

    Args:
        path: The file.

    Raises:
        ConfigError: The file cannot be read, or is no network with this input and output.
        MissingExtraError: The extra `onnx` is not installed.
    """

    def __init__(self, path: Path) -> None:
        """Read the file, then load and check it in the child process."""
        what = "onnxruntime, which runs networks"
        check_extra("onnx", "onnxruntime", what=what, where=str(path))
        self._path = path
        self._content = _read_file(path)
        self.digest = hashlib.sha256(self._content).hexdigest()
        self._lock = Lock()  # Two threads would mix up their answers on the pipes.
        self._worker: WorkerProcess | None = None
        with self._lock:
            self._width, self.num_parts = self._start(ConfigError)

    def __call__(self, observation: Observation) -> NDArray[np.floating]:
        """The action of each simulation.

        Raises:
            DriverError: The network fails, or exceeds its time or memory.
        """
        with self._lock:
            if self._worker is None:
                self._start(DriverError)
            return self._request(observation.table[:, : self._width], DriverError)

    def _start(self, error: type[OvertakingError]) -> tuple[int, int]:
        """Start the process; return the width of the input and the number of parts."""
        self._worker = WorkerProcess(_MODULE)
        weakref.finalize(self, self._worker.close)
        limits = {
            "memory_mib": MEMORY_MIB,
            "widths": (OBSERVATION_SIZE, OBSERVATION_SIZE - len(PASSING_COLUMNS)),
        }
        self._request(limits, error, timeout_s=_START_TIMEOUT_S)
        return self._request(self._content, error)

    def _request(
        self, message: object, error: type[OvertakingError], timeout_s: float | None = None
    ) -> Any:
        """Send a message to the process and return its answer."""
        assert self._worker is not None
        limit = TIMEOUT_S if timeout_s is None else timeout_s
        try:
            self._worker.send(message)
            answer = _receive(self._worker, limit)
        except _NetworkError as failure:
            self._close()
            raise _driver_file_error(self._path, failure.expected, failure.got, error) from None
        except BaseException:
            # After Ctrl-C, the late answer must not be read as the answer to the next decision.
            self._close()
            raise
        return answer

    def _close(self) -> None:
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.close()


class _NetworkError(Exception):
    """A network that failed in its process."""

    def __init__(self, expected: str, got: str) -> None:
        super().__init__(expected, got)
        self.expected, self.got = expected, got


def _receive(worker: WorkerProcess, timeout_s: float) -> Any:
    """The next answer.

    Raises:
        _NetworkError: The process reports an error, ends, or takes too long.
    """
    begin = time.monotonic()
    try:
        answer = worker.receive(timeout_s)
    except TimeoutError:
        elapsed = time.monotonic() - begin
        raise _NetworkError(
            f"an answer within {timeout_s:g} s", f"none after {elapsed:.0f} s"
        ) from None
    if answer is WORKER_ENDED:
        raise _NetworkError(
            f"a process that evaluates it with {MEMORY_MIB} MiB of memory",
            f"one that ended {worker.describe_exit()}",
        )
    if isinstance(answer, dict):
        raise _NetworkError(answer["expected"], answer["got"])
    return answer


def _read_file(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise _driver_file_error(path, "a file that can be read", str(error)) from error
    if len(content) > MAX_BYTES:
        raise _driver_file_error(path, f"at most {MAX_BYTES} bytes", "more")
    return content


def _driver_file_error(
    path: Path, expected: str, got: str, error: type[OvertakingError] = ConfigError
) -> OvertakingError:
    return error(
        what="driver",
        where=str(path),
        expected=expected,
        got=got,
        next_step="export the network anew; docs/how-to/evaluate-a-driver.md says how",
    )
