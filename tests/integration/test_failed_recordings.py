"""A recording that fails does not end the run of its folder."""

from __future__ import annotations

import errno
import json
import os
import sys
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from tests.support.faulty_road import FAR, faulty_road

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError, DatasetError, ImportFormatError
from overtaking.data import collection, plan, shards
from overtaking.data.tables import files as table_files

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci


class PanicException(BaseException):
    """Stands for a panic of compiled code."""


TIME = np.arange(0.0, 12.05, 0.1).round(1)
COLUMNS: dict[str, Any] = {
    "recording": {"length_m": 4.4, "width_m": 1.8},
    "columns": {"vehicle": "id", "time": "t [s]", "x": "x [m]", "y": "y [m]", "speed": "v [m/s]"},
}


def table(shift: float = 0.0, speed_factor: float = 1.0) -> pd.DataFrame:
    """Vehicle 1 overtakes vehicle 2 on the road `motorway`; vehicle 3 follows vehicle 2."""
    aside = np.clip((TIME - 2.0) / 3.0, 0.0, 1.0) - np.clip((TIME - 8.0) / 3.0, 0.0, 1.0)
    tracks = [
        pd.DataFrame({"id": vehicle, "t": TIME, "x": start + speed * TIME, "y": y, "v": speed})
        for vehicle, start, speed, y in (
            (1, 100.0, 33.0, -10.375 + 3.75 * aside),
            (2, 130.0, 24.0, -10.375),
            (3, 40.0, 24.0, -10.375),
        )
    ]
    rows = pd.concat(tracks, ignore_index=True)
    return rows.assign(x=rows.x + shift, v=rows.v * speed_factor)


def write(folder: Path, name: str, rows: pd.DataFrame | str) -> None:
    folder.mkdir(exist_ok=True)
    if isinstance(rows, str):
        (folder / name).write_text(rows, encoding="utf-8")
    else:
        rows.to_csv(folder / name, index=False)


@pytest.fixture(autouse=True)
def _small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collection, "SHARD_SIZE", 2)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four recordings; 01 is no table, at 02 the faulty road fails."""
    made = tmp_path / "in"
    for number in range(4):
        write(made, f"{number:02d}.csv", table(shift=2.0 * FAR if number == 2 else 0.0))
    write(made, "01.csv", "id,t\n1,x\n")
    return made


def labelled(folder: Path, out: Path, **options: Any) -> dict[str, Any]:
    chosen = {"columns": COLUMNS, "road": faulty_road(), "executor": "threads", **options}
    return ot.label_recordings("table", folder, out, **chosen)


def recordings_of(out: Path) -> list[str]:
    """Files whose simulations are in the result, by the table of simulations."""
    sources = pd.read_parquet(out / "simulations").source_recording
    return sorted({source.partition(": ")[0] for source in sources})


def contents(out: Path) -> dict[str, bytes]:
    files = (path for path in out.rglob("*") if path.is_file() and path.name != ".lock")
    return {str(path.relative_to(out)): path.read_bytes() for path in files}


@pytest.mark.parametrize(("executor", "workers"), [("threads", None), ("processes", 2), ("ray", 2)])
def test_refused_and_faulty_recordings_are_named_and_the_others_labelled(
    folder, tmp_path, executor, workers
):
    out = tmp_path / "out"
    result = labelled(folder, out, executor=executor, workers=workers)
    assert recordings_of(out) == ["00.csv", "03.csv"]
    assert (result["recordings"], result["refused"], result["faults"]) == (4, 1, 1)
    assert sorted(result["failed"]) == ["01.csv", "02.csv"]
    assert "expected a column x" in result["failed"]["01.csv"]
    assert "please report it with fault-00002.txt: ZeroDivisionError" in result["failed"]["02.csv"]
    assert json.loads((out / "recordings.json").read_text("utf-8")) == result
    (fault,) = out.glob("fault-*")
    assert fault.name == "fault-00002.txt"
    text = fault.read_text("utf-8")
    assert text.startswith("Traceback (most recent call last):\n")
    assert text.endswith("ZeroDivisionError: the road is wrong about distant traffic\n")
    assert "faulty_road.py" in text


def test_a_fault_in_the_last_piece_leaves_no_simulation_of_the_recording(
    folder, tmp_path, monkeypatch
):
    monkeypatch.setattr(plan, "RECORDED_CHUNK_SIZE", 1)
    encode, calls = collection.contents, []

    def fail(trajectories: Any, numbers: Any, *arguments: Any) -> Any:
        calls.append(int(numbers[0]))
        if numbers[0] == 3_000_001:
            raise ValueError("in the second piece")
        return encode(trajectories, numbers, *arguments)

    monkeypatch.setattr(collection, "contents", fail)
    out = tmp_path / "out"
    result = labelled(folder, out, road="motorway")
    assert 3_000_000 in calls
    assert recordings_of(out) == ["00.csv"]
    for name in collection.TABLES:
        rows = pd.read_parquet(out / name)
        assert not len(rows) or rows.simulation.max() < 1_000_000
    assert "ValueError: in the second piece" in result["failed"]["03.csv"]


@pytest.mark.parametrize(
    ("error", "reason", "is_fault"),
    [
        (ImportFormatError("00.csv: no lanes"), "00.csv: no lanes", False),
        (ConfigError("no such lanelet"), "no such lanelet", False),
        (PermissionError(errno.EACCES, "Permission denied"), "00.csv: Permission denied", False),
        (MemoryError(), "00.csv: memory: expected a system that grants more", False),
        (KeyError("x"), "KeyError: 'x'", True),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "no"), "UnicodeDecodeError", True),
        (AssertionError(), "AssertionError", True),
        (StopIteration(), "StopIteration", True),
        (PanicException("index out of bounds"), "PanicException: index out of bounds", True),
        (GeneratorExit(), None, None),
    ],
)
def test_any_exception_fails_the_recording_alone(tmp_path, monkeypatch, error, reason, is_fault):
    write(tmp_path / "in", "00.csv", table())

    def fail(*_: Any) -> Any:
        raise error

    monkeypatch.setattr(collection, "read_recording", fail)
    if reason is None:
        with pytest.raises(type(error)):
            labelled(tmp_path / "in", tmp_path / "out")
        return
    result = labelled(tmp_path / "in", tmp_path / "out")
    assert reason in result["failed"]["00.csv"]
    assert (result["refused"], result["faults"]) == ((0, 1) if is_fault else (1, 0))
    assert result["simulations"] == 0


def test_an_interrupt_while_labelling_ends_the_run(folder, tmp_path, monkeypatch):
    encode = collection.contents

    def interrupt(trajectories: Any, numbers: Any, *arguments: Any) -> Any:
        if numbers[0] >= 3_000_000:
            raise KeyboardInterrupt
        return encode(trajectories, numbers, *arguments)

    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(collection, "contents", interrupt)
        with pytest.raises(KeyboardInterrupt):
            labelled(folder, out)
    assert not json.loads((out / "recordings.json").read_text("utf-8"))["complete"]
    labelled(folder, out, resume=True)
    labelled(folder, tmp_path / "once")
    assert contents(out) == contents(tmp_path / "once")


@pytest.mark.parametrize("method", ["write", "finish"])
def test_an_error_in_writing_ends_the_run(folder, tmp_path, monkeypatch, method):
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(table_files.TableWriter, method, full)
    with pytest.raises(DatasetError, match="No space left"):
        labelled(folder, tmp_path / "out")


def test_an_error_in_writing_a_traceback_ends_the_run(folder, tmp_path, monkeypatch):
    put_text = collection.Folder.put_text

    def full(self: Any, name: str, text: str, **options: Any) -> None:
        if name.startswith("fault-"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        put_text(self, name, text, **options)

    monkeypatch.setattr(collection.Folder, "put_text", full)
    with pytest.raises(DatasetError, match="No space left"):
        labelled(folder, tmp_path / "out")


# A second try


def test_resuming_labels_recordings_that_were_repaired(folder, tmp_path):
    out = tmp_path / "out"
    first = labelled(folder, out)
    kept = (out / "simulations" / "part-00000.parquet").stat().st_mtime_ns
    write(folder, "02.csv", table(shift=10.0))
    result = labelled(folder, out, resume=True)
    assert sorted(result["failed"]) == ["01.csv"]
    assert recordings_of(out) == ["00.csv", "02.csv", "03.csv"]
    assert not list(out.glob("fault-*"))
    assert result["simulations"] > first["simulations"]
    assert (out / "simulations" / "part-00000.parquet").stat().st_mtime_ns == kept
    labelled(folder, tmp_path / "once")
    assert contents(out) == contents(tmp_path / "once")


def test_resuming_labels_recordings_after_the_fault_is_repaired(folder, tmp_path, monkeypatch):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(collection, "contents", lambda *_: 1 / 0)
        assert labelled(folder, out, road="motorway")["faults"] == 2
    labelled(folder, out, road="motorway", resume=True)
    labelled(folder, tmp_path / "once", road="motorway")
    assert contents(out) == contents(tmp_path / "once")


def test_an_error_while_a_shard_is_written_again_loses_no_recording(folder, tmp_path, monkeypatch):
    out = tmp_path / "out"
    labelled(folder, out)
    write(folder, "02.csv", table(shift=10.0))

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(shards, "put_into_place", full)
        with pytest.raises(DatasetError, match="No space left"):
            labelled(folder, out, resume=True)
    labelled(folder, out, resume=True)
    labelled(folder, tmp_path / "once")
    assert contents(out) == contents(tmp_path / "once")


def test_resuming_keeps_the_shards_of_recordings_that_fail_again(folder, tmp_path):
    out = tmp_path / "out"
    result = labelled(folder, out)
    times = {path: path.stat().st_mtime_ns for path in (out / "simulations").iterdir()}
    before = contents(out)
    assert labelled(folder, out, resume=True) == result
    assert {path: path.stat().st_mtime_ns for path in (out / "simulations").iterdir()} == times
    assert contents(out) == before


def test_resuming_refuses_a_labelled_recording_that_has_changed(folder, tmp_path):
    labelled(folder, tmp_path / "out")
    write(folder, "03.csv", table(shift=10.0))
    with pytest.raises(DatasetError, match=r"got those of another 03\.csv"):
        labelled(folder, tmp_path / "out", resume=True)


def test_a_lost_report_of_a_shard_is_made_again(folder, tmp_path):
    labelled(folder, tmp_path / "out")
    before = contents(tmp_path / "out")
    (tmp_path / "out" / "report-00000.json").write_text("[]", encoding="utf-8")
    labelled(folder, tmp_path / "out", resume=True)
    assert contents(tmp_path / "out") == before


# Errors in the options


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"columns": {"columns": {"vehicle": "id"}}}, "columns: expected"),
        ({"columns": "no-such-map"}, "map of columns"),
        ({"columns": COLUMNS | {"road": {"borders_m": [3, 1]}}}, "growing numbers"),
        ({"columns": COLUMNS | {"road": {"borders_m": [0, 90]}}}, "map of columns: road"),
        ({"columns": COLUMNS | {"road": {"driving_side": "up"}}}, "driving_side"),
        ({"columns": COLUMNS | {"road": {"speed_limit_kmh": 1e5}}}, "map of columns: road"),
        ({"columns": COLUMNS | {"road": {"heading_deg": 1000}}}, "map of columns: road"),
        ({"driving_side": "middle", "road": None}, "driving side"),
        ({"driving_side": "left"}, "driving side: expected right"),
        ({"speed_limit": 0.0}, "speed_limit"),
        ({"vehicles": 1}, "vehicles of a simulation"),
        ({"vehicles": 65}, "vehicles of a simulation"),
        ({"road": "no-such-road"}, "road"),
        ({"lanelet": 3}, "lanelet"),
        ({"strict": 1}, "strict"),
        ({"executor": "steam"}, "executor"),
    ],
)
def test_an_error_in_the_options_ends_the_run_before_the_first_recording(
    folder, tmp_path, monkeypatch, options, message
):
    def read(*_: Any) -> None:
        pytest.fail("a recording was read")

    monkeypatch.setattr(collection, "read_recording", read)
    with pytest.raises(ConfigError, match=message):
        labelled(folder, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists() or not contents(tmp_path / "out")


@pytest.mark.parametrize(
    ("file_format", "options", "message"),
    [
        ("highd", {"direction": 3}, "direction: expected 1"),
        ("highd", {"columns": COLUMNS}, "option for highd"),
        ("commonroad", {"driving_side": "up"}, "driving side"),
        ("pinto2023", {"speed_limit": -1.0}, "speed_limit"),
        ("exid", {"driving_side": "up"}, "driving side"),
        ("sumo", {}, "format"),
    ],
)
def test_an_error_in_the_options_of_a_format_ends_the_run(tmp_path, file_format, options, message):
    for name in ("01_tracks.csv", "a.xml", "b.csv"):
        write(tmp_path / "in", name, "")
    with pytest.raises(ConfigError, match=message):
        ot.label_recordings(file_format, tmp_path / "in", tmp_path / "out", **options)
    assert not (tmp_path / "out").exists() or not contents(tmp_path / "out")


# Kinds of recordings that ended the run


def test_recordings_of_many_kinds_fail_alone(tmp_path):
    inputs = tmp_path / "in"
    write(inputs, "good.csv", table())
    write(inputs, "empty.csv", "")
    write(inputs, "header.csv", "id,t,x,y,v\n")
    write(inputs, "backwards.csv", table().assign(x=lambda rows: -rows.x))
    (inputs / "binary.csv").write_bytes(b"\x00\xff\xfe\x00")
    (inputs / "binary.parquet").write_bytes(b"PAR1 no table PAR1")
    (inputs / "folder.csv").mkdir()
    (inputs / "nowhere.csv").symlink_to("nothing")
    columns = COLUMNS | {"road": {"kind": "motorway", "heading_deg": 0}}
    result = labelled(inputs, tmp_path / "out", columns=columns, road=None)
    assert result["faults"] == 0
    assert result["refused"] == result["recordings"] - 1 == 7
    assert recordings_of(tmp_path / "out") == ["good.csv"]


def test_a_recording_in_which_nobody_drives_along_the_road_is_refused(tmp_path):
    for number in range(3):
        rows = table().assign(x=lambda rows, sign=-1.0 if number == 1 else 1.0: sign * rows.x)
        write(tmp_path / "in", f"{number}.csv", rows)
    columns = COLUMNS | {"road": {"kind": "motorway", "heading_deg": 0}}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = labelled(tmp_path / "in", tmp_path / "out", columns=columns, road=None)
    assert (result["refused"], result["faults"]) == (1, 0)
    assert "expected some that drive" in result["failed"]["1.csv"]
    assert recordings_of(tmp_path / "out") == ["0.csv", "2.csv"]


@pytest.mark.skipif(sys.platform != "linux", reason="names of other systems are UTF-8")
@pytest.mark.parametrize("rows", [table(), "id,t\n1,x\n"])
def test_a_file_name_that_is_no_utf_8_is_shown_with_escapes(tmp_path, rows):
    write(tmp_path / "in", "a.csv", table())
    write(tmp_path / "in", "b.csv", rows)
    (tmp_path / "in" / "b.csv").rename(tmp_path / "in" / os.fsdecode(b"b\xff.csv"))
    result = labelled(tmp_path / "in", tmp_path / "out")
    labelled_recordings = recordings_of(tmp_path / "out")
    if isinstance(rows, str):
        assert (labelled_recordings, list(result["failed"])) == (["a.csv"], ["b\\xff.csv"])
    else:
        assert (labelled_recordings, result["failed"]) == (["a.csv", "b\\xff.csv"], {})
    assert labelled(tmp_path / "in", tmp_path / "out", resume=True) == result


# The import report of a folder


@pytest.fixture
def contradictory(tmp_path: Path) -> Path:
    """Twelve recordings with speeds in km/h, and one without a finding."""
    for number in range(12):
        write(tmp_path / "in", f"{number:02d}.csv", table(speed_factor=3.6))
    write(tmp_path / "in", "good.csv", table())
    return tmp_path / "in"


def test_the_result_of_a_folder_has_the_report(contradictory, tmp_path):
    with pytest.warns(ot.RecordingWarning) as caught:
        result = labelled(contradictory, tmp_path / "out")
    texts = [str(warning.message) for warning in caught]
    assert len(texts) == 11
    assert texts[0].startswith("00.csv: speeds: reported: ")
    assert texts[10].startswith("2 further recordings have findings")
    assert {warning.filename for warning in caught} == {__file__}
    report = pd.DataFrame(result["import_report"])
    assert report.recording.tolist() == [f"{number:02d}.csv" for number in range(12)]
    assert set(report.check) == {"speeds"}
    assert json.loads((tmp_path / "out" / "recordings.json").read_text("utf-8")) == result


@pytest.mark.parametrize("executor", ["processes"])
def test_workers_do_not_warn_and_the_report_is_the_same(contradictory, tmp_path, executor, capfd):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ot.RecordingWarning)
        one = labelled(contradictory, tmp_path / "one")
        two = labelled(contradictory, tmp_path / "two", executor=executor, workers=2)
    assert one == two
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    assert "RecordingWarning" not in capfd.readouterr().err


def test_strict_refuses_a_folder_with_a_finding_before_anything_is_written(contradictory, tmp_path):
    with pytest.raises(ImportFormatError, match=r"00\.csv: examination with strict"):
        labelled(contradictory, tmp_path / "out", strict=True)
    assert not (tmp_path / "out").exists()


def test_strict_is_no_part_of_the_identity(folder, tmp_path):
    result = labelled(folder, tmp_path / "out", strict=True)
    before = contents(tmp_path / "out")
    assert labelled(folder, tmp_path / "out", resume=True) == result
    assert labelled(folder, tmp_path / "out", resume=True, strict=True) == result
    assert contents(tmp_path / "out") == before
    labelled(folder, tmp_path / "other")
    assert contents(tmp_path / "other") == before


# The command


@pytest.fixture
def words(tmp_path: Path) -> list[str]:
    columns = tmp_path / "map.toml"
    cells = "\n".join(f'{name} = "{cell}"' for name, cell in COLUMNS["columns"].items())
    columns.write_text(
        f"[recording]\nlength_m = 4.4\nwidth_m = 1.8\n[columns]\n{cells}\n", encoding="utf-8"
    )
    paths = [tmp_path / "in", "--columns", columns, "--out", tmp_path / "out"]
    return [str(word) for word in ("import", "table", *paths, "--road", "motorway", "--json")]


def test_the_exit_status_is_0_if_all_failures_are_refusals(folder, words, capsys):
    (folder / "02.csv").unlink()
    assert main([*words, "--executor", "threads"]) == 0
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("failed: 01.csv: ")
    result = json.loads(captured.out)
    assert (result["refused"], result["faults"], result["import_report"]) == (1, 0, [])


def test_the_exit_status_is_70_after_a_fault_of_the_package(folder, words, monkeypatch, capsys):
    monkeypatch.setattr(collection, "contents", lambda *_: 1 / 0)
    assert main([*words, "--executor", "threads"]) == 70
    captured = capsys.readouterr()
    assert "fault-00000.txt: ZeroDivisionError" in captured.err
    assert json.loads(captured.out)["faults"] == 2


def test_the_command_prints_one_line_per_check_of_a_folder(contradictory, words, capsys):
    assert main([*words, "--executor", "threads"]) == 0
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("warning: 12 recordings: speeds: reported, 4,356 rows, 12 findings; ")
    assert len(json.loads(captured.out)["import_report"]) == 12
    assert main([*words, "--executor", "threads", "--resume", "--strict"]) == 2
    assert "00.csv: examination with strict" in capsys.readouterr().err


def test_many_failures_are_named_up_to_ten(tmp_path, words, capsys):
    for number in range(13):
        write(tmp_path / "in", f"{number:02d}.csv", "id,t\n1,x\n")
    assert main([*words, "--executor", "threads"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 11
    assert lines[-1] == "failed: 3 others; recordings.json names them"


def test_a_recording_with_more_simulations_than_numbers_is_refused(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(collection, "NUMBERS", 1)
    result = labelled(folder, tmp_path / "out")
    reason = result["failed"]["00.csv"]
    assert "simulations: expected at most 1 in a recording of a folder, got 3" in reason
    assert result["simulations"] == 0
