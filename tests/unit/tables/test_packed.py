"""What compiled code writes, other programs read: pyarrow and DuckDB."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from overtaking import _core
from overtaking.tables.columns import Enumeration, column, names_of
from overtaking.tables.digest import content_of
from overtaking.tables.packed import PackedRows

if TYPE_CHECKING:
    from pathlib import Path

SIDES = Enumeration(names=("off", "left", "right"))
SCHEMA = pa.schema(
    [
        column("simulation", pa.int64(), "1", "Key"),
        column("x_mm", pa.int32(), "mm", "Any number"),
        column("heading_100urad", pa.int16(), "0.1 mrad", "Any number of 16 bits"),
        column("lane_id", pa.int16(), "1", "Few numbers, or none", nullable=True),
        column("lights", pa.uint8(), "1", "Few numbers"),
        column("side", SIDES, "1", "A name"),
    ]
)
FEW = frozenset({"lane_id", "lights"})
INT32 = st.integers(-(2**31), 2**31 - 1)
INT16 = st.integers(-(2**15), 2**15 - 1)


def table_of(rows: list[tuple[Any, ...]]) -> pa.Table:
    """Rows as a table; names are given as their places."""
    values = list(zip(*rows, strict=True)) or [()] * len(SCHEMA)
    arrays: list[pa.Array] = []
    for field, numbers in zip(SCHEMA, values, strict=True):
        if names := names_of(field):
            codes = pa.array(numbers, pa.int32())
            arrays.append(pa.DictionaryArray.from_arrays(codes, pa.array(names)))
        else:
            arrays.append(pa.array(numbers, field.type))
    return pa.Table.from_arrays(arrays, schema=SCHEMA)


def packed(*tables: pa.Table) -> tuple[bytes, str]:
    """A file of some pieces, and the hash over its values."""
    sink = io.BytesIO()
    rows = PackedRows(sink, SCHEMA, ["simulation"], FEW)  # type: ignore[arg-type]
    for table in tables:
        rows.append(table)
    rows.close({"note": "kept"})
    return sink.getvalue(), rows.content


def plain(table: pa.Table) -> dict[str, list[Any]]:
    return {name: table[name].to_pylist() for name in table.schema.names}


@given(
    st.lists(
        st.tuples(
            st.integers(0, 2**29),
            INT32,
            INT16,
            st.none() | st.integers(-8, 8),
            st.integers(0, 255),
            st.integers(0, 2),
        ),
        min_size=1,
        max_size=300,
    )
)
def test_any_rows_come_back(rows: list[tuple[Any, ...]]):
    table = table_of(rows)
    file, content = packed(table)
    read = pq.read_table(io.BytesIO(file))
    assert plain(read) == plain(table)
    assert content == content_of(table) == content_of(read)


@pytest.mark.parametrize("count", [1, 2, 32, 33, 128, 129, 130, 161, 257, 70_000])
def test_any_number_of_rows_is_read_by_others(count: int, tmp_path: Path):
    step = np.arange(count) * 7919
    rows = [
        (int(k) // 50, int(k) % 2**31, int(k) % 999 - 500, None if k % 3 else 4, 7, int(k) % 3)
        for k in step
    ]
    table = table_of(rows)
    file, _ = packed(table, table)
    (tmp_path / "a.parquet").write_bytes(file)
    expected = {name: values * 2 for name, values in plain(table).items()}
    assert plain(pq.read_table(tmp_path / "a.parquet")) == expected
    query = f"select * from '{tmp_path}/a.parquet'"
    assert duckdb.connect().execute(query).fetchall() == list(zip(*expected.values(), strict=True))


def test_a_column_without_any_value_comes_back():
    table = table_of([(0, 1, 2, None, 3, 0)] * 40)
    read = pq.read_table(io.BytesIO(packed(table)[0]))
    assert read["lane_id"].null_count == 40


def test_the_footer_tells_the_range_of_keys_the_order_and_the_notes():
    metadata = pq.read_metadata(
        io.BytesIO(packed(table_of([(3, 1, 2, 4, 3, 0), (9,) + (1,) * 5]))[0])
    )
    group = metadata.row_group(0)
    assert (group.column(0).statistics.min, group.column(0).statistics.max) == (3, 9)
    assert group.column(1).statistics is None
    assert [each.column_index for each in group.sorting_columns] == [0]
    assert metadata.metadata[b"note"] == b"kept"
    assert metadata.schema.to_arrow_schema().field("x_mm").metadata == SCHEMA.field("x_mm").metadata


def test_a_file_without_rows_has_its_schema():
    read = pq.read_table(io.BytesIO(packed()[0]))
    assert read.schema.names == SCHEMA.names
    assert read.num_rows == 0


def test_neighbours_that_do_not_change_cost_next_to_nothing():
    table = table_of([(1, 5, 5, 4, 3, 1)] * 100_000)
    assert len(packed(table)[0]) < 100_000 * 0.3


def given_columns(**changes: np.ndarray) -> list[dict[str, Any]]:
    """Two rows as the encoder takes them, with some values changed."""
    values = {
        "simulation": np.zeros(2, np.int64),
        "x_mm": np.zeros(2, np.int32),
        "heading_100urad": np.zeros(2, np.int16),
        "lane_id": np.zeros(2, np.int16),
        "lights": np.zeros(2, np.uint8),
        "side": np.zeros(2, np.int8),
    } | changes
    return [
        {
            "values": rows,
            "missing": np.zeros(2, np.bool_) if name == "lane_id" else None,
            "names": list(SIDES.names) if name == "side" else [],
            "is_key": False,
            "is_few": name in FEW,
        }
        for name, rows in values.items()
    ]


def test_columns_of_another_table_are_refused():
    file = _core.ParquetFile(packed()[0], [0])
    file.append(given_columns())
    with pytest.raises(ValueError, match="1 columns instead of 6"):
        file.append(given_columns()[:1])
    for name, rows in {
        "x_mm": np.zeros(2, np.int64),
        "simulation": np.zeros(2, np.int32),
        "lights": np.zeros(3, np.uint8),
    }.items():
        with pytest.raises(ValueError, match=f"column {name} is not as in the schema"):
            file.append(given_columns(**{name: rows}))


def test_what_is_no_parquet_file_is_no_template():
    with pytest.raises(ValueError, match="Parquet"):
        _core.ParquetFile(b"no such thing", [])


@pytest.mark.parametrize("kind", [np.int32, np.int16, np.uint8])
def test_rows_are_cut_to_their_lengths(kind: type[Any]):
    values = np.arange(24, dtype=kind).reshape(4, 6)[:, :5]
    counts = np.array([5, 0, 2, 1])
    expected = np.concatenate([row[:count] for row, count in zip(values, counts, strict=True)])
    found = _core.compact(values, counts)
    assert found.dtype == kind
    assert np.array_equal(found, expected)


@pytest.mark.parametrize("counts", [[1, 2], [6, 1, 1], [-1, 1, 1], [2**62, 0, 0]])
def test_lengths_that_rows_do_not_have_are_refused(counts: list[int]):
    with pytest.raises(ValueError, match="counts"):
        _core.compact(np.zeros((3, 5), np.int32), np.array(counts))
