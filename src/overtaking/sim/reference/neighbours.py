"""Neighbours of each vehicle: six, by lane, ahead and behind, of its own direction."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.sim.reference.environment import lane_value
from overtaking.sim.reference.state import NOBODY, Fields, State, pick
from overtaking.world.step_parameters import StepParameters

_FAR = np.float32(1e9)  # Gap without a neighbour [m].
_SHIFTS = (0.0, 1.0, -1.0)  # The own, the faster and the slower lane, from the own.


@dataclass(slots=True, kw_only=True)
class Neighbours:
    """Nearest vehicles by role (see `state`).

    Attributes:
        slot: Whole-number slots or `NOBODY`, (role, vehicle, simulation).
        gap: Bumper-to-bumper gap, negative when alongside, (role, vehicle, simulation) [m].
        distance: Distance of the centres along the road, never negative,
            (role, vehicle, simulation) [m].
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


def lane_borders(state: State, given: StepParameters, shift: float) -> tuple[F32, F32]:
    """Borders of the lane `shift` lanes from each vehicle's own [m]."""
    road = given.road
    low = lane_value(road.boundaries, state.lane + np.float32(shift), road.num_lanes + 1)
    high = lane_value(road.boundaries, state.lane + np.float32(shift + 1.0), road.num_lanes + 1)
    return low, high


def find_neighbours(state: State, given: StepParameters, p: Fields) -> Neighbours:
    """The nearest vehicle ahead and behind in the own, the faster and the slower lane.

    A vehicle counts in every lane that its body overlaps by more than the margin, so one that
    straddles a line is seen by both lanes; and in the lane that it is changing to, from the first
    moment if it signals, and else as soon as it visibly moves over. Those who make for one place
    from both sides would else see each other too late.
    """
    bands = [lane_borders(state, given, shift) for shift in _SHIFTS]
    found = _Nearest(state.s.shape)
    for j in range(state.s.shape[0]):
        ahead, beside = along(given, state.s[j] - state.s), state.d[j] - state.d
        others = (p.valid[j] > 0) & (p.travel_sign[j] == p.travel_sign)
        others[j] = False
        shows = shows_change(state, given, j)
        for k, (low, high) in enumerate(bands):
            heading = shows & (state.lane[j] - state.lane == _SHIFTS[k])
            inside = others & (_overlaps(state, given, p, j, low, high) | heading)
            found.offer(2 * k, j, inside & (ahead >= 0), ahead, beside)
            found.offer(2 * k + 1, j, inside & (ahead < 0), -ahead, beside)
    half = pick(p.half_length, found.slot)
    return Neighbours(
        slot=found.slot,
        gap=found.distance - (half + p.half_length),
        distance=found.distance,
        aside=found.aside,
        half_length=half,
        lane_low=bands[0][0],
        lane_high=bands[0][1],
    )


def along(given: StepParameters, distance: F32) -> F32:
    """A distance along the road; on a ring that to the nearest image [m]."""
    q = given.simulations
    ring, inverse = q.ring_length, q.inverse_ring_length
    return distance - ring * np.rint(distance * inverse)


def shows_change(state: State, given: StepParameters, j: int) -> Mask:
    """Whether others can tell to which lane vehicle `j` is changing."""
    changing = (state.path_time[j] < state.path_duration[j]) & (state.crashed[j] == 0)
    moves = state.path_time[j] > given.constants.visible_fraction * state.path_duration[j]
    return changing & ((state.indicator[j] != 0) | moves)


def _overlaps(state: State, given: StepParameters, p: Fields, j: int, low: F32, high: F32) -> Mask:
    """Whether the body of vehicle `j` is in the lane between two borders, for each driver."""
    margin = given.constants.corridor_margin
    low_side, high_side = state.d[j] - p.half_width[j], state.d[j] + p.half_width[j]
    return (high_side > low + margin) & (low_side < high - margin)


class _Nearest:
    """The nearest vehicle found so far in each role, (role, vehicle, simulation)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.slot = np.full((6, *shape), NOBODY)
        self.distance = np.full((6, *shape), _FAR)
        self.aside = np.zeros((6, *shape), np.float32)

    def offer(self, role: int, j: int, mask: Mask, distance: F32, aside: F32) -> None:
        """Take vehicle `j` for a role where it is nearer; the lower slot wins a tie."""
        nearer = mask & (distance < self.distance[role])
        self.distance[role] = np.where(nearer, distance, self.distance[role])
        self.slot[role] = np.where(nearer, np.float32(j), self.slot[role])
        self.aside[role] = np.where(nearer, aside, self.aside[role])
