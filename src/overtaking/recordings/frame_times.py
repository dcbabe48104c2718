"""Times of the rows of a table: clocks that start again, order of rows, time between frames."""

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
"""Backward steps in time, in the order of the file, are reported below this share of a vehicle's
steps. With a larger share, the file is not sorted by time, which is no fault."""

_MAX_FRAMES = 10_000_000  # About 28 h at 100 Hz.
_WRAP_MARGIN = 2.0  # At the longest time between frames, 1 s, this holds two states [s].
_MAX_VEHICLE_SPEED = 70.0  # 252 km/h; a larger one shows that the id has another vehicle [m/s].
_MAX_STRIDE = 100  # At the highest frame rate, 100 Hz, this is the longest time between frames.
_SAME_TIME = 1e-6  # Times that differ by less are equal but for rounding [s].


class RowOrder(NamedTuple):
    """The order of rows by vehicle and time.

    Attributes:
        order: Indices that sort the rows of the file, shape (row,).
        findings: One for each vehicle with a few backward steps in time.
    """

    order: I64
    findings: list[Finding]


def undo_clock_wraps(
    seconds: F64, vehicle: I64, x: F64, y: F64, column: str
) -> tuple[F64, list[Finding]]:
    """Make times continuous where a clock starts again after a day or an hour.

    A clock has started again if one vehicle is in the last and then in the first seconds of a
    period, at a distance that it can have driven. In a file that is sorted by time, all restarts
    are undone. In other files a single restart is, if a pause in the recording separates the times
    before and after it.

    Args:
        seconds: Time of each row, shape (row,) [s].
        vehicle: Index of the vehicle of each row, same shape.
        x: Position, same shape [m].
        y: Position, same shape [m].
        column: The column of times, for messages.

    Returns:
        The continuous times, shape (row,) [s], and at most one finding.
    """
    earliest, latest = float(seconds.min()), float(seconds.max())
    for period in CLOCK_PERIODS:
        if not (0.0 <= earliest < _WRAP_MARGIN and period - _WRAP_MARGIN < latest <= period):
            continue
        if not _continues_after_wrap(seconds, vehicle, x, y, period):
            continue
        wraps = _count_wraps(seconds, period)
        hours = f"{period / 3600.0:g} h"
        if wraps is None:
            detail = (
                f"column {column}: the clock starts again after {hours}, but neither the order of "
                "rows nor a pause shows how often; the times are unchanged"
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
    """The finding for a clock that starts again, about rows after a restart or all rows."""
    is_later = np.ones(len(seconds), np.bool_) if wraps is None else wraps > 0
    return Finding(
        check=Check.TIME,
        consequence=consequence,
        detail=detail,
        rows=int(is_later.sum()),
        first_time_s=float(seconds[is_later].min()),
    )


def _continues_after_wrap(seconds: F64, vehicle: I64, x: F64, y: F64, period: float) -> bool:
    """Whether a vehicle can have driven on from the end of a period to the beginning of the next.

    Its last position within `_WRAP_MARGIN` of the end is compared with its first one within the
    same time of the beginning.
    """
    early = np.flatnonzero(seconds <= _WRAP_MARGIN)
    late = np.flatnonzero(seconds >= period - _WRAP_MARGIN)
    early = early[np.lexsort((seconds[early], vehicle[early]))]
    late = late[np.lexsort((-seconds[late], vehicle[late]))]
    vehicles, first_early = np.unique(vehicle[early], return_index=True)
    others, last_late = np.unique(vehicle[late], return_index=True)
    _, places, other_places = np.intersect1d(vehicles, others, return_indices=True)
    before, after = late[last_late[other_places]], early[first_early[places]]
    elapsed = seconds[after] + period - seconds[before]
    distance = np.hypot(x[after] - x[before], y[after] - y[before])
    return bool(((distance <= _MAX_VEHICLE_SPEED * elapsed) & (elapsed > 0.0)).any())


def _count_wraps(seconds: F64, period: float) -> I64 | None:
    """Number of restarts of the clock before each row, shape (row,); None if it is not clear."""
    steps = np.diff(seconds)
    is_wrap = steps < _WRAP_MARGIN - period
    others = steps[~is_wrap]
    is_in_order = (others >= 0.0) & (others < 0.5 * period)
    if is_wrap.any() and is_in_order.all():
        return np.append(0, np.cumsum(is_wrap))
    # The rows are not sorted by time: the longest pause separates the late from the early period.
    times = np.sort(seconds)
    pauses = np.diff(times)
    longest = int(np.argmax(pauses))
    if pauses[longest] < 2.0 * _WRAP_MARGIN:
        return None
    return (seconds <= times[longest]).astype(np.int64)


def order_rows(
    seconds: F64, vehicle: I64, is_incomplete: Mask, names: NDArray[np.object_], column: str
) -> RowOrder:
    """Sort rows by vehicle, then time; among rows of one time, complete rows come first.

    Args:
        seconds: Time of each row in the order of the file, shape (row,) [s].
        vehicle: Index of the vehicle of each row, same shape.
        is_incomplete: Whether a quantity is missing in each row, same shape.
        names: Name of each vehicle, shape (vehicle,).
        column: The column of times, for messages.
    """
    # NumPy's stable sort of 16-bit integers is a radix sort, in linear time.
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
    """Time between frames: the most frequent time between two rows of a vehicle, in whole ms.

    Args:
        file_name: Name of the table in messages.
        column: The column of times.
        seconds: Time of each row, in order of vehicle and time, shape (row,) [s].
        vehicle: Index of the vehicle of each row, same shape.

    Raises:
        ImportFormatError: It is outside `FRAME_INTERVAL_RANGE_MS`.
    """
    steps_ms = np.diff(seconds)[np.diff(vehicle) == 0] * 1000.0
    steps_ms = steps_ms[steps_ms > ON_GRID]
    interval = float(np.median(steps_ms)) if len(steps_ms) else 0.0
    longest = FRAME_INTERVAL_RANGE_MS[1]
    if interval <= longest:
        whole = np.rint(np.minimum(steps_ms, 2.0 * longest)).astype(np.int64)
        most_frequent = float(np.argmax(np.bincount(whole))) if len(whole) else 0.0
        # With jitter or rounded times, steps spread around the interval: 33 and 34 ms at 30 Hz. The
        # median of the steps near the most frequent one is taken.
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
    if 2 * int(is_next.sum()) > len(steps):  # The usual case, without a count of all steps.
        return 1
    steps = steps[(np.diff(vehicle) == 0) & (steps > 0.0) & (steps <= _MAX_STRIDE)]
    return int(np.argmax(np.bincount(steps.astype(np.int64)))) if len(steps) else 1


def check_interval(file_name: str, column: str, interval_ms: float) -> None:
    """Refuse a time between frames outside `FRAME_INTERVAL_RANGE_MS`.

    Args:
        file_name: Name of the table in messages.
        column: The column of times or frames.
        interval_ms: Time between frames [ms].

    Raises:
        ImportFormatError: The time is too short or too long.
    """
    shortest, longest = FRAME_INTERVAL_RANGE_MS
    if not shortest <= interval_ms <= longest:
        raise refused(
            file_name,
            f"column {column}",
            f"{shortest:g} to {longest:g} ms between two states",
            f"{interval_ms:g} ms",
            "check the column of times and its unit in the map of columns, or the frame rate",
        )


def check_extent(file_name: str, column: str, frame_time: F64) -> None:
    """Refuse a recording of more than `_MAX_FRAMES` frames.

    Args:
        file_name: Name of the table in messages.
        column: The column of times or frames.
        frame_time: Time of each row, shape (row,) [frames].

    Raises:
        ImportFormatError: There are too many frames from the first to the last row.
    """
    if np.ptp(frame_time) > _MAX_FRAMES:
        raise refused(
            file_name,
            f"column {column}",
            f"at most {_MAX_FRAMES:,} frames from the first to the last",
            f"{np.ptp(frame_time):,.0f} (choose a part: --only COLUMN=VALUE)",
        )
