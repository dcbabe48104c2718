"""The paper's table against the one row of it that the paper prints, and against itself."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import re
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from overtaking.model.road import DrivingSide, Lane, Road, RoadMark
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import (
    NO_VEHICLE,
    Contacts,
    Percepts,
    Stage,
    States,
    Trajectories,
)
from overtaking.model.vehicles import DriverTraits, VehicleSpecs
from overtaking.model.weather import Weather
from overtaking.recordings.pinto2023 import COLUMNS, to_table, write_table
from overtaking.recordings.pinto2023_schema import VEHICLE_COLUMNS
from overtaking.recordings.pinto2023_text import from_text, to_text

FRAME = 70
PAPER_COLUMNS = "S F TS IDego Dim L V D A MV RT LT LW LWR LWL C Prec Fog Wind DN HL OV"
PAPER_ID_OF_THE_EGO = 488


def town06() -> Road:
    """The paper's road around x = 351 m as its frame 70 describes it; y grows to the left here."""
    marks = [RoadMark.SOLID, *[RoadMark.BROKEN] * 4, RoadMark.SOLID]
    return Road(
        name="town06",
        kind="town",
        driving_side=DrivingSide.RIGHT,
        lanes=tuple(
            Lane(lane_id=-7 + n, width=3.5, right_mark=marks[n], left_mark=marks[n + 1])
            for n in range(5)
        ),
        kerb_edge_d=-1.75,
        length=470.0,
        x0=128.0,
        y0=-251.58,
        heading=0.0,
        speed_limit=25.0,
        kerb_side_neighbour=Lane(
            lane_id=-8,
            width=0.5,
            kind="shoulder",
            right_mark=RoadMark.NONE,
            left_mark=RoadMark.SOLID,
        ),
    )


def filled(cls, shape, **known):
    """A batch of `cls`: the fields given, and zeros of the right shape in all the others."""
    fields = {field.name: field.type for field in dataclasses.fields(cls)}
    return cls(
        **{name: np.zeros(shape, dtype=np.float32) for name in fields if name not in known}, **known
    )


def scenario(num_simulations: int, valid: np.ndarray, **known) -> Scenario:
    shape = valid.shape
    bodies = known.pop("bodies", {})
    weather = known.pop("weather", {})
    given_fields = {
        "profile": "by hand",
        "road": town06(),
        "seed": 0,
        "frame_interval_ms": 50,
        "scenario_index": np.arange(1, num_simulations + 1, dtype=np.uint64),
        "vehicles": filled(VehicleSpecs, shape, valid=valid, **bodies),
        "drivers": filled(DriverTraits, shape),
        "weather": filled(Weather, num_simulations, **weather),
        **known,
    }
    return filled(Scenario, num_simulations, **given_fields)


def trajectories(scene: Scenario, length: int, **known) -> Trajectories:
    num_simulations, num_slots = scene.vehicles.valid.shape
    given_states = known.pop("states", {})
    shape = (num_simulations, num_slots, length)
    states = {
        field.name: np.zeros(shape, dtype=np.int32)
        for field in dataclasses.fields(States)
        if field.name not in given_states
    }
    per_frame = (num_simulations, length)
    recorded: dict[str, Any] = {
        "num_frames": np.full(num_simulations, length, dtype=np.int32),
        "stage": np.zeros(per_frame, dtype=np.uint8),
        "collided_with": np.full(per_frame, NO_VEHICLE, dtype=np.uint8),
        **known,
    }
    return Trajectories(
        scenario=scene,
        states=States(**states, **given_states),
        contacts=filled(Contacts, (num_simulations, num_slots)),
        percepts=filled(Percepts, (num_simulations, 1)),
        trace_hash=np.zeros((num_simulations, 4), dtype=np.uint32),
        **recorded,
    )


def frame_70() -> Trajectories:
    """The instant that the paper prints, in the units and frames of a recording."""

    def over_time(values, scale=1.0):
        column = np.rint(np.array(values) * scale).astype(np.int32)
        return np.repeat(column[None, :, None], FRAME + 1, axis=2)

    scene = scenario(
        1,
        np.ones((1, 3), dtype=bool),
        bodies={
            "length": np.array([[6.273, 5.37, 4.8559]], dtype=np.float32),
            "width": np.array([[2.395, 1.8, 2.033]], dtype=np.float32),
            "height": np.array([[2.098, 1.57, 1.651]], dtype=np.float32),
        },
        weather={
            "rain": np.array([60.0], dtype=np.float32),
            "fog": np.array([60.0], dtype=np.float32),
            "wind": np.array([60.0], dtype=np.float32),
            "night": np.array([True]),
            "low_sun": np.array([False]),
        },
    )
    recorded = {
        "x": over_time([351.351, 355.818, 318.8], 1e3),
        "y": over_time([-251.58, -251.68, -251.614], 1e3),
        "speed": over_time([66.2 / 3.6, 79.0 / 3.6, 112.6 / 3.6], 1e3),
        "wheel_angle": over_time(np.radians([0.2, -0.35, -0.1]), 1e4),
        "heading": over_time(np.radians([3.62, 0.43, -0.23]), 1e4),
        "accel_lon": over_time([-76.0, 40.06, 0.44], 1e3),
        "accel_lat": over_time([6.527, 0.0, 0.33], 1e3),
        "lane": over_time([0, 0, 0]).astype(np.uint8),
    }
    partner = np.full((1, FRAME + 1), NO_VEHICLE)
    partner[0, FRAME] = 1
    return trajectories(scene, FRAME + 1, states=recorded, collided_with=partner)


@pytest.fixture
def printed(repository) -> dict[str, str]:
    path = repository / "tests" / "golden" / "pinto2023" / "frame70.json"
    return json.loads(path.read_text(encoding="utf-8"))


def with_our_ids(printed: dict[str, str]) -> dict[str, str]:
    """The printed row with ids counted from 1, and without its three slips of typing.

    Those are a missing second semicolon, "1.80" where every other zero at the end is left out, and
    one space after a comma.
    """
    row = {}
    for name, cell in printed.items():
        tuples = re.findall(r"\(([^)]*)\)", cell)
        if not tuples:
            row[name] = cell
            continue
        parts = [[part.strip() for part in inside.split(",")] for inside in tuples]
        for one in parts:
            one[0] = str(int(one[0]) - PAPER_ID_OF_THE_EGO + 1)
        cells = ["(" + ",".join(one) + ")" for one in parts]
        row[name] = "; ".join(cells).replace("1.80", "1.8")
    for name in ("IDego", "C"):
        row[name] = str(int(printed[name]) - PAPER_ID_OF_THE_EGO + 1)
    return row


def test_columns_are_the_papers_in_its_order(printed):
    assert list(COLUMNS) == PAPER_COLUMNS.split() == list(printed)


def test_frame_70_is_written_as_the_paper_prints_it(printed):
    last = to_text(to_table(frame_70())).slice(FRAME).to_pylist()
    assert last == [with_our_ids(printed)]


def test_frame_70_is_read_as_the_paper_prints_it(printed):
    read = from_text(pa.table({name: [cell] for name, cell in printed.items()})).to_pylist()[0]
    assert read["L"][2] == {"id": 490, "x_m": 318.8, "y_m": 251.61, "lane_id": -7}
    assert read["Dim"][1] == {"id": 489, "length_m": 5.37, "width_m": 1.8, "height_m": 1.57}
    assert read["V"] == [
        {"id": 488, "speed_kmh": 66},
        {"id": 489, "speed_kmh": 79},
        {"id": 490, "speed_kmh": 113},
    ]
    assert read["A"][2] == {"id": 490, "accel_mps2": 0.55}
    assert read["D"][0] == {"id": 488, "wheel_deg": -0.2, "yaw_deg": -3.62}
    assert (read["C"], read["MV"], read["TS"], read["DN"]) == (489, 90.0, 3.5, "Night")


def test_frame_70_in_values_equals_the_paper_up_to_the_ids(printed):
    ours = to_table(frame_70()).slice(FRAME)
    theirs = from_text(pa.table({name: [cell] for name, cell in with_our_ids(printed).items()}))
    assert ours.equals(theirs)


def test_a_left_turn_of_wheel_and_body_is_negative_and_left_is_a_smaller_y():
    straight = frame_70()
    left = straight.replace(
        states=straight.states.replace(
            wheel_angle=np.full_like(straight.states.wheel_angle, 500),
            heading=np.full_like(straight.states.heading, 300),
            y=straight.states.y + 1000,
        )
    )
    before, after = (to_table(t).slice(FRAME).to_pylist()[0] for t in (straight, left))
    assert after["D"][0]["wheel_deg"] == round(-math.degrees(0.05), 2)
    assert after["D"][0]["yaw_deg"] == round(-math.degrees(0.03), 2)
    assert after["L"][0]["y_m"] == pytest.approx(before["L"][0]["y_m"] - 1.0)


def test_mv_is_the_limit_where_the_ego_is():
    run = frame_70()
    states = run.states.replace(s=np.broadcast_to(np.arange(FRAME + 1) * 1000, run.states.s.shape))
    lower = SpeedLimitSpan(start=10.0, stop=30.0, speed=50 / 3.6)
    road = dataclasses.replace(run.road, course=RoadCourse(speed_limit_spans=(lower,)))
    scene = run.scenario.replace(road=road)
    found = to_table(run.replace(states=states, scenario=scene))["MV"].to_pylist()
    assert found == [90.0] * 10 + [50.0] * 20 + [90.0] * (FRAME + 1 - 30)


def with_lane(lane: int, road: Road | None = None) -> dict[str, Any]:
    run = frame_70()
    if road is not None:
        run = run.replace(scenario=run.scenario.replace(road=road))
    states = run.states.replace(lane=np.full_like(run.states.lane, lane))
    return to_table(run.replace(states=states)).slice(FRAME).to_pylist()[0]


AROUND = ("RT", "LT", "LW", "LWR", "LWL")


@pytest.mark.parametrize(
    ("lane", "lane_id", "around"),
    [
        (0, -7, ("Solid", "Broken", 3.5, 0.5, 3.5)),
        (2, -5, ("Broken", "Broken", 3.5, 3.5, 3.5)),
        (4, -3, ("Broken", "Solid", 3.5, 3.5, None)),
        (5, -3, ("Broken", "Solid", 3.5, 3.5, None)),  # Beyond the edge, and no lane there.
        (255, -8, ("NONE", "Solid", 0.5, None, 3.5)),  # On the shoulder.
    ],
)
def test_the_lane_says_what_lies_around_it(lane, lane_id, around):
    row = with_lane(lane)
    assert row["L"][0]["lane_id"] == lane_id
    assert tuple(row[name] for name in AROUND) == around


def test_in_left_hand_traffic_the_shoulder_is_on_the_left():
    row = with_lane(0, town06().mirror())
    assert tuple(row[name] for name in AROUND) == ("Broken", "Solid", 3.5, 3.5, 0.5)
    assert row["L"][0]["lane_id"] == 7


@pytest.mark.parametrize(
    ("stages", "marked"),
    [
        ("0000000", []),
        ("0112233", [1, 5]),
        ("0115011", [1]),  # Given up, then tried again: one phase begun, as the paper counts.
        ("0122666", [1]),
        ("0112334", [1, 4]),
    ],
)
def test_overtake_marks_the_first_frames_of_pull_out_and_return(stages, marked):
    scene = scenario(1, np.ones((1, 1), dtype=bool))
    stage = np.array([[int(letter) for letter in stages]], dtype=np.uint8)
    assert (Stage.PULL_OUT, Stage.RETURN) == (1, 3)
    table = to_table(trajectories(scene, len(stages), stage=stage))
    assert np.flatnonzero(table["OV"].to_numpy()).tolist() == marked


def test_rows_are_the_recorded_frames_and_tuples_the_vehicles_that_exist():
    valid = np.array([[True, True, False], [True, True, True]])
    run = trajectories(scenario(2, valid), 4, num_frames=np.array([2, 4], dtype=np.int32))
    table = to_table(run)
    assert table["S"].to_pylist() == [1, 1, 2, 2, 2, 2]
    assert table["F"].to_pylist() == [0, 1, 0, 1, 2, 3]
    assert table["TS"].to_pylist() == [0.0, 0.05, 0.0, 0.05, 0.1, 0.15]
    for name in VEHICLE_COLUMNS:
        ids = [[one["id"] for one in cell] for cell in table[name].to_pylist()]
        assert ids == [[1, 2]] * 2 + [[1, 2, 3]] * 4
    assert table["C"].null_count == 6
    renumbered = to_table(run, np.array([7, 9]))
    assert renumbered["S"].to_pylist() == [7, 7, 9, 9, 9, 9]


def test_csv_is_what_another_reader_expects(tmp_path, printed):
    path = tmp_path / "table.csv"
    write_table([to_table(frame_70())], path)
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == FRAME + 1
    assert rows[-1] == with_our_ids(printed)
    assert rows[0]["C"] == "0"


def test_parquet_holds_the_cells_as_the_paper_prints_them(tmp_path, printed):
    path = tmp_path / "table.parquet"
    write_table([to_table(frame_70())], path)
    file = pq.read_table(path)
    assert file.column_names == PAPER_COLUMNS.split()
    assert file.slice(FRAME).to_pylist() == [with_our_ids(printed)]
    assert file.schema.metadata[b"schema"] == b"overtaking.pinto2023"
