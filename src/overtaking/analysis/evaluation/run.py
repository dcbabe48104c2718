"""Simulates the same scenes with every driver, and compares them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from overtaking.analysis.evaluation import bootstrap, worst
from overtaking.analysis.evaluation.endpoints import EVERY, PRIMARY, Endpoint
from overtaking.analysis.evaluation.margins import MARGINS, of_batch
from overtaking.analysis.evaluation.measures import Columns, columns
from overtaking.analysis.evaluation.results import Contrast, Evaluation, Margin, Rate, Worst
from overtaking.analysis.validation.overtakes import STRATA, strata
from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.labels.labelling import label
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import MODEL_VERSION

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from overtaking.analysis.validation.tally import Array
    from overtaking.core.arrays import F64
    from overtaking.model.road import Road
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories
    from overtaking.scenarios.specification import Specification

    Simulate = Callable[[Scenario], Trajectories]

CHUNK: Final = 128
"""Scenes at a time: as many as fit into half a gigabyte."""

STAY: Final = "stay"
"""The driver that time is gained over."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contestant:
    """A driver.

    Attributes:
        name: Its name, short.
        source: The words that name it.
        simulate: Simulates scenes with it at the ego's wheel.
        digest: SHA-256 of its file, empty if unknown.
        observe: What it observes, in a word.
        action: What it answers.
    """

    name: str
    simulate: Simulate
    source: str = ""
    digest: str = ""
    observe: str = "human"
    action: str = ""


@dataclass(slots=True)
class _Seen:
    """What is kept of one driver: columns and margins by chunk, and the worst scenes."""

    columns: list[Columns] = field(default_factory=list)
    margins: list[dict[str, tuple[Array, Array]]] = field(default_factory=list)
    worst: list[Worst] = field(default_factory=list)


def scenes_of(spec: Specification) -> Specification:
    """A specification whose proposal bends the scene and the others, and nothing of the ego.

    Its density is the marginal of that of the profile: traits of the ego are drawn as they are met,
    and the weights are those of scene and others (ADR 44).
    """
    if spec.proposal is None:
        return spec
    bent = tuple(one.without_ego_quantities() for one in spec.proposal)
    return spec.model_copy(update={"proposal": bent})


def evaluate(
    spec: Specification,
    road: Road,
    simulations: int,
    seed: int,
    *,
    policy: Contestant,
    references: Iterable[Contestant],
    stay: Contestant,
    progress: ProgressCallback | None = None,
) -> Evaluation:
    """Simulate the same scenes with a policy and its references.

    Args:
        spec: What scenes to draw.
        road: Their road.
        simulations: How many.
        seed: Seed of their random numbers.
        policy: The driver that is evaluated.
        references: Drivers to compare it with.
        stay: The driver that time is gained over.
        progress: Called with the number of simulations that are done, and of all.
    """
    against = list(references)
    every = {one.name: one for one in (stay, policy, *against)}
    step = ProgressCounter(simulations * len(every), progress)
    seen = {name: _Seen() for name in every}
    drawn_from, weights, weathers = scenes_of(spec), [], []
    for first in range(0, simulations, CHUNK):
        index = np.arange(first, min(first + CHUNK, simulations), dtype=np.uint64)
        scenario = ScenarioSource(drawn_from, road, seed).sample(index)
        weights.append(scenario.weight)
        weathers.append(np.stack(strata(scenario.weather)))
        _drive(scenario, every, seen, step, policy.name)
    weight = np.concatenate(weights)
    found = {name: _joined(one.columns) for name, one in seen.items()}
    named = [policy.name, *(one.name for one in against)]
    rates, contrasts = _compared(
        weight, np.concatenate(weathers, axis=1), {name: found[name] for name in named}
    )
    effective, largest = bootstrap.concentration(weight)
    return Evaluation(
        policy=policy.name,
        references=tuple(named[1:]),
        profile=spec.name,
        simulations=simulations,
        seed=seed,
        source=policy.source,
        digest=policy.digest,
        observe=policy.observe,
        action=policy.action,
        model_version=MODEL_VERSION,
        effective=effective,
        largest=largest,
        rates=tuple(rates),
        contrasts=tuple(contrasts),
        margins=tuple(
            one for name in named for one in _quantiles(name, weight, seen[name].margins)
        ),
        counts={
            name: {key: float(one.sum()) for key, one in found[name].items()} for name in named
        },
        worst=tuple(seen[policy.name].worst),
    )


def _drive(
    scenario: Scenario,
    every: Mapping[str, Contestant],
    seen: Mapping[str, _Seen],
    step: ProgressCounter,
    policy: str,
) -> None:
    """Add what each driver does in a batch of scenes; the one that stays comes first."""
    stay: Trajectories | None = None
    for name, one in every.items():
        runs = one.simulate(scenario)
        stay = runs if stay is None else stay
        labelled = label(runs)
        measured = columns(labelled, stay)
        seen[name].columns.append(measured)
        seen[name].margins.append(of_batch(labelled))
        if name == policy:
            seen[name].worst = worst.kept([*seen[name].worst, *worst.of_batch(labelled, measured)])
        step(scenario.num_simulations)


def _joined(parts: list[Columns]) -> Columns:
    return {name: np.concatenate([one[name] for one in parts]) for name in parts[0]}


def _compared(
    weight: F64, weathers: Array, found: Mapping[str, Columns]
) -> tuple[list[Rate], list[Contrast]]:
    """Rates and differences, the primary endpoints in each kind of weather too."""
    rates: list[Rate] = []
    contrasts: list[Contrast] = []
    for row, weather in enumerate(STRATA):
        inside = weathers[row]
        if not inside.any():
            continue
        chosen = EVERY if row == 0 else PRIMARY
        here = {
            driver: {name: values[inside] for name, values in named.items()}
            for driver, named in found.items()
        }
        some_rates, some = _in_weather(weather, weight[inside], here, chosen, is_all=row == 0)
        rates += some_rates
        contrasts += some
    return rates, _corrected(contrasts)


def _in_weather(
    weather: str,
    weight: F64,
    found: Mapping[str, Columns],
    endpoints: tuple[Endpoint, ...],
    *,
    is_all: bool,
) -> tuple[list[Rate], list[Contrast]]:
    """Rates and differences of some endpoints in one kind of weather."""
    used = sorted({name for one in endpoints for name in (one.part, one.whole)})
    drawn = bootstrap.Resampled(
        weight, {driver: {name: one[name] for name in used} for driver, one in found.items()}
    )
    rates: list[Rate] = []
    contrasts: list[Contrast] = []
    policy, *others = found
    for endpoint in endpoints:
        rates += [
            _rate(drawn, driver, endpoint, weather, weight, named)
            for driver, named in found.items()
        ]
        contrasts += [
            _contrast(drawn, (policy, one), endpoint, weather, found, is_primary=is_all)
            for one in others
        ]
    return rates, contrasts


def _rate(
    drawn: bootstrap.Resampled,
    driver: str,
    endpoint: Endpoint,
    weather: str,
    weight: F64,
    named: Columns,
) -> Rate:
    value, repeats = drawn.ratio(driver, endpoint.part, endpoint.whole)
    low, high = bootstrap.interval(repeats)
    part, whole = named[endpoint.part], weight * named[endpoint.whole]
    counted = int((part != 0.0).sum())
    if endpoint.is_event and counted < bootstrap.FEW:
        # Events per unit of the whole; a scene without any of the whole has no event.
        each = np.divide(part, named[endpoint.whole], out=np.zeros_like(part), where=whole > 0.0)
        low, high = bootstrap.rare_interval(whole, each)
        if not endpoint.unit:  # The gamma method knows no largest rate.
            high = min(high, max(1.0, value))
    effective, largest = bootstrap.concentration(whole)
    return Rate(
        driver=driver,
        endpoint=endpoint,
        weather=weather,
        value=endpoint.scale * value,
        low=endpoint.scale * low,
        high=endpoint.scale * high,
        scenes=counted,
        effective=effective,
        largest=largest,
    )


def _contrast(
    drawn: bootstrap.Resampled,
    pair: tuple[str, str],
    endpoint: Endpoint,
    weather: str,
    found: Mapping[str, Columns],
    *,
    is_primary: bool,
) -> Contrast:
    """The difference of two drivers; only those of primary endpoints in any weather are primary."""
    policy, other = pair
    (here, repeats), (there, others) = (
        drawn.ratio(one, endpoint.part, endpoint.whole) for one in pair
    )
    pairs = int((found[policy][endpoint.part] != found[other][endpoint.part]).sum())
    low, high = bootstrap.interval(repeats - others)
    difference = here - there
    enough = pairs >= bootstrap.FEW
    return Contrast(
        reference=other,
        endpoint=endpoint,
        weather=weather,
        difference=endpoint.scale * difference,
        low=endpoint.scale * low,
        high=endpoint.scale * high,
        pairs=pairs,
        p=bootstrap.two_sided(difference, repeats - others) if enough else float("nan"),
        adjusted=float("nan"),
        is_primary=is_primary and endpoint in PRIMARY,
    )


def _corrected(contrasts: list[Contrast]) -> list[Contrast]:
    """The differences with p-values that are corrected for the number of secondary ones."""
    secondary = [float("nan") if one.is_primary else one.p for one in contrasts]
    adjusted = bootstrap.holm(secondary)
    return [replace(one, adjusted=p) for one, p in zip(contrasts, adjusted, strict=True)]


def _quantiles(
    driver: str, weight: F64, parts: list[dict[str, tuple[Array, Array]]]
) -> list[Margin]:
    """The quantiles of every margin of one driver."""
    found: list[Margin] = []
    for name, (title, unit) in MARGINS.items():
        values = np.concatenate([one[name][0] for one in parts]).astype(np.float64)
        there = np.concatenate([one[name][1] for one in parts])
        low, middle, high = bootstrap.quantiles(values[there], weight[there], (0.05, 0.5, 0.95))
        found.append(
            Margin(
                driver=driver,
                title=title,
                unit=unit,
                count=int(there.sum()),
                fifth=low,
                median=middle,
                last=high,
            )
        )
    return found
