"""Faults that are injected at random into tables of clean simulations (`simulated_tables`).

A fault that a recording can have is one more function in `FAULTS`. Where a check has a limit, the
size of the fault is drawn between two and ten times the limit (`beyond`). The docstring of a
function says what else is drawn, and which faults are not drawn because the documentation of the
check says that it cannot find them.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from tests.support.simulated_tables import (
    MAP,
    NUM_TOGETHER,
    PROFILES,
    SEED,
    simulate_profile,
    table_of,
)

from overtaking.core.errors import ImportFormatError
from overtaking.recordings import recording_checks
from overtaking.recordings.column_map import column_map
from overtaking.recordings.findings import Check
from overtaking.recordings.frame_times import CLOCK_PERIODS
from overtaking.recordings.gaps import MAX_GAP_S, MAX_OWN_INTERVAL_S, ONE_FRAME
from overtaking.recordings.missing_cells import MAX_MISSING_SHARE
from overtaking.recordings.motion_check import (
    MAX_ACCELERATION,
    MAX_DEVIATION_ACROSS,
    MAX_DEVIATION_ALONG,
    MAX_FAULTY_SHARE,
    MAX_SPEED_CHANGE_AT_END,
)
from overtaking.recordings.tables import recording_of
from overtaking.recordings.track_table import read_track_rows, track_rows_from_table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.random import Generator

    from overtaking.model.road import Road
    from overtaking.recordings.findings import Finding

_MIN_ROWS = 50  # Rows of a vehicle that gets a fault: 2.5 s at 20 Hz.


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A recording with a fault.

    Attributes:
        table: The table of states.
        columns: Changes of `MAP`, and columns that it leaves out (None).
        check: The check that finds the fault; None for a recording that is refused.
        words: Words of the finding or error: the column, for faults of the whole file.
        vehicles: Names of the vehicles that may be named; empty for the whole file.
        first_time: Time of the first row that it concerns; None for the whole file [s].
        has_road: Whether the recording lies on the road of the simulations. Positions in another
            unit do not; of such a recording only the rows are examined.
        files: For a recording of three files, the text of each by the ending of its name.
    """

    table: pd.DataFrame
    check: Check | None
    columns: Mapping[str, str | None] = field(default_factory=dict[str, str | None])
    words: tuple[str, ...] = ()
    vehicles: frozenset[str] = frozenset()
    first_time: float | None = None
    has_road: bool = True
    files: Mapping[str, str] = field(default_factory=dict[str, str])


class Examined(NamedTuple):
    """Result of the examination of a recording with one injected fault.

    Attributes:
        is_found: Whether it has a finding of the right check, or refuses the recording for it.
        is_vehicle_right: Whether such a finding names the vehicle, or for a fault of the whole file
            the column.
        is_time_right: Whether it also has the right first time, within one frame.
    """

    is_found: bool
    is_vehicle_right: bool
    is_time_right: bool


def examine_fault(fault: Fault, road: Road) -> Examined:
    """Read a recording with a fault, and compare the findings with it."""
    try:
        findings, interval = _findings(fault, road)
    except ImportFormatError as error:
        is_right = all(word in str(error) for word in fault.words) and bool(fault.words)
        return Examined(is_right, is_right, is_right)
    of_check = [finding for finding in findings if finding.check is fault.check]
    of_vehicle = [
        finding
        for finding in of_check
        if (finding.vehicle in fault.vehicles if fault.vehicles else finding.vehicle is None)
        and all(word in finding.detail for word in fault.words)
    ]
    is_time_right = any(
        finding.first_time_s is None
        if fault.first_time is None
        else finding.first_time_s is not None
        and abs(finding.first_time_s - fault.first_time) <= interval + 1e-6
        for finding in of_vehicle
    )
    return Examined(bool(of_check), bool(of_vehicle), is_time_right)


def _findings(fault: Fault, road: Road) -> tuple[tuple[Finding, ...] | list[Finding], float]:
    """The findings of a recording, and the time between its frames [s]."""
    if fault.files:
        with tempfile.TemporaryDirectory() as folder:
            for ending, text in fault.files.items():
                (Path(folder) / f"01{ending}").write_text(text, encoding="utf-8")
            columns = column_map("exid")
            rows = read_track_rows(Path(folder) / "01_tracks.csv", columns)
    else:
        cells = {**MAP["columns"], **fault.columns}
        columns = column_map(
            {**MAP, "columns": {name: cell for name, cell in cells.items() if cell is not None}}
        )
        rows = track_rows_from_table(fault.table, columns)
    interval = rows.frame_interval_ms * 1e-3
    if not fault.has_road:
        return recording_checks.check_rows(rows), interval
    return recording_of(rows, columns, "test", road=road).findings, interval


# Draws


def beyond(random: Generator, limit: float) -> float:
    """A size between two and ten times a limit."""
    return float(random.uniform(2.0, 10.0) * limit)


def _either_way(random: Generator, size: float) -> float:
    return size * float(random.choice([-1.0, 1.0]))


def _interval(table: pd.DataFrame) -> float:
    return float(np.diff(np.unique(table.t))[0])


def _vehicle_rows(
    table: pd.DataFrame, random: Generator, at_least: int = _MIN_ROWS
) -> pd.DataFrame:
    """The rows of a random vehicle with a number of them at least."""
    count = table.groupby("id").t.transform("size")
    vehicle = random.choice(table.id[count >= at_least].unique())
    return table[table.id == vehicle]


def _stretch(table: pd.DataFrame, random: Generator, most: int) -> pd.DataFrame:
    """Up to a number of adjacent rows of a random vehicle."""
    rows = _vehicle_rows(table, random)
    count = int(random.integers(1, most + 1))
    first = int(random.integers(0, len(rows) - count + 1))
    return rows.iloc[first : first + count]


def _of_rows(rows: pd.DataFrame) -> dict[str, Any]:
    """Vehicle and first time of a fault in rows of one vehicle."""
    return {
        "vehicles": frozenset({str(rows.id.iloc[0])}),
        "first_time": float(rows.t.iloc[0]),
    }


# Ids, times and cells


def missing_cells(column: str, table: pd.DataFrame, random: Generator) -> Fault:
    """Up to 20 cells in adjacent rows of a vehicle."""
    rows = _stretch(table, random, 20)
    cells = table[column].astype(object)
    cells[rows.index] = None
    changed = table.assign(**{column: cells})
    place = _of_rows(rows)
    if column == "id":
        place["vehicles"] = frozenset()
    if column == "t":
        place["first_time"] = None
    return Fault(
        table=changed if column == "kind" else changed.astype({column: float}),
        check=Check.MISSING_CELLS,
        words=(f"column {column}:",),
        **place,
    )


def too_many_missing_cells(table: pd.DataFrame, random: Generator) -> Fault:
    """A share of the cells of a column, which is refused; sizes and types may be missing."""
    column = str(random.choice(["id", "t", "x", "y", "v", "vx", "vy", "heading", "a"]))
    count = round(beyond(random, MAX_MISSING_SHARE) * len(table))
    cells = table[column].astype(float)
    cells[random.choice(table.index, count, replace=False)] = np.nan
    words = (f"column {column}", f"in {count} of {len(table)} rows")
    return Fault(table=table.assign(**{column: cells}), check=None, words=words)


def repeated_rows(table: pd.DataFrame, random: Generator) -> Fault:
    """Up to 20 adjacent rows of a vehicle that are anywhere in the file once more."""
    rows = _stretch(table, random, 20)
    changed = pd.concat([table, rows]).sample(frac=1.0, random_state=int(random.integers(1000)))
    return Fault(table=changed, check=Check.DUPLICATE_ROWS, **_of_rows(rows))


def similar_ids(table: pd.DataFrame, random: Generator) -> Fault:
    """Two vehicles with one number in two spellings."""
    number = str(random.integers(1000, 10**6))
    spellings = (f"0{number}", f"{number[0]}_{number[1:]}", f" {number}", f"{number} ")
    first, second = random.permutation(table.id.unique())[:2]
    ids = table.id.map(str).where(table.id != first, number)
    ids = ids.where(table.id != second, str(random.choice(spellings)))
    return Fault(table=table.assign(id=ids), check=Check.IDENTITY, words=("column id:",))


def wrapped_clock(table: pd.DataFrame, random: Generator) -> Fault:
    """A clock of a day or an hour that starts again while a vehicle is there; rows in any order."""
    rows = _vehicle_rows(table, random)
    instant = float(rows.t.iloc[int(random.integers(1, len(rows)))])
    period = float(random.choice(CLOCK_PERIODS))
    start = float(random.uniform(0.0, _interval(table)))  # Of the row at `instant`.
    wrapped = table.assign(t=((table.t - instant + start) % period).round(3))
    orders = (["t", "id"], ["id"], None)
    order = orders[int(random.integers(3))]
    if order is None:
        wrapped = wrapped.sample(frac=1.0, random_state=int(random.integers(1000)))
    elif order == ["t", "id"]:
        wrapped = wrapped.loc[table.sort_values(order).index]
    return Fault(
        table=wrapped,
        check=Check.TIME,
        words=("column t:", f"after {period / 3600.0:g} h"),
        first_time=float(wrapped.t[table.t >= instant].min()),
    )


def row_too_late(table: pd.DataFrame, random: Generator) -> Fault:
    """A row that stands up to 14 rows too late in a file in order of vehicles and times."""
    rows = _vehicle_rows(table, random)
    place = int(random.integers(0, len(rows) - 1))
    row, later = (
        rows.index[place],
        rows.index[min(place + int(random.integers(1, 15)), len(rows) - 1)],
    )
    order = table.index.delete(row).insert(later, row)
    return Fault(
        table=table.loc[order],
        check=Check.TIME,
        words=("column t:",),
        **_of_rows(rows.iloc[place:]),
    )


def separators_of_thousands(table: pd.DataFrame, random: Generator) -> Fault:
    """Whole millimetres below a million with separators of thousands, which look like decimals.

    Positions are reported. Sizes are refused, as such a vehicle is a few millimetres long.
    """
    quantity = str(random.choice(["x", "y", "length", "width"]))
    if quantity in ("x", "y"):
        first = float(random.uniform(table[quantity].min(), table[quantity].max()))
        table = table[table[quantity].between(first - 450.0, first + 450.0)]
        table = table.assign(**{quantity: table[quantity] - first + 460.0})
    cells = (table[quantity] * 1000.0).round().astype(int).map("{:,}".format)
    mark = str(random.choice([".", ","]))
    return Fault(
        table=table.assign(**{quantity: cells.str.replace(",", mark)}),
        check=Check.NUMBER_FORMAT,
        columns={quantity: f"{quantity} [mm]"},
        words=(f"column {quantity}",),
        has_road=False,
    )


# Frame rates and gaps


def slower_vehicle(table: pd.DataFrame, random: Generator) -> Fault:
    """A vehicle with every n-th row; two rows are up to 1 s apart."""
    rows = _vehicle_rows(table, random, 100)
    step = min(round(beyond(random, ONE_FRAME)), round(MAX_OWN_INTERVAL_S / _interval(table)))
    dropped = rows.index[np.arange(len(rows)) % step != 0]
    return Fault(table=table.drop(dropped), check=Check.FRAME_RATE, **_of_rows(rows.iloc[1:]))


def _rows_left_out(table: pd.DataFrame, random: Generator, num_missing: int) -> Fault:
    rows = _vehicle_rows(table, random, num_missing + 2)
    place = int(random.integers(1, len(rows) - num_missing))
    missing = rows.iloc[place : place + num_missing]
    return Fault(table=table.drop(missing.index), check=Check.GAPS, **_of_rows(missing))


def short_gap(table: pd.DataFrame, random: Generator) -> Fault:
    """A gap that is interpolated: at least two frames, at most 0.5 s."""
    return _rows_left_out(
        table, random, int(random.integers(1, round(MAX_GAP_S / _interval(table))))
    )


def long_gap(table: pd.DataFrame, random: Generator) -> Fault:
    """A gap that splits a track."""
    num_frames = round(beyond(random, MAX_GAP_S) / _interval(table))
    return _rows_left_out(table, random, num_frames - 1)


# Sizes and kinds


def exchanged_sizes(table: pd.DataFrame, random: Generator) -> Fault:
    """A vehicle with length and width exchanged."""
    rows = _vehicle_rows(table, random)
    changed = table.copy()
    changed.loc[rows.index, ["length", "width"]] = rows[["width", "length"]].to_numpy()
    return Fault(table=changed, check=Check.SIZES, **_of_rows(rows))


def exchanged_columns(table: pd.DataFrame, random: Generator) -> Fault:
    """All vehicles with length and width exchanged, twice the share that is refused."""
    changed = table.assign(length=table.width, width=table.length)
    return Fault(table=changed, check=None, words=("length and width of",))


def sizes_in_another_unit(table: pd.DataFrame, random: Generator) -> Fault:
    """Sizes by which most vehicles are too wide or too narrow for vehicles.

    Of these, sizes that no vehicle has (more than 10 m wide or 50 m long, less than 0.1 m) are
    refused cell by cell, before this check.
    """
    narrowest, widest = recording_checks._VEHICLE_WIDTHS
    has_four_wheels = ~table.kind.isin(["motorcycle", "bicycle"])
    usual = float(table[has_four_wheels].groupby("id").width.first().median())
    is_wide = bool(random.integers(2))
    factor = (beyond(random, widest) if is_wide else narrowest / beyond(random, 1.0)) / usual
    changed = table.assign(length=table.length * factor, width=table.width * factor)
    limits = {"length": (0.1, 50.0), "width": (0.1, 10.0)}
    is_refused = any(
        changed[name].min() <= low or changed[name].max() >= high
        for name, (low, high) in limits.items()
    )
    words = ("column ", " to ") if is_refused else ("width: vehicles are",)
    return Fault(table=changed, check=None if is_refused else Check.SIZES, words=words)


def sizes_of_two_tables(table: pd.DataFrame, random: Generator) -> Fault:
    """Sizes of one vehicle or more that differ between the table of states and that of vehicles."""
    has_box = table.kind != "bicycle"  # The map of exiD leaves bicycles out.
    part = table[table.id.isin(table.id[has_box].unique()[:10])]
    vehicles = part.groupby("id", as_index=False).agg(
        width=("width", "first"), length=("length", "first"), kind=("kind", "first")
    )
    column = str(random.choice(["length", "width"]))
    factor = 1.0 + beyond(random, recording_checks._MAX_SIZE_DIFFERENCE)
    factor = factor if random.integers(2) else 1.0 / factor
    others = random.choice(vehicles.id, int(random.integers(1, len(vehicles) + 1)), replace=False)
    states = pd.DataFrame(
        {
            "recordingId": 1, "trackId": part.id,
            "frame": (part.t / _interval(table)).round().astype(int),
            "xCenter": part.x, "yCenter": part.y, "heading": np.degrees(part.heading) % 360.0,
            "width": part.width, "length": part.length, "xVelocity": part.vx, "yVelocity": part.vy,
            "lonAcceleration": part.a, "latAcceleration": 0.0,
        }
    )  # fmt: skip
    states.loc[part.id.isin(others), column] *= factor
    metadata = vehicles.rename(columns={"id": "trackId", "kind": "class"})
    rate = round(1.0 / _interval(table))
    files = {
        "_tracks.csv": states.to_csv(index=False),
        "_tracksMeta.csv": metadata.assign(recordingId=1).to_csv(index=False),
        "_recordingMeta.csv": f"recordingId,frameRate,speedLimit\n1,{rate},-1\n",
    }
    words = (f"column {column}: for {len(others)} of {len(vehicles)} vehicles",)
    return Fault(table=table, check=Check.SIZES, words=words, has_road=False, files=files)


def other_kind(table: pd.DataFrame, random: Generator) -> Fault:
    """A type that a vehicle has in fewer than half of its rows."""
    rows = _vehicle_rows(table, random)
    count = int(random.integers(1, len(rows) // 2))
    first = int(random.integers(0, len(rows) - count + 1))
    rows = rows.iloc[first : first + count]
    others = [kind for kind in MAP["types"] if kind != rows.kind.iloc[0]]
    changed = table.copy()
    changed.loc[rows.index, "kind"] = str(random.choice(others))
    return Fault(table=changed, check=Check.KINDS, words=("column kind:",), **_of_rows(rows))


# Motion


def _shifted(
    table: pd.DataFrame, rows: pd.DataFrame, size: float, *, is_along: bool
) -> pd.DataFrame:
    """The table with rows of one vehicle away from its path, along or across its movement [m]."""
    path = table[table.id == rows.id.iloc[0]]
    place = path.index.get_indexer(rows.index)
    low, high = max(place[0] - 10, 0), min(place[0] + 10, len(path) - 1)
    way = path[["x", "y"]].iloc[high] - path[["x", "y"]].iloc[low]
    heading = np.arctan2(way.y, way.x) + (0.0 if is_along else 0.5 * np.pi)
    changed = table.copy()
    changed.loc[rows.index, "x"] += size * np.cos(heading)
    changed.loc[rows.index, "y"] += size * np.sin(heading)
    return changed


def _max_deviation(is_along: bool, time: float) -> float:
    """The limit at a time to the neighbours before and after [m].

    Args:
        is_along: Whether the deviation is along the movement, not across.
        time: Geometric mean of both times [s].
    """
    limit = MAX_DEVIATION_ALONG if is_along else MAX_DEVIATION_ACROSS
    return limit + 0.5 * MAX_ACCELERATION * time**2


def row_away(is_along: bool, table: pd.DataFrame, random: Generator) -> Fault:
    """A row inside a track away from the path."""
    path = _vehicle_rows(table, random)
    place = int(random.integers(1, len(path) - 1))
    rows = path.iloc[place : place + 1]
    size = _either_way(random, beyond(random, _max_deviation(is_along, _interval(table))))
    changed = _shifted(table, rows, size, is_along=is_along)
    return Fault(table=changed, check=Check.MOTION, **_of_rows(rows))


def rows_away(table: pd.DataFrame, random: Generator) -> Fault:
    """A run of rows away from the path by one distance; the gap without it is at most 0.5 s."""
    interval, is_along = _interval(table), bool(random.integers(2))
    path = _vehicle_rows(table, random)
    count = int(random.integers(2, round(MAX_GAP_S / interval)))
    place = int(random.integers(1, len(path) - count))
    rows = path.iloc[place : place + count]
    limit = _max_deviation(is_along, 0.5 * (count + 1) * interval)  # In the middle of the run.
    size = _either_way(random, beyond(random, limit))
    changed = _shifted(table, rows, size, is_along=is_along)
    return Fault(table=changed, check=Check.MOTION, **_of_rows(rows))


def end_row_away(table: pd.DataFrame, random: Generator) -> Fault:
    """The first or last row of a track away; a contact may explain a change of speed by 20 m/s."""
    interval, is_along = _interval(table), bool(random.integers(2))
    path = _vehicle_rows(table, random)
    rows = path.iloc[:1] if random.integers(2) else path.iloc[-1:]
    limit = _max_deviation(is_along, interval * 2**0.5) + MAX_SPEED_CHANGE_AT_END * interval
    size = _either_way(random, beyond(random, limit))
    changed = _shifted(table, rows, size, is_along=is_along)
    return Fault(table=changed, check=Check.MOTION, **_of_rows(rows))


def jump(table: pd.DataFrame, random: Generator) -> Fault:
    """All rows of a vehicle from one on, the third or a later one, away from the path before."""
    interval, is_along = _interval(table), bool(random.integers(2))
    path = _vehicle_rows(table, random)
    rows = path.iloc[int(random.integers(2, len(path) - 2)) :]
    size = _either_way(random, beyond(random, _max_deviation(is_along, interval)))
    changed = _shifted(table, rows, size, is_along=is_along)
    return Fault(table=changed, check=Check.MOTION, **_of_rows(rows))


def scattered_positions(table: pd.DataFrame, random: Generator) -> Fault:
    """A share of all rows away from their paths, by various distances in all directions."""
    count = round(beyond(random, MAX_FAULTY_SHARE) * len(table))
    rows = random.choice(table.index, count, replace=False)
    limit = _max_deviation(True, _interval(table))
    size, angle = random.uniform(2.0, 10.0, count) * limit, random.uniform(0.0, 2.0 * np.pi, count)
    changed = table.copy()
    changed.loc[rows, "x"] += size * np.cos(angle)
    changed.loc[rows, "y"] += size * np.sin(angle)
    return Fault(table=changed, check=Check.MOTION, words=("positions scatter",))


# Vehicles under two ids


def second_id(table: pd.DataFrame, random: Generator) -> Fault:
    """A second track beside that of a vehicle, for 20 rows or more, up to 0.3 widths away.

    The boxes overlap in all common frames, the largest share; the limit is 60 %.
    """
    rows = _vehicle_rows(table, random)
    begin = int(random.integers(0, len(rows) // 2))
    end = int(random.integers(begin + 20, len(rows) + 1))
    ghost = rows.iloc[begin:end].assign(id=9999)
    ghost["x"] += random.uniform(-0.3, 0.3) * ghost.width
    ghost["y"] += random.uniform(-0.3, 0.3) * ghost.width
    return Fault(
        table=pd.concat([table, ghost], ignore_index=True),
        check=Check.DUPLICATE_VEHICLES,
        vehicles=frozenset({"9999"}),
        first_time=float(ghost.t.iloc[0]),
    )


def changed_id(table: pd.DataFrame, random: Generator) -> Fault:
    """A vehicle with another id from a row on, and with both in less than half of either track."""
    rows = _vehicle_rows(table, random)
    change = int(random.integers(20, len(rows) - 20))
    num_common = int(random.integers(1, min(change, len(rows) - change) // 2))
    later = rows.iloc[change - num_common :].assign(id=9999)
    changed = pd.concat([table.drop(rows.index[change:]), later], ignore_index=True)
    is_later_shorter = len(later) <= change
    copy = later if is_later_shorter else rows
    return Fault(table=changed, check=Check.DUPLICATE_VEHICLES, **_of_rows(copy))


# Quantities that contradict each other


def speeds_in_another_unit(table: pd.DataFrame, random: Generator) -> Fault:
    """Speeds, or their components, that are too large or too small for the movement."""
    factor = 1.0 + beyond(random, recording_checks._MAX_DISAGREEMENT)
    factor = factor if random.integers(2) else 1.0 / factor
    columns = ["v"] if random.integers(2) else ["vx", "vy"]
    words = ("speed and positions",) if columns == ["v"] else ("vx and vy and positions",)
    changed = table.assign(**{column: table[column] * factor for column in columns})
    return Fault(table=changed, check=Check.SPEEDS, words=words)


def headings_turned(table: pd.DataFrame, random: Generator) -> Fault:
    """All headings turned by one angle."""
    angle = _either_way(random, beyond(random, recording_checks._MAX_ANGLE_ERROR))
    changed = table.assign(heading=table.heading + angle)
    return Fault(table=changed, check=Check.HEADINGS, words=("heading and positions",))


def accelerations_in_another_unit(table: pd.DataFrame, random: Generator) -> Fault:
    """Accelerations that are too large or too small for the changes of speed."""
    factor = 1.0 + beyond(random, recording_checks._MAX_ACCEL_DISAGREEMENT)
    factor = factor if random.integers(2) else 1.0 / factor
    changed = table.assign(a=table.a * factor)
    return Fault(table=changed, check=Check.ACCELERATIONS, words=("accel_lon and speed",))


def _lateral_speed(table: pd.DataFrame) -> float:
    """Root mean square of the speed along y, of means over 0.5 s [m/s]."""
    num_rows = round(0.5 / _interval(table))
    means = table.groupby("id").vy.rolling(num_rows).mean().dropna()
    return float((means**2).mean() ** 0.5)


def other_axes(table: pd.DataFrame, random: Generator) -> Fault:
    """Components of speeds that are exchanged, or of which one has the opposite sign; refused.

    The sign of vy is drawn where it shows: slower movement than 0.1 m/s (root mean square) across
    a road along the x axis is noise to the check.
    """
    has_lateral_speed = bool(_lateral_speed(table) > 1.1 * recording_checks._MIN_LATERAL_SPEED)
    change = int(random.integers(3 if has_lateral_speed else 2))
    changed = (
        table.assign(vx=table.vy, vy=table.vx)
        if change == 0
        else table.assign(vx=-table.vx)
        if change == 1
        else table.assign(vy=-table.vy)
    )
    word = ("vx and vy", "vx and x", "vy and y")[change]
    return Fault(table=changed, check=None, words=("axes", word))


def mirrored_traffic(table: pd.DataFrame, random: Generator) -> Fault:
    """All of a two-way road mirrored, so that oncoming traffic is on the wrong side; refused."""
    middle = 0.5 * (table.y.min() + table.y.max())
    changed = table.assign(y=2.0 * middle - table.y, vy=-table.vy, heading=-table.heading)
    return Fault(table=changed, check=None, words=("oncoming traffic",))


def positions_in_another_unit(table: pd.DataFrame, random: Generator) -> Fault:
    """Positions by which vehicles are faster than any traffic; no column states speeds."""
    usual = float(np.percentile(table.v, 95.0))
    factor = beyond(random, recording_checks._MAX_TRAFFIC_SPEED) / usual
    return Fault(
        table=table.assign(x=table.x * factor, y=table.y * factor),
        check=Check.SPEEDS,
        columns=dict.fromkeys(("speed", "vx", "vy", "accel_lon")),
        words=("positions: vehicles move at",),
        has_road=False,
    )


FAULTS: Mapping[str, Callable[[pd.DataFrame, Generator], Fault]] = {
    **{
        f"missing_{column}": partial(missing_cells, column)
        for column in ("id", "t", "x", "y", "length", "kind", "v", "heading")
    },
    "row_away_along": partial(row_away, True),
    "row_away_across": partial(row_away, False),
    **{
        inject.__name__: inject
        for inject in (
            too_many_missing_cells,
            repeated_rows,
            similar_ids,
            wrapped_clock,
            row_too_late,
            separators_of_thousands,
            slower_vehicle,
            short_gap,
            long_gap,
            exchanged_sizes,
            exchanged_columns,
            sizes_in_another_unit,
            sizes_of_two_tables,
            other_kind,
            rows_away,
            end_row_away,
            jump,
            scattered_positions,
            second_id,
            changed_id,
            speeds_in_another_unit,
            headings_turned,
            accelerations_in_another_unit,
            other_axes,
            mirrored_traffic,
            positions_in_another_unit,
        )
    },
}
"""Functions that inject a fault into a table, by name."""


def inject_faults(name: str, count: int) -> list[Examined]:
    """Inject a number of faults of one kind, each into another table; the profiles take turns."""
    random = np.random.default_rng(SEED)
    results: list[Examined] = []
    # Only traffic in both directions shows that left and right are exchanged.
    profiles = ("rural",) if name == "mirrored_traffic" else PROFILES
    for number in range(count):
        profile = profiles[number % len(profiles)]
        run = simulate_profile(profile, 20)
        first = int(random.integers(20))
        table = table_of(run, range(first, first + NUM_TOGETHER[profile]))
        results.append(examine_fault(FAULTS[name](table, random), run.road))
    return results
