"""Rules and factors of overtaking decisions, learned from a data set."""

from typing import TYPE_CHECKING, Annotated

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import Group

    from overtaking.analysis.learning.factors import FactorsFound
    from overtaking.analysis.learning.rules import RulesFound

About = Annotated[
    str,
    options.option(
        "--about NAME", f"{options.TARGET} legal, collision, or start (do not start now)."
    ),
]
AboutFactors = Annotated[
    str,
    options.option(
        "--about NAME", f"{options.TARGET} outcome (the class), legal, collision, or start."
    ),
]
Features = Annotated[
    str | None,
    options.option(
        "--features NAME,NAME",
        "Factors or attributes to use, separated by commas.  [default: all factors]",
    ),
]
Repeats = Annotated[
    int, options.option("--repeats N", "How many times to rank, to measure the stability.")
]
ShowLeakage = Annotated[
    bool,
    options.option(
        "--show-leakage", "Show how features that are known only afterwards inflate the accuracy."
    ),
]
Seed = Annotated[int, options.option("--seed N", f"{options.SEED} They split and repeat.", min=0)]
MaxRules = Annotated[int, options.option("--max-rules N", "Rules at most.")]
MaxConditions = Annotated[int, options.option("--max-conditions N", "Conditions per rule at most.")]


def rules(
    output: Output,
    data: options.Data,
    about: About = "legal",
    policy: options.Policy = None,
    seed: Seed = 1,
    max_rules: MaxRules = 12,
    max_conditions: MaxConditions = 3,
) -> None:
    """Learn a few short rules from the state at the start.

    Each attribute is known when the overtake starts, or could have started.
    """
    from overtaking.api import learning

    with output.progress("rounds") as meter:
        found = learning.learn_rules(
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
    policy: options.Policy = None,
    seed: Seed = 1,
    repeats: Repeats = 1,
    show_leakage: ShowLeakage = False,
) -> None:
    """Rank the factors that decide, with calibrated models."""
    from overtaking.api import learning

    with output.progress("models") as meter:
        found = learning.learn_factors(
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
    from overtaking.cli.tables import result_table

    shown = [tables.model_table, tables.confusion_table, tables.ranking_table]
    shown += [tables.leakage_table] if found.leakage else []
    return Group(*(part for table in shown for part in result_table(table(found))))


def _drawn_rules(found: "RulesFound") -> "Group":
    """The rules, then how they compare, then what to look at."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.analysis.learning.tables import comparison_table, rule_table
    from overtaking.cli.tables import result_table

    lines = [
        f"learned from {found.num_learned_from:,} simulations; accuracy on all "
        f"{found.everywhere.num:,}: {100.0 * found.everywhere.accuracy:.1f} %"
    ]
    if found.num_missed:
        numbers = ", ".join(str(one) for one in found.missed)
        lines.append(f"{found.num_missed:,} false negatives: {numbers}, …")
    if not found.rules:
        lines.append("no rule was found")
    tables = (rule_table(found), comparison_table(found))
    return Group(
        *(part for table in tables for part in result_table(table)), Text("\n".join(lines))
    )
