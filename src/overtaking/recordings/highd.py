"""highD recordings (three CSV files) as recordings: both carriageways turned into travel along s.

A highD image has x to the right and y down; a box is given by its upper left corner, its length is
called width. The upper lanes drive to the left (direction 1), the lower ones to the right. The
columns are a map like any other (`columns/highd.toml`); what is special is the road: two
carriageways beside each other become one.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.model.road import MAX_LANES, DrivingSide, Lane, Road, RoadMark
from overtaking.recordings.column_map import (
    RECORDING,
    VEHICLES,
    ColumnMap,
    column_map,
    files_of,
)
from overtaking.recordings.examination import examine
from overtaking.recordings.limits import NO_LIMIT
from overtaking.recordings.recording import NEVER_RECORDED, Recording, by_ways, kept
from overtaking.recordings.recording_checks import check_rows
from overtaking.recordings.road import scaled
from overtaking.recordings.table_errors import refused, refused_cell
from overtaking.recordings.table_streams import uncompressed_name
from overtaking.recordings.tables import tracks_of
from overtaking.recordings.track_table import read_track_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from overtaking.core.arrays import F64
    from overtaking.recordings.rows import Rows


FORMAT = "highd"
DIRECTIONS = (1, 2)


def read_highd(path: Path | str, *, direction: int | None = None) -> Recording:
    """The traffic of a highD recording.

    Args:
        path: Its `_tracks.csv`.
        direction: 1 for the upper lanes, 2 for the lower ones; by default both, on one road, whose
            lanes have the mean of their widths.

    Raises:
        ImportFormatError: A file is missing or damaged; the message names line and column.
        ConfigError: The directions have different numbers of lanes and none was chosen.
    """
    check_direction(direction)
    columns = column_map(FORMAT)
    files = {name: file.name for name, file in files_of(Path(path), columns).items()}
    rows = read_track_rows(Path(path), columns)
    findings = check_rows(rows)
    assert rows.direction is not None
    wanted = DIRECTIONS if direction is None else (direction,)
    used = [one for one in wanted if (rows.direction == one).any()]
    if not used:
        raise refused(files[VEHICLES], "vehicles", "some in that direction", "none")
    lines = _lines(rows.about, columns, files[RECORDING])
    borders = {one: _borders(lines[one], one, files[RECORDING]) for one in used}
    limit = _limit(rows.about["speed_limit"], files[RECORDING])
    half = rows.length[rows.vehicle] * 0.5
    extent = float((rows.values["x"] + half).max())
    name = uncompressed_name(Path(path)).removesuffix(columns.files["tracks"])
    road = _road(name, limit, list(borders.values()), extent)
    driven, on_lanes = _on_one_road(rows, borders, road)
    ways = by_ways(kept(driven, on_lanes, rows.frame_interval_ms), road)
    if not ways.along:
        raise refused(rows.where, "vehicles", "some that drive in their direction", "none")
    recording = Recording(
        name=f"highD {road.name}",
        file_format=FORMAT,
        road=road,
        frame_interval_ms=rows.frame_interval_ms,
        tracks=ways.tracks,
        unknown=NEVER_RECORDED | {"weather", "marks", "yaw_rate"},
        notes={
            "directions": used,
            "lanes_from": "lane markings of the recording",
            "widening": _widening(road, list(borders.values())),
            **ways.notes,
            "states": ways.tracks.num_rows,
            "states_off_the_road": driven.num_rows - int(on_lanes.sum()),
            "has_speed_limit": limit is not None,
        },
        findings=tuple(findings),
        time_origin_s=rows.time_origin_s,
    )
    return examine(recording)


def check_direction(direction: int | None) -> None:
    """Refuse a number that is no direction; None stands for both directions.

    Raises:
        ConfigError: It is not among `DIRECTIONS`.
    """
    if direction not in (None, *DIRECTIONS):
        raise _unknown_direction(direction)


def _limit(limit: float, file: str) -> float | None:
    """The speed limit, None where there is none [m/s]."""
    if limit > NO_LIMIT or (limit <= 0 and limit != -1):
        raise refused_cell(file, 0, "speedLimit", "m/s, or -1 for none", str(limit))
    return None if limit < 0 else limit


def _lines(about: dict[str, Any], columns: ColumnMap, file: str) -> dict[int, F64]:
    """The lane markings of each direction, growing [m]."""
    found: dict[int, F64] = {}
    for one, name in zip(DIRECTIONS, ("upper_lines", "lower_lines"), strict=True):
        text = str(about[name])
        try:
            values = np.array([float(each) for each in text.split(";") if each.strip()])
        except ValueError:
            values = np.array([np.nan])
        if not ((np.abs(values) < 1e4).all() and (np.diff(values) > 0).all()):  # Nor NaN.
            column = columns.columns[name].names[0]
            raise refused_cell(file, 0, column, "growing numbers between semicolons", text)
        found[one] = values
    return found


def _borders(lines: F64, direction: int, file: str) -> F64:
    """Offsets of the lane borders from the right to the left, in the direction of travel [m]."""
    if not 2 <= len(lines) <= MAX_LANES + 1:
        what = f"markings of direction {direction}"
        raise refused(file, what, f"2 to {MAX_LANES + 1} of them", str(len(lines)))
    return lines if direction == 1 else -lines[::-1]


def _on_one_road(rows: Rows, borders: dict[int, F64], road: Road) -> Any:
    """The vehicles in road coordinates, and which rows are on the lanes that are read."""
    assert rows.direction is not None
    direction = rows.direction[rows.vehicle]
    sign = np.where(direction == 1, -1.0, 1.0)
    # The rows have y upwards: turning the upper carriageway round changes the sign of both.
    turned = {name: sign * rows.values[name] for name in ("vx", "vy", "ax", "ay")}
    s = np.where(sign > 0, rows.values["x"], road.length - rows.values["x"])
    d = np.zeros_like(s)
    for one, local in borders.items():
        here = direction == one
        offset = (sign * rows.values["y"])[here]
        d[here] = scaled(
            offset, np.broadcast_to(local, (len(offset), len(local))), road.lane_boundaries
        )
    tracks = tracks_of(replace(rows, values=turned), road, s, d)
    on_lanes = np.isin(direction, list(borders))
    return replace(tracks, carriageway=rows.direction - 1), on_lanes


def _road(name: str, limit: float | None, borders: Sequence[F64], extent: float) -> Road:
    """The straight road, along x through the middle of its lanes."""
    if len({len(one) for one in borders}) > 1:
        raise _unknown_direction(None)
    widths = np.mean([np.diff(one) for one in borders], axis=0)
    try:
        return Road(
            name=name,
            kind="motorway",
            driving_side=DrivingSide.RIGHT,
            lanes=tuple(
                Lane(
                    lane_id=k - len(widths),
                    width=float(width),
                    right_mark=RoadMark.NONE,
                    left_mark=RoadMark.NONE,
                )
                for k, width in enumerate(widths)
            ),
            kerb_edge_d=-float(widths.sum()) * 0.5,
            length=max(extent, 1.0),
            x0=0.0,
            y0=0.0,
            heading=0.0,
            speed_limit=limit or NO_LIMIT,
        )
    except ConfigError as error:
        raise refused(
            f"{name}_recordingMeta.csv", "road", "a road that the model is made for", str(error)
        ) from None


def _widening(road: Road, borders: Sequence[F64]) -> float:
    """Largest part by which a lane differs from that of the road that stands for both."""
    mean = np.diff(road.lane_boundaries)
    return round(max(float(np.abs(np.diff(one) / mean - 1.0).max()) for one in borders), 4)


def _unknown_direction(got: int | None) -> ConfigError:
    return ConfigError(
        what="direction",
        where="read_highd",
        expected="1 (upper lanes) or 2 (lower lanes)",
        got="both, which have different numbers of lanes" if got is None else got,
        next_step="choose one of them",
    )
