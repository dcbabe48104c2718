"""Rules about oncoming traffic: L24, L25, L26, L27."""

from dataclasses import replace

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray, Mask
from overtaking.core.float32_math import HALF, as_f32, maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import opposing_lane_span, seconds_of
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    finding_at_frame,
    finding_at_instants,
    finding_not_applicable,
)
from overtaking.labels.law.measurement_errors import (
    MeasurementErrors,
    errors_of_two_vehicles,
    propagated_error,
    return_time_error,
    zero_if_infinite,
)
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    LINE_TOLERANCE,
    ONCOMING_TIME,
    RETURN_RANGE,
    amount,
)
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import decel_for_safe_distance, lawful_gap
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    OtherVehicles,
    at_frame,
    lane_borders,
    lateral_position_and_gap,
    other_vehicles_at,
    slot_or_ego,
)
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding


def back_frame(case: Case) -> I32:
    """Frame in which the ego is back in its lane, after a pass or an abort; shape (simulation,)."""
    events = case.events
    return np.where(events.return_end != NEVER, events.return_end, events.abort_end)


def margins_at_return(case: Case, others: OtherVehicles, speed_error: F32 | None = None) -> F32:
    """Margin of the gap to each oncoming vehicle when the ego is back in its lane.

    Args:
        case: The batch.
        others: All vehicles at `back_frame`.
        speed_error: Added to the ego's speed, to find how the margin depends on it; a number or
            shape (simulation,) [m/s].

    Returns:
        Shape (simulation, vehicle) [m]; `UNCONSTRAINED` for vehicles that are not oncoming.
    """
    speed = at_frame(case.signals.speed, back_frame(case))[:, None]
    speed = speed if speed_error is None else speed + speed_error
    closing_distance = ONCOMING_TIME.f32 * (others.speed + speed)
    encroachment_distance = constant("law.oncoming.encroachment") * others.speed
    needed = maximum(closing_distance, encroachment_distance)
    return np.where(others.is_approaching, others.gap - needed, UNCONSTRAINED)


def _meeting(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the gap to the oncoming vehicle that lacks most, when the ego is back."""
    del finding
    others = other_vehicles_at(case.trajectories, back_frame(case))

    def margin_with(
        ego_position_error: F32,
        other_position_error: F32,
        ego_speed_error: F32,
        other_speed_error: F32,
    ) -> F32:
        moved_others = replace(
            others,
            gap=others.gap + other_position_error - ego_position_error,
            speed=others.speed + other_speed_error,
        )
        return margins_at_return(case, moved_others, ego_speed_error).min(axis=1)

    return zero_if_infinite(propagated_error(margin_with, *errors_of_two_vehicles(errors)))


_TIME = str(ONCOMING_TIME)

_PET = amount("law.oncoming.encroachment")

MEETING = Spread(
    formula=f"sqrt(2 sp^2 + 2 ({_TIME})^2 sv^2), or sqrt(2 sp^2 + ({_PET})^2 sv^2) where "
    f"{_PET} decide",
    standard_error=_meeting,
)

BACK_BEFORE_ONCOMING = (
    "On two-way roads, at return_end or abort_end: gap to each oncoming vehicle >= "
    f"{ONCOMING_TIME} (v + v_oncoming), and it reaches the place that the ego has "
    f"left after {amount('law.oncoming.encroachment')} or more."
)


def _back_before_oncoming(case: Case) -> Finding:
    """When the ego is back, the first oncoming vehicle is 1 s of both speeds and 2 s away."""
    if not case.trajectories.road.is_two_way:
        return finding_not_applicable(case.signals.num_simulations)
    back, others = back_frame(case), other_vehicles_at(case.trajectories, back_frame(case))
    margin = margins_at_return(case, others).min(axis=1)
    was_out = case.events.line_crossed != NEVER
    return finding_at_frame(back, margin, was_out & others.is_approaching.any(axis=1))


L24 = Rule(
    id="pt.ce.38-1.oncoming@2013",
    code="L24",
    article="Article 38(1)",
    title="Oncoming traffic",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic from the "
    "opposite direction.",
    predicate=BACK_BEFORE_ONCOMING,
    unit="m",
    grade=Grade.BY_ROAD,
    check=_back_before_oncoming,
    spread=MEETING,
)

TIME_TO_PASS = (
    "On two-way roads, as the line between the directions is crossed: gap to each oncoming vehicle "
    "- distance that the ego drives until it is back - v_oncoming (time on the other side) >= "
    f"{ONCOMING_TIME} (v + v_oncoming), v when it is back, v_oncoming when the line "
    "is crossed."
)

_CLEARANCE = str(ONCOMING_TIME)

NO_REACTION = (
    "While a corner of the ego is beyond the line between the directions: the next oncoming "
    f"vehicle, if it is met within {amount('law.oncoming.reach_time')}, brakes at "
    f"{ABRUPT_BRAKING} or less and keeps its lane. Leaving the lane counts as "
    f"{ABRUPT_BRAKING} too much."
)


def predicted_oncoming_gaps(case: Case, others: OtherVehicles) -> F32:
    """Gap to each oncoming vehicle when the ego is back, if they drive on as at the pull-out.

    Args:
        case: The batch.
        others: All vehicles at the pull-out.

    Returns:
        Shape (simulation, vehicle), infinite for those that do not come [m].
    """
    opposing_span, s = opposing_lane_span(case), case.trajectories.states.s[:, EGO_SLOT]
    distance = (
        as_f32(at_frame(s, opposing_span.last) - at_frame(s, opposing_span.first)) * METRES_PER_MM
    )
    time = seconds_of(case, np.maximum(opposing_span.last - opposing_span.first, 0))
    gap = others.gap - (distance[:, None] + others.speed * time[:, None])
    return np.where(others.is_approaching, gap, UNCONSTRAINED)


def _time_to_pass(case: Case) -> Finding:
    """At the pull-out the oncoming traffic leaves room and time for all of the manoeuvre."""
    if not case.trajectories.road.is_two_way:
        return finding_not_applicable(case.signals.num_simulations)
    out = opposing_lane_span(case)
    others = other_vehicles_at(case.trajectories, out.first)
    applies = out.is_nonempty & others.is_approaching.any(axis=1)
    return finding_at_frame(out.first, oncoming_margins(case, others).min(axis=1), applies)


def oncoming_margins(case: Case, others: OtherVehicles, ego_speed_error: F32 | None = None) -> F32:
    """Gaps when the ego is back, minus 1 s of both speeds, shape (simulation, vehicle) [m].

    Args:
        case: The batch.
        others: All vehicles at the pull-out.
        ego_speed_error: Error of the ego's speed, (simulation,) or a number [m/s].

    Returns:
        `UNCONSTRAINED` for those that do not come.
    """
    ego_speed = at_frame(case.signals.speed, opposing_lane_span(case).last)[:, None]
    ego_speed = ego_speed if ego_speed_error is None else ego_speed + ego_speed_error
    needed = ONCOMING_TIME.f32 * (ego_speed + others.speed)
    gaps = predicted_oncoming_gaps(case, others)
    return np.where(others.is_approaching, gaps - needed, UNCONSTRAINED)


def _time_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the predicted gap, by positions at the pull-out and both speeds [m]."""
    del finding
    others = other_vehicles_at(case.trajectories, opposing_lane_span(case).first)

    def margin_with(
        ego_position_error: F32,
        other_position_error: F32,
        ego_speed_error: F32,
        other_speed_error: F32,
    ) -> F32:
        signals = replace(
            others,
            gap=others.gap + other_position_error - ego_position_error,
            speed=others.speed + other_speed_error,
        )
        return oncoming_margins(case, signals, ego_speed_error).min(axis=1)

    gaps = oncoming_margins(case, others)
    row, slot = np.arange(len(gaps)), gaps.argmin(axis=1)
    closing_speed = (
        at_frame(case.signals.speed, opposing_lane_span(case).last) + others.speed[row, slot]
    )
    lateness_error = closing_speed * return_time_error(case, errors)
    gap_error = propagated_error(margin_with, *errors_of_two_vehicles(errors))
    return np.sqrt(gap_error * gap_error + lateness_error * lateness_error)


L25 = Rule(
    id="pt.ce.38-1.pull-out@2013",
    code="L25",
    article="Articles 35 and 38(1)",
    title="Time to pass",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic that comes "
    "from the opposite direction.",
    predicate=TIME_TO_PASS,
    unit="m",
    grade=Grade.BY_ROAD,
    check=_time_to_pass,
    spread=Spread(
        formula=f"sqrt(2 sp^2 + (time on the other side + {_CLEARANCE})^2 sv^2 + "
        f"({_CLEARANCE})^2 sv^2), and (v + v_oncoming) sp / (speed across the road as it is "
        "back), added in squares",
        standard_error=_time_error,
    ),
    only_two_way_roads=True,
)


def near_oncoming_vehicles(case: Case) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Each frame on the other side in which an oncoming vehicle is near, and the nearest.

    Near is who is met within 10 s at both speeds.

    Returns:
        Simulations, frames and slots, shape (instant,).
    """
    rows, frames = opposing_lane_span(case).instants()
    others = other_vehicles_at(case.trajectories, frames.astype(np.int32), rows)
    closing_speed = others.speed + case.signals.speed[rows, frames][:, None]
    is_near = others.is_approaching & (
        others.gap <= constant("law.oncoming.reach_time") * closing_speed
    )
    slot = np.where(is_near, others.gap, np.inf).argmin(axis=1)
    instants = np.flatnonzero(is_near.any(axis=1))
    return rows[instants], frames[instants], slot[instants]


def distance_over_outer_edge(
    case: Case, rows: IndexArray, frames: IndexArray, slot: IndexArray
) -> F32:
    """How far oncoming vehicles reach beyond the outer edge of their lane, (instant,) [m]."""
    trajectories = case.trajectories
    reach = lateral_position_and_gap(trajectories, case.signals, rows, slot, frames)[0]
    reach = reach + trajectories.scenario.vehicles.width[rows, slot] * HALF
    return reach - lane_borders(trajectories.road)[-1]


def _nobody_evades(case: Case) -> Finding:
    """Oncoming drivers neither brake hard for the ego nor leave their lane."""
    trajectories = case.trajectories
    if not trajectories.road.is_two_way:
        return finding_not_applicable(case.signals.num_simulations)
    rows, frames, slot = near_oncoming_vehicles(case)
    limit = ABRUPT_BRAKING.f32
    margin = limit + as_f32(trajectories.states.accel_lon[rows, slot, frames]) * METRES_PER_MM
    left = distance_over_outer_edge(case, rows, frames, slot) > LINE_TOLERANCE.f32
    margin = np.where(left, np.minimum(margin, -limit), margin)
    return finding_at_instants(margin, rows, frames, case.signals.num_simulations)


L26 = Rule(
    id="pt.ce.35.oncoming@2013",
    code="L26",
    article="Article 35",
    title="No reaction of oncoming traffic",
    gloss="Overtake only where no danger to or obstruction of traffic results.",
    predicate=NO_REACTION,
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    check=_nobody_evades,
    only_two_way_roads=True,
)


def return_gap(case: Case) -> tuple[Mask, F32, F32, F32, F32]:
    """The gap ahead of the last vehicle that the ego passes, or would, at the pull-out.

    Returns:
        Whether there is a vehicle ahead of it within 200 m, shape (simulation,); the gap between
        the two [m], their speeds, the one behind first [m/s], and the ego's length [m].
    """
    opposing_span, trajectories = opposing_lane_span(case), case.trajectories
    simulation, crossing = np.arange(len(opposing_span.first)), np.maximum(opposing_span.first, 0)
    others = other_vehicles_at(case.trajectories, crossing)
    is_in_ego_lane = (
        others.valid
        & ~others.is_oncoming
        & (others.lane == at_frame(case.signals.lane, crossing)[:, None])
    )
    s, return_frame = trajectories.states.s, np.maximum(opposing_span.last, 0)
    passed = (
        is_in_ego_lane
        & (others.ego_lead < 0)
        & (s[simulation, EGO_SLOT, return_frame, None] > s[simulation, :, return_frame])
    )
    # Of those that are passed the foremost, else the target.
    foremost = np.where(passed, others.ego_lead, np.inf).argmin(axis=1)
    slot = np.where(passed.any(axis=1), foremost, slot_or_ego(case.target.slot))
    ahead = is_in_ego_lane & (others.ego_lead < others.ego_lead[simulation, slot][:, None])
    leader_slot = np.where(ahead, others.ego_lead, -np.inf).argmax(axis=1)
    lengths = (
        trajectories.scenario.vehicles.length[simulation, slot]
        + trajectories.scenario.vehicles.length[simulation, leader_slot]
    )
    gap = (
        others.ego_lead[simulation, slot]
        - others.ego_lead[simulation, leader_slot]
        - lengths * HALF
    )
    has_gap = opposing_span.is_nonempty & (slot != EGO_SLOT) & ahead.any(axis=1)
    speeds = others.speed[simulation, slot], others.speed[simulation, leader_slot]
    is_near = has_gap & (gap <= RETURN_RANGE.f32)
    return is_near, gap, *speeds, trajectories.scenario.vehicles.length[:, EGO_SLOT]


def _gap_to_return(case: Case) -> Finding:
    """At the pull-out the gap to return into holds the ego and both safe distances."""
    if not case.trajectories.road.is_two_way:
        return finding_not_applicable(case.signals.num_simulations)
    out = opposing_lane_span(case)
    applies, gap, behind, ahead, length = return_gap(case)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, out.first))
    return finding_at_frame(
        out.first, gap - _required_return_gap(behind, ahead, length, decel), applies
    )


def _required_return_gap(behind: F32, ahead: F32, length: F32, decel: F32) -> F32:
    """Room that the ego takes between two others, at the speed of the one ahead [m]."""
    gap_behind = lawful_gap(behind, behind - ahead, decel)
    return length + gap_behind + lawful_gap(ahead, np.float32(0.0), decel)


def _return_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the gap between two others and of what their speeds ask [m]."""
    del finding
    _, gap, behind, ahead, length = return_gap(case)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, opposing_lane_span(case).first))

    def margin_with(
        rear_position_error: F32,
        front_position_error: F32,
        rear_speed_error: F32,
        front_speed_error: F32,
    ) -> F32:
        required_gap = _required_return_gap(
            behind + rear_speed_error, ahead + front_speed_error, length, decel
        )
        return gap + front_position_error - rear_position_error - required_gap

    return propagated_error(margin_with, *errors_of_two_vehicles(errors))


L27 = Rule(
    id="pt.ce.38-2-b.gap@2013",
    code="L27",
    article="Article 38(2)(b)",
    title="A gap to return into",
    gloss="Do not begin to overtake unless one can return to the right without danger to those "
    "who drive there.",
    predicate=(
        "On two-way roads, as the line between the directions is crossed: the gap ahead of the "
        "foremost vehicle that the ego will pass, or of the target, if a vehicle drives less than "
        f"{RETURN_RANGE} ahead of it, >= length of the ego + safe distances (as L3) "
        "behind and ahead of it, at the speed of the one ahead."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    check=_gap_to_return,
    spread=Spread(
        formula="as L3 behind and ahead, between the two others", standard_error=_return_error
    ),
    only_two_way_roads=True,
)
