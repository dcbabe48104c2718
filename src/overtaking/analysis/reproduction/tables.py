"""A reproduction as tables."""

import math

import pandas as pd

from overtaking.analysis.reproduction.run import Comparison, Reproduction
from overtaking.analysis.stats.columns import PAPER_CLASSES
from overtaking.analysis.stats.table import Style, Table
from overtaking.knowledge.paper import ALL, Measure, statements

_COEFFICIENTS = (Measure.SPEARMAN, Measure.P_VALUE)


def numbers(found: Reproduction) -> Table:
    """The paper's numbers that simulations give, and ours."""
    shown = [one for one in found.comparisons if not one.is_design]
    texts = ["about", "unit", "number", "class", "standing"]
    header = [*texts, "paper", "ours", "from", "to", "below"]
    rows = [
        (
            *(one.statement.about, one.statement.unit, one.statement.text),
            *(scope(one), one.statement.standing, one.statement.quoted),
            *(one.ours, *one.interval, percent(one.percentile)),
        )
        for one in shown
    ]
    return Table(
        name="numbers",
        title=f"Numbers of {found.study} and of {found.num_replicates:,} replicates",
        note="ours: median of the replicates; from, to: 95 % of them; below: share of the "
        "replicates below the paper's number, those equal to it counted half.",
        rows=pd.DataFrame(rows, columns=header),
        styles=tuple(_style(one) for one in shown),
        num_texts=len(texts),
    )


def scope(one: Comparison) -> str:
    """The class that a number is about; empty for all."""
    return "" if one.statement.scope == ALL else one.statement.scope


def percent(percentile: float) -> str:
    """A percentile in words; empty for NaN."""
    return "" if math.isnan(percentile) else f"{percentile:.1f} %"


def _style(one: Comparison) -> Style:
    if one.is_count:
        return Style.COUNT
    return Style.COEFFICIENT if one.statement.measure in _COEFFICIENTS else Style.NUMBER


def design(found: Reproduction) -> Table:
    """The inputs of the paper, and ours."""
    shown = [(one.statement, one.ours) for one in found.comparisons if one.is_design]
    rows = [(one.text, one.unit, one.standing, one.quoted, ours) for one, ours in shown]
    return Table(
        name="design",
        title="What was simulated, and how",
        note="Inputs and definitions, which do not vary.",
        rows=pd.DataFrame(rows, columns=["input", "unit", "standing", "paper", "ours"]),
        styles=tuple(Style.COUNT if one.quoted.is_integer() else Style.NUMBER for one, _ in shown),
        num_texts=3,
    )


def lawful(found: Reproduction) -> Table:
    """Legal shares of completed overtakes by day and by night."""
    return Table.of(
        name="lawful",
        title="Completed overtakes that are legal, by light",
        note="All replicates together. The paper's legal overtakes are all by day, if it used "
        "CARLA's presets as they are.",
        columns={
            "policy": Style.TEXT,
            "light": Style.TEXT,
            "completed": Style.COUNT,
            "legal": Style.COUNT,
            "share": Style.SHARE,
        },
        rows=[
            (
                *(one.policy, "night" if one.is_night else "day", one.completed, one.legal),
                one.legal / one.completed if one.completed else math.nan,
            )
            for one in found.lawful
        ],
    )


def starts(found: Reproduction) -> Table:
    """Classes by the treatment of starts."""
    counts = {one.scope: one.quoted for one in statements().values() if one.measure == "count"}
    total = sum(counts.values())
    named = {"as drawn" if one.allow_doomed else "avoidable": one for one in found.starts}
    shares = {"paper": {name: counts[name] / total for name in PAPER_CLASSES}}
    shares |= {name: one.shares for name, one in sorted(named.items())}
    return Table.of(
        name="starts",
        title="Classes by the treatment of starts",
        note="avoidable: who would start too fast behind another starts farther back, or slower; "
        "as drawn: places and speeds at random, also where no braking avoids a collision. Both "
        "keep the profile's least gap. "
        + ", ".join(f"{name}: {one.simulations:,}" for name, one in named.items())
        + " simulations.",
        columns={"class": Style.TEXT} | dict.fromkeys(shares, Style.SHARE),
        rows=[(name, *(column[name] for column in shares.values())) for name in PAPER_CLASSES],
    )


def tables(found: Reproduction) -> tuple[Table, ...]:
    """All tables."""
    return numbers(found), design(found), lawful(found), starts(found)
