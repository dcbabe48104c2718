"""Simulations in memory: drawn, carried out, branched, labelled, compared."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from overtaking import scenarios
from overtaking.api.choices import (
    BRANCHING,
    Profile,
    at_least_one,
    module_of,
    road_of,
    several,
    simulator_of,
)
from overtaking.datasets.generate import Progress
from overtaking.labelling import Labelled
from overtaking.labelling import label as labelled
from overtaking.model.batch import concatenate
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Trajectories
from overtaking.model.weather import Weather
from overtaking.sim.branch import branch as branched
from overtaking.sim.decision import Decision
from overtaking.simulators.comparison import Comparison


def sample(
    profile: Profile,
    simulations: int,
    seed: int,
    *,
    first: int = 0,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
) -> Scenario:
    """Draw scenarios.

    Args:
        profile: What to sample.
        simulations: How many, 1 to 1,000,000.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        first: Number of the first one; each is the same in any batch.
        overrides: Dotted keys of the specification with other values.
        road: A road in place of the profile's.

    Raises:
        ConfigError: The specification or a number cannot be used.
        InfeasibleError: No such scenario fits on the road.
    """
    spec = scenarios.spec(profile, overrides)
    number = at_least_one(simulations, "sample")
    index = np.arange(first, first + number, dtype=np.uint64)
    return scenarios.sample(spec, road_of(road or spec.road), seed, index)


def simulate(scenario: Scenario, *, simulator: str = "engine") -> Trajectories:
    """Simulate a batch.

    Args:
        scenario: A batch of scenarios.
        simulator: One of `SIMULATORS`; the results of `engine` and `reference` are the same, bit
            for bit.

    Raises:
        ConfigError: There is no such simulator, or it cannot run the scenario.
        MissingExtraError: The simulator is not installed.
    """
    return simulator_of(simulator).simulate(scenario)


def branch(
    scenario: Scenario,
    frame: int,
    *,
    decision: Decision | None = None,
    weather: Weather | None = None,
    simulator: str = "engine",
) -> Trajectories:
    """Simulate again, with a decision or the weather changed from a frame on.

    Args:
        scenario: A batch of scenarios.
        frame: First frame that the change can affect; up to it, all is as it was.
        decision: Decision forced on every ego, at the first instant that allows it.
        weather: Weather of every simulation from then on, as long as the batch.
        simulator: One of `BRANCHING`.

    Raises:
        ConfigError: The frame is negative, or there is no such simulator.
    """
    run = module_of(simulator, BRANCHING).run
    return branched(scenario, frame, decision=decision, weather=weather, run=run)


def label(runs: Trajectories) -> Labelled:
    """What happened in recorded simulations, whether it was lawful, and what describes it.

    Args:
        runs: A batch from `simulate`, `branch` or any other source.

    Returns:
        Signals, events, findings, labels and features, one for each simulation.
    """
    return labelled(runs)


def compare(
    profile: Profile,
    simulations: int,
    seed: int,
    *,
    simulators: Sequence[str] = ("engine", "sumo"),
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Simulate the same scenarios on several simulators: how they end, and where they part.

    Args:
        profile: What to sample.
        simulations: How many.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        simulators: Two or more of `SIMULATORS`; the others are held against the first.
        overrides: Dotted keys of the specification with other values.
        road: A road in place of the profile's.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: The specification or a number cannot be used, or there is no such simulator,
            or it is compared with itself.
        MissingExtraError: A simulator is not installed.
    """
    spec = scenarios.spec(profile, overrides)
    place = road_of(road or spec.road)
    chosen = [simulator_of(name) for name in several(simulators)]
    step = min(one.chunk_size for one in chosen)
    parts: list[Comparison] = []
    for first in range(0, at_least_one(simulations, "compare"), step):
        count = min(step, simulations - first)
        batch = sample(spec, count, seed, first=first, road=place)
        runs = [by.simulate(batch) for by in chosen]
        parts.append(Comparison.of(simulators, [(run, labelled(run).labels) for run in runs]))
        if progress is not None:
            progress(first + count, simulations)
    return concatenate(parts)
