"""The associations as tables, with words that do not turn a p-value into a certainty."""

import math

import numpy as np
import pandas as pd

from overtaking.analysis.stats.associations import ALPHA, Associations, Pair
from overtaking.analysis.stats.columns import CLASS
from overtaking.analysis.stats.table import Style, Table

MAX_STRONGEST = 12

_STYLES = (Style.NUMBER, Style.NUMBER, Style.P_VALUE, Style.P_VALUE, Style.COUNT)


def class_associations(found: Associations) -> Table:
    """Every feature with CLASS, the strongest effect first."""
    pairs = [one for one in found.pairs if CLASS in (one.first, one.second)]
    pairs.sort(key=_strength, reverse=True)
    rows = [[_other(one), *_texts(one, found), *_numbers(one, found)] for one in pairs]
    return _table(
        name="associations-with-class",
        title="Features and CLASS",
        note="Effect: ε² for numbers (share of the variance of the ranks that lies between "
        "classes), V for names; its size in a word by Cohen's conventions.",
        texts=["feature", "test", "effect size", "reading"],
        rows=rows,
    )


def strongest_pairs(found: Associations) -> Table:
    """The pairs of features that go together most."""
    pairs = [one for one in found.pairs if CLASS not in (one.first, one.second)]
    pairs = [one for one in pairs if not math.isnan(one.value)]
    pairs.sort(key=lambda one: abs(one.value), reverse=True)
    rows = [
        [f"{one.first}, {one.second}", *_texts(one, found), *_numbers(one, found)]
        for one in pairs[:MAX_STRONGEST]
    ]
    return _table(
        name="strongest-associations",
        title="Features that go together most",
        note="The strongest associations among features. DSEP is computed from SE and SP, so what "
        "it shares with them is partly algebra.",
        texts=["features", "test", "effect size", "reading"],
        rows=rows,
    )


def reading(p_value: float, q_value: float) -> str:
    """What a p-value allows to say, and no more."""
    if math.isnan(p_value):
        return "cannot be tested"
    if q_value < ALPHA:
        return "stands out, also after correction"
    if p_value < ALPHA:
        return "stands out alone, not after correction"
    return "compatible with no association"


def _table(
    *, name: str, title: str, note: str, texts: list[str], rows: list[list[object]]
) -> Table:
    header = [*texts, "association", "effect", "p", "q", "n"]
    return Table(
        name=name,
        title=title,
        note=f"{note} q is p after the correction of Benjamini and Hochberg for all pairs.",
        rows=pd.DataFrame(rows, columns=header),
        styles=(Style.TEXT,) * len(texts) + _STYLES,
        num_texts=len(texts),
        by_column=True,
    )


def _texts(one: Pair, found: Associations) -> list[object]:
    q_value = _q_value(one, found)
    return [one.test, f"{one.size} ({one.effect_name})", reading(one.p_value, q_value)]


def _numbers(one: Pair, found: Associations) -> list[object]:
    return [one.value, one.effect, one.p_value, _q_value(one, found), one.count]


def _q_value(one: Pair, found: Associations) -> float:
    return float(found.q_values[found.names.index(one.first), found.names.index(one.second)])


def _other(one: Pair) -> str:
    return one.first if one.second == CLASS else one.second


def _strength(one: Pair) -> float:
    """For sorting: the association, which is on one scale for all pairs."""
    return -1.0 if np.isnan(one.value) else abs(one.value)
