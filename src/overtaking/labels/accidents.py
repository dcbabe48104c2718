"""Collisions of the ego, who ran into whom, and leaving the road."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.model.events import NEVER
from overtaking.model.signals import Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.signals.frames import at, first_true
from overtaking.signals.target import signals_of


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
        others = trajectories.select(hurt), seen.select(hurt)
        by_other[hurt] = _is_struck(*others, partner[hurt], collision[hurt])
    return by_other


def _is_struck(
    trajectories: Trajectories,
    seen: Signals,
    partner: NDArray[np.uint8],
    collision: NDArray[np.int32],
) -> Mask:
    """Whether the other one ran into the ego.

    In the last frame before the contact: where the two are apart along the road, the one behind
    runs into the one ahead; where they are side by side, the one that moves towards the other
    faster does.
    """
    before = np.maximum(collision - 1, 0)
    other = signals_of(trajectories, seen, partner)
    lead, gap, aside = (at(each, before) for each in (other.lead, other.gap, other.lateral_gap))
    is_left = at(seen.lateral, before) > at(other.lateral, before)
    own, others = at(seen.lateral_speed, before), at(other.lateral_speed, before)
    # Towards the other: to the right for the one on the left.
    towards, towards_ego = np.where(is_left, -own, own), np.where(is_left, others, -others)
    beside = (gap < 0) & (aside > gap)
    return np.where(beside, towards_ego > towards, lead > 0)
