"""Processes of this machine make the same files as one process, whoever dies on the way."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import uuid
from pathlib import Path

import fsspec.config
import pytest
from tests.support.killer import Killer, contents
from tests.support.processes import eventually
from tests.support.sumo import needs_sumo
from tests.support.troubled import troubled

import overtaking as ot
from overtaking.core.errors import DatasetError
from overtaking.data import generate as writing
from overtaking.data import processes
from overtaking.data.balance import ClassBalance
from overtaking.data.location import PARTIAL, Folder
from overtaking.data.processes import ProcessExecutor
from overtaking.data.recipe import Keep, Recipe
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification

pytestmark = pytest.mark.ci

NUM_SIMULATIONS, SHARD_SIZE = 1000, 125
SETTINGS = {
    "overrides": {"time.horizon_s": 4.0, "time.attempt_deadline_s": 4.0},
    "shard_size": SHARD_SIZE,
    "keep": "features",
}
linux_only = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")

# Without `if __name__ == "__main__"`, which nobody writes in a notebook or a short script.
SCRIPT = f"""
import signal, sys
import overtaking
signal.signal(signal.SIGINT, signal.default_int_handler)  # A background job would not hear it.
def progress(done, total):
    print(done, flush=True)
    if done > {2 * SHARD_SIZE}:
        sys.stdin.read()
try:
    overtaking.generate_dataset("pinto2023-physical", num_simulations={NUM_SIMULATIONS}, seed=1,
                        out=sys.argv[1], executor="processes",
                        workers=2, resume=True, progress=progress, **{SETTINGS!r})
except (Exception, KeyboardInterrupt) as error:
    sys.exit(f"{{type(error).__name__}} {{error}}")
"""


def generate(out: str | Path, **changes) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=NUM_SIMULATIONS,
        seed=1,
        out=out,
        **{**SETTINGS, **changes},
    )


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return contents(
        generate(tmp_path_factory.mktemp("undisturbed") / "data", executor="threads").path
    )


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "script.py"
    path.write_text(SCRIPT)
    return path


def started(script: Path) -> subprocess.Popen[str]:
    """The script at work on a folder beside it, as a group of processes of its own."""
    return subprocess.Popen(
        [sys.executable, str(script), str(script.parent / "data")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def at_work(script: Path) -> subprocess.Popen[str]:
    """The same when shards are finished; it waits there, while workers go on with others."""
    process = started(script)
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) > 2 * SHARD_SIZE:
            return process
    pytest.fail(f"it ended: {process.communicate()[1]}")


def group(number: int) -> list[int]:
    """The processes of a group that still run."""
    found: list[int] = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(") ")[2].split()
        except OSError:
            continue
        if int(fields[2]) == number and fields[0] != "Z":
            found.append(int(folder.name))
    return found


def ignores(number: int, what: signal.Signals) -> bool:
    """Whether a process does not hear a signal."""
    status = Path(f"/proc/{number}/status").read_text()
    mask = int(status.partition("SigIgn:")[2].split()[0], base=16)
    return bool(mask >> (what - 1) & 1)


@linux_only
def test_two_workers_killed_in_the_middle_change_not_one_byte(tmp_path, undisturbed):
    told: list[int] = []
    with Killer(tmp_path / "data", kills=2) as killer:
        generate(
            tmp_path / "data",
            executor="processes",
            workers=2,
            progress=lambda done, _: told.append(done),
        )
    assert len(killer.killed) == 2
    assert all("overtaking.data.processes" in name for name in killer.killed.values())
    assert contents(tmp_path / "data") == undisturbed
    assert told == sorted(told)
    assert told[-1] == NUM_SIMULATIONS


@linux_only
def test_a_shard_of_which_every_worker_dies_is_given_up(tmp_path, monkeypatch, undisturbed):
    monkeypatch.setattr(processes, "MAX_ATTEMPTS", 2)
    with (
        Killer(tmp_path / "data", kills=1000),
        pytest.raises(DatasetError, match=r"got 2 that died, the last by SIGKILL; see whether"),
    ):
        generate(tmp_path / "data", executor="processes", workers=1)
    assert not (tmp_path / "data" / PARTIAL).exists()
    ot.resume_dataset(tmp_path / "data", executor="threads")
    assert contents(tmp_path / "data") == undisturbed


def test_a_script_that_guards_nothing_runs_once(script, undisturbed):
    process = started(script)
    said, complaints = process.communicate(timeout=120)
    assert (process.returncode, complaints) == (0, "")
    assert said.split()[0] == "0"
    assert said.count(f"{NUM_SIMULATIONS}\n") == 1
    assert contents(script.parent / "data") == undisturbed


@linux_only
def test_workers_end_with_a_parent_that_is_killed(script, undisturbed):
    process = at_work(script)
    workers = set(group(process.pid)) - {process.pid}
    assert len(workers) == 2
    assert all(ignores(worker, signal.SIGINT) for worker in workers)
    while any((script.parent / "data" / PARTIAL).glob("*/*.parquet")):
        time.sleep(0.01)  # Who is in the middle of a shard would end when it answers.
    process.kill()
    process.communicate(timeout=60)
    assert eventually(lambda: not group(process.pid))
    finished = (script.parent / "data").glob("simulations/*.parquet")
    before = {path: path.stat().st_mtime_ns for path in finished}
    assert before
    ot.resume_dataset(script.parent / "data", executor="processes", workers=2)
    assert contents(script.parent / "data") == undisturbed
    assert {path: path.stat().st_mtime_ns for path in before} == before


@linux_only
@pytest.mark.parametrize(
    ("by", "named"), [(signal.SIGTERM, "DatasetError"), (signal.SIGINT, "KeyboardInterrupt")]
)
def test_a_group_asked_to_end_says_one_line_and_leaves_nobody(by, named, script):
    process = at_work(script)
    os.killpg(process.pid, by)  # As a terminal does with Ctrl-C.
    _, complaints = process.communicate(timeout=60)
    assert process.returncode == 1
    assert re.fullmatch(
        rf"{named} .*: data set: expected 8 shards, got \d .*--resume .*\n", complaints
    )
    assert not group(process.pid)
    assert not (script.parent / "data" / PARTIAL).exists()


def test_a_balanced_data_set_on_another_road_is_the_same(tmp_path):
    settings = {
        "num_simulations": 60,
        "shard_size": 20,
        "balance": ClassBalance(policy="paper", allows_missing=True, candidates=400),
        "road": load_road("motorway"),
        "overrides": {"time.horizon_s": 8.0, "time.attempt_deadline_s": 8.0},
    }
    made = [
        ot.generate_dataset(
            "pinto2023-physical", seed=2, out=tmp_path / executor, executor=executor, **settings
        )
        for executor in ("threads", "processes")
    ]
    assert len(made[0]) >= 25
    assert contents(made[0].path) == contents(made[1].path)


def test_a_store_is_filled_with_the_same(tmp_path, undisturbed, monkeypatch):
    monkeypatch.setitem(fsspec.config.conf, "local", {"auto_mkdir": True})
    monkeypatch.setenv("FSSPEC_LOCAL", '{"auto_mkdir": true}')  # The same for workers.
    generate(f"local://{tmp_path}/data", executor="processes", workers=2)
    assert contents(tmp_path / "data") == {
        name: data for name, data in undisturbed.items() if name != ".lock"
    }


@needs_sumo
def test_every_process_has_a_sumo_of_its_own(tmp_path):
    made = [
        ot.generate_dataset(
            "pinto2023-physical",
            num_simulations=4,
            seed=2,
            out=tmp_path / executor,
            **(SETTINGS | {"shard_size": 2, "simulator": "sumo", "executor": executor}),
        )
        for executor in ("threads", "processes")
    ]
    assert contents(made[0].path) == contents(made[1].path)


def test_a_place_that_workers_do_not_see_is_refused():
    with pytest.raises(DatasetError, match=r"expected one that every worker sees, got nothing"):
        generate(f"memory://{uuid.uuid4()}", executor="processes", workers=1)


def troubled_data(trouble: str, out: Path) -> ot.Dataset:
    given = load_specification(
        "pinto2023-physical", {"time.horizon_s": 0.2, "time.attempt_deadline_s": 0.2}
    )
    recipe = Recipe(
        spec=given,
        road=load_road(given.road),
        seed=1,
        num_simulations=20,
        keep=Keep.FEATURES,
        shard_size=10,
    )
    executor = ProcessExecutor(workers=1)
    return writing.generate(recipe, Folder(out), troubled(trouble), executor=executor)


def test_what_a_worker_prints_is_neither_heard_nor_in_the_way(tmp_path, capfd):
    assert len(troubled_data("prints", tmp_path / "data")) == 20
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("trouble", "kind", "said"),
    [
        ("runs_out_of_room", DatasetError, r"/data/part: writing: .*got No space left on device"),
        ("is_wrong", RuntimeError, r"\AUnknown: one over nothing\nIn a worker process:\nTraceback"),
        ("ends", DatasetError, r"that died, the last with exit status 3: out of luck; see whether"),
    ],
)
def test_what_goes_wrong_in_a_worker_is_told_as_if_it_had_gone_wrong_here(
    trouble, kind, said, tmp_path, monkeypatch, capfd
):
    monkeypatch.setattr(processes, "MAX_ATTEMPTS", 1)
    with pytest.raises(kind, match=said) as caught:
        troubled_data(trouble, tmp_path / "data")
    if trouble == "is_wrong":
        assert "tests/support/troubled.py" in caught.value.__notes__[0]
    assert not (tmp_path / "data" / PARTIAL).exists()
    assert capfd.readouterr() == ("", "")


def test_a_worker_that_cannot_start_is_told_of(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(DatasetError, match=r"expected one that starts, .*add --executor threads"):
        generate(tmp_path / "data", executor="processes", workers=1)
