"""Measures of an overtake against oncoming traffic."""

import numpy as np

from overtaking.core.elementary import F32, Mask
from overtaking.labels.instants import I32, at, seconds_of
from overtaking.labels.law.opposite import coming, on_the_other_side
from overtaking.labels.law.others import others_at
from overtaking.labels.law.sight import shown_sight
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.oncoming import Oncoming

_NONE = np.float32(np.nan)
_LEAST_SPEED = np.float32(0.1)  # Keeps times finite [m/s].


def oncoming_measures(case: Case) -> Oncoming:
    """The measures of a batch."""
    out, limit = on_the_other_side(case), np.float32(case.trajectories.road.speed_limit)
    began, ended = (np.where(out.exists, each, NEVER) for each in (out.start, out.stop))
    abreast = np.where(out.exists, case.events.overlap_begin, NEVER)
    gaps = {name: _nearest(case, frame) for name, frame in _moments(began, abreast, ended)}
    own, sight = at(case.signals.speed, began), shown_sight(case, np.maximum(began, 0))
    unseen = sight / np.maximum(own + limit, _LEAST_SPEED)
    return Oncoming(
        **{f"distance_{name}": distance for name, (distance, _) in gaps.items()},
        **{f"time_{name}": time for name, (_, time) in gaps.items()},
        least_time=_least_time(case),
        sight_out=_known(out.exists, sight),
        time_needed=_known(out.exists, seconds_of(case, np.maximum(out.stop - out.start, 0))),
        time_available=_known(out.exists, np.fmin(gaps["out"][1], unseen)),
    )


def _moments(began: I32, abreast: I32, ended: I32) -> tuple[tuple[str, I32], ...]:
    return ("out", began), ("abreast", abreast), ("back", ended)


def _known(where: Mask, values: F32) -> F32:
    return np.where(where, values, _NONE).astype(np.float32)


def _nearest(case: Case, frame: I32) -> tuple[F32, F32]:
    """Gap to the nearest who comes at one frame each, and the time to meet, NaN without one."""
    others, row = others_at(case, frame), np.arange(len(frame))
    gaps = np.where(coming(others), others.gap, np.inf)
    slot = gaps.argmin(axis=1)
    there = (frame != NEVER) & np.isfinite(gaps[row, slot])
    both = np.maximum(at(case.signals.speed, frame) + others.speed[row, slot], _LEAST_SPEED)
    gap = _known(there, gaps[row, slot])
    return gap, gap / both


def _least_time(case: Case) -> F32:
    """Least time to meet over all frames on the other side, shape (simulation,) [s]."""
    rows, frames = on_the_other_side(case).frames()
    others = others_at(case, frames.astype(np.int32), rows)
    both = others.speed + case.signals.speed[rows, frames][:, None]
    times = np.where(coming(others), others.gap / np.maximum(both, _LEAST_SPEED), np.inf)
    least = np.full(case.signals.num_simulations, np.inf, np.float32)
    np.minimum.at(least, rows, times.min(axis=1, initial=np.inf).astype(np.float32))
    return _known(np.isfinite(least), least)
