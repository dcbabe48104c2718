"""Whether drivers pass against oncoming traffic: distance, time and sight distance needed.

The leader is the vehicle ahead in a driver's lane, the target the vehicle that it overtakes. The
return gap is the gap to the target that the driver leaves behind itself when it returns. A slot is
the number of a vehicle in its simulation; without a vehicle `value_at_slot` reads slot 0. The ego,
the vehicle under study, and the others decide by the same rules; `slots` selects the rows of arrays
of shape (vehicle, simulation).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, TWO, ZERO, maximum, minimum
from overtaking.sim.reference.decision_context import DecisionContext
from overtaking.sim.reference.state import FAR, LEADER, SlotSelection, State, value_at_slot
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import StepParameters, VehicleParameters

MIN_CLOSING_SPEED = np.float32(0.5)
"""Smallest speed difference with which drivers compute the time of a pass or a meeting [m/s].

Smaller differences count as this one, so that the times stay finite. Chosen: it matters only for
vehicles of nearly equal speed.
"""

_MIN_ACCEL = np.float32(0.1)
"""Smallest acceleration with which drivers compute the time of a pass [m/s^2].

It keeps this time finite where a slow vehicle cannot accelerate. Chosen.
"""


class PassingSpeeds(NamedTuple):
    """Speeds of a passing driver and its target [m/s].

    `closing` is `passer` minus `target`, and a field of its own because of rounding: a driver may
    believe a closing speed, from which the target's speed is computed.
    """

    passer: F32
    target: F32
    closing: F32


@dataclass(slots=True, kw_only=True)
class PassingOpportunity:
    """Beliefs of drivers about the opposing lane before they pull out, shape of the slots.

    Attributes:
        leader_gap: Believed gap to the leader [m].
        leader_speed: Believed speed of the leader [m/s].
        leader_length: Length of the leader [m].
        gap_ahead_of_leader: Gap between the leader and the next vehicle ahead of it [m].
        assumed_oncoming_gap: Distance at which the driver assumes an oncoming vehicle [m].
        oncoming_closing_speed: Believed closing speed of that vehicle; without a detected vehicle
            the closing speed of one at the usual speed [m/s].
        is_certain: Whether the driver has looked long enough to know if a vehicle is coming.
        line_is_solid: Whether a solid line separates the directions here or ahead.
        tall_vehicle_gap_factor: Factor on the gap that the driver leaves at its return to a leader
            that blocks the view [1].
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


def time_to_gain(distance: F32, closing_speed: F32, max_closing_speed: F32, accel: F32) -> F32:
    """Time to gain a distance on another vehicle, accelerating up to a top speed [s].

    Args:
        distance: The distance [m].
        closing_speed: Present speed minus the other vehicle's [m/s].
        max_closing_speed: Top speed minus the other vehicle's [m/s].
        accel: Acceleration up to the top speed [m/s^2].
    """
    a, v_max = maximum(accel, _MIN_ACCEL), maximum(max_closing_speed, MIN_CLOSING_SPEED)
    v = minimum(maximum(closing_speed, ZERO), v_max)
    ramp_time = (v_max - v) / a
    ramp_distance = HALF * (v + v_max) * ramp_time
    # Solves distance = v t + a t^2 / 2.
    time_on_ramp = (np.sqrt(v * v + TWO * a * distance) - v) / a
    time_beyond_ramp = ramp_time + (distance - ramp_distance) / v_max
    return np.where(distance < ramp_distance, time_on_ramp, time_beyond_ramp)


def expected_accel(
    constants: ModelConstants, vehicle: VehicleParameters, speed: F32, passing_speed: F32
) -> F32:
    """Acceleration that drivers expect on the way up to their passing speed [m/s^2].

    Passing drivers accelerate more than followers, by the factor `accelerate_gain`. The engine
    limits them to its force at the mean of the present speed and the passing speed: for constant
    power this mean gives the exact time. `slip_speed` bounds it from below. Drivers know the power
    of their vehicle. They misjudge the time of a pass by the trait `passing_time_factor`, which is
    not part of this acceleration.

    Args:
        constants: Constants of the model.
        vehicle: Parameters of the drivers and their vehicles.
        speed: Their speed [m/s].
        passing_speed: The speed at which they pass [m/s].
    """
    mean_speed = HALF * (speed + maximum(passing_speed, speed))
    engine_force = minimum(
        vehicle.launch_force, vehicle.power / maximum(mean_speed, constants.slip_speed)
    )
    force = engine_force - (vehicle.drag * mean_speed * mean_speed + vehicle.rolling)
    return minimum(constants.accelerate_gain * vehicle.accel, force * vehicle.inverse_mass)


def passing_speed(vehicle: VehicleParameters, surplus: np.float32, target_speed: F32) -> F32:
    """Speed at which drivers pass: well above the target's speed, if the vehicle can [m/s].

    A driver that complies with the speed limit on a free road complies as much while it passes, and
    takes longer.

    Args:
        vehicle: Parameters of the drivers and their vehicles.
        surplus: Least by which drivers want to be faster than the target [m/s].
        target_speed: Speed of the target [m/s].
    """
    # `vehicle.passing_speed` is the speed at which the driver desires to pass any vehicle.
    speed = maximum(vehicle.passing_speed, target_speed + surplus)
    # The compliance is the share of the excess over the limit that the driver gives up, 0 to 1.
    excess = maximum(speed - vehicle.speed_limit, ZERO)
    return minimum(speed - vehicle.speed_limit_compliance * excess, vehicle.max_speed)


def current_passing_speed(state: State, params: StepParameters) -> F32:
    """The speed that passing drivers want now, (vehicle, simulation) [m/s].

    It is higher while they return urgently, because an oncoming vehicle or a solid line is near.
    """
    vehicles, constants, overtake = params.vehicles, params.constants, state.overtake
    along_road, _ = state.road_velocity()
    target_speed = value_at_slot(along_road, overtake.target_slot)
    usual = passing_speed(vehicles, constants.passing_speed_surplus, target_speed)
    urgent = constants.urgent_speed_factor * usual
    return minimum(np.where(overtake.must_return_urgently > 0, urgent, usual), vehicles.max_speed)


def time_to_pass(
    constants: ModelConstants, vehicle: VehicleParameters, distance: F32, speeds: PassingSpeeds
) -> F32:
    """Time that drivers expect to need to gain a distance on their target [s].

    The trait `passing_time_factor`, by which they misjudge this time, is not applied here.

    Args:
        constants: Constants of the model.
        vehicle: Parameters of the drivers and their vehicles.
        distance: The distance [m].
        speeds: Speeds of the drivers and of their targets.
    """
    top_speed = passing_speed(vehicle, constants.passing_speed_surplus, speeds.target)
    accel = expected_accel(constants, vehicle, speeds.passer, top_speed)
    return time_to_gain(distance, speeds.closing, top_speed - speeds.target, accel)


def assumed_oncoming_gap(vehicle: VehicleParameters, believed_gap: F32, sight_distance: F32) -> F32:
    """Distance at which drivers assume an oncoming vehicle, seen or not [m].

    Where the road is hidden, a driver assumes a vehicle at a multiple of the sight distance. The
    factor `assumed_sight_factor` is above 1 for most drivers: few believe that a vehicle is just
    beyond the visible road.

    Args:
        vehicle: Parameters of the drivers and their vehicles.
        believed_gap: Believed gap to the oncoming vehicle [m].
        sight_distance: Sight distance along the opposing lane [m].
    """
    # Without a detected vehicle the believed gap is the range to which drivers look.
    return minimum(believed_gap, vehicle.assumed_sight_factor * sight_distance)


def tall_vehicle_gap_factor(params: StepParameters, slot: F32) -> F32:
    """Factor on the gap that drivers keep to the vehicle in a slot, 1 for a car [1].

    Drivers keep longer gaps to a vehicle that blocks the view: behind it, to see past it, and ahead
    of it at the return, because it brakes worse. The number is fitted.

    Source:
        The Highway Code, rule 164 (drop back behind large vehicles, to see and be seen).
    """
    blocks_view = value_at_slot(params.vehicles.blocks_view, slot) > 0
    return np.where(blocks_view, params.constants.tall_vehicle_gap_factor, ONE)


def passing_opportunity(
    state: State, params: StepParameters, context: DecisionContext, slots: SlotSelection
) -> PassingOpportunity:
    """Beliefs of drivers on a two-way road about the opposing lane."""
    assert context.oncoming is not None, "one-way roads have no oncoming traffic"
    neighbours, beliefs, oncoming = context.neighbours, context.beliefs, context.oncoming.nearest
    leader_slot = neighbours.slot[LEADER, slots]
    return PassingOpportunity(
        leader_gap=beliefs.gap[LEADER, slots],
        leader_speed=state.motion.vx[slots] - beliefs.closing_speed[LEADER, slots],
        leader_length=TWO * neighbours.half_length[LEADER, slots],
        gap_ahead_of_leader=gap_ahead_of(state, params, leader_slot, slots),
        assumed_oncoming_gap=assumed_oncoming_gap(
            params.vehicles.at_slots(slots),
            oncoming.believed_gap[slots],
            oncoming.sight_distance[slots],
        ),
        oncoming_closing_speed=oncoming.closing_speed[slots],
        is_certain=oncoming.is_certain[slots],
        line_is_solid=line_is_solid(state, params, slots, params.constants.line_lookahead),
        tall_vehicle_gap_factor=tall_vehicle_gap_factor(params, leader_slot),
    )


def accepts_oncoming_gap(
    params: StepParameters,
    vehicle: VehicleParameters,
    speed: F32,
    patience_left: F32,
    opportunity: PassingOpportunity,
) -> Mask:
    """Whether drivers believe that the opposing lane is free for long enough.

    They compare the time that passing takes, with their error about it and a reserve, with the time
    until they meet the nearest oncoming vehicle. Beyond their sight distance they assume one.
    To the time of gaining on the leader they add one lane change: half of it passes before they
    gain speed, half during the return. A waiting driver asks for less return gap and a smaller
    reserve. The reserve does not fall below a share of its first value, because drivers expect no
    oncoming vehicle to brake.

    Args:
        params: Parameters of the batch.
        vehicle: Parameters of the drivers and their vehicles.
        speed: Their speed [m/s].
        patience_left: Share of return gap and reserve that they still ask for after waiting, 1 at
            first [1].
        opportunity: Their beliefs about the opposing lane.
    """
    constants, leader_speed = params.constants, opportunity.leader_speed
    lengths = opportunity.leader_length + TWO * vehicle.half_length
    gap_factor = opportunity.tall_vehicle_gap_factor
    return_gap = vehicle.return_time_gap * patience_left * gap_factor * leader_speed
    distance = opportunity.leader_gap + lengths + return_gap
    speeds = PassingSpeeds(passer=speed, target=leader_speed, closing=speed - leader_speed)
    time_to_gain_distance = time_to_pass(constants, vehicle, distance, speeds)
    time = vehicle.passing_time_factor * (time_to_gain_distance + vehicle.lane_change_duration)
    # The closing speed now is too low: on average over the pass the driver is faster by half of its
    # gain in speed.
    top_speed = passing_speed(vehicle, constants.passing_speed_surplus, leader_speed)
    closing_speed = opportunity.oncoming_closing_speed + HALF * maximum(top_speed - speed, ZERO)
    reserve = vehicle.time_reserve_share * maximum(patience_left, constants.min_time_reserve_share)
    has_time = opportunity.assumed_oncoming_gap > time * (ONE + reserve) * closing_speed
    # Ahead of the leader lie, one after the other, the return gap, the driver's vehicle, and its
    # smallest gap and a share of its time gap to the next vehicle.
    min_gap = TWO * vehicle.half_length + constants.min_return_gap + return_gap
    time_gap = constants.return_time_gap_share * vehicle.time_gap
    fits_ahead = opportunity.gap_ahead_of_leader > min_gap + time_gap * leader_speed
    is_kept_by_line = opportunity.line_is_solid & (vehicle.heeds_solid_lines > 0)
    return has_time & opportunity.is_certain & fits_ahead & ~is_kept_by_line


def gap_ahead_of(state: State, params: StepParameters, slot: F32, slots: SlotSelection) -> F32:
    """Gap between the vehicle in a slot and the next one ahead of it, for each driver [m].

    The next vehicle may be in any lane, also in the opposing lane while it passes. Without one the
    gap is `FAR`.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        slot: Slot of the vehicle, which travels in the driver's direction, shape of the slots.
        slots: Slots of the drivers, which do not count as the next vehicle.
    """
    vehicles, s = params.vehicles, state.motion.s
    centre = value_at_slot(s, slot)
    front = centre + value_at_slot(vehicles.half_length, slot)
    gap = np.full_like(front, FAR)
    # Slot of each driver; the column broadcasts over the simulations.
    driver_slot = np.arange(len(s), dtype=np.float32)[:, None][slots]
    for candidate in range(len(s)):
        # No vehicle is ahead of its own centre; the first comparison of slots changes nothing.
        is_same_direction = vehicles.travel_sign[candidate] == vehicles.travel_sign[slots]
        is_other = (slot != np.float32(candidate)) & (driver_slot != np.float32(candidate))
        is_candidate = is_other & is_same_direction & (vehicles.valid[candidate] > 0)
        # Stations grow in each vehicle's direction of travel.
        is_ahead = is_candidate & (s[candidate] > centre)
        rear = s[candidate] - vehicles.half_length[candidate]
        gap = np.where(is_ahead, minimum(gap, rear - front), gap)
    return gap


def line_is_solid(
    state: State, params: StepParameters, slots: SlotSelection, distance: F32 | np.float32
) -> Mask:
    """Whether the line between the directions is solid at drivers, or at a distance ahead of them.

    A solid piece that begins and ends between the two places is overlooked.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        slots: Slots of the drivers.
        distance: The distance [m].
    """
    # From each station on, 1 if drivers along or against the road must not cross the line, else 0.
    stations, along, against = params.road.solid_line
    # Lines have stations of the road, which `road_position` gives; `state.motion.s` grows in each
    # vehicle's direction of travel. The sign is 1 for drivers along the road, -1 for the others.
    s, travel_sign = state.road_position(params)[0][slots], params.vehicles.travel_sign[slots]
    is_solid = np.zeros(s.shape, bool)
    for road_s in (s, s + travel_sign * distance):
        # The index of the last station behind the place; the first is far before the road.
        knot = np.searchsorted(stations, road_s, side="right") - 1
        is_solid = is_solid | (np.where(travel_sign < 0, against[knot], along[knot]) > 0)
    return is_solid
