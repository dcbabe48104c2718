"""Processes of this machine, one for each core, that make one shard after the other.

Python's lock lets one thread of a process run at a time, and sampling, labelling and writing need
it much of the time; each process has a lock of its own. A worker has no state: one that dies is
replaced, and its shard is made again from the beginning.
"""

import pickle
import traceback
from collections.abc import Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

from overtaking.core.errors import ConfigError, DatasetError, OvertakingError
from overtaking.core.process_limits import THREADS_VARIABLE
from overtaking.core.worker_process import (
    SHUTDOWN_TIMEOUT,
    WORKER_ENDED,
    ParentConnection,
    WorkerProcess,
)
from overtaking.data.interruption import Terminated, termination_raises
from overtaking.data.location import Location
from overtaking.data.manifest import ShardRecord
from overtaking.data.work import HasShard, OnDone, Work

MAX_ATTEMPTS = 4
"""Attempts at one shard before the call fails."""

_ONE_THREAD = (THREADS_VARIABLE, "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables with the number of threads of the engine, Arrow and linear algebra."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessExecutor:
    """The `Executor` that carries out tasks in processes of this machine.

    Attributes:
        workers: How many at a time; no more than there are shards are started.
    """

    workers: int

    def __post_init__(self) -> None:
        """Refuse less than one."""
        if self.workers < 1:
            next_step = "leave it out for one on each core"
            raise ConfigError.out_of_range(
                what="workers", where="generate", low=1, got=self.workers, next_step=next_step
            )

    def __call__(
        self, job: Work, tasks: Iterable[HasShard], location: Location, on_done: OnDone
    ) -> Generator[ShardRecord]:
        """Make shards; see `Executor`. Records come in the order in which they are finished.

        Raises:
            DatasetError: Workers cannot be started or die, or do not see the location.
            OSError: A shard cannot be written.
        """
        run = _Run(job.for_one_core(), str(location.resolved()), on_done)
        given = iter(tasks)
        try:
            for task in islice(given, self.workers):
                run.begin(_Attempts(task))
            yield from run.records(given)
        finally:
            run.close()


@dataclass(slots=True)
class _Attempts:
    """The attempts at one task.

    Attributes:
        task: The task.
        begun: How many attempts were begun.
        reported: Simulations that were reported as done, in any attempt.
        done: Simulations that are done in this attempt.
    """

    task: HasShard
    begun: int = 0
    reported: int = 0
    done: int = 0

    def advance(self, simulations: int) -> int:
        """Count simulations that are done, and return the number not yet reported."""
        self.done += simulations
        news = max(0, self.done - self.reported)
        self.reported += news
        return news


class _Run:
    """The workers of one call."""

    def __init__(self, job: Work, where: str, on_done: OnDone) -> None:
        self._job, self._where, self._on_done = job, where, on_done
        self._busy: dict[WorkerProcess, _Attempts] = {}
        self._idle: list[WorkerProcess] = []

    def begin(self, attempts: _Attempts, worker: WorkerProcess | None = None) -> None:
        """Send a task to a worker; to a new one if none is given."""
        worker = worker or self._started()
        attempts.begun, attempts.done = attempts.begun + 1, 0
        self._busy[worker] = attempts
        worker.send((self._job, self._where, attempts.task))

    def records(self, given: Iterator[HasShard]) -> Iterator[ShardRecord]:
        """The records that workers return; each worker then gets the next task."""
        while self._busy:
            worker, message = WorkerProcess.receive_from_any(self._busy)
            if isinstance(message, ShardRecord):
                self._go_on(worker, next(given, None))
                yield message
            elif isinstance(message, int):
                self._on_done(self._busy[worker].advance(message))
            elif message is WORKER_ENDED:
                self._replace(worker)
            else:
                raise message

    def close(self) -> None:
        """End every worker, in the middle of a shard as well."""
        for worker in self._busy:
            worker.stop()
        for worker in (*self._busy, *self._idle):
            worker.close(SHUTDOWN_TIMEOUT)

    def _started(self) -> WorkerProcess:
        try:
            return WorkerProcess(__name__, variables=dict.fromkeys(_ONE_THREAD, "1"))
        except OSError as error:
            raise DatasetError(
                what="worker process",
                where="generate",
                expected="one that starts",
                got=str(error),
                next_step="add --executor threads, which needs none",
            ) from error

    def _go_on(self, worker: WorkerProcess, task: HasShard | None) -> None:
        """Give a worker the next task, or end it."""
        if task is not None:
            self.begin(_Attempts(task), worker)
            return
        del self._busy[worker]
        self._idle.append(worker)
        worker.stop()

    def _replace(self, worker: WorkerProcess) -> None:
        """Give the task of a worker that has ended to a new one.

        Raises:
            DatasetError: Too many have ended with this task.
        """
        attempts = self._busy.pop(worker)
        ending = worker.describe_exit()
        if attempts.begun < MAX_ATTEMPTS:
            self.begin(attempts)
            return
        raise DatasetError(
            what=f"shard {attempts.task.shard.number}",
            where=self._where,
            expected="a worker that lives until it is finished",
            got=f"{MAX_ATTEMPTS} that died, the last {ending}",
            next_step="see whether there is enough memory, or take fewer --workers; "
            "--resume goes on",
        )


def main(parent: ParentConnection) -> None:
    """Run a worker process: make shards, and report to the parent.

    Each message is a job (`Work`), the text of a location, and a task. The answers to each are
    numbers of simulations that are done, then its record or an exception.
    """
    # An `OSError` is one of the pipe: the parent has ended.
    with suppress(Terminated, OSError), termination_raises():
        for job, where, task in parent:
            outcome: ShardRecord | Exception
            try:
                outcome = job.make(task, job.location(where), parent.send)
            except Exception as error:
                outcome = _portable(error)
            parent.send(outcome)


def _portable(error: Exception) -> Exception:
    """An error that can be unpickled; an unexpected one has its traceback in a note."""
    if isinstance(error, OvertakingError | OSError | MemoryError):
        return error
    where = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(f"In a worker process:\n{where}")
    return error
