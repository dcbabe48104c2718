"""Rows of tables as Parquet, encoded by compiled code.

The format is Parquet's, as any reader knows it; `crates/overtaking-tables` says how a column is
encoded. Schema and metadata of a file are those that pyarrow would write.
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from overtaking import _core
from overtaking.tables.arrow import Array, Mask
from overtaking.tables.columns import names_of
from overtaking.tables.digest import titles_of, total_of
from overtaking.tables.rows import Column, Rows

_KINDS = {
    pa.int64(): "long",
    pa.uint64(): "long",
    pa.int32(): "int",
    pa.int16(): "short",
    pa.uint8(): "byte",
    pa.float32(): "float",
    pa.float64(): "double",
    pa.bool_(): "flag",
    pa.string(): "text",
}
"""What the encoder calls each type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What all files of a schema share.

    Attributes:
        template: A file without rows.
        columns: Name of each column, what the encoder calls its type, and names that it may hold.
        titles: What the content hash says of each column.
    """

    template: bytes
    columns: tuple[tuple[str, str, list[str]], ...]
    titles: tuple[str, ...]

    @classmethod
    def of(cls, schema: pa.Schema) -> Self:
        """The layout of a schema."""
        return cls(
            template=_template(schema),
            columns=tuple((field.name, _kind(field), list(names_of(field))) for field in schema),
            titles=titles_of(schema),
        )


class PackedRows:
    """Encodes a table piece by piece; each piece becomes a row group."""

    def __init__(
        self,
        file: io.RawIOBase,
        layout: Layout,
        keys: Sequence[str],
        few: frozenset[str],
        *,
        compressed: bool,
    ) -> None:
        """Begin a file.

        Args:
            file: Where the bytes go.
            layout: Its columns.
            keys: Columns that the rows are sorted by.
            few: Integers that take few values and rarely change: run lengths beat differences.
            compressed: Whether pages are compressed where that makes them smaller.

        Raises:
            OSError: The file cannot be written.
        """
        self._file = file
        self._titles = layout.titles
        columns = [
            (name, kind, names, name in keys, name in few) for name, kind, names in layout.columns
        ]
        self._encoder = _core.ParquetFile(layout.template, columns, compressed)
        self.num_rows = 0

    def append(self, rows: Rows) -> None:
        """Append some rows.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        self.num_rows += rows.num_rows
        self._file.write(self._encoder.append([_given(column) for column in rows.columns]))

    def close(self, notes: Mapping[str, str]) -> None:
        """Complete the file.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        self._file.write(self._encoder.finish(list(notes.items())))

    @property
    def content(self) -> str:
        """Hash over the values so far, as `ContentDigest` has it."""
        return total_of(self._titles, self._encoder.digests())


def _kind(field: pa.Field) -> str:
    if names_of(field):
        return "name"
    if pa.types.is_fixed_size_binary(field.type):
        return f"fixed {field.type.byte_width}"
    return _KINDS[field.type]


def _given(column: Column) -> tuple[Array, Mask | None, list[str]]:
    """A column as the encoder takes it, without a copy where it lies in one piece."""
    values, missing, texts = column
    if values.dtype == np.uint64:
        values = values.view(np.int64)
    if missing is not None:
        missing = np.ascontiguousarray(missing)
    return np.ascontiguousarray(values), missing, list(texts)


def _template(schema: pa.Schema) -> bytes:
    """A Parquet file without rows."""
    sink = io.BytesIO()
    pq.ParquetWriter(sink, schema).close()
    return sink.getvalue()
