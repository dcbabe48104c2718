"""The states of a recording in SI units by vehicle and frame, and how they come to whole frames."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, U8, Mask
    from overtaking.recordings.findings import Finding

ON_GRID = 1e-3
"""Instants this near a frame are that frame's: 3 mm at 30 m/s and 10 frames a second [frames]."""

TORN = 1.5
"""A longer time between two rows of a vehicle is a gap that begins a new track [frames]."""


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
        direction: Number of the carriageway, same shape; None where none is given.
        start: First row of each vehicle, and the number of rows, shape (vehicle + 1,).
        frame: Of each row, without gaps in a vehicle, shape (row,).
        frame_interval_ms: Time between frames [ms].
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
    direction: I64 | None
    start: I64
    frame: I64
    frame_interval_ms: int
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
    """Rows at whole frames; a vehicle that was away is another track.

    Attributes:
        owner: Vehicle of each track, shape (track,).
        start: First row of each track, and the number of rows, shape (track + 1,).
        frame: Shape (row,).
        nearest: Row of the table that is nearest in time, same shape.
        values: Same shape.
        is_moved: Whether states are interpolated.
    """

    owner: I64
    start: I64
    frame: I64
    nearest: I64
    values: dict[str, F64]
    is_moved: bool


def at_whole_frames(vehicle: I64, moment: F64, values: dict[str, F64]) -> Grid:
    """States at whole frames.

    Args:
        vehicle: Place of each row's vehicle, growing, shape (row,).
        moment: Instant in frames, growing within a vehicle, same shape.
        values: What is interpolated, same shape.
    """
    torn = (np.diff(vehicle) != 0) | (np.diff(moment) > TORN)
    begin = np.append(0, np.flatnonzero(torn) + 1)
    frame = np.rint(moment)
    if (np.abs(moment - frame) <= ON_GRID).all():
        start = np.append(begin, len(moment)).astype(np.int64)
        rows = np.arange(len(moment))
        return Grid(
            owner=vehicle[begin],
            start=start,
            frame=frame.astype(np.int64),
            nearest=rows,
            values=values,
            is_moved=False,
        )
    return _interpolated(vehicle, moment, values, np.append(begin, len(moment)))


def _interpolated(vehicle: I64, moment: F64, values: dict[str, F64], ends: I64) -> Grid:
    """States at whole frames, linearly between those of the table."""
    tracks: list[tuple[int, F64, I64]] = []
    moved: dict[str, list[F64]] = {name: [] for name in values}
    for low, high in pairwise(ends.tolist()):
        when = moment[low:high]
        at = np.arange(np.ceil(when[0] - ON_GRID), np.floor(when[-1] + ON_GRID) + 1.0)
        if not len(at):
            continue
        after = np.clip(np.searchsorted(when, at), 1 if high - low > 1 else 0, high - low - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(at - when[before] < when[after] - at, before, after)
        tracks.append((int(vehicle[low]), at, low + nearest))
        for name, column in values.items():
            piece = column[low:high]
            moved[name].append(
                np.interp(at, when, np.unwrap(piece) if name == "heading" else piece)
            )
    count = [len(at) for _, at, _ in tracks]
    return Grid(
        owner=np.array([owner for owner, _, _ in tracks], np.int64),
        start=np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
        frame=np.concatenate([at for _, at, _ in tracks]).astype(np.int64),
        nearest=np.concatenate([row for _, _, row in tracks]),
        values={name: np.concatenate(parts) for name, parts in moved.items()},
        is_moved=True,
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
