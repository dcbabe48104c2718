"""Conditions, rules, and sets of rules."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from overtaking.analysis.learning.attributes import Attribute
from overtaking.analysis.learning.cuts import supervised_cuts
from overtaking.analysis.learning.examples import Examples
from overtaking.analysis.learning.wording import condition_text, rounded
from overtaking.core.arrays import Mask
from overtaking.core.equality import ContentEquality

_LEAST_SHARE = 0.002
"""Least share of examples that must meet a condition, and that must fail it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition(ContentEquality):
    """A numeric attribute on one side of a border, or a nominal one with or without a level.

    Attributes:
        attribute: The attribute.
        value: The border [SI], or the number of the level.
        is_least: Whether the value is at least the border, or is the level; else it is not.
    """

    attribute: Attribute
    value: float
    is_least: bool

    @property
    def text(self) -> str:
        """The condition in words."""
        return condition_text(self.attribute, self.value, is_least=self.is_least)

    def values(self) -> dict[str, Any]:
        """The condition for JSON; borders in SI."""
        attribute = self.attribute
        if attribute.is_nominal:
            sign, value = "is" if self.is_least else "is not", attribute.levels[int(self.value)]
        else:
            sign, value = ">=" if self.is_least else "<", self.value
        name = attribute.name
        return {"attribute": name, "operator": sign, "value": value, "text": self.text}

    def holds(self, examples: Examples) -> Mask:
        """Whether it holds in each example, shape (example,)."""
        values = examples.column(self.attribute.name)
        is_so = values == self.value if self.attribute.is_nominal else values >= self.value
        return is_so if self.is_least else ~is_so


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule(ContentEquality):
    """A conjunction of conditions.

    Attributes:
        conditions: At least one.
    """

    conditions: tuple[Condition, ...]

    @property
    def text(self) -> str:
        """The rule in words."""
        return " and ".join(one.text for one in self.conditions)

    def holds(self, examples: Examples) -> Mask:
        """Whether all of them hold in each example, shape (example,)."""
        return np.logical_and.reduce([one.holds(examples) for one in self.conditions])


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleSet:
    """A disjunction of rules.

    Attributes:
        rules: The rules, the weightiest first.
        is_negated: Whether they predict that the target is false, instead of true.
    """

    rules: tuple[Rule, ...]
    is_negated: bool

    def says(self, examples: Examples) -> Mask:
        """Whether the target is predicted in each example, shape (example,)."""
        found = np.zeros(len(examples), np.bool_)
        for one in self.rules:
            found |= one.holds(examples)
        return ~found if self.is_negated else found


def conditions_of(examples: Examples, positive: Mask) -> list[Condition]:
    """Every candidate: both sides of each supervised cut, and each level.

    Args:
        examples: The examples to learn from.
        positive: Whether the target is true, shape (example,).

    Returns:
        Conditions on plain attributes, in the order of the attributes; cuts are rounded as they
        are worded.
    """
    return [
        condition
        for attribute in examples.attributes
        if attribute.is_plain
        for condition in _of_attribute(attribute, examples, positive)
    ]


def _of_attribute(attribute: Attribute, examples: Examples, positive: Mask) -> list[Condition]:
    values = examples.column(attribute.name)
    if attribute.is_nominal:
        borders = [float(level) for level in np.unique(values)]
        sides = (True,)  # "Not a van" is not a readable condition.
    else:
        cuts = supervised_cuts(values, positive)
        borders = sorted({rounded(one, attribute.scale.unit) for one in cuts.tolist()})
        sides = (True, False)
    made = [
        Condition(attribute=attribute, value=border, is_least=is_least)
        for border in borders
        for is_least in sides
    ]
    return [one for one in made if _divides(one.holds(examples))]


def _divides(holds: Mask) -> bool:
    """Whether there are enough examples on either side."""
    return _LEAST_SHARE <= float(holds.mean()) <= 1.0 - _LEAST_SHARE if len(holds) else False
