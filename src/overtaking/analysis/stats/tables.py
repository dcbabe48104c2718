"""The paper's two tables, and the frequency of each class.

Known of the paper's tables are the captions and the description in its text: counts for static
features that are names; minimum, mean, maximum and standard deviation for the others; absolute (af)
and relative frequency (rf) for dynamic features.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from overtaking.analysis.stats.columns import BY_NAME, CENSORED, EGO_TYPES, FEATURES, Feature
from overtaking.analysis.stats.sample import Sample, effective_size
from overtaking.analysis.stats.table import Style, Table
from overtaking.analysis.stats.weighted_statistics import Moments, moments, wilson_interval
from overtaking.core.arrays import Mask

ALL = "All"
"""Column of all simulations together."""

_TEXTS = ("feature", "unit", "statistic")
_FOUR = {"min": "minimum", "mean": "mean", "max": "maximum", "σ": "sigma"}

Row = tuple[Style, tuple[str, str, str], list[float]]


def class_table(sample: Sample) -> Table:
    """The frequency of each class, with the 95 % confidence interval of its share."""
    rated, total = sample.is_rated, float(sample.weight[sample.is_rated].sum())
    size = effective_size(sample.weight[rated])
    rows: list[tuple[object, ...]] = []
    for name, members in sample.groups():
        shares = np.nan, np.nan, np.nan
        if total and name != CENSORED:
            share = float(sample.weight[members].sum()) / total
            shares = share, *wilson_interval(share, size)
        rows.append((name, int(members.sum()), *shares))
    weighted = "The shares are weighted, the counts are not. " if sample.is_weighted else ""
    return Table.of(
        name="classes",
        title=f"Frequency of classes under the policy {sample.policy}",
        note=f"{weighted}The last two columns limit the share with 95 % confidence "
        "(Wilson's interval).",
        columns={"class": Style.TEXT, "count": Style.COUNT}
        | dict.fromkeys(("share", "from", "to"), Style.SHARE),
        rows=rows,
    )


def static_table(sample: Sample) -> Table:
    """The paper's table of static features: counts of names, four numbers for the times."""
    rows: list[Row] = []
    for feature in FEATURES:
        if feature.is_nominal:
            rows += _level_rows(sample, feature)
        elif feature.name == "NV":
            rows += _number_rows(sample)
        elif feature.is_static:
            rows += _moment_rows(sample, feature)
    return _table(
        sample,
        rows,
        name="static-features",
        title=f"Statistics of static features by class, policy {sample.policy}",
        note="Counts for what is a name, and for the number of vehicles; σ is the standard "
        "deviation of a sample (n − 1).",
    )


def dynamic_table(sample: Sample) -> Table:
    """The paper's table of dynamic features: four numbers, absolute and relative frequency."""
    rows: list[Row] = []
    for feature in FEATURES:
        if not feature.is_static:
            rows += _moment_rows(sample, feature)
            rows += _frequency_rows(sample, feature)
    return _table(
        sample,
        rows,
        name="dynamic-features",
        title=f"Statistics of dynamic features by class, policy {sample.policy}",
        note="Values at the start of the overtake. af is the number of simulations that have a "
        "value, rf its share of all those that have one and are not censored.",
    )


def _table(sample: Sample, rows: list[Row], *, name: str, title: str, note: str) -> Table:
    """Rows as a table with a column for each class, and one for all."""
    header = [*_TEXTS, *sample.classes, ALL]
    weights = " Weighted, with the mean weight scaled to 1." if sample.is_weighted else ""
    return Table(
        name=name,
        title=title,
        note=note + weights,
        rows=pd.DataFrame([[*texts, *values] for _, texts, values in rows], columns=header),
        styles=tuple(style for style, _, _ in rows),
        num_texts=len(_TEXTS),
    )


def _columns(sample: Sample) -> Iterator[tuple[str, Mask]]:
    """The columns of a table: each class, then all simulations."""
    yield from sample.groups()
    yield ALL, np.ones(len(sample), dtype=bool)


def _level_rows(sample: Sample, feature: Feature) -> Iterator[Row]:
    """A row for each level of a nominal feature, and one for missing values."""
    codes = sample.codes(feature.name)
    levels = list(enumerate(feature.levels))
    if (codes < 0).any():
        levels.append((-1, "none"))
    for code, level in levels:
        row = _count_row(sample, feature.name, level, codes == code)
        if row[2][-1] or feature.name != "TE" or level in EGO_TYPES:
            yield row


def _number_rows(sample: Sample) -> Iterator[Row]:
    """A row for each number of vehicles, or four numbers where there are many."""
    values = sample.values("NV")
    numbers = np.unique(values[~np.isnan(values)])
    if len(numbers) > 10:
        yield from _moment_rows(sample, BY_NAME["NV"])
    else:
        yield from (_count_row(sample, "NV", f"{one:g}", values == one) for one in numbers)


def _count_row(sample: Sample, name: str, level: str, members: Mask) -> Row:
    counts = [float(sample.weight[of & members].sum()) for _, of in _columns(sample)]
    return Style.COUNT, (name, "", level), counts


def _moment_rows(sample: Sample, feature: Feature) -> Iterator[Row]:
    """Minimum, mean, maximum and standard deviation of a numeric feature."""
    described = _described(sample, feature)
    for word, attribute in _FOUR.items():
        values = [getattr(one, attribute) for one in described]
        yield Style.NUMBER, (feature.name, feature.unit, word), values


def _frequency_rows(sample: Sample, feature: Feature) -> Iterator[Row]:
    """Absolute and relative frequency of the values of a numeric feature."""
    weights = [one.weight for one in _described(sample, feature)]
    shown = dict(zip((*sample.classes, ALL), weights, strict=True))
    rated = shown[ALL] - shown.get(CENSORED, 0.0)
    shares = [
        np.nan if name == CENSORED or rated <= 0.0 else (rated if name == ALL else weight) / rated
        for name, weight in shown.items()
    ]
    yield Style.COUNT, (feature.name, "", "af"), weights
    yield Style.SHARE, (feature.name, "", "rf"), shares


def _described(sample: Sample, feature: Feature) -> list[Moments]:
    """The moments of a feature in each column."""
    values = sample.values(feature.name)
    return [moments(values[of], sample.weight[of]) for _, of in _columns(sample)]
