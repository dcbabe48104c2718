"""Rows of a table as arrays: numbers, and texts of which each different one stands once."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
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
"""Code of a missing text."""


@dataclass(frozen=True, slots=True)
class TextColumn:
    """Texts of rows.

    Attributes:
        texts: The different texts, composed in Unicode's form NFC, shape (text,).
        code: Index of the text of each row, `MISSING` for an empty cell, shape (row,).
    """

    texts: NDArray[np.object_]
    code: I64

    @classmethod
    def of(cls, column: pa.ChunkedArray) -> TextColumn:
        """The texts of a column of dictionaries."""
        encoded = column.unify_dictionaries().combine_chunks()
        if isinstance(encoded, pa.ChunkedArray):
            encoded = encoded.chunk(0) if encoded.num_chunks else pa.array([], column.type)
        texts = pc.utf8_normalize(encoded.dictionary.cast(TEXT), form="NFC")
        code = pc.fill_null(encoded.indices, MISSING).to_numpy(zero_copy_only=False)
        return cls(np.array(texts.to_pylist(), np.object_), code.astype(np.int64)).merged(texts)

    def merged(self, texts: pa.Array) -> TextColumn:
        """The column with other texts, of which equal ones become one and empty ones are missing.

        Args:
            texts: The new text in place of each of `texts`.
        """
        different = texts.dictionary_encode()
        new_code = different.indices.fill_null(MISSING).to_numpy(zero_copy_only=False)
        values = np.array(different.dictionary.to_pylist(), np.object_)
        is_missing = np.append(values == "", True)  # The last place is that of `MISSING`.
        new_code = np.where(is_missing[new_code], MISSING, new_code)
        # The last place is that of `MISSING`.
        return TextColumn(values, np.append(new_code, MISSING)[self.code].astype(np.int64))

    def words(self, meaningful: Collection[str] = ()) -> TextColumn:
        """The texts without blanks around them, and whole numbers without the ".0" of pandas.

        Args:
            meaningful: Texts that count as they stand even if they look like a missing cell.
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
        """Text of a row."""
        return "" if self.code[row] == MISSING else str(self.texts[self.code[row]])

    def select(self, rows: Mask | I64) -> TextColumn:
        """Some of the rows."""
        return TextColumn(self.texts, self.code[rows])


@dataclass(frozen=True, slots=True)
class ArrayTable:
    """Rows of a table as arrays.

    Attributes:
        file_name: Name of the table in messages.
        numbers: Columns of numbers, NaN where a cell is missing, shape (row,).
        texts: Columns of texts.
        row: Index of each row in the file, from 0, shape (row,).
        places: Where the rows are in the file.
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
        """The columns of a table that was read.

        Args:
            content: The table.
            file_name: Name of the table in messages.
            meaningful: For columns of words, the texts that are no missing cell; texts of other
                columns stay as they stand.
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
        """Place in the file of one of these rows, for messages."""
        return self.places.name(int(self.row[row]))

    def cell(self, name: str, row: int) -> str:
        """A cell as it is shown in messages."""
        if name in self.texts:
            return self.texts[name].text(row) or "an empty cell"
        number = float(self.numbers[name][row])
        return "an empty cell" if np.isnan(number) else f"{number:.12g}"

    def check(self, is_right: Mask, name: str, expected: str) -> None:
        """Raise the error for the first cell of a column that is not right."""
        if not is_right.all():
            row = int(np.argmin(is_right))
            got = self.cell(name, row)
            raise refused_cell(self.file_name, self.place(row), name, expected, got)

    def select(self, rows: Mask | I64) -> ArrayTable:
        """Some of the rows."""
        if rows.dtype == np.bool_ and rows.all():
            return self
        return replace(
            self,
            numbers={name: cells[rows] for name, cells in self.numbers.items()},
            texts={name: cells.select(rows) for name, cells in self.texts.items()},
            row=self.row[rows],
        )

    def differs(self, name: str, rows: I64, others: I64) -> Mask:
        """Whether the cells of two rows differ, and not both are missing; shape of `rows`."""
        if name in self.texts:
            code = self.texts[name].code
            return code[rows] != code[others]
        first, second = self.numbers[name][rows], self.numbers[name][others]
        return (first != second) & ~(np.isnan(first) & np.isnan(second))

    def choose(self, only: Mapping[str, str]) -> ArrayTable:
        """The rows in which each column of `only` has the value that is stated for it.

        Raises:
            ImportFormatError: No row has these values.
        """
        is_chosen = np.ones(self.num_rows, np.bool_)
        for name, value in only.items():
            if name in self.texts:
                is_chosen &= self.texts[name].words().is_text(value)
            elif name in self.numbers:
                is_chosen &= _is_number(self.numbers[name], value)
            if not is_chosen.any():
                what = f"rows with {shown(name)}={shown(value)}"
                raise refused(self.file_name, what, "at least one", "none")
        return self.select(is_chosen)


def _is_number(numbers: F64, value: str) -> Mask:
    """Whether cells have a value that the user states as text: 12 is also 12.0 among numbers."""
    try:
        return numbers == float(value)
    except ValueError:  # A word is in no column of numbers.
        return np.zeros(len(numbers), np.bool_)
