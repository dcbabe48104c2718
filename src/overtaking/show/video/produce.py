"""Many films, several at a time."""

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

from overtaking.core.equality import ContentEquality
from overtaking.show.video.canvas import HEIGHT, WIDTH
from overtaking.show.video.encode import require, write_film
from overtaking.show.video.film import Film
from overtaking.show.video.jobs import Job
from overtaking.show.video.scene import RATE

_WAITING = 2
"""Films that wait for each that is being made: more would only fill the memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Video(ContentEquality):
    """A film that was made.

    Attributes:
        number: Number of the simulation.
        path: The file.
        num_frames: Frames, `scene.RATE` of them a second.
        label: Class of the simulation.
    """

    number: int
    path: Path
    num_frames: int
    label: str

    @property
    def duration(self) -> float:
        """[s]."""
        return self.num_frames / RATE

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return WIDTH, HEIGHT


def file_name(number: int) -> str:
    """Name of the file of a simulation."""
    return f"{number:06d}.mp4"


def produce(
    jobs: Iterable[Job],
    folder: Path,
    *,
    total: int | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Video]:
    """Make films, several at a time.

    Drawing and encoding run outside of Python's global lock for the most part, so threads are
    enough.

    Args:
        jobs: The films; each worker takes the next when it is free.
        folder: Where they go; made if missing. Each file appears when it is complete.
        total: Number of jobs, if it is known, for `progress`.
        threads: How many films are made beside each other; all processors if not given.
        progress: Called with the number of films that are done, and of all.

    Returns:
        The films, in the order of the jobs.

    Raises:
        MissingExtraError: The encoder is not installed.
        DatasetError: The encoder failed.
        OSError: A file cannot be written. Films that were finished are kept.
    """
    require()
    workers = threads or os.cpu_count() or 1
    stop = threading.Event()
    made: list[Future[Video]] = []
    with ThreadPoolExecutor(max_workers=workers) as pool:
        try:
            pending: set[Future[Video]] = set()
            for job in jobs:
                folder.mkdir(parents=True, exist_ok=True)  # What is refused leaves none behind.
                made.append(pool.submit(_make, job, folder, stop))
                pending.add(made[-1])
                pending = _settled(
                    pending, workers * _WAITING, progress, (len(made), total or len(made))
                )
            _settled(pending, 1, progress, (len(made), total or len(made)))
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    return [future.result() for future in made]


def _settled(
    pending: set[Future[Video]],
    room: int,
    progress: Callable[[int, int], None] | None,
    counts: tuple[int, int],
) -> set[Future[Video]]:
    """Wait until fewer than `room` films are pending; errors are raised at once."""
    while len(pending) >= room:
        done, pending = wait(pending, return_when=FIRST_COMPLETED)
        for future in done:
            future.result()
        if progress is not None:
            progress(counts[0] - len(pending), counts[1])
    return pending


def _make(job: Job, folder: Path, stop: threading.Event) -> Video:
    """Make one film."""
    film = film_of(job)
    path = folder / file_name(job.number)
    title = f"Simulation {job.number} of {job.labelled.trajectories.scenario.profile}"
    title += f", policy {job.policy.name}"
    write_film(film, path, title=title, is_wanted=lambda: not stop.is_set())
    return Video(number=job.number, path=path, num_frames=film.num_frames, label=job.label.title)


def film_of(job: Job) -> Film:
    """The frames of a film."""
    return Film(
        job.labelled.trajectories,
        title=f"Simulation {job.number}",
        events=job.labelled.events,
        findings=job.labelled.findings,
        policy=job.policy,
        label=job.label,
    )
