"""Errors of measurement and what they do to margins.

A margin is a function of positions and speeds. By the law of propagation of uncertainty its
variance is the sum of the squares of what each of them contributes, and a contribution is half the
change of the margin as that one moves by its standard deviation to either side (JCGM 100:2008,
5.1.2 and the note to 5.1.3). So each rule needs only its margin as a function of errors, at the
frame that decides.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray
from overtaking.core.float32_math import as_f32, maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.instants import METRES, at, seconds_of, vehicle_at
from overtaking.labels.law.distances import (
    beside,
    full_decel,
    lawful_gap,
    margin_ahead,
    margin_behind,
    margin_of_gap,
    room_beside,
    slow_lane_room,
    stop_distance,
    sure_decel,
)
from overtaking.labels.law.frames import (
    ENDLESS,
    Span,
    conduct,
    manoeuvre,
    passed,
    settled,
    stretches,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.others import Others, coming, others_at
from overtaking.labels.law.rule import MeasurementErrors, Spread
from overtaking.labels.signals import encounter
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import Encounter
from overtaking.model.verdicts import Case, Finding

Margin = Callable[[F32, F32, F32, F32], F32]
"""Margin from gap, speed of the ego, closing speed and sure deceleration."""

_SLOW = np.float32(0.1)  # Gaps that change more slowly are not waited for [m/s].


def standard_error(margin: Callable[..., F32], *sizes: float) -> F32:
    """Standard deviation of a margin.

    Args:
        margin: The margin as a function of one error for each of the inputs.
        sizes: Standard deviation of each input.

    Source:
        JCGM 100:2008, 5.1.2 and the note to 5.1.3.
    """
    total = np.float32(0.0)
    for k, size in enumerate(sizes):
        moved = [np.float32(0.0)] * len(sizes)
        moved[k] = np.float32(size)
        up = margin(*moved)
        moved[k] = -moved[k]
        half = (up - margin(*moved)) * np.float32(0.5)
        total = total + half * half
    return np.sqrt(total)


def deciding(span: Span, margin: Callable[[IndexArray, IndexArray], F32], checked: Finding) -> I32:
    """The frame of a span at which a margin is the one that was found, shape (simulation,)."""
    rows, frames = span.frames()
    decide = np.maximum(span.start, 0).astype(np.int32)
    if not rows.size:
        return decide
    deviation = np.abs(margin(rows, frames) - checked.margin[rows])
    order = np.lexsort((frames, deviation, rows))
    first = order[np.append(True, np.diff(rows[order]) != 0)]
    decide[rows[first]] = frames[first]
    return decide


def gap_error(
    case: Case, place: NeighbourRole, frame: I32, margin: Margin, errors: MeasurementErrors
) -> F32:
    """Error of a margin of the gap to a neighbour, from positions and speeds of both."""
    other, seen = beside(case, place, frame), case.signals
    speed, decel = at(seen.speed, frame), sure_decel(at(seen.friction, frame))
    is_ahead = place in (
        NeighbourRole.LEADER,
        NeighbourRole.LEFT_LEADER,
        NeighbourRole.RIGHT_LEADER,
    )

    def moved(own: F32, its: F32, faster: F32, its_faster: F32) -> F32:
        near = moved_neighbour(other, own, its, faster, its_faster, is_ahead=is_ahead)
        return margin(near.gap, speed + faster, near.closing_speed, decel)

    return standard_error(moved, *of_both(errors))


def moved_neighbour(
    other: Encounter, own: F32, its: F32, faster: F32, its_faster: F32, *, is_ahead: bool
) -> Encounter:
    """A neighbour as it would have been seen with errors.

    Args:
        other: As it was seen.
        own: Error of the ego's position along the road [m].
        its: Of the neighbour's [m].
        faster: Of the ego's speed [m/s].
        its_faster: Of the neighbour's [m/s].
        is_ahead: Whether it is ahead of the ego.
    """
    sign = np.float32(1.0 if is_ahead else -1.0)
    return other.replace(
        gap=other.gap + sign * (its - own),
        closing_speed=other.closing_speed + sign * (faster - its_faster),
    )


def of_both(errors: MeasurementErrors) -> tuple[float, float, float, float]:
    """Errors of two positions and two speeds."""
    return errors.position_std, errors.position_std, errors.speed_std, errors.speed_std


def _following(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the gap to the leader, in the frame in which it lacks most."""

    def margin(rows: IndexArray, frames: IndexArray) -> F32:
        ahead = encounter(case, NeighbourRole.LEADER, rows, frames)
        decel = sure_decel(case.signals.friction[rows, frames])
        speed = case.signals.speed[rows, frames]
        value = margin_of_gap(ahead.gap, speed, ahead.closing_speed, decel)
        return np.where(ahead.valid, value, ENDLESS)

    frame = deciding(settled(case), margin, found)
    error = gap_error(case, NeighbourRole.LEADER, frame, margin_of_gap, errors)
    leaving = _leaving(case, frame, errors)
    return np.sqrt(error * error + leaving * leaving)


def _leaving(case: Case, frame: I32, errors: MeasurementErrors) -> F32:
    """Error of a gap because the ego leaves the lane sooner or later than it was seen to [m].

    Where a gap closes until the ego has left the lane, the last frame in the lane decides.
    """
    seen, next_one = case.signals, np.minimum(frame + 1, case.events.last)
    leaves = at(seen.lane, next_one) != at(seen.lane, frame)
    closing = beside(case, NeighbourRole.LEADER, frame).closing_speed
    across = np.maximum(np.abs(at(seen.lateral_speed, frame)), _SLOW)
    return np.where(leaves, closing * np.float32(errors.position_std) / across, np.float32(0.0))


def _entering(
    place: NeighbourRole, margin: Margin
) -> Callable[[Case, Finding, MeasurementErrors], F32]:
    """Of the gap to a neighbour in the entered lane as the line is crossed."""

    def of(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
        del found
        return gap_error(case, place, case.events.line_crossed, margin, errors)

    return of


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

    return _finite(standard_error(moved, *[errors.position_std] * 3, *[errors.speed_std] * 3))


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


def back_frame(case: Case) -> I32:
    """Frame in which the ego is back in its lane, after a pass or an abort; shape (simulation,)."""
    events = case.events
    return np.where(events.return_end != NEVER, events.return_end, events.abort_end)


def oncoming_margins(case: Case, others: Others, speed_error: F32 | None = None) -> F32:
    """Margin of the gap to each oncoming vehicle when the ego is back in its lane.

    Args:
        case: The batch.
        others: All vehicles at `back_frame`.
        speed_error: Added to the ego's speed, to find how the margin depends on it; a number or
            shape (simulation,) [m/s].

    Returns:
        Shape (simulation, vehicle) [m]; `ENDLESS` for vehicles that are not oncoming.
    """
    speed = at(case.signals.speed, back_frame(case))[:, None]
    speed = speed if speed_error is None else speed + speed_error
    closing_distance = constant("law.oncoming.time") * (others.speed + speed)
    encroachment_distance = constant("law.oncoming.encroachment") * others.speed
    needed = maximum(closing_distance, encroachment_distance)
    return np.where(coming(others), others.gap - needed, ENDLESS)


def _meeting(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the gap to the oncoming vehicle that lacks most, when the ego is back."""
    del found
    others = others_at(case, back_frame(case))

    def moved(own: F32, its: F32, faster: F32, its_faster: F32) -> F32:
        moved_others = replace(others, gap=others.gap + its - own, speed=others.speed + its_faster)
        return oncoming_margins(case, moved_others, faster).min(axis=1)

    return _finite(standard_error(moved, *of_both(errors)))


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

    opening = np.maximum(speed - there.speed, _SLOW)
    error = standard_error(moved, *of_both(errors)) / opening
    error = np.where(there.valid, error, np.float32(0.0))
    last = frame + stretches(case).due[1]
    ends = (frame != NEVER) & (last <= passed(case).stop)
    # It is no longer due once the slower lane is taken: by how fast its room gets less.
    last = np.maximum(np.minimum(last, case.events.last), 1)
    lost = slow_lane_room(case, last - 1) - slow_lane_room(case, last)
    rate = np.maximum(np.abs(lost) / seconds_of(case, np.ones_like(last)), _SLOW)
    late = np.where(ends, _room_error(case, last, errors) / rate, np.float32(0.0))
    return np.where(frame != NEVER, np.sqrt(error * error + late * late), np.float32(0.0))


def _stopping(sight: str) -> Callable[[Case, Finding, MeasurementErrors], F32]:
    """Of the stopping distance where it comes nearest to the sight."""

    def of(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
        seen = case.signals

        def margin(rows: IndexArray, frames: IndexArray) -> F32:
            stop = stop_distance(seen.speed[rows, frames], seen.friction[rows, frames])
            return getattr(seen, sight)[rows, frames] - stop

        frame = deciding(conduct(case), margin, found)
        speed = at(seen.speed, frame)
        time = constant("law.sight.reaction_time") + speed / full_decel(at(seen.friction, frame))
        return time * np.float32(errors.speed_std)

    return of


def _of_speed(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the ego's speed."""
    del case
    return np.full_like(found.margin, errors.speed_std)


def _of_place(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of one position across the road."""
    del case
    return np.full_like(found.margin, errors.position_std)


def lane_error(distance: F32, errors: MeasurementErrors) -> F32:
    """Error of a margin in lanes: half a lane where a centre is one error from the border [lanes].

    Args:
        distance: From the border that decides, either way [m].
        errors: Of the measurement.
    """
    return np.float32(0.5 * errors.position_std) / np.maximum(np.abs(distance), METRES)


def _slow_lanes(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of being in the two slowest lanes, by the way to the border of the third."""
    del found
    road, span = case.trajectories.road, conduct(case)
    border = as_f32(road.overtaking_sign * road.lane_boundaries)[int(constant("law.trucks.lanes"))]
    rows, frames = span.frames()
    over = np.full(len(span.start), -ENDLESS, np.float32)
    np.maximum.at(over, rows, case.signals.lateral_position[rows, frames] - border)
    return lane_error(over, errors)


def _finite(error: F32) -> F32:
    """An error where there is nobody whose position could be wrong: 0."""
    return np.where(np.isfinite(error), error, np.float32(0.0))


_GAP = "sqrt(2 sp^2 + sv^2 ((t + v/b)^2 + (u/b)^2)), v behind and u ahead"
_BRAKED = (
    "sqrt(2 sp^2 + 2 ((u - v)/a)^2 sv^2) where braking at a = "
    f"{amount('law.entry.braking')} decides"
)
_FREE = amount("law.return.free_time")
_TIME, _PET = amount("law.oncoming.time"), amount("law.oncoming.encroachment")
FOLLOWING = Spread(
    formula=f"{_GAP}, in the frame of the smallest margin; where that is the last one in the lane, "
    "the square of sp (v - u) / (speed across the road) is added to the variance",
    of=_following,
)
ENTERING_AHEAD = Spread(
    formula=f"{_GAP}, or sqrt(2 sp^2 + 2 ({amount('law.entry.ttc')})^2 sv^2) where the time to "
    "collision decides",
    of=_entering(NeighbourRole.LEFT_LEADER, margin_ahead),
)
ENTERING_BEHIND = Spread(
    formula=f"{_GAP}, or {_BRAKED}",
    of=_entering(NeighbourRole.LEFT_FOLLOWER, margin_behind),
)
RETURNING = Spread(
    formula=f"behind: {_GAP}, or {_BRAKED}; ahead: {_GAP}; of the three, the one that decides",
    of=_returning,
)
KEEPING_RIGHT = Spread(
    formula=f"ahead and behind: {_GAP}, or sqrt(2 sp^2 + 2 ({_FREE})^2 sv^2) where {_FREE} ahead "
    "decide",
    of=_keeping_right,
)
BRAKING = Spread(
    formula="sqrt(2 sv^2 (dv/gap)^2 + 2 sp^2 (dv^2 / (2 gap^2))^2), in the frame of the smallest "
    "margin",
    of=_braking,
)
MEETING = Spread(
    formula=f"sqrt(2 sp^2 + 2 ({_TIME})^2 sv^2), or sqrt(2 sp^2 + ({_PET})^2 sv^2) where "
    f"{_PET} decide",
    of=_meeting,
)
DUE = Spread(
    formula="(error of the gap to the target as it becomes large enough) / (v - v_target) and "
    "(error of the room to the right as it ends) / (its loss per second), added in squares",
    of=_due,
)
STOPPING = Spread(formula="(t + v/b) sv, in the frame of the smallest margin",
                  of=_stopping("sight_lit"))  # fmt: skip
STOPPING_UNLIT = Spread(formula=STOPPING.formula, of=_stopping("sight_unlit"))
OF_SPEED = Spread(formula="sv", of=_of_speed)
OF_PLACE = Spread(formula="sp", of=_of_place)
SLOW_LANES = Spread(formula="0.5 sp / distance from the border that decides", of=_slow_lanes)
