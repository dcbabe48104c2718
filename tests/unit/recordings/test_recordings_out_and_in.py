"""Simulations written as recordings and read again are the simulations that they were."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest
from tests.support.recordings import RECORDING_META, TRACKS, TRACKS_META, whole

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan
from overtaking.recordings import pinto2023
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.commonroad_write import FIRST_OBSTACLE, scenario_id, write_commonroad
from overtaking.recordings.export import write_folder
from overtaking.recordings.findings import Check, Consequence
from overtaking.recordings.formats import read_recording
from overtaking.recordings.highd import read_highd
from overtaking.recordings.highd_write import write_highd
from overtaking.recordings.pinto2023_import import read_pinto2023, speed_ratios
from overtaking.recordings.pinto2023_schema import VEHICLE_COLUMNS

COUNT = 4


@pytest.fixture(scope="module")
def runs():
    """At highD's rate, so that nothing is interpolated."""
    scenario = ot.sample(
        "pinto2023-physical",
        num_simulations=COUNT,
        seed=5,
        overrides={"profile.frame_interval_ms": 40},
    )
    return ot.simulate(scenario)


def same(run, again, name, *, shift=False, tolerance=1):
    """Whether a field came back, up to a constant where the origin of the road is another."""
    count, slots = int(run.num_frames[0]), int(run.scenario.num_vehicles[0])
    before = getattr(run.states, name)[0, :slots, :count].astype(np.int64)
    after = getattr(again.states, name)[0, :slots, :count].astype(np.int64)
    off = after - before
    if shift:
        off = off - np.rint(np.median(off)).astype(np.int64)
    assert np.abs(off).max() <= tolerance, f"{name}: {np.abs(off).max()}"


def same_lane(run, again, *, within_mm):
    """Whether lanes came back, but where a centre lies on a line as nearly as the format tells."""
    count, slots = int(run.num_frames[0]), int(run.scenario.num_vehicles[0])
    before, after = (each.states.lane[0, :slots, :count] for each in (run, again))
    across = run.states.d[0, :slots, :count, None] * 1e-3
    off_line = np.abs(across - np.asarray(run.road.lane_boundaries)).min(axis=-1)
    assert off_line[before != after].max(initial=0.0) <= within_mm * 1e-3
    assert (before != after).mean() < 0.01


@pytest.mark.parametrize("place", range(COUNT))
def test_a_commonroad_scenario_comes_back_to_the_last_digit(runs, tmp_path, place):
    one = runs.select(slice(place, place + 1))
    rows = write_commonroad(one, np.array([place]), tmp_path)
    assert rows == one.state_mask.sum()
    recording = read_commonroad(tmp_path / f"{scenario_id(place)}.xml")
    again = whole(recording, FIRST_OBSTACLE)
    assert again.num_frames[0] == one.num_frames[0]
    for name in ("speed", "accel_lon", "yaw_rate", "heading"):
        same(one, again, name, tolerance=0)
    for name in ("s", "d"):  # The reader counts from the middle of the road.
        same(one, again, name, shift=True, tolerance=0)
    for name in ("x", "y"):  # Worked out from s and d, so rounded once more.
        same(one, again, name)
    same_lane(one, again, within_mm=0.5)  # It is told before d is rounded to millimetres.
    assert again.road.num_lanes == one.road.num_lanes
    assert again.road.speed_limit == pytest.approx(one.road.speed_limit)
    assert [lane.left_mark for lane in again.road.lanes] == [
        lane.left_mark for lane in one.road.lanes
    ]
    valid = one.scenario.vehicles.valid[0]
    assert np.allclose(
        again.scenario.vehicles.length[0, : valid.sum()],
        one.scenario.vehicles.length[0][valid],
        atol=1e-4,
    )


@pytest.mark.parametrize("place", range(COUNT))
def test_a_highd_recording_comes_back_within_its_decimals(runs, tmp_path, place):
    one = runs.select(slice(place, place + 1))
    rows = write_highd(one, np.array([place]), tmp_path)
    assert rows == one.state_mask.sum()
    again = whole(read_highd(tmp_path / f"{place + 1:02d}_tracks.csv"), 1)
    assert again.num_frames[0] == one.num_frames[0]
    for name in ("s", "d", "heading"):
        same(one, again, name, shift=True, tolerance=1)
    for name in ("speed", "accel_lon", "accel_lat"):
        same(one, again, name)
    same_lane(one, again, within_mm=10.0)


def test_twenty_frames_a_second_become_twenty_five_between_the_recorded_ones(tmp_path):
    run = ot.simulate(ot.sample("pinto2023-physical", num_simulations=1, seed=5))
    assert run.scenario.frame_interval_ms == 50
    write_highd(run, np.array([0]), tmp_path)
    tracks = read_highd(tmp_path / "01_tracks.csv").tracks
    count, time = int(run.num_frames[0]), np.arange(tracks.start[1]) * 0.04
    known = np.arange(count) * 0.05
    expected = np.interp(time, known, run.states.s[0, 0, :count] * 1e-3)
    off = tracks.s[: tracks.start[1]] - expected
    assert np.ptp(off) < 1e-3
    assert time[-1] <= known[-1]
    assert known[-1] - time[-1] < 0.04


def test_highd_files_have_exactly_its_columns_and_agree_with_each_other(runs, tmp_path):
    one = runs.select(slice(0, 1))
    write_highd(one, np.array([0]), tmp_path)
    table, meta, whole_one = (
        pacsv.read_csv(tmp_path / f"01_{name}.csv")
        for name in ("tracks", "tracksMeta", "recordingMeta")
    )
    assert tuple(table.column_names) == TRACKS
    assert tuple(meta.column_names) == TRACKS_META
    assert tuple(whole_one.column_names) == RECORDING_META
    rows = table.to_pandas()
    assert whole_one["numVehicles"][0].as_py() == rows["id"].nunique() == meta.num_rows
    by_key = rows.set_index(["frame", "id"])
    follows = rows[rows["precedingId"] > 0]
    assert len(follows)
    leader = by_key.loc[list(zip(follows["frame"], follows["precedingId"], strict=True))]
    gap = leader["x"].to_numpy() - follows["x"].to_numpy() - follows["width"].to_numpy()
    assert np.allclose(gap, follows["dhw"], atol=2e-4)
    assert np.array_equal(leader["laneId"], follows["laneId"])
    assert np.array_equal(leader["followingId"], follows["id"])
    assert np.allclose(leader["xVelocity"], follows["precedingXVelocity"], atol=2e-4)
    thw = follows["dhw"] / follows["xVelocity"]
    assert np.allclose(thw, follows["thw"], atol=1e-3)
    lines = [float(one) for one in whole_one["lowerLaneMarkings"][0].as_py().split(";")]
    middle = rows["y"] + rows["height"] / 2
    lane = np.searchsorted(lines, middle) - 1  # From the fast lane on.
    assert np.array_equal(lane + 3, rows["laneId"])


def test_a_commonroad_file_has_the_parts_that_its_schema_wants(runs, tmp_path):
    one = runs.select(slice(1, 2))
    write_commonroad(one, np.array([1]), tmp_path)
    (path,) = tmp_path.iterdir()
    root = ET.parse(path).getroot()
    assert path.stem == root.attrib["benchmarkID"] == "ZAM_Overtaking-1_2_T-1"
    assert {"author", "affiliation", "source", "date", "timeStepSize"} <= set(root.attrib)
    assert [child.tag for child in root][:2] == ["location", "scenarioTags"]
    ids = [child.attrib["id"] for child in root if "id" in child.attrib]
    assert len(set(ids)) == len(ids)
    lanelets = root.findall("lanelet")
    assert len(lanelets) == one.road.num_lanes
    order = [child.tag for child in lanelets[1]]
    assert order == [
        *("leftBound", "rightBound", "adjacentLeft", "adjacentRight"),
        *("laneletType", "userOneWay", "trafficSignRef"),
    ]
    for obstacle in root.findall("dynamicObstacle"):
        times = [int(t.text or "") for t in obstacle.findall(".//time/exact")]
        assert times == list(range(len(times)))


def test_a_folder_appears_whole_or_not_at_all(runs, tmp_path):
    out = tmp_path / "out"

    def batches():
        yield np.arange(2), runs.select(slice(0, 2))
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        write_folder(batches(), out, file_format="commonroad", total=4, road=runs.road)
    assert list(tmp_path.iterdir()) == []
    pairs = [(np.arange(COUNT), runs)]
    write_folder(pairs, out, file_format="highd", total=COUNT, road=runs.road)
    assert len(list(out.iterdir())) == 3 * COUNT
    with pytest.raises(ConfigError, match="expected a name that is free"):
        write_folder(pairs, out, file_format="highd", total=COUNT, road=runs.road)
    with pytest.raises(ConfigError, match="left-hand"):
        write_folder(pairs, tmp_path / "b", file_format="highd", total=4, road=runs.road.mirror())


# --- the paper's table ---


@pytest.fixture(scope="module")
def table_runs():
    return ot.simulate(ot.sample("pinto2023-physical", num_simulations=12, seed=9))


@pytest.fixture(scope="module")
def table(table_runs):
    return pinto2023.to_table(table_runs)


def write(table: pa.Table, path):
    pinto2023.write_table([table], path)
    return path


def test_the_papers_table_comes_back_within_its_two_decimals(table_runs, table, tmp_path):
    scenes = read_pinto2023(write(table, tmp_path / "t.parquet"))
    again = scenes.trajectories(range(len(scenes)))
    assert np.array_equal(again.num_frames, table_runs.num_frames)
    slots = again.states.x.shape[1]
    there = again.state_mask
    assert np.array_equal(there, table_runs.state_mask[:, :slots])
    for name, tolerance in (("x", 5), ("y", 5), ("s", 8), ("d", 8), ("heading", 1), ("speed", 140)):
        off = getattr(again.states, name) - getattr(table_runs.states, name)[:, :slots]
        assert np.abs(off[there]).max() <= tolerance, name
    assert np.array_equal(again.collided_with, table_runs.collided_with)
    assert np.array_equal(
        again.contacts.partner[:, 0] != 255, (table_runs.collided_with != 255).any(axis=1)
    )
    for name in ("rain", "fog", "wind", "night", "low_sun", "sun_altitude", "puddles"):
        ours, theirs = (getattr(run.scenario.weather, name) for run in (again, table_runs))
        assert np.array_equal(ours, theirs), name
    assert "weather" not in again.unknown
    assert {"drivers", "bodies", "percepts", "kinds"} <= again.unknown


def test_a_true_clock_is_not_suspected(table, tmp_path):
    scenes = read_pinto2023(write(table, tmp_path / "t.parquet"))
    assert scenes.notes["speed_ratio_median"] == pytest.approx(1.0, abs=0.01)
    assert scenes.notes["time_scaling"] is None
    ratios = speed_ratios(scenes.recording)
    assert np.nanmax(np.abs(ratios - 1.0)) < 0.05


@pytest.mark.parametrize(("factor", "name"), [(3.0, "a third"), (1.0 / 3.0, "three times")])
def test_a_scaled_clock_is_named(table, tmp_path, factor, name):
    times = np.round(table["TS"].to_numpy() * factor, 2)
    scaled = table.set_column(2, table.schema.field(2), pa.array(times))
    scenes = read_pinto2023(write(scaled, tmp_path / "t.parquet"))
    assert scenes.notes["time_scaling"] == name


def test_a_table_from_another_road_is_refused_unless_the_road_is_named(table, tmp_path):
    from overtaking.core.errors import ImportFormatError
    from overtaking.model.known_roads import known_road

    values = table.to_pylist()
    for row in values:
        for one in row["L"]:
            one["y_m"] += 40.0
    moved = pa.Table.from_pylist(values, schema=table.schema)
    path = write(moved, tmp_path / "t.parquet")
    with pytest.raises(ImportFormatError, match="column L: expected lanes of"):
        read_pinto2023(path)
    road = known_road("town06")
    named = dataclasses.replace(road, y0=road.y0 - 40.0)
    assert len(read_pinto2023(path, road=named)) == 12


def test_limits_that_change_come_back_with_their_road_and_are_not_known_without(
    table_runs, tmp_path
):
    lower = SpeedLimitSpan(start=0.0, stop=250.0, speed=50 / 3.6)
    road = dataclasses.replace(table_runs.road, course=RoadCourse(speed_limit_spans=(lower,)))
    scenario = table_runs.scenario.replace(road=road)
    told = pinto2023.to_table(table_runs.replace(scenario=scenario))
    assert set(told["MV"].to_pylist()) == {50.0, 90.0}
    path = write(told, tmp_path / "t.parquet")
    back = read_pinto2023(path, road=road).recording
    assert "speed_limit" not in back.unknown
    assert back.road.course == road.course
    assert "speed_limit" in read_pinto2023(path).recording.unknown
    slower = told.set_column(told.schema.get_field_index("MV"), "MV", [[40.0] * told.num_rows])
    one = read_pinto2023(write(slower, tmp_path / "s.parquet"), road=road).recording
    assert one.road.speed_limit == pytest.approx(40 / 3.6)
    assert one.road.course == RoadCourse()


def test_a_stated_speed_limit_replaces_that_of_the_table(table, tmp_path):
    path = write(table, tmp_path / "t.parquet")
    options = {"speed_limit": 20.0}
    recording = read_recording("pinto2023", path, options).scenes.recording
    assert recording.road.speed_limit == 20.0
    assert "speed_limit" not in recording.unknown


def test_frames_that_are_missing_or_uneven_are_refused(table, tmp_path):
    from overtaking.core.errors import ImportFormatError

    gap = pa.concat_tables([table.slice(0, 5), table.slice(6)])
    with pytest.raises(ImportFormatError, match=r"row 6, column F"):
        read_pinto2023(write(gap, tmp_path / "gap.parquet"))
    times = table["TS"].to_numpy().copy()
    times[3] += 0.04
    uneven = table.set_column(2, table.schema.field(2), pa.array(times))
    with pytest.raises(ImportFormatError, match="column TS: expected even steps"):
        read_pinto2023(write(uneven, tmp_path / "uneven.parquet"))


def with_tuples(table: pa.Table, change) -> pa.Table:
    """The paper's table with other tuples of vehicles.

    Args:
        table: The table.
        change: Takes simulation, frame, column and the tuples of that cell, and gives others.
    """
    simulations, frames = table["S"].to_pylist(), table["F"].to_pylist()
    for name in VEHICLE_COLUMNS:
        cells = [
            change(simulation, frame, name, cell)
            for simulation, frame, cell in zip(
                simulations, frames, table[name].to_pylist(), strict=True
            )
        ]
        place = table.schema.get_field_index(name)
        table = table.set_column(
            place, table.schema.field(name), [pa.array(cells, table.schema.field(name).type)]
        )
    return table


@pytest.mark.parametrize(
    ("vehicle", "consequence"), [(1, Consequence.REPORTED), (2, Consequence.LEFT_OUT)]
)
def test_a_position_of_the_papers_table_that_no_vehicle_reaches(
    table, tmp_path, vehicle, consequence
):
    def move(simulation, frame, name, cell):
        is_changed = (simulation, frame, name) == (3, 30, "L")
        return [
            {**part, "x_m": part["x_m"] + 15.0 * (is_changed and part["id"] == vehicle)}
            if name == "L"
            else part
            for part in cell
        ]

    whole = read_pinto2023(write(table, tmp_path / "whole.parquet")).recording
    recording = read_pinto2023(
        write(with_tuples(table, move), tmp_path / "moved.parquet")
    ).recording
    (finding,) = recording.findings
    assert (finding.check, finding.consequence) == (Check.MOTION, consequence)
    assert finding.vehicle == str(vehicle)
    assert finding.first_time_s == pytest.approx(30 * recording.frame_interval_ms * 1e-3)
    largest = np.abs(recording.tracks.x - whole.tracks.x).max()
    assert largest == pytest.approx(15.0, abs=0.01) if vehicle == 1 else largest < 0.2


def test_a_vehicle_that_the_papers_table_lacks_in_a_few_frames_is_interpolated(table, tmp_path):
    def leave_out(simulation, frame, _, cell):
        is_changed = simulation == 3 and 30 <= frame < 33
        return [part for part in cell if not (is_changed and part["id"] == 2)]

    whole = read_pinto2023(write(table, tmp_path / "whole.parquet")).recording
    recording = read_pinto2023(
        write(with_tuples(table, leave_out), tmp_path / "shorter.parquet")
    ).recording
    (finding,) = recording.findings
    assert (finding.check, finding.vehicle, finding.rows) == (Check.GAPS, "2", 3)
    assert np.abs(recording.tracks.x - whole.tracks.x).max() < 0.2
