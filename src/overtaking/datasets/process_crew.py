"""Processes of this machine, one for each core, that make one shard after the other.

Python's lock lets one thread of a process run at a time, and sampling, labelling and writing need
it much of the time; each process has a lock of its own. A worker has no state: one that dies is
replaced, and its shard is made again from the beginning.
"""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any

from overtaking.core.errors import ConfigError, DatasetError
from overtaking.core.messages import receive, send
from overtaking.core.processors import THREADS_VARIABLE
from overtaking.datasets.elsewhere import absolute, single
from overtaking.datasets.manifest import ShardRecord
from overtaking.datasets.orders import Order, Task, Told
from overtaking.datasets.place import Place
from overtaking.datasets.process_worker import PATIENCE, READY

MAX_TRIES = 4
"""How often a shard is begun before its workers are taken to die of it."""

_COMMAND = ("-P", "-m", "overtaking.datasets.process_worker")
"""Safe: a module that lies in the working directory is none of ours."""

_ONE_THREAD = (THREADS_VARIABLE, "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What the engine, Arrow and the libraries of linear algebra ask for a number of threads."""

_GLANCE = 1.0  # Windows hears Ctrl-C only between two waits [s].
_LAST_WORDS = 4096  # Bytes of what a worker printed last.


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
        shift = _Shift(single(order), absolute(place), on_done)
        given = iter(tasks)
        try:
            for task in islice(given, self.workers):
                shift.begin(_Duty(task))
            yield from shift.records(given)
        finally:
            shift.end()


@dataclass(slots=True)
class _Duty:
    """A task that somebody works on.

    Attributes:
        task: The task.
        tries: How often it was begun.
        told: Simulations of it that were told of.
        done: Simulations of it that are done in this try.
    """

    task: Task
    tries: int = 0
    told: int = 0
    done: int = 0

    def advance(self, simulations: int) -> int:
        """Count simulations that are done; how many of them nobody was told of before."""
        self.done += simulations
        news = max(0, self.done - self.told)
        self.told += news
        return news


class _Shift:
    """The workers of one call."""

    def __init__(self, order: Order, where: str, on_done: Told) -> None:
        self._order, self._where, self._on_done = order, where, on_done
        self._said: SimpleQueue[tuple[_Worker, Any]] = SimpleQueue()
        self._duties: dict[_Worker, _Duty] = {}
        self._idle: list[_Worker] = []

    def begin(self, duty: _Duty) -> None:
        """Start a worker for a task."""
        duty.tries, duty.done = duty.tries + 1, 0
        self._duties[_Worker.start(self._said)] = duty

    def records(self, given: Iterator[Task]) -> Iterator[ShardRecord]:
        """What workers return, who then get the next task."""
        while self._duties:
            worker, said = self._next()
            if (duty := self._duties.get(worker)) is None:
                continue  # It was sent away, and has ended.
            if isinstance(said, ShardRecord):
                self._go_on(worker, next(given, None))
                yield said
            elif isinstance(said, int):
                self._on_done(duty.advance(said))
            elif isinstance(said, BaseException):
                raise said
            elif said == READY:
                worker.tell((self._order, self._where))
                worker.tell(duty.task)
            else:
                self._replace(worker)

    def end(self) -> None:
        """End every worker, those in the middle of a shard as well."""
        for worker in self._duties:
            worker.stop()
        for worker in (*self._duties, *self._idle):
            worker.wait()

    def _next(self) -> "tuple[_Worker, Any]":
        while True:
            with suppress(Empty):
                return self._said.get(timeout=_GLANCE)

    def _go_on(self, worker: "_Worker", task: Task | None) -> None:
        """Give a worker the next task, or nothing more."""
        if task is not None:
            worker.tell(task)
            self._duties[worker] = _Duty(task, tries=1)
            return
        del self._duties[worker]
        self._idle.append(worker)
        worker.stop()

    def _replace(self, worker: "_Worker") -> None:
        """Have the task of a worker that has died done by another one.

        Raises:
            DatasetError: Too many have died of it.
        """
        duty = self._duties.pop(worker)
        worker.wait()
        if duty.tries < MAX_TRIES:
            self.begin(duty)
            return
        raise DatasetError.of(
            what=f"shard {duty.task.shard.number}",
            where=self._where,
            expected="a worker that lives until it is finished",
            got=f"{MAX_TRIES} that died, the last {worker.last_words}",
            next_step="see whether there is enough memory, or take fewer --workers; "
            "--resume goes on",
        )


@dataclass(eq=False, slots=True)
class _Worker:
    """A process that makes shards.

    Attributes:
        process: The process.
        listeners: The threads that hear it.
        printed: The end of what it has printed.
    """

    process: "subprocess.Popen[bytes]"
    listeners: list[threading.Thread] = field(default_factory=list[threading.Thread])
    printed: bytes = b""

    @classmethod
    def start(cls, said: "SimpleQueue[tuple[_Worker, Any]]") -> "_Worker":
        """Start one whose answers go to a queue, and last of all None."""
        worker = cls(_started())
        targets = (lambda: worker._listen(said), worker._read)
        worker.listeners += [threading.Thread(target=one, daemon=True) for one in targets]
        for thread in worker.listeners:
            thread.start()
        return worker

    def tell(self, request: object) -> None:
        """Say something to it; that it has died is heard elsewhere."""
        with suppress(OSError):
            send(_stream(self.process.stdin), request)

    def stop(self) -> None:
        """Tell it to end in order, now."""
        self.tell(None)

    def wait(self) -> None:
        """Wait until it has ended, and see to it that it does."""
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        for thread in self.listeners:
            thread.join()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            with suppress(OSError):  # What nobody will read any more.
                _stream(stream).close()

    @property
    def last_words(self) -> str:
        """How it ended, and what it printed last."""
        status = self.process.returncode
        how = _signal_name(-status) if status < 0 else f"with exit status {status}"
        lines = self.printed.decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f"{how}: {last}" if last else how

    def _listen(self, said: "SimpleQueue[tuple[_Worker, Any]]") -> None:
        """Hear what it answers until it says no more."""
        try:
            while True:
                said.put((self, receive(_stream(self.process.stdout))))
        except (EOFError, OSError):
            said.put((self, None))

    def _read(self) -> None:
        """Keep the end of what it prints."""
        while some := os.read(_stream(self.process.stderr).fileno(), _LAST_WORDS):
            self.printed = (self.printed + some)[-_LAST_WORDS:]


def _started() -> "subprocess.Popen[bytes]":
    """A process that finds the modules that this one finds, with one thread."""
    found = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
    environment = {**os.environ, **dict.fromkeys(_ONE_THREAD, "1"), "PYTHONPATH": found}
    try:
        return subprocess.Popen(
            [sys.executable, *_COMMAND],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
        )
    except OSError as error:
        raise DatasetError.of(
            what="worker process",
            where="generate",
            expected="one that starts",
            got=str(error),
            next_step="add --engine threads, which needs none",
        ) from error


def _stream(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


def _signal_name(number: int) -> str:
    try:
        return f"by {signal.Signals(number).name}"
    except ValueError:
        return f"by signal {number}"
