"""What stands above facts: each predicate with the types, units and ranges of its arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.analysis.logic.facts import BY_NAME, Demand
from overtaking.analysis.logic.vocabulary import INT_BITS, Predicate, Type

if TYPE_CHECKING:
    from collections.abc import Sequence

LANGUAGES = {"asp": ".lp", "prolog": ".pl"}
"""The languages of facts, and the endings of their files."""


def header(title: str, demand: Demand, language: str) -> str:
    """The beginning of a file of facts.

    Args:
        title: One line on where the facts come from.
        demand: Which facts follow.
        language: One of `LANGUAGES`.
    """
    predicates = [one for name, one in BY_NAME.items() if name in demand]
    lines = [f"% {title}", "%", "% Every argument is an integer or a constant:", "%"]
    lines += [_type_line(kind) for kind in _types(predicates)]
    lines += ["%", f"% Sums and products are meant for integers of {INT_BITS} bits.", ""]
    for one in predicates:
        types = ", ".join(kind.name for _, kind in one.arguments)
        lines += [f"% {one.head}: {one.about}", f"%: {one.name}({types})"]
        lines += _declared(one, language)
    return "\n".join(lines) + "\n\n"


def _types(predicates: Sequence[Predicate]) -> list[Type]:
    """The types of some predicates, each once, in the order in which they occur."""
    kinds = {kind.name: kind for one in predicates for _, kind in one.arguments}
    return list(kinds.values())


def _type_line(kind: Type) -> str:
    values = " ".join(kind.names) if kind.names else f"{kind.low}..{kind.high}"
    return f"%     {kind.name:<10} {kind.about}: {values}"


def _declared(predicate: Predicate, language: str) -> list[str]:
    """So that a predicate without facts is empty, and is no mistake."""
    name, arity = predicate.signature
    if language == "asp":
        return [f"#defined {name}/{arity}."]
    return [f":- {how}({name}/{arity})." for how in ("multifile", "dynamic", "discontiguous")]
