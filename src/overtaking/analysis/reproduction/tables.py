"""A reproduction as tables."""

import math

import pandas as pd

from overtaking.analysis.reproduction.run import PHYSICAL, Comparison, Reproduction
from overtaking.analysis.reproduction.statements import ALL, Statistic, statements
from overtaking.analysis.reproduction.variants import COLLISION, Variant
from overtaking.analysis.stats.columns import PAPER_CLASSES
from overtaking.analysis.stats.table import Style, Table

_COEFFICIENTS = (Statistic.SPEARMAN, Statistic.P_VALUE)


def numbers(found: Reproduction) -> Table:
    """The paper's numbers that simulations give, and ours."""
    shown = [one for one in found.comparisons if not one.is_design]
    texts = ["about", "unit", "number", "class", "standing"]
    header = [*texts, "paper", "experiment", "from", "to", "below", "physical"]
    rows = [
        (
            *(one.statement.about, one.statement.unit, one.statement.text),
            *(scope(one), one.statement.standing, one.statement.quoted),
            *(one.ours, *one.interval, percent(one.percentile), one.physical),
        )
        for one in shown
    ]
    return Table(
        name="numbers",
        title=f"Numbers of the paper, of its experiment, and with physical weather "
        f"({found.num_replicates:,} replicates of each)",
        note="experiment: median of the replicates of the study's experiment; from, to: 95 % of "
        "them; below: share of them below the paper's number, those equal to it counted half; "
        f"physical: median of as many replicates of {PHYSICAL}, which were not fitted to it.",
        rows=pd.DataFrame(rows, columns=header),
        styles=tuple(_style(one) for one in shown),
        num_texts=len(texts),
    )


def scope(one: Comparison) -> str:
    """The class that a number is about; empty for all."""
    return "" if one.statement.outcome_class == ALL else one.statement.outcome_class


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


def score(found: Reproduction) -> Table:
    """How many numbers of each standing lie among ours."""
    rows: list[tuple[object, ...]] = []
    for group in ("by design", "fitted", "implied", "predicted", "contradiction"):
        inside = [
            one.is_inside
            for one in found.comparisons
            if one.statement.standing.group == group and one.is_inside is not None
        ]
        rows.append((group, len(inside), sum(inside), len(inside) - sum(inside)))
    columns = dict.fromkeys(("judged", "inside", "missed"), Style.COUNT)
    return Table.of(
        name="score",
        title="Numbers of the paper by standing",
        note="inside: the number lies where 95 % of the experiment's replicates do; an input lies "
        "there if it is the same.",
        columns={"standing": Style.TEXT} | columns,
        rows=rows,
    )


def collided(found: Reproduction) -> Table:
    """Distance and speeds of the collided."""
    names = {None: "all", False: "touch before pulling out", True: "touch after pulling out"}
    stated = {
        one.feature: one.quoted
        for one in statements().values()
        if one.outcome_class == COLLISION and one.measure == Statistic.MEAN
    }
    total = found.collided[0].simulations
    share = {one.begun: one.simulations / total if total else math.nan for one in found.collided}
    joint = (
        ""
        if math.isnan(found.farther)
        else (
            f" Of the replicates {found.farther:.1%} lie farther from the middle of all, in the "
            "three means jointly, than the paper."
        )
    )
    units = {"D": "D [m]", "SE": "SE [km/h]", "SP": "SP [km/h]"}
    return Table.of(
        name="collided",
        title="The collided",
        note=f"Means over all replicates, {total:,} collided.{joint}",
        columns={"collided": Style.TEXT, "share": Style.SHARE}
        | dict.fromkeys(units.values(), Style.NUMBER),
        rows=[
            ("paper", math.nan, *(stated[name] for name in units)),
            *(
                (names[one.begun], share[one.begun], *(one.means[name] for name in units))
                for one in found.collided
            ),
        ],
    )


def pushes(found: Reproduction) -> Table:
    """Classes by the size of the pushes."""
    columns = {f"pushes x {one.value:g}": one for one in found.pushes}
    return _variants(
        "pushes",
        "Classes by the size of the pushes",
        "The paper gives no size of the pushes that stand for rain and wind: x 1 is our choice.",
        columns,
    )


def starts(found: Reproduction) -> Table:
    """Classes by the treatment of starts."""
    columns = {"as drawn" if one.value else "avoidable": one for one in found.starts}
    return _variants(
        "starts",
        "Classes by the treatment of starts",
        "avoidable: who would start too fast behind another starts farther back, or slower; as "
        "drawn: places and speeds at random, also where no braking avoids a collision. Both keep "
        "the profile's least gap.",
        dict(sorted(columns.items())),
    )


def _variants(name: str, title: str, note: str, variants: dict[str, Variant]) -> Table:
    """Shares of the classes of the paper, and of some variants."""
    counts = {
        one.outcome_class: one.quoted for one in statements().values() if one.measure == "count"
    }
    total = sum(counts.values())
    shares = {"paper": {name: counts[name] / total for name in PAPER_CLASSES}}
    shares |= {name: one.shares for name, one in variants.items()}
    sizes = ", ".join(f"{name}: {one.simulations:,}" for name, one in variants.items())
    return Table.of(
        name=name,
        title=title,
        note=f"{note} {sizes} simulations." if sizes else note,
        columns={"class": Style.TEXT} | dict.fromkeys(shares, Style.SHARE),
        rows=[(one, *(column[one] for column in shares.values())) for one in PAPER_CLASSES],
    )


def tables(found: Reproduction) -> tuple[Table, ...]:
    """All tables."""
    every = (score, numbers, design, collided, pushes, lawful, starts)
    return tuple(one(found) for one in every)
