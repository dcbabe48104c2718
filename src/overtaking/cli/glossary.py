"""`overtaking glossary`: what the words of tables, reports and pages mean."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from overtaking.cli.output import Output
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from rich.console import Group

Word = Annotated[
    str | None, typer.Argument(metavar="[WORD]", help="Term to explain.  [default: all]")
]


def glossary(output: Output, word: Word = None) -> None:
    """Explain classes, features, policies and other terms."""
    values = values_of(word)
    output.result(values, lambda _: render(values))


def values_of(word: str | None) -> dict[str, Any]:
    """The terms, or those of one name.

    Raises:
        ConfigError: There is no such word.
    """
    from overtaking.knowledge.glossary import TERM_GROUPS, terms

    found = [
        {
            "group": title,
            "name": name,
            "title": term.title or None,
            "unit": term.display_unit or None,
            "meaning": term.meaning,
        }
        for group, title in TERM_GROUPS.items()
        for name, term in terms(group).items()
        if word is None or word.lower() in (name.lower(), *name.lower().split(", "))
    ]
    if not found:
        from overtaking.scenarios.specification_values import suggestion

        names = [name for group in TERM_GROUPS for name in terms(group)]
        raise ConfigError(
            what="word",
            where="glossary",
            expected="a word of the glossary",
            got=repr(word),
            next_step=suggestion(str(word), names),
        )
    return {"terms": found}


def render(values: dict[str, Any]) -> "Group":
    """The terms, group by group."""
    from itertools import groupby

    from rich.console import Group, RenderableType
    from rich.text import Text

    from overtaking.cli.tables import open_table

    parts: list[RenderableType] = []
    for title, terms in groupby(values["terms"], key=lambda term: term["group"]):
        table = open_table("", "")
        for term in terms:
            words = ", ".join(filter(None, (term["title"], term["unit"])))
            meaning = f"{term['meaning'].rstrip('.')}."
            table.add_row(term["name"], f"({words}) {meaning}" if words else meaning)
        parts += [*([Text()] if parts else []), Text(title, style="bold"), table]
    return Group(*parts)
