"""Tables of recordings, CSV, Parquet or Arrow: bounded in size, every cell checked."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

import os
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.ipc as ipc
import pyarrow.parquet as pq

from overtaking.core.errors import ImportFormatError
from overtaking.recordings.column_request import NUMBER, TEXT, ColumnRequest, ReadTable, RowPlaces
from overtaking.recordings.reading_progress import is_counting, report_share
from overtaking.recordings.table_cells import (
    check_table,
    decimal_mark,
    has_thousands,
    is_text,
    numbers_without_thousands,
)
from overtaking.recordings.table_csv import csv_column_names, read_csv
from overtaking.recordings.table_errors import refused, unreadable
from overtaking.recordings.table_streams import max_cell_bytes

PARQUET_SUFFIXES = (".parquet", ".pq")
ARROW_SUFFIXES = (".arrow", ".arrows", ".feather")
_ARROW_FILE_MAGIC = b"ARROW1"  # Arrow files begin with these bytes, Arrow streams do not.
_CELL_BYTES = 8  # Size of a number in memory, which does not depend on its encoding in the file.

SMALL_UNITS = ("mm", "cm")
"""Whole numbers of these units have separators of thousands that look like decimal marks."""


def read_columns(path: Path, request: ColumnRequest) -> ReadTable:
    """Some columns of a CSV, Parquet or Arrow file.

    Args:
        path: The file. The ending of its name is its format: one of `PARQUET_SUFFIXES`; one of
            `ARROW_SUFFIXES`; any other is CSV, compressed or not.
        request: The columns; the file may have more.

    Raises:
        ImportFormatError: The file is missing, too large, lacks a column, or has a cell that is no
            such value; the message names column and line.
    """
    if path.suffix.lower() in PARQUET_SUFFIXES:
        return checked_table(_parquet(path, request), request, path.name)
    if path.suffix.lower() in ARROW_SUFFIXES:
        return checked_table(_read_arrow(path, request), request, path.name)
    numbers = [name for name, kind in request.types.items() if kind == NUMBER]
    if request.thousands is None:
        numbers = [name for name in numbers if request.units.get(name) in SMALL_UNITS]
    elif request.thousands == "none":
        numbers = []
    content = read_csv(path, request, numbers)
    return checked_table(content.table, request, path.name, content.places, content.decimal)


def checked_table(
    table: pa.Table,
    request: ColumnRequest,
    where: str,
    places: RowPlaces | None = None,
    decimal: str | None = None,
) -> ReadTable:
    """A table with the wanted columns; raises an error for a cell of another type.

    Args:
        table: The table, with the names of the request.
        request: The columns.
        where: What it is called in a message.
        places: Where its rows are.
        decimal: The decimal mark of numbers that are texts; detected if None.
    """
    grouped: dict[str, str] = {}
    texts = {
        name: table[name].cast(TEXT)
        for name in table.column_names
        if request.types[name] == NUMBER and is_text(table[name].type)
    }
    decimal = decimal or decimal_mark(texts.values())
    small = [name for name in texts if request.units.get(name) in SMALL_UNITS]
    if request.thousands is None:
        examples = {name: has_thousands(texts[name], decimal) for name in small}
        grouped = {name: example for name, example in examples.items() if example is not None}
    columns = numbers_without_thousands(texts, request.thousands, decimal, small)
    for name, column in columns.items():
        table = table.set_column(table.column_names.index(name), name, column)
    places = places or RowPlaces()
    return ReadTable(check_table(table, request, where, places), places, grouped)


def column_names(path: Path) -> tuple[str, ...]:
    """The columns of a file."""
    if path.suffix.lower() in PARQUET_SUFFIXES:
        return tuple(_parquet_file(path).schema_arrow.names)
    if path.suffix.lower() in ARROW_SUFFIXES:
        with _open_arrow(path) as (reader, _):
            return tuple(reader.schema.names)
    return csv_column_names(path)


def _parquet_file(path: Path) -> Any:
    """A Parquet file, open."""
    try:
        if not path.is_file():
            raise refused(path, "file", "a readable Parquet file", "no plain file")
        return pq.ParquetFile(pa.OSFile(os.fsencode(path)))
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise unreadable(path, "a readable Parquet file", error) from None


def _parquet(path: Path, request: ColumnRequest) -> pa.Table:
    """Some columns of a Parquet file."""
    file = _parquet_file(path)
    names = request.match(file.schema_arrow.names, path.name, _index_names(file.schema_arrow))
    most = max_cell_bytes(path)
    about = file.metadata
    pages = sum(about.row_group(k).total_byte_size for k in range(about.num_row_groups))
    if max(pages, _CELL_BYTES * request.num_columns * about.num_rows) > most:
        raise _too_many_cells(path, most, about.num_rows)
    try:
        table = _read_row_groups(path, file, list(names.values()))
        table.validate(full=True)
    except (pa.ArrowException, OSError) as error:
        raise unreadable(path, "a readable Parquet file", error) from None
    return table.select(list(names.values())).rename_columns(list(names))


def _read_row_groups(path: Path, file: Any, columns: list[str]) -> pa.Table:
    """Some columns of an open Parquet file, with a report after each group of rows."""
    if not is_counting():  # Reading all groups at once takes 5 % less memory.
        return file.read(columns=columns)
    tables: list[pa.Table] = []
    for number in range(file.num_row_groups):
        tables.append(file.read_row_group(number, columns=columns))
        report_share(path, "table", (number + 1) / file.num_row_groups)
    return pa.concat_tables(tables) if tables else file.read(columns=columns)


@contextmanager
def _open_arrow(path: Path, columns: Sequence[int] | None = None) -> Generator[Any]:
    """A reader of an Arrow IPC file or stream, and its bytes.

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
        with pa.OSFile(os.fsencode(path)) as file:
            is_stream = file.read(len(_ARROW_FILE_MAGIC)) != _ARROW_FILE_MAGIC
            file.seek(0)
            opened = ipc.open_stream if is_stream else ipc.open_file
            with opened(file, options=options) as reader:
                yield reader, file
    # Damaged names of columns are a UnicodeDecodeError or KeyError.
    except (pa.ArrowException, OSError, UnicodeDecodeError, KeyError) as error:
        raise unreadable(path, expected, error) from None


def _read_arrow(path: Path, request: ColumnRequest) -> pa.Table:
    """Some columns of an Arrow IPC file or stream."""
    most = max_cell_bytes(path)
    with _open_arrow(path) as (reader, _):
        schema = reader.schema
        names = request.match(schema.names, path.name, _index_names(schema))
    indices = [schema.get_field_index(name) for name in names.values()]
    for field in map(schema.field, indices):
        # Cells of other types, such as run-end encoded ones, take any number of bytes when cast.
        kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
        if pa.types.is_nested(kind) or not (pa.types.is_primitive(kind) or is_text(kind)):
            raise refused(path, f"column {field.name}", "cells of numbers or text", str(field.type))
    batches: list[pa.RecordBatch] = []
    num_rows = num_bytes = 0
    with _open_arrow(path, indices) as (reader, file):
        # A file states its number of rows before cells are decompressed; a stream does not.
        is_file = isinstance(reader, ipc.RecordBatchFileReader)
        if is_file and _CELL_BYTES * request.num_columns * reader.count_rows() > most:
            raise _too_many_cells(path, most, reader.count_rows())
        for batch, read_share in _batches(reader, file):
            batch.validate(full=True)
            batches.append(batch)
            report_share(path, "table", read_share)
            num_rows += batch.num_rows
            num_bytes += sum(map(_decoded_bytes, batch.columns))
            if num_bytes > most:
                raise _too_many_cells(path, most, num_rows)
        # Batches have the chosen columns only; the schema of a reader has all of them.
        read_schema = batches[0].schema if batches else reader.schema
    table = pa.Table.from_batches(batches, read_schema)
    return table.select(list(names.values())).rename_columns(list(names))


def _batches(reader: Any, file: pa.NativeFile) -> Iterator[tuple[pa.RecordBatch, float]]:
    """The batches of an Arrow file or stream, each with the share of the file that is read."""
    if isinstance(reader, ipc.RecordBatchFileReader):
        for number in range(reader.num_record_batches):
            yield reader.get_batch(number), (number + 1) / reader.num_record_batches
    else:
        for batch in reader:
            yield batch, file.tell() / file.size()


def _index_names(schema: pa.Schema) -> list[str]:
    """Names of the index of the data frame that a file was written from."""
    about = schema.pandas_metadata or {}
    return [name for name in about.get("index_columns", ()) if isinstance(name, str)]


def _decoded_bytes(column: pa.Array) -> int:
    """Memory of a column with every cell on its own, not as an index of a dictionary [bytes]."""
    cells = max(column.nbytes, _CELL_BYTES * len(column))
    if pa.types.is_dictionary(column.type) and is_text(column.type):
        longest = pc.max(pc.binary_length(column.dictionary.cast(TEXT))).as_py() or 0
        cells = max(cells, longest * len(column))
    return cells


def _too_many_cells(path: Path, most: int, num_rows: int) -> ImportFormatError:
    return refused(path, "file", f"at most {most >> 20} MB of cells", f"{num_rows} rows")
