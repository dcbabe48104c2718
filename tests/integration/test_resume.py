"""Whatever ends a `generate`, `--resume` completes it to the content of an undisturbed run."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import duckdb
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import overtaking as ot
from overtaking.core.errors import DatasetError, LockedError
from overtaking.data.tables.schemas import KEYS

pytestmark = pytest.mark.ci

NUM_SIMULATIONS = 24
SHARD_SIZE = 8
SHORT = {"time.horizon_s": 0.2, "time.attempt_deadline_s": 0.2}
SETTINGS = {"overrides": SHORT, "shard_size": SHARD_SIZE}

GENERATE = f"""
import sys
import overtaking as ot
def progress(done, total):
    print(done, flush=True)
    if done == int(sys.argv[2]):
        sys.stdin.read()
try:
    ot.generate_dataset("pinto2023-physical", num_simulations={NUM_SIMULATIONS}, seed=1,
                 out=sys.argv[1], progress=progress, **{SETTINGS!r})
except (Exception, KeyboardInterrupt) as error:
    print(type(error).__name__, error, file=sys.stderr)
    sys.exit(2)
"""


def generate(out: Path, *, seed: int = 1, resume: bool = False) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=NUM_SIMULATIONS,
        seed=seed,
        out=out,
        resume=resume,
        **SETTINGS,
    )


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    return generate(tmp_path_factory.mktemp("undisturbed") / "data")


@pytest.fixture
def copy(undisturbed: ot.Dataset, tmp_path: Path) -> Path:
    """A copy of the data set, to be damaged."""
    return shutil.copytree(undisturbed.path, tmp_path / "data")


def start(out: Path, hold_at: int) -> subprocess.Popen[str]:
    """A process that generates, and waits for ever after so many simulations."""
    process = subprocess.Popen(
        [sys.executable, "-c", GENERATE, str(out), str(hold_at)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) == hold_at:
            return process
    pytest.fail(f"it never got to {hold_at}: {process.communicate()[1]}")


def end(process: subprocess.Popen[str], by: signal.Signals) -> tuple[int, str]:
    """Send a signal; exit status and what was said on stderr."""
    process.send_signal(by)
    _, said = process.communicate(timeout=60)
    return process.returncode, said


def assert_same(data: ot.Dataset, undisturbed: ot.Dataset) -> None:
    """Same values, same bytes, every key once for whoever reads the folders, nothing left over."""
    data.verify()
    assert data.content_hash == undisturbed.content_hash
    files = {path.relative_to(data.path) for path in data.path.rglob("*")}
    assert files == {path.relative_to(undisturbed.path) for path in undisturbed.path.rglob("*")}
    kept = {table: keys for table, keys in KEYS.items() if table in data.manifest.identity.tables}
    for table, keys in kept.items():
        names = ", ".join(keys)
        query = f"select count(*), count(distinct ({names})) from '{data.path}/{table}/*.parquet'"
        rows, distinct = duckdb.connect().execute(query).fetchone() or (0, 1)
        assert rows == distinct == undisturbed.table(table).num_rows


def test_a_process_killed_at_any_moment_loses_nothing_and_repeats_nothing(repository: Path):
    """Six of the moments of the full proof, which `make test-all` takes."""
    done = subprocess.run(
        [
            *(sys.executable, str(repository / "benchmarks" / "kill_resume.py")),
            *("--kills", "6", "--horizon", "0.2"),
            *("--simulations", str(NUM_SIMULATIONS), "--shard-size", str(SHARD_SIZE)),
            *("--seed", "1"),
        ],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("6 kills, 6 resumed to the same content"), done.stdout


@pytest.mark.parametrize("hold_at", [8, 16])
def test_a_killed_process_is_resumed_in_another(hold_at: int, undisturbed, tmp_path: Path):
    process = start(tmp_path / "data", hold_at)
    code, _ = end(process, signal.SIGKILL)
    assert code == -signal.SIGKILL
    assert any((tmp_path / "data" / ".partial").iterdir())
    assert_same(generate(tmp_path / "data", resume=True), undisturbed)


@pytest.mark.parametrize(
    ("by", "named"), [(signal.SIGTERM, "DatasetError"), (signal.SIGINT, "KeyboardInterrupt")]
)
def test_a_process_asked_to_end_cleans_up_and_says_how_to_go_on(
    by: signal.Signals, named: str, undisturbed, tmp_path: Path
):
    out = tmp_path / "data"
    process = start(out, 16)
    code, said = end(process, by)
    assert code == 2
    assert said.count("\n") == 1
    assert re.match(rf"{named} {re.escape(str(out))}: data set: expected 3 shards, got 1 ", said)
    assert "--resume" in said
    assert not (out / ".partial").exists()
    assert len(list((out / "simulations").iterdir())) == 1
    assert_same(generate(out, resume=True), undisturbed)


def test_what_is_finished_is_not_made_again(tmp_path: Path):
    end(start(tmp_path / "data", 24), signal.SIGKILL)
    first = tmp_path / "data" / "states" / "part-00000.parquet"
    before = first.stat().st_mtime_ns
    generate(tmp_path / "data", resume=True)
    assert first.stat().st_mtime_ns == before


def test_two_processes_do_not_write_one_folder(undisturbed, tmp_path: Path):
    out = tmp_path / "data"
    process = start(out, 8)
    with pytest.raises(LockedError, match=f"got process {process.pid}; wait") as caught:
        generate(out, resume=True)
    assert "\n" not in str(caught.value)
    process.communicate(input="", timeout=60)
    assert process.returncode == 0
    assert_same(ot.load_dataset(out), undisturbed)


def test_an_unfinished_data_set_is_not_overwritten_without_being_asked_to(tmp_path: Path):
    end(start(tmp_path / "data", 16), signal.SIGKILL)
    with pytest.raises(DatasetError, match=r"got one that is not finished; .*--resume"):
        generate(tmp_path / "data")
    with pytest.raises(DatasetError, match=r"got one that is not finished; .*--resume"):
        ot.load_dataset(tmp_path / "data")


def test_another_recipe_does_not_go_on_with_it(tmp_path: Path):
    end(start(tmp_path / "data", 16), signal.SIGKILL)
    with pytest.raises(DatasetError, match="seed of the data set: expected 2, got 1; choose"):
        generate(tmp_path / "data", seed=2, resume=True)


def test_the_manifest_alone_says_how_to_go_on(undisturbed, tmp_path: Path):
    end(start(tmp_path / "data", 16), signal.SIGKILL)
    assert_same(ot.resume_dataset(tmp_path / "data"), undisturbed)


def test_resuming_what_is_complete_changes_nothing(undisturbed, copy: Path):
    before = {path: path.stat().st_mtime_ns for path in copy.rglob("*.parquet")}
    manifest = (copy / "dataset.json").read_text()
    assert_same(ot.resume_dataset(copy), undisturbed)
    assert {path: path.stat().st_mtime_ns for path in copy.rglob("*.parquet")} == before
    assert (copy / "dataset.json").read_text() == manifest


def test_nothing_to_resume_says_so(tmp_path: Path):
    with pytest.raises(DatasetError, match=r"expected its folder, which holds dataset\.json"):
        ot.resume_dataset(tmp_path)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 0x10
    path.write_bytes(data)


def empty(path: Path) -> None:
    path.write_bytes(b"")


DAMAGES = [cut, flip, empty, Path.unlink]


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("table", ["states", "vehicles", "simulations"])
def test_a_damaged_file_is_found_and_named_and_written_again(
    damage, table: str, undisturbed, copy: Path
):
    file = copy / table / "part-00001.parquet"
    damage(file)
    data = ot.load_dataset(copy)
    with pytest.raises(DatasetError, match="the bytes that were written, got") as caught:
        data.verify()
    assert "\n" not in str(caught.value)
    assert str(file) in str(caught.value)
    with pytest.raises(DatasetError, match="the bytes that were written, got"):
        data.table(table)
    assert_same(ot.resume_dataset(copy), undisturbed)


@pytest.mark.parametrize("damage", DAMAGES)
def test_other_simulations_can_be_read_beside_a_damaged_file(damage, undisturbed, copy: Path):
    damage(copy / "states" / "part-00001.parquet")
    data = ot.load_dataset(copy)
    assert data.states(0).equals(undisturbed.states(0))
    with pytest.raises(DatasetError, match=r"part-00001\.parquet"):
        data.states(8)


def forget(folder: Path) -> None:
    """Let the manifest know nothing of the shards, as before the end of a `generate`."""
    manifest = json.loads((folder / "dataset.json").read_text())
    unfinished = {**manifest, "complete": False, "content_hash": None, "shards": []}
    (folder / "dataset.json").write_text(json.dumps(unfinished))


@given(share=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
@settings(max_examples=15)
def test_any_bit_of_a_commit_mark_may_be_wrong(share, bit, undisturbed, tmp_path_factory):
    copy = shutil.copytree(undisturbed.path, tmp_path_factory.mktemp("flipped") / "data")
    file = copy / "simulations" / "part-00001.parquet"
    data = bytearray(file.read_bytes())
    data[int(share * len(data))] ^= 1 << bit
    file.write_bytes(data)
    with pytest.raises(DatasetError, match="the bytes that were written, got others"):
        ot.load_dataset(copy).verify()
    forget(copy)
    resumed = ot.resume_dataset(copy)
    resumed.verify()
    assert resumed.content_hash == undisturbed.content_hash


def test_a_shard_of_another_data_set_is_not_taken_for_finished(undisturbed, copy: Path, tmp_path):
    other = generate(tmp_path / "other", seed=2)
    for file in other.path.rglob("part-00000.parquet"):
        shutil.copy(file, copy / file.relative_to(other.path))
    forget(copy)
    assert_same(ot.resume_dataset(copy), undisturbed)
