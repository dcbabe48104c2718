"""Sorted rows of the table of states: faulty rows, repeated rows, and division into tracks."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from overtaking.recordings.column_map import LEFT_OUT
from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.gaps import is_long_gap
from overtaking.recordings.motion_check import FaultyRows, find_faulty_rows
from overtaking.recordings.rows import ON_GRID
from overtaking.recordings.table_errors import refused_cell

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask
    from overtaking.recordings.array_table import ArrayTable

_MAX_SPEED = 150.0
"""Where an id moves faster than this between two rows, a second vehicle has taken it over [m/s]."""

_MAX_SPEED_RATIO = 20.0
"""A jump must also exceed the median speed by this factor. With positions in a wrong unit, all rows
exceed `_MAX_SPEED`; each would be a track of its own, and `recording_checks`, which reports the
unit, would have no speeds to compare."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateRows:
    """Rows of the table of states in order of vehicle and time; arrays have shape (row,).

    Attributes:
        table: The cells of the rows.
        names: Name of each vehicle, shape (vehicle,).
        vehicle: Index of the vehicle.
        seconds: Time as the file counts [s].
        frame_time: Time [frames].
        x: Position in the axes of the table [m].
        y: Position in the axes of the table [m].
        type_code: A `VehicleKind`, or `BY_LENGTH`, `LEFT_OUT` or `NOT_KNOWN` of `column_map`.
        is_incomplete: Whether the row lacks a quantity that changes from row to row.
        place: Index of the row among the sorted rows before any were left out.
    """

    table: ArrayTable
    names: NDArray[np.object_]
    vehicle: I64
    seconds: F64
    frame_time: F64
    x: F64
    y: F64
    type_code: I64
    is_incomplete: Mask
    place: I64

    @property
    def num_rows(self) -> int:
        """Number of rows."""
        return len(self.vehicle)

    def select(self, is_selected: Mask) -> StateRows:
        """The selected rows.

        Args:
            is_selected: Whether each row is selected, shape (row,).
        """
        if is_selected.all():  # Avoids a copy of all columns.
            return self
        names = {field.name for field in fields(self)} - {"table", "names"}
        arrays = {name: getattr(self, name)[is_selected] for name in names}
        return replace(self, table=self.table.select(is_selected), **arrays)


def faulty_rows(states: StateRows, interval_ms: int) -> FaultyRows:
    """Find faulty positions, except in rows of repeated times and of vehicles that are left out.

    Args:
        states: The rows.
        interval_ms: Time between frames [ms].

    Returns:
        Indices in `states` of faulty rows and jumps.
    """
    vehicle, frame_time, x, y = states.vehicle, states.frame_time, states.x, states.y
    is_compared = states.type_code != LEFT_OUT
    # Two rows of one time have no speed between them; `find_repeated` compares them instead.
    is_repeated = (np.diff(vehicle) == 0) & (np.diff(frame_time) <= ON_GRID)
    is_compared[1:] &= ~is_repeated
    is_compared[:-1] &= ~is_repeated
    if is_compared.all():
        return find_faulty_rows(vehicle, frame_time, x, y, interval_ms)
    rows = np.flatnonzero(is_compared)
    faulty = find_faulty_rows(vehicle[rows], frame_time[rows], x[rows], y[rows], interval_ms)
    return replace(faulty, row=rows[faulty.row], jump=rows[faulty.jump])


def track_of_rows(states: StateRows, interval_ms: int) -> I64:
    """Index of the track of each row, shape (row,). After a long gap or a jump a new track begins.

    Args:
        states: The rows.
        interval_ms: Time between frames [ms].
    """
    is_same = np.diff(states.vehicle) == 0
    apart = np.where(is_same, np.diff(states.frame_time), 1.0)
    is_repeated = apart <= ON_GRID
    elapsed = np.where(is_repeated, 1.0, apart) * (interval_ms * 1e-3)
    speed = np.hypot(np.diff(states.x), np.diff(states.y)) / elapsed
    median_speed = float(np.median(speed[is_same])) if is_same.any() else 0.0
    is_jump = (speed > max(_MAX_SPEED, _MAX_SPEED_RATIO * median_speed)) & ~is_repeated
    is_gap = is_long_gap(states.vehicle, states.frame_time, interval_ms)
    return np.append(0, np.cumsum(~is_same | is_gap | is_jump))


def find_repeated(
    states: StateRows, time_name: str, time_column: str, ignored: Iterable[str]
) -> Mask:
    """Whether a row repeats the vehicle and time of the row before it, shape (row,).

    Args:
        states: The rows; among rows of one vehicle and time, complete rows come first.
        time_name: "time" or "frame".
        time_column: The column of times or frames.
        ignored: Columns that may differ.

    Raises:
        ImportFormatError: Two complete rows of a vehicle at one time differ.
    """
    table, vehicle = states.table, states.vehicle
    is_same_time = np.append(
        False, (np.diff(vehicle) == 0) & (np.diff(states.frame_time) <= ON_GRID)
    )
    # An incomplete row adds nothing to the complete one before it, so its cells are not compared.
    later = np.flatnonzero(is_same_time & ~states.is_incomplete)
    columns = [name for name in (*table.numbers, *table.texts) if name not in set(ignored)]
    differs = {name: table.differs(name, later, later - 1) for name in columns}
    is_conflict = np.logical_or.reduce([*differs.values()])
    if not is_conflict.any():
        return is_same_time
    first = int(np.argmax(is_conflict))
    row = int(later[first])
    name = next(name for name, cells in differs.items() if cells[first])
    conflict = " and ".join(f"{name} {table.cell(name, k)}" for k in (row - 1, row))
    raise refused_cell(
        table.file_name,
        table.place(row),
        time_column,
        f"another {time_name} of vehicle {states.names[vehicle[row]]} than in "
        f"{table.place(row - 1)}, or the same values",
        f"{time_name} {table.cell(time_column, row)} again, with {conflict} "
        "(choose a part: --only COLUMN=VALUE)",
    )


def repeated_findings(states: StateRows, is_repeated: Mask) -> list[Finding]:
    """Report repeated rows, one finding for each vehicle.

    Args:
        states: The rows.
        is_repeated: Result of `find_repeated`, shape (row,).
    """
    rows = np.flatnonzero(is_repeated)
    owners, first_places, counts = np.unique(
        states.vehicle[rows], return_index=True, return_counts=True
    )
    return [
        Finding(
            check=Check.DUPLICATE_ROWS,
            consequence=Consequence.LEFT_OUT,
            detail=f"{count} rows repeat the vehicle and time of another",
            rows=int(count),
            vehicle=str(states.names[owner]),
            first_time_s=float(states.seconds[rows[place]]),
        )
        for owner, place, count in zip(owners, first_places, counts, strict=True)
    ]
