"""Scores of predictions: precision, recall, F-measure, accuracy, and their uncertainty."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from overtaking.analysis.stats.weighted_statistics import wilson_interval
from overtaking.core.arrays import F64, I64, Mask
from overtaking.core.equality import ContentEquality
from overtaking.core.representation import json_values


@dataclass(frozen=True, slots=True, kw_only=True)
class Score(ContentEquality):
    """The confusion matrix of a binary prediction, and its scores; NaN where one is undefined.

    Attributes:
        name: Name of the predictor.
        hits: TP, predicted and true.
        false_alarms: FP, predicted and false.
        misses: FN, not predicted and true.
        rejections: TN, not predicted and false.
        area: Area under the ROC curve; NaN for predictions without probabilities.
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
        """TP / (TP + FP)."""
        return _share(self.hits, self.hits + self.false_alarms)

    @property
    def recall(self) -> float:
        """TP / (TP + FN)."""
        return _share(self.hits, self.hits + self.misses)

    @property
    def f_measure(self) -> float:
        """Harmonic mean of precision and recall."""
        return _share(2 * self.hits, 2 * self.hits + self.false_alarms + self.misses)

    @property
    def accuracy(self) -> float:
        """(TP + TN) / all."""
        return _share(self.hits + self.rejections, self.num)

    @property
    def balanced_accuracy(self) -> float:
        """Mean of recall and specificity."""
        specificity = _share(self.rejections, self.rejections + self.false_alarms)
        return (self.recall + specificity) / 2.0

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the accuracy (Wilson)."""
        return wilson_interval(self.accuracy, self.num)

    def values(self) -> dict[str, Any]:
        """Everything for JSON; undefined scores are null."""
        low, high = self.interval
        return json_values(
            {
                "name": self.name,
                "examples": self.num,
                "hits": self.hits,
                "false_alarms": self.false_alarms,
                "misses": self.misses,
                "precision": self.precision,
                "recall": self.recall,
                "f_measure": self.f_measure,
                "accuracy": self.accuracy,
                "accuracy_low": low,
                "accuracy_high": high,
                "balanced_accuracy": self.balanced_accuracy,
                "area_under_curve": self.area,
            }
        )


def score(name: str, said: Mask, positive: Mask, area: float = float("nan")) -> Score:
    """Compare predictions with the truth.

    Args:
        name: Name of the predictor.
        said: The predictions, shape (example,).
        positive: The truth, same shape.
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
    """95 % confidence interval of a share of examples that come in groups.

    Examples of one recording resemble each other. The interval is Wilson's, for the effective
    number of independent examples.

    Args:
        right: Whether each example counts, shape (example,).
        groups: Group of each, same shape.

    Source:
        L. Kish, Survey Sampling, 1965, sections 6.4 and 8.2: the linearised variance of a ratio of
        sums over clusters, and the design effect.
    """
    number = len(right)
    if not number:
        return wilson_interval(0.0, 0.0)
    share = float(right.mean())
    _, indices = np.unique(groups, return_inverse=True)
    deviations = np.bincount(indices, right - share)
    clusters = len(deviations)
    plain = share * (1.0 - share) / number
    if clusters < 2 or plain == 0.0:
        return wilson_interval(share, float(clusters))
    spread = clusters / (clusters - 1) * float((deviations**2).sum()) / number**2
    return wilson_interval(share, number / max(spread / plain, 1.0))


def best_threshold(probability: F64, positive: Mask) -> float:
    """The threshold of the probability with the highest F-measure.

    Args:
        probability: Of each example, shape (example,).
        positive: The truth, same shape.
    """
    order = np.argsort(-probability, kind="stable")
    hits = np.cumsum(positive[order])
    measure = 2.0 * hits / (np.arange(1, len(order) + 1) + int(positive.sum()))
    return float(probability[order][int(np.argmax(measure))])


def _share(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
