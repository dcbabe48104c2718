"""The content hash sees every value and nothing else."""

from __future__ import annotations

import hashlib

import numpy as np
import pyarrow as pa
import pytest

from overtaking import _core
from overtaking.data.tables.digest import ContentDigest, content_of
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import SCHEMAS
from overtaking.model.driver_interface import MAX_ACTION_PARTS, Actions

NOTHING = {"count": 0, "offset": 0, "validity": None, "data": None, "ends": None}
"""No rows, as the compiled hash takes them."""


@pytest.fixture(scope="module")
def tables(recorder):
    values = np.random.default_rng(2).integers(-1, 2, (5, 9, MAX_ACTION_PARTS)).astype(np.int32)
    run = recorder(seed=3).replace(actions=Actions(values=values, kind="accel_lane"))
    return contents(run, np.arange(5), tuple(SCHEMAS))


@pytest.mark.parametrize("name", SCHEMAS)
def test_pieces_of_any_length_give_the_same_hash(name: str, tables):
    table, digest = tables[name], ContentDigest(SCHEMAS[name])
    for start in range(0, table.num_rows, 3):
        digest.update(table.slice(start, 3))
    assert digest.hexdigest() == content_of(table)
    assert digest.num_rows == table.num_rows


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_column_counts(name: str, tables):
    table = tables[name]
    known, rows = {content_of(table)}, np.arange(table.num_rows)
    for place, field in enumerate(table.schema):
        shuffled = table[place].combine_chunks().take(pa.array(np.roll(rows, 1)))
        other = table.set_column(place, field, changed(shuffled, field))
        known.add(content_of(other))
    assert len(known) == len(table.schema) + 1


def hashed(octets: bytes) -> str:
    """The hash of bytes that are given one by one."""
    digest = _core.ColumnHash("numbers", 1, nullable=False)
    for octet in octets:
        digest.update({**NOTHING, "count": 1, "data": bytes([octet])})
    return digest.hexdigests()[0]


def changed(values: pa.Array, field: pa.Field) -> pa.Array:
    """The same column with another first value."""
    if pa.types.is_dictionary(field.type):
        codes = values.indices.to_numpy(zero_copy_only=False).copy()
        codes = np.nan_to_num(codes).astype(np.int32)
        codes[0] = (codes[0] + 1) % len(values.dictionary)
        return pa.DictionaryArray.from_arrays(pa.array(codes), values.dictionary)
    texts = {pa.string(): "other", pa.binary(16): b"\1" * 16}
    if field.type in texts:
        first = texts[field.type]
    else:
        first = not values[0].as_py() if pa.types.is_boolean(field.type) else 77
    return pa.array([first, *values.to_pylist()[1:]], field.type)


def test_null_and_zero_differ():
    schema = pa.schema([pa.field("gap_mm", pa.int32())])
    null, zero = (pa.table({"gap_mm": pa.array([v], pa.int32())}, schema) for v in (None, 0))
    assert content_of(null) != content_of(zero)


def test_what_stands_behind_a_null_does_not_count():
    schema = pa.schema([pa.field("gap_mm", pa.int32())])
    one, other = (
        pa.table(
            {"gap_mm": pa.array(np.array([v, 2], np.int32), mask=np.array([True, False]))}, schema
        )
        for v in (5, 6)
    )
    assert content_of(one) == content_of(other)


def test_the_order_of_a_dictionary_does_not_count(tables):
    table = tables["vehicles"]
    place = table.schema.get_field_index("kind")
    texts = table["kind"].cast(pa.string()).combine_chunks()
    other = table.set_column(place, table.schema.field("kind"), texts.dictionary_encode())
    assert other["kind"].chunk(0).dictionary != table["kind"].chunk(0).dictionary
    assert content_of(other) == content_of(table)


def test_texts_cannot_run_together():
    schema = pa.schema([pa.field("name", pa.string())])
    one, other = (pa.table({"name": texts}, schema) for texts in (["ab", "c"], ["a", "bc"]))
    assert content_of(one) != content_of(other)


@pytest.mark.parametrize(
    ("kind", "texts"),
    [
        (pa.string(), ["ab", None, "", "ünï", "c"]),
        (pa.string(), [None, None]),
        (pa.string(), []),
        (pa.binary(3), [b"abc", b"def", None]),
    ],
    ids=["some missing", "all missing", "none", "fixed width"],
)
def test_texts_are_hashed_one_after_the_other(kind: pa.DataType, texts: list[str | bytes | None]):
    schema = pa.schema([pa.field("name", kind)])
    table = pa.table({"name": pa.array(texts, kind)}, schema)
    parts = [each.encode() if isinstance(each, str) else each or b"" for each in texts]
    values = b"".join(len(each).to_bytes(8, "little") + each for each in parts)
    nulls = bytes(each is None for each in texts)
    whole = "".join(f"{hashed(part)}\0" for part in (values, nulls))
    expected = hashlib.sha256(f"name\0{kind}\0{whole}".encode()).hexdigest()
    assert content_of(table) == expected
    longer = pa.table({"name": pa.array([*texts[:1], *texts], kind)}, schema)
    assert content_of(longer.slice(len(texts[:1]))) == expected
