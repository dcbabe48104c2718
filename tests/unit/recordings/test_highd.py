"""highD recordings: files in exactly its columns, both directions, every number known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support.recordings import (
    HIGHD_META,
    HIGHD_ROWS,
    HIGHD_VEHICLES,
    OVERTAKE,
    RECORDING_META,
    TRACKS,
    TRACKS_META,
    Mover,
    highd,
)

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.recordings.findings import Check, Consequence
from overtaking.recordings.highd import read_highd
from overtaking.recordings.scenes import scenes

SLOW = [Mover(number=20, s=100.0, speed=22.0), Mover(number=21, s=40.0, speed=28.0, lane=2)]


def test_the_columns_are_those_of_the_owners_tools():
    assert ",".join(TRACKS) == HIGHD_ROWS
    assert ",".join(TRACKS_META) == HIGHD_VEHICLES
    assert ",".join(RECORDING_META) == HIGHD_META


def test_a_box_at_its_upper_left_corner_becomes_a_centre_along_and_across(tmp_path):
    found = read_highd(highd(tmp_path))
    tracks = found.tracks
    three = int(np.flatnonzero(tracks.names == "3")[0])
    rows = slice(tracks.start[three], tracks.start[three + 1])
    time = np.arange(300) * 0.04
    assert found.frame_interval_ms == 40
    assert np.abs(tracks.s[rows] - (80.0 + 24.0 * time)).max() < 1e-4
    assert np.abs(tracks.d[rows] - found.road.lane_centres[0]).max() < 1e-9
    assert tracks.length[three] == 4.5
    assert tracks.width[three] == 1.8
    assert (tracks.lane[rows] == 0).all()


def test_both_directions_of_the_same_traffic_are_the_same_recording(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    down = read_highd(highd(tmp_path / "a", lower=OVERTAKE))
    up = read_highd(highd(tmp_path / "b", lower=(), upper=OVERTAKE))
    for name in ("d", "speed", "heading", "lane", "accel_lon", "accel_lat"):
        assert np.allclose(getattr(down.tracks, name), getattr(up.tracks, name), atol=1e-4), name
    # The upper lanes begin where the image ends, wherever that is.
    assert np.ptp(down.tracks.s - up.tracks.s) < 1e-4


def test_carriageways_have_nothing_to_do_with_each_other(tmp_path):
    alone = scenes(read_highd(highd(tmp_path)))
    (tmp_path / "both").mkdir()
    both = scenes(read_highd(highd(tmp_path / "both", upper=SLOW)))
    assert alone.counts["passes"] + 1 == both.counts["passes"]
    assert both.counts["candidate_overtakes"] == 1
    for window in both.windows:
        assert len({int(both.recording.tracks.carriageway[one]) for one in window.vehicles}) == 1


def test_who_drives_against_its_carriageway_is_left_out_and_counted(tmp_path):
    wrong = Mover(number=30, s=600.0, speed=-25.0, lane=2)
    alone = scenes(read_highd(highd(tmp_path)))
    both = scenes(read_highd(highd(tmp_path, lower=[*OVERTAKE, wrong])))
    assert (alone.notes["oncoming_left_out"], both.notes["oncoming_left_out"]) == (0, 1)
    assert both.counts == alone.counts


def test_one_direction_can_be_chosen_and_must_be_where_the_lanes_differ(tmp_path):
    path = highd(tmp_path, upper=SLOW, upper_lines="4;7.5;11;14.5;18")
    with pytest.raises(ConfigError, match="different numbers of lanes"):
        read_highd(path)
    assert read_highd(path, direction=1).tracks.names.tolist() == ["20", "21"]
    assert read_highd(path, direction=1).road.num_lanes == 4
    assert read_highd(path, direction=2).tracks.names.tolist() == ["3", "5", "7", "9"]
    with pytest.raises(ConfigError, match="direction"):
        read_highd(path, direction=3)


def test_lanes_of_different_widths_are_averaged_and_nobody_changes_lane_by_it(tmp_path):
    found = read_highd(highd(tmp_path, upper=SLOW, upper_lines="4;7.7;11.6;15.5"))
    assert np.allclose(np.diff(found.road.lane_boundaries), [3.6, 3.7, 3.7])
    assert found.notes["widening"] == pytest.approx(0.2 / 3.7, abs=1e-4)
    # A vehicle in the middle of a lane of 3.5 m is in the middle of that of 3.6 m.
    three = int(np.flatnonzero(found.tracks.names == "3")[0])
    assert found.tracks.d[found.tracks.start[three]] == pytest.approx(found.road.lane_centres[0])


def test_speed_limits_are_taken_over_and_none_is_none(tmp_path):
    assert read_highd(highd(tmp_path, limit=36.11)).road.speed_limit == 36.11
    free = read_highd(highd(tmp_path, limit=-1.0))
    assert free.road.speed_limit == 100.0
    assert free.notes["has_speed_limit"] is False
    assert "speed_limit" not in free.unknown
    assert {"marks", "yaw_rate", "weather", "drivers"} <= free.unknown


def test_cars_are_cars_whatever_their_length_and_trucks_are_trucks(tmp_path):
    movers = [
        Mover(number=1, s=10.0, length=9.0),
        Mover(number=2, s=50.0, length=5.5, kind="truck"),
        Mover(number=3, s=90.0, length=3.6),
    ]
    assert read_highd(highd(tmp_path, lower=movers)).tracks.kind.tolist() == [2, 4, 0]


def test_an_overtake_is_one_simulation_with_the_ego_and_its_target_first(tmp_path):
    longer = [replace(one, last=499) for one in OVERTAKE]
    found = scenes(read_highd(highd(tmp_path, lower=longer)), attempts_only=True)
    assert len(found) == 1
    assert found.counts == {
        "vehicles": 4,
        "lane_changes_left": 1,
        "lane_changes_right": 1,
        "passes": 1,
        "candidate_overtakes": 1,
        "candidates_that_return": 1,
        "followers_without_attempt": 2,
        "types": {"L": 1, "M": 3},
        "neighbours_with_a_slot": 1.0,
    }
    (text,) = found.sources(range(1))
    assert "vehicles 7 3 " in text
    run = found.trajectories(range(1))
    assert run.unknown == found.unknown
    assert run.num_frames[0] == run.states.s.shape[2]
    ego, target = run.states.s[0, 0], run.states.s[0, 1]
    assert ego[0] < target[0]
    assert ego[-1] > target[-1]


def test_rows_in_any_order_are_the_same_recording(tmp_path):
    path = highd(tmp_path)
    first = read_highd(path)
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([head, *reversed(rows)]) + "\n", encoding="utf-8")
    again = read_highd(path)
    assert np.array_equal(first.tracks.s, again.tracks.s)
    assert np.array_equal(first.tracks.names, again.tracks.names)


def _changed(path, line: int, column: int, cell: str) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    cells = lines[line - 1].split(",")
    cells[column] = cell
    lines[line - 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("column", "cell", "message"),
    [
        (2, "inf", r"line 5, column x"),
        (2, "1e9", r"line 5, column x"),
        (2, "abc", r"01_tracks\.csv: line \d+: .*abc"),
        (0, "2", r"line 5, column frame: expected another frame of vehicle 7 than in line 4"),
        (0, "9", r"column frame: expected another frame of vehicle 7 than in line 5"),
        (1, "4444", r"line 5, column id: expected an id of tracksMeta, got 4444"),
        (6, "1e999", r"line 5, column xVelocity"),
    ],
)
def test_a_bad_cell_is_named_by_line_and_column(tmp_path, column, cell, message):
    path = highd(tmp_path)
    _changed(path, 5, column, cell)
    with pytest.raises(ImportFormatError, match=message):
        read_highd(path)


@pytest.mark.parametrize("cell", ["nan", "", "NaN"])
def test_a_frame_without_a_position_is_interpolated(tmp_path, cell):
    path = highd(tmp_path)
    before = read_highd(path).tracks
    _changed(path, 5, 2, cell)
    recording = read_highd(path)
    assert recording.tracks.names.tolist() == before.names.tolist()
    assert np.allclose(recording.tracks.s, before.s, atol=1e-3)
    (finding,) = [each for each in recording.findings if each.check is Check.GAPS]
    assert (finding.consequence, finding.rows, finding.vehicle) == (Consequence.CORRECTED, 1, "7")
    assert finding.first_time_s == pytest.approx(3 * 0.04)


def test_a_missing_frame_is_interpolated(tmp_path):
    path = highd(tmp_path)
    before = read_highd(path).tracks
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines[:4], *lines[5:]]) + "\n", encoding="utf-8")
    recording = read_highd(path)
    assert np.allclose(recording.tracks.s, before.s, atol=1e-3)
    (finding,) = recording.findings
    assert (finding.check, finding.vehicle, finding.rows) == (Check.GAPS, "7", 1)
    assert finding.first_time_s == pytest.approx(3 * 0.04)


def test_a_long_time_without_frames_parts_a_vehicle_into_two_tracks(tmp_path):
    path = highd(tmp_path)
    before = read_highd(path).tracks
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines[:11], *lines[31:]]) + "\n", encoding="utf-8")
    recording = read_highd(path)
    assert set(recording.tracks.names) == {*before.names, "7 (2)"}
    assert recording.tracks.num_rows == before.num_rows - 20
    (finding,) = recording.findings
    assert (finding.consequence, finding.vehicle) == (Consequence.REPORTED, "7")


@pytest.mark.parametrize(
    ("name", "column", "cell", "message"),
    [
        ("tracksMeta", 6, "Bus", r"line 2, column class: expected Car or Truck, got Bus"),
        ("tracksMeta", 7, "3", r"line 2, column drivingDirection: expected 1 or 2"),
        ("tracksMeta", 1, "-4", r"line 2, column width: expected a length"),
        ("tracksMeta", 0, "3", r"column id: expected an id of tracksMeta, got 7"),
        ("recordingMeta", 1, "0", r"line 2, column frameRate"),
        ("recordingMeta", 1, "24", r"line 2, column frameRate: expected .* whole milliseconds"),
        ("recordingMeta", 3, "-3", r"line 2, column speedLimit"),
        ("recordingMeta", 14, "1;x", r"line 2, column lowerLaneMarkings"),
        ("recordingMeta", 14, "5;4", r"line 2, column lowerLaneMarkings"),
        ("recordingMeta", 14, "20;20.5;30", r"width of lane -2"),
        ("recordingMeta", 14, "20", r"markings of direction 2"),
    ],
)
def test_bad_metadata_is_named_by_line_and_column(tmp_path, name, column, cell, message):
    path = highd(tmp_path)
    _changed(tmp_path / f"01_{name}.csv", 2, column, cell)
    with pytest.raises(ImportFormatError, match=message):
        read_highd(path)


def test_ragged_rows_missing_columns_and_missing_files_are_refused(tmp_path):
    path = highd(tmp_path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text + "1,2,3\n", encoding="utf-8")
    with pytest.raises(ImportFormatError, match="Expected 25 columns, got 3"):
        read_highd(path)
    path.write_text(text.replace("xVelocity", "speedX"), encoding="utf-8")
    with pytest.raises(ImportFormatError, match="expected a column xVelocity, got none"):
        read_highd(path)
    path.write_text(text.splitlines()[0] + "\n", encoding="utf-8")
    with pytest.raises(ImportFormatError, match="expected at least one row"):
        read_highd(path)
    path.write_bytes(b"\xff\xfe\x00frame")
    with pytest.raises(ImportFormatError, match="UTF-8"):
        read_highd(path)
    path.write_text(text, encoding="utf-8")
    (tmp_path / "01_tracksMeta.csv").unlink()
    with pytest.raises(ImportFormatError, match="No such file"):
        read_highd(path)
    with pytest.raises(ConfigError, match=r"_tracks\.csv"):
        read_highd(tmp_path / "01_recordingMeta.csv")
