"""Rules that a driver would recognise, compared with a black box and with the speed limit."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from overtaking.analysis.learning import models as ml
from overtaking.analysis.learning.conditions import Rule, RuleSet, conditions_of
from overtaking.analysis.learning.covering import MAX_CONDITIONS, MAX_RULES, cover
from overtaking.analysis.learning.examples import Examples, refuse_too_few
from overtaking.analysis.learning.models import TREES, Split
from overtaking.analysis.learning.scores import Score, best_threshold, score
from overtaking.analysis.learning.targets import Target
from overtaking.core.arrays import F64, Mask
from overtaking.core.equality import ContentEquality
from overtaking.core.progress import ProgressCallback
from overtaking.core.representation import CompactRepr

LEAST = 20
"""Least examples of each kind."""

SHOWN = 5
"""Counterexamples that are listed for each rule."""

BASELINE = "speed over the limit alone"


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedRule(ContentEquality):
    """A rule with its scores.

    Attributes:
        rule: The rule.
        learned_from: Score on the examples that it was learned from.
        held_out: Score on held-out examples.
        everywhere: Score on the whole data set.
        counterexamples: Numbers of the first simulations in which it holds and is wrong.
        num_counterexamples: Number of all of them.
    """

    rule: Rule
    learned_from: Score
    held_out: Score
    everywhere: Score
    counterexamples: tuple[int, ...]
    num_counterexamples: int

    def values(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {
            "text": self.rule.text,
            "conditions": [one.values() for one in self.rule.conditions],
            "learned_from": self.learned_from.values(),
            "held_out": self.held_out.values(),
            "everywhere": self.everywhere.values(),
            "counterexamples": list(self.counterexamples),
            "num_counterexamples": self.num_counterexamples,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class RulesFound(CompactRepr, ContentEquality):
    """The rules for a target.

    Attributes:
        target: The target.
        policy: The policy that decided on the classes.
        seed: Seed of the split and of the black box.
        num_learned_from: Number of examples learned from.
        rules: The rules with their scores.
        is_negated: Whether they predict that the target is false, instead of true.
        comparison: Rules, baseline and black box on held-out examples.
        everywhere: The rules on the whole data set.
        missed: Numbers of the first false negatives.
        num_missed: Number of all of them.
    """

    target: Target
    policy: str
    seed: int
    num_learned_from: int
    rules: tuple[LearnedRule, ...]
    is_negated: bool
    comparison: tuple[Score, ...]
    everywhere: Score
    missed: tuple[int, ...]
    num_missed: int

    @property
    def head(self) -> str:
        """The prediction of the rules, up to their conditions."""
        return f"{self.target.title} unless" if self.is_negated else f"{self.target.title} if"

    def values(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {
            "about": self.target.name,
            "question": self.target.question,
            "head": self.head,
            "policy": self.policy,
            "seed": self.seed,
            "learned_from": self.num_learned_from,
            "rules": [one.values() for one in self.rules],
            "held_out": [one.values() for one in self.comparison],
            "everywhere": self.everywhere.values(),
            "missed": list(self.missed),
            "num_missed": self.num_missed,
        }


def learn_rules(
    examples: Examples,
    target: Target,
    *,
    seed: int = 1,
    max_rules: int = MAX_RULES,
    max_conditions: int = MAX_CONDITIONS,
    progress: ProgressCallback | None = None,
) -> RulesFound:
    """Learn rules for a target, and compare them.

    Args:
        examples: The examples of a data set.
        target: The target.
        seed: Seed of the split and of the black box.
        max_rules: Most rules.
        max_conditions: Most conditions of a rule.
        progress: Called with the number of rounds that are done, and of all.

    Raises:
        DatasetError: There are too few examples.
        MissingExtraError: scikit-learn is not installed.
    """
    asked, positive = examples.about(target)
    refuse_too_few(
        positive, asked.groups, where="learn rules", what=f'"{target.title}"', least=LEAST
    )
    parts = ml.split(asked.groups, seed)
    known, kept = (asked.where(part) for part in parts)
    was, is_so = (positive[part] for part in parts)
    made = cover(
        known,
        was,
        conditions_of(known, was),
        max_rules=max_rules,
        max_conditions=max_conditions,
        on_round=progress,
    )
    says = made.says(asked)
    missed = says & ~positive if made.is_negated else ~says & positive
    return RulesFound(
        target=target,
        policy=examples.policy,
        seed=seed,
        num_learned_from=len(known),
        rules=tuple(_judged(one, made, asked, positive, parts) for one in made.rules),
        is_negated=made.is_negated,
        comparison=(
            score("these rules", made.says(kept), is_so),
            _baseline(kept, is_so, target),
            _black_box(known, was, kept, is_so, seed),
        ),
        everywhere=score("these rules", says, positive),
        missed=_numbers(asked, missed),
        num_missed=int(missed.sum()),
    )


def _judged(
    rule: Rule, made: RuleSet, asked: Examples, positive: Mask, parts: Split
) -> LearnedRule:
    """A rule with its scores, alone."""
    holds, wanted = rule.holds(asked), positive ^ made.is_negated
    wrong = holds & ~wanted
    return LearnedRule(
        rule=rule,
        learned_from=score("learned from", holds[parts[0]], wanted[parts[0]]),
        held_out=score("held out", holds[parts[1]], wanted[parts[1]]),
        everywhere=score("everywhere", holds, wanted),
        counterexamples=_numbers(asked, wrong),
        num_counterexamples=int(wrong.sum()),
    )


def _numbers(examples: Examples, chosen: Mask) -> tuple[int, ...]:
    """Numbers of the first few simulations."""
    return tuple(int(one) for one in examples.simulations[chosen][:SHOWN])


def _baseline(kept: Examples, is_so: Mask, target: Target) -> Score:
    """The prediction from the speed limit alone."""
    is_over = kept.column("over_limit") > 0.0
    return score(BASELINE, is_over if target.over_limit_means else ~is_over, is_so)


def _black_box(known: Examples, was: Mask, kept: Examples, is_so: Mask, seed: int) -> Score:
    """The prediction of gradient boosting, with a threshold chosen by cross-validation."""
    from sklearn.metrics import roc_auc_score

    model = ml.model_of(TREES, known.attributes, seed)
    guessed = np.zeros(len(known))
    for learned, left in ml.folds(known.groups, 3):
        part = ml.fit(model, known.values[learned], was[learned])
        guessed[left] = _positive(part, known.values[left])
    threshold = best_threshold(guessed, was)
    chance = _positive(ml.fit(model, known.values, was), kept.values)
    area = float(roc_auc_score(is_so, chance)) if 0 < is_so.sum() < len(is_so) else float("nan")
    return score(f"{TREES} (black box)", chance >= threshold, is_so, area)


def _positive(model: Any, values: F64) -> F64:
    """Probability that the target is true; 0 where the model has never seen it."""
    classes = list(model.classes_)
    found = ml.probabilities(model, values)
    return found[:, classes.index(True)] if True in classes else np.zeros(len(values))
