"""The words of the package: classes, policies, features, vehicle classes and other terms."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from overtaking.knowledge.toml_reader import read_records

TERM_GROUPS = {
    "classes": "Classes",
    "policies": "Policies",
    "readings": "Readings of the features",
    "features": "Features",
    "vehicles": "Vehicle classes",
    "road": "On the road",
    "manoeuvre": "The manoeuvre",
    "world": "The world",
    "law": "The law",
    "data": "Data and numbers",
}
"""The groups of terms, each with its heading."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A word and its meaning.

    Attributes:
        meaning: One sentence.
        defined_in: Module and name that define it, below the root of the package.
        title: The name in a few words; empty if the name is a word of its own.
        display_unit: Unit in which tables show it; empty for a pure number or a text.
        avoid: Words that must not be used for it.
    """

    meaning: str
    defined_in: str
    title: str = ""
    display_unit: str = ""
    avoid: str = ""


@cache
def terms(group: str) -> Mapping[str, Term]:
    """The terms of a group by name, in the order in which tables show them.

    Args:
        group: One of `TERM_GROUPS`.

    Raises:
        KnowledgeError: A term lacks a key or has an unknown one.
        KeyError: There is no such group.
    """
    return read_records(Term, "glossary.toml", group)
