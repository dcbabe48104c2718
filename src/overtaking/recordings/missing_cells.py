"""Missing cells of a table: rows that are left out, and values that are interpolated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.table_errors import refused_cell

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask
    from overtaking.recordings.array_table import ArrayTable

MAX_MISSING_SHARE = 0.05
"""Largest share of rows that may lack a cell of a column."""

_MAX_NAMED_VEHICLES = 10  # With more vehicles, one finding stands for all of them.


def check_missing(
    table: ArrayTable, column: str, is_missing: Mask, is_counted: Mask, advice: str
) -> None:
    """Refuse a column in which more than `MAX_MISSING_SHARE` of the cells are missing.

    Args:
        table: The table.
        column: The name of the column.
        is_missing: Whether each row lacks the cell, shape (row,).
        is_counted: Whether each row counts, same shape; others may lack the cell.
        advice: What the user can do, for the message.

    Raises:
        ImportFormatError: The cell is missing in too many rows.
    """
    is_missing = is_missing & is_counted
    count, total = int(is_missing.sum()), int(is_counted.sum())
    if count > MAX_MISSING_SHARE * total:
        raise refused_cell(
            table.file_name,
            table.place(int(np.argmax(is_missing))),
            column,
            f"a value in {1.0 - MAX_MISSING_SHARE:.0%} of the rows",
            f"an empty cell here and in {count} of {total} rows ({advice})",
        )


def missing_findings(
    column: str,
    rows: I64,
    seconds: F64,
    vehicle: I64,
    names: NDArray[np.object_],
    *,
    is_left_out: bool,
) -> list[Finding]:
    """Report missing cells of a column, one finding for each vehicle or one for all.

    Args:
        column: The name of the column.
        rows: Index of each row that lacks the cell, shape (missing,).
        seconds: Time of each row of the table, NaN where it is missing, shape (row,) [s].
        vehicle: Index of the vehicle of each row, negative where it is missing, same shape.
        names: Name of each vehicle, shape (vehicle,).
        is_left_out: Whether the rows are left out, or only the values.
    """
    if not len(rows):
        return []
    vehicles = np.unique(vehicle[rows])
    groups = [(index, rows[vehicle[rows] == index]) for index in vehicles.tolist()]
    if len(groups) > _MAX_NAMED_VEHICLES:
        groups = [(-1, rows)]
    findings: list[Finding] = []
    for index, group in groups:
        times = seconds[group][~np.isnan(seconds[group])]
        is_single = len(group) == 1
        cells = "1 cell is" if is_single else f"{len(group)} cells are"
        if is_left_out:
            effect = "its row is left out" if is_single else "their rows are left out"
        else:
            effect = "its value is unknown" if is_single else "their values are unknown"
        findings.append(
            Finding(
                check=Check.MISSING_CELLS,
                consequence=Consequence.LEFT_OUT,
                detail=f"column {column}: {cells} missing; {effect}",
                rows=len(group),
                vehicle=str(names[index]) if index >= 0 else None,
                first_time_s=float(times.min()) if len(times) else None,
            )
        )
    return findings


def fill_missing(values: Mapping[str, F64], track: I64, seconds: F64) -> dict[str, F64]:
    """Fill missing values by linear interpolation between rows of the track.

    Before the first and after the last value of a track, that value is repeated. Where a whole
    track lacks a quantity, it is computed from positions.

    Args:
        values: Quantities by the names of `column_map.QUANTITIES`, NaN where a value is missing,
            shape (row,) each. Positions are complete.
        track: Index of the track of each row, ascending, same shape.
        seconds: Time of each row, ascending within a track, same shape [s].

    Returns:
        The quantities without missing values.
    """
    filled = dict(values)
    for name, cells in values.items():
        is_missing = np.isnan(cells)
        if not is_missing.any():
            continue
        # The nearest rows before and after each row that have a value, -1 or the number of rows
        # where there is no such row. They may belong to other tracks.
        rows = np.arange(len(cells))
        before = np.maximum.accumulate(np.where(is_missing, -1, rows))
        after = np.minimum.accumulate(np.where(is_missing, len(cells), rows)[::-1])[::-1]
        missing = np.flatnonzero(is_missing)
        first, last = before[missing], after[missing]
        has_value_before = (first >= 0) & (track[np.maximum(first, 0)] == track[missing])
        inside = np.minimum(last, len(cells) - 1)
        has_value_after = (last < len(cells)) & (track[inside] == track[missing])
        first, last = (
            np.where(has_value_before, first, inside),
            np.where(has_value_after, last, first),
        )
        first, last = np.maximum(first, 0), np.clip(last, 0, len(cells) - 1)
        change = cells[last] - cells[first]
        if name == "heading":  # Turn by at most half a circle.
            change -= 2.0 * np.pi * np.round(change / (2.0 * np.pi))
        elapsed = seconds[last] - seconds[first]
        share = (seconds[missing] - seconds[first]) / np.where(elapsed > 0.0, elapsed, 1.0)
        new_cells = cells.copy()
        new_cells[missing] = cells[first] + np.where(elapsed > 0.0, share, 0.0) * change
        is_track_empty = ~has_value_before & ~has_value_after
        if is_track_empty.any():
            derived = _derive_from_positions(name, values, track, seconds)
            new_cells[missing[is_track_empty]] = derived[missing[is_track_empty]]
        filled[name] = new_cells
    return filled


def _derive_from_positions(name: str, values: Mapping[str, F64], track: I64, seconds: F64) -> F64:
    """Compute a quantity from positions by central differences, shape (row,).

    At the ends of a track they are one-sided; a track of one row stands still. Units are those of
    `column_map.QUANTITIES`.
    """
    rows = np.arange(len(track))
    is_first_row = np.append(True, np.diff(track) != 0)
    is_last_row = np.append(is_first_row[1:], True)
    before, after = np.where(is_first_row, rows, rows - 1), np.where(is_last_row, rows, rows + 1)
    elapsed = seconds[after] - seconds[before]

    def rate(cells: F64) -> F64:
        return (cells[after] - cells[before]) / np.where(elapsed > 0.0, elapsed, np.inf)

    vx, vy = rate(values["x"]), rate(values["y"])
    speed = np.hypot(vx, vy)
    ax, ay = rate(vx), rate(vy)
    nonzero_speed = np.where(speed > 0.0, speed, np.inf)
    accel_lon, accel_lat = (ax * vx + ay * vy) / nonzero_speed, (ay * vx - ax * vy) / nonzero_speed
    quantities = {
        "vx": vx, "vy": vy, "speed": speed, "heading": np.arctan2(vy, vx), "ax": ax, "ay": ay,
        "accel_lon": accel_lon, "accel_lat": accel_lat, "yaw_rate": accel_lat / nonzero_speed,
    }  # fmt: skip
    return quantities[name]
