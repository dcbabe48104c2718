"""The states of a recording in SI units by vehicle and frame, and how they come to whole frames."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, U8, Mask
    from overtaking.recordings.findings import Finding

ON_GRID = 1e-3
"""Instants this near a frame are that frame's: 3 mm at 30 m/s and 10 frames a second [frames]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """States by vehicle and frame.

    Attributes:
        where: The file, for messages.
        names: Name of each track, each different, shape (vehicle,); see `track_names`.
        kind: `VehicleKind`, same shape.
        is_kind_known: Whether the kind is stated and agrees with the length, same shape.
        length: Same shape [m].
        width: Same shape [m].
        file_row: Row of the file in which each vehicle appears first, same shape.
        direction: Number of the carriageway, same shape; None where none is given.
        start: First row of each vehicle, and the number of rows, shape (vehicle + 1,).
        frame: Of each row, without gaps in a vehicle, shape (row,).
        frame_interval_ms: Time between frames [ms].
        time_origin_s: Time of frame 0 as the file counts [s].
        values: Positions, speeds, headings and accelerations by the names of `QUANTITIES`, in axes
            of which y is to the left of x, shape (row,) [SI].
        lane: Name of the lane, shape (row,); None where none is given.
        about: What holds for the whole recording, by the names of `QUANTITIES`.
        notes: What was decided or measured.
        findings: What the examination of the tables found.
    """

    where: str
    names: NDArray[np.object_]
    kind: U8
    is_kind_known: Mask
    length: F64
    width: F64
    file_row: I64
    direction: I64 | None
    start: I64
    frame: I64
    frame_interval_ms: int
    time_origin_s: float
    values: dict[str, F64]
    lane: NDArray[Any] | None
    about: dict[str, Any]
    notes: dict[str, Any] = field(default_factory=dict[str, Any])
    findings: tuple[Finding, ...] = ()

    @property
    def vehicle(self) -> I64:
        """Place of each row's vehicle, shape (row,)."""
        return np.repeat(np.arange(len(self.names)), np.diff(self.start))


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """States of tracks at whole frames.

    Attributes:
        owner: Track that each track of the grid was, shape (track,).
        start: First row of each track, and the number of rows, shape (track + 1,).
        frame: Shape (row,), without gaps in a track.
        nearest: Row of the table that is nearest in time, same shape.
        values: Same shape.
        is_moved: Whether states are interpolated because their instants lie between frames.
    """

    owner: I64
    start: I64
    frame: I64
    nearest: I64
    values: dict[str, F64]
    is_moved: bool


def at_whole_frames(track: I64, frame_time: F64, values: dict[str, F64]) -> Grid:
    """States at each whole frame from the first to the last row of a track.

    Frames without a row, and all frames if some instants lie between frames, are interpolated
    linearly.

    Args:
        track: Index of the track of each row, ascending, shape (row,).
        frame_time: Instant, ascending within a track, same shape [frames].
        values: Quantities to interpolate, same shape.
    """
    begin = np.append(0, np.flatnonzero(np.diff(track) != 0) + 1)
    start = np.append(begin, len(track)).astype(np.int64)
    frame = np.rint(frame_time)
    is_moved = bool((np.abs(frame_time - frame) > ON_GRID).any())
    if is_moved:
        return _interpolated(track, frame_time, values, start, is_moved=True)
    if int((frame[start[1:] - 1] - frame[begin] + 1.0).sum()) > len(track):
        return _interpolated(track, frame, values, start, is_moved=False)
    return Grid(
        owner=track[begin],
        start=start,
        frame=frame.astype(np.int64),
        nearest=np.arange(len(track)),
        values=values,
        is_moved=False,
    )


def _interpolated(
    track: I64, frame_time: F64, values: dict[str, F64], start: I64, *, is_moved: bool
) -> Grid:
    """States at whole frames, linearly between those of the table."""
    first_time, last_time = frame_time[start[:-1]], frame_time[start[1:] - 1]
    first = np.ceil(first_time - ON_GRID)
    count = np.maximum(np.floor(last_time + ON_GRID) - first + 1.0, 0.0).astype(np.int64)
    has_frame = count > 0
    first, count = first[has_frame], count[has_frame]
    low, high = start[:-1][has_frame], start[1:][has_frame] - 1
    grid_start = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    within = np.arange(grid_start[-1]) - np.repeat(grid_start[:-1], count)
    frame = np.repeat(first, count) + within
    # One ascending axis for all tracks: each begins two frames after the end of the one before.
    extent = np.ceil(last_time - first_time) + 2.0
    shift = np.cumsum(extent) - extent - first_time
    axis = frame_time + np.repeat(shift, np.diff(start))
    place = np.searchsorted(axis, frame + np.repeat(shift[has_frame], count), side="right") - 1
    before = np.clip(place, np.repeat(low, count), np.repeat(np.maximum(high - 1, low), count))
    after = np.minimum(before + 1, np.repeat(high, count))
    elapsed = frame_time[after] - frame_time[before]
    share = (frame - frame_time[before]) / np.where(elapsed > 0.0, elapsed, 1.0)
    # A frame that is a hair before the first row or after the last one has its values.
    share = np.where(elapsed > 0.0, np.clip(share, 0.0, 1.0), 0.0)
    moved: dict[str, F64] = {}
    for name, column in values.items():
        change = column[after] - column[before]
        if name == "heading":
            change -= np.round(change / math.tau) * math.tau
        # Rows of the table at whole frames keep their values to the last digit.
        moved[name] = np.where(share == 1.0, column[after], column[before] + share * change)
    return Grid(
        owner=track[low],
        start=grid_start,
        frame=frame.astype(np.int64),
        nearest=np.where(share < 0.5, before, after),
        values=moved,
        is_moved=is_moved,
    )


def track_names(vehicle_names: NDArray[np.object_], vehicle: I64) -> NDArray[np.object_]:
    """Name of each track: that of its vehicle, then `NAME (2)` for its second track, and so on.

    Args:
        vehicle_names: Name of each vehicle.
        vehicle: Index of the vehicle of each track, shape (track,); tracks of a vehicle are in
            order of time.
    """
    names = vehicle_names[vehicle].copy()
    taken = set(names.tolist())
    num_tracks: Counter[int] = Counter()
    for track, place in enumerate(vehicle.tolist()):
        num_tracks[place] += 1
        if num_tracks[place] == 1:
            continue
        # A file may have a vehicle of the name "12 (2)".
        while (name := f"{vehicle_names[place]} ({num_tracks[place]})") in taken:
            num_tracks[place] += 1
        names[track] = name
        taken.add(name)
    return names
