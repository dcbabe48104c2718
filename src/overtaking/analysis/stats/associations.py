"""Associations of features, their p-values, and both as tables.

The measures are those of `dython.nominal.associations(nom_nom_assoc="cramer",
num_num_assoc="spearman", nom_num_assoc="correlation_ratio")`, with gaps left out pair by pair; a
test compares them with it. They are computed here because each column is ranked once, which makes a
million simulations a matter of seconds, and because dython gives no p-values.
"""

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from overtaking.analysis.stats.columns import ALL_CLASSES, BY_NAME, CLASS, FEATURES
from overtaking.analysis.stats.sample import Sample
from overtaking.analysis.stats.table import Style, Table
from overtaking.analysis.stats.weighted_statistics import sums
from overtaking.core.arrays import F64, I64, Mask
from overtaking.core.errors import MissingExtraError

if TYPE_CHECKING:
    from numpy.typing import NDArray

ALPHA = 0.05
"""The paper's level of significance."""

FEWEST = 3
"""Least simulations of a pair."""

MAX_STRONGEST = 12


@dataclass(frozen=True, slots=True)
class Method:
    """How the association of a kind of pair is measured and tested.

    Attributes:
        measure: Name of the measure of association.
        test: Name of the test.
        effect_name: Name of the effect size.
        limits: Effect sizes from which an effect is small, medium and large: J. Cohen, Statistical
            Power Analysis for the Behavioral Sciences, 2nd edition, 1988, sections 3.2 (r), 7.2 (w)
            and 8.2 (shares of variance).
    """

    measure: str
    test: str
    effect_name: str
    limits: tuple[float, float, float]


NUMBERS = Method("Spearman's ρ", "t-test of ρ", "|ρ|", (0.1, 0.3, 0.5))
NAME_AND_NUMBER = Method("correlation ratio η", "Kruskal–Wallis", "ε²", (0.01, 0.06, 0.14))
_WORDS = ("negligible", "small", "medium", "large")
NAMES = Method("Cramér's V", "χ²", "V", (0.1, 0.3, 0.5))


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two variables.

    Attributes:
        first: The first.
        second: The second.
        method: How their association is measured.
        value: The association: [-1, 1] for two numbers, else [0, 1]; NaN if a variable is constant.
        p_value: P-value of the test, NaN likewise.
        effect: Effect size.
        size: The effect size in a word, by convention.
        count: Number of simulations that have both.
    """

    first: str
    second: str
    method: Method
    value: float
    p_value: float
    effect: float
    size: str
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Associations:
    """The associations of all variables; matrices have shape (variable, variable).

    Attributes:
        names: The variables, associated ones beside each other.
        values: Associations, 1 on the diagonal, NaN where a variable is constant.
        p_values: P-values, NaN on the diagonal.
        q_values: P-values adjusted by Benjamini and Hochberg, which bound the share of false
            discoveries among all pairs.
        constant: Variables with one value only.
        pairs: Every pair once.
    """

    names: tuple[str, ...]
    values: F64
    p_values: F64
    q_values: F64
    constant: tuple[str, ...]
    pairs: tuple[Pair, ...]

    def q_value(self, pair: Pair) -> float:
        """The adjusted p-value of a pair."""
        return float(self.q_values[self.names.index(pair.first), self.names.index(pair.second)])


def associations(sample: Sample) -> Associations:
    """Measure all pairs of features, and of features with CLASS.

    Censored simulations are left out. Weights are not applied: a test needs simulations as they
    were drawn.

    Raises:
        MissingExtraError: SciPy is not installed.
    """
    needs_scipy()
    variables = [_Variable(sample, name) for name in (*BY_NAME, CLASS)]
    pairs = tuple(_pair(one, other) for one, other in combinations(variables, 2))
    names = [one.name for one in variables]
    p_values = _matrix(names, {(one.first, one.second): one.p_value for one in pairs})
    values = _matrix(names, {(one.first, one.second): one.value for one in pairs})
    np.fill_diagonal(values, 1.0)
    order = _clustered(values)
    square = np.ix_(order, order)
    return Associations(
        names=tuple(names[number] for number in order),
        values=values[square],
        p_values=p_values[square],
        q_values=_adjusted(p_values)[square],
        constant=tuple(one.name for one in variables if one.is_constant),
        pairs=pairs,
    )


def needs_scipy() -> None:
    """Make sure that SciPy is installed.

    Raises:
        MissingExtraError: It is not.
    """
    try:
        import scipy.stats  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise MissingExtraError.for_extra(
            "stats", what="SciPy, which computes p-values", where="statistics"
        ) from None


class _Variable:
    """A column: its numbers, NaN for none, or the codes of its names, -1 for none."""

    def __init__(self, sample: Sample, name: str) -> None:
        self.name = name
        self.is_nominal = name not in BY_NAME or BY_NAME[name].is_nominal
        values = sample.codes(name) if self.is_nominal else sample.values(name)
        self.values: NDArray[Any] = values[sample.is_rated]
        self.known: Mask = self.values >= 0 if self.is_nominal else ~np.isnan(self.values)
        known = self.values[self.known]
        self.is_constant = not len(known) or known.min() == known.max()
        self._ranks: dict[bytes, F64] = {}

    def ranks(self, both: Mask) -> F64:
        """Ranks of the numbers of a pair, from 1, ties sharing their mean rank."""
        key = np.packbits(both).tobytes()  # Most pairs have the same gaps: rank once.
        if key not in self._ranks:
            ranks = pd.Series(self.values[both]).rank()
            self._ranks[key] = np.asarray(ranks, dtype=np.float64)
        return self._ranks[key]


def _pair(one: _Variable, other: _Variable) -> Pair:
    """Measure two variables; of a number and a name, the number comes first."""
    if one.is_nominal and not other.is_nominal:
        one, other = other, one
    both = one.known & other.known
    sized: float | None = None
    if one.is_nominal:
        method = NAMES
        value, p_value, sized = _of_names(one.values[both], other.values[both])
        effect = value
    elif other.is_nominal:
        method = NAME_AND_NUMBER
        value, p_value, effect = _of_number_and_name(one, other.values[both], both)
    else:
        method = NUMBERS
        value, p_value = _of_numbers(one.ranks(both), other.ranks(both))
        effect = abs(value)
    size = effect if sized is None else sized
    word = "unknown" if math.isnan(size) else _WORDS[sum(size >= least for least in method.limits)]
    return Pair(
        first=one.name,
        second=other.name,
        method=method,
        value=value,
        p_value=p_value,
        effect=effect,
        size=word,
        count=int(both.sum()),
    )


def _of_numbers(x: F64, y: F64) -> tuple[float, float]:
    """Spearman's rho from ranks, and the p-value of its t-test.

    Source: M. G. Kendall and A. Stuart, The Advanced Theory of Statistics, section 31.19.
    """
    from scipy.stats import t

    freedom = len(x) - 2
    if len(x) < FEWEST or not (np.ptp(x) > 0.0 and np.ptp(y) > 0.0):
        return math.nan, math.nan
    x, y = x - x.mean(), y - y.mean()
    rho = float(np.clip((x * y).sum() / math.sqrt((x * x).sum() * (y * y).sum()), -1.0, 1.0))
    rest = max(1.0 - rho * rho, 0.0)
    statistic = abs(rho) * math.sqrt(freedom / rest) if rest > 0.0 else math.inf
    return rho, float(2.0 * t.sf(statistic, freedom))


def _of_number_and_name(number: _Variable, codes: I64, both: Mask) -> tuple[float, float, float]:
    """The correlation ratio, the p-value of Kruskal and Wallis, and its effect size.

    Source: W. H. Kruskal and W. A. Wallis, J. Am. Stat. Assoc. 47 (1952) 583-621; effect:
    M. Tomczak and E. Tomczak, Trends in Sport Sciences 1 (2014) 19-25.
    """
    from scipy.stats import chi2

    values, groups = number.values[both], len(np.unique(codes))
    if len(values) < FEWEST or groups < 2 or not np.ptp(values) > 0.0:
        return math.nan, math.nan, math.nan
    # The between share of the ranks is H / (n - 1), with the correction for ties in it.
    effect = _between(codes, number.ranks(both))
    p_value = float(chi2.sf(effect * (len(values) - 1), groups - 1))
    return math.sqrt(_between(codes, values)), p_value, effect


def _between(codes: I64, values: F64) -> float:
    """Share of the variance of values that lies between groups, 0 to 1."""
    centred = values - values.mean()
    sizes, totals = np.bincount(codes), sums(codes, centred)
    between = float((totals[sizes > 0] ** 2 / sizes[sizes > 0]).sum())
    return min(between / float((centred * centred).sum()), 1.0)


def _of_names(one: I64, other: I64) -> tuple[float, float, float]:
    """Cramer's V, corrected for its bias, the p-value of the chi-squared test, and Cohen's w.

    Source: W. Bergsma, A bias-correction for Cramer's V and Tschuprow's T, J. Korean Stat. Soc. 42
    (2013) 323-328. Two by two levels get the correction of Yates for continuity.
    """
    from scipy.stats import chi2_contingency

    width = len(ALL_CLASSES) + max(len(feature.levels) for feature in FEATURES)
    counts = np.bincount(one * width + other, minlength=width * width).reshape(width, width)
    counts = counts[counts.any(axis=1)][:, counts.any(axis=0)].astype(np.float64)
    rows, columns = counts.shape
    total = float(counts.sum())
    if min(rows, columns) < 2 or total < FEWEST:
        return math.nan, math.nan, math.nan
    tested: Any = chi2_contingency(counts)
    phi2 = max(0.0, tested.statistic / total - (rows - 1) * (columns - 1) / (total - 1.0))
    levels = min(size - (size - 1) ** 2 / (total - 1.0) for size in (rows, columns))
    value = min(1.0, math.sqrt(phi2 / (levels - 1.0))) if levels > 1.0 else math.nan
    return value, float(tested.pvalue), value * math.sqrt(min(rows, columns) - 1)


def _matrix(names: list[str], values: dict[tuple[str, str], float]) -> F64:
    """The values of all pairs as a symmetric matrix, NaN on the diagonal."""
    matrix = np.full((len(names), len(names)), np.nan)
    for (first, second), value in values.items():
        one, other = names.index(first), names.index(second)
        matrix[one, other] = matrix[other, one] = value
    return matrix


def _adjusted(p_values: F64) -> F64:
    """All p-values above the diagonal, adjusted by Benjamini and Hochberg.

    Source: Y. Benjamini and Y. Hochberg, J. R. Stat. Soc. B 57 (1995) 289-300.
    """
    from scipy.stats import false_discovery_control

    adjusted = np.full_like(p_values, np.nan)
    upper = np.triu(~np.isnan(p_values), k=1)
    if upper.any():
        adjusted[upper] = adjusted.T[upper] = false_discovery_control(p_values[upper])
    return adjusted


def _clustered(values: F64) -> I64:
    """An order in which variables with strong associations stand beside each other."""
    from scipy.cluster.hierarchy import leaves_list, linkage

    if len(values) < FEWEST:
        return np.arange(len(values))
    distance = 1.0 - np.abs(np.nan_to_num(values))
    condensed = distance[np.triu_indices(len(values), k=1)]
    tree = linkage(condensed, method="average", optimal_ordering=True)
    return leaves_list(tree).astype(np.int64)


def class_associations(found: Associations) -> Table:
    """Every feature with CLASS, the strongest association first."""
    pairs = [one for one in found.pairs if CLASS in (one.first, one.second)]
    pairs.sort(key=lambda one: -1.0 if math.isnan(one.value) else abs(one.value), reverse=True)
    return _table(
        found,
        {one.first if one.second == CLASS else one.second: one for one in pairs},
        of="feature",
        name="associations-with-class",
        title="Features and CLASS",
        note="Effect: ε² for numbers (share of the variance of the ranks that lies between "
        "classes), V for names; its size in a word by Cohen's conventions.",
    )


def strongest_pairs(found: Associations) -> Table:
    """The pairs of features with the strongest associations."""
    pairs = [one for one in found.pairs if CLASS not in (one.first, one.second)]
    pairs = [one for one in pairs if not math.isnan(one.value)]
    pairs.sort(key=lambda one: abs(one.value), reverse=True)
    return _table(
        found,
        {f"{one.first}, {one.second}": one for one in pairs[:MAX_STRONGEST]},
        of="features",
        name="strongest-associations",
        title="Features that go together most",
        note="The strongest associations among features. DSEP is computed from SE and SP, so what "
        "it shares with them is partly algebra.",
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
    found: Associations, pairs: dict[str, Pair], *, of: str, name: str, title: str, note: str
) -> Table:
    number, p_value = Style.NUMBER, Style.P_VALUE
    return Table.of(
        name=name,
        title=title,
        note=f"{note} q is p after the correction of Benjamini and Hochberg for all pairs.",
        columns={
            **dict.fromkeys((of, "test", "effect size", "reading"), Style.TEXT),
            "association": number,
            "effect": number,
            "p": p_value,
            "q": p_value,
            "n": Style.COUNT,
        },
        rows=[
            (
                *(label, one.method.test, f"{one.size} ({one.method.effect_name})"),
                reading(one.p_value, found.q_value(one)),
                *(one.value, one.effect, one.p_value, found.q_value(one), one.count),
            )
            for label, one in pairs.items()
        ],
    )
