"""A pack of rules, and what it says of a batch."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from overtaking.labels.law.rule import Check, Rule, judge
from overtaking.model.labels import Case, Findings


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """The rules of one jurisdiction; another one is another list.

    Attributes:
        name: Short name.
        version: Changes whenever a verdict may.
        rules: The rules, in the order of every table.
    """

    name: str
    version: str
    rules: tuple[Rule, ...]

    @property
    def codes(self) -> tuple[str, ...]:
        """The codes of the rules, in order."""
        return tuple(rule.code for rule in self.rules)


def check(pack: Pack, case: Case) -> Findings:
    """What each rule of a pack says of each simulation.

    Args:
        pack: The rules.
        case: Recordings of any source, with their signals and events.

    Returns:
        Arrays of shape (simulation, rule).
    """
    found = [judge(rule, case) for rule in pack.rules]
    columns = {
        field.name: np.stack([getattr(one, field.name) for one in found], axis=1)
        for field in dataclasses.fields(Check)
    }
    return Findings(rules=pack.codes, version=pack.version, **columns)
