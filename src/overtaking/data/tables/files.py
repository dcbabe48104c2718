"""Parquet files of one table: written once, whole and durable, and read with suspicion."""

import contextlib
import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Self, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from overtaking.core.errors import SchemaError
from overtaking.data.tables.arrow import column_to_numpy
from overtaking.data.tables.digest import ContentDigest
from overtaking.data.tables.schemas import FORMAT, KEYS, SCHEMAS, SINCE, VERSION

T = TypeVar("T")

LEAST_GROUP_BYTES = 4_000_000
"""Pieces wait for each other until a row group is this large: a column of a group costs the same
time whether it holds a hundred rows or ten thousand."""

_DENSE = frozenset({"states"})
"""The large table: of integers, and of differences that leave little to compress."""


_WIDENED = frozenset({("checks_blind_spot", pa.bool_())})
"""Columns that older versions hold in a narrower type: until version 3 a driver looked over the
shoulder always or never."""


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
        SchemaError: The file is missing, damaged, of another table or of a newer version.
    """
    return _read(path, lambda: _as_today(_opened(path, table).read(), table))


def num_rows(path: Path, table: str) -> int:
    """Number of rows of a file by its metadata; no row is decoded.

    Args:
        path: The file.
        table: Name of one of the `SCHEMAS`.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version.
    """
    return _read(path, lambda: _opened(path, table).metadata.num_rows)


def read_columns(path: Path, table: str, names: Sequence[str]) -> pa.Table:
    """Some columns of a file, all rows.

    Args:
        path: The file.
        table: Name of one of the `SCHEMAS`.
        names: Names of columns of that schema.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version.
    """
    schema = SCHEMAS[table]

    def read() -> pa.Table:
        file = _opened(path, table)
        there = [name for name in names if name in file.schema_arrow.names]
        found = file.read(columns=there)
        nothing = {name: pa.nulls(found.num_rows, schema.field(name).type) for name in names}
        return pa.table({name: found[name] if name in there else nothing[name] for name in names})

    return _read(path, read)


def read_rows(path: Path, table: str, first: int, last: int) -> pa.Table:
    """The rows whose first key lies between two numbers.

    Args:
        path: The file.
        table: Name of one of the `SCHEMAS`.
        first: Smallest number.
        last: Largest number.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version.
    """

    def read() -> pa.Table:
        file = _opened(path, table)
        groups = [
            group for group in range(file.num_row_groups) if _overlaps(file, group, first, last)
        ]
        rows = _as_today(file.read_row_groups(groups), table)
        key = column_to_numpy(rows[KEYS[table][0]])
        start, stop = key.searchsorted(first, "left"), key.searchsorted(last, "right")
        return rows.slice(start, stop - start)

    return _read(path, read)


def read_notes(path: Path, table: str) -> dict[str, str]:
    """The notes that a file was finished with, and whatever else its metadata holds.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version.
    """
    metadata = _read(path, lambda: _opened(path, table).metadata.metadata)
    # A damaged file may hold anything.
    texts = ((key.decode(errors="replace"), value) for key, value in metadata.items())
    return {key: value.decode(errors="replace") for key, value in texts}


def _read(path: Path, action: Callable[[], T]) -> T:
    """Run an action on a file; turn any failure into one `SchemaError`."""
    try:
        return action()
    except FileNotFoundError:
        got = "no such file"
    except (pa.ArrowException, OSError, UnicodeDecodeError, ValueError) as error:
        if isinstance(error, SchemaError):
            raise
        got = str(error)
    raise SchemaError.of(
        what="file",
        where=str(path),
        expected="a readable Parquet file",
        got=got,
        next_step="restore it from a copy, or generate the data set again",
    )


def _opened(path: Path, table: str) -> pq.ParquetFile:
    """A file whose schema can be read by this version."""
    file = pq.ParquetFile(path)
    _check_version(path, table, file.schema_arrow.metadata or {})
    _check_columns(path, SCHEMAS[table], file.schema_arrow)
    return file


def _as_today(rows: pa.Table, table: str) -> pa.Table:
    """Rows of any version with the types of this one."""
    for index, want in enumerate(SCHEMAS[table]):
        if want.name not in rows.schema.names:
            rows = rows.add_column(index, want, pa.nulls(rows.num_rows, want.type))
        elif (want.name, rows.schema.field(want.name).type) in _WIDENED:
            rows = rows.set_column(index, want, rows[want.name].cast(want.type))
    return rows


def _check_version(path: Path, table: str, metadata: dict[bytes, bytes]) -> None:
    name = metadata.get(b"schema", b"none").decode(errors="replace")
    if name != f"{FORMAT}.{table}":
        raise SchemaError.of(
            what="schema",
            where=str(path),
            expected=f"{FORMAT}.{table}",
            got=name,
            next_step="put the files of each table into the folder of its name",
        )
    version = _version(metadata)
    if version > VERSION:
        raise SchemaError.newer(f"version of schema {name}", str(path), VERSION, version)


def _version(metadata: dict[bytes, bytes]) -> int:
    return int(metadata.get(b"version", b"0"))


def _check_columns(path: Path, expected: pa.Schema, got: pa.Schema) -> None:
    for want in expected:
        have = got.field(want.name) if want.name in got.names else None
        if have is None and _version(got.metadata or {}) < SINCE.get(want.name, 0):
            continue  # It is null in older tables.
        if have is not None and (have.name, have.type) in _WIDENED:
            continue
        if have is None or have.type != want.type:
            raise SchemaError.of(
                what=f"column {want.name}",
                where=str(path),
                expected=f"type {want.type}",
                got="no such column" if have is None else f"type {have.type}",
                next_step="restore the file from a copy, or generate the data set again",
            )


def _overlaps(file: pq.ParquetFile, group: int, first: int, last: int) -> bool:
    """Whether a row group may hold keys between two numbers."""
    statistics = file.metadata.row_group(group).column(0).statistics
    if statistics is None or not statistics.has_min_max:
        return True
    return statistics.min <= last and statistics.max >= first
