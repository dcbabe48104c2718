"""What was learned about a target, as tables."""

from collections.abc import Sequence

import pandas as pd

from overtaking.analysis.learning.rules import RulesFound
from overtaking.analysis.learning.scores import Score
from overtaking.analysis.stats.table import Style, Table


def rule_table(found: RulesFound) -> Table:
    """The rules, how they fare on what was kept back, and where each is wrong."""
    rows = [
        {
            "": str(number + 1),
            f"{found.head} …": one.rule.text,
            "wrong in": ", ".join(str(n) for n in one.counterexamples)
            + (", …" if one.num_counterexamples > len(one.counterexamples) else ""),
            "holds in": one.held_out.hits + one.held_out.false_alarms,
            "precision": one.held_out.precision,
            "recall": one.held_out.recall,
        }
        for number, one in enumerate(found.rules)
    ]
    columns = ["", f"{found.head} …", "wrong in", "holds in", "precision", "recall"]
    text = Style.TEXT
    return Table(
        name=f"rules-{found.target.name}",
        title=f"{found.target.title}: {found.target.question}",
        note="Any of the rules is enough. Counted on simulations that were kept back; “wrong in” "
        "names the first simulations of the whole data set in which a rule holds and is wrong.",
        rows=pd.DataFrame(rows, columns=columns),
        styles=(text, text, text, Style.COUNT, Style.SHARE, Style.SHARE),
        num_texts=3,
        by_column=True,
    )


def comparison_table(found: RulesFound) -> Table:
    """The rules beside the baseline and the black box."""
    return score_table(
        found.comparison,
        name=f"rules-{found.target.name}-compared",
        title=f"{found.target.title}: rules, speed limit and black box",
        note="On the simulations that were kept back.",
    )


def score_table(scores: Sequence[Score], *, name: str, title: str, note: str) -> Table:
    """Scores below each other."""
    rows = [
        {
            "judge": one.name,
            "examples": one.num,
            "accuracy": one.accuracy,
            "balanced": one.balanced_accuracy,
            "precision": one.precision,
            "recall": one.recall,
            "F": one.f_measure,
        }
        for one in scores
    ]
    return Table(
        name=name,
        title=title,
        note=note,
        rows=pd.DataFrame(rows),
        styles=(Style.TEXT, Style.COUNT, *[Style.SHARE] * 5),
        num_texts=1,
        by_column=True,
    )
