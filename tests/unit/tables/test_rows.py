"""Rows as NumPy arrays are the tables that Arrow sees, in any pieces."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from overtaking.datasets.contents import content_rows, contents
from overtaking.tables.arrow import Masked
from overtaking.tables.rows import Column, Rows, Texts, nothing, texts_of
from overtaking.tables.schemas import SCHEMAS


@pytest.fixture(scope="module")
def recorded(recorder):
    return recorder(seed=6)


@pytest.fixture(scope="module")
def rows(recorded):
    return content_rows(recorded, np.arange(5), tuple(SCHEMAS))


@pytest.mark.parametrize("name", SCHEMAS)
def test_rows_are_those_of_the_table(name: str, rows, recorded):
    table = contents(recorded, np.arange(5), (name,))[name]
    assert rows[name].num_rows == table.num_rows
    assert rows[name].arrow().equals(table)
    assert Rows.of(table).arrow().equals(table)


@pytest.mark.parametrize("name", SCHEMAS)
def test_pieces_one_after_the_other_are_the_whole(name: str, rows):
    table = rows[name].arrow()
    parts = [Rows.of(table.slice(start, 3)) for start in range(0, max(table.num_rows, 1), 3)]
    assert Rows.joined(parts).arrow().equals(table)
    assert Rows.joined(parts).num_rows == table.num_rows


def sources(*columns: Column) -> pa.Array:
    """The sources of recordings that come in pieces."""
    schema = pa.schema([SCHEMAS["simulations"].field("source_recording")])
    parts = [Rows(schema, (one,), len(one.values)) for one in columns]
    return Rows.joined(parts).arrow()["source_recording"]


def test_pieces_with_texts_of_their_own_keep_them():
    field = SCHEMAS["simulations"].field("source_recording")
    found = sources(texts_of(["a", "b"]), nothing(field, 2), texts_of(["b", "c"]))
    assert found.to_pylist() == ["a", "b", None, None, "b", "c"]


def test_pieces_with_the_same_texts_share_them():
    one = Column(np.array([1, 0], np.int32), None, ("a", "b"))
    joined = Rows.joined([Rows(pa.schema([("text", pa.string())]), (one,), 2)] * 3)
    assert joined.columns[0].texts == ("a", "b")
    assert joined.arrow()["text"].to_pylist() == ["b", "a"] * 3


def test_nulls_of_some_pieces_stay_where_they_are():
    field = pa.field("gap_m", pa.float32())
    there = Column(np.array([1.5, 2.5], np.float32))
    parts = [Rows(pa.schema([field]), (one,), 2) for one in (there, nothing(field, 2), there)]
    assert Rows.joined(parts).arrow()["gap_m"].to_pylist() == [1.5, 2.5, None, None, 1.5, 2.5]


def test_a_column_of_another_type_is_named(rows):
    names = SCHEMAS["weather"].names
    given = {
        name: Masked(one.values, one.values != one.values)
        for name, one in zip(names, rows["weather"].columns, strict=True)
    }
    given["preset"] = Texts(np.zeros(5, np.int32), ("ClearNoon",))
    assert Rows.build("weather", given).num_rows == 5
    with pytest.raises(AssertionError, match="fog_percent: float64 instead of float32"):
        Rows.build("weather", given | {"fog_percent": np.zeros(5)})
