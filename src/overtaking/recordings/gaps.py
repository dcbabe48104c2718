"""Gaps in tracks: short ones are interpolated; after a long one a new track begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.messages import refused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask

MAX_GAP_S = 0.5
"""Longest time between two rows that is interpolated [s]. In its middle, linear interpolation of a
vehicle that brakes at 3 m/s² is off by 3 * 0.5**2 / 8 = 0.1 m."""

MAX_OWN_INTERVAL_S = 1.0
"""Longest regular time between the rows of one vehicle [s]; a recording has the same limit
(`frame_times.FRAME_INTERVAL_RANGE_MS`)."""

ONE_FRAME = 1.5
"""Rows less than this apart are in adjacent frames [frames]; the half frame allows for jitter."""

_MAX_SPLIT_SHARE = 0.5  # With a larger share of split vehicles, the frame interval is wrong.
_MIN_PIECE_S = 1.0  # Shorter pieces of tracks contain no manoeuvre [s].
_ROUNDING = 1e-6  # A gap of exactly the longest time stays short in floating point [frames].


def is_long_gap(vehicle: I64, frame_time: F64, interval_ms: float) -> Mask:
    """Whether a long gap precedes each row but the first, shape (row - 1,).

    The rows of a vehicle may be regularly more than `MAX_GAP_S` apart, up to `MAX_OWN_INTERVAL_S`.
    Such a vehicle has a frame rate of its own; its gaps are measured in its own intervals.

    Args:
        vehicle: Index of the vehicle of each row, ascending, shape (row,).
        frame_time: Instant of each row, ascending within a vehicle, same shape [frames].
        interval_ms: Time between frames [ms].
    """
    step = np.diff(frame_time)
    is_same = np.diff(vehicle) == 0
    is_long = is_same & (step > max(ONE_FRAME, MAX_GAP_S * 1000.0 / interval_ms + _ROUNDING))
    owners, count = np.unique(vehicle[1:][is_long], return_counts=True)
    longest = MAX_OWN_INTERVAL_S * 1000.0 / interval_ms + _ROUNDING
    for owner in owners[count > 1].tolist():  # One long gap is not regular.
        low, high = np.searchsorted(vehicle, [owner, owner + 1])
        steps = step[low : high - 1]
        own_interval = float(np.median(steps))
        if own_interval <= longest:
            is_long[low : high - 1] &= steps > ONE_FRAME * own_interval
    return is_long


def gap_findings(
    track: I64,
    frame_time: F64,
    seconds: F64,
    *,
    interval_ms: int,
    track_names: NDArray[np.object_],
    track_vehicle: I64,
    num_faulty: I64,
) -> list[Finding]:
    """Report the gaps of a recording.

    Args:
        track: Index of the track of each row, ascending, shape (row,).
        frame_time: Instant of each row, ascending within a track, same shape [frames].
        seconds: Time of each row as the file counts, same shape [s].
        interval_ms: Time between frames [ms].
        track_names: Name of each track, shape (track,).
        track_vehicle: Vehicle of each track, same shape.
        num_faulty: Number of faulty rows that were left out before each row but the first, shape
            (row - 1,). They do not count as missing: `motion_findings` reports them.

    Returns:
        One finding for each track with interpolated gaps, and one for each track that continues
        another.
    """
    step, is_same = np.diff(frame_time), np.diff(track) == 0
    step = step - num_faulty
    findings: list[Finding] = []
    before_gap = np.flatnonzero(is_same & (step > ONE_FRAME))
    owners, first = np.unique(track[before_gap], return_index=True)
    for owner, gaps in zip(owners.tolist(), np.split(before_gap, first)[1:], strict=True):
        low, high = np.searchsorted(track, [owner, owner + 1])
        num_missing = int((np.rint(step[gaps]) - 1.0).sum())
        own_interval = float(np.median(step[low : high - 1])) * interval_ms * 1e-3
        is_slow = 2 * len(gaps) > high - low - 1  # Most steps are gaps: a frame rate of its own.
        longest = float(step[gaps].max()) * interval_ms * 1e-3
        detail = (
            f"a row every {own_interval:.3g} s, where the recording has one every "
            f"{interval_ms * 1e-3:.3g} s; states between them are interpolated linearly"
            if is_slow
            else f"{num_missing} rows missing in {len(gaps)} gaps of up to {longest:.3g} s are "
            "interpolated linearly"
        )
        findings.append(
            Finding(
                check=Check.FRAME_RATE if is_slow else Check.GAPS,
                consequence=Consequence.CORRECTED,
                detail=detail,
                rows=num_missing,
                vehicle=str(track_names[owner]),
                first_time_s=float(seconds[gaps[0]]) + interval_ms * 1e-3,
            )
        )
    return findings + _split_findings(
        track, frame_time, seconds, interval_ms, track_names, track_vehicle
    )


def _split_findings(
    track: I64,
    frame_time: F64,
    seconds: F64,
    interval_ms: int,
    track_names: NDArray[np.object_],
    track_vehicle: I64,
) -> list[Finding]:
    """Report each track that continues another; arguments as in `gap_findings`."""
    start = np.searchsorted(track, np.arange(len(track_vehicle) + 1))
    findings: list[Finding] = []
    for later in (np.flatnonzero(np.diff(track_vehicle) == 0) + 1).tolist():
        row = int(start[later])
        elapsed = float(frame_time[row] - frame_time[row - 1]) * interval_ms * 1e-3
        reason = (
            f"no row for {elapsed:.3g} s"
            if elapsed * 1000.0 > ONE_FRAME * interval_ms
            else "a jump that no vehicle makes"
        )
        detail = f"{reason}; the rows after it are the track {track_names[later]}"
        findings.append(
            Finding(
                check=Check.GAPS,
                consequence=Consequence.REPORTED,
                detail=detail,
                rows=int(start[later + 1] - row),
                vehicle=str(track_names[later - 1]),
                first_time_s=float(seconds[row - 1]) + interval_ms * 1e-3,
            )
        )
    return findings


def check_pieces(file_name: str, start: I64, track_vehicle: I64, interval_ms: int) -> None:
    """Refuse a recording in which most vehicles are split into short pieces.

    Args:
        file_name: Name of the file in messages.
        start: First row of each track, then the number of rows, shape (track + 1,).
        track_vehicle: Vehicle of each track, shape (track,).
        interval_ms: Time between frames [ms].

    Raises:
        ImportFormatError: Most vehicles are split, and most of their pieces are shorter than
            `_MIN_PIECE_S`.
    """
    vehicles, num_pieces = np.unique(track_vehicle, return_counts=True)
    is_split = num_pieces > 1
    if not is_split.any() or is_split.sum() <= _MAX_SPLIT_SHARE * len(vehicles):
        return
    is_piece = np.isin(track_vehicle, vehicles[is_split])
    typical_s = float(np.median(np.diff(start)[is_piece])) * interval_ms * 1e-3
    if typical_s >= _MIN_PIECE_S:
        return
    raise refused(
        file_name,
        "frame rate",
        f"rows of most vehicles every {interval_ms * 1e-3:g} s, the most frequent time between two "
        "rows",
        f"gaps of more than {MAX_GAP_S:g} s that split {int(is_split.sum())} of {len(vehicles)} "
        f"vehicles into pieces of {typical_s:.2g} s",
        "write a row for each vehicle and frame, or check the column of times",
    )
