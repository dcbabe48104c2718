"""The glossary: names that users see, such as classes and features, and their meanings.

The texts are in `data/glossary.toml`. Tables, statistics, reports, the command
`overtaking glossary` and the page docs/reference/glossary.md read them from here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from overtaking.knowledge.toml_reader import read_records

TERM_GROUPS = {
    "classes": "Classes",  # Results of an overtake, such as `Success_L`: completed and legal.
    "policies": "Policies",  # Sets of traffic rules that a legal overtake must keep.
    # Two definitions of the features of the reproduced paper (profile `pinto2023`). Without an
    # attempt to overtake, `paper` takes means over all frames, `matched` values at one instant.
    "readings": "Readings of the features",
    "features": "Features",
    "vehicles": "Vehicle classes",
    "road": "On the road",
    "manoeuvre": "The manoeuvre",
    "world": "The world",  # Weather, light and sight.
    "law": "The law",
    "data": "Data and numbers",
}
"""Groups of terms, which are the top tables of the file, each with its heading."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A term of the glossary; its name is the key in `terms`.

    Attributes:
        meaning: The meaning in one sentence.
        defined_in: Module and name that define it, without `overtaking.`, such as
            "model.verdicts.OvertakeClass".
        title: A readable form of a coded name, such as "completed, legal" for `Success_L`; empty
            for a name that is a plain word.
        display_unit: Unit in which tables show the value; empty for pure numbers and texts.
        avoid: Words that code and texts must not use for this term, separated by commas.
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
        group: A key of `TERM_GROUPS`.

    Returns:
        A read-only mapping, cached and shared by all callers.

    Raises:
        KnowledgeError: A key of a term in the file is missing or unknown.
        KeyError: There is no such group.
    """
    return read_records(Term, "glossary.toml", group)
