"""Margins over frames: their minima, the frames of a breach, and findings from them."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.native import simd_level
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.signals import Arrays, adjacent, pack_seen, packed
from overtaking.labels.snapshots import Span
from overtaking.model.overtake_events import NEVER
from overtaking.model.verdicts import Belief, Case, Finding, Verdict

MIN_RATE_OF_CHANGE = np.float32(0.1)
"""A slower change of a gap or a lateral position counts as this fast in errors [m/s].

The error of an instant is that of a position over this rate: without a bound it would be infinite
for a vehicle that hardly moves.
"""

SAME_MARGIN_M = np.float32(1e-3)
"""Margins that differ by less are equal [m]."""


def decided(
    applies: Mask,
    margin: F32,
    first: NDArray[np.integer],
    last: NDArray[np.integer],
    *,
    longest: NDArray[np.integer] | None = None,
    doubtful: Mask | None = None,
    belief: U8 | None = None,
) -> Finding:
    """A check from margins.

    Args:
        applies: Whether the rule is about this simulation at all, shape (simulation,).
        margin: Negative in a breach, same shape.
        first: First frame of the breach, read where there is one.
        last: Last frame of the breach.
        longest: Number of frames of its longest unbroken part; None if it has no break.
        doubtful: Whether what is unknown could still break the rule.
        belief: `Belief`, read where the rule applies.
    """
    broken, known = applies & (margin < 0), applies
    decision = broken.view(np.uint8)  # Legal is 0, illegal 1.
    if longest is None:
        longest = last - first + 1
    if doubtful is not None:
        known = applies & (broken | ~doubtful)
        decision = np.where(known, decision, np.uint8(Verdict.UNDECIDABLE))
    return Finding(
        verdict=np.where(applies, decision, np.uint8(Verdict.NOT_APPLICABLE)),
        # The sum makes a negative zero positive.
        margin=np.where(known, margin, np.float32(0.0)) + np.float32(0.0),
        first_frame=np.where(broken, first, NEVER).astype(np.int32, copy=False),
        last_frame=np.where(broken, last, NEVER).astype(np.int32, copy=False),
        longest_run=np.where(broken, longest, 0).astype(np.int32, copy=False),
        severity=np.zeros(len(applies), np.uint8),
        belief=np.zeros(len(applies), np.uint8)
        if belief is None
        else np.where(applies, belief, np.uint8(Belief.NONE)),
    )


def inapplicable(num_simulations: int) -> Finding:
    """The check of a rule that says nothing of any simulation."""
    never = np.full(num_simulations, NEVER)
    nothing = np.zeros(num_simulations, np.float32)
    return decided(np.zeros(num_simulations, np.bool_), nothing, never, never)


ENDLESS = np.float32(3.0e38)
"""Larger than any margin."""


def frames_of(case: Case, seconds: float | np.floating) -> int:
    """Number of frames in a duration, the nearest."""
    return round(float(seconds) * 1000.0 / case.signals.frame_interval_ms)


def time_to_regain(case: Case) -> int:
    """Number of frames in which a distance that another has taken may be regained."""
    return frames_of(case, constant("law.safe_distance.recapture"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A margin over a span; every array has shape (simulation,).

    Attributes:
        low: Its smallest value, `ENDLESS` where it does not count in any frame; means nothing where
            the span is empty.
        first: First frame in which it is negative, `NEVER` without one.
        last: Last such frame.
        longest: Number of frames of the longest unbroken run of them, 0 without one.
    """

    low: F32
    first: I32
    last: I32
    longest: I32

    def with_rows(self, rows: IndexArray, replacement: "Stretch") -> "Stretch":
        """The same with other margins in some simulations."""
        changed = {one.name: getattr(self, one.name).copy() for one in fields(self)}
        for name, values in changed.items():
            values[rows] = getattr(replacement, name)
        return Stretch(**changed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretches:
    """What the compiled engine answers about stretches of frames; arrays have shape (simulation,).

    Attributes:
        stop_lit: Distance at which something lit is seen minus the stopping distance, over
            `conduct` [m].
        stop_unlit: The same for something unlit [m].
        follow: Gap to the leader minus the lawful gap, over `settled`, but for the time after a
            cut-in [m].
        braking: Braking that is allowed minus what is forced on the follower in the time after each
            change of lane, over `manoeuvre` [m/s^2].
        due: Over `passed`, the longest run of frames in which the ego could have returned: its
            first frame, `NEVER` without one, and its number of frames.
        entry_arrival: When the vehicle behind on the left came where the ego's rear was as the ego
            crossed the line, `NEVER` if it did not.
        return_arrival: When the target came where the ego's rear was at the end of the return.
        worst: Worst measures over `conduct`, by name: `leader` and `follower` with the fields of
            `Encounter`; time_headway, picud, rss_margin and lawful_margin to the vehicle ahead;
            num_close, num_critical and shortfall, the frames under the lawful distance, those with
            a critical time to collision, and the sum of what these lack [s]. 0 without a vehicle.
        sums: Sums of recorded integers up to a collision, by name, of simulations without an
            attempt: frames; led, those with a leader; ego_speed [mm/s] and left_count over all;
            target_speed, speed_difference [mm/s] and distance [mm] to the leader over those with
            one, the latter two without sign.
    """

    stop_lit: Stretch
    stop_unlit: Stretch
    follow: Stretch
    braking: Stretch
    due: tuple[I32, I32]
    entry_arrival: I32
    return_arrival: I32
    worst: dict[str, F32]
    sums: dict[str, NDArray[np.int64]]


def answers(case: Case, spans: dict[str, Span]) -> Stretches:
    """The answers of the compiled engine, whatever the spans.

    Args:
        case: The batch.
        spans: Where to look, by the names that `stretches` gives them.
    """
    count, names = case.signals.num_simulations, _core.FIELD_NAMES
    ends = [end for name in names["spans"] for end in (spans[name].start, spans[name].stop)]
    moments = [getattr(case.events, name) for name in names["moments"]]
    kinds = {"measures": np.float32, "frames": np.int32, "sums": np.int64}
    out = {name: np.empty((len(names[name]), count), kind) for name, kind in kinds.items()}
    _core.scan_spans(
        recording=packed(case),
        signals=pack_seen(case.signals),
        spans=np.concatenate(ends, dtype=np.int32),
        moments=np.concatenate(moments, dtype=np.int32),
        law=_numbers(case),
        outputs=out,
        level=simd_level(),
    )
    said: dict[str, Arrays] = {
        name: dict(zip(names[name], rows, strict=True)) for name, rows in out.items()
    }
    frames, measures = said["frames"], said["measures"]
    margins = {
        name: Stretch(
            low=measures[name],
            first=frames[f"{name}.first"],
            last=frames[f"{name}.last"],
            longest=frames[f"{name}.longest"],
        )
        for name in ("stop_lit", "stop_unlit", "follow", "braking")
    }
    return Stretches(
        **margins,
        due=(frames["due.first"], frames["due.length"]),
        entry_arrival=frames["entry.arrival"],
        return_arrival=frames["return.arrival"],
        worst=measures,
        sums=said["sums"],
    )


_NUMBERS = {
    "friction_floor": "friction.table.floor",
    "decel_limit": "law.safe_distance.decel_limit",
    "reaction_time": "law.safe_distance.reaction_time",
    "stop_reaction_time": "law.sight.reaction_time",
    "time_gap": "law.return.time_gap",
    "free_time": "law.return.free_time",
    "return_range": "law.return.reach",
    "allowed_braking": "law.obstruction.braking",
    "max_braking": "law.obstruction.most",
    "picud_reaction_time": "event_detection.safety.picud_reaction_time",
    "picud_decel": "event_detection.safety.picud_decel",
    "rss_reaction_time": "law.rss.reaction_time",
    "rss_accel": "law.rss.accel",
    "rss_rear_decel": "law.rss.rear_decel",
    "rss_leader_decel": "law.rss.lead_decel",
    "critical_ttc": "event_detection.safety.critical_ttc",
}


def _numbers(case: Case) -> dict[str, Any]:
    usable = constant("friction.table.usable_share") * constant("model.nature.gravity")
    return {
        **{name: float(constant(path)) for name, path in _NUMBERS.items()},
        "decel_per_friction": float(usable),
        "regain_frames": time_to_regain(case),
        "obstruction_frames": frames_of(case, constant("law.obstruction.duration")),
    }


def reduced(by: np.ufunc, values: NDArray[Any], span: Span) -> NDArray[Any]:
    """`values` (simulation, time) of a span, reduced by a ufunc; any value where it is empty."""
    first, some = np.arange(len(values)) * values.shape[1], span.exists
    index = np.empty(2 * len(values), np.intp)
    index[::2] = first + np.where(some, span.start, 0)
    index[1::2] = first + np.where(some, span.stop + 1, 1)
    flat = values.reshape(-1)
    # `reduceat` takes no end beyond the array, and needs none after the last start.
    return by.reduceat(flat, index[index < flat.size])[::2]


def ends_in(span: Span, rows: IndexArray, broken: Mask) -> tuple[I32, I32, I32]:
    """`ends_of` the frames of a mask (row, time) of some simulations within a span."""
    row, frame = np.nonzero(span.mask(rows, broken.shape[1]) & broken)
    return ends_of(rows[row], frame, len(span.start))


def ends_of(rows: IndexArray, frames: IndexArray, num_simulations: int) -> tuple[I32, I32, I32]:
    """First and last of some frames of each simulation, and how many of them follow each other.

    Args:
        rows: Simulation of each frame, in order.
        frames: In order within a simulation.
        num_simulations: Length of the results.

    Returns:
        Both, `NEVER` without any, and the number of frames of the longest run of consecutive ones.
    """
    first = np.full(num_simulations, NEVER)
    last, longest = first.copy(), np.zeros(num_simulations, np.int32)
    # Of several frames of a simulation the one that is written last stays.
    first[rows[::-1]], last[rows] = frames[::-1], frames
    breaks = (np.diff(rows) != 0) | (np.diff(frames) != 1)
    begins = np.flatnonzero(np.append(True, breaks)[: rows.size])
    np.maximum.at(longest, rows[begins], np.diff(np.append(begins, rows.size)))
    return first, last, longest


def stretch(margin: F32, span: Span) -> Stretch:
    """A margin (simulation, time) over a span; `ENDLESS` where it does not count."""
    low = reduced(np.minimum, margin, span)
    rows = np.flatnonzero(span.exists & (low < 0))
    first, last, longest = ends_in(span, rows, margin[rows] < 0)
    return Stretch(low=low, first=first, last=last, longest=longest)


def limited(signal: F32, limit: F32 | np.float32, span: Span, *, is_most: bool) -> Stretch:
    """`stretch` of a signal minus the least that is allowed, or of the most minus the signal.

    Args:
        signal: Shape (simulation, time).
        limit: The limit in each frame, shape (simulation, time), of each simulation, (simulation,),
            or of all.
        span: Where the margin counts.
        is_most: Whether the limit is the most that is allowed.
    """
    if limit.ndim == signal.ndim:
        signal, limit = signal - limit, np.float32(0.0)
    count = len(signal)
    low, frames = np.empty(count, np.float32), np.empty((3, count), np.int32)
    _core.limit_margins(
        signal=adjacent(signal),
        span=span.ends,
        limit=np.full(count, limit, np.float32),
        is_maximum=is_most,
        min_margin=low,
        frames=frames,
        level=simd_level(),
    )
    first, last, longest = frames
    return Stretch(low=low, first=first, last=last, longest=longest)


def bits_within(values: U8, span: Span) -> tuple[U8, U8]:
    """Bits that are set in any frame of a span, and in all: none and all where it is empty.

    Args:
        values: Shape (simulation, time).
        span: Where to look.
    """
    out = np.empty((2, len(values)), np.uint8)
    _core.flag_bits(values=adjacent(values), span=span.ends, out=out)
    return out[0], out[1]


def never_negative(found: Stretch, span: Span, *, belief: U8 | None = None) -> Finding:
    """A margin that may never be negative: its smallest value, and the frames in which it is.

    Args:
        found: The margin over the span.
        span: Where it counts; the rule applies where it counts in any frame.
        belief: `Belief` of each simulation, where the rule is about one.
    """
    about = span.exists & (found.low < ENDLESS)
    return decided(about, found.low, found.first, found.last, longest=found.longest, belief=belief)


def always(margin: F32, span: Span) -> Finding:
    """`never_negative` of a margin of shape (simulation, time)."""
    return never_negative(stretch(margin, span), span)


def always_at(margin: F32, rows: IndexArray, frames: IndexArray, num_simulations: int) -> Finding:
    """The same of a margin at single frames; the rule applies to simulations that have any.

    Args:
        margin: Shape (instant,).
        rows: Simulation of each, in order.
        frames: Frame of each, in order within a simulation.
        num_simulations: Length of the results.
    """
    low = np.full(num_simulations, ENDLESS)
    if rows.size:
        begins = np.append(0, np.flatnonzero(rows[1:] != rows[:-1]) + 1)
        low[rows[begins]] = np.minimum.reduceat(margin, begins)
    broken = margin < 0
    first, last, longest = ends_of(rows[broken], frames[broken], num_simulations)
    return decided(low < ENDLESS, low, first, last, longest=longest)


def instant(
    frame: I32,
    margin: F32,
    applies: Mask,
    *,
    doubtful: Mask | None = None,
    belief: U8 | None = None,
) -> Finding:
    """A margin that counts at one frame; the other arguments are those of `decided`."""
    there = applies & (frame != NEVER)
    return decided(there, margin, frame, frame, doubtful=doubtful, belief=belief)
