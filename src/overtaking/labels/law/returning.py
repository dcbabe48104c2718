"""Rules about coming back and keeping right: L8, L9, L21, L23."""

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray
from overtaking.core.float32_math import minimum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.beliefs import belief, going_back
from overtaking.labels.law.case import beside, driving_end, manoeuvre, passed, seconds_of, stretches
from overtaking.labels.law.margins import (
    ENDLESS,
    MIN_RATE_OF_CHANGE,
    decided,
    frames_of,
    instant,
    never_negative,
)
from overtaking.labels.law.measurement_errors import (
    BRAKING_ERROR_FORMULA,
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    deciding,
    moved_neighbour,
    of_both,
    standard_error,
    zero_if_infinite,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import (
    REACTION_AND_DECEL,
    lawful_gap,
    margin_behind,
    margin_of_gap,
    room_beside,
    slow_lane_room,
    sure_decel,
)
from overtaking.labels.signals import encounter
from overtaking.labels.snapshots import METRES, at, vehicle_at
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import PerceivedVehicle
from overtaking.model.verdicts import Case, Finding


def _returning(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the smaller of the gaps behind and ahead at the end of the return."""
    del found
    frame, seen = case.events.return_end, case.signals
    behind, ahead = (
        beside(case, place, frame) for place in (NeighbourRole.FOLLOWER, NeighbourRole.LEADER)
    )
    speed, decel = at(seen.speed, frame), sure_decel(at(seen.friction, frame))

    def moved(*by: F32) -> F32:
        own, rear, front, faster, rear_faster, front_faster = by
        near = moved_neighbour(behind, own, rear, faster, rear_faster, is_ahead=False)
        far = moved_neighbour(ahead, own, front, faster, front_faster, is_ahead=True)
        after = margin_behind(near.gap, speed + faster, near.closing_speed, decel)
        before = margin_of_gap(far.gap, speed + faster, far.closing_speed, decel)
        return np.minimum(
            np.where(near.valid, after, ENDLESS), np.where(far.valid, before, ENDLESS)
        )

    return zero_if_infinite(
        standard_error(moved, *[errors.position_std] * 3, *[errors.speed_std] * 3)
    )


def _keeping_right(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the room in the slower lane at the first frame."""
    del found
    return _room_error(case, np.maximum(case.events.first, 0), errors)


def _room_error(case: Case, frame: I32, errors: MeasurementErrors) -> F32:
    """Error of `slow_lane_room` [m]."""
    places = (NeighbourRole.RIGHT_LEADER, NeighbourRole.RIGHT_FOLLOWER)
    ahead, behind = (beside(case, place, frame) for place in places)
    speed = at(case.signals.speed, frame)
    decel = sure_decel(at(case.signals.friction, frame))

    def moved(*by: F32) -> F32:
        own, front, rear, faster, front_faster, rear_faster = by
        far = moved_neighbour(ahead, own, front, faster, front_faster, is_ahead=True)
        near = moved_neighbour(behind, own, rear, faster, rear_faster, is_ahead=False)
        return room_beside(speed + faster, decel, far, near)

    return standard_error(moved, *[errors.position_std] * 3, *[errors.speed_std] * 3)


def _braking(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the braking that is forced on the follower, where it is hardest."""

    def hard(behind: Encounter) -> F32:
        closing = np.maximum(behind.closing_speed, np.float32(0.0))
        gap = np.maximum(behind.gap, METRES)
        most = constant("law.obstruction.most")
        return np.minimum(closing * closing / (np.float32(2.0) * gap), most)

    def margin(rows: IndexArray, frames: IndexArray) -> F32:
        behind = encounter(case, NeighbourRole.FOLLOWER, rows, frames)
        return np.where(behind.valid, constant("law.obstruction.braking") - hard(behind), ENDLESS)

    other = beside(case, NeighbourRole.FOLLOWER, deciding(manoeuvre(case), margin, found))

    def moved(*by: F32) -> F32:
        return hard(moved_neighbour(other, *by, is_ahead=False))

    return standard_error(moved, *of_both(errors))


def _due(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the time for which a return was due: how much later the target is far enough behind."""
    del found
    frame = stretches(case).due[0]
    rows, target = np.arange(len(frame)), case.target.slot
    there = vehicle_at(case.trajectories, target, rows, frame)
    speed = at(case.signals.speed, frame)
    decel = sure_decel(at(case.signals.friction, frame))

    def moved(own: F32, its: F32, faster: F32, its_faster: F32) -> F32:
        its_speed = there.speed + its_faster
        needed = lawful_gap(its_speed, its_speed - speed - faster, decel)
        return (
            there.gap + own - its - np.maximum(constant("law.return.time_gap") * its_speed, needed)
        )

    opening = np.maximum(speed - there.speed, MIN_RATE_OF_CHANGE)
    error = standard_error(moved, *of_both(errors)) / opening
    error = np.where(there.valid, error, np.float32(0.0))
    last = frame + stretches(case).due[1]
    ends = (frame != NEVER) & (last <= passed(case).stop)
    # It is no longer due once the slower lane is taken: by how fast its room gets less.
    last = np.maximum(np.minimum(last, case.events.last), 1)
    lost = slow_lane_room(case, last - 1) - slow_lane_room(case, last)
    rate = np.maximum(np.abs(lost) / seconds_of(case, np.ones_like(last)), MIN_RATE_OF_CHANGE)
    late = np.where(ends, _room_error(case, last, errors) / rate, np.float32(0.0))
    return np.where(frame != NEVER, np.sqrt(error * error + late * late), np.float32(0.0))


_FREE = amount("law.return.free_time")

RETURNING = Spread(
    formula=f"behind: {GAP_ERROR_FORMULA}, or {BRAKING_ERROR_FORMULA}; ahead: {GAP_ERROR_FORMULA}; "
    "of the three, the one that decides",
    of=_returning,
)

KEEPING_RIGHT = Spread(
    formula=f"ahead and behind: {GAP_ERROR_FORMULA}, or sqrt(2 sp^2 + 2 ({_FREE})^2 sv^2) where "
    f"{_FREE} ahead decide",
    of=_keeping_right,
)

BRAKING = Spread(
    formula="sqrt(2 sv^2 (dv/gap)^2 + 2 sp^2 (dv^2 / (2 gap^2))^2), in the frame of the smallest "
    "margin",
    of=_braking,
)

DUE = Spread(
    formula="(error of the gap to the target as it becomes large enough) / (v - v_target) and "
    "(error of the room to the right as it ends) / (its loss per second), added in squares",
    of=_due,
)

NO_HARD_BRAKING = (
    f"In the {amount('law.obstruction.duration')} after each change of lane: closing speed^2 / (2 "
    f"gap) of the vehicle behind the ego <= {amount('law.obstruction.braking')}."
)

SAFE_RETURN = (
    "At return_end: gap to the vehicle behind, the overtaken one or one in between, >= v t + "
    f"v^2 / (2 b) - u^2 / (2 b), v behind and u ahead, {REACTION_AND_DECEL}; the braking forced "
    f"on it <= {amount('law.entry.braking')}; gap to the vehicle ahead by the same formula."
)
"""The predicate of `L8` for laws without a formula for the safe distance."""


def _safe_return(case: Case) -> Finding:
    """When the ego is back, the gaps behind and ahead of it are lawful."""
    seen, frame = case.signals, case.events.return_end
    speed, decel = at(seen.speed, frame), sure_decel(at(seen.friction, frame))
    behind, ahead = (
        beside(case, place, frame) for place in (NeighbourRole.FOLLOWER, NeighbourRole.LEADER)
    )
    room_behind = margin_behind(behind.gap, speed, behind.closing_speed, decel)
    room_ahead = margin_of_gap(ahead.gap, speed, ahead.closing_speed, decel)
    margin = minimum(
        np.where(behind.valid, room_behind, ENDLESS), np.where(ahead.valid, room_ahead, ENDLESS)
    )
    believed = belief(
        case,
        going_back(case),
        {PerceivedVehicle.NEW_FOLLOWER: margin_behind, PerceivedVehicle.NEW_LEADER: margin_of_gap},
    )
    return instant(frame, margin, behind.valid | ahead.valid, belief=believed)


L8 = Rule(
    id="pt.ce.38-2-b@2013",
    code="L8",
    law="Article 38(2)(b)",
    title="Safe return",
    gloss="Overtake only if one can return to the right without danger to those who drive there.",
    predicate=(
        "At return_end: gap to the vehicle behind, the overtaken one or one in between, >= "
        "its safe distance (as L3); the braking forced on it <= "
        f"{amount('law.entry.braking')}; gap to the vehicle ahead >= the ego's safe distance."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=_safe_return,
    spread=RETURNING,
)


def _no_hard_braking(case: Case) -> Finding:
    """For 3 s after the ego has come into a lane, it forces no hard braking on its follower."""
    return never_negative(stretches(case).braking, manoeuvre(case))


L23 = Rule(
    id="pt.ce.35.obstruction@2013",
    code="L23",
    law="Article 35",
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
    f"max({amount('law.return.time_gap')}, safe distance) or more behind it and the lane to the "
    "right is free: room ahead and behind, and no vehicle reached within "
    f"{amount('law.return.free_time')}."
)

ROOM_MARGIN = (
    "The margin is the distance by which the room falls short, at most "
    f"{amount('law.return.reach')}."
)

KEEPS_RIGHT = (
    "At the first frame, if the ego is not in the slowest lane: the lane to the right is occupied, "
    "that is, without the safe distances ahead and behind, or with a vehicle that is reached "
    f"within {amount('law.return.free_time')}. {ROOM_MARGIN}"
)
"""The predicate of `L21` for laws without a formula for the safe distance."""


def _returns_soon(case: Case) -> Finding:
    """With the target behind and room in the slower lane, the ego does not stay for over 8 s."""
    over, (first, length) = passed(case), stretches(case).due
    within = constant("law.return.within")
    applies = (case.events.overlap_end != NEVER) & over.exists
    # The frame in which it had been due for so long, up to the last in which it still was.
    start = first + frames_of(case, within)
    return decided(applies, within - seconds_of(case, length), start, first + length - 1)


L9 = Rule(
    id="pt.ce.38-4@2013",
    code="L9",
    law="Articles 38(4) and 13(3)",
    title="Duty to return",
    gloss="Return to the right as soon as the manoeuvre is done and this is safe.",
    predicate=f"{RETURNS_SOON} L24 is the rule for the lane of oncoming traffic.",
    unit="s",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=_returns_soon,
    spread=DUE,
)


def _keeps_right(case: Case) -> Finding:
    """At the first frame the ego is in the slowest lane, or the next slower one is taken."""
    frame = case.events.first
    lane = at(case.signals.lane, frame)
    applies = (lane > 0) & (lane < case.trajectories.road.num_lanes) & (driving_end(case) >= frame)
    return instant(frame, -slow_lane_room(case, np.where(applies, frame, NEVER)), applies)


L21 = Rule(
    id="pt.ce.13-3@2013",
    code="L21",
    law="Article 13(3)",
    title="Keep right",
    gloss="With two or more lanes in the same direction use the right-most; others only if there "
    "is no room in it, to overtake or to change direction.",
    predicate=(
        "At the first frame, if the ego is not in the slowest lane: the lane to the right is "
        f"occupied, that is, without the room that L9 requires. {ROOM_MARGIN}"
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    without_attempt=True,
    check=_keeps_right,
    spread=KEEPING_RIGHT,
)
