"""Contacts: oriented boxes, swept over a step, and the exchange of momentum.

A frame has the direction of travel of a vehicle: s ahead along the road, d to the left. The two
vehicles of a pair are `first` and `second`, and the frame of the first is used for both. A step
lasts 10 or 50 ms; a *share* of it is a part from 0 to 1.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, ZERO, clamp, maximum, minimum, sincos
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters

_MIN_MOTION = np.float32(1e-6)  # Keeps the time of contact finite without relative motion [m].
_UNBOUNDED = np.float32(1e9)  # Bound of an overlap that no axis has narrowed yet [shares].


class RoadVector(NamedTuple):
    """A vector in a frame: a position, a difference of positions [m], or a velocity [m/s]."""

    s: F32
    d: F32


@dataclass(slots=True, kw_only=True)
class OrientedBox:
    """Body of one vehicle in each simulation; arrays of shape (simulation,).

    Attributes:
        s, d: Centre [m].
        sine, cosine: Sine and cosine of the body's angle to the s axis.
        half_length, half_width: Half of the sizes [m].
    """

    s: F32
    d: F32
    sine: F32
    cosine: F32
    half_length: F32
    half_width: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class PairFrame:
    """Transformation from the frame of the second vehicle of a pair to the frame of the first.

    Attributes:
        turn: 1, or -1 for vehicles of opposite directions, whose axes are opposite, (simulation,).
        road_length: Length of the road: the sum of the stations of a point in opposite frames [m].
        edge_sum: Sum of the lateral positions of a point in opposite frames [m].
    """

    turn: F32
    road_length: np.float32
    edge_sum: np.float32

    def in_first_frame(self, s: F32, d: F32) -> RoadVector:
        """A position of the second vehicle in the frame of the first [m]."""
        is_opposite = self.turn < 0
        return RoadVector(
            s=np.where(is_opposite, self.road_length - s, s),
            d=np.where(is_opposite, self.edge_sum - d, d),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class VehiclePair:
    """Two vehicles that may touch before the next decision.

    Attributes:
        first, second: Their slots.
        frame: Transformation from the frame of the second vehicle to the frame of the first.
        is_near: In which simulations they may touch, (simulation,).
    """

    first: int
    second: int
    frame: PairFrame
    is_near: Mask


class PairMember(NamedTuple):
    """One vehicle of a pair."""

    slot: int
    frame: PairFrame  # Transformation from its own frame to the frame of the first vehicle.


@dataclass(frozen=True, slots=True, kw_only=True)
class SweptStep:
    """A step over which bodies are swept.

    Attributes:
        index: Number of the step of 10 ms with which it begins.
        length: Length [s]: one step, or all steps between two decisions if no frame is recorded
            between them.
        start: Positions of all vehicles at its start, (vehicle, simulation).
    """

    index: int
    length: np.float32
    start: RoadVector


class RemainingStep(NamedTuple):
    """Part of a step that is still to come, (simulation,)."""

    share: F32  # Share by which the position is moved back towards its start, 0 to 1.
    time: F32  # Time by which the heading is turned back [s].


class SweptOverlap(NamedTuple):
    """Overlap of two boxes in relative motion, (simulation,)."""

    enter: F32  # Share of the step at which it begins.
    leave: F32  # Share of the step at which it ends.
    normal_s: F32  # Unit normal from the first box to the second.
    normal_d: F32

    def is_within_step(self) -> Mask:
        """Whether the boxes overlap at some time of the step."""
        return (self.enter <= self.leave) & (self.enter <= ONE) & (self.leave >= ZERO)


@dataclass(slots=True, kw_only=True)
class Impact:
    """A contact of two vehicles in the frame of the first; arrays of shape (simulation,).

    Attributes:
        exists: Whether they touch in this step.
        normal_s, normal_d: Unit normal from the first to the second.
        lever_first, lever_second: Levers of the impulse about both centres, positive if an impulse
            along the normal turns the vehicle to the left [m].
        closing_speed: Closing speed along the normal [m/s].
        time: Time of the contact since the start of the simulation [s].
        remaining_time: Rest of the step [s].
    """

    exists: Mask
    normal_s: F32
    normal_d: F32
    lever_first: F32
    lever_second: F32
    closing_speed: F32
    time: F32
    remaining_time: F32


class Impulse(NamedTuple):
    """Impulse on one vehicle in its own frame, (simulation,)."""

    size: F32  # Along the normal, negative against it [N s].
    lever: F32  # Lever about the vehicle's centre [m].


def pair_frame(params: StepParameters, first: int, second: int | slice) -> PairFrame:
    """The transformation to the frame of the first vehicle from the frame of one or more others."""
    travel_sign, road = params.vehicles.travel_sign, params.road
    turn = travel_sign[first] * travel_sign[second]
    return PairFrame(turn=turn, road_length=road.length, edge_sum=road.edge_sum)


def pairs_that_may_touch(state: State, params: StepParameters) -> list[VehiclePair]:
    """The pairs that may touch before the next decision, ordered by their slots.

    `near_gap`, 4 m, is more than two oncoming vehicles at 130 km/h approach until then, 3.6 m.
    """
    vehicles, constants, motion = params.vehicles, params.constants, state.motion
    pairs: list[VehiclePair] = []
    for first in range(len(vehicles.valid)):
        later = slice(first + 1, None)
        position = pair_frame(params, first, later).in_first_frame(motion.s[later], motion.d[later])
        half_lengths = vehicles.half_length[first] + vehicles.half_length[later]
        half_widths = vehicles.half_width[first] + vehicles.half_width[later]
        is_near = (
            (np.abs(position.s - motion.s[first]) < half_lengths + constants.near_gap)
            & (np.abs(position.d - motion.d[first]) < half_widths + constants.near_side)
            & (vehicles.valid[first] > 0)
            & (vehicles.valid[later] > 0)
        )
        pairs += [
            VehiclePair(
                first=first,
                second=second,
                frame=pair_frame(params, first, second),
                is_near=is_near_second,
            )
            for second, is_near_second in enumerate(is_near, first + 1)
            if is_near_second.any()
        ]
    return pairs


def wreck_off_road_vehicles(state: State, params: StepParameters, step: int) -> None:
    """Turn vehicles that have left the road, or stand across it, into wrecks that slide to rest."""
    constants, road, motion = params.constants, params.road, state.motion
    # The edges have the same lateral positions in the frames of both directions.
    right_edge, left_edge = road.boundaries[0], road.boundaries[road.num_lanes]
    is_off_road = (motion.d < right_edge - constants.edge_margin) | (
        motion.d > left_edge + constants.edge_margin
    )
    is_across = np.abs(motion.heading) > constants.spin_angle
    is_sound = (params.vehicles.valid > 0) & (motion.is_wreck == 0)
    is_lost = (is_off_road | is_across) & is_sound
    motion.is_wreck = np.where(is_lost, ONE, motion.is_wreck)
    end_after_ego_accident(state, params, is_lost[EGO_SLOT], step)


def end_after_ego_accident(
    state: State, params: StepParameters, has_crashed: Mask, step: int
) -> None:
    """End simulations `after_collision` [s] after `step`, at which their ego has crashed."""
    constants, stage = params.constants, state.overtake.stage
    stage[EGO_SLOT] = np.where(has_crashed, np.float32(Stage.CRASHED), stage[EGO_SLOT])
    # `step` is the number of a step, `constants.step` the length of each [s].
    last_step = np.float32(step) + np.rint(constants.after_collision / constants.step)
    state.end_step = np.where(has_crashed, minimum(state.end_step, last_step), state.end_step)


def resolve_contacts(
    state: State, params: StepParameters, pairs: list[VehiclePair], swept: SweptStep
) -> None:
    """Exchange momentum in every pair that touched during the last step.

    For the rest of the step after a contact, the pair moves with its new velocities. If one of them
    touches a third vehicle in the same step, it is swept along the straight line from its start to
    this new end.

    Args:
        state: State after the step; it changes.
        params: Parameters of the batch.
        pairs: `pairs_that_may_touch` at the last decision.
        swept: The last step.
    """
    was_sound = state.motion.is_wreck[EGO_SLOT] == 0
    for pair in pairs:
        _resolve_pair(state, params, pair, swept)
    has_crashed = was_sound & (state.motion.is_wreck[EGO_SLOT] > 0)
    end_after_ego_accident(state, params, has_crashed, swept.index)


def _resolve_pair(
    state: State, params: StepParameters, pair: VehiclePair, swept: SweptStep
) -> None:
    """Exchange the momentum of one pair, and record its contact."""
    impact = _find_impact(state, params, pair, swept)
    if impact is None:
        return
    size, turn = _impulse_size(params, impact, pair), pair.frame.turn
    # The normal points from the first vehicle to the second, so the first is pushed against it.
    _apply_impulse(state, params, impact, pair.first, Impulse(-size, impact.lever_first))
    # In an opposite frame the impulse is reversed, but not its moment, the product of size and
    # lever; so the lever is reversed as well.
    on_second = Impulse(turn * size, turn * impact.lever_second)
    _apply_impulse(state, params, impact, pair.second, on_second)
    _record_contact(state, impact, size, pair.first, pair.second)
    _record_contact(state, impact, size, pair.second, pair.first)


def _find_impact(
    state: State, params: StepParameters, pair: VehiclePair, swept: SweptStep
) -> Impact | None:
    """The contact of a pair during the step; None if the first sweep finds none in any simulation.

    The boxes keep their heading while they are swept. The first sweep takes the heading at the end
    of the step; the second takes the heading at the time of contact that the first has found. Two
    sweeps are enough: the times of contact differ by at most 10 ms from a simulation with steps of
    1 ms (`tests/reference/test_contact_times.py`).
    """
    s, d = state.motion.s, state.motion.d
    start_s, start_d = swept.start
    first, second, frame = pair.first, pair.second, pair.frame
    second_start = frame.in_first_frame(start_s[second], start_d[second])
    second_end = frame.in_first_frame(s[second], d[second])
    start_offset = RoadVector(second_start.s - start_s[first], second_start.d - start_d[first])
    end_offset = RoadVector(second_end.s - s[first], second_end.d - d[first])
    zero = np.zeros_like(end_offset.s)
    own_frame = PairFrame(
        turn=np.ones_like(zero), road_length=frame.road_length, edge_sum=frame.edge_sum
    )
    member_1, member_2 = PairMember(first, own_frame), PairMember(second, frame)

    def boxes_before(remaining: RemainingStep) -> tuple[OrientedBox, OrientedBox]:
        """The bodies of both vehicles when this part of the step was still to come."""
        return (
            _box_at(state, params, member_1, swept.start, remaining),
            _box_at(state, params, member_2, swept.start, remaining),
        )

    overlap = swept_overlap(*boxes_before(RemainingStep(zero, zero)), start_offset, end_offset)
    touches = pair.is_near & overlap.is_within_step()
    # Most near pairs do not touch; to return here saves most of the time of `sim.reference`.
    if not touches.any():
        return None
    # Where the first sweep has found a contact, the second takes its headings at that time.
    share = ONE - clamp(overlap.enter, ZERO, ONE)
    time = share * swept.length
    overlap = swept_overlap(*boxes_before(RemainingStep(share, time)), start_offset, end_offset)
    enter = clamp(overlap.enter, ZERO, ONE)
    # The boxes as they touch in the second sweep: its headings, which stay those at `time`, and the
    # positions at its contact, `enter`. Levers of any other boxes would create spin.
    boxes = boxes_before(RemainingStep(ONE - enter, time))
    arm_first, arm_second = _contact_arms(*boxes)
    # Velocities are those at the end of the step, which a contact then changes.
    velocity_first = _point_velocity(state, first, arm_first, own_frame.turn)
    velocity_second = _point_velocity(state, second, arm_second, frame.turn)
    normal_s, normal_d = overlap.normal_s, overlap.normal_d
    closing_speed = (velocity_first.s - velocity_second.s) * normal_s + (
        velocity_first.d - velocity_second.d
    ) * normal_d
    time_of_contact = np.float32(swept.index) * params.constants.step + enter * swept.length
    is_running = time_of_contact < state.end_step * params.constants.step
    return Impact(
        exists=touches & overlap.is_within_step() & (closing_speed > 0) & is_running,
        normal_s=normal_s,
        normal_d=normal_d,
        lever_first=arm_first.s * normal_d - arm_first.d * normal_s,
        lever_second=arm_second.s * normal_d - arm_second.d * normal_s,
        closing_speed=closing_speed,
        time=time_of_contact,
        remaining_time=(ONE - enter) * swept.length,
    )


def _impulse_size(params: StepParameters, impact: Impact, pair: VehiclePair) -> F32:
    """Impulse along the normal of two rigid bodies without friction between them [N s].

    Source:
        Newton's law of restitution; Brach and Brach, Vehicle Accident Analysis and Reconstruction
        Methods (2011), planar impact mechanics.
    """
    inverse_mass, inverse_inertia = params.vehicles.inverse_mass, params.vehicles.inverse_inertia
    first, second = pair.first, pair.second
    compliance = inverse_mass[first] + inverse_mass[second]
    compliance = (
        compliance
        + impact.lever_first * impact.lever_first * inverse_inertia[first]
        + impact.lever_second * impact.lever_second * inverse_inertia[second]
    )
    size = (ONE + params.constants.restitution) * impact.closing_speed / compliance
    return np.where(impact.exists, size, ZERO)


def _record_contact(state: State, impact: Impact, size: F32, slot: int, partner: int) -> None:
    """Keep the first contact of a vehicle, and make it a wreck.

    Pairs are resolved in the order of slots, so a contact that is earlier in the step may be
    resolved later. Slots and flags are float32, as all of the state.
    """
    contact, is_wreck = state.first_contact, state.motion.is_wreck
    is_earlier = (contact.partner[slot] < 0) | (impact.time < contact.time[slot])
    is_first = impact.exists & is_earlier
    contact.partner[slot] = np.where(is_first, np.float32(partner), contact.partner[slot])
    contact.time[slot] = np.where(is_first, impact.time, contact.time[slot])
    contact.impulse[slot] = np.where(is_first, size, contact.impulse[slot])
    contact.closing_speed[slot] = np.where(
        is_first, impact.closing_speed, contact.closing_speed[slot]
    )
    is_wreck[slot] = np.where(impact.exists, ONE, is_wreck[slot])


def _box_at(
    state: State,
    params: StepParameters,
    member: PairMember,
    start: RoadVector,
    remaining: RemainingStep,
) -> OrientedBox:
    """The body of a vehicle when `remaining` was still to come, in the frame of `first`."""
    motion, vehicles, slot = state.motion, params.vehicles, member.slot
    turn = member.frame.turn
    sine, cosine = sincos(motion.heading[slot] - remaining.time * motion.yaw_rate[slot])
    position = member.frame.in_first_frame(
        motion.s[slot] - remaining.share * (motion.s[slot] - start.s[slot]),
        motion.d[slot] - remaining.share * (motion.d[slot] - start.d[slot]),
    )
    return OrientedBox(
        s=position.s,
        d=position.d,
        sine=turn * sine,
        cosine=turn * cosine,
        half_length=vehicles.half_length[slot],
        half_width=vehicles.half_width[slot],
    )


def swept_overlap(
    a: OrientedBox, b: OrientedBox, start_offset: RoadVector, end_offset: RoadVector
) -> SweptOverlap:
    """Time in which two boxes in relative motion overlap, and the contact normal.

    Along each separating axis of both boxes the relative centre moves linearly, which gives the
    part of the step in which the projections overlap. The axis that starts to overlap last is the
    normal.

    Args:
        a: First box, of which only size and heading count.
        b: Second box, likewise.
        start_offset: Centre of b minus centre of a at the start of the step [m].
        end_offset: The same at the end.

    Source:
        Ericson, Real-Time Collision Detection (2005), sections 4.4 and 5.5.8.
    """
    axes = ((a.cosine, a.sine), (-a.sine, a.cosine), (b.cosine, b.sine), (-b.sine, b.cosine))
    enter, leave = np.full_like(a.s, -_UNBOUNDED), np.full_like(a.s, _UNBOUNDED)
    normal_s, normal_d = np.zeros_like(a.s), np.zeros_like(a.s)
    for (axis_s, axis_d), distance in zip(axes, _overlap_distances(a, b), strict=True):
        start = start_offset.s * axis_s + start_offset.d * axis_d
        change = end_offset.s * axis_s + end_offset.d * axis_d - start
        change = np.where(np.abs(change) < _MIN_MOTION, _MIN_MOTION, change)
        at_one_side, at_other_side = (-distance - start) / change, (distance - start) / change
        axis_enter = minimum(at_one_side, at_other_side)
        axis_leave = maximum(at_one_side, at_other_side)
        is_later = axis_enter > enter
        # From a to b, at the time when this axis starts to overlap.
        offset = start + change * clamp(axis_enter, ZERO, ONE)
        sign = np.where(offset < 0, -ONE, ONE)
        normal_s = np.where(is_later, sign * axis_s, normal_s)
        normal_d = np.where(is_later, sign * axis_d, normal_d)
        enter = maximum(axis_enter, enter)
        leave = minimum(axis_leave, leave)
    return SweptOverlap(enter, leave, normal_s, normal_d)


def _overlap_distances(a: OrientedBox, b: OrientedBox) -> tuple[F32, F32, F32, F32]:
    """Distance of the centres along each axis of both boxes below which projections overlap [m]."""
    relative_cosine = np.abs(a.cosine * b.cosine + a.sine * b.sine)
    relative_sine = np.abs(a.sine * b.cosine - a.cosine * b.sine)
    return (
        a.half_length + b.half_length * relative_cosine + b.half_width * relative_sine,
        a.half_width + b.half_length * relative_sine + b.half_width * relative_cosine,
        b.half_length + a.half_length * relative_cosine + a.half_width * relative_sine,
        b.half_width + a.half_length * relative_sine + a.half_width * relative_cosine,
    )


def _contact_arms(a: OrientedBox, b: OrientedBox) -> tuple[RoadVector, RoadVector]:
    """Contact point relative to the centre of each box [m].

    It lies midway between the points of each box nearest to the other's centre: a simple choice,
    since motion after a contact is indicative only.
    """
    offset = RoadVector(b.s - a.s, b.d - a.d)
    point_of_a = _nearest_point(a, offset)
    point_of_b = _nearest_point(b, RoadVector(-offset.s, -offset.d))
    arm = RoadVector(
        s=HALF * (point_of_a.s + offset.s + point_of_b.s),
        d=HALF * (point_of_a.d + offset.d + point_of_b.d),
    )
    return arm, RoadVector(arm.s - offset.s, arm.d - offset.d)


def _nearest_point(box: OrientedBox, offset: RoadVector) -> RoadVector:
    """The point of a box nearest to another point, both relative to the centre of the box [m]."""
    along = offset.s * box.cosine + offset.d * box.sine
    across = offset.d * box.cosine - offset.s * box.sine
    along = clamp(along, -box.half_length, box.half_length)
    across = clamp(across, -box.half_width, box.half_width)
    return RoadVector(
        s=along * box.cosine - across * box.sine, d=along * box.sine + across * box.cosine
    )


def _point_velocity(state: State, slot: int, arm: RoadVector, turn: F32) -> RoadVector:
    """Velocity of a point of a vehicle along and across a frame [m/s].

    Args:
        state: State of the batch.
        slot: Slot of the vehicle.
        arm: The point relative to the centre, in this frame [m].
        turn: 1 if the frame is the vehicle's own, -1 if it is the opposite one.
    """
    motion = state.motion
    vx, vy, yaw_rate = motion.vx[slot], motion.vy[slot], motion.yaw_rate[slot]
    sine, cosine = sincos(motion.heading[slot])
    return RoadVector(
        s=turn * (vx * cosine - vy * sine) - yaw_rate * arm.d,
        d=turn * (vx * sine + vy * cosine) + yaw_rate * arm.s,
    )


def _apply_impulse(
    state: State, params: StepParameters, impact: Impact, slot: int, impulse: Impulse
) -> None:
    """Change the motion of a vehicle by an impulse, and its position over the rest of the step."""
    vehicles, motion, time = params.vehicles, state.motion, impact.remaining_time
    zero = np.zeros_like(impulse.lever)
    speed_change = impulse.size * vehicles.inverse_mass[slot]
    change_s, change_d = speed_change * impact.normal_s, speed_change * impact.normal_d
    velocity = _point_velocity(state, slot, RoadVector(zero, zero), np.ones_like(zero))
    velocity_s, velocity_d = velocity.s + change_s, velocity.d + change_d
    spin = impulse.size * impulse.lever * vehicles.inverse_inertia[slot]
    # Without a contact all changes are zero, but the turn of the velocity to the road and back
    # would round; so only the velocity is masked.
    motion.s[slot] = motion.s[slot] + time * change_s
    motion.d[slot] = motion.d[slot] + time * change_d
    motion.heading[slot] = motion.heading[slot] + time * spin
    motion.yaw_rate[slot] = motion.yaw_rate[slot] + spin
    sine, cosine = sincos(motion.heading[slot])
    exists = impact.exists
    vx, vy = velocity_s * cosine + velocity_d * sine, velocity_d * cosine - velocity_s * sine
    motion.vx[slot] = np.where(exists, vx, motion.vx[slot])
    motion.vy[slot] = np.where(exists, vy, motion.vy[slot])
