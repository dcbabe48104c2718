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
from overtaking.tables.packed import Layout, PackedRows
from overtaking.tables.rows import Rows

if TYPE_CHECKING:
    from pathlib import Path

SIDES = Enumeration(names=("off", "left", "right"))
SCHEMA = pa.schema(
    [
        column("simulation", pa.int64(), "1", "Key"),
        column("seed", pa.uint64(), "1", "Any number without a sign"),
        column("x_mm", pa.int32(), "mm", "Any number"),
        column("heading_100urad", pa.int16(), "0.1 mrad", "Any number of 16 bits"),
        column("lane_id", pa.int16(), "1", "Few numbers, or none", nullable=True),
        column("lights", pa.uint8(), "1", "Few numbers"),
        column("gap_m", pa.float32(), "m", "Any number, or none", nullable=True),
        column("limit_mps", pa.float64(), "m/s", "Any number"),
        column("lit", pa.bool_(), "1", "Yes or no, or neither", nullable=True),
        column("side", SIDES, "1", "A name, or none", nullable=True),
        column("source", pa.string(), "1", "Any text, or none", nullable=True),
        column("hash", pa.binary(3), "1", "Bytes"),
    ]
)
LAYOUT = Layout.of(SCHEMA)
FEW = frozenset({"lane_id", "lights"})
INT32 = st.integers(-(2**31), 2**31 - 1)
INT16 = st.integers(-(2**15), 2**15 - 1)
ROW = st.tuples(
    st.integers(0, 2**40),
    st.integers(0, 2**64 - 1),
    INT32,
    INT16,
    st.none() | st.integers(-8, 8),
    st.integers(0, 255),
    st.none() | st.floats(width=32, allow_nan=False),
    st.sampled_from([0.0, -0.0, 0.1, 25.0]) | st.floats(allow_nan=False),
    st.none() | st.booleans(),
    st.none() | st.integers(0, 2),
    st.none() | st.sampled_from(["", "a", "ünï"]) | st.text(max_size=5),
    st.binary(min_size=3, max_size=3),
)


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


def row_of(k: int) -> tuple[Any, ...]:
    """A row with something in every column, and nothing in some."""
    return (
        k // 50,
        2**64 - 1,
        k % 2**31,
        k % 999 - 500,
        None if k % 3 else 4,
        7,
        None if k % 5 == 1 else k / 7,
        0.1 * (k % 4),
        None if k % 11 == 2 else k % 2 == 0,
        None if k % 13 == 1 else k % 3,
        None if k % 17 == 4 else f"text {k % 400}",
        k.to_bytes(8, "little")[:3],
    )


def packed(*tables: pa.Table, compressed: bool = True) -> tuple[bytes, str]:
    """A file of some pieces, and the hash over its values."""
    sink: Any = io.BytesIO()
    rows = PackedRows(sink, LAYOUT, ["simulation", "side"], FEW, compressed=compressed)
    for table in tables:
        rows.append(Rows.of(table))
    rows.close({"note": "kept"})
    return sink.getvalue(), rows.content


def plain(table: pa.Table) -> dict[str, list[Any]]:
    return {name: table[name].to_pylist() for name in table.schema.names}


@given(st.lists(ROW, min_size=1, max_size=300), st.booleans())
def test_any_rows_come_back(rows: list[tuple[Any, ...]], compressed: bool):
    table = table_of(rows)
    file, content = packed(table, compressed=compressed)
    read = pq.read_table(io.BytesIO(file))
    assert plain(read) == plain(table)
    assert content == content_of(table) == content_of(read)


@pytest.mark.parametrize("count", [1, 2, 7, 8, 32, 33, 128, 129, 130, 161, 257, 513, 9000])
def test_any_number_of_rows_is_read_by_others(count: int, tmp_path: Path):
    table = table_of([row_of(k * 7919) for k in range(count)])
    file, content = packed(table, table)
    (tmp_path / "a.parquet").write_bytes(file)
    expected = {name: values * 2 for name, values in plain(table).items()}
    assert plain(pq.read_table(tmp_path / "a.parquet")) == expected
    assert content == content_of(pa.concat_tables([table, table]))
    query = f"select * from '{tmp_path}/a.parquet'"
    rows = list(zip(*expected.values(), strict=True))
    assert duckdb.connect().execute(query).fetchall() == rows


@pytest.mark.parametrize("compressed", [True, False])
def test_runs_of_any_length_among_others_come_back(compressed: bool):
    """Runs and packed groups take turns at every place of a group of eight."""
    lanes = [lane for k in range(1, 60) for lane in [k % 5] * k + [None] * (k % 9) + [6, 7, 6]]
    rows = [(0, 0, k, 0, lane, *row_of(k)[5:]) for k, lane in enumerate(lanes)]
    table = table_of(rows)
    read = pq.read_table(io.BytesIO(packed(table, compressed=compressed)[0]))
    assert plain(read) == plain(table)


def test_a_column_without_any_value_comes_back():
    row = row_of(0)
    table = table_of([(*row[:4], None, row[5], None, row[7], None, None, None, row[11])] * 40)
    read = pq.read_table(io.BytesIO(packed(table)[0]))
    for name in ("lane_id", "gap_m", "lit", "side", "source"):
        assert read[name].null_count == 40


def test_more_different_integers_than_a_dictionary_holds_come_back():
    row = row_of(0)
    table = table_of([(*row[:4], k % 700 - 350, *row[5:]) for k in range(2000)])
    assert plain(pq.read_table(io.BytesIO(packed(table)[0]))) == plain(table)


def test_the_footer_tells_the_range_of_keys_the_order_and_the_notes():
    first, last = (3, *row_of(1)[1:9], 2, None, b"abc"), (9, *row_of(2)[1:9], 1, None, b"abc")
    metadata = pq.read_metadata(io.BytesIO(packed(table_of([first, last]))[0]))
    group = metadata.row_group(0)
    assert (group.column(0).statistics.min, group.column(0).statistics.max) == (3, 9)
    side = group.column(SCHEMA.get_field_index("side")).statistics
    assert (side.min, side.max) == ("left", "right")
    assert group.column(2).statistics is None
    assert [each.column_index for each in group.sorting_columns] == [0, 9]
    assert metadata.metadata[b"note"] == b"kept"
    assert metadata.schema.to_arrow_schema().field("x_mm").metadata == SCHEMA.field("x_mm").metadata


def test_a_file_without_rows_has_its_schema():
    read = pq.read_table(io.BytesIO(packed()[0]))
    assert read.schema.names == SCHEMA.names
    assert read.num_rows == 0


@pytest.mark.parametrize(("compressed", "most"), [(True, 0.2), (False, 3.9)])
def test_neighbours_that_do_not_change_cost_next_to_nothing(compressed: bool, most: float):
    table = table_of([row_of(5)] * 30_000)
    assert len(packed(table, compressed=compressed)[0]) < 30_000 * most


def test_what_compression_does_not_make_smaller_is_not_compressed():
    draw = np.random.default_rng(1)
    numbers = draw.integers(-(2**31), 2**31 - 1, 4000).tolist()
    table = table_of([(k, 0, number, *row_of(0)[3:]) for k, number in enumerate(numbers)])
    group = pq.read_metadata(io.BytesIO(packed(table)[0])).row_group(0)
    assert group.column(2).compression == "UNCOMPRESSED"
    assert group.column(2).total_compressed_size == group.column(2).total_uncompressed_size
    assert group.column(10).compression == "UNCOMPRESSED"  # One code is not worth a frame.
    plain_hash = group.column(11)
    assert plain_hash.compression == "ZSTD"
    assert plain_hash.total_compressed_size < plain_hash.total_uncompressed_size


def given_columns(**changes: np.ndarray) -> list[tuple[Any, ...]]:
    """Two rows as the encoder takes them, with some values changed."""
    columns = dict(zip(SCHEMA.names, Rows.of(table_of([row_of(0)] * 2)).columns, strict=True))
    values = {name: one.values for name, one in columns.items()} | changes
    values["seed"] = values["seed"].view(np.int64)
    return [(values[name], one.missing, list(one.texts)) for name, one in columns.items()]


def encoder() -> Any:
    sink: Any = io.BytesIO()
    return PackedRows(sink, LAYOUT, ["simulation"], FEW, compressed=True)._encoder  # pyright: ignore[reportPrivateUsage]


def test_columns_of_another_table_are_refused():
    file = encoder()
    file.append(given_columns())
    with pytest.raises(ValueError, match="1 columns instead of 12"):
        file.append(given_columns()[:1])
    for name, rows in {
        "x_mm": np.zeros(2, np.int64),
        "simulation": np.zeros(2, np.int32),
        "lights": np.zeros(3, np.uint8),
        "gap_m": np.zeros(2, np.float64),
        "side": np.full(2, 3, np.int8),
        "source": np.full(2, 1, np.int32),
        "hash": np.zeros(9, np.uint8),
    }.items():
        with pytest.raises(ValueError, match=f"column {name} is not as in the schema"):
            file.append(given_columns(**{name: rows}))


def test_a_gap_where_none_may_be_is_refused():
    columns = given_columns()
    columns[2] = (columns[2][0], np.array([False, True]), [])
    with pytest.raises(ValueError, match="column x_mm is not as in the schema"):
        encoder().append(columns)


def test_what_is_no_parquet_file_is_no_template():
    with pytest.raises(ValueError, match="Parquet"):
        _core.ParquetFile(b"no such thing", [], True)


@pytest.mark.parametrize("kind", ["integer", "fixed", "fixed 0", "fixed -1"])
def test_a_kind_of_column_that_there_is_not_is_refused(kind: str):
    with pytest.raises(ValueError, match="column a: unknown kind"):
        _core.ParquetFile(packed()[0], [("a", kind, [], False, False)], True)


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
