"""Damaged Parquet files of a data set whose manifest states the checksum of the damaged file.

`corpus` makes two small data sets, `damaged` changes bytes or decoded values of a file in one of
them, and `read` opens the data set and uses its tables as the commands do.
"""

import contextlib
import hashlib
import io
import json
import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import overtaking as ot
from damage import damaged_bytes

MANIFEST = "dataset.json"
SHORT = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 1.0, "traffic.vehicles": "2..3"}

INTEGERS = (0, 1, -1, 7, 31, 32, 127, 255, 256, 2**15, 2**31 - 1, -(2**31), 2**63 - 1, 2**64 - 1)
FLOATS = (0.0, -0.0, -1.0, 1e-40, 1e9, 1e38, 1e308, float("nan"), float("inf"), -float("inf"))
TEXTS = ("", "a", "paper", "none", "\x1b[31m", "é" * 40, "a" * 100_000, "../..")


class Shard(NamedTuple):
    """A file of a data set.

    Attributes:
        folder: Name of the folder of the data set.
        table: Name of the table.
        content: The bytes.
    """

    folder: str
    table: str
    content: bytes


def corpus(folder: Path) -> Sequence[Shard]:
    """Every file of a data set with frames, and of one without."""
    shards: list[Shard] = []
    for name, keep in (("frames", "frames"), ("features", "features")):
        ot.generate_dataset(
            "pinto2023-physical",
            num_simulations=3,
            seed=1,
            out=folder / name,
            overrides=SHORT,
            keep=keep,
        )
        paths = sorted((folder / name).glob("*/part-00000.parquet"))
        shards += [Shard(name, path.parent.name, path.read_bytes()) for path in paths]
    return shards


def damaged(sound: Shard, chance: random.Random) -> Shard:
    """A file of which some bytes differ, or up to three properties of the decoded table."""
    if chance.random() < 0.3:
        return sound._replace(content=damaged_bytes(sound.content, chance))
    table = pq.read_table(io.BytesIO(sound.content))
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        table = chance.choice(_CHANGES)(table, chance)
    written = io.BytesIO()
    try:
        pq.write_table(table, written, row_group_size=chance.choice((None, 1, 7)))
    except (pa.ArrowException, ValueError):  # Parquet cannot hold such a table.
        return sound._replace(content=sound.content[:-1])
    return sound._replace(content=written.getvalue())


def read(shard: Shard, folder: Path) -> None:
    """Write the file and its checksum, use the data set, and put the sound files back."""
    path = folder / shard.folder / shard.table / "part-00000.parquet"
    manifest_path = folder / shard.folder / MANIFEST
    files = {path: path.read_bytes(), manifest_path: manifest_path.read_bytes()}
    try:
        path.write_bytes(shard.content)
        manifest_path.write_text(_with_checksum(files[manifest_path], shard), encoding="utf-8")
        _use(folder / shard.folder)
    finally:
        for file, content in files.items():
            file.write_bytes(content)


def _with_checksum(manifest: bytes, shard: Shard) -> str:
    """The manifest with size, checksum and number of rows of the damaged file."""
    values = json.loads(manifest)
    facts = values["shards"][0]["tables"][shard.table]
    facts |= {
        "size_bytes": len(shard.content),
        "sha256": hashlib.sha256(shard.content).hexdigest(),
    }
    with contextlib.suppress(
        pa.ArrowException, OSError, UnicodeDecodeError
    ):  # The footer may be damaged.
        facts["rows"] = pq.read_metadata(io.BytesIO(shard.content)).num_rows
    return json.dumps(values)


def _use(path: Path) -> None:
    """Read every table, and make of them what the commands show."""
    data = ot.load_dataset(path)
    assert repr(data)
    for table in data.kept_tables:
        method = getattr(data, table, None)
        if table not in ("frames", "states"):
            assert method is not None
            method()
    for encoded in (False, True):
        data.features(encoded=encoded)
    data.verdict(1)
    data.frames(1)
    data.states(1)
    ot.dataset_statistics(data).summary()
    for _numbers, recorded in data.batches():
        ot.label(recorded)


def _other_cell(table: pa.Table, chance: random.Random) -> pa.Table:
    """One cell, or a whole column, holds another value."""
    index = chance.randrange(table.num_columns)
    field, values = table.schema.field(index), table.column(index).to_pylist()
    value = chance.choice((*values, None, *_hostile_values(field.type)))
    rows = range(len(values)) if chance.random() < 0.3 else [chance.randrange(len(values) or 1)]
    for row in rows if values else ():
        values[row] = value
    kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
    try:
        array = pa.array(values, kind)
    except (pa.ArrowException, OverflowError, ValueError, TypeError):
        return table
    array = array.dictionary_encode() if pa.types.is_dictionary(field.type) else array
    return table.set_column(index, field.with_nullable(True), array)


def _hostile_values(kind: pa.DataType) -> tuple[Any, ...]:
    """Values that a column of a type can hold and should not."""
    if pa.types.is_integer(kind):
        return INTEGERS
    if pa.types.is_floating(kind):
        return FLOATS
    return (True, False) if pa.types.is_boolean(kind) else TEXTS


def _other_type(table: pa.Table, chance: random.Random) -> pa.Table:
    """A column has another type."""
    index = chance.randrange(table.num_columns)
    kinds = (pa.int8(), pa.int32(), pa.int64(), pa.float32(), pa.float64(), pa.string(), pa.null())
    kind = chance.choice(kinds)
    array = pa.nulls(table.num_rows, kind)
    if chance.random() < 0.7 and not pa.types.is_null(kind):
        array = pa.array(np.zeros(table.num_rows), pa.float64()).cast(kind)
    return table.set_column(index, table.schema.field(index).with_type(kind), array)


def _other_rows(table: pa.Table, chance: random.Random) -> pa.Table:
    """Rows are missing, repeated, or in another order."""
    order = list(range(table.num_rows))
    match chance.randrange(4):
        case 0:
            order = order[: chance.randrange(len(order) + 1)]
        case 1:
            chance.shuffle(order)
        case 2:
            order = sorted(order * chance.choice((2, 3, 100)))
        case _:
            order = order[chance.randrange(len(order) + 1) :]
    return table.take(pa.array(order, pa.int64()))


def _other_columns(table: pa.Table, chance: random.Random) -> pa.Table:
    """A column is missing, there twice, renamed, or in another place."""
    names = list(table.column_names)
    index = chance.randrange(len(names))
    match chance.randrange(4):
        case 0:
            return table.remove_column(index)
        case 1:
            return table.append_column(table.schema.field(index), table.column(index))
        case 2:
            names[index] = chance.choice(("other", "", *names))
            return table.rename_columns(names)
        case _:
            return table.select(chance.sample(range(len(names)), len(names)))


def _other_metadata(table: pa.Table, chance: random.Random) -> pa.Table:
    """The metadata of the table, or of a column, say something else."""
    hostile = {
        b"names": b"[",
        b"unit": b"mm",
        b"flags": b'["a"]',
        b"version": b"x",
        b"schema": b"y",
    }
    changed = dict(chance.sample(sorted(hostile.items()), 2))
    if chance.random() < 0.5:
        return table.replace_schema_metadata({**(table.schema.metadata or {}), **changed})
    index = chance.randrange(table.num_columns)
    field = table.schema.field(index)
    return table.set_column(index, field.with_metadata(changed), table.column(index))


_CHANGES: tuple[Callable[[pa.Table, random.Random], pa.Table], ...] = (
    *[_other_cell] * 6,
    _other_type,
    _other_rows,
    _other_columns,
    _other_metadata,
)
