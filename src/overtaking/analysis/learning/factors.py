"""What decides: models that foretell the outcome, how sure they are, and the factors in order."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.learning.attributes import Attribute
from overtaking.analysis.learning.elimination import Factors, Ranked, num_fits, rank
from overtaking.analysis.learning.examples import Examples, refuse_too_few
from overtaking.analysis.learning.models import (
    MODELS,
    fit,
    fit_calibrated,
    model_of,
    probabilities,
    trees,
)
from overtaking.analysis.learning.scores import grouped_interval
from overtaking.analysis.learning.splits import Split, split
from overtaking.analysis.learning.targets import Target, is_ended
from overtaking.analysis.stats.columns import ALL_CLASSES
from overtaking.core.summary import Summarized

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Outcomes = NDArray[Any]
Progress = Callable[[int, int], None]

LEAST = 40
"""Examples inside and outside the most frequent outcome that are needed."""

FEWEST = 10
"""An outcome that occurs less often is left out: nobody could learn it."""

BINS = 10
"""Intervals of confidence in which calibration is judged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFound:
    """A model, judged on examples that were kept back.

    Attributes:
        name: Its name.
        accuracy: Share foretold rightly.
        low: Lower limit of its 95 % confidence.
        high: Upper limit.
        balanced: Mean over the outcomes of the share foretold rightly.
        log_loss: Mean of -log of the probability that it gave what came [nat].
        error_before: Expected calibration error before calibration.
        error: The same after it.
        confusion: Number of examples by outcome and foretold outcome, shape (outcome, outcome).
        said: Mean confidence in each interval, NaN in empty ones, shape (interval,).
        was: Share foretold rightly there, same shape.
        counts: Examples there, same shape.
    """

    name: str
    accuracy: float
    low: float
    high: float
    balanced: float
    log_loss: float
    error_before: float
    error: float
    confusion: I64
    said: F64
    was: F64
    counts: I64

    def values(self) -> dict[str, Any]:
        """All of it for JSON."""
        return {
            "name": self.name,
            "accuracy": self.accuracy,
            "accuracy_low": self.low,
            "accuracy_high": self.high,
            "balanced_accuracy": self.balanced,
            "log_loss": self.log_loss,
            "calibration_error_before": self.error_before,
            "calibration_error": self.error,
            "confusion": self.confusion.tolist(),
            "reliability": [
                {"confidence": said, "right": was, "examples": count}
                for said, was, count in zip(
                    self.said.tolist(), self.was.tolist(), self.counts.tolist(), strict=True
                )
                if count
            ],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Faked:
    """What a leak would fake.

    Attributes:
        name: What leaks.
        why: Why it does.
        accuracy: Of the same model with it.
        gain: How much more than without.
    """

    name: str
    why: str
    accuracy: float
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorsFound(Summarized):
    """What was found out about the factors.

    Attributes:
        about: `outcome` or the name of a target.
        policy: The policy that decided about the classes.
        seed: Of all choices.
        outcomes: What can come of it, in order.
        num_learned_from: Number of examples learned from.
        num_kept: Number of those kept back.
        num_groups: Number of root scenarios or recordings.
        most_frequent: Accuracy of always saying the most frequent outcome.
        models: The models.
        ranking: The factors, most important first.
        faked: What leaks would fake; empty unless asked for.
    """

    about: str
    policy: str
    seed: int
    outcomes: tuple[str, ...]
    num_learned_from: int
    num_kept: int
    num_groups: int
    most_frequent: float
    models: tuple[ModelFound, ...]
    ranking: tuple[Ranked, ...]
    faked: tuple[Faked, ...]

    def values(self) -> dict[str, Any]:
        """All of it for JSON."""
        return {
            "about": self.about,
            "policy": self.policy,
            "seed": self.seed,
            "outcomes": list(self.outcomes),
            "learned_from": self.num_learned_from,
            "held_out": self.num_kept,
            "groups": self.num_groups,
            "most_frequent_accuracy": self.most_frequent,
            "models": [one.values() for one in self.models],
            "ranking": [one.values() for one in self.ranking],
            "leakage": [
                {"feature": one.name, "why": one.why, "accuracy": one.accuracy, "gain": one.gain}
                for one in self.faked
            ],
        }


def learn_factors(
    examples: Examples,
    factors: Factors,
    target: Target | None = None,
    *,
    seed: int = 1,
    repeats: int = 1,
    leaks: Mapping[str, tuple[str, F64]] | None = None,
    progress: Progress | None = None,
) -> FactorsFound:
    """Find out what decides.

    Args:
        examples: The examples of a data set.
        factors: The attributes of each factor.
        target: What to foretell; the class if none.
        seed: Of all choices.
        repeats: How often the factors are ranked.
        leaks: Why each leak leaks, and its values, shape (simulation, column).
        progress: Called with the number of fits that are done, and of all.

    Raises:
        DatasetError: There are too few examples.
        MissingExtraError: scikit-learn is not installed.
    """
    asked, outcomes, places = _asked(examples, target)
    names = tuple(name for attributes in factors.values() for name in attributes)
    seen = asked.with_attributes(names)
    parts = split(seen.groups, seed)
    steps = _Steps(len(MODELS) + num_fits(len(factors), repeats) + len(leaks or {}), progress)
    known, kept = parts
    models = tuple(_judged(name, seen, outcomes, parts, seed, steps) for name in MODELS)
    ranking = rank(seen, outcomes, factors, parts, seed=seed, repeats=repeats, step=steps.step)
    given = {name: (why, values[places]) for name, (why, values) in (leaks or {}).items()}
    counts = {name: int((outcomes[known] == name).sum()) for name in np.unique(outcomes)}
    most = max(counts, key=lambda name: counts[name])
    return FactorsFound(
        about=target.name if target else "outcome",
        policy=examples.policy,
        seed=seed,
        outcomes=tuple(str(one) for one in _ordered(outcomes)),
        num_learned_from=len(known),
        num_kept=len(kept),
        num_groups=len(np.unique(seen.groups)),
        most_frequent=float((outcomes[kept] == most).mean()),
        models=models,
        ranking=ranking,
        faked=_faked(seen, outcomes, parts, given, seed, steps),
    )


def _asked(examples: Examples, target: Target | None) -> tuple[Examples, Outcomes, I64]:
    """The examples that are asked about, what came of each, and their places in the data set."""
    numbered = replace(examples, simulations=np.arange(len(examples)))
    if target is not None:
        asked, positive = numbered.about(target)
        outcomes = np.where(positive, target.title, f"not {target.title}").astype(object)
    else:
        asked = numbered.where(is_ended(examples.classes, examples.is_seen))
        outcomes = asked.classes.to_numpy(dtype=object)
        names, counts = np.unique(outcomes.astype(str), return_counts=True)
        common = np.isin(outcomes.astype(str), names[counts >= FEWEST])
        asked, outcomes = asked.where(common), outcomes[common]
    names, counts = np.unique(outcomes.astype(str), return_counts=True)
    most = names[int(np.argmax(counts))] if len(names) else ""
    refuse_too_few(
        outcomes == most, asked.groups, where="learn factors", what="outcomes", least=LEAST
    )
    return asked, outcomes, asked.simulations


def _judged(
    name: str, seen: Examples, outcomes: Outcomes, parts: Split, seed: int, steps: "_Steps"
) -> ModelFound:
    """A model as it is and calibrated, on what was kept back."""
    known, kept = parts
    model = model_of(name, seen.attributes, seed)
    values, was = seen.values[known], outcomes[known]
    plain = fit(model, values, was)
    calibrated = fit_calibrated(model, values, was, seen.groups[known])
    order = _ordered(outcomes)
    before = _in_order(probabilities(plain, seen.values[kept]), plain, order)
    after = _in_order(probabilities(calibrated, seen.values[kept]), calibrated, order)
    truth = np.array([order.index(one) for one in outcomes[kept]])
    said = after.argmax(axis=1)
    confusion = np.zeros((len(order), len(order)), np.int64)
    np.add.at(confusion, (truth, said), 1)
    low, high = grouped_interval(said == truth, seen.groups[kept])
    bins = reliability(after, truth)
    sizes = confusion.sum(axis=1)
    steps.step()
    return ModelFound(
        name=name,
        accuracy=float((said == truth).mean()),
        low=low,
        high=high,
        balanced=float((np.diag(confusion)[sizes > 0] / sizes[sizes > 0]).mean()),
        log_loss=float(-np.log(np.clip(after[np.arange(len(truth)), truth], 1e-12, 1.0)).mean()),
        error_before=calibration_error(*reliability(before, truth)),
        error=calibration_error(*bins),
        confusion=confusion,
        said=bins[0],
        was=bins[1],
        counts=bins[2],
    )


def reliability(probability: F64, truth: I64) -> tuple[F64, F64, I64]:
    """How often a model is right, by how sure it is.

    Args:
        probability: Of each outcome, shape (example, outcome).
        truth: Number of the outcome that came, shape (example,).

    Returns:
        Mean confidence, share foretold rightly, and number of examples in intervals of confidence
        of equal width; NaN in empty ones.
    """
    confidence, right = probability.max(axis=1), probability.argmax(axis=1) == truth
    places = np.minimum((confidence * BINS).astype(np.int64), BINS - 1)
    counts = np.bincount(places, minlength=BINS)
    filled = np.where(counts > 0, counts, 1)
    said = np.bincount(places, confidence, BINS) / filled
    was = np.bincount(places, right.astype(np.float64), BINS) / filled
    empty = counts == 0
    return np.where(empty, np.nan, said), np.where(empty, np.nan, was), counts


def calibration_error(said: F64, was: F64, counts: I64) -> float:
    """Expected calibration error: mean distance of confidence and share foretold rightly.

    Source:
        M. P. Naeini, G. F. Cooper and M. Hauskrecht, Obtaining well calibrated probabilities using
        Bayesian binning, AAAI 2015.
    """
    filled = counts > 0
    weights = counts[filled] / counts.sum()
    return float((weights * abs(said[filled] - was[filled])).sum())


def _ordered(outcomes: Outcomes) -> list[str]:
    """The outcomes that occur: classes in their order, others by name."""
    found = {str(one) for one in np.unique(outcomes.astype(str))}
    return [one for one in ALL_CLASSES if one in found] or sorted(found, key=_is_denied)


def _is_denied(name: str) -> tuple[bool, str]:
    return name.startswith("not "), name


def _in_order(probability: F64, model: Any, order: list[str]) -> F64:
    """Probabilities with a column for each outcome, 0 for those that the model never saw."""
    found = np.zeros((len(probability), len(order)))
    for column, name in enumerate(model.classes_):
        found[:, order.index(str(name))] = probability[:, column]
    return found


def _faked(
    seen: Examples,
    outcomes: Outcomes,
    parts: Split,
    leaks: Mapping[str, tuple[str, F64]],
    seed: int,
    steps: "_Steps",
) -> tuple[Faked, ...]:
    """How much accuracy each leak would fake."""
    if not leaks:
        return ()
    plain = _accuracy(seen, outcomes, parts, np.zeros((len(seen), 0)), seed)
    found: list[Faked] = []
    for name, (why, values) in leaks.items():
        accuracy = _accuracy(seen, outcomes, parts, values, seed)
        found.append(Faked(name=name, why=why, accuracy=accuracy, gain=accuracy - plain))
        steps.step()
    return tuple(found)


def _accuracy(seen: Examples, outcomes: Outcomes, parts: Split, more: F64, seed: int) -> float:
    """Accuracy of gradient boosting with more columns."""
    known, kept = parts
    values = np.column_stack([seen.values, more])
    columns = tuple(Attribute(name=f"leak {n}", factor="", words="") for n in range(more.shape[1]))
    model = fit(
        trees((*seen.attributes, *columns), seed, rounds=100), values[known], outcomes[known]
    )
    said = model.classes_[np.argmax(probabilities(model, values[kept]), axis=1)]
    return float((said == outcomes[kept]).mean())


class _Steps:
    """Counts what is done."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        """Begin with nothing done."""
        self._done, self._total, self._progress = 0, total, progress

    def step(self) -> None:
        """One more."""
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._total)
