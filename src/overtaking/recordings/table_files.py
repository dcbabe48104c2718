"""Tables of recordings, CSV, Parquet or Arrow: bounded in size, every cell checked."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

import csv
import re
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.ipc as ipc
import pyarrow.parquet as pq

from overtaking.core.errors import ImportFormatError
from overtaking.recordings import messages
from overtaking.recordings.messages import shown

MAX_BYTES = 1 << 31
"""Larger files are refused; the largest of highD has some 200 MB, NGSIM's of all sites 1.5 GB."""

MAX_MAGNITUDE = 1.0e6
"""No metre, second or number of a frame in half an hour of a motorway is larger."""

_MAX_EXPANSION, _SMALL_BYTES = 100, 1 << 24
"""Cells of a compressed file may take so many times its size, and always 16 MB: a few bytes can
stand for any number of rows."""

ARROW_SUFFIXES = (".arrow", ".arrows", ".feather")
_ARROW_FILE_MAGIC = b"ARROW1"  # Files begin with it, streams do not.
_CELL_BYTES = 8  # A number in memory, whatever its encoding in the file.

_MAX_LINE = 1 << 16
TEXT, NUMBER, WHOLE = pa.string(), pa.float64(), pa.int64()
Types = Mapping[str, pa.DataType]


def read_columns(
    path: Path,
    columns: Types,
    *,
    header: Sequence[str] = (),
    limits: Mapping[str, float] | None = None,
) -> pa.Table:
    """Some columns of a CSV, Parquet or Arrow file.

    Args:
        path: The file. The ending of its name is its format: `.parquet`; one of `ARROW_SUFFIXES`;
            any other is CSV.
        columns: Types of the wanted columns by name; the file may have more. A name in other
            letters, capital or small, is the same if no other column has it.
        header: Names of all columns of a text file that has none, with blanks between the cells.
        limits: Largest size of the numbers of some columns; `MAX_MAGNITUDE` for the others.

    Returns:
        A table with the columns in that order, without nulls, and with finite numbers only.

    Raises:
        ImportFormatError: The file is missing, too large, lacks a column, or has a cell that is no
            such value; the message names column and line.
    """
    if path.suffix == ".parquet":
        return checked_table(_parquet(path, columns), columns, path.name, limits)
    if path.suffix in ARROW_SUFFIXES:
        return checked_table(_read_arrow(path, columns), columns, path.name, limits)
    names = _header(path)
    if header and not any(one.strip()[:1].isalpha() for one in names):
        return checked_table(_headless(path, columns, header), columns, path.name, limits)
    found = named(names, columns, path.name)
    table = _csv(path, {found[name]: kind for name, kind in columns.items()})
    return checked_table(table.rename_columns(list(columns)), columns, path.name, limits)


def checked_table(
    table: pa.Table, columns: Types, where: str, limits: Mapping[str, float] | None = None
) -> pa.Table:
    """A table with the wanted columns, refused where a cell is no such value.

    Args:
        table: The table.
        columns: Types of its columns.
        where: What it is called in a message.
        limits: As in `read_columns`.
    """
    if not table.num_rows:
        raise refused(where, "table", "at least one row", "none")
    arrays = [_of_type(table[name], name, kind, where) for name, kind in columns.items()]
    for (name, kind), array in zip(columns.items(), arrays, strict=True):
        if kind != TEXT:
            _check_numbers(where, name, array, (limits or {}).get(name, MAX_MAGNITUDE))
    return pa.Table.from_arrays(arrays, names=list(columns))


def named(names: Sequence[str], wanted: Iterable[str], where: str) -> dict[str, str]:
    """The columns of a table that are meant by some names."""
    found: dict[str, str] = {}
    for name in wanted:
        exact = [one for one in names if one == name]
        same = exact or [one for one in names if one.strip().casefold() == name.casefold()]
        if len(same) != 1:
            got = f"{len(same)} of them" if same else "none"
            raise refused(where, "line 1", f"a column {name}", got)
        found[name] = same[0]
    return found


def refused(where: Path | str, what: str, expected: str, got: str) -> ImportFormatError:
    """The error for a file that is not what it should be."""
    next_step = "use the files as their owners distribute them, or correct the map of columns"
    place = shown(where.name if isinstance(where, Path) else where, length=80)
    return messages.refused(place, what, expected, shown(got, length=150), next_step)


def refused_cell(
    where: Path | str, row: int, name: str, expected: str, got: str
) -> ImportFormatError:
    """The error for one cell.

    Args:
        where: The file.
        row: Row of the table, from 0.
        name: Name of the column.
        expected: What would have been right.
        got: What was there.
    """
    return refused(where, f"line {row + 2}, column {name}", expected, got)


def column_names(path: Path) -> tuple[str, ...]:
    """The columns of a file."""
    if path.suffix == ".parquet":
        return tuple(_parquet_file(path).schema_arrow.names)
    if path.suffix in ARROW_SUFFIXES:
        with _open_arrow(path) as reader:
            return tuple(reader.schema.names)
    return tuple(_header(path))


def _header(path: Path) -> list[str]:
    """The cells of the first line of a plain file of bounded size."""
    try:
        size = path.stat().st_size if path.is_file() else -1
        with path.open("rb") as file:
            line = file.readline(_MAX_LINE)
        names = next(csv.reader([line.decode("utf-8-sig")]), [])
    except (OSError, ValueError, csv.Error) as error:
        got = error.strerror if isinstance(error, OSError) else "bytes that are no UTF-8"
        raise refused(path, "file", "a readable CSV file", str(got)) from None
    if not 0 <= size <= MAX_BYTES:
        raise refused(path, "file", f"a plain one of at most {MAX_BYTES} bytes", f"{size} bytes")
    return names


def _csv(source: Any, columns: Types, *, where: Path | None = None, **reading: Any) -> pa.Table:
    """Some columns of a text with commas between the cells.

    Args:
        source: The file, or an Arrow buffer.
        columns: Types of the columns by name.
        where: The file, if the source is none.
        reading: Further options of Arrow.
    """
    try:
        return pacsv.read_csv(
            source,
            # One thread, because only then Arrow knows the number of a bad row.
            read_options=pacsv.ReadOptions(use_threads=False, block_size=1 << 22, **reading),
            parse_options=pacsv.ParseOptions(ignore_empty_lines=False),
            convert_options=pacsv.ConvertOptions(
                include_columns=list(columns),
                column_types=dict(columns),
                strings_can_be_null=False,
            ),
        )
    except (pa.ArrowException, UnicodeDecodeError) as error:
        raise refused(where or source, _place_of(error), "rows of a table", str(error)) from None


def _headless(path: Path, columns: Types, header: Sequence[str]) -> pa.Table:
    """Some columns of a text without names, with blanks between the cells."""
    text = re.sub(rb"[ \t]+", b",", re.sub(rb"(?m)^[ \t]+|[ \t\r]+$", b"", path.read_bytes()))
    buffer = pa.BufferReader(text)
    return _csv(buffer, columns, where=path, column_names=list(header))


def _parquet_file(path: Path) -> Any:
    """A Parquet file, open."""
    try:
        if not path.is_file():
            raise refused(path, "file", "a readable Parquet file", "no plain file")
        return pq.ParquetFile(path)
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise refused(path, "file", "a readable Parquet file", str(error)) from None


def _parquet(path: Path, columns: Types) -> pa.Table:
    """Some columns of a Parquet file."""
    file = _parquet_file(path)
    found = named(file.schema_arrow.names, columns, path.name)
    most = _max_cell_bytes(path)
    about = file.metadata
    pages = sum(about.row_group(k).total_byte_size for k in range(about.num_row_groups))
    if max(pages, _CELL_BYTES * len(columns) * about.num_rows) > most:
        raise _too_many_cells(path, most, about.num_rows)
    try:
        table = file.read(columns=list(found.values()))
        table.validate(full=True)
    except (pa.ArrowException, OSError) as error:
        raise refused(path, "file", "a readable Parquet file", str(error)) from None
    return table.select(list(found.values())).rename_columns(list(found))


@contextmanager
def _open_arrow(path: Path, columns: Sequence[int] | None = None) -> Generator[Any]:
    """A reader of an Arrow IPC file or stream.

    Args:
        path: The file.
        columns: Indices of the columns to read; all if None.

    Raises:
        ImportFormatError: The file is not readable, also while the caller reads from it.
    """
    options = ipc.IpcReadOptions(included_fields=None if columns is None else list(columns))
    expected = "a readable Arrow file (Feather of version 2)"
    try:
        if not path.is_file():
            raise refused(path, "file", expected, "no plain file")
        # No memory map: another process that shortens the file would end this one by SIGBUS.
        with pa.OSFile(str(path)) as file:
            is_stream = file.read(len(_ARROW_FILE_MAGIC)) != _ARROW_FILE_MAGIC
            file.seek(0)
            opened = ipc.open_stream if is_stream else ipc.open_file
            with opened(file, options=options) as reader:
                yield reader
    except (pa.ArrowException, OSError, UnicodeDecodeError, KeyError) as error:
        raise refused(path, "file", expected, str(error)) from None


def _read_arrow(path: Path, columns: Types) -> pa.Table:
    """Some columns of an Arrow IPC file or stream."""
    most = _max_cell_bytes(path)
    with _open_arrow(path) as reader:
        schema = reader.schema
        names = named(schema.names, columns, path.name)
    indices = [schema.get_field_index(name) for name in names.values()]
    for field in map(schema.field, indices):
        # Cells of other types, such as run-end encoded ones, take any number of bytes when cast.
        kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
        if pa.types.is_nested(kind) or not (pa.types.is_primitive(kind) or _is_text(kind)):
            raise refused(path, f"column {field.name}", "cells of numbers or text", str(field.type))
    batches: list[pa.RecordBatch] = []
    num_rows = num_bytes = 0
    with _open_arrow(path, indices) as reader:
        if isinstance(reader, ipc.RecordBatchFileReader):
            # Known before anything is decompressed; a stream has no such count.
            if _CELL_BYTES * len(columns) * reader.count_rows() > most:
                raise _too_many_cells(path, most, reader.count_rows())
            source = map(reader.get_batch, range(reader.num_record_batches))
        else:
            source = reader
        for batch in source:
            batch.validate(full=True)
            batches.append(batch)
            num_rows += batch.num_rows
            num_bytes += sum(map(_decoded_bytes, batch.columns))
            if num_bytes > most:
                raise _too_many_cells(path, most, num_rows)
        read_schema = batches[0].schema if batches else reader.schema
    table = pa.Table.from_batches(batches, read_schema)
    return table.select(list(names.values())).rename_columns(list(names))


def _is_text(kind: pa.DataType) -> bool:
    return pa.types.is_string(kind) or pa.types.is_large_string(kind) or kind == pa.string_view()


def _decoded_bytes(column: pa.Array) -> int:
    """Memory of a column with every cell on its own, not as an index of a dictionary [bytes]."""
    cells = max(column.nbytes, _CELL_BYTES * len(column))
    if pa.types.is_dictionary(column.type) and _is_text(column.type.value_type):
        longest = pc.max(pc.binary_length(column.dictionary.cast(TEXT))).as_py() or 0
        cells = max(cells, longest * len(column))
    return cells


def _max_cell_bytes(path: Path) -> int:
    """Memory that the cells of a compressed file may take [bytes]."""
    return min(max(_MAX_EXPANSION * path.stat().st_size, _SMALL_BYTES), MAX_BYTES)


def _too_many_cells(path: Path, most: int, num_rows: int) -> ImportFormatError:
    return refused(path, "file", f"at most {most >> 20} MB of cells", f"{num_rows} rows")


def _of_type(column: pa.ChunkedArray, name: str, kind: pa.DataType, where: str) -> pa.ChunkedArray:
    """A column of one type, refused if its cells are of another."""
    try:
        return column.cast(kind)
    except (pa.ArrowException, UnicodeDecodeError) as error:
        raise refused(where, f"column {name}", f"cells of type {kind}", str(error)) from None


def _place_of(error: Exception) -> str:
    """The line that an error of Arrow's is about, which counts rows from the header on."""
    found = re.search(r"[Rr]ow #(\d+)", str(error))
    return f"line {found.group(1)}" if found else "table"


def _check_numbers(where: str, name: str, column: pa.ChunkedArray, most: float) -> None:
    """Refuse what is missing, not finite, or larger than anything in a recording."""
    # An integer beyond 2**53 loses digits here; it is far beyond every limit all the same.
    sizes = pc.abs(pc.fill_null(column.cast(NUMBER, safe=False), np.nan))
    wrong = pc.index(pc.fill_null(pc.less_equal(sizes, most), False), False).as_py()
    if wrong >= 0:
        got = "an empty cell" if not column[wrong].is_valid else str(column[wrong].as_py())
        raise refused_cell(where, wrong, name, f"a number of size at most {most:g}", got)
