"""Finds positions that no vehicle can have reached: single rows or short runs of rows.

A row is faulty if it deviates from the straight line through its neighbours in time, and if the
path jumps to it and back. The second condition excludes vehicles that brake, turn or collide: their
paths bend without a jump.
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
"""Largest deviation along the movement from the line through the neighbours [m], in addition to
the deviation that `MAX_ACCELERATION` allows. The sum is 1.2 m at 5 Hz; at this rate, positions of
the MONA data set deviate by up to 1.15 m."""

MAX_DEVIATION_ACROSS = 0.5
"""Largest deviation across the movement [m], in addition to the same allowance. Positions of US-101
scatter by 0.21 m in their lanes. An undetected fault must not move a car from the middle of its
lane into the next lane, 1.5 m away."""

MAX_ACCELERATION = 10.0
"""Full braking on a dry road with a margin for slopes [m/s^2]. A vehicle with the acceleration `a`
deviates by `a * t1 * t2 / 2` from the line, where `t1` and `t2` are the times to its neighbours."""

MAX_SPEED_CHANGE_AT_END = 20.0
"""Largest change of speed in a contact [m/s]. The first or last row of a track is faulty only
beyond this change, because no further row shows whether the path returns."""

MAX_FAULTY_SHARE = 0.05
"""With a larger share of faulty rows, the positions of the whole recording scatter, and no row is
called faulty."""

# A neighbour of a faulty row must show at least this share of the bend that the fault causes there.
_MIN_RETURN = 0.5
# Largest bend beside a faulty first or last row, as a share of the deviation of that row.
_MAX_END_BEND = 0.25
_MIN_CHORD = 1.0  # The direction of a shorter line is unreliable [m].
_BLOCK = 1 << 18  # Rows that are compared at a time, to keep memory small.


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultyRows:
    """Faulty rows and jumps of a recording, in ascending order.

    Attributes:
        row: Index of each faulty row, shape (faulty,).
        deviation: Distance of each from the line through its neighbours, same shape [m].
        jump: Index of the first row after each jump to another path, shape (jump,).
        jump_size: Length of each jump, same shape [m].
        is_scattered: Whether more rows deviate than `MAX_FAULTY_SHARE` allows; the arrays are
            empty then.
    """

    row: I64
    deviation: F64
    jump: I64
    jump_size: F64
    is_scattered: bool = False

    @classmethod
    def none(cls, *, is_scattered: bool = False) -> FaultyRows:
        """The result without any faulty row or jump."""
        rows, sizes = np.empty(0, np.int64), np.empty(0, np.float64)
        return cls(row=rows, deviation=sizes, jump=rows, jump_size=sizes, is_scattered=is_scattered)

    def select(self, is_selected: Mask) -> FaultyRows:
        """The faulty rows and jumps among some rows; indices stay those of the recording.

        Args:
            is_selected: Whether each row of the recording is selected, shape (row,).
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

    Returns:
        Indices of faulty rows and jumps; no row is faulty if more than `MAX_FAULTY_SHARE` are.
    """
    bends = _find_bends(vehicle, frame_time, x, y, interval_ms)
    # A faulty row bends the path at three rows: at itself and at both neighbours.
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
        for piece, piece_bends in zip(pieces.tolist(), np.split(bends, first)[1:], strict=True):
            low, high = int(start[piece]), int(start[piece + 1])
            path = _Path.of(
                frame_time[low:high] * (interval_ms * 1e-3),
                x[low:high] + 1j * y[low:high],
                interval_ms * 1e-3,
            )
            faulty_in_piece, jumps_in_piece = path.find((piece_bends - low).tolist())
            rows += [low + row for row in faulty_in_piece]
            deviations += faulty_in_piece.values()
            jumps += [(low + row, size) for row, size in jumps_in_piece.items()]
    if len(rows) > MAX_FAULTY_SHARE * len(vehicle):
        return FaultyRows.none(is_scattered=True)
    return FaultyRows(
        row=np.array(rows, np.int64),
        deviation=np.array(deviations, np.float64),
        jump=np.array([row for row, _ in jumps], np.int64),
        jump_size=np.array([size for _, size in jumps], np.float64),
    )


def _find_bends(vehicle: I64, frame_time: F64, x: F64, y: F64, interval_ms: float) -> I64:
    """Find rows that deviate by half the limit from the line through both neighbours, ascending.

    Half the limit, because in a run of faulty rows only one neighbour of the first and of the last
    row is in place: these rows deviate by half the distance of the run from the path.
    """
    blocks: list[I64] = []
    longest = max(MAX_GAP_S * 1000.0 / interval_ms, ONE_FRAME) + 1e-6
    for low in range(1, len(vehicle) - 1, _BLOCK):
        high = min(low + _BLOCK, len(vehicle) - 1)
        before, here, after = (slice(low + k, high + k) for k in (-1, 0, 1))
        earlier = frame_time[here] - frame_time[before]
        later = frame_time[after] - frame_time[here]
        share = earlier / np.maximum(earlier + later, 1e-9)
        deviation_x = x[here] - x[before] - share * (x[after] - x[before])
        deviation_y = y[here] - y[before] - share * (y[after] - y[before])
        limit = _limit(MAX_DEVIATION_ACROSS, earlier * later * (interval_ms * 1e-3) ** 2)
        is_bend = deviation_x * deviation_x + deviation_y * deviation_y > (0.5 * limit) ** 2
        rows = np.flatnonzero(is_bend)
        is_inside = (vehicle[rows + low - 1] == vehicle[rows + low + 1]) & (
            np.maximum(earlier[rows], later[rows]) <= longest
        )
        blocks.append(rows[is_inside] + low)
    return np.concatenate(blocks) if blocks else np.empty(0, np.int64)


def _limit(deviation: float, times: F64) -> F64:
    """Largest deviation that braking and errors of measurement explain [m].

    Args:
        deviation: `MAX_DEVIATION_ALONG` or `MAX_DEVIATION_ACROSS` [m].
        times: Product of the times to both neighbours, shape (row,) [s^2].
    """
    return deviation + 0.5 * MAX_ACCELERATION * times


@dataclass(frozen=True, slots=True, kw_only=True)
class _Path:
    """A stretch of a vehicle's path without a long gap.

    Attributes:
        time: Time of each row, shape (row,) [s].
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
        """The path through points, with its bends."""
        bend = np.zeros(len(point), np.complex128)
        share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
        bend[1:-1] = point[1:-1] - point[:-2] - share * (point[2:] - point[:-2])
        return cls(time=time, point=point, bend=bend, interval=interval)

    def find(self, bends: list[int]) -> tuple[dict[int, float], dict[int, float]]:
        """Find faulty rows and jumps.

        Args:
            bends: Rows at which the path bends, ascending; faulty rows may begin there.

        Returns:
            The deviation of each faulty row, and the length of each jump by the row after it [m].
        """
        faulty: dict[int, float] = {}
        for first in bends:
            if first in faulty or first - 1 in faulty:
                continue
            # The shortest run that is faulty counts: a longer one would contain good rows.
            last = first
            while last + 1 < len(self.time) and self._is_short(first, last):
                deviation = self._run_deviation(first, last)
                if deviation is not None:
                    distances = np.abs(deviation).tolist()
                    faulty |= dict(zip(range(first, last + 1), distances, strict=True))
                    break
                last += 1
        faulty |= self._end_deviations(faulty)
        jumps: dict[int, float] = {}
        for row in bends:
            # `_jump_size` compares the speeds before and after the jump, so all four rows count.
            if not {row - 2, row - 1, row, row + 1} & faulty.keys() and row >= 2:
                size = self._jump_size(row)
                jumps |= {} if size is None else {row: size}
        return dict(sorted(faulty.items())), jumps

    def _is_short(self, first: int, last: int) -> bool:
        """Whether the gap that the rows `first` to `last` would leave is short enough to fill.

        At low frame rates, the gap of a single row counts as short.
        """
        elapsed = self.time[last + 1] - self.time[first - 1]
        return bool(elapsed <= max(MAX_GAP_S, 2.0 * self.interval) + 1e-6)

    def _run_deviation(self, first: int, last: int) -> Complex | None:
        """Deviations of the rows `first` to `last` if they are one faulty run, else None [m]."""
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
        """Whether the path returns at a row beside a faulty run.

        A fault of size `deviation` in one neighbour bends a straight path at the row to the other
        side, by the share that linear interpolation between both neighbours gives.

        Args:
            row: The row beside the run.
            beside: Its neighbour on the side away from the run.
            towards: Its neighbour in the run.
            deviation: Deviation of that neighbour [m].
        """
        near = abs(self.time[towards] - self.time[row])
        far = abs(self.time[beside] - self.time[row])
        caused = -deviation * far / (near + far)
        share = (self.bend[row] * caused.conjugate()).real / abs(caused) ** 2
        return bool(share >= _MIN_RETURN)

    def _is_beyond(self, deviation: Complex, times: F64, before: int, after: int) -> Mask:
        """Whether deviations exceed the limits along or across the movement, shape of `deviation`.

        Args:
            deviation: Deviations from the line through the rows `before` and `after` [m].
            times: Products of the times to these rows, same shape [s^2].
            before: The last row before the deviations.
            after: The first row after them.
        """
        direction = self._direction(before, after)
        if direction is None:  # Without a direction, the larger limit holds.
            return np.abs(deviation) > _limit(MAX_DEVIATION_ALONG, times)
        turned = deviation * direction.conjugate()
        along = np.abs(turned.real) > _limit(MAX_DEVIATION_ALONG, times)
        return along | (np.abs(turned.imag) > _limit(MAX_DEVIATION_ACROSS, times))

    def _direction(self, before: int, after: int) -> complex | None:
        """Direction of the movement as a unit complex number, None for a vehicle that stands.

        The line through both rows decides; if it is short, a line that is 1 s longer on both sides,
        then that of the whole path.
        """
        rows_per_second = round(1.0 / self.interval)
        low, high = (
            max(before - rows_per_second, 0),
            min(after + rows_per_second, len(self.point) - 1),
        )
        for first, last in ((before, after), (low, high), (0, len(self.point) - 1)):
            chord = self.point[last] - self.point[first]
            if abs(chord) > _MIN_CHORD:
                return complex(chord / abs(chord))
        return None

    def _end_deviations(self, faulty: dict[int, float]) -> dict[int, float]:
        """Deviation of the first and of the last row if they are faulty [m].

        An end row has one neighbour, so the line through the next two rows is extended to it. The
        path may also bend there in a contact: the limit grows by `MAX_SPEED_CHANGE_AT_END`.
        """
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

    def _jump_size(self, row: int) -> float | None:
        """Length of the jump between the row before and this row [m]; None without a jump.

        The jump is the part of the step that the mean of the speeds before and after it does not
        explain. Both rows must show it as bends to opposite sides.
        """
        time, point = self.time, self.point
        if row + 1 >= len(time):
            return None
        step = time[row] - time[row - 1]
        before, after = time[row - 1] - time[row - 2], time[row + 1] - time[row]
        velocity_sum = (point[row - 1] - point[row - 2]) / before + (
            point[row + 1] - point[row]
        ) / after
        jump = point[row] - point[row - 1] - 0.5 * velocity_sum * step
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
    """Report the faulty rows and the jumps of a recording, one finding of each for each vehicle.

    Args:
        faulty: Result of `find_faulty_rows`.
        vehicle: Index of the vehicle of each row, ascending, shape (row,).
        seconds: Time of each row as the file counts, same shape [s].
        names: Name of each vehicle, shape (vehicle,).
        consequence: What the reader does with faulty rows.
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
        for owner, (owner_rows, distances) in zip(owners.tolist(), parts, strict=True):
            findings.append(
                Finding(
                    check=Check.MOTION,
                    consequence=outcome,
                    detail=text.format(distances.max()),
                    rows=len(owner_rows),
                    vehicle=str(names[owner]),
                    first_time_s=float(seconds[owner_rows[0]]),
                )
            )
    return findings
