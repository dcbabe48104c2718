"""Rules about the side of oncoming traffic: L25, L26, L27, L28."""

from dataclasses import replace

import numpy as np

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.instants import METRES, across_at, at, borders_of, seconds_of, slot_of
from overtaking.labels.law.distances import lawful_gap, sure_decel
from overtaking.labels.law.errors import of_both, standard_error
from overtaking.labels.law.frames import (
    ENDLESS,
    Span,
    always_at,
    conduct,
    driving_end,
    ends_in,
    instant,
    manoeuvre,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.others import Others, coming, others_at
from overtaking.labels.law.rule import Finding, Grade, MeasurementErrors, Rule, Spread, inapplicable
from overtaking.labels.signals import encounter
from overtaking.model.batch import cached_per_batch
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case

_SLOW = np.float32(0.1)  # Who moves across more slowly is not back at a sure time [m/s].


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


@cached_per_batch
def on_the_other_side(case: Case) -> Span:
    """The manoeuvre while a corner is beyond the line between the directions.

    From the first to the last such frame; empty on one-way roads.
    """
    span, road = manoeuvre(case), case.trajectories.road
    never = np.full(len(span.start), NEVER)
    if not road.is_two_way:
        return Span(start=never + np.int32(1), stop=never)
    line = np.float32(road.overtaking_sign * road.lane_boundaries[-1]) + constant(
        "law.line.tolerance"
    )
    rows = np.flatnonzero(span.exists)
    first, last, _ = ends_in(span, rows, case.signals.left_edge[rows] > line)
    return Span(start=np.where(first == NEVER, last + 1, first).astype(np.int32), stop=last)


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


def time_back_error(case: Case, errors: MeasurementErrors) -> F32:
    """Error of when the ego is back on its side, by its position across the road [s]."""
    across = at(case.signals.lateral_speed, on_the_other_side(case).stop)
    return np.float32(errors.position_std) / np.maximum(np.abs(across), _SLOW)


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


def _leaves_room(case: Case) -> Finding:
    """A slow heavy vehicle that does not overtake keeps 50 m to the one ahead."""
    run, seen, events = case.trajectories, case.signals, case.events
    in_town = run.road.kind == "town" and "road_kind" not in run.unknown
    if not run.road.is_two_way or run.road.num_lanes > 1 or in_town:
        return inapplicable(seen.num_simulations)
    heavy = run.scenario.vehicles.kind[:, EGO_SLOT] == VehicleKind.TRUCK
    heavy |= "kinds" in run.unknown
    # Who is about to overtake may close up (paragraph 2).
    span, end = conduct(case), driving_end(case)
    stop = np.where(heavy & ~events.has_attempt, np.minimum(span.stop, end), span.start - 1)
    rows, frames = Span(start=span.start, stop=stop).frames()
    slow = seen.speed[rows, frames] <= constant("law.slow.speed")
    slow &= seen.neighbour_slot[rows, NeighbourRole.LEADER, frames] != NO_VEHICLE
    rows, frames = rows[slow], frames[slow]
    gap = encounter(case, NeighbourRole.LEADER, rows, frames).gap
    return always_at(gap - constant("law.slow.distance"), rows, frames, seen.num_simulations)


L28 = Rule(
    id="pt.ce.40@2013",
    code="L28",
    law="Article 40",
    title="Slow vehicles leave room",
    gloss="Outside localities, on roads with one lane in each direction, heavy and other vehicles "
    f"that drive slowly keep at least {amount('law.slow.distance')} to the vehicle ahead, so that "
    "they can be overtaken; not who is about to overtake.",
    predicate=(
        f"At every frame at {amount('law.slow.speed')} or less, the ego being a truck that does "
        "not begin to overtake, on a two-way road with one lane each way outside localities: gap "
        f"to the leader in its lane >= {amount('law.slow.distance')}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["kinds", "road_kind"]),
    without_attempt=True,
    check=_leaves_room,
    spread=Spread(
        formula="sqrt(2) sp",
        of=lambda _, found, errors: np.full_like(
            found.margin, np.sqrt(2.0) * errors.position_std, np.float32
        ),
    ),
    two_way=True,
)
