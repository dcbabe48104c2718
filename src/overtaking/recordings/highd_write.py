"""Recorded simulations as highD recordings: three CSV files each.

The columns and their order are those that the owners' own reader names (`read_csv.py` of the
highD-dataset tools).

highD has 25 frames a second, so positions and speeds are interpolated linearly between recorded
frames where these are not at that rate: at 20 frames a second and 5 m/s^2 that moves a vehicle by
at most 1.6 mm. Numbers have four decimals, highD's own have two. Traffic along the road drives to
the right, on the lower lanes; the upper carriageway has one line and no lanes, but on two-way roads
the lane of oncoming traffic, whose lower line is the upper one of ours. `dhw` is the distance
between the bumpers, `thw` and `ttc` are that over the speed and over the closing speed, of vehicles
that drive the same way. Images of bends are straight in no frame of highD's, and a recording has
one speed limit, so roads that bend or have several are refused.
"""

# pyright: reportUnknownParameterType=false

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError
from overtaking.core.files import write_new_file
from overtaking.model.trajectories import STATE_RESOLUTION, Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.limits import NO_LIMIT

Places = NDArray[np.int64]
"""Places among the vehicles, `_NOBODY` for none; shape (vehicle, frame)."""

Columns = dict[str, NDArray[Any]]
"""Columns of a file, in highD's order."""

FORMAT = "highd"
FRAME_RATE = 25
INTERVAL_MS = 1000 // FRAME_RATE

_DECIMALS = 4
_MARGIN = 50.0  # Road before the first and beyond the last vehicle [m].
_MEDIAN = 8.0  # From the line of the upper carriageway to the fast edge of ours [m].
_NOBODY = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageTracks:
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
        way: Direction of travel, 1 to the right, -1 to the left; shape (vehicle,).
        lane: Lane index, 0 the slowest; that of oncoming traffic is the next one.
        lines: Positions of the lane markings of the lower lanes, growing [m].
        upper: The same of the upper ones.
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
    way: F64
    lane: NDArray[np.int64]
    lines: F64
    upper: F64
    extent: float
    limit: float


def write_highd(trajectories: Trajectories, numbers: NDArray[np.integer], folder: Path) -> int:
    """Write a recording for each simulation of a batch.

    Args:
        trajectories: Recorded simulations on a road with right-hand traffic.
        numbers: Number of each in its data set, shape (simulation,).
        folder: Where the files go; they are numbered from 1.

    Returns:
        Number of states written.

    Raises:
        ConfigError: The road bends or rises, or its limit changes.
        OSError: A file cannot be written.
    """
    trajectories.road.check_straight("export to highD")
    _check_one_limit(trajectories)
    written = 0
    for place, number in enumerate(numbers.tolist()):
        image = image_tracks(trajectories, place)
        neighbours = _neighbours(image)
        gaps = _gaps(image, neighbours["precedingId"])
        tables = {
            "recordingMeta": recording_meta(image, number + 1),
            "tracksMeta": tracks_meta(image, neighbours["precedingId"] != _NOBODY, gaps),
            "tracks": tracks(image, neighbours, gaps),
        }
        for kind, columns in tables.items():
            write_new_file(folder / f"{number + 1:02d}_{kind}.csv", _text(columns))
        written += int(image.there.sum())
    return written


def _check_one_limit(trajectories: Trajectories) -> None:
    """Refuse several limits, which `speedLimit` has no place for."""
    road = trajectories.road
    if road.course and road.course.speed_limit_spans and "speed_limit" not in trajectories.unknown:
        raise ConfigError(
            what=f"road {road.name}",
            where="export to highD",
            expected="one speed limit",
            got=f"{len(road.course.speed_limit_spans)} stretches with lower ones",
            next_step="choose --format commonroad",
        )


def image_tracks(trajectories: Trajectories, place: int) -> ImageTracks:
    """One simulation, resampled and turned into the image."""
    road, count = trajectories.road, int(trajectories.num_frames[place])
    interval = trajectories.scenario.frame_interval_ms
    slots = np.flatnonzero(trajectories.scenario.vehicles.valid[place])
    time = np.arange(0, (count - 1) * interval + 1, INTERVAL_MS) / interval
    before = np.minimum(time.astype(np.int64), count - 1)
    after, part = np.minimum(before + 1, count - 1), time - before
    present = trajectories.state_mask[place, slots]

    def at_times(values: F64) -> F64:
        return values[:, before] * (1.0 - part) + values[:, after] * part

    def column(name: str) -> F64:
        return at_times(getattr(trajectories.states, name)[place, slots] * STATE_RESOLUTION[name])

    s, d, speed = column("s"), column("d"), column("speed")
    # Who comes points half a turn away, which is written with either sign.
    turned = trajectories.states.heading[place, slots] * STATE_RESOLUTION["heading"] - road.heading
    relative = at_times(np.unwrap(turned, axis=1))
    lon, lat = column("accel_lon"), column("accel_lat")
    cosine, sine = np.cos(relative), np.sin(relative)
    there = present[:, before] & (present[:, after] | (part == 0.0))
    first = float(s[there].min()) - _MARGIN
    edges = np.sort(road.lane_boundaries)
    line = _MEDIAN
    upper = np.zeros(1)
    if (beyond := road.overtaking_side_neighbour) is not None and road.is_two_way:
        line += beyond.width
        upper = np.array([_MEDIAN, line])
    bodies = trajectories.scenario.vehicles
    known = "speed_limit" not in trajectories.unknown and road.speed_limit < NO_LIMIT
    return ImageTracks(
        there=there,
        length=bodies.length[place, slots].astype(np.float64),
        width=bodies.width[place, slots].astype(np.float64),
        is_truck=bodies.kind[place, slots] == VehicleKind.TRUCK,
        x=s - first,
        y=line + edges[-1] - d,
        velocity=np.stack([speed * cosine, -speed * sine]),
        accel=np.stack([lon * cosine - lat * sine, -lon * sine - lat * cosine]),
        way=np.where(np.where(there, cosine, 0.0).sum(axis=1) < 0.0, -1.0, 1.0),
        lane=road.lane_index(d),
        lines=line + edges[-1] - edges[::-1],
        upper=upper,
        extent=float(s[there].max()) + _MARGIN - first,
        limit=road.speed_limit if known else -1.0,
    )


def _neighbours(image: ImageTracks) -> dict[str, Places]:
    """The neighbours of each vehicle in its own lane and the two beside it, in highD's order."""
    apart, reach = _apart(image)
    shift = image.lane[None, :, :] - image.lane[:, None, :]
    both = image.there[None, :, :] & image.there[:, None, :]
    both &= (image.way[None, :] == image.way[:, None])[:, :, None]
    both &= ~np.eye(len(image.length), dtype=np.bool_)[:, :, None]
    beside, own = np.abs(apart) <= reach, both & (shift == 0)
    found = {
        "precedingId": _nearest(apart, own & (apart >= 0)),
        "followingId": _nearest(-apart, own & (apart < 0)),
    }
    for side, step in (("left", 1), ("right", -1)):
        there = both & (shift == step)
        found[f"{side}PrecedingId"] = _nearest(apart, there & (apart > 0) & ~beside)
        found[f"{side}AlongsideId"] = _nearest(np.abs(apart), there & beside)
        found[f"{side}FollowingId"] = _nearest(-apart, there & (apart < 0) & ~beside)
    return found


def _apart(image: ImageTracks) -> tuple[F64, F64]:
    """Distance of the centres ahead and of touching ones, shapes (vehicle, other, frame or 1)."""
    half = image.length * 0.5
    apart = (image.x[None, :, :] - image.x[:, None, :]) * image.way[:, None, None]
    return apart, (half[None, :] + half[:, None])[:, :, None]


def _nearest(distance: F64, there: NDArray[np.bool_]) -> Places:
    """Place of the nearest other vehicle, from arrays of shape (vehicle, other, frame)."""
    masked = np.where(there, distance, np.inf)
    return np.where(there.any(axis=1), masked.argmin(axis=1), _NOBODY)


def _gaps(image: ImageTracks, preceding: Places) -> Columns:
    """Gap [m], times [s] and speed [m/s] of the vehicle ahead, 0 without one; (vehicle, frame)."""
    apart, reach = _apart(image)
    speed, somebody = image.velocity[0] * image.way[:, None], preceding != _NOBODY
    ahead = np.maximum(preceding, 0)
    clear = np.take_along_axis(apart - reach, ahead[:, None, :], axis=1)[:, 0]
    gap = np.where(somebody, clear, 0.0)
    other = np.where(somebody, np.take_along_axis(speed, ahead, axis=0), 0.0)
    closing = speed - other
    moves, closes = somebody & (speed > 0.1), somebody & (np.abs(closing) > 1e-3)
    return {
        "dhw": gap,
        "thw": np.where(moves, gap / np.where(moves, speed, 1.0), 0.0),
        "ttc": np.where(closes, gap / np.where(closes, closing, 1.0), 0.0),
        "precedingXVelocity": other * image.way[:, None],
    }


def tracks(image: ImageTracks, neighbours: dict[str, Places], gaps: Columns) -> Columns:
    """The states, by vehicle and frame."""
    length, width = image.length[:, None], image.width[:, None]
    x = image.x - length * 0.5
    sights = (image.extent - (x + length), x)
    left = image.way[:, None] < 0.0
    values: Columns = {
        "frame": np.arange(image.there.shape[1]) + 1,
        "id": np.arange(len(length))[:, None] + 1,
        "x": x,
        "y": image.y - width * 0.5,
        "width": length,
        "height": width,
        "xVelocity": image.velocity[0],
        "yVelocity": image.velocity[1],
        "xAcceleration": image.accel[0],
        "yAcceleration": image.accel[1],
        "frontSightDistance": np.where(left, *sights[::-1]),
        "backSightDistance": np.where(left, *sights),
        **gaps,
        **{name: np.where(one == _NOBODY, 0, one + 1) for name, one in neighbours.items()},
        "laneId": _lane_ids(image),
    }
    shape = image.there.shape
    return {name: np.broadcast_to(one, shape)[image.there] for name, one in values.items()}


def _lane_ids(image: ImageTracks) -> NDArray[np.int64]:
    """From the top: 1 is above the upper lanes, then they, the median, and the lower lanes come."""
    lower, upper = len(image.lines) - 1, len(image.upper) - 1
    ids = 2 + upper + lower - image.lane
    # Who drives in the lane of oncoming traffic, or comes in it, is on the upper carriageway.
    return np.where(upper and image.lane >= lower, 1 + upper, ids)


def tracks_meta(image: ImageTracks, follows: NDArray[np.bool_], gaps: Columns) -> Columns:
    """One row per vehicle; measures that a vehicle never has are -1.

    Args:
        image: The simulation.
        follows: Whether a vehicle has another ahead, shape (vehicle, frame).
        gaps: From `_gaps`.
    """
    there, speed = image.there, np.abs(image.velocity[0])
    follows = there & follows

    def least(values: F64, where: NDArray[np.bool_]) -> F64:
        found = np.where(where, values, np.inf).min(axis=1)
        return np.where(np.isfinite(found), found, -1.0)

    first = there.argmax(axis=1)
    last = np.where(there, np.arange(there.shape[1]), 0).max(axis=1)
    ends = (np.take_along_axis(image.x, frame[:, None], axis=1) for frame in (last, first))
    both = there[:, 1:] & there[:, :-1]
    return {
        "id": np.arange(len(first)) + 1,
        "width": image.length,
        "height": image.width,
        "initialFrame": first + 1,
        "finalFrame": last + 1,
        "numFrames": there.sum(axis=1),
        "class": np.where(image.is_truck, "Truck", "Car"),
        "drivingDirection": np.where(image.way > 0.0, 2, 1),
        "traveledDistance": np.abs(np.subtract(*ends)[:, 0]),
        "minXVelocity": least(speed, there),
        "maxXVelocity": -least(-speed, there),
        "meanXVelocity": np.where(there, speed, 0.0).sum(axis=1) / there.sum(axis=1),
        "minDHW": least(gaps["dhw"], follows),
        "minTHW": least(gaps["thw"], follows & (gaps["thw"] > 0)),
        "minTTC": least(gaps["ttc"], follows & (gaps["ttc"] > 0)),
        "numLaneChanges": (both & (np.diff(image.lane, axis=1) != 0)).sum(axis=1),
    }


def recording_meta(image: ImageTracks, number: int) -> Columns:
    """The one row about the whole recording; its date means nothing."""
    count, trucks = len(image.length), int(image.is_truck.sum())
    driven = (np.where(image.there, np.abs(image.velocity[0]), 0.0)).sum() / FRAME_RATE
    row = {
        "id": number,
        "frameRate": FRAME_RATE,
        "locationId": 0,
        "speedLimit": image.limit,
        "month": "1.1970",
        "weekDay": "Thu",
        "startTime": "00:00",
        "duration": image.there.shape[1] / FRAME_RATE,
        "totalDrivenDistance": driven,
        "totalDrivenTime": float(image.there.sum()) / FRAME_RATE,
        "numVehicles": count,
        "numCars": count - trucks,
        "numTrucks": trucks,
        "upperLaneMarkings": _written(image.upper) if len(image.upper) > 1 else "0.00",
        "lowerLaneMarkings": _written(image.lines),
    }
    return {name: np.array([value]) for name, value in row.items()}


def _written(lines: F64) -> str:
    """Positions of lane markings."""
    return ";".join(f"{line:.{_DECIMALS}f}" for line in lines)


def _text(columns: Columns) -> str:
    """Columns as CSV without quotes, which no cell needs; fractions are rounded."""
    arrays = [
        pa.array(np.round(values, _DECIMALS) + 0.0 if values.dtype.kind == "f" else values)
        for values in columns.values()
    ]
    sink = pa.BufferOutputStream()
    options = pacsv.WriteOptions(include_header=False, quoting_style="none")
    pacsv.write_csv(pa.Table.from_arrays(arrays, names=list(columns)), sink, options)
    return ",".join(columns) + "\n" + sink.getvalue().to_pybytes().decode()
