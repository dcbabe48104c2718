"""Arrow tables from batches: columns are read from their paths, or an encoder computes them."""

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from overtaking.core.arrays import Mask
from overtaking.data.tables.arrow import Array, Masked, to_arrow, to_names
from overtaking.data.tables.columns import Column, names_of
from overtaking.data.tables.schemas import COLUMNS, schema_of
from overtaking.model.batch import Batch


class Texts(NamedTuple):
    """A column of repeated texts.

    Attributes:
        indices: Index of each row's text, shape (row,).
        texts: The texts.
        missing: Where the column is null, shape (row,); None if nowhere.
    """

    indices: Array
    texts: tuple[str, ...]
    missing: Mask | None = None

    @classmethod
    def same(cls, text: str, count: int) -> "Texts":
        """One text, `count` times."""
        return cls(np.zeros(count, np.int32), (text,))


Given = Array | Masked | Texts
"""A column before it is encoded: of an enumeration its codes, of fixed-size bytes all bytes."""

Rows = Callable[[Array], Array]
"""Takes the rows of a table from an attribute of its batch."""


def build(
    table: str,
    batch: Batch,
    rows: Rows,
    computed: Mapping[str, Given],
    unknown: Collection[str] = (),
) -> pa.Table:
    """A table of a batch.

    Args:
        table: Its name.
        batch: Where the paths of its columns begin.
        rows: Takes the rows of the table from an attribute.
        computed: Columns by name that are not attributes of the batch, a key first.
        unknown: Names of what a recording does not tell.
    """
    schema, count = schema_of(table, unknown), len(next(iter(computed.values())))
    known = [one for one in COLUMNS[table] if not one.is_silent(unknown)]
    read = read_columns([one for one in known if one.name not in computed], batch, rows)
    given = {one.name: computed.get(one.name, read.get(one.name)) for one in known}
    arrays = [
        pa.nulls(count, field.type) if one is None else _array(one, field)
        for field in schema
        for one in [given.get(field.name)]
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def read_columns(columns: Iterable[Column], batch: Batch, rows: Rows) -> dict[str, Given]:
    """Columns that are attributes of a batch, by name; null where they have no finite value.

    Args:
        columns: Which.
        batch: Where their paths begin.
        rows: Takes the rows of the table from an attribute.
    """

    @cache
    def absent(path: str, index: int | None, null_value: int) -> Mask:
        return rows(_attribute(batch, path, index)) == null_value

    given: dict[str, Given] = {}
    for one in columns:
        values = rows(_attribute(batch, one.path, one.index))
        path = one.spec.null_unless
        missing = absent(path, one.index, one.null_value) if path else None
        if one.is_nullable and values.dtype.kind == "f":
            infinite = ~np.isfinite(values)
            missing = infinite if missing is None else missing | infinite
        given[one.name] = values if missing is None else Masked(values, missing)
    return given


def _attribute(batch: Batch, path: str, index: int | None) -> Array:
    """An attribute; arrays of shape (simulation,) have no last axis to choose from."""
    found: Array = attrgetter(path)(batch)
    return found if index is None or found.ndim == 1 else found[..., index]


def _array(given: Given, field: pa.Field) -> pa.Array:
    if isinstance(given, Texts):
        return to_names(given.indices, given.texts, given.missing).dictionary_decode()
    values, missing = given if isinstance(given, Masked) else (given, None)
    if names := names_of(field):
        return to_names(values, names, missing)
    if pa.types.is_fixed_size_binary(field.type):
        buffers: list[Any] = [None, pa.py_buffer(np.ascontiguousarray(values))]
        return pa.Array.from_buffers(field.type, len(values) // field.type.byte_width, buffers)
    # A silent conversion would hide an encoder that disagrees with the schema.
    assert values.dtype == field.type.to_pandas_dtype(), f"{field.name}: {values.dtype}"
    return to_arrow(values, missing)
