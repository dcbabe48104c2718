"""Compares the paper's numbers with those of many simulated sets of the same size."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.reproduction import hidden
from overtaking.analysis.reproduction.designs import designs
from overtaking.analysis.reproduction.measures import POLICY, measured
from overtaking.analysis.reproduction.replicates import SIZE, Replicates, replicates
from overtaking.analysis.reproduction.statements import (
    COUNTS,
    Statement,
    Statistic,
    calibration,
    statements,
)
from overtaking.analysis.reproduction.variants import (
    PUSHES,
    Collided,
    Variant,
    collided,
    farther,
    other_starts,
    pushed,
)
from overtaking.analysis.result_methods import Plottable, Reportable
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError, check_in_range
from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.core.representation import CompactRepr, json_values
from overtaking.knowledge.toml_reader import numbers_below
from overtaking.scenarios.profiles import load_specification as checked_spec

if TYPE_CHECKING:
    from overtaking.core.arrays import F64
    from overtaking.data.recipe import Simulator
    from overtaking.model.road import Road
    from overtaking.scenarios.specification import Specification


STUDIES = ("pinto2023",)
"""Studies that can be reproduced; each is a profile too."""

PHYSICAL = "pinto2023-physical"
"""The profile of the same scenes with weather that acts by physics and drivers who decide."""

MOST_REPLICATES = 100_000

_OTHERS = 10
"""Replicates of the profile as it is for each one with other starts or pushes."""

_REACH = 0.025  # Share of the replicates beyond either end of the interval.


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(ContentEquality):
    """A number of the paper and ours, in the unit of the paper.

    Attributes:
        name: Its name in `paper.toml`.
        statement: The number and its standing.
        replicates: Our number in each replicate, NaN: nothing to measure; one value for a design.
        physical: Median of the replicates of `PHYSICAL`, NaN: nothing to measure.
    """

    name: str
    statement: Statement
    replicates: F64
    physical: float = math.nan

    @property
    def known(self) -> F64:
        """The numbers of replicates that have one."""
        return self.replicates[~np.isnan(self.replicates)]

    @property
    def is_design(self) -> bool:
        """Whether it is an input."""
        return self.statement.measure == Statistic.DESIGN

    @property
    def is_count(self) -> bool:
        """Whether it is a number of simulations."""
        return self.statement.measure in COUNTS

    @property
    def ours(self) -> float:
        """Median of the replicates."""
        return float(np.median(self.known)) if len(self.known) else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """The interval of 95 % of the replicates."""
        if not len(self.known):
            return math.nan, math.nan
        low, high = np.quantile(self.known, (_REACH, 1.0 - _REACH))
        return float(low), float(high)

    @property
    def percentile(self) -> float:
        """Share of the replicates below the paper's number [%]; those that equal it count half.

        Equal is what rounds to it. NaN for a design.
        """
        if self.is_design or not len(self.known):
            return math.nan
        paper, near = self.statement.quoted, self.statement.resolution
        below = (self.known < paper - near).mean()
        equal = (np.abs(self.known - paper) <= near).mean()
        return 100.0 * float(below + 0.5 * equal)

    @property
    def is_inside(self) -> bool | None:
        """Whether the interval holds the paper's number, within its rounding; None if unknown."""
        if not len(self.known):
            return None
        low, high = self.interval
        near = self.statement.resolution
        return low - near <= self.statement.quoted <= high + near

    def values(self) -> dict[str, Any]:
        """The comparison for JSON."""
        one, (low, high) = self.statement, self.interval
        return json_values(
            {
                "name": self.name,
                **{
                    name: getattr(one, name)
                    for name in ("about", "text", "outcome_class", "standing")
                },
                "unit": one.unit,
                "paper": one.quoted,
                "ours": self.ours,
                "low": low,
                "high": high,
                "percentile": self.percentile,
                "physical": self.physical,
                "inside": self.is_inside,
                "replicates": len(self.known),
                "note": one.note,
                "cause": one.cause if self.is_inside is False else "",
                "derived": one.stated.rationale,
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction(CompactRepr, ContentEquality, Plottable, Reportable):
    """A study and our replicates of its data set.

    Attributes:
        study: The paper, by the name of its profile.
        seed: Seed of the replicates.
        num_replicates: Number of sets of `SIZE` simulations.
        simulator: Name and version of the simulator.
        parameters_sha256: Hash over the present drivers and profile.
        is_frozen: Whether they are the fitted ones.
        comparisons: Every number of the paper.
        inferences: The weather that its means imply, by class.
        lawful: Legal overtakes by day and by night in our replicates.
        starts: Classes with the profile's starts, and with the other treatment of starts.
        pushes: Classes with the pushes of weather weaker and stronger; empty without pushes.
        collided: Means of the collided, by whether they had pulled out.
        farther: Share of the replicates whose collided are farther from the middle of all, in
            distance and speeds jointly, than the paper's.
    """

    study: str
    seed: int
    num_replicates: int
    simulator: str
    parameters_sha256: str
    is_frozen: bool
    comparisons: tuple[Comparison, ...]
    inferences: tuple[hidden.Inference, ...]
    lawful: tuple[hidden.Lawful, ...]
    starts: tuple[Variant, ...]
    pushes: tuple[Variant, ...]
    collided: tuple[Collided, ...]
    farther: float

    def values(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {
            "study": self.study,
            "policy": POLICY,
            "seed": self.seed,
            "calibration_seeds": [int(seed) for seed in calibration().seeds],
            "replicates": self.num_replicates,
            "simulations": self.num_replicates * SIZE,
            "simulator": self.simulator,
            "parameters_sha256": self.parameters_sha256,
            "frozen": self.is_frozen,
            "numbers": [one.values() for one in self.comparisons],
            "inferences": json_values(self.inferences),
            "lawful": json_values(self.lawful),
            "starts": json_values(self.starts),
            "pushes": json_values(self.pushes),
            "collided": json_values(self.collided),
            "farther": json_values(self.farther),
        }


def reproduce(
    spec: Specification,
    road: Road,
    num_replicates: int,
    seed: int,
    simulator: Simulator,
    progress: ProgressCallback | None = None,
) -> Reproduction:
    """Simulate replicates of the paper's data set, and compare its numbers with theirs.

    Args:
        spec: The profile of the study.
        road: Its road.
        num_replicates: Number of sets as large as the paper's.
        seed: Seed of the random numbers; none that the drivers were fitted with.
        simulator: The simulator.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: The seed is one of the calibration, or a number is out of range.
    """
    _check(num_replicates, seed)
    inputs, beside = designs(spec, road), checked_spec(PHYSICAL)
    few = -(-num_replicates // _OTHERS)
    pushes = {one: found for one in PUSHES if (found := pushed(spec, one)) is not None}
    step = ProgressCounter((2 * num_replicates + (1 + len(pushes)) * few) * SIZE, progress)

    def run(one: Specification, number: int) -> Replicates:
        return replicates(one, road, seed, number, simulator, step)

    found, physical = run(spec, num_replicates), run(beside, num_replicates)
    other, digest = other_starts(spec), parameter_hash(spec)
    return Reproduction(
        study=spec.name,
        seed=seed,
        num_replicates=num_replicates,
        simulator=f"{simulator.name} {simulator.version}",
        parameters_sha256=digest,
        is_frozen=digest == calibration().parameters_sha256,
        comparisons=_compared(found, physical, inputs),
        inferences=hidden.inferences(),
        lawful=hidden.lawful(found),
        starts=(
            Variant.of(spec.starts.allow_doomed, found),
            Variant.of(other.starts.allow_doomed, run(other, few)),
        ),
        pushes=tuple(Variant.of(factor, run(one, few)) for factor, one in pushes.items()),
        collided=collided(found),
        farther=farther(found),
    )


def _compared(
    found: Replicates, physical: Replicates, inputs: dict[str, float]
) -> tuple[Comparison, ...]:
    """Every number of the paper beside ours."""
    comparisons: list[Comparison] = []
    for name, one in statements().items():
        if one.measure == Statistic.DESIGN:
            ours = beside = np.array([inputs[one.feature]], np.float64)
        else:
            ours, beside = measured(found, one), measured(physical, one)
        known = beside[~np.isnan(beside)] / one.factor
        comparisons.append(
            Comparison(
                name=name,
                statement=one,
                replicates=ours / one.factor,
                physical=float(np.median(known)) if len(known) else math.nan,
            )
        )
    return tuple(comparisons)


def parameter_hash(spec: Specification) -> str:
    """SHA-256 over the numbers of the drivers and of the profile, in hexadecimal."""
    decided = {
        "population": numbers_below("drivers.toml", spec.drivers.population),
        "profile": spec.to_dict(),
    }
    text = json.dumps(decided, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _check(num_replicates: int, seed: int) -> None:
    check_in_range(num_replicates, 1, MOST_REPLICATES, what="replicates", where="reproduce")
    if seed in calibration().seeds:
        used = ", ".join(f"{one:g}" for one in calibration().seeds)
        raise ConfigError(
            what="seed",
            where="reproduce",
            expected=f"none of {used}, with which the drivers were fitted",
            got=seed,
            next_step="choose another",
        )
