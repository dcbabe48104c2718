"""Simulations in memory: sample, simulate, branch, label and compare them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from overtaking.api.choices import (
    BRANCHING,
    Count,
    Profile,
    Seed,
    module_of,
    road_of,
    several,
    simulator_of,
)
from overtaking.api.rules import load_pack, policies_for
from overtaking.core.errors import ConfigError
from overtaking.core.process_limits import check_memory
from overtaking.core.progress import ProgressCallback
from overtaking.labels.label import LabelledTrajectories
from overtaking.labels.label import label as labelled
from overtaking.labels.law import PORTUGAL, MeasurementErrors, Pack, default_policy
from overtaking.labels.law import lacking as rules_lacking
from overtaking.model.batch import FieldSpec, concatenate
from overtaking.model.checks import check_arguments, check_batch
from overtaking.model.road import Road
from overtaking.model.scenario import MAX_VEHICLES, ForcedDecision, Intervention, Scenario
from overtaking.model.trajectories import BYTES_PER_STATE, Trajectories
from overtaking.model.weather import Weather
from overtaking.scenarios import profiles, sampler
from overtaking.sim.branch import branch as branched
from overtaking.sim.branch import changed
from overtaking.simulators.comparison import Comparison
from overtaking.world.constants import STEP_MS

BYTES_PER_LABELLED_FRAME = 64
"""Memory of the signals of a frame, measured with 400 simulations of `motorway` [bytes]."""

MAX_SCENARIOS = 100_000_000
"""Largest number of scenarios in a batch; data sets may be larger."""


@check_arguments
def sample(
    profile: Profile,
    *,
    num_simulations: Annotated[int, FieldSpec(low=0, high=MAX_SCENARIOS)],
    seed: Seed,
    first_scenario: Annotated[int, FieldSpec(low=0, high=2**63)] = 0,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
) -> Scenario:
    """Draw scenarios.

    Args:
        profile: Name of a profile of the package, path of a TOML file, or a specification.
        num_simulations: Number of scenarios, at most `MAX_SCENARIOS`.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        first_scenario: Scenario index of the first row, 0 <= first_scenario < 2**63. A scenario
            index gives the same scenario in every batch.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.

    Raises:
        ConfigError: The specification or a number cannot be used.
        InfeasibleError: No such scenario fits on the road.
        SystemLimitError: They need more memory than the system grants.
    """
    spec = profiles.load_specification(profile, overrides)
    place = road_of(road or spec.road)
    index = np.uint64(first_scenario) + np.arange(num_simulations, dtype=np.uint64)
    one = sampler.ScenarioSource(spec, place, seed).sample(index[:1])
    check_batch(one, "sample", "scenario")
    # Twice, as parts are joined in the end.
    next_step = "draw fewer at a time, or call generate_dataset"
    check_memory(2 * one.nbytes * num_simulations, "sample", next_step)
    return sampler.ScenarioSource(spec, place, seed).sample(index)


@check_arguments
def simulate(scenario: Scenario, *, simulator: str = "engine") -> Trajectories:
    """Simulate a batch.

    Args:
        scenario: A batch of scenarios.
        simulator: One of `SIMULATORS`; the results of `engine` and `reference` are the same, bit
            for bit.

    Raises:
        ConfigError: A field of the scenario is out of its range, there is no such simulator, or it
            cannot run the scenario.
        MissingExtraError: The simulator is not installed.
        SystemLimitError: The system grants too little memory or too few threads.
    """
    chosen = simulator_of(simulator)
    check_runnable(scenario, "simulate")
    return chosen.simulate(scenario)


@check_arguments
def branch(
    source: Scenario | Trajectories,
    frame: int = 0,
    *,
    decision: ForcedDecision | None = None,
    weather: Weather | None = None,
    interventions: Iterable[Intervention] = (),
    simulator: str = "engine",
) -> Trajectories:
    """Simulate again, with something changed from a frame on.

    Args:
        source: A batch of scenarios, or recorded simulations. The interventions of a branch come
            before these.
        frame: First frame that `decision` and `weather` can affect, before the horizon of the
            longest simulation; up to it, all is as it was.
        decision: Decision forced on every ego, at the first instant that allows it.
        weather: Weather of every simulation from then on, as long as the batch.
        interventions: Any number of other changes, at frames of their own.
        simulator: One of `BRANCHING`.

    Returns:
        The batch, with `branched` to say what it branches from. Labels take weather and drivers
        as they are after the last change.

    Raises:
        ConfigError: A number is out of its range, the weather is not as long as the batch, no
            simulation has the frame or vehicle, a policy drives the ego, or there is no such
            simulator.
    """
    run = module_of(simulator, BRANCHING).run
    scenario = source if isinstance(source, Scenario) else source.scenario
    check_runnable(scenario, "branch")
    interventions = tuple(interventions)
    for intervention in (Intervention(weather=weather), *interventions):
        check_batch(intervention, "branch")
        check_batch(changed(scenario, intervention), "branch")
    return branched(
        source, frame, decision=decision, weather=weather, interventions=interventions, run=run
    )


@check_arguments
def label(
    runs: Trajectories,
    *,
    errors: MeasurementErrors | None = None,
    law: str | Pack = PORTUGAL,
    policies: Sequence[str] | None = None,
) -> LabelledTrajectories:
    """Label recorded simulations: events, law, classes and features.

    Args:
        runs: A batch from `simulate`, `branch` or any other source.
        errors: Standard deviations of recorded positions and speeds; None for a recording without
            errors. A rule is undecidable where its margin is less than two standard errors.
        law: A pack of rules, or the text that `rules.load_pack` takes.
        policies: Names of its policies; None for those that data sets store.

    Returns:
        Signals, events, findings, labels and features, one for each simulation.

    Raises:
        ConfigError: A field of the recording is out of its range, or there is no such law
            or policy.
        SystemLimitError: The system grants too little memory or too few threads.
    """
    check_memory(BYTES_PER_LABELLED_FRAME * runs.stage.size, "label", "label fewer at a time")
    pack = load_pack(law)
    return labelled(runs, pack=pack, policies=policies_for(pack, policies), errors=errors)


def undecidable_rules(unknown: Iterable[str]) -> dict[str, list[str]]:
    """The rules that a recording cannot decide.

    Args:
        unknown: What it does not tell: `Trajectories.unknown`.

    Returns:
        Codes of rules: `always` undecidable where they apply, or `sometimes`.
    """
    return rules_lacking(PORTUGAL, unknown)


@check_arguments
def compare_simulators(
    profile: Profile,
    *,
    num_simulations: Count,
    seed: Seed,
    simulators: Sequence[str] = ("engine", "sumo"),
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: ProgressCallback | None = None,
) -> Comparison:
    """Simulate the same scenarios on several simulators: how they end, and where they differ.

    Args:
        profile: As in `sample`.
        num_simulations: Number of scenarios, 1 to 1,000,000.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        simulators: Two or more of `SIMULATORS`; the others are held against the first.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: The specification or a number cannot be used, or there is no such simulator,
            or it is compared with itself.
        MissingExtraError: A simulator is not installed.
    """
    spec = profiles.load_specification(profile, overrides)
    place = road_of(road or spec.road)
    chosen = [simulator_of(name) for name in several(simulators)]
    step = min(one.chunk_size for one in chosen)
    parts: list[Comparison] = []
    for first in range(0, num_simulations, step):
        count = min(step, num_simulations - first)
        batch = sample(spec, num_simulations=count, seed=seed, first_scenario=first, road=place)
        runs = [by.simulate(batch) for by in chosen]
        recordings = [(run, labelled(run).labels) for run in runs]
        policy = default_policy(batch.profile)
        parts.append(Comparison.of(simulators, recordings, policy=policy))
        if progress is not None:
            progress(first + count, num_simulations)
    return concatenate(parts)


def check_runnable(scenario: Scenario, where: str) -> None:
    """Refuse scenarios of recordings that simulators cannot run, and batches larger than memory."""
    interval, slots = scenario.frame_interval_ms, scenario.num_slots
    for what, is_wrong, expected, got in (
        ("frame_interval_ms", interval % STEP_MS != 0, f"a multiple of {STEP_MS}", interval),
        ("vehicles", slots > MAX_VEHICLES, f"at most {MAX_VEHICLES} slots", slots),
    ):
        if is_wrong:
            raise ConfigError(
                what=f"scenario.{what}",
                where=where,
                expected=expected,
                got=got,
                next_step="change the scenario",
            )
    longest = float(scenario.horizon.max(initial=0.0))
    frames = int(longest * 1000.0) // interval + 1
    size = scenario.num_simulations * slots * frames * BYTES_PER_STATE
    check_memory(size, where, "simulate fewer at a time, or call generate_dataset")
