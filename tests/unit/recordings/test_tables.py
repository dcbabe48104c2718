"""Tables of any columns: the same traffic is the same, whatever holds it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.support.recordings import (
    EXID_ROWS,
    NGSIM_ROWS,
    OVERTAKE,
    Bend,
    Mover,
    commonroad,
    exid,
    highd,
    ngsim,
    states,
)

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.reference_line import CurveSegment
from overtaking.model.road_course import RoadCourse
from overtaking.model.verdicts import Verdict
from overtaking.recordings.column_map import column_map, map_names, template
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.formats import read_recording
from overtaking.recordings.highd import read_highd
from overtaking.recordings.scenes import scenes
from overtaking.recordings.tables import read_table, recording_of
from overtaking.recordings.track_table import track_rows_from_table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from overtaking.recordings.recording import Recording

TRAFFIC = tuple(
    replace(one, s=one.s + 100.0, kind="truck" if one.length > 10.0 else "car")
    for one in (
        *OVERTAKE,
        Mover(number=11, s=0.0, speed=33.0, lane=2),
        Mover(number=12, s=-60.0, speed=32.0, lane=1, moves=((7.0, 2), (13.0, 1))),
        Mover(number=13, s=150.0, speed=23.0, length=12.0),
    )
)
COLUMNS = {
    "vehicle": "id",
    "time": "t [s]",
    "x": "x [m]",
    "y": "y [m]",
    "length": "length [m]",
    "width": "width [m]",
}
MOVING = {**COLUMNS, "vx": "vx [m/s]", "vy": "vy [m/s]", "heading": "yaw [deg]"}
TYPES = {"car": ["car"], "truck": ["truck"]}


def written(folder: Path, movers: Sequence[Mover]) -> dict[str, Recording]:
    """The same traffic, 10 frames a second, in each format and read again."""
    (folder / "highd").mkdir()
    (folder / "exid").mkdir()
    (folder / "scene.xml").write_text(
        commonroad(movers, Bend(length=2000.0), yaws=True), encoding="utf-8"
    )
    (folder / "ngsim.csv").write_text(ngsim(movers), encoding="utf-8")
    table = pa.table(states(movers))
    pq.write_table(table, folder / "table.parquet")
    pd.DataFrame(states(movers)).to_csv(folder / "table.csv", index=False)
    tracks = highd(folder / "highd", lower=movers, extent=2000.0)
    for name in ("tracks", "tracksMeta", "recordingMeta"):
        path = folder / "highd" / f"01_{name}.csv"
        path.write_text(path.read_text("utf-8").replace("1,25,1,", "1,10,1,"), encoding="utf-8")
    rewritten_rows(tracks, movers)
    with_types: dict[str, Any] = {"columns": {**MOVING, "type": "kind"}, "types": TYPES}
    corners = {**MOVING, "x": [f"x{k} [m]" for k in (1, 2, 3, 4)], "type": "kind"}
    corners["y"] = [f"y{k} [m]" for k in (1, 2, 3, 4)]
    of_corners = {"columns": corners, "types": TYPES, "recording": {"point": "corners"}}
    return {
        "commonroad": read_commonroad(folder / "scene.xml"),
        "highd": read_highd(tracks),
        "exid": read_table(exid(folder / "exid", movers, rate=10), "exid"),
        "exid, turned": read_table(exid(folder / "exid", movers, rate=10, turn=2.2), "exid"),
        "ngsim": read_table(folder / "ngsim.csv", "ngsim"),
        "table of centres": read_table(folder / "table.csv", with_types),
        "table of corners": read_table(folder / "table.parquet", of_corners),
    }


def rewritten_rows(path: Path, movers: Sequence[Mover]) -> None:
    """The rows of a highD file, whose frames are 0.04 s apart, at 0.1 s."""
    head, *_ = path.read_text(encoding="utf-8").splitlines()
    table, lines = states(movers), [head]
    for k in range(len(table["id"])):
        one, x, y, long = table["id"][k], table["x"][k], 30.5 - table["y"][k], table["length"][k]
        lines.append(
            f"{round(table['t'][k] * 10)},{one},{x - long / 2:.5f},{y - 0.9:.5f},{long},1.8,"
            f"{table['vx'][k]:g},{-table['vy'][k]:.6f}" + ",0" * 17
        )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.fixture(scope="module")
def labelled(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    found = written(tmp_path_factory.mktemp("formats"), TRAFFIC)
    runs = {name: scenes(one) for name, one in found.items()}
    return {name: ot.label(one.trajectories(range(len(one)))) for name, one in runs.items()}


def test_the_same_traffic_gets_the_same_verdicts_through_every_reader(labelled):
    """Wherever two readers decide a rule, they decide it alike."""
    first = labelled["commonroad"]
    decided = 0
    for name, other in labelled.items():
        both = first.findings.verdict != Verdict.UNDECIDABLE
        both &= other.findings.verdict != Verdict.UNDECIDABLE
        assert np.array_equal(first.findings.verdict[both], other.findings.verdict[both]), name
        apart = np.abs(first.findings.margin - other.findings.margin)[both]
        assert apart.max() < 0.03, name
        for field in ("attempt", "line_crossed", "overlap_begin", "overlap_end", "return_end"):
            frames = getattr(first.events, field), getattr(other.events, field)
            assert np.abs(np.subtract(*frames)).max() <= 1, (name, field)
        assert np.array_equal(first.labels.outcome, other.labels.outcome), name
        decided += int(both.sum())
    assert decided > 100
    assert {Verdict.LEGAL, Verdict.ILLEGAL} <= {Verdict(one) for one in first.findings.verdict.flat}


def test_what_a_reader_lacks_is_what_its_format_lacks(labelled):
    lacking = {name: one.trajectories.unknown for name, one in labelled.items()}
    every = frozenset.intersection(*lacking.values())
    more = {name: sorted(one - every) for name, one in lacking.items()}
    assert more == {
        "commonroad": ["speed_limit"],
        "highd": ["marks"],
        "exid": ["marks", "road_kind"],
        "exid, turned": ["marks", "road_kind"],
        "ngsim": ["marks", "speed_limit"],
        "table of centres": ["marks", "road_kind", "speed_limit"],
        "table of corners": ["marks", "road_kind", "speed_limit"],
    }


def test_the_columns_written_by_the_tests_are_those_of_the_maps():
    for name, header in (("exid", EXID_ROWS), ("ngsim", NGSIM_ROWS)):
        columns = column_map(name)
        there = {one.casefold() for one in header.split(",")}
        assert {one.casefold() for one in columns.names("tracks")} <= there
        assert columns.is_tested
        assert columns.source


def test_every_shipped_map_is_sound_and_says_where_its_columns_are_documented():
    assert map_names() == ("exid", "highd", "interaction", "ngsim", "sind")
    for name in map_names():
        assert column_map(name).source
    assert not column_map("interaction").is_tested


def test_units_are_converted_and_named(tmp_path):
    table = pd.DataFrame(states())
    feet = table.assign(x=table.x / 0.3048, y=table.y * 100.0, t=table.t * 1000.0)
    columns = {**COLUMNS, "x": "x [ft]", "y": "y [cm]", "time": "t [ms]"}
    one = ot.Trajectories.from_table(table, columns=COLUMNS)
    two = ot.Trajectories.from_table(feet, columns=columns)
    for name in ("s", "d", "speed"):
        assert np.abs(np.subtract(getattr(one.states, name), getattr(two.states, name))).max() <= 1


def test_a_frame_of_pandas_arrow_or_plain_columns_is_the_same():
    table = states()
    runs = [
        ot.Trajectories.from_table(each, columns=COLUMNS)
        for each in (table, pd.DataFrame(table), pa.table(table))
    ]
    for other in runs[1:]:
        assert np.array_equal(runs[0].trace_hash, other.trace_hash)
    assert "kinds" in runs[0].unknown


@pytest.mark.parametrize("interval_ms", [1000 / 30, 1000 / 24, 77.0])
def test_at_any_rate_states_are_interpolated_between_whole_milliseconds(interval_ms):
    table = states(TRAFFIC, interval_ms=interval_ms)
    run = ot.Trajectories.from_table(table, columns=COLUMNS, attempts_only=True)
    interval = round(interval_ms)
    assert run.scenario.frame_interval_ms == interval
    speed = run.states.speed[run.state_mask]
    assert speed.min() > 19_000
    assert speed.max() < 33_500
    # A vehicle that never changes lane moves by as much in every frame.
    slot = int(np.flatnonzero(np.isclose(run.scenario.vehicles.length[0], 12.0))[0])
    there = run.state_mask[0, slot]
    steps = np.diff(run.states.s[0, slot][there])
    assert np.ptp(steps) <= 2


def test_a_vehicle_that_was_away_has_two_tracks(tmp_path):
    table = pd.DataFrame(states())
    gone = table[(table.id != 3) | (table.t < 9.95) | (table.t > 12.05)]
    path = tmp_path / "gap.csv"
    gone.to_csv(path, index=False)
    found = read_table(path, COLUMNS)
    assert found.notes["tracks_torn"] == 1
    assert found.tracks.names.tolist() == ["3", "3 (2)", "5", "7", "9"]


def test_lanes_come_from_the_map_the_named_lanes_or_the_traffic(tmp_path):
    table = pd.DataFrame(states(TRAFFIC))
    path = tmp_path / "t.csv"
    table.assign(lane=(table.y // 3.5).astype(int)).to_csv(path, index=False)
    given = {"columns": COLUMNS, "road": {"borders_m": [0, 3.4, 7.0, 10.5], "heading_deg": 0}}
    stated = read_table(path, given)
    assert stated.notes["lanes_from"] == "map of columns"
    assert np.allclose(np.diff(stated.road.lane_boundaries), [3.4, 3.6, 3.5])
    named = {"columns": {**COLUMNS, "lane": "lane"}, "road": {"lanes": [0, 1, 2]}}
    by_name = read_table(path, named)
    assert by_name.notes["lanes_from"] == "traffic, by the named lanes"
    assert np.allclose(np.diff(by_name.road.lane_boundaries), 3.5, atol=0.01)
    inferred = read_table(path, COLUMNS)
    assert inferred.notes["lanes_from"] == "traffic, equally wide"
    assert np.allclose(np.diff(inferred.road.lane_boundaries), 3.5, atol=0.05)
    road = read_highd(highd(tmp_path)).road
    assert read_table(path, COLUMNS, road=road).notes["lanes_from"] == f"road {road.name}"


def test_traffic_in_one_lane_is_no_road_to_infer(tmp_path):
    path = tmp_path / "t.csv"
    pd.DataFrame(states([OVERTAKE[1], OVERTAKE[3]])).to_csv(path, index=False)
    with pytest.raises(ImportFormatError, match="traffic in 2 to 8 lanes"):
        read_table(path, COLUMNS)


CROWD = (
    *(replace(one, s=one.s - 100.0, last=149) for one in TRAFFIC),
    *(Mover(number=30 + k, s=-20.0 * k, lane=k % 3, last=149) for k in range(9)),
)


@pytest.mark.ci
@pytest.mark.parametrize("curvature", [1.0 / 400.0, -1.0 / 300.0])
def test_a_road_that_bends_is_inferred_and_judged_as_the_straight_one(curvature):
    """Its traffic has the same ways along the right edge, and comes the other way besides."""
    table = states(CROWD)
    bend = Bend(curvature=curvature)
    x, y, _ = bend.to_world(np.array(table["x"]), np.array(table["y"]))
    bent = ot.Trajectories.from_table(
        {**table, "x": x, "y": y}, columns=COLUMNS, attempts_only=True
    )
    straight = ot.Trajectories.from_table(table, columns=COLUMNS, attempts_only=True)
    assert bent.road.is_curved
    assert not straight.road.is_curved
    assert np.allclose(np.diff(bent.road.lane_boundaries), 3.5, atol=0.06)
    # Where no lane is changed the road bends as it does.
    inner = bent.road.curvature_at(np.linspace(0.3, 0.7, 20) * bent.road.length)
    middle = float(np.median(inner))
    assert 1.0 / middle == pytest.approx(1.0 / curvature, rel=0.05)
    one, other = ot.label(bent), ot.label(straight)
    assert one.events.target_slot.tolist() == other.events.target_slot.tolist()
    assert one.labels.outcome.tolist() == other.labels.outcome.tolist()
    for field in ("line_crossed", "overlap_begin", "overlap_end"):
        apart = np.subtract(getattr(one.events, field), getattr(other.events, field))
        assert np.abs(apart).max() <= 2, field


def test_a_given_road_may_bend(tmp_path):
    """What is read back from the world is what was put there, oncoming vehicles left out."""
    line = CurveSegment(0.0, 0.0, 0.0, 1200.0, 1.0 / 400.0, 1.0 / 400.0)
    flat = read_highd(highd(tmp_path)).road
    road = replace(flat, length=1200.0, course=RoadCourse(segments=(line,)))
    table = states([*CROWD[:3], Mover(number=50, s=700.0, speed=-20.0, lane=3)])
    table = {name: np.array(each) for name, each in table.items()}
    x, y = road.to_world(table["x"], table["y"] - 5.25)
    found = recording_of(
        track_rows_from_table({**table, "x": x, "y": y}, column_map(COLUMNS)),
        column_map(COLUMNS),
        "t",
        road=road,
    )
    tracks = found.tracks
    assert found.notes["oncoming_left_out"] == 1
    there = (table["id"] != 50) & (table["x"] >= 0.0)
    order = np.lexsort((table["t"], table["id"]))[there[np.lexsort((table["t"], table["id"]))]]
    assert np.abs(tracks.s - table["x"][order]).max() < 1e-6
    assert np.abs(tracks.d - (table["y"][order] - 5.25)).max() < 1e-6
    steady = np.abs(np.gradient(table["y"][order])) < 1e-6
    along = 1.0 - tracks.d / 400.0
    speed = np.gradient(tracks.s, 0.1) * along
    inner = steady & (np.abs(np.gradient(np.gradient(tracks.s))) < 1e-6)
    assert tracks.speed[inner] == pytest.approx(speed[inner], abs=1e-3)
    assert tracks.accel_lat[inner] == pytest.approx(
        speed[inner] ** 2 / 400.0 / along[inner], abs=0.05
    )


def test_ngsims_text_without_names_is_read_as_its_table_is(tmp_path):
    path, text = tmp_path / "ngsim.csv", ngsim(TRAFFIC)
    path.write_text(text, encoding="utf-8")
    plain = tmp_path / "trajectories.txt"
    rows = (line.rsplit(",", 1)[0].split(",") for line in text.splitlines()[1:])
    lines = ("  ".join(f"{cell:>8}" for cell in row) + " " for row in rows)
    plain.write_text("\n".join(lines) + "\n", encoding="utf-8")
    one, two = read_table(path, "ngsim"), read_table(plain, "ngsim")
    assert np.array_equal(one.tracks.s, two.tracks.s)
    assert one.road.num_lanes == 3


def test_rows_can_be_chosen_by_the_value_of_a_column(tmp_path):
    path, text = tmp_path / "ngsim.csv", ngsim(TRAFFIC)
    farther = [replace(one, s=one.s + 30.0) for one in TRAFFIC]
    other = ngsim(farther).replace("us-101", "i-80").split("\n", 1)[1]
    path.write_text(text + other, encoding="utf-8")
    with pytest.raises(ImportFormatError, match="--only"):
        read_table(path, "ngsim")
    chosen = read_recording("ngsim", path, {"only": {"Location": "us-101"}})
    assert chosen.options == {"only": {"Location": "us-101"}}
    assert chosen.scenes.counts["vehicles"] == len(TRAFFIC)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": "x"}, r"columns.x: expected a unit in brackets"),
        ({"x": "x [s]"}, r"columns.x: expected a unit"),
        ({"z": "z [m]"}, r"columns.z: expected a known key"),
        ({"x": ["x1 [m]", "x2 [m]"]}, r"columns.x: expected the name of a column"),
        ({"x": "nowhere [m]"}, r"expected a column nowhere, got none"),
    ],
)
def test_a_wrong_map_is_refused_in_one_line(change, message):
    with pytest.raises((ConfigError, ImportFormatError), match=message) as caught:
        ot.Trajectories.from_table(states(), columns={**COLUMNS, **change})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"columns": {"vehicle": "id"}}, "columns: expected x, got none"),
        ({"columns": COLUMNS, "road": {"lane": 1}}, "road.lane: expected a known key"),
        ({"columns": COLUMNS, "recording": {"tested": 1}}, "recording.tested: expected a value"),
        ({"columns": COLUMNS, "more": {}}, "more: expected a known key"),
        ({"columns": COLUMNS, "recording": {"point": "rear"}}, "recording.point: expected centre"),
        ({"columns": COLUMNS, "road": {"borders_m": [3, 1]}}, "growing numbers"),
    ],
)
def test_a_map_is_checked_section_by_section(content, message):
    with pytest.raises(ConfigError, match=message):
        ot.Trajectories.from_table(states(), columns=content)


def test_a_map_without_columns_is_refused(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text('[recording]\nname = "bridge"\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="columns: expected vehicle, got none"):
        ot.Trajectories.from_table(states(), columns=path)


def test_a_column_whose_name_is_no_text_is_refused(tmp_path):
    path = tmp_path / "tracks.parquet"
    pd.DataFrame(states()).rename(columns={"x": "sideways"}).to_parquet(path)
    path.write_bytes(path.read_bytes().replace(b"sideways", b"side\xabays"))
    with pytest.raises(ImportFormatError, match="expected a readable Parquet file"):
        read_recording("table", path, {"columns": {"columns": COLUMNS}})


def test_a_bad_cell_is_named(tmp_path):
    table = pd.DataFrame(states())
    for column, value, message in (
        ("x", float("inf"), "row 4, column x: expected a number"),
        ("length", 0.0, "row 4, column length: expected a length, 0.1 to 50 m"),
        ("t", 1e15, "row 4, column t: expected a number of size at most"),
        ("t", 0.0, "row 4, column t: expected another time of vehicle 7"),
    ):
        wrong = table.copy()
        wrong[column] = wrong[column].astype(float)
        wrong.loc[3, column] = value
        with pytest.raises(ImportFormatError, match=message):
            ot.Trajectories.from_table(wrong, columns=COLUMNS)


def test_an_unlisted_type_is_refused_and_what_is_left_out_is_counted(tmp_path):
    movers = [*TRAFFIC, Mover(number=20, s=0.0, speed=1.5, kind="pedestrian", length=0.5)]
    path = tmp_path / "t.csv"
    pd.DataFrame(states(movers)).to_csv(path, index=False)
    content: dict[str, Any] = {"columns": {**COLUMNS, "type": "kind"}, "types": dict(TYPES)}
    with pytest.raises(ImportFormatError, match="column kind: expected car or truck, got pedestr"):
        read_table(path, content)
    content["types"]["left_out"] = ["pedestrian"]
    found = read_table(path, content)
    assert found.notes["left_out"] == 1
    assert "20" not in found.tracks.names


def test_the_template_is_a_map_once_it_is_filled_in(tmp_path, capsys):
    path, out = tmp_path / "t.csv", tmp_path / "map.toml"
    pd.DataFrame(states(TRAFFIC)).to_csv(path, index=False)
    assert main(["import", "table", str(path), "--template", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert "Columns of the table: id, t, x, y" in text
    for name, cell in COLUMNS.items():
        start = text.index(f"# {name} = ")
        text = text[:start] + f'{name} = "{cell}"' + text[text.index("  #", start) :]
    out.write_text(text, encoding="utf-8")
    line = ["import", "table", str(path), "--columns", str(out), "--out", str(tmp_path / "data")]
    assert main([*line, "--json"]) == 0
    told = json.loads(capsys.readouterr().out.split("map.toml\n", 1)[-1])
    assert told["undecidable"] == ot.law.undecidable_rules(told["unknown"])
    assert "L3" in told["undecidable"]["always"]
    assert set(told["files"]) == {"t.csv", "map.toml"}
    assert main(["import", "table", str(path), "--template", "--out", str(out)]) == 2
    assert "one that exists" in capsys.readouterr().err


def test_the_map_of_the_how_to_page_imports_a_table(tmp_path, repository):
    page = (repository / "docs" / "how-to" / "import-a-table.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    pd.DataFrame(states(TRAFFIC)).to_csv(tmp_path / "tracks.csv", index=False)
    found = read_table(tmp_path / "tracks.csv", tmp_path / "map.toml")
    assert found.road.speed_limit == pytest.approx(120 / 3.6)
    assert "marks" in found.unknown
    assert not {"kinds", "road_kind", "speed_limit"} & found.unknown
    assert len(text.splitlines()) < 60
    for name in map_names():
        assert all(f"`{column}`" in page for column in column_map(name).names("tracks")), name


def test_a_table_needs_a_map(tmp_path, capsys):
    path = tmp_path / "t.csv"
    pd.DataFrame(states()).to_csv(path, index=False)
    assert main(["import", "table", str(path), "--out", str(tmp_path / "data")]) == 2
    assert "--columns" in capsys.readouterr().err


def test_the_template_names_every_quantity():
    from overtaking.recordings.column_map import QUANTITIES

    text = template(("a", "b"))
    assert all(f"# {name} = " in text for name in QUANTITIES)
