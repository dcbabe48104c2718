"""CSV files, compressed or not: separator, decimal mark, comments and blank lines are detected."""

# pyarrow ships no types.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from overtaking.core.process_limits import refusal_of
from overtaking.recordings.column_matching import name_key, unit_of_header
from overtaking.recordings.column_request import NUMBER, TEXT, TIME, ColumnRequest, RowPlaces
from overtaking.recordings.table_errors import refused
from overtaking.recordings.table_streams import open_bytes

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from pathlib import Path

    from overtaking.core.errors import ImportFormatError

SEPARATORS = (",", ";", "\t", "|", " ")
"""Separators of cells; " " stands for any number of blanks. Where numbers have decimal commas,
tables have semicolons, tabs or blanks."""

MISSING_WORDS = (
    "", "NaN", "nan", "-NaN", "-nan", "NA", "N/A", "n/a", "<NA>", "#N/A", "#N/A N/A", "#NA", "NULL",
    "null", "None", "NaT", "1.#QNAN", "-1.#IND", "1.#IND", "-1.#QNAN",
)  # fmt: skip
"""Texts that pandas, Arrow, R and spreadsheets write for a missing cell."""

_SAMPLE_BYTES = 1 << 16  # Enough for the header of the widest table and some hundred rows.
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_DECIMAL_POINT = re.compile(r"\s*[+-]?\d*\.\d+([eE][+-]?\d+)?\s*")
_NUMBER = re.compile(r"\s*[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?\s*")
_EXCEL_SEPARATOR = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)
_THOUSANDS = re.compile(
    r"(?<![\w.,])\d{1,3}(?:(?:([.,])\d{3})(?:\1\d{3})+|([.,])\d{3}(?!\2)[.,]\d+)(?![\w.,])"
)
_BLANK_LINE = re.compile(rb"\n[ \t]+(?:#|\r?(?:\n|$))")  # Also a comment after blanks.
_MAX_DROPPED_LINES = 1_000_000


class Dialect(NamedTuple):
    """How the cells of a CSV file are written.

    Attributes:
        separator: One of `SEPARATORS`.
        decimal: `.` or `,`.
        names: Names of the columns.
        has_header: Whether a line holds the names.
        has_comments: Whether a line that begins with "#" is a comment.
        num_skipped: Lines before the header that are neither comments nor blank.
        has_text_times: Whether instants are texts, such as those of ISO 8601.
    """

    separator: str
    decimal: str
    names: tuple[str, ...]
    has_header: bool = True
    has_comments: bool = True
    num_skipped: int = 0
    has_text_times: bool = False


class CsvTable(NamedTuple):
    """A CSV file that was read.

    Attributes:
        table: The requested columns. Texts are dictionaries; columns of `raw_numbers` are text.
        places: Where its rows are in the file.
        decimal: The decimal mark.
    """

    table: pa.Table
    places: RowPlaces
    decimal: str


def csv_column_names(path: Path) -> tuple[str, ...]:
    """The columns of a CSV file.

    Raises:
        ImportFormatError: The file is not readable.
    """
    return _dialect(path, _sample(path), ColumnRequest(types={})).names


def read_csv(path: Path, request: ColumnRequest, raw_numbers: Collection[str] = ()) -> CsvTable:
    """Some columns of a CSV file.

    Args:
        path: The file, compressed or not.
        request: The columns. Missing cells are null.
        raw_numbers: Columns of numbers that are read as text.

    Raises:
        ImportFormatError: The file is not readable, lacks a column or has rows of another length.
    """
    dialect = _dialect(path, _sample(path), request)
    names = request.match(dialect.names, path.name)
    types: dict[str, pa.DataType] = {}
    for name, kind in request.types.items():
        is_text = kind == TEXT or (kind == TIME and dialect.has_text_times)
        if is_text:
            # Few different texts stand in many rows.
            types[names[name]] = pa.dictionary(pa.int32(), TEXT)
        else:
            types[names[name]] = TEXT if name in raw_numbers else NUMBER
    try:
        table, places = _parse(path, types, dialect)
    except _ParseError as error:
        # If the sample holds whole numbers only, it does not show the decimal mark.
        dialect = dialect._replace(decimal="," if dialect.decimal == "." else ".")
        try:
            table, places = _parse(path, types, dialect)
        except _ParseError:
            raise error.refusal from None
    columns = [table[names[name]] for name in request.types]
    return CsvTable(pa.table(columns, names=list(request.types)), places, dialect.decimal)


class _ParseError(Exception):
    """A row or a cell that Arrow cannot read, with the error for the user."""

    def __init__(self, refusal: ImportFormatError) -> None:
        super().__init__(str(refusal))
        self.refusal = refusal


def _sample(path: Path) -> str:
    """The first lines of a file, without the last one if it is cut off."""
    with open_bytes(path) as file:
        head = file.read(_SAMPLE_BYTES)
    is_cut = len(head) == _SAMPLE_BYTES
    if is_cut and b"\n" in head:
        head = head[: head.rindex(b"\n") + 1]
    if head.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\x00" in head[:1000]:
        raise refused(
            path,
            "file",
            "text in UTF-8",
            "UTF-16" if b"\x00" in head else "bytes that are no UTF-8",
            "save it as UTF-8: in a spreadsheet as 'CSV UTF-8', or with pandas.read_csv(..., "
            "encoding='utf-16').to_csv(...)",
        )
    try:
        return head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # The sample may end within a letter, which has at most 4 bytes.
        if is_cut and error.start >= len(head) - 3:
            return head[: error.start].decode("utf-8-sig")
        raise refused(
            path,
            "file",
            "a readable CSV file",
            "bytes that are no UTF-8",
            "save it as UTF-8: in a spreadsheet as 'CSV UTF-8', or with pandas.read_csv(..., "
            "encoding='latin-1').to_csv(...)",
        ) from None


@dataclass(frozen=True, slots=True)
class _SampleLines:
    """The first lines of a file by their content.

    Attributes:
        comments: Comments before the first other line, without the "#".
        lines: All lines that are neither comments nor blank.
        has_comments: Whether lines that begin with "#" are comments; not if most lines do.
        num_skipped: Lines before the first of `lines` that only state the separator.
        separator: The separator that such a line states.
    """

    comments: list[str]
    lines: list[str]
    has_comments: bool
    num_skipped: int = 0
    separator: str | None = None

    @classmethod
    def of(cls, sample: str) -> _SampleLines:
        """The lines of a sample."""
        lines = [line for line in re.split(r"\r\n|\n|\r", sample) if line.strip()]
        is_comment = [line.lstrip().startswith("#") for line in lines]
        # Below a header without "#", lines that mostly begin with it are rows with such names.
        has_comments = not lines or is_comment[0] or 2 * sum(is_comment) < len(lines)
        is_comment = [comment and has_comments for comment in is_comment]
        others = [line for line, comment in zip(lines, is_comment, strict=True) if not comment]
        num_first = is_comment.index(False) if others else len(lines)
        comments = [line.lstrip("# \t").rstrip() for line in lines[:num_first]]
        excel = _EXCEL_SEPARATOR.fullmatch(others[0]) if others else None
        if excel is None:
            return cls(comments, others, has_comments)
        return cls(comments, others[1:], has_comments, 1, excel[1])


def _dialect(path: Path, sample: str, request: ColumnRequest) -> Dialect:
    """The dialect of a file, detected from its first lines.

    Args:
        path: The file, for messages.
        sample: Its first lines.
        request: The columns that are to be read.
    """
    first = _SampleLines.of(sample)
    first_line = first.lines[0] if first.lines else ""
    if request.header and not _has_names(first_line, request.header):
        separator = max(SEPARATORS[:-1], key=lambda mark: len(_cells(path, first_line, mark)))
        separator = separator if len(_cells(path, first_line, separator)) > 1 else " "
        names, has_header = tuple(request.header), False
    else:
        candidates = SEPARATORS if first.separator is None else (first.separator,)
        headers = [first_line, *first.comments[-1:]]  # NumPy writes the names as a comment.
        scores = [
            _separator_score(path, header, separator, request)
            for header in headers
            for separator in candidates
        ]
        best = scores.index(max(scores))
        has_header = best < len(candidates)
        header, separator = headers[not has_header], candidates[best % len(candidates)]
        names = tuple(_cells(path, header, separator))
    rows = [_cells(path, line, separator) for line in first.lines[has_header:]]
    return Dialect(
        separator=separator,
        decimal=_decimal_mark(path, rows, _indices(names, request, NUMBER, TIME), request),
        names=names,
        has_header=has_header,
        has_comments=first.has_comments,
        num_skipped=first.num_skipped,
        has_text_times=_has_text(rows, _indices(names, request, TIME)),
    )


def _has_names(line: str, names: Sequence[str]) -> bool:
    """Whether a line holds one of some names of columns."""
    cells = {name_key(cell.strip('"')) for cell in re.split(r"[,;\t|]|\s+", line)}
    return not cells.isdisjoint(map(name_key, names))


def _separator_score(
    path: Path, header: str, separator: str, request: ColumnRequest
) -> tuple[int, bool, int]:
    """How well a separator fits a header: number of columns to read, then number of names.

    Blanks also stand within names, so they count after all other separators.
    """
    names = _cells(path, header, separator)
    wanted = {name_key(name) for name in request.types}
    num_wanted = sum(not wanted.isdisjoint(_keys(name, request)) for name in names)
    return num_wanted, separator != " " and len(names) > 1, len(names)


def _keys(name: str, request: ColumnRequest) -> set[str]:
    """The wanted names that a header may stand for, as `name_key` has them."""
    header = unit_of_header(name, request.known_units)
    return {name_key(name), *([] if header is None else [name_key(header[0])])}


def _indices(names: Sequence[str], request: ColumnRequest, *kinds: pa.DataType) -> list[int]:
    """Positions of the columns to read that have one of some types."""
    wanted = {name_key(name) for name, kind in request.types.items() if kind in kinds}
    return [k for k, name in enumerate(names) if not wanted.isdisjoint(_keys(name, request))]


def _cells(path: Path, line: str, separator: str) -> list[str]:
    """The cells of a line."""
    if separator == " ":
        return line.split()
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error as error:
        raise refused(path, "first lines", "cells of a table", str(error)) from None


def _decimal_mark(
    path: Path, rows: Sequence[Sequence[str]], indices: Collection[int], request: ColumnRequest
) -> str:
    """The decimal mark of the numbers in the first lines.

    Args:
        path: The file, for messages.
        rows: Cells of the first lines.
        indices: Positions of the columns of numbers.
        request: The request, which may state the separator of thousands.

    Raises:
        ImportFormatError: Some numbers have decimal commas, others decimal points.
    """
    if request.thousands in (".", ","):
        return "," if request.thousands == "." else "."
    numbers = [row[k] for row in rows for k in indices if k < len(row)]
    comma = next((cell for cell in numbers if _DECIMAL_COMMA.fullmatch(cell)), None)
    if comma is None:
        return "."
    point = next((cell for cell in numbers if _DECIMAL_POINT.fullmatch(cell)), None)
    if point is not None:
        raise refused(
            path,
            "numbers",
            "one decimal mark, a point or a comma",
            f"{comma.strip()} and {point.strip()}",
            "write all numbers with one decimal mark; if one of the two separates thousands, state "
            "recording.thousands in the map of columns",
        )
    return ","


def _has_text(rows: Sequence[Sequence[str]], indices: Collection[int]) -> bool:
    """Whether the first cell of some columns that is not missing is no number."""
    cells = (row[k].strip() for row in rows for k in indices if k < len(row))
    first = next((cell for cell in cells if cell not in MISSING_WORDS), "0")
    return _NUMBER.fullmatch(first) is None


def _parse(
    path: Path, types: Mapping[str, pa.DataType], dialect: Dialect
) -> tuple[pa.Table, RowPlaces]:
    """Some columns of a file with a known dialect, and the places of its rows.

    Args:
        path: The file.
        types: Types of the columns, by their names in the file.
        dialect: How its cells are written.
    """
    read_options: dict[str, Any] = {}
    if not dialect.has_header:
        read_options["column_names"] = list(dialect.names)
    with open_bytes(path) as file:
        lines = _RowLines(file, path, dialect)
        try:
            source, separator = _source(lines, dialect)
            table = pacsv.read_csv(
                source,
                # One thread, because only then Arrow knows the number of a bad row.
                read_options=pacsv.ReadOptions(
                    use_threads=False, block_size=1 << 22, **read_options
                ),
                parse_options=pacsv.ParseOptions(delimiter=separator, ignore_empty_lines=False),
                convert_options=pacsv.ConvertOptions(
                    include_columns=list(types),
                    column_types=dict(types),
                    null_values=[*MISSING_WORDS, "-"],
                    strings_can_be_null=False,
                    decimal_point=dialect.decimal,
                ),
            )
        except (pa.ArrowException, UnicodeDecodeError) as error:
            if (refusal := refusal_of(error, path.name)) is not None:
                raise refusal from error
            text = str(error)
            counts = re.search(r"Expected (\d+) columns, got (\d+)", text)
            if dialect.separator == "," and counts and int(counts[2]) > int(counts[1]):
                text += " (decimal commas need another separator, such as semicolons)"
            where = _place_of(error, lines.places)
            step = thousands_advice(text) or "correct the line, or the map of columns"
            raise _ParseError(refused(path, where, "rows of a table", text, step)) from None
        return table, lines.places


def thousands_advice(text: str) -> str | None:
    """What the user can do about a text with separators of thousands; None if it has none."""
    match = _THOUSANDS.search(text)
    if match is None:
        return None
    mark = match[1] or match[2]
    return f'if "{mark}" separates thousands, state recording.thousands = "{mark}" in the map'


def _source(lines: _RowLines, dialect: Dialect) -> tuple[Any, str]:
    """The source that Arrow reads, and the separator in it.

    Arrow takes one blank as a separator, so runs of blanks become commas, or semicolons before
    numbers with decimal commas.
    """
    if dialect.separator != " ":
        return pa.PythonFile(lines, mode="r"), dialect.separator
    separator = ";" if dialect.decimal == "," else ","
    text = re.sub(rb"(?m)^[ \t]+|[ \t\r]+$", b"", lines.read())
    return pa.BufferReader(re.sub(rb"[ \t]+", separator.encode(), text)), separator


def _place_of(error: Exception, places: RowPlaces) -> str:
    """The line that an error of Arrow names; Arrow counts rows from 1, the header among them."""
    match = re.search(r"[Rr]ow #(\d+)", str(error))
    return f"line {places.line(int(match.group(1)))}" if match else "table"


class _RowLines(io.RawIOBase):
    """The lines of a file that are rows or its header: without comments and blank lines."""

    def __init__(self, source: BinaryIO, path: Path, dialect: Dialect) -> None:
        super().__init__()
        self._source, self._path, self._dialect = source, path, dialect
        self._pending = b""  # Lines that are ready.
        self._rest = b""  # The beginning of a line that is not complete.
        self._num_lines = 0
        self._num_to_skip = dialect.num_skipped
        self._dropped: list[int] = []

    @property
    def places(self) -> RowPlaces:
        """Where the rows are in the file, as far as it has been read."""
        first = 2 if self._dialect.has_header else 1
        return RowPlaces("line", first, np.array(self._dropped, np.int64))

    def readable(self) -> bool:
        """Whether bytes can be read: always."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Read into a buffer; returns the number of bytes, 0 at the end."""
        while not self._pending:
            data = self._source.read(max(len(buffer), 1 << 16))
            text = self._rest + data
            if not text:
                return 0
            # A file whose lines end in "\r" alone is one line.
            end = text.rfind(b"\n") + 1 if data else len(text)
            self._rest = text[end:]
            self._pending = self._without_dropped(text[:end])
        count = min(len(buffer), len(self._pending))
        buffer[:count] = self._pending[:count]
        self._pending = self._pending[count:]
        return count

    def _without_dropped(self, text: bytes) -> bytes:
        """Whole lines without those that are no rows."""
        if self._num_lines == 0:
            text = text.removeprefix(b"\xef\xbb\xbf")
        num_before = self._num_lines
        self._num_lines += text.count(b"\n")
        if not self._num_to_skip and not _may_have_dropped(text):
            return text
        lines = text.splitlines(keepends=True) if b"\n" not in text else _split_lines(text)
        kept: list[bytes] = []
        for number, line in enumerate(lines, num_before + 1):
            is_comment = self._dialect.has_comments and line.lstrip().startswith(b"#")
            if not line.strip() or is_comment:
                self._dropped.append(number)
            elif self._num_to_skip:
                self._num_to_skip -= 1
                self._dropped.append(number)
            else:
                kept.append(line)
        if len(self._dropped) > _MAX_DROPPED_LINES:
            expected = f"at most {_MAX_DROPPED_LINES:,} comments and blank lines"
            raise refused(self._path, "file", expected, "more")
        return b"".join(kept)


def _may_have_dropped(text: bytes) -> bool:
    """Whether lines may have a comment or a blank line among them."""
    if text.startswith((b"\n", b"\r\n", b" ", b"\t", b"#")):
        return True
    # These searches are much faster than one for a line of blanks.
    if any(begin in text for begin in (b"\n#", b"\n\n", b"\n\r\n")):
        return True
    return (b"\n " in text or b"\n\t" in text) and _BLANK_LINE.search(text) is not None


def _split_lines(text: bytes) -> list[bytes]:
    """Lines with the ends of lines."""
    lines = text.split(b"\n")
    last = lines.pop()
    return [line + b"\n" for line in lines] + ([last] if last else [])
