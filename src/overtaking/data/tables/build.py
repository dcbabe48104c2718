"""Arrow tables from NumPy columns."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from overtaking.data.tables.arrow import Array, Mask, Masked, to_arrow, to_names
from overtaking.data.tables.columns import names_of
from overtaking.data.tables.schemas import SCHEMAS


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


def build(table: str, given: Mapping[str, Given]) -> pa.Table:
    """A table of one of the `SCHEMAS`.

    Args:
        table: Its name.
        given: Its columns by name, in any order.
    """
    schema = SCHEMAS[table]
    return pa.Table.from_arrays([_array(given[one.name], one) for one in schema], schema=schema)


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
