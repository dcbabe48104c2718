"""Two courses of one simulation held against each other, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.show.wording import margin_words, outcome_words, symbol

if TYPE_CHECKING:
    from overtaking.show.judgement import Values


def contrast(before: Values, after: Values) -> list[str]:
    """What a change has changed: outcome, classes, collisions and law.

    Args:
        before: What `describe` says of the simulation.
        after: The same of its branch.

    Returns:
        Sentences; the first is of the outcome.
    """
    parts = _classes(before, after), _collision(before, after), _law(before, after)
    return [_outcome(before, after), *(text for part in parts for text in part)]


def _outcome(before: Values, after: Values) -> str:
    old, new = outcome_words(before), outcome_words(after)
    return f"Outcome as before: {new}." if old == new else f"Outcome: {new}, instead of {old}."


def _classes(before: Values, after: Values) -> list[str]:
    """The classes that differ, policies with the same change together."""
    changes: dict[tuple[str, str], list[str]] = {}
    for policy, one in after["policies"].items():
        pair = before["policies"][policy]["class"], one["class"]
        changes.setdefault(pair, []).append(policy)
    every = len(after["policies"])
    said: list[str] = []
    for (old, new), policies in changes.items():
        whose = "every policy" if len(policies) == every else " and ".join(policies)
        was = "as before" if old == new else f"instead of {old}"
        said.append(f"Class {new} under {whose}, {was}.")
    return said


def _collision(before: Values, after: Values) -> list[str]:
    """Collisions of the ego that come or go."""
    old, new = before["collision_partner"], after["collision_partner"]
    if old == new:
        return []
    if new is None:
        return [f"The ego no longer collides with {symbol(old)}."]
    return [f"The ego collides with {symbol(new)}."]


def _law(before: Values, after: Values) -> list[str]:
    """Rules that are now broken, no longer broken, or by another margin."""
    old = {one["rule"]: one for one in before["broken"]}
    new = {one["rule"]: one for one in after["broken"]}
    said = [f"Now broken: {_rule(one)}." for code, one in new.items() if code not in old]
    said += [f"No longer broken: {_name(one)}." for code, one in old.items() if code not in new]
    both = [(old[code], one) for code, one in new.items() if code in old]
    said += [
        f"Still broken: {_rule(after)}"
        + ("." if before["margin"] == after["margin"] else f" instead of {_margin(before)}.")
        for before, after in both
    ]
    return said or ["No rule is broken in either."]


def _name(one: Values) -> str:
    return f"{one['rule']} {one['title']}"


def _rule(one: Values) -> str:
    return f"{_name(one)}, margin {_margin(one)}"


def _margin(one: Values) -> str:
    return margin_words(one["margin"], one["unit"])
