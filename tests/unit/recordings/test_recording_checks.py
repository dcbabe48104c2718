"""Quantities that a recording states twice are compared with each other."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from tests.support.recordings import OVERTAKE, Bend, Mover, exid, highd, states

from overtaking.cli import main
from overtaking.core.errors import ImportFormatError
from overtaking.recordings.column_map import column_map
from overtaking.recordings.highd import read_highd
from overtaking.recordings.recording_checks import check_rows
from overtaking.recordings.tables import read_table, recording_of
from overtaking.recordings.track_table import track_rows_from_table

if TYPE_CHECKING:
    from pathlib import Path

COLUMNS = {
    "vehicle": "id",
    "time": "t [s]",
    "x": "x [m]",
    "y": "y [m]",
    "length": "length [m]",
    "width": "width [m]",
}
MOVERS = [
    *(replace(one, s=one.s + 100.0) for one in OVERTAKE),
    Mover(number=11, s=0.0, speed=33.0, lane=2, moves=((6.0, 1), (12.0, 2))),
]


@pytest.fixture
def frame() -> pd.DataFrame:
    """Traffic on a road that bends to the left, with all quantities, without contradiction."""
    table = {name: np.array(values) for name, values in states(MOVERS).items()}
    bend = Bend(curvature=1.0 / 500.0)
    x, y, angle = bend.to_world(table["x"], table["y"])
    heading = angle + np.radians(table["yaw"])
    speed = np.hypot(table["vx"], table["vy"]) * (1.0 - table["y"] / 500.0)
    made = pd.DataFrame({name: table[name] for name in ("id", "t", "length", "width", "kind")})
    made["x"], made["y"], made["v"], made["heading"] = x, y, speed, heading
    made["vx"], made["vy"] = speed * np.cos(heading), speed * np.sin(heading)
    for of, name in (("vx", "ax"), ("vy", "ay"), ("heading", "yaw_rate")):
        made[name] = made.groupby("id")[of].transform(lambda one: np.gradient(one, 0.1))
    return made


def sentences(table: pd.DataFrame, **columns: str) -> list[str]:
    rows = track_rows_from_table(table, column_map({**COLUMNS, **columns}))
    return [finding.detail for finding in check_rows(rows)]


def sentence(table: pd.DataFrame, **columns: str) -> str:
    (found,) = sentences(table, **columns)
    return found


ALL = {
    "speed": "v [m/s]",
    "vx": "vx [m/s]",
    "vy": "vy [m/s]",
    "heading": "heading [rad]",
    "ax": "ax [m/s^2]",
    "ay": "ay [m/s^2]",
    "yaw_rate": "yaw_rate [rad/s]",
}


def test_a_table_without_contradictions_gives_no_warning(frame):
    assert sentences(frame, **ALL) == []


@pytest.mark.parametrize(
    ("factor", "name"),
    [
        (3.6, "3.6 (km/h and m/s)"),
        (1 / 3.6, "1/3.6 (km/h and m/s)"),
        (0.3048, "0.3048 (feet and metres)"),
        (1 / 0.3048, "1/0.3048 (feet and metres)"),
        (1000.0, "1000"),
        (1 / 0.44704, "1/0.44704 (mph and m/s)"),
    ],
)
def test_speeds_in_another_unit_are_named_by_the_factor(frame, factor, name):
    warning = sentence(frame.assign(v=frame.v * factor), speed="v [m/s]")
    assert warning.startswith("speed and positions")
    assert f"likely the factor {name}" in warning


@pytest.mark.parametrize("factor", [3.6, 0.3048])
def test_components_of_the_speed_in_another_unit_are_named_by_the_factor(frame, factor):
    wrong = frame.assign(vx=frame.vx * factor, vy=frame.vy * factor)
    warning = sentence(wrong, vx="vx [m/s]", vy="vy [m/s]")
    assert f"likely the factor {factor:g} (" in warning


def test_components_of_the_speed_are_compared_beside_a_right_speed(frame):
    wrong = frame.assign(vx=frame.vx * 3.6, vy=frame.vy * 3.6)
    warning = sentence(wrong, speed="v [m/s]", vx="vx [m/s]", vy="vy [m/s]")
    assert warning.startswith("vx and vy and positions")
    assert "likely the factor 3.6" in warning


def test_positions_in_feet_are_found_by_speeds(frame):
    wrong = frame.assign(x=frame.x / 0.3048, y=frame.y / 0.3048)
    warning = sentence(wrong, speed="v [m/s]")
    assert "likely the factor 0.3048" in warning
    assert "points to the unit of x and y" in warning


def test_positions_in_feet_are_found_by_the_speed_of_traffic():
    wrong = pd.DataFrame(states(MOVERS))
    wrong[["x", "y"]] /= 0.3048
    assert "unit of x and y is off by the factor 0.3048" in sentence(wrong)


def test_positions_of_slow_traffic_in_feet_are_found_by_its_lanes():
    slow = [replace(one, speed=one.speed * 0.3, s=one.s * 0.5) for one in MOVERS]
    wrong = pd.DataFrame(states(slow))
    wrong[["x", "y"]] /= 0.3048
    (finding,) = recording_of(
        track_rows_from_table(wrong, column_map(COLUMNS)), column_map(COLUMNS), "t"
    ).findings
    assert re.search(r"11\.5 m apart.* by the factor 0\.3048", finding.detail)


@pytest.mark.parametrize("factor", [0.3048, 1 / 0.3048])
def test_sizes_in_another_unit_are_named_by_the_factor(frame, factor):
    warning = sentence(frame.assign(length=frame.length * factor, width=frame.width * factor))
    assert warning.startswith("width: vehicles are")
    assert "0.3048 (feet and metres)" in warning


@pytest.mark.parametrize(
    ("heading", "name"),
    [
        (lambda h: np.degrees(h), "degrees where the map declares radians"),
        (lambda h: -h, "clockwise from x (y is flipped)"),
        (lambda h: np.pi / 2 - h, "as a compass has it"),
        (lambda h: np.degrees(np.pi / 2 - h), "degrees where the map declares radians, clockwise"),
        (lambda h: h + np.pi, "the opposite direction"),
    ],
)
def test_the_convention_of_headings_is_named(frame, heading, name):
    turned = frame.assign(heading=heading(frame.heading + 0.4))
    cosine, sine = np.cos(0.4), np.sin(0.4)
    x, y = turned.x * cosine - turned.y * sine, turned.x * sine + turned.y * cosine
    warning = sentence(turned.assign(x=x, y=y), heading="heading [rad]")
    assert warning.startswith("heading and positions")
    assert name in warning.partition("; likely ")[2]


def test_radians_that_are_declared_as_degrees_are_named(frame):
    turned = frame.assign(x=-frame.y, y=frame.x, heading=frame.heading + np.pi / 2)
    warning = sentence(turned, heading="heading [deg]")
    assert "radians where the map declares degrees" in warning


def test_an_axis_that_is_flipped_is_named(frame):
    assert "sign of vy" in sentence(frame.assign(vy=-frame.vy), vx="vx [m/s]", vy="vy [m/s]")
    swapped = frame.assign(vx=frame.vy, vy=frame.vx)
    warning = sentences(swapped, vx="vx [m/s]", vy="vy [m/s]")
    assert any("swapped" in text for text in warning)


@pytest.mark.parametrize("factor", [9.80665, 1 / 9.80665, 3.6])
def test_accelerations_in_another_unit_are_named_by_the_factor(frame, factor):
    wrong = frame.assign(ay=frame.ay * factor, ax=frame.ax * factor)
    warning = sentences(wrong, vx="vx [m/s]", vy="vy [m/s]", ax="ax [m/s^2]", ay="ay [m/s^2]")
    assert warning
    assert all("likely the factor" in one for one in warning)


def test_exchanged_components_of_the_speed_are_named_on_a_straight_road():
    keeps_lane = [replace(mover, moves=()) for mover in MOVERS]
    table = pd.DataFrame(states(keeps_lane))
    swapped = table.assign(vx=table.vy, vy=table.vx)
    assert "swapped" in sentence(swapped, vx="vx [m/s]", vy="vy [m/s]")


def test_accelerations_in_another_unit_are_named_where_few_vehicles_brake(frame):
    # One vehicle of five brakes at 1 m/s^2, for 3 s of 30.
    braking = np.where(frame.id == 7, np.clip(frame.t - 10.0, 0.0, 3.0), 0.0)
    after = np.where(frame.id == 7, np.clip(frame.t - 13.0, 0.0, None), 0.0)
    table = frame.assign(
        x=20.0 * frame.t - 0.5 * braking**2 - 3.0 * after,
        y=1.0,
        v=20.0 - braking,
        a=np.where((braking > 0.0) & (after == 0.0), -1.0, 0.0),
    )
    columns = {"speed": "v [m/s]", "accel_lon": "a [m/s^2]"}
    assert sentences(table, **columns) == []
    warning = sentence(table.assign(a=table.a * 3.6), **columns)
    assert "accel_lon is not the change of speed" in warning


def test_an_error_about_oncoming_vehicles_names_headings_that_contradict_the_movement():
    table = pd.DataFrame(states(MOVERS))
    table["yaw"] += 150.0
    columns = column_map(
        {
            "columns": {**COLUMNS, "heading": "yaw [deg]"},
            "road": {"kind": "motorway", "borders_m": [0.0, 3.5, 7.0, 10.5], "heading_deg": 0},
        }
    )
    with pytest.raises(ImportFormatError, match=r"oncoming ones; heading .* are 150 degrees off"):
        recording_of(track_rows_from_table(table, columns), columns, "test")


def test_a_yaw_rate_in_degrees_is_named(frame):
    warning = sentence(
        frame.assign(yaw_rate=np.degrees(frame.yaw_rate)),
        heading="heading [rad]",
        yaw_rate="yaw_rate [rad/s]",
    )
    assert "degrees and radians" in warning


def test_sizes_of_two_tables_are_compared(tmp_path: Path):
    path = exid(tmp_path, MOVERS)
    assert read_table(path, "exid").findings == ()
    lines = path.read_text(encoding="utf-8").splitlines()
    names = lines[0].split(",")
    rows = [line.split(",") for line in lines[1:]]
    for row in rows:
        for name in ("width", "length"):
            row[names.index(name)] = f"{float(row[names.index(name)]) / 0.3048:.4f}"
    path.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n", "utf-8")
    found = read_table(path, "exid")
    details = [finding.detail for finding in found.findings]
    assert [text.partition("column ")[2].partition(":")[0] for text in details] == [
        "length",
        "width",
    ]
    assert all("5 of 5 vehicles" in text and "1/0.3048" in text for text in details)
    assert sorted(found.tracks.length.tolist()) == [4.5, 4.5, 4.5, 4.5, 12.0]


def test_speeds_of_highd_in_another_unit_are_named(tmp_path: Path):
    path = highd(tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    for row in rows:
        row[6], row[7] = (f"{float(row[k]) * 3.6:.4f}" for k in (6, 7))
    path.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n", "utf-8")
    (finding,) = read_highd(path).findings
    assert "likely the factor 3.6" in finding.detail


def test_findings_reach_the_command_line(tmp_path: Path, frame, capsys):
    path, columns = tmp_path / "t.csv", tmp_path / "map.toml"
    frame.assign(v=frame.v * 3.6).to_csv(path, index=False)
    cells = {**COLUMNS, "speed": "v [m/s]"}
    text = "\n".join(f'{name} = "{cell}"' for name, cell in cells.items())
    columns.write_text(f"[columns]\n{text}\n", encoding="utf-8")
    line = ["import", "table", str(path), "--columns", str(columns), "--out", str(tmp_path / "d")]
    assert main(line) == 0
    err = capsys.readouterr().err
    assert "warning: map t: speeds: reported, 1,500 rows: speed and positions" in err
    assert "likely the factor 3.6" in err
    assert "RecordingWarning" not in err


# Positions that integers cannot hold


def test_absolute_coordinates_are_shifted_and_the_road_keeps_the_shift(tmp_path: Path):
    table: Any = pd.DataFrame(states(MOVERS))
    table["x"] += 691_000.0
    table["y"] += 5_335_000.0
    table.to_csv(tmp_path / "t.csv", index=False)
    found = read_table(tmp_path / "t.csv", COLUMNS)
    road, tracks = found.road, found.tracks
    assert (road.origin_x, road.origin_y) == (691_000.0, 5_335_000.0)
    assert np.abs(tracks.y).max() < 1000.0
    x, y = road.to_source(tracks.x, tracks.y)
    order = np.lexsort((table.t, table.id))
    assert np.abs(x - table.x.to_numpy()[order]).max() < 1e-6
    assert np.abs(y - table.y.to_numpy()[order]).max() < 1e-6
    near = read_table_shifted(tmp_path, table)
    assert np.allclose(near.tracks.s, tracks.s, atol=1e-6)
    assert np.allclose(near.tracks.d, tracks.d, atol=1e-6)


def read_table_shifted(folder: Path, table: pd.DataFrame) -> Any:
    """The same on the road that keeps the shift, which maps in those coordinates have."""
    path = folder / "again.csv"
    table.to_csv(path, index=False)
    road = read_table(path, COLUMNS).road
    return read_table(path, COLUMNS, road=road)


def test_stated_borders_are_in_the_coordinates_of_the_table(tmp_path: Path):
    table = pd.DataFrame(states(MOVERS))
    table["y"] += 5_335_000.0
    table.to_csv(tmp_path / "t.csv", index=False)
    borders = [5_335_000.0 + 3.5 * k for k in range(4)]
    content = {"columns": COLUMNS, "road": {"borders_m": borders, "heading_deg": 0}}
    found = read_table(tmp_path / "t.csv", content)
    assert found.road.num_lanes == 3
    assert np.unique(found.tracks.lane).tolist() == [0, 1, 2]


def test_a_position_that_integers_cannot_hold_is_refused_in_one_line(tmp_path: Path):
    road = read_highd(highd(tmp_path)).road
    far = replace(road, x0=1_800_000.0)
    table = pd.DataFrame(states(MOVERS))
    table["x"] += 2_200_000.0
    rows = track_rows_from_table(table, column_map(COLUMNS))
    long = replace(far, length=100_000.0)
    with pytest.raises(ImportFormatError) as caught:
        recording_of(rows, column_map(COLUMNS), "t", road=replace(long, origin_x=0.0))
    assert "\n" not in str(caught.value)


def test_a_speed_that_integers_cannot_hold_is_refused_with_vehicle_and_frame(tmp_path: Path):
    table = pd.DataFrame(states(MOVERS)).assign(v=25.0)
    table.loc[5, "v"] = 1200.0
    table.to_csv(tmp_path / "t.csv", index=False)
    columns = {**COLUMNS, "speed": "v [m/s]"}
    with pytest.raises(ImportFormatError, match=r"speed of vehicle 7 in frame 5: .* 1000 m/s"):
        read_table(tmp_path / "t.csv", columns)
