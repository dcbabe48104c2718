"""The features as the paper measures them, its traps included.

An overtake is measured in the frame in which it begins, a run without an attempt by the mean over
all of its frames: a definition that depends on the class, which is why there is a second reading in
`matched`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.labels.features.common import end_of, of_target, static, unless_under_way
from overtaking.labels.features.engine import sums
from overtaking.labels.features.matched import left_lane_then
from overtaking.labels.signals.frames import at, seconds_of
from overtaking.labels.signals.reference import METRES
from overtaking.labels.signals.target import target_at
from overtaking.model.events import NEVER
from overtaking.model.features import Features
from overtaking.model.labels import Case

I32 = NDArray[np.int32]

POLICY = "paper"


def paper_features(case: Case) -> Features:
    """The features of a batch under the paper's reading.

    The waiting time counts from the first frame, and without an attempt is the whole duration. The
    overtaking time ends with the return, a collision or the recording, and is 0 without an attempt.
    The difference of speeds has no sign, the distance is that of the centres, and the occupancy is
    the number of vehicles in the lane to the left over that of all others.
    """
    events = case.events
    attempted = events.attempted
    waited = np.where(attempted, events.attempt, end_of(case, events.collision))
    ended = end_of(case, events.collision, events.return_end)
    lasted = np.where(attempted, ended - events.attempt, np.int32(0))
    measured: dict[str, Any] = {**_at_attempt(case, attempted), **static(case)}
    return Features(
        policy=POLICY,
        waiting_time=unless_under_way(case, seconds_of(case, waited)),
        overtaking_time=unless_under_way(case, seconds_of(case, lasted)),
        frame=np.where(attempted, events.attempt, NEVER),
        **measured,
    )


def _at_attempt(case: Case, attempted: Mask) -> dict[str, F32]:
    """What is measured in the first frame of the attempt, or as a mean where there is none."""
    instant, mean = _instant(case), _means(case)
    return {name: np.where(attempted, instant[name], mean[name]) for name in instant}


def _instant(case: Case) -> dict[str, F32]:
    run, frame = case.trajectories, case.events.attempt
    own = at(case.signals.speed, frame)
    target = of_target(case, target_at(run, case.target, frame))
    left = left_lane_then(case)  # Nobody looks at it where nothing was attempted.
    others = np.maximum(case.trajectories.scenario.num_vehicles - 1, 1)
    return {
        "ego_speed": own,
        "target_speed": target["speed"],
        "speed_difference": np.abs(own - target["speed"]),
        "distance": np.abs(target["lead"]),
        "left_occupancy": as_f32(left.count) / as_f32(others),
    }


def _means(case: Case) -> dict[str, F32]:
    """Means over the frames up to a collision, 0 where there is an attempt.

    They are means of the recorded integers, so that no digit is lost.
    """
    end = end_of(case, case.events.collision)
    # Where there is an attempt nobody asks for means.
    total = sums(case, np.where(case.events.attempted, NEVER, end).astype(np.int32))
    others = np.maximum(case.trajectories.scenario.num_vehicles - 1, 1)

    def mean(name: str, counted: str) -> F32:
        return as_f32(total[name] / np.maximum(total[counted], 1))

    return {
        "ego_speed": mean("ego_speed", "frames") * METRES,
        "target_speed": mean("target_speed", "led") * METRES,
        "speed_difference": mean("speed_difference", "led") * METRES,
        "distance": mean("distance", "led") * METRES,
        "left_occupancy": mean("left_count", "frames") / as_f32(others),
    }
