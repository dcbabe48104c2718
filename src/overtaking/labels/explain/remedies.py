"""Remedies of the Portuguese rules without a criterion."""

from collections.abc import Callable, Mapping

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.margins import SAME_MARGIN_M
from overtaking.labels.law.numbers import STOPPING_REACTION_TIME
from overtaking.labels.law.remedies import (
    BreachContext,
    Remedy,
    RemedyQuantity,
    single_change,
)
from overtaking.labels.law.rule import Rule
from overtaking.labels.law.safe_distance import decel_with_all_grip
from overtaking.labels.law.sight import (
    L14,
    L15,
    L14s,
    L15s,
    passing_sight_margin,
    required_passing_sight,
)
from overtaking.model.verdicts import Case, Finding
from overtaking.world.road_surface import stoppable_speed

Find = Callable[[BreachContext], tuple[Remedy, ...]]
"""A function that finds the remedies for a breach."""


def _stop(facts: BreachContext, sight: F32) -> tuple[Remedy, ...]:
    """L14 and L14s: at the speed from which one stops where something is seen.

    The friction is that at the actual speed; a slower vehicle has no less.
    """
    frames = facts.frames
    decel = decel_with_all_grip(facts.case.signals.friction[0, frames])
    reaction = as_f32(STOPPING_REACTION_TIME.f32)
    return facts.remedy_slower_ego(frames, stoppable_speed(sight[0, frames], reaction, decel))


def see_farther(facts: BreachContext) -> tuple[Remedy, ...]:
    """L15 and L15s: more sight; a driver can only wait for it."""
    if facts.case.trajectories.road.is_two_way:
        clear = float(passing_sight_margin(facts.case)[0])
        if abs(clear - facts.margin) < SAME_MARGIN_M:
            return see_oncoming_traffic(facts)
    return _more_sight(facts, constant("law.sight.least"))


def see_oncoming_traffic(facts: BreachContext) -> tuple[Remedy, ...]:
    """O16: sight over the whole length of road that the overtake needs."""
    return _more_sight(facts, required_passing_sight(facts.case)[0])


def _more_sight(facts: BreachContext, needed: np.float32) -> tuple[Remedy, ...]:
    return single_change(
        RemedyQuantity.SIGHT, float(needed) + facts.margin, needed, facts.first_frame
    )


REMEDIES: dict[Callable[[Case], Finding], Find] = {
    rule.check: find
    for rule, find in (
        (L14, lambda facts: _stop(facts, facts.case.signals.sight_lit)),
        (L14s, lambda facts: _stop(facts, facts.case.signals.sight_unlit)),
        (L15, see_farther),
        (L15s, see_farther),
    )
}
"""Remedies by the check of a rule. A remedy reads the same numbers as the check, so rules of other
laws with the same check have the same remedy."""


def remedies_of(
    rule: Rule,
    facts: BreachContext,
    remedies: Mapping[Callable[[Case], Finding], Find] = REMEDIES,
) -> tuple[Remedy, ...]:
    """Find the changes that would have kept a broken rule, all else unchanged.

    Args:
        rule: The broken rule.
        facts: The breach.
        remedies: Functions that find remedies, by the check of the rule, for rules without a
            criterion.

    Returns:
        Alternative remedies; the first is the one whose size is the margin. Empty for a check
        without a remedy.
    """
    if rule.criterion is not None:
        return rule.criterion.remedies(facts)
    find = remedies.get(rule.check)
    return () if find is None else find(facts)
