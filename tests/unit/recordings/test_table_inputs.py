"""Tables as people have them: separators, compression, gaps, repeated rows, ids that restart."""

from __future__ import annotations

import bz2
import gzip
import lzma
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from tests.support.recordings import OVERTAKE, Mover, exid, ngsim, states
from tests.unit.recordings.test_pinto2023_files import ONE_ROW

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.overtake_events import Outcome
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Verdict
from overtaking.recordings.column_request import NUMBER, ColumnRequest
from overtaking.recordings.findings import Check, Consequence
from overtaking.recordings.formats import read_recording
from overtaking.recordings.limits import NO_LIMIT
from overtaking.recordings.opendrive_writer import write_opendrive
from overtaking.recordings.pinto2023 import read_table as read_paper
from overtaking.recordings.pinto2023 import write_table
from overtaking.recordings.rows import track_names
from overtaking.recordings.scenes import scenes
from overtaking.recordings.table_files import read_columns
from overtaking.recordings.tables import read_table

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from overtaking.recordings.recording import Recording

COLUMNS = {
    "vehicle": "id",
    "time": "t [s]",
    "x": "x [m]",
    "y": "y [m]",
    "length": "length [m]",
    "width": "width [m]",
}
MAP: dict[str, Any] = {
    "columns": {**COLUMNS, "type": "kind"},
    "types": {"car": ["car"], "truck": ["truck"]},
    "road": {"kind": "motorway", "borders_m": [0, 3.5, 7, 10.5], "heading_deg": 0},
}
USED = ["id", "t", "x", "y", "length", "width", "kind"]


@pytest.fixture
def frame() -> pd.DataFrame:
    """Vehicle 7 overtakes vehicle 3."""
    movers = [replace(one, s=one.s + 100.0) for one in OVERTAKE]
    return pd.DataFrame(states(movers))[USED]


def read(path: Path, **options: Any) -> Recording:
    return read_table(path, MAP, **options)


def outcomes(recording: Recording) -> dict[str, Outcome]:
    """Outcome of each simulation, by its vehicles."""
    found = scenes(recording)
    labels = ot.label(found.trajectories(range(len(found)))).labels
    names = [one.partition("vehicles ")[2] for one in found.sources(range(len(found)))]
    return dict(zip(names, map(Outcome, labels.outcome.tolist()), strict=True))


def overtakes(recording: Recording) -> int:
    return list(outcomes(recording).values()).count(Outcome.COMPLETED)


# CSV files


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_separator_and_decimal_mark_are_found(tmp_path, frame, separator, decimal):
    path, plain = tmp_path / "t.csv", tmp_path / "plain.csv"
    frame.to_csv(plain, index=False)
    frame.to_csv(path, index=False, sep=separator, decimal=decimal)
    found, first = read(path), read(plain)
    assert np.array_equal(found.tracks.s, first.tracks.s)
    assert overtakes(found) == 1


def test_decimal_commas_after_many_whole_numbers_are_found(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("id;x\n" + "1;2\n" * 20_000 + "1;2,5\n", encoding="utf-8")
    table = read_columns(path, ColumnRequest(types={"x": NUMBER})).table
    assert table["x"].to_pylist() == [2.0] * 20_000 + [2.5]


def test_decimal_commas_between_commas_are_named(tmp_path, frame):
    path = tmp_path / "t.csv"
    text = frame.to_csv(index=False, sep=";", decimal=",")
    path.write_text(text.replace(";", ","), encoding="utf-8")
    with pytest.raises(ImportFormatError, match="decimal commas need another separator"):
        read(path)


def zstd(content: bytes) -> bytes:
    return pa.compress(content, codec="zstd", asbytes=True)


@pytest.mark.parametrize(
    ("suffix", "compress"),
    [(".gz", gzip.compress), (".bz2", bz2.compress), (".xz", lzma.compress), (".zst", zstd)],
)
def test_compressed_tables_are_read(tmp_path, frame, suffix, compress: Callable[[bytes], bytes]):
    plain, path = tmp_path / "t.csv", tmp_path / f"t.csv{suffix}"
    frame.to_csv(plain, index=False)
    path.write_bytes(compress(plain.read_bytes()))
    assert np.array_equal(read(path).tracks.x, read(plain).tracks.x)
    assert read(path).name == read(plain).name


@pytest.mark.parametrize("compress", [gzip.compress, bz2.compress, lzma.compress, zstd])
def test_a_compressed_table_that_grows_beyond_bounds_is_refused(tmp_path, compress):
    path = tmp_path / "t.csv.gz"
    head = b"id,t,x,y,length,width,kind\n"
    path.write_bytes(compress(head + b"7,0.0,1.0,1.0,4.0,2.0,car\n" * 1_000_000))
    assert path.stat().st_size < 100_000
    with pytest.raises(ImportFormatError, match="at most 16 MB of text in a file of that size"):
        read(path)


@pytest.mark.parametrize("compress", [gzip.compress, bz2.compress, lzma.compress, zstd])
def test_a_damaged_compressed_table_is_refused_in_one_line(tmp_path, frame, compress):
    path = tmp_path / "t.csv.gz"
    content = compress(frame.to_csv(index=False).encode())
    for damaged in (content[: len(content) // 2], content[:40], content[:200] + content[260:]):
        path.write_bytes(damaged)
        with pytest.raises(ImportFormatError) as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_the_papers_table_may_be_compressed(tmp_path):
    path = tmp_path / "paper.csv"
    write_table([ONE_ROW], path)
    (tmp_path / "paper.csv.gz").write_bytes(gzip.compress(path.read_bytes()))
    assert read_paper(tmp_path / "paper.csv.gz").equals(read_paper(path))


def test_an_archive_is_named(tmp_path):
    path = tmp_path / "t.csv"
    path.write_bytes(b"PK\x03\x04" + bytes(100))
    with pytest.raises(ImportFormatError, match="a zip archive; unpack it"):
        read(path)


def test_compressed_files_of_a_family_are_found_beside_each_other(tmp_path):
    tracks = exid(tmp_path, [replace(one, s=one.s + 100.0) for one in OVERTAKE])
    first = read_recording("exid", tracks, {}).scenes
    for name in ("tracks", "tracksMeta"):
        path = tmp_path / f"01_{name}.csv"
        (tmp_path / f"01_{name}.csv.gz").write_bytes(gzip.compress(path.read_bytes()))
        path.unlink()
    again = read_recording("exid", tmp_path / "01_tracks.csv.gz", {})
    assert set(again.files) == {"01_tracks.csv.gz", "01_tracksMeta.csv.gz", "01_recordingMeta.csv"}
    assert again.scenes.counts == first.counts


# Missing cells


def test_frames_without_positions_are_a_gap(tmp_path, frame):
    path = tmp_path / "t.csv"
    missing = (frame.id == 3) & frame.t.between(4.95, 6.05)
    frame.loc[missing, ["x", "y"]] = np.nan
    frame.to_csv(path, index=False)
    found = read(path)
    assert found.notes["rows_missing"] == 11
    assert found.notes["tracks_torn"] == 1
    assert found.tracks.num_vehicles == 5
    assert np.isfinite(found.tracks.s).all()


@pytest.mark.parametrize("text", ["NaN", "nan", "NA", "null", "N/A", ""])
def test_missing_positions_may_be_written_in_several_ways(tmp_path, frame, text):
    path = tmp_path / "t.csv"
    frame.loc[frame.index[5], "x"] = np.nan
    frame.to_csv(path, index=False, na_rep=text)
    assert read(path).notes["rows_missing"] == 1


def test_rows_without_anything_are_a_gap(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame = frame.astype({"id": float})
    frame.loc[frame.index[40:46], :] = np.nan
    frame.to_csv(path, index=False)
    found = read(path)
    assert found.tracks.names.tolist() == ["3", "5", "7", "7 (2)", "9"]
    assert found.notes["tracks_torn"] == 1


@pytest.mark.parametrize("column", ["id", "t", "x", "y"])
def test_a_row_without_vehicle_time_or_position_is_left_out(tmp_path, frame, column):
    path = tmp_path / "t.csv"
    wrong = frame.astype({column: float})
    wrong.loc[wrong.index[3], column] = np.nan
    wrong.to_csv(path, index=False)
    recording = read(path)
    assert recording.notes["rows_missing"] == 1
    (finding,) = [one for one in recording.findings if one.check is Check.MISSING_CELLS]
    assert finding.consequence is Consequence.LEFT_OUT
    assert finding.rows == 1
    assert finding.vehicle == (None if column == "id" else "7")
    assert finding.first_time_s == (None if column == "t" else pytest.approx(0.3))
    assert f"column {column}" in finding.detail


@pytest.mark.parametrize("column", ["id", "t", "x", "y"])
def test_a_column_with_many_missing_cells_is_refused(tmp_path, frame, column):
    path = tmp_path / "t.csv"
    wrong = frame.astype({column: float})
    wrong.loc[wrong.index[::15], column] = np.nan
    wrong.to_csv(path, index=False)
    with pytest.raises(ImportFormatError, match=f"line 2, column {column}: .*95% of the rows"):
        read(path)


def test_a_speed_that_is_missing_throughout_comes_from_positions(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.assign(v=np.nan).to_csv(path, index=False)
    content = {**MAP, "columns": {**MAP["columns"], "speed": "v [m/s]"}}
    found = read_table(path, content)
    assert found.tracks.num_vehicles == 4
    assert float(np.median(found.tracks.speed[found.tracks.vehicle == 0])) == pytest.approx(24.0)


def test_sizes_and_types_that_some_rows_lack_come_from_the_others(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.loc[frame.index[::3], ["length", "width"]] = np.nan
    frame.loc[frame.index[1::3], "kind"] = None
    frame.to_csv(path, index=False)
    found = read(path)
    assert found.tracks.length.tolist() == [4.5, 4.5, 4.5, 12.0]
    assert found.tracks.is_kind_known.tolist() == [True, True, True, False]


def test_a_vehicle_without_any_length_is_named(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.loc[frame.id == 5, "length"] = np.nan
    frame.to_csv(path, index=False)
    with pytest.raises(ImportFormatError, match="column length: expected a length in one of the"):
        read(path)


def test_a_vehicle_without_a_type_has_an_unknown_kind(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.loc[frame.id == 5, "kind"] = None
    frame.to_csv(path, index=False)
    found = read(path)
    assert found.tracks.is_kind_known[found.tracks.names == "5"].tolist() == [False]


def test_whole_numbers_may_have_decimals(tmp_path):
    path = tmp_path / "ngsim.csv"
    text = ngsim([replace(one, s=one.s + 100.0) for one in OVERTAKE])
    path.write_text(text, encoding="utf-8")
    first = read_recording("ngsim", path, {}).scenes
    head, *rows = text.splitlines()
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[0], row[10], row[13] = f"{row[0]}.0", f"{row[10]}.000", f"{row[13]}."
    path.write_text("\n".join([head, *(",".join(row) for row in cells)]) + "\n", encoding="utf-8")
    assert read_recording("ngsim", path, {}).scenes.counts == first.counts


# Repeated rows


def test_identical_rows_are_dropped(tmp_path, frame):
    path = tmp_path / "t.csv"
    pd.concat([frame, frame[100:120], frame[100:110]]).to_csv(path, index=False)
    found = read(path)
    assert found.notes["rows_repeated"] == 30
    assert found.tracks.num_rows == len(frame)


def test_conflicting_rows_are_named_with_vehicle_and_time(tmp_path, frame):
    path = tmp_path / "t.csv"
    wrong = frame[50:51].assign(x=17.25)
    pd.concat([frame, wrong]).to_csv(path, index=False)
    with pytest.raises(ImportFormatError) as caught:
        read(path)
    message = str(caught.value)
    assert "expected another time of vehicle 7 than in line" in message
    assert "time 5 again" in message
    assert "17.25" in message
    assert "\n" not in message


def test_a_repeated_row_without_a_position_is_dropped(tmp_path, frame):
    path = tmp_path / "t.csv"
    pd.concat([frame, frame[50:60].assign(x=np.nan)]).to_csv(path, index=False)
    assert read(path).tracks.num_rows == len(frame)


def test_the_differing_column_is_named_when_another_one_is_empty(tmp_path, frame):
    path = tmp_path / "t.csv"
    empty = frame.assign(v=np.nan)
    pd.concat([empty, empty[50:51].assign(x=17.25)]).to_csv(path, index=False)
    columns = {**MAP, "columns": {"speed": "v [m/s]", **MAP["columns"]}}
    with pytest.raises(ImportFormatError, match=r"with x 270 and x 17\.25"):
        read_table(path, columns)


# Rows that the user chooses


@pytest.mark.parametrize("value", ["12", "12.0"])
def test_rows_can_be_chosen_by_a_column_of_numbers(tmp_path, frame, value):
    path = tmp_path / "t.csv"
    frame.to_csv(path, index=False)
    assert set(read(path, only={"length": value}).tracks.length.tolist()) == {12.0}


@pytest.mark.parametrize(("column", "value"), [("length", "99"), ("length", "long"), ("kind", "x")])
def test_a_choice_without_rows_is_named(tmp_path, frame, column, value):
    path = tmp_path / "t.csv"
    frame.to_csv(path, index=False)
    with pytest.raises(ImportFormatError, match=f"rows with {column}={value}: expected at least"):
        read(path, only={column: value})


def test_a_combination_without_rows_is_named_with_all_its_columns(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.assign(site="A", day=np.where(frame.index < 10, "Mon", "Tue")).to_csv(path, index=False)
    with pytest.raises(ImportFormatError, match="rows with day=Mon and length=99: expected at"):
        read(path, only={"day": "Mon", "length": "99"})


# Ids that restart


def periods(gap_s: float) -> pd.DataFrame:
    """Two periods with the same ids, in which the car and the truck change their ids."""
    first = [
        Mover(number=1, s=120.0, speed=30.0, length=4.6, moves=((4.0, 1), (14.0, 0))),
        Mover(number=2, s=180.0, speed=22.0, length=16.5, kind="truck"),
        Mover(number=5, s=40.0, speed=26.0, lane=1),
    ]
    second = [replace(first[0], number=2), replace(first[1], number=1), first[2]]
    later = pd.DataFrame(states(second))
    return pd.concat([pd.DataFrame(states(first)), later.assign(t=later.t + 30.0 + gap_s)])


@pytest.mark.parametrize("gap_s", [0.0, 600.0])
def test_sizes_and_kinds_belong_to_tracks_and_not_to_ids(tmp_path, gap_s):
    path = tmp_path / "t.csv"
    periods(gap_s)[USED].to_csv(path, index=False)
    tracks = read(path).tracks
    is_car = tracks.length == 4.6
    assert sorted(tracks.length.tolist()) == [4.5, 4.5, 4.6, 4.6, 16.5, 16.5]
    assert set(tracks.kind[is_car].tolist()) == {VehicleKind.MEDIUM_CAR}
    assert set(tracks.kind[tracks.length == 16.5].tolist()) == {VehicleKind.TRUCK}
    assert tracks.is_kind_known.all()
    assert overtakes(read(path)) == 2


def test_a_noisy_length_of_a_track_is_its_median(tmp_path, frame):
    path = tmp_path / "t.csv"
    noise = np.random.default_rng(1).choice([-0.1, 0.0, 0.1], len(frame), p=[0.2, 0.6, 0.2])
    frame.assign(length=frame.length + noise).to_csv(path, index=False)
    assert read(path).tracks.length.tolist() == pytest.approx([4.5, 4.5, 4.5, 12.0])


def test_one_of_several_recordings_in_a_file_is_chosen_in_all_its_tables(tmp_path):
    movers = [replace(one, s=one.s + 100.0) for one in OVERTAKE]
    (tmp_path / "one").mkdir()
    tracks = exid(tmp_path / "one", movers)
    first = read_table(tracks, "exid")
    exid(tmp_path, [replace(one, length=one.length + 2.0) for one in movers])
    for name in ("tracks", "tracksMeta", "recordingMeta"):
        path = tmp_path / f"01_{name}.csv"
        head, *rows = path.read_text(encoding="utf-8").splitlines()
        others = [f"2{row[1:]}" for row in rows]
        own = (tmp_path / "one" / path.name).read_text(encoding="utf-8").splitlines()[1:]
        path.write_text("\n".join([head, *others, *own]) + "\n", encoding="utf-8")
    with pytest.raises(ImportFormatError, match="--only"):
        read_table(tmp_path / "01_tracks.csv", "exid")
    chosen = read_table(tmp_path / "01_tracks.csv", "exid", only={"recordingId": "1"})
    assert chosen.tracks.length.tolist() == first.tracks.length.tolist()
    assert np.array_equal(chosen.tracks.s, first.tracks.s)


# Kinds that lengths contradict


@pytest.mark.parametrize(
    ("kind", "length", "is_known"),
    [
        ("car", 4.5, True),
        ("car", 7.07, False),
        ("car", 12.0, False),
        ("car", 1.2, False),
        ("truck", 12.0, True),
        ("truck", 3.0, False),
    ],
)
def test_a_kind_that_the_length_contradicts_is_not_known(tmp_path, frame, kind, length, is_known):
    path = tmp_path / "t.csv"
    frame.loc[frame.id == 7, ["kind", "length"]] = kind, length
    frame.to_csv(path, index=False)
    tracks = read(path).tracks
    assert tracks.is_kind_known[tracks.names == "7"].tolist() == [is_known]


def test_rules_for_trucks_are_undecidable_for_a_vehicle_of_unknown_kind(tmp_path, frame):
    path = tmp_path / "t.csv"
    content = {**MAP, "road": {**MAP["road"], "speed_limit_kmh": 120}}
    verdicts: dict[tuple[str, float], Verdict] = {}
    for kind, length in (("car", 4.5), ("car", 7.07), ("truck", 12.0)):
        changed = frame.copy()
        changed.loc[changed.id == 7, ["kind", "length"]] = kind, length
        changed.to_csv(path, index=False)
        found = scenes(read_table(path, content))
        labelled = ot.label(found.trajectories(range(1)))
        verdict = labelled.findings.verdict[0, labelled.findings.rule_codes.index("L12")]
        verdicts[kind, length] = Verdict(int(verdict))
    assert verdicts == {
        ("car", 4.5): Verdict.LEGAL,  # 108 km/h.
        ("car", 7.07): Verdict.UNDECIDABLE,
        ("truck", 12.0): Verdict.ILLEGAL,
    }


# Properties of the road that the user states


@pytest.mark.parametrize(
    ("speed_limit", "verdict"),
    [(math.inf, Verdict.LEGAL), (120 / 3.6, Verdict.LEGAL), (100 / 3.6, Verdict.ILLEGAL)],
)
def test_a_stated_speed_limit_is_that_of_the_road(tmp_path, frame, speed_limit, verdict):
    path = tmp_path / "t.csv"
    frame.to_csv(path, index=False)
    options = {"columns": MAP, "speed_limit": speed_limit}
    found = read_recording("table", path, options).scenes
    labelled = ot.label(found.trajectories(range(1)))
    assert "speed_limit" not in found.unknown
    assert labelled.findings.verdict[0, labelled.findings.rule_codes.index("L12")] == verdict
    of_frame = ot.Trajectories.from_table(frame, columns=MAP, speed_limit=speed_limit)
    assert of_frame.road.speed_limit == found.road.speed_limit


@pytest.mark.parametrize(("text", "limit"), [("100", 100 / 3.6), ("none", NO_LIMIT)])
def test_the_speed_limit_is_an_option_of_import(tmp_path, frame, text, limit):
    path, out = tmp_path / "t.csv", tmp_path / "data"
    frame.to_csv(path, index=False)
    columns = tmp_path / "map.toml"
    cells = "\n".join(f'{name} = "{cell}"' for name, cell in COLUMNS.items())
    columns.write_text(f"[columns]\n{cells}\n", encoding="utf-8")
    line = ["import", "table", str(path), "--columns", str(columns), "--out", str(out)]
    assert main([*line, "--speed-limit", text]) == 0
    data = ot.load_dataset(out)
    assert data.manifest.identity.road.speed_limit == pytest.approx(limit)
    assert "speed_limit" not in data.manifest.identity.unknown


def test_a_speed_limit_that_is_no_number_is_refused(tmp_path, capsys):
    line = ["import", "table", str(tmp_path / "t.csv"), "--out", str(tmp_path / "data")]
    assert main([*line, "--speed-limit", "fast"]) == 2
    assert "expected a number of km/h" in capsys.readouterr().err


@pytest.mark.parametrize("heading_deg", [0, 180])
def test_traffic_that_keeps_to_the_left_overtakes_on_the_right(tmp_path, frame, heading_deg):
    path = tmp_path / "t.csv"
    sign = 1.0 if heading_deg == 0 else -1.0
    mirrored = frame.assign(x=sign * frame.x, y=-sign * frame.y)
    mirrored.to_csv(path, index=False)
    content = {key: value for key, value in MAP.items() if key != "road"}
    right = read_table(path, content)
    left = read_table(path, content, driving_side="left")
    assert (right.road.overtaking_sign, left.road.overtaking_sign) == (1.0, -1.0)
    assert (overtakes(right), overtakes(left)) == (0, 1)
    stated = read_table(path, {**content, "road": {"driving_side": "left"}})
    assert stated.road == left.road


def test_a_side_against_that_of_the_road_is_refused(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.to_csv(path, index=False)
    road = read(path).road
    with pytest.raises(ConfigError, match="driving side: expected right, got left"):
        read(path, road=road, driving_side="left")
    with pytest.raises(ConfigError, match="driving side: expected right or left"):
        read(path, driving_side="up")


def test_kinds_that_are_not_known_are_null_in_data_sets_and_unknown_when_loaded(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.loc[frame.id == 7, "length"] = 7.07
    frame.to_csv(path, index=False)
    options = {"columns": MAP, "speed_limit": 120 / 3.6}
    data = ot.import_recording("table", path, tmp_path / "data", **options)
    runs = read_recording("table", path, options).scenes
    first = runs.trajectories(range(len(runs)))
    ((_, again),) = data.batches()
    assert first.is_kind_known is not None
    assert again.is_kind_known is not None
    assert np.array_equal(first.is_kind_known, again.is_kind_known)
    one, two = ot.label(first), ot.label(again)
    assert np.array_equal(one.findings.verdict, two.findings.verdict)
    kinds = data.vehicles()["kind"]
    assert 0 < kinds.isna().sum() < len(kinds)
    attempts = data.attempts()
    assert attempts["ego_kind"].isna().sum() == (~first.is_kind_known[:, 0]).sum()
    assert attempts["law_speed_mps"].isna().tolist() == attempts["ego_kind"].isna().tolist()


# Exports


def test_exports_have_the_coordinates_of_the_source(tmp_path, frame):
    path = tmp_path / "t.csv"
    absolute = frame.assign(x=frame.x + 691_000.0, y=frame.y + 5_335_000.0)
    absolute.to_csv(path, index=False)
    content = {**MAP, "road": {"kind": "motorway"}}
    data = ot.import_recording("table", path, tmp_path / "data", columns=content)
    assert (data.road.origin_x, data.road.origin_y) == (691_000.0, 5_335_000.0)
    ot.export_dataset(data, tmp_path / "scenes", file_format="commonroad")
    text = min((tmp_path / "scenes").glob("*.xml")).read_text(encoding="utf-8")
    x, y = (
        np.array(re.findall(rf"<{axis}>([-0-9.]+)</{axis}>", text.partition("<dynamicO")[2]), float)
        for axis in "xy"
    )
    assert absolute.x.min() - 0.01 <= x.min() <= x.max() <= absolute.x.max() + 0.01
    assert absolute.y.min() - 0.01 <= y.min() <= y.max() <= absolute.y.max() + 0.01
    header = write_opendrive(data.road).partition("</header>")[0]
    assert '<offset x="691000.0" y="5335000.0" z="0" hdg="0"/>' in header


def test_a_vehicle_of_unknown_kind_is_unknown_in_a_commonroad_file(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.loc[frame.id == 7, "length"] = 7.07
    frame.to_csv(path, index=False)
    data = ot.import_recording("table", path, tmp_path / "data", columns=MAP)
    ot.export_dataset(data, tmp_path / "scenes", file_format="commonroad")
    text = min((tmp_path / "scenes").glob("*.xml")).read_text(encoding="utf-8")
    types = re.findall(r"<dynamicObstacle id=\"(\d+)\"><type>(\w+)</type>", text)
    assert types[0] == ("1000", "unknown")
    assert types[1] == ("1001", "car")


# Names of vehicles


def test_tracks_of_a_vehicle_are_counted_and_names_of_the_file_stay():
    names = np.array(["12", "12 (2)", "x"], np.object_)
    vehicle = np.array([0, 0, 0, 1, 2, 2])
    expected = ["12", "12 (3)", "12 (4)", "12 (2)", "x", "x (2)"]
    assert track_names(names, vehicle).tolist() == expected
