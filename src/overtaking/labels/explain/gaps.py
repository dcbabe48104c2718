"""Remedies of rules about distances along the road: L24, L25, L27."""

import numpy as np

from overtaking.labels.law.case import opposing_lane_span
from overtaking.labels.law.oncoming_traffic import (
    back_frame,
    margins_at_return,
    oncoming_margins,
    return_gap,
)
from overtaking.labels.law.remedies import (
    BreachContext,
    Remedy,
    RemedyQuantity,
    single_change,
)
from overtaking.labels.snapshots import other_vehicles_at


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
