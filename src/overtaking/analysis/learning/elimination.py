"""Which factor tells most: sequential backward selection.

From all factors, the one is dropped without which a model foretells best; then the next, until one
is left. The last to go is the most important. What the first, the first two, ... foretell is then
measured on examples that took no part in the choice.

Source:
    T. Marill and D. M. Green, On the effectiveness of receptors in recognition systems, IEEE Trans.
    Inf. Theory 9 (1963) 11-17. As a table of cumulative accuracy: Human-like Decision-Making System
    for Overtaking Stationary Vehicles Based on Traffic Scene Interpretation, Sensors 21 (2021)
    6768.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.learning.examples import Examples
from overtaking.analysis.learning.models import fit, probabilities, trees
from overtaking.analysis.learning.scores import grouped_interval
from overtaking.analysis.learning.splits import Split, split

I64 = NDArray[np.int64]
Outcomes = NDArray[Any]
Factors = Mapping[str, tuple[str, ...]]
Step = Callable[[], None]

_ROUNDS, _FINAL_ROUNDS = 25, 100
_MOST = 5000
"""Examples that a choice is made on: more cost time and change little."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranked:
    """A factor in the order of importance.

    Attributes:
        name: The factor.
        attributes: Names of its attributes.
        accuracy: Share foretold rightly from this factor and those before it.
        low: Lower limit of its 95 % confidence.
        high: Upper limit.
        gain: What it adds to those before it.
        best_rank: Its best rank among the repetitions, from 1.
        worst_rank: Its worst rank.
    """

    name: str
    attributes: tuple[str, ...]
    accuracy: float
    low: float
    high: float
    gain: float
    best_rank: int
    worst_rank: int

    def values(self) -> dict[str, Any]:
        """All of it for JSON."""
        return {
            "factor": self.name,
            "attributes": list(self.attributes),
            "accuracy": self.accuracy,
            "accuracy_low": self.low,
            "accuracy_high": self.high,
            "gain": self.gain,
            "best_rank": self.best_rank,
            "worst_rank": self.worst_rank,
        }


def num_fits(factors: int, repeats: int) -> int:
    """How many models are fitted to rank some factors."""
    return repeats * (factors * (factors + 1) // 2 - 1) + factors


def rank(
    examples: Examples,
    outcomes: Outcomes,
    factors: Factors,
    parts: Split,
    *,
    seed: int,
    repeats: int,
    step: Step,
) -> tuple[Ranked, ...]:
    """Rank factors by sequential backward selection.

    Args:
        examples: The examples.
        outcomes: What is to be foretold, shape (example,).
        factors: The attributes of each factor.
        parts: The examples to choose by, and those to measure by.
        seed: Of all choices.
        repeats: How often to rank, each time on other examples; the first order is kept, the others
            say how sure it is.
        step: Called after each fit.
    """
    orders = [
        _order(examples, outcomes, factors, parts[0], seed=seed + n, step=step)
        for n in range(repeats)
    ]
    accuracies = _accuracies(examples, outcomes, factors, parts, orders[0], seed=seed, step=step)
    ranks = {name: [order.index(name) + 1 for order in orders] for name in orders[0]}
    before = [0.0, *(one[0] for one in accuracies)]
    return tuple(
        Ranked(
            name=name,
            attributes=factors[name],
            accuracy=share,
            low=low,
            high=high,
            gain=share - before[place],
            best_rank=min(ranks[name]),
            worst_rank=max(ranks[name]),
        )
        for place, (name, (share, low, high)) in enumerate(zip(orders[0], accuracies, strict=True))
    )


def _order(
    examples: Examples, outcomes: Outcomes, factors: Factors, known: I64, *, seed: int, step: Step
) -> list[str]:
    """The factors, most important first, by dropping one after the other."""
    learned, judged = split(examples.groups[known], seed, share=0.5)
    first, second = known[learned[: _MOST // 2]], known[judged[: _MOST // 2]]
    left, dropped = list(factors), []
    while len(left) > 1:
        scores: list[float] = []
        for name in left:
            kept = [one for one in left if one != name]
            right = _rightly(examples, outcomes, (first, second), _names(factors, kept), seed=seed)
            scores.append(float(right.mean()))
            step()
        # Of equals the later one goes, so that the order of the factors decides, not chance.
        worst = len(left) - 1 - int(np.argmax(scores[::-1]))
        dropped.append(left.pop(worst))
    return [*left, *reversed(dropped)]


def _accuracies(
    examples: Examples,
    outcomes: Outcomes,
    factors: Factors,
    parts: Split,
    order: Sequence[str],
    *,
    seed: int,
    step: Step,
) -> list[tuple[float, float, float]]:
    """Accuracy and its limits with the first factor, the first two, and so on."""
    found: list[tuple[float, float, float]] = []
    for number in range(1, len(order) + 1):
        names = _names(factors, order[:number])
        right = _rightly(examples, outcomes, parts, names, seed=seed, rounds=_FINAL_ROUNDS)
        low, high = grouped_interval(right, examples.groups[parts[1]])
        found.append((float(right.mean()), low, high))
        step()
    return found


def _names(factors: Factors, chosen: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for factor in chosen for name in factors[factor])


def _rightly(
    examples: Examples,
    outcomes: Outcomes,
    parts: Split,
    names: tuple[str, ...],
    *,
    seed: int,
    rounds: int = _ROUNDS,
) -> NDArray[np.bool_]:
    """Which examples of the second part are foretold from those of the first."""
    known, kept = parts
    seen = examples.with_attributes(names)
    model = fit(trees(seen.attributes, seed, rounds=rounds), seen.values[known], outcomes[known])
    said = model.classes_[np.argmax(probabilities(model, seen.values[kept]), axis=1)]
    return said == outcomes[kept]
