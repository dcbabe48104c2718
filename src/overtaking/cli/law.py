"""The law of one simulation on a terminal: classes, broken rules, and what would have kept them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from overtaking.knowledge.glossary import terms
from overtaking.show.wording import breach_words, doubt_words

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import RenderableType

    from overtaking.cli.drawing import Glyphs
    from overtaking.show.judgement import Values

_CODE_WIDTH = 5


def law_lines(values: Values, width: int, glyphs: Glyphs) -> Iterator[RenderableType]:
    """Everything about the law.

    Args:
        values: What `describe` says of the simulation.
        width: Columns to fill.
        glyphs: The characters to draw with.
    """
    yield Text(
        f"The law ({values['rules_version']}, an interpretation, no legal advice)", style="bold"
    )
    yield _policies(values, width)
    if values["broken"]:
        yield Text()
        yield Text("Broken, and what would have been legal", style="bold")
    for one in values["broken"]:
        yield _breach(one, values, width, glyphs)
    yield Text()
    yield _rest(values, width)


def _grid(width: int, first: int) -> Table:
    """Two columns, the first of fixed width, the second with its lines broken."""
    grid = Table.grid(padding=(0, 1, 0, 0))
    grid.width = width
    grid.add_column(min_width=first, max_width=first)
    grid.add_column(ratio=1)
    return grid


def _policies(values: Values, width: int) -> Table:
    """Each policy: the class, the rules that made it so, and which rules it requires."""
    grid = _grid(width, max(len(name) for name in values["policies"]))
    for name, one in values["policies"].items():
        facts = [one["class"]]
        reasons = (what for what in ("broken", "undecidable") if one[what])
        facts += [f"{what} {', '.join(one[what])}" for what in reasons]
        words = Text("; ".join(facts))
        grid.add_row(name, words.append(f"\n{terms('policies')[name].meaning}", style="dim"))
    return grid


def _breach(one: Values, values: Values, width: int, glyphs: Glyphs) -> Table:
    """One broken rule: which, how severe, when, by how much, and the remedies."""
    told = breach_words(one, values, glyphs.dash)
    body = Text()
    body.append(f"{told.rule}: ", style="bold")
    body.append(f"{told.grade}\n{told.facts}")
    for index, remedy in enumerate(told.remedies):
        body.append(f"\n{'or' if index else 'needs'} {remedy}")
    grid = _grid(width, _CODE_WIDTH)
    grid.add_row(Text(one["rule"], style="bold"), body)
    return grid


def _rest(values: Values, width: int) -> Table:
    """The rules that cannot be decided, those that are kept, and those that do not apply."""
    grid = _grid(width, len("Do not apply"))
    if not values["broken"]:
        grid.add_row("Broken", "nothing")
    for index, one in enumerate(values["undecidable"]):
        grid.add_row("" if index else "Undecidable", doubt_words(one))
    for title, key in (
        ("Kept", "kept"),
        ("Do not apply", "not_applicable"),
        ("Text unread", "text_not_read"),
    ):
        if values[key]:
            grid.add_row(title, ", ".join(values[key]))
    return grid
