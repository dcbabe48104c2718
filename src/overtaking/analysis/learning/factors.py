"""Models that predict the outcome, their calibration, and the factors in order."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from overtaking.analysis.learning import models as ml
from overtaking.analysis.learning.attributes import Attribute
from overtaking.analysis.learning.elimination import Factors, Ranked, Ranking, num_fits
from overtaking.analysis.learning.examples import Examples, refuse_too_few
from overtaking.analysis.learning.models import MODELS, Model, Outcomes, Split
from overtaking.analysis.learning.scores import grouped_interval
from overtaking.analysis.learning.targets import Target, is_ended
from overtaking.analysis.result_methods import Plottable
from overtaking.analysis.stats.columns import ALL_CLASSES
from overtaking.core.arrays import F64, I64
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import DatasetError
from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.core.representation import CompactRepr, json_values

LEAST = 40
"""Least examples with, and without, the most frequent outcome."""

FEWEST = 10
"""Outcomes with fewer examples are left out."""

BINS = 10
"""Intervals of confidence in which calibration is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bin(ContentEquality):
    """The held-out examples in one interval of confidence.

    Attributes:
        confidence: Mean probability of the predicted outcome.
        right: Share that was predicted rightly.
        examples: Number of examples.
    """

    confidence: float
    right: float
    examples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFound(ContentEquality):
    """A model, tested on held-out examples.

    Attributes:
        name: Its name.
        accuracy: Share that it predicts rightly.
        accuracy_low: Lower limit of the 95 % confidence interval.
        accuracy_high: Upper limit.
        balanced_accuracy: Mean of the recalls of the outcomes.
        log_loss: Mean of -log of the probability that it gave to the outcome [nat].
        calibration_error_before: Expected calibration error before calibration.
        calibration_error: The same after calibration.
        confusion: Number of examples by outcome and predicted outcome, shape (outcome, outcome).
        reliability: The intervals of confidence that hold examples.
    """

    name: str
    accuracy: float
    accuracy_low: float
    accuracy_high: float
    balanced_accuracy: float
    log_loss: float
    calibration_error_before: float
    calibration_error: float
    confusion: I64
    reliability: tuple[Bin, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Leakage(ContentEquality):
    """The accuracy that a leaking feature would fake.

    Attributes:
        feature: The feature.
        why: Why it leaks.
        accuracy: Accuracy of the same model with it.
        gain: Accuracy less that without it.
    """

    feature: str
    why: str
    accuracy: float
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorsFound(CompactRepr, ContentEquality, Plottable):
    """Models and factors of a target.

    Attributes:
        about: `outcome` or the name of a target.
        policy: The policy that decided on the classes.
        seed: Seed of all choices.
        outcomes: The outcomes in order.
        learned_from: Number of examples learned from.
        held_out: Number of held-out examples.
        groups: Number of root scenarios or recordings.
        most_frequent_accuracy: Accuracy of always predicting the most frequent outcome.
        models: The models.
        ranking: The factors, most important first.
        leakage: The effect of leaks; empty unless asked for.
    """

    about: str
    policy: str
    seed: int
    outcomes: tuple[str, ...]
    learned_from: int
    held_out: int
    groups: int
    most_frequent_accuracy: float
    models: tuple[ModelFound, ...]
    ranking: tuple[Ranked, ...]
    leakage: tuple[Leakage, ...]

    def values(self) -> dict[str, Any]:
        """Everything for JSON."""
        return json_values(self)


def learn_factors(
    examples: Examples,
    factors: Factors,
    target: Target | None = None,
    *,
    seed: int = 1,
    repeats: int = 1,
    leaks: Mapping[str, tuple[str, F64]] | None = None,
    progress: ProgressCallback | None = None,
) -> FactorsFound:
    """Fit models of a target and rank the factors.

    Args:
        examples: The examples of a data set.
        factors: The attributes of each factor; those that the examples lack are left out.
        target: What to predict; None: the class.
        seed: Seed of all choices.
        repeats: Number of rankings.
        leaks: Why each leak leaks, and its values, shape (simulation, column).
        progress: Called with the number of fits that are done, and of all.

    Raises:
        DatasetError: There are too few examples, or they have none of the factors.
        MissingExtraError: scikit-learn is not installed.
    """
    asked, outcomes, chosen = _asked(examples, target)
    factors = _known(factors, examples)
    seen = asked.with_attributes(tuple(name for names in factors.values() for name in names))
    parts = known, kept = ml.split(seen.groups, seed)
    step = ProgressCounter(
        len(MODELS) + num_fits(len(factors), repeats) + len(leaks or {}), progress
    )
    models = tuple(_tested(name, seen, outcomes, parts, seed, step) for name in MODELS)
    ranking = Ranking(
        examples=seen, outcomes=outcomes, factors=factors, parts=parts, seed=seed, step=step
    )
    given = {name: (why, values[chosen]) for name, (why, values) in (leaks or {}).items()}
    return FactorsFound(
        about=target.name if target else "outcome",
        policy=examples.policy,
        seed=seed,
        outcomes=tuple(_ordered(outcomes)),
        learned_from=len(known),
        held_out=len(kept),
        groups=len(np.unique(seen.groups)),
        most_frequent_accuracy=float((outcomes[kept] == _most_frequent(outcomes[known])).mean()),
        models=models,
        ranking=ranking.rank(repeats),
        leakage=_leakage(seen, outcomes, parts, given, seed, step),
    )


def _known(factors: Factors, examples: Examples) -> Factors:
    """The factors with the attributes that examples have; one-way roads have fewer."""
    has = {one.name for one in examples.attributes}
    kept = {name: tuple(one for one in names if one in has) for name, names in factors.items()}
    found = {name: names for name, names in kept.items() if names}
    if not found:
        raise DatasetError(
            what="factors",
            where="learn factors",
            expected="one that the examples have",
            got=", ".join(factors),
            next_step="take a data set of a two-way road",
        )
    return found


def _asked(examples: Examples, target: Target | None) -> tuple[Examples, Outcomes, I64]:
    """The examples that are asked about, their outcomes, and their places in the data set."""
    if target is not None:
        chosen = np.flatnonzero(examples.is_asked(target))
        asked = examples.where(chosen)
        positive = asked.classes.isin(target.classes).to_numpy()
        outcomes = np.where(positive, target.title, f"not {target.title}").astype(object)
    else:
        ended = is_ended(examples.classes, examples.is_seen)
        counts = examples.classes[ended].value_counts()
        common = examples.classes.isin(counts[counts >= FEWEST].index).to_numpy()
        chosen = np.flatnonzero(ended & common)
        asked = examples.where(chosen)
        outcomes = asked.classes.to_numpy(dtype=object)
    is_most = outcomes == _most_frequent(outcomes)
    refuse_too_few(is_most, asked.groups, where="learn factors", what="outcomes", least=LEAST)
    return asked, outcomes, chosen


def _most_frequent(outcomes: Outcomes) -> str:
    """The most frequent outcome, the first by name of several; empty if there is none."""
    names, counts = np.unique(outcomes.astype(str), return_counts=True)
    return str(names[np.argmax(counts)]) if len(names) else ""


def _tested(
    name: str, seen: Examples, outcomes: Outcomes, parts: Split, seed: int, step: ProgressCounter
) -> ModelFound:
    """A model before and after calibration, on held-out examples."""
    known, kept = parts
    model, order = ml.model_of(name, seen.attributes, seed), _ordered(outcomes)
    values, was = seen.values[known], outcomes[known]
    models = (
        ml.fit(model, values, was),
        ml.fit_calibrated(model, values, was, seen.groups[known]),
    )
    before, after = (_in_order(one, seen.values[kept], order) for one in models)
    truth = np.array([order.index(one) for one in outcomes[kept]])
    predicted = after.argmax(axis=1)
    confusion = np.zeros((len(order), len(order)), np.int64)
    np.add.at(confusion, (truth, predicted), 1)
    sizes = confusion.sum(axis=1)
    recalls = np.diag(confusion)[sizes > 0] / sizes[sizes > 0]
    low, high = grouped_interval(predicted == truth, seen.groups[kept])
    step()
    return ModelFound(
        name=name,
        accuracy=float((predicted == truth).mean()),
        accuracy_low=low,
        accuracy_high=high,
        balanced_accuracy=float(recalls.mean()),
        log_loss=float(-np.log(np.clip(after[np.arange(len(truth)), truth], 1e-12, 1.0)).mean()),
        calibration_error_before=calibration_error(reliability(before, truth)),
        calibration_error=calibration_error(reliability(after, truth)),
        confusion=confusion,
        reliability=reliability(after, truth),
    )


def reliability(probability: F64, truth: I64) -> tuple[Bin, ...]:
    """Accuracy by confidence, in intervals of confidence of equal width that are not empty.

    Args:
        probability: Of each outcome, shape (example, outcome).
        truth: Number of the outcome that occurred, shape (example,).
    """
    confidence, right = probability.max(axis=1), probability.argmax(axis=1) == truth
    indices = np.minimum((confidence * BINS).astype(np.int64), BINS - 1)
    counts = np.bincount(indices)
    sums = np.bincount(indices, confidence), np.bincount(indices, right.astype(np.float64))
    return tuple(
        Bin(
            confidence=float(sums[0][n] / counts[n]),
            right=float(sums[1][n] / counts[n]),
            examples=int(counts[n]),
        )
        for n in np.flatnonzero(counts)
    )


def calibration_error(bins: tuple[Bin, ...]) -> float:
    """Expected calibration error: mean distance of confidence and accuracy.

    Source:
        M. P. Naeini, G. F. Cooper and M. Hauskrecht, Obtaining well calibrated probabilities using
        Bayesian binning, AAAI 2015.
    """
    total = sum(one.examples for one in bins)
    return sum(one.examples / total * abs(one.confidence - one.right) for one in bins)


def _ordered(outcomes: Outcomes) -> list[str]:
    """The outcomes that occur: classes in their order, others by name."""
    found = {str(one) for one in outcomes}
    named = [one for one in ALL_CLASSES if one in found]
    return named or sorted(found, key=lambda one: (one.startswith("not "), one))


def _in_order(model: Model, values: F64, order: list[str]) -> F64:
    """Probabilities with a column for each outcome, 0 for those that the model never saw."""
    found = np.zeros((len(values), len(order)))
    found[:, [order.index(str(name)) for name in model.classes_]] = ml.probabilities(model, values)
    return found


def _leakage(
    seen: Examples,
    outcomes: Outcomes,
    parts: Split,
    leaks: Mapping[str, tuple[str, F64]],
    seed: int,
    step: ProgressCounter,
) -> tuple[Leakage, ...]:
    """The accuracy that each leak would fake."""
    if not leaks:
        return ()

    def accuracy(more: F64) -> float:
        columns = tuple(Attribute(f"leak {n}", "", "") for n in range(more.shape[1]))
        values = np.column_stack([seen.values, more])
        attributes = (*seen.attributes, *columns)
        right = ml.predicted_right(attributes, values, outcomes, parts, seed=seed, rounds=100)
        return float(right.mean())

    without = accuracy(np.zeros((len(seen), 0)))
    found: list[Leakage] = []
    for name, (why, values) in leaks.items():
        reached = accuracy(values)
        found.append(Leakage(feature=name, why=why, accuracy=reached, gain=reached - without))
        step()
    return tuple(found)
