"""Who drives around each vehicle: six neighbours by lane and direction."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32
from overtaking.sim.parameters import Parameters
from overtaking.sim.reference.environment import lane_value
from overtaking.sim.reference.state import NOBODY, Fields, State, pick

_FAR = np.float32(1e9)


@dataclass(slots=True, kw_only=True)
class Neighbours:
    """Nearest vehicles by role (see `state`).

    Attributes:
        slot: Whole-number slots or `NOBODY`, (role, vehicle, simulation).
        gap: Bumper-to-bumper gap, negative when alongside, (role, vehicle, simulation) [m].
        distance: Distance of the centres along the road, never negative, (role, vehicle, simulation) [m].
        aside: How far it is towards the fast side, (role, vehicle, simulation) [m].
        half_length: Half of its length, (role, vehicle, simulation) [m].
        lane_low: Slow-side border of the own lane, (vehicle, simulation) [m].
        lane_high: Fast-side border of the own lane, (vehicle, simulation) [m].
    """

    slot: F32
    gap: F32
    distance: F32
    aside: F32
    half_length: F32
    lane_low: F32
    lane_high: F32


def lane_borders(state: State, given: Parameters, shift: float) -> tuple[F32, F32]:
    """Borders of the lane `shift` lanes from each vehicle's own [m]."""
    road = given.road
    low = lane_value(road.boundaries, state.lane + np.float32(shift), road.num_lanes + 1)
    high = lane_value(road.boundaries, state.lane + np.float32(shift + 1.0), road.num_lanes + 1)
    return low, high


def find_neighbours(state: State, given: Parameters, p: Fields) -> Neighbours:
    """The nearest vehicle ahead and behind in the own, the faster and the slower lane.

    A vehicle counts in every lane that its body overlaps by more than the margin, so one that
    straddles a line is seen by both lanes.
    """
    c = given.constants
    bands = [lane_borders(state, given, shift) for shift in (0.0, 1.0, -1.0)]
    shape = (6, *state.s.shape)
    slot = np.full(shape, NOBODY, np.float32)
    nearest = np.full(shape, _FAR, np.float32)
    aside = np.zeros(shape, np.float32)
    for j in range(state.s.shape[0]):
        ahead = state.s[j] - state.s
        beside = state.d[j] - state.d
        others = np.broadcast_to(p.valid[j] > 0, ahead.shape).copy()
        others[j] = False
        low_side = state.d[j] - p.half_width[j]
        high_side = state.d[j] + p.half_width[j]
        for k, (low, high) in enumerate(bands):
            inside = (
                others
                & (high_side > low + c.corridor_margin)
                & (low_side < high - c.corridor_margin)
            )
            front = inside & (ahead >= 0) & (ahead < nearest[2 * k])
            back = inside & (ahead < 0) & (-ahead < nearest[2 * k + 1])
            nearest[2 * k] = np.where(front, ahead, nearest[2 * k])
            slot[2 * k] = np.where(front, np.float32(j), slot[2 * k])
            aside[2 * k] = np.where(front, beside, aside[2 * k])
            nearest[2 * k + 1] = np.where(back, -ahead, nearest[2 * k + 1])
            slot[2 * k + 1] = np.where(back, np.float32(j), slot[2 * k + 1])
            aside[2 * k + 1] = np.where(back, beside, aside[2 * k + 1])
    half = pick(p.half_length, slot)
    return Neighbours(
        slot=slot,
        gap=nearest - (half + p.half_length),
        distance=nearest,
        aside=aside,
        half_length=half,
        lane_low=bands[0][0],
        lane_high=bands[0][1],
    )
