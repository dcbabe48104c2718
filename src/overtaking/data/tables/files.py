"""Parquet files of one table: written once, whole and durable, and read with suspicion."""

import contextlib
import hashlib
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from io import BufferedIOBase
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from overtaking.core.arrays import Mask
from overtaking.core.errors import DatasetError, SchemaError
from overtaking.core.files import unreadable_error
from overtaking.data.tables.arrow import column_to_numpy, longest_text
from overtaking.data.tables.columns import codes, names_of
from overtaking.data.tables.digest import ContentDigest
from overtaking.data.tables.schemas import (
    FORMAT,
    KEYS,
    NEVER_NULL,
    SCHEMAS,
    VERSION,
)

T = TypeVar("T")

LEAST_GROUP_BYTES = 4_000_000
"""Pieces wait for each other until a row group is this large: a column of a group costs the same
time whether it holds a hundred rows or ten thousand."""

MOST_TEXT_BYTES = 4096
"""Longest text of a cell [bytes]; a file can repeat one text in any number of rows."""

MOST_EXPANSION, SMALL_BYTES = 1000, 1 << 26
"""Decoded rows may take so many times the size of their file, and always 64 MiB. Columns of long
simulations that never change reach 200 times."""

_DENSE = frozenset({"states"})
"""The large table: of integers, and of differences that leave little to compress."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileFacts:
    """Size and hashes of a finished file.

    Attributes:
        rows: Number of rows.
        size_bytes: Length of the file.
        sha256: Hash over the bytes, 64 hexadecimal digits.
        content: Hash over the values, whatever the encoding, 64 hexadecimal digits.
    """

    rows: int
    size_bytes: int
    sha256: str
    content: str


class TableWriter:
    """Writes one file piece by piece; pieces become row groups, small ones together.

    Used as a context manager, it closes the file in any case; `finish` alone makes it complete.
    """

    def __init__(self, path: Path, table: str, schema: pa.Schema | None = None) -> None:
        """Create the file.

        Args:
            path: Where; an existing file is replaced.
            table: Name of one of the `SCHEMAS`.
            schema: From `schema_of`, for recordings that do not tell everything.

        Raises:
            OSError: The file cannot be created.
        """
        self._path, self._digest = path, ContentDigest(schema or SCHEMAS[table])
        self._waiting: list[pa.Table] = []
        self._waiting_bytes = 0
        self._rows = _parquet_writer(path, table, schema or SCHEMAS[table])

    def __enter__(self) -> Self:
        """The writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file; without `finish` it stays incomplete and is of no use."""
        self._waiting.clear()
        with contextlib.suppress(OSError):  # On a full disk the footer does not fit either.
            self._rows.close()

    def write(self, piece: pa.Table) -> None:
        """Append a piece.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        self._digest.update(piece)
        self._waiting.append(piece)
        self._waiting_bytes += piece.nbytes  # Counted once: it takes long for many columns.
        if self._waiting_bytes >= LEAST_GROUP_BYTES:
            self._write_group()

    def _write_group(self) -> None:
        """Write the waiting pieces as one row group."""
        group = pa.concat_tables(self._waiting)
        self._waiting.clear()
        self._waiting_bytes = 0
        if group.num_rows:
            self._rows.write_table(group, row_group_size=group.num_rows)

    @property
    def content(self) -> str:
        """Hash over the values so far, 64 hexadecimal digits."""
        return self._digest.hexdigest()

    def finish(self, notes: dict[str, str] | None = None) -> FileFacts:
        """Complete the file and force it to the disk.

        Args:
            notes: Texts to keep in the file's metadata.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        if self._waiting:
            self._write_group()
        self._rows.add_key_value_metadata(notes or {})
        self._rows.close()
        with self._path.open("rb") as file:
            os.fsync(file.fileno())
        return facts_of(self._path, self._digest.num_rows, self.content)


def _parquet_writer(path: Path, table: str, schema: pa.Schema) -> pq.ParquetWriter:
    """A writer with the encodings that suit our columns.

    Integers change little from row to row, so their differences take few bits. Names and texts
    repeat. Floats rarely repeat: a dictionary of them costs time and saves nothing.
    """
    return pq.ParquetWriter(path, schema, **_options(table))


@cache
def _options(table: str) -> dict[str, Any]:
    """What a writer is told about the columns of a table."""
    schema, keys = SCHEMAS[table], [(name, "ascending") for name in KEYS[table]]
    integers = [field.name for field in schema if pa.types.is_integer(field.type)]
    repeated = [
        field.name
        for field in schema
        if pa.types.is_dictionary(field.type) or pa.types.is_string(field.type)
    ]
    return {
        "use_dictionary": repeated,
        "column_encoding": dict.fromkeys(integers, "DELTA_BINARY_PACKED"),
        "compression": "none" if table in _DENSE else "zstd",
        "compression_level": None if table in _DENSE else 1,
        "write_statistics": KEYS[table],
        "sorting_columns": pq.SortingColumn.from_ordering(schema, keys),
    }


def facts_of(path: Path, rows: int, content: str) -> FileFacts:
    """Size and hashes of a file whose rows, and the hash over them, are known."""
    with path.open("rb") as file:
        size, sha256 = os.fstat(file.fileno()).st_size, hashlib.file_digest(file, "sha256")
    return FileFacts(rows=rows, size_bytes=size, sha256=sha256.hexdigest(), content=content)


def read_table(path: Path, table: str) -> pa.Table:
    """All rows of a file.

    Args:
        path: The file.
        table: Name of one of the `SCHEMAS`.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version, or has a
            cell that the table cannot hold.
    """
    return _read(path, lambda: _checked_rows(path, table, _open_parquet(path, table).read()))


def check_footer(path: Path, table: str) -> int:
    """As `footer_rows`, of a file that may be missing or damaged.

    Raises:
        SchemaError: As `footer_rows`; or the file is missing or damaged.
    """
    return _read(path, lambda: footer_rows(path, str(path), table))


def footer_rows(source: Path | BufferedIOBase, where: str, table: str) -> int:
    """Check version, columns and stated size of a file by its metadata; no row is decoded.

    Args:
        source: The file, or its bytes.
        where: Name of the file in messages.
        table: Name of one of the `SCHEMAS`.

    Returns:
        The number of its rows.

    Raises:
        SchemaError: It is of another table or of a newer version, lacks a column, or its rows would
            take far more memory than its size lets expect.
        OSError: It is no Parquet file. Arrow has errors of its own for this, too.
    """
    file = _open_parquet(source, table, where)
    is_path = isinstance(source, Path)
    file_bytes = source.stat().st_size if is_path else source.seek(0, os.SEEK_END)
    row_bytes = sum(_cell_bytes(field.type) for field in file.schema_arrow)
    groups = range(file.num_row_groups)
    page_bytes = sum(file.metadata.row_group(index).total_byte_size for index in groups)
    most = max(MOST_EXPANSION * file_bytes, SMALL_BYTES)
    num_rows = file.metadata.num_rows
    if max(row_bytes * num_rows, page_bytes) > most:
        raise _refused(
            where,
            f"size of table {table}",
            f"at most {most >> 20} MiB of rows in a file of {file_bytes} bytes",
            f"{num_rows} rows",
        )
    return num_rows


def read_columns(path: Path, table: str, names: Sequence[str]) -> pa.Table:
    """Some columns of a file, all rows.

    Args:
        path: The file.
        table: Name of one of the `SCHEMAS`.
        names: Names of columns of that schema.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version, or has a
            cell that the table cannot hold.
    """

    def read() -> pa.Table:
        file = _open_parquet(path, table)
        in_file = [name for name in names if name in file.schema_arrow.names]
        return _checked_rows(path, table, file.read(columns=in_file), names)

    return _read(path, read)


def read_rows(path: Path, table: str, first: int, last: int) -> pa.Table:
    """The rows whose first key lies between two numbers.

    Args:
        path: The file.
        table: Name of one of the `SCHEMAS`.
        first: Smallest number.
        last: Largest number.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version, or has a
            cell that the table cannot hold.
    """

    def read() -> pa.Table:
        file = _open_parquet(path, table)
        groups = [
            group
            for group in range(file.num_row_groups)
            if _overlaps(file, group, KEYS[table][0], first, last)
        ]
        rows = _checked_rows(path, table, file.read_row_groups(groups))
        key = column_to_numpy(rows[KEYS[table][0]])
        start, stop = key.searchsorted(first, "left"), key.searchsorted(last, "right")
        return rows.slice(start, stop - start)

    return _read(path, read)


def read_notes(path: Path, table: str) -> dict[str, str]:
    """The notes that a file was finished with, and whatever else its metadata holds.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version.
    """
    metadata = _read(path, lambda: _open_parquet(path, table).metadata.metadata)
    # A damaged file may hold anything.
    texts = ((key.decode(errors="replace"), value) for key, value in metadata.items())
    return {key: value.decode(errors="replace") for key, value in texts}


def _read(where: Path | str, action: Callable[[], T]) -> T:
    """Run an action on a file; turn each failure into an error with a next step.

    Raises:
        SchemaError: The file is missing or damaged.
        DatasetError: The system does not let this process read it.
        SystemLimitError: The system lacks memory, threads or open files.
    """
    try:
        return action()
    except FileNotFoundError:
        got = "no such file"
    except SchemaError:
        raise
    except (pa.ArrowException, OSError, MemoryError, ValueError, RuntimeError) as error:
        if (unreadable := unreadable_error(error, str(where), DatasetError)) is not None:
            raise unreadable from error
        if isinstance(error, RuntimeError):
            raise
        got = str(error)
    raise SchemaError(
        what="file",
        where=str(where),
        expected="a readable Parquet file",
        got=got,
        next_step=_RESTORE,
    )


_RESTORE = "restore the file from a copy, or generate the data set again"


def _refused(where: Path | str, what: str, expected: str, got: object) -> SchemaError:
    """The error for a file with contents that its table cannot have."""
    return SchemaError(what=what, where=str(where), expected=expected, got=got, next_step=_RESTORE)


def _open_parquet(source: Path | BufferedIOBase, table: str, where: str = "") -> pq.ParquetFile:
    """A file whose schema can be read by this version; texts are read as dictionaries."""
    where = where or str(source)
    if isinstance(source, Path):
        source = pa.OSFile(os.fsencode(source))  # Arrow takes names that are not UTF-8 as bytes.
    metadata = pq.read_metadata(source)
    schema = metadata.schema.to_arrow_schema()
    _check_version(where, table, schema.metadata or {})
    _check_columns(where, SCHEMAS[table], schema)
    # A text that a file stores once would otherwise be repeated in memory for each of its rows.
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    return pq.ParquetFile(source, metadata=metadata, read_dictionary=texts)


def _cell_bytes(kind: pa.DataType) -> int:
    """Memory of a cell, of a text or a name that of its index [bytes]."""
    if pa.types.is_dictionary(kind):
        kind = kind.index_type
    return max(1, kind.bit_width // 8)


def _checked_rows(
    path: Path, table: str, rows: pa.Table, names: Sequence[str] | None = None
) -> pa.Table:
    """Rows with the types of their table, refused where a cell is impossible.

    Args:
        path: The file, for messages.
        table: Name of the table.
        rows: The rows as they are in the file.
        names: Names of the columns of the result; all of the table if left out.

    Returns:
        The columns in the order of `names`, with the types and metadata of the table.

    Raises:
        SchemaError: A cell is null that must not be, an unknown name, or a text that is too long;
            or the keys do not increase from row to row.
    """
    schema = SCHEMAS[table]
    wanted = schema.names if names is None else list(dict.fromkeys(names))
    arrays: list[pa.ChunkedArray] = []
    fields: list[pa.Field] = []
    for name in wanted:
        field = schema.field(name)
        arrays.append(_checked_column(path, table, field, rows[name]))
        # Recordings allow nulls in columns that simulations always fill.
        is_nullable = field.nullable or rows.schema.field(name).nullable
        fields.append(field.with_nullable(is_nullable))
    checked = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=schema.metadata))
    if set(KEYS[table]) <= set(wanted) and not (is_rising := _rise(checked, table)).all():
        key = ", ".join(KEYS[table])
        row_index = int(np.argmin(is_rising)) + 1
        raise _refused(path, f"row {row_index}", f"keys ({key}) that increase", "a smaller key")
    return checked


def _checked_column(
    path: Path, table: str, field: pa.Field, column: pa.ChunkedArray
) -> pa.ChunkedArray:
    """A column with the type of its table."""
    what = f"column {field.name}"
    if column.null_count and field.name in NEVER_NULL[table]:
        raise _refused(path, what, "a value in every row", f"{column.null_count} nulls")
    if pa.types.is_dictionary(column.type):
        column.validate(full=True)  # Parquet checks neither indices nor that texts are UTF-8.
        for chunk in column.chunks:
            longest = longest_text(chunk.dictionary)
            if longest > MOST_TEXT_BYTES:
                raise _refused(path, what, f"texts of at most {MOST_TEXT_BYTES} bytes", longest)
    if listed := names_of(field):
        for chunk in column.chunks:
            unknown = sorted(set(map(str, chunk.dictionary.to_pylist())) - set(listed))
            if unknown:
                raise _refused(path, what, f"one of {', '.join(listed)}", unknown[0])
        return column
    return column if column.type == field.type else column.cast(field.type)


def _rise(rows: pa.Table, table: str) -> Mask:
    """Whether the keys of each row but the first are larger than those of the row before."""
    is_larger = np.zeros(max(0, rows.num_rows - 1), dtype=np.bool_)
    is_equal = ~is_larger
    for name in KEYS[table]:
        key = _key(rows, table, name)
        is_larger |= is_equal & (key[1:] > key[:-1])
        is_equal &= key[1:] == key[:-1]
    return is_larger


def _key(rows: pa.Table, table: str, name: str) -> NDArray[Any]:
    """The values of a key by which rows are sorted; names are sorted by their codes."""
    listed = names_of(SCHEMAS[table].field(name))
    return codes(rows[name], listed) if listed else column_to_numpy(rows[name])


def _check_version(where: str, table: str, metadata: dict[bytes, bytes]) -> None:
    name = metadata.get(b"schema", b"none").decode(errors="replace")
    if name != f"{FORMAT}.{table}":
        raise SchemaError(
            what="schema",
            where=where,
            expected=f"{FORMAT}.{table}",
            got=name,
            next_step="put the files of each table into the folder of its name",
        )
    if not re.fullmatch(rb"\d{1,9}", metadata.get(b"version", b"0")):
        raise _refused(where, f"version of schema {name}", "a number", metadata[b"version"])
    version = int(metadata.get(b"version", b"0"))
    if version > VERSION:
        raise SchemaError.newer_version(
            what=f"version of schema {name}", where=where, newest=VERSION, got=version
        )
    if version < VERSION:
        raise _refused(where, f"version of schema {name}", str(VERSION), version)


def _check_columns(where: str, expected: pa.Schema, got: pa.Schema) -> None:
    for want in expected:
        fields = [field for field in got if field.name == want.name]
        types = [field.type for field in fields]
        if types == [want.type]:
            continue
        got_types = "no such column" if not types else f"type {' and '.join(map(str, types))}"
        raise _refused(where, f"column {want.name}", f"type {want.type}", got_types)


def _overlaps(file: pq.ParquetFile, group: int, key: str, first: int, last: int) -> bool:
    """Whether a row group may hold keys between two numbers."""
    statistics = (
        file.metadata.row_group(group).column(file.schema_arrow.names.index(key)).statistics
    )
    if statistics is None or not statistics.has_min_max:
        return True
    return statistics.min <= last and statistics.max >= first
