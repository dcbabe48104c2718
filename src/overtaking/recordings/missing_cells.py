"""Missing cells of a table: rows that are left out, and values that are worked out instead."""

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
"""Share of the rows that may lack a cell of a column."""

_MAX_NAMED_VEHICLES = 10  # With more of them, one finding stands for all.


def check_missing(
    table: ArrayTable, column: str, is_missing: Mask, is_counted: Mask, result: str
) -> None:
    """Refuse a column in which more than `MAX_MISSING_SHARE` of the cells are missing.

    Args:
        table: The table.
        column: The column.
        is_missing: Whether each row lacks the cell, shape (row,).
        is_counted: Whether each row counts, same shape.
        result: What the user can do.

    Raises:
        ImportFormatError: Too many are missing.
    """
    is_missing = is_missing & is_counted
    count, total = int(is_missing.sum()), int(is_counted.sum())
    if count > MAX_MISSING_SHARE * total:
        raise refused_cell(
            table.file_name,
            table.place(int(np.argmax(is_missing))),
            column,
            f"a value in {1.0 - MAX_MISSING_SHARE:.0%} of the rows",
            f"an empty cell here and in {count} of {total} rows ({result})",
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
    """The findings for missing cells of a column, one for each vehicle.

    Args:
        column: The column.
        rows: Index of each row that lacks the cell.
        seconds: Time of all rows, NaN where it is missing [s].
        vehicle: Index of the vehicle of all rows, negative where it is missing.
        names: Names of the vehicles.
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
    """Quantities in which missing values are interpolated, linearly between rows of the track.

    Where a whole track lacks a quantity, it is worked out from positions.

    Args:
        values: Quantities by the names of `column_map.QUANTITIES`, NaN where a value is missing,
            shape (row,) each. Positions are complete.
        track: Index of the track of each row, ascending, same shape.
        seconds: Time of each row, ascending within a track, same shape [s].
    """
    filled = dict(values)
    for name, cells in values.items():
        is_missing = np.isnan(cells)
        if not is_missing.any():
            continue
        rows = np.arange(len(cells))
        before = np.maximum.accumulate(np.where(is_missing, -1, rows))
        after = np.minimum.accumulate(np.where(is_missing, len(cells), rows)[::-1])[::-1]
        missing = np.flatnonzero(is_missing)
        first, last = before[missing], after[missing]
        has_first = (first >= 0) & (track[np.maximum(first, 0)] == track[missing])
        inside = np.minimum(last, len(cells) - 1)
        has_last = (last < len(cells)) & (track[inside] == track[missing])
        first, last = np.where(has_first, first, inside), np.where(has_last, last, first)
        first, last = np.maximum(first, 0), np.clip(last, 0, len(cells) - 1)
        change = cells[last] - cells[first]
        if name == "heading":  # The shorter way round.
            change -= 2.0 * np.pi * np.round(change / (2.0 * np.pi))
        elapsed = seconds[last] - seconds[first]
        share = (seconds[missing] - seconds[first]) / np.where(elapsed > 0.0, elapsed, 1.0)
        new_cells = cells.copy()
        new_cells[missing] = cells[first] + np.where(elapsed > 0.0, share, 0.0) * change
        is_alone = ~has_first & ~has_last
        if is_alone.any():
            derived = _from_positions(name, values, track, seconds)
            new_cells[missing[is_alone]] = derived[missing[is_alone]]
        filled[name] = new_cells
    return filled


def _from_positions(name: str, values: Mapping[str, F64], track: I64, seconds: F64) -> F64:
    """A quantity that changes, from the positions of the rows before and after; shape (row,)."""
    rows = np.arange(len(track))
    is_begin = np.append(True, np.diff(track) != 0)
    is_end = np.append(is_begin[1:], True)
    before, after = np.where(is_begin, rows, rows - 1), np.where(is_end, rows, rows + 1)
    elapsed = seconds[after] - seconds[before]

    def rate(cells: F64) -> F64:
        return (cells[after] - cells[before]) / np.where(elapsed > 0.0, elapsed, np.inf)

    vx, vy = rate(values["x"]), rate(values["y"])
    speed = np.hypot(vx, vy)
    ax, ay = rate(vx), rate(vy)
    moving = np.where(speed > 0.0, speed, np.inf)
    accel_lon, accel_lat = (ax * vx + ay * vy) / moving, (ay * vx - ax * vy) / moving
    quantities = {
        "vx": vx, "vy": vy, "speed": speed, "heading": np.arctan2(vy, vx), "ax": ax, "ay": ay,
        "accel_lon": accel_lon, "accel_lat": accel_lat, "yaw_rate": accel_lat / moving,
    }  # fmt: skip
    return quantities[name]
