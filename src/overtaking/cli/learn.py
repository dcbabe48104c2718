"""Rules and factors of overtaking decisions, learned from a data set."""

import shutil
from typing import TYPE_CHECKING, Annotated

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import Group, RenderableType

    from overtaking.analysis.learning.factors import FactorsFound
    from overtaking.analysis.learning.rules import RulesFound
    from overtaking.analysis.stats.table import Table

About = Annotated[
    str,
    typer.Option(
        "--about",
        metavar="NAME",
        help=f"{options.TARGET} legal, collision, or start (do not start now).",
    ),
]
AboutFactors = Annotated[
    str,
    typer.Option(
        "--about",
        metavar="NAME",
        help=f"{options.TARGET} outcome (the class), legal, collision, or start.",
    ),
]
Features = Annotated[
    str | None,
    typer.Option(
        "--features",
        metavar="NAME,NAME",
        help="Factors or attributes to use, separated by commas.  [default: all factors]",
    ),
]
Repeats = Annotated[
    int,
    typer.Option(
        "--repeats", metavar="N", help="How many times to rank, to measure the stability."
    ),
]
ShowLeakage = Annotated[
    bool,
    typer.Option(
        "--show-leakage",
        help="Show how features that are known only afterwards inflate the accuracy.",
    ),
]
Seed = Annotated[
    int, typer.Option("--seed", min=0, metavar="N", help=f"{options.SEED} They split and repeat.")
]
MaxRules = Annotated[int, typer.Option("--max-rules", metavar="N", help="Rules at most.")]
MaxConditions = Annotated[
    int, typer.Option("--max-conditions", metavar="N", help="Conditions per rule at most.")
]


def rules(
    output: Output,
    data: options.Data,
    about: About = "legal",
    policy: options.Policy = "paper",
    seed: Seed = 1,
    max_rules: MaxRules = 12,
    max_conditions: MaxConditions = 3,
) -> None:
    """Learn a few short rules from what is known at the start.

    Each attribute is known when the overtake starts, or could have started.
    """
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


def factors(
    output: Output,
    data: options.Data,
    about: AboutFactors = "outcome",
    features: Features = None,
    policy: options.Policy = "paper",
    seed: Seed = 1,
    repeats: Repeats = 1,
    show_leakage: ShowLeakage = False,
) -> None:
    """Rank the factors that decide, with calibrated models."""
    from overtaking import api

    with output.progress("models") as meter:
        found = api.learn_factors(
            data,
            about,
            features=[one.strip() for one in (features or "").split(",") if one.strip()],
            policy=policy,
            seed=seed,
            repeats=repeats,
            show_leakage=show_leakage,
            progress=meter,
        )
    output.result(found.values(), lambda _: _drawn_factors(found))


def _drawn_factors(found: "FactorsFound") -> "Group":
    """Models, confusion, the factors in order, and leaks."""
    from rich.console import Group

    from overtaking.analysis.learning import tables

    shown = [tables.model_table, tables.confusion_table, tables.ranking_table]
    shown += [tables.leakage_table] if found.leakage else []
    return Group(*(drawn(table(found)) for table in shown))


def _drawn_rules(found: "RulesFound") -> "Group":
    """The rules, then how they compare, then what to look at."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.analysis.learning.tables import comparison_table, rule_table

    lines = [
        f"learned from {found.num_learned_from:,} simulations; accuracy on all "
        f"{found.everywhere.num:,}: {100.0 * found.everywhere.accuracy:.1f} %"
    ]
    if found.num_missed:
        numbers = ", ".join(str(one) for one in found.missed)
        lines.append(f"{found.num_missed:,} false negatives: {numbers}, …")
    if not found.rules:
        lines.append("no rule was found")
    return Group(drawn(rule_table(found)), drawn(comparison_table(found)), Text("\n".join(lines)))


def drawn(table: "Table") -> "RenderableType":
    """A table for a terminal; long texts are wrapped inside their column."""
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
    factors: "overtaking learn factors data/pinto --repeats 3 --show-leakage",
}
