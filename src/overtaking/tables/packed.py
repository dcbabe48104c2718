"""Rows of recorded integers as Parquet, encoded by compiled code.

The format is Parquet's, as any reader knows it; `crates/overtaking-tables` says how a column is
encoded. Schema and metadata of a file are those that pyarrow would write.
"""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from overtaking import _core
from overtaking.tables.arrow import Array, missing_in, to_numpy
from overtaking.tables.columns import names_of, short_codes
from overtaking.tables.digest import total_of


class PackedRows:
    """Encodes a table of integers piece by piece; each piece becomes a row group."""

    def __init__(
        self, file: io.RawIOBase, schema: pa.Schema, keys: Sequence[str], few: frozenset[str]
    ) -> None:
        """Begin a file.

        Args:
            file: Where the bytes go.
            schema: Columns of integers of 8 to 64 bits and of names; nulls only among `few`.
            keys: Columns that the rows are sorted by.
            few: Columns that take few values and rarely change: run lengths beat differences.

        Raises:
            OSError: The file cannot be written.
        """
        self._file = file
        self._schema = schema
        self._keys = keys
        self._few = few
        places = [schema.get_field_index(key) for key in keys]
        self._encoder = _core.ParquetFile(_template(schema), places)
        self.num_rows = 0

    def append(self, table: pa.Table) -> None:
        """Append some rows.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        self.num_rows += table.num_rows
        columns = [self._column(field, table.column(field.name)) for field in self._schema]
        self._file.write(self._encoder.append(columns))

    def close(self, notes: Mapping[str, str]) -> None:
        """Complete the file.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        self._file.write(self._encoder.finish(list(notes.items())))

    def abandon(self) -> None:
        """Leave the file as it is: incomplete, and of no use."""

    @property
    def content(self) -> str:
        """Hash over the values so far, as `ContentDigest` has it."""
        return total_of(self._schema, self._encoder.digests())

    def _column(self, field: pa.Field, column: pa.ChunkedArray) -> dict[str, Any]:
        """A column as the encoder takes it, without a copy where it is in one piece."""
        chunk = column.chunk(0) if column.num_chunks == 1 else column.combine_chunks()
        names = names_of(field)
        return {
            "values": _values(chunk, names),
            "missing": missing_in(chunk) if field.nullable else None,
            "names": list(names),
            "is_key": field.name in self._keys,
            "is_few": field.name in self._few,
        }


def _values(chunk: pa.Array, names: tuple[str, ...]) -> Array:
    """The numbers of a column, or the codes of its names."""
    return short_codes(chunk, names) if names else to_numpy(chunk)


def _template(schema: pa.Schema) -> bytes:
    """A Parquet file without rows."""
    sink = io.BytesIO()
    pq.ParquetWriter(sink, schema).close()
    return sink.getvalue()
