"""The three CSV files of a highD recording: bounded in size, every cell checked."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

import csv
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv

from overtaking.core.errors import ImportFormatError
from overtaking.recordings import messages
from overtaking.recordings.messages import shown

MAX_BYTES = 1 << 31
"""Larger files are refused; the largest of the data set has some 200 MB."""

MAX_MAGNITUDE = 1.0e6
"""No metre, second or number of a frame in half an hour of a motorway is larger."""

_MAX_LINE = 1 << 16
TEXT, NUMBER, WHOLE = pa.string(), pa.float64(), pa.int64()


def read_columns(path: Path, columns: dict[str, pa.DataType]) -> pa.Table:
    """Some columns of a CSV file.

    Args:
        path: The file.
        columns: Types of the wanted columns by name; the file may have more.

    Returns:
        A table with the columns in that order, without nulls, and with finite numbers only.

    Raises:
        ImportFormatError: The file is missing, too large, lacks a column, or has a cell that is no
            such value; the message names column and line.
    """
    _check_header(path, columns)
    try:
        table = pacsv.read_csv(
            path,
            # One thread, because only then Arrow knows the number of a bad row.
            read_options=pacsv.ReadOptions(use_threads=False, block_size=1 << 22),
            parse_options=pacsv.ParseOptions(ignore_empty_lines=False),
            convert_options=pacsv.ConvertOptions(
                include_columns=list(columns), column_types=columns, strings_can_be_null=False
            ),
        )
    except (pa.ArrowException, UnicodeDecodeError) as error:
        raise refused(path, _place_of(error), "a highD table", str(error)) from None
    if not table.num_rows:
        raise refused(path, "table", "at least one row", "none")
    for name, kind in columns.items():
        if kind != TEXT:
            _check_numbers(path, name, table[name])
    return table


def refused(path: Path, what: str, expected: str, got: str) -> ImportFormatError:
    """The error for a file that is not what it should be."""
    next_step = "use the files as their owners distribute them"
    where = shown(path.name, length=80)
    return messages.refused(where, what, expected, shown(got, length=150), next_step)


def refused_cell(path: Path, row: int, name: str, expected: str, got: str) -> ImportFormatError:
    """The error for one cell.

    Args:
        path: The file.
        row: Row of the table, from 0.
        name: Name of the column.
        expected: What would have been right.
        got: The value found.
    """
    return refused(path, f"line {row + 2}, column {name}", expected, got)


def _check_header(path: Path, columns: dict[str, pa.DataType]) -> None:
    """Refuse what is no plain file of bounded size with the wanted columns."""
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
    for name in columns:
        if names.count(name) != 1:
            got = "none" if name not in names else f"{names.count(name)} of them"
            raise refused(path, "line 1", f"a column {name}", got)


def _place_of(error: Exception) -> str:
    """The line that an error of Arrow's is about, which counts rows from the header on."""
    found = re.search(r"[Rr]ow #(\d+)", str(error))
    return f"line {found.group(1)}" if found else "table"


def _check_numbers(path: Path, name: str, column: pa.ChunkedArray) -> None:
    """Refuse what is missing, not finite, or larger than anything in a recording."""
    sizes = pc.abs(pc.fill_null(column.cast(NUMBER), np.nan))
    wrong = pc.index(pc.fill_null(pc.less_equal(sizes, MAX_MAGNITUDE), False), False).as_py()
    if wrong >= 0:
        got = "an empty cell" if not column[wrong].is_valid else str(column[wrong].as_py())
        expected = f"a number of size at most {MAX_MAGNITUDE:g}"
        raise refused_cell(path, wrong, name, expected, got)
