"""How many films of 200 frames are made in a second, and what drawing and encoding take of it.

    python benchmarks/video.py
    python benchmarks/video.py --films 64

Simulations of the study's profile, all weathers, films as long as they are. Preparing, drawing and
encoding are timed apart on one core, in time of the processor, as the shortest of some runs of each
film; then everything together with as many threads as there are processors, by the clock, from
labelled simulations to files that are safe on the disk.
"""

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import cast

import av
import numpy as np

import overtaking as ot
from measure import Measure, parser, report
from overtaking.show.video import encode, jobs, produce
from overtaking.show.video.canvas import HEIGHT, WIDTH, Canvas
from overtaking.show.video.film import Film
from overtaking.show.video.scene import RATE

FILMS, REPEATS, FRAMES = 24, 3, 200
TARGET = 2.0


def shortest(action: Callable[[], object], clock: Callable[[], float] = time.process_time) -> float:
    """The shortest of some runs [s]."""
    times: list[float] = []
    for _ in range(REPEATS):
        begin = clock()
        action()
        times.append(clock() - begin)
    return min(times)


def preparing(job: jobs.Job) -> float:
    """Seconds to the first frame."""
    canvas = blank()
    return shortest(lambda: produce.film_of(job).draw(0, canvas))


def drawing(film: Film) -> float:
    """Seconds for all frames."""
    canvas, planes = blank(), np.empty((HEIGHT * 3 // 2, WIDTH), np.uint8)

    def draw() -> None:
        for number in range(film.num_frames):
            film.draw(number, canvas)
            canvas.write_yuv(planes)

    return shortest(draw)


class Still:
    """A film whose frames were drawn before."""

    def __init__(self, film: Film) -> None:
        """Draw all frames."""
        self.num_frames, self._frames = film.num_frames, list[Canvas]()
        for number in range(film.num_frames):
            self._frames.append(film.draw(number))

    def draw(self, frame: int, out: Canvas) -> Canvas:
        """Copy a frame that was kept."""
        out.copy_columns(self._frames[frame], 0, 0, (0, WIDTH))
        return out


def encoding(job: jobs.Job, folder: Path) -> float:
    """Seconds from frames to a file, with their conversion to the colours of the encoder."""
    still = cast("Film", Still(produce.film_of(job)))
    return shortest(lambda: encode.write_film(still, folder / "still.mp4"))


def blank() -> Canvas:
    """A black frame."""
    return Canvas(WIDTH, HEIGHT, "#000000")


def together(wanted: list[jobs.Job], folder: Path) -> tuple[float, float]:
    """Seconds for all films by the clock, of the shortest of some runs, and of processors."""
    runs: list[tuple[float, float]] = []
    for _ in range(REPEATS):
        begin = time.perf_counter(), time.process_time()
        produce.produce(iter(wanted), folder)
        runs.append((time.perf_counter() - begin[0], time.process_time() - begin[1]))
    return min(runs)


def measures(count: int) -> list[Measure]:
    """Everything that is measured."""
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        folder = Path(name)
        data = ot.generate_dataset(
            "pinto2023-physical", num_simulations=count, seed=1, out=folder / "data"
        )
        wanted = list(jobs.jobs(data, jobs.ALL))
        films = [produce.film_of(job) for job in wanted]
        frames = sum(film.num_frames for film in films)
        apart = {
            "preparing": sum(preparing(job) for job in wanted) / count,
            "drawing": sum(map(drawing, films)) / frames * FRAMES,
            "encoding": sum(encoding(job, folder) for job in wanted) / frames * FRAMES,
        }
        whole, busy = together(wanted, folder / "films")
        size = sum(path.stat().st_size for path in (folder / "films").iterdir())
    cores = os.cpu_count() or 1
    note = f"{count} films, {frames} frames, {cores} processors, PyAV {av.__version__}"
    return [
        *(
            Measure(name=f"{what} a film of {FRAMES} frames", value=seconds * 1e3, unit="ms")
            for what, seconds in apart.items()
        ),
        Measure(
            name=f"films of {FRAMES} frames",
            value=frames / FRAMES / whole,
            unit="films/s",
            at_least=TARGET,
            note=note,
        ),
        Measure(
            name=f"films of {FRAMES} frames by the time of the processors",
            value=frames / FRAMES / busy * cores,
            unit="films/s",
            note="as if nobody else were at work",
        ),
        Measure(name="processors at work", value=busy / whole, unit=f"of {cores}"),
        Measure(name="size", value=size / frames * RATE / 1e3, unit="kB a second of film"),
    ]


if __name__ == "__main__":
    command_line = parser(__doc__)
    command_line.add_argument("--films", type=int, default=FILMS)
    arguments = command_line.parse_args()
    report(measures(arguments.films), as_json=arguments.json)
