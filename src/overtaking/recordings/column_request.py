"""The columns to read of a table, and where its rows are in the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from overtaking.recordings.column_matching import match_columns

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from overtaking.core.arrays import I64

TEXT, NUMBER = pa.string(), pa.float64()

TIME = pa.timestamp("ns")
"""Type of a column of instants: numbers, dates, durations or texts of ISO 8601. A table that was
read has float64 in such a column."""

MAX_MAGNITUDE = 1.0e6
"""No metre, second or number of a frame in half an hour of a motorway is larger."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnRequest:
    """The columns to read of a table.

    Attributes:
        types: `TEXT`, `NUMBER` or `TIME` by the name in the map of columns.
        limits: Largest size of the numbers of some columns; `MAX_MAGNITUDE` for the others.
        gaps: Columns in which cells may be missing.
        units: Unit of some columns in the map of columns.
        known_units: Units that a header may have.
        time_unit: Unit of instants in the map [s]; dates and durations are converted into it.
        has_time_unit: Whether the map states that unit.
        header: Names of all columns of a text file that has none.
        thousands: Separator of thousands, "." or ","; "none" without any; None if the map does not
            say.
    """

    types: Mapping[str, pa.DataType]
    limits: Mapping[str, float] = field(default_factory=dict[str, float])
    gaps: Collection[str] = ()
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    known_units: Collection[str] = ()
    time_unit: float = 1.0
    has_time_unit: bool = True
    header: Sequence[str] = ()
    thousands: str | None = None

    @property
    def num_columns(self) -> int:
        """Number of columns."""
        return len(self.types)

    def match(
        self, names: Sequence[str], where: str, index_names: Iterable[str] = ()
    ) -> dict[str, str]:
        """The name in a table of each column; see `match_columns`."""
        return match_columns(
            names,
            self.types,
            where,
            units=self.units,
            known_units=self.known_units,
            index_names=index_names,
        )


@dataclass(frozen=True, slots=True)
class RowPlaces:
    """Where the rows of a table are in its file.

    Attributes:
        word: What a row is called: "line" of a text file, "row" of other tables.
        first: Number of the first row, counted from 1.
        dropped: Numbers of lines that are no rows, such as comments, ascending.
    """

    word: str = "row"
    first: int = 1
    dropped: I64 = field(default_factory=lambda: np.zeros(0, np.int64))

    def name(self, row: int) -> str:
        """Place of a row, counted from 0, in messages."""
        return f"{self.word} {self.line(row + self.first)}"

    def line(self, number: int) -> int:
        """Number in the file of a line that is counted without the dropped ones."""
        num_before = self.dropped - np.arange(len(self.dropped)) - 1
        return number + int(np.searchsorted(num_before, number, side="left"))


class ReadTable(NamedTuple):
    """A table that was read.

    Attributes:
        table: The requested columns, in that order. Numbers and instants are float64, NaN where a
            cell is missing; texts are as they stand, null where a cell is missing.
        places: Where its rows are in the file.
        grouped: Columns whose numbers may have separators of thousands, and an example.
    """

    table: pa.Table
    places: RowPlaces
    grouped: Mapping[str, str]
