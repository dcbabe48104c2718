"""Remedies of rules about distances along the road: L4, L5, L24."""

import numpy as np

from overtaking.core.arrays import F32, IndexArray
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import opposing_lane_span
from overtaking.labels.law.oncoming_traffic import (
    back_frame,
    margins_at_return,
    oncoming_margins,
    return_gap,
)
from overtaking.labels.law.remedies import (
    NO_SPEED,
    BreachContext,
    Remedy,
    RemedyQuantity,
    gap_and_closing_speed,
    max_following_speed,
    min_speed_before_follower,
    more_gap,
    single_change,
)
from overtaking.labels.law.safe_distance import (
    decel_for_safe_distance,
)
from overtaking.labels.law.speed import speed_limits
from overtaking.labels.snapshots import other_vehicles_at
from overtaking.model.neighbours import NeighbourRole


def room_ahead(facts: BreachContext) -> tuple[Remedy, ...]:
    """L4: more distance to the one ahead on the left, or slower."""
    neighbour, frames = NeighbourRole.LEFT_LEADER, np.array([facts.first_frame])
    gap, closing = gap_and_closing_speed(facts, neighbour, frames)
    ahead = facts.case.signals.speed[0, frames] - closing
    in_time = ahead + gap / constant("law.entry.ttc")
    allowed = np.minimum(max_following_speed(gap, ahead, _decel(facts, frames)), in_time)
    farther = more_gap(facts, neighbour, facts.first_frame, facts.margin)
    return *farther, *facts.remedy_slower_ego(frames, np.where(gap < 0, NO_SPEED, allowed))


def room_behind(facts: BreachContext) -> tuple[Remedy, ...]:
    """L5: more distance to the one behind on the left, or faster where the limit allows it."""
    neighbour, frames = NeighbourRole.LEFT_FOLLOWER, np.array([facts.first_frame])
    farther = more_gap(facts, neighbour, facts.first_frame, facts.margin)
    gap, closing = gap_and_closing_speed(facts, neighbour, frames)
    rear = facts.case.signals.speed[0, frames] + closing
    slowest = min_speed_before_follower(np.maximum(gap, 0), rear, _decel(facts, frames))[0]
    if gap[0] < 0 or slowest > speed_limits(facts.case)[1][0, facts.first_frame]:
        return farther
    return *farther, *facts.remedy_ego_speed(facts.first_frame, slowest)


def oncoming(facts: BreachContext) -> tuple[Remedy, ...]:
    """L24: more distance to the oncoming vehicle when the ego is back in its lane."""
    others = other_vehicles_at(facts.case.trajectories, back_frame(facts.case))
    slot = int(margins_at_return(facts.case, others)[0].argmin())
    gap = float(others.gap[0, slot])
    return single_change(
        RemedyQuantity.GAP_ONCOMING, gap, gap - facts.margin, facts.first_frame, slot
    )


def time_to_pass(facts: BreachContext) -> tuple[Remedy, ...]:
    """L25: more distance to the oncoming vehicle at the pull-out."""
    begin = opposing_lane_span(facts.case).first
    others = other_vehicles_at(facts.case.trajectories, begin)
    lacking = np.abs(oncoming_margins(facts.case, others)[0] - facts.margin)
    slot = int(np.where(others.is_approaching[0], lacking, np.inf).argmin())
    gap = float(others.gap[0, slot])
    return single_change(
        RemedyQuantity.GAP_ONCOMING, gap, gap - facts.margin, facts.first_frame, slot
    )


def to_return(facts: BreachContext) -> tuple[Remedy, ...]:
    """L27: more distance between the two vehicles between which the ego would return."""
    gap = float(return_gap(facts.case)[1][0])
    return single_change(RemedyQuantity.GAP_TO_RETURN, gap, gap - facts.margin, facts.first_frame)


def _decel(facts: BreachContext, frames: IndexArray) -> F32:
    return decel_for_safe_distance(facts.case.signals.friction[0, frames])
