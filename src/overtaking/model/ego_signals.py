"""Signals of the ego, frame by frame, from a recording of any origin.

Left is the overtaking side and right the kerb side, also in left-hand traffic, so a mirrored world
has the same signals.
"""

from dataclasses import dataclass

from overtaking.core.arrays import F32, U8, Mask
from overtaking.model.batch import Delayed
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE


@dataclass(frozen=True, slots=True, kw_only=True)
class EgoSignals(Delayed):
    """Ego-centred signals of a batch.

    Arrays have shape (simulation, time), or (simulation, neighbour, time) with `NeighbourRole` as
    the middle axis. Where `valid` is false, and where `neighbour_slot` is `NO_VEHICLE`, the values
    are finite and undefined.

    Attributes:
        frame_interval_ms: Time between frames [ms].
        valid: Whether the frame was recorded.
        lane: Lane index of the ego's centre, 0 the slowest; `num_lanes` beyond the edge on the
            overtaking side, 255 beyond the edge on the kerb side.
        s: Position of the ego along the road [m].
        lateral_position: Position of the ego across the road, growing to the left [m].
        lateral_speed: Speed of the ego to the left, a central difference over about 0.2 s [m/s].
        speed: Speed of the ego [m/s].
        accel: Acceleration of the ego along its axis [m/s^2].
        right_edge: `lateral_position` of the right-most corner of the ego's body [m].
        left_edge: `lateral_position` of its left-most corner [m].
        neighbour_slot: Slot of the neighbour, `NO_VEHICLE` without a neighbour, shape (simulation,
            neighbour, time).
        gap: Gap between the bumpers of ego and neighbour, negative alongside, same shape [m].
        closing_speed: Speed at which that gap shrinks, same shape [m/s].
        lateral_gap: Gap between the sides of their bodies, negative where they overlap, same
            shape [m].
        left_occupancy: Vehicle lengths within 100 m ahead and behind in the lane to the left, over
            200 m [1].
        left_count: Number of vehicles in the lane to the left.
        friction: Peak friction under the ego at its speed on the mean film of its lane [1].
        sight_lit: Distance at which the ego's driver sees a lit vehicle ahead [m].
        sight_unlit: Distance at which the ego's driver sees an unlit vehicle ahead [m].
    """

    frame_interval_ms: int
    valid: Mask
    lane: U8
    s: F32
    lateral_position: F32
    lateral_speed: F32
    speed: F32
    accel: F32
    right_edge: F32
    left_edge: F32
    neighbour_slot: U8
    gap: F32
    closing_speed: F32
    lateral_gap: F32
    left_occupancy: F32
    left_count: U8
    friction: F32
    sight_lit: F32
    sight_unlit: F32

    @property
    def num_simulations(self) -> int:
        """Number of simulations in the batch."""
        return self.lane.shape[0]

    @property
    def num_frames(self) -> int:
        """Number of frames of the longest simulation."""
        return self.lane.shape[1]

    def has_neighbour(self, neighbour: NeighbourRole) -> Mask:
        """Whether the ego has a neighbour in a role, shape (simulation, time)."""
        return self.valid & (self.neighbour_slot[:, neighbour] != NO_VEHICLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSignals(Delayed):
    """The vehicle that each ego attempts to overtake, frame by frame.

    Arrays have shape (simulation, time). Where a simulation has no target, `valid` is false.

    Attributes:
        valid: Whether there is a target and the frame was recorded.
        slot: Its slot, `NO_VEHICLE` without a target, shape (simulation,).
        length: Its length, shape (simulation,) [m].
        ego_lead: Centre of the ego minus its centre, along the road: negative while it is ahead
            [m].
        overlaps: Whether ego and target overlap along the road.
        gap: Gap between their bumpers, whichever is ahead; negative while they overlap [m].
        lateral_position: Its position across the road, as `EgoSignals.lateral_position` [m].
        lateral_gap: Gap between the sides of their bodies [m].
        lane: Its lane index, as `EgoSignals.lane`.
        speed: Its speed [m/s].
        accel: Its acceleration [m/s^2].
        lateral_speed: Its speed to the left [m/s].
    """

    valid: Mask
    slot: U8
    length: F32
    ego_lead: F32
    overlaps: Mask
    gap: F32
    lateral_position: F32
    lateral_gap: F32
    lane: U8
    speed: F32
    accel: F32
    lateral_speed: F32
