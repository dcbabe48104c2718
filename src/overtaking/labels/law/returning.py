"""Rules about coming back and keeping right: L8, L9, L21, L23."""

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray
from overtaking.core.float32_math import minimum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.beliefs import belief_at, return_percept
from overtaking.labels.law.case import (
    last_driven_frame,
    manoeuvre,
    neighbour_at,
    scans,
    seconds_of,
    span_after_passing,
)
from overtaking.labels.law.margins import (
    MIN_RATE_OF_CHANGE,
    UNCONSTRAINED,
    finding_at_frame,
    finding_from_margins,
    finding_of_minimum,
    num_frames_in,
)
from overtaking.labels.law.measurement_errors import (
    BRAKING_ERROR_FORMULA,
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    deciding_frame,
    encounter_with_error,
    errors_of_two_vehicles,
    propagated_error,
    zero_if_infinite,
)
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    MAX_FORCED_BRAKING,
    OBSTRUCTION_TIME,
    RETURN_FREE_TIME,
    RETURN_RANGE,
    RETURN_TIME_GAP,
    amount,
)
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import (
    REACTION_AND_DECEL,
    decel_for_safe_distance,
    entry_margin_behind,
    gap_between,
    gap_in_right_lane,
    lawful_gap,
    margin_to_leader,
)
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import METRES_PER_MM, at_frame, vehicle_snapshot
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import PerceivedVehicle
from overtaking.model.verdicts import Case, Finding


def _returning(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the smaller of the gaps behind and ahead at the end of the return."""
    del finding
    frame, signals = case.events.return_end, case.signals
    behind, ahead = (
        neighbour_at(case, place, frame) for place in (NeighbourRole.FOLLOWER, NeighbourRole.LEADER)
    )
    speed, decel = (
        at_frame(signals.speed, frame),
        decel_for_safe_distance(at_frame(signals.friction, frame)),
    )

    def margin_with(*by: F32) -> F32:
        (
            ego_position_error,
            rear_position_error,
            front_position_error,
            ego_speed_error,
            rear_speed_error,
            front_speed_error,
        ) = by
        moved_follower = encounter_with_error(
            behind,
            ego_position_error,
            rear_position_error,
            ego_speed_error,
            rear_speed_error,
            is_ahead=False,
        )
        moved_leader = encounter_with_error(
            ahead,
            ego_position_error,
            front_position_error,
            ego_speed_error,
            front_speed_error,
            is_ahead=True,
        )
        margin_behind = entry_margin_behind(
            moved_follower.gap, speed + ego_speed_error, moved_follower.closing_speed, decel
        )
        margin_ahead = margin_to_leader(
            moved_leader.gap, speed + ego_speed_error, moved_leader.closing_speed, decel
        )
        return np.minimum(
            np.where(moved_follower.valid, margin_behind, UNCONSTRAINED),
            np.where(moved_leader.valid, margin_ahead, UNCONSTRAINED),
        )

    return zero_if_infinite(
        propagated_error(margin_with, *[errors.position_std] * 3, *[errors.speed_std] * 3)
    )


def _keeping_right(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the room in the slower lane at the first frame."""
    del finding
    return _gap_in_right_lane_error(case, np.maximum(case.events.first, 0), errors)


def _gap_in_right_lane_error(case: Case, frame: I32, errors: MeasurementErrors) -> F32:
    """Error of `gap_in_right_lane` [m]."""
    places = (NeighbourRole.RIGHT_LEADER, NeighbourRole.RIGHT_FOLLOWER)
    ahead, behind = (neighbour_at(case, place, frame) for place in places)
    speed = at_frame(case.signals.speed, frame)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))

    def margin_with(*by: F32) -> F32:
        (
            ego_position_error,
            front_position_error,
            rear_position_error,
            ego_speed_error,
            front_speed_error,
            rear_speed_error,
        ) = by
        moved_leader = encounter_with_error(
            ahead,
            ego_position_error,
            front_position_error,
            ego_speed_error,
            front_speed_error,
            is_ahead=True,
        )
        moved_follower = encounter_with_error(
            behind,
            ego_position_error,
            rear_position_error,
            ego_speed_error,
            rear_speed_error,
            is_ahead=False,
        )
        return gap_between(speed + ego_speed_error, decel, moved_leader, moved_follower)

    return propagated_error(margin_with, *[errors.position_std] * 3, *[errors.speed_std] * 3)


def _braking(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the braking that is forced on the follower, where it is hardest."""

    def hard(behind: Encounter) -> F32:
        closing = np.maximum(behind.closing_speed, np.float32(0.0))
        gap = np.maximum(behind.gap, METRES_PER_MM)
        max_braking = MAX_FORCED_BRAKING.f32
        return np.minimum(closing * closing / (np.float32(2.0) * gap), max_braking)

    def margin(rows: IndexArray, frames: IndexArray) -> F32:
        behind = encounters_at(case, NeighbourRole.FOLLOWER, rows, frames)
        return np.where(behind.valid, ABRUPT_BRAKING.f32 - hard(behind), UNCONSTRAINED)

    follower = neighbour_at(
        case, NeighbourRole.FOLLOWER, deciding_frame(manoeuvre(case), margin, finding)
    )

    def margin_with(*by: F32) -> F32:
        return hard(encounter_with_error(follower, *by, is_ahead=False))

    return propagated_error(margin_with, *errors_of_two_vehicles(errors))


def _due(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the time for which a return was due: how much later the target is far enough behind."""
    del finding
    frame = scans(case).return_opportunity[0]
    rows, target = np.arange(len(frame)), case.target.slot
    target_state = vehicle_snapshot(case.trajectories, target, rows, frame)
    speed = at_frame(case.signals.speed, frame)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))

    def margin_with(
        ego_position_error: F32,
        target_position_error: F32,
        ego_speed_error: F32,
        target_speed_error: F32,
    ) -> F32:
        its_speed = target_state.speed + target_speed_error
        needed = lawful_gap(its_speed, its_speed - speed - ego_speed_error, decel)
        return (
            target_state.gap
            + ego_position_error
            - target_position_error
            - np.maximum(RETURN_TIME_GAP.f32 * its_speed, needed)
        )

    opening_speed = np.maximum(speed - target_state.speed, MIN_RATE_OF_CHANGE)
    error = propagated_error(margin_with, *errors_of_two_vehicles(errors)) / opening_speed
    error = np.where(target_state.valid, error, np.float32(0.0))
    last = frame + scans(case).return_opportunity[1]
    ends_within_span = (frame != NEVER) & (last <= span_after_passing(case).last)
    # It is no longer due once the slower lane is taken: by how fast its room gets less.
    last = np.maximum(np.minimum(last, case.events.last), 1)
    gap_lost = gap_in_right_lane(case, last - 1) - gap_in_right_lane(case, last)
    loss_rate = np.maximum(
        np.abs(gap_lost) / seconds_of(case, np.ones_like(last)), MIN_RATE_OF_CHANGE
    )
    end_error = np.where(
        ends_within_span, _gap_in_right_lane_error(case, last, errors) / loss_rate, np.float32(0.0)
    )
    return np.where(frame != NEVER, np.sqrt(error * error + end_error * end_error), np.float32(0.0))


_FREE = str(RETURN_FREE_TIME)

RETURNING = Spread(
    formula=f"behind: {GAP_ERROR_FORMULA}, or {BRAKING_ERROR_FORMULA}; ahead: {GAP_ERROR_FORMULA}; "
    "of the three, the one that decides",
    standard_error=_returning,
)

KEEPING_RIGHT = Spread(
    formula=f"ahead and behind: {GAP_ERROR_FORMULA}, or sqrt(2 sp^2 + 2 ({_FREE})^2 sv^2) where "
    f"{_FREE} ahead decide",
    standard_error=_keeping_right,
)

BRAKING = Spread(
    formula="sqrt(2 sv^2 (dv/gap)^2 + 2 sp^2 (dv^2 / (2 gap^2))^2), in the frame of the smallest "
    "margin",
    standard_error=_braking,
)

DUE = Spread(
    formula="(error of the gap to the target as it becomes large enough) / (v - v_target) and "
    "(error of the room to the right as it ends) / (its loss per second), added in squares",
    standard_error=_due,
)

NO_HARD_BRAKING = (
    f"In the {OBSTRUCTION_TIME} after each change of lane: closing speed^2 / (2 "
    f"gap) of the vehicle behind the ego <= {ABRUPT_BRAKING}."
)

SAFE_RETURN = (
    "At return_end: gap to the vehicle behind, the overtaken one or one in between, >= v t + "
    f"v^2 / (2 b) - u^2 / (2 b), v behind and u ahead, {REACTION_AND_DECEL}; the braking forced "
    f"on it <= {ABRUPT_BRAKING}; gap to the vehicle ahead by the same formula."
)
"""The predicate of `L8` for laws without a formula for the safe distance."""


def _safe_return(case: Case) -> Finding:
    """When the ego is back, the gaps behind and ahead of it are lawful."""
    signals, frame = case.signals, case.events.return_end
    speed, decel = (
        at_frame(signals.speed, frame),
        decel_for_safe_distance(at_frame(signals.friction, frame)),
    )
    behind, ahead = (
        neighbour_at(case, place, frame) for place in (NeighbourRole.FOLLOWER, NeighbourRole.LEADER)
    )
    room_behind = entry_margin_behind(behind.gap, speed, behind.closing_speed, decel)
    room_ahead = margin_to_leader(ahead.gap, speed, ahead.closing_speed, decel)
    margin = minimum(
        np.where(behind.valid, room_behind, UNCONSTRAINED),
        np.where(ahead.valid, room_ahead, UNCONSTRAINED),
    )
    believed = belief_at(
        case,
        return_percept(case),
        {
            PerceivedVehicle.NEW_FOLLOWER: entry_margin_behind,
            PerceivedVehicle.NEW_LEADER: margin_to_leader,
        },
    )
    return finding_at_frame(frame, margin, behind.valid | ahead.valid, belief=believed)


L8 = Rule(
    id="pt.ce.38-2-b@2013",
    code="L8",
    article="Article 38(2)(b)",
    title="Safe return",
    gloss="Overtake only if one can return to the right without danger to those who drive there.",
    predicate=(
        "At return_end: gap to the vehicle behind, the overtaken one or one in between, >= "
        "its safe distance (as L3); the braking forced on it <= "
        f"{ABRUPT_BRAKING}; gap to the vehicle ahead >= the ego's safe distance."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    check=_safe_return,
    spread=RETURNING,
)


def _no_hard_braking(case: Case) -> Finding:
    """For 3 s after the ego has come into a lane, it forces no hard braking on its follower."""
    return finding_of_minimum(scans(case).forced_braking, manoeuvre(case))


L23 = Rule(
    id="pt.ce.35.obstruction@2013",
    code="L23",
    article="Article 35",
    title="No obstruction",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    predicate=NO_HARD_BRAKING,
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    check=_no_hard_braking,
    spread=BRAKING,
)

RETURNS_SOON = (
    "From overlap_end on: the ego never stays out of its original lane for more than "
    f"{amount('law.return.within')} on end in which the target is "
    f"max({RETURN_TIME_GAP}, safe distance) or more behind it and the lane to the "
    "right is free: room ahead and behind, and no vehicle reached within "
    f"{RETURN_FREE_TIME}."
)

ROOM_MARGIN = f"The margin is the distance by which the room falls short, at most {RETURN_RANGE}."

KEEPS_RIGHT = (
    "At the first frame, if the ego is not in the slowest lane: the lane to the right is occupied, "
    "that is, without the safe distances ahead and behind, or with a vehicle that is reached "
    f"within {RETURN_FREE_TIME}. {ROOM_MARGIN}"
)
"""The predicate of `L21` for laws without a formula for the safe distance."""


def _returns_soon(case: Case) -> Finding:
    """With the target behind and room in the slower lane, the ego does not stay for over 8 s."""
    over, (first, length) = span_after_passing(case), scans(case).return_opportunity
    time_limit = constant("law.return.within")
    applies = (case.events.overlap_end != NEVER) & over.is_nonempty
    # The frame in which it had been due for so long, up to the last in which it still was.
    start = first + num_frames_in(case, time_limit)
    return finding_from_margins(
        applies, time_limit - seconds_of(case, length), start, first + length - 1
    )


L9 = Rule(
    id="pt.ce.38-4@2013",
    code="L9",
    article="Articles 38(4) and 13(3)",
    title="Duty to return",
    gloss="Return to the right as soon as the manoeuvre is done and this is safe.",
    predicate=f"{RETURNS_SOON} L24 is the rule for the lane of oncoming traffic.",
    unit="s",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    check=_returns_soon,
    spread=DUE,
)


def _keeps_right(case: Case) -> Finding:
    """At the first frame the ego is in the slowest lane, or the next slower one is taken."""
    frame = case.events.first
    lane = at_frame(case.signals.lane, frame)
    applies = (
        (lane > 0) & (lane < case.trajectories.road.num_lanes) & (last_driven_frame(case) >= frame)
    )
    return finding_at_frame(
        frame, -gap_in_right_lane(case, np.where(applies, frame, NEVER)), applies
    )


L21 = Rule(
    id="pt.ce.13-3@2013",
    code="L21",
    article="Article 13(3)",
    title="Keep right",
    gloss="With two or more lanes in the same direction use the right-most; others only if there "
    "is no room in it, to overtake or to change direction.",
    predicate=(
        "At the first frame, if the ego is not in the slowest lane: the lane to the right is "
        f"occupied, that is, without the room that L9 requires. {ROOM_MARGIN}"
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    applies_without_attempt=True,
    check=_keeps_right,
    spread=KEEPING_RIGHT,
)
