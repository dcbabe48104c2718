"""The examination of states by vehicle and frame, for formats that are no tables."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from overtaking.recordings.findings import Consequence
from overtaking.recordings.gaps import check_pieces, gap_findings, is_long_gap
from overtaking.recordings.motion_check import find_faulty_rows, motion_findings
from overtaking.recordings.rows import at_whole_frames, track_names

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask
    from overtaking.recordings.findings import Finding


@dataclass(frozen=True, slots=True, kw_only=True)
class ExaminedStates:
    """Tracks without faulty rows and gaps.

    Attributes:
        names: Name of each track, shape (track,).
        vehicle: Vehicle of each track, same shape.
        first: First frame of each track, same shape.
        start: First row of each track, and the number of rows, shape (track + 1,).
        values: Quantities by name, shape (row,).
        findings: What was found.
    """

    names: NDArray[np.object_]
    vehicle: I64
    first: I64
    start: I64
    values: dict[str, F64]
    findings: tuple[Finding, ...]


def examine_states(
    vehicle: I64,
    frame_time: F64,
    values: dict[str, F64],
    *,
    names: NDArray[np.object_],
    interval_ms: int,
    file_name: str,
    seconds: F64 | None = None,
    motion_interval_ms: float | None = None,
    is_exempt: Mask | None = None,
    is_unchanged: Mask | None = None,
) -> ExaminedStates:
    """Leave out faulty rows, interpolate short gaps, and split tracks at long ones.

    Args:
        vehicle: Index of the vehicle of each row, ascending, shape (row,).
        frame_time: Whole frame of each row, ascending within a vehicle, same shape.
        values: Quantities by name, among them x and y [m], same shape.
        names: Name of each vehicle.
        interval_ms: Time between frames [ms].
        file_name: Name of the file in messages.
        seconds: Time of each row as the file counts, same shape [s]; by default that of its frame.
        motion_interval_ms: Time between frames in which the vehicles moved [ms], where the clock of
            the file is another.
        is_exempt: Rows that are never faulty, such as those of a contact, same shape.
        is_unchanged: Rows that are reported if they are faulty, and kept, same shape.

    Raises:
        ImportFormatError: Gaps split most of the vehicles into short pieces.
    """
    if seconds is None:
        seconds = frame_time * (interval_ms * 1e-3)
    faulty = find_faulty_rows(
        vehicle, frame_time, values["x"], values["y"], motion_interval_ms or interval_ms
    )
    if is_exempt is not None:
        faulty = faulty.select(~is_exempt)
    findings: list[Finding] = []
    if is_unchanged is not None:
        findings += motion_findings(
            faulty.select(is_unchanged),
            vehicle=vehicle,
            seconds=seconds,
            names=names,
            consequence=Consequence.REPORTED,
        )
        faulty = replace(faulty.select(~is_unchanged), is_scattered=False)
    findings += motion_findings(faulty, vehicle=vehicle, seconds=seconds, names=names)
    row = np.delete(np.arange(len(vehicle)), faulty.row)
    if len(faulty.row):
        vehicle, frame_time, seconds = vehicle[row], frame_time[row], seconds[row]
        values = {name: column[row] for name, column in values.items()}
    is_new = (np.diff(vehicle) != 0) | is_long_gap(vehicle, frame_time, interval_ms)
    track = np.append(0, np.cumsum(is_new))
    first_row = np.append(0, np.flatnonzero(is_new) + 1)
    track_vehicle = vehicle[first_row]
    check_pieces(file_name, np.append(first_row, len(track)), track_vehicle, interval_ms)
    track_name = track_names(names, track_vehicle)
    findings += gap_findings(
        track,
        frame_time,
        seconds,
        interval_ms=interval_ms,
        track_names=track_name,
        track_vehicle=track_vehicle,
        num_faulty=np.diff(np.searchsorted(faulty.row, row)),
    )
    grid = at_whole_frames(track, frame_time, values)
    return ExaminedStates(
        names=track_name[grid.owner],
        vehicle=track_vehicle[grid.owner],
        first=grid.frame[grid.start[:-1]],
        start=grid.start,
        values=grid.values,
        findings=tuple(findings),
    )
