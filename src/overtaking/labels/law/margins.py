"""Margins over frames: their minima, the frames of a breach, and findings from them.

A finding is the verdict of one rule on each simulation, with the margin, which is negative in a
breach. The ego is the vehicle under study, the target the vehicle that it overtakes. An event or
frame that does not exist is `NEVER` (-1).
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.arrays import F32, F64, I32, U8, IndexArray, Mask
from overtaking.core.native import simd_level
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    GAP_REGAIN_TIME,
    MAX_DECEL,
    MAX_FORCED_BRAKING,
    OBSTRUCTION_TIME,
    REACTION_TIME,
    RETURN_FREE_TIME,
    RETURN_RANGE,
    RETURN_TIME_GAP,
    RSS_ACCEL,
    RSS_LEADER_DECEL,
    RSS_REACTION_TIME,
    RSS_REAR_DECEL,
    STOPPING_REACTION_TIME,
)
from overtaking.labels.signals import (
    ArraysByName,
    contiguous_in_time,
    pack_signals,
    packed_recording,
)
from overtaking.labels.snapshots import FrameSpan
from overtaking.model.overtake_events import NEVER
from overtaking.model.verdicts import Belief, Case, Finding, Verdict

MIN_RATE_OF_CHANGE = np.float32(0.1)
"""Smallest rate of change of a gap or a lateral position in the error of an instant [m/s].

An instant, such as the end of a return, has the error of a position over its rate of change.
Without a bound this would be infinite for a vehicle that hardly moves. The value is a choice, less
than the lateral speed of a lane change; it limits the error of an instant to 10 s per metre of
error of a position.
"""

SAME_MARGIN_M = np.float32(1e-3)
"""Margins that differ by less are equal [m].

With it, errors and remedies find out which of several conditions gave the smallest margin. The
value is a choice, the resolution of recorded positions. On roads of some kilometres, rounding to
float32 changes margins by less.
"""


def finding_from_margins(
    applies: Mask,
    margin: F32,
    first: NDArray[np.integer],
    last: NDArray[np.integer],
    *,
    longest: NDArray[np.integer] | None = None,
    doubtful: Mask | None = None,
    belief: U8 | None = None,
) -> Finding:
    """Make a finding from margins; every array has shape (simulation,).

    Args:
        applies: Whether the rule applies to the simulation.
        margin: Margin, negative in a breach.
        first: First frame of the breach; ignored without a breach.
        last: Last frame of the breach; ignored without a breach.
        longest: Number of frames of the longest unbroken run of the breach; None for a breach
            without a break.
        doubtful: Whether an unknown input could turn a kept rule into a broken one. The verdict is
            then undecidable where the margin is 0 or more; a negative margin is a breach all the
            same.
        belief: `Belief` of the ego's driver when it decided to pull out or to return; ignored where
            the rule does not apply. None for a rule that judges no beliefs.
    """
    is_broken, is_decided = applies & (margin < 0), applies
    verdict = is_broken.view(np.uint8)  # Legal is 0, illegal 1.
    if longest is None:
        longest = last - first + 1
    if doubtful is not None:
        is_decided = applies & (is_broken | ~doubtful)
        verdict = np.where(is_decided, verdict, np.uint8(Verdict.UNDECIDABLE))
    return Finding(
        verdict=np.where(applies, verdict, np.uint8(Verdict.NOT_APPLICABLE)),
        # The sum makes a negative zero positive: it would look like a breach in tables, and its
        # other bits would change their hashes.
        margin=np.where(is_decided, margin, np.float32(0.0)) + np.float32(0.0),
        first_frame=np.where(is_broken, first, NEVER).astype(np.int32, copy=False),
        last_frame=np.where(is_broken, last, NEVER).astype(np.int32, copy=False),
        longest_run=np.where(is_broken, longest, 0).astype(np.int32, copy=False),
        # `judging` fills in the severity by the grade of the rule; a criterion whose breaches
        # differ in severity replaces it.
        severity=np.zeros(len(applies), np.uint8),
        belief=np.zeros(len(applies), np.uint8)
        if belief is None
        else np.where(applies, belief, np.uint8(Belief.NONE)),
    )


def finding_not_applicable(num_simulations: int) -> Finding:
    """Finding of a rule that applies to no simulation of a batch."""
    never = np.full(num_simulations, NEVER)
    margin = np.zeros(num_simulations, np.float32)
    return finding_from_margins(np.zeros(num_simulations, np.bool_), margin, never, never)


UNCONSTRAINED = np.float32(3.0e38)
"""Margin where a rule sets no limit: larger than any other, and finite in float32."""


def num_frames_in(case: Case, seconds: float | np.floating) -> int:
    """Number of frames in a duration, rounded to the nearest."""
    return round(float(seconds) * 1000.0 / case.signals.frame_interval_ms)


def num_frames_to_regain_gap(case: Case) -> int:
    """Number of frames in which a driver may restore a gap that another vehicle has taken."""
    return num_frames_in(case, GAP_REGAIN_TIME.f32)


@dataclass(frozen=True, slots=True, kw_only=True)
class MarginMinimum:
    """The minimum of a margin over a span; every array has shape (simulation,).

    Attributes:
        min_margin: Smallest margin, `UNCONSTRAINED` if no frame of the span counts. Undefined where
            the span is empty.
        first_frame: First frame with a negative margin, `NEVER` without one.
        last_frame: Last frame with a negative margin, `NEVER` without one.
        longest_run: Number of frames of the longest unbroken run with a negative margin.
    """

    min_margin: F32
    first_frame: I32
    last_frame: I32
    longest_run: I32

    def with_simulations(self, rows: IndexArray, replacement: "MarginMinimum") -> "MarginMinimum":
        """Replace the values of some simulations by the values of `replacement`."""
        arrays = {field.name: getattr(self, field.name).copy() for field in fields(self)}
        for name, values in arrays.items():
            values[rows] = getattr(replacement, name)
        return MarginMinimum(**arrays)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanResults:
    """Results of the compiled scan over spans; arrays have shape (simulation,).

    `judged_span`, `manoeuvre` and the other spans are functions of `labels.law.case`.

    Attributes:
        stop_lit: Distance at which the driver sees a lit vehicle minus the stopping distance, over
            `judged_span` [m].
        stop_unlit: Distance at which the driver sees an unlit obstacle minus the stopping distance,
            over `judged_span` [m].
        following: Gap to the leader minus the lawful gap, over `span_after_gap_recovery`. Frames in
            which the driver may still restore a gap after a cut-in do not count [m].
        forced_braking: Allowed braking minus the braking forced on the follower in the time after
            each change of lane, over `manoeuvre` [m/s^2].
        return_opportunity: First frame, `NEVER` without one, and number of frames of the longest
            run in `span_after_passing` in which the ego could have returned.
        entry_arrival: Frame in which the follower in the lane on the left reaches the station where
            the ego's rear was at the line crossing, `NEVER` if it does not.
        return_arrival: Frame in which the target reaches the station where the ego's rear was at
            the end of the return, `NEVER` if it does not.
        worst_measures: Worst measures over `judged_span` by name, 0 without a vehicle. The fields
            of `Encounter` with a prefix, such as `leader.gap` and `follower.gap`; `time_headway`,
            `picud`, `rss_margin` and `lawful_margin` to the leader; `num_close`, the number of
            frames below the lawful gap; `num_critical`, the number of frames with a critical time
            to collision; `shortfall`, the sum over these frames of the critical time to collision
            minus the actual one [s].
        recorded_sums: Sums of recorded integers over the frames up to a collision, by name, for
            means over a simulation without an attempt; 0 with an attempt. `frames` and
            `frames_with_leader` are numbers of frames. Sums over all these frames: `ego_speed`
            [mm/s], and `left_count`, the number of vehicles in the lane to the left of the ego.
            Sums over the frames with a leader: `target_speed`, the speed of the leader, and the
            absolute `speed_difference` [mm/s] and `distance` [mm] between ego and leader.
    """

    stop_lit: MarginMinimum
    stop_unlit: MarginMinimum
    following: MarginMinimum
    forced_braking: MarginMinimum
    return_opportunity: tuple[I32, I32]
    entry_arrival: I32
    return_arrival: I32
    worst_measures: dict[str, F32]
    recorded_sums: dict[str, NDArray[np.int64]]


def scan_spans(case: Case, spans: dict[str, FrameSpan]) -> ScanResults:
    """Scan spans of frames with the compiled engine.

    Args:
        case: The batch.
        spans: The spans to scan, by their names in the engine; `labels.law.case.scans` lists them.
    """
    # `_core.FIELD_NAMES` has the engine's names of the rows of each array, in order. `moments` are
    # attributes of `case.events`: frames of events, slot of the target and original lane.
    count, names = case.signals.num_simulations, _core.FIELD_NAMES
    ends = [end for name in names["spans"] for end in (spans[name].first, spans[name].last)]
    moments = [getattr(case.events, name) for name in names["moments"]]
    dtypes = {"measures": np.float32, "frames": np.int32, "sums": np.int64}
    outputs = {name: np.empty((len(names[name]), count), dtype) for name, dtype in dtypes.items()}
    _core.scan_spans(
        recording=packed_recording(case),
        signals=pack_signals(case.signals),
        spans=np.concatenate(ends, dtype=np.int32),
        moments=np.concatenate(moments, dtype=np.int32),
        law=_law_numbers(case),
        outputs=outputs,
        level=simd_level(),
    )
    results: dict[str, ArraysByName] = {
        name: dict(zip(names[name], rows, strict=True)) for name, rows in outputs.items()
    }
    frames, measures = results["frames"], results["measures"]
    minima = {
        name: MarginMinimum(
            min_margin=measures[name],
            first_frame=frames[f"{name}.first"],
            last_frame=frames[f"{name}.last"],
            longest_run=frames[f"{name}.longest"],
        )
        for name in ("stop_lit", "stop_unlit", "following", "braking")
    }
    return ScanResults(
        stop_lit=minima["stop_lit"],
        stop_unlit=minima["stop_unlit"],
        following=minima["following"],
        forced_braking=minima["braking"],
        return_opportunity=(
            frames["return_opportunity.first"],
            frames["return_opportunity.length"],
        ),
        entry_arrival=frames["entry.arrival"],
        return_arrival=frames["return.arrival"],
        worst_measures=measures,  # Contains the four minima as well, under their names.
        recorded_sums=results["sums"],
    )


_LAW_NUMBERS = {
    "decel_limit": MAX_DECEL,
    "reaction_time": REACTION_TIME,
    "stop_reaction_time": STOPPING_REACTION_TIME,
    "time_gap": RETURN_TIME_GAP,
    "free_time": RETURN_FREE_TIME,
    "return_range": RETURN_RANGE,
    "allowed_braking": ABRUPT_BRAKING,  # The limit of the margin `forced_braking`.
    "max_braking": MAX_FORCED_BRAKING,  # Larger forced braking counts as this.
    "rss_reaction_time": RSS_REACTION_TIME,
    "rss_accel": RSS_ACCEL,
    "rss_rear_decel": RSS_REAR_DECEL,
    "rss_leader_decel": RSS_LEADER_DECEL,
}
"""Numbers of `labels.law.numbers` that the scan reads, by the names of the engine."""

_OTHER_NUMBERS = {
    "friction_floor": "friction.table.floor",  # The smallest friction coefficient of a tyre.
    "picud_reaction_time": "event_detection.safety.picud_reaction_time",
    "picud_decel": "event_detection.safety.picud_decel",
    "critical_ttc": "event_detection.safety.critical_ttc",
}
"""Numbers of knowledge files that the scan reads, by the names of the engine."""


def _law_numbers(case: Case) -> dict[str, Any]:
    decel_per_friction = constant("friction.table.usable_share") * constant("model.nature.gravity")
    return {
        **{name: float(number.f32) for name, number in _LAW_NUMBERS.items()},
        **{name: float(constant(path)) for name, path in _OTHER_NUMBERS.items()},
        "decel_per_friction": float(decel_per_friction),
        "regain_frames": num_frames_to_regain_gap(case),
        "obstruction_frames": num_frames_in(case, OBSTRUCTION_TIME.f32),
    }


def reduce_span(reduction: np.ufunc, values: NDArray[Any], span: FrameSpan) -> NDArray[Any]:
    """Reduce the frames of a span by a ufunc, such as a minimum.

    Args:
        reduction: The ufunc.
        values: Shape (simulation, time).
        span: The frames.

    Returns:
        Shape (simulation,); undefined where the span is empty.
    """
    row_begin, is_nonempty = np.arange(len(values)) * values.shape[1], span.is_nonempty
    index = np.empty(2 * len(values), np.intp)
    index[::2] = row_begin + np.where(is_nonempty, span.first, 0)
    index[1::2] = row_begin + np.where(is_nonempty, span.last + 1, 1)
    flat = values.reshape(-1)
    # `reduceat` reduces from each index to the next: every second result belongs to a span. It
    # accepts no index beyond the array; from the last index it reduces to the end of the array.
    return reduction.reduceat(flat, index[index < flat.size])[::2]


def breach_frames_in(span: FrameSpan, rows: IndexArray, broken: Mask) -> tuple[I32, I32, I32]:
    """First frame, last frame and longest run of a breach within a span.

    Args:
        span: The judged frames.
        rows: Some simulations, in order.
        broken: Whether each frame is in breach, shape (row, time).

    Returns:
        As `breach_frames`.
    """
    row, frame = np.nonzero(span.mask(rows, broken.shape[1]) & broken)
    return breach_frames(rows[row], frame, len(span.first))


def breach_frames(
    rows: IndexArray, frames: IndexArray, num_simulations: int
) -> tuple[I32, I32, I32]:
    """First frame, last frame and longest run of the frames in breach.

    Args:
        rows: Simulation of each frame in breach, in order.
        frames: The frames in breach, in order within a simulation.
        num_simulations: Length of the results.

    Returns:
        First and last frame, `NEVER` without a breach, and the number of frames of the longest run
        of consecutive frames; each of shape (simulation,).
    """
    first = np.full(num_simulations, NEVER)
    last, longest = first.copy(), np.zeros(num_simulations, np.int32)
    # Of several values for one simulation, the last one written remains: so the first frames are
    # written in reverse order.
    first[rows[::-1]], last[rows] = frames[::-1], frames
    breaks = (np.diff(rows) != 0) | (np.diff(frames) != 1)
    # Without a frame in breach `np.append` still has one element, which the slice removes.
    begins = np.flatnonzero(np.append(True, breaks)[: rows.size])
    np.maximum.at(longest, rows[begins], np.diff(np.append(begins, rows.size)))
    return first, last, longest


def minimum_over(margin: F32, span: FrameSpan) -> MarginMinimum:
    """Minimum of a margin over a span.

    Args:
        margin: Shape (simulation, time); `UNCONSTRAINED` in frames that the rule does not judge.
        span: The frames.
    """
    low = reduce_span(np.minimum, margin, span)
    rows = np.flatnonzero(span.is_nonempty & (low < 0))
    first, last, longest = breach_frames_in(span, rows, margin[rows] < 0)
    return MarginMinimum(min_margin=low, first_frame=first, last_frame=last, longest_run=longest)


def minimum_to_limit(
    signal: F32, limit: F32 | np.float32, span: FrameSpan, *, is_most: bool
) -> MarginMinimum:
    """`minimum_over` of the margin between a signal and its limit, by the compiled engine.

    Args:
        signal: Shape (simulation, time).
        limit: Limit in each frame, shape (simulation, time), in each simulation, shape
            (simulation,), or one for all.
        span: The judged frames.
        is_most: Whether the limit is the largest lawful value; otherwise it is the smallest one.
    """
    if limit.ndim == signal.ndim:
        signal, limit = signal - limit, np.float32(0.0)
    count = len(signal)
    low, frames = np.empty(count, np.float32), np.empty((3, count), np.int32)
    _core.limit_margins(
        signal=contiguous_in_time(signal),
        span=span.packed_ends,
        limit=np.full(count, limit, np.float32),
        is_maximum=is_most,
        min_margin=low,
        frames=frames,
        level=simd_level(),
    )
    first, last, longest = frames
    return MarginMinimum(min_margin=low, first_frame=first, last_frame=last, longest_run=longest)


def margins_within_span(span: FrameSpan, margins: NDArray[np.floating]) -> F64:
    """Margins within a span for a chart, shape (time,), NaN outside.

    A chart shows one simulation.

    Args:
        span: The judged frames, of one simulation.
        margins: Shape (1, time).
    """
    frame = np.arange(margins.shape[1])
    is_in_span = (frame >= span.first[0]) & (frame <= span.last[0])
    return np.where(is_in_span, margins[0], np.nan).astype(np.float64)


def flags_any_and_all(values: U8, span: FrameSpan) -> tuple[U8, U8]:
    """Bits that are set in any frame of a span, and bits that are set in all frames.

    Args:
        values: Shape (simulation, time).
        span: The frames. In an empty span no bit is set in any frame, and all bits in all frames.

    Returns:
        Each of shape (simulation,).
    """
    out = np.empty((2, len(values)), np.uint8)
    _core.flag_bits(values=contiguous_in_time(values), span=span.packed_ends, out=out)
    return out[0], out[1]


def finding_of_minimum(
    minimum: MarginMinimum, span: FrameSpan, *, belief: U8 | None = None
) -> Finding:
    """Finding from the smallest margin over a span.

    Args:
        minimum: Minimum of the margin over the span.
        span: The judged frames. The rule applies where the margin of any frame is constrained.
        belief: `Belief` of each simulation, for a rule that judges beliefs.
    """
    applies = span.is_nonempty & (minimum.min_margin < UNCONSTRAINED)
    return finding_from_margins(
        applies,
        minimum.min_margin,
        minimum.first_frame,
        minimum.last_frame,
        longest=minimum.longest_run,
        belief=belief,
    )


def finding_over_span(margin: F32, span: FrameSpan) -> Finding:
    """`finding_of_minimum` of a margin (simulation, time), as `minimum_over` takes it."""
    return finding_of_minimum(minimum_over(margin, span), span)


def finding_at_instants(
    margin: F32, rows: IndexArray, frames: IndexArray, num_simulations: int
) -> Finding:
    """Finding from the smallest margin over listed instants.

    The rule applies to the simulations that have an instant with a constrained margin.

    Args:
        margin: Margin at each instant, shape (instant,).
        rows: Simulation of each instant, in order.
        frames: Frame of each instant, in order within a simulation.
        num_simulations: Length of the results.
    """
    low = np.full(num_simulations, UNCONSTRAINED)
    if rows.size:
        begins = np.append(0, np.flatnonzero(rows[1:] != rows[:-1]) + 1)
        low[rows[begins]] = np.minimum.reduceat(margin, begins)
    broken = margin < 0
    first, last, longest = breach_frames(rows[broken], frames[broken], num_simulations)
    return finding_from_margins(low < UNCONSTRAINED, low, first, last, longest=longest)


def finding_at_frame(
    frame: I32,
    margin: F32,
    applies: Mask,
    *,
    doubtful: Mask | None = None,
    belief: U8 | None = None,
) -> Finding:
    """Finding from a margin at one frame of each simulation.

    Args:
        frame: The frame, `NEVER` where the rule does not apply, shape (simulation,).
        margin: Margin at that frame, same shape.
        applies: Whether the rule applies, same shape.
        doubtful: As in `finding_from_margins`.
        belief: As in `finding_from_margins`.
    """
    applies = applies & (frame != NEVER)
    return finding_from_margins(applies, margin, frame, frame, doubtful=doubtful, belief=belief)
