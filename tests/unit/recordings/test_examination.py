"""Recordings are examined before they are judged: gaps, and positions that no vehicle reaches."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from tests.support.recordings import commonroad, states

from overtaking.core.errors import ImportFormatError
from overtaking.recordings.column_map import column_map
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.findings import Check, Consequence
from overtaking.recordings.motion_check import find_faulty_rows
from overtaking.recordings.tables import recording_of
from overtaking.recordings.track_table import track_rows_from_table

COLUMNS = {
    "columns": {
        "vehicle": "id",
        "time": "t [s]",
        "x": "x [m]",
        "y": "y [m]",
        "length": "length [m]",
        "width": "width [m]",
        "type": "kind",
    },
    "types": {"car": ["car"], "truck": ["truck"]},
    "road": {"kind": "motorway", "borders_m": [0.0, 3.5, 7.0, 10.5], "heading_deg": 0},
}


@pytest.fixture
def frame() -> pd.DataFrame:
    """Four vehicles at 10 Hz; 3 overtakes 5."""
    return pd.DataFrame(states())


def read(table, columns=COLUMNS):
    columns = column_map(columns)
    return recording_of(track_rows_from_table(table, columns), columns, "test")


def track_of(recording, name: str) -> slice:
    place = recording.tracks.names.tolist().index(name)
    return slice(*recording.tracks.start[place : place + 2].tolist())


def without(table, vehicle: int, first: float, last: float):
    return table[(table.id != vehicle) | (table.t < first - 1e-6) | (table.t > last + 1e-6)]


# Gaps


def test_a_clean_table_has_no_findings(frame):
    assert read(frame).findings == ()


def test_a_gap_of_half_a_second_is_interpolated_and_counted(frame):
    whole, recording = read(frame), read(without(frame, 3, 8.0, 8.3))
    assert recording.tracks.names.tolist() == whole.tracks.names.tolist()
    assert recording.tracks.s == pytest.approx(whole.tracks.s, abs=0.01)
    assert recording.tracks.d == pytest.approx(whole.tracks.d, abs=0.1)
    (finding,) = recording.findings
    assert (finding.check, finding.consequence) == (Check.GAPS, Consequence.CORRECTED)
    assert (finding.vehicle, finding.rows) == ("3", 4)
    assert finding.first_time_s == pytest.approx(8.0)


def test_a_longer_gap_splits_a_track_and_is_reported(frame):
    whole, recording = read(frame), read(without(frame, 3, 8.0, 8.5))
    assert sorted(recording.tracks.names) == ["3", "3 (2)", "5", "7", "9"]
    assert recording.tracks.num_rows == whole.tracks.num_rows - 6
    (finding,) = recording.findings
    assert (finding.check, finding.consequence) == (Check.GAPS, Consequence.REPORTED)
    assert (finding.vehicle, finding.first_time_s) == ("3", pytest.approx(8.0))
    assert "3 (2)" in finding.detail


def test_a_slower_vehicle_is_interpolated_to_the_rate_of_the_recording(frame):
    whole = read(frame)
    is_slow = (frame.id == 3) & (np.rint(frame.t * 10) % 2 == 1)
    recording = read(frame[~is_slow])
    assert recording.frame_interval_ms == 100
    assert recording.tracks.names.tolist() == whole.tracks.names.tolist()
    (finding,) = recording.findings
    assert (finding.check, finding.vehicle) == (Check.FRAME_RATE, "3")
    assert finding.consequence is Consequence.CORRECTED


def test_a_vehicle_with_a_row_each_second_is_interpolated(frame):
    is_slow = (frame.id == 3) & (np.rint(frame.t * 10) % 10 != 0)
    recording = read(frame[~is_slow])
    assert recording.tracks.num_vehicles == 4
    assert [finding.check for finding in recording.findings] == [Check.FRAME_RATE]


def test_a_table_with_every_fifth_frame_has_a_fifth_of_the_rate(frame):
    columns = {
        **COLUMNS,
        "columns": {name: text for name, text in COLUMNS["columns"].items() if name != "time"}
        | {"frame": "frame"},
        "recording": {"frames_per_second": 50.0},
    }
    # The states of 10 Hz at every fifth frame of 50 Hz.
    frame["frame"] = np.rint(frame.t * 10).astype(int) * 5 + 2
    recording = read(frame, columns)
    assert recording.frame_interval_ms == 100
    assert recording.tracks.num_rows == len(frame)
    assert recording.findings == ()


def test_a_recording_in_short_pieces_is_refused_for_its_frame_rate(frame):
    is_second = np.rint(frame.t * 10) % 10 < 2
    with pytest.raises(ImportFormatError, match=r"frame rate: expected rows of most vehicles"):
        read(frame[is_second])


def test_a_missing_time_step_of_a_scenario_is_interpolated(write):
    text = commonroad()
    whole = read_commonroad(write(text))
    shorter = re.sub(
        r"<state>(?:(?!</state>).)*<time><exact>(?:50|51)</exact></time>.*?</state>", "", text
    )
    recording = read_commonroad(write(shorter))
    assert recording.tracks.s == pytest.approx(whole.tracks.s, abs=0.02)
    assert {finding.check for finding in recording.findings} == {Check.GAPS}
    assert {finding.first_time_s for finding in recording.findings} == {5.0}
    assert {finding.rows for finding in recording.findings} == {2}


def test_time_steps_that_are_missing_for_long_split_a_vehicle_of_a_scenario(write):
    text = commonroad()
    whole = read_commonroad(write(text))
    shorter = re.sub(
        r"<state>(?:(?!</state>).)*<time><exact>5\d</exact></time>.*?</state>", "", text
    )
    recording = read_commonroad(write(shorter))
    names = whole.tracks.names.tolist()
    assert sorted(recording.tracks.names) == sorted([*names, *(f"{name} (2)" for name in names)])
    assert {finding.consequence for finding in recording.findings} == {Consequence.REPORTED}


# Motion


@pytest.mark.parametrize("away", [(15.0, 0.0), (-2.5, 0.0), (0.0, 3.5), (0.0, -1.2), (900.0, 0.0)])
@pytest.mark.parametrize("num_rows", [1, 3])
def test_rows_out_of_place_are_left_out_and_named(frame, away, num_rows):
    whole = read(frame)
    wrong = (frame.id == 3) & frame.t.between(2.95, 2.96 + 0.1 * num_rows)
    assert wrong.sum() == num_rows
    frame.loc[wrong, "x"] += away[0]
    frame.loc[wrong, "y"] += away[1]
    recording = read(frame)
    (finding,) = recording.findings
    assert (finding.check, finding.consequence) == (Check.MOTION, Consequence.LEFT_OUT)
    assert (finding.vehicle, finding.rows) == ("3", num_rows)
    assert finding.first_time_s == pytest.approx(3.0)
    assert recording.tracks.names.tolist() == whole.tracks.names.tolist()
    assert recording.tracks.s == pytest.approx(whole.tracks.s, abs=0.05)
    assert recording.tracks.d == pytest.approx(whole.tracks.d, abs=0.05)


def test_a_first_row_out_of_place_is_left_out(frame):
    wrong = (frame.id == 3) & (frame.t < 0.05)
    frame.loc[wrong, "x"] += 8.0
    recording = read(frame)
    (finding,) = recording.findings
    assert (finding.check, finding.vehicle, finding.first_time_s) == (Check.MOTION, "3", 0.0)
    assert recording.tracks.num_rows == len(frame) - 1


def test_a_jump_to_another_path_is_reported(frame):
    frame.loc[(frame.id == 7) & (frame.t > 9.95), "y"] += 3.0
    (finding,) = read(frame).findings
    assert (finding.check, finding.consequence) == (Check.MOTION, Consequence.REPORTED)
    assert (finding.vehicle, finding.first_time_s) == ("7", pytest.approx(10.0))


def test_a_state_of_a_scenario_out_of_place_is_left_out(write):
    text = commonroad()
    whole = read_commonroad(write(text))
    obstacle = re.findall(r'<dynamicObstacle id="3">.*?</dynamicObstacle>', text)[0]
    wrong = re.sub(
        r"<x>([-0-9.]*)</x>(<y>[-0-9.]*</y></point></position><orientation><exact>[-0-9.]*</exact>"
        r"</orientation><time><exact>60<)",
        lambda state: f"<x>{float(state[1]) + 15.0}</x>{state[2]}",
        obstacle,
    )
    assert wrong != obstacle
    recording = read_commonroad(write(text.replace(obstacle, wrong)))
    (finding,) = recording.findings
    assert (finding.check, finding.vehicle, finding.first_time_s) == (Check.MOTION, "3", 6.0)
    assert recording.tracks.s == pytest.approx(whole.tracks.s, abs=0.02)
    assert recording.tracks.accel_lon == pytest.approx(whole.tracks.accel_lon, abs=0.1)


@pytest.mark.parametrize("interval_ms", [40, 100, 200])
@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_change_of_speed_in_an_instant_is_no_faulty_row(interval_ms, share):
    time = np.arange(100) * interval_ms * 1e-3
    hit = time[50] + share * interval_ms * 1e-3
    x = np.where(time < hit, 35.0 * time, 35.0 * hit + 2.0 * (time - hit))
    y = np.where(time < hit, 0.0, 6.0 * (time - hit))
    faulty = find_faulty_rows(np.zeros(100, np.int64), np.arange(100.0), x, y, interval_ms)
    assert faulty.row.tolist() == []
    assert faulty.jump.tolist() == []


def test_positions_that_scatter_everywhere_are_kept_and_reported(frame):
    frame["x"] += np.random.default_rng(1).normal(0.0, 5.0, len(frame))
    findings = [each for each in read(frame).findings if each.check is Check.MOTION]
    assert [(each.consequence, each.rows) for each in findings] == [
        (Consequence.REPORTED, len(frame))
    ]


# Sizes


def test_exchanged_columns_of_sizes_are_refused(frame):
    wrong = frame.rename(columns={"length": "width", "width": "length"})
    with pytest.raises(ImportFormatError, match=r"length and width of 4 of 4 vehicles: expected"):
        read(wrong)


def test_exchanged_sizes_of_a_vehicle_are_reported(frame):
    frame.loc[frame.id == 5, ["length", "width"]] = 1.8, 4.6
    (finding,) = read(frame).findings
    assert (finding.check, finding.consequence) == (Check.SIZES, Consequence.REPORTED)
    assert (finding.vehicle, finding.rows) == ("5", 300)


def test_exchanged_sizes_of_a_scenario_are_refused(write):
    text = re.sub(
        "<length>(.*?)</length><width>(.*?)</width>",
        r"<length>\2</length><width>\1</width>",
        commonroad(),
    )
    with pytest.raises(ImportFormatError, match="exchange the two columns"):
        read_commonroad(write(text))


# One vehicle under two ids


@pytest.mark.parametrize("is_first_in_file", [False, True])
def test_of_two_tracks_of_a_vehicle_the_later_one_in_the_file_is_left_out(frame, is_first_in_file):
    ghost = frame[frame.id == 3].assign(id=1, x=lambda one: one.x + 0.8)
    table = pd.concat([ghost, frame] if is_first_in_file else [frame, ghost])
    recording = read(table)
    (finding,) = recording.findings
    assert (finding.check, finding.consequence) == (
        Check.DUPLICATE_VEHICLES,
        Consequence.LEFT_OUT,
    )
    assert (finding.vehicle, finding.rows) == ("3" if is_first_in_file else "1", 300)
    assert finding.first_time_s == pytest.approx(0.0)
    assert sorted(recording.tracks.names) == sorted(
        {"1", "5", "7", "9"} if is_first_in_file else {"3", "5", "7", "9"}
    )


def test_the_shorter_of_two_tracks_is_left_out_at_the_time_of_the_file(frame):
    frame["t"] += 1000.0
    ghost = frame[(frame.id == 3) & frame.t.between(1004.95, 1012.0)].assign(id=1)
    (finding,) = read(pd.concat([ghost, frame])).findings
    assert (finding.vehicle, finding.first_time_s) == ("1", pytest.approx(1005.0))


def test_a_new_id_on_the_way_is_reported(frame):
    is_late = (frame.id == 3) & (frame.t > 15.0)
    table = pd.concat([frame[~is_late], frame[(frame.id == 3) & (frame.t > 14.0)].assign(id=33)])
    recording = read(table)
    (finding,) = recording.findings
    assert finding.consequence is Consequence.REPORTED
    assert {"3", "33"} <= set(recording.tracks.names)


def test_vehicles_that_touch_later_or_at_other_speeds_are_two(frame):
    touching = frame[frame.id == 3].copy()
    late = touching.t > 6.0
    beside = touching.assign(id=1)
    beside.loc[~late, "x"] -= 30.0 - 5.0 * touching.t[~late]
    faster = touching.assign(id=2, x=touching.x + 0.05 * touching.t)
    faster["x"] = touching.x.iloc[0] + 1.0 + (touching.x - touching.x.iloc[0]) * 1.2
    recording = read(pd.concat([frame, beside, faster]))
    assert Check.DUPLICATE_VEHICLES not in {finding.check for finding in recording.findings}


def test_a_second_id_in_a_scenario_is_left_out(write):
    text = commonroad()
    obstacle = re.findall(r'<dynamicObstacle id="5">.*?</dynamicObstacle>\n', text)[0]
    ghost = obstacle.replace('id="5"', 'id="2"')
    recording = read_commonroad(write(text.replace(obstacle, obstacle + ghost)))
    (finding,) = recording.findings
    assert (finding.check, finding.vehicle) == (Check.DUPLICATE_VEHICLES, "2")
    assert "2" not in recording.tracks.names
