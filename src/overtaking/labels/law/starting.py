"""Rules about the begin of an overtake: L4, L5, L6, L7."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.core.float32_math import maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.beliefs import belief, pull_out
from overtaking.labels.law.case import beside
from overtaking.labels.law.margins import instant
from overtaking.labels.law.measurement_errors import (
    BRAKING_ERROR_FORMULA,
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    gap_error,
    of_both,
    standard_error,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import GapMargin, margin_ahead, margin_behind, sure_decel
from overtaking.labels.snapshots import (
    METRES,
    Frames,
    Others,
    at,
    half_window,
    lateral_speed_at,
    others_at,
    out_indicator,
    slot_of,
    spread_over,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE, PerceivedVehicle, Trajectories
from overtaking.model.verdicts import Case, Finding

_THIRD = np.array([-1.0, 3.0, -3.0, 1.0])
"""A third difference: 0 for a parabola, with 20 times the variance of the noise."""


def steady_speed_at(
    run: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames, limit: float
) -> F32:
    """Speed of vehicles to the left at single frames, all arrays of shape (instant,) [m/s].

    In a recording the central difference over about 0.2 s is widened, up to 2 s, until its standard
    error is a quarter of the limit. The noise of a position is the root mean square of its third
    differences within a second, over the root of 20; the error of a difference over 2 h is the
    noise times the root of 2, over 2 h. Simulations have no noise.

    Args:
        run: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        frames: A frame of each in which it is recorded.
        limit: The speed with which it is compared [m/s].
    """
    if not run.unknown:
        return lateral_speed_at(run, rows, slot, frames)
    interval = run.scenario.frame_interval_ms
    around = int(float(constant("law.others.noise_time")) * 1000.0 / interval)
    accepted = float(constant("law.others.error_share")) * limit
    wanted = np.sqrt(2.0) * _noise(run, rows, slot, frames, max(2, around)) / accepted
    half = np.ceil(wanted / 2.0 * 1000.0 / interval)
    narrow = half_window(interval)
    half = np.clip(half, narrow, max(narrow, around)).astype(np.int32)
    return lateral_speed_at(run, rows, slot, frames, half)


def _noise(
    run: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames, around: int
) -> NDArray[np.float64]:
    """Standard deviation of the noise of a lateral position, from frames around it [m]."""
    frame = frames[:, None] + np.arange(-around, around + 1)
    inside = (frame >= 0) & (frame < run.num_frames[rows, None])
    place = (rows[:, None], slot[:, None], np.where(inside, frame, 0))
    inside &= run.state_mask[place]
    d = run.states.d[place] * float(METRES)
    count = frame.shape[1] - len(_THIRD) + 1
    pieces = [(d[:, k : k + count], inside[:, k : k + count]) for k in range(len(_THIRD))]
    third = sum(weight * values for weight, (values, _) in zip(_THIRD, pieces, strict=True))
    whole = np.logical_and.reduce([there for _, there in pieces])
    squares = np.where(whole, third**2, 0.0).sum(axis=1)
    return np.sqrt(squares / np.maximum(whole.sum(axis=1), 1) / (_THIRD**2).sum())


def _entering(
    place: NeighbourRole, margin: GapMargin
) -> Callable[[Case, Finding, MeasurementErrors], F32]:
    """Of the gap to a neighbour in the entered lane as the line is crossed."""

    def of(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
        del found
        return gap_error(case, place, case.events.line_crossed, margin, errors)

    return of


ENTERING_AHEAD = Spread(
    formula=f"{GAP_ERROR_FORMULA}, or sqrt(2 sp^2 + 2 ({amount('law.entry.ttc')})^2 sv^2) where "
    "the time to collision decides",
    of=_entering(NeighbourRole.LEFT_LEADER, margin_ahead),
)

ENTERING_BEHIND = Spread(
    formula=f"{GAP_ERROR_FORMULA}, or {BRAKING_ERROR_FORMULA}",
    of=_entering(NeighbourRole.LEFT_FOLLOWER, margin_behind),
)


def _room_ahead(case: Case) -> Finding:
    """When the line is crossed, the leader on the left is at a lawful gap, 3 s or more away."""
    seen, frame = case.signals, case.events.line_crossed
    other, decel = (
        beside(case, NeighbourRole.LEFT_LEADER, frame),
        sure_decel(at(seen.friction, frame)),
    )
    margin = margin_ahead(other.gap, at(seen.speed, frame), other.closing_speed, decel)
    believed = belief(case, pull_out(case), {PerceivedVehicle.NEW_LEADER: margin_ahead})
    return instant(frame, margin, other.valid, belief=believed)


L4 = Rule(
    id="pt.ce.38-1.front@2013",
    code="L4",
    law="Article 38(1) and (2)(a)",
    title="Room ahead in the lane entered",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic in the "
    "same direction; the carriageway must be free over the length that is needed.",
    predicate=(
        "At line_crossed: gap to the leader in the lane on the left >= safe distance (as L3), and "
        f"time to collision >= {amount('law.entry.ttc')}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=_room_ahead,
    spread=ENTERING_AHEAD,
)


def _room_behind(case: Case) -> Finding:
    """When the line is crossed, the follower on the left has a lawful gap and need not brake."""
    seen, frame = case.signals, case.events.line_crossed
    other, decel = (
        beside(case, NeighbourRole.LEFT_FOLLOWER, frame),
        sure_decel(at(seen.friction, frame)),
    )
    margin = margin_behind(other.gap, at(seen.speed, frame), other.closing_speed, decel)
    believed = belief(case, pull_out(case), {PerceivedVehicle.NEW_FOLLOWER: margin_behind})
    return instant(frame, margin, other.valid, belief=believed)


L5 = Rule(
    id="pt.ce.35@2013",
    code="L5",
    law="Articles 35 and 38(2)(c)",
    title="Room behind in the lane entered",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    predicate=(
        "At line_crossed: gap to the follower in the lane on the left >= its safe distance (as "
        "L3), and the braking that is forced on it, closing speed^2 / (2 gap), <= "
        f"{amount('law.entry.braking')}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
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
    others, own_lane = others_at(case, frame[rows], rows), case.signals.lane[rows, frame[rows]]
    behind = others.valid & ~others.oncoming & (others.lead > 0)
    left = behind & (others.lane == own_lane[:, None] + 1)
    near = others.gap <= constant("law.others.reach")
    same = behind & (others.lane == own_lane[:, None]) & near
    moving, limit = same.copy(), constant("law.others.lateral_speed")
    place, slot = np.nonzero(same)
    start = (rows[place], slot, frame[rows[place]])
    moving[same] = steady_speed_at(case.trajectories, *start, float(limit)) > limit
    hidden = "indicators" in case.trajectories.unknown
    shown = same & ((others.lights & out_indicator(case)) != 0) & (not hidden)
    begun = (moving | shown).any(axis=1)
    arrival = np.where(begun, np.float32(0.0), _arrival(case, others, left, rows))
    spread = partial(spread_over, simulations=attempted, count=len(attempted))
    return instant(
        frame,
        spread(arrival - constant("law.others.arrival")),
        spread((left | same).any(axis=1)),
        doubtful=spread(same.any(axis=1) & hidden),
    )


def _arrival(case: Case, others: Others, left: Mask, rows: IndexArray) -> F32:
    """Time until the first on the left is beside the ego at constant speeds [s], at most 60."""
    longest = constant("law.others.longest_arrival")
    own = case.signals.speed[rows, case.events.attempt[rows], None]
    closing = others.speed - own
    comes = left & (closing > 0)
    time = maximum(others.gap, np.float32(0.0)) / np.where(comes, closing, np.float32(1.0))
    return np.where(comes & (time < longest), time, longest).min(axis=1)


def _arrival_error(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Error of the arrival of the first on the left, by positions and speeds of both [s]."""
    rows = np.flatnonzero(case.events.has_attempt)
    frame = case.events.attempt[rows]
    others = others_at(case, frame, rows)
    lane = case.signals.lane[rows, frame]
    left = others.valid & ~others.oncoming & (others.lead > 0)
    left &= others.lane == lane[:, None] + 1

    def moved(own: F32, its: F32, faster: F32, its_faster: F32) -> F32:
        seen = replace(others, gap=others.gap + own - its, speed=others.speed + its_faster - faster)
        return _arrival(case, seen, left, rows)

    attempted = case.events.has_attempt
    error = spread_over(standard_error(moved, *of_both(errors)), attempted, len(attempted))
    begun = found.margin <= -constant("law.others.arrival")
    return np.where(begun, np.float32(0.0), error)


L6 = Rule(
    id="pt.ce.38-2-c@2013",
    code="L6",
    law="Article 38(2)(c)",
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
    partly=frozenset(["indicators"]),
    check=_nobody_overtakes,
    spread=Spread(
        formula="sqrt(2 sp^2 + 2 time^2 sv^2) / closing speed; 0 where somebody signals or moves"
        " left",
        of=_arrival_error,
    ),
)


def _target_keeps_lane(case: Case) -> Finding:
    """At the start the target neither signals left nor moves left."""
    run, frame, vehicle = case.trajectories, case.events.attempt, case.target.slot
    there, slot, limit = (
        vehicle != NO_VEHICLE,
        slot_of(vehicle),
        constant("law.others.lateral_speed"),
    )
    lights = run.states.lights[np.arange(len(slot)), slot, np.maximum(frame, 0)]
    hidden = "indicators" in run.unknown
    shown = there & ((lights & out_indicator(case)) != 0) & (not hidden)
    # Without an attempt the target need not be recorded in the frame that is looked at.
    speed, begun = np.zeros(len(slot), np.float32), np.flatnonzero(there & case.events.has_attempt)
    speed[begun] = steady_speed_at(run, begun, slot[begun], frame[begun], float(limit))
    margin = limit - speed
    margin = np.where(shown, np.minimum(margin, -limit), margin)
    return instant(frame, margin, there, doubtful=np.full(len(slot), hidden))


L7 = Rule(
    id="pt.ce.38-2-d@2013",
    code="L7",
    law="Article 38(2)(d)",
    title="The driver ahead does not pull out",
    gloss="Do not begin to overtake if the driver ahead has signalled to overtake a third vehicle"
    " or to avoid an obstacle.",
    predicate=TARGET_KEEPS_LANE,
    unit="m/s",
    grade=Grade.BY_ROAD,
    partly=frozenset(["indicators"]),
    check=_target_keeps_lane,
)
