"""Contacts: oriented boxes, swept over a step, and the exchange of momentum."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import clamp, maximum, minimum, sincos
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters

_TINY = np.float32(1e-6)  # Keeps the instant of contact finite without relative motion [m].
_NEVER = np.float32(1e9)  # Steps before and after which nothing happens.

Pairs = dict[tuple[int, int], Mask]
"""Slots of two vehicles, and in which simulations they may touch."""


@dataclass(slots=True, kw_only=True)
class OrientedBox:
    """One vehicle of each simulation as an oriented box; arrays of shape (simulation,)."""

    s: F32
    d: F32
    sine: F32
    cosine: F32
    half_length: F32
    half_width: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class PairFrame:
    """How the second vehicle of a pair is seen from the first; arrays of shape (simulation,).

    Attributes:
        turn: 1, or -1 for vehicles of opposite directions: axes of the second point the other way.
        road_length: Sum of their positions along the road where they meet [m].
        edge_sum: Sum of their positions across it where they meet [m].
    """

    turn: F32
    road_length: np.float32
    edge_sum: np.float32

    def in_first_frame(self, s: F32, d: F32) -> tuple[F32, F32]:
        """A position of the second vehicle in the frame of the first [m]."""
        turned = self.turn < 0
        return np.where(turned, self.road_length - s, s), np.where(turned, self.edge_sum - d, d)


def pair_frame(params: StepParameters, i: int, j: int | slice) -> PairFrame:
    """How vehicle `j` is seen from vehicle `i`."""
    vehicles, road = params.vehicles, params.road
    turn = vehicles.travel_sign[i] * vehicles.travel_sign[j]
    return PairFrame(turn=turn, road_length=road.length, edge_sum=road.edge_sum)


def pairs_that_may_touch(state: State, params: StepParameters) -> Pairs:
    """The pairs that may touch before the next decision, in order, and where they may."""
    vehicles, constants = params.vehicles, params.constants
    found: Pairs = {}
    for i in range(len(vehicles.valid)):
        rest = slice(i + 1, None)
        s, d = pair_frame(params, i, rest).in_first_frame(
            state.motion.s[rest], state.motion.d[rest]
        )
        along = (
            np.abs(s - state.motion.s[i])
            < vehicles.half_length[i] + vehicles.half_length[rest] + constants.near_gap
        )
        aside = (
            np.abs(d - state.motion.d[i])
            < vehicles.half_width[i] + vehicles.half_width[rest] + constants.near_side
        )
        near = along & aside & (vehicles.valid[i] > 0) & (vehicles.valid[rest] > 0)
        found |= {(i, j): one for j, one in enumerate(near, i + 1) if one.any()}
    return found


def wreck_off_road_vehicles(state: State, params: StepParameters, step: int) -> None:
    """Vehicles that have left the lanes, or stand across them, become wrecks that slide to rest.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        step: Number of the step.
    """
    vehicles, constants, road = params.vehicles, params.constants, params.road
    right_edge, left_edge = road.boundaries[0], road.boundaries[road.num_lanes]
    beyond = (state.motion.d < right_edge - constants.edge_margin) | (
        state.motion.d > left_edge + constants.edge_margin
    )
    lost = (
        (beyond | (np.abs(state.motion.heading) > constants.spin_angle))
        & (vehicles.valid > 0)
        & (state.motion.is_wreck == 0)
    )
    state.motion.is_wreck = np.where(lost, np.float32(1.0), state.motion.is_wreck)
    end_after_ego_accident(state, params, lost[EGO_SLOT], step)


def end_after_ego_accident(state: State, params: StepParameters, crashed: Mask, step: int) -> None:
    """An accident of the ego ends the simulation soon."""
    constants = params.constants
    state.overtake.stage[EGO_SLOT] = np.where(
        crashed, np.float32(Stage.CRASHED), state.overtake.stage[EGO_SLOT]
    )
    after = np.float32(step) + np.rint(constants.after_collision / constants.step)
    state.end_step = np.where(crashed, minimum(state.end_step, after), state.end_step)


def resolve_contacts(
    state: State,
    params: StepParameters,
    pairs: Pairs,
    before: tuple[F32, F32],
    step: int,
    step_length: np.float32,
) -> None:
    """Exchange momentum in every near pair that touched during the last step.

    For the rest of the step after a contact, the pair moves with its new velocities.

    Args:
        state: State after the step.
        params: Parameters of the batch.
        pairs: `near_pairs` at the last decision.
        before: Positions `s` and `d` before the step.
        step: Number of the step that began at `before`.
        step_length: Its length [s].
    """
    was_sound = state.motion.is_wreck[EGO_SLOT] == 0
    for (i, j), near in pairs.items():
        frame = pair_frame(params, i, j)
        _resolve_pair(state, params, near, before, (step, step_length), (i, j), frame)
    end_after_ego_accident(state, params, was_sound & (state.motion.is_wreck[EGO_SLOT] > 0), step)


@dataclass(slots=True, kw_only=True)
class Impact:
    """A contact of two vehicles in the frame of the first; arrays of shape (simulation,).

    Attributes:
        mask: Where there is one.
        normal_s, normal_d: Unit normal from the first to the second.
        lever_a, lever_b: Levers of the impulse about both centres [m].
        closing_speed: Speed of approach along the normal [m/s].
        time: When they touched [s].
        remaining_time: Rest of the step [s].
    """

    mask: Mask
    normal_s: F32
    normal_d: F32
    lever_a: F32
    lever_b: F32
    closing_speed: F32
    time: F32
    remaining_time: F32


def _resolve_pair(
    state: State,
    params: StepParameters,
    near: Mask,
    before: tuple[F32, F32],
    during: tuple[int, np.float32],
    pair: tuple[int, int],
    frame: PairFrame,
) -> None:
    i, j = pair
    hit = _find_impact(state, params, near, before, during, pair, frame)
    if hit is None:
        return
    impulse = _impulse(params, hit, i, j)
    _apply_impulse(state, params, hit, i, -impulse, hit.lever_a)
    _apply_impulse(state, params, hit, j, frame.turn * impulse, frame.turn * hit.lever_b)
    for own, other in ((i, j), (j, i)):
        _record_contact(state, hit, impulse, own, other)


def _find_impact(
    state: State,
    params: StepParameters,
    near: Mask,
    before: tuple[F32, F32],
    during: tuple[int, np.float32],
    pair: tuple[int, int],
    frame: PairFrame,
) -> Impact | None:
    """Whether, when, where and how fast a pair touched during the step; none once it is over.

    None if the pair came near in no simulation, which saves most of the reference's time.

    Boxes keep their heading while they are swept: that of the end of the step, and then that of the
    instant of contact that was found so.
    """
    constants = params.constants
    (step, step_length), (i, j) = during, pair
    one = np.float32(1.0)
    was_s, was_d = frame.in_first_frame(before[0][j], before[1][j])
    is_s, is_d = frame.in_first_frame(state.motion.s[j], state.motion.d[j])
    then = (was_s - before[0][i], was_d - before[1][i])
    now = (is_s - state.motion.s[i], is_d - state.motion.d[i])
    zero = np.zeros_like(now[0])
    unturned = PairFrame(
        turn=np.ones_like(zero), road_length=frame.road_length, edge_sum=frame.edge_sum
    )
    frames = (i, unturned), (j, frame)
    a, b = (_box_at(state, params, before, k, zero, zero, own) for k, own in frames)
    overlap = swept_overlap(a, b, then, now)
    near = near & _is_within(overlap)
    if not near.any():
        return None
    share = one - clamp(overlap[0], np.float32(0.0), one)
    a, b = (_box_at(state, params, before, k, share, share * step_length, own) for k, own in frames)
    overlap = swept_overlap(a, b, then, now)
    enter, _, along, across = overlap
    enter = clamp(enter, np.float32(0.0), one)
    # Levers of any other instant than the one that the pair goes on from would make spin.
    a, b = (
        _box_at(state, params, before, k, one - enter, share * step_length, own)
        for k, own in frames
    )
    arm_a, arm_b = _contact_arms(a, b)
    velocity_a = _point_velocity(state, i, arm_a, unturned.turn)
    velocity_b = _point_velocity(state, j, arm_b, frame.turn)
    approach = (velocity_a[0] - velocity_b[0]) * along + (velocity_a[1] - velocity_b[1]) * across
    instant = np.float32(step) * constants.step + enter * step_length
    runs = instant < state.end_step * constants.step
    return Impact(
        mask=near & _is_within(overlap) & (approach > 0) & runs,
        normal_s=along,
        normal_d=across,
        lever_a=arm_a[0] * across - arm_a[1] * along,
        lever_b=arm_b[0] * across - arm_b[1] * along,
        closing_speed=approach,
        time=instant,
        remaining_time=(one - enter) * step_length,
    )


def _impulse(params: StepParameters, hit: Impact, i: int, j: int) -> F32:
    """Impulse along the normal of two rigid bodies without friction between them [N s].

    Source:
        Newton's law of restitution; Brach and Brach, Vehicle Accident Analysis and Reconstruction
        Methods (2011), planar impact mechanics.
    """
    vehicles, constants = params.vehicles, params.constants
    softness = vehicles.inverse_mass[i] + vehicles.inverse_mass[j]
    softness = (
        softness
        + hit.lever_a * hit.lever_a * vehicles.inverse_inertia[i]
        + hit.lever_b * hit.lever_b * vehicles.inverse_inertia[j]
    )
    impulse = (np.float32(1.0) + constants.restitution) * hit.closing_speed / softness
    return np.where(hit.mask, impulse, np.float32(0.0))


def _record_contact(state: State, hit: Impact, impulse: F32, own: int, other: int) -> None:
    """Keep the first contact of a vehicle, and make it a wreck.

    Pairs are looked at by slot, so of two contacts in one step the earlier may come second.
    """
    sooner = (state.first_contact.partner[own] < 0) | (hit.time < state.first_contact.time[own])
    first = hit.mask & sooner
    state.first_contact.partner[own] = np.where(
        first, np.float32(other), state.first_contact.partner[own]
    )
    state.first_contact.time[own] = np.where(first, hit.time, state.first_contact.time[own])
    state.first_contact.impulse[own] = np.where(first, impulse, state.first_contact.impulse[own])
    state.first_contact.closing_speed[own] = np.where(
        first, hit.closing_speed, state.first_contact.closing_speed[own]
    )
    state.motion.is_wreck[own] = np.where(hit.mask, np.float32(1.0), state.motion.is_wreck[own])


def _box_at(
    state: State,
    params: StepParameters,
    before: tuple[F32, F32],
    i: int,
    share: F32,
    left: F32,
    frame: PairFrame,
) -> OrientedBox:
    """A vehicle as it was when a `share` of the step, a time `left` [s], was still to come."""
    vehicles = params.vehicles
    sine, cosine = sincos(state.motion.heading[i] - left * state.motion.yaw_rate[i])
    s = state.motion.s[i] - share * (state.motion.s[i] - before[0][i])
    d = state.motion.d[i] - share * (state.motion.d[i] - before[1][i])
    s, d = frame.in_first_frame(s, d)
    return OrientedBox(
        s=s,
        d=d,
        sine=frame.turn * sine,
        cosine=frame.turn * cosine,
        half_length=vehicles.half_length[i],
        half_width=vehicles.half_width[i],
    )


def _is_within(overlap: tuple[F32, F32, F32, F32]) -> Mask:
    """Whether boxes overlap at some time of the step."""
    enter, leave = overlap[:2]
    return (enter <= leave) & (enter <= np.float32(1.0)) & (leave >= np.float32(0.0))


def swept_overlap(
    a: OrientedBox, b: OrientedBox, then: tuple[F32, F32], now: tuple[F32, F32]
) -> tuple[F32, F32, F32, F32]:
    """When two boxes in relative motion begin and cease to overlap, and the contact normal.

    Separating axes of both boxes; along each the relative centre moves linearly, which gives the
    part of the step in which the projections overlap. The axis that starts to overlap last is the
    normal.

    Args:
        a: First box at the end of the step.
        b: Second box at the end of the step.
        then: Centre of b minus centre of a at the start of the step (along, across) [m].
        now: The same at the end.

    Returns:
        Start and end of the overlap as shares of the step, and the unit normal from a to b.

    Source:
        Ericson, Real-Time Collision Detection (2005), sections 4.4 and 5.5.8.
    """
    axes = ((a.cosine, a.sine), (-a.sine, a.cosine), (b.cosine, b.sine), (-b.sine, b.cosine))
    enter, leave = np.full_like(a.s, -_NEVER), np.full_like(a.s, _NEVER)
    along, across = np.zeros_like(a.s), np.zeros_like(a.s)
    for (axis_s, axis_d), limit in zip(axes, _overlap_distances(a, b), strict=True):
        start = then[0] * axis_s + then[1] * axis_d
        change = now[0] * axis_s + now[1] * axis_d - start
        change = np.where(np.abs(change) < _TINY, _TINY, change)
        one, two = (-limit - start) / change, (limit - start) / change
        begin, end = minimum(one, two), maximum(one, two)
        later = begin > enter
        facing = start + change * clamp(begin, np.float32(0.0), np.float32(1.0))
        sign = np.where(facing < 0, np.float32(-1.0), np.float32(1.0))
        along = np.where(later, sign * axis_s, along)
        across = np.where(later, sign * axis_d, across)
        enter = maximum(begin, enter)
        leave = minimum(end, leave)
    return enter, leave, along, across


def _overlap_distances(a: OrientedBox, b: OrientedBox) -> tuple[F32, F32, F32, F32]:
    """Distance of the centres along each axis of both boxes below which projections overlap [m]."""
    turn_cosine = np.abs(a.cosine * b.cosine + a.sine * b.sine)
    turn_sine = np.abs(a.sine * b.cosine - a.cosine * b.sine)
    return (
        a.half_length + b.half_length * turn_cosine + b.half_width * turn_sine,
        a.half_width + b.half_length * turn_sine + b.half_width * turn_cosine,
        b.half_length + a.half_length * turn_cosine + a.half_width * turn_sine,
        b.half_width + a.half_length * turn_sine + a.half_width * turn_cosine,
    )


def _contact_arms(a: OrientedBox, b: OrientedBox) -> tuple[tuple[F32, F32], tuple[F32, F32]]:
    """Contact point relative to both centres, midway between the points nearest to the other."""
    ahead, aside = b.s - a.s, b.d - a.d
    near_a = _nearest_point(a, ahead, aside)
    near_b = _nearest_point(b, -ahead, -aside)
    half = np.float32(0.5)
    point = (half * (near_a[0] + ahead + near_b[0]), half * (near_a[1] + aside + near_b[1]))
    return point, (point[0] - ahead, point[1] - aside)


def _nearest_point(box: OrientedBox, ahead: F32, aside: F32) -> tuple[F32, F32]:
    along = clamp(ahead * box.cosine + aside * box.sine, -box.half_length, box.half_length)
    across = clamp(aside * box.cosine - ahead * box.sine, -box.half_width, box.half_width)
    return along * box.cosine - across * box.sine, along * box.sine + across * box.cosine


def _point_velocity(state: State, i: int, arm: tuple[F32, F32], turn: F32) -> tuple[F32, F32]:
    """Velocity of a point of a vehicle, along and across, in a frame that is turned or not."""
    sine, cosine = sincos(state.motion.heading[i])
    along = (
        turn * (state.motion.vx[i] * cosine - state.motion.vy[i] * sine)
        - state.motion.yaw_rate[i] * arm[1]
    )
    across = (
        turn * (state.motion.vx[i] * sine + state.motion.vy[i] * cosine)
        + state.motion.yaw_rate[i] * arm[0]
    )
    return along, across


def _apply_impulse(
    state: State, params: StepParameters, hit: Impact, i: int, impulse: F32, lever: F32
) -> None:
    """Change the motion of a vehicle by an impulse, and its position over the rest of the step."""
    vehicles = params.vehicles
    zero = np.zeros_like(lever)
    change = impulse * vehicles.inverse_mass[i]
    along, across = _point_velocity(state, i, (zero, zero), np.ones_like(lever))
    along, across = along + change * hit.normal_s, across + change * hit.normal_d
    spin = impulse * lever * vehicles.inverse_inertia[i]
    state.motion.s[i] = state.motion.s[i] + hit.remaining_time * (change * hit.normal_s)
    state.motion.d[i] = state.motion.d[i] + hit.remaining_time * (change * hit.normal_d)
    state.motion.heading[i] = state.motion.heading[i] + hit.remaining_time * spin
    state.motion.yaw_rate[i] = state.motion.yaw_rate[i] + spin
    sine, cosine = sincos(state.motion.heading[i])
    state.motion.vx[i] = np.where(hit.mask, along * cosine + across * sine, state.motion.vx[i])
    state.motion.vy[i] = np.where(hit.mask, across * cosine - along * sine, state.motion.vy[i])
