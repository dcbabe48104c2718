"""Processes of a Ray cluster, on this machine or on many, that make one shard after the other.

A worker gets a job and a task, and puts the files of one shard where all workers see them.
It has no state: one that dies is replaced, and its shard is made again from the beginning.
"""

import os
import signal
import socket
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from typing import Any

from overtaking.core.errors import ConfigError, DatasetError, MissingExtraError, OvertakingError
from overtaking.data.location import Location
from overtaking.data.manifest import ShardRecord
from overtaking.data.work import HasShard, OnDone, Work
from overtaking.sim import MODEL_VERSION

MAX_RETRIES = 10
"""Further attempts at a shard after its worker has died."""

TASKS_AHEAD = 2
"""Tasks submitted to Ray for each worker: the next one waits at the worker."""

_STORE_BYTES = 80 * 2**20
"""Least that Ray takes for objects that processes share; only jobs and records are shared."""

_STARTS = 3
"""Attempts to start a cluster."""

_LOGGING = {"log_to_driver": False, "logging_level": "ERROR"}

REACH_TIME = 10.0
"""A cluster must accept a connection within this time [s]."""

_TRIES = "RAY_gcs_server_port_wait_time_s"
"""Environment variable with Ray's attempts to reach a cluster; Ray reads it when it connects."""

_LOOPBACK = ("127.0.0.1", "::1")

_QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",  # Else it tells its makers about every run.
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # Else it warns about what it will change.
}

_ONLY_HERE = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
"""Makes Ray bind to loopback on every system. It reads this when it is imported."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RayExecutor:
    """The `Executor` that carries out tasks on a Ray cluster; one worker has one core.

    Attributes:
        address: Of a cluster that runs, as `ray.init` understands it; None for one that lives on
            this machine as long as the work does, and that only this machine can reach.
        workers: How many processes work at a time on this machine; None for one on each core.
    """

    address: str | None = None
    workers: int | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        if self.workers is None or (self.address is None and self.workers >= 1):
            return
        raise ConfigError(
            what="workers",
            where="generate",
            expected="1 or more" if self.address is None else "none beside an address",
            got=self.workers,
            next_step="leave it out: a cluster knows how many cores it has",
        )

    def refuse_unreachable(self) -> None:
        """Refuse an address without a listener; Ray itself would retry for 15 minutes.

        Raises:
            ConfigError: No program listens there.
        """
        host, _, port = (self.address or "").rpartition("://")[2].rpartition(":")
        if not (host and port.isdecimal()):
            return  # `auto`, or an address that `ray.init` itself refuses.
        try:
            socket.create_connection((host.strip("[]"), int(port)), REACH_TIME).close()
        except (OSError, OverflowError) as error:
            raise _no_cluster(self.address, error) from None

    def __call__(
        self, job: Work, tasks: Iterable[HasShard], location: Location, on_done: OnDone
    ) -> Generator[ShardRecord]:
        """Make shards; see `Executor`. Records come in the order in which they are finished.

        Raises:
            ConfigError: There is no such cluster, or a worker has other versions of packages.
            DatasetError: A worker does not see the location, or too many workers died.
            MissingExtraError: Ray is not installed.
            OSError: A shard cannot be written.
        """
        ray = _ray(is_only_here=self.address is None)
        with _cluster(ray, self.address, self.workers) as is_left:
            shared = ray.put((job.for_one_core(), _packages()))
            make = ray.remote(_make).options(num_cpus=1, max_retries=MAX_RETRIES)
            most = TASKS_AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
            given = (make.remote(shared, task, str(location.resolved())) for task in tasks)
            for record in _finished(ray, given, most, location, is_left=is_left):
                on_done(record.simulations)
                yield record


def _make(shared: tuple[Work, dict[str, str]], task: HasShard, where: str) -> ShardRecord:
    """Make one shard on a worker."""
    job, packages = shared
    os.environ.setdefault("RAYON_NUM_THREADS", "1")  # The engine looks when it is first called.
    location = job.location(where)
    _compare(packages)
    return job.make(task, location, lambda _: None)


@cache
def _packages() -> dict[str, str]:
    """The versions that decide the bytes of the files."""
    names = ("overtaking", "numpy", "pyarrow")
    return {**{name: version(name) for name in names}, "model": MODEL_VERSION}


def _compare(packages: dict[str, str]) -> None:
    """Refuse other versions than the driver's: they might write other bytes."""
    for name, expected in packages.items():
        if _packages()[name] != expected:
            raise ConfigError(
                what=f"version of {name}",
                where=f"worker on {socket.gethostname()}",
                expected=expected,
                got=_packages()[name],
                next_step="install the same versions on every machine of the cluster",
            )


def _finished(
    ray: Any, given: Iterator[Any], most: int, location: Location, *, is_left: bool
) -> Iterator[ShardRecord]:
    """The records of workers, with at most `most` tasks submitted at a time.

    No task goes on after an error. A cluster that is left ends the tasks of the driver that leaves;
    in one that is not left they are waited for. `ray.cancel` may end this process if a task is done
    at that moment.
    """
    underway: list[Any] = []
    try:
        while True:
            while len(underway) < most and (task := next(given, None)) is not None:
                underway.append(task)
            if not underway:
                return
            (done, *_), underway = ray.wait(underway, num_returns=1)
            yield _record(ray, done, location)
    finally:
        if underway and not is_left:
            ray.wait(underway, num_returns=len(underway))


def _record(ray: Any, done: Any, location: Location) -> ShardRecord:
    """The record that a worker returned; raises what the worker raised."""
    try:
        return ray.get(done)
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, OvertakingError | OSError):
            raise error.cause from None
        raise
    except ray.exceptions.RayError as error:
        raise DatasetError(
            what="shard",
            where=str(location),
            expected="a worker that lives until it is finished",
            got=f"{type(error).__name__} after {MAX_RETRIES} more tries",
            next_step="see whether the workers have enough memory; --resume goes on",
        ) from error


@contextmanager
def _cluster(ray: Any, address: str | None, workers: int | None) -> Generator[bool]:
    """A connection to a cluster; gives whether it ends here. One that was there before stays."""
    if ray.is_initialized() and address is None:
        yield False
        return
    with _signals_as_they_are():
        _connect(ray, address, workers)
    try:
        yield True
    finally:
        ray.shutdown()


def _connect(ray: Any, address: str | None, workers: int | None) -> None:
    """Start a cluster, or connect to the one at an address."""
    if address is None:
        if ray.util.get_node_ip_address() not in _LOOPBACK:  # Where it would listen.
            raise _reachable()
        _start(ray, workers)
        return
    try:
        with _trying_once():
            ray.init(address=address, **_LOGGING)
    except (ConnectionError, ValueError, RuntimeError, TimeoutError) as error:
        raise _no_cluster(address, error) from None


@contextmanager
def _trying_once() -> Generator[None]:
    """Limit Ray to one attempt to reach a cluster, which takes 41 s, instead of twenty."""
    before = os.environ.get(_TRIES)
    os.environ[_TRIES] = before or "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_TRIES]


def _no_cluster(address: str | None, error: Exception) -> ConfigError:
    said, *_traceback = str(error).split("\n")
    return ConfigError(
        what="address",
        where="generate",
        expected="that of a Ray cluster that runs",
        got=f"{address}: {said}",
        next_step="start one with `ray start --head`, set RAY_AUTH_MODE=token if it asks for a"
        " token, or leave the address out",
    )


def _start(ray: Any, workers: int | None) -> None:
    """Start a cluster on this machine; a busy one may need longer than Ray waits for it."""
    for left in reversed(range(_STARTS)):
        try:
            ray.init(
                address="local",
                num_cpus=workers,
                num_gpus=0,
                include_dashboard=False,
                object_store_memory=_STORE_BYTES,
                **_LOGGING,
            )
        except Exception as error:  # Ray raises nothing more special.
            ray.shutdown()
            if left == 0:
                raise _not_started(error) from error
        else:
            return


def _not_started(error: Exception) -> DatasetError:
    return DatasetError(
        what="Ray",
        where="generate",
        expected=f"a cluster on this machine after {_STARTS} tries",
        got=str(error),
        next_step="see that the machine is not too busy; the executor threads needs no cluster",
    )


def _reachable() -> ConfigError:
    """The error if Ray was imported before its variable could keep it on this machine."""
    return ConfigError(
        what="Ray",
        where="generate",
        expected="a cluster that only this machine can reach",
        got="one that would listen to the network, since `ray` was imported before",
        next_step="call `ray.init` yourself, or do not import ray before generating",
    )


@contextmanager
def _signals_as_they_are() -> Generator[None]:
    """Keep the handler of SIGTERM: that of Ray ends the process without naming what is finished."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, heard)


def _ray(*, is_only_here: bool) -> Any:
    """The library, without reports to its makers."""
    for name, value in {**_QUIET, **(_ONLY_HERE if is_only_here else {})}.items():
        os.environ.setdefault(name, value)
    try:
        import ray
    except ImportError:
        raise MissingExtraError.for_extra(
            "ray", what="Ray, of the executor ray", where="generate"
        ) from None
    return ray
