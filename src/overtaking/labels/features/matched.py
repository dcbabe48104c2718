"""The features measured alike in every class, so that a model may learn from them.

Where there was no attempt, there is an instant at which there might have been one: after a waiting
time drawn from those of the attempts, within the time for which the ego did follow.
"""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.compiled import Draws
from overtaking.core.elementary import F32, as_f32, maximum
from overtaking.core.philox import Stream
from overtaking.knowledge import Quantity, quantities
from overtaking.labels.features.common import end_of, of_target, static, unless_under_way
from overtaking.labels.signals.frames import at, seconds_of
from overtaking.labels.signals.reference import LeftLane, left_lane_at
from overtaking.labels.signals.target import target_at
from overtaking.model.events import NEVER
from overtaking.model.features import Features
from overtaking.model.labels import Case
from overtaking.model.once import once
from overtaking.model.trajectory import NO_VEHICLE

I32 = NDArray[np.int32]

POLICY = "matched"


def matched_features(case: Case) -> Features:
    """The features of a batch, measured at `t_a` or at an instant that stands for it.

    The waiting time counts from the frame in which the ego closes up to the target, the difference
    of speeds is positive while it closes, the distance is the gap between the bumpers, and the
    occupancy is the share of 100 m of the lane to the left, ahead and behind, that vehicles cover.
    """
    events, run = case.events, case.trajectories
    attempted = events.attempted
    frame = moment(case)
    waited = np.maximum(frame - events.follow, 0)
    ended = end_of(case, events.collision, events.return_end, events.back)
    lasted = np.where(attempted, np.maximum(ended - events.attempt, 0), np.int32(0))
    own = at(case.signals.speed, frame)
    target = of_target(case, target_at(run, case.target, frame))
    has_target = events.target != NO_VEHICLE
    return Features(
        policy=POLICY,
        waiting_time=unless_under_way(case, seconds_of(case, waited)),
        overtaking_time=unless_under_way(case, seconds_of(case, lasted)),
        ego_speed=own,
        target_speed=target["speed"],
        speed_difference=np.where(has_target, own - target["speed"], np.float32(0.0)),
        distance=target["gap"],
        left_occupancy=left_lane_then(case).occupancy,
        frame=frame,
        **static(case),
    )


@once
def moment(case: Case) -> I32:
    """The attempt, or the instant that stands for it, shape (simulation,)."""
    attempt = np.where(case.events.attempted, case.events.attempt, pseudo_attempt(case))
    return attempt.astype(np.int32, copy=False)


@once
def left_lane_then(case: Case) -> LeftLane:
    """The lane to the left at that moment."""
    return left_lane_at(case.trajectories, case.signals, np.maximum(moment(case), 0))


@once
def pseudo_attempt(case: Case) -> I32:
    """The instant that stands for `t_a` where nothing was attempted, shape (simulation,).

    The inverse of the distribution of the attempts' waiting times, cut off at the time for which
    the ego followed, at a uniform number from a stream of its own.
    """
    scenario, events = case.trajectories.scenario, case.events
    known = quantities("labels.toml")["matched.waiting_time_quantiles"]
    assert isinstance(known, Quantity)
    quantiles = as_f32(known.value)
    draw = Draws(scenario.seed, scenario.index, Stream.LABEL).uniform()
    end = end_of(case, events.collision)
    longest = seconds_of(case, np.maximum(end - events.follow, 0))
    waited = _quantile(quantiles, draw * _share_below(quantiles, longest))
    frames = np.rint(waited * np.float32(1000.0 / case.signals.frame_interval_ms))
    frame = np.minimum(events.follow + frames.astype(np.int32), end)
    return np.where(events.attempted, NEVER, frame)


def _quantile(quantiles: F32, share: F32) -> F32:
    """Value below which a share lies, linear between evenly spaced quantiles."""
    steps = np.float32(len(quantiles) - 1)
    place = share * steps
    low = np.minimum(place.astype(np.int32), len(quantiles) - 2)
    part = place - as_f32(low)
    return quantiles[low] + part * (quantiles[low + 1] - quantiles[low])


def _share_below(quantiles: F32, value: F32) -> F32:
    """Share that lies below a value; the inverse of `_quantile`."""
    last = len(quantiles) - 2
    low = np.clip(np.searchsorted(quantiles, value, side="right") - 1, 0, last)
    step = maximum(quantiles[low + 1] - quantiles[low], np.float32(1e-6))
    part = np.clip((value - quantiles[low]) / step, np.float32(0.0), np.float32(1.0))
    return (as_f32(low) + as_f32(part)) / np.float32(len(quantiles) - 1)
