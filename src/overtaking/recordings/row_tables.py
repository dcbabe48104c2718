"""From the tables of a recording to rows: cells checked, tables joined, units converted.

A map of columns says where each quantity is. What a table does not have is missing in the rows too;
what can be worked out is worked out later, on the road.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.recordings.column_map import (
    BY_LENGTH,
    LEFT_OUT,
    RECORDING,
    TRACKS,
    VEHICLES,
    ColumnMap,
    files_of,
)
from overtaking.recordings.recording import kinds_by_length
from overtaking.recordings.rows import ON_GRID, Rows, at_whole_frames, numbered
from overtaking.recordings.table_files import (
    NUMBER,
    TEXT,
    WHOLE,
    checked_table,
    named,
    read_columns,
    refused,
    refused_cell,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from overtaking.core.arrays import F64, I64

INTERVALS_MS = (10.0, 1000.0)
"""Least and most time between two frames [ms]."""

_DIRECTIONS = (1, 2)
_SIZES = {"length": (0.1, 50.0), "width": (0.1, 10.0)}
_WORDS = frozenset({"type", "lane", "upper_lines", "lower_lines"})
_NUMBERS = frozenset({"frame", "direction"})
_LIMITS = {"x": 1.0e8, "y": 1.0e8, "time": 1.0e13, "vehicle": 1.0e15, "frame": 1.0e9}
_STEADY = ("type", "length", "width", "direction")  # What does not change, of each vehicle.
_MOST_ROWS, _MOST_FRAMES = 50_000_000, 10_000_000

Columns = dict[str, NDArray[Any]]


def read_rows(path: Path, columns: ColumnMap, only: Mapping[str, str] | None = None) -> Rows:
    """The states in the files of a recording.

    Args:
        path: The file, or the one of the states.
        columns: Where each quantity is.
        only: Values that columns must have, beside those that the map names.

    Raises:
        ImportFormatError: A file is missing or damaged; the message names line and column.
        ConfigError: The path is not that of the table of states.
    """
    asked = replace(columns, only={**columns.only, **(only or {})})
    tables = {name: _read(file, asked, name) for name, file in files_of(path, asked).items()}
    return _Joining(asked, tables).rows()


def _read(path: Path, columns: ColumnMap, table: str) -> _Table:
    """One of the tables of a recording."""
    types, limits = _types(columns, table), _limits(columns, table)
    read = read_columns(path, types, header=columns.header, limits=limits)
    return _Table.of(read, path.name, types)


def rows_of(table: Any, columns: ColumnMap) -> Rows:
    """The states in a table in memory: of pandas, Arrow, or a mapping of columns.

    Raises:
        ImportFormatError: It lacks a column, or has a cell that is no such value.
    """
    given = table if isinstance(table, pa.Table) else _arrow(table)
    types = _types(columns, TRACKS)
    found = named(given.column_names, types, "table")
    chosen = given.select(list(found.values())).rename_columns(list(found))
    checked = checked_table(chosen, types, "table", _limits(columns, TRACKS))
    return _Joining(columns, {TRACKS: _Table.of(checked, "table", types)}).rows()


def _arrow(table: Any) -> pa.Table:
    """A table of another library as Arrow's."""
    try:
        if isinstance(table, dict):
            return pa.table(table)
        return pa.Table.from_pandas(table, preserve_index=False)
    except (pa.ArrowException, TypeError, ValueError, AttributeError) as error:
        raise refused("table", "table", "a pandas or Arrow table", f"{error}") from None


def _types(columns: ColumnMap, table: str) -> dict[str, pa.DataType]:
    """The columns that are read of a table, with their types."""
    types = dict.fromkeys(columns.names(table), TEXT)
    for name, one in columns.columns.items():
        if one.table == table and name not in _WORDS and name != "vehicle":
            types |= dict.fromkeys(one.names, WHOLE if name in _NUMBERS else NUMBER)
    if table in (TRACKS, VEHICLES):
        types[columns.columns["vehicle"].names[0]] = TEXT
    return types


def _limits(columns: ColumnMap, table: str) -> dict[str, float]:
    """The largest numbers that some columns may hold."""
    return {
        cell: _LIMITS[name]
        for name, one in columns.columns.items()
        if name in _LIMITS and one.table == table
        for cell in one.names
    }


@dataclass(frozen=True, slots=True)
class _Table:
    """A table as arrays, and what it is called."""

    where: str
    columns: Columns

    @classmethod
    def of(cls, table: pa.Table, where: str, types: Mapping[str, pa.DataType]) -> _Table:
        """The columns of an Arrow table."""
        return cls(where, {name: np.asarray(table[name]) for name in types})

    @property
    def num_rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())))

    def refused(self, is_right: NDArray[np.bool_], name: str, expected: str) -> None:
        """Refuse the first cell of a column that is not right."""
        if not is_right.all():
            row = int(np.argmin(is_right))
            raise refused_cell(self.where, row, name, expected, str(self.columns[name][row]))

    def kept(self, rows: NDArray[Any]) -> _Table:
        """Some of the rows."""
        return _Table(self.where, {name: each[rows] for name, each in self.columns.items()})


@dataclass(frozen=True, slots=True)
class _Joining:
    """The tables of a recording on their way to rows."""

    map: ColumnMap
    tables: dict[str, _Table]

    def rows(self) -> Rows:
        """All of it."""
        tracks = self.tables[TRACKS]
        line = np.arange(tracks.num_rows)
        for name, value in self.map.only.items():
            line = line[tracks.columns[name][line] == value]
        if not len(line) or len(line) > _MOST_ROWS:
            raise refused(tracks.where, "rows", f"1 to {_MOST_ROWS:,}", f"{len(line):,}")
        ids, vehicle = self.ids(line)
        self.check_vehicles()
        steady = self.steady(line, ids, vehicle)
        chosen = steady["kind"] != LEFT_OUT
        here = chosen[vehicle]
        line, vehicle = line[here], (np.cumsum(chosen) - 1)[vehicle[here]]
        if not len(line):
            raise refused(tracks.where, "vehicles", "some that are read", "none")
        steady = {name: each[chosen] for name, each in steady.items()}
        about = self.about()
        moment, interval = self.moments(line, vehicle, about)
        order = np.lexsort((moment, vehicle))
        line, vehicle, moment = line[order], vehicle[order], moment[order]
        self.check_order(line, vehicle, moment, ids[chosen])
        grid = at_whole_frames(vehicle, moment, self.values(line, steady, vehicle))
        lane = self.words("lane", line)
        return Rows(
            where=tracks.where,
            ids=numbered(ids[chosen], grid.owner),
            **{name: each[grid.owner] for name, each in steady.items() if name != "direction"},
            direction=steady["direction"][grid.owner].astype(np.int64)
            if "direction" in steady
            else None,
            start=grid.start,
            frame=grid.frame,
            frame_interval_ms=interval,
            values=grid.values,
            lane=None if lane is None else lane[grid.nearest],
            about=about,
            notes={
                "interpolated": grid.is_moved,
                "tracks_torn": len(grid.owner) - len(np.unique(grid.owner)),
                "left_out": int((~chosen).sum()),
            },
        )

    def cell(self, name: str) -> tuple[_Table, str] | None:
        """Table and column of a quantity, None where there is none."""
        one = self.map.columns.get(name)
        return None if one is None else (self.tables[one.table], one.names[0])

    def ids(self, line: I64) -> tuple[NDArray[Any], I64]:
        """The vehicles in order, and the place of each row's."""
        name = self.map.columns["vehicle"].names[0]
        tracks, vehicles = self.tables[TRACKS], self.tables.get(VEHICLES)
        given = tracks.columns[name] = _as_numbers(tracks.columns[name])
        if vehicles is not None:
            known = vehicles.columns[name] = _as_numbers(vehicles.columns[name])
            if known.dtype != given.dtype:  # Names among numbers: then all are names.
                given, known = given.astype("U40"), known.astype("U40")
                tracks.columns[name], vehicles.columns[name] = given, known
            order = np.argsort(known, kind="stable")
            is_new = np.ones(len(order), np.bool_)
            is_new[order[1:]] = known[order][1:] != known[order][:-1]
            vehicles.refused(is_new, name, "a different id in each row")
            file = self.map.files[VEHICLES].strip("_").partition(".")[0]
            tracks.refused(np.isin(given, known), name, f"an id of {file}")
        ids, vehicle = np.unique(given[line], return_inverse=True)
        return ids, vehicle

    def check_vehicles(self) -> None:
        """Refuse sizes that no vehicle has, but of those that are not read, and directions."""
        types = self.cell("type")
        for name, (least, most) in _SIZES.items():
            found = self.cell(name)
            if found is None:
                continue
            table, column = found
            size = table.columns[column] * self.map.columns[name].factor
            is_right = (size > least) & (size < most)
            if types is not None and types[0] is table:
                out = [one for one, kind in self.map.kinds.items() if kind == LEFT_OUT]
                is_right |= _among(table.columns[types[1]], out)
            table.refused(is_right, column, f"a {name}, {least:g} to {most:g} m")
        if (found := self.cell("direction")) is not None:
            table, column = found
            table.refused(np.isin(table.columns[column], _DIRECTIONS), column, "1 or 2")

    def steady(self, line: I64, ids: NDArray[Any], vehicle: I64) -> Columns:
        """What does not change, of each vehicle: its size, its kind and where it belongs."""
        given: Columns = {}
        for name in _STEADY:
            found = self.cell(name)
            if found is None:
                continue
            table, column = found
            cells = table.columns[column]
            if table is self.tables[TRACKS]:
                first = np.zeros(len(ids), np.int64)
                first[vehicle[::-1]] = line[::-1]
                given[name] = (
                    _medians(cells[line], vehicle, len(ids)) if name in _SIZES else cells[first]
                )
            else:
                key = self.map.columns["vehicle"].names[0]
                order = np.argsort(table.columns[key], kind="stable")
                given[name] = cells[order[np.searchsorted(table.columns[key][order], ids)]]
        sizes = {
            name: given[name] * self.map.columns[name].factor
            if name in given
            else np.full(len(ids), getattr(self.map, name))
            for name in _SIZES
        }
        more = {"direction": given["direction"]} if "direction" in given else {}
        return {**sizes, "kind": self.kinds(sizes["length"], given.get("type")), **more}

    def kinds(self, length: F64, types: NDArray[Any] | None) -> NDArray[np.int64]:
        """The kind of each vehicle."""
        nothing = np.zeros(len(length), np.bool_)
        if types is None:
            return kinds_by_length(length, is_truck=nothing, is_car=nothing).astype(np.int64)
        found = self.cell("type")
        assert found is not None
        table, column = found
        known = _among(table.columns[column], self.map.kinds)
        table.refused(known, column, " or ".join(self.map.kinds) or "a type of the map")
        kind = np.array([self.map.kinds[one] for one in types])
        cars = kinds_by_length(length, is_truck=nothing, is_car=~nothing)
        return np.where(kind == BY_LENGTH, cars, kind)

    def about(self) -> dict[str, Any]:
        """What holds for the whole recording."""
        if RECORDING not in self.tables:
            return {}
        table = self.tables[RECORDING]
        if table.num_rows != 1:
            raise refused(table.where, "table", "one row", f"{table.num_rows} rows")
        about: dict[str, Any] = {}
        for name, one in self.map.columns.items():
            if one.table == RECORDING:
                cell = table.columns[one.names[0]][0]
                about[name] = cell if name in _WORDS else float(cell) * one.factor
        if "frame_rate" in about:
            self.check_rate(table, about["frame_rate"])
        return about

    def check_rate(self, table: _Table, rate: float) -> None:
        """Refuse a rate that is none of a recording."""
        interval = 1000.0 / rate if rate > 0 else 0.0
        is_right = INTERVALS_MS[0] <= interval <= INTERVALS_MS[1]
        if self.map.is_exact:
            is_right = is_right and abs(interval - round(interval)) < 1e-9
        expected = "1 to 100 frames a second, of whole milliseconds"
        table.refused(np.array([is_right]), self.map.columns["frame_rate"].names[0], expected)

    def moments(self, line: I64, vehicle: I64, about: Mapping[str, Any]) -> tuple[F64, int]:
        """The instant of each row in frames, and the time between two frames [ms]."""
        name = "frame" if "frame" in self.map.columns else "time"
        one = self.map.columns[name]
        given = self.tables[TRACKS].columns[one.names[0]][line]
        if name == "frame":
            exact = 1000.0 / float(about.get("frame_rate") or self.map.frames_per_second or 1.0)
            moment = given * exact
        else:
            moment = (given - given.min()) * (one.factor * 1000.0)
            order = np.lexsort((moment, vehicle))
            apart = np.diff(moment[order])[np.diff(vehicle[order]) == 0]
            apart = apart[apart > 0]
            exact = float(np.median(apart)) if len(apart) else 0.0
        if not INTERVALS_MS[0] <= exact <= INTERVALS_MS[1]:
            raise refused(
                self.tables[TRACKS].where,
                f"column {one.names[0]}",
                f"{INTERVALS_MS[0]:g} to {INTERVALS_MS[1]:g} ms between two states",
                f"{exact:g} ms",
            )
        # Frames are whole milliseconds apart: at another rate states are interpolated.
        interval = round(exact)
        moment = moment / interval
        if np.ptp(moment) > _MOST_FRAMES:
            raise refused(
                self.tables[TRACKS].where,
                f"column {one.names[0]}",
                f"at most {_MOST_FRAMES:,} frames from the first to the last",
                f"{np.ptp(moment):,.0f} (choose a part: --only COLUMN=VALUE)",
            )
        return moment, interval

    def check_order(self, line: I64, vehicle: I64, moment: F64, ids: NDArray[Any]) -> None:
        """Refuse a vehicle that is twice at one time, and one that is missing where none is."""
        apart = np.diff(moment)
        wrong = np.abs(apart - 1.0) > ON_GRID if self.map.is_exact else apart <= 0.0
        wrong = np.flatnonzero((np.diff(vehicle) == 0) & wrong)
        if not len(wrong):
            return
        row, tracks = int(wrong[0]) + 1, self.tables[TRACKS]
        name = "frame" if "frame" in self.map.columns else "time"
        column = self.map.columns[name].names[0]
        expected = f"another {name} of vehicle {ids[vehicle[row]]} than in the row before"
        got = tracks.columns[column][line[row]]
        if self.map.is_exact:
            before = tracks.columns[column][line[row - 1]]
            expected = f"frame {before + 1} of vehicle {ids[vehicle[row]]}"
        raise refused_cell(
            tracks.where,
            int(line[row]),
            column,
            expected + ("" if self.map.is_exact else " (choose a part: --only COLUMN=VALUE)"),
            f"{name} {got}",
        )

    def values(self, line: I64, steady: Columns, vehicle: I64) -> dict[str, F64]:
        """Everything that changes, as numbers in SI units, with y to the left of x."""
        tracks = self.tables[TRACKS].columns
        values: dict[str, F64] = {}
        for name, one in self.map.columns.items():
            if one.table == TRACKS and name not in (*_STEADY, "vehicle", "frame", "time", "lane"):
                values[name] = np.mean([tracks[each][line] for each in one.names], axis=0)
                values[name] = values[name] * one.factor
        if self.map.point == "corner":
            values["x"] = values["x"] + steady["length"][vehicle] * 0.5
            values["y"] = values["y"] + steady["width"][vehicle] * 0.5
        if not self.map.y_is_left:
            for name in ("y", "vy", "ay", "heading", "yaw_rate"):
                if name in values:
                    values[name] = -values[name]
        return values

    def words(self, name: str, line: I64) -> NDArray[Any] | None:
        """A column of words, None where there is none."""
        found = self.cell(name)
        return None if found is None else found[0].columns[found[1]][line]


def _as_numbers(names: NDArray[Any]) -> NDArray[Any]:
    """Names of vehicles as whole numbers, if all of them are."""
    try:
        return names.astype(np.int64)
    except (ValueError, OverflowError):
        return names.astype("U40")  # Of fixed size, however long a name is.


def _among(words: NDArray[Any], known: Iterable[str]) -> NDArray[np.bool_]:
    """Which words are among some, shape (row,)."""
    found, place = np.unique(words, return_inverse=True)
    return np.array([one in set(known) for one in found.tolist()])[place]


def _medians(values: NDArray[Any], group: I64, count: int) -> F64:
    """The median of each group, shape (group,)."""
    order = np.lexsort((values, group))
    size = np.bincount(group, minlength=count)
    first = np.cumsum(size) - size
    low, high = first + (size - 1) // 2, first + size // 2
    return (values[order][low] + values[order][high]) * 0.5
