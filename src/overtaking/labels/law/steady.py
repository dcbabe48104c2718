"""How fast others move across the road, where their positions are measured and not computed."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32
from overtaking.labels.signals.reference import METRES, half_window, lateral_speed_at
from overtaking.model.trajectory import Trajectories
from overtaking.world.constants import known

Index = NDArray[np.intp]

_THIRD = np.array([-1.0, 3.0, -3.0, 1.0])
"""A third difference: 0 for a parabola, with 20 times the variance of the noise."""


def steady_speed_at(
    trajectories: Trajectories, rows: Index, slot: Index, frames: NDArray[np.integer], limit: float
) -> F32:
    """Speed of vehicles to the left at single frames, all arrays of shape (instant,) [m/s].

    In a recording the central difference over about 0.2 s is widened, up to 2 s, until its standard
    error is a quarter of the limit. The noise of a position is the root mean square of its third
    differences within a second, over the root of 20; the error of a difference over 2 h is the
    noise times the root of 2, over 2 h. Simulations have no noise.

    Args:
        trajectories: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        frames: A frame of each in which it is recorded.
        limit: The speed with which it is compared [m/s].
    """
    if not trajectories.unknown:
        return lateral_speed_at(trajectories, rows, slot, frames)
    interval = trajectories.scenario.frame_interval_ms
    accepted = float(known("law.others.error_share")) * limit
    wanted = np.sqrt(2.0) * _noise(trajectories, rows, slot, frames) / accepted
    half = np.ceil(wanted / 2.0 * 1000.0 / interval)
    widest = max(half_window(interval), _around(interval))
    half = np.clip(half, half_window(interval), widest).astype(np.int32)
    return lateral_speed_at(trajectories, rows, slot, frames, half)


def _around(interval_ms: int) -> int:
    """Frames before and after an instant that are looked at."""
    return int(float(known("law.others.noise_time")) * 1000.0 / interval_ms)


def _noise(
    trajectories: Trajectories, rows: Index, slot: Index, frames: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Standard deviation of what is noise in a recorded lateral position [m]."""
    around = max(2, _around(trajectories.scenario.frame_interval_ms))
    frame = frames[:, None] + np.arange(-around, around + 1)
    inside = (frame >= 0) & (frame < trajectories.num_frames[rows, None])
    place = (rows[:, None], slot[:, None], np.where(inside, frame, 0))
    inside &= trajectories.state_valid[place]
    d = trajectories.states.d[place] * float(METRES)
    count = frame.shape[1] - len(_THIRD) + 1
    pieces = [(d[:, k : k + count], inside[:, k : k + count]) for k in range(len(_THIRD))]
    third = sum(weight * values for weight, (values, _) in zip(_THIRD, pieces, strict=True))
    whole = np.logical_and.reduce([there for _, there in pieces])
    squares = np.where(whole, third**2, 0.0).sum(axis=1)
    return np.sqrt(squares / np.maximum(whole.sum(axis=1), 1) / (_THIRD**2).sum())
