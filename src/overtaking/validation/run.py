"""Simulates a profile and holds it against what is known of real traffic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.model.events import Outcome
from overtaking.scenarios import sample
from overtaking.scenarios.schema_flow import Flow
from overtaking.sim import engine
from overtaking.validation import overtakes, ring, traffic
from overtaking.validation.figures import Figure, figures
from overtaking.validation.tally import Tally
from overtaking.validation.traffic import Batch

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.scenarios import Spec

Progress = Callable[[int, int], None]

CHUNK = 48
"""Simulations at a time."""

RING_SHARE = 8
"""One ring for so many simulations: it has all its vehicles for longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stratum:
    """Outcomes in one kind of weather.

    Attributes:
        name: One of `overtakes.STRATA`.
        counts: Simulations, by name of the outcome.
        shares: Weighted shares, by name of the outcome; None where there is no simulation.
    """

    name: str
    counts: dict[str, int]
    shares: dict[str, float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """What was found.

    Attributes:
        profile: Name of the profile.
        simulations: How many were simulated.
        seed: Seed of their random numbers.
        figures: Every figure.
        strata: Outcomes by weather.
    """

    profile: str
    simulations: int
    seed: int
    figures: tuple[Figure, ...]
    strata: tuple[Stratum, ...]

    @property
    def is_met(self) -> bool:
        """Whether every target is met."""
        return all(figure.met is not False for figure in self.figures)

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
        }


def validate(
    spec: Spec, road: Road, simulations: int, seed: int, progress: Progress | None = None
) -> Validation:
    """Simulate a profile and work out every figure.

    Args:
        spec: What to sample.
        road: Where.
        simulations: How many.
        seed: Seed of the random numbers.
        progress: Called with the number of simulations that are done, and of all.
    """
    tally, buffers = Tally(), engine.Buffers()
    for first in range(0, simulations, CHUNK):
        last = min(first + CHUNK, simulations)
        index = np.arange(first, last, dtype=np.uint64)
        batch = Batch.of(engine.simulate(sample(spec, road, seed, index), buffers=buffers))
        traffic.count(tally, batch)
        overtakes.count(tally, batch)
        if progress is not None:
            progress(last, simulations)
    rings = Tally() if isinstance(spec.traffic, Flow) else None
    if rings is not None:
        ring.count(rings, spec, road, seed, max(1, simulations // RING_SHARE))
    return Validation(
        profile=spec.name,
        simulations=simulations,
        seed=seed,
        figures=tuple(figures(tally, rings)),
        strata=_strata(tally),
    )


def _strata(tally: Tally) -> tuple[Stratum, ...]:
    shape = (len(overtakes.STRATA), len(Outcome))
    raw, weighted = (tally.total(name).reshape(shape) for name in ("raw_outcomes", "outcomes"))
    names = [outcome.name for outcome in Outcome]
    return tuple(
        Stratum(
            name=name,
            counts=dict(zip(names, map(int, raw[row]), strict=True)),
            shares={
                outcome: float(weight / weighted[row].sum()) if raw[row].any() else None
                for outcome, weight in zip(names, weighted[row], strict=True)
            },
        )
        for row, name in enumerate(overtakes.STRATA)
    )
