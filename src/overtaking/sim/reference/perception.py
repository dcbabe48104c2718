"""Beliefs of drivers about their neighbours: detection, gap, closing speed and braking.

A *role* is one of six places around a driver: the leaders and followers in its own, the left and
the right lane. Left is the overtaking side, and lateral distances are positive to the left. A
driver *watches* a role at every decision, 20 a second, or *glances* at it when it checks its
mirrors. A vehicle *looms* to a driver while its image visibly grows. A reaction delay is a number
of decisions, a slot the number of a vehicle in its simulation; without a vehicle `value_at_slot`
reads slot 0.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import ONE, ZERO, clamp, exp, maximum, minimum
from overtaking.core.random_numbers import Stream, philox_words, uniform_from_word
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.decision_context import Beliefs, Neighbours
from overtaking.sim.reference.neighbour_search import nearest_image
from overtaking.sim.reference.road_conditions import value_of_lane
from overtaking.sim.reference.state import (
    HISTORY_LENGTH,
    LEADER,
    NEVER_LOOKED,
    State,
    is_leader_role,
    value_at_slot,
)
from overtaking.world import road_surface
from overtaking.world.step_parameters import StepParameters

# A closer vehicle is as visible as at this gap, and looms as much [m].
_NEAREST_GAP = np.float32(1.0)
_FARTHEST_GAP = np.float32(1e4)  # Larger than every range of sight; keeps squares finite [m].
_MAX_OPTICAL_DEPTH = np.float32(40.0)  # Nothing is visible through it; bounds the exponent [1].
_MIN_LOG_CONTRAST = np.float32(0.02)  # The outline of a near vehicle shows even against the sun.
_MIN_LOOMING = np.float32(1e-9)  # Keeps a quotient finite if the threshold is 0 [rad/s].

MIN_SIGHT_LINE = np.float32(0.1)
"""Smallest length of a line of sight, which keeps it finite alongside [m]."""


class Extinction(NamedTuple):
    """Extinction coefficients, (vehicle, simulation) [1/m]."""

    air: F32  # Of fog and rain around the driver.
    spray: F32  # Of the spray behind its leader.


class Conspicuity(NamedTuple):
    """How well a vehicle can be seen, (vehicle, simulation)."""

    log_contrast: F32  # Logarithm of its contrast.
    inverse_lamp_intensity: F32  # One over the luminous intensity towards the driver [1/cd].


class Looming(NamedTuple):
    """How an approach looms to each driver, (vehicle, simulation)."""

    exceeds_threshold: Mask  # Whether the image grows fast enough for the driver to notice.
    noticed_share: F32  # Share of the closing speed that the driver notices, 0 to 1.
    error_share: F32  # Share of the driver's errors that is left; falls to 0 before a contact.
    closing_speed: F32  # Closing speed with the driver's error [m/s].


class RecalledMotion(NamedTuple):
    """Past motion of vehicles, extrapolated to this decision, (vehicle, simulation)."""

    s: F32  # Station now, if the speed has stayed the same [m].
    speed: F32  # Speed along the road [m/s].
    observed_at: F32  # Index of the decision at which the driver saw the vehicle.


@dataclass(frozen=True, slots=True, kw_only=True)
class Gaze:
    """Where drivers look at one decision.

    Attributes:
        extinction: Extinction around each driver, and in the spray ahead.
        watches_role: Whether the driver watches this role at every decision, (vehicle, simulation).
        looks_at_role: Whether the driver looks at this role now, (vehicle, simulation).
        known_slots: Vehicle in each role at the last look, (role, vehicle, simulation).
        known_times: Time for which that vehicle had been in view, same shape [s].
    """

    extinction: Extinction
    watches_role: Mask
    looks_at_role: Mask
    known_slots: F32
    known_times: F32


def record_history(state: State, decision_index: int) -> None:
    """Store the motion of all vehicles, which drivers recall after their reaction delay."""
    speed, _ = state.road_velocity()
    row = decision_index % HISTORY_LENGTH
    state.attention.past_s[row], state.attention.past_speed[row] = state.motion.s, speed


def checks_mirrors_now(state: State, params: StepParameters, decision_index: int) -> Mask:
    """Whether drivers check mirrors and adjacent lanes now, (vehicle, simulation).

    Drivers look once in each interval, once more when they have indicated for long enough, before
    they move over, more often in the first part of a lane change, and at every decision in the
    opposing lane.

    Source:
        Salvucci, Liu and Boer 2001; Olsen, Lee and Wierwille 2005.
    """
    vehicles, constants, choice = params.vehicles, params.constants, state.lane_choice
    all_slots = np.arange(len(state.motion.s))[:, None]
    interval = int(constants.glance_interval)
    # The drivers of a simulation look one after the other: the stagger of 7 and the interval of 20
    # decisions have no common factor. A slot looks at the same decisions in all simulations. The
    # engine computes sixteen of them at once and saves time at decisions without a look; with looks
    # at random times one of the sixteen would look at more than half of the decisions.
    is_due = (decision_index + all_slots * int(constants.glance_stagger)) % interval == 0
    # No look in the first interval, so no driver indicates or changes lanes in it.
    is_due = is_due & (decision_index >= interval)
    # As long as a driver may still cancel its lane change.
    may_cancel = state.path.elapsed < constants.abort_until * state.path.duration
    is_due = is_due | (may_cancel & (decision_index % int(constants.glance_moving) == 0))
    has_indicated = choice.time_wanted >= vehicles.indicator_lead_time
    # The drivers in these slots overtake by gap acceptance, which counts `time_indicating`; the
    # others change lanes by MOBIL, which counts `time_wanted`. Each model starts its lane changes
    # by this comparison, > or >=.
    overtaking_slots = slice(None) if params.road.has_oncoming_traffic else EGO_SLOT
    time_indicating = state.overtake.time_indicating[overtaking_slots]
    lead_time = vehicles.indicator_lead_time[overtaking_slots]
    has_indicated[overtaking_slots] = time_indicating > lead_time
    checks_mirrors = is_due | ((choice.wanted_side != 0) & has_indicated)
    # On a two-way road, a lane from 1 on is the opposing lane.
    return checks_mirrors | ((choice.lane >= ONE) & params.road.has_oncoming_traffic)


def draw_shoulder_check(
    state: State, params: StepParameters, is_drawn: Mask, decision_index: int
) -> None:
    """Draw whether drivers look over the shoulder before their next lane change.

    `vehicles.checks_blind_spot` is the probability that they look.

    Args:
        state: The function updates `lane_choice.checks_blind_spot`.
        params: Parameters of the batch.
        is_drawn: Drivers to draw for, (vehicle, simulation).
        decision_index: Index of this decision.
    """
    if not is_drawn.any():
        return
    # Each slot has a stream of random words of its own.
    streams = np.arange(len(state.motion.s), dtype=np.uint32)[:, None] + np.uint32(Stream.GLANCES)
    words = philox_words(params.seed, params.scenario_index[None, :], streams, decision_index)
    checks = np.where(uniform_from_word(words[0]) < params.vehicles.checks_blind_spot, ONE, ZERO)
    choice = state.lane_choice
    choice.checks_blind_spot = np.where(is_drawn, checks, choice.checks_blind_spot)


def extinction_ahead(state: State, params: StepParameters, neighbours: Neighbours) -> Extinction:
    """Extinction around each driver and in the spray ahead of it."""
    vehicles, simulations = params.vehicles, params.simulations
    constants, vx = params.constants, state.motion.vx
    # A moving driver meets more rain drops.
    rain_factor = ONE + vx / constants.rain_speed
    air = simulations.fog_extinction + simulations.rain_extinction * rain_factor
    # The factor by which the film grows with the distance over which water drains to the lane.
    path_factor = value_of_lane(
        params.road.film_path, state.lane_choice.lane, params.road.num_lanes
    )
    # Depth of the water on the driver's lane.
    film = road_surface.lane_film(
        simulations.min_wet_film,
        simulations.film_rain_factor,
        path_factor,
        simulations.texture_depth,
    )
    leader = neighbours.slot[LEADER]
    # Spray grows with the film of water, up to a limit, and with the square of the leader's speed.
    speed_ratio = value_at_slot(vx, leader) / constants.spray_speed
    wetness = minimum(film / constants.spray_film, ONE)
    vehicle_factor = value_at_slot(vehicles.spray, leader)
    spray = constants.spray_coefficient * wetness * (speed_ratio * speed_ratio) * vehicle_factor
    is_close = (leader >= 0) & (neighbours.gap[LEADER] < constants.spray_reach)
    return Extinction(air=air, spray=np.where(is_close, spray, ZERO))


def is_occluded(params: StepParameters, neighbours: Neighbours, role: int) -> Mask:
    """Whether a tall leader stands between a driver and the neighbour ahead in `role`."""
    vehicles, lateral_distance = params.vehicles, neighbours.lateral_distance
    leader, slot = neighbours.slot[LEADER], neighbours.slot[role]
    distance = neighbours.distance[role]
    distance_to_rear = maximum(
        neighbours.distance[LEADER] - neighbours.half_length[LEADER], MIN_SIGHT_LINE
    )
    # Lateral position, seen from the driver, at which the line of sight passes the leader's rear.
    crossing = lateral_distance[role] * (distance_to_rear / maximum(distance, MIN_SIGHT_LINE))
    offset = np.abs(crossing - lateral_distance[LEADER])
    # A leader on the line between two lanes has two roles, but does not hide itself.
    is_beyond_leader = (distance > distance_to_rear) & (slot != leader)
    is_blocked = is_beyond_leader & (offset < value_at_slot(vehicles.half_width, leader))
    return (leader >= 0) & (value_at_slot(vehicles.blocks_view, leader) > 0) & is_blocked


def sight_range_ratio(
    params: StepParameters,
    gap: F32,
    conspicuity: Conspicuity,
    extinction: Extinction,
    *,
    is_ahead: bool,
) -> F32:
    """Distance of a vehicle over the range at which it can be seen; up to 1 it can be seen [1].

    The ratio is the smaller of two. By contrast it is the distance over the range of sight
    (Koschmieder). By lamps it is the root of the eye's threshold over the illuminance (Allard); in
    clear air this root is a distance over a range, too.

    Args:
        params: Parameters of the batch.
        gap: Gap to the vehicle [m].
        conspicuity: Contrast and lamps of the vehicle.
        extinction: Extinction between driver and vehicle.
        is_ahead: Whether the vehicle is ahead of the driver, not in its mirrors.
    """
    simulations, constants = params.simulations, params.constants
    distance = clamp(gap, _NEAREST_GAP, _FARTHEST_GAP)
    depth = extinction.air * distance
    sensitivity = simulations.log_contrast_sensitivity_behind
    if is_ahead:
        depth = depth + extinction.spray * minimum(distance, constants.spray_reach)
        sensitivity = simulations.log_contrast_sensitivity_ahead
    # The divisor is the optical depth at which the vehicle vanishes: the logarithm of its contrast
    # over the eye's threshold.
    by_contrast = depth / maximum(conspicuity.log_contrast + sensitivity, _MIN_LOG_CONTRAST)
    # At night the contrast counts within the reach of the driver's low beam only.
    by_contrast = maximum(by_contrast, distance * simulations.inverse_lit_range)
    threshold = simulations.lamp_threshold * conspicuity.inverse_lamp_intensity
    attenuation = exp(minimum(depth, _MAX_OPTICAL_DEPTH))
    by_lamp = np.sqrt(distance * distance * threshold * attenuation)
    return minimum(by_contrast, by_lamp)


def detection_time(params: StepParameters, ratio: F32) -> F32:
    """Time in view until a driver detects a vehicle [s].

    At the limit of sight, where the ratio is 1, it is longer by the factor 1 + `detection_growth`.
    The third power is a choice.
    """
    growth = params.constants.detection_growth * (ratio * ratio * ratio)
    return params.simulations.detection_time * (ONE + growth)


def detect(
    state: State, params: StepParameters, neighbours: Neighbours, role: int, gaze: Gaze
) -> Mask:
    """Update the time in view of the neighbour in `role`.

    Returns:
        Whether each driver looks at the neighbour now and has had it in view for the detection
        time, which grows towards the limit of sight.
    """
    constants, slot = params.constants, neighbours.slot[role]
    ratio = _sight_range_ratio_of(state, params, neighbours, role, gaze.extinction)
    is_visible = _is_visible(state, params, neighbours, role, ratio)
    # A glance adds half a second, so a driver needs several glances for a vehicle that is hard to
    # see. A watched vehicle gains the 50 ms of each decision.
    added_time = np.where(gaze.watches_role, constants.decision, constants.glance_time)
    # The vehicle may have been in another role before: passing it, or changing lanes, does not
    # restart its detection.
    time_so_far = np.zeros_like(ratio)
    for known_slot, known_time in zip(gaze.known_slots, gaze.known_times, strict=True):
        time_so_far = np.where(slot == known_slot, maximum(time_so_far, known_time), time_so_far)
    # Drivers have watched the traffic before the first frame.
    is_first_look = gaze.known_slots[role] == NEVER_LOOKED
    time_in_view = np.where(is_first_look, constants.initial_time_in_view, time_so_far + added_time)
    time_in_view = np.where(is_visible, time_in_view, ZERO)
    attention = state.attention
    attention.time_in_view[role] = np.where(
        gaze.looks_at_role, time_in_view, attention.time_in_view[role]
    )
    attention.slot_in_view[role] = np.where(gaze.looks_at_role, slot, attention.slot_in_view[role])
    is_seen_long_enough = attention.time_in_view[role] >= detection_time(params, ratio)
    return gaze.looks_at_role & is_visible & is_seen_long_enough


def _sight_range_ratio_of(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    role: int,
    extinction: Extinction,
) -> F32:
    """Distance of the neighbour in `role` over the range at which it can be seen [1].

    The driver sees the rear lamps of vehicles ahead and the headlamps of vehicles behind.
    """
    vehicles, slot = params.vehicles, neighbours.slot[role]
    is_ahead = is_leader_role(role)
    if is_ahead:
        lamp = _inverse_rear_lamp(state, params, slot)
    else:
        lamp = value_at_slot(vehicles.inverse_head_lamp, slot)
    conspicuity = Conspicuity(value_at_slot(vehicles.log_contrast, slot), lamp)
    gap = neighbours.gap[role]
    return sight_range_ratio(params, gap, conspicuity, extinction, is_ahead=is_ahead)


def _inverse_rear_lamp(state: State, params: StepParameters, slot: F32) -> F32:
    """One over the intensity of the brighter rear lamp that is on, tail or stop lamp [1/cd]."""
    vehicles, constants = params.vehicles, params.constants
    lamp = value_at_slot(vehicles.inverse_tail_lamp, slot)
    is_braking = value_at_slot(state.controls.requested_accel, slot) < -constants.stop_lamp_decel
    return np.where(is_braking, minimum(lamp, constants.inverse_stop_lamp), lamp)


def _is_visible(
    state: State, params: StepParameters, neighbours: Neighbours, role: int, ratio: F32
) -> Mask:
    """Whether the neighbour in `role` can be seen: in range, not occluded, not in a blind spot."""
    constants, vehicles = params.constants, params.vehicles
    slot, gap = neighbours.slot[role], neighbours.gap[role]
    is_ahead = is_leader_role(role)
    max_range = vehicles.attention_range if is_ahead else constants.mirror_range
    is_visible = (slot >= 0) & (ratio <= ONE) & (gap < max_range)
    if is_ahead:
        is_visible = is_visible & ~is_occluded(params, neighbours, role)
    # The blind spot reaches from the driver's rear bumper backwards; a leader is in it only
    # alongside, where the gap is negative. From the corner of the eye the driver sees a vehicle at
    # a lateral gap up to `alongside`.
    half_widths = vehicles.half_width + value_at_slot(vehicles.half_width, slot)
    lateral_gap = np.abs(neighbours.lateral_distance[role]) - half_widths
    is_beside = gap < (ZERO if is_ahead else constants.blind_spot)
    is_in_blind_spot = is_beside & (lateral_gap > constants.alongside)
    # A look over the shoulder shows what is in the blind spot.
    return is_visible & ~(is_in_blind_spot & (state.lane_choice.checks_blind_spot == 0))


def recall_motion(state: State, decision_index: F32, slot: F32) -> tuple[F32, F32]:
    """Station [m] and speed along the road [m/s] of the vehicles in `slot` at past decisions."""
    # `NO_SLOT` reads the history of slot 0; callers ignore the result.
    row, slots = decision_index.astype(np.int64) % HISTORY_LENGTH, slot.astype(np.int64).clip(0)
    column = np.arange(state.motion.s.shape[1])
    past = state.attention
    return past.past_s[row, slots, column], past.past_speed[row, slots, column]


def extrapolate_motion(
    state: State, params: StepParameters, slot: F32, delay: F32, decision_index: int
) -> RecalledMotion:
    """Motion of vehicles as drivers saw it a reaction delay ago, extrapolated at constant speed.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        slot: Slots of the vehicles.
        delay: Reaction delay [decisions].
        decision_index: Index of this decision.

    Source:
        Treiber, Kesting and Helbing 2006 (human driver model).
    """
    observed_at = maximum(np.float32(decision_index) - delay, ZERO)
    elapsed = (np.float32(decision_index) - observed_at) * params.constants.decision
    s, speed = recall_motion(state, observed_at, slot)
    return RecalledMotion(s=s + speed * elapsed, speed=speed, observed_at=observed_at)


def sense_looming(
    state: State, params: StepParameters, gap: F32, closing_speed: F32, width: F32
) -> Looming:
    """Looming of an approaching vehicle: the growth of its image, and what drivers notice of it.

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        gap: Gap to the vehicle [m].
        closing_speed: Closing speed, positive while the gap shrinks [m/s].
        width: Width of the vehicle, at night the distance between its lamps [m].

    Source:
        Lee 1976 (time to contact from optical expansion).
    """
    simulations, constants = params.simulations, params.constants
    distance = maximum(gap, _NEAREST_GAP)
    # Rate of change of the visual angle w / s of a width w at a distance s.
    expansion_rate = width * np.abs(closing_speed) / (distance * distance)
    excess = expansion_rate - constants.looming_threshold
    # From the threshold to this much above it, drivers notice a growing share of the approach. If
    # they noticed all at once, they would brake hard at the threshold, release below it, and brake
    # again.
    span = maximum(constants.looming_growth * constants.looming_threshold, _MIN_LOOMING)
    # Nearer than this, errors fade: there the time to contact is below `error_fade_time`.
    fading_distance = maximum(closing_speed * constants.error_fade_time, _NEAREST_GAP)
    error_share = minimum(distance / fading_distance, ONE)
    # The coefficient of variation times a random process of unit variance.
    error = error_share * (simulations.speed_error * state.noise.speed_error)
    return Looming(
        exceeds_threshold=excess > 0,
        noticed_share=clamp(excess / span, ZERO, ONE),
        error_share=error_share,
        closing_speed=closing_speed * (ONE + error),
    )


def form_beliefs(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    decision_index: int,
    checks_mirrors: Mask,
) -> Beliefs:
    """Beliefs of each driver about its six neighbours.

    Drivers watch the leader, and while they change lanes also the vehicles ahead on either side.
    They glance at the other neighbours, and ignore them between two glances.

    Drivers extrapolate the motion that they saw a reaction delay ago. They misjudge distance and
    closing speed by slowly varying factors. They believe in a closing speed of 0 below the
    threshold of looming, and in a growing share of the true one above it. The errors fade as
    contact comes near, because the growth of the image shows the time to contact.
    """
    vehicles, constants = params.vehicles, params.constants
    extinction = extinction_ahead(state, params, neighbours)
    own_speed, _ = state.road_velocity()  # Along the road.
    distance_factor = exp(params.simulations.distance_error * state.noise.distance_error)
    # Copies, because `detect` updates the attention in each role.
    known_slots = state.attention.slot_in_view.copy()
    known_times = state.attention.time_in_view.copy()
    is_changing_lanes = state.path.elapsed < state.path.duration
    detected, gaps, closing_speeds, accels = [], [], [], []
    for role in range(6):
        slot, is_ahead = neighbours.slot[role], is_leader_role(role)
        watches_role = (role == LEADER) | (is_changing_lanes & is_ahead)
        gaze = Gaze(
            extinction=extinction,
            watches_role=watches_role,
            looks_at_role=checks_mirrors | watches_role,
            known_slots=known_slots,
            known_times=known_times,
        )
        is_detected = detect(state, params, neighbours, role, gaze)
        is_imminent = _is_imminent(state, params, neighbours, role)
        delay = np.where(is_imminent, vehicles.urgent_reaction_delay, vehicles.reaction_delay)
        recalled = extrapolate_motion(state, params, slot, delay, decision_index)
        distance = recalled.s - state.motion.s if is_ahead else state.motion.s - recalled.s
        half_lengths = neighbours.half_length[role] + vehicles.half_length
        # On a ring road `nearest_image` takes the shorter way round.
        gap = nearest_image(params, distance) - half_lengths
        closing_speed = own_speed - recalled.speed if is_ahead else recalled.speed - own_speed
        width = value_at_slot(vehicles.looming_width, slot)
        looming = sense_looming(state, params, gap, closing_speed, width)
        believed_gap = gap + gap * ((distance_factor - ONE) * looming.error_share)
        believed_closing_speed = looming.noticed_share * looming.closing_speed
        accel = _believed_braking(state, params, slot, recalled.observed_at, looming)
        detected.append(is_detected)
        gaps.append(np.where(is_detected, believed_gap, constants.unseen_gap))
        closing_speeds.append(np.where(is_detected, believed_closing_speed, ZERO))
        accels.append(np.where(is_detected & is_ahead, accel, ZERO))
    return Beliefs(
        is_detected=np.stack(detected),
        gap=np.stack(gaps),
        closing_speed=np.stack(closing_speeds),
        accel=np.stack(accels),
    )


def _is_imminent(state: State, params: StepParameters, neighbours: Neighbours, role: int) -> Mask:
    """Whether contact is near and `role` is the leader's, the one role that drivers always watch.

    Source:
        Markkula et al. 2016: drivers brake sooner, the more urgent the looming.
    """
    # The true motion now: the driver's beliefs depend on the delay that this function selects.
    closing_speed = state.motion.vx - value_at_slot(state.motion.vx, neighbours.slot[LEADER])
    is_near = neighbours.gap[LEADER] < params.constants.urgent_time * closing_speed
    return (role == LEADER) & is_near


def _believed_braking(
    state: State, params: StepParameters, slot: F32, observed_at: F32, looming: Looming
) -> F32:
    """Believed acceleration of vehicles ahead a reaction delay ago, never positive [m/s^2].

    The mean over `brake_memory` decisions. While stop lamps show that a vehicle brakes, but no
    looming shows how hard, drivers assume at least the deceleration `lamp_decel`.
    """
    constants = params.constants
    earlier = maximum(observed_at - constants.brake_memory, ZERO)
    _, speed = recall_motion(state, observed_at, slot)
    _, earlier_speed = recall_motion(state, earlier, slot)
    accel = (speed - earlier_speed) / (constants.brake_memory * constants.decision)
    accel = minimum(accel, ZERO)
    # The history holds motion only, so lamps count as lit beyond the deceleration that lights them.
    sees_lamps_only = (accel < -constants.stop_lamp_decel) & ~looming.exceeds_threshold
    return np.where(sees_lamps_only, minimum(accel, -constants.lamp_decel), accel)
