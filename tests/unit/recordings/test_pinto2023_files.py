"""The paper's table in files: written whole, read back the same, refused where it is wrong."""

from __future__ import annotations

import csv
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.road import RoadMark
from overtaking.recordings.pinto2023 import COLUMNS, SCHEMA, read_table, write_table
from overtaking.recordings.pinto2023_schema import VEHICLE_COLUMNS
from overtaking.recordings.pinto2023_text import from_text

GOOD = dict(
    zip(
        COLUMNS,
        [
            *("1", "0", "0", "1", "(1,6.27,2.39,2.1)", "(1,351.35,2.5,-7)", "(1,66)"),
            *("(1,-0.2,-3.62)", "(1,76.28)", "90", "Solid", "Broken", "3.5", "0.5", "3.5"),
            *("0", "60", "60", "60", "Night", "No", "0"),
        ],
        strict=True,
    )
)
ONE_ROW = from_text(pa.table({name: [cell] for name, cell in GOOD.items()}))

NUMBER = st.integers(-(10**7), 10**7).map(lambda hundredths: hundredths / 100.0)
POSITIVE = NUMBER.map(abs)


@st.composite
def tables(draw) -> pa.Table:
    """Any table of the paper's form."""
    kinds = {"speed_kmh": st.integers(0, 400), "lane_id": st.integers(-20, 20)}

    def row(number: int) -> dict[str, object]:
        ids = draw(st.lists(st.integers(1, 10**6), min_size=1, max_size=4, unique=True))
        tuples = {
            column: [
                {"id": one, **{name: draw(kinds.get(name, NUMBER)) for name, _ in fields}}
                for one in ids
            ]
            for column, fields in VEHICLE_COLUMNS.items()
        }
        percent = st.integers(0, 10_000).map(lambda hundredths: hundredths / 100.0)
        mark = st.sampled_from([one.value for one in RoadMark])
        return {
            "S": draw(st.integers(0, 10**18 - 1)),
            "F": number,
            "TS": draw(POSITIVE),
            "IDego": draw(st.sampled_from(ids)),
            **tuples,
            "MV": draw(POSITIVE),
            "RT": draw(mark),
            "LT": draw(mark),
            "LW": draw(POSITIVE),
            "LWR": draw(st.none() | POSITIVE),
            "LWL": draw(st.none() | POSITIVE),
            "C": draw(st.none() | st.sampled_from(ids)),
            **{name: draw(percent) for name in ("Prec", "Fog", "Wind")},
            "DN": draw(st.sampled_from(["Day", "Night"])),
            "HL": draw(st.sampled_from(["Yes", "No"])),
            "OV": draw(st.integers(0, 1)),
        }

    return pa.Table.from_pylist([row(n) for n in range(draw(st.integers(0, 4)))], schema=SCHEMA)


@pytest.mark.ci
@pytest.mark.parametrize("ending", ["csv", "parquet"])
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(parts=st.lists(tables(), max_size=3))
def test_what_is_written_in_parts_is_read_back_as_the_same_values(tmp_path, ending, parts):
    path = tmp_path / f"table.{ending}"
    rows = write_table(iter(parts), path)
    whole = pa.concat_tables([SCHEMA.empty_table(), *parts])
    again = read_table(path)
    assert rows == again.num_rows == whole.num_rows
    assert again.schema.equals(SCHEMA, check_metadata=True)
    assert again.to_pylist() == whole.to_pylist()
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_writer_that_fails_halfway_leaves_the_old_file_and_nothing_else(tmp_path, ending):
    path = tmp_path / f"table.{ending}"
    write_table([ONE_ROW], path)
    before = path.read_bytes()

    def parts():
        yield ONE_ROW
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        write_table(parts(), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["table.xlsx", "table", "folder.csv"])
def test_a_name_that_is_no_csv_or_parquet_file_is_refused(tmp_path, name):
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(ConfigError, match=r"\.csv or \.parquet"):
        write_table([], tmp_path / name)


def write_rows(path, *rows: dict[str, str], names=COLUMNS) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([row[name] for name in COLUMNS] for row in rows)


@pytest.mark.parametrize(
    ("column", "cell", "expected"),
    [
        ("S", "one", "a whole number"),
        ("S", "-1", "not less than 0"),
        ("S", "9" * 40, "a whole number"),
        ("F", "3.5", "a whole number"),
        ("F", "99999999999", "at most 2147483647"),
        ("TS", "nan", "a number"),
        ("TS", "", "a number"),
        ("IDego", "2", "one of the ids of column Dim"),
        ("Dim", "", "tuples (id, length_m, width_m, height_m)"),
        ("Dim", "(1,6.27,2.39)", "tuples (id, length_m, width_m, height_m)"),
        ("L", "(1,351.35,251.58,-7", "tuples (id, x_m, y_m, lane_id)"),
        ("L", "(1,351.35,251.58,-7.5)", "tuples (id, x_m, y_m, lane_id)"),
        ("L", "(1,351.35,251.58,-99999999999)", "at most 2147483647"),
        ("L", "(3,351.35,251.58,-7)", "the ids of column Dim, in the same order"),
        ("V", "(1,66); (2,79)", "the ids of column Dim, in the same order"),
        ("V", "(1,66),(2,79)", "tuples (id, speed_kmh)"),
        ("D", "(1,,1)", "tuples (id, wheel_deg, yaw_deg)"),
        ("A", "(1,1e999)", "tuples (id, accel_mps2)"),
        ("MV", "90 km/h", "a number"),
        ("RT", "solid", "one of NONE, Solid"),
        ("LWL", "wide", "a number"),
        ("C", "489", "one of the ids of column Dim"),
        ("Prec", "101", "0 to 100"),
        ("Fog", "-1", "0 to 100"),
        ("DN", "Dusk", "one of Day, Night"),
        ("HL", "0", "one of Yes, No"),
        ("OV", "2", "0 to 1"),
    ],
)
def test_a_bad_cell_is_named_by_line_and_column(tmp_path, column, cell, expected):
    path = tmp_path / "bad.csv"
    write_rows(path, GOOD, GOOD, {**GOOD, column: cell})
    with pytest.raises(ImportFormatError) as caught:
        read_table(path)
    message = str(caught.value)
    assert f"bad.csv: line 4, column {column}: expected {expected}" in message
    assert "\n" not in message
    assert len(message) < 500


def test_the_row_for_the_bad_cells_is_itself_good(tmp_path):
    path = tmp_path / "good.csv"
    write_rows(path, GOOD)
    assert read_table(path).num_rows == 1


def test_a_bad_cell_of_a_parquet_file_is_named_by_row_and_column(tmp_path):
    path = tmp_path / "bad.parquet"
    pq.write_table(pa.Table.from_pylist([GOOD, {**GOOD, "HL": None}]).select(COLUMNS), path)
    with pytest.raises(ImportFormatError, match="row 2, column HL: expected one of Yes, No"):
        read_table(path)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "line 1, column 1: expected the name S"),
        (b"S,F,TS\r\n1,0,0\r\n", "line 1, column 4: expected the name IDego"),
        ((",".join(COLUMNS) + ",X\r\n").encode(), "expected 22 columns, got 23"),
        ((",".join(COLUMNS) + "\r\n1,0\r\n").encode(), "#2: Expected 22 columns, got 2"),
        ((",".join(COLUMNS) + "\r\n" + "\xff" * 22).encode("latin-1"), "22 cells of UTF-8 text"),
        (b"\xff\xfe\x00S", "22 cells of UTF-8 text"),
        (b"\x00" * 1000, "line 1, column 1"),
    ],
)
def test_a_file_that_is_no_such_csv_is_refused(tmp_path, content, expected):
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    with pytest.raises(ImportFormatError, match=re.escape(expected)):
        read_table(path)


def test_a_byte_order_mark_of_a_spreadsheet_is_no_reason_to_refuse(tmp_path):
    path = tmp_path / "table.csv"
    write_rows(path, GOOD)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_table(path).num_rows == 1


def test_a_parquet_file_with_a_damaged_byte_is_refused_or_read(tmp_path):
    """Arrow says OSError where a page or its header is damaged."""
    path = tmp_path / "table.parquet"
    write_table([ONE_ROW], path)
    whole, num_refused = path.read_bytes(), 0
    for place in range(4, len(whole) - 8, 97):
        path.write_bytes(whole[:place] + b"\xff" + whole[place + 1 :])
        try:
            read_table(path)
        except ImportFormatError:
            num_refused += 1
    assert num_refused > 10


POOL = pa.proxy_memory_pool(pa.default_memory_pool())
"""Lives as long as the process: Arrow's threads may give memory back after a test has ended."""


@pytest.mark.ci
@pytest.mark.parametrize(
    ("rows", "cell", "settings_"),
    [
        (1_000_000, "Solid", {}),  # Runs of the same cell.
        (2_000, "9" * 100_000, {}),  # One long cell, many times.
        (20, "9" * 1_000_000, {"use_dictionary": False}),  # Long cells, well compressed.
    ],
)
def test_a_parquet_file_whose_few_bytes_stand_for_much_text_is_refused(
    tmp_path, rows, cell, settings_
):
    path = tmp_path / "bomb.parquet"
    same = pa.array([0], pa.int32()).take(pa.array(np.zeros(rows, np.int32)))
    cells = pa.DictionaryArray.from_arrays(same, pa.array([cell])).dictionary_decode()
    short = pa.nulls(rows, pa.string()).fill_null("1")
    table = pa.table({name: cells if name == "RT" else short for name in COLUMNS})
    pq.write_table(table, path, compression="zstd", **settings_)
    assert path.stat().st_size < 200_000
    usual = pa.default_memory_pool()
    pa.set_memory_pool(POOL)
    try:
        with pytest.raises(ImportFormatError, match=r"expected at most 1[0-9] MB of text, got"):
            read_table(path)
    finally:
        pa.set_memory_pool(usual)
    assert POOL.max_memory() < 16 << 20


def test_a_parquet_file_with_text_that_is_no_utf_8_is_refused(tmp_path):
    path = tmp_path / "table.parquet"
    table = pa.Table.from_pylist([GOOD]).select(COLUMNS)
    pq.write_table(table, path, compression="none", use_dictionary=False)
    assert read_table(path).num_rows == 1
    path.write_bytes(path.read_bytes().replace(b"Night", b"N\xffght"))
    with pytest.raises(ImportFormatError, match=r"expected a Parquet file, got .*UTF"):
        read_table(path)


@pytest.mark.parametrize("cut", [0, 3, 100, 4000])
def test_a_parquet_file_cut_short_is_refused(tmp_path, cut):
    path = tmp_path / "table.parquet"
    write_table([ONE_ROW], path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(ImportFormatError, match="expected a Parquet file"):
        read_table(path)


def test_a_parquet_file_with_numbers_in_place_of_cells_is_refused(tmp_path):
    path = tmp_path / "typed.parquet"
    pq.write_table(ONE_ROW, path)
    with pytest.raises(ImportFormatError, match="expected columns of text"):
        read_table(path)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(damage=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), min_size=1, max_size=4))
def test_a_damaged_csv_is_read_or_refused_but_never_crashes(tmp_path, damage):
    path = tmp_path / "table.csv"
    write_rows(path, GOOD, GOOD)
    content = bytearray(path.read_bytes())
    for position, byte in damage:
        content[position % len(content)] = byte
    path.write_bytes(bytes(content))
    try:
        table = read_table(path)
    except ImportFormatError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert table.schema.equals(SCHEMA)
