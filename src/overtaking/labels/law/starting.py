"""Rules about the begin of an overtake: L4, L5, L6, L7."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.core.float32_math import maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.beliefs import belief_at, pull_out_percept
from overtaking.labels.law.case import neighbour_at
from overtaking.labels.law.margins import finding_at_frame
from overtaking.labels.law.measurement_errors import (
    BRAKING_ERROR_FORMULA,
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    errors_of_two_vehicles,
    gap_error,
    propagated_error,
)
from overtaking.labels.law.numbers import ABRUPT_BRAKING, amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import (
    GapMargin,
    decel_for_safe_distance,
    entry_margin_ahead,
    entry_margin_behind,
)
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    Frames,
    OtherVehicles,
    at_frame,
    indicator_to_overtaking_side,
    lateral_speed_at,
    lateral_speed_half_window,
    other_vehicles_at,
    scatter,
    slot_or_ego,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE, PerceivedVehicle, Trajectories
from overtaking.model.verdicts import Case, Finding

_THIRD_DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])
"""A third difference: 0 for a parabola, with 20 times the variance of the noise."""


def denoised_lateral_speed_at(
    trajectories: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames, limit: float
) -> F32:
    """Speed of vehicles to the left at single frames, all arrays of shape (instant,) [m/s].

    In a recording the central difference over about 0.2 s is widened, up to 2 s, until its standard
    error is a quarter of the limit. The noise of a position is the root mean square of its third
    differences within a second, over the root of 20; the error of a difference over 2 h is the
    noise times the root of 2, over 2 h. Simulations have no noise.

    Args:
        trajectories: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        frames: A frame of each in which it is recorded.
        limit: The speed with which it is compared [m/s].
    """
    if not trajectories.unknown:
        return lateral_speed_at(trajectories, rows, slot, frames)
    interval = trajectories.scenario.frame_interval_ms
    max_half_window = int(float(constant("law.others.noise_time")) * 1000.0 / interval)
    max_error = float(constant("law.others.error_share")) * limit
    required_duration = (
        np.sqrt(2.0)
        * _lateral_noise(trajectories, rows, slot, frames, max(2, max_half_window))
        / max_error
    )
    half_window = np.ceil(required_duration / 2.0 * 1000.0 / interval)
    min_half_window = lateral_speed_half_window(interval)
    half_window = np.clip(
        half_window, min_half_window, max(min_half_window, max_half_window)
    ).astype(np.int32)
    return lateral_speed_at(trajectories, rows, slot, frames, half_window)


def _lateral_noise(
    trajectories: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames, around: int
) -> NDArray[np.float64]:
    """Standard deviation of the noise of a lateral position, from frames around it [m]."""
    frame = frames[:, None] + np.arange(-around, around + 1)
    is_recorded = (frame >= 0) & (frame < trajectories.num_frames[rows, None])
    instants = (rows[:, None], slot[:, None], np.where(is_recorded, frame, 0))
    is_recorded &= trajectories.state_mask[instants]
    d = trajectories.states.d[instants] * float(METRES_PER_MM)
    num_differences = frame.shape[1] - len(_THIRD_DIFFERENCE) + 1
    windows = [
        (d[:, k : k + num_differences], is_recorded[:, k : k + num_differences])
        for k in range(len(_THIRD_DIFFERENCE))
    ]
    third_difference = sum(
        weight * values for weight, (values, _) in zip(_THIRD_DIFFERENCE, windows, strict=True)
    )
    is_complete = np.logical_and.reduce([is_inside for _, is_inside in windows])
    squares = np.where(is_complete, third_difference**2, 0.0).sum(axis=1)
    return np.sqrt(squares / np.maximum(is_complete.sum(axis=1), 1) / (_THIRD_DIFFERENCE**2).sum())


def _entering(
    place: NeighbourRole, margin: GapMargin
) -> Callable[[Case, Finding, MeasurementErrors], F32]:
    """Of the gap to a neighbour in the entered lane as the line is crossed."""

    def standard_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        del finding
        return gap_error(case, place, case.events.line_crossed, margin, errors)

    return standard_error


ENTERING_AHEAD = Spread(
    formula=f"{GAP_ERROR_FORMULA}, or sqrt(2 sp^2 + 2 ({amount('law.entry.ttc')})^2 sv^2) where "
    "the time to collision decides",
    standard_error=_entering(NeighbourRole.LEFT_LEADER, entry_margin_ahead),
)

ENTERING_BEHIND = Spread(
    formula=f"{GAP_ERROR_FORMULA}, or {BRAKING_ERROR_FORMULA}",
    standard_error=_entering(NeighbourRole.LEFT_FOLLOWER, entry_margin_behind),
)


def _room_ahead(case: Case) -> Finding:
    """When the line is crossed, the leader on the left is at a lawful gap, 3 s or more away."""
    signals, frame = case.signals, case.events.line_crossed
    leader, decel = (
        neighbour_at(case, NeighbourRole.LEFT_LEADER, frame),
        decel_for_safe_distance(at_frame(signals.friction, frame)),
    )
    margin = entry_margin_ahead(
        leader.gap, at_frame(signals.speed, frame), leader.closing_speed, decel
    )
    believed = belief_at(
        case, pull_out_percept(case), {PerceivedVehicle.NEW_LEADER: entry_margin_ahead}
    )
    return finding_at_frame(frame, margin, leader.valid, belief=believed)


L4 = Rule(
    id="pt.ce.38-1.front@2013",
    code="L4",
    article="Article 38(1) and (2)(a)",
    title="Room ahead in the lane entered",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic in the "
    "same direction; the carriageway must be free over the length that is needed.",
    predicate=(
        "At line_crossed: gap to the leader in the lane on the left >= safe distance (as L3), and "
        f"time to collision >= {amount('law.entry.ttc')}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    check=_room_ahead,
    spread=ENTERING_AHEAD,
)


def _room_behind(case: Case) -> Finding:
    """When the line is crossed, the follower on the left has a lawful gap and need not brake."""
    signals, frame = case.signals, case.events.line_crossed
    follower, decel = (
        neighbour_at(case, NeighbourRole.LEFT_FOLLOWER, frame),
        decel_for_safe_distance(at_frame(signals.friction, frame)),
    )
    margin = entry_margin_behind(
        follower.gap, at_frame(signals.speed, frame), follower.closing_speed, decel
    )
    believed = belief_at(
        case, pull_out_percept(case), {PerceivedVehicle.NEW_FOLLOWER: entry_margin_behind}
    )
    return finding_at_frame(frame, margin, follower.valid, belief=believed)


L5 = Rule(
    id="pt.ce.35@2013",
    code="L5",
    article="Articles 35 and 38(2)(c)",
    title="Room behind in the lane entered",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    predicate=(
        "At line_crossed: gap to the follower in the lane on the left >= its safe distance (as "
        "L3), and the braking that is forced on it, closing speed^2 / (2 gap), <= "
        f"{ABRUPT_BRAKING}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    check=_room_behind,
    spread=ENTERING_BEHIND,
)

TARGET_KEEPS_LANE = (
    "At attempt: the target does not signal left, and moves left at no more than "
    f"{amount('law.others.lateral_speed')}. A signal alone counts as a margin of "
    f"-{amount('law.others.lateral_speed')}."
)


def _nobody_overtakes(case: Case) -> Finding:
    """At the start no vehicle arrives on the left within 4 s, and no follower is pulling out."""
    frame, attempted = case.events.attempt, case.events.has_attempt
    rows = np.flatnonzero(attempted)
    others, own_lane = (
        other_vehicles_at(case.trajectories, frame[rows], rows),
        case.signals.lane[rows, frame[rows]],
    )
    behind = others.valid & ~others.is_oncoming & (others.ego_lead > 0)
    is_behind_on_left = behind & (others.lane == own_lane[:, None] + 1)
    near = others.gap <= constant("law.others.reach")
    is_behind_in_lane = behind & (others.lane == own_lane[:, None]) & near
    moving, limit = is_behind_in_lane.copy(), constant("law.others.lateral_speed")
    place, slot = np.nonzero(is_behind_in_lane)
    start = (rows[place], slot, frame[rows[place]])
    moving[is_behind_in_lane] = (
        denoised_lateral_speed_at(case.trajectories, *start, float(limit)) > limit
    )
    hidden = "indicators" in case.trajectories.unknown
    is_indicating = (
        is_behind_in_lane
        & ((others.lights & indicator_to_overtaking_side(case.trajectories.road)) != 0)
        & (not hidden)
    )
    has_begun = (moving | is_indicating).any(axis=1)
    arrival = np.where(has_begun, np.float32(0.0), _arrival(case, others, is_behind_on_left, rows))
    spread = partial(scatter, simulations=attempted, count=len(attempted))
    return finding_at_frame(
        frame,
        spread(arrival - constant("law.others.arrival")),
        spread((is_behind_on_left | is_behind_in_lane).any(axis=1)),
        doubtful=spread(is_behind_in_lane.any(axis=1) & hidden),
    )


def _arrival(case: Case, others: OtherVehicles, left: Mask, rows: IndexArray) -> F32:
    """Time until the first on the left is beside the ego at constant speeds [s], at most 60."""
    longest = constant("law.others.longest_arrival")
    ego_speed = case.signals.speed[rows, case.events.attempt[rows], None]
    closing = others.speed - ego_speed
    comes = left & (closing > 0)
    time = maximum(others.gap, np.float32(0.0)) / np.where(comes, closing, np.float32(1.0))
    return np.where(comes & (time < longest), time, longest).min(axis=1)


def _arrival_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of the arrival of the first on the left, by positions and speeds of both [s]."""
    rows = np.flatnonzero(case.events.has_attempt)
    frame = case.events.attempt[rows]
    others = other_vehicles_at(case.trajectories, frame, rows)
    lane = case.signals.lane[rows, frame]
    left = others.valid & ~others.is_oncoming & (others.ego_lead > 0)
    left &= others.lane == lane[:, None] + 1

    def margin_with(
        ego_position_error: F32,
        other_position_error: F32,
        ego_speed_error: F32,
        other_speed_error: F32,
    ) -> F32:
        signals = replace(
            others,
            gap=others.gap + ego_position_error - other_position_error,
            speed=others.speed + other_speed_error - ego_speed_error,
        )
        return _arrival(case, signals, left, rows)

    attempted = case.events.has_attempt
    error = scatter(
        propagated_error(margin_with, *errors_of_two_vehicles(errors)), attempted, len(attempted)
    )
    has_begun = finding.margin <= -constant("law.others.arrival")
    return np.where(has_begun, np.float32(0.0), error)


L6 = Rule(
    id="pt.ce.38-2-c@2013",
    code="L6",
    article="Article 38(2)(c)",
    title="Nobody overtakes already",
    gloss="Do not begin to overtake if a follower in the same lane or in the one on the left has "
    "begun to.",
    predicate=(
        "At attempt: no vehicle behind in the lane on the left arrives beside the ego within "
        f"{amount('law.others.arrival')}, and no vehicle within {amount('law.others.reach')} "
        "behind in its lane signals left or moves left at over "
        f"{amount('law.others.lateral_speed')}."
    ),
    unit="s",
    grade=Grade.BY_ROAD,
    conditional_inputs=frozenset(["indicators"]),
    check=_nobody_overtakes,
    spread=Spread(
        formula="sqrt(2 sp^2 + 2 time^2 sv^2) / closing speed; 0 where a vehicle signals or moves"
        " left",
        standard_error=_arrival_error,
    ),
)


def _target_keeps_lane(case: Case) -> Finding:
    """At the start the target neither signals left nor moves left."""
    trajectories, frame, vehicle = case.trajectories, case.events.attempt, case.target.slot
    has_target, slot, limit = (
        vehicle != NO_VEHICLE,
        slot_or_ego(vehicle),
        constant("law.others.lateral_speed"),
    )
    lights = trajectories.states.lights[np.arange(len(slot)), slot, np.maximum(frame, 0)]
    hidden = "indicators" in trajectories.unknown
    is_indicating = (
        has_target
        & ((lights & indicator_to_overtaking_side(case.trajectories.road)) != 0)
        & (not hidden)
    )
    # Without an attempt the target need not be recorded in that frame.
    speed, has_begun = (
        np.zeros(len(slot), np.float32),
        np.flatnonzero(has_target & case.events.has_attempt),
    )
    speed[has_begun] = denoised_lateral_speed_at(
        trajectories, has_begun, slot[has_begun], frame[has_begun], float(limit)
    )
    margin = limit - speed
    margin = np.where(is_indicating, np.minimum(margin, -limit), margin)
    return finding_at_frame(frame, margin, has_target, doubtful=np.full(len(slot), hidden))


L7 = Rule(
    id="pt.ce.38-2-d@2013",
    code="L7",
    article="Article 38(2)(d)",
    title="The driver ahead does not pull out",
    gloss="Do not begin to overtake if the driver ahead has signalled to overtake a third vehicle"
    " or to avoid an obstacle.",
    predicate=TARGET_KEEPS_LANE,
    unit="m/s",
    grade=Grade.BY_ROAD,
    conditional_inputs=frozenset(["indicators"]),
    check=_target_keeps_lane,
)
