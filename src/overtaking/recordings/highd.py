"""highD recordings (three CSV files) as recordings: both carriageways turned into travel along s.

A highD image has x to the right and y down; a box is given by its upper left corner, its length is
called width. The upper lanes drive to the left (direction 1), the lower ones to the right.
"""

# pyright: reportUnknownParameterType=false

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError
from overtaking.model.road import MAX_LANES, DrivingSide, Lane, Road, RoadMark
from overtaking.recordings.highd_files import (
    NUMBER,
    TEXT,
    WHOLE,
    read_columns,
    refused,
    refused_cell,
)
from overtaking.recordings.recording import (
    NEVER_RECORDED,
    Recording,
    Tracks,
    kept,
    kinds_by_length,
    lane_codes,
    without_oncoming,
)
from overtaking.recordings.road import scaled

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FORMAT = "highd"
DIRECTIONS = (1, 2)

NO_LIMIT = 100.0
"""Stands for a road without a speed limit, which highD writes as -1 [m/s]."""

_ENDING = "_tracks.csv"
_META = {
    "frameRate": NUMBER, "speedLimit": NUMBER, "upperLaneMarkings": TEXT, "lowerLaneMarkings": TEXT,
}  # fmt: skip
_VEHICLES = {
    "id": WHOLE, "width": NUMBER, "height": NUMBER, "class": TEXT, "drivingDirection": WHOLE,
}  # fmt: skip
_ROWS = {
    "frame": WHOLE, "id": WHOLE, "x": NUMBER, "y": NUMBER, "width": NUMBER, "height": NUMBER,
    "xVelocity": NUMBER, "yVelocity": NUMBER, "xAcceleration": NUMBER, "yAcceleration": NUMBER,
}  # fmt: skip

Columns = dict[str, NDArray[Any]]


def files_of(path: Path | str) -> tuple[Path, Path, Path]:
    """The files of a recording: tracks, tracksMeta and recordingMeta.

    Args:
        path: The one whose name ends in `_tracks.csv`; the others lie beside it.

    Raises:
        ConfigError: The name has another ending.
    """
    source = Path(path)
    if not source.name.endswith(_ENDING):
        raise ConfigError.of(
            what="highD recording",
            where=str(source),
            expected=f"a file whose name ends in {_ENDING}",
            got=repr(source.name),
            next_step="name that file; the two others are found beside it",
        )
    stem = source.name.removesuffix(_ENDING)
    others = (source.with_name(f"{stem}_{name}.csv") for name in ("tracksMeta", "recordingMeta"))
    return (source, *others)  # pyright: ignore[reportReturnType]


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
    tracks_path, vehicles_path, meta_path = files_of(path)
    if direction not in (None, *DIRECTIONS):
        raise _unknown_direction(direction)
    meta = _read_meta(meta_path)
    vehicles = _read_vehicles(vehicles_path)
    rows = _read_rows(tracks_path, vehicles["id"])
    wanted = DIRECTIONS if direction is None else (direction,)
    used = [one for one in wanted if (vehicles["drivingDirection"] == one).any()]
    if not used:
        raise refused(vehicles_path, "vehicles", "some in that direction", "none")
    borders = {one: meta.borders(one, meta_path) for one in used}
    extent = float((rows["x"] + rows["width"]).max())
    road = _road(tracks_path.name.removesuffix(_ENDING), meta, list(borders.values()), extent)
    driven = _tracks(rows, vehicles, borders, road)
    tracks, num_oncoming = without_oncoming(driven, road.heading)
    if not tracks.num_vehicles:
        raise refused(tracks_path, "vehicles", "some that drive in their direction", "none")
    return Recording(
        name=f"highD {road.name}",
        file_format=FORMAT,
        road=road,
        frame_interval_ms=meta.frame_interval_ms,
        tracks=tracks,
        unknown=NEVER_RECORDED | {"weather", "marks", "yaw_rate"},
        notes={
            "directions": used,
            "widening": _widening(road, list(borders.values())),
            "states": tracks.num_rows,
            "states_off_the_road": len(rows["id"]) - driven.num_rows,
            "oncoming_left_out": num_oncoming,
            "has_speed_limit": meta.speed_limit is not None,
        },
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Meta:
    """What holds for the whole recording.

    Attributes:
        frame_interval_ms: [ms].
        speed_limit: None where there is none [m/s].
        upper: Lane markings of direction 1, growing [m].
        lower: Lane markings of direction 2, growing [m].
    """

    frame_interval_ms: int
    speed_limit: float | None
    upper: F64
    lower: F64

    def borders(self, direction: int, path: Path) -> F64:
        """Offsets of the lane borders from the right to the left, in the direction of travel."""
        lines = self.upper if direction == 1 else -self.lower[::-1]
        if not 2 <= len(lines) <= MAX_LANES + 1:
            what = f"markings of direction {direction}"
            raise refused(path, what, f"2 to {MAX_LANES + 1} of them", str(len(lines)))
        return lines


def _read_meta(path: Path) -> _Meta:
    table = read_columns(path, _META)
    if table.num_rows != 1:
        raise refused(path, "table", "one row", f"{table.num_rows} rows")
    row = table.to_pylist()[0]
    interval = 1000.0 / row["frameRate"] if row["frameRate"] > 0 else 0.0
    if not 10.0 <= interval <= 1000.0 or abs(interval - round(interval)) > 1e-9:
        expected = "1 to 100 frames a second, of whole milliseconds"
        raise refused_cell(path, 0, "frameRate", expected, str(row["frameRate"]))
    limit = row["speedLimit"]
    if limit > NO_LIMIT or (limit <= 0 and limit != -1):
        raise refused_cell(path, 0, "speedLimit", "m/s, or -1 for none", str(limit))
    return _Meta(
        frame_interval_ms=round(interval),
        speed_limit=None if limit < 0 else limit,
        upper=_markings(path, row, "upperLaneMarkings"),
        lower=_markings(path, row, "lowerLaneMarkings"),
    )


def _markings(path: Path, row: dict[str, str], name: str) -> F64:
    """The positions of lane markings, growing [m]."""
    try:
        values = np.array([float(one) for one in row[name].split(";") if one.strip()])
    except ValueError:
        values = np.array([np.nan])
    if not ((np.abs(values) < 1e4).all() and (np.diff(values) > 0).all()):  # NaN fails as well.
        raise refused_cell(path, 0, name, "growing numbers between semicolons", row[name])
    return values


def _read_vehicles(path: Path) -> Columns:
    """The columns `_VEHICLES`, in the order of the ids."""
    table = read_columns(path, _VEHICLES)
    columns = {name: np.asarray(table[name]) for name in _VEHICLES}
    order = np.argsort(columns["id"], kind="stable")
    is_new = np.ones(len(order), np.bool_)
    is_new[order[1:]] = np.diff(columns["id"][order]) != 0
    length, width = columns["width"], columns["height"]
    for name, is_right, expected in (
        ("class", np.isin(columns["class"], ("Car", "Truck")), "Car or Truck"),
        ("drivingDirection", np.isin(columns["drivingDirection"], DIRECTIONS), "1 or 2"),
        ("width", (length > 0.1) & (length < 50.0), "a length, 0.1 to 50 m"),
        ("height", (width > 0.1) & (width < 10.0), "a width, 0.1 to 10 m"),
        ("id", is_new, "a different id in each row"),
    ):
        if not is_right.all():
            row = int(np.argmin(is_right))
            raise refused_cell(path, row, name, expected, str(columns[name][row]))
    return {name: values[order] for name, values in columns.items()}


def _read_rows(path: Path, ids: I64) -> Columns:
    """The columns `_ROWS`, by vehicle and frame."""
    table = read_columns(path, _ROWS)
    columns = {name: np.asarray(table[name]) for name in _ROWS}
    known = np.isin(columns["id"], ids)
    if not known.all():
        row = int(np.argmin(known))
        raise refused_cell(path, row, "id", "an id of tracksMeta", str(columns["id"][row]))
    order = np.lexsort((columns["frame"], columns["id"]))
    columns = {name: values[order] for name, values in columns.items()}
    vehicle, frame = columns["id"], columns["frame"]
    wrong = np.flatnonzero((np.diff(vehicle) == 0) & (np.diff(frame) != 1))
    if len(wrong):  # A vehicle is twice in a frame, or missing in some.
        row = int(wrong[0]) + 1
        expected = f"frame {frame[row - 1] + 1} of vehicle {vehicle[row]}"
        raise refused_cell(path, int(order[row]), "frame", expected, f"frame {frame[row]}")
    return columns


def _road(name: str, meta: _Meta, borders: Sequence[F64], extent: float) -> Road:
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
            edge_d=-float(widths.sum()) * 0.5,
            length=max(extent, 1.0),
            x0=0.0,
            y0=0.0,
            heading=0.0,
            speed_limit=meta.speed_limit or NO_LIMIT,
        )
    except ConfigError as error:
        file = Path(f"{name}{_ENDING}")
        raise refused(file, "road", "a road that the model is made for", str(error)) from None


def _widening(road: Road, borders: Sequence[F64]) -> float:
    """Largest part by which a lane differs from that of the road that stands for both."""
    mean = np.diff(road.boundaries)
    return round(max(float(np.abs(np.diff(one) / mean - 1.0).max()) for one in borders), 4)


def _tracks(rows: Columns, vehicles: Columns, borders: dict[int, F64], road: Road) -> Tracks:
    """The vehicles in road coordinates."""
    vehicle = np.searchsorted(vehicles["id"], rows["id"])
    start = np.searchsorted(vehicle, np.arange(len(vehicles["id"]) + 1))
    direction = vehicles["drivingDirection"][vehicle]
    sign = np.where(direction == 1, -1.0, 1.0)
    x, y = rows["x"] + rows["width"] * 0.5, rows["y"] + rows["height"] * 0.5
    along, left = sign * rows["xVelocity"], -sign * rows["yVelocity"]
    speed = np.hypot(along, left)
    # Below 0.5 m/s the velocity has no reliable direction.
    heading = np.where(speed > 0.5, np.arctan2(left, along), 0.0)
    push, pull = sign * rows["xAcceleration"], -sign * rows["yAcceleration"]
    cosine, sine = np.cos(heading), np.sin(heading)
    s = np.where(sign > 0, x, road.length - x)
    d = np.zeros_like(s)
    for one, local in borders.items():
        here = direction == one
        offset = -sign[here] * y[here]
        d[here] = scaled(offset, np.broadcast_to(local, (len(offset), len(local))), road.boundaries)
    is_truck, nothing = vehicles["class"] == "Truck", np.zeros_like(s)
    tracks = Tracks(
        ids=vehicles["id"],
        kind=kinds_by_length(vehicles["width"], is_truck=is_truck, is_car=~is_truck),
        length=vehicles["width"],
        width=vehicles["height"],
        carriageway=vehicles["drivingDirection"] - 1,
        first=rows["frame"][np.minimum(start[:-1], len(s) - 1)],
        start=start,
        x=s,
        y=d,
        s=s,
        d=d,
        speed=speed,
        heading=heading,
        accel_lon=push * cosine + pull * sine,
        accel_lat=pull * cosine - push * sine,
        yaw_rate=nothing,
        wheel_angle=nothing,
        lane=lane_codes(road, d),
    )
    return kept(tracks, np.isin(direction, list(borders)))


def _unknown_direction(got: int | None) -> ConfigError:
    return ConfigError.of(
        what="direction",
        where="read_highd",
        expected="1 (upper lanes) or 2 (lower lanes)",
        got="both, which have different numbers of lanes" if got is None else got,
        next_step="choose one of them",
    )
