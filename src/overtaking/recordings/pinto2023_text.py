"""The cells of the paper's table as text, and text as values again.

A number has at most two decimals and no trailing zeros. The tuples of a cell stand in the order of
the ids, with a semicolon between them: `(1,351.35,251.58,-7); (2,355.82,251.68,-7)`. The paper's
own row leaves out the second semicolon and puts a space after one comma; both are read as well.
"""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from overtaking.recordings.pinto2023_schema import (
    COLUMNS,
    DECIMALS,
    NULLABLE,
    PERCENTAGES,
    SCHEMA,
    VEHICLE_COLUMNS,
    WORDS,
)

BETWEEN_TUPLES = "; "
_HUNDRED = 10**DECIMALS
_ENDINGS = pa.array([f".{hundredths:02}".rstrip("0").rstrip(".") for hundredths in range(_HUNDRED)])
_LARGEST = {**dict.fromkeys(PERCENTAGES, 100), "OV": 1}
# Bounded, so that no cell can overflow a double or an int64.
_INTEGER = r"[-+]?[0-9]{1,18}"
_NUMBER = r"[-+]?[0-9]{1,15}(\.[0-9]{1,17})?"


class CellError(ValueError):
    """A cell that does not say what its column wants.

    Attributes:
        row: Number of the row, from 0.
        column: Name of the column.
        expected: What would have been right.
        got: The text of the cell.
    """

    def __init__(self, *, row: int, column: str, expected: str, got: str) -> None:
        """Note where the cell is, for a caller that knows the file's name and its line numbers."""
        super().__init__(f"row {row}, column {column}: expected {expected}, got {got!r}")
        self.row, self.column, self.expected, self.got = row, column, expected, got


def to_text(table: pa.Table) -> pa.Table:
    """A table of `SCHEMA` as the paper prints it: every cell is text.

    No collision is 0 and a missing lane an empty cell, as in the paper.
    """
    return pa.table({name: _column_text(table, name) for name in COLUMNS})


def from_text(text: pa.Table) -> pa.Table:
    """The values of a table whose cells are text: the inverse of `to_text`.

    Raises:
        CellError: A cell does not say what its column wants.
    """
    columns = {name: text[name].combine_chunks().cast(pa.string()) for name in COLUMNS}
    values = {name: _column_values(name, columns[name]) for name in COLUMNS}
    _check_ids(values, columns)
    return pa.table([values[name] for name in COLUMNS], schema=SCHEMA)


def _column_text(table: pa.Table, name: str) -> pa.Array:
    """One column as text."""
    column = table[name].combine_chunks()
    if name in VEHICLE_COLUMNS:
        return _tuple_text(column)
    if name in WORDS:
        return column
    return pc.fill_null(_number_text(column), "0" if name == "C" else "")


def _number_text(values: pa.Array) -> pa.Array:
    """Numbers as text; nulls stay null."""
    if pa.types.is_integer(values.type):
        return values.cast(pa.string())
    hundredths = np.rint(np.asarray(pc.fill_null(values, 0.0)) * _HUNDRED).astype(np.int64)
    sign = pa.array(np.where(hundredths < 0, "-", ""), type=pa.string())
    whole = pa.array(np.abs(hundredths) // _HUNDRED).cast(pa.string())
    ending = _ENDINGS.take(pa.array(np.abs(hundredths) % _HUNDRED))
    text = pc.binary_join_element_wise(sign, whole, ending, "")
    return pc.if_else(pc.is_valid(values), text, pa.scalar(None, pa.string()))


def _tuple_text(column: pa.ListArray) -> pa.Array:
    """Cells with one tuple per vehicle."""
    parts = [_number_text(part) for part in column.flatten().flatten()]
    inside = pc.binary_join_element_wise(*parts, ",")
    tuples = pc.binary_join_element_wise("(", inside, ")", "")
    lengths = np.asarray(pc.list_value_length(column))
    offsets = pa.array(np.concatenate([[0], np.cumsum(lengths)]), type=pa.int32())
    return pc.binary_join(pa.ListArray.from_arrays(offsets, tuples), BETWEEN_TUPLES)


def _column_values(name: str, cells: pa.StringArray) -> pa.Array:
    """The values of one column."""
    if name in VEHICLE_COLUMNS:
        return _tuple_values(name, cells)
    if name in WORDS:
        _check(name, cells, pc.is_in(cells, pa.array(WORDS[name])), f"one of {_listed(name)}")
        return cells
    return _number_values(name, cells)


def _listed(name: str) -> str:
    """The words that a column may hold, for a message."""
    return ", ".join(WORDS[name])


def _number_values(name: str, cells: pa.StringArray) -> pa.Array:
    """The values of a column with one number per cell."""
    kind = SCHEMA.field(name).type
    pattern, expected = (
        (_INTEGER, "a whole number") if pa.types.is_integer(kind) else (_NUMBER, "a number")
    )
    is_empty = pc.equal(cells, "")
    is_number = pc.match_substring_regex(cells, f"^{pattern}$")
    may_be_empty = name in NULLABLE
    _check(name, cells, pc.or_(is_number, is_empty) if may_be_empty else is_number, expected)
    numbers = pc.if_else(is_empty, pa.scalar(None, pa.string()), cells)
    values = _cast(name, cells, numbers, kind)
    if name == "C":
        return pc.if_else(pc.equal(values, 0), pa.scalar(None, kind), values)
    is_right = pc.greater_equal(values, pa.scalar(0, kind))
    if name in _LARGEST:
        is_right = pc.and_(is_right, pc.less_equal(values, pa.scalar(_LARGEST[name], kind)))
    expected = f"0 to {_LARGEST[name]}" if name in _LARGEST else "not less than 0"
    _check(name, cells, pc.fill_null(is_right, fill_value=True), expected)
    return values


def _cast(
    name: str, cells: pa.StringArray, numbers: pa.Array, kind: pa.DataType, rows: pa.Array = None
) -> pa.Array:
    """Text to numbers, where the text is known to be one but may be too large for the type.

    Args:
        name: Name of the column.
        cells: The column's cells.
        numbers: The texts, one per cell or, with `rows`, any number of them.
        kind: The type wanted.
        rows: Row of each text.
    """
    bare = pc.replace_substring_regex(numbers, r"^\+", "")  # Arrow reads no leading plus sign.
    if not pa.types.is_integer(kind):
        return bare.cast(kind)
    wide = bare.cast(pa.int64())
    largest = 2 ** (kind.bit_width - 1) - 1
    within = pc.fill_null(pc.less_equal(pc.abs(wide), largest), fill_value=True)
    _check(name, cells, within, f"at most {largest}", rows)
    return wide.cast(kind)


def _tuple_values(name: str, cells: pa.StringArray) -> pa.ListArray:
    """The values of a column with one tuple per vehicle in each cell."""
    fields = (("id", pa.int32()), *VEHICLE_COLUMNS[name])
    number = [_INTEGER if pa.types.is_integer(kind) else _NUMBER for _, kind in fields]
    one = r"\(\s*" + r"\s*,\s*".join(number) + r"\s*\)"
    fits = pc.match_substring_regex(cells, rf"^\s*{one}(\s*;?\s*{one})*\s*;?\s*$")
    names = ", ".join(field for field, _ in fields)
    _check(name, cells, fits, f"tuples ({names}) separated by semicolons")
    bare = pc.replace_substring_regex(cells, r"^\s*\(\s*|\s*\)\s*;?\s*$", "")
    tuples = pc.split_pattern_regex(bare, r"\s*\)\s*;?\s*\(\s*")
    parts = pc.split_pattern_regex(tuples.flatten(), r"\s*,\s*").flatten()
    rows = pc.list_parent_indices(tuples)
    values = []
    for position, (_, kind) in enumerate(fields):
        texts = parts.take(pa.array(np.arange(position, len(parts), len(fields))))
        values.append(_cast(name, cells, texts, kind, rows))
    structs = pa.StructArray.from_arrays(values, names=[field for field, _ in fields])
    return pa.ListArray.from_arrays(tuples.offsets, structs)


def _check_ids(values: dict[str, pa.Array], columns: dict[str, pa.StringArray]) -> None:
    """Every tuple column names the same vehicles, and the ego and its partner are among them."""
    lengths, ids = _ids(values["Dim"])
    rows = np.repeat(np.arange(len(lengths)), lengths)
    expected = "the ids of column Dim, in the same order"
    for name in VEHICLE_COLUMNS:
        own_lengths, own_ids = _ids(values[name])
        _check(name, columns[name], pa.array(own_lengths == lengths), expected)
        _check(name, columns[name], pa.array(own_ids == ids), expected, pa.array(rows))
    for name in ("IDego", "C"):
        named = np.asarray(pc.fill_null(values[name], 0))
        is_known = np.bincount(rows, ids == named[rows], minlength=len(lengths)) > 0
        is_right = pc.or_(pa.array(is_known), pc.is_null(values[name]))
        _check(name, columns[name], is_right, "one of the ids of column Dim")


def _ids(vehicles: pa.ListArray) -> tuple[np.ndarray, np.ndarray]:
    """Number of tuples in each cell, and the ids of all of them in turn."""
    return np.asarray(pc.list_value_length(vehicles)), np.asarray(vehicles.flatten().field("id"))


def _check(
    name: str, cells: pa.Array, is_right: pa.Array, expected: str, rows: pa.Array = None
) -> None:
    """Refuse the first cell that is not right; `rows` gives the row of each value checked."""
    wrong = pc.index(pc.fill_null(is_right, fill_value=False), value=False).as_py()
    if wrong >= 0:
        row = wrong if rows is None else rows[wrong].as_py()
        raise CellError(row=row, column=name, expected=expected, got=cells[row].as_py() or "")
