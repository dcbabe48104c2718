"""Stretches of frames in which rules look, and what they find there."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.labels.law.rule import Check, decided
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.once import once
from overtaking.model.road import Road
from overtaking.world.constants import known

I32 = NDArray[np.int32]
S = TypeVar("S", bound=np.generic)
U8 = NDArray[np.uint8]
Index = NDArray[np.intp]

ENDLESS = np.float32(3.0e38)
"""Larger than any margin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """From one frame to another, both within it; empty where `stop` is before `start`.

    Attributes:
        start: First frame, shape (simulation,).
        stop: Last frame, shape (simulation,).
    """

    start: I32
    stop: I32

    @property
    def exists(self) -> Mask:
        """Whether it has a frame, shape (simulation,)."""
        return self.stop >= self.start

    def mask(self, rows: Index, num_frames: int) -> Mask:
        """Which frames it has in some simulations, shape (row, time)."""
        frame = np.arange(num_frames, dtype=np.int32)
        return (frame >= self.start[rows, None]) & (frame <= self.stop[rows, None])

    def frames(self) -> tuple[Index, Index]:
        """Simulation and frame of each of its frames, in order."""
        length = np.maximum(self.stop - self.start + 1, 0)
        rows = np.repeat(np.arange(len(length)), length)
        before = np.cumsum(length) - length
        return rows, np.arange(rows.size) + np.repeat(self.start - before, length)


def frames_of(case: Case, seconds: float | np.floating) -> int:
    """Number of frames in a duration, the nearest."""
    return round(float(seconds) * 1000.0 / case.signals.frame_interval_ms)


def time_to_regain(case: Case) -> int:
    """Number of frames in which a distance that another has taken may be regained."""
    return frames_of(case, known("law.safe_distance.recapture"))


def is_two_way(road: Road) -> bool:
    """Whether the lane beyond the fast edge belongs to oncoming traffic."""
    beyond = road.fast_side_neighbour
    return beyond is not None and beyond.kind == "driving" and beyond.direction == -1


@once
def driving_end(case: Case) -> I32:
    """Last frame in which the ego is driven: before a collision, before it is off the road."""
    events = case.events
    end = events.last.copy()
    stops = [events.collision]
    if not is_two_way(case.trajectories.road):
        stops.append(events.road_departure)
    for stop in stops:
        end = np.where(stop != NEVER, np.minimum(end, stop - 1), end)
    return end


@once
def manoeuvre(case: Case) -> Span:
    """From 3 s before the attempt to 3 s after its end; empty without an attempt.

    An overtake that is not completed ends when the ego is back, or with the recording.
    """
    events = case.events
    before = frames_of(case, known("law.window.before"))
    after = frames_of(case, known("law.window.after"))
    given_up = np.where(events.back != NEVER, events.back, events.last)
    over = np.where(events.return_end != NEVER, events.return_end + after, given_up)
    stop = np.minimum(over, driving_end(case))
    return Span(
        start=np.maximum(events.attempt - before, events.first),
        stop=np.where(events.attempted, stop, NEVER).astype(np.int32),
    )


@once
def conduct(case: Case) -> Span:
    """The manoeuvre, or all that was driven where there was no attempt."""
    attempted, within = case.events.attempted, manoeuvre(case)
    return Span(
        start=np.where(attempted, within.start, case.events.first),
        stop=np.where(attempted, within.stop, driving_end(case)),
    )


def lowest(values: NDArray[S], span: Span) -> NDArray[S]:
    """Smallest of `values` (simulation, time) in a span; means nothing where that is empty."""
    return reduced(np.minimum, values, span)


def reduced(by: np.ufunc, values: NDArray[S], span: Span) -> NDArray[S]:
    """`values` (simulation, time) of a span, reduced by a ufunc, without a mask of their size."""
    first = np.arange(len(values)) * values.shape[1]
    some = span.exists
    index = np.empty(2 * len(values), np.intp)
    index[::2] = first + np.where(some, span.start, 0)
    index[1::2] = first + np.where(some, span.stop + 1, 1)
    flat = values.reshape(-1)
    # `reduceat` takes no end beyond the array, and needs none after the last start.
    return by.reduceat(flat, index[index < flat.size])[::2]


def ends(broken: Mask) -> tuple[I32, I32]:
    """First and last frame of a mask, `NEVER` where it has none, shape (simulation,)."""
    some = broken.any(axis=1)
    first = broken.argmax(axis=1)
    last = broken.shape[1] - 1 - broken[:, ::-1].argmax(axis=1)
    return (
        np.where(some, first, NEVER).astype(np.int32),
        np.where(some, last, NEVER).astype(np.int32),
    )


def ends_in(span: Span, rows: Index, broken: Mask) -> tuple[I32, I32]:
    """First and last frame of a mask (row, time) of some simulations within a span.

    Returns:
        Shape (simulation,), `NEVER` for all others.
    """
    first = np.full(len(span.start), NEVER)
    last = first.copy()
    first[rows], last[rows] = ends(span.mask(rows, broken.shape[1]) & broken)
    return first, last


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A margin over a span; every array has shape (simulation,).

    Attributes:
        low: Its smallest value, `ENDLESS` where it does not count in any frame; means nothing where
            the span is empty.
        first: First frame in which it is negative, `NEVER` without one.
        last: Last such frame.
    """

    low: F32
    first: I32
    last: I32


def stretch(margin: F32, span: Span) -> Stretch:
    """A margin (simulation, time) over a span; `ENDLESS` where it does not count."""
    low = lowest(margin, span)
    rows = np.flatnonzero(span.exists & (low < 0))
    first, last = ends_in(span, rows, margin[rows] < 0)
    return Stretch(low=low, first=first, last=last)


def stretch_of_instants(margin: F32, rows: Index, frames: Index, num_simulations: int) -> Stretch:
    """The same of a margin at single frames; arguments as in `always_at`."""
    low = np.full(num_simulations, ENDLESS)
    first = np.full(num_simulations, NEVER)
    last = first.copy()
    if rows.size:
        begins = np.append(0, np.flatnonzero(rows[1:] != rows[:-1]) + 1)
        low[rows[begins]] = np.minimum.reduceat(margin, begins)
        broken = np.flatnonzero(margin < 0)
        row, frame = rows[broken], frames[broken]
        # Of several frames of a simulation the one that is written last stays.
        first[row[::-1]], last[row] = frame[::-1], frame
    return Stretch(low=low, first=first, last=last)


def never_negative(found: Stretch, span: Span, *, belief: U8 | None = None) -> Check:
    """A margin that may never be negative: its smallest value, and the frames in which it is.

    Args:
        found: The margin over the span.
        span: Where it counts; the rule applies where it counts in any frame.
        belief: `Belief` of each simulation, where the rule is about one.
    """
    about = span.exists & (found.low < ENDLESS)
    return decided(about, found.low, found.first, found.last, belief=belief)


def always(margin: F32, span: Span, *, belief: U8 | None = None) -> Check:
    """`never_negative` of a margin of shape (simulation, time)."""
    return never_negative(stretch(margin, span), span, belief=belief)


def always_at(margin: F32, rows: Index, frames: Index, num_simulations: int) -> Check:
    """The same of a margin at single frames; the rule applies to simulations that have any.

    Args:
        margin: Shape (instant,).
        rows: Simulation of each, in order.
        frames: Frame of each, in order within a simulation.
        num_simulations: Length of the results.
    """
    found = stretch_of_instants(margin, rows, frames, num_simulations)
    return decided(found.low < ENDLESS, found.low, found.first, found.last)


def instant(
    frame: I32,
    margin: F32,
    applies: Mask,
    *,
    doubtful: Mask | None = None,
    belief: U8 | None = None,
) -> Check:
    """A margin that counts at one frame; the other arguments are those of `decided`."""
    there = applies & (frame != NEVER)
    return decided(there, margin, frame, frame, doubtful=doubtful, belief=belief)
