"""Perception of drivers at one decision: data only, without the functions that compute it.

A *role* is the place of a neighbour: leader, follower, left leader, left follower, right leader,
right follower; the first axis of arrays by role has this order. Left is the overtaking side. A
*slot* is the number of a vehicle in its simulation, a whole float32.
"""

from dataclasses import dataclass

from overtaking.core.arrays import F32, Mask


@dataclass(slots=True, kw_only=True)
class Neighbours:
    """Nearest vehicles in the same direction of travel by role.

    Attributes:
        slot: Slot of the neighbour, `NO_SLOT` without one, (role, vehicle, simulation).
        gap: Gap between bumpers, negative when alongside, (role, vehicle, simulation) [m].
        distance: Distance of the centres along the road, never negative,
            (role, vehicle, simulation) [m].
        lateral_distance: Lateral position of the neighbour minus the driver's, positive to the
            left, (role, vehicle, simulation) [m].
        half_length: Half of the neighbour's length, (role, vehicle, simulation) [m].
        lane_right_edge: Right border of the driver's lane, (vehicle, simulation) [m].
        lane_left_edge: Left border of the driver's lane, (vehicle, simulation) [m].
    """

    slot: F32
    gap: F32
    distance: F32
    lateral_distance: F32
    half_length: F32
    lane_right_edge: F32
    lane_left_edge: F32


@dataclass(slots=True, kw_only=True)
class Beliefs:
    """Beliefs of drivers about their neighbours, (role, vehicle, simulation).

    Attributes:
        is_detected: Whether the driver has detected the neighbour.
        gap: Believed gap, `ModelConstants.unseen_gap` without a detected neighbour [m].
        closing_speed: Believed speed at which the gap shrinks, 0 without a detected neighbour
            [m/s].
        accel: Believed acceleration of a neighbour ahead, never positive; 0 for one behind [m/s^2].
    """

    is_detected: Mask
    gap: F32
    closing_speed: F32
    accel: F32


@dataclass(slots=True, kw_only=True)
class OncomingVehicle:
    """The nearest oncoming vehicle of each driver, and the driver's beliefs about it.

    Arrays have shape (vehicle, simulation).

    Attributes:
        slot: Slot of the vehicle, `NO_SLOT` without one.
        gap: Gap between the front bumpers [m].
        half_length: Half of its length [m].
        is_detected: Whether the driver has detected it.
        is_certain: Whether the driver has looked long enough to know if a vehicle is coming.
        believed_gap: Believed gap, `ModelConstants.oncoming_range` without a detected vehicle [m].
        closing_speed: Believed closing speed; without a detected vehicle the closing speed of one
            that the driver assumes to be out of sight [m/s].
        sight_distance: Sight distance in the lane of the vehicle: the opposing lane, or for
            `in_own_lane` the driver's own [m].
    """

    slot: F32
    gap: F32
    half_length: F32
    is_detected: Mask
    is_certain: Mask
    believed_gap: F32
    closing_speed: F32
    sight_distance: F32


@dataclass(slots=True, kw_only=True)
class OncomingTraffic:
    """Traffic of the other direction on a two-way road; arrays of shape (vehicle, simulation).

    Attributes:
        nearest: The nearest oncoming vehicle in any lane, which limits a pass.
        in_own_lane: The nearest oncoming vehicle in the driver's own lane.
        is_being_passed: Whether another vehicle passes the driver and the driver notices it.
        leader_pulls_out: Whether the leader indicates that it will pull out itself.
    """

    nearest: OncomingVehicle
    in_own_lane: OncomingVehicle
    is_being_passed: Mask
    leader_pulls_out: Mask


@dataclass(slots=True, kw_only=True)
class DecisionContext:
    """Perception of the drivers of a batch at one decision.

    Attributes:
        neighbours: The nearest vehicles in the same direction of travel, as they are.
        beliefs: Beliefs of each driver about them.
        checks_mirrors: Whether the driver checks mirrors and adjacent lanes now, (vehicle,
            simulation). Between such looks it keeps its intention.
        gives_way: Whether another driver that indicates for the same gap goes first, (vehicle,
            simulation).
        oncoming: Vehicles of the other direction; None on one-way roads.
        decision_index: Index of the decision since the start of the simulation, 20 per second.
    """

    neighbours: Neighbours
    beliefs: Beliefs
    checks_mirrors: Mask
    gives_way: Mask
    oncoming: OncomingTraffic | None
    decision_index: int
