"""Processes of this machine, one for each core, that make one shard after the other.

Python's lock lets one thread of a process run at a time, and sampling, labelling and writing need
it much of the time; each process has a lock of its own. A worker has no state: one that dies is
replaced, and its shard is made again from the beginning.
"""

from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

from overtaking.core.errors import ConfigError, DatasetError
from overtaking.core.processors import THREADS_VARIABLE
from overtaking.core.worker import ENDED, PATIENCE, Inbox, Worker
from overtaking.data.elsewhere import absolute, single
from overtaking.data.manifest import ShardRecord
from overtaking.data.orders import Order, Task, Told
from overtaking.data.place import Place

MAX_ATTEMPTS = 4
"""How often a shard is begun before the data set is given up."""

_MODULE = "overtaking.data.process_worker"

_ONE_THREAD = (THREADS_VARIABLE, "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables with the number of threads of the engine, Arrow and linear algebra."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessCrew:
    """Carries out tasks in processes of this machine.

    Attributes:
        workers: How many at a time; no more than there are shards are started.
    """

    workers: int

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        if self.workers < 1:
            raise ConfigError.of(
                what="workers",
                where="generate",
                expected="1 or more",
                got=self.workers,
                next_step="leave it out for one on each core",
            )

    def __call__(
        self, order: Order, tasks: Iterable[Task], place: Place, on_done: Told
    ) -> Generator[ShardRecord]:
        """The record of each shard, in the order in which they are finished.

        Args:
            order: What is to be made.
            tasks: The shards.
            place: Where they belong.
            on_done: Told about every few hundred simulations.

        Raises:
            DatasetError: Workers cannot be started or die, or do not see the place.
            OSError: A shard cannot be written.
        """
        run = _Run(single(order), absolute(place), on_done)
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
        told: Simulations that `on_done` was told of, in any attempt.
        done: Simulations that are done in this attempt.
    """

    task: Task
    begun: int = 0
    told: int = 0
    done: int = 0

    def advance(self, simulations: int) -> int:
        """Count simulations that are done, and return how many `on_done` was not told of."""
        self.done += simulations
        news = max(0, self.done - self.told)
        self.told += news
        return news


class _Run:
    """The workers of one call."""

    def __init__(self, order: Order, where: str, on_done: Told) -> None:
        self._order, self._where, self._on_done = order, where, on_done
        self._inbox = Inbox()
        self._busy: dict[Worker, _Attempts] = {}
        self._idle: list[Worker] = []

    def begin(self, attempts: _Attempts) -> None:
        """Start a worker for a task."""
        worker = self._started()
        attempts.begun, attempts.done = attempts.begun + 1, 0
        self._busy[worker] = attempts
        worker.send((self._order, self._where, attempts.task))

    def records(self, given: Iterator[Task]) -> Iterator[ShardRecord]:
        """The records that workers return; each worker then gets the next task."""
        while self._busy:
            worker, message = self._inbox.receive()
            if (attempts := self._busy.get(worker)) is None:
                continue  # It was idle, and has ended.
            if isinstance(message, ShardRecord):
                self._go_on(worker, next(given, None))
                yield message
            elif isinstance(message, int):
                self._on_done(attempts.advance(message))
            elif message is ENDED:
                self._replace(worker)
            else:
                raise message

    def close(self) -> None:
        """End every worker, in the middle of a shard as well."""
        for worker in self._busy:
            worker.stop()
        for worker in (*self._busy, *self._idle):
            worker.close(PATIENCE)

    def _started(self) -> Worker:
        variables: dict[str, str] = dict.fromkeys(_ONE_THREAD, "1")
        try:
            return Worker(_MODULE, inbox=self._inbox, variables=variables)
        except OSError as error:
            raise DatasetError.of(
                what="worker process",
                where="generate",
                expected="one that starts",
                got=str(error),
                next_step="add --engine threads, which needs none",
            ) from error

    def _go_on(self, worker: Worker, task: Task | None) -> None:
        """Give a worker the next task, or end it."""
        if task is not None:
            worker.send((self._order, self._where, task))
            self._busy[worker] = _Attempts(task, begun=1)
            return
        del self._busy[worker]
        self._idle.append(worker)
        worker.stop()

    def _replace(self, worker: Worker) -> None:
        """Give the task of a worker that has ended to a new one.

        Raises:
            DatasetError: Too many have ended with this task.
        """
        attempts = self._busy.pop(worker)
        ending = worker.ending()
        if attempts.begun < MAX_ATTEMPTS:
            self.begin(attempts)
            return
        raise DatasetError.of(
            what=f"shard {attempts.task.shard.number}",
            where=self._where,
            expected="a worker that lives until it is finished",
            got=f"{MAX_ATTEMPTS} that died, the last {ending}",
            next_step="see whether there is enough memory, or take fewer --workers; "
            "--resume goes on",
        )
