"""The importance of factors: sequential backward selection.

From all factors, the one without which a model predicts best is dropped, then the next, until one
is left. The last one to go is the most important. The accuracy with the first factor, the first two
and so on is then measured on examples that took no part in the choice.

Source:
    T. Marill and D. M. Green, On the effectiveness of receptors in recognition systems, IEEE Trans.
    Inf. Theory 9 (1963) 11-17. As a table of cumulative accuracy: Human-like Decision-Making System
    for Overtaking Stationary Vehicles Based on Traffic Scene Interpretation, Sensors 21 (2021)
    6768.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from overtaking.analysis.learning.examples import Examples
from overtaking.analysis.learning.models import Outcomes, Split, predicted_right, split
from overtaking.analysis.learning.scores import grouped_interval
from overtaking.core.arrays import Mask
from overtaking.core.equality import ContentEquality

Factors = Mapping[str, tuple[str, ...]]

_ROUNDS, _FINAL_ROUNDS = 25, 100
_MOST = 5000
"""Most examples that a choice is made on: more cost time and change little."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranked(ContentEquality):
    """A factor in the order of importance.

    Attributes:
        factor: Its name.
        attributes: Names of its attributes.
        accuracy: Accuracy with this factor and those before it.
        accuracy_low: Lower limit of its 95 % confidence interval.
        accuracy_high: Upper limit.
        gain: Accuracy less that without this factor.
        best_rank: Its best rank among the repetitions, from 1.
        worst_rank: Its worst rank.
    """

    factor: str
    attributes: tuple[str, ...]
    accuracy: float
    accuracy_low: float
    accuracy_high: float
    gain: float
    best_rank: int
    worst_rank: int


def num_fits(factors: int, repeats: int) -> int:
    """Number of models that are fitted to rank some factors."""
    return repeats * (factors * (factors + 1) // 2 - 1) + factors


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """The ranked factors, and the examples for it.

    Attributes:
        examples: The examples.
        outcomes: What to predict, shape (example,).
        factors: The attributes of each factor.
        parts: The examples to choose by, and those to measure by.
        seed: Seed of all choices.
        step: Called after each fit.
    """

    examples: Examples
    outcomes: Outcomes
    factors: Factors
    parts: Split
    seed: int
    step: Callable[[], None]

    def rank(self, repeats: int) -> tuple[Ranked, ...]:
        """Rank the factors by sequential backward selection.

        Args:
            repeats: Number of rankings, each on other examples; the first order is returned, the
                others show its stability.
        """
        orders = [self._order(self.seed + n) for n in range(repeats)]
        found: list[Ranked] = []
        for number, name in enumerate(orders[0], start=1):
            right = self._right(orders[0][:number], self.parts, self.seed, _FINAL_ROUNDS)
            low, high = grouped_interval(right, self.examples.groups[self.parts[1]])
            ranks = [order.index(name) + 1 for order in orders]
            accuracy = float(right.mean())
            found.append(
                Ranked(
                    factor=name,
                    attributes=self.factors[name],
                    accuracy=accuracy,
                    accuracy_low=low,
                    accuracy_high=high,
                    gain=accuracy - (found[-1].accuracy if found else 0.0),
                    best_rank=min(ranks),
                    worst_rank=max(ranks),
                )
            )
        return tuple(found)

    def _order(self, seed: int) -> list[str]:
        """The factors, most important first, by dropping one after the other."""
        known = self.parts[0]
        learned, judged = split(self.examples.groups[known], seed, share=0.5)
        parts = known[learned[: _MOST // 2]], known[judged[: _MOST // 2]]
        left, dropped = list(self.factors), list[str]()
        while len(left) > 1:
            scores = [
                self._right([one for one in left if one != name], parts, seed, _ROUNDS).mean()
                for name in left
            ]
            # Of equals the later one goes, so that the order of the factors decides, not chance.
            dropped.append(left.pop(len(left) - 1 - int(np.argmax(scores[::-1]))))
        return [*left, *reversed(dropped)]

    def _right(self, chosen: Iterable[str], parts: Split, seed: int, rounds: int) -> Mask:
        """Which examples of the second part some factors predict rightly."""
        names = tuple(name for factor in chosen for name in self.factors[factor])
        seen = self.examples.with_attributes(names)
        right = predicted_right(
            seen.attributes, seen.values, self.outcomes, parts, seed=seed, rounds=rounds
        )
        self.step()
        return right
