"""Tables hold what was recorded, row for row, and nothing where nothing was."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest

from overtaking.data.tables.columns import codes, names_of
from overtaking.data.tables.encode import encode, lane_change_begins
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.lanes import lane_columns
from overtaking.data.tables.schemas import KEYS, SCHEMAS
from overtaking.model.known_roads import known_road
from overtaking.model.trajectories import Lights, Stage

NUMBERS = np.array([3, 4, 10, 11, 90])


@pytest.fixture(scope="module")
def recorded(recorder):
    return recorder(seed=1)


@pytest.fixture(scope="module")
def tables(recorded):
    return contents(recorded, NUMBERS, tuple(SCHEMAS))


def row(table: pa.Table, **keys: int) -> dict[str, object]:
    """The only row with these keys."""
    for name, value in keys.items():
        table = table.filter(pc.equal(table[name], value))
    (found,) = table.to_pylist()
    return found


def test_every_table_is_valid_and_has_exactly_its_schema(tables):
    for name, schema in SCHEMAS.items():
        assert tables[name].schema.equals(schema, check_metadata=True), name
        tables[name].validate(full=True)


def test_no_column_that_may_not_be_null_is(tables):
    for name, schema in SCHEMAS.items():
        nulls = {field.name for field in schema if tables[name][field.name].null_count}
        assert nulls <= {field.name for field in schema if field.nullable}, name


def test_rows_are_sorted_by_key_and_no_key_comes_twice(tables):
    for name, table in tables.items():
        keys = list(zip(*(places(table, key) for key in KEYS[name]), strict=True))
        assert keys == sorted(set(keys)), name


def places(table: pa.Table, key: str) -> list[int]:
    """The values of a key; of a name, its place among all names."""
    names = names_of(table.schema.field(key))
    return codes(table[key], names).tolist() if names else table[key].to_pylist()


def test_there_is_a_row_for_everything_recorded_and_for_no_padding(recorded, tables):
    vehicles = recorded.scenario.vehicles.valid.sum(axis=1)
    assert tables["simulations"].num_rows == tables["weather"].num_rows == 5
    assert tables["vehicles"].num_rows == vehicles.sum()
    assert tables["frames"].num_rows == recorded.num_frames.sum()
    assert tables["states"].num_rows == (vehicles * recorded.num_frames).sum()
    assert tables["percepts"].num_rows == recorded.percepts.valid.sum()


def test_a_state_is_the_recorded_one(recorded, tables):
    simulation, vehicle, frame = 2, 0, int(recorded.num_frames[2]) - 1
    found = row(tables["states"], simulation=10, vehicle=vehicle, frame=frame)
    at = (simulation, vehicle, frame)
    assert found["x_mm"] == recorded.states.x[at]
    assert found["yaw_rate_100uradps"] == recorded.states.yaw_rate[at]
    lights = Lights(int(recorded.states.lights[at]))
    assert found["lights"] == lights >> 2
    blinking = {Lights(0): "off", Lights.INDICATOR_LEFT: "left", Lights.INDICATOR_RIGHT: "right"}
    both = Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT
    assert found["indicator"] == blinking.get(lights & both, "both")


def test_a_lane_is_named_by_its_opendrive_id_and_by_null_beside_the_lanes(recorded, tables):
    ids = dict(enumerate(lane.lane_id for lane in recorded.road.lanes))
    lanes = recorded.states.lane[
        recorded.scenario.vehicles.valid[:, :, None] & recorded.frame_mask[:, None, :]
    ]
    expected = [ids.get(lane) for lane in lanes.tolist()]
    assert tables["states"]["lane_id"].to_pylist() == expected
    assert None in expected


def test_a_full_batch_is_not_copied(recorder):
    recorded = recorder(full=True)
    column = encode(recorded, NUMBERS)["states"]["x_mm"].chunk(0)
    assert column.buffers()[1].address == recorded.states.x.ctypes.data


def test_a_contact_is_null_where_there_was_none(recorded, tables):
    partner = recorded.contacts.partner[recorded.scenario.vehicles.valid]
    table = tables["vehicles"]
    expected = [None if slot == 255 else slot for slot in partner.tolist()]
    assert table["contact_vehicle"].to_pylist() == expected
    for name in ("contact_time_ms", "contact_impulse_newton_s", "contact_closing_speed_mmps"):
        assert table[name].is_null().equals(table["contact_vehicle"].is_null())


def test_what_the_ego_did_not_see_has_no_believed_gap(tables):
    table = tables["percepts"]
    for who in ("leader", "new_leader", "new_follower"):
        unseen = pc.invert(table[f"{who}_is_detected"])
        nobody = table[f"{who}_vehicle"].is_null()
        assert table[f"{who}_gap_mm"].is_null().equals(unseen)
        assert table[f"{who}_true_gap_mm"].is_null().equals(nobody)


def test_trace_hashes_are_their_words_in_little_endian_order(recorded, tables):
    first = recorded.trace_hash[0].tolist()
    words = b"".join(word.to_bytes(4, "little") for word in first)
    assert tables["simulations"]["trace_hash"][0].as_py() == words


def test_the_lanes_of_town06_are_those_of_the_papers_frame_70():
    """Frame 70 of Pinto et al.: lane -7, right Solid, left Broken, widths 3.5, 0.5 and 3.5 m."""
    road = known_road("town06")
    lane = [lane.lane_id for lane in road.lanes].index(-7)
    found = {name: one.values[lane] for name, one in lane_columns(road).items()}
    assert road.lanes[0].lane_id == found["lane_id"] == -7
    marks = [mark.value for mark in type(road.lanes[0].left_mark)]
    assert (marks[found["right_line"]], marks[found["left_line"]]) == ("Solid", "Broken")
    widths = (found[f"{name}_width_m"] for name in ("lane", "right_lane", "left_lane"))
    assert tuple(widths) == (3.5, 0.5, 3.5)
    assert (found["right_lane_id"], found["left_lane_id"]) == (-8, -6)


def test_right_and_left_change_places_in_a_mirrored_world():
    road = known_road("town06")
    here, there = lane_columns(road), lane_columns(road.mirror())
    assert np.array_equal(there["lane_id"].values, -here["lane_id"].values)
    for name in ("line", "lane_width_m"):
        for mine, other in zip(here[f"left_{name}"], there[f"right_{name}"], strict=True):
            assert np.array_equal(mine, other), name


def stages(recorder, *names: str) -> list[bool]:
    """The paper's OV for one simulation that goes through these stages; `-` is padding."""
    recorded = recorder(num_simulations=1, num_frames=len(names))
    length = len(names) - names.count("-")
    code = [Stage[name] if name != "-" else Stage.RETURN for name in names]
    recorded = recorded.replace(
        num_frames=np.array([length], dtype=np.int32), stage=np.array([code], dtype=np.uint8)
    )
    return lane_change_begins(recorded)[0].tolist()


def test_ov_marks_the_first_pull_out_and_the_first_return_after_it(recorder):
    names = ("FOLLOW", "PULL_OUT", "PULL_OUT", "PASS", "RETURN", "RETURN", "DONE")
    assert stages(recorder, *names) == [False, True, False, False, True, False, False]


def test_ov_marks_a_second_overtake_no_more(recorder):
    names = ("PULL_OUT", "RETURN", "FOLLOW", "PULL_OUT", "RETURN")
    assert stages(recorder, *names) == [True, True, False, False, False]


def test_ov_does_not_mark_a_return_without_a_pull_out(recorder):
    assert stages(recorder, "RETURN", "FOLLOW", "PULL_OUT") == [False, False, True]


def test_ov_does_not_look_at_padding(recorder):
    assert stages(recorder, "FOLLOW", "PULL_OUT", "-", "-") == [False, True, False, False]
