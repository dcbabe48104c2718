"""Instants of the rows of a table: clocks that start again, order in the file, frame interval."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.rows import ON_GRID
from overtaking.recordings.table_errors import refused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask

FRAME_INTERVAL_RANGE_MS = (10.0, 1000.0)
"""Least and most time between two frames [ms]."""

CLOCK_PERIODS = (86_400.0, 3_600.0)
"""Times after which a clock starts again: a day and an hour [s]."""

MAX_BACKWARD_SHARE = 0.01
"""Share of a vehicle's steps in file order that may go backwards to count as a fault. With more of
them, the file is in another order than that of time."""

_MAX_FRAMES = 10_000_000
_WRAP_MARGIN = 2.0  # Two states at least lie within this time of a wrap [s].
_MAX_VEHICLE_SPEED = 70.0  # Faster than any vehicle on a road [m/s].
_MAX_STRIDE = 100  # At 100 frames a second, 1 s: the longest time between frames.
_SAME_TIME = 1e-6  # Instants nearer to each other are one [s].


class RowOrder(NamedTuple):
    """Rows by vehicle and time.

    Attributes:
        order: Index of each row in the file, shape (row,).
        findings: Vehicles of which a few rows go back in time.
    """

    order: I64
    findings: list[Finding]


def undo_clock_wraps(
    seconds: F64, vehicle: I64, x: F64, y: F64, column: str
) -> tuple[F64, list[Finding]]:
    """Times that grow on when a clock of the day or of the hour starts again.

    A clock starts again if a vehicle moves on from the last to the first seconds of a period. In a
    file in order of time, each wrap is undone; in another one, a single wrap is, if there is a
    time at which nothing was recorded.

    Args:
        seconds: Time of each row, shape (row,) [s].
        vehicle: Index of the vehicle of each row, same shape.
        x: Position, same shape [m].
        y: Position, same shape [m].
        column: The column of times, for messages.

    Returns:
        The times, and what was found.
    """
    earliest, latest = float(seconds.min()), float(seconds.max())
    for period in CLOCK_PERIODS:
        if not (0.0 <= earliest < _WRAP_MARGIN and period - _WRAP_MARGIN < latest <= period):
            continue
        if not _moves_past(seconds, vehicle, x, y, period):
            continue
        wraps = _wraps_of_rows(seconds, period)
        hours = f"{period / 3600.0:g} h"
        if wraps is None:
            detail = (
                f"column {column}: the clock starts again after {hours}, but neither the order of "
                "rows nor a pause shows how often"
            )
            return seconds, [_time_finding(Consequence.REPORTED, detail, seconds, wraps)]
        detail = f"column {column}: the clock starts again after {hours}; later times are {hours} "
        detail += "later" if wraps.max() == 1 else f"later for each of {wraps.max()} times"
        finding = _time_finding(Consequence.CORRECTED, detail, seconds, wraps)
        return seconds + wraps * period, [finding]
    return seconds, []


def _time_finding(
    consequence: Consequence, detail: str, seconds: F64, wraps: I64 | None
) -> Finding:
    """The finding for a clock that starts again."""
    is_later = np.ones(len(seconds), np.bool_) if wraps is None else wraps > 0
    return Finding(
        check=Check.TIME,
        consequence=consequence,
        detail=detail,
        rows=int(is_later.sum()),
        first_time_s=float(seconds[is_later].min()),
    )


def _moves_past(seconds: F64, vehicle: I64, x: F64, y: F64, period: float) -> bool:
    """Whether a vehicle moves on from the end of a period to its beginning."""
    early = np.flatnonzero(seconds <= _WRAP_MARGIN)
    late = np.flatnonzero(seconds >= period - _WRAP_MARGIN)
    early = early[np.lexsort((seconds[early], vehicle[early]))]
    late = late[np.lexsort((-seconds[late], vehicle[late]))]
    vehicles, first_early = np.unique(vehicle[early], return_index=True)
    others, last_late = np.unique(vehicle[late], return_index=True)
    _, places, other_places = np.intersect1d(vehicles, others, return_indices=True)
    before, after = late[last_late[other_places]], early[first_early[places]]
    elapsed = seconds[after] + period - seconds[before]
    way = np.hypot(x[after] - x[before], y[after] - y[before])
    return bool(((way <= _MAX_VEHICLE_SPEED * elapsed) & (elapsed > 0.0)).any())


def _wraps_of_rows(seconds: F64, period: float) -> I64 | None:
    """Number of wraps before each row, shape (row,); None if it is not clear."""
    steps = np.diff(seconds)
    is_wrap = steps < _WRAP_MARGIN - period
    others = steps[~is_wrap]
    is_in_order = (others >= 0.0) & (others < 0.5 * period)
    if is_wrap.any() and is_in_order.all():
        return np.append(0, np.cumsum(is_wrap))
    times = np.sort(seconds)
    pauses = np.diff(times)
    longest = int(np.argmax(pauses))
    if pauses[longest] < 2.0 * _WRAP_MARGIN:
        return None
    return (seconds <= times[longest]).astype(np.int64)


def order_rows(
    seconds: F64, vehicle: I64, is_incomplete: Mask, names: NDArray[np.object_], column: str
) -> RowOrder:
    """Rows by vehicle, then time; of one time, complete rows come first.

    Args:
        seconds: Time of each row in the order of the file, shape (row,) [s].
        vehicle: Index of the vehicle of each row, same shape.
        is_incomplete: Whether a quantity is missing in each row, same shape.
        names: Name of each vehicle.
        column: The column of times, for messages.
    """
    # NumPy sorts small integers in linear time.
    key = vehicle.astype(np.int16) if len(names) < 2**15 else vehicle
    order = np.argsort(key, kind="stable")
    steps = np.diff(seconds[order])
    is_same = np.diff(vehicle[order]) == 0
    if (steps[is_same] > _SAME_TIME).all():
        return RowOrder(order, [])
    findings: list[Finding] = []
    backward = np.flatnonzero(is_same & (steps < -_SAME_TIME))
    if len(backward):
        num_steps = np.bincount(vehicle, minlength=len(names)) - 1
        owner = vehicle[order][backward]
        num_backward = np.bincount(owner, minlength=len(names))
        share = num_backward / np.maximum(num_steps, 1)
        for index in np.flatnonzero((num_backward > 0) & (share < MAX_BACKWARD_SHARE)).tolist():
            row = order[backward[np.argmax(owner == index)] + 1]
            count = int(num_backward[index])
            detail = f"column {column}: in {count} of {num_steps[index] + 1} rows time goes back"
            findings.append(
                Finding(
                    check=Check.TIME,
                    consequence=Consequence.REPORTED,
                    detail=f"{detail}; rows are read in order of time",
                    rows=count,
                    vehicle=str(names[index]),
                    first_time_s=float(seconds[row]),
                )
            )
    return RowOrder(np.lexsort((is_incomplete, seconds, vehicle)), findings)


def frame_interval_ms(file_name: str, column: str, seconds: F64, vehicle: I64) -> int:
    """Time between frames: the most frequent one between two rows of a vehicle, in whole ms.

    Args:
        file_name: Name of the table in messages.
        column: The column of times.
        seconds: Time of each row, in order of vehicle and time, shape (row,) [s].
        vehicle: Index of the vehicle of each row, same shape.

    Raises:
        ImportFormatError: It is none of a recording.
    """
    steps_ms = np.diff(seconds)[np.diff(vehicle) == 0] * 1000.0
    steps_ms = steps_ms[steps_ms > ON_GRID]
    interval = float(np.median(steps_ms)) if len(steps_ms) else 0.0
    longest = FRAME_INTERVAL_RANGE_MS[1]
    if interval <= longest:
        whole = np.rint(np.minimum(steps_ms, 2.0 * longest)).astype(np.int64)
        most_frequent = float(np.argmax(np.bincount(whole))) if len(whole) else 0.0
        # Instants that tremble or are rounded have a mean step that few steps have.
        is_near = np.abs(steps_ms - most_frequent) <= 0.2 * most_frequent + 1.0
        interval = float(np.median(steps_ms[is_near])) if is_near.any() else interval
    check_interval(file_name, column, interval)
    return round(interval)


def most_frequent_stride(frames: F64, vehicle: I64) -> int:
    """The most frequent step between the frames of two rows of a vehicle.

    Args:
        frames: Frame of each row, in order of vehicle and frame, shape (row,).
        vehicle: Index of the vehicle of each row, same shape.
    """
    steps = np.diff(frames)
    is_next = steps == 1.0
    if 2 * int(is_next.sum()) > len(steps):
        return 1
    steps = steps[(np.diff(vehicle) == 0) & (steps > 0.0) & (steps <= _MAX_STRIDE)]
    return int(np.argmax(np.bincount(steps.astype(np.int64)))) if len(steps) else 1


def check_interval(file_name: str, column: str, interval_ms: float) -> None:
    """Refuse a time between frames that is none of a recording [ms].

    Raises:
        ImportFormatError: It is too short or too long.
    """
    shortest, longest = FRAME_INTERVAL_RANGE_MS
    if not shortest <= interval_ms <= longest:
        raise refused(
            file_name,
            f"column {column}",
            f"{shortest:g} to {longest:g} ms between two states",
            f"{interval_ms:g} ms",
        )


def check_extent(file_name: str, column: str, frame_time: F64) -> None:
    """Refuse a recording of more frames than the reader takes.

    Raises:
        ImportFormatError: There are too many.
    """
    if np.ptp(frame_time) > _MAX_FRAMES:
        raise refused(
            file_name,
            f"column {column}",
            f"at most {_MAX_FRAMES:,} frames from the first to the last",
            f"{np.ptp(frame_time):,.0f} (choose a part: --only COLUMN=VALUE)",
        )
