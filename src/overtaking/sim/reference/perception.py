"""What each driver believes about the neighbours: seen or not, how far, how fast."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import clamp, exp, maximum, minimum
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
    value_at_slot,
)
from overtaking.world import road_surface
from overtaking.world.step_parameters import StepParameters

# The engine has these numbers too.
_NEAREST_GAP = np.float32(1.0)  # Who touches is as visible, and looms as much, as at this gap [m].


_FARTHEST_GAP = np.float32(1e4)  # Beyond this every limit of sight has been passed [m].


_MAX_OPTICAL_DEPTH = np.float32(
    40.0
)  # Nothing is seen through e**-40; larger exponents only overflow.


_MIN_LOG_CONTRAST = np.float32(0.02)  # Logarithm at which contrast is as good as gone.


_MIN_LOOMING = np.float32(1e-9)  # Keeps the growth finite where all looming is seen [rad/s].


MIN_SIGHT_LINE = np.float32(0.1)  # Keeps sight lines finite alongside [m].


def record_history(state: State, decision_index: int) -> None:
    """Write down where everybody is now, to be seen after a reaction time."""
    along, _ = state.road_velocity()
    state.attention.past_s[decision_index % HISTORY_LENGTH] = state.motion.s
    state.attention.past_speed[decision_index % HISTORY_LENGTH] = along


def checks_mirrors_now(state: State, params: StepParameters, decision_index: int) -> Mask:
    """Who looks into the mirrors and at the other lanes now, (vehicle, simulation).

    Everybody does at an interval, one vehicle after the other, but not at once at the start; once
    more who has signalled for long enough, before moving over; and more often who moves over.

    Source:
        Salvucci, Liu and Boer 2001; Olsen, Lee and Wierwille 2005.
    """
    vehicles = params.vehicles
    constants, all_slots = params.constants, np.arange(state.motion.s.shape[0])[:, None]
    interval = int(constants.glance_interval)
    regular = (decision_index + all_slots * int(constants.glance_stagger)) % interval == 0
    regular = regular & (decision_index >= interval)
    early = state.path.elapsed < constants.abort_until * state.path.duration
    regular = regular | (early & (decision_index % int(constants.glance_moving) == 0))
    signalled = state.lane_choice.time_wanted >= vehicles.indicator_lead_time
    # These drivers overtake by gap acceptance; the others change lanes by MOBIL.
    slots = slice(None) if params.road.has_oncoming_traffic else EGO_SLOT
    signalled[slots] = state.overtake.time_indicating[slots] > vehicles.indicator_lead_time[slots]
    checks_mirrors = regular | ((state.lane_choice.wanted_side != 0) & signalled)
    # Who is in the lane of others looks all the time.
    return checks_mirrors | (
        (state.lane_choice.lane >= np.float32(1.0)) & params.road.has_oncoming_traffic
    )


def draw_shoulder_check(
    state: State, params: StepParameters, drawn: Mask, decision_index: int
) -> None:
    """Draw whether the masked drivers look over the shoulder before their next lane change."""
    vehicles = params.vehicles
    if not drawn.any():
        return
    slots = np.arange(state.motion.s.shape[0], dtype=np.uint32)[:, None] + np.uint32(Stream.GLANCES)
    word = uniform_from_word(
        philox_words(params.seed, params.scenario_index[None, :], slots, decision_index)[0]
    )
    checks = np.where(word < vehicles.checks_blind_spot, np.float32(1.0), np.float32(0.0))
    state.lane_choice.checks_blind_spot = np.where(
        drawn, checks, state.lane_choice.checks_blind_spot
    )


def extinction_ahead(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
) -> tuple[F32, F32]:
    """Extinction around each driver and that of the spray ahead, (vehicle, simulation) [1/m]."""
    vehicles, simulations = params.vehicles, params.simulations
    constants = params.constants
    air = simulations.fog_extinction + simulations.rain_extinction * (
        np.float32(1.0) + state.motion.vx / constants.rain_speed
    )
    path = value_of_lane(params.road.film_path, state.lane_choice.lane, params.road.num_lanes)
    water = road_surface.lane_film(
        simulations.min_wet_film, simulations.film_rain_factor, path, simulations.texture_depth
    )
    lead = neighbours.slot[LEADER]
    speed = value_at_slot(state.motion.vx, lead) / constants.spray_speed
    wetness = minimum(water / constants.spray_film, np.float32(1.0))
    spray = (
        constants.spray_coefficient
        * wetness
        * (speed * speed)
        * value_at_slot(vehicles.spray, lead)
    )
    close = (lead >= 0) & (neighbours.gap[LEADER] < constants.spray_reach)
    return air, np.where(close, spray, np.float32(0.0))


def is_occluded(params: StepParameters, neighbours: Neighbours, role: int) -> Mask:
    """Whether a high leader stands between a driver and the neighbour ahead in `role`."""
    vehicles = params.vehicles
    lead, other = neighbours.slot[LEADER], neighbours.slot[role]
    reach = maximum(neighbours.distance[LEADER] - neighbours.half_length[LEADER], MIN_SIGHT_LINE)
    distance = neighbours.distance[role]
    crossing = neighbours.lateral_distance[role] * (reach / maximum(distance, MIN_SIGHT_LINE))
    offset = np.abs(crossing - neighbours.lateral_distance[LEADER])
    blocked = (
        (distance > reach) & (offset < value_at_slot(vehicles.half_width, lead)) & (other != lead)
    )
    return (lead >= 0) & (value_at_slot(vehicles.blocks_view, lead) > 0) & blocked


def sight_range_ratio(
    params: StepParameters,
    gap: F32,
    shines: tuple[F32, F32],
    depths: tuple[F32, F32],
    *,
    is_front: bool,
) -> F32:
    """How close to the limit of sight somebody at a gap is: below 1 it can be seen.

    By contrast the value is the distance over the range of sight (Koschmieder), by lamps the root
    of threshold over illuminance (Allard), which in clear air is the distance over the range as
    well.

    Args:
        params: Parameters of the batch.
        gap: The gap [m].
        shines: Logarithm of the contrast, and one over the intensity of the lamps [1/cd].
        depths: What `optical_depth` returned.
        is_front: Whether it is seen ahead, not in the mirrors.
    """
    simulations, constants = params.simulations, params.constants
    air, spray = depths
    contrast, lamp = shines
    distance = clamp(gap, _NEAREST_GAP, _FARTHEST_GAP)
    depth, sensitivity = air * distance, simulations.log_contrast_sensitivity_behind
    if is_front:
        depth = depth + spray * minimum(distance, constants.spray_reach)
        sensitivity = simulations.log_contrast_sensitivity_ahead
    by_contrast = depth / maximum(contrast + sensitivity, _MIN_LOG_CONTRAST)
    by_contrast = maximum(by_contrast, distance * simulations.inverse_lit_range)
    by_lamp = np.sqrt(
        distance
        * distance
        * (simulations.lamp_threshold * lamp)
        * exp(minimum(depth, _MAX_OPTICAL_DEPTH))
    )
    return minimum(by_contrast, by_lamp)


def _inverse_rear_lamp(state: State, params: StepParameters, slot: F32) -> F32:
    """One over the intensity of what shines at the rear of a vehicle [1/cd]."""
    vehicles, constants = params.vehicles, params.constants
    lamp = value_at_slot(vehicles.inverse_tail_lamp, slot)
    braking = value_at_slot(state.controls.requested_accel, slot) < -constants.stop_lamp_decel
    return np.where(braking, minimum(lamp, constants.inverse_stop_lamp), lamp)


def detect(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    role: int,
    depths: tuple[F32, F32],
    before: tuple[F32, F32],
    watches: tuple[Mask, Mask],
) -> Mask:
    """Whether each driver has noticed the neighbour in `role`; advances the time in view.

    Who was in view at the last look `before`, in whatever role, is not lost by passing or by a
    change of lanes. The masks `watches` say who keeps an eye on the role, and who looks there now.
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants = params.constants
    slot, gap = neighbours.slot[role], neighbours.gap[role]
    is_front = role % 2 == 0
    lamp = (
        _inverse_rear_lamp(state, params, slot)
        if is_front
        else value_at_slot(vehicles.inverse_head_lamp, slot)
    )
    effort = sight_range_ratio(
        params, gap, (value_at_slot(vehicles.log_contrast, slot), lamp), depths, is_front=is_front
    )
    reach = vehicles.attention_range if is_front else constants.mirror_range
    visible = (slot >= 0) & (effort <= np.float32(1.0)) & (gap < reach)
    if is_front:
        visible = visible & ~is_occluded(params, neighbours, role)
    # Who comes as near as this is noticed without a look over the shoulder.
    aside = np.abs(neighbours.lateral_distance[role]) - (
        vehicles.half_width + value_at_slot(vehicles.half_width, slot)
    )
    hides = gap < (np.float32(0.0) if is_front else constants.blind_spot)
    visible = visible & ~(
        hides & (aside > constants.alongside) & (state.lane_choice.checks_blind_spot == 0)
    )
    steadily, now = watches
    more = np.where(steadily, constants.decision, constants.glance_time)
    longer = np.zeros_like(gap)
    for known, time in zip(*before, strict=True):
        longer = np.where(slot == known, maximum(longer, time), longer)
    longer = np.where(
        before[0][role] == NEVER_LOOKED, constants.initial_time_in_view, longer + more
    )
    longer = np.where(visible, longer, np.float32(0.0))
    state.attention.time_in_view[role] = np.where(now, longer, state.attention.time_in_view[role])
    state.attention.slot_in_view[role] = np.where(now, slot, state.attention.slot_in_view[role])
    needed = simulations.detection_time * (
        np.float32(1.0) + constants.detection_growth * (effort * effort * effort)
    )
    return now & visible & (state.attention.time_in_view[role] >= needed)


def recall_motion(state: State, then: F32, slot: F32) -> tuple[F32, F32]:
    """Where the vehicles in `slot` were at decisions `then`, and how fast [m, m/s]."""
    row, slots = then.astype(np.int64) % HISTORY_LENGTH, slot.astype(np.int64).clip(0)
    column = np.arange(state.motion.s.shape[1])
    return state.attention.past_s[row, slots, column], state.attention.past_speed[
        row, slots, column
    ]


def sense_looming(
    state: State,
    params: StepParameters,
    gap: F32,
    closing: F32,
    width: F32,
) -> tuple[Mask, F32, F32, F32]:
    """How an approach looms to each driver, (vehicle, simulation).

    Args:
        state: State at a decision.
        params: Parameters of the batch.
        gap: The gap [m].
        closing: Speed of approach [m/s].
        width: What is seen to grow [m].

    Returns:
        Whether it looms at all; how much of it is noticed, 0 to 1; what is left of misjudgements
        as contact comes near, 0 to 1; the speed of approach that is sensed [m/s].

    Source:
        Lee 1976 (time to contact from optical expansion).
    """
    simulations, constants = params.simulations, params.constants
    one = np.float32(1.0)
    distance = maximum(gap, _NEAREST_GAP)
    expansion = width * np.abs(closing) / (distance * distance)
    excess = expansion - constants.looming_threshold
    span = maximum(constants.looming_growth * constants.looming_threshold, _MIN_LOOMING)
    clear = clamp(excess / span, np.float32(0.0), one)
    fading = maximum(closing * constants.error_fade_time, _NEAREST_GAP)
    share = minimum(distance / fading, one)
    sensed = closing * (one + share * (simulations.speed_error * state.noise.speed_error))
    return excess > 0, clear, share, sensed


def form_beliefs(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    decision_index: int,
    checks_mirrors: Mask,
) -> Beliefs:
    """What each driver believes about the six neighbours.

    Drivers watch the leader, and while they change lanes also those ahead on either side. At the
    others they glance: who is not looked at is as good as not there, and nothing is decided then.

    Others are seen as they were a reaction time ago and carried on at constant speed, as in the
    human driver model of Treiber, Kesting and Helbing (2006); their distance and closing speed are
    misjudged by slowly varying factors. An approach is noticed above the threshold of looming, a
    little at first. The misjudgement fades as contact comes near, since expansion alone tells the
    time that is left (`sense`).
    """
    vehicles, simulations = params.vehicles, params.simulations
    constants = params.constants
    depths = extinction_ahead(state, params, neighbours)
    own_speed, _ = state.road_velocity()
    judged = exp(simulations.distance_error * state.noise.distance_error)
    before = state.attention.slot_in_view.copy(), state.attention.time_in_view.copy()
    changing = state.path.elapsed < state.path.duration
    detected, gaps, closings, accels = [], [], [], []
    for role in range(6):
        slot = neighbours.slot[role]
        steadily = (role == LEADER) | (changing & (role % 2 == 0))
        watches = steadily, checks_mirrors | steadily
        noticed = detect(state, params, neighbours, role, depths, before, watches)
        ticks = np.where(
            _is_imminent(state, params, neighbours, role),
            vehicles.urgent_reaction_delay,
            vehicles.reaction_delay,
        )
        then = maximum(np.float32(decision_index) - ticks, np.float32(0.0))
        elapsed = (np.float32(decision_index) - then) * constants.decision
        place, speed = recall_motion(state, then, slot)
        place = place + speed * elapsed
        ahead = nearest_image(
            params, place - state.motion.s if role % 2 == 0 else state.motion.s - place
        )
        gap = ahead - (neighbours.half_length[role] + vehicles.half_length)
        closing = own_speed - speed if role % 2 == 0 else speed - own_speed
        width = value_at_slot(vehicles.looming_width, slot)
        looms, clear, share, sensed = sense_looming(state, params, gap, closing, width)
        error = (judged - np.float32(1.0)) * share
        detected.append(noticed)
        gaps.append(np.where(noticed, gap + gap * error, constants.unseen_gap))
        closings.append(np.where(noticed, clear * sensed, np.float32(0.0)))
        accels.append(_believed_braking(state, params, neighbours, role, then, noticed, looms))
    return Beliefs(
        is_detected=np.stack(detected),
        gap=np.stack(gaps),
        closing_speed=np.stack(closings),
        accel=np.stack(accels),
    )


def _is_imminent(state: State, params: StepParameters, neighbours: Neighbours, role: int) -> Mask:
    """Whether the leader, who alone is watched all the time, comes near very soon.

    Source:
        Markkula et al. 2016: drivers brake sooner, the more urgent the looming.
    """
    constants = params.constants
    closing = state.motion.vx - value_at_slot(state.motion.vx, neighbours.slot[LEADER])
    return (role == LEADER) & (neighbours.gap[LEADER] < constants.urgent_time * closing)


def _believed_braking(
    state: State,
    params: StepParameters,
    neighbours: Neighbours,
    role: int,
    then: F32,
    noticed: Mask,
    looming: Mask,
) -> F32:
    """How hard somebody ahead seemed to brake a reaction time ago, (vehicle, simulation) [m/s^2].

    Stop lamps say that there is braking, not how much; that is seen once the leader looms.
    """
    constants = params.constants
    if role % 2 == 1:
        return np.zeros_like(then)
    before = maximum(then - constants.brake_memory, np.float32(0.0))
    _, late = recall_motion(state, then, neighbours.slot[role])
    _, early = recall_motion(state, before, neighbours.slot[role])
    change = minimum(
        (late - early) / (constants.brake_memory * constants.decision), np.float32(0.0)
    )
    lamps = (change < -constants.stop_lamp_decel) & ~looming
    seen = np.where(lamps, minimum(change, -constants.lamp_decel), change)
    return np.where(noticed, seen, np.float32(0.0))
