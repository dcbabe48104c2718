"""What decides an overtake, learned from a data set."""

import shutil
from typing import TYPE_CHECKING, Annotated

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import Group, RenderableType

    from overtaking.learning.rules import RulesFound
    from overtaking.stats.table import Table

About = Annotated[
    str,
    typer.Option(
        "--about",
        metavar="NAME",
        help="legal, collision, or start (do not start now).",
    ),
]
Policy = Annotated[
    str,
    typer.Option("--policy", metavar="NAME", help="Which rules decide: paper, default or strict."),
]
Seed = Annotated[int, typer.Option("--seed", min=0, metavar="N", help="Of the split.")]
MaxRules = Annotated[int, typer.Option("--max-rules", metavar="N", help="How many rules at most.")]
MaxConditions = Annotated[
    int, typer.Option("--max-conditions", metavar="N", help="How many conditions a rule may have.")
]


def rules(
    output: Output,
    data: options.Data,
    about: About = "legal",
    policy: Policy = "paper",
    seed: Seed = 1,
    max_rules: MaxRules = 8,
    max_conditions: MaxConditions = 3,
) -> None:
    """Learn a few rules that a driver would recognise, from what is known when it begins."""
    from overtaking import api

    with output.progress("rounds") as meter:
        found = api.learn_rules(
            data,
            about,
            policy=policy,
            seed=seed,
            max_rules=max_rules,
            max_conditions=max_conditions,
            progress=meter,
        )
    output.result(found.values(), lambda _: _drawn_rules(found))


def _drawn_rules(found: "RulesFound") -> "Group":
    """The rules, then how they compare, then what to look at."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.learning.tables_of_rules import comparison_table, rule_table

    lines = [
        f"learned from {found.num_learned_from:,} simulations; "
        f"on all {found.everywhere.num:,} the rules are right in "
        f"{100.0 * found.everywhere.accuracy:.1f} %",
    ]
    if found.num_missed:
        numbers = ", ".join(str(one) for one in found.missed)
        lines.append(f"no rule holds, and one should, in {found.num_missed:,}: {numbers}, …")
    if not found.rules:
        lines.append("no rule is worth its words")
    return Group(drawn(rule_table(found)), drawn(comparison_table(found)), Text("\n".join(lines)))


def drawn(table: "Table") -> "RenderableType":
    """A table for a terminal; long texts are broken inside their column."""
    from rich import box
    from rich.table import Table as Drawn
    from rich.text import Text

    made = Drawn(title=table.title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    wide = shutil.get_terminal_size().columns
    for number, name in enumerate(table.header):
        made.add_column(
            name,
            justify="left" if number < table.num_texts else "right",
            no_wrap=number >= table.num_texts,
            max_width=max(wide // 2, 30) if number < table.num_texts else None,
        )
    for row in table.cells():
        made.add_row(*(Text(cell) for cell in row))
    return made


COMMANDS: dict[options.Body, str] = {
    rules: "overtaking learn rules data/pinto --about start",
}
