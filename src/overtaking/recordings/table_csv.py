"""CSV files, compressed or not; the separator and the decimal mark are detected."""

# pyarrow ships no types.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from __future__ import annotations

import csv
import io
import re
from typing import TYPE_CHECKING, Any, NamedTuple

import pyarrow as pa
import pyarrow.csv as pacsv

from overtaking.recordings.table_errors import named, refused
from overtaking.recordings.table_streams import open_bytes

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from pathlib import Path

    from overtaking.core.errors import ImportFormatError

SEPARATORS = (",", ";", "\t", "|")
"""Separators of cells. Where numbers have decimal commas, tables have semicolons or tabs."""

_SAMPLE_BYTES = 1 << 16  # Enough for the header of the widest table and some hundred rows.
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")


class Dialect(NamedTuple):
    """How the cells of a CSV file are written.

    Attributes:
        separator: One of `SEPARATORS`, or a blank for columns aligned by blanks.
        decimal: `.` or `,`.
        names: Names of the columns.
        has_header: Whether the first line holds the names.
    """

    separator: str
    decimal: str
    names: tuple[str, ...]
    has_header: bool = True


def csv_column_names(path: Path) -> tuple[str, ...]:
    """The columns of a CSV file.

    Raises:
        ImportFormatError: The file is not readable.
    """
    return _dialect(path, _sample(path), {}).names


def read_csv(
    path: Path, columns: Mapping[str, pa.DataType], header: Sequence[str] = ()
) -> pa.Table:
    """Some columns of a CSV file.

    Args:
        path: The file, compressed or not.
        columns: Types of the wanted columns by name. Numbers that are missing are null.
        header: Names of all columns of a file without names in its first line.

    Raises:
        ImportFormatError: The file is not readable, lacks a column or has rows of another length.
    """
    dialect = _dialect(path, _sample(path), columns, header)
    names = named(dialect.names, columns, path.name)
    types = {names[name]: kind for name, kind in columns.items()}
    try:
        table = _parse(path, types, dialect)
    except _ParseError as error:
        # If the sample holds whole numbers only, it does not show the decimal mark.
        other_dialect = dialect._replace(decimal="," if dialect.decimal == "." else ".")
        try:
            table = _parse(path, types, other_dialect)
        except _ParseError:
            raise error.refusal from None
    return table.rename_columns(list(columns))


class _ParseError(Exception):
    """A row or a cell that Arrow cannot read, with the error for the user."""

    def __init__(self, refusal: ImportFormatError) -> None:
        super().__init__(str(refusal))
        self.refusal = refusal


def _sample(path: Path) -> str:
    """The first lines of a file, of which the last may be cut off."""
    with open_bytes(path) as file:
        head = file.read(_SAMPLE_BYTES)
    try:
        return head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # The sample may end within a letter, which has at most 4 bytes.
        if error.start >= len(head) - 3 and len(head) == _SAMPLE_BYTES:
            return head[: error.start].decode("utf-8-sig")
        raise refused(path, "file", "a readable CSV file", "bytes that are no UTF-8") from None


def _dialect(
    path: Path, sample: str, columns: Mapping[str, pa.DataType], header: Sequence[str] = ()
) -> Dialect:
    """The dialect of a file, detected from its first lines.

    Args:
        path: The file, for messages.
        sample: Its first lines.
        columns: Types of the columns that are to be read, by name.
        header: Names of the columns of a file without names.
    """
    first_line = sample.partition("\n")[0]
    cells = {separator: _cells(path, first_line, separator) for separator in SEPARATORS}
    if header and not any(cell.strip()[:1].isalpha() for cell in cells[","]):
        separator = max(SEPARATORS, key=lambda separator: len(cells[separator]))
        separator = separator if len(cells[separator]) > 1 else " "
        return Dialect(separator, ".", tuple(header), has_header=False)
    column_keys = {name.casefold() for name in columns}

    def score(separator: str) -> tuple[int, int]:
        """Number of columns to read among the names, then the number of names."""
        names = cells[separator]
        return sum(name.strip().casefold() in column_keys for name in names), len(names)

    separator = max(SEPARATORS, key=score)
    names = tuple(cells[separator])
    number_keys = {name.casefold() for name, kind in columns.items() if kind != pa.string()}
    indices = [k for k, name in enumerate(names) if name.strip().casefold() in number_keys]
    return Dialect(separator, _decimal_mark(sample, separator, indices), names)


def _cells(path: Path, line: str, separator: str) -> list[str]:
    """The cells of a line."""
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error as error:
        raise refused(path, "line 1", "names of columns", str(error)) from None


def _decimal_mark(sample: str, separator: str, indices: Collection[int]) -> str:
    """The decimal mark of the numbers in the first lines.

    Args:
        sample: The first lines of the file.
        separator: Separator of its cells.
        indices: Positions of the columns of numbers.
    """
    lines = io.StringIO(sample.partition("\n")[2])
    try:
        for row in csv.reader(lines, delimiter=separator):
            if any(k < len(row) and _DECIMAL_COMMA.fullmatch(row[k]) for k in indices):
                return ","
    except csv.Error:
        pass  # Arrow refuses the same line, and names it.
    return "."


def _parse(path: Path, types: Mapping[str, pa.DataType], dialect: Dialect) -> pa.Table:
    """Some columns of a file with a known dialect.

    Args:
        path: The file.
        types: Types of the columns, by their names in the file.
        dialect: How its cells are written.
    """
    read_options: dict[str, Any] = {}
    if not dialect.has_header:
        read_options["column_names"] = list(dialect.names)
    try:
        with open_bytes(path) as file:
            source, separator = _source(file, dialect)
            return pacsv.read_csv(
                source,
                # One thread, because only then Arrow knows the number of a bad row.
                read_options=pacsv.ReadOptions(
                    use_threads=False, block_size=1 << 22, **read_options
                ),
                parse_options=pacsv.ParseOptions(delimiter=separator, ignore_empty_lines=False),
                convert_options=pacsv.ConvertOptions(
                    include_columns=list(types),
                    column_types=dict(types),
                    strings_can_be_null=False,
                    decimal_point=dialect.decimal,
                ),
            )
    except (pa.ArrowException, UnicodeDecodeError) as error:
        text = str(error)
        if dialect.separator == "," and "columns, got" in text:
            text += " (decimal commas need another separator, such as semicolons)"
        raise _ParseError(refused(path, _place_of(error), "rows of a table", text)) from None


def _source(file: Any, dialect: Dialect) -> tuple[Any, str]:
    """The source that Arrow reads, and the separator in it.

    Arrow takes one blank as a separator, so runs of blanks become commas.
    """
    if dialect.separator != " ":
        return pa.PythonFile(file, mode="r"), dialect.separator
    text = re.sub(rb"[ \t]+", b",", re.sub(rb"(?m)^[ \t]+|[ \t\r]+$", b"", file.read()))
    return pa.BufferReader(text), ","


def _place_of(error: Exception) -> str:
    """The line that an error of Arrow names; Arrow counts rows from 1, the header among them."""
    match = re.search(r"[Rr]ow #(\d+)", str(error))
    return f"line {match.group(1)}" if match else "table"
