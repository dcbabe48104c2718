"""A folder of recordings is labelled by anybody, in any number of calls, to the same bytes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.data import collection
from overtaking.recordings.formats import FORMATS

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci

COLUMNS: dict[str, Any] = {
    "recording": {"length_m": 4.4, "width_m": 1.8},
    "columns": {"vehicle": "id", "time": "t [s]", "x": "x [m]", "y": "y [m]"},
}
COUNT = 7
BAD = "03.csv"


def recording(shift: float) -> str:
    """Vehicle 1 overtakes vehicle 2."""
    time = np.arange(0.0, 20.0, 0.1)
    rows = ["id,t,x,y"]
    for number, start, speed in ((1, 0.0, 30.0), (2, 40.0 + shift, 24.0), (3, -60.0, 27.0)):
        aside = np.clip((time - 2.0) / 3.0, 0.0, 1.0) - np.clip((time - 14.0) / 3.0, 0.0, 1.0)
        across = 3.5 * aside if number == 1 else np.zeros_like(time) + 3.5 * (number == 3)
        rows += [
            f"{number},{t:.1f},{start + speed * t:.3f},{y:.3f}"
            for t, y in zip(time, across, strict=True)
        ]
    return "\n".join(rows) + "\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("recordings")
    for number in range(COUNT):
        text = recording(0.5 * number) if f"{number:02d}.csv" != BAD else "id,t\n1,x\n"
        (made / f"{number:02d}.csv").write_text(text, encoding="utf-8")
    (made / "notes.md").write_text("No recording.", encoding="utf-8")
    return made


@pytest.fixture(autouse=True)
def _small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collection, "SHARD_SIZE", 2)


def files(out: Path) -> dict[str, bytes]:
    found = {str(each.relative_to(out)): each for each in out.rglob("*") if each.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if name != ".lock"}


def labelled(folder: Path, out: Path, **given: Any) -> dict[str, Any]:
    return ot.label_recordings("table", folder, out, columns=COLUMNS, **given)


@pytest.fixture(scope="module")
def once(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("once") / "labels"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(collection, "SHARD_SIZE", 2)
        labelled(folder, out, executor="threads")
    return out


def test_labels_are_those_of_the_recordings_one_by_one(folder, once, tmp_path):
    said = json.loads((once / "recordings.json").read_text())
    assert (said["recordings"], said["refused"], said["complete"]) == (COUNT, 1, True)
    together = pd.read_parquet(once / "labels")
    assert said["simulations"] == together.simulation.nunique() > 0
    for number in (0, 5):
        alone = ot.import_recording(
            "table", folder / f"{number:02d}.csv", tmp_path / f"{number}", columns=COLUMNS
        )
        mine = together[together.simulation // collection.NUMBERS == number]
        assert mine["class"].astype(str).tolist() == alone.labels()["class"].astype(str).tolist()
        assert (mine.simulation % collection.NUMBERS).tolist() == alone.labels().simulation.tolist()
    where = pd.read_parquet(once / "simulations").source_recording
    assert where.str.startswith("05.csv: ").any()


def test_a_recording_that_cannot_be_used_is_named_with_its_error(once):
    result = json.loads((once / "recordings.json").read_text())
    assert list(result["failed"]) == [BAD]
    assert "expected a column x" in result["failed"][BAD]
    assert (result["refused"], result["faults"]) == (1, 0)
    assert not list(once.glob("fault-*"))


@pytest.mark.parametrize(
    ("executor", "workers"),
    [("processes", 2), pytest.param("ray", 2, marks=pytest.mark.ci)],
)
def test_every_executor_writes_the_same_bytes(folder, once, tmp_path, executor, workers):
    labelled(folder, tmp_path / "labels", executor=executor, workers=workers)
    assert files(tmp_path / "labels") == files(once)


def test_what_was_interrupted_is_completed_to_the_same_bytes(folder, once, tmp_path):
    out = tmp_path / "labels"

    def stop(done: int, total: int) -> None:
        if done >= 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        labelled(folder, out, executor="threads", progress=stop)
    with pytest.raises(DatasetError, match="--resume"):
        labelled(folder, out, executor="threads")
    kept = {each: each.stat().st_mtime_ns for each in (out / "simulations").iterdir()}
    assert 0 < len(kept) < 4
    labelled(folder, out, executor="threads", resume=True)
    assert files(out) == files(once)
    assert {each: each.stat().st_mtime_ns for each in kept} == kept
    (out / "labels" / "part-00001.parquet").write_bytes(b"damaged")
    labelled(folder, out, executor="threads", resume=True)
    assert files(out) == files(once)


def test_every_format_has_an_ending():
    assert collection.ENDINGS.keys() == FORMATS.keys()


def test_other_recordings_are_not_mixed_in(folder, once, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "a.csv").write_text(recording(0.0))
    with pytest.raises(DatasetError, match="the labels of these recordings"):
        labelled(tmp_path / "other", once, resume=True)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "mine.txt").touch()
    with pytest.raises(DatasetError, match=r"mine\.txt"):
        labelled(folder, tmp_path / "taken")


def test_a_call_that_cannot_succeed_leaves_nothing(folder, tmp_path):
    out = tmp_path / "labels"
    with pytest.raises(ConfigError, match="lanelet"):
        labelled(folder, out, executor="threads", lanelet=3)
    assert not out.exists() or not files(out)
    with pytest.raises(ConfigError, match="none"):
        labelled(tmp_path, out)


def test_the_command_labels_a_folder(folder, once, tmp_path, capsys):
    from overtaking.cli import main

    columns = tmp_path / "map.toml"
    columns.write_text(
        '[recording]\nlength_m = 4.4\nwidth_m = 1.8\n[columns]\nvehicle = "id"\ntime = "t [s]"\n'
        'x = "x [m]"\ny = "y [m]"\n'
    )
    words = ["import", "table", folder, "--columns", columns, "--out", tmp_path / "out", "--json"]
    assert main([str(each) for each in [*words, "--executor", "threads"]]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["refused"] == 1
    ours, theirs = (pd.read_parquet(each / "findings") for each in (tmp_path / "out", once))
    pd.testing.assert_frame_equal(ours, theirs)
    file = [*words[:2], folder / "00.csv", *words[3:5], "--out", tmp_path / "one", "--workers", "2"]
    assert main([str(each) for each in file]) == 2
    assert "a folder of recordings" in capsys.readouterr().err
