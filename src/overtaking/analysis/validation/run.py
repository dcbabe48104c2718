"""Simulates a profile and holds it against what is known of real traffic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.validation import overtakes, ring, traffic
from overtaking.analysis.validation.comparison import Rate, compare
from overtaking.analysis.validation.figures import Figure, figures
from overtaking.analysis.validation.tally import Tally
from overtaking.analysis.validation.traffic import Batch
from overtaking.core.memory import Buffers
from overtaking.core.summary import Summarized
from overtaking.model.labels import OvertakeClass
from overtaking.scenarios import sample
from overtaking.scenarios.schema_flow import Flow
from overtaking.sim import engine

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.scenarios import Spec

Progress = Callable[[int, int], None]

CHUNK = 48
"""Simulations at a time."""

STUDIED = (
    OvertakeClass.NO_ATTEMPT,
    OvertakeClass.SUCCESS_I,
    OvertakeClass.SUCCESS_L,
    OvertakeClass.UNSUCCESS_COL,
    OvertakeClass.UNSUCCESS_NCOL,
)
"""The study's five classes."""

RING_SHARE = 8
"""One ring for so many simulations: it has all its vehicles for longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stratum:
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
class Validation(Summarized):
    """What was found.

    Attributes:
        profile: Name of the profile.
        simulations: How many were simulated.
        seed: Seed of their random numbers.
        figures: Every figure.
        strata: Classes by weather.
        comparison: Weighted rates beside those of the profile without its proposal; empty for a
            profile that has none.
    """

    profile: str
    simulations: int
    seed: int
    figures: tuple[Figure, ...]
    strata: tuple[Stratum, ...]
    comparison: tuple[Rate, ...] = ()

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
        """The same for machines."""
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
        }


def validate(
    spec: Spec, road: Road, simulations: int, seed: int, progress: Progress | None = None
) -> Validation:
    """Simulate a profile and work out every figure.

    A profile with a proposal is simulated once more without it, with the next seed, to compare.

    Args:
        spec: What to sample.
        road: Where.
        simulations: How many.
        seed: Seed of the random numbers.
        progress: Called with the number of simulations that are done, and of all.
    """
    natural = natural_of(spec)
    runs = [(spec, seed)] + ([(natural, seed + 1)] if natural else [])
    tallies: list[Tally] = []
    for number, (drawn, own_seed) in enumerate(runs):
        done = _onwards(progress, number * simulations, len(runs) * simulations)
        tallies.append(_counted(drawn, road, simulations, own_seed, done))
    tally = tallies[0]
    rings = Tally() if isinstance(spec.traffic, Flow) else None
    if rings is not None:
        ring.count(rings, spec, road, seed, max(1, simulations // RING_SHARE))
    return Validation(
        profile=spec.name,
        simulations=simulations,
        seed=seed,
        figures=tuple(figures(tally, rings)),
        strata=_strata(tally),
        comparison=compare(*tallies) if natural else (),
    )


def natural_of(spec: Spec) -> Spec | None:
    """The specification without its proposal, None if it has none."""
    return spec.model_copy(update={"proposal": None}) if spec.proposal else None


def _onwards(progress: Progress | None, before: int, total: int) -> Callable[[int], None]:
    def tell(done: int) -> None:
        if progress is not None:
            progress(before + done, total)

    return tell


def _counted(
    spec: Spec, road: Road, simulations: int, seed: int, tell: Callable[[int], None]
) -> Tally:
    """What was counted in the simulations of a specification."""
    tally, buffers = Tally(), Buffers()
    for first in range(0, simulations, CHUNK):
        last = min(first + CHUNK, simulations)
        index = np.arange(first, last, dtype=np.uint64)
        batch = Batch.of(engine.simulate(sample(spec, road, seed, index), buffers=buffers))
        traffic.count(tally, batch)
        overtakes.count(tally, batch)
        tell(last)
    return tally


def _strata(tally: Tally) -> tuple[Stratum, ...]:
    shape = (len(overtakes.STRATA), len(OvertakeClass))
    raw, weighted = (tally.total(name).reshape(shape) for name in ("raw_classes", "classes"))
    names = [kind.title for kind in OvertakeClass]
    return tuple(
        Stratum(
            name=name,
            counts=dict(zip(names, map(int, raw[row]), strict=True)),
            shares={
                kind: float(weight / weighted[row].sum()) if raw[row].any() else None
                for kind, weight in zip(names, weighted[row], strict=True)
            },
        )
        for row, name in enumerate(overtakes.STRATA)
    )
