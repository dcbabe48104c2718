"""The findings of a recording stand in an import report, in memory and in data sets."""

from __future__ import annotations

import errno
import json
import pickle
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from tests.support.recordings import OVERTAKE, states

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import DatasetError, ImportFormatError
from overtaking.data.import_report import FILE_NAME, report_frame, warn_about
from overtaking.data.location import Folder
from overtaking.model.batch import batch_fields, concatenate
from overtaking.model.import_report import ImportFinding, summarize_findings

if TYPE_CHECKING:
    from pathlib import Path

COLUMNS = ["recording", "check", "vehicle", "first_time_s", "rows", "consequence", "detail"]
MAP = {
    "vehicle": "id",
    "time": "t [s]",
    "x": "x [m]",
    "y": "y [m]",
    "length": "length [m]",
    "width": "width [m]",
    "vx": "vx [m/s]",
    "vy": "vy [m/s]",
}
SENTENCE = "likely the factor 3.6 (km/h and m/s)"


def table(speed_factor: float = 1.0) -> pd.DataFrame:
    """A recording whose speeds are in m/s if the factor is 1."""
    rows = pd.DataFrame(states([replace(mover, s=mover.s + 100.0) for mover in OVERTAKE]))
    return rows.assign(vx=rows.vx * speed_factor, vy=rows.vy * speed_factor)


@pytest.fixture
def contradictory() -> pd.DataFrame:
    return table(3.6)


def read(frame: pd.DataFrame, **options: Any) -> ot.Trajectories:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ot.RecordingWarning)
        return ot.Trajectories.from_table(frame, columns=MAP, **options)


def finding(recording: str = "a.csv", **changes: Any) -> ImportFinding:
    values: dict[str, Any] = {
        "recording": recording,
        "check": "gaps",
        "vehicle": "12 (2)",
        "first_time_s": 8.1,
        "rows": 3,
        "consequence": "corrected",
        "detail": "interpolated.",
    }
    return ImportFinding(**values | changes)


def test_trajectories_have_a_report_with_the_findings(contradictory):
    report = read(contradictory).import_report
    assert list(report.columns) == COLUMNS
    assert report["rows"].dtype == np.int64
    assert report.first_time_s.dtype == np.float64
    (row,) = report.to_dict("records")
    assert (row["check"], row["consequence"], row["rows"]) == ("speeds", "reported", 1200)
    assert pd.isna(row["vehicle"])
    assert np.isnan(row["first_time_s"])
    assert SENTENCE in row["detail"]


def test_a_report_without_findings_has_the_columns():
    for runs in (read(table()), ot.simulate(ot.sample("motorway", num_simulations=2, seed=1))):
        assert list(runs.import_report.columns) == COLUMNS
        assert len(runs.import_report) == 0


def test_the_report_names_vehicle_and_time():
    (row,) = report_frame([finding()]).to_dict("records")
    assert (row["vehicle"], row["first_time_s"], row["rows"]) == ("12 (2)", 8.1, 3)


def test_the_report_is_no_field_of_the_batch(contradictory):
    assert [name for name in batch_fields(ot.Trajectories) if "import" in name] == []
    runs = read(contradictory)
    assert runs.equals(runs.replace(import_findings=()))


def test_selecting_pickling_and_replacing_keep_the_report(contradictory):
    runs = read(contradictory)
    kept = [runs.select([0]), runs.replace(unknown=runs.unknown), pickle.loads(pickle.dumps(runs))]
    assert all(one.import_findings == runs.import_findings != () for one in kept)


def test_joining_batches_joins_their_reports(contradictory):
    runs = read(contradictory)
    other = runs.replace(import_findings=(finding("b.csv"), *runs.import_findings))
    joined = concatenate([runs.select([0]), other, runs])
    assert joined.import_findings == (*runs.import_findings, finding("b.csv"))


def test_a_warning_comes_once_and_points_to_the_caller(contradictory):
    with pytest.warns(ot.RecordingWarning, match="speeds: reported") as caught:
        ot.Trajectories.from_table(contradictory, columns=MAP)
    assert [warning.filename for warning in caught] == [__file__]


def test_a_recording_without_findings_causes_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ot.Trajectories.from_table(table(), columns=MAP)


def test_a_recording_with_several_findings_causes_one_warning():
    with pytest.warns(ot.RecordingWarning) as caught:
        warn_about([finding(), finding(check="kinds"), finding(vehicle="3")])
    (warning,) = caught
    assert str(warning.message) == (
        "a.csv: 3 findings, the first: gaps: corrected: vehicle 12 (2) at 8.1 s: interpolated.; "
        "import_report lists them"
    )


@pytest.mark.parametrize(("num_recordings", "num_warnings"), [(9, 9), (10, 10), (11, 11), (40, 11)])
def test_ten_warnings_are_for_recordings_and_one_for_the_others(num_recordings, num_warnings):
    with pytest.warns(ot.RecordingWarning) as caught:
        warn_about([finding(f"{number}.csv") for number in range(num_recordings) for _ in "ab"])
    texts = [str(warning.message) for warning in caught]
    assert len(texts) == num_warnings
    if num_recordings > 10:
        assert texts[-1].startswith(f"{num_recordings - 10} further recordings")


def test_lines_are_one_for_each_check():
    findings = [
        finding(),
        finding(vehicle="3", first_time_s=2.0, rows=5),
        finding("b.csv", check="sizes", vehicle=None, first_time_s=None, consequence="reported"),
        finding("b.csv", rows=1),
    ]
    assert summarize_findings(findings) == [
        "2 recordings: gaps: corrected, 9 rows, 3 findings; the first: "
        "a.csv: vehicle 12 (2) at 8.1 s: interpolated.",
        "b.csv: sizes: reported, 3 rows: interpolated.",
    ]


def test_strict_refuses_a_table_with_a_finding(contradictory):
    with pytest.raises(ImportFormatError, match="strict: expected no finding, got 1, the first: "):
        read(contradictory, strict=True)
    assert len(read(table(), strict=True).import_report) == 0


# In data sets


@pytest.fixture
def recorded(contradictory, tmp_path: Path) -> Path:
    path = tmp_path / "tracks.csv"
    contradictory.to_csv(path, index=False)
    return path


@pytest.mark.ci
def test_a_data_set_keeps_the_report_with_a_hash_of_its_own(recorded, tmp_path):
    with pytest.warns(ot.RecordingWarning, match="speeds") as caught:
        data = ot.import_recording("table", recorded, tmp_path / "data", columns=MAP)
    assert [warning.filename for warning in caught] == [__file__]
    assert data.import_report.check.tolist() == ["speeds"]
    assert data.trajectory(0).import_findings == data.import_findings
    assert data.manifest.import_report is not None
    assert data.manifest.import_report.rows == 1
    assert data.manifest.identity.simulator_version == "3"
    data.verify()

    ot.relabel_dataset(tmp_path / "data")
    again = ot.load_dataset(tmp_path / "data")
    assert again.import_findings == data.import_findings
    assert again.manifest.import_report == data.manifest.import_report

    report = tmp_path / "data" / FILE_NAME
    report.write_text(report.read_text("utf-8").replace("3.6", "3.7"), encoding="utf-8")
    damaged = ot.load_dataset(tmp_path / "data")
    with pytest.raises(DatasetError, match=r"import_report\.json: import report: .* other bytes"):
        damaged.verify()
    with pytest.raises(DatasetError, match="import report"):
        _ = damaged.import_report
    report.unlink()
    with pytest.raises(DatasetError, match="import report"):
        ot.load_dataset(tmp_path / "data").verify()


@pytest.mark.ci
def test_a_report_that_cannot_be_read_is_not_called_damaged(recorded, tmp_path, monkeypatch):
    with pytest.warns(ot.RecordingWarning):
        ot.import_recording("table", recorded, tmp_path / "data", columns=MAP)
    data, opened = ot.load_dataset(tmp_path / "data"), Folder.open

    def refuse(self: Folder, name: str) -> Any:
        if name == FILE_NAME:
            raise PermissionError(errno.EACCES, "Permission denied")
        return opened(self, name)

    monkeypatch.setattr(Folder, "open", refuse)
    with pytest.raises(DatasetError, match="Permission denied; check its permissions"):
        data.verify()


@pytest.mark.ci
def test_the_report_is_no_part_of_the_content_hash(recorded, tmp_path, monkeypatch):
    hashes = set()
    for name, findings in (("one", ()), ("two", (finding(),))):
        monkeypatch.setattr(
            "overtaking.recordings.scenes.Parts.import_findings", property(lambda _, f=findings: f)
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ot.RecordingWarning)
            data = ot.import_recording("table", recorded, tmp_path / name, columns=MAP)
        assert data.import_findings == findings
        hashes.add(data.content_hash)
    assert len(hashes) == 1


@pytest.mark.ci
def test_a_data_set_without_a_report_has_an_empty_one(recorded, tmp_path):
    with pytest.warns(ot.RecordingWarning):
        ot.import_recording("table", recorded, tmp_path / "data", columns=MAP)
    manifest = tmp_path / "data" / "dataset.json"
    content = json.loads(manifest.read_text("utf-8"))
    del content["import_report"]
    manifest.write_text(json.dumps(content), encoding="utf-8")
    (tmp_path / "data" / FILE_NAME).unlink()
    data = ot.load_dataset(tmp_path / "data")
    data.verify()
    assert list(data.import_report.columns) == COLUMNS
    assert len(data.import_report) == len(data.trajectory(0).import_report) == 0


@pytest.mark.ci
def test_strict_writes_nothing_and_changes_no_data_set(recorded, tmp_path):
    with pytest.raises(ImportFormatError, match="strict"):
        ot.import_recording("table", recorded, tmp_path / "data", columns=MAP, strict=True)
    assert list(tmp_path.iterdir()) == [recorded]
    table().to_csv(recorded, index=False)
    fingerprints = {
        ot.import_recording(
            "table", recorded, tmp_path / f"strict-{strict}", columns=MAP, strict=strict
        ).manifest.identity.fingerprint
        for strict in (False, True)
    }
    assert len(fingerprints) == 1


@pytest.mark.ci
def test_the_command_prints_one_line_per_check_and_the_report_as_json(recorded, tmp_path, capsys):
    columns = tmp_path / "map.toml"
    text = "\n".join(f'{name} = "{cell}"' for name, cell in MAP.items())
    columns.write_text(f"[columns]\n{text}\n", encoding="utf-8")
    words = ["import", "table", recorded, "--columns", columns, "--out", tmp_path / "out", "--json"]
    words = [str(word) for word in words]
    assert main([*words, "--strict"]) == 2
    captured = capsys.readouterr()
    assert "with strict: expected no finding" in captured.err
    assert not (tmp_path / "out").exists()
    assert main(words) == 0
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("warning: map tracks: speeds: reported, 1,200 rows: ")
    (row,) = json.loads(captured.out)["import_report"]
    assert list(row) == COLUMNS
    assert (row["check"], row["vehicle"], row["first_time_s"]) == ("speeds", None, None)
