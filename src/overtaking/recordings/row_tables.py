"""From the tables of a recording to rows: cells checked, tables joined, units converted.

A map of columns says where each quantity is. Quantities that a table lacks are missing in the rows
too; they are worked out later, on the road. Sizes and kinds belong to a track, a stretch of rows
without a gap: recordings of several periods number their vehicles anew in each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from overtaking.model.vehicles import may_be_kind
from overtaking.recordings.column_map import (
    BY_LENGTH,
    LEFT_OUT,
    NOT_KNOWN,
    RECORDING,
    TRACKS,
    VEHICLES,
    ColumnMap,
    files_of,
)
from overtaking.recordings.messages import shown
from overtaking.recordings.recording import kinds_by_length
from overtaking.recordings.recording_checks import compare_sizes
from overtaking.recordings.rows import ON_GRID, TORN, Rows, at_whole_frames, track_names
from overtaking.recordings.table_errors import named, refused, refused_cell
from overtaking.recordings.table_files import (
    NUMBER,
    TEXT,
    checked_table,
    column_names,
    read_columns,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask
    from overtaking.recordings.findings import Finding

INTERVALS_MS = (10.0, 1000.0)
"""Least and most time between two frames [ms]."""

_DIRECTIONS = (1, 2)
_SIZES = {"length": (0.1, 50.0), "width": (0.1, 10.0)}
_WORDS = frozenset({"type", "lane", "upper_lines", "lower_lines"})
_LIMITS = {"x": 1.0e8, "y": 1.0e8, "time": 1.0e13, "vehicle": 1.0e15, "frame": 1.0e9}
_OF_A_TRACK = ("type", "length", "width", "direction")
_NOT_CHANGING = (*_OF_A_TRACK, "vehicle", "frame", "time", "lane")
_MOST_ROWS, _MOST_FRAMES = 50_000_000, 10_000_000

_MAX_SPEED = 150.0
"""An id that moves faster between two rows belongs to two vehicles, one after the other [m/s]."""

_MAX_SPEED_RATIO = 20.0
"""Jumps must also exceed the median speed by this factor: with positions in a wrong unit, every row
exceeds `_MAX_SPEED`, and no track would be left for `recording_checks` to name the unit."""

Columns = dict[str, "NDArray[Any]"]


def read_rows(path: Path, columns: ColumnMap, only: Mapping[str, str] | None = None) -> Rows:
    """The states in the files of a recording.

    Args:
        path: The file, or the one of the states.
        columns: Where each quantity is.
        only: Values that columns must have, beside those that the map names. The tables of vehicles
            and of the recording are filtered too if they have such a column.

    Raises:
        ImportFormatError: A file is missing or damaged; the message names line and column.
        ConfigError: The path is not that of the table of states.
    """
    chosen = replace(columns, only={**columns.only, **(only or {})})
    tables = {name: _read(file, chosen, name) for name, file in files_of(path, chosen).items()}
    return _Join(chosen, tables).rows()


def _read(path: Path, columns: ColumnMap, table: str) -> _Table:
    """One of the tables of a recording, with the chosen rows only."""
    types, limits = _types(columns, table), _limits(columns, table)
    if columns.files:
        types |= _further_types(column_names(path), columns, table)
    gaps = [name for name, kind in types.items() if kind == NUMBER and table != RECORDING]
    read = read_columns(path, types, header=columns.header, limits=limits, gaps=gaps)
    return _Table.of(read, path.name, types).chosen(columns.only)


def rows_of(table: Any, columns: ColumnMap) -> Rows:
    """The states in a table in memory: of pandas, Arrow, or a mapping of columns.

    Raises:
        ImportFormatError: It lacks a column, or has a cell that is no such value.
    """
    arrow = table if isinstance(table, pa.Table) else _arrow(table)
    types = _types(columns, TRACKS)
    names = named(arrow.column_names, types, "table")
    part = arrow.select(list(names.values())).rename_columns(list(names))
    gaps = [name for name, kind in types.items() if kind == NUMBER]
    checked = checked_table(part, types, "table", _limits(columns, TRACKS), gaps)
    return _Join(columns, {TRACKS: _Table.of(checked, "table", types).chosen(columns.only)}).rows()


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
    for name, column in columns.columns.items():
        if column.table == table and name not in _WORDS and name != "vehicle":
            types |= dict.fromkeys(column.names, NUMBER)
    if table in (TRACKS, VEHICLES):
        types[columns.columns["vehicle"].names[0]] = TEXT
    return types


def _further_types(names: Iterable[str], columns: ColumnMap, table: str) -> dict[str, pa.DataType]:
    """Columns of a table that the map does not name for it, with their types.

    These are the columns by which rows are chosen, and in the table of states the sizes that the
    table of vehicles has as well, which are compared.
    """
    optional = dict.fromkeys(columns.only, TEXT)
    if table == TRACKS:
        optional |= {
            column.names[0]: NUMBER
            for name, column in columns.columns.items()
            if name in _SIZES and column.table == VEHICLES
        }
    existing = {name.strip().casefold() for name in names}
    return {name: kind for name, kind in optional.items() if name.casefold() in existing}


def _limits(columns: ColumnMap, table: str) -> dict[str, float]:
    """The largest numbers that some columns may hold."""
    return {
        cell: _LIMITS[name]
        for name, column in columns.columns.items()
        if name in _LIMITS and column.table == table
        for cell in column.names
    }


@dataclass(frozen=True, slots=True)
class _Table:
    """Rows of a table as arrays.

    Attributes:
        where: Name of the table in messages.
        columns: Cells of each column, shape (row,).
        line: Index of each row in the file, from 0, same shape.
    """

    where: str
    columns: Columns
    line: I64

    @classmethod
    def of(cls, table: pa.Table, where: str, types: Mapping[str, pa.DataType]) -> _Table:
        """The columns of an Arrow table."""
        columns = {name: np.asarray(table[name]) for name in types}
        return cls(where, columns, np.arange(table.num_rows))

    @property
    def num_rows(self) -> int:
        """Number of rows."""
        return len(self.line)

    def check(self, is_right: Mask, name: str, expected: str) -> None:
        """Raise the error for the first cell of a column that is not right."""
        if not is_right.all():
            row = int(np.argmin(is_right))
            got = str(self.columns[name][row])
            got = "an empty cell" if got in ("", "nan") else got
            raise refused_cell(self.where, int(self.line[row]), name, expected, got)

    def kept(self, rows: Mask | I64) -> _Table:
        """Some of the rows."""
        if rows.dtype == np.bool_ and rows.all():
            return self
        columns = {name: cells[rows] for name, cells in self.columns.items()}
        return _Table(self.where, columns, self.line[rows])

    def chosen(self, only: Mapping[str, str]) -> _Table:
        """The rows in which each column of `only` has the value that is stated for it.

        Raises:
            ImportFormatError: No row has these values.
        """
        rows = np.ones(self.num_rows, np.bool_)
        for name, value in only.items():
            if name in self.columns:
                rows &= _has_value(self.columns[name], value)
                if not rows.any():
                    what = f"rows with {shown(name)}={shown(value)}"
                    raise refused(self.where, what, "at least one", "none")
        return self.kept(rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class _OfTracks:
    """Quantities that are constant within a track; arrays have shape (track,).

    Attributes:
        length: [m].
        width: [m].
        kind: `VehicleKind`.
        is_kind_known: Whether the kind is stated and agrees with the length.
        direction: Number of the carriageway; None where no column has it.
        findings: Contradictions between columns.
    """

    length: F64
    width: F64
    kind: I64
    is_kind_known: Mask
    direction: I64 | None
    findings: list[Finding]


@dataclass(frozen=True, slots=True)
class _Join:
    """The tables of a recording on their way to rows."""

    map: ColumnMap
    tables: dict[str, _Table]

    def rows(self) -> Rows:
        """The states of the recording."""
        tracks, empty = self.with_vehicle_and_time(self.tables[TRACKS])
        ids, vehicle, tracks = self.ids(tracks)
        type_code = self.type_codes(tracks, vehicle, ids)
        is_read = type_code != LEFT_OUT
        num_left_out = len(np.unique(vehicle[~is_read]))
        tracks, vehicle, type_code = tracks.kept(is_read), vehicle[is_read], type_code[is_read]
        self.check_vehicles(tracks)
        if not tracks.num_rows:
            raise refused(tracks.where, "vehicles", "some that are read", "none")
        about = self.about()
        moment, interval = self.moments(tracks, vehicle, about)
        is_missing = self.is_missing(tracks, empty)
        # Of rows of one time, complete ones come first, so that incomplete repetitions are dropped.
        order = np.lexsort((is_missing, moment, vehicle))
        tracks, vehicle, moment = tracks.kept(order), vehicle[order], moment[order]
        type_code, is_missing = type_code[order], is_missing[order]
        is_repeated = self.is_repeated(tracks, vehicle, moment, ids, is_missing=is_missing)
        if self.map.is_exact:
            self.check_frames(tracks, vehicle, moment, ids, ~is_repeated)
        rows = ~is_repeated & ~is_missing
        if not rows.any():
            raise refused(tracks.where, "rows", "positions", "none")
        tracks, vehicle, moment = tracks.kept(rows), vehicle[rows], moment[rows]
        values = self.values(tracks, empty)
        track = _tracks(vehicle, moment, values, interval)
        first_row = np.flatnonzero(np.append(True, np.diff(track) != 0))
        track_vehicle = vehicle[first_row]
        about_tracks = self.about_tracks(tracks, track, ids[track_vehicle], type_code[rows])
        values = self.oriented(values, about_tracks, track)
        grid = at_whole_frames(track, moment, values)
        lane = self.words("lane", tracks)
        owner = grid.owner
        return Rows(
            where=tracks.where,
            names=track_names(ids.astype(str).astype(np.object_), track_vehicle[owner]),
            kind=about_tracks.kind[owner].astype(np.uint8),
            is_kind_known=about_tracks.is_kind_known[owner],
            length=about_tracks.length[owner],
            width=about_tracks.width[owner],
            direction=None if about_tracks.direction is None else about_tracks.direction[owner],
            start=grid.start,
            frame=grid.frame,
            frame_interval_ms=interval,
            values=grid.values,
            lane=None if lane is None else lane[grid.nearest],
            about=about,
            notes={
                "interpolated": grid.is_moved,
                "tracks_torn": len(owner) - len(np.unique(track_vehicle[owner])),
                "left_out": num_left_out,
                "rows_repeated": int(is_repeated.sum()),
                "rows_missing": int((is_missing & ~is_repeated).sum()),
            },
            findings=tuple(about_tracks.findings),
        )

    def cell(self, name: str) -> tuple[_Table, str] | None:
        """Table and column of a quantity, None where there is none."""
        column = self.map.columns.get(name)
        return None if column is None else (self.tables[column.table], column.names[0])

    @property
    def changing(self) -> list[str]:
        """The quantities that change from row to row."""
        columns = self.map.columns.items()
        return [
            name for name, column in columns if column.table == TRACKS and name not in _NOT_CHANGING
        ]

    def with_vehicle_and_time(self, tracks: _Table) -> tuple[_Table, frozenset[str]]:
        """The rows that have a vehicle and a time, and the quantities whose columns are empty.

        Raises:
            ImportFormatError: There are no rows or too many, a frame is no whole number, or a row
                with all its quantities lacks the vehicle or the time. Other rows without them are
                left out.
        """
        if not 0 < tracks.num_rows <= _MOST_ROWS:
            expected = f"1 to {_MOST_ROWS:,}"
            raise refused(tracks.where, "rows", expected, f"{tracks.num_rows:,}")
        empty = frozenset(
            name
            for name in self.changing
            if name not in ("x", "y")
            and all(np.isnan(tracks.columns[cell]).all() for cell in self.map.columns[name].names)
        )
        id_column, time_column = self.map.columns["vehicle"].names[0], self.time_column
        has_id = tracks.columns[id_column].astype(object) != ""
        has_time = ~np.isnan(tracks.columns[time_column])
        is_missing = self.is_missing(tracks, empty)
        tracks.check(has_id | is_missing, id_column, "a vehicle")
        tracks.check(has_time | is_missing, time_column, "a number")
        if self.time_name == "frame":
            frame = tracks.columns[time_column]
            tracks.check(~has_time | (frame == np.rint(frame)), time_column, "a whole number")
        return tracks.kept(has_id & has_time), empty

    def is_missing(self, tracks: _Table, empty: Iterable[str]) -> Mask:
        """Whether a row lacks a quantity that changes, but for those of empty columns; (row,)."""
        missing = np.zeros(tracks.num_rows, np.bool_)
        for name in self.changing:
            if name not in empty:
                for column in self.map.columns[name].names:
                    missing |= np.isnan(tracks.columns[column])
        return missing

    def ids(self, tracks: _Table) -> tuple[NDArray[Any], I64, _Table]:
        """The ids in order, the index of each row's id among them, and the rows.

        Ids become numbers where all of them are. Repeated rows of the table of vehicles are
        dropped.
        """
        name = self.map.columns["vehicle"].names[0]
        numbers = _as_numbers(tracks.columns[name])
        vehicles = self.tables.get(VEHICLES)
        if vehicles is not None:
            vehicle_ids = _as_numbers(vehicles.columns[name])
            if vehicle_ids.dtype != numbers.dtype:  # Only one table has numbers: compare as text.
                numbers = tracks.columns[name].astype("U40")
                vehicle_ids = vehicles.columns[name].astype("U40")
            vehicles = replace(vehicles, columns={**vehicles.columns, name: vehicle_ids})
            self.tables[VEHICLES] = vehicles = _without_repeated(vehicles, name)
            file = self.map.files[VEHICLES].strip("_").partition(".")[0]
            is_known = np.isin(numbers, vehicles.columns[name])
            tracks.check(is_known, name, f"an id of {file}")
        ids, vehicle = np.unique(numbers, return_inverse=True)
        return ids, vehicle, replace(tracks, columns={**tracks.columns, name: numbers})

    def of_vehicles(self, cells: NDArray[Any], ids: NDArray[Any]) -> NDArray[Any]:
        """The cells that some ids have in a column of the table of vehicles, shape of `ids`."""
        keys = self.tables[VEHICLES].columns[self.map.columns["vehicle"].names[0]]
        order = np.argsort(keys, kind="stable")
        return cells[order[np.searchsorted(keys[order], ids)]]

    def type_codes(self, tracks: _Table, vehicle: I64, ids: NDArray[Any]) -> I64:
        """A `VehicleKind`, `BY_LENGTH`, `LEFT_OUT` or `NOT_KNOWN` for each row, shape (row,)."""
        cell = self.cell("type")
        if cell is None:
            return np.full(tracks.num_rows, NOT_KNOWN)
        if cell[0] is self.tables[TRACKS]:
            return self.codes_of(tracks, cell[1])
        return self.of_vehicles(self.codes_of(*cell), ids)[vehicle]

    def codes_of(self, table: _Table, column: str) -> I64:
        """The code of each word in a column of types, as of `type_codes`, shape (row,)."""
        words, word_index = np.unique(table.columns[column], return_inverse=True)
        codes = {"": NOT_KNOWN, **self.map.kinds}
        is_listed = np.array([word in codes for word in words.tolist()])
        expected = " or ".join(self.map.kinds) or "a type of the map"
        table.check(is_listed[word_index], column, expected)
        code_of_word = np.array([codes.get(word, NOT_KNOWN) for word in words.tolist()], np.int64)
        return code_of_word[word_index]

    def check_vehicles(self, tracks: _Table) -> None:
        """Refuse sizes that no vehicle has, and directions other than 1 and 2.

        Sizes of vehicles that are left out may be anything.
        """
        for name, (least, most) in _SIZES.items():
            if (cell := self.cell(name)) is None:
                continue
            table, column = cell
            is_of_rows = table is self.tables[TRACKS]
            table = tracks if is_of_rows else table
            size = table.columns[column] * self.map.columns[name].factor
            is_right = (size > least) & (size < most)
            if is_of_rows:
                is_right |= np.isnan(size)
            elif (types := self.cell("type")) is not None and types[0] is table:
                is_right |= self.codes_of(*types) == LEFT_OUT
            table.check(is_right, column, f"a {name}, {least:g} to {most:g} m")
        if (cell := self.cell("direction")) is not None:
            table, column = cell
            table = tracks if table is self.tables[TRACKS] else table
            table.check(np.isin(table.columns[column], _DIRECTIONS), column, "1 or 2")

    def is_repeated(
        self,
        tracks: _Table,
        vehicle: I64,
        moment: F64,
        ids: NDArray[Any],
        *,
        is_missing: Mask,
    ) -> Mask:
        """Whether a row repeats the vehicle and time of the row before it, shape (row,).

        Args:
            tracks: Rows in order of vehicle, instant, and whether a quantity is missing.
            vehicle: Index of the vehicle of each row in `ids`, shape (row,).
            moment: Instant of each row, same shape [frames].
            ids: Id of each vehicle.
            is_missing: Whether a quantity is missing in each row, same shape.

        Raises:
            ImportFormatError: Two rows of a vehicle at one time differ.
        """
        is_same_time = np.append(False, (np.diff(vehicle) == 0) & (np.diff(moment) <= ON_GRID))
        later = np.flatnonzero(is_same_time & ~is_missing)
        is_equal = np.ones(len(later), np.bool_)
        names = [name for name in tracks.columns if name not in self.map.only]
        for name in names:
            cells = tracks.columns[name]
            is_equal &= _is_equal(cells[later], cells[later - 1])
        if is_equal.all():
            return is_same_time
        row = int(later[np.argmin(is_equal)])
        column = self.time_column
        name = next(
            name
            for name, cells in tracks.columns.items()
            if name in names and not _is_equal(cells[[row]], cells[[row - 1]]).all()
        )
        conflict = " and ".join(f"{name} {tracks.columns[name][k]}" for k in (row - 1, row))
        raise refused_cell(
            tracks.where,
            int(tracks.line[row]),
            column,
            f"another {self.time_name} of vehicle {ids[vehicle[row]]} than in line "
            f"{tracks.line[row - 1] + 2}, or the same values",
            f"{self.time_name} {tracks.columns[column][row]:g} again, with {conflict} "
            "(choose a part: --only COLUMN=VALUE)",
        )

    @property
    def time_name(self) -> str:
        """The quantity that states the instant of a row: frame or time."""
        return "frame" if "frame" in self.map.columns else "time"

    @property
    def time_column(self) -> str:
        """The column of `time_name`."""
        return self.map.columns[self.time_name].names[0]

    def check_frames(
        self, tracks: _Table, vehicle: I64, moment: F64, ids: NDArray[Any], rows: Mask
    ) -> None:
        """Refuse a vehicle without a row in a frame between its first and its last."""
        line, vehicle, moment = tracks.line[rows], vehicle[rows], moment[rows]
        is_wrong = (np.diff(vehicle) == 0) & (np.abs(np.diff(moment) - 1.0) > ON_GRID)
        if not is_wrong.any():
            return
        row = int(np.argmax(is_wrong)) + 1
        frames = tracks.columns[self.time_column][rows]
        raise refused_cell(
            tracks.where,
            int(line[row]),
            self.time_column,
            f"frame {frames[row - 1] + 1:g} of vehicle {ids[vehicle[row]]}",
            f"{self.time_name} {frames[row]:g}",
        )

    def about_tracks(
        self, tracks: _Table, track: I64, ids: NDArray[Any], type_code: I64
    ) -> _OfTracks:
        """Sizes, kind and direction of each track.

        Args:
            tracks: The rows.
            track: Index of the track of each row, ascending, shape (row,).
            ids: Id of the vehicle of each track, shape (track,).
            type_code: As of `type_codes`, shape (row,).
        """
        count = len(ids)
        sizes: dict[str, F64] = {}
        findings: list[Finding] = []
        for name in _SIZES:
            cell = self.cell(name)
            if cell is None:
                sizes[name] = np.full(count, getattr(self.map, name), np.float64)
                continue
            table, column = cell
            factor = self.map.columns[name].factor
            of_tracks = None
            if column in tracks.columns:
                of_tracks = _medians(tracks.columns[column], track, count) * factor
            if table is self.tables[TRACKS]:
                assert of_tracks is not None
                first_row = np.searchsorted(track, np.arange(count))
                is_right = np.ones(tracks.num_rows, np.bool_)
                is_right[first_row] = ~np.isnan(of_tracks)
                tracks.check(is_right, column, f"a {name} in one of the rows of the vehicle")
                sizes[name] = of_tracks
                continue
            sizes[name] = self.of_vehicles(table.columns[column], ids) * factor
            if of_tracks is not None:
                findings += compare_sizes(column, of_tracks, sizes[name], tracks.num_rows)
        kind, is_kind_known = self.kinds(sizes["length"], _most_frequent(type_code, track, count))
        return _OfTracks(
            length=sizes["length"],
            width=sizes["width"],
            kind=kind,
            is_kind_known=is_kind_known,
            direction=self.directions(tracks, track, ids),
            findings=findings,
        )

    def directions(self, tracks: _Table, track: I64, ids: NDArray[Any]) -> I64 | None:
        """Number of the carriageway of each track; None where no column has it."""
        cell = self.cell("direction")
        if cell is None:
            return None
        table, column = cell
        if table is not self.tables[TRACKS]:
            return self.of_vehicles(table.columns[column], ids).astype(np.int64)
        first_row = np.searchsorted(track, np.arange(len(ids)))
        return tracks.columns[column][first_row].astype(np.int64)

    def kinds(self, length: F64, type_code: I64) -> tuple[I64, Mask]:
        """The kind of each vehicle, and whether it is known.

        A kind is unknown where none is stated, and where the length contradicts it.

        Args:
            length: Shape (vehicle,) [m].
            type_code: A kind, `BY_LENGTH` for a car, or `NOT_KNOWN`, same shape.
        """
        is_car, no_truck = type_code == BY_LENGTH, np.zeros(len(length), np.bool_)
        by_length = kinds_by_length(length, is_truck=no_truck, is_car=is_car).astype(np.int64)
        kind = np.where(type_code >= 0, type_code, by_length)
        is_known = (type_code != NOT_KNOWN) & may_be_kind(kind, length)
        if self.cell("type") is None:
            # Without a column of types, "kinds" in `Recording.unknown` covers all vehicles.
            is_known[:] = True
        return kind, is_known

    def about(self) -> dict[str, Any]:
        """What holds for the whole recording."""
        if RECORDING not in self.tables:
            return {}
        table = self.tables[RECORDING]
        if table.num_rows != 1:
            got = f"{table.num_rows} rows (choose a part: --only COLUMN=VALUE)"
            raise refused(table.where, "table", "one row", got)
        about: dict[str, Any] = {}
        for name, column in self.map.columns.items():
            if column.table == RECORDING:
                cell = table.columns[column.names[0]][0]
                about[name] = cell if name in _WORDS else float(cell) * column.factor
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
        table.check(np.array([is_right]), self.map.columns["frame_rate"].names[0], expected)

    def moments(self, tracks: _Table, vehicle: I64, about: Mapping[str, Any]) -> tuple[F64, int]:
        """The instant of each row in frames, and the time between two frames [ms]."""
        cells = tracks.columns[self.time_column]
        if self.time_name == "frame":
            exact = 1000.0 / float(about.get("frame_rate") or self.map.frames_per_second or 1.0)
            moment = cells * exact
        else:
            moment = (cells - cells.min()) * (self.map.columns["time"].factor * 1000.0)
            order = np.lexsort((moment, vehicle))
            apart = np.diff(moment[order])[np.diff(vehicle[order]) == 0]
            apart = apart[apart > 0]
            exact = float(np.median(apart)) if len(apart) else 0.0
        if not INTERVALS_MS[0] <= exact <= INTERVALS_MS[1]:
            raise refused(
                tracks.where,
                f"column {self.time_column}",
                f"{INTERVALS_MS[0]:g} to {INTERVALS_MS[1]:g} ms between two states",
                f"{exact:g} ms",
            )
        # Frames are whole milliseconds apart: at another rate states are interpolated.
        interval = round(exact)
        moment = moment / interval
        if np.ptp(moment) > _MOST_FRAMES:
            raise refused(
                tracks.where,
                f"column {self.time_column}",
                f"at most {_MOST_FRAMES:,} frames from the first to the last",
                f"{np.ptp(moment):,.0f} (choose a part: --only COLUMN=VALUE)",
            )
        return moment, interval

    def values(self, tracks: _Table, empty: Iterable[str]) -> dict[str, F64]:
        """Quantities that change, in SI units and the axes of the table, shape (row,) each.

        Of a quantity with several columns, such as the four corners of a box, it is their mean.
        """
        values: dict[str, F64] = {}
        for name in self.changing:
            if name not in empty:
                column = self.map.columns[name]
                mean = np.mean([tracks.columns[cell] for cell in column.names], axis=0)
                values[name] = mean * column.factor
        return values

    def oriented(self, values: dict[str, F64], about: _OfTracks, track: I64) -> dict[str, F64]:
        """Quantities of the centres of vehicles, with y to the left of x.

        Args:
            values: Quantities in the axes of the table, maybe of a corner, shape (row,) each.
            about: Sizes of each track.
            track: Index of the track of each row, shape (row,).
        """
        values = dict(values)
        if self.map.point == "corner":
            values["x"] = values["x"] + about.length[track] * 0.5
            values["y"] = values["y"] + about.width[track] * 0.5
        if not self.map.y_is_left:
            for name in ("y", "vy", "ay", "heading", "yaw_rate"):
                if name in values:
                    values[name] = -values[name]
        return values

    def words(self, name: str, tracks: _Table) -> NDArray[Any] | None:
        """A column of words, None where there is none."""
        cell = self.cell(name)
        return None if cell is None else tracks.columns[cell[1]]


def _tracks(vehicle: I64, moment: F64, values: Mapping[str, F64], interval_ms: int) -> I64:
    """Index of the track of each row, shape (row,). A gap or a jump begins a new track.

    Args:
        vehicle: Index of the vehicle of each row, ascending, shape (row,).
        moment: Instant of each row, ascending within a vehicle, same shape [frames].
        values: Positions x and y, same shape [m].
        interval_ms: Length of a frame [ms].
    """
    is_same = np.diff(vehicle) == 0
    apart = np.where(is_same, np.diff(moment), 1.0)
    speed = np.hypot(np.diff(values["x"]), np.diff(values["y"])) / (apart * interval_ms * 1e-3)
    median_speed = float(np.median(speed[is_same])) if is_same.any() else 0.0
    is_jump = speed > max(_MAX_SPEED, _MAX_SPEED_RATIO * median_speed)
    return np.append(0, np.cumsum(~is_same | (apart > TORN) | is_jump))


def _has_value(cells: NDArray[Any], value: str) -> Mask:
    """Whether cells have a value that the user states as text: 12 is also 12.0 among numbers."""
    if cells.dtype.kind != "f":
        return cells.astype(object) == value
    try:
        return cells == float(value)
    except ValueError:  # A word is in no column of numbers.
        return np.zeros(len(cells), np.bool_)


def _is_equal(cells: NDArray[Any], others: NDArray[Any]) -> Mask:
    """Whether cells of two rows are equal, or both missing, shape (row,)."""
    is_equal = cells == others
    if cells.dtype.kind == "f":
        is_equal |= np.isnan(cells) & np.isnan(others)
    return is_equal.astype(np.bool_)


def _without_repeated(vehicles: _Table, name: str) -> _Table:
    """The table of vehicles without repeated rows.

    Args:
        vehicles: The table.
        name: The column of ids.

    Raises:
        ImportFormatError: Two rows of a vehicle differ.
    """
    order = np.argsort(vehicles.columns[name], kind="stable")
    columns = [column[order] for column in vehicles.columns.values()]
    ids = vehicles.columns[name][order]
    is_same_id = np.append(False, ids[1:] == ids[:-1])
    is_equal = np.ones(len(order), np.bool_)
    for column in columns:
        is_equal[1:] &= _is_equal(column[1:], column[:-1])
    is_right = np.ones(len(order), np.bool_)
    is_right[order] = ~is_same_id | is_equal
    vehicles.check(
        is_right, name, "a different id in each row (choose a part: --only COLUMN=VALUE)"
    )
    is_first = np.ones(len(order), np.bool_)
    is_first[order] = ~is_same_id
    return vehicles.kept(is_first)


def _as_numbers(names: NDArray[Any]) -> NDArray[Any]:
    """Names of vehicles as whole numbers, if all of them are."""
    try:
        return names.astype(np.int64)
    except (ValueError, OverflowError):
        return names.astype("U40")  # Of fixed size, however long a name is.


def _medians(values: F64, group: I64, count: int) -> F64:
    """The median of each group without its NaNs, NaN for an empty group, shape (group,)."""
    is_number = ~np.isnan(values)
    values, group = values[is_number], group[is_number]
    size = np.bincount(group, minlength=count)
    if not len(values):
        return np.full(count, np.nan)
    order = np.lexsort((values, group))
    first = np.minimum(np.cumsum(size) - size, len(values) - 1)
    low = np.minimum(first + np.maximum(size - 1, 0) // 2, len(values) - 1)
    high = np.minimum(first + size // 2, len(values) - 1)
    median = (values[order][low] + values[order][high]) * 0.5
    return np.where(size > 0, median, np.nan)


def _most_frequent(codes: I64, group: I64, count: int) -> I64:
    """The most frequent code of each group; `NOT_KNOWN` only where a group has no other code."""
    kinds = np.unique(codes)
    votes = np.zeros((count, len(kinds)), np.int64)
    np.add.at(votes, (group, np.searchsorted(kinds, codes)), 1)
    votes[:, kinds == NOT_KNOWN] = 0
    return np.where(votes.any(axis=1), kinds[votes.argmax(axis=1)], NOT_KNOWN)
