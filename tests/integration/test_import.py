"""`overtaking import` from the outside: a labelled data set, or one line and nothing written."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.recordings import Mover, commonroad, highd

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError, DatasetError, ImportFormatError
from overtaking.data import shards as writing
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.scenes import scenes

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.data.manifest import Source

MOVERS = (
    Mover(number=7, s=20.0, speed=30.0, moves=((4.0, 1), (14.0, 0)), last=250),
    Mover(number=3, s=80.0, speed=24.0, last=250),
    Mover(number=5, s=-30.0, speed=26.0, lane=1, first=20, last=120),
    Mover(number=9, s=300.0, speed=20.0, length=12.0, last=250),
)


def source_of(data: ot.Dataset) -> Source:
    """What the manifest says of the recording."""
    found = data.manifest.identity.source
    assert found is not None
    return found


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "in" / "scene.xml"
    path.parent.mkdir()
    path.write_text(commonroad(MOVERS), encoding="utf-8")
    return path


def test_an_overtake_in_a_recording_is_labelled_like_one_of_ours(scene, tmp_path):
    data = ot.import_recording("commonroad", scene, tmp_path / "data")
    assert source_of(data).counts["candidate_overtakes"] == 1
    assert len(data) == 3
    run = data[0]
    ids = data.simulations()["source_recording"][0]
    assert ids.startswith("ZAM_Hand-1_1_T-1 frames 0 to ")
    assert ids.split("vehicles ")[1].split()[:2] == ["7", "3"]
    # Vehicle 5 comes later and goes earlier: it has no rows where it was not.
    assert run.is_recorded is not None
    slot = ids.split("vehicles ")[1].split().index("5")
    states = data.states(0)
    assert len(states[states["vehicle"] == slot]) == 101
    assert states["wheel_angle_rad"].isna().all()
    labels = data.features()
    assert labels["CLASS"][0].startswith("Success")
    assert data.manifest.identity.seed is None
    assert (tmp_path / "data" / "README.md").read_text(encoding="utf-8").count("scene.xml") == 1


@pytest.mark.ci
def test_what_is_read_back_is_what_was_read(scene, tmp_path):
    found = scenes(read_commonroad(scene))
    data = ot.import_recording("commonroad", scene, tmp_path / "data")
    for numbers, again in data.batches():
        memory = found.trajectories(range(int(numbers[0]), int(numbers[-1]) + 1))
        assert np.array_equal(again.trace_hash, memory.trace_hash)
        slots = memory.states.x.shape[1]
        assert np.array_equal(again.state_mask[:, :slots], memory.state_mask)
        assert np.array_equal(
            again.scenario.vehicles.mass[:, :slots][memory.scenario.vehicles.valid],
            memory.scenario.vehicles.mass[memory.scenario.vehicles.valid],
        )
        assert again.unknown == memory.unknown


def test_what_a_recording_does_not_tell_is_not_made_up_for_the_papers_table(scene, tmp_path):
    data = ot.import_recording("commonroad", scene, tmp_path / "data")
    with pytest.raises(ConfigError, match="does not tell speed_limit, stage, weather"):
        ot.export_dataset(data, tmp_path / "table.csv")
    assert [each.name for each in tmp_path.glob("table*")] == []


@pytest.mark.ci
def test_the_same_file_gives_the_same_content_and_names_its_hash(scene, tmp_path):
    one = ot.import_recording("commonroad", scene, tmp_path / "a")
    two = ot.import_recording("commonroad", scene, tmp_path / "b")
    assert one.content_hash == two.content_hash
    source = source_of(one)
    assert source.files == {"scene.xml": hashlib.sha256(scene.read_bytes()).hexdigest()}
    one.verify()


@pytest.mark.ci
def test_the_command_tells_what_it_found(scene, tmp_path, capsys):
    out = tmp_path / "data"
    line = ["import", "commonroad", str(scene), "--out", str(out), "--attempts-only", "--json"]
    assert main(line) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["counts"]["candidate_overtakes"] == told["simulations"] == 1
    assert told["counts"]["vehicles"] == 4
    assert main(["import", "commonroad", str(scene), "--out", str(tmp_path / "b")]) == 0
    assert "candidate overtakes" in capsys.readouterr().out
    assert main(["show", str(out), "0"]) == 0


@pytest.mark.ci
def test_all_three_formats_are_commands(tmp_path, capsys):
    (tmp_path / "in").mkdir()
    highd(tmp_path / "in")
    track = str(tmp_path / "in" / "01_tracks.csv")
    assert main(["import", "highd", track, "--out", str(tmp_path / "h")]) == 0
    assert set(source_of(ot.load_dataset(tmp_path / "h")).files) == {
        *("01_tracks.csv", "01_tracksMeta.csv", "01_recordingMeta.csv"),
    }
    ot.generate_dataset("pinto2023-physical", num_simulations=3, seed=1, out=tmp_path / "g")
    table = str(tmp_path / "t.csv")
    assert main(["export", str(tmp_path / "g"), "--out", table]) == 0
    assert main(["import", "pinto2023", table, "--out", str(tmp_path / "p")]) == 0
    assert len(ot.load_dataset(tmp_path / "p")) == 3
    folder = str(tmp_path / "scenes")
    assert main(["export", str(tmp_path / "g"), "--format", "commonroad", "--out", folder]) == 0
    capsys.readouterr()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["commonroad", "{scene}", "--direction", "1"], "option for commonroad"),
        (
            ["bvh", "{scene}"],
            "expected commonroad or exid or highd or ngsim or pinto2023 or table, got bvh",
        ),
        (["commonroad", "missing.xml"], "no such file"),
        (["commonroad", "{scene}", "--vehicles", "1"], "expected 2 to 64, got 1"),
        (["commonroad", "{scene}", "--lanelet", "5"], "lanelet 5"),
        (["commonroad", "{empty}"], "well-formed XML"),
    ],
)
def test_a_mistake_costs_one_line_and_leaves_nothing(scene, tmp_path, capsys, arguments, message):
    empty = scene.with_name("empty.xml")
    empty.write_text("", encoding="utf-8")
    words = {"{scene}": str(scene), "{empty}": str(empty)}
    given = [words.get(word, word) for word in arguments]
    out = tmp_path / "data"
    assert main(["import", *given, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"in"}


def test_a_disk_that_fills_up_leaves_nothing(scene, tmp_path, monkeypatch):
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writing, "write_shard", full)
    with pytest.raises(DatasetError, match="No space left"):
        ot.import_recording("commonroad", scene, tmp_path / "data")
    assert {path.name for path in tmp_path.iterdir()} == {"in"}


def test_a_folder_that_holds_something_is_not_touched(scene, tmp_path):
    out = tmp_path / "data"
    out.mkdir()
    (out / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(ConfigError, match="expected a name that is free"):
        ot.import_recording("commonroad", scene, out)
    assert [path.name for path in out.iterdir()] == ["mine.txt"]


@pytest.mark.ci
def test_a_recording_without_any_overtake_says_so(tmp_path):
    path = tmp_path / "still.xml"
    path.write_text(commonroad(MOVERS[1:2]), encoding="utf-8")
    with pytest.raises(ImportFormatError, match="none and no followers"):
        ot.import_recording("commonroad", path, tmp_path / "data")
    path.write_text(commonroad([MOVERS[1], Mover(number=4, s=40.0, speed=24.0)]), encoding="utf-8")
    with pytest.raises(ImportFormatError, match="import the followers too"):
        ot.import_recording("commonroad", path, tmp_path / "data", attempts_only=True)
