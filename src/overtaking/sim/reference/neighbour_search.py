"""Search for the six neighbours of each vehicle among those that travel in its direction.

Arrays have shape (vehicle, simulation) unless stated. Lanes and their borders are numbered from the
right; left is the overtaking side. During a lane change a vehicle's own lane is the one that it
enters. A *role* is one of the six places of a neighbour, such as `LEFT_LEADER`.
"""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.sim.reference.decision_context import Neighbours
from overtaking.sim.reference.road_conditions import value_of_lane
from overtaking.sim.reference.state import FAR, NO_SLOT, State, value_at_slot
from overtaking.world.step_parameters import StepParameters

_LANE_OFFSETS = (0.0, 1.0, -1.0)
"""The vehicle's own lane, the left and the right one, in the order of the roles [lanes]."""


def lane_borders(state: State, params: StepParameters, offset: float) -> tuple[F32, F32]:
    """Right and left border of the lane `offset` lanes to the left of each vehicle's lane [m].

    Outside the road both borders are the edge of the road.
    """
    boundaries, num_boundaries = params.road.boundaries, params.road.num_lanes + 1
    lane = state.lane_choice.lane
    right = value_of_lane(boundaries, lane + np.float32(offset), num_boundaries)
    left = value_of_lane(boundaries, lane + np.float32(offset + 1.0), num_boundaries)
    return right, left


def find_neighbours(state: State, params: StepParameters) -> Neighbours:
    """The nearest vehicle ahead and behind in each vehicle's own, left and right lane.

    A vehicle counts in every lane that its body overlaps by more than `corridor_margin`; one that
    straddles a line counts in both lanes. It also counts in the lane to which it changes: at once
    if it indicates, otherwise when it visibly moves over. Without this rule, two drivers that move
    to one gap from both sides see each other too late.
    """
    vehicles, motion, lane = params.vehicles, state.motion, state.lane_choice.lane
    borders = [lane_borders(state, params, offset) for offset in _LANE_OFFSETS]
    nearest = _NearestByRole(motion.s.shape)
    for other_slot in range(len(motion.s)):
        distance_ahead = nearest_image(params, motion.s[other_slot] - motion.s)
        lateral_distance = motion.d[other_slot] - motion.d
        # Both directions of travel have coordinates of their own, so only one's own is compared.
        is_candidate = (vehicles.valid[other_slot] > 0) & (
            vehicles.travel_sign[other_slot] == vehicles.travel_sign
        )
        is_candidate[other_slot] = False
        changes_lane = visibly_changes_lane(state, params, other_slot)
        for k, offset in enumerate(_LANE_OFFSETS):
            changes_to_lane = changes_lane & (lane[other_slot] - lane == offset)
            overlaps_lane = _overlaps_lane(state, params, other_slot, borders[k])
            counts_in_lane = is_candidate & (overlaps_lane | changes_to_lane)
            is_leader = counts_in_lane & (distance_ahead >= 0)
            is_follower = counts_in_lane & (distance_ahead < 0)
            # Roles come in pairs of leader and follower, in the order of the lanes.
            role = 2 * k
            nearest.consider(role, other_slot, is_leader, distance_ahead, lateral_distance)
            nearest.consider(role + 1, other_slot, is_follower, -distance_ahead, lateral_distance)
    # Without a neighbour this is the length of slot 0, and the gap stays at about `FAR`.
    half_length = value_at_slot(vehicles.half_length, nearest.slot)
    return Neighbours(
        slot=nearest.slot,
        gap=nearest.distance - (half_length + vehicles.half_length),
        distance=nearest.distance,
        lateral_distance=nearest.lateral_distance,
        half_length=half_length,
        lane_right_edge=borders[0][0],
        lane_left_edge=borders[0][1],
    )


def nearest_image(params: StepParameters, distance: F32) -> F32:
    """A signed distance along the road; on a ring road the shorter way round [m]."""
    simulations = params.simulations
    length, inverse_length = simulations.ring_length, simulations.inverse_ring_length
    # On other roads the inverse length is 0, so the distance is unchanged.
    return distance - length * np.rint(distance * inverse_length)


def visibly_changes_lane(state: State, params: StepParameters, slot: int) -> Mask:
    """Whether the vehicle in a slot changes lanes and others can see it, (simulation,)."""
    # A wreck counts only where its body is. Without this rule a wreck with its indicator on counted
    # in its new lane however far away it slid, and drivers braked in a free lane.
    elapsed, duration = state.path.elapsed[slot], state.path.duration[slot]
    is_changing_lane = (elapsed < duration) & (state.motion.is_wreck[slot] == 0)
    has_visibly_moved = elapsed > params.constants.visible_fraction * duration
    return is_changing_lane & ((state.controls.indicator[slot] != 0) | has_visibly_moved)


def _overlaps_lane(
    state: State, params: StepParameters, slot: int, borders: tuple[F32, F32]
) -> Mask:
    """Whether the vehicle in a slot overlaps the lane between each driver's two borders."""
    d, half_width = state.motion.d[slot], params.vehicles.half_width[slot]
    margin = params.constants.corridor_margin
    right_border, left_border = borders
    return (d + half_width > right_border + margin) & (d - half_width < left_border - margin)


class _NearestByRole:
    """The nearest vehicle so far in each role, (role, vehicle, simulation)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Start without any vehicle."""
        self.slot = np.full((6, *shape), NO_SLOT)
        self.distance = np.full((6, *shape), FAR)
        self.lateral_distance = np.zeros((6, *shape), np.float32)

    def consider(
        self, role: int, slot: int, is_candidate: Mask, distance: F32, lateral_distance: F32
    ) -> None:
        """Take a vehicle for a role where it is nearer; the lower slot wins a tie."""
        is_nearer = is_candidate & (distance < self.distance[role])
        self.distance[role] = np.where(is_nearer, distance, self.distance[role])
        self.slot[role] = np.where(is_nearer, np.float32(slot), self.slot[role])
        self.lateral_distance[role] = np.where(
            is_nearer, lateral_distance, self.lateral_distance[role]
        )
