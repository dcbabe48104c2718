"""Collisions of the ego, who ran into whom, and leaving the road."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.labels.signals.frames import at, first_true
from overtaking.labels.signals.target import signals_at
from overtaking.model.events import NEVER
from overtaking.model.signals import Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories


@dataclass(frozen=True, slots=True, kw_only=True)
class Accidents:
    """What may end an overtake early; every array has shape (simulation,), see `Events`."""

    collision: NDArray[np.int32]
    road_departure: NDArray[np.int32]
    partner: NDArray[np.uint8]
    struck: Mask


def accidents(trajectories: Trajectories, seen: Signals) -> Accidents:
    """The accidents of a batch."""
    hit = trajectories.collided_with
    collision = first_true(seen.valid & (hit != NO_VEHICLE))
    partner = np.where(collision == NEVER, NO_VEHICLE, at(hit, collision))
    departed = first_true(seen.valid & (seen.lane >= trajectories.road.num_lanes))
    return Accidents(
        collision=collision,
        road_departure=departed,
        partner=partner,
        struck=struck(trajectories, seen, partner, collision),
    )


def struck(
    trajectories: Trajectories,
    seen: Signals,
    partner: NDArray[np.uint8],
    collision: NDArray[np.int32],
) -> Mask:
    """Whether the other one ran into the ego, shape (simulation,); not where nobody did.

    Args:
        trajectories: The batch.
        seen: Its signals.
        partner: Slot of the other one, shape (simulation,).
        collision: First frame after the contact, `NEVER` without one, same shape.
    """
    by_other = np.zeros(len(collision), dtype=np.bool_)
    hurt = np.flatnonzero(collision != NEVER)
    if len(hurt):
        before = np.maximum(collision[hurt] - 1, 0)
        by_other[hurt] = _is_struck(trajectories, seen, hurt, partner[hurt], before)
    return by_other


def _is_struck(
    trajectories: Trajectories,
    seen: Signals,
    hurt: NDArray[np.intp],
    partner: NDArray[np.uint8],
    before: NDArray[np.int32],
) -> Mask:
    """Whether the other one ran into the ego, in some simulations.

    In the last frame before the contact: where the two are apart along the road, the one behind
    runs into the one ahead; where they are side by side, the one that moves towards the other
    faster does.
    """
    other = signals_at(trajectories, seen, hurt, partner, before)
    is_left = seen.lateral[hurt, before] > other.lateral
    own, others = seen.lateral_speed[hurt, before], other.lateral_speed
    # Towards the other: to the right for the one on the left.
    towards, towards_ego = np.where(is_left, -own, own), np.where(is_left, others, -others)
    beside = (other.gap < 0) & (other.lateral_gap > other.gap)
    return np.where(beside, towards_ego > towards, other.lead > 0)
