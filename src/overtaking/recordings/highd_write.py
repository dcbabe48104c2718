"""Recorded simulations as highD recordings: three CSV files each, in highD's columns.

highD has 25 frames a second, so positions and speeds are interpolated linearly between recorded
frames where these are not at that rate: at 20 frames a second and 5 m/s^2 that moves a vehicle by
at most 1.6 mm. Numbers have four decimals, highD's own have two. All traffic drives to the right,
on the lower lanes; of the upper carriageway there is one line. `dhw` is the distance between the
bumpers, `thw` and `ttc` are that over the speed and over the closing speed.
"""

# pyright: reportUnknownParameterType=false

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from overtaking.core.folders import put_file
from overtaking.model.trajectory import (
    METRES_PER_SECOND_PER_STEP,
    METRES_PER_SECOND_SQUARED_PER_STEP,
    METRES_PER_STEP,
    RADIANS_PER_STEP,
)
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.highd import NO_LIMIT
from overtaking.recordings.highd_files import RECORDING_META, TRACKS, TRACKS_META

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.model.road import Road
    from overtaking.model.trajectory import Trajectories

F64 = NDArray[np.float64]

FORMAT = "highd"
FRAME_RATE = 25
INTERVAL_MS = 1000 // FRAME_RATE

_DECIMALS = 4
_MARGIN = 50.0  # Road before the first and beyond the last vehicle [m].
_MEDIAN = 8.0  # From the line of the upper carriageway to the fast edge of ours [m].
_NOBODY = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One simulation in the coordinates of a highD image, 25 frames a second.

    Arrays have shape (vehicle, frame); where a vehicle is not there, the values mean nothing.

    Attributes:
        there: Whether it is there.
        length: Shape (vehicle,) [m].
        width: Shape (vehicle,) [m].
        is_truck: Shape (vehicle,).
        x: Of the centre, to the right [m].
        y: Of the centre, down [m].
        velocity: To the right and down, shape (2, vehicle, frame) [m/s].
        accel: The same of the acceleration [m/s^2].
        lane: Lane index, 0 the slowest.
        lines: Positions of the lane markings, growing [m].
        extent: Length of the image [m].
        limit: Speed limit, -1 if there is none or it is not known [m/s].
    """

    there: NDArray[np.bool_]
    length: F64
    width: F64
    is_truck: NDArray[np.bool_]
    x: F64
    y: F64
    velocity: F64
    accel: F64
    lane: NDArray[np.int64]
    lines: F64
    extent: float
    limit: float

    @property
    def num_lanes(self) -> int:
        """Number of lanes."""
        return len(self.lines) - 1


def write_highd(trajectories: Trajectories, numbers: NDArray[np.integer], folder: Path) -> int:
    """Write a recording for each simulation of a batch.

    Args:
        trajectories: Recorded simulations on a road with right-hand traffic.
        numbers: Number of each in its data set, shape (simulation,).
        folder: Where the files go; they are numbered from 1.

    Returns:
        Number of states written.

    Raises:
        OSError: A file cannot be written.
    """
    written = 0
    for place, number in enumerate(numbers.tolist()):
        scene = scene_of(trajectories, place)
        around = _Around.of(scene)
        name = f"{number + 1:02d}"
        tables = {
            "recordingMeta": recording_meta(scene, number + 1),
            "tracksMeta": tracks_meta(scene, around),
            "tracks": tracks(scene, around),
        }
        for kind, table in tables.items():
            put_file(folder / f"{name}_{kind}.csv", _text(table))
        written += int(scene.there.sum())
    return written


def scene_of(trajectories: Trajectories, place: int) -> Scene:
    """One simulation, resampled and turned into the image."""
    road, count = trajectories.road, int(trajectories.num_frames[place])
    interval = trajectories.scenario.frame_interval_ms
    slots = np.flatnonzero(trajectories.scenario.vehicles.valid[place])
    time = np.arange(0, (count - 1) * interval + 1, INTERVAL_MS) / interval
    before = np.minimum(time.astype(np.int64), count - 1)
    after, part = np.minimum(before + 1, count - 1), time - before
    recorded, present = trajectories.states, trajectories.state_valid[place, slots]

    def column(name: str, step: float) -> F64:
        values = getattr(recorded, name)[place, slots] * step
        return values[:, before] * (1.0 - part) + values[:, after] * part

    s, d = column("s", METRES_PER_STEP), column("d", METRES_PER_STEP)
    relative = column("heading", RADIANS_PER_STEP) - road.heading
    speed = column("speed", METRES_PER_SECOND_PER_STEP)
    lon, lat = (
        column(name, METRES_PER_SECOND_SQUARED_PER_STEP) for name in ("accel_lon", "accel_lat")
    )
    cosine, sine = np.cos(relative), np.sin(relative)
    there = present[:, before] & (present[:, after] | (part == 0.0))
    first = float(s[there].min()) - _MARGIN
    edges = np.sort(road.boundaries)
    bodies = trajectories.scenario.vehicles
    known = "speed_limit" not in trajectories.unknown and road.speed_limit < NO_LIMIT
    return Scene(
        there=there,
        length=bodies.length[place, slots].astype(np.float64),
        width=bodies.width[place, slots].astype(np.float64),
        is_truck=bodies.kind[place, slots] == VehicleKind.T,
        x=s - first,
        y=_MEDIAN + edges[-1] - d,
        velocity=np.stack([speed * cosine, -speed * sine]),
        accel=np.stack([lon * cosine - lat * sine, -lon * sine - lat * cosine]),
        lane=_lanes(road, d),
        lines=_MEDIAN + edges[-1] - edges[::-1],
        extent=float(s[there].max()) + _MARGIN - first,
        limit=road.speed_limit if known else -1.0,
    )


def _lanes(road: Road, d: F64) -> NDArray[np.int64]:
    """Lane index at positions across the road, -1 and `num_lanes` beside it."""
    return road.lane_index(d)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Around:
    """Who is around whom, as places among the vehicles, `_NOBODY` for none.

    Attributes:
        places: By the name of highD's column, shape (vehicle, frame).
        gap: Distance to the bumper of the preceding vehicle, 0 if there is none, same shape [m].
    """

    places: dict[str, NDArray[np.int64]]
    gap: F64

    @classmethod
    def of(cls, scene: Scene) -> _Around:
        """The neighbours in the own lane and the two beside it."""
        half = scene.length * 0.5
        apart = scene.x[None, :, :] - scene.x[:, None, :]
        reach = (half[None, :] + half[:, None])[:, :, None]
        shift = scene.lane[None, :, :] - scene.lane[:, None, :]
        both = scene.there[None, :, :] & scene.there[:, None, :]
        both &= ~np.eye(len(half), dtype=np.bool_)[:, :, None]
        beside = np.abs(apart) <= reach
        places = {
            "precedingId": _nearest(apart, both & (shift == 0) & (apart >= 0)),
            "followingId": _nearest(-apart, both & (shift == 0) & (apart < 0)),
        }
        for side, step in (("left", 1), ("right", -1)):
            there = both & (shift == step)
            places[f"{side}PrecedingId"] = _nearest(apart, there & (apart > 0) & ~beside)
            places[f"{side}AlongsideId"] = _nearest(np.abs(apart), there & beside)
            places[f"{side}FollowingId"] = _nearest(-apart, there & (apart < 0) & ~beside)
        ahead = places["precedingId"]
        clear = np.take_along_axis(apart - reach, np.maximum(ahead, 0)[:, None, :], axis=1)[:, 0]
        return cls(places=places, gap=np.where(ahead == _NOBODY, 0.0, clear))


def _nearest(distance: F64, there: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Place of the nearest other vehicle, from arrays of shape (vehicle, other, frame)."""
    masked = np.where(there, distance, np.inf)
    return np.where(there.any(axis=1), masked.argmin(axis=1), _NOBODY)


def tracks(scene: Scene, around: _Around) -> pa.Table:
    """The states, by vehicle and frame."""
    vehicle, frame = np.nonzero(scene.there)
    preceding = around.places["precedingId"]
    ahead = np.maximum(preceding, 0)
    other = np.take_along_axis(scene.velocity[0], ahead, axis=0)
    other = np.where(preceding == _NOBODY, 0.0, other)
    thw, ttc = _times(scene, around, other)
    ids = {
        name: np.where(one == _NOBODY, 0, one + 1)[vehicle, frame]
        for name, one in around.places.items()
    }
    x, y = scene.x - scene.length[:, None] * 0.5, scene.y - scene.width[:, None] * 0.5
    front, back = x + scene.length[:, None], x
    values = {
        "frame": frame + 1,
        "id": vehicle + 1,
        "width": scene.length[vehicle],
        "height": scene.width[vehicle],
        # From the top: what is above the upper line is 1, the median is 2, then come the lanes.
        "laneId": 2 + scene.num_lanes - scene.lane[vehicle, frame],
        **ids,
    }
    wide = {
        "x": x,
        "y": y,
        "xVelocity": scene.velocity[0],
        "yVelocity": scene.velocity[1],
        "xAcceleration": scene.accel[0],
        "yAcceleration": scene.accel[1],
        "frontSightDistance": scene.extent - front,
        "backSightDistance": back,
        "dhw": around.gap,
        "thw": thw,
        "ttc": ttc,
        "precedingXVelocity": other,
    }
    values |= {name: one[vehicle, frame] for name, one in wide.items()}
    return _table(TRACKS, values)


def _times(scene: Scene, around: _Around, other: F64) -> tuple[F64, F64]:
    """Time headway and time to collision, 0 where there is nobody ahead [s]."""
    speed = scene.velocity[0]
    somebody = around.places["precedingId"] != _NOBODY
    closing = speed - other
    moves, closes = somebody & (speed > 0.1), somebody & (np.abs(closing) > 1e-3)
    thw = np.where(moves, around.gap / np.where(moves, speed, 1.0), 0.0)
    ttc = np.where(closes, around.gap / np.where(closes, closing, 1.0), 0.0)
    return thw, ttc


def tracks_meta(scene: Scene, around: _Around) -> pa.Table:
    """One row per vehicle; measures that a vehicle never has are -1."""
    there, speed = scene.there, np.abs(scene.velocity[0])
    other = np.take_along_axis(
        scene.velocity[0], np.maximum(around.places["precedingId"], 0), axis=0
    )
    thw, ttc = _times(scene, around, other)
    follows = there & (around.places["precedingId"] != _NOBODY)
    frames = np.arange(there.shape[1])

    def least(values: F64, where: NDArray[np.bool_]) -> F64:
        found = np.where(where, values, np.inf).min(axis=1)
        return np.where(np.isfinite(found), found, -1.0)

    first, last = there.argmax(axis=1), np.where(there, frames, 0).max(axis=1)
    travelled = np.take_along_axis(scene.x, last[:, None], 1) - np.take_along_axis(
        scene.x, first[:, None], 1
    )
    both = there[:, 1:] & there[:, :-1]
    values: dict[str, Any] = {
        "id": np.arange(len(first)) + 1,
        "width": scene.length,
        "height": scene.width,
        "initialFrame": first + 1,
        "finalFrame": last + 1,
        "numFrames": there.sum(axis=1),
        "class": np.where(scene.is_truck, "Truck", "Car"),
        "drivingDirection": np.full(len(first), 2),
        "traveledDistance": travelled[:, 0],
        "minXVelocity": least(speed, there),
        "maxXVelocity": -least(-speed, there),
        "meanXVelocity": np.where(there, speed, 0.0).sum(axis=1) / there.sum(axis=1),
        "minDHW": least(around.gap, follows),
        "minTHW": least(thw, follows & (thw > 0)),
        "minTTC": least(ttc, follows & (ttc > 0)),
        "numLaneChanges": (both & (np.diff(scene.lane, axis=1) != 0)).sum(axis=1),
    }
    return _table(TRACKS_META, values)


def recording_meta(scene: Scene, number: int) -> pa.Table:
    """The one row about the whole recording; its date means nothing."""
    count, trucks = len(scene.length), int(scene.is_truck.sum())
    driven = (np.where(scene.there, np.abs(scene.velocity[0]), 0.0)).sum() / FRAME_RATE
    values = {
        "id": [number],
        "frameRate": [FRAME_RATE],
        "locationId": [0],
        "speedLimit": [scene.limit],
        "month": ["1.1970"],
        "weekDay": ["Thu"],
        "startTime": ["00:00"],
        "duration": [scene.there.shape[1] / FRAME_RATE],
        "totalDrivenDistance": [driven],
        "totalDrivenTime": [float(scene.there.sum()) / FRAME_RATE],
        "numVehicles": [count],
        "numCars": [count - trucks],
        "numTrucks": [trucks],
        "upperLaneMarkings": ["0.00"],
        "lowerLaneMarkings": [";".join(f"{line:.{_DECIMALS}f}" for line in scene.lines)],
    }
    return _table(RECORDING_META, {name: np.array(one) for name, one in values.items()})


def _table(names: tuple[str, ...], values: dict[str, Any]) -> pa.Table:
    """Columns in highD's order; numbers that are not whole are rounded."""
    arrays = [
        pa.array(
            np.round(values[name], _DECIMALS) + 0.0
            if values[name].dtype.kind == "f"
            else values[name]
        )
        for name in names
    ]
    return pa.Table.from_arrays(arrays, names=list(names))


def _text(table: pa.Table) -> str:
    """A table as CSV without quotes, which no cell needs."""
    sink = pa.BufferOutputStream()
    header = ",".join(table.column_names) + "\n"
    options = pacsv.WriteOptions(include_header=False, quoting_style="none")
    pacsv.write_csv(table, sink, options)
    return header + sink.getvalue().to_pybytes().decode()
