"""Signals of the ego, frame by frame, from a recording of any origin.

Left and right are meant as in right-hand traffic, the law's point of view: left is the fast side,
right the slow side. In left-hand traffic they are the mirror image, so a mirrored world has the
same signals.
"""

from dataclasses import dataclass
from enum import IntEnum

from overtaking.core.arrays import F32, U8, Mask
from overtaking.model.batch import Delayed
from overtaking.model.trajectory import NO_VEHICLE


class Around(IntEnum):
    """Neighbours of the ego, the order of the `neighbour` axis.

    A leader's centre is not behind the ego's centre, a follower's is; each is the nearest one whose
    centre lies in that lane. Alongside, a gap is negative.
    """

    LEADER = 0
    FOLLOWER = 1
    LEFT_LEADER = 2
    LEFT_FOLLOWER = 3
    RIGHT_LEADER = 4
    RIGHT_FOLLOWER = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Signals(Delayed):
    """Ego-centred signals of a batch.

    Arrays have shape (simulation, time), or (simulation, neighbour, time) with `Around` as the
    middle axis. Where `valid` is false, and where `vehicle` is `NO_VEHICLE`, the values are finite
    and mean nothing.

    Attributes:
        frame_interval_ms: Time between frames [ms].
        valid: Whether the frame was recorded.
        lane: Lane index of the ego's centre, 0 the slowest; `num_lanes` beyond the fast edge, 255
            beyond the slow edge.
        s: Position of the ego along the road [m].
        lateral: Position of the ego across the road, growing to the left [m].
        lateral_speed: Speed of the ego to the left, a central difference over about 0.2 s [m/s].
        speed: Of the ego [m/s].
        accel: Of the ego, along its axis [m/s^2].
        right_reach: `lateral` of the right-most corner of the ego's body [m].
        left_reach: `lateral` of its left-most corner [m].
        vehicle: Slot of the neighbour, `NO_VEHICLE` if there is none, (simulation, neighbour,
            time).
        gap: Between the bumpers of ego and neighbour, negative alongside, same shape [m].
        closing_speed: Speed at which that gap shrinks, same shape [m/s].
        lateral_gap: Between the sides of their bodies, negative where they overlap, same shape [m].
        left_occupancy: Vehicle lengths within 100 m ahead and behind in the lane to the left, over
            200 m [1].
        left_count: Number of vehicles in the lane to the left.
        friction: Peak friction under the ego at its speed on the mean film of its lane [1].
        sight_lit: Distance at which a lit vehicle ahead is seen [m].
        sight_unlit: Distance at which an unlit one is seen [m].
    """

    frame_interval_ms: int
    valid: Mask
    lane: U8
    s: F32
    lateral: F32
    lateral_speed: F32
    speed: F32
    accel: F32
    right_reach: F32
    left_reach: F32
    vehicle: U8
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

    def has(self, neighbour: Around) -> Mask:
        """Whether a vehicle is at a position around the ego, shape (simulation, time)."""
        return self.valid & (self.vehicle[:, neighbour] != NO_VEHICLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSignals(Delayed):
    """The vehicle that each ego attempts to overtake, frame by frame.

    Arrays have shape (simulation, time). Where a simulation has no target, `valid` is false.

    Attributes:
        valid: Whether there is a target and the frame was recorded.
        vehicle: Its slot, `NO_VEHICLE` without a target, shape (simulation,).
        length: Its length, shape (simulation,) [m].
        lead: Centre of the ego minus its centre, along the road: negative while it is ahead [m].
        overlaps: Whether ego and target overlap along the road.
        gap: Between their bumpers, whichever is ahead; negative while they overlap [m].
        lateral: Its position across the road, as `Signals.lateral` [m].
        lateral_gap: Between the sides of their bodies [m].
        lane: Its lane index, as `Signals.lane`.
        speed: Its speed [m/s].
        accel: Its acceleration [m/s^2].
        lateral_speed: Its speed to the left [m/s].
    """

    valid: Mask
    vehicle: U8
    length: F32
    lead: F32
    overlaps: Mask
    gap: F32
    lateral: F32
    lateral_gap: F32
    lane: U8
    speed: F32
    accel: F32
    lateral_speed: F32
