"""Movements across the road: unbroken ones, how far they lead, and how fast."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.model.signals import Signals
from overtaking.world.constants import known

I32 = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Movements:
    """Sustained movements to one side, in the order of simulations and frames.

    Attributes:
        simulation: Whose they are, shape (movement,).
        begin: First frame, shape (movement,).
        end: Last frame, shape (movement,).
        wide: Whether they last and lead far enough to be noticed.
    """

    simulation: I32
    begin: I32
    end: I32
    wide: Mask

    def as_mask(self, shape: tuple[int, int]) -> Mask:
        """Where a wide movement begins, shape (simulation, time)."""
        mask = np.zeros(shape, dtype=np.bool_)
        mask[self.simulation[self.wide], self.begin[self.wide]] = True
        return mask


def movements(seen: Signals, moving: Mask, *, towards_left: bool) -> Movements:
    """The unbroken movements of the egos to one side.

    A movement is wide if it lasts `motion.least_time` and leads `motion.least_shift` away from
    where the ego was in the median over the `motion.median_window` before it.

    Args:
        seen: Signals of the batch.
        moving: Frames in which they move to that side, shape (simulation, time).
        towards_left: Which side.
    """
    sign = np.float32(1.0 if towards_left else -1.0)
    simulation, begin, end = runs(moving)
    frames = num_frames_of(seen, "motion.least_time")
    before = _median_before(seen, simulation, begin)
    shift = sign * (seen.lateral[simulation, end] - before)
    long_enough = end - begin + 1 >= frames
    return Movements(
        simulation=simulation,
        begin=begin,
        end=end,
        wide=long_enough & (shift >= known("labels.motion.least_shift")),
    )


def advances(lateral: F32, found: tuple[I32, I32, I32], frames: int) -> F32:
    """The farthest that each movement to the left leads within a number of frames [m].

    Args:
        lateral: Position across the road, shape (simulation, time) [m].
        found: Simulation, first and last frame of the movements, as `runs` gives them.
        frames: How many frames a movement has for it; a shorter one has those that it lasts.

    Returns:
        Shape (movement,).
    """
    simulation, begin, end = found
    length = end - begin + 1
    if not length.size:
        return np.zeros(0, np.float32)
    row, last = np.repeat(simulation, length), np.repeat(end, length)
    first = np.cumsum(length) - length
    frame = np.arange(row.size, dtype=np.int32) + np.repeat(begin - first, length)
    ahead = lateral[row, np.minimum(frame + frames, last)] - lateral[row, frame]
    return as_f32(np.maximum.reduceat(ahead, first))


def runs(mask: Mask) -> tuple[I32, I32, I32]:
    """The unbroken runs of frames at which rows of `mask` hold.

    Returns:
        Simulation, first frame and last frame of each, shape (run,), in the order of simulations
        and frames.
    """
    padded = np.zeros((mask.shape[0], mask.shape[1] + 2), dtype=np.int8)
    padded[:, 1:-1] = mask
    change = np.diff(padded, axis=1)
    simulation, begin = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    return simulation.astype(np.int32), begin.astype(np.int32), (end - 1).astype(np.int32)


def num_frames_of(seen: Signals, name: str) -> int:
    """A time of `labels.toml` as a number of frames, at least one."""
    return max(1, round(float(known(f"labels.{name}")) * 1000.0 / seen.frame_interval_ms))


def _median_before(seen: Signals, simulation: I32, begin: I32) -> F32:
    """Where the ego was in the median over the seconds before each movement, shape (movement,)."""
    width = num_frames_of(seen, "motion.median_window")
    frame = begin[:, None] + np.arange(-width, 1, dtype=np.int32)
    # Before the recording it was where it was at first.
    place = seen.lateral[simulation[:, None], np.maximum(frame, 0)]
    return as_f32(np.median(place, axis=1))
