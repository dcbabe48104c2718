"""First, last and longest: small questions to masks of shape (simulation, time)."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.model.events import NEVER
from overtaking.model.labels import Case

I32 = NDArray[np.int32]
T = TypeVar("T", bound=np.generic)


def first_true(mask: Mask) -> I32:
    """First frame at which each row of `mask` holds, `NEVER` where it never does."""
    first = mask.argmax(axis=1).astype(np.int32)
    return np.where(mask[np.arange(len(mask)), first], first, NEVER)


def since(first: I32, num_frames: int) -> Mask:
    """The frames from `first` on, shape (simulation, time); none where it is `NEVER`."""
    frame = np.arange(num_frames, dtype=np.int32)
    return (frame >= first[:, None]) & (first != NEVER)[:, None]


def until(last: I32, num_frames: int) -> Mask:
    """The frames before `last`, shape (simulation, time); all of them where it is `NEVER`."""
    frame = np.arange(num_frames, dtype=np.int32)
    return (frame < last[:, None]) | (last == NEVER)[:, None]


def earliest(*frames: I32) -> I32:
    """The first of several events, `NEVER` if none of them happened."""
    largest = np.iinfo(np.int32).max
    stacked = np.stack([np.where(each == NEVER, largest, each) for each in frames])
    first = stacked.min(axis=0)
    return np.where(first == largest, NEVER, first).astype(np.int32)


def only(frames: I32, where: Mask) -> I32:
    """`frames` where `where` holds, else `NEVER`."""
    return np.where(where, frames, NEVER)


def at(values: NDArray[T], frames: I32) -> NDArray[T]:
    """`values` (simulation, time) at one frame each; where that is `NEVER`, at the first frame."""
    return values[np.arange(len(frames)), np.maximum(frames, 0)]


def seconds_of(case: Case, frames: NDArray[np.integer]) -> F32:
    """Duration of a number of frames, of the same shape [s]."""
    return as_f32(frames * np.int32(case.signals.frame_interval_ms)) / np.float32(1000.0)
