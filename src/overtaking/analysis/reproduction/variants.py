"""Class frequencies under other starts and pushes, and which vehicles collide."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.reproduction.measures import POLICY, measured
from overtaking.analysis.reproduction.replicates import Replicates, members
from overtaking.analysis.reproduction.statements import Statement, Statistic, statements
from overtaking.analysis.stats.columns import PAPER_CLASSES
from overtaking.core.equality import ContentEquality
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from overtaking.core.arrays import F64
    from overtaking.scenarios.specification import Specification

PUSHES = (0.0, 0.5, 1.0, 2.0)
"""Factors on the pushes of the profile: their size is a choice."""

COLLISION = OvertakeClass.UNSUCCESS_COL.title
_JOINT = ("D", "SE", "SP")
_FEWEST = 10
"""Replicates below which three means are not compared jointly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant(ContentEquality):
    """Classes of simulations of a specification in which one thing is different.

    Attributes:
        value: What is different: whether starts are as drawn, or the factor on the pushes.
        simulations: Number of simulations.
        shares: Share of each class of the paper.
    """

    value: float
    simulations: int
    shares: dict[str, float]

    @classmethod
    def of(cls, value: float, found: Replicates) -> Variant:
        """The classes of some replicates."""
        classes = found.classes[POLICY]
        shares = {name: float(members(classes, name).mean()) for name in PAPER_CLASSES}
        return cls(value=value, simulations=classes.size, shares=shares)


def other_starts(spec: Specification) -> Specification:
    """The same specification with the other treatment of starts."""
    starts = spec.starts.model_copy(update={"allow_doomed": not spec.starts.allow_doomed})
    return spec.model_copy(update={"starts": starts})


def pushed(spec: Specification, factor: float) -> Specification | None:
    """The same specification with pushes so much stronger; None if weather acts by physics."""
    given = spec.weather.pushes
    if given is None:
        return None
    pushes = given.model_copy(update={"accel_mps2": factor * given.accel_mps2})
    return spec.model_copy(update={"weather": spec.weather.model_copy(update={"pushes": pushes})})


@dataclass(frozen=True, slots=True, kw_only=True)
class Collided(ContentEquality):
    """The collided of all replicates, or a part of them.

    Attributes:
        begun: Whether the attempt had begun before the contact; None for all of them.
        simulations: Number of simulations.
        means: Means of D [m], SE and SP [km/h]; NaN without a simulation.
    """

    begun: bool | None
    simulations: int
    means: dict[str, float]


def collided(found: Replicates) -> tuple[Collided, ...]:
    """All that collided, those that touched before they pulled out, and the others."""
    inside = members(found.classes[POLICY], COLLISION)
    begun = found.columns["BEGUN"] > 0.0
    parts = {None: inside, False: inside & ~begun, True: inside & begun}
    stated = _stated()
    return tuple(
        Collided(
            begun=which,
            simulations=int(part.sum()),
            means={
                name: _mean(found.columns[name][part]) / one.factor for name, one in stated.items()
            },
        )
        for which, part in parts.items()
    )


def farther(found: Replicates) -> float:
    """Share of replicates whose collided lie farther from the middle than the paper's, jointly.

    Far is meant in D, SE and SP at once, by the distance of Mahalanobis. NaN for few replicates.
    """
    stated = _stated().values()
    ours = np.stack([measured(found, one) for one in stated], axis=1)
    ours = ours[~np.isnan(ours).any(axis=1)]
    if len(ours) < _FEWEST:
        return math.nan
    middle, spread = ours.mean(axis=0), np.linalg.inv(np.cov(ours, rowvar=False))

    def distance(points: F64) -> F64:
        return np.einsum("ij,jk,ik->i", points - middle, spread, points - middle)

    paper = distance(np.array([[one.stated.number for one in stated]]))
    return float((distance(ours) > paper).mean())


def _stated() -> dict[str, Statement]:
    """What the paper says of its collided, by feature."""
    every = [
        one
        for one in statements().values()
        if one.outcome_class == COLLISION and one.measure == Statistic.MEAN
    ]
    return {name: next(one for one in every if one.feature == name) for name in _JOINT}


def _mean(values: F64) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan
