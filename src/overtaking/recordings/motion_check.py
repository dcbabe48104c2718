"""Positions that no vehicle can have reached: single rows or short runs of rows out of place.

A row is faulty if it lies away from the straight line through its neighbours in time, and if the
path jumps to it and back. The second condition tells a faulty row from a vehicle that brakes, turns
or collides: there the path bends, but every row lies on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.gaps import MAX_GAP_S, ONE_FRAME, is_long_gap

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask

    Complex = NDArray[np.complex128]

MAX_DEVIATION_ALONG = 1.0
"""Largest distance of a position from the line through its neighbours along the movement, beside
that of `MAX_ACCELERATION` [m]. Together they are 1.2 m at 5 Hz, where trackers of the MONA data set
are off by up to 1.15 m."""

MAX_DEVIATION_ACROSS = 0.5
"""The same across the movement [m]: positions of US-101 scatter by 0.21 m in their lanes, and a
faulty row must not reach the next lane, 1.5 m away for a car in the middle of its own."""

MAX_ACCELERATION = 10.0
"""Full braking on a dry road, and a margin for slopes [m/s^2]. With it a position deviates from the
line by half of it times the times to both neighbours."""

MAX_SPEED_CHANGE_AT_END = 20.0
"""At the end of a track a contact looks like a faulty row, up to this change of speed [m/s]."""

MAX_FAULTY_SHARE = 0.05
"""With a larger share of faulty rows, positions scatter, and the rows are kept."""

_MIN_RETURN = 0.5  # Least share of a jump to and from faulty rows that their neighbours show.
_MAX_END_BEND = 0.25  # Largest deviation beside a faulty first or last row, as a share of its own.
_MIN_CHORD = 1.0  # A shorter line has no reliable direction [m].
_BLOCK = 1 << 18  # Rows that are compared at a time, to keep memory small.


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultyRows:
    """Rows out of place, ascending.

    Attributes:
        row: Index of each, shape (faulty,).
        deviation: Its distance from the line through its neighbours, same shape [m].
        jump: First row after each jump to another path, shape (jump,).
        jump_size: Size of each, same shape [m].
        is_scattered: Whether so many rows deviate that none can be called faulty; then the arrays
            are empty.
    """

    row: I64
    deviation: F64
    jump: I64
    jump_size: F64
    is_scattered: bool = False

    @classmethod
    def none(cls, *, is_scattered: bool = False) -> FaultyRows:
        """No rows."""
        rows, sizes = np.empty(0, np.int64), np.empty(0, np.float64)
        return cls(row=rows, deviation=sizes, jump=rows, jump_size=sizes, is_scattered=is_scattered)

    def select(self, is_selected: Mask) -> FaultyRows:
        """Those at some rows.

        Args:
            is_selected: Which rows of the recording, shape (row,).
        """
        rows, jumps = is_selected[self.row], is_selected[self.jump]
        return replace(
            self,
            row=self.row[rows],
            deviation=self.deviation[rows],
            jump=self.jump[jumps],
            jump_size=self.jump_size[jumps],
        )


def find_faulty_rows(
    vehicle: I64, frame_time: F64, x: F64, y: F64, interval_ms: float
) -> FaultyRows:
    """Find positions that no vehicle can have reached.

    Args:
        vehicle: Index of the vehicle of each row, ascending, shape (row,).
        frame_time: Instant of each row, ascending within a vehicle, same shape [frames].
        x: Position, same shape [m].
        y: Position, same shape [m].
        interval_ms: Time between frames [ms].
    """
    bends = _bends(vehicle, frame_time, x, y, interval_ms)
    # A faulty row shows in three rows: its own and both neighbours.
    if len(bends) > 3.0 * MAX_FAULTY_SHARE * len(vehicle):
        return FaultyRows.none(is_scattered=True)
    rows: list[int] = []
    deviations: list[float] = []
    jumps: list[tuple[int, float]] = []
    if len(bends):
        is_end = (np.diff(vehicle) != 0) | is_long_gap(vehicle, frame_time, interval_ms)
        start = np.concatenate([[0], np.flatnonzero(is_end) + 1, [len(vehicle)]])
        pieces, first = np.unique(
            np.searchsorted(start, bends, side="right") - 1, return_index=True
        )
        for piece, of_piece in zip(pieces.tolist(), np.split(bends, first)[1:], strict=True):
            low, high = int(start[piece]), int(start[piece + 1])
            path = _Path.of(
                frame_time[low:high] * (interval_ms * 1e-3),
                x[low:high] + 1j * y[low:high],
                interval_ms * 1e-3,
            )
            away, jumped = path.find((of_piece - low).tolist())
            rows += [low + row for row in away]
            deviations += away.values()
            jumps += [(low + row, size) for row, size in jumped.items()]
    if len(rows) > MAX_FAULTY_SHARE * len(vehicle):
        return FaultyRows.none(is_scattered=True)
    return FaultyRows(
        row=np.array(rows, np.int64),
        deviation=np.array(deviations, np.float64),
        jump=np.array([row for row, _ in jumps], np.int64),
        jump_size=np.array([size for _, size in jumps], np.float64),
    )


def _bends(vehicle: I64, frame_time: F64, x: F64, y: F64, interval_ms: float) -> I64:
    """Rows that deviate by half the limit from the line through both neighbours, ascending.

    Beside a run of faulty rows, the first and the last of them deviate by half their distance.
    """
    blocks: list[I64] = []
    longest = max(MAX_GAP_S * 1000.0 / interval_ms, ONE_FRAME) + 1e-6
    for low in range(1, len(vehicle) - 1, _BLOCK):
        high = min(low + _BLOCK, len(vehicle) - 1)
        before, here, after = (slice(low + k, high + k) for k in (-1, 0, 1))
        earlier = frame_time[here] - frame_time[before]
        later = frame_time[after] - frame_time[here]
        share = earlier / np.maximum(earlier + later, 1e-9)
        off_x = x[here] - x[before] - share * (x[after] - x[before])
        off_y = y[here] - y[before] - share * (y[after] - y[before])
        limit = _limit(MAX_DEVIATION_ACROSS, earlier * later * (interval_ms * 1e-3) ** 2)
        is_bend = off_x * off_x + off_y * off_y > (0.5 * limit) ** 2
        rows = np.flatnonzero(is_bend)
        is_inside = (vehicle[rows + low - 1] == vehicle[rows + low + 1]) & (
            np.maximum(earlier[rows], later[rows]) <= longest
        )
        blocks.append(rows[is_inside] + low)
    return np.concatenate(blocks) if blocks else np.empty(0, np.int64)


def _limit(deviation: float, times: F64) -> F64:
    """Largest deviation [m], where `times` is the product of the times to both neighbours [s^2]."""
    return deviation + 0.5 * MAX_ACCELERATION * times


@dataclass(frozen=True, slots=True, kw_only=True)
class _Path:
    """The path of a vehicle without a long gap.

    Attributes:
        time: Shape (row,) [s].
        point: Positions as complex numbers, x + 1j * y, same shape [m].
        bend: Deviation from the line through both neighbours, 0 at the ends, same shape [m].
        interval: Time between frames [s].
    """

    time: F64
    point: Complex
    bend: Complex
    interval: float

    @classmethod
    def of(cls, time: F64, point: Complex, interval: float) -> _Path:
        """The path through points."""
        bend = np.zeros(len(point), np.complex128)
        share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
        bend[1:-1] = point[1:-1] - point[:-2] - share * (point[2:] - point[:-2])
        return cls(time=time, point=point, bend=bend, interval=interval)

    def find(self, bends: list[int]) -> tuple[dict[int, float], dict[int, float]]:
        """Faulty rows and jumps, with their distances.

        Args:
            bends: Rows of large deviation, where faulty rows may begin.
        """
        faulty: dict[int, float] = {}
        for first in bends:
            if first in faulty or first - 1 in faulty:
                continue
            last = first
            while last + 1 < len(self.time) and self._is_short(first, last):
                deviation = self._run(first, last)
                if deviation is not None:
                    distances = np.abs(deviation).tolist()
                    faulty |= dict(zip(range(first, last + 1), distances, strict=True))
                    break
                last += 1
        faulty |= self._ends(faulty)
        jumps: dict[int, float] = {}
        for row in bends:
            if not {row - 2, row - 1, row, row + 1} & faulty.keys() and row >= 2:
                size = self._jump(row)
                jumps |= {} if size is None else {row: size}
        return dict(sorted(faulty.items())), jumps

    def _is_short(self, first: int, last: int) -> bool:
        """Whether the gap without these rows is one that is interpolated."""
        elapsed = self.time[last + 1] - self.time[first - 1]
        return bool(elapsed <= max(MAX_GAP_S, 2.0 * self.interval) + 1e-6)

    def _run(self, first: int, last: int) -> Complex | None:
        """Deviations of rows that are faulty together, None if they are not."""
        time, point = self.time, self.point
        before, after = first - 1, last + 1
        earlier = time[first:after] - time[before]
        elapsed = time[after] - time[before]
        chord = point[after] - point[before]
        deviation = point[first:after] - point[before] - earlier / elapsed * chord
        if not self._is_beyond(deviation, earlier * (elapsed - earlier), before, after).all():
            return None
        returns = [
            self._returns(row, beside, towards, off)
            for row, beside, towards, off in (
                (before, before - 1, first, deviation[0]),
                (after, after + 1, last, deviation[-1]),
            )
            if 0 <= beside < len(time)
        ]
        return deviation if returns and all(returns) else None

    def _returns(self, row: int, beside: int, towards: int, deviation: complex) -> bool:
        """Whether a row beside faulty ones deviates to the other side, as far as they cause it."""
        near, far = (
            abs(self.time[towards] - self.time[row]),
            abs(self.time[beside] - self.time[row]),
        )
        caused = -deviation * far / (near + far)
        share = (self.bend[row] * caused.conjugate()).real / abs(caused) ** 2
        return bool(share >= _MIN_RETURN)

    def _is_beyond(self, deviation: Complex, times: F64, before: int, after: int) -> Mask:
        """Whether deviations exceed the limits along or across the movement, same shape."""
        along = np.abs(deviation) > _limit(MAX_DEVIATION_ALONG, times)
        direction = self._direction(before, after)
        if direction is None:
            return along
        turned = deviation * direction.conjugate()
        along = np.abs(turned.real) > _limit(MAX_DEVIATION_ALONG, times)
        return along | (np.abs(turned.imag) > _limit(MAX_DEVIATION_ACROSS, times))

    def _direction(self, before: int, after: int) -> complex | None:
        """Direction of the movement as a unit, None for a vehicle that stands."""
        wide = round(1.0 / self.interval)
        low, high = max(before - wide, 0), min(after + wide, len(self.point) - 1)
        for first, last in ((before, after), (low, high), (0, len(self.point) - 1)):
            chord = self.point[last] - self.point[first]
            if abs(chord) > _MIN_CHORD:
                return complex(chord / abs(chord))
        return None

    def _ends(self, faulty: dict[int, float]) -> dict[int, float]:
        """A faulty first or last row, by the line through the two rows beside it."""
        count = len(self.time)
        end_rows: dict[int, float] = {}
        for row, beside, third, fourth in (
            (0, 1, 2, 3),
            (count - 1, count - 2, count - 3, count - 4),
        ):
            if count < 4 or {beside, third, fourth} & faulty.keys():
                continue
            near = abs(self.time[beside] - self.time[row])
            far = abs(self.time[third] - self.time[beside])
            last_step = self.point[beside] - self.point[third]
            off = self.point[row] - self.point[beside] - last_step * (near / far)
            allowance = MAX_SPEED_CHANGE_AT_END * near
            size = max(abs(off) - allowance, 0.0) / max(abs(off), 1e-9) * off
            times = np.array([near * (near + far)])
            is_beyond = self._is_beyond(
                np.array([size]), times, min(beside, third), max(beside, third)
            )
            if is_beyond[0] and abs(self.bend[third]) < _MAX_END_BEND * abs(off):
                end_rows[row] = float(abs(off))
        return end_rows

    def _jump(self, row: int) -> float | None:
        """Size of a jump to another path between a row and the one before it [m]."""
        time, point = self.time, self.point
        if row + 1 >= len(time):
            return None
        step, before, after = (
            time[row] - time[row - 1],
            time[row - 1] - time[row - 2],
            (time[row + 1] - time[row]),
        )
        speed = (point[row - 1] - point[row - 2]) / before + (point[row + 1] - point[row]) / after
        jump = point[row] - point[row - 1] - 0.5 * speed * step
        if not self._is_beyond(np.array([jump]), np.array([step * step]), row - 1, row)[0]:
            return None
        caused_before = -jump * before / (before + step)
        caused_after = jump * after / (after + step)
        shares = [
            (self.bend[k] * caused.conjugate()).real / abs(caused) ** 2
            for k, caused in ((row - 1, caused_before), (row, caused_after))
        ]
        return float(abs(jump)) if min(shares) >= _MIN_RETURN else None


def motion_findings(
    faulty: FaultyRows,
    *,
    vehicle: I64,
    seconds: F64,
    names: NDArray[np.object_],
    consequence: Consequence = Consequence.LEFT_OUT,
) -> list[Finding]:
    """The faulty rows and the jumps of a recording, one finding for each vehicle.

    Args:
        faulty: The rows, as of `find_faulty_rows`.
        vehicle: Index of the vehicle of each row, ascending, shape (row,).
        seconds: Time of each row as the file counts, same shape [s].
        names: Name of each vehicle.
        consequence: What becomes of faulty rows.
    """
    if faulty.is_scattered:
        detail = (
            "positions scatter so much that faulty ones cannot be told from others; the values are "
            "unchanged"
        )
        return [
            Finding(
                check=Check.MOTION,
                consequence=Consequence.REPORTED,
                detail=detail,
                rows=len(vehicle),
            )
        ]
    left_out = (
        ", left out; states are interpolated linearly"
        if consequence is Consequence.LEFT_OUT
        else ""
    )
    findings: list[Finding] = []
    for rows, sizes, text, outcome in (
        (
            faulty.row,
            faulty.deviation,
            f"up to {{:.3g}} m off the line through the positions before and after{left_out}",
            consequence,
        ),
        (
            faulty.jump,
            faulty.jump_size,
            "a jump of {:.3g} m to another path; the values are unchanged",
            Consequence.REPORTED,
        ),
    ):
        owners, first = np.unique(vehicle[rows], return_index=True)
        parts = zip(np.split(rows, first)[1:], np.split(sizes, first)[1:], strict=True)
        for owner, (of_owner, distances) in zip(owners.tolist(), parts, strict=True):
            findings.append(
                Finding(
                    check=Check.MOTION,
                    consequence=outcome,
                    detail=text.format(distances.max()),
                    rows=len(of_owner),
                    vehicle=str(names[owner]),
                    first_time_s=float(seconds[of_owner[0]]),
                )
            )
    return findings
