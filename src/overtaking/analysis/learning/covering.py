"""A few short rules that together say where something is so: sequential covering.

Each rule is the one, among all conjunctions that a beam search meets, that adds most to what is
wanted, given the rules before it. The first rules are found before anybody knows what the later
ones will cover, and so come out too broad: each is looked for again, given all the others, until
none can be bettered. Where an outcome has many causes, rules say when it is so; where it takes many
things to be right at once, as for what is lawful, they say when it is not. Both are tried, and the
set with the higher F-measure is kept; of what is rare rules say only when it is so, since when it
is not is nearly always, for a hundred reasons that nobody would name.

How much a false alarm weighs against a hit follows from the F-measure: a set of rules reaches f if
(2 - f) TP - f FP >= f P, so for each f the best set is one that is best for weights. Some of them
are tried.

Source:
    Covering with a beam: P. Clark and T. Niblett, The CN2 induction algorithm, Machine Learning 3
    (1989) 261-283. Rules looked for again: W. W. Cohen, Fast effective rule induction, ICML 1995,
    115-123. Weights for a fraction: W. Dinkelbach, On nonlinear fractional programming, Management
    Science 13 (1967) 492-498.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.learning.conditions import Condition, Rule, RuleSet
from overtaking.analysis.learning.examples import Examples

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Mask = NDArray[np.bool_]
Numbers = tuple[int, ...]
"""A rule as the numbers of its conditions."""

MAX_RULES, MAX_CONDITIONS = 12, 3
"""As many as a person reads."""

_BEAM = 24
_COSTS = (0.12, 0.2, 0.35, 0.5, 0.75, 1.0)
"""f / (2 - f) from f = 0.2 to 1: what a false alarm costs, where a hit gives 1."""

_RARE = 0.1
"""What is so in a smaller share of the examples is rare."""

_BETTERED = 3
"""Of so many sets, the best of all weights, the rules are looked for again: that takes longest."""

_MAX_PASSES = 6
"""So often at most is every rule of a set looked for again; most sets settle before."""

_LEAST_GAIN = 0.005
"""A rule, and a condition, must add as much as this share of all hits."""

_LEAST_NEW = 15
"""A rule must cover as many examples that no other covers: with fewer, chance looks like a rule."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    """What is searched.

    Attributes:
        holds: Where each condition holds, 0 or 1, shape (example, condition).
        may_join: Whether two conditions may stand in one rule, shape (condition, condition).
        wanted: What rules should cover, shape (example,).
        is_negated: Whether that is where the target is not so.
        gain: What it gives to cover an example that is wanted.
        cost: What it costs to cover another.
        least: The gain that is worth a condition or a rule.
    """

    holds: F32
    may_join: Mask
    wanted: Mask
    is_negated: bool
    gain: float
    cost: float
    least: float

    def value(self, hits: F64, misses: F64) -> F64:
        """What covering some examples is worth."""
        return self.gain * hits - self.cost * misses


def cover(
    examples: Examples,
    positive: Mask,
    conditions: Sequence[Condition],
    *,
    max_rules: int = MAX_RULES,
    max_conditions: int = MAX_CONDITIONS,
    on_round: Callable[[int, int], None] | None = None,
) -> RuleSet:
    """Learn a set of rules with a high F-measure.

    Args:
        examples: What to learn from.
        positive: Whether the target is so, shape (example,).
        conditions: What rules may be made of.
        max_rules: How many rules at most.
        max_conditions: How many conditions a rule may have.
        on_round: Called with the number of rounds that are done, and of all.

    Returns:
        The rules, the one that is worth most first; none where none is worth its words.
    """
    if not conditions or not positive.any():
        return RuleSet(rules=(), is_negated=False)
    limits = max_rules, max_conditions
    tasks = _tasks(positive, conditions, examples)
    step = _Steps(len(tasks) + min(_BETTERED, len(tasks)), on_round)
    found: list[_Found] = []
    for task in tasks:
        found.append(_found(task, positive, _rules(task, *limits)))
        step()
    best = sorted(found, key=lambda one: -one.reached)[:_BETTERED]
    for task, rules, _ in tuple(best):
        best.append(_found(task, positive, _bettered(task, rules, *limits)))
        step()
    task, rules, _ = max(best, key=lambda one: one.reached)
    ordered = sorted(rules, key=lambda one: -_worth(task, [one]))
    named = [Rule(conditions=tuple(conditions[n] for n in sorted(one))) for one in ordered]
    return RuleSet(rules=tuple(named), is_negated=task.is_negated)


class _Found(NamedTuple):
    """The rules that a search found, and the F-measure that they reach."""

    task: _Task
    rules: list[Numbers]
    reached: float


def _found(task: _Task, positive: Mask, rules: list[Numbers]) -> _Found:
    return _Found(task, rules, f_measure(_union(task, rules) ^ task.is_negated, positive))


class _Steps:
    """Counts rounds, and tells."""

    def __init__(self, total: int, tell: Callable[[int, int], None] | None) -> None:
        self._done, self._total, self._tell = 0, total, tell

    def __call__(self) -> None:
        self._done += 1
        if self._tell is not None:
            self._tell(self._done, self._total)


def _tasks(positive: Mask, conditions: Sequence[Condition], examples: Examples) -> list[_Task]:
    """A search for what is so, and unless that is rare one for what is not, for each weight."""
    holds = np.column_stack([one.holds(examples) for one in conditions]).astype(np.float32)
    may_join = _may_join(holds, [one.attribute.name for one in conditions])
    sides = (False,) if positive.mean() < _RARE else (False, True)
    return [
        _Task(
            holds=holds,
            may_join=may_join,
            wanted=~positive if is_negated else positive,
            is_negated=is_negated,
            gain=cost if is_negated else 1.0,
            cost=1.0 if is_negated else cost,
            least=_LEAST_GAIN * float(positive.sum()),
        )
        for is_negated in sides
        for cost in _COSTS
    ]


def f_measure(said: Mask, positive: Mask) -> float:
    """Harmonic mean of precision and recall, 0 where neither says anything."""
    hits = int((said & positive).sum())
    return 2.0 * hits / max(int(said.sum()) + int(positive.sum()), 1)


def _may_join(holds: F32, names: Sequence[str]) -> Mask:
    """Which conditions may stand together: on different attributes, or both ends of a range."""
    both = holds.T @ holds
    alone = np.diag(both)
    narrows = (both > 0.0) & (both < alone[:, None]) & (both < alone[None, :])
    same = np.array(names)[:, None] == np.array(names)[None, :]
    return ~same | narrows


def _rules(
    task: _Task, max_rules: int, max_conditions: int, before: Sequence[Numbers] = ()
) -> list[Numbers]:
    """Rules after those before, one after the other, then all without what is not needed."""
    found = list(before)
    is_open = ~_union(task, found)
    while len(found) < max_rules:
        rule = _best_rule(task, is_open, max_conditions)
        if not rule:
            break
        found.append(rule)
        is_open &= ~_covered(task, rule)
    return _needed(task, found)


def _bettered(
    task: _Task, rules: list[Numbers], max_rules: int, max_conditions: int
) -> list[Numbers]:
    """The rules after each was looked for again, given the others, and more were looked for."""
    found = rules
    for _ in range(_MAX_PASSES):
        before = found
        for place in range(len(before)):
            found = _replaced(task, found, place, max_conditions)
        found = _rules(task, max_rules, max_conditions, found)
        if found == before:
            break
    return found


def _replaced(task: _Task, rules: list[Numbers], place: int, max_conditions: int) -> list[Numbers]:
    """The rules with a better one in a place, if there is one."""
    if place >= len(rules):
        return rules
    others = rules[:place] + rules[place + 1 :]
    rule = _best_rule(task, ~_union(task, others), max_conditions)
    tried = [*others[:place], rule, *others[place:]] if rule else others
    return tried if _worth(task, tried) > _worth(task, rules) else rules


def _best_rule(task: _Task, is_open: Mask, max_conditions: int) -> Numbers:
    """The conjunction that adds most; a longer one must be worth its length."""
    hit, miss = task.holds[is_open & task.wanted], task.holds[is_open & ~task.wanted]
    share = len(hit) / max(len(hit) + len(miss), 1)
    beam: list[Numbers] = [()]
    best: tuple[float, Numbers] = (0.0, ())
    for _ in range(max_conditions):
        grown, hits, misses = _grown(task, hit, miss, beam)
        if not grown:
            break
        values = np.where(hits >= _LEAST_NEW, task.value(hits, misses), -np.inf)
        place = int(np.argmax(values))
        if values[place] > best[0] + task.least:
            best = (float(values[place]), grown[place])
        beam = _kept(grown, values, hits - share * (hits + misses))
    return best[1]


def _grown(task: _Task, hit: F32, miss: F32, beam: list[Numbers]) -> tuple[list[Numbers], F64, F64]:
    """Every rule of the beam with one condition more, and how many of each kind it covers.

    Counts are whole numbers below 2^24, which float32 adds up exactly in any order: the result does
    not depend on the number of threads.
    """
    may_join = np.array([task.may_join[list(one)].all(axis=0) for one in beam])
    for row, rule in enumerate(beam):
        may_join[row, list(rule)] = False
    rows, columns = np.nonzero(may_join)
    rules = [tuple(sorted((*beam[r], int(c)))) for r, c in zip(rows, columns, strict=True)]
    first = {rule: n for n, rule in reversed(list(enumerate(rules)))}
    places = np.array(sorted(first.values()), dtype=np.int64)
    hits, misses = (_inside(part, beam) @ part for part in (hit, miss))
    at = rows[places], columns[places]
    return (
        [rules[n] for n in places],
        hits[at].astype(np.float64),
        misses[at].astype(np.float64),
    )


def _inside(holds: F32, beam: list[Numbers]) -> F32:
    """Where each rule of the beam holds, shape (rule, example)."""
    return np.stack([holds[:, list(one)].all(axis=1) for one in beam]).astype(np.float32)


def _kept(grown: list[Numbers], values: F64, unusual: F64) -> list[Numbers]:
    """The rules to go on with: those worth most, then those that stand out most."""
    half = _BEAM // 2
    chosen = [*np.argsort(-values, kind="stable")[:half], *np.argsort(-unusual, kind="stable")]
    return [grown[n] for n in list(dict.fromkeys(int(n) for n in chosen[: 2 * _BEAM]))[:_BEAM]]


def _needed(task: _Task, rules: list[Numbers]) -> list[Numbers]:
    """The rules without those whose loss costs less than a rule is worth."""
    kept = list(rules)
    while len(kept) > 1:
        value = _worth(task, kept)
        losses = [value - _worth(task, kept[:n] + kept[n + 1 :]) for n in range(len(kept))]
        least = int(np.argmin(losses))
        if losses[least] >= task.least:
            break
        del kept[least]
    return kept


def _covered(task: _Task, rule: Numbers) -> Mask:
    return np.asarray(task.holds[:, list(rule)].all(axis=1))


def _union(task: _Task, rules: Sequence[Numbers]) -> Mask:
    found = np.zeros(len(task.wanted), np.bool_)
    for rule in rules:
        found |= _covered(task, rule)
    return found


def _worth(task: _Task, rules: Sequence[Numbers]) -> float:
    """What a set of rules is worth."""
    covered = _union(task, rules)
    hits = int((covered & task.wanted).sum())
    return task.gain * hits - task.cost * (int(covered.sum()) - hits)
