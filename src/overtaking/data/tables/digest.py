"""A hash over the values of a table, independent of its file and batches."""

import hashlib
from functools import cache
from typing import Any

import pyarrow as pa

from overtaking import _core
from overtaking.data.tables.arrow import listed
from overtaking.data.tables.columns import names_of


class ContentDigest:
    """A hash over the values of a table that arrives in pieces.

    Each column has a BLAKE3 hash of its own, so that pieces of any length give the same result;
    nulls are hashed as a column of their own, and the values behind them do not count.
    """

    def __init__(self, schema: pa.Schema) -> None:
        """Start with no rows of a table of one of the `SCHEMAS`."""
        self._schema = schema
        self._columns = [_Column(field) for field in schema]
        self.num_rows = 0

    def update(self, table: pa.Table) -> None:
        """Add rows."""
        self.num_rows += table.num_rows
        for index, column in enumerate(self._columns):
            for chunk in table.column(index).chunks:
                column.update(chunk)

    def hexdigest(self) -> str:
        """The hash over all rows so far, 64 hexadecimal digits."""
        total = hashlib.sha256()
        for field, column in zip(self._schema, self._columns, strict=True):
            parts = (field.name, field.type, *column.hash.hexdigests())
            total.update("".join(f"{part}\0" for part in parts).encode())
        return total.hexdigest()


def content_of(table: pa.Table) -> str:
    """The content hash of a whole table."""
    digest = ContentDigest(table.schema)
    digest.update(table)
    return digest.hexdigest()


class _Column:
    """A column and its hash."""

    def __init__(self, field: pa.Field) -> None:
        self._names = names_of(field)
        layout, width = ("codes", 4) if self._names else _layout(field.type)
        self.hash = _core.ColumnHash(layout, width, nullable=field.nullable)

    def update(self, chunk: pa.Array) -> None:
        """Add rows."""
        if not self._names:
            self.hash.update(_rows(chunk))
            return
        self.hash.update(_rows(chunk.indices), self._meaning(chunk.dictionary))

    def _meaning(self, dictionary: pa.Array) -> list[int]:
        """The code of each name of a dictionary, which may hold them in any order."""
        if dictionary.equals(listed(self._names)):
            return list(range(len(self._names)))
        return [self._names.index(name) for name in dictionary.to_pylist()]


@cache
def _layout(kind: pa.DataType) -> tuple[str, int]:
    """How the values of a type lie in its data, and the bytes of each that has a fixed number."""
    if pa.types.is_boolean(kind):
        return "bits", 1
    if pa.types.is_string(kind):
        return "texts", 0
    if pa.types.is_fixed_size_binary(kind):
        return "fixed", kind.byte_width
    return "numbers", kind.byte_width


def _rows(chunk: pa.Array) -> dict[str, Any]:
    """The rows of an array as the compiled hash takes them."""
    # Arrow's buffers say that they hold signed bytes.
    buffers = [None if one is None else memoryview(one).cast("B") for one in chunk.buffers()]
    validity, *ends, data = buffers
    return {
        "count": len(chunk),
        "offset": chunk.offset,
        "validity": validity,
        "data": data,
        "ends": ends[0] if ends else None,
    }
