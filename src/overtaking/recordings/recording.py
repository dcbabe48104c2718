"""A recording of traffic, whatever file it comes from: vehicles on one road.

Readers of formats make a `Recording`; `candidates` finds overtakes in it, and `recording_batch`
makes `Trajectories` of them. Numbers are float64 and SI until they are rounded once, at the end.
"""

import dataclasses
import re
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64, I64, U8, Mask
from overtaking.model.road import Road
from overtaking.model.trajectories import BEYOND_KERB_EDGE
from overtaking.recordings.findings import Finding
from overtaking.recordings.limits import with_speed_limit
from overtaking.recordings.recording_checks import check_ranges
from overtaking.recordings.rows import track_names

NEVER_RECORDED = frozenset(
    {"drivers", "bodies", "indicators", "lamps", "wheel_angle", "impulse", "stage", "percepts"}
)
"""What no recording of others contains; see `model.trajectories.UNKNOWNS`."""

OPPOSITE = -1
"""Carriageway of the vehicles that come the other way on a road with a lane for them."""

_OF_A_VEHICLE = ("names", "kind", "is_kind_known", "length", "width", "carriageway", "file_row")
_BESIDE = 6.0  # Vehicles farther than this from the outer lanes belong to another road [m].
_LEAST_STRETCH = 0.5  # Nearer to the centre of a bend is no part of a road.
_MIN_PIECE_MS = 500  # Shorter pieces of tracks show no manoeuvre.
_LATER_TRACK = re.compile(r"(.*) \([0-9]+\)", re.DOTALL)
_HALF_SMOOTHING_MS = 100  # As the signals have it: a central difference over 0.2 s.


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """The vehicles of a recording; the rows of a vehicle are adjacent, in order of time.

    Attributes:
        names: Name or number of each vehicle in the source, each different, shape (vehicle,); a
            later track of a vehicle is `NAME (2)`.
        kind: `VehicleKind`, same shape.
        is_kind_known: Whether the kind is stated and agrees with the length, same shape.
        length: Same shape [m].
        width: Same shape [m].
        carriageway: Number of the carriageway that it drives on; those on different ones have
            no influence on each other, same shape. `OPPOSITE` for oncoming vehicles.
        file_row: Row of the file in which each vehicle appears first, or another number in that
            order, same shape.
        first: Frame in which each vehicle is first seen, counted as the source does, same shape.
        start: Row at which each vehicle begins, and after the last the number of rows,
            shape (vehicle + 1,).
        x: World position, shape (row,) like all that follow [m].
        y: World position, to the left of x [m].
        s: Position along the road [m].
        d: Position across the road, growing to the left [m].
        speed: Never negative [m/s].
        heading: Of the road plus that of the vehicle relative to it, anticlockwise [rad].
        accel_lon: [m/s^2].
        accel_lat: To the left [m/s^2].
        yaw_rate: Anticlockwise [rad/s].
        wheel_angle: Positive to the left [rad].
        lane: Lane index as in `States.lane`.
    """

    names: NDArray[np.object_]
    kind: U8
    is_kind_known: Mask
    length: F64
    width: F64
    carriageway: I64
    file_row: I64
    first: I64
    start: I64
    x: F64
    y: F64
    s: F64
    d: F64
    speed: F64
    heading: F64
    accel_lon: F64
    accel_lat: F64
    yaw_rate: F64
    wheel_angle: F64
    lane: U8

    @property
    def num_vehicles(self) -> int:
        """Number of vehicles."""
        return len(self.names)

    @property
    def num_rows(self) -> int:
        """Number of states."""
        return len(self.s)

    @property
    def last(self) -> I64:
        """Frame in which each vehicle is last seen, shape (vehicle,)."""
        return self.first + np.diff(self.start) - 1

    @property
    def vehicle(self) -> I64:
        """Place of each row's vehicle, shape (row,)."""
        return np.repeat(np.arange(self.num_vehicles), np.diff(self.start))

    @property
    def is_oncoming(self) -> NDArray[np.bool_]:
        """Whether each vehicle comes the other way, shape (vehicle,)."""
        return self.carriageway == OPPOSITE

    @property
    def lane_index(self) -> I64:
        """Lane index of each row, -1 beyond the slow edge, shape (row,)."""
        return np.where(self.lane == BEYOND_KERB_EDGE, -1, self.lane.astype(np.int64))

    @property
    def frame(self) -> I64:
        """Frame of each row, shape (row,)."""
        return np.arange(self.num_rows) - np.repeat(
            self.start[:-1] - self.first, np.diff(self.start)
        )

    def name_of(self, vehicle: int) -> str:
        """Name of a vehicle in messages and results."""
        return str(self.names[vehicle])

    def row(self, vehicle: int, frame: int) -> int:
        """The row of a vehicle in a frame in which it is present."""
        return int(self.start[vehicle] + frame - self.first[vehicle])


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Traffic on one road.

    Attributes:
        name: What the source calls it.
        file_format: Format of the file that it was read from.
        road: The road.
        frame_interval_ms: Time between frames [ms].
        tracks: The vehicles.
        unknown: What the source does not tell, names of `UNKNOWNS`.
        notes: What the reader decided, left out or measured, by name with units.
        findings: What the examination of the recording found.
        time_origin_s: Time of frame 0 as the file counts [s].
    """

    name: str
    file_format: str
    road: Road
    frame_interval_ms: int
    tracks: Tracks
    unknown: frozenset[str]
    notes: dict[str, Any] = field(default_factory=dict[str, Any])
    findings: tuple[Finding, ...] = ()
    time_origin_s: float = 0.0

    def __post_init__(self) -> None:
        """Refuse quantities that the recorded integers cannot hold.

        Raises:
            ImportFormatError: A position or speed is too large; the message names vehicle and
                frame.
        """
        check_ranges(self)

    def with_speed_limit(self, speed_limit: float) -> Self:
        """The recording on a road with one speed limit, which counts as known.

        Args:
            speed_limit: The limit, infinite for none [m/s].

        Raises:
            ConfigError: The limit is not positive, or too large.
        """
        road = with_speed_limit(self.road, speed_limit)
        return dataclasses.replace(self, road=road, unknown=self.unknown - {"speed_limit"})


def kept(tracks: Tracks, rows: NDArray[np.bool_], frame_interval_ms: int) -> Tracks:
    """The tracks restricted to some rows; the pieces of a vehicle become tracks of their own.

    A vehicle beside the edge of the road crosses it often, so pieces shorter than `_MIN_PIECE_MS`
    are left out, but for the longest one of a vehicle.

    Args:
        tracks: The tracks.
        rows: Which rows may stay, shape (row,).
        frame_interval_ms: Time between frames [ms].
    """
    if rows.all():
        return tracks
    vehicle = tracks.vehicle
    begins = rows & np.append(True, ~rows[:-1] | (vehicle[1:] != vehicle[:-1]))
    run = np.cumsum(begins) - 1
    first_row, length = np.flatnonzero(begins), np.bincount(run[rows], minlength=begins.sum())
    owner = vehicle[first_row]
    longest = np.zeros(tracks.num_vehicles, np.int64)
    np.maximum.at(longest, owner, length)
    is_kept = length * frame_interval_ms >= _MIN_PIECE_MS
    # Of pieces that are all short, the first one of the greatest length stays.
    is_longest = np.flatnonzero(length == longest[owner])
    is_kept[is_longest[np.unique(owner[is_longest], return_index=True)[1]]] = True
    is_in_piece = np.zeros(tracks.num_rows, np.bool_)
    is_in_piece[rows] = is_kept[run[rows]]
    owner, first_row, length = owner[is_kept], first_row[is_kept], length[is_kept]
    pieces = _restricted(tracks, owner, first_row, length, is_in_piece)
    if (np.diff(owner) > 0).all():
        return pieces
    return dataclasses.replace(pieces, names=_piece_names(tracks.names, owner))


def _piece_names(names: NDArray[np.object_], owner: I64) -> NDArray[np.object_]:
    """Names of pieces of tracks, in order of track and time.

    Args:
        names: Name of each track; that of a second track is "NAME (2)".
        owner: Track of each piece, ascending.
    """
    index_of_name = {name: place for place, name in enumerate(names.tolist())}
    vehicle = np.arange(len(names))
    for place, name in enumerate(names.tolist()):
        match = _LATER_TRACK.fullmatch(name)
        if match is not None and index_of_name.get(match[1], place) < place:
            vehicle[place] = index_of_name[match[1]]
    return track_names(names, vehicle[owner])


class Ways(NamedTuple):
    """Tracks by the way that they go, and how many vehicles go against the road.

    Attributes:
        tracks: The tracks.
        oncoming: Number of vehicles that come the other way and are among them.
        left_out: Number of those that are not, as the road has no lane for them.
    """

    tracks: Tracks
    oncoming: int
    left_out: int

    @property
    def along(self) -> int:
        """Number of vehicles that drive along the road."""
        return self.tracks.num_vehicles - self.oncoming

    @property
    def notes(self) -> dict[str, int]:
        """The numbers, for the notes of a recording."""
        return {"oncoming": self.oncoming, "oncoming_left_out": self.left_out}


def by_ways(tracks: Tracks, road: Road) -> Ways:
    """Which vehicles point against the road in most of their states.

    On a two-way road they are on the carriageway `OPPOSITE`; elsewhere they are left out.
    """
    vehicle, num = tracks.vehicle, tracks.num_vehicles
    is_against = np.cos(tracks.heading - road.heading_at(tracks.s)) < 0.0
    is_oncoming = 2 * np.bincount(vehicle[is_against], minlength=num) > np.diff(tracks.start)
    count = int(is_oncoming.sum())
    if not road.is_two_way:
        return Ways(select_vehicles(tracks, ~is_oncoming), 0, count)
    carriageway = np.where(is_oncoming, OPPOSITE, tracks.carriageway)
    return Ways(dataclasses.replace(tracks, carriageway=carriageway), count, 0)


def select_vehicles(tracks: Tracks, is_chosen: Mask) -> Tracks:
    """Some of the vehicles, with all of their rows."""
    chosen = np.flatnonzero(is_chosen)
    count = np.diff(tracks.start)
    return _restricted(
        tracks, chosen, tracks.start[chosen], count[chosen], np.repeat(is_chosen, count)
    )


def _restricted(
    tracks: Tracks, vehicles: I64, first_row: I64, length: I64, wanted: NDArray[np.bool_]
) -> Tracks:
    """Some vehicles, each with one run of its rows."""
    changes: dict[str, Any] = {
        "first": tracks.first[vehicles] + first_row - tracks.start[vehicles],
        "start": np.concatenate([[0], np.cumsum(length)]).astype(np.int64),
        **{name: getattr(tracks, name)[vehicles] for name in _OF_A_VEHICLE},
    }
    for each in dataclasses.fields(Tracks):
        if each.name not in changes:
            changes[each.name] = getattr(tracks, each.name)[wanted]
    return Tracks(**changes)


def slope(values: F64, start: I64, frame_interval_ms: int) -> F64:
    """Change per second of something that each vehicle has in each row.

    Args:
        values: Shape (row,).
        start: First row of each vehicle and the number of rows, shape (vehicle + 1,).
        frame_interval_ms: Time between rows [ms].

    Returns:
        A central difference over about 0.2 s, one-sided at the ends, 0 for a single row.
    """
    half = max(1, round(_HALF_SMOOTHING_MS / frame_interval_ms))
    row, count = np.arange(len(values)), np.diff(start)
    later = np.minimum(row + half, np.repeat(start[1:] - 1, count))
    earlier = np.maximum(row - half, np.repeat(start[:-1], count))
    elapsed = np.maximum(later - earlier, 1) * (frame_interval_ms * 1e-3)
    return (values[later] - values[earlier]) / elapsed


def on_road(road: Road, s: F64, d: F64) -> NDArray[np.bool_]:
    """Whether points are on a road or on what may lie right beside it, same shape.

    Args:
        road: The road.
        s: Along it, any shape [m].
        d: To its left, same shape [m].
    """
    edges = np.sort(road.lane_boundaries[[0, -1]])
    beside = (d > edges[0] - _BESIDE) & (d < edges[1] + _BESIDE)
    return beside & (s >= 0.0) & (s <= road.length)


def bending(road: Road, s: F64, d: F64) -> tuple[F64, F64]:
    """The way of vehicles beside the reference line over that along it, and how the road turns.

    Args:
        road: The road.
        s: Where they are along it, any shape [m].
        d: To its left, same shape [m].

    Returns:
        Metres of their own way per metre of the line, at least `_LEAST_STRETCH`, and the turning
        of the road per metre of their own way, positive in left bends [1/m].
    """
    curvature = road.curvature_at(s)
    stretch = np.maximum(1.0 - curvature * d, _LEAST_STRETCH)
    return stretch, curvature / stretch


def lane_codes(road: Road, d: F64) -> U8:
    """Values of `States.lane` for positions across the road [m]."""
    lane = road.lane_index(d)
    return np.where(lane < 0, BEYOND_KERB_EDGE, lane).astype(np.uint8)
