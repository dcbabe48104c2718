"""Tables of recordings, CSV, Parquet or Arrow: bounded in size, every cell checked."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from collections.abc import Collection, Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.ipc as ipc
import pyarrow.parquet as pq

from overtaking.core.errors import ImportFormatError
from overtaking.recordings.table_csv import csv_column_names, read_csv
from overtaking.recordings.table_errors import named, refused, refused_cell
from overtaking.recordings.table_streams import max_cell_bytes

MAX_MAGNITUDE = 1.0e6
"""No metre, second or number of a frame in half an hour of a motorway is larger."""

ARROW_SUFFIXES = (".arrow", ".arrows", ".feather")
_ARROW_FILE_MAGIC = b"ARROW1"  # Arrow files begin with these bytes, Arrow streams do not.
_CELL_BYTES = 8  # Size of a number in memory, which does not depend on its encoding in the file.

TEXT, NUMBER, WHOLE = pa.string(), pa.float64(), pa.int64()
Types = Mapping[str, pa.DataType]


def read_columns(
    path: Path,
    columns: Types,
    *,
    header: Sequence[str] = (),
    limits: Mapping[str, float] | None = None,
    gaps: Collection[str] = (),
) -> pa.Table:
    """Some columns of a CSV, Parquet or Arrow file.

    Args:
        path: The file. The ending of its name is its format: `.parquet`; one of `ARROW_SUFFIXES`;
            any other is CSV, compressed or not.
        columns: Types of the wanted columns by name; the file may have more. Names are matched as
            `table_errors.named` describes.
        header: Names of all columns of a text file that has none, with blanks between the cells.
        limits: Largest size of the numbers of some columns; `MAX_MAGNITUDE` for the others.
        gaps: Columns of numbers in which cells may be missing.

    Returns:
        A table with the columns in that order, without nulls. Numbers are finite, except NaN for a
        missing cell in one of the `gaps`.

    Raises:
        ImportFormatError: The file is missing, too large, lacks a column, or has a cell that is no
            such value; the message names column and line.
    """
    if path.suffix == ".parquet":
        return checked_table(_parquet(path, columns), columns, path.name, limits, gaps)
    if path.suffix in ARROW_SUFFIXES:
        return checked_table(_read_arrow(path, columns), columns, path.name, limits, gaps)
    # pandas writes whole numbers as 3.0 if cells of their column are missing.
    types = {name: NUMBER if kind == WHOLE else kind for name, kind in columns.items()}
    return checked_table(read_csv(path, types, header), columns, path.name, limits, gaps)


def checked_table(
    table: pa.Table,
    columns: Types,
    where: str,
    limits: Mapping[str, float] | None = None,
    gaps: Collection[str] = (),
) -> pa.Table:
    """A table with the wanted columns; raises an error for a cell of another type.

    Args:
        table: The table.
        columns: Types of its columns.
        where: What it is called in a message.
        limits: As in `read_columns`.
        gaps: As in `read_columns`.
    """
    if not table.num_rows:
        raise refused(where, "table", "at least one row", "none")
    arrays: list[pa.ChunkedArray] = []
    for name, kind in columns.items():
        array = _of_type(table[name], name, kind, where)
        if kind == TEXT:
            arrays.append(_words(array))
            continue
        largest = (limits or {}).get(name, MAX_MAGNITUDE)
        _check_numbers(where, name, array, largest, may_be_missing=name in gaps)
        arrays.append(pc.fill_null(array, np.nan) if name in gaps else array)
    return pa.Table.from_arrays(arrays, names=list(columns))


def _words(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Text without blanks around it, and whole numbers without the ".0" that pandas adds."""
    trimmed = pc.utf8_trim_whitespace(pc.fill_null(column, ""))
    return pc.replace_substring_regex(trimmed, r"^([+-]?\d+)\.0*$", r"\1")


def column_names(path: Path) -> tuple[str, ...]:
    """The columns of a file."""
    if path.suffix == ".parquet":
        return tuple(_parquet_file(path).schema_arrow.names)
    if path.suffix in ARROW_SUFFIXES:
        with _open_arrow(path) as reader:
            return tuple(reader.schema.names)
    return csv_column_names(path)


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
    most = max_cell_bytes(path)
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
    # Damaged names of columns are a UnicodeDecodeError or KeyError.
    except (pa.ArrowException, OSError, UnicodeDecodeError, KeyError) as error:
        raise refused(path, "file", expected, str(error)) from None


def _read_arrow(path: Path, columns: Types) -> pa.Table:
    """Some columns of an Arrow IPC file or stream."""
    most = max_cell_bytes(path)
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
            # A file states its number of rows before cells are decompressed; a stream does not.
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
        # Batches have the chosen columns only; the schema of a reader has all of them.
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


def _too_many_cells(path: Path, most: int, num_rows: int) -> ImportFormatError:
    return refused(path, "file", f"at most {most >> 20} MB of cells", f"{num_rows} rows")


def _of_type(column: pa.ChunkedArray, name: str, kind: pa.DataType, where: str) -> pa.ChunkedArray:
    """A column of one type, refused if its cells are of another."""
    try:
        return column.cast(kind)
    except (pa.ArrowException, UnicodeDecodeError) as error:
        raise refused(where, f"column {name}", f"cells of type {kind}", str(error)) from None


def _check_numbers(
    where: str, name: str, column: pa.ChunkedArray, most: float, *, may_be_missing: bool
) -> None:
    """Refuse numbers that are missing, not finite, or larger than anything in a recording."""
    # `safe=False`: an integer beyond 2**53 loses digits, but it exceeds every limit anyway.
    sizes = pc.abs(pc.fill_null(column.cast(NUMBER, safe=False), np.nan))
    is_right = pc.less_equal(sizes, most)
    if may_be_missing:
        is_right = pc.or_(is_right, pc.is_nan(sizes))
    wrong = pc.index(is_right, False).as_py()
    if wrong >= 0:
        got = "an empty cell" if not column[wrong].is_valid else str(column[wrong].as_py())
        raise refused_cell(where, wrong, name, f"a number of size at most {most:g}", got)
