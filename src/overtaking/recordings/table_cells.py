"""Cells of tables as numbers, instants and texts; every cell is checked."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from overtaking.recordings.column_request import MAX_MAGNITUDE, NUMBER, TEXT, TIME
from overtaking.recordings.table_csv import MISSING_WORDS, thousands_advice
from overtaking.recordings.table_errors import refused, refused_cell

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from overtaking.recordings.column_request import ColumnRequest, RowPlaces

_SAMPLE_CELLS = 100_000  # Cells of a column that are looked at for separators of thousands.

_NANOSECONDS = 1e-9  # [s]

_ISO_INSTANT = r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?)?"
_OFFSET = r"(?:Z|[+-]\d\d(?::?\d\d)?)$"
_CLOCK = (
    r"^(?:(?P<sign>-)?(?P<days>\d{1,6}) days?,? )?\+?"
    r"(?P<hours>\d{1,4}):(?P<minutes>\d\d):(?P<seconds>\d\d(?:\.\d+)?)$"
)
"""A time of the day, or a duration as pandas writes it."""


def check_table(table: pa.Table, request: ColumnRequest, where: str, places: RowPlaces) -> pa.Table:
    """The requested columns of a table, as `ReadTable.table` has them.

    Args:
        table: A table with the wanted names.
        request: The columns.
        where: Name of the table in messages.
        places: Where its rows are.

    Raises:
        ImportFormatError: There are no rows, or a cell is no value of its type.
    """
    if not table.num_rows:
        raise refused(where, "table", "at least one row", "none")
    columns: list[pa.ChunkedArray] = []
    for name, kind in request.types.items():
        column = table[name]
        if pa.types.is_run_end_encoded(column.type):
            column = pc.run_end_decode(column)
        if kind == TEXT:
            columns.append(_texts(column, name, where))
            continue
        if kind == TIME:
            column = _seconds(column, name, request, where, places)
        else:
            column = _numbers(column, name, where)
        limit = request.limits.get(name, MAX_MAGNITUDE)
        _check_sizes(column, name, limit, where, places, has_gaps=name in request.gaps)
        columns.append(pc.fill_null(column, np.nan) if column.null_count else column)
    return pa.Table.from_arrays(columns, names=list(request.types))


def decimal_mark(columns: Iterable[pa.ChunkedArray]) -> str:
    """The decimal mark of numbers that are texts: a comma if no cell has a point."""
    has_comma = False
    for column in columns:
        if pc.any(pc.match_substring(column, ".")).as_py():
            return "."
        has_comma |= bool(pc.any(pc.match_substring(column, ",")).as_py())
    return "," if has_comma else "."


def has_thousands(texts: pa.ChunkedArray, decimal: str) -> str | None:
    """A cell that shows that numbers may be whole ones with separators of thousands, else None.

    They may if no cell has one, two or more than three decimals, none with three begins with 0 or
    has more than three digits before the mark, and all cells without decimals are below 1000.

    Args:
        texts: Numbers as texts.
        decimal: The decimal mark.
    """
    step = -(-len(texts) // _SAMPLE_CELLS)
    if step > 1:
        texts = texts.take(pa.array(np.arange(0, len(texts), step)))
    texts = pc.utf8_trim_whitespace(texts.drop_null())
    mark = r"\." if decimal == "." else ","
    is_grouped = pc.match_substring_regex(texts, rf"^[+-]?[1-9]\d{{0,2}}{mark}\d{{3}}$")
    is_small = pc.match_substring_regex(texts, r"^[+-]?\d{1,3}$")
    is_missing = pc.is_in(texts, pa.array([*MISSING_WORDS, "-"]))
    if not pc.all(pc.or_(pc.or_(is_grouped, is_small), is_missing)).as_py():
        return None
    example = pc.index(is_grouped, True).as_py()
    return None if example is None or example < 0 else texts[example].as_py()


def numbers_without_thousands(
    texts: Mapping[str, pa.ChunkedArray],
    thousands: str | None,
    decimal: str,
    small: Collection[str],
) -> dict[str, pa.ChunkedArray]:
    """Numbers as texts with a decimal point and without separators of thousands.

    A column has separators of thousands if each cell that has the mark has it before groups of
    three digits. Where no cell of the table has the other mark, only numbers of small units have
    them: "1.750" is 1.75 m, but 1750 mm.

    Args:
        texts: Numbers as texts, by column.
        thousands: Separator of thousands, "." or ","; other values stand for none.
        decimal: The decimal mark of columns without separators of thousands.
        small: Columns of small units, such as mm.
    """
    if thousands not in (".", ","):
        return {name: _with_point(column, decimal) for name, column in texts.items()}
    other = "," if thousands == "." else "."
    mark = re.escape(thousands)
    pattern = rf"^\s*[+-]?\d{{1,3}}({mark}\d{{3}})+({re.escape(other)}\d*)?\s*$"
    has_other = any(pc.any(pc.match_substring(column, other)).as_py() for column in texts.values())
    columns: dict[str, pa.ChunkedArray] = {}
    for name, column in texts.items():
        has_mark = pc.match_substring(column, thousands)
        is_grouped = pc.or_(pc.invert(has_mark), pc.match_substring_regex(column, pattern))
        if (has_other or name in small) and pc.all(is_grouped).as_py() is not False:
            columns[name] = _with_point(pc.replace_substring(column, thousands, ""), other)
        else:
            columns[name] = _with_point(column, thousands)
    return columns


def _with_point(column: pa.ChunkedArray, decimal: str) -> pa.ChunkedArray:
    """Numbers as texts with a point in place of the decimal mark."""
    return pc.replace_substring(column, ",", ".") if decimal == "," else column


def _numbers(column: pa.ChunkedArray, name: str, where: str) -> pa.ChunkedArray:
    """A column of float64, null where a cell is missing."""
    if is_text(column.type):
        texts = pc.utf8_trim_whitespace(_cast(column, TEXT, name, where))
        is_missing = pc.is_in(texts, pa.array([*MISSING_WORDS, "-"]))
        column = pc.if_else(is_missing, pa.scalar(None, TEXT), texts)
    elif pa.types.is_temporal(column.type):
        raise refused(where, f"column {name}", "numbers", f"cells of type {column.type}")
    return _cast(column, NUMBER, name, where)


def _texts(column: pa.ChunkedArray, name: str, where: str) -> pa.ChunkedArray:
    """A column of texts as a dictionary, null where a cell is missing."""
    kind = column.type
    if pa.types.is_floating(kind):  # A NaN is a missing cell.
        column = pc.if_else(pc.is_nan(column), pa.scalar(None, kind), column)
    if not (pa.types.is_dictionary(kind) or pa.types.is_primitive(kind) or is_text(kind)):
        column = _cast(column, TEXT, name, where)
    if not pa.types.is_dictionary(kind):
        column = column.dictionary_encode()
    return _cast(column, pa.dictionary(pa.int32(), TEXT), name, where)


def _seconds(
    column: pa.ChunkedArray, name: str, request: ColumnRequest, where: str, places: RowPlaces
) -> pa.ChunkedArray:
    """Instants as float64 in the unit of the map of columns.

    Dates count from 1970, in UTC where they state an offset, durations and times of the day from
    their beginning.
    """
    kind = column.type
    if is_text(kind):
        texts = _cast(column, TEXT, name, where)
        return _seconds_of_texts(texts, name, request, where, places)
    if not pa.types.is_temporal(kind):
        _check_time_unit(name, request, where)
        return _numbers(column, name, where)
    if pa.types.is_date(kind):
        column = _cast(column, pa.timestamp("s"), name, where)
    elif pa.types.is_time32(kind):
        column = _cast(column, pa.time64("ns"), name, where)
    factor = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": _NANOSECONDS}[column.type.unit]
    count = column.cast(pa.int64())  # In units of the column.
    return pc.multiply(count.cast(NUMBER, safe=False), factor / request.time_unit)


def _check_time_unit(name: str, request: ColumnRequest, where: str) -> None:
    """Refuse instants that are numbers without a unit."""
    if not request.has_time_unit:
        raise refused(
            where,
            f"column {name}",
            "dates, durations or ISO 8601, or a unit in the map of columns",
            "numbers without a unit",
            f'write the unit behind the name: time = "{name} [s]"',
        )


def _seconds_of_texts(
    column: pa.ChunkedArray, name: str, request: ColumnRequest, where: str, places: RowPlaces
) -> pa.ChunkedArray:
    """As `_seconds` of texts: numbers, ISO 8601, times of the day, or durations of pandas."""
    texts = pc.utf8_trim_whitespace(column)
    is_missing = pc.is_in(texts, pa.array(MISSING_WORDS))
    texts = pc.replace_substring(pc.if_else(is_missing, pa.scalar(None, TEXT), texts), ",", ".")
    stated = texts.drop_null()
    if not len(stated):
        return texts.cast(NUMBER)
    if pc.all(pc.match_substring_regex(stated, r"^[+-]?[\d.]+([eE][+-]?\d+)?$")).as_py():
        _check_time_unit(name, request, where)
        return _cast(texts, NUMBER, name, where)
    if pc.all(pc.match_substring_regex(texts.drop_null(), _CLOCK)).as_py():
        return pc.divide(_clock_seconds(texts), request.time_unit)
    for pattern, replacement in (
        # The basic format, without separators.
        (r"^(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)", r"\1-\2-\3T\4:\5:\6"),
        (r"(\.\d{9})\d+", r"\1"),
        (r"[Zz]$", "Z"),
        (r" ([+-]\d\d:?\d\d)$", r"\1"),
    ):
        texts = pc.replace_substring_regex(texts, pattern, replacement)
    first = texts.drop_null()[0].as_py()
    # Whether the texts state an offset decides about the type that they are read as.
    zone = "UTC" if re.search(_OFFSET, first) else None
    pattern = rf"^{_ISO_INSTANT}{_OFFSET if zone else '$'}"
    row = pc.index(pc.fill_null(pc.match_substring_regex(texts, pattern), True), False).as_py()
    if row < 0:
        try:
            instants = texts.cast(pa.timestamp("ns", zone))
            seconds = instants.cast(pa.int64()).cast(NUMBER, safe=False)
            return pc.multiply(seconds, _NANOSECONDS / request.time_unit)
        except pa.ArrowException as error:
            raise refused(where, f"column {name}", "instants", str(error)) from None
    raise refused_cell(
        where,
        places.name(row),
        name,
        "a number, or an instant in ISO 8601 such as 2024-05-01T08:30:00.1, all with an offset or "
        "all without one",
        texts[row].as_py(),
    )


def _clock_seconds(texts: pa.ChunkedArray) -> pa.ChunkedArray:
    """Seconds that times of the day or durations stand for."""
    parts = pc.extract_regex(texts, _CLOCK)

    def part(name: str) -> pa.ChunkedArray:
        text = pc.struct_field(parts, name)
        return pc.if_else(pc.equal(text, ""), "0", text).cast(NUMBER)

    minutes = pc.add(pc.multiply(part("hours"), 60.0), part("minutes"))
    seconds = pc.add(pc.multiply(minutes, 60.0), part("seconds"))
    is_negative = pc.equal(pc.struct_field(parts, "sign"), "-")
    # pandas writes -1 s as "-1 days +23:59:59"; only the days have a sign.
    days = pc.multiply(part("days"), pc.if_else(is_negative, -86400.0, 86400.0))
    return pc.add(days, seconds)


def _cast(column: pa.ChunkedArray, kind: pa.DataType, name: str, where: str) -> pa.ChunkedArray:
    """A column of one type, refused if its cells are of another."""
    try:
        # An integer beyond 2**53 loses digits; the limits of the columns allow none but instants.
        return column.cast(kind, safe=not (kind == NUMBER and pa.types.is_integer(column.type)))
    except (pa.ArrowException, UnicodeDecodeError) as error:
        step = thousands_advice(str(error)) or "correct the cell, or the map of columns"
        expected = "numbers" if kind == NUMBER else "texts"
        raise refused(where, f"column {name}", expected, str(error), step) from None


def is_text(kind: pa.DataType) -> bool:
    """Whether a column holds texts, each on its own or as a dictionary."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return pa.types.is_string(kind) or pa.types.is_large_string(kind) or kind == pa.string_view()


def _check_sizes(
    column: pa.ChunkedArray,
    name: str,
    limit: float,
    where: str,
    places: RowPlaces,
    *,
    has_gaps: bool,
) -> None:
    """Refuse numbers that are missing, not finite, or larger than anything in a recording."""
    sizes = pc.abs(column)
    is_right = pc.less_equal(sizes, limit)
    is_right = pc.or_(is_right, pc.is_nan(sizes)) if has_gaps else pc.fill_null(is_right, False)
    row = pc.index(is_right, False).as_py()
    if row >= 0:
        got = "an empty cell" if not column[row].is_valid else str(column[row].as_py())
        expected = f"a number of size at most {limit:g}"
        raise refused_cell(where, places.name(row), name, expected, got)
