"""Files come back as they were written, or say in one line what is wrong with them."""

from __future__ import annotations

import errno
import hashlib
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from overtaking.core.errors import SchemaError
from overtaking.data.tables import files
from overtaking.data.tables.digest import content_of
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.files import (
    FileFacts,
    TableWriter,
    facts_of,
    read_notes,
    read_rows,
    read_table,
)
from overtaking.data.tables.schemas import SCHEMAS, VERSION


@pytest.fixture(scope="module")
def recorded(recorder):
    return recorder(seed=4)


@pytest.fixture(scope="module")
def tables(recorded):
    return contents(recorded, np.arange(5), tuple(SCHEMAS))


def write(path: Path, name: str, *pieces: pa.Table) -> FileFacts:
    with TableWriter(path, name) as writer:
        for piece in pieces:
            writer.write(piece)
        return writer.finish({"note": "kept"})


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_table_comes_back_with_its_schema_and_metadata(name: str, tables, tmp_path: Path):
    facts = write(tmp_path / "a.parquet", name, tables[name])
    read = read_table(tmp_path / "a.parquet", name)
    assert read.schema.equals(SCHEMAS[name], check_metadata=False)
    for field in SCHEMAS[name]:
        assert read.schema.field(field.name).metadata.items() >= field.metadata.items()
    assert content_of(read) == content_of(tables[name]) == facts.content
    assert facts.rows == tables[name].num_rows


def test_the_facts_of_a_file_are_those_of_its_bytes(tables, tmp_path: Path):
    path = tmp_path / "a.parquet"
    facts = write(path, "states", tables["states"])
    data = path.read_bytes()
    assert facts.size_bytes == len(data)
    assert facts.sha256 == hashlib.sha256(data).hexdigest()
    assert facts_of(path, facts.rows, facts.content) == facts


def test_the_same_table_gives_the_same_bytes(tables, tmp_path: Path):
    one = write(tmp_path / "a.parquet", "vehicles", tables["vehicles"])
    assert write(tmp_path / "b.parquet", "vehicles", tables["vehicles"]) == one


def test_every_column_of_the_states_reads_the_same_in_another_program(
    recorded, tables, tmp_path: Path
):
    write(tmp_path / "a.parquet", "states", tables["states"])
    query = f"select * from '{tmp_path}/a.parquet' order by simulation, vehicle, frame"
    columns = duckdb.connect().execute(query).fetchnumpy()
    valid = recorded.scenario.vehicles.valid[:, :, None] & recorded.frame_mask[:, None, :]
    simulation, vehicle, frame = np.nonzero(valid)
    expected = {
        "simulation": simulation,
        "vehicle": vehicle,
        "frame": frame,
        "x_mm": recorded.states.x[valid],
        "d_mm": recorded.states.d[valid],
        "speed_mmps": recorded.states.speed[valid],
        "wheel_angle_100urad": recorded.states.wheel_angle[valid],
        "accel_lat_mmps2": recorded.states.accel_lat[valid],
        "lights": recorded.states.lights[valid] >> 2,
    }
    for name, values in expected.items():
        assert np.array_equal(np.ma.getdata(columns[name]), values), name


def test_rows_of_one_simulation_are_found_in_any_group(tables, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(files, "LEAST_GROUP_BYTES", 1)
    states = tables["states"]
    key = states["simulation"].to_numpy()
    cut = int(np.searchsorted(key, 2))
    write(tmp_path / "a.parquet", "states", states.slice(0, cut), states.slice(cut))
    assert pq.ParquetFile(tmp_path / "a.parquet").num_row_groups == 2
    for number in range(5):
        found = read_rows(tmp_path / "a.parquet", "states", number, number)
        assert content_of(found) == content_of(states.filter(pa.array(key == number)))
    assert read_rows(tmp_path / "a.parquet", "states", 1, 3)["simulation"].unique().to_pylist() == [
        1,
        2,
        3,
    ]
    assert read_rows(tmp_path / "a.parquet", "states", 9, 9).num_rows == 0


def test_small_pieces_share_a_row_group(tables, tmp_path: Path):
    weather = tables["weather"]
    pieces = [weather.slice(k, 1) for k in range(weather.num_rows)]
    facts = write(tmp_path / "a.parquet", "weather", *pieces)
    assert pq.ParquetFile(tmp_path / "a.parquet").num_row_groups == 1
    assert facts == write(tmp_path / "b.parquet", "weather", weather)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_the_content_counts_pieces_that_wait(tables, tmp_path: Path):
    with TableWriter(tmp_path / "a.parquet", "weather") as writer:
        writer.write(tables["weather"])
        assert writer.content == content_of(tables["weather"])


def test_notes_are_kept(tables, tmp_path: Path):
    write(tmp_path / "a.parquet", "weather", tables["weather"])
    assert read_notes(tmp_path / "a.parquet", "weather")["note"] == "kept"


def test_the_name_of_a_note_may_be_damaged(tables, tmp_path: Path):
    path = tmp_path / "a.parquet"
    write(path, "weather", tables["weather"])
    data = path.read_bytes()
    assert data.count(b"note") == 1
    path.write_bytes(data.replace(b"note", b"not\xf3"))  # The begin of a longer character.
    assert "not\ufffd" in read_notes(path, "weather")


def test_a_table_without_rows_is_a_file_all_the_same(tables, tmp_path: Path):
    write(tmp_path / "a.parquet", "percepts", tables["percepts"].slice(0, 0))
    assert read_table(tmp_path / "a.parquet", "percepts").num_rows == 0


def one_line(error: SchemaError, *parts: object) -> None:
    """The message is one line and holds all of the parts."""
    text = str(error)
    assert "\n" not in text
    for part in parts:
        assert str(part) in text


def test_a_file_cut_short_is_refused(tables, tmp_path: Path):
    path = tmp_path / "a.parquet"
    write(path, "states", tables["states"])
    whole = path.read_bytes()
    for length in (0, 3, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(SchemaError) as caught:
            read_table(path, "states")
        one_line(caught.value, path, "expected a readable Parquet file, got", "restore the file")


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(SchemaError) as caught:
        read_table(tmp_path / "a.parquet", "states")
    one_line(caught.value, tmp_path / "a.parquet", "no such file")


def test_a_newer_version_says_to_upgrade(tables, tmp_path: Path):
    newer = {**SCHEMAS["states"].metadata, b"version": str(VERSION + 1).encode()}
    pq.write_table(tables["states"].replace_schema_metadata(newer), tmp_path / "a.parquet")
    with pytest.raises(SchemaError) as caught:
        read_table(tmp_path / "a.parquet", "states")
    one_line(
        caught.value, "overtaking.states", f"at most {VERSION}, got {VERSION + 1}", "newer one"
    )


@pytest.mark.parametrize("version", [b"0", None])
def test_a_table_of_an_earlier_version_is_refused(version, tables, tmp_path: Path):
    metadata = dict(SCHEMAS["states"].metadata)
    del metadata[b"version"]
    metadata |= {} if version is None else {b"version": version}
    pq.write_table(tables["states"].replace_schema_metadata(metadata), tmp_path / "a.parquet")
    with pytest.raises(SchemaError, match=f"expected {VERSION}, got 0"):
        read_table(tmp_path / "a.parquet", "states")


def test_another_table_is_refused(tables, tmp_path: Path):
    write(tmp_path / "a.parquet", "weather", tables["weather"])
    with pytest.raises(SchemaError, match=r"expected overtaking\.states, got overtaking\.weather"):
        read_table(tmp_path / "a.parquet", "states")


def test_a_parquet_file_of_someone_else_is_refused(tmp_path: Path):
    pq.write_table(pa.table({"a": [1]}), tmp_path / "a.parquet")
    with pytest.raises(SchemaError, match=r"expected overtaking\.states, got none"):
        read_table(tmp_path / "a.parquet", "states")


@pytest.mark.parametrize(
    ("spoil", "got"),
    [
        (lambda table: table.drop_columns(["x_mm"]), "no such column"),
        (
            lambda table: table.set_column(
                3, pa.field("x_mm", pa.float64()), table["x_mm"].cast(pa.float64())
            ),
            "type double",
        ),
    ],
)
def test_a_column_that_is_missing_or_of_another_type_is_named(spoil, got, tables, tmp_path: Path):
    pq.write_table(spoil(tables["states"]), tmp_path / "a.parquet")
    with pytest.raises(SchemaError) as caught:
        read_table(tmp_path / "a.parquet", "states")
    one_line(caught.value, "column x_mm: expected type int32", f"got {got}")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a disk that is full")
def test_a_full_disk_is_an_error_and_not_a_short_file(tables):
    with pytest.raises(OSError, match="No space left") as caught:
        write(Path("/dev/full"), "states", tables["states"])
    assert caught.value.errno == errno.ENOSPC


def test_the_footer_gives_the_range_and_the_order_of_the_keys(tables, tmp_path: Path):
    write(tmp_path / "a.parquet", "states", tables["states"])
    metadata = pq.read_metadata(tmp_path / "a.parquet")
    group = metadata.row_group(0)
    assert (group.column(0).statistics.min, group.column(0).statistics.max) == (0, 4)
    assert group.column(SCHEMAS["states"].get_field_index("x_mm")).statistics is None
    assert [each.column_index for each in group.sorting_columns] == [0, 1, 2]
