"""Conditions in the words of a driver."""

import math

from overtaking.analysis.learning.attributes import UNITS, Attribute
from overtaking.knowledge.glossary import terms

_TYPES = {name: f"a {term.title}" for name, term in terms("vehicles").items()}


def rounded(value: float, unit: str) -> float:
    """A value rounded as it is worded [SI]: the border in the text is the one that is tested."""
    scale, step = UNITS[unit]
    if unit == "n":  # Between 0 and 1 means from 1 on.
        return math.ceil(value)
    return round(value * scale / step) * step / scale


def condition_text(attribute: Attribute, value: float, *, is_least: bool) -> str:
    """A condition in words.

    Args:
        attribute: The attribute.
        value: A border [SI], or the number of a level of a nominal attribute.
        is_least: Whether the quantity is at least the border, or has the level; else it is below
            it, or has another level.
    """
    if attribute.is_nominal:
        return _nominal_text(attribute, attribute.levels[int(value)], is_so=is_least)
    unit = attribute.scale.unit
    told = abs(value) * UNITS[unit][0]
    number = f"{told:.3g} {unit.removeprefix('n')}".strip()
    if attribute.above:
        text = _difference_text(attribute, value, number, is_least=is_least)
    else:
        sign = "−" if value < 0.0 and told >= 0.005 else ""
        word = "at least" if is_least else "below"
        text = f"{attribute.words} {word} {sign}{number}"
    is_met_by_absence = bool(attribute.needs) and (attribute.scale.absent >= value) == is_least
    return f"{text}{_or_nobody(attribute)}" if is_met_by_absence else text


def _difference_text(attribute: Attribute, value: float, number: str, *, is_least: bool) -> str:
    words, above, below = attribute.words, attribute.above, attribute.below
    if float(number.split()[0]) == 0.0:
        return f"{words} {above if is_least else below}"
    by = {
        (True, True): f"{above} by at least {number}",
        (True, False): f"{above} by less than {number}, or {below}",
        (False, True): f"{below} by at most {number}, or {above}",
        (False, False): f"{below} by more than {number}",
    }
    return f"{words} {by[value > 0.0, is_least]}"


def _nominal_text(attribute: Attribute, level: str, *, is_so: bool) -> str:
    if len(attribute.levels) == 2:
        return attribute.levels[attribute.levels.index(level) ^ (not is_so)]
    named = _TYPES.get(level, level)
    return f"{attribute.words} is {'' if is_so else 'not '}{named}"


def _or_nobody(attribute: Attribute) -> str:
    """The words for a condition that also holds without a vehicle."""
    if attribute.needs.startswith("nobody"):
        return f" (or {attribute.needs})"
    return "" if attribute.needs == "ahead" else " (or nobody is there)"
