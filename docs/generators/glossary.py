"""The glossary, from the declared terms."""

from __future__ import annotations

from generators.markdown import page, section, table, unit

from overtaking.knowledge.glossary import TERM_GROUPS, Term, terms

INTRODUCTION = """\
Every word that tables, reports, `overtaking show` and these pages use in a sense of its own. The
second column is where the package defines it. `overtaking glossary` prints the same in a terminal,
`overtaking glossary margin` a single word.
"""
NOTES = {
    "classes": "The study's five classes come first. Which rules count is the choice of a policy.",
    "policies": "Each of the first three includes the rules of the one above it. The "
    "[rules](rules.md#portugal) say which rule belongs to which policy.",
    "readings": "The two ways to [measure features](../explanation/events.md"
    "#two-ways-to-measure-features).",
    "features": "The study's fifteen features of a simulation, the seven static ones first.",
    "vehicles": "The study's codes; their bodies are in [vehicle classes](vehicles.md).",
}


def content() -> str:
    """The page `reference/glossary.md`."""
    return page("Glossary", INTRODUCTION, *map(_section, TERM_GROUPS))


def _section(group: str) -> str:
    of_group = terms(group)
    columns = [name for name in ("title", "display_unit", "meaning", "avoid") if _has(group, name)]
    heads = {"title": "in words", "display_unit": "unit", "meaning": "meaning", "avoid": "not"}
    header = ("name", "in the code", *(heads[name] for name in columns))
    rows = [
        (_name(name, group), f"`{term.defined_in}`", *(_cell(term, column) for column in columns))
        for name, term in of_group.items()
    ]
    return section(
        TERM_GROUPS[group], *([NOTES[group]] if group in NOTES else []), table(header, rows)
    )


def _has(group: str, column: str) -> bool:
    return any(getattr(term, column) for term in terms(group).values())


def _name(name: str, group: str) -> str:
    """A word; what data sets hold is set as code."""
    is_code = group in ("classes", "policies", "readings", "features", "vehicles")
    return f"`{name}`" if is_code or name in ("s", "d", "lane_id") else name


def _cell(term: Term, column: str) -> str:
    value = getattr(term, column)
    return unit(value) if column == "display_unit" else value
