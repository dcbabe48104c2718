"""From the tables of a recording to rows: cells checked, tables joined, units converted.

A map of columns says where each quantity is. Quantities that a table lacks are missing in the rows
too; they are worked out later, on the road. Sizes and kinds belong to a track, a stretch of rows
without a gap: recordings of several periods number their vehicles anew in each.
"""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.recordings.array_table import MISSING, ArrayTable
from overtaking.recordings.column_map import (
    LEFT_OUT,
    NOT_KNOWN,
    RECORDING,
    TRACKS,
    UNITS,
    VEHICLES,
    ColumnMap,
    files_of,
)
from overtaking.recordings.column_matching import name_key
from overtaking.recordings.column_request import NUMBER, TEXT, TIME, ColumnRequest
from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.frame_times import (
    FRAME_INTERVAL_RANGE_MS,
    check_extent,
    check_interval,
    frame_interval_ms,
    most_frequent_stride,
    order_rows,
    undo_clock_wraps,
)
from overtaking.recordings.gaps import check_pieces, gap_findings, is_long_gap
from overtaking.recordings.memory_tables import arrow_table
from overtaking.recordings.missing_cells import check_missing, fill_missing, missing_findings
from overtaking.recordings.motion_check import FaultyRows, find_faulty_rows, motion_findings
from overtaking.recordings.recording_checks import compare_sizes
from overtaking.recordings.rows import ON_GRID, Rows, at_whole_frames, track_names
from overtaking.recordings.table_errors import refused, refused_cell
from overtaking.recordings.table_files import checked_table, column_names, read_columns
from overtaking.recordings.vehicle_constants import (
    VehicleConstants,
    medians,
    vehicle_kinds,
    vote_on_types,
)
from overtaking.recordings.vehicle_ids import compare_names, identify_vehicles

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    import pyarrow as pa
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask

_DIRECTIONS = (1, 2)
_SIZES = {"length": (0.1, 50.0), "width": (0.1, 10.0)}
_TEXT_QUANTITIES = frozenset({"type", "lane", "upper_lines", "lower_lines"})
_LIMITS = {"x": 1.0e8, "y": 1.0e8, "frame": 1.0e9}
_VEHICLE_CONSTANTS = ("type", "length", "width", "direction")
_NOT_CHANGING = (*_VEHICLE_CONSTANTS, "vehicle", "frame", "time", "lane")
_MAX_ROWS = 50_000_000
_MAX_TIME, _MAX_DATE = 1.0e13, 1.0e10  # In the unit of the map; in seconds since 1970.

_MAX_SPEED = 150.0
"""An id that moves faster between two rows belongs to two vehicles, one after the other [m/s]."""

_MAX_SPEED_RATIO = 20.0
"""Jumps must also exceed the median speed by this factor: with positions in a wrong unit, every row
exceeds `_MAX_SPEED`, and no track would be left for `recording_checks` to name the unit."""


def read_track_rows(path: Path, columns: ColumnMap, only: Mapping[str, str] | None = None) -> Rows:
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
    chosen = _with_choice(columns, only or {})
    tables: dict[str, ArrayTable] = {}
    findings: list[Finding] = []
    for name, file in files_of(path, chosen).items():
        existing = column_names(file) if chosen.files else ()
        request = _request(chosen, name, existing)
        content = read_columns(file, request)
        tables[name] = ArrayTable.of(content, file.name, _words(chosen)).choose(chosen.only)
        findings += _thousands_findings(content.grouped, content.table.num_rows)
    return _TableJoiner(chosen, tables, findings).join()


def track_rows_from_table(table: Any, columns: ColumnMap) -> Rows:
    """The states in a table in memory; see `arrow_table` for its types.

    Raises:
        ImportFormatError: It lacks a column, or has a cell that is no such value.
    """
    chosen = _with_choice(columns, {})
    arrow, index_names = arrow_table(table)
    request = _request(chosen, TRACKS)
    names = request.match(arrow.column_names, "table", index_names)
    part = arrow.select(list(names.values())).rename_columns(list(names))
    content = checked_table(part, request, "table")
    tracks = ArrayTable.of(content, "table", _words(chosen)).choose(chosen.only)
    findings = _thousands_findings(content.grouped, content.table.num_rows)
    return _TableJoiner(chosen, {TRACKS: tracks}, findings).join()


def _with_choice(columns: ColumnMap, only: Mapping[str, str]) -> ColumnMap:
    """The map with further values that columns must have, composed as the cells are."""
    values = {**columns.only, **only}
    composed = {name: unicodedata.normalize("NFC", value) for name, value in values.items()}
    return replace(columns, only=composed)


def _words(columns: ColumnMap) -> dict[str, frozenset[str]]:
    """The columns of words, and the words that are no missing cell, whatever they look like."""
    words: dict[str, frozenset[str]] = {}
    for name, column in columns.columns.items():
        if name in _TEXT_QUANTITIES:
            lanes = columns.road.get("lanes", ()) if name == "lane" else ()
            kinds = columns.kinds if name == "type" else ()
            words[column.names[0]] = frozenset({*kinds, *map(str, lanes)})
    return words


def _request(columns: ColumnMap, table: str, existing: Iterable[str] = ()) -> ColumnRequest:
    """The columns to read of a table.

    Args:
        columns: The map.
        table: One of `column_map.TABLES`.
        existing: The columns that its file has. Of those by which rows are chosen, and of sizes
            that the table of vehicles has as well, a table is asked for the existing ones.
    """
    types: dict[str, pa.DataType] = dict.fromkeys(columns.names(table), TEXT)
    limits: dict[str, float] = {}
    units: dict[str, str] = {}
    for name, column in columns.columns.items():
        if column.table == table and name not in _TEXT_QUANTITIES and name != "vehicle":
            types |= dict.fromkeys(column.names, TIME if name == "time" else NUMBER)
        if column.table == table:
            limits |= dict.fromkeys(column.names, _LIMITS[name]) if name in _LIMITS else {}
            if name == "time":
                limits |= dict.fromkeys(column.names, max(_MAX_TIME, _MAX_DATE / column.factor))
            units |= dict.fromkeys(column.names, column.unit)
    if table in (TRACKS, VEHICLES):
        types[columns.columns["vehicle"].names[0]] = TEXT
    optional: dict[str, pa.DataType] = dict.fromkeys(columns.only, TEXT)
    if table == TRACKS:
        optional |= {
            column.names[0]: NUMBER
            for name, column in columns.columns.items()
            if name in _SIZES and column.table == VEHICLES
        }
    keys = set(map(name_key, existing))
    types |= {
        name: kind
        for name, kind in optional.items()
        if name_key(name) in keys and name not in types
    }
    time = columns.columns.get("time")
    return ColumnRequest(
        types=types,
        limits=limits,
        gaps=() if table == RECORDING else tuple(types),
        units=units,
        known_units=tuple(UNITS),
        time_unit=1.0 if time is None else time.factor,
        has_time_unit=time is not None and bool(time.unit),
        header=columns.header,
        thousands=columns.thousands,
    )


def _thousands_findings(grouped: Mapping[str, str], num_rows: int) -> list[Finding]:
    """A finding for each column whose numbers may have separators of thousands."""
    return [
        Finding(
            check=Check.NUMBER_FORMAT,
            consequence=Consequence.REPORTED,
            detail=(
                f"column {column}: {example} is read as a number with decimals, but all cells may "
                "be whole numbers with separators of thousands; state recording.thousands in the "
                'map of columns: ".", "," or "none"'
            ),
            rows=num_rows,
        )
        for column, example in grouped.items()
    ]


@dataclass(frozen=True, slots=True)
class _TableJoiner:
    """The tables of a recording on their way to rows."""

    map: ColumnMap
    tables: dict[str, ArrayTable]
    findings: list[Finding]

    def join(self) -> Rows:
        """The states of the recording."""
        tracks = self.tables[TRACKS]
        if not 0 < tracks.num_rows <= _MAX_ROWS:
            expected = f"1 to {_MAX_ROWS:,}"
            raise refused(tracks.file_name, "rows", expected, f"{tracks.num_rows:,}")
        names, vehicle = self.identify()
        tracks = self.tables[TRACKS]
        recording_values = self.recording_values()
        states = self.complete_rows(tracks, vehicle, names, recording_values)
        tracks, vehicle, without_position = states
        empty = self.empty_quantities(tracks)
        type_code = self.type_codes(tracks, vehicle)
        seconds = self.seconds(tracks, recording_values)
        x, y = (self.mean(tracks, name) for name in ("x", "y"))
        if self.time_name == "time":
            seconds, findings = undo_clock_wraps(seconds, vehicle, x, y, self.time_column)
            self.findings.extend(findings)
        incomplete = self.is_incomplete(tracks, empty)
        order, findings = order_rows(seconds, vehicle, incomplete, names, self.time_column)
        self.findings.extend(findings)
        tracks, vehicle, seconds = tracks.select(order), vehicle[order], seconds[order]
        type_code, incomplete = type_code[order], incomplete[order]
        frame_time, interval = self.frame_times(tracks, vehicle, seconds, recording_values)
        x, y = x[order], y[order]
        faulty = self.faulty_rows(vehicle, frame_time, x, y, type_code, interval)
        self.findings.extend(motion_findings(faulty, vehicle=vehicle, seconds=seconds, names=names))
        is_kept = np.ones(len(vehicle), np.bool_)
        is_kept[faulty.row] = False
        row_index = np.flatnonzero(is_kept)
        if len(faulty.row):
            tracks, vehicle, seconds = tracks.select(is_kept), vehicle[is_kept], seconds[is_kept]
            type_code, incomplete = type_code[is_kept], incomplete[is_kept]
            frame_time, x, y = frame_time[is_kept], x[is_kept], y[is_kept]
        track = _track_of_rows(vehicle, frame_time, x, y, interval)
        track_vehicle = vehicle[np.flatnonzero(np.append(True, np.diff(track) != 0))]
        track_type, findings = self.vote(type_code, track, seconds, names[track_vehicle])
        is_read = (track_type != LEFT_OUT)[track]
        num_left_out = len(np.unique(vehicle[~is_read]))
        if not is_read.any():
            raise refused(tracks.file_name, "vehicles", "some that are read", "none")
        self.findings.extend(findings)
        is_repeated = self.is_repeated(
            tracks.select(is_read), vehicle[is_read], frame_time[is_read], names,
            incomplete[is_read],
        )  # fmt: skip
        rows = np.flatnonzero(is_read)[~is_repeated]
        self.report_repeated(np.flatnonzero(is_read)[is_repeated], seconds, vehicle, names)
        tracks, vehicle, seconds = tracks.select(rows), vehicle[rows], seconds[rows]
        frame_time = frame_time[rows]
        tracks_left, track = np.unique(track[rows], return_inverse=True)
        track_vehicle, track_type = track_vehicle[tracks_left], track_type[tracks_left]
        self.check_vehicle_values(tracks)
        self.report_missing_values(tracks, empty, seconds, vehicle, names)
        values = fill_missing(self.motion_columns(tracks, empty), track, seconds)
        constants = self.vehicle_constants(tracks, track, track_vehicle, names, track_type)
        values = self.oriented(values, constants, track)
        first_row = np.flatnonzero(np.append(True, np.diff(track) != 0))
        check_pieces(tracks.file_name, np.append(first_row, len(track)), track_vehicle, interval)
        track_name = track_names(names, track_vehicle)
        self.findings.extend(
            gap_findings(
                track,
                frame_time,
                seconds,
                interval_ms=interval,
                track_names=track_name,
                track_vehicle=track_vehicle,
                num_faulty=np.diff(np.searchsorted(faulty.row, row_index[rows])),
            )
        )
        grid = at_whole_frames(track, frame_time, values)
        owner, lane = grid.owner, self.lane_names(tracks)
        direction = constants.direction
        return Rows(
            where=tracks.file_name,
            names=track_name[owner],
            kind=constants.kind[owner].astype(np.uint8),
            is_kind_known=constants.is_kind_known[owner],
            length=constants.length[owner],
            width=constants.width[owner],
            file_row=np.minimum.reduceat(tracks.row, first_row)[owner],
            direction=None if direction is None else direction[owner],
            start=grid.start,
            frame=grid.frame,
            frame_interval_ms=interval,
            time_origin_s=float(seconds[0] - frame_time[0] * interval * 1e-3),
            values=grid.values,
            lane=None if lane is None else lane[grid.nearest],
            about=recording_values,
            notes={
                "interpolated": grid.is_moved,
                "tracks_torn": len(owner) - len(np.unique(track_vehicle[owner])),
                "left_out": num_left_out,
                "rows_repeated": int(is_repeated.sum()),
                "rows_missing": len(without_position),
            },
            findings=(*self.findings, *constants.findings),
        )

    def find_column(self, name: str) -> tuple[ArrayTable, str] | None:
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

    @property
    def id_column(self) -> str:
        """The column of ids."""
        return self.map.columns["vehicle"].names[0]

    @property
    def time_name(self) -> str:
        """The quantity that states the instant of a row: frame or time."""
        return "frame" if "frame" in self.map.columns else "time"

    @property
    def time_column(self) -> str:
        """The column of `time_name`."""
        return self.map.columns[self.time_name].names[0]

    def identify(self) -> tuple[NDArray[np.object_], I64]:
        """Names of the vehicles, and the vehicle of each row of the table of states.

        Repeated rows of the table of vehicles are dropped, and its rows are sorted by vehicle.

        Raises:
            ImportFormatError: The table of vehicles lacks one, or has it twice with other values.
        """
        tracks, vehicles = self.tables[TRACKS], self.tables.get(VEHICLES)
        columns = [table.texts[self.id_column] for table in (tracks, vehicles) if table is not None]
        names, vehicle_of_row = identify_vehicles(columns)
        self.findings.extend(compare_names(self.id_column, names.tolist(), tracks.num_rows))
        if vehicles is None:
            return names, vehicle_of_row[0]
        vehicles, listed = _without_repeated(vehicles, vehicle_of_row[1], self.id_column)
        file = self.map.files[VEHICLES].strip("_").partition(".")[0]
        vehicle = vehicle_of_row[0]
        is_listed = np.isin(vehicle, listed) | (vehicle == MISSING)
        tracks.check(is_listed, self.id_column, f"an id of {file}")
        # Each vehicle has the row of its number; vehicles without states have none.
        new_number = np.full(len(names) + 1, MISSING)
        new_number[listed] = np.arange(len(listed))
        self.tables[VEHICLES] = vehicles
        return names[listed], new_number[vehicle]

    def is_missing(self, table: ArrayTable, name: str) -> Mask:
        """Whether each row of a table lacks a quantity, shape (row,)."""
        missing = np.zeros(table.num_rows, np.bool_)
        for column in self.map.columns[name].names:
            if column in table.texts:
                missing |= table.texts[column].is_missing
            else:
                missing |= np.isnan(table.numbers[column])
        return missing

    def complete_rows(
        self,
        tracks: ArrayTable,
        vehicle: I64,
        names: NDArray[np.object_],
        recording_values: Mapping[str, Any],
    ) -> tuple[ArrayTable, I64, list[tuple[int, float]]]:
        """The rows that have a vehicle, a time and a position, and their vehicles.

        Returns:
            The rows, their vehicles, and vehicle and time of each other row.

        Raises:
            ImportFormatError: Too many lack one of these, or a frame is no whole number.
        """
        needed = ("vehicle", self.time_name, "x", "y")
        is_missing = {name: self.is_missing(tracks, name) for name in needed}
        is_missing["vehicle"] = vehicle == MISSING
        is_left_out = np.logical_or.reduce([*is_missing.values()])
        if is_left_out.any():
            is_counted = ~self.is_blank(tracks)
            is_counted &= self.type_codes(tracks, vehicle) != LEFT_OUT
            seconds = self.seconds(tracks, recording_values)
            for name in needed:
                column = self.map.columns[name].names[0]
                advice = "complete them, or delete these rows"
                check_missing(tracks, column, is_missing[name], is_counted, advice)
                rows = np.flatnonzero(is_missing[name] & is_counted)
                self.findings.extend(
                    missing_findings(column, rows, seconds, vehicle, names, is_left_out=True)
                )
            incomplete = np.flatnonzero(is_left_out & is_counted)
            cells = tracks.numbers[self.time_column][incomplete].tolist()
            dropped = list(zip(vehicle[incomplete].tolist(), cells, strict=True))
            tracks, vehicle = tracks.select(~is_left_out), vehicle[~is_left_out]
            if not tracks.num_rows:
                raise refused(tracks.file_name, "rows", "positions", "none")
        else:
            dropped = []
        if self.time_name == "frame":
            frame = tracks.numbers[self.time_column]
            tracks.check(frame == np.rint(frame), self.time_column, "a whole number")
        return tracks, vehicle, dropped

    def is_blank(self, tracks: ArrayTable) -> Mask:
        """Whether all cells of a row are missing, shape (row,)."""
        blank = np.ones(tracks.num_rows, np.bool_)
        for cells in tracks.numbers.values():
            blank &= np.isnan(cells)
        for texts in tracks.texts.values():
            blank &= texts.is_missing | texts.is_text("")
        return blank

    def empty_quantities(self, tracks: ArrayTable) -> frozenset[str]:
        """Quantities beside positions whose columns are empty: they count as not there."""
        return frozenset(
            name
            for name in self.changing
            if name not in ("x", "y") and self.is_missing(tracks, name).all()
        )

    def is_incomplete(self, tracks: ArrayTable, empty: Iterable[str]) -> Mask:
        """Whether a row lacks a quantity that changes, but for those of empty columns; (row,)."""
        incomplete = np.zeros(tracks.num_rows, np.bool_)
        for name in self.changing:
            if name not in empty:
                incomplete |= self.is_missing(tracks, name)
        return incomplete

    def report_missing_values(
        self,
        tracks: ArrayTable,
        empty: Iterable[str],
        seconds: F64,
        vehicle: I64,
        names: NDArray[np.object_],
    ) -> None:
        """Note the missing cells of optional quantities, and refuse too many of them.

        Sizes and kinds belong to a track, so one row of it is enough.
        """
        all_rows = np.ones(tracks.num_rows, np.bool_)
        for name in [*self.changing, *_VEHICLE_CONSTANTS]:
            column = self.map.columns.get(name)
            if name in empty or column is None or column.table != TRACKS:
                continue
            is_missing = self.is_missing(tracks, name)
            rows = np.flatnonzero(is_missing)
            if name in self.changing:
                advice = "complete them, or leave the column out of the map"
                check_missing(tracks, column.names[0], is_missing, all_rows, advice)
            self.findings.extend(
                missing_findings(column.names[0], rows, seconds, vehicle, names, is_left_out=False)
            )

    def of_vehicles(self, cells: NDArray[Any], vehicle: I64) -> NDArray[Any]:
        """The cells that some vehicles have in a column of the table of vehicles."""
        return np.append(cells, cells[:1])[vehicle]  # The last place is that of `MISSING`.

    def type_codes(self, tracks: ArrayTable, vehicle: I64) -> I64:
        """A `VehicleKind`, `BY_LENGTH`, `LEFT_OUT` or `NOT_KNOWN` for each row, shape (row,)."""
        cell = self.find_column("type")
        if cell is None:
            return np.full(tracks.num_rows, NOT_KNOWN)
        if cell[0] is self.tables[TRACKS]:
            return self.codes_of(tracks, cell[1])
        return self.of_vehicles(self.codes_of(*cell), vehicle)

    def codes_of(self, table: ArrayTable, column: str) -> I64:
        """The code of each word in a column of types, as of `type_codes`, shape (row,)."""
        words = table.texts[column]
        kinds = {unicodedata.normalize("NFC", word): code for word, code in self.map.kinds.items()}
        codes = [kinds.get(word, NOT_KNOWN) for word in words.texts.tolist()]
        is_listed = [word in kinds for word in words.texts.tolist()]
        expected = " or ".join(self.map.kinds) or "a type of the map"
        # The last place is that of an empty cell.
        table.check(np.array([*is_listed, True])[words.code], column, expected)
        return np.array([*codes, kinds.get("", NOT_KNOWN)], np.int64)[words.code]

    def vote(
        self, type_code: I64, track: I64, seconds: F64, names: NDArray[np.object_]
    ) -> tuple[I64, list[Finding]]:
        """The type of each track, and what was found."""
        cell = self.find_column("type")
        column = "" if cell is None else cell[1]
        return vote_on_types(type_code, track, seconds, names, column)

    def check_vehicle_values(self, tracks: ArrayTable) -> None:
        """Refuse sizes that no vehicle has, and directions other than 1 and 2.

        Sizes of vehicles that are left out may be anything.
        """
        for name, (least, most) in _SIZES.items():
            if (cell := self.find_column(name)) is None:
                continue
            table, column = cell
            is_of_rows = table is self.tables[TRACKS]
            table = tracks if is_of_rows else table
            size = table.numbers[column] * self.map.columns[name].factor
            is_right = (size > least) & (size < most)
            length = self.find_column("length")
            if name == "width" and length is not None and length[0] is cell[0]:
                # Exchanged columns are named as such by `examination.check_sizes`.
                lengths = table.numbers[length[1]] * self.map.columns["length"].factor
                is_right |= (size > lengths) & (size < _SIZES["length"][1])
            if is_of_rows:
                is_right |= np.isnan(size)
            elif (types := self.find_column("type")) is not None and types[0] is table:
                is_right |= self.codes_of(*types) == LEFT_OUT
            table.check(is_right, column, f"a {name}, {least:g} to {most:g} m")
        if (cell := self.find_column("direction")) is not None:
            table, column = cell
            table = tracks if table is self.tables[TRACKS] else table
            table.check(np.isin(table.numbers[column], _DIRECTIONS), column, "1 or 2")

    def is_repeated(
        self,
        tracks: ArrayTable,
        vehicle: I64,
        frame_time: F64,
        names: NDArray[np.object_],
        is_incomplete: Mask,
    ) -> Mask:
        """Whether a row repeats the vehicle and time of the row before it, shape (row,).

        Args:
            tracks: Rows in order of vehicle, instant, and whether a quantity is missing.
            vehicle: Index of the vehicle of each row, shape (row,).
            frame_time: Instant of each row, same shape [frames].
            names: Name of each vehicle.
            is_incomplete: Whether a quantity is missing in each row, same shape.

        Raises:
            ImportFormatError: Two rows of a vehicle at one time differ.
        """
        is_same_time = np.append(False, (np.diff(vehicle) == 0) & (np.diff(frame_time) <= ON_GRID))
        later = np.flatnonzero(is_same_time & ~is_incomplete)
        columns = [
            name
            for name in (*tracks.numbers, *tracks.texts)
            if name not in self.map.only and name != self.id_column
        ]
        differs = {name: tracks.differs(name, later, later - 1) for name in columns}
        is_conflict = np.logical_or.reduce([*differs.values()])
        if not is_conflict.any():
            return is_same_time
        first = int(np.argmax(is_conflict))
        row, column = int(later[first]), self.time_column
        name = next(name for name, cells in differs.items() if cells[first])
        conflict = " and ".join(f"{name} {tracks.cell(name, k)}" for k in (row - 1, row))
        raise refused_cell(
            tracks.file_name,
            tracks.place(row),
            column,
            f"another {self.time_name} of vehicle {names[vehicle[row]]} than in "
            f"{tracks.place(row - 1)}, or the same values",
            f"{self.time_name} {tracks.cell(column, row)} again, with {conflict} "
            "(choose a part: --only COLUMN=VALUE)",
        )

    def report_repeated(
        self, rows: I64, seconds: F64, vehicle: I64, names: NDArray[np.object_]
    ) -> None:
        """Note repeated rows, by vehicle."""
        owners, first, counts = np.unique(vehicle[rows], return_index=True, return_counts=True)
        for owner, place, count in zip(owners, first, counts, strict=True):
            self.findings.append(
                Finding(
                    check=Check.DUPLICATE_ROWS,
                    consequence=Consequence.LEFT_OUT,
                    detail=f"{count} rows repeat the vehicle and time of another",
                    rows=int(count),
                    vehicle=str(names[owner]),
                    first_time_s=float(seconds[rows[place]]),
                )
            )

    def faulty_rows(
        self,
        vehicle: I64,
        frame_time: F64,
        x: F64,
        y: F64,
        type_code: I64,
        interval_ms: int,
    ) -> FaultyRows:
        """Rows out of place, without those of repeated times and of vehicles that are not read.

        Args:
            vehicle: Index of the vehicle of each row, ascending, shape (row,).
            frame_time: Instant of each row, ascending within a vehicle, same shape [frames].
            x: Position, same shape [m].
            y: Position, same shape [m].
            type_code: As of `type_codes`, same shape.
            interval_ms: Length of a frame [ms].
        """
        is_compared = type_code != LEFT_OUT
        # Rows of one time are compared by `is_repeated`, which refuses a contradiction.
        is_repeated = (np.diff(vehicle) == 0) & (np.diff(frame_time) <= ON_GRID)
        is_compared[1:] &= ~is_repeated
        is_compared[:-1] &= ~is_repeated
        if is_compared.all():
            return find_faulty_rows(vehicle, frame_time, x, y, interval_ms)
        rows = np.flatnonzero(is_compared)
        faulty = find_faulty_rows(vehicle[rows], frame_time[rows], x[rows], y[rows], interval_ms)
        return replace(faulty, row=rows[faulty.row], jump=rows[faulty.jump])

    def vehicle_constants(
        self,
        tracks: ArrayTable,
        track: I64,
        track_vehicle: I64,
        names: NDArray[np.object_],
        track_type: I64,
    ) -> VehicleConstants:
        """Sizes, kind and direction of each track.

        Args:
            tracks: The rows.
            track: Index of the track of each row, ascending, shape (row,).
            track_vehicle: Vehicle of each track, shape (track,).
            names: Name of each vehicle.
            track_type: Type of each track as of `type_codes`, shape (track,).
        """
        del names
        count = len(track_vehicle)
        sizes: dict[str, F64] = {}
        findings: list[Finding] = []
        for name in _SIZES:
            cell = self.find_column(name)
            if cell is None:
                sizes[name] = np.full(count, getattr(self.map, name), np.float64)
                continue
            table, column = cell
            factor = self.map.columns[name].factor
            of_tracks = None
            if column in tracks.numbers:
                of_tracks = medians(tracks.numbers[column], track, count) * factor
            if table is self.tables[TRACKS]:
                assert of_tracks is not None
                first_row = np.searchsorted(track, np.arange(count))
                is_right = np.ones(tracks.num_rows, np.bool_)
                is_right[first_row] = ~np.isnan(of_tracks)
                tracks.check(is_right, column, f"a {name} in one of the rows of the vehicle")
                sizes[name] = of_tracks
                continue
            sizes[name] = self.of_vehicles(table.numbers[column], track_vehicle) * factor
            if of_tracks is not None:
                findings += compare_sizes(column, of_tracks, sizes[name], tracks.num_rows)
        has_types = self.find_column("type") is not None
        kind, is_kind_known = vehicle_kinds(sizes["length"], track_type, has_types=has_types)
        return VehicleConstants(
            length=sizes["length"],
            width=sizes["width"],
            kind=kind,
            is_kind_known=is_kind_known,
            direction=self.directions(tracks, track, track_vehicle),
            findings=findings,
        )

    def directions(self, tracks: ArrayTable, track: I64, track_vehicle: I64) -> I64 | None:
        """Number of the carriageway of each track; None where no column has it."""
        cell = self.find_column("direction")
        if cell is None:
            return None
        table, column = cell
        if table is not self.tables[TRACKS]:
            return self.of_vehicles(table.numbers[column], track_vehicle).astype(np.int64)
        first_row = np.searchsorted(track, np.arange(len(track_vehicle)))
        return tracks.numbers[column][first_row].astype(np.int64)

    def recording_values(self) -> dict[str, Any]:
        """What holds for the whole recording."""
        if RECORDING not in self.tables:
            return {}
        table = self.tables[RECORDING]
        if table.num_rows != 1:
            got = f"{table.num_rows} rows (choose a part: --only COLUMN=VALUE)"
            raise refused(table.file_name, "table", "one row", got)
        values: dict[str, Any] = {}
        for name, column in self.map.columns.items():
            if column.table == RECORDING and name in _TEXT_QUANTITIES:
                values[name] = table.texts[column.names[0]].text(0)
            elif column.table == RECORDING:
                values[name] = float(table.numbers[column.names[0]][0]) * column.factor
        if "frame_rate" in values:
            self.check_rate(table, values["frame_rate"])
        return values

    def check_rate(self, table: ArrayTable, rate: float) -> None:
        """Refuse a rate that is none of a recording."""
        interval = 1000.0 / rate if rate > 0 else 0.0
        is_right = FRAME_INTERVAL_RANGE_MS[0] <= interval <= FRAME_INTERVAL_RANGE_MS[1]
        if self.map.is_exact:
            is_right = is_right and abs(interval - round(interval)) < 1e-9
        expected = "1 to 100 frames a second, of whole milliseconds"
        table.check(np.array([is_right]), self.map.columns["frame_rate"].names[0], expected)

    def exact_interval_ms(self, recording_values: Mapping[str, Any]) -> float:
        """Time between two frames that are counted [ms]."""
        rate = recording_values.get("frame_rate") or self.map.frames_per_second or 1.0
        return 1000.0 / float(rate)

    def seconds(self, tracks: ArrayTable, recording_values: Mapping[str, Any]) -> F64:
        """Time of each row as the file counts, shape (row,) [s]."""
        cells = tracks.numbers[self.time_column]
        if self.time_name == "frame":
            return cells * (self.exact_interval_ms(recording_values) * 1e-3)
        return cells * self.map.columns["time"].factor

    def frame_times(
        self, tracks: ArrayTable, vehicle: I64, seconds: F64, recording_values: Mapping[str, Any]
    ) -> tuple[F64, int]:
        """The instant of each row in frames, and the time between two frames [ms].

        Args:
            tracks: Rows in order of vehicle and time.
            vehicle: Index of the vehicle of each row, shape (row,).
            seconds: Time of each row, same shape [s].
            recording_values: What holds for the whole recording.
        """
        file_name, column = tracks.file_name, self.time_column
        if self.time_name == "frame":
            exact = self.exact_interval_ms(recording_values)
            check_interval(file_name, column, exact)
            frames = tracks.numbers[column]
            # A file may have every fifth frame only.
            stride = most_frequent_stride(frames, vehicle)
            check_interval(file_name, column, exact * stride)
            # Frames are whole milliseconds apart: at another rate states are interpolated.
            interval = round(exact * stride)
            frame_time = (frames - frames.min() % stride) * exact / interval
        else:
            interval = frame_interval_ms(file_name, column, seconds, vehicle)
            frame_time = (seconds - seconds.min()) * 1000.0 / interval
        check_extent(file_name, column, frame_time)
        return frame_time, interval

    def mean(self, tracks: ArrayTable, name: str) -> F64:
        """A quantity in SI units and the axes of the table, shape (row,).

        Of a quantity with several columns, such as the four corners of a box, it is their mean.
        """
        column = self.map.columns[name]
        if len(column.names) == 1:
            cells = tracks.numbers[column.names[0]]
            return cells if column.factor == 1.0 else cells * column.factor
        return np.mean([tracks.numbers[cell] for cell in column.names], axis=0) * column.factor

    def motion_columns(self, tracks: ArrayTable, empty: Iterable[str]) -> dict[str, F64]:
        """Quantities that change, as `mean` has them."""
        return {name: self.mean(tracks, name) for name in self.changing if name not in empty}

    def oriented(
        self, values: dict[str, F64], constants: VehicleConstants, track: I64
    ) -> dict[str, F64]:
        """Quantities of the centres of vehicles, with y to the left of x.

        Args:
            values: Quantities in the axes of the table, maybe of a corner, shape (row,) each.
            constants: Sizes of each track.
            track: Index of the track of each row, shape (row,).
        """
        values = dict(values)
        if self.map.point == "corner":
            values["x"] = values["x"] + constants.length[track] * 0.5
            values["y"] = values["y"] + constants.width[track] * 0.5
        if not self.map.y_is_left:
            for name in ("y", "vy", "ay", "heading", "yaw_rate"):
                if name in values:
                    values[name] = -values[name]
        return values

    def lane_names(self, tracks: ArrayTable) -> NDArray[np.object_] | None:
        """Name of the lane of each row, None where no column has it."""
        cell = self.find_column("lane")
        if cell is None:
            return None
        lanes = tracks.texts[cell[1]]
        return np.append(lanes.texts, "")[lanes.code]


def _track_of_rows(vehicle: I64, frame_time: F64, x: F64, y: F64, interval_ms: int) -> I64:
    """Index of the track of each row, shape (row,). A gap or a jump begins a new track.

    Args:
        vehicle: Index of the vehicle of each row, ascending, shape (row,).
        frame_time: Instant of each row, ascending within a vehicle, same shape [frames].
        x: Position, same shape [m].
        y: Position, same shape [m].
        interval_ms: Length of a frame [ms].
    """
    is_same = np.diff(vehicle) == 0
    apart = np.where(is_same, np.diff(frame_time), 1.0)
    is_repeated = apart <= ON_GRID
    elapsed = np.where(is_repeated, 1.0, apart) * (interval_ms * 1e-3)
    speed = np.hypot(np.diff(x), np.diff(y)) / elapsed
    median_speed = float(np.median(speed[is_same])) if is_same.any() else 0.0
    is_jump = (speed > max(_MAX_SPEED, _MAX_SPEED_RATIO * median_speed)) & ~is_repeated
    return np.append(
        0, np.cumsum(~is_same | is_long_gap(vehicle, frame_time, interval_ms) | is_jump)
    )


def _without_repeated(vehicles: ArrayTable, vehicle: I64, column: str) -> tuple[ArrayTable, I64]:
    """The table of vehicles in order of vehicle without repeated rows, and the vehicle of each.

    Args:
        vehicles: The table.
        vehicle: Index of the vehicle of each row, shape (row,).
        column: The column of ids.

    Raises:
        ImportFormatError: Two rows of a vehicle differ, or a row has no vehicle.
    """
    vehicles.check(vehicle != MISSING, column, "an id")
    order = np.argsort(vehicle, kind="stable")
    is_same = np.append(False, np.diff(vehicle[order]) == 0)
    later = np.flatnonzero(is_same)
    is_conflict = np.zeros(len(order), np.bool_)
    for name in (*vehicles.numbers, *vehicles.texts):
        if name != column:
            is_conflict[later] |= vehicles.differs(name, order[later], order[later - 1])
    is_right = np.ones(len(order), np.bool_)
    is_right[order] = ~is_conflict
    vehicles.check(
        is_right, column, "a different id in each row (choose a part: --only COLUMN=VALUE)"
    )
    return vehicles.select(order[~is_same]), vehicle[order][~is_same]
