"""Columns of a table as NumPy arrays: numbers, and texts as codes of distinct values."""

# pyarrow ships no types, and it creates its compute functions at import.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from overtaking.recordings.column_request import TEXT, ReadTable, RowPlaces
from overtaking.recordings.messages import shown
from overtaking.recordings.table_csv import MISSING_WORDS
from overtaking.recordings.table_errors import refused, refused_cell

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask

MISSING = -1
"""Code of a missing text. As an index it selects the last element of an array, so arrays that are
indexed by codes end with the element for missing texts."""


@dataclass(frozen=True, slots=True)
class TextColumn:
    """A column of texts.

    Attributes:
        texts: The distinct texts, composed in Unicode's form NFC, shape (text,).
        code: Index of the text of each row, `MISSING` for an empty cell, shape (row,).
    """

    texts: NDArray[np.object_]
    code: I64

    @classmethod
    def of(cls, column: pa.ChunkedArray) -> TextColumn:
        """The column of a dictionary-encoded Arrow column."""
        encoded = column.unify_dictionaries().combine_chunks()
        if isinstance(encoded, pa.ChunkedArray):
            encoded = encoded.chunk(0) if encoded.num_chunks else pa.array([], column.type)
        texts = pc.utf8_normalize(encoded.dictionary.cast(TEXT), form="NFC")
        code = pc.fill_null(encoded.indices, MISSING).to_numpy(zero_copy_only=False)
        return cls(np.array(texts.to_pylist(), np.object_), code.astype(np.int64)).merged(texts)

    def merged(self, texts: pa.Array) -> TextColumn:
        """The column with replaced texts; equal texts are merged, and empty ones become missing.

        Args:
            texts: The replacement of each element of `self.texts`, shape (text,).
        """
        different = texts.dictionary_encode()
        new_code = different.indices.fill_null(MISSING).to_numpy(zero_copy_only=False)
        values = np.array(different.dictionary.to_pylist(), np.object_)
        is_missing = np.append(values == "", True)
        new_code = np.where(is_missing[new_code], MISSING, new_code)
        return TextColumn(values, np.append(new_code, MISSING)[self.code].astype(np.int64))

    def words(self, meaningful: Collection[str] = ()) -> TextColumn:
        """The column without blanks around texts and without ".0" after whole numbers.

        pandas writes whole numbers of a column with missing cells with ".0". Words for missing
        cells, such as "NA", become missing.

        Args:
            meaningful: Words that are values although they look like a missing cell.
        """
        texts = pc.utf8_trim_whitespace(pa.array(self.texts, TEXT))
        texts = pc.replace_substring_regex(texts, r"^([+-]?\d+)\.0*$", r"\1")
        missing = [word for word in MISSING_WORDS if word not in meaningful]
        return self.merged(pc.if_else(pc.is_in(texts, pa.array(missing)), "", texts))

    @property
    def is_missing(self) -> Mask:
        """Whether each cell is empty, shape (row,)."""
        return self.code == MISSING

    def is_text(self, text: str) -> Mask:
        """Whether each cell holds a text, shape (row,)."""
        return np.append(self.texts == text, False)[self.code]

    def text(self, row: int) -> str:
        """The text of a row; empty if it is missing."""
        return "" if self.code[row] == MISSING else str(self.texts[self.code[row]])

    def select(self, rows: Mask | I64) -> TextColumn:
        """The rows of a mask or of indices."""
        return TextColumn(self.texts, self.code[rows])


@dataclass(frozen=True, slots=True)
class ArrayTable:
    """Columns of a table as arrays.

    Attributes:
        file_name: Name of the table in messages.
        numbers: Columns of numbers by name, NaN where a cell is missing, shape (row,) each.
        texts: Columns of texts by name.
        row: Index of each row in the file, from 0, shape (row,).
        places: Names of the places of rows in the file, such as "line 7".
    """

    file_name: str
    numbers: dict[str, F64]
    texts: dict[str, TextColumn]
    row: I64
    places: RowPlaces

    @classmethod
    def of(
        cls, content: ReadTable, file_name: str, meaningful: Mapping[str, Collection[str]]
    ) -> ArrayTable:
        """The arrays of an Arrow table.

        Args:
            content: The table.
            file_name: Name of the table in messages.
            meaningful: For each column of words, the words that are values although they look like
                a missing cell. Texts of other columns are unchanged.
        """
        numbers: dict[str, F64] = {}
        texts: dict[str, TextColumn] = {}
        for name in content.table.column_names:
            column = content.table[name]
            if pa.types.is_dictionary(column.type):
                text_column = TextColumn.of(column)
                words = meaningful.get(name)
                texts[name] = text_column if words is None else text_column.words(words)
            else:
                numbers[name] = np.asarray(column)
        row = np.arange(content.table.num_rows)
        return cls(file_name, numbers, texts, row, content.places)

    @property
    def num_rows(self) -> int:
        """Number of rows."""
        return len(self.row)

    def place(self, row: int) -> str:
        """Place in the file of a row of this table, for messages."""
        return self.places.name(int(self.row[row]))

    def cell(self, name: str, row: int) -> str:
        """A cell as messages show it."""
        if name in self.texts:
            return self.texts[name].text(row) or "an empty cell"
        number = float(self.numbers[name][row])
        return "an empty cell" if np.isnan(number) else f"{number:.12g}"

    def check(self, is_right: Mask, name: str, expected: str) -> None:
        """Refuse a column with a wrong cell.

        Args:
            is_right: Whether the cell of each row is right, shape (row,).
            name: Name of the column.
            expected: A description of a right cell.

        Raises:
            ImportFormatError: A cell is wrong; the message names the first one.
        """
        if not is_right.all():
            row = int(np.argmin(is_right))
            got = self.cell(name, row)
            raise refused_cell(self.file_name, self.place(row), name, expected, got)

    def select(self, rows: Mask | I64) -> ArrayTable:
        """The rows of a mask or of indices."""
        if rows.dtype == np.bool_ and rows.all():  # Avoids a copy of all columns.
            return self
        return replace(
            self,
            numbers={name: cells[rows] for name, cells in self.numbers.items()},
            texts={name: cells.select(rows) for name, cells in self.texts.items()},
            row=self.row[rows],
        )

    def differs(self, name: str, rows: I64, others: I64) -> Mask:
        """Whether cells of a column differ between two rows; two missing cells are equal.

        Args:
            name: Name of the column.
            rows: Indices of rows.
            others: Index of the row to compare with each, same shape.
        """
        if name in self.texts:
            code = self.texts[name].code
            return code[rows] != code[others]
        first, second = self.numbers[name][rows], self.numbers[name][others]
        return (first != second) & ~(np.isnan(first) & np.isnan(second))

    def choose(self, only: Mapping[str, str]) -> ArrayTable:
        """The rows in which columns have required values.

        Args:
            only: Required value of each column; columns that this table lacks are ignored.

        Raises:
            ImportFormatError: No row has all these values.
        """
        is_chosen = np.ones(self.num_rows, np.bool_)
        conditions: list[str] = []  # A message about a combination names all of its columns.
        for name, value in only.items():
            if name in self.texts:
                is_chosen &= self.texts[name].words().is_text(value)
            elif name in self.numbers:
                is_chosen &= _is_number(self.numbers[name], value)
            else:
                continue
            conditions.append(f"{shown(name)}={shown(value)}")
            if not is_chosen.any():
                what = f"rows with {' and '.join(conditions)}"
                raise refused(self.file_name, what, "at least one", "none")
        return self.select(is_chosen)


def _is_number(numbers: F64, value: str) -> Mask:
    """Whether numbers equal a value that the user wrote as text: "12" equals 12.0."""
    try:
        return numbers == float(value)
    except ValueError:  # A word equals no number.
        return np.zeros(len(numbers), np.bool_)
