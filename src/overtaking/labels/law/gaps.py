"""Rules about gaps along the road: L3, L4, L5, L8, L23, L24."""

import numpy as np

from overtaking.core.float32_math import minimum
from overtaking.labels.instants import at
from overtaking.labels.law.beliefs import belief, going_back, pull_out
from overtaking.labels.law.distances import (
    beside,
    margin_ahead,
    margin_behind,
    margin_of_gap,
    sure_decel,
)
from overtaking.labels.law.errors import (
    BRAKING,
    ENTERING_AHEAD,
    ENTERING_BEHIND,
    FOLLOWING,
    MEETING,
    RETURNING,
    back_frame,
    oncoming_margins,
)
from overtaking.labels.law.frames import (
    ENDLESS,
    instant,
    manoeuvre,
    never_negative,
    settled,
    stretches,
)
from overtaking.labels.law.numbers import amount, bare
from overtaking.labels.law.others import coming, others_at
from overtaking.labels.law.rule import Finding, Grade, Rule, inapplicable
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import PerceivedVehicle
from overtaking.model.verdicts import Case

_REACTION_AND_DECEL = (
    f"t = {amount('law.safe_distance.reaction_time')}, b = "
    f"min({amount('law.safe_distance.decel_limit')}, {bare('friction.table.usable_share')} mu g)"
)

NO_HARD_BRAKING = (
    f"In the {amount('law.obstruction.duration')} after each change of lane: closing speed^2 / (2 "
    f"gap) of the vehicle behind the ego <= {amount('law.obstruction.braking')}."
)

BACK_BEFORE_ONCOMING = (
    "On two-way roads, at return_end or abort_end: gap to each oncoming vehicle >= "
    f"{amount('law.oncoming.time')} (v + v_oncoming), and it reaches the place that the ego has "
    f"left after {amount('law.oncoming.encroachment')} or more."
)

SAFE_RETURN = (
    "At return_end: gap to the vehicle behind, the overtaken one or one in between, >= v t + "
    f"v^2 / (2 b) - u^2 / (2 b), v behind and u ahead, {_REACTION_AND_DECEL}; the braking forced "
    f"on it <= {amount('law.entry.braking')}; gap to the vehicle ahead by the same formula."
)
"""The predicate of `L8` for laws without a formula for the safe distance."""


def _follows_safely(case: Case) -> Finding:
    """The gap to the leader is lawful, but for 3 s after it cut in or all began."""
    believed = belief(case, pull_out(case), {PerceivedVehicle.LEADER: margin_of_gap})
    return never_negative(stretches(case).follow, settled(case), belief=believed)


L3 = Rule(
    id="pt.ce.18-1@2013",
    code="L3",
    law="Article 18(1)",
    title="Safe distance",
    gloss="Keep a distance to the vehicle ahead that avoids a collision if it stops or slows "
    "suddenly.",
    predicate=(
        "At every frame: gap to the leader in the ego's lane >= v t + v^2 / (2 b) - v_lead^2 / (2 "
        f"b), {_REACTION_AND_DECEL}; not in the {amount('law.safe_distance.recapture')} after the "
        "leader cut in or the recording began."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    without_attempt=True,
    check=_follows_safely,
    spread=FOLLOWING,
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
