"""The ego and one of its neighbours, at any instants, as one vehicle behind another."""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import as_f32
from overtaking.labels.signals.engine import neighbours_at
from overtaking.labels.signals.reference import METRES
from overtaking.model.labels import Case
from overtaking.model.safety import Encounter
from overtaking.model.signals import Around
from overtaking.model.vehicles import Role
from overtaking.world.measures import drac, time_gap, ttc, ttc_accel

Index = NDArray[np.intp]


class Side(Enum):
    """Whether the neighbour is ahead of the ego or behind it."""

    AHEAD = 0
    BEHIND = 1


def encounter(
    case: Case, place: Around | Index, side: Side, rows: Index, frames: Index
) -> Encounter:
    """What the gap between the ego and a neighbour means for whoever is behind.

    Args:
        case: The batch.
        place: Place around the ego, or one for each instant.
        side: The side that all of these places lie on.
        rows: Simulations, shape (instant,).
        frames: A frame of each, same shape.

    Returns:
        Arrays of shape (instant,).
    """
    seen, accels = case.signals, case.trajectories.states.accel_lon
    other = neighbours_at(case.trajectories, seen, place, rows, frames)
    valid, gap, closing = other.exists, other.gap, other.closing_speed
    # Numbers of single cells are found faster than pairs of them.
    own = rows * seen.num_frames + frames
    own_speed, own_accel = (each.reshape(-1).take(own) for each in (seen.speed, seen.accel))
    accel = as_f32(accels[rows, np.where(valid, other.vehicle, Role.EGO), frames]) * METRES
    ahead = side is Side.AHEAD
    speed = own_speed if ahead else own_speed + closing
    closing_accel = own_accel - accel if ahead else accel - own_accel
    return Encounter(
        valid=valid,
        gap=gap,
        closing_speed=closing,
        time_gap=time_gap(gap, speed),
        ttc=ttc(gap, closing),
        mttc=ttc_accel(gap, closing, closing_accel),
        drac=drac(gap, closing),
    )
