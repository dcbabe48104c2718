"""Parquet files of one table: written once, whole and durable, and read with suspicion."""

import hashlib
import io
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from overtaking.core.errors import SchemaError
from overtaking.tables.arrow import column_to_numpy
from overtaking.tables.packed import Layout, PackedRows
from overtaking.tables.rows import Rows
from overtaking.tables.schemas import FORMAT, KEYS, SCHEMAS, VERSION

T = TypeVar("T")

LEAST_GROUP_BYTES = 4_000_000
"""Pieces wait for each other until a row group is this large: a column of a group costs the same
time whether it holds a hundred rows or ten thousand."""

LEAST_WRITE_BYTES = 1 << 20
"""Pages wait for each other until this much is written at a time."""

_FEW_VALUES = frozenset({"vehicle", "lane_id", "lights", "right_lane_id", "left_lane_id"})
"""Integers that take few values and rarely change: run lengths beat differences."""

_DENSE = frozenset({"states"})
"""The large table: of integers, and of differences that leave little to compress."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileFacts:
    """What is known of a file once it is written.

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
            path: Where; what is there is replaced.
            table: Name of one of the `SCHEMAS`.
            schema: What `schema_of` makes of it where not everything is known.

        Raises:
            OSError: The file cannot be created.
        """
        known = schema is None or schema is SCHEMAS[table]
        layout = _layout(table) if known else Layout.of(schema)
        self._waiting: list[Rows] = []
        self._file = _HashedFile(path)
        try:
            self._rows = PackedRows(
                self._file, layout, KEYS[table], _FEW_VALUES, compressed=table not in _DENSE
            )
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        """The writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; without `finish` it stays incomplete and is of no use."""
        self._waiting.clear()
        self._file.close()

    def write(self, piece: Rows | pa.Table) -> None:
        """Append a piece.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        rows = piece if isinstance(piece, Rows) else Rows.of(piece)
        if not rows.num_rows:
            return
        self._waiting.append(rows)
        if sum(each.nbytes for each in self._waiting) >= LEAST_GROUP_BYTES:
            self._write_group()

    def _write_group(self) -> None:
        """Write what waits as one row group."""
        if self._waiting:
            group = Rows.joined(self._waiting)
            self._waiting.clear()
            self._rows.append(group)

    @property
    def content(self) -> str:
        """Hash over the values so far, 64 hexadecimal digits."""
        self._write_group()
        return self._rows.content

    def finish(self, notes: dict[str, str] | None = None) -> FileFacts:
        """Complete the file and force it to the disk.

        Args:
            notes: Texts to keep in the file's metadata.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        self._write_group()
        self._rows.close(notes or {})
        self._file.settle()
        os.fsync(self._file.fileno())
        return FileFacts(
            rows=self._rows.num_rows,
            size_bytes=self._file.tell(),
            sha256=self._file.hexdigest(),
            content=self.content,
        )


@cache
def _layout(table: str) -> Layout:
    """The layout of a table of which everything is known, the same for every shard."""
    return Layout.of(SCHEMAS[table])


def sync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk, where the system knows how to."""
    if os.name == "nt":  # Windows cannot open folders.
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sha256_of(path: Path) -> str:
    """Hash over the bytes of a file, 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_table(path: Path, table: str) -> pa.Table:
    """All rows of a file.

    Args:
        path: The file.
        table: Name of one of the `SCHEMAS`.

    Raises:
        SchemaError: The file is missing, damaged, of another table or of a newer version.
    """
    return _read(path, lambda: _opened(path, table).read())


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
        rows = file.read_row_groups(groups)
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
    return {key.decode(): value.decode(errors="replace") for key, value in metadata.items()}


class _HashedFile(io.FileIO):
    """A file that hashes what is written to it, and never writes less than it was given.

    What is written in small parts, as pages of columns are, waits until there is more of it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "wb")
        self._hash = hashlib.sha256()
        self._waiting = bytearray()

    def write(self, data: Any, /) -> int:
        """Write all of `data`, now or with what comes next."""
        view = memoryview(data).cast("B")
        self._waiting += view
        if len(self._waiting) >= LEAST_WRITE_BYTES:
            self.settle()
        return len(view)

    def settle(self) -> None:
        """Write what waits; the system may take it in parts when the disk is almost full.

        Raises:
            OSError: The disk is full or the file cannot be written.
        """
        # Not `flush`, which closing calls: a file that is given up is not worth another error.
        whole, self._waiting = self._waiting, bytearray()
        self._hash.update(whole)
        view, done = memoryview(whole), 0
        while done < len(view):
            done += super().write(view[done:])

    def tell(self) -> int:
        """Number of bytes so far."""
        return super().tell() + len(self._waiting)

    def hexdigest(self) -> str:
        """Hash over what was written."""
        return self._hash.hexdigest()


def _read(path: Path, action: Callable[[], T]) -> T:
    """Do something with a file, and say in one line what is wrong with it if that fails."""
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
    version = int(metadata.get(b"version", b"0"))
    if version > VERSION:
        raise SchemaError.of(
            what=f"version of schema {name}",
            where=str(path),
            expected=f"at most {VERSION}",
            got=version,
            next_step="use the version of overtaking that wrote it, or a newer one",
        )


def _check_columns(path: Path, expected: pa.Schema, got: pa.Schema) -> None:
    for want, have in zip_fields(expected, got):
        if have is None or have.type != want.type:
            raise SchemaError.of(
                what=f"column {want.name}",
                where=str(path),
                expected=f"type {want.type}",
                got="no such column" if have is None else f"type {have.type}",
                next_step="restore the file from a copy, or generate the data set again",
            )


def zip_fields(expected: pa.Schema, got: pa.Schema) -> list[tuple[pa.Field, pa.Field | None]]:
    """Each expected field with the one of its name, or None."""
    names: Sequence[str] = got.names
    return [(field, got.field(field.name) if field.name in names else None) for field in expected]


def _overlaps(file: pq.ParquetFile, group: int, first: int, last: int) -> bool:
    """Whether a row group may hold keys between two numbers."""
    statistics = file.metadata.row_group(group).column(0).statistics
    if statistics is None or not statistics.has_min_max:
        return True
    return statistics.min <= last and statistics.max >= first
