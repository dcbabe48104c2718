"""How good it is to say that something will be so: hits, misses, and what follows."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.stats.moments import wilson

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What came of saying that something will be so.

    Attributes:
        name: Who said it.
        hits: It was said and was so.
        false_alarms: It was said and was not so.
        misses: It was so and was not said.
        rejections: It was neither said nor so.
        area: Area under the curve of hits over false alarms, NaN for what knows no degrees.
    """

    name: str
    hits: int
    false_alarms: int
    misses: int
    rejections: int
    area: float = float("nan")

    @property
    def num(self) -> int:
        """Number of examples."""
        return self.hits + self.false_alarms + self.misses + self.rejections

    @property
    def precision(self) -> float:
        """Of what was said, the share that was so; NaN if nothing was said."""
        return _share(self.hits, self.hits + self.false_alarms)

    @property
    def recall(self) -> float:
        """Of what was so, the share that was said."""
        return _share(self.hits, self.hits + self.misses)

    @property
    def f_measure(self) -> float:
        """Harmonic mean of precision and recall."""
        return _share(2 * self.hits, 2 * self.hits + self.false_alarms + self.misses)

    @property
    def accuracy(self) -> float:
        """Share of the examples that were judged rightly."""
        return _share(self.hits + self.rejections, self.num)

    @property
    def balanced_accuracy(self) -> float:
        """Mean of the shares that were judged rightly where it was so and where it was not."""
        specificity = _share(self.rejections, self.rejections + self.false_alarms)
        return (self.recall + specificity) / 2.0

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence of the accuracy (Wilson)."""
        return wilson(self.accuracy, self.num)

    def values(self) -> dict[str, Any]:
        """All of it for JSON; what has no value is null."""
        low, high = self.interval
        shares = {
            "precision": self.precision,
            "recall": self.recall,
            "f_measure": self.f_measure,
            "accuracy": self.accuracy,
            "accuracy_low": low,
            "accuracy_high": high,
            "balanced_accuracy": self.balanced_accuracy,
            "area_under_curve": self.area,
        }
        return {
            "name": self.name,
            "examples": self.num,
            "hits": self.hits,
            "false_alarms": self.false_alarms,
            "misses": self.misses,
            **{name: None if value != value else value for name, value in shares.items()},
        }


def score(name: str, said: Mask, positive: Mask, area: float = float("nan")) -> Score:
    """Compare what was said with what was so.

    Args:
        name: Who said it.
        said: Shape (example,).
        positive: Same shape.
        area: As in `Score`.
    """
    return Score(
        name=name,
        hits=int((said & positive).sum()),
        false_alarms=int((said & ~positive).sum()),
        misses=int((~said & positive).sum()),
        rejections=int((~said & ~positive).sum()),
        area=area,
    )


def grouped_interval(right: Mask, groups: I64) -> tuple[float, float]:
    """95 % confidence of a share of examples that come in groups.

    Examples of one recording resemble each other, so they say less than as many strangers would:
    Wilson's interval for the number of strangers that say as much.

    Args:
        right: Whether each example counts, shape (example,).
        groups: Group of each, same shape.

    Source:
        L. Kish, Survey Sampling, 1965, sections 6.4 and 8.2: the linearised variance of a ratio of
        sums over clusters, and the design effect.
    """
    number = len(right)
    if not number:
        return wilson(0.0, 0.0)
    share = float(right.mean())
    _, places = np.unique(groups, return_inverse=True)
    deviations = np.bincount(places, right - share)
    clusters = len(deviations)
    plain = share * (1.0 - share) / number
    if clusters < 2 or plain == 0.0:
        return wilson(share, float(clusters))
    spread = clusters / (clusters - 1) * float((deviations**2).sum()) / number**2
    return wilson(share, number / max(spread / plain, 1.0))


def best_threshold(probability: F64, positive: Mask) -> float:
    """The probability from which to say so for the highest F-measure.

    Args:
        probability: Of each example, shape (example,).
        positive: Whether it was so, same shape.
    """
    order = np.argsort(-probability, kind="stable")
    hits = np.cumsum(positive[order])
    measure = 2.0 * hits / (np.arange(1, len(order) + 1) + int(positive.sum()))
    return float(probability[order][int(np.argmax(measure))])


def _share(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
