"""Neighbours of each vehicle: six, by lane, ahead and behind, of its own direction."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.sim.reference.decision_context import Neighbours
from overtaking.sim.reference.road_conditions import value_of_lane
from overtaking.sim.reference.state import NO_SLOT, State, value_at_slot
from overtaking.world.step_parameters import StepParameters

_FAR = np.float32(1e9)  # Gap without a neighbour [m].


_LANE_OFFSETS = (0.0, 1.0, -1.0)  # The own, the faster and the slower lane, from the own.


def lane_borders(state: State, params: StepParameters, shift: float) -> tuple[F32, F32]:
    """Borders of the lane `shift` lanes from each vehicle's own [m]."""
    road = params.road
    low = value_of_lane(
        road.boundaries, state.lane_choice.lane + np.float32(shift), road.num_lanes + 1
    )
    high = value_of_lane(
        road.boundaries, state.lane_choice.lane + np.float32(shift + 1.0), road.num_lanes + 1
    )
    return low, high


def find_neighbours(state: State, params: StepParameters) -> Neighbours:
    """The nearest vehicle ahead and behind in the own, the left and the right lane.

    A vehicle counts in every lane that its body overlaps by more than the margin, so one that
    straddles a line counts in both lanes. It also counts in the lane that it changes to: at once if
    it indicates, otherwise when it visibly moves over. Without this, two drivers that move to one
    gap from both sides would see each other too late.
    """
    vehicles = params.vehicles
    bands = [lane_borders(state, params, shift) for shift in _LANE_OFFSETS]
    found = _NearestByRole(state.motion.s.shape)
    for j in range(state.motion.s.shape[0]):
        ahead, beside = (
            nearest_image(params, state.motion.s[j] - state.motion.s),
            state.motion.d[j] - state.motion.d,
        )
        others = (vehicles.valid[j] > 0) & (vehicles.travel_sign[j] == vehicles.travel_sign)
        others[j] = False
        shows = visibly_changes_lane(state, params, j)
        for k, (low, high) in enumerate(bands):
            heading = shows & (
                state.lane_choice.lane[j] - state.lane_choice.lane == _LANE_OFFSETS[k]
            )
            inside = others & (_is_in_lane(state, params, j, low, high) | heading)
            found.consider(2 * k, j, inside & (ahead >= 0), ahead, beside)
            found.consider(2 * k + 1, j, inside & (ahead < 0), -ahead, beside)
    half = value_at_slot(vehicles.half_length, found.slot)
    return Neighbours(
        slot=found.slot,
        gap=found.distance - (half + vehicles.half_length),
        distance=found.distance,
        lateral_distance=found.aside,
        half_length=half,
        lane_right_edge=bands[0][0],
        lane_left_edge=bands[0][1],
    )


def nearest_image(params: StepParameters, distance: F32) -> F32:
    """A distance along the road; on a ring that to the nearest image [m]."""
    simulations = params.simulations
    ring, inverse = simulations.ring_length, simulations.inverse_ring_length
    return distance - ring * np.rint(distance * inverse)


def visibly_changes_lane(state: State, params: StepParameters, j: int) -> Mask:
    """Whether others can tell to which lane vehicle `j` is changing."""
    # A wreck counts only where its body is. With its indicator on it stayed a neighbour in the lane
    # that it had been changing to, however far it slid, and other drivers braked in a free lane.
    changing = (state.path.elapsed[j] < state.path.duration[j]) & (state.motion.is_wreck[j] == 0)
    moves = state.path.elapsed[j] > params.constants.visible_fraction * state.path.duration[j]
    return changing & ((state.controls.indicator[j] != 0) | moves)


def _is_in_lane(state: State, params: StepParameters, j: int, low: F32, high: F32) -> Mask:
    """Whether the body of vehicle `j` is in the lane between two borders, for each driver."""
    vehicles = params.vehicles
    margin = params.constants.corridor_margin
    low_side, high_side = (
        state.motion.d[j] - vehicles.half_width[j],
        state.motion.d[j] + vehicles.half_width[j],
    )
    return (high_side > low + margin) & (low_side < high - margin)


class _NearestByRole:
    """The nearest vehicle found so far in each role, (role, vehicle, simulation)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.slot = np.full((6, *shape), NO_SLOT)
        self.distance = np.full((6, *shape), _FAR)
        self.aside = np.zeros((6, *shape), np.float32)

    def consider(self, role: int, j: int, mask: Mask, distance: F32, aside: F32) -> None:
        """Take vehicle `j` for a role where it is nearer; the lower slot wins a tie."""
        nearer = mask & (distance < self.distance[role])
        self.distance[role] = np.where(nearer, distance, self.distance[role])
        self.slot[role] = np.where(nearer, np.float32(j), self.slot[role])
        self.aside[role] = np.where(nearer, aside, self.aside[role])
