"""Label leaks: classes that do not occur in a stratum of the data where they should."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.stats.columns import BY_NAME, CENSORED, NOMINAL, WEATHER
from overtaking.analysis.stats.sample import Sample
from overtaking.core.arrays import Mask
from overtaking.core.equality import ContentEquality

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAX_CHANCE = 0.01
"""Largest probability by chance of a missing class that is reported."""

MAX_VALUES = 12
"""Most values of a number whose values are strata: the weather of presets."""


@dataclass(frozen=True, slots=True)
class Leak(ContentEquality):
    """A class that does not occur in a stratum, where it should by its frequency.

    Attributes:
        feature: The feature.
        level: Its level or value.
        name: The class that is missing.
        size: Simulations in the stratum.
        expected: Expected number of the class in the stratum.
        chance: Probability of none if class and feature were independent.
    """

    feature: str
    level: str
    name: str
    size: int
    expected: float
    chance: float

    @property
    def sentence(self) -> str:
        """The warning in words."""
        return (
            f"No {self.name} among the {self.size:,} simulations with {self.feature} = "
            f"{self.level}, where {self.expected:,.1f} were to be expected if class and feature "
            f"were independent (probability of none: {_small(self.chance)}). Either the world "
            f"rules it out or the label does: a model of {self.name} trained on these data may "
            f"learn {self.feature}."
        )


def leaks(sample: Sample) -> tuple[Leak, ...]:
    """Find classes that are missing where they should occur; the least probable first.

    Weights are not applied: the question is whether a combination occurs at all. Censored
    simulations are left out.
    """
    rated = sample.is_rated
    found: list[Leak] = []
    for name, members in sample.groups():
        number = int((members & rated).sum())
        if name == CENSORED or not number:
            continue
        found += [
            one
            for feature, level, stratum in _strata(sample)
            if (one := _leak(feature, level, name, stratum[rated], members[rated], number))
            is not None
        ]
    return tuple(sorted(found, key=lambda one: (one.chance, one.feature, one.level)))


def _leak(
    feature: str, level: str, name: str, stratum: Mask, members: Mask, number: int
) -> Leak | None:
    """The leak of a class in a stratum, if there is one."""
    size, total = int(stratum.sum()), len(stratum)
    if not 0 < size < total or (stratum & members).any():
        return None
    # Fisher's exact probability: all members of the class fall outside the stratum.
    chance = math.exp(_log_choose(total - size, number) - _log_choose(total, number))
    if chance > MAX_CHANCE:
        return None
    return Leak(feature, level, name, size, number * size / total, chance)


def _strata(sample: Sample) -> list[tuple[str, str, Mask]]:
    """Each level of a name, and each value of weather that takes few, with its simulations."""
    strata: list[tuple[str, str, Mask]] = []
    for feature in NOMINAL:
        codes = sample.codes(feature.name)
        strata += [(feature.name, level, codes == n) for n, level in enumerate(feature.levels)]
    for name in WEATHER:
        values = sample.values(name)
        different: NDArray[np.float64] = np.unique(values[~np.isnan(values)])
        if 1 < len(different) <= MAX_VALUES:
            unit = BY_NAME[name].unit
            strata += [(name, f"{value:g} {unit}", values == value) for value in different]
    return strata


def _log_choose(total: int, chosen: int) -> float:
    """Logarithm of the number of ways to choose, minus infinity if there is none."""
    if chosen > total:
        return -math.inf
    return math.lgamma(total + 1) - math.lgamma(chosen + 1) - math.lgamma(total - chosen + 1)


def _small(chance: float) -> str:
    """A small probability in words."""
    return f"{chance:.2g}" if chance >= 1e-6 else "below one in a million"
