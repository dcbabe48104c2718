"""Remedies of rules about distances along the road: L3, L4, L5, L8, L23, L24."""

import numpy as np

from overtaking.core.arrays import F32, IndexArray
from overtaking.core.float32_math import TWO, as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.explain.breach import BreachFacts, Change, Quantity, Remedy, sole
from overtaking.labels.law.case import after_cut_ins, on_the_other_side
from overtaking.labels.law.oncoming_traffic import (
    back_frame,
    gap_to_return,
    oncoming_margins,
    room_and_time,
)
from overtaking.labels.law.safe_distance import GapMargin, margin_behind, margin_of_gap, sure_decel
from overtaking.labels.law.speed import speed_limits
from overtaking.labels.snapshots import coming, others_at
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.world.road_surface import stoppable_speed
from overtaking.world.surrogate_safety import drac

_NONE = np.float32(-1.0)
"""Where no speed is lawful [m/s]."""


def safe_distance(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L3: more distance throughout, or so much slower at the same distances."""
    frames = facts.beside(NeighbourRole.LEADER)
    frames = frames[~after_cut_ins(facts.case)[0, frames]]
    margins = _margins(facts, NeighbourRole.LEADER, frames, margin_of_gap)
    worst, broken = int(margins.argmin()), frames[margins < 0]
    farther = more_distance(facts, NeighbourRole.LEADER, frames[worst], margins[worst])
    return *farther, *facts.slower(broken, _followable(facts, broken))


def room_ahead(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L4: more distance to the one ahead on the left, or slower."""
    neighbour, frames = NeighbourRole.LEFT_LEADER, np.array([facts.first])
    gap, closing = _gaps(facts, neighbour, frames)
    ahead = facts.case.signals.speed[0, frames] - closing
    in_time = ahead + gap / constant("law.entry.ttc")
    allowed = np.minimum(_lawful_speed(gap, ahead, _decel(facts, frames)), in_time)
    farther = more_distance(facts, neighbour, facts.first, facts.margin)
    return *farther, *facts.slower(frames, np.where(gap < 0, _NONE, allowed))


def room_behind(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L5: more distance to the one behind on the left, or faster where the limit allows it."""
    neighbour, frames = NeighbourRole.LEFT_FOLLOWER, np.array([facts.first])
    farther = more_distance(facts, neighbour, facts.first, facts.margin)
    gap, closing = _gaps(facts, neighbour, frames)
    rear = facts.case.signals.speed[0, frames] + closing
    slowest = _speed_before(np.maximum(gap, 0), rear, _decel(facts, frames))[0]
    if gap[0] < 0 or slowest > speed_limits(facts.case)[1][0, facts.first]:
        return farther
    return *farther, *facts.speed(facts.first, slowest)


def safe_return(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L8: more distance to those in the lane of the return, to both if both were too near."""
    frame, changes = np.array([facts.first]), list[Change]()
    for neighbour, margin in (
        (NeighbourRole.FOLLOWER, margin_behind),
        (NeighbourRole.LEADER, margin_of_gap),
    ):
        found = float(_margins(facts, neighbour, frame, margin)[0])
        if facts.case.signals.neighbour_slot[0, neighbour, facts.first] != NO_VEHICLE and found < 0:
            changes += more_distance(facts, neighbour, facts.first, found)[0]
    return (tuple(changes),)


def no_obstruction(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L23: so much more distance to the one behind that it need not brake hard."""
    neighbour, limit = NeighbourRole.FOLLOWER, constant("law.obstruction.braking")
    frames = facts.beside(neighbour)
    gap, closing = _gaps(facts, neighbour, frames)
    forced = np.minimum(drac(gap, closing), constant("law.obstruction.most"))
    needed = closing * closing / (TWO * limit)
    # Where the margin is cut off, several frames have it; the one that lacks most tells.
    lacking = np.where(np.isclose(limit - forced, facts.margin), needed - gap, -np.inf)
    worst = int(lacking.argmax())
    return more_distance(facts, neighbour, frames[worst], gap[worst] - needed[worst])


def oncoming(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L24: more distance to the oncoming vehicle when the ego is back in its lane."""
    others = others_at(facts.case, back_frame(facts.case))
    slot = int(oncoming_margins(facts.case, others)[0].argmin())
    gap = float(others.gap[0, slot])
    return sole(Quantity.GAP_ONCOMING, gap, gap - facts.margin, facts.first, slot)


def time_to_pass(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L25: more distance to the oncoming vehicle at the pull-out."""
    begin = on_the_other_side(facts.case).start
    others = others_at(facts.case, begin)
    lacking = np.abs(room_and_time(facts.case, others)[0] - facts.margin)
    slot = int(np.where(coming(others)[0], lacking, np.inf).argmin())
    gap = float(others.gap[0, slot])
    return sole(Quantity.GAP_ONCOMING, gap, gap - facts.margin, facts.first, slot)


def to_return(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L27: more distance between the two vehicles between which the ego would return."""
    gap = float(gap_to_return(facts.case)[1][0])
    return sole(Quantity.GAP_TO_RETURN, gap, gap - facts.margin, facts.first)


def slow_vehicle(facts: BreachFacts) -> tuple[Remedy, ...]:
    """L28: farther behind the vehicle ahead."""
    frames = facts.beside(NeighbourRole.LEADER)
    gap, _ = _gaps(facts, NeighbourRole.LEADER, frames)
    # The smallest gap may lie in a frame in which the ego is too fast for the rule (above 40 km/h).
    # The frame that decides is the one whose gap gives the margin of the finding.
    worst = int(np.abs(gap - constant("law.slow.distance") - facts.margin).argmin())
    return more_distance(facts, NeighbourRole.LEADER, frames[worst], facts.margin)


def _followable(facts: BreachFacts, frames: IndexArray) -> F32:
    """Highest speed that each gap to the leader allows, negative where none does [m/s]."""
    gap, closing = _gaps(facts, NeighbourRole.LEADER, frames)
    ahead = facts.case.signals.speed[0, frames] - closing
    return np.where(gap < 0, _NONE, _lawful_speed(gap, ahead, _decel(facts, frames)))


def _lawful_speed(gap: F32, ahead: F32, decel: F32) -> F32:
    """Highest speed that a gap to a vehicle of speed `ahead` allows, as `lawful_gap` [m/s]."""
    way = np.maximum(gap, np.float32(0.0)) + ahead * ahead / (TWO * decel)
    return stoppable_speed(way, as_f32(constant("law.safe_distance.reaction_time")), decel)


def _speed_before(gap: F32, rear: F32, decel: F32) -> F32:
    """Lowest speed at a gap before a vehicle of speed `rear`, as `margin_behind` [m/s]."""
    reaction = constant("law.safe_distance.reaction_time")
    square = rear * rear + TWO * decel * (rear * reaction - gap)
    calm = rear - np.sqrt(TWO * constant("law.entry.braking") * gap)
    return np.maximum(np.sqrt(np.maximum(square, np.float32(0.0))), calm)


def more_distance(
    facts: BreachFacts,
    neighbour: NeighbourRole,
    frame: int | np.integer,
    margin: float | np.floating,
) -> tuple[Remedy]:
    """More distance to a neighbour, by what the margin lacks."""
    seen, ahead = facts.case.signals, neighbour in (NeighbourRole.LEADER, NeighbourRole.LEFT_LEADER)
    quantity = Quantity.GAP_AHEAD if ahead else Quantity.GAP_BEHIND
    gap = float(seen.gap[0, neighbour, frame])
    return sole(
        quantity, gap, gap - float(margin), frame, int(seen.neighbour_slot[0, neighbour, frame])
    )


def _margins(
    facts: BreachFacts, neighbour: NeighbourRole, frames: IndexArray, margin: GapMargin
) -> F32:
    gap, closing = _gaps(facts, neighbour, frames)
    return margin(gap, facts.case.signals.speed[0, frames], closing, _decel(facts, frames))


def _gaps(facts: BreachFacts, neighbour: NeighbourRole, frames: IndexArray) -> tuple[F32, F32]:
    """Gap and closing speed of a neighbour, shape (frame,)."""
    seen = facts.case.signals
    return seen.gap[0, neighbour, frames], seen.closing_speed[0, neighbour, frames]


def _decel(facts: BreachFacts, frames: IndexArray) -> F32:
    return sure_decel(facts.case.signals.friction[0, frames])
