"""Remedies of the German rules with checks of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.knowledge.toml_reader import constant
from overtaking.labels.explain.remedies import (
    at_limit,
    see_oncoming_traffic,
)
from overtaking.labels.law.germany.driving import V2, V3, limits
from overtaking.labels.law.germany.opposite import O16

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.labels.explain.remedies import Find
    from overtaking.labels.law.remedies import BreachContext, Remedy
    from overtaking.model.verdicts import Case, Finding


def _at_limit(facts: BreachContext) -> tuple[Remedy, ...]:
    """V2: no faster than the limit."""
    return at_limit(facts, limits(facts.case)[1])


def _slower(facts: BreachContext) -> tuple[Remedy, ...]:
    """V3: slower, down to the speed allowed in fog."""
    fastest = facts.frames[int(facts.case.signals.speed[0, facts.frames].argmax())]
    return facts.remedy_ego_speed(fastest, constant("law_de.fog.speed"))


GERMAN: dict[Callable[[Case], Finding], Find] = {
    rule.check: find
    for rule, find in (
        (O16, see_oncoming_traffic),
        (V2, _at_limit),
        (V3, _slower),
    )
}
"""Remedies by the check of a rule. German rules that are not listed share the check of a Portuguese
rule, and with it the remedy in `REMEDIES`."""
