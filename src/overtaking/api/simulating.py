"""Simulations in memory: sample, simulate, drive, branch and label them."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from overtaking.api.law import load_pack, policies_for
from overtaking.api.simulator_registry import (
    MODEL_SIMULATORS,
    ProfileSource,
    Seed,
    get_simulator,
    simulator_module,
)
from overtaking.core.errors import ConfigError
from overtaking.core.process_limits import check_memory
from overtaking.data.recipe import PolicyRecord, Simulator
from overtaking.labels.label import LabelledTrajectories
from overtaking.labels.label import label as labelled
from overtaking.labels.law import PORTUGAL, MeasurementErrors, Pack
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_arguments, check_batch
from overtaking.model.road import Road
from overtaking.model.scenario import MAX_VEHICLES, ForcedDecision, Intervention, Scenario
from overtaking.model.trajectories import BYTES_PER_STATE, Trajectories
from overtaking.model.weather import Weather
from overtaking.recordings.roads import resolve_road
from overtaking.scenarios import profiles, sampler
from overtaking.sim import driving
from overtaking.sim.branch import branch as branched
from overtaking.sim.branch import changed
from overtaking.sim.driving import OBSERVATION_SOURCES, Driver
from overtaking.sim.sensor import Sensor
from overtaking.world.constants import STEP_MS

BYTES_PER_LABELLED_FRAME = 64
"""Memory of the signals of a frame, measured with 400 simulations of `motorway` [bytes]."""


MAX_SCENARIOS = 100_000_000
"""Largest number of scenarios in a batch; data sets may be larger."""


@check_arguments
def sample(
    profile: ProfileSource,
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
    place = resolve_road(road or spec.road)
    index = np.uint64(first_scenario) + np.arange(num_simulations, dtype=np.uint64)
    first_row = sampler.ScenarioSource(spec, place, seed).sample(index[:1])
    check_batch(first_row, "sample", "scenario")
    # Twice, as parts are joined in the end.
    next_step = "draw fewer at a time, or call generate_dataset"
    check_memory(2 * first_row.nbytes * num_simulations, "sample", next_step)
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
    used_simulator = get_simulator(simulator)
    check_runnable(scenario, "simulate")
    return used_simulator.simulate(scenario)


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
        simulator: One of `MODEL_SIMULATORS`.

    Returns:
        The batch, with `branched` to say what it branches from. Labels take weather and drivers
        as they are after the last change.

    Raises:
        ConfigError: A number is out of its range, the weather is not as long as the batch, no
            simulation has the frame or vehicle, a policy drives the ego, or there is no such
            simulator.
    """
    run = simulator_module(simulator, MODEL_SIMULATORS).run
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
    trajectories: Trajectories,
    *,
    errors: MeasurementErrors | None = None,
    law: str | Pack = PORTUGAL,
    policies: Sequence[str] | None = None,
) -> LabelledTrajectories:
    """Label recorded simulations: events, law, classes and features.

    Args:
        trajectories: A batch from `simulate`, `branch` or any other source.
        errors: Standard deviations of recorded positions and speeds; None for a recording without
            errors. A rule is undecidable where its margin is less than two standard errors.
        law: A pack of rules, or `pt`, `de` or `module:NAME`, as in `law.load_pack`.
        policies: Names of its policies; None for those that data sets store.

    Returns:
        Signals, events, findings, labels and features, one for each simulation.

    Raises:
        ConfigError: A field of the recording is out of its range, or there is no such law
            or policy.
        SystemLimitError: The system grants too little memory or too few threads.
    """
    check_memory(
        BYTES_PER_LABELLED_FRAME * trajectories.stage.size, "label", "label fewer at a time"
    )
    pack = load_pack(law)
    return labelled(trajectories, pack=pack, policies=policies_for(pack, policies), errors=errors)


def check_runnable(scenario: Scenario, where: str) -> None:
    """Refuse scenarios of recordings that simulators cannot run, and batches larger than memory."""
    interval, slots = scenario.frame_interval_ms, scenario.num_slots
    for field, is_wrong, expected, value in (
        ("frame_interval_ms", interval % STEP_MS != 0, f"a multiple of {STEP_MS}", interval),
        ("vehicles", slots > MAX_VEHICLES, f"at most {MAX_VEHICLES} slots", slots),
    ):
        if is_wrong:
            raise ConfigError(
                what=f"scenario.{field}",
                where=where,
                expected=expected,
                got=value,
                next_step="change the scenario",
            )
    longest = float(scenario.horizon.max(initial=0.0))
    frames = int(longest * 1000.0) // interval + 1
    size = scenario.num_simulations * slots * frames * BYTES_PER_STATE
    check_memory(size, where, "simulate fewer at a time, or call generate_dataset")


@check_arguments
def drive(
    scenario: Scenario,
    driver: Any,
    *,
    observation: str | Sensor | None = None,
    action: str | None = None,
    action_repeat: int | None = None,
    simulator: str = "engine",
) -> Trajectories:
    """Simulate a batch in which a driver of one's own drives every ego.

    The other vehicles keep the drivers of the model.

    Args:
        scenario: A batch of scenarios.
        driver: A function from an `Observation` of all simulations to an array with an action for
            each, or a `Driver`, which states the next three arguments itself.
        observation: Observation of the function, required with one: `human` for what the model's
            driver
            believes, `truth` for the state of the world, or a `Sensor`.
        action: Answer of a function: `accel_lane` (the default), `speed_lane`, `accel_steer`,
            `trajectory` or `decision`; with the indicator as a part of it, `accel_move` or
            `accel_steer_signal`.
        action_repeat: Number of decisions for which an action holds, 20 a second, 1 to 200; 1 by
            default.
        simulator: One of `MODEL_SIMULATORS`; the results are the same, bit for bit.

    Returns:
        The batch, with the actions of the driver as `actions`; a simulation with these actions
        gives the same batch.

    Raises:
        ConfigError: An argument cannot be used, or the scenario cannot be run.
        DriverError: The driver raises an exception, or its answer is not an action.
    """
    run = simulator_module(simulator, MODEL_SIMULATORS).run
    check_runnable(scenario, "drive")
    settings: dict[str, Any] = {
        "observation": observation,
        "action": action,
        "action_repeat": action_repeat,
    }
    stated = {name: value for name, value in settings.items() if value is not None}
    if isinstance(driver, Driver) and stated:
        raise ConfigError(
            what=", ".join(stated),
            where="drive",
            expected="no value beside a Driver, which states it",
            got=", ".join(map(str, stated.values())),
            next_step="leave it out, or give the function of the driver",
        )
    if not isinstance(driver, Driver):
        if observation is None:
            raise ConfigError(
                what="observation",
                where="drive",
                expected=f"{', '.join(OBSERVATION_SOURCES)} or a Sensor",
                got=None,
                next_step="state it, because results depend on it",
            )
        driver = Driver(function=driver, **stated)
    return driving.drive(scenario, driver, run, simulator)


def simulator_with_driver(driver: Driver, simulator: str) -> Simulator:
    """The simulator in which a driver of one's own drives every ego."""
    base = get_simulator(simulator)
    run = simulator_module(simulator, MODEL_SIMULATORS).run
    asks = partial(driving.drive, driver=driver, run=run, simulator=simulator)
    # A driver may keep a state of its own, so one process calls it, one batch at a time.
    return dataclasses.replace(base, simulate=asks, threads=1, shares_world=True)


def driver_record(driver: Driver) -> PolicyRecord:
    """The record of a driver in a manifest."""
    sensor = driver.observation
    return PolicyRecord(
        name=driver.display_name,
        version=driver.version,
        digest=driver.digest,
        observe=dataclasses.asdict(sensor) if isinstance(sensor, Sensor) else sensor,
        action=driver.action,
        hold=driver.action_repeat,
    )
