"""Simulates a profile and compares it with published measurements of real traffic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.result_methods import Plottable
from overtaking.analysis.validation import (
    accidents,
    changes,
    conflicts,
    overtakes,
    passes,
    recorded,
    ring,
    traffic,
)
from overtaking.analysis.validation.comparison import Rate, compare
from overtaking.analysis.validation.figures import (
    DEFINITIONS,
    PASSES,
    Figure,
    figures,
    figures_of_passes,
)
from overtaking.analysis.validation.tally import Tally
from overtaking.analysis.validation.traffic import Batch
from overtaking.core.arrays import Buffers
from overtaking.core.equality import ContentEquality
from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.core.representation import CompactRepr, json_values
from overtaking.model.verdicts import OvertakeClass
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.traffic_specification import FlowTraffic, TwoWayTraffic
from overtaking.scenarios.two_way_traffic import flows_per_second
from overtaking.sim import engine

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.analysis.validation.recorded import Comparison
    from overtaking.model.road import Road
    from overtaking.scenarios.specification import Specification

CHUNK = 48
"""Simulations at a time."""

STUDIED = tuple(OvertakeClass)[: OvertakeClass.UNSUCCESS_NCOL + 1]
"""The study's five classes."""

COUNTED = (traffic.count, changes.count, conflicts.count, accidents.count, overtakes.count)
"""Functions that add a batch of traffic in one direction to a tally."""

COUNTED_OF_PASSES = (passes.count, overtakes.count_classes)
"""Functions that add a batch of a two-way road to a tally."""

RING_SHARE = 8
"""Simulations per ring: a ring keeps all its vehicles for longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stratum(ContentEquality):
    """Classes in one kind of weather.

    Attributes:
        name: One of `overtakes.STRATA`.
        counts: Simulations, by name of the class.
        shares: Weighted shares, by name of the class; None where there is no simulation.
    """

    name: str
    counts: dict[str, int]
    shares: dict[str, float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation(CompactRepr, ContentEquality, Plottable):
    """The figures of a profile, its classes by weather, and its weights.

    Attributes:
        profile: Name of the profile.
        simulations: Number of simulations.
        seed: Seed of their random numbers.
        figures: Every figure.
        strata: Classes by weather.
        comparison: Weighted rates beside the rates of the profile without its proposal; empty for a
            profile without a proposal.
        recordings: What the profile's drivers and recorded ones do in traffic alike; None if no
            recordings were given.
    """

    profile: str
    simulations: int
    seed: int
    figures: tuple[Figure, ...]
    strata: tuple[Stratum, ...]
    comparison: tuple[Rate, ...] = ()
    recordings: Comparison | None = None

    @property
    def is_met(self) -> bool:
        """Whether every target is met, and every weighted rate agrees with the natural one."""
        met = all(figure.met is not False for figure in self.figures)
        return met and all(rate.agrees for rate in self.comparison)

    @property
    def missing(self) -> tuple[tuple[str, str], ...]:
        """The study's classes that did not occur in a kind of weather, as (weather, class)."""
        return tuple(
            (one.name, kind.title)
            for one in self.strata
            for kind in STUDIED
            if not one.counts[kind.title]
        )

    def values(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {
            "profile": self.profile,
            "simulations": self.simulations,
            "seed": self.seed,
            "met": self.is_met,
            "figures": [figure.values() for figure in self.figures],
            "strata": {
                one.name: {"counts": one.counts, "shares": one.shares} for one in self.strata
            },
            "missing": [list(pair) for pair in self.missing],
            "comparison": [rate.values() for rate in self.comparison],
            "recordings": self.recordings.values() if self.recordings else None,
        }


def validate(
    spec: Specification,
    road: Road,
    simulations: int,
    seed: int,
    progress: ProgressCallback | None = None,
    recordings: Path | None = None,
) -> Validation:
    """Simulate a profile and compute every figure.

    A profile with a proposal is simulated once more without it, with the next seed, to compare.

    Args:
        spec: The specification.
        road: Its road.
        simulations: Number of simulations.
        seed: Seed of the random numbers.
        progress: Called with the number of simulations that are done, and of all.
        recordings: A recording in CommonRoad's format or a folder of them, to compare with.
    """
    natural = natural_of(spec)
    runs = [(spec, seed)] + ([(natural, seed + 1)] if natural else [])
    step = ProgressCounter(len(runs) * simulations, progress)
    tallies = [_counted(drawn, road, simulations, own_seed, step) for drawn, own_seed in runs]
    tally, two_way = tallies[0], isinstance(spec.traffic, TwoWayTraffic)
    rings = Tally() if isinstance(spec.traffic, FlowTraffic) else None
    if rings is not None:
        ring.count(rings, spec, road, seed, max(1, simulations // RING_SHARE))
    return Validation(
        profile=spec.name,
        simulations=simulations,
        seed=seed,
        figures=tuple(
            figures_of_passes(tally, is_enriched=natural is not None)
            if two_way
            else figures(tally, rings)
        ),
        strata=_strata(tally),
        comparison=compare(tally, tallies[1], PASSES if two_way else DEFINITIONS)
        if natural
        else (),
        recordings=recorded.compare(spec, road, seed, recordings) if recordings else None,
    )


def natural_of(spec: Specification) -> Specification | None:
    """The specification without its proposal; None for a specification without a proposal."""
    return spec.model_copy(update={"proposal": None}) if spec.proposal else None


def _counted(
    spec: Specification, road: Road, simulations: int, seed: int, step: ProgressCounter
) -> Tally:
    """The tally of the simulations of a specification."""
    tally, buffers = Tally(), Buffers()
    two_way = isinstance(spec.traffic, TwoWayTraffic)
    for first in range(0, simulations, CHUNK):
        index = np.arange(first, min(first + CHUNK, simulations), dtype=np.uint64)
        runs = engine.simulate(ScenarioSource(spec, road, seed).sample(index), buffers=buffers)
        batch = Batch.of(runs, flows_per_second(spec, seed, index) if two_way else None)
        for count in COUNTED_OF_PASSES if two_way else COUNTED:
            count(tally, batch)
        step(len(index))
    return tally


def _strata(tally: Tally) -> tuple[Stratum, ...]:
    shape = (len(overtakes.STRATA), len(OvertakeClass))
    raw, weighted = (tally.total(name).reshape(shape) for name in ("raw_classes", "classes"))
    found: list[Stratum] = []
    for name, numbers, weights in zip(overtakes.STRATA, raw, weighted, strict=True):
        total = weights.sum() if numbers.any() else np.nan
        found.append(
            Stratum(
                name=name,
                counts={kind.title: int(numbers[kind]) for kind in OvertakeClass},
                shares={kind.title: json_values(weights[kind] / total) for kind in OvertakeClass},
            )
        )
    return tuple(found)
