"""Rules about oncoming traffic: L24, L25, L26, L27."""

from dataclasses import replace

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray, Mask
from overtaking.core.float32_math import HALF, as_f32, maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import on_the_other_side, seconds_of
from overtaking.labels.law.margins import ENDLESS, always_at, inapplicable, instant
from overtaking.labels.law.measurement_errors import (
    MeasurementErrors,
    of_both,
    standard_error,
    time_back_error,
    zero_if_infinite,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import lawful_gap, sure_decel
from overtaking.labels.snapshots import (
    METRES,
    Others,
    across_at,
    at,
    borders_of,
    coming,
    others_at,
    slot_of,
)
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding


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

    return zero_if_infinite(standard_error(moved, *of_both(errors)))


_TIME = amount("law.oncoming.time")

_PET = amount("law.oncoming.encroachment")

MEETING = Spread(
    formula=f"sqrt(2 sp^2 + 2 ({_TIME})^2 sv^2), or sqrt(2 sp^2 + ({_PET})^2 sv^2) where "
    f"{_PET} decide",
    of=_meeting,
)

BACK_BEFORE_ONCOMING = (
    "On two-way roads, at return_end or abort_end: gap to each oncoming vehicle >= "
    f"{amount('law.oncoming.time')} (v + v_oncoming), and it reaches the place that the ego has "
    f"left after {amount('law.oncoming.encroachment')} or more."
)


def _back_before_oncoming(case: Case) -> Finding:
    """When the ego is back, the first oncoming vehicle is 1 s of both speeds and 2 s away."""
    if not case.trajectories.road.is_two_way:
        return inapplicable(case.signals.num_simulations)
    back, others = back_frame(case), others_at(case, back_frame(case))
    margin = oncoming_margins(case, others).min(axis=1)
    was_out = case.events.line_crossed != NEVER
    return instant(back, margin, was_out & coming(others).any(axis=1))


L24 = Rule(
    id="pt.ce.38-1.oncoming@2013",
    code="L24",
    law="Article 38(1)",
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
    f"{amount('law.oncoming.time')} (v + v_oncoming), v when it is back, v_oncoming when the line "
    "is crossed."
)

_CLEARANCE = amount("law.oncoming.time")

NO_REACTION = (
    "While a corner of the ego is beyond the line between the directions: the next oncoming "
    f"vehicle, if it is met within {amount('law.oncoming.reach_time')}, brakes at "
    f"{amount('law.obstruction.braking')} or less and keeps its lane. Leaving the lane counts as "
    f"{amount('law.obstruction.braking')} too much."
)


def predicted_gaps(case: Case, others: Others) -> F32:
    """Gap to each oncoming vehicle when the ego is back, if they drive on as at the pull-out.

    Args:
        case: The batch.
        others: All vehicles at the pull-out.

    Returns:
        Shape (simulation, vehicle), infinite for those that do not come [m].
    """
    out, s = on_the_other_side(case), case.trajectories.states.s[:, EGO_SLOT]
    way = as_f32(at(s, out.stop) - at(s, out.start)) * METRES
    time = seconds_of(case, np.maximum(out.stop - out.start, 0))
    left = others.gap - (way[:, None] + others.speed * time[:, None])
    return np.where(coming(others), left, ENDLESS)


def _time_to_pass(case: Case) -> Finding:
    """At the pull-out the oncoming traffic leaves room and time for all of the manoeuvre."""
    if not case.trajectories.road.is_two_way:
        return inapplicable(case.signals.num_simulations)
    out = on_the_other_side(case)
    others = others_at(case, out.start)
    applies = out.exists & coming(others).any(axis=1)
    return instant(out.start, room_and_time(case, others).min(axis=1), applies)


def room_and_time(case: Case, others: Others, faster: F32 | None = None) -> F32:
    """Gaps when the ego is back, minus 1 s of both speeds, shape (simulation, vehicle) [m].

    Args:
        case: The batch.
        others: All vehicles at the pull-out.
        faster: Error of the ego's speed, (simulation,) or a number [m/s].

    Returns:
        `ENDLESS` for those that do not come.
    """
    own = at(case.signals.speed, on_the_other_side(case).stop)[:, None]
    own = own if faster is None else own + faster
    needed = constant("law.oncoming.time") * (own + others.speed)
    gaps = predicted_gaps(case, others)
    return np.where(coming(others), gaps - needed, ENDLESS)


def _time_error(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the predicted gap, by positions at the pull-out and both speeds [m]."""
    del found
    others = others_at(case, on_the_other_side(case).start)

    def moved(own: F32, its: F32, faster: F32, its_faster: F32) -> F32:
        seen = replace(others, gap=others.gap + its - own, speed=others.speed + its_faster)
        return room_and_time(case, seen, faster).min(axis=1)

    gaps = room_and_time(case, others)
    row, slot = np.arange(len(gaps)), gaps.argmin(axis=1)
    both = at(case.signals.speed, on_the_other_side(case).stop) + others.speed[row, slot]
    late = both * time_back_error(case, errors)
    along = standard_error(moved, *of_both(errors))
    return np.sqrt(along * along + late * late)


L25 = Rule(
    id="pt.ce.38-1.pull-out@2013",
    code="L25",
    law="Articles 35 and 38(1)",
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
        of=_time_error,
    ),
    two_way=True,
)


def nearest_coming(case: Case) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Each frame on the other side in which an oncoming vehicle is near, and the nearest.

    Near is who is met within 10 s at both speeds.

    Returns:
        Simulations, frames and slots, shape (instant,).
    """
    rows, frames = on_the_other_side(case).frames()
    others = others_at(case, frames.astype(np.int32), rows)
    both = others.speed + case.signals.speed[rows, frames][:, None]
    near = coming(others) & (others.gap <= constant("law.oncoming.reach_time") * both)
    slot = np.where(near, others.gap, np.inf).argmin(axis=1)
    met = np.flatnonzero(near.any(axis=1))
    return rows[met], frames[met], slot[met]


def over_its_edge(case: Case, rows: IndexArray, frames: IndexArray, slot: IndexArray) -> F32:
    """How far oncoming vehicles reach beyond the outer edge of their lane, (instant,) [m]."""
    run = case.trajectories
    reach = across_at(run, case.signals, rows, slot, frames)[0]
    reach = reach + run.scenario.vehicles.width[rows, slot] * HALF
    return reach - borders_of(run.road)[-1]


def _nobody_evades(case: Case) -> Finding:
    """Oncoming drivers neither brake hard for the ego nor leave their lane."""
    run = case.trajectories
    if not run.road.is_two_way:
        return inapplicable(case.signals.num_simulations)
    rows, frames, slot = nearest_coming(case)
    limit = constant("law.obstruction.braking")
    margin = limit + as_f32(run.states.accel_lon[rows, slot, frames]) * METRES
    left = over_its_edge(case, rows, frames, slot) > constant("law.line.tolerance")
    margin = np.where(left, np.minimum(margin, -limit), margin)
    return always_at(margin, rows, frames, case.signals.num_simulations)


L26 = Rule(
    id="pt.ce.35.oncoming@2013",
    code="L26",
    law="Article 35",
    title="No reaction of oncoming traffic",
    gloss="Overtake only where no danger to or obstruction of traffic results.",
    predicate=NO_REACTION,
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    check=_nobody_evades,
    two_way=True,
)


def gap_to_return(case: Case) -> tuple[Mask, F32, F32, F32, F32]:
    """The gap ahead of the last vehicle that the ego passes, or would, at the pull-out.

    Returns:
        Whether there is a vehicle ahead of it within 200 m, shape (simulation,); the gap between
        the two [m], their speeds, the one behind first [m/s], and the ego's length [m].
    """
    out, run = on_the_other_side(case), case.trajectories
    row, begin = np.arange(len(out.start)), np.maximum(out.start, 0)
    others = others_at(case, begin)
    same = others.valid & ~others.oncoming & (others.lane == at(case.signals.lane, begin)[:, None])
    s, stop = run.states.s, np.maximum(out.stop, 0)
    passed = same & (others.lead < 0) & (s[row, EGO_SLOT, stop, None] > s[row, :, stop])
    # Of those that are passed the foremost, else the target.
    foremost = np.where(passed, others.lead, np.inf).argmin(axis=1)
    slot = np.where(passed.any(axis=1), foremost, slot_of(case.target.slot))
    ahead = same & (others.lead < others.lead[row, slot][:, None])
    following = np.where(ahead, others.lead, -np.inf).argmax(axis=1)
    halves = run.scenario.vehicles.length[row, slot] + run.scenario.vehicles.length[row, following]
    gap = others.lead[row, slot] - others.lead[row, following] - halves * HALF
    there = out.exists & (slot != EGO_SLOT) & ahead.any(axis=1)
    speeds = others.speed[row, slot], others.speed[row, following]
    near = there & (gap <= constant("law.return.reach"))
    return near, gap, *speeds, run.scenario.vehicles.length[:, EGO_SLOT]


def _gap_to_return(case: Case) -> Finding:
    """At the pull-out the gap to return into holds the ego and both safe distances."""
    if not case.trajectories.road.is_two_way:
        return inapplicable(case.signals.num_simulations)
    out = on_the_other_side(case)
    applies, gap, behind, ahead, length = gap_to_return(case)
    decel = sure_decel(at(case.signals.friction, out.start))
    return instant(out.start, gap - _room_taken(behind, ahead, length, decel), applies)


def _room_taken(behind: F32, ahead: F32, length: F32, decel: F32) -> F32:
    """Room that the ego takes between two others, at the speed of the one ahead [m]."""
    after = lawful_gap(behind, behind - ahead, decel)
    return length + after + lawful_gap(ahead, np.float32(0.0), decel)


def _return_error(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Of the gap between two others and of what their speeds ask [m]."""
    del found
    _, gap, behind, ahead, length = gap_to_return(case)
    decel = sure_decel(at(case.signals.friction, on_the_other_side(case).start))

    def moved(rear: F32, front: F32, faster: F32, front_faster: F32) -> F32:
        taken = _room_taken(behind + faster, ahead + front_faster, length, decel)
        return gap + front - rear - taken

    return standard_error(moved, *of_both(errors))


L27 = Rule(
    id="pt.ce.38-2-b.gap@2013",
    code="L27",
    law="Article 38(2)(b)",
    title="A gap to return into",
    gloss="Do not begin to overtake unless one can return to the right without danger to those "
    "who drive there.",
    predicate=(
        "On two-way roads, as the line between the directions is crossed: the gap ahead of the "
        "foremost vehicle that the ego will pass, or of the target, if a vehicle drives less than "
        f"{amount('law.return.reach')} ahead of it, >= length of the ego + safe distances (as L3) "
        "behind and ahead of it, at the speed of the one ahead."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=_gap_to_return,
    spread=Spread(formula="as L3 behind and ahead, between the two others", of=_return_error),
    two_way=True,
)
