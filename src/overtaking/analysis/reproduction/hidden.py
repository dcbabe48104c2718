"""The weather that the paper's means imply for each class, and legal overtakes by light.

The paper prints means of fog and rain by class. Its weather comes from a few presets of CARLA, so
only some splits of a class over the presets have these means. There may be one split, or all of
them may agree on the number of nights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.reproduction.statements import statements
from overtaking.core.equality import ContentEquality
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.analysis.reproduction.replicates import Replicates

COMPLETED = (OvertakeClass.SUCCESS_I, OvertakeClass.SUCCESS_L, OvertakeClass.SUCCESS_U)


@dataclass(frozen=True, slots=True, kw_only=True)
class Inference(ContentEquality):
    """The weather that the means of a class imply, if CARLA's presets were used unmodified.

    Attributes:
        scope: The class.
        simulations: Its size.
        means: The printed means, by feature.
        splits: Number of splits over weathers that have these means.
        nights: The fewest and the most nights among these splits; None without one.
    """

    scope: str
    simulations: int
    means: dict[str, float]
    splits: int
    nights: tuple[int, int] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Lawful(ContentEquality):
    """Completed overtakes by day or by night, and the legal ones, over all replicates.

    Attributes:
        policy: The policy that decides on legality.
        is_night: Whether it is night.
        completed: Number of completed overtakes.
        legal: Number of legal ones among them.
    """

    policy: str
    is_night: bool
    completed: int
    legal: int


def inferences() -> tuple[Inference, ...]:
    """The inferences of the classes whose mean fog is printed."""
    found = [one for one in statements().values() if one.feature == "FOG" and one.measure == "mean"]
    return tuple(_inference(one.outcome_class) for one in found)


def _inference(scope: str) -> Inference:
    """Every split of a class over the paper's weathers that has its printed means."""
    about = [one for one in statements().values() if one.outcome_class == scope]
    size = next(round(one.quoted) for one in about if one.measure == "count")
    printed = {
        one.feature: one
        for one in about
        if one.measure == "mean" and one.feature in ("FOG", "PREC")
    }
    kinds = weathers(tuple(printed))
    numbers = splits(len(kinds), size)
    fits = np.ones(len(numbers), bool)
    for index, statement in enumerate(printed.values()):
        means = numbers @ np.array([kind[index] for kind in kinds]) / size
        fits &= np.abs(means - statement.quoted) <= statement.resolution
    nights = numbers[fits] @ np.array([kind[-1] for kind in kinds], np.int64)
    return Inference(
        scope=scope,
        simulations=size,
        means={name: one.quoted for name, one in printed.items()},
        splits=int(fits.sum()),
        nights=(int(nights.min()), int(nights.max())) if fits.any() else None,
    )


def weathers(features: tuple[str, ...]) -> tuple[tuple[float, ...], ...]:
    """The paper's weathers as far as some features and the light tell them apart.

    Args:
        features: Out of FOG and PREC.

    Returns:
        The features of each [%], and last 1 for a night and 0 for a day.
    """
    kinds: set[tuple[float, ...]] = set()
    for one in weather_presets().values():
        if one.in_pinto2023:
            known = {"FOG": one.fog_density_percent, "PREC": one.precipitation_percent}
            night = float(one.sun_altitude_deg < 0.0)
            kinds.add((*(known[name] for name in features), night))
    return tuple(sorted(kinds))


def splits(kinds: int, size: int) -> NDArray[np.int64]:
    """Every way to split `size` things over `kinds` kinds, shape (way, kind)."""
    ways = np.zeros((1, 0), np.int64)
    left = np.array([size], np.int64)
    for _ in range(kinds - 1):
        ends = np.cumsum(left + 1)
        taken = np.arange(ends[-1]) - np.repeat(ends - (left + 1), left + 1)
        ways = np.column_stack([np.repeat(ways, left + 1, axis=0), taken])
        left = np.repeat(left, left + 1) - taken
    return np.column_stack([ways, left])


def lawful(of: Replicates) -> tuple[Lawful, ...]:
    """Legal shares of completed overtakes by day and by night, under each policy."""
    night = of.columns["NIGHT"] > 0.0
    found: list[Lawful] = []
    for policy, classes in of.classes.items():
        completed = np.isin(classes, COMPLETED)
        legal = classes == OvertakeClass.SUCCESS_L
        found += [
            Lawful(
                policy=policy,
                is_night=is_night,
                completed=int((completed & (night == is_night)).sum()),
                legal=int((legal & (night == is_night)).sum()),
            )
            for is_night in (False, True)
        ]
    return tuple(found)
