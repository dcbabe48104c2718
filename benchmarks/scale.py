"""Generates data sets of several sizes: memory, time and bytes, whoever makes them.

    python benchmarks/scale.py --sizes 2000,10000,100000
    python benchmarks/scale.py --sizes 10000 --engine ray
    python benchmarks/scale.py --processes 4000

Memory is what all processes of a run hold together, looked at ten times a second; it shall not grow
with the number of simulations. `--processes` asks whether two processes of one thread each do more
than one process of two threads; they take turns, and the best round of each counts. Linux only.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

INTERVAL = 0.1
ROUNDS = 3
MIB = 2**20
_PARENT, _MEMORY, _CPU = 1, 21, slice(11, 15)
"""Fields of `/proc/N/stat` behind the name: parent, pages in memory, ticks of it and its dead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What one run took.

    Attributes:
        seconds: By the clock [s].
        cpu: Time of all processors, in processes that had ended or were seen last [s].
        peak: Most memory that all its processes held together [MiB].
        result: What the command printed.
    """

    seconds: float
    cpu: float
    peak: float
    result: dict[str, object]


def stats() -> dict[int, list[int]]:
    """The numbers of `/proc/N/stat` of every process, those behind its name."""
    found: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            text = (folder / "stat").read_text()
        except OSError:
            continue
        found[int(folder.name)] = [int(one) for one in text.rpartition(") ")[2].split()[1:]]
    return found


def family(root: int) -> list[list[int]]:
    """The numbers of a process and of all that it and its children started."""
    known = stats()
    members, added = set[int](), {root}
    while added:
        members |= added
        added = {pid for pid, row in known.items() if row[_PARENT - 1] in members} - members
    return [known[pid] for pid in members if pid in known]


def watched(command: list[str]) -> Run:
    """Run a command and look at its memory."""
    begin, peak, cpu = time.perf_counter(), 0.0, 0.0
    page, tick = os.sysconf("SC_PAGE_SIZE"), os.sysconf("SC_CLK_TCK")
    with tempfile.TemporaryFile("w+") as answer:
        process = subprocess.Popen(command, stdout=answer)
        while process.poll() is None:
            rows = family(process.pid)
            peak = max(peak, sum(row[_MEMORY - 1] for row in rows) * page / MIB)
            ticks = sum(sum(row[_CPU.start - 1 : _CPU.stop - 1]) for row in rows)
            cpu = max(cpu, ticks / tick)
            time.sleep(INTERVAL)
        answer.seek(0)
        text = answer.read()
    if process.returncode:
        raise SystemExit(process.returncode)
    seconds = time.perf_counter() - begin
    return Run(seconds=seconds, cpu=cpu, peak=peak, result=json.loads(text))


def command_of(profile: str, simulations: int, out: Path, *words: str) -> list[str]:
    """The command line that makes a data set without frames."""
    shared = [sys.executable, "-m", "overtaking.cli", "generate", "--json", "--quiet"]
    recipe = ["--profile", profile, "-n", str(simulations), "--seed", "1", "--keep", "features"]
    return [*shared, *recipe, "--out", str(out), *words]


def sizes(given: argparse.Namespace, folder: Path) -> None:
    """One line for each size."""
    print(f"{'simulations':>11} {'s':>8} {'CPU s':>8} {'per CPU s':>9} {'peak MiB':>9} {'MB':>8}")
    for text in given.sizes.split(","):
        simulations, out = int(text), folder / text
        words = ["--engine", given.engine]
        run = watched(command_of(given.profile, simulations, out, *words))
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) / 1e6
        print(
            f"{simulations:>11,} {run.seconds:>8.1f} {run.cpu:>8.1f} {simulations / run.cpu:>9.1f} "
            f"{run.peak:>9.0f} {size:>8.1f}  {run.result['content_hash']}",
            flush=True,
        )


def processes(given: argparse.Namespace, folder: Path) -> None:
    """Two threads of one process, and two processes of one thread, in turn."""
    half = given.processes // 2
    best = {"one process, two threads": 0.0, "two processes, one thread each": 0.0}
    for number in range(ROUNDS):
        for name, count in zip(best, (1, 2), strict=True):
            environment = {**os.environ, "RAYON_NUM_THREADS": str(3 - count)}
            begin = time.perf_counter()
            running = [
                subprocess.Popen(
                    command_of(
                        given.profile,
                        2 * half // count,
                        folder / f"{number}-{count}-{part}",
                        *("--engine", "threads"),
                    ),
                    env=environment,
                    stdout=subprocess.DEVNULL,
                    # Its threads of Python are as many as processors that it may use.
                    preexec_fn=(lambda part=part: os.sched_setaffinity(0, {part}))
                    if count == 2
                    else (lambda: os.sched_setaffinity(0, {0, 1})),
                )
                for part in range(count)
            ]
            if any(process.wait() for process in running):
                raise SystemExit(1)
            best[name] = max(best[name], 2 * half / (time.perf_counter() - begin))
    for name, rate in best.items():
        print(f"{name:<32} {rate:8.1f} simulations a second")


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description="Memory and time of generating at scale.")
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--sizes", default="2000,10000")
    parser.add_argument("--engine", default="threads", choices=("threads", "ray"))
    parser.add_argument("--processes", type=int, metavar="N")
    given = parser.parse_args()
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    with tempfile.TemporaryDirectory() as folder:
        (processes if given.processes else sizes)(given, Path(folder))


if __name__ == "__main__":
    main()
