"""Whether drivers pass against oncoming traffic: the way, the time for it, and what they see.

Everybody does so by the same rules, the ego and the others; `who` says of whom arrays tell.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import maximum, minimum
from overtaking.sim.reference.decision_context import Neighbours, OncomingVehicle
from overtaking.sim.reference.state import LEADER, SlotSelection, State, value_at_slot
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters, VehicleParameters

MIN_CLOSING_SPEED = np.float32(0.5)
"""Least surplus of speed to be past with, and of approach [m/s]."""

_FAR = np.float32(1e9)
_MIN_ACCEL = np.float32(0.1)  # Keeps the time of accelerating finite [m/s^2].
_ZERO = np.float32(0.0)
_HALF = np.float32(0.5)
_TWO = np.float32(2.0)


def time_to_gain(way: F32, faster: F32, top: F32, accel: F32) -> F32:
    """Time to gain a way on another vehicle, at constant acceleration up to a top speed [s].

    Args:
        way: The way [m].
        faster: How much faster one is now [m/s].
        top: How much faster one gets at most [m/s].
        accel: Acceleration [m/s^2].
    """
    a, most = maximum(accel, _MIN_ACCEL), maximum(top, MIN_CLOSING_SPEED)
    v = minimum(maximum(faster, _ZERO), most)
    ramp = (most - v) / a
    covered = _HALF * (v + most) * ramp
    within = (np.sqrt(v * v + _TWO * a * way) - v) / a
    return np.where(way < covered, within, ramp + (way - covered) / most)


def expected_accel(constants: ModelConstants, own: VehicleParameters, speed: F32, top: F32) -> F32:
    """The acceleration that drivers reckon with on the way up to a speed [m/s^2].

    It is the acceleration that they like to use, limited to what the engine can give halfway. The
    trait `passing_time_factor`, which has a source, is their error about the resulting time; they
    know what their vehicle can do.

    Args:
        constants: Constants of the model.
        own: Parameters of the drivers.
        speed: Their own [m/s].
        top: The speed that they pass at [m/s].
    """
    halfway = _HALF * (speed + maximum(top, speed))
    engine = minimum(own.launch_force, own.power / maximum(halfway, constants.slip_speed))
    left = (engine - (own.drag * halfway * halfway + own.rolling)) * own.inverse_mass
    return minimum(constants.accelerate_gain * own.accel, left)


def passing_speed(own: VehicleParameters, surplus: np.float32, leader: F32) -> F32:
    """The speed that is passed at: well above that of the other, if the vehicle can [m/s].

    Who heeds the limit on a free road heeds it as much while passing, and takes longer.

    Args:
        own: Parameters of the drivers.
        surplus: How much faster than the other drivers want to be [m/s].
        leader: Speed of the other [m/s].
    """
    wanted = maximum(own.passing_speed, leader + surplus)
    heeded = wanted - own.speed_limit_compliance * maximum(wanted - own.speed_limit, _ZERO)
    return minimum(heeded, own.max_speed)


def current_passing_speed(state: State, params: StepParameters) -> F32:
    """The speed that drivers who pass want now, (vehicle, simulation) [m/s]."""
    vehicles = params.vehicles
    constants = params.constants
    along, _ = state.road_velocity()
    top = passing_speed(
        vehicles, constants.passing_speed_surplus, value_at_slot(along, state.overtake.target_slot)
    )
    return minimum(
        np.where(state.overtake.must_return_urgently > 0, constants.urgent_speed_factor * top, top),
        vehicles.max_speed,
    )


def time_to_pass(
    constants: ModelConstants, own: VehicleParameters, way: F32, speed: F32, faster: F32, other: F32
) -> F32:
    """How long drivers reckon to take to gain a way on another [s].

    Args:
        constants: Constants of the model.
        own: Parameters of the drivers.
        way: The way [m].
        speed: Their own [m/s].
        faster: How much faster that is than the other [m/s].
        other: Speed of the other [m/s].
    """
    top = passing_speed(own, constants.passing_speed_surplus, other)
    return time_to_gain(way, faster, top - other, expected_accel(constants, own, speed, top))


def assumed_oncoming_gap(own: VehicleParameters, gap: F32, sight: F32) -> F32:
    """The way up to who comes, or may come from where the road is not seen [m].

    Few reckon with somebody at the very end of what they see: who does come then comes in sight
    while they pass.

    Args:
        own: Parameters of the drivers.
        gap: Believed gap to who comes [m].
        sight: How far the other lane is seen [m].
    """
    return minimum(gap, own.assumed_sight_factor * sight)


def tall_vehicle_gap_factor(params: StepParameters, slot: F32) -> F32:
    """How much more room drivers leave to the vehicle in a slot than to a car [1].

    Source:
        The Highway Code, rule 164 (drop back behind large vehicles, to see and be seen).
    """
    vehicles, constants = params.vehicles, params.constants
    return np.where(
        value_at_slot(vehicles.blocks_view, slot) > 0,
        constants.tall_vehicle_gap_factor,
        np.float32(1.0),
    )


@dataclass(slots=True, kw_only=True)
class PassingOpportunity:
    """What drivers know about the opposing lane before they pull out, shape of the slots.

    Attributes:
        leader_gap: Believed gap to the leader [m].
        leader_speed: Believed speed of the leader [m/s].
        leader_length: Length of the leader [m].
        gap_ahead_of_leader: Gap between the leader and the next vehicle ahead of it [m].
        assumed_oncoming_gap: Distance at which the driver assumes an oncoming vehicle [m].
        oncoming_closing_speed: Believed or expected closing speed of that vehicle [m/s].
        is_certain: Whether the driver has looked long enough to know if a vehicle is coming.
        line_is_solid: Whether a solid line separates the directions here or ahead.
        tall_vehicle_gap_factor: Factor on the gap that is left to a leader that blocks the view
            [1].
    """

    leader_gap: F32
    leader_speed: F32
    leader_length: F32
    gap_ahead_of_leader: F32
    assumed_oncoming_gap: F32
    oncoming_closing_speed: F32
    is_certain: Mask
    line_is_solid: Mask
    tall_vehicle_gap_factor: F32


def passing_opportunity(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    coming: OncomingVehicle,
    slots: SlotSelection,
    leader: tuple[F32, F32],
) -> PassingOpportunity:
    """What drivers know of the other lane.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        neighbours: Neighbours.
        coming: Who comes.
        slots: The drivers.
        leader: Gap at which they believe their leaders to be [m], and speed of those [m/s].
    """
    vehicles = params.vehicles
    gap, speed = leader
    slot = neighbours.slot[LEADER, slots]
    return PassingOpportunity(
        leader_gap=gap,
        leader_speed=speed,
        leader_length=_TWO * neighbours.half_length[LEADER, slots],
        gap_ahead_of_leader=gap_ahead_of(state, params, slot, slots),
        assumed_oncoming_gap=assumed_oncoming_gap(
            vehicles.at_slots(slots), coming.believed_gap[slots], coming.sight_distance[slots]
        ),
        oncoming_closing_speed=coming.closing_speed[slots],
        is_certain=coming.is_certain[slots],
        line_is_solid=line_is_solid(state, params, slots, params.constants.line_lookahead),
        tall_vehicle_gap_factor=tall_vehicle_gap_factor(params, slot),
    )


def accepts_oncoming_gap(
    params: StepParameters,
    own: VehicleParameters,
    speed: F32,
    impatience: F32,
    ahead: PassingOpportunity,
) -> Mask:
    """Whether the other lane is believed to be free for long enough.

    The time that passing takes, as it is misjudged, with something to spare, is held against
    the time until the nearest oncomer is met; a road that is not seen counts as an oncomer. Passing
    takes half a lane change before speed is gained, and half of one back at its end. Who waits
    spares less, but not less than a part of what it spared at first.

    Args:
        params: Parameters of the batch.
        own: Parameters of the drivers.
        speed: Their own [m/s].
        impatience: What waiting has left of their demands, 1 at first [1].
        ahead: What they know of the other lane.
    """
    constants, leader = params.constants, ahead.leader_speed
    bodies = ahead.leader_length + _TWO * own.half_length
    returns = own.return_time_gap * impatience * ahead.tall_vehicle_gap_factor * leader
    way = ahead.leader_gap + bodies + returns
    top = passing_speed(own, constants.passing_speed_surplus, leader)
    gaining = time_to_pass(constants, own, way, speed, speed - leader, leader)
    need = own.passing_time_factor * (gaining + own.lane_change_duration)
    closing = ahead.oncoming_closing_speed + _HALF * maximum(top - speed, _ZERO)
    spare = own.time_reserve_share * maximum(impatience, constants.min_time_reserve_share)
    enough = ahead.assumed_oncoming_gap > need * (np.float32(1.0) + spare) * closing
    least = _TWO * own.half_length + constants.min_return_gap + returns
    room = (
        ahead.gap_ahead_of_leader > least + constants.return_time_gap_share * own.time_gap * leader
    )
    return enough & ahead.is_certain & room & ~(ahead.line_is_solid & (own.heeds_solid_lines > 0))


def gap_ahead_of(state: State, params: StepParameters, slot: F32, slots: SlotSelection) -> F32:
    """Gap that drivers find between the vehicle in a slot and the one ahead of it [m]."""
    vehicles = params.vehicles
    place = value_at_slot(state.motion.s, slot)
    front = place + value_at_slot(vehicles.half_length, slot)
    room = np.full_like(front, _FAR)
    numbers = np.arange(len(state.motion.s), dtype=np.float32)[:, None][slots]
    for j in range(len(state.motion.s)):
        beyond = (
            (vehicles.valid[j] > 0)
            & (vehicles.travel_sign[j] == vehicles.travel_sign[slots])
            & (state.motion.s[j] > place)
        )
        beyond = beyond & (slot != np.float32(j)) & (numbers != np.float32(j))
        room = np.where(
            beyond, minimum(room, (state.motion.s[j] - vehicles.half_length[j]) - front), room
        )
    return room


def line_is_solid(
    state: State,
    params: StepParameters,
    slots: SlotSelection,
    ahead: F32 | np.float32,
) -> Mask:
    """Whether the line is not to be crossed where drivers are, or at a way ahead of them.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        slots: The drivers.
        ahead: The way [m].
    """
    vehicles = params.vehicles
    stations, along, against = params.road.solid_line
    here, direction = state.road_position(params)[0][slots], vehicles.travel_sign[slots]
    solid = np.zeros(here.shape, bool)
    for place in (here, here + direction * ahead):
        knot = np.searchsorted(stations, place, side="right") - 1
        solid = solid | (np.where(direction < 0, against[knot], along[knot]) > 0)
    return solid
