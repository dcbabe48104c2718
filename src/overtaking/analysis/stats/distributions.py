"""Histograms, boxes, swarms and points: the numbers in the figures of features."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.stats.columns import BY_NAME, CLASS, EGO_TYPES, NUMERIC, Feature
from overtaking.analysis.stats.sample import Sample
from overtaking.analysis.stats.weighted_statistics import quantiles, sums
from overtaking.core.arrays import F64, Mask

MAX_BINS = 24
MAX_BARS = 8
"""A numeric feature with no more values than this gets a bar for each."""
MAX_SWARM = 200
"""Points of one class in a swarm; more would lie on each other."""
MAX_PAIRS = 1200
"""Points in a pair plot."""
_QUARTERS = (0.25, 0.5, 0.75)
_WHISKER = 1.5  # Interquartile ranges: J. W. Tukey, Exploratory Data Analysis, 1977.
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


@dataclass(frozen=True, slots=True)
class Histogram:
    """The frequency of the values of a feature in each class.

    Attributes:
        feature: Which feature.
        edges: Edges of the bins of a numeric feature, shape (bin + 1,); empty for names.
        levels: Labels of the bars if they are not bins; empty for bins.
        counts: Sum of weights, shape (class, bin), classes as in the sample.
        num_missing: Simulations without a value.
    """

    feature: Feature
    edges: F64
    levels: tuple[str, ...]
    counts: F64
    num_missing: int


def histogram(sample: Sample, name: str) -> Histogram:
    """Count the values of a feature, class by class."""
    feature = BY_NAME[name]
    if feature.is_nominal:
        codes = sample.codes(name)
        shown = feature.levels
        if name == "TE" and codes.max(initial=0) < len(EGO_TYPES):
            shown = EGO_TYPES
        return _counted(sample, feature, codes, shown)
    values = sample.values(name)
    there = values[~np.isnan(values)]
    different = np.unique(there)
    if 0 < len(different) <= MAX_BARS:
        codes = np.where(np.isnan(values), -1, np.searchsorted(different, values))
        return _counted(sample, feature, codes, tuple(f"{value:.4g}" for value in different))
    edges = nice_edges(there)
    counts = [
        np.histogram(values[of], edges, weights=sample.weight[of])[0] for _, of in sample.groups()
    ]
    return Histogram(feature, edges, (), np.array(counts), len(values) - len(there))


def _counted(
    sample: Sample, feature: Feature, codes: NDArray[np.int64], levels: tuple[str, ...]
) -> Histogram:
    """A histogram of names or of small numbers."""
    counts = [
        sums(codes[known], sample.weight[known], len(levels))
        for known in (of & (codes >= 0) for _, of in sample.groups())
    ]
    return Histogram(feature, np.array([]), levels, np.array(counts), int((codes < 0).sum()))


def nice_edges(values: F64) -> F64:
    """Edges of bins of a round width that hold all values, shape (bin + 1,).

    The width is the rule's of Freedman and Diaconis, rounded up to 1, 2, 2.5 or 5 times a power
    of ten, and wider where that would be more than `MAX_BINS` bins.

    Source:
        D. Freedman and P. Diaconis, On the histogram as a density estimator, Z. Wahrsch. verw.
        Geb. 57 (1981) 453-476.
    """
    if not len(values):
        return np.array([0.0, 1.0])
    low, high = float(values.min()), float(values.max())
    spread = float(np.subtract(*np.quantile(values, (0.75, 0.25))))
    wanted = 2.0 * spread / len(values) ** (1.0 / 3.0)
    step = _round_up(max(wanted, (high - low) / (MAX_BINS - 1)) or 1.0)
    first, last = math.floor(low / step), math.ceil(high / step)
    last += last * step < high or last == first  # What rounding took away; one bin at least.
    return np.arange(first, last + 1, dtype=np.float64) * step


def _round_up(width: float) -> float:
    """The next round number."""
    power = 10.0 ** math.floor(math.log10(width))
    return next(power * step for step in _STEPS if power * step >= width * (1.0 - 1e-9))


@dataclass(frozen=True, slots=True)
class Box:
    """A box plot in numbers.

    Attributes:
        count: Number of values; the others are NaN if it is 0.
        quartiles: First quartile, median, third quartile.
        whiskers: Smallest and largest value within 1.5 interquartile ranges of the box.
        outliers: Values beyond the whiskers, each once, growing.
    """

    count: int
    quartiles: tuple[float, float, float]
    whiskers: tuple[float, float]
    outliers: F64


def box(values: F64, weight: F64 | None = None) -> Box:
    """Describe values as a box plot does; NaN are left out."""
    there = ~np.isnan(values) & (True if weight is None else weight > 0.0)
    values = values[there]
    lower, median, upper = quantiles(values, _QUARTERS, None if weight is None else weight[there])
    reach = _WHISKER * (upper - lower)
    inside = values[(values >= lower - reach) & (values <= upper + reach)]
    beyond = values[(values < lower - reach) | (values > upper + reach)]
    ends = (float(inside.min()), float(inside.max())) if len(inside) else (math.nan, math.nan)
    quartiles = float(lower), float(median), float(upper)
    return Box(len(values), quartiles, ends, np.unique(beyond))


def boxes_by_class(sample: Sample, name: str) -> dict[str, Box]:
    """A feature as one box per class."""
    values, weight = sample.values(name), sample.weight if sample.is_weighted else None
    return {
        one: box(values[of], None if weight is None else weight[of]) for one, of in sample.groups()
    }


def scaled_boxes(sample: Sample) -> dict[str, Box]:
    """Each numeric feature as a box, its range scaled to 0 to 1."""
    weight = sample.weight if sample.is_weighted else None
    return {one.name: box(min_max(sample.values(one.name)), weight) for one in NUMERIC}


def min_max(values: F64) -> F64:
    """Values moved and scaled to the range 0 to 1; all 0 where they are all the same."""
    there = values[~np.isnan(values)]
    if not len(there):
        return values
    low, spread = float(there.min()), float(there.max() - there.min())
    return (values - low) / (spread if spread > 0.0 else 1.0)


@dataclass(frozen=True, slots=True)
class Points:
    """Some simulations, drawn as points.

    Attributes:
        simulations: Their positions in the sample, growing, shape (point,).
        num_all: Number of all simulations.
    """

    simulations: NDArray[np.int64]
    num_all: int

    @property
    def is_sampled(self) -> bool:
        """Whether some simulations are left out."""
        return len(self.simulations) < self.num_all


def every_kth(members: Mask, most: int) -> NDArray[np.int64]:
    """Positions of the members, or of `most` of them at equal distances.

    Simulations are drawn independently of their number, so this is a random sample, and it is the
    same every time.
    """
    positions = np.flatnonzero(members)
    if len(positions) <= most:
        return positions
    return positions[(np.arange(most) * len(positions)) // most]


def swarm_points(sample: Sample, name: str, most: int = MAX_SWARM) -> dict[str, Points]:
    """The values of a feature to be drawn one by one, class by class."""
    known = ~np.isnan(sample.values(name))
    return {
        one: Points(every_kth(of & known, most), int((of & known).sum()))
        for one, of in sample.groups()
    }


def pair_points(sample: Sample, most: int = MAX_PAIRS) -> Points:
    """The simulations to be drawn in a pair plot; of each class in proportion, but some of each."""
    fewest = most // 20
    chosen = [
        every_kth(of, max(fewest, int(most * of.mean()))) if of.any() else np.array([], np.int64)
        for _, of in sample.groups()
    ]
    simulations = np.sort(np.concatenate(chosen)) if len(sample) > most else np.arange(len(sample))
    return Points(simulations, len(sample))


def typical(sample: Sample) -> dict[str, int]:
    """The most typical simulation of each class that occurs, by its position in the sample.

    It is the one whose numeric features lie nearest to the medians of its class, each measured in
    the spread of the whole sample; of equals the first.
    """
    numbers = sample.frame[[one.name for one in NUMERIC]]
    spread = numbers.std(ddof=0)
    numbers, spread = numbers.loc[:, spread > 0.0], spread[spread > 0.0]
    medians = numbers.groupby(sample.frame[CLASS], observed=True).transform("median")
    away = ((numbers - medians).abs() / spread).sum(axis=1, skipna=False)
    distance = away.fillna(np.inf).to_numpy()
    found: dict[str, int] = {}
    for name, of in sample.groups():
        if of.any():
            positions = np.flatnonzero(of)
            found[name] = int(positions[np.argmin(distance[positions])])
    return found
