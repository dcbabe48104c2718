"""Ego and target side by side, and who is around the ego at single frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.labels.law import engine
from overtaking.labels.law.frames import Span, driving_end
from overtaking.labels.signals.engine import neighbours_at
from overtaking.labels.signals.reference import Neighbours
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.once import once
from overtaking.model.signals import Around

I32 = NDArray[np.int32]
Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alongside:
    """The frames in which ego and target overlap, in order; arrays have shape (instant,).

    Attributes:
        rows: Simulation of each.
        frames: Its frame.
        lane: Lane of the target.
        lateral_gap: Between the sides of their bodies [m].
        accel: Of the target [m/s^2].
    """

    rows: Index
    frames: Index
    lane: NDArray[np.uint8]
    lateral_gap: F32
    accel: F32

    def where(self, holds: Mask) -> "Alongside":
        """Some of these frames."""
        if holds.all():
            return self
        kept = np.flatnonzero(holds)
        return Alongside(
            rows=self.rows[kept],
            frames=self.frames[kept],
            lane=self.lane[kept],
            lateral_gap=self.lateral_gap[kept],
            accel=self.accel[kept],
        )


@once
def alongside(case: Case) -> Alongside:
    """The frames in which ego and target overlap, in the overtake."""
    events, end = case.events, driving_end(case)
    over = np.where(events.overlap_end != NEVER, np.minimum(events.overlap_end, end), end)
    begun = events.overlap_begin != NEVER
    span = Span(start=np.where(begun, events.overlap_begin, over + 1), stop=over)
    rows, frames = span.frames()
    found = engine.of_target(case, span)
    overlaps = found.pop("overlaps")
    return Alongside(rows=rows, frames=frames, **found).where(overlaps)


def beside(case: Case, place: Around, frame: I32) -> Neighbours:
    """The neighbour in a place at one frame of each simulation; the first where that is `NEVER`."""
    rows = np.arange(len(frame))
    return neighbours_at(
        case.trajectories, case.signals, place, rows, np.maximum(frame, 0).astype(np.intp)
    )
