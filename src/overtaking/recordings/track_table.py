"""Converts the tables of a recording to rows: checks cells, joins tables, converts units.

A map of columns states the table and column of each quantity. Quantities without a column stay
missing here; they are derived later, in road coordinates. Sizes and kinds belong to a track, which
is a series of rows of one id without a long gap, because recordings of several periods may reuse
ids.
"""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.recordings.array_table import MISSING, ArrayTable
from overtaking.recordings.column_map import (
    LEFT_OUT,
    NOT_KNOWN,
    RECORDING,
    TRACKS,
    VEHICLES,
    ColumnMap,
    files_of,
)
from overtaking.recordings.frame_times import (
    FRAME_INTERVAL_RANGE_MS,
    check_extent,
    check_interval,
    frame_interval_ms,
    most_frequent_stride,
    order_rows,
    undo_clock_wraps,
)
from overtaking.recordings.gaps import check_pieces, gap_findings
from overtaking.recordings.memory_tables import arrow_table
from overtaking.recordings.missing_cells import check_missing, fill_missing, missing_findings
from overtaking.recordings.motion_check import motion_findings
from overtaking.recordings.recording_checks import compare_sizes
from overtaking.recordings.rows import Rows, at_whole_frames, track_names
from overtaking.recordings.state_rows import (
    StateRows,
    faulty_rows,
    find_repeated,
    repeated_findings,
    track_of_rows,
)
from overtaking.recordings.table_errors import refused
from overtaking.recordings.table_files import checked_table, column_names, read_columns
from overtaking.recordings.table_request import (
    SIZE_RANGES,
    TEXT_QUANTITIES,
    build_request,
    meaningful_words,
    thousands_findings,
    with_choice,
)
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

    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask
    from overtaking.recordings.findings import Finding

_DIRECTIONS = (1, 2)
_VEHICLE_CONSTANTS = ("type", "length", "width", "direction")
_NOT_CHANGING = (*_VEHICLE_CONSTANTS, "vehicle", "frame", "time", "lane")
_MAX_ROWS = 50_000_000


def read_track_rows(path: Path, columns: ColumnMap, only: Mapping[str, str] | None = None) -> Rows:
    """Read the states in the files of a recording.

    Args:
        path: The file of the recording; of several files, the one with the states.
        columns: The map of columns.
        only: Required value of each column, in addition to those of the map. They also filter the
            tables of vehicles and of the recording if these have such a column.

    Raises:
        ImportFormatError: A file is missing or damaged; the message names line and column.
        ConfigError: `path` is not the table of states.
    """
    filtered_map = with_choice(columns, only or {})
    tables: dict[str, ArrayTable] = {}
    findings: list[Finding] = []
    for name, file in files_of(path, filtered_map).items():
        existing = column_names(file) if filtered_map.files else ()
        request = build_request(filtered_map, name, existing)
        content = read_columns(file, request)
        tables[name] = ArrayTable.of(content, file.name, meaningful_words(filtered_map)).choose(
            filtered_map.only
        )
        findings += thousands_findings(content.grouped, content.table.num_rows)
    return _TableJoiner(filtered_map, tables, findings).join()


def track_rows_from_table(table: Any, columns: ColumnMap) -> Rows:
    """Convert a table in memory to rows; see `arrow_table` for types of tables.

    Args:
        table: The table of states.
        columns: The map of columns.

    Raises:
        ImportFormatError: A column is missing, or a cell has no valid value.
    """
    filtered_map = with_choice(columns, {})
    arrow, index_names = arrow_table(table)
    request = build_request(filtered_map, TRACKS)
    names = request.match(arrow.column_names, "table", index_names)
    part = arrow.select(list(names.values())).rename_columns(list(names))
    content = checked_table(part, request, "table")
    tracks = ArrayTable.of(content, "table", meaningful_words(filtered_map)).choose(
        filtered_map.only
    )
    findings = thousands_findings(content.grouped, content.table.num_rows)
    return _TableJoiner(filtered_map, {TRACKS: tracks}, findings).join()


@dataclass(frozen=True, slots=True)
class _TableJoiner:
    """Joins the tables of a recording; `findings` grows on the way.

    Attributes:
        map: The map of columns.
        tables: The tables by the names of `column_map.TABLES`, rows in the order of the file.
        findings: The findings so far.
    """

    map: ColumnMap
    tables: dict[str, ArrayTable]
    findings: list[Finding]

    def join(self) -> Rows:
        """The states of the recording."""
        names, vehicle = self.identify()
        recording_values = self.recording_values()
        tracks, vehicle, num_incomplete = self.complete_rows(vehicle, names, recording_values)
        empty = self.empty_quantities(tracks)
        states, interval = self.order_states(tracks, vehicle, names, empty, recording_values)
        faulty = faulty_rows(states, interval)
        self.findings.extend(
            motion_findings(faulty, vehicle=states.vehicle, seconds=states.seconds, names=names)
        )
        is_kept = np.ones(states.num_rows, np.bool_)
        is_kept[faulty.row] = False
        states = states.select(is_kept)
        track = track_of_rows(states, interval)
        track_vehicle = states.vehicle[_first_rows(track)]
        track_type = self.vote(states, track, names[track_vehicle])
        is_read = (track_type != LEFT_OUT)[track]
        if not is_read.any():
            raise refused(
                tracks.file_name,
                "vehicles",
                "at least one with a type that the map of columns does not leave out",
                "none",
                "correct [types] in the map of columns",
            )
        num_left_out = len(np.unique(states.vehicle[~is_read]))
        states, track = states.select(is_read), track[is_read]
        is_repeated = find_repeated(
            states, self.time_name, self.time_column, ignored=(*self.map.only, self.id_column)
        )
        self.findings.extend(repeated_findings(states, is_repeated))
        states, track = states.select(~is_repeated), track[~is_repeated]
        # Renumber the tracks, because those that are left out have no rows now.
        tracks_left, track = np.unique(track, return_inverse=True)
        track_vehicle, track_type = track_vehicle[tracks_left], track_type[tracks_left]
        tracks = states.table
        self.check_vehicle_values(tracks)
        self.report_missing_values(states, empty)
        constants = self.vehicle_constants(tracks, track, track_vehicle, track_type)
        values = fill_missing(self.motion_columns(tracks, empty), track, states.seconds)
        values = self.oriented(values, constants, track)
        first_row = _first_rows(track)
        check_pieces(tracks.file_name, np.append(first_row, len(track)), track_vehicle, interval)
        track_name = track_names(names, track_vehicle)
        self.findings.extend(
            gap_findings(
                track,
                states.frame_time,
                states.seconds,
                interval_ms=interval,
                track_names=track_name,
                track_vehicle=track_vehicle,
                num_faulty=np.diff(np.searchsorted(faulty.row, states.place)),
            )
        )
        grid = at_whole_frames(track, states.frame_time, values)
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
            time_origin_s=float(states.seconds[0] - states.frame_time[0] * interval * 1e-3),
            values=grid.values,
            lane=None if lane is None else lane[grid.nearest],
            about=recording_values,
            notes={
                "interpolated": grid.is_moved,
                "tracks_torn": len(owner) - len(np.unique(track_vehicle[owner])),
                "left_out": num_left_out,
                "rows_repeated": int(is_repeated.sum()),
                "rows_missing": num_incomplete,
            },
            findings=(*self.findings, *constants.findings),
        )

    def order_states(
        self,
        tracks: ArrayTable,
        vehicle: I64,
        names: NDArray[np.object_],
        empty: Iterable[str],
        recording_values: Mapping[str, Any],
    ) -> tuple[StateRows, int]:
        """Rows in order of vehicle and time, and the time between two frames [ms].

        Args:
            tracks: The rows in the order of the file.
            vehicle: Index of the vehicle of each row, shape (row,).
            names: Name of each vehicle.
            empty: Quantities whose columns are empty.
            recording_values: Result of the method of that name.
        """
        seconds = self.seconds(tracks, recording_values)
        x, y = (self.mean(tracks, name) for name in ("x", "y"))
        if self.time_name == "time":
            seconds, findings = undo_clock_wraps(seconds, vehicle, x, y, self.time_column)
            self.findings.extend(findings)
        is_incomplete = self.is_incomplete(tracks, empty)
        order, findings = order_rows(seconds, vehicle, is_incomplete, names, self.time_column)
        self.findings.extend(findings)
        type_code = self.type_codes(tracks, vehicle)[order]
        tracks, vehicle, seconds = tracks.select(order), vehicle[order], seconds[order]
        frame_time, interval = self.frame_times(tracks, vehicle, seconds, recording_values)
        states = StateRows(
            table=tracks,
            names=names,
            vehicle=vehicle,
            seconds=seconds,
            frame_time=frame_time,
            x=x[order],
            y=y[order],
            type_code=type_code,
            is_incomplete=is_incomplete[order],
            place=np.arange(len(vehicle)),
        )
        return states, interval

    def find_column(self, name: str) -> tuple[ArrayTable, str] | None:
        """Table and column of a quantity; None if the map has no column for it."""
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
            ImportFormatError: The table of vehicles lacks a vehicle or has two different rows of
                one, or the table of states has no rows or too many.
        """
        tracks, vehicles = self.tables[TRACKS], self.tables.get(VEHICLES)
        if not 0 < tracks.num_rows <= _MAX_ROWS:
            expected = f"1 to {_MAX_ROWS:,}"
            raise refused(tracks.file_name, "rows", expected, f"{tracks.num_rows:,}")
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
        # Renumber vehicles by their row in the table of vehicles. The last element, for `MISSING`,
        # stays `MISSING`.
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
        self, vehicle: I64, names: NDArray[np.object_], recording_values: Mapping[str, Any]
    ) -> tuple[ArrayTable, I64, int]:
        """The rows that have a vehicle, a time and a position, and their vehicles.

        Args:
            vehicle: Index of the vehicle of each row, `MISSING` for none, shape (row,).
            names: Name of each vehicle.
            recording_values: Result of the method of that name.

        Returns:
            The rows, the vehicle of each, and the number of incomplete rows that are not blank and
            not of vehicles that are left out.

        Raises:
            ImportFormatError: Too many rows are incomplete, or a frame is not a whole number.
        """
        tracks, num_incomplete = self.tables[TRACKS], 0
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
            num_incomplete = int((is_left_out & is_counted).sum())
            tracks, vehicle = tracks.select(~is_left_out), vehicle[~is_left_out]
            if not tracks.num_rows:
                raise refused(tracks.file_name, "rows", "positions", "none")
        if self.time_name == "frame":
            frame = tracks.numbers[self.time_column]
            tracks.check(frame == np.rint(frame), self.time_column, "a whole number")
        return tracks, vehicle, num_incomplete

    def is_blank(self, tracks: ArrayTable) -> Mask:
        """Whether all cells of a row are missing, shape (row,)."""
        blank = np.ones(tracks.num_rows, np.bool_)
        for cells in tracks.numbers.values():
            blank &= np.isnan(cells)
        for texts in tracks.texts.values():
            blank &= texts.is_missing | texts.is_text("")
        return blank

    def empty_quantities(self, tracks: ArrayTable) -> frozenset[str]:
        """Quantities other than positions whose columns are empty; they count as absent."""
        return frozenset(
            name
            for name in self.changing
            if name not in ("x", "y") and self.is_missing(tracks, name).all()
        )

    def is_incomplete(self, tracks: ArrayTable, empty: Iterable[str]) -> Mask:
        """Whether a row lacks a quantity that changes and is not in `empty`, shape (row,)."""
        incomplete = np.zeros(tracks.num_rows, np.bool_)
        for name in self.changing:
            if name not in empty:
                incomplete |= self.is_missing(tracks, name)
        return incomplete

    def report_missing_values(self, states: StateRows, empty: Iterable[str]) -> None:
        """Report missing cells of optional quantities, and refuse too many of them.

        Sizes and kinds may be missing in any number of rows: one row of each track is enough.
        """
        tracks, all_rows = states.table, np.ones(states.num_rows, np.bool_)
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
                missing_findings(
                    column.names[0],
                    rows,
                    states.seconds,
                    states.vehicle,
                    states.names,
                    is_left_out=False,
                )
            )

    def of_vehicles(self, cells: NDArray[Any], vehicle: I64) -> NDArray[Any]:
        """Cells of a column of the table of vehicles, for the vehicle of each row or track.

        For `MISSING` it is any cell; such rows are left out.
        """
        return np.append(cells, cells[:1])[vehicle]

    def type_codes(self, tracks: ArrayTable, vehicle: I64) -> I64:
        """A `VehicleKind`, `BY_LENGTH`, `LEFT_OUT` or `NOT_KNOWN` for each row, shape (row,)."""
        cell = self.find_column("type")
        if cell is None:
            return np.full(tracks.num_rows, NOT_KNOWN)
        if cell[0] is self.tables[TRACKS]:
            return self.codes_of(tracks, cell[1])
        return self.of_vehicles(self.codes_of(*cell), vehicle)

    def codes_of(self, table: ArrayTable, column: str) -> I64:
        """The code of the type in each row of a column, as in `type_codes`, shape (row,)."""
        words = table.texts[column]
        kinds = {unicodedata.normalize("NFC", word): code for word, code in self.map.kinds.items()}
        codes = [kinds.get(word, NOT_KNOWN) for word in words.texts.tolist()]
        is_listed = [word in kinds for word in words.texts.tolist()]
        expected = " or ".join(self.map.kinds) or "a type of the map"
        # The last element is for an empty cell, with the code `MISSING`.
        table.check(np.array([*is_listed, True])[words.code], column, expected)
        return np.array([*codes, kinds.get("", NOT_KNOWN)], np.int64)[words.code]

    def vote(self, states: StateRows, track: I64, names: NDArray[np.object_]) -> I64:
        """The most frequent type of each track, as in `type_codes`, shape (track,).

        Args:
            states: The rows.
            track: Index of the track of each row, shape (row,).
            names: Name of the vehicle of each track.
        """
        cell = self.find_column("type")
        column = "" if cell is None else cell[1]
        track_type, findings = vote_on_types(states.type_code, track, states.seconds, names, column)
        self.findings.extend(findings)
        return track_type

    def check_vehicle_values(self, tracks: ArrayTable) -> None:
        """Refuse implausible sizes, and directions other than 1 and 2.

        Sizes of vehicles that are left out are not checked.
        """
        for name, (least, most) in SIZE_RANGES.items():
            if (cell := self.find_column(name)) is None:
                continue
            table, column = cell
            is_of_rows = table is self.tables[TRACKS]
            table = tracks if is_of_rows else table
            size = table.numbers[column] * self.map.columns[name].factor
            is_right = (size > least) & (size < most)
            length = self.find_column("length")
            if name == "width" and length is not None and length[0] is cell[0]:
                # Accepted here, because `examination.check_sizes` reports exchanged columns.
                lengths = table.numbers[length[1]] * self.map.columns["length"].factor
                is_right |= (size > lengths) & (size < SIZE_RANGES["length"][1])
            if is_of_rows:
                is_right |= np.isnan(size)
            elif (types := self.find_column("type")) is not None and types[0] is table:
                is_right |= self.codes_of(*types) == LEFT_OUT
            table.check(is_right, column, f"a {name}, {least:g} to {most:g} m")
        if (cell := self.find_column("direction")) is not None:
            table, column = cell
            table = tracks if table is self.tables[TRACKS] else table
            table.check(np.isin(table.numbers[column], _DIRECTIONS), column, "1 or 2")

    def vehicle_constants(
        self,
        tracks: ArrayTable,
        track: I64,
        track_vehicle: I64,
        track_type: I64,
    ) -> VehicleConstants:
        """Sizes, kind and direction of each track.

        Args:
            tracks: The rows.
            track: Index of the track of each row, ascending, shape (row,).
            track_vehicle: Vehicle of each track, shape (track,).
            track_type: Type of each track as in `type_codes`, shape (track,).
        """
        count = len(track_vehicle)
        sizes: dict[str, F64] = {}
        findings: list[Finding] = []
        for name in SIZE_RANGES:
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
        """Number of the carriageway of each track, shape (track,); None without such a column."""
        cell = self.find_column("direction")
        if cell is None:
            return None
        table, column = cell
        if table is not self.tables[TRACKS]:
            return self.of_vehicles(table.numbers[column], track_vehicle).astype(np.int64)
        first_row = np.searchsorted(track, np.arange(len(track_vehicle)))
        return tracks.numbers[column][first_row].astype(np.int64)

    def recording_values(self) -> dict[str, Any]:
        """Quantities of the table of the recording by name, in SI units; empty without it."""
        if RECORDING not in self.tables:
            return {}
        table = self.tables[RECORDING]
        if table.num_rows != 1:
            got = f"{table.num_rows} rows (choose a part: --only COLUMN=VALUE)"
            raise refused(table.file_name, "table", "one row", got)
        values: dict[str, Any] = {}
        for name, column in self.map.columns.items():
            if column.table == RECORDING and name in TEXT_QUANTITIES:
                values[name] = table.texts[column.names[0]].text(0)
            elif column.table == RECORDING:
                values[name] = float(table.numbers[column.names[0]][0]) * column.factor
        if "frame_rate" in values:
            self.check_rate(table, values["frame_rate"])
        return values

    def check_rate(self, table: ArrayTable, rate: float) -> None:
        """Refuse a frame rate out of range [1/s].

        If the map demands exact frames, a frame must also last whole milliseconds.
        """
        interval = 1000.0 / rate if rate > 0 else 0.0
        is_right = FRAME_INTERVAL_RANGE_MS[0] <= interval <= FRAME_INTERVAL_RANGE_MS[1]
        if self.map.is_exact:
            is_right = is_right and abs(interval - round(interval)) < 1e-9
        expected = "1 to 100 frames a second, of whole milliseconds"
        table.check(np.array([is_right]), self.map.columns["frame_rate"].names[0], expected)

    def exact_interval_ms(self, recording_values: Mapping[str, Any]) -> float:
        """Time between two consecutive frame numbers [ms]."""
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
            recording_values: Result of the method of that name.
        """
        file_name, column = tracks.file_name, self.time_column
        if self.time_name == "frame":
            exact = self.exact_interval_ms(recording_values)
            check_interval(file_name, column, exact)
            frames = tracks.numbers[column]
            # A file may contain only every fifth frame, for example.
            stride = most_frequent_stride(frames, vehicle)
            check_interval(file_name, column, exact * stride)
            # The result has whole milliseconds between frames; states of other rates are
            # interpolated later.
            interval = round(exact * stride)
            frame_time = (frames - frames.min() % stride) * exact / interval
        else:
            interval = frame_interval_ms(file_name, column, seconds, vehicle)
            frame_time = (seconds - seconds.min()) * 1000.0 / interval
        check_extent(file_name, column, frame_time)
        return frame_time, interval

    def mean(self, tracks: ArrayTable, name: str) -> F64:
        """A quantity in SI units and the axes of the table, shape (row,).

        A quantity with several columns, such as the four corners of a box, is their mean.
        """
        column = self.map.columns[name]
        if len(column.names) == 1:
            cells = tracks.numbers[column.names[0]]
            return cells if column.factor == 1.0 else cells * column.factor
        return np.mean([tracks.numbers[cell] for cell in column.names], axis=0) * column.factor

    def motion_columns(self, tracks: ArrayTable, empty: Iterable[str]) -> dict[str, F64]:
        """Quantities that change from row to row, converted by `mean`, without those in `empty`."""
        return {name: self.mean(tracks, name) for name in self.changing if name not in empty}

    def oriented(
        self, values: dict[str, F64], constants: VehicleConstants, track: I64
    ) -> dict[str, F64]:
        """Convert quantities to the centres of vehicles and to axes with y to the left of x.

        Args:
            values: Quantities at the map's `point`, in the axes of the table, shape (row,) each.
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
        """Name of the lane of each row, shape (row,); None without such a column."""
        cell = self.find_column("lane")
        if cell is None:
            return None
        lanes = tracks.texts[cell[1]]
        return np.append(lanes.texts, "")[lanes.code]


def _first_rows(track: I64) -> I64:
    """Index of the first row of each track, shape (track,).

    Args:
        track: Index of the track of each row, ascending, shape (row,).
    """
    return np.flatnonzero(np.append(True, np.diff(track) != 0))


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
