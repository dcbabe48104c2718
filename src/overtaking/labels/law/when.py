"""Rules about when to overtake and when to return: L6, L7, L9, L21."""

from dataclasses import replace
from functools import partial

import numpy as np

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.core.float32_math import maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.instants import at, seconds_of, slot_of, spread_over
from overtaking.labels.law.distances import slow_lane_room
from overtaking.labels.law.errors import DUE, KEEPING_RIGHT, of_both, standard_error
from overtaking.labels.law.frames import driving_end, frames_of, instant, passed, stretches
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.others import Others, others_at, out_indicator, steady_speed_at
from overtaking.labels.law.rule import Finding, Grade, MeasurementErrors, Rule, Spread, decided
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.verdicts import Case

TARGET_KEEPS_LANE = (
    "At attempt: the target does not signal left, and moves left at no more than "
    f"{amount('law.others.lateral_speed')}. A signal alone counts as a margin of "
    f"-{amount('law.others.lateral_speed')}."
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
