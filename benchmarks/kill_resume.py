"""Kills a `generate` at many moments, resumes it, and compares with an undisturbed run.

    python benchmarks/kill_resume.py --kills 200
    python benchmarks/kill_resume.py --kills 60 --executor processes

Half of the moments are random instants; the other half are the entries into the calls that change
the file system (open, rename, make and remove), where the time is short and the danger greatest.
With processes, these are the calls of a worker, which kills its parent and itself there; every
other time itself alone, and then the run must go on as if nothing had been.
After each kill the data set is resumed and must be the same as the undisturbed one: content hash,
bytes of every file, every key once, nothing left over. Exits with 1 if a single one is not.
"""

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import pyarrow.parquet as pq

import overtaking as ot
from overtaking.api import simulator_registry
from overtaking.data.tables.schemas import KEYS

CHANGES = frozenset({"open", "os.mkdir", "os.rename", "os.truncate", "shutil.rmtree"})
"""Audit events (PEP 578) of what changes the file system."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """The data set to make.

    Attributes:
        simulations: How many simulations.
        shard_size: Simulations a file.
        simulator: Who simulates.
        horizon: Longest duration of a simulation [s].
        executor: Who makes the shards.
    """

    simulations: int
    shard_size: int
    simulator: str
    horizon: float
    executor: str

    def run(self, out: Path) -> None:
        """Make the data set, or complete it."""
        overrides = {"time.horizon_s": self.horizon, "time.attempt_deadline_s": self.horizon}
        ot.generate_dataset(
            "pinto2023-physical",
            num_simulations=self.simulations,
            seed=1,
            out=out,
            resume=True,
            overrides=overrides,
            simulator=self.simulator,
            shard_size=self.shard_size,
            executor=self.executor,
        )


def in_child(action: Callable[[], None]) -> int:
    """Start a process that does something; its number."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            action()
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    return child


def finished(child: int) -> bool:
    """Wait for a process; whether it ended by itself and well."""
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status) == 0


def kill_after(seconds: float, job: Job, out: Path) -> bool:
    """Kill a run at an instant; whether it was still running."""
    child = in_child(lambda: job.run(out))
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    return not finished(child)


def watch(change: int, out: str, action: Callable[[], None]) -> None:
    """Do something when this process is about to change the file system once more."""
    left = change

    def count(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal left
        if event in CHANGES and any(out in str(one) for one in arguments):
            left -= 1
            if left == -1:
                action()

    sys.addaudithook(count)


def kill_at(change: int, job: Job, out: Path) -> bool:
    """Kill a run that is about to change the file system once more; whether it got that far."""

    def run() -> None:
        watch(change, str(out), lambda: os.kill(os.getpid(), signal.SIGKILL))
        job.run(out)

    return not finished(in_child(run))


def kill_workers_at(change: int, job: Job, out: Path) -> bool:
    """Kill the first worker that is about to change the file system once more.

    Args:
        change: How many changes it may make before; every other one takes its parent with it.
        job: What to run.
        out: Where.

    Returns:
        Whether a worker got that far.
    """
    mark = out.with_name("killed-worker")
    mark.unlink(missing_ok=True)

    folder = out.with_name("victim")
    folder.mkdir(exist_ok=True)
    # A worker finds it where its parent would, and Python imports it before all else.
    (folder / "sitecustomize.py").write_text(VICTIM)

    def run() -> None:
        sys.path[:0] = [str(folder), str(Path(__file__).parent)]
        os.environ["KILL_AT"] = json.dumps([change, str(out), str(mark), change % 2])
        job.run(out)

    goes_on = finished(in_child(run))
    if mark.exists() and change % 2 == 0 and not goes_on:
        raise SystemExit("the run did not go on without a worker")
    return mark.exists()


VICTIM = """
import json, os, signal, sys
def end():
    try:
        os.close(os.open(mark, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return
    if takes_parent:
        os.kill(os.getppid(), signal.SIGKILL)
    os.kill(os.getpid(), signal.SIGKILL)
if "KILL_AT" in os.environ:
    from kill_resume import watch
    change, out, mark, takes_parent = json.loads(os.environ["KILL_AT"])
    watch(change, out, end)
"""
"""What a worker runs before anything else: the first to get there dies."""


def contents(out: Path) -> dict[str, str]:
    """The hash of every file of a data set, but for the times in its manifest."""
    manifest = json.loads((out / "dataset.json").read_text(encoding="utf-8"))
    del manifest["provenance"]
    files = [path for path in out.rglob("*") if path.is_file() and path.name != "dataset.json"]
    hashes = {str(path.relative_to(out)): sha256(path.read_bytes()).hexdigest() for path in files}
    return {**hashes, "dataset.json": json.dumps(manifest, sort_keys=True)}


def repeated_keys(out: Path) -> list[str]:
    """The tables in which a key comes more than once, as any reader of the folders sees them."""
    kept = {name: keys for name, keys in KEYS.items() if (out / name).is_dir()}
    tables = {name: pq.read_table(out / name, columns=list(keys)) for name, keys in kept.items()}
    return [
        name
        for name, keys in tables.items()
        if keys.group_by(keys.column_names).aggregate([]).num_rows != keys.num_rows
    ]


def trial(kill: Callable[[Path], bool], job: Job, expected: dict[str, str], folder: Path) -> str:
    """Kill one run and resume it; what is wrong with the result, empty if nothing is.

    Raises:
        InterruptedError: The run was over before it could be killed.
    """
    out = folder / "killed"
    shutil.rmtree(out, ignore_errors=True)
    if not kill(out):
        raise InterruptedError
    if not finished(in_child(lambda: job.run(out))):
        return "it could not be resumed"
    found = contents(out)
    different = sorted(key for key in {*found, *expected} if found.get(key) != expected.get(key))
    if different:
        return f"different from the undisturbed run: {', '.join(different[:3])}"
    return f"a key twice in {', '.join(twice)}" if (twice := repeated_keys(out)) else ""


def trials(job: Job, kills: int, seed: int, folder: Path) -> tuple[int, list[str]]:
    """Kill as many runs as asked for; how many were, and what was wrong."""
    start = time.perf_counter()
    if not finished(in_child(lambda: job.run(folder / "whole"))):
        return 0, ["the undisturbed run failed"]
    duration = time.perf_counter() - start
    expected = contents(folder / "whole")
    draw, done, wrong = random.Random(seed), 0, list[str]()
    changes = 0
    while done < kills:
        number = changes if done % 2 else -1
        moment = draw.uniform(0.0, duration)

        def kill(out: Path, number: int = number, moment: float = moment) -> bool:
            at = kill_workers_at if job.executor == "processes" else kill_at
            return at(number, job, out) if number >= 0 else kill_after(moment, job, out)

        try:
            found = trial(kill, job, expected, folder)
        except InterruptedError:
            changes = 0 if number >= 0 else changes  # All were tried: begin again.
            continue
        changes += number >= 0
        done += 1
        wrong += [f"kill {done}: {found}"] if found else []
    return done, wrong


def main() -> int:
    """Kill, resume, compare; print what came of it."""
    parser = argparse.ArgumentParser(description="Kill, resume and compare.")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--simulations", type=int, default=400)
    parser.add_argument("--shard-size", type=int, default=50)
    parser.add_argument("--simulator", choices=simulator_registry.SIMULATORS, default="engine")
    parser.add_argument("--executor", choices=("threads", "processes"), default="threads")
    parser.add_argument("--horizon", type=float, default=20.0, help="longest duration in seconds")
    given = parser.parse_args()
    job = Job(
        simulations=given.simulations,
        shard_size=given.shard_size,
        simulator=given.simulator,
        horizon=given.horizon,
        executor=given.executor,
    )
    with tempfile.TemporaryDirectory() as folder:
        done, wrong = trials(job, given.kills, given.seed, Path(folder))
    same = max(0, done - len(wrong))
    print(f"{done} kills, {same} resumed to the same content with nothing twice")
    for line in wrong:
        print(line)
    return 1 if wrong or not done else 0


if __name__ == "__main__":
    sys.exit(main())
