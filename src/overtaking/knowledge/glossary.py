"""The words for classes, policies, features and vehicle classes, each declared once."""

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
    """What a word means.

    Attributes:
        meaning: One sentence.
        defined_in: Where the code defines it, below the root of the package.
        title: The name in a few words, empty where the name is one.
        display_unit: Unit in which tables show it, empty without one.
        avoid: What not to call it.
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
        group: One of `GROUPS`.

    Raises:
        KnowledgeError: An entry lacks a word, or has one too many.
        KeyError: There is no such group.
    """
    return read_records(Term, "glossary.toml", group)
