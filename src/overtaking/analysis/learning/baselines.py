"""Baselines of a task, which a predictor has to beat."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.learning import models as ml
from overtaking.analysis.learning.conditions import conditions_of
from overtaking.analysis.learning.covering import cover
from overtaking.analysis.learning.examples import Examples
from overtaking.analysis.learning.rules import BASELINE, LEAST
from overtaking.analysis.learning.scores import grouped_interval
from overtaking.analysis.learning.tasks import Names
from overtaking.analysis.stats.weighted_statistics import Z95
from overtaking.core.arrays import Mask

if TYPE_CHECKING:
    from collections.abc import Callable

MOST_FOR_RULES = 10_000
"""Examples that rules are learned from at most; more change them little and take long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """The scores of a baseline on test examples.

    Attributes:
        name: Name of the baseline.
        num: Number of test examples.
        accuracy: Share of right answers, and its 95 % interval (Wilson).
        balanced: Mean recall of the answers, and its 95 % interval (normal).
    """

    name: str
    num: int
    accuracy: tuple[float, float, float]
    balanced: tuple[float, float, float]


def baselines(
    known: Examples, was: Names, kept: Examples, is_so: Names, seed: int = 1
) -> list[Baseline]:
    """Every baseline that the examples suffice for.

    Args:
        known: Examples to learn from.
        was: Their answers, shape (example,).
        kept: Examples to test on, of other scenes.
        is_so: Their answers, shape (example,).
        seed: Seed of the models.

    Raises:
        MissingExtraError: scikit-learn is not installed.
    """
    predictors: dict[str, Callable[[], Names]] = {
        "majority": lambda: np.full(len(kept), _commonest(was)),
        BASELINE: lambda: _by_limit(known, was, kept),
        "logistic regression": lambda: _by_model("logistic regression", known, was, kept, seed),
        ml.TREES: lambda: _by_model(ml.TREES, known, was, kept, seed),
        "rules": lambda: _by_rules(known, was, kept),
    }
    # One answer, or none, leaves nothing to learn.
    learnable = len(np.unique(was)) > 1 and len(kept) > 0
    return [
        _judged(name, predict(), kept, is_so)
        for name, predict in (predictors.items() if learnable else ())
    ]


def _commonest(answers: Names) -> str:
    """The most frequent answer; the first by name of equals."""
    names, counts = np.unique(answers, return_counts=True)
    return str(names[counts.argmax()])


def _by_limit(known: Examples, was: Names, kept: Examples) -> Names:
    """The most frequent answer of those on the same side of the speed limit."""
    over, later = (one.column("over_limit") > 0.0 for one in (known, kept))
    said = [_commonest(was[side]) if side.any() else _commonest(was) for side in (~over, over)]
    return np.where(later, said[1], said[0])


def _by_model(name: str, known: Examples, was: Names, kept: Examples, seed: int) -> Names:
    model = ml.fit(ml.model_of(name, known.attributes, seed), known.values, was)
    return model.classes_[ml.probabilities(model, kept.values).argmax(axis=1)]


def _by_rules(known: Examples, was: Names, kept: Examples) -> Names:
    """A decision list: the rules of the rarest answer first, the commonest where none holds."""
    few, answers = known.where(np.arange(min(len(known), MOST_FOR_RULES))), was[:MOST_FOR_RULES]
    names, counts = np.unique(answers, return_counts=True)
    said = np.full(len(kept), _commonest(answers), dtype=was.dtype)
    is_open = np.ones(len(kept), np.bool_)
    for name, count in sorted(zip(names, counts, strict=True), key=lambda one: one[1])[:-1]:
        if count < LEAST:
            continue
        holds = cover(few, answers == name, conditions_of(few, answers == name)).says(kept)
        said[is_open & holds] = name
        is_open &= ~holds
    return said


def _judged(name: str, said: Names, kept: Examples, is_so: Names) -> Baseline:
    right: Mask = said == is_so
    share, spread = _balanced(right, is_so)
    return Baseline(
        name=name,
        num=len(kept),
        accuracy=(float(right.mean()), *grouped_interval(right, kept.groups)),
        balanced=(share, max(share - Z95 * spread, 0.0), min(share + Z95 * spread, 1.0)),
    )


def _balanced(right: Mask, is_so: Names) -> tuple[float, float]:
    """Mean recall over the answers, and its standard error, recalls being independent shares."""
    groups = [right[is_so == name] for name in np.unique(is_so)]
    recalls = [float(group.mean()) for group in groups]
    variance = sum(r * (1.0 - r) / len(group) for r, group in zip(recalls, groups, strict=True))
    return sum(recalls) / len(groups), math.sqrt(variance) / len(groups)
