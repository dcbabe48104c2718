"""How the overtake ended, and by which way."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.model.events import NEVER, Detail, Events, Outcome
from overtaking.world.constants import known

U8 = NDArray[np.uint8]


def outcome(events: Events) -> U8:
    """`Outcome` of each simulation.

    A collision counts at any time that was recorded, also before an attempt and after the return:
    recordings of this package end three seconds after the overtake, and what happens until then
    belongs to it.
    """
    ended = np.where(events.completed, Outcome.COMPLETED, Outcome.NOT_COMPLETED)
    tried = np.where(events.attempted, ended, Outcome.NO_ATTEMPT)
    return np.where(events.collision != NEVER, Outcome.COLLISION, tried).astype(np.uint8)


def detail(events: Events, frame_interval_ms: int) -> U8:
    """`Detail` of each simulation.

    Args:
        events: Events of the batch.
        frame_interval_ms: Time between frames [ms].
    """
    how = outcome(events)
    cases: list[tuple[Mask, Detail]] = [
        (_collided(events) & ~events.attempted, Detail.COLLISION_BEFORE_ATTEMPT),
        (_collided(events) & events.struck, Detail.STRUCK_BY_OTHER),
        (_collided(events), Detail.RAN_INTO_OTHER),
        (how == Outcome.COMPLETED, Detail.NONE),
        (events.road_departure != NEVER, Detail.LEFT_ROAD),
        (how == Outcome.NO_ATTEMPT, Detail.NONE),
        (_went_back(events) & (events.line_crossed == NEVER), Detail.ABORTED_BEFORE_CROSSING),
        (_went_back(events), Detail.ABORTED_AFTER_CROSSING),
        (_stayed(events, frame_interval_ms), Detail.PASSED_NOT_RETURNED),
    ]
    conditions, details = zip(*cases, strict=True)
    return np.select(conditions, details, Detail.OPEN_AT_HORIZON).astype(np.uint8)


def _collided(events: Events) -> Mask:
    return events.collision != NEVER


def _went_back(events: Events) -> Mask:
    return events.back != NEVER


def _stayed(events: Events, frame_interval_ms: int) -> Mask:
    """Whether the ego had passed and stayed in the other lane for good."""
    frames = float(known("labels.phases.stay_time")) * 1000.0 / frame_interval_ms
    return (events.overlap_end != NEVER) & (events.last - events.overlap_end >= frames)
