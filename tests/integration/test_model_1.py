"""A data set that model version 1 made.

`tests/data/model_1.tar.xz` came from `overtaking generate -n 3 --seed 11 --keep frames`
of that version.
"""

from __future__ import annotations

import json
import shutil
import tarfile
from pathlib import Path
from typing import Any

import pytest

from overtaking import api
from overtaking.cli import main
from overtaking.core.errors import DatasetError
from overtaking.show.report.files import ReportFolder

PACKED = Path(__file__).parents[1] / "data" / "model_1.tar.xz"
SIZE = 3
INSTALL = r"install overtaking 0\.1\.0 with engine 1, which made it"


@pytest.fixture
def old(tmp_path: Path) -> Path:
    with tarfile.open(PACKED) as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path / "model_1"


def change(folder: Path, **changes: object) -> None:
    """Change what the manifest says of the data set, and of its tables."""
    file = folder / "dataset.json"
    manifest = json.loads(file.read_text(encoding="utf-8"))
    manifest["identity"].update(changes)
    for shard in manifest["shards"]:
        shard["tables"] = {
            name: facts for name, facts in shard["tables"].items() if (folder / name).exists()
        }
    file.write_text(json.dumps(manifest), encoding="utf-8")


@pytest.fixture
def without_frames(old: Path) -> Path:
    for name in ("states", "frames"):
        shutil.rmtree(old / name)
    change(old, keep="features")
    return old


def test_it_is_read(old: Path):
    data = api.load_dataset(old)
    data.verify()
    assert data.manifest.identity.simulator_version == "1"
    assert len(data) == len(data.features()) == SIZE
    assert len(data.frames(1)) == int(data[1].num_frames[0]) > 100


@pytest.mark.ci
def test_it_is_asked(old: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["sql", str(old), "SELECT count(*) AS n FROM simulations", "--json"]) == 0
    assert str(SIZE) in capsys.readouterr().out


@pytest.mark.ci
def test_it_is_reported(old: Path, monkeypatch: pytest.MonkeyPatch):
    draw = ReportFolder.figure

    def figure(folder: ReportFolder, name: str, *given: Any, **more: Any) -> str:
        """Only the examples show what the data set alone has; the others take 20 s of a core."""
        return draw(folder, name, *given, **more) if name.startswith("example-") else ""

    monkeypatch.setattr(ReportFolder, "figure", figure)
    assert main(["report", str(old), "--quiet"]) == 0
    page = (old / "report" / "index.html").read_text(encoding="utf-8")
    drawn = {path.stem for path in (old / "report" / "figures").glob("*.svg")}
    assert {
        f"example-{name.lower().replace('_', '-')}"
        for name in set(api.load_dataset(old).features()["CLASS"])
    } == drawn
    assert "cannot be drawn" not in page


def test_it_is_labelled_again_and_only_a_departure_has_a_new_name(old: Path):
    kept = ["simulation", "policy", "outcome", "num_broken", "num_undecidable", "class_weight"]
    data = api.load_dataset(old)
    before, intended = data.labels(), data.events()["was_intended"]
    assert intended.isna().all()
    api.relabel_dataset(old)
    data = api.load_dataset(old)
    data.verify()
    after, events = data.labels(), data.events()
    assert after[kept].equals(before[kept])
    departed = (before["detail"] == "left_road").to_numpy()
    assert departed.any()
    assert not departed.all()
    for name in ("class", "detail"):
        assert (after[name].astype(str) == before[name].astype(str))[~departed].all()
    assert set(after["detail"][departed]) == {"departed"}
    named = {"paper": "Unsuccess_ncol", "default": "Unsuccess_dep", "strict": "Unsuccess_dep"}
    assert dict(zip(after["policy"][departed], after["class"][departed], strict=True)) == named
    assert events["was_intended"].notna().equals(events["event"] == "attempt")


def test_frames_that_it_did_not_keep_are_refused(without_frames: Path):
    data = api.load_dataset(without_frames)
    assert len(data.features()) == SIZE
    with pytest.raises(DatasetError, match=INSTALL) as caught:
        data.frames(1)
    assert "\n" not in str(caught.value).strip()


def test_it_is_not_resumed(old: Path):
    manifest = json.loads((old / "dataset.json").read_text(encoding="utf-8"))
    manifest |= {"complete": False, "content_hash": None, "shards": []}
    (old / "dataset.json").write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(DatasetError, match=INSTALL) as caught:
        api.resume_dataset(old)
    assert "simulator_version of the data set: expected 2, got 1" in str(caught.value)
    assert "\n" not in str(caught.value).strip()
