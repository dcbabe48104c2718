"""How strongly features go together, and how surprising that would be if they did not.

The measures are those of `dython.nominal.associations(nom_nom_assoc="cramer",
num_num_assoc="spearman", nom_num_assoc="correlation_ratio")`, with gaps left out pair by pair; a
test compares them with it. They are computed here because each column is ranked once, which makes a
million simulations a matter of seconds, and because dython gives no p-values.
"""

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from overtaking.analysis.stats.columns import ALL_CLASSES, BY_NAME, CLASS, FEATURES
from overtaking.analysis.stats.moments import sums
from overtaking.analysis.stats.sample import Sample
from overtaking.core.errors import MissingExtraError

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Codes = I64

ALPHA = 0.05
"""The paper's level of significance."""

# Small, medium, large: J. Cohen, Statistical Power Analysis for the Behavioral Sciences, 2nd
# edition, 1988: sections 3.2 (r) and 7.2 (w), and 8.2 for shares of variance.
_LIMITS_OF_R = (0.1, 0.3, 0.5)
_LIMITS_OF_SHARES = (0.01, 0.06, 0.14)
_WORDS = ("negligible", "small", "medium", "large")

FEWEST = 3
"""Simulations that a pair needs before anything is said of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two variables.

    Attributes:
        first: The one.
        second: The other.
        measure: Name of the measure of association.
        value: The association: -1 to 1 for two numbers, 0 to 1 otherwise; NaN if a variable is
            constant.
        test: Name of the test.
        p_value: Its p-value, NaN likewise.
        effect: Size of the effect, on the scale of `effect_name`.
        effect_name: What the effect is measured by.
        size: The effect in a word, by convention.
        count: Simulations that have both.
    """

    first: str
    second: str
    measure: str
    value: float
    test: str
    p_value: float
    effect: float
    effect_name: str
    size: str
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Associations:
    """The associations of all variables; matrices have shape (variable, variable).

    Attributes:
        names: The variables, those that go together beside each other.
        values: Associations, 1 on the diagonal, NaN where a variable is constant.
        p_values: P-values, NaN on the diagonal.
        q_values: P-values adjusted by Benjamini and Hochberg, which bound the share of false
            discoveries among all pairs.
        constant: Variables with one value only, which go together with nothing.
        pairs: Every pair once.
    """

    names: tuple[str, ...]
    values: F64
    p_values: F64
    q_values: F64
    constant: tuple[str, ...]
    pairs: tuple[Pair, ...]


def associations(sample: Sample) -> Associations:
    """Measure all pairs of features, and of features with CLASS.

    Censored simulations are left out. Weights are not applied: a test needs simulations as they
    were drawn.

    Raises:
        MissingExtraError: SciPy is not installed.
    """
    needs_scipy()
    variables = _variables(sample)
    ranked: dict[tuple[str, bytes], F64] = {}
    pairs = tuple(
        _pair(variables[one], variables[other], ranked) for one, other in combinations(variables, 2)
    )
    names = tuple(variables)
    values, p_values = _matrix(names, pairs, "value"), _matrix(names, pairs, "p_value")
    np.fill_diagonal(values, 1.0)
    order = _clustered(values)
    q_values = _adjusted(p_values)
    square = np.ix_(order, order)
    return Associations(
        names=tuple(names[number] for number in order),
        values=values[square],
        p_values=p_values[square],
        q_values=q_values[square],
        constant=tuple(name for name, one in variables.items() if one.is_constant),
        pairs=pairs,
    )


def needs_scipy() -> None:
    """Make sure that SciPy is there.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        import scipy.stats  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise MissingExtraError.lacking(
            "stats", what="SciPy, which computes p-values", where="statistics"
        ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Variable:
    """A column: codes of its levels, -1 for none, or numbers, NaN for none."""

    name: str
    codes: Codes | None
    numbers: F64 | None
    known: NDArray[np.bool_]
    is_constant: bool


def _variables(sample: Sample) -> dict[str, _Variable]:
    """All columns, the class last, without censored simulations."""
    rated = sample.is_rated
    found: dict[str, _Variable] = {}
    for name in [*BY_NAME, CLASS]:
        if name in BY_NAME and not BY_NAME[name].is_nominal:
            numbers = sample.values(name)[rated]
            known = ~np.isnan(numbers)
            few = known.sum() == 0 or numbers[known].min() == numbers[known].max()
            codes = None
        else:
            codes, numbers = sample.codes(name)[rated], None
            known = codes >= 0
            few = len(np.unique(codes[known])) < 2
        found[name] = _Variable(
            name=name, codes=codes, numbers=numbers, known=known, is_constant=bool(few)
        )
    return found


def _pair(one: _Variable, other: _Variable, ranked: dict[tuple[str, bytes], F64]) -> Pair:
    """Measure two variables."""
    both = one.known & other.known
    if one.codes is not None and other.codes is not None:
        return _of_names(one, other, both)
    if one.numbers is not None and other.numbers is not None:
        return _of_numbers(one, other, both, ranked)
    names, numbers = (one, other) if one.codes is not None else (other, one)
    return _of_name_and_number(names, numbers, both, ranked)


def _ranks(
    variable: _Variable, both: NDArray[np.bool_], ranked: dict[tuple[str, bytes], F64]
) -> F64:
    """Ranks of the numbers that are in a pair, from 1, equal ones sharing their mean rank."""
    assert variable.numbers is not None
    key = (variable.name, np.packbits(both).tobytes())
    if key not in ranked:
        ranks = pd.Series(variable.numbers[both]).rank()
        ranked[key] = np.asarray(ranks, dtype=np.float64)
    return ranked[key]


def _of_numbers(
    one: _Variable,
    other: _Variable,
    both: NDArray[np.bool_],
    ranked: dict[tuple[str, bytes], F64],
) -> Pair:
    """Spearman's rho, and its t-test.

    Source: M. G. Kendall and A. Stuart, The Advanced Theory of Statistics, section 31.19.
    """
    from scipy.stats import t

    x, y = _ranks(one, both, ranked), _ranks(other, both, ranked)
    count = len(x)
    rho = p_value = math.nan
    if count >= FEWEST and np.ptp(x) > 0.0 and np.ptp(y) > 0.0:
        x, y = x - x.mean(), y - y.mean()
        rho = float(np.clip((x * y).sum() / math.sqrt((x * x).sum() * (y * y).sum()), -1.0, 1.0))
        rest = max(1.0 - rho * rho, 0.0)
        statistic = abs(rho) * math.sqrt((count - 2) / rest) if rest > 0.0 else math.inf
        p_value = float(2.0 * t.sf(statistic, count - 2))
    return Pair(
        first=one.name,
        second=other.name,
        measure="Spearman's ρ",
        value=rho,
        test="t-test of ρ",
        p_value=p_value,
        effect=abs(rho),
        effect_name="|ρ|",
        size=_in_a_word(abs(rho), _LIMITS_OF_R),
        count=count,
    )


def _of_name_and_number(
    names: _Variable,
    numbers: _Variable,
    both: NDArray[np.bool_],
    ranked: dict[tuple[str, bytes], F64],
) -> Pair:
    """The correlation ratio, and the test of Kruskal and Wallis with its effect size.

    Source: W. H. Kruskal and W. A. Wallis, J. Am. Stat. Assoc. 47 (1952) 583-621; effect:
    M. Tomczak and E. Tomczak, Trends in Sport Sciences 1 (2014) 19-25.
    """
    from scipy.stats import chi2

    assert names.codes is not None
    assert numbers.numbers is not None
    codes, values = names.codes[both], numbers.numbers[both]
    count, groups = len(values), len(np.unique(codes))
    eta = p_value = effect = math.nan
    if count >= FEWEST and groups > 1 and np.ptp(values) > 0.0:
        eta = math.sqrt(_between(codes, values))
        # The between share of the ranks is H / (n - 1), with the correction for ties in it.
        effect = _between(codes, _ranks(numbers, both, ranked))
        p_value = float(chi2.sf(effect * (count - 1), groups - 1))
    return Pair(
        first=numbers.name,
        second=names.name,
        measure="correlation ratio η",
        value=eta,
        test="Kruskal–Wallis",
        p_value=p_value,
        effect=effect,
        effect_name="ε²",
        size=_in_a_word(effect, _LIMITS_OF_SHARES),
        count=count,
    )


def _in_a_word(effect: float, limits: tuple[float, float, float]) -> str:
    """The size of an effect by convention."""
    return "unknown" if math.isnan(effect) else _WORDS[sum(effect >= limit for limit in limits)]


def _between(codes: Codes, values: F64) -> float:
    """Share of the variance of values that lies between groups, 0 to 1."""
    centred = values - values.mean()
    sizes, totals = np.bincount(codes), sums(codes, centred)
    between = float((totals[sizes > 0] ** 2 / sizes[sizes > 0]).sum())
    return min(between / float((centred * centred).sum()), 1.0)


def _of_names(one: _Variable, other: _Variable, both: NDArray[np.bool_]) -> Pair:
    """Cramer's V, corrected for its bias, and the chi-squared test.

    Source: W. Bergsma, A bias-correction for Cramer's V and Tschuprow's T, J. Korean Stat. Soc. 42
    (2013) 323-328. Two by two levels get the correction of Yates for continuity.
    """
    assert one.codes is not None
    assert other.codes is not None
    counts = _crossed(one.codes[both], other.codes[both])
    value, p_value = _cramers_v(counts)
    return Pair(
        first=one.name,
        second=other.name,
        measure="Cramér's V",
        value=value,
        test="χ²",
        p_value=p_value,
        effect=value,
        effect_name="V",
        # Cohen's w is V times the root of the smaller number of levels less one.
        size=_in_a_word(value * math.sqrt(max(min(counts.shape) - 1, 1)), _LIMITS_OF_R),
        count=int(counts.sum()),
    )


def _crossed(one: Codes, other: Codes) -> F64:
    """How often each two levels occur together, levels that do not occur left out."""
    width = len(ALL_CLASSES) + max(len(feature.levels) for feature in FEATURES)
    counts = np.bincount(one * width + other, minlength=width * width).reshape(width, width)
    return counts[counts.any(axis=1)][:, counts.any(axis=0)].astype(np.float64)


def _cramers_v(counts: F64) -> tuple[float, float]:
    """Cramer's V of a table of counts, and the p-value of its chi-squared test."""
    from scipy.stats import chi2_contingency

    rows, columns = counts.shape
    total = float(counts.sum())
    if min(rows, columns) < 2 or total < FEWEST:
        return math.nan, math.nan
    tested: Any = chi2_contingency(counts)
    phi2 = max(0.0, tested.statistic / total - (rows - 1) * (columns - 1) / (total - 1.0))
    rows_left = rows - (rows - 1) ** 2 / (total - 1.0)
    columns_left = columns - (columns - 1) ** 2 / (total - 1.0)
    room = min(rows_left, columns_left) - 1.0
    value = min(1.0, math.sqrt(phi2 / room)) if room > 0.0 else math.nan
    return value, float(tested.pvalue)


def _matrix(names: tuple[str, ...], pairs: tuple[Pair, ...], attribute: str) -> F64:
    """Something of all pairs as a symmetric matrix, NaN on the diagonal."""
    matrix = np.full((len(names), len(names)), np.nan)
    place = {name: number for number, name in enumerate(names)}
    for pair in pairs:
        one, other = place[pair.first], place[pair.second]
        matrix[one, other] = matrix[other, one] = getattr(pair, attribute)
    return matrix


def _adjusted(p_values: F64) -> F64:
    """All p-values above the diagonal, adjusted by Benjamini and Hochberg.

    Source: Y. Benjamini and Y. Hochberg, J. R. Stat. Soc. B 57 (1995) 289-300.
    """
    from scipy.stats import false_discovery_control

    adjusted = np.full_like(p_values, np.nan)
    upper = np.triu(~np.isnan(p_values), k=1)
    if upper.any():
        kept: F64 = false_discovery_control(p_values[upper]).astype(np.float64)
        adjusted[upper] = kept
        adjusted.T[upper] = kept
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
