"""Public functions that simulate in memory: `sample`, `simulate`, `drive`, `branch`, `label`.

    scenario = sample("motorway", num_simulations=100, seed=1)   # start of 100 simulations
    trajectories = simulate(scenario)                            # recorded motion, frame by frame
    labels = label(trajectories).labels                          # what happened, and was it legal?

A *scenario* is everything decided before the first frame: road, weather, vehicles and their
drivers. Scenarios and trajectories are batches: arrays whose first axis is the simulation. The
*ego* is the vehicle whose overtaking is studied, a *frame* a recorded instant, the *horizon* the
time at which a simulation ends. A *profile* is a named setting to sample from; *specification*: the
same as an object or as a TOML file of the user.

The package has two simulators of its own model: `engine` (compiled) and `reference` (readable
Python); both give the same bits. `check_arguments` raises a `ConfigError` for an argument of
another type than its annotation, or outside the range in `FieldSpec`.
"""

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
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.labels.labelling import label as label_batch
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Pack
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_arguments, check_batch
from overtaking.model.road import Road
from overtaking.model.scenario import MAX_VEHICLES, ForcedDecision, Intervention, Scenario
from overtaking.model.trajectories import BYTES_PER_STATE, Trajectories
from overtaking.model.weather import Weather
from overtaking.recordings.roads import resolve_road
from overtaking.scenarios import profiles, sampler
from overtaking.sim import external_driver
from overtaking.sim.branching import branch as branch_batch
from overtaking.sim.external_driver import OBSERVATION_SOURCES, Driver
from overtaking.sim.sensors import Sensor
from overtaking.world.constants import STEP_MS

BYTES_PER_LABELLED_FRAME = 64
"""Memory for the signals that `label` computes, per simulation and frame [bytes].

Measured with 400 simulations of the profile `motorway`.
"""


MAX_SCENARIOS = 100_000_000
"""Largest number of scenarios in a batch, a choice: a larger number is taken for a typing error.

That many scenarios of the profile `motorway` take 600 GB. Data sets may have more, because they are
made in parts.
"""


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
    """Draw scenarios at random.

    Args:
        profile: Name of a profile, path of a TOML file, or a specification.
        num_simulations: Number of scenarios, 0 to `MAX_SCENARIOS`.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        first_scenario: Scenario index of the first one, 0 to 2**63. Seed and scenario index
            determine a scenario, so a batch can be drawn in parts: the scenario with index 7 is the
            same whatever else is drawn.
        overrides: New values of keys of the specification, such as
            `{"traffic.vehicles": "2..6"}`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.

    Returns:
        The scenarios with the indices `first_scenario`, `first_scenario + 1` and so on.

    Raises:
        ConfigError: The specification or a number cannot be used.
        InfeasibleError: The vehicles do not fit on the road, cannot reach their speeds, or are too
            few for the density of the traffic.
        SystemLimitError: The scenarios need more memory than the system grants.
    """
    spec = profiles.load_specification(profile, overrides)
    source = sampler.ScenarioSource(spec, resolve_road(road or spec.road), seed)
    # `first_scenario` is 2**63 at most, so that the sum does not overflow.
    scenario_index = np.uint64(first_scenario) + np.arange(num_simulations, dtype=np.uint64)
    # One scenario shows errors of the specification, and the size of all, before the long work.
    first_row = source.sample(scenario_index[:1])
    check_batch(first_row, "sample", "scenario")
    # Factor 2: the sampler draws blocks, and holds them while it joins them to one batch.
    next_step = "draw fewer at a time, or call generate_dataset"
    check_memory(2 * first_row.nbytes * num_simulations, "sample", next_step)
    return source.sample(scenario_index)


@check_arguments
def simulate(scenario: Scenario, *, simulator: str = "engine") -> Trajectories:
    """Simulate a batch of scenarios.

    Args:
        scenario: The scenarios.
        simulator: A name in `SIMULATORS`.

    Returns:
        Positions, speeds and more of each vehicle in each frame.

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
    """Simulate a batch again with changes from some frame on; random numbers stay the same.

    Until the first change, the result equals the original simulation bit for bit.

    Args:
        source: A batch of scenarios, or simulated trajectories. If these are a branch themselves,
            its changes are kept and the new ones are added.
        frame: First frame that `decision` and `weather` can affect, 0 or more, before the last
            frame of the longest simulation.
        decision: Decision forced on every ego, such as to start an overtake; carried out at the
            first instant at which it is possible. None for no change.
        weather: Weather of every simulation from `frame` on, shape (simulation,); None for no
            change.
        interventions: Any number of other changes, each with a frame of its own, such as of the
            speed of a vehicle.
        simulator: A name in `MODEL_SIMULATORS`.

    Returns:
        The changed simulations; `branch_origin` holds the original scenarios and all changes.
        Labels judge by the weather and drivers after the last change.

    Raises:
        ConfigError: A number is out of its range, the weather has another shape, no simulation has
            the frame or vehicle, a driver of the user controls the ego (its recorded actions would
            not react to a change), or there is no such simulator.
        SystemLimitError: The system grants too little memory or too few threads.
    """
    # `run` is like the simulator's `simulate`, but takes changes as well.
    run = simulator_module(simulator, MODEL_SIMULATORS).run
    scenario = source if isinstance(source, Scenario) else source.scenario
    check_runnable(scenario, "branch")  # Changes alter neither frames nor number of vehicles.
    return branch_batch(
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
    """Find out what happened in each simulation and whether it was legal.

    Args:
        trajectories: Simulated or imported trajectories.
        errors: Standard deviations of the positions [m] and speeds [m/s] of a recording; None for
            exact ones, as of simulations. A rule is undecidable where its margin (the distance to
            its limit) is less than two standard errors.
        law: The pack of rules of a law: `pt` (Portugal), `de` (Germany), `module:NAME` of a Python
            module, or a `Pack`.
        policies: Names of policies of the law (sets of rules that a legal overtake must keep); None
            for the ones that data sets store (`paper`, `default` and `strict`), or for all policies
            of a pack of the user.

    Returns:
        Signals of the ego, events of its overtake, findings of each rule, labels (class and
        legality under each policy) and features, for each simulation.

    Raises:
        ConfigError: A field of the trajectories is out of its range, or there is no such law or
            policy.
        SystemLimitError: The system grants too little memory or too few threads.
    """
    num_frames = trajectories.stage.size  # Of all simulations: `stage` is (simulation, time).
    check_memory(BYTES_PER_LABELLED_FRAME * num_frames, "label", "label fewer at a time")
    pack = load_pack(law)
    return label_batch(
        trajectories, pack=pack, policies=policies_for(pack, policies), errors=errors
    )


def check_runnable(scenario: Scenario, where: str) -> None:
    """Refuse a scenario that the simulators cannot run, or whose trajectories exceed the memory.

    The simulators can run all sampled scenarios. Scenarios of imported recordings may have a frame
    interval that is no multiple of the simulation step (10 ms), or too many vehicles.

    Args:
        scenario: A batch of scenarios.
        where: The public function, for error messages.

    Raises:
        ConfigError: The scenario cannot be run.
        SystemLimitError: The trajectories exceed the memory.
    """
    interval, num_slots = scenario.frame_interval_ms, scenario.num_slots  # A slot per vehicle.
    if interval % STEP_MS != 0:
        expected = f"a multiple of {STEP_MS}"
        raise _scenario_error("frame_interval_ms", where, expected, interval)
    if num_slots > MAX_VEHICLES:
        raise _scenario_error("vehicles", where, f"at most {MAX_VEHICLES} slots", num_slots)
    longest_ms = round(1000.0 * float(scenario.horizon.max(initial=0.0)))
    num_frames = longest_ms // interval + 1  # Both ends are recorded.
    size = scenario.num_simulations * num_slots * num_frames * BYTES_PER_STATE
    check_memory(size, where, "simulate fewer at a time, or call generate_dataset")


def _scenario_error(field: str, where: str, expected: str, got: int) -> ConfigError:
    """The error for a scenario that the simulators cannot run."""
    return ConfigError(
        what=f"scenario.{field}",
        where=where,
        expected=expected,
        got=got,
        next_step="change the scenario",
    )


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
    """Simulate a batch in which a driver of the user controls every ego.

    All other vehicles keep the human drivers of the model.

    Args:
        scenario: A batch of scenarios.
        driver: A function that takes an `Observation` of all simulations and returns an array with
            an action for each, shape (simulation, part); or a `Driver`, which holds such a function
            together with the next three arguments, so these must then be None.
        observation: Input of the function: `human` for the perception of a human, `truth` for the
            exact state, or a `Sensor`. Required with a function.
        action: Output of the function. `accel_lane` (None means this): acceleration and lane
            change; `speed_lane`: desired speed and lane change; `accel_steer`: acceleration and
            wheel angle; `accel_steer_signal`: the same and a side for the indicator; `trajectory`:
            points to drive through; `decision`: a `Move`, such as to pull out; `accel_move`:
            acceleration and a `Move`, to whose side the indicator is set.
        action_repeat: Time for which an action holds, in units of 50 ms, 1 to 200; None for 1. The
            function is called again after it.
        simulator: A name in `MODEL_SIMULATORS`.

    Returns:
        The trajectories. Their `actions` hold all actions of the driver, with which the simulation
        can be repeated without it.

    Raises:
        ConfigError: An argument cannot be used, or the scenario cannot be run.
        DriverError: The driver raises an exception, or its answer is not an action.
        SystemLimitError: The system grants too little memory or too few threads.
    """
    # `run` is like the simulator's `simulate`, but takes the actions of the ego as well.
    run = simulator_module(simulator, MODEL_SIMULATORS).run
    check_runnable(scenario, "drive")
    settings: dict[str, Any] = {
        "observation": observation,
        "action": action,
        "action_repeat": action_repeat,
    }
    explicit_settings = {name: value for name, value in settings.items() if value is not None}
    if isinstance(driver, Driver) and explicit_settings:
        raise ConfigError(
            what=", ".join(explicit_settings),
            where="drive",
            expected="no value beside a Driver, which states it",
            got=", ".join(map(str, explicit_settings.values())),
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
        driver = Driver(function=driver, **explicit_settings)
    return external_driver.drive(scenario, driver, run, simulator)


def simulator_with_driver(driver: Driver, simulator: str) -> Simulator:
    """Make a simulator for data sets in which a driver of the user controls every ego.

    Args:
        driver: The driver.
        simulator: A name in `MODEL_SIMULATORS`.

    Raises:
        ConfigError: There is no such simulator, or it is not one of `MODEL_SIMULATORS`.
    """
    base = get_simulator(simulator)
    run = simulator_module(simulator, MODEL_SIMULATORS).run
    simulate_with_driver = partial(
        external_driver.drive, driver=driver, run=run, simulator=simulator
    )
    # A driver may keep a state between calls, so only one process calls it, for one batch at a
    # time. `shares_world=True` forbids several processes; it was made for CARLA, where all of them
    # would share the world of one server.
    return dataclasses.replace(base, simulate=simulate_with_driver, threads=1, shares_world=True)


def driver_record(driver: Driver) -> PolicyRecord:
    """The description of a driver for `dataset.json`, the manifest of a data set.

    A manifest calls the driver `policy`, its observation `observe` and its `action_repeat` `hold`.
    """
    sensor = driver.observation
    return PolicyRecord(
        name=driver.display_name,
        version=driver.version,
        digest=driver.sha256,
        observe=dataclasses.asdict(sensor) if isinstance(sensor, Sensor) else sensor,
        action=driver.action,
        hold=driver.action_repeat,
    )
