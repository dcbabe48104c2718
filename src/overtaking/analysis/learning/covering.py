"""Learns a few short rules that predict a target: sequential covering.

A beam search finds the conjunction that adds most to the rules before it. The first rules do not
know what later ones will cover, and so come out too broad: each is searched again, given all
others, until none can be improved. Where an outcome has many causes, rules predict that it is true;
where it takes many conditions at once, as for a legal overtake, rules predict that it is false.
Both are tried, and the set with the higher F-measure is kept; of a rare target only rules for true,
since it is false nearly always.

The weight of a false alarm follows from the F-measure: a set of rules reaches f if
(2 - f) TP - f FP >= f P, so for each f the best set is the best one for certain weights. Some
weights are tried.

Source:
    Covering with a beam: P. Clark and T. Niblett, The CN2 induction algorithm, Machine Learning 3
    (1989) 261-283. Rules searched again: W. W. Cohen, Fast effective rule induction, ICML 1995,
    115-123. Weights for a fraction: W. Dinkelbach, On nonlinear fractional programming, Management
    Science 13 (1967) 492-498.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from overtaking.analysis.learning.conditions import Condition, Rule, RuleSet
from overtaking.analysis.learning.examples import Examples
from overtaking.core.arrays import F32, F64, Mask
from overtaking.core.progress import ProgressCallback, ProgressCounter

Numbers = tuple[int, ...]
"""A rule as the indices of its conditions."""

MAX_RULES, MAX_CONDITIONS = 12, 3
"""Default limits: as many as a person reads."""

_BEAM = 24
_COSTS = (0.12, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Cost of a false alarm where a hit is worth 1: f / (2 - f) from f = 0.2 to 1."""

_RARE = 0.1
"""A target that is true in a smaller share of the examples is rare."""

_BETTERED = 3
"""Number of rule sets, the best of all weights, that are searched again: that takes longest."""

_MAX_PASSES = 6
"""Most passes over the rules of a set; most sets settle earlier."""

_LEAST_GAIN = 0.005
"""Least worth of a rule or a condition, as a share of all hits."""

_LEAST_NEW = 15
"""Least examples that only this rule covers: with fewer, chance looks like a rule."""


def cover(
    examples: Examples,
    positive: Mask,
    conditions: Sequence[Condition],
    *,
    max_rules: int = MAX_RULES,
    max_conditions: int = MAX_CONDITIONS,
    on_round: ProgressCallback | None = None,
) -> RuleSet:
    """Learn a set of rules with a high F-measure.

    Args:
        examples: The examples to learn from.
        positive: Whether the target is true, shape (example,).
        conditions: The conditions that rules may consist of.
        max_rules: Most rules.
        max_conditions: Most conditions of a rule.
        on_round: Called with the number of rounds that are done, and of all.

    Returns:
        The rules, the most valuable first; empty if no rule is worth its words.
    """
    if not conditions or not positive.any():
        return RuleSet(rules=(), is_negated=False)
    searches = _searches(examples, positive, conditions, (max_rules, max_conditions))
    step = ProgressCounter(len(searches) + min(_BETTERED, len(searches)), on_round)

    def found(search: _Search, rules: list[Numbers]) -> _Found:
        step()
        return _Found(search, rules, f_measure(search.covered(rules) ^ search.is_negated, positive))

    first = [found(search, search.rules()) for search in searches]
    best = sorted(first, key=lambda one: -one.reached)[:_BETTERED]
    best += [found(one.search, one.search.bettered(one.rules)) for one in best]
    search, rules, _ = max(best, key=lambda one: one.reached)
    ordered = sorted(rules, key=lambda one: -search.worth([one]))
    named = [Rule(conditions=tuple(conditions[n] for n in sorted(one))) for one in ordered]
    return RuleSet(rules=tuple(named), is_negated=search.is_negated)


def _searches(
    examples: Examples, positive: Mask, conditions: Sequence[Condition], limits: tuple[int, int]
) -> list["_Search"]:
    """For each weight a search for rules of the target, and of its opposite if that is not rare."""
    holds = np.column_stack([one.holds(examples) for one in conditions]).astype(np.float32)
    may_join = _may_join(holds, [one.attribute.name for one in conditions])
    least = _LEAST_GAIN * float(positive.sum())
    found: list[_Search] = []
    for is_negated in (False,) if positive.mean() < _RARE else (False, True):
        wanted = positive ^ is_negated
        for cost in _COSTS:
            weights = (cost, 1.0) if is_negated else (1.0, cost)
            found.append(_Search(holds, may_join, wanted, is_negated, *weights, least, *limits))
    return found


class _Found(NamedTuple):
    """The rules that a search found, and the F-measure that they reach."""

    search: "_Search"
    rules: list[Numbers]
    reached: float


class _Search(NamedTuple):
    """A search for rules with one weight of false alarms.

    Attributes:
        holds: Where each condition holds, 0 or 1, shape (example, condition).
        may_join: Whether two conditions may stand in one rule, shape (condition, condition).
        wanted: What rules should cover, shape (example,).
        is_negated: Whether that is where the target is false.
        gain: Worth of covering a wanted example.
        cost: Cost of covering another one.
        least: Least worth of a condition or a rule.
        max_rules: Most rules.
        max_conditions: Most conditions of a rule.
    """

    holds: F32
    may_join: Mask
    wanted: Mask
    is_negated: bool
    gain: float
    cost: float
    least: float
    max_rules: int
    max_conditions: int

    def rules(self, before: Sequence[Numbers] = ()) -> list[Numbers]:
        """Rules after those before, one after the other, then all without the superfluous ones."""
        found = list(before)
        is_open = ~self.covered(found)
        while len(found) < self.max_rules and (rule := self.best_rule(is_open)):
            found.append(rule)
            is_open &= ~self.covered([rule])
        return self._needed(found)

    def bettered(self, rules: list[Numbers]) -> list[Numbers]:
        """The rules after each was searched again, given the others, and more were searched."""
        found = rules
        for _ in range(_MAX_PASSES):
            before = found
            for index in range(len(before)):
                found = self._replaced(found, index)
            found = self.rules(found)
            if found == before:
                break
        return found

    def _replaced(self, rules: list[Numbers], index: int) -> list[Numbers]:
        """The rules with a better one at an index, if there is one."""
        if index >= len(rules):
            return rules
        others = rules[:index] + rules[index + 1 :]
        rule = self.best_rule(~self.covered(others))
        tried = [*others[:index], rule, *others[index:]] if rule else others
        return tried if self.worth(tried) > self.worth(rules) else rules

    def best_rule(self, is_open: Mask) -> Numbers:
        """The conjunction that adds most; a longer one must be worth its length."""
        hit, miss = self.holds[is_open & self.wanted], self.holds[is_open & ~self.wanted]
        share = len(hit) / max(len(hit) + len(miss), 1)
        beam: list[Numbers] = [()]
        best: tuple[float, Numbers] = (0.0, ())
        for _ in range(self.max_conditions):
            grown, hits, misses = self._grown(hit, miss, beam)
            if not grown:
                break
            values = np.where(hits >= _LEAST_NEW, self.gain * hits - self.cost * misses, -np.inf)
            index = int(np.argmax(values))
            if values[index] > best[0] + self.least:
                best = (float(values[index]), grown[index])
            beam = _kept(grown, values, hits - share * (hits + misses))
        return best[1]

    def _grown(self, hit: F32, miss: F32, beam: list[Numbers]) -> tuple[list[Numbers], F64, F64]:
        """Every rule of the beam with one more condition, and how many of each kind it covers.

        Counts are whole numbers below 2^24, which float32 adds exactly in any order: the result
        does not depend on the number of threads.
        """
        may_join = np.array([self.may_join[list(one)].all(axis=0) for one in beam])
        for row, rule in enumerate(beam):
            may_join[row, list(rule)] = False
        rows, columns = np.nonzero(may_join)
        rules = [tuple(sorted((*beam[r], int(c)))) for r, c in zip(rows, columns, strict=True)]
        first = {rule: n for n, rule in reversed(list(enumerate(rules)))}
        indices = np.array(sorted(first.values()), dtype=np.int64)
        at = rows[indices], columns[indices]
        hits, misses = (_inside(part, beam) @ part for part in (hit, miss))
        found = [rules[n] for n in indices]
        return found, hits[at].astype(np.float64), misses[at].astype(np.float64)

    def _needed(self, rules: list[Numbers]) -> list[Numbers]:
        """The rules without those whose loss costs less than a rule is worth."""
        kept = list(rules)
        while len(kept) > 1:
            value = self.worth(kept)
            losses = [value - self.worth(kept[:n] + kept[n + 1 :]) for n in range(len(kept))]
            least = int(np.argmin(losses))
            if losses[least] >= self.least:
                break
            del kept[least]
        return kept

    def covered(self, rules: Sequence[Numbers]) -> Mask:
        """Where any of the rules holds, shape (example,)."""
        found = np.zeros(len(self.wanted), np.bool_)
        for rule in rules:
            found |= np.asarray(self.holds[:, list(rule)].all(axis=1))
        return found

    def worth(self, rules: Sequence[Numbers]) -> float:
        """The worth of a set of rules."""
        covered = self.covered(rules)
        hits = int((covered & self.wanted).sum())
        return self.gain * hits - self.cost * (int(covered.sum()) - hits)


def _inside(holds: F32, beam: list[Numbers]) -> F32:
    """Where each rule of the beam holds, shape (rule, example)."""
    return np.stack([holds[:, list(one)].all(axis=1) for one in beam]).astype(np.float32)


def _kept(grown: list[Numbers], values: F64, unusual: F64) -> list[Numbers]:
    """The rules to go on with: those worth most, then those that stand out most."""
    half = _BEAM // 2
    chosen = [*np.argsort(-values, kind="stable")[:half], *np.argsort(-unusual, kind="stable")]
    return [grown[n] for n in list(dict.fromkeys(int(n) for n in chosen[: 2 * _BEAM]))[:_BEAM]]


def _may_join(holds: F32, names: Sequence[str]) -> Mask:
    """Which conditions may stand together: on different attributes, or both ends of a range."""
    both = holds.T @ holds
    alone = np.diag(both)
    narrows = (both > 0.0) & (both < alone[:, None]) & (both < alone[None, :])
    same = np.array(names)[:, None] == np.array(names)[None, :]
    return ~same | narrows


def f_measure(said: Mask, positive: Mask) -> float:
    """Harmonic mean of precision and recall, 0 where there is neither prediction nor truth."""
    hits = int((said & positive).sum())
    return 2.0 * hits / max(int(said.sum()) + int(positive.sum()), 1)
