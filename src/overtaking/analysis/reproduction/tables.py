"""A reproduction as tables."""

import math

import pandas as pd

from overtaking.analysis.reproduction.run import Comparison, Reproduction
from overtaking.analysis.stats.columns import PAPER_CLASSES
from overtaking.analysis.stats.table import Style, Table
from overtaking.knowledge.paper import ALL, Measure, statements

_COEFFICIENTS = (Measure.SPEARMAN, Measure.P_VALUE)


def numbers(found: Reproduction) -> Table:
    """Every number that simulations give, beside the paper's."""
    shown = [one for one in found.comparisons if not one.is_design]
    return Table(
        name="numbers",
        title=f"Numbers of {found.study} and of {found.num_replicates:,} replicates",
        note="ours: median of the replicates; from, to: 95 % of them; below: share of the "
        "replicates below the paper's number, those equal to it counted half.",
        rows=pd.DataFrame(
            [
                {
                    "about": one.statement.about,
                    "unit": one.statement.unit,
                    "number": one.statement.text,
                    "class": scope(one),
                    "standing": one.statement.standing,
                    "paper": one.statement.quoted,
                    "ours": one.ours,
                    "from": one.interval[0],
                    "to": one.interval[1],
                    "below": percent(one.percentile),
                }
                for one in shown
            ]
        ),
        styles=tuple(_style(one) for one in shown),
        num_texts=5,
    )


def scope(one: Comparison) -> str:
    """The class that a number is about, empty for all."""
    return "" if one.statement.scope == ALL else one.statement.scope


def percent(percentile: float) -> str:
    """A percentile as a person reads it."""
    return "" if math.isnan(percentile) else f"{percentile:.1f} %"


def _style(one: Comparison) -> Style:
    if one.is_count:
        return Style.COUNT
    return Style.COEFFICIENT if one.statement.measure in _COEFFICIENTS else Style.NUMBER


def design(found: Reproduction) -> Table:
    """The inputs of the paper beside ours."""
    shown = [one for one in found.comparisons if one.is_design]
    return Table(
        name="design",
        title="What was simulated, and how",
        note="Inputs and definitions, which do not vary.",
        rows=pd.DataFrame(
            [
                {
                    "input": one.statement.text,
                    "unit": one.statement.unit,
                    "standing": one.statement.standing,
                    "paper": one.statement.quoted,
                    "ours": one.ours,
                }
                for one in shown
            ]
        ),
        styles=tuple(
            Style.COUNT if one.statement.quoted.is_integer() else Style.NUMBER for one in shown
        ),
        num_texts=3,
    )


def lawful(found: Reproduction) -> Table:
    """Legal shares of completed overtakes by day and by night."""
    return Table(
        name="lawful",
        title="Completed overtakes that are legal, by light",
        note="All replicates together. The paper's legal overtakes are all by day, if it used "
        "CARLA's presets as they are.",
        rows=pd.DataFrame(
            [
                {
                    "policy": one.policy,
                    "light": "night" if one.is_night else "day",
                    "completed": one.completed,
                    "legal": one.legal,
                    "share": one.legal / one.completed if one.completed else math.nan,
                }
                for one in found.lawful
            ]
        ),
        styles=(Style.TEXT, Style.TEXT, Style.COUNT, Style.COUNT, Style.SHARE),
        num_texts=2,
        by_column=True,
    )


def starts(found: Reproduction) -> Table:
    """Classes by how starts are treated."""
    counts = {one.scope: one.quoted for one in statements().values() if one.measure == "count"}
    total = sum(counts.values())
    names = {True: "as drawn", False: "avoidable"}
    columns = {names[one.allow_doomed]: one.shares for one in found.starts}
    return Table(
        name="starts",
        title="Classes by the treatment of starts",
        note="avoidable: who would start too fast behind another starts farther back, or slower; "
        "as drawn: places and speeds at random, also where no braking avoids a collision. Both "
        "keep the profile's least gap. "
        + ", ".join(f"{names[one.allow_doomed]}: {one.simulations:,}" for one in found.starts)
        + " simulations.",
        rows=pd.DataFrame(
            [
                {"class": name, "paper": counts[name] / total}
                | {column: shares[name] for column, shares in sorted(columns.items())}
                for name in PAPER_CLASSES
            ]
        ),
        styles=(Style.TEXT, Style.SHARE, Style.SHARE, Style.SHARE),
        num_texts=1,
        by_column=True,
    )


def tables(found: Reproduction) -> tuple[Table, ...]:
    """All of them."""
    return numbers(found), design(found), lawful(found), starts(found)
