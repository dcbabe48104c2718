"""Generates data sets of several sizes: memory, time and bytes, whoever makes them.

    python benchmarks/scale.py --sizes 2000,10000,100000
    python benchmarks/scale.py --sizes 10000 --executor ray
    python benchmarks/scale.py --processes 4000

Memory is what all processes of a run hold together, looked at ten times a second; it shall not grow
with the number of simulations. `--processes` asks whether one process on each core does more than
one process with as many threads; they take turns, and the best round of each counts. Linux only.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from memory import Watch

ROUNDS = 3


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


def watched(command: list[str]) -> Run:
    """Run a command and look at its memory."""
    begin = time.perf_counter()
    with tempfile.TemporaryFile("w+") as answer:
        process = subprocess.Popen(command, stdout=answer)
        with Watch(process.pid) as watch:
            process.wait()
        seconds = time.perf_counter() - begin
        answer.seek(0)
        text = answer.read()
    if process.returncode:
        raise SystemExit(process.returncode)
    return Run(seconds=seconds, cpu=watch.cpu, peak=watch.peak, result=json.loads(text))


def command_of(given: argparse.Namespace, simulations: int, out: Path, executor: str) -> list[str]:
    """The command line that makes a data set."""
    shared = [sys.executable, "-m", "overtaking", "generate", "--json", "--quiet"]
    recipe = ["--profile", given.profile, "-n", str(simulations), "--seed", "1"]
    return [*shared, *recipe, "--keep", given.keep, "--executor", executor, "--out", str(out)]


def sizes(given: argparse.Namespace, folder: Path) -> None:
    """One line for each size."""
    print(f"{'simulations':>11} {'s':>8} {'CPU s':>8} {'per CPU s':>9} {'peak MiB':>9} {'MB':>8}")
    for text in given.sizes.split(","):
        simulations, out = int(text), folder / text
        run = watched(command_of(given, simulations, out, given.executor))
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) / 1e6
        print(
            f"{simulations:>11,} {run.seconds:>8.1f} {run.cpu:>8.1f} {simulations / run.cpu:>9.1f} "
            f"{run.peak:>9.0f} {size:>8.1f}  {run.result['content_hash']}",
            flush=True,
        )


def processes(given: argparse.Namespace, folder: Path) -> None:
    """Threads of one process, and one process on each core, in turn."""
    best: dict[str, Run] = {}
    for number in range(ROUNDS):
        for executor in ("threads", "processes"):
            out = folder / f"{number}-{executor}"
            run = watched(command_of(given, given.processes, out, executor))
            shutil.rmtree(out)
            if executor not in best or run.seconds < best[executor].seconds:
                best[executor] = run
    for executor, run in best.items():
        print(
            f"{executor:<10} {given.processes / run.seconds:8.1f} simulations a second, "
            f"{run.cpu:7.1f} s of a processor, {run.peak:6.0f} MiB"
        )


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description="Memory and time of generating at scale.")
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--sizes", default="2000,10000")
    parser.add_argument("--keep", default="features", choices=("features", "frames"))
    parser.add_argument("--executor", default="threads", choices=("threads", "processes", "ray"))
    parser.add_argument("--processes", type=int, metavar="N")
    given = parser.parse_args()
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    with tempfile.TemporaryDirectory() as folder:
        (processes if given.processes else sizes)(given, Path(folder))


if __name__ == "__main__":
    main()
