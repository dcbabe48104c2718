"""Measures of an overtake against oncoming traffic."""

from typing import Any

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray, Mask
from overtaking.labels.instants import at, seconds_of
from overtaking.labels.law.opposite import on_the_other_side
from overtaking.labels.law.others import coming, others_at
from overtaking.labels.law.sight import shown_sight, unseen_speed
from overtaking.model.batch import batch_fields
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import PassingSafety
from overtaking.model.verdicts import Case

_NONE = np.float32(np.nan)
_LEAST_SPEED = np.float32(0.1)  # Keeps times finite [m/s].


def oncoming_measures(case: Case) -> PassingSafety:
    """The measures of a batch."""
    if not case.trajectories.road.is_two_way:
        return _nothing(case.signals.num_simulations)
    out = on_the_other_side(case)
    began, ended = (np.where(out.exists, each, NEVER) for each in (out.start, out.stop))
    abreast = np.where(out.exists, case.events.overlap_begin, NEVER)
    gap_at_crossing, time_at_crossing = _meeting(case, began)
    gap_abreast, time_abreast = _meeting(case, abreast)
    gap_at_return, time_at_return = _meeting(case, ended)
    begin = np.maximum(began, 0)
    own, sight = at(case.signals.speed, begin), shown_sight(case, begin)
    unseen = sight / np.maximum(own + unseen_speed(case, begin), _LEAST_SPEED)
    return PassingSafety(
        was_in_opposing_lane=out.exists,
        gap_at_crossing=gap_at_crossing,
        time_to_meet_at_crossing=time_at_crossing,
        gap_abreast=gap_abreast,
        time_to_meet_abreast=time_abreast,
        gap_at_return=gap_at_return,
        time_to_meet_at_return=time_at_return,
        min_time_to_meet=_min_time_to_meet(case),
        sight_at_crossing=_known(out.exists, sight),
        time_in_opposing_lane=_known(
            out.exists, seconds_of(case, np.maximum(out.stop - out.start, 0))
        ),
        time_available=_known(out.exists, np.fmin(time_at_crossing, unseen)),
        was_aborted=case.events.abort != NEVER,
    )


def _nothing(count: int) -> PassingSafety:
    """Nothing measured in any simulation."""
    empty: dict[str, Any] = {
        name: np.zeros(count, np.bool_) if field.is_flag else np.full(count, _NONE)
        for name, field in batch_fields(PassingSafety).items()
    }
    return PassingSafety(**empty)


def _known(where: Mask, values: F32) -> F32:
    return np.where(where, values, _NONE).astype(np.float32)


def next_oncomer(
    case: Case, frame: I32, rows: IndexArray | None = None
) -> tuple[F32, F32, IndexArray]:
    """The nearest who comes at one frame of some simulations of a two-way road; none at `NEVER`.

    Args:
        case: The batch.
        frame: A frame of each, shape (instant,).
        rows: Which simulations, same shape; all of them if left out.

    Returns:
        Gap to it [m] and both speeds together [m/s], NaN where nobody comes, and its slot.
    """
    rows = np.arange(len(frame)) if rows is None else rows
    others, instant = others_at(case, frame, rows), np.arange(len(frame))
    gaps = np.where(coming(others), others.gap, np.inf)
    slot = gaps.argmin(axis=1)
    gap, own = gaps[instant, slot], case.signals.speed[rows, np.maximum(frame, 0)]
    there = (frame != NEVER) & np.isfinite(gap)
    both = np.maximum(own + others.speed[instant, slot], _LEAST_SPEED)
    return _known(there, gap), _known(there, both), slot


def _meeting(case: Case, frame: I32, rows: IndexArray | None = None) -> tuple[F32, F32]:
    """Gap to who comes next [m], and the time to meet [s]; arguments as of `next_oncomer`."""
    gap, both, _ = next_oncomer(case, frame, rows)
    return gap, np.maximum(gap, np.float32(0.0)) / both


def _min_time_to_meet(case: Case) -> F32:
    """Smallest time to meet over all frames in the opposing lane, shape (simulation,) [s]."""
    rows, frames = on_the_other_side(case).frames()
    _, times = _meeting(case, frames.astype(np.int32), rows)
    least = np.full(case.signals.num_simulations, _NONE)
    np.fmin.at(least, rows, times)
    return least
