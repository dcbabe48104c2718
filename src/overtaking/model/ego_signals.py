"""Signals: time series of the ego, its neighbours and the vehicle that it overtakes.

The ego is the vehicle under study; a batch holds many simulations with one ego each.
`labels.signals` computes the signals from the recorded positions and speeds and from the sizes of
the vehicles, for simulations and recordings of real traffic alike. Detectors of events, rules of
the law and safety measures read them. A `Delayed` batch computes some arrays when they are first
read. A frame is a recorded instant, and a slot is the number of a vehicle in its simulation.

Left is the overtaking side and right the kerb side, also in left-hand traffic, so a mirrored world
has the same signals. On a two-way road the opposing lane counts as one more lane to the left.
Oncoming vehicles do not count as neighbours, and no vehicle in the opposing lane counts in
`left_occupancy` and `left_count`.
"""

from dataclasses import dataclass

from overtaking.core.arrays import F32, U8, Mask
from overtaking.model.batch import Delayed
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE


@dataclass(frozen=True, slots=True, kw_only=True)
class EgoSignals(Delayed):
    """Signals of each ego and of the vehicles around it.

    Arrays have shape (simulation, time), with one entry for each frame of the longest simulation.
    Arrays of neighbours have shape (simulation, neighbour, time) with a `NeighbourRole` as the
    middle index: leader and follower in the ego's lane, in the next lane to the left and in the
    next lane to the right. Where `valid` is false, or `neighbour_slot` is `NO_VEHICLE`, the other
    values are undefined, but finite, so that arithmetic raises no warnings.

    Attributes:
        frame_interval_ms: Time between frames [ms].
        valid: Whether the frame was recorded; false after the end of a simulation.
        lane: Index of the lane that contains the ego's centre: 0 for the slowest. On a two-way road
            the opposing lane has the number of driving lanes as its index. Beyond the last lane on
            the overtaking side the index is one higher than the index of that lane; beyond the edge
            on the kerb side it is 255 (-1 as a uint8).
        s: Position of the ego's centre along the road [m].
        lateral_position: Position of the ego's centre across the road, 0 on the reference line of
            the road and growing to the left [m].
        lateral_speed: Speed of the ego to the left [m/s]: a central difference over about 0.2 s at
            any frame rate, so that recordings of 20 and 25 Hz agree. A choice: 0.2 s.
        speed: Speed of the ego [m/s].
        accel: Acceleration of the ego along its axis [m/s^2].
        right_edge: `lateral_position` of the right-most corner of the ego's body [m].
        left_edge: `lateral_position` of the left-most corner [m].
        neighbour_slot: Slot of the neighbour, its vehicle number in the simulation; `NO_VEHICLE`
            (255) without a neighbour. Shape (simulation, neighbour, time).
        gap: Gap between the bumpers of ego and neighbour, negative alongside, same shape [m].
        closing_speed: Speed at which that gap shrinks, same shape [m/s].
        lateral_gap: Gap across the road between the sides of ego and neighbour, negative where they
            overlap, same shape [m].
        left_occupancy: Share of the lane to the left that vehicles cover, from 100 m behind the
            ego's centre to 100 m ahead of it (a choice); 0 without such a lane, and for the
            opposing lane [1].
        left_count: Number of vehicles in the lane to the left, at any distance as in the definition
            of the reproduced paper (`PaperFeatures`, `pinto2023`); 0 in the same cases.
        friction: Largest friction coefficient between the ego's tyres and the road, at its speed
            and the mean water film of its lane [1].
        sight_lit: Distance at which the ego's driver sees a vehicle ahead with lamps on, by
            weather, light and the course of the road [m].
        sight_unlit: The same for a vehicle whose lamps are off [m].
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
        """Whether the ego has a neighbour in a role, shape (simulation, time); False if not valid.

        Args:
            neighbour: The role, such as `NeighbourRole.LEADER`.
        """
        return self.valid & (self.neighbour_slot[:, neighbour] != NO_VEHICLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSignals(Delayed):
    """Signals of the target, the vehicle that the ego overtakes or would overtake.

    Arrays have shape (simulation, time). Each simulation has at most one target, also in frames in
    which that vehicle is no neighbour. If the ego does not overtake, the target is the leader that
    held it up first (`OvertakeEvents.target_slot`). Where `valid` is false, the other values are
    undefined.

    Attributes:
        valid: Whether the simulation has a target, and the target was recorded in the frame.
        slot: Its slot, `NO_VEHICLE` (255) without a target, shape (simulation,).
        length: Its length, shape (simulation,) [m].
        ego_lead: Position of the ego's centre minus the target's, along the road; negative while
            the target is ahead [m].
        overlaps: Whether the bodies of ego and target overlap along the road, in any lanes.
        gap: Gap between their bumpers, whichever is ahead; negative while they overlap [m].
        lateral_position: Its position across the road, as `EgoSignals.lateral_position` [m].
        lateral_gap: Gap across the road between ego and target, negative where they overlap [m].
        lane: Its lane index, as `EgoSignals.lane`.
        speed: Its speed [m/s].
        accel: Its acceleration along its axis [m/s^2].
        lateral_speed: Its speed to the left, as `EgoSignals.lateral_speed` [m/s].
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
