"""Remedies of the Portuguese rules without a criterion."""

from collections.abc import Callable, Mapping

from overtaking.labels.law.remedies import BreachContext, Remedy
from overtaking.labels.law.rule import Rule
from overtaking.model.verdicts import Case, Finding

Find = Callable[[BreachContext], tuple[Remedy, ...]]
"""A function that finds the remedies for a breach."""


REMEDIES: dict[Callable[[Case], Finding], Find] = {}
"""Remedies by the check of a rule. Rules with a criterion state theirs there."""


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
