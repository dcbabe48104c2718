"""A driver of one's own beside others in the same scenes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.choices import Count, Profile, Seed, module_of, road_of
from overtaking.core.errors import ConfigError, nearest_first
from overtaking.core.progress import ProgressCallback
from overtaking.model.checks import check_arguments
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.scenarios import profiles
from overtaking.sim import driving, policies
from overtaking.sim.driving import Driver
from overtaking.sim.sensor import Sensor

if TYPE_CHECKING:
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.evaluation.run import Contestant

HUMAN, STAY = "human", "stay"

BUILTIN_DRIVERS: Mapping[str, Driver | None] = {
    HUMAN: None,
    STAY: Driver(function=policies.stay, observation="human", action="decision", name=STAY),
    "rules": Driver(function=policies.rules, observation="human", action="decision", name="rules"),
}
"""Drivers that are part of the package; None is the model's own."""

DEFAULT_REFERENCES = (HUMAN, STAY)

RISK_SUFFIX = "-risk"
"""End of the name of a profile that draws dangerous scenes more often."""


@check_arguments
def evaluate(
    driver: str | Driver,
    profile: Profile = "motorway-risk",
    *,
    num_simulations: Count = 1000,
    seed: Seed = 1,
    references: Sequence[str | Driver] = DEFAULT_REFERENCES,
    natural: bool = False,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: ProgressCallback | None = None,
    say: Callable[[str], None] | None = None,
) -> "Evaluation":
    """Compare a driver with others in the same scenes.

    Args:
        driver: A `Driver`, or the name of one of `BUILTIN_DRIVERS`.
        profile: Profile of the scenes, as in `sample`. For a profile of the package that has a
            variant with the suffix `-risk`, the scenes are drawn from that one.
        num_simulations: Number of scenes, 1 to 1,000,000.
        seed: Seed of their random numbers, 0 <= seed < 2**64.
        references: Drivers to compare it with, each with another name.
        natural: Whether to draw scenes of the named profile itself, as often as they occur.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.
        progress: Called with the number of simulations that are done, and of all.
        say: Called before the run with a sentence that names the `-risk` profile, if one is drawn.

    Returns:
        Rates with intervals, differences, margins and the worst scenes; `write_report` makes a page
        of it.

    Raises:
        ConfigError: The specification, a number or a name cannot be used.
        DriverError: A driver raises an exception, or its answer is not an action.
    """
    from overtaking.analysis.evaluation.run import evaluate as run
    from overtaking.analysis.evaluation.words import risk_note

    evaluated, *others = _compared_drivers([driver, *references])
    risk_profile = None if natural else _risk_profile(profile)
    spec = profiles.load_specification(risk_profile or profile, overrides)
    if risk_profile is not None and say is not None:
        say(risk_note(str(profile), risk_profile))
    (stay,) = _compared_drivers([STAY])
    evaluation = run(
        spec,
        road_of(road or spec.road),
        num_simulations,
        seed,
        policy=evaluated,
        references=others,
        stay=stay,
        progress=progress,
    )
    if risk_profile is None:
        return evaluation
    return replace(evaluation, asked_profile=str(profile))


@check_arguments
def run_benchmark(
    driver: str | Driver,
    benchmark: str | Path,
    *,
    references: Sequence[str | Driver] = DEFAULT_REFERENCES,
    progress: ProgressCallback | None = None,
) -> "BenchmarkResult":
    """Compare a driver with others in the scenes of a benchmark, whose numbers are fixed.

    Args:
        driver: As in `evaluate`.
        benchmark: Its name, or a TOML file.
        references: Drivers to compare it with.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such benchmark, or a profile or the model is not the one that it
            was made with; or as in `evaluate`.
        DriverError: A driver raises an exception, or its answer is not an action.
    """
    from overtaking.analysis.evaluation.benchmark import read, run

    evaluated, *others = _compared_drivers([driver, *references])
    (stay,) = _compared_drivers([STAY])
    return run(read(benchmark), evaluated, others, stay, road_of, progress)


def resolve_driver(
    name: str, observation: str | None, *, action: str, action_repeat: int, option: str = "--driver"
) -> str | Driver:
    """The driver that the options of a command name: a built-in one, or as in `load_driver`.

    Args:
        name: Its name.
        observation: What it observes; needed unless the driver is one of `BUILTIN_DRIVERS`.
        action: What it answers.
        action_repeat: Number of decisions for which an action holds.
        option: Option of the command line that names the driver, for messages.

    Raises:
        ConfigError: No such driver or sensor exists, or `observation` is missing.
    """
    from overtaking.api.driving import load_driver, load_driver_function

    if name in BUILTIN_DRIVERS:
        return name
    if observation is None:
        # An unknown name is reported before the missing option.
        load_driver_function(name, option, BUILTIN_DRIVERS)
        raise ConfigError(
            what="--observation",
            where="evaluate",
            expected=f"human, truth or the file of a sensor, for {option} {name}",
            got="nothing",
            next_step=f"add --observation, or choose one of {', '.join(BUILTIN_DRIVERS)}",
        )
    if ":" not in name and not name.endswith(".onnx"):
        # This raises; the message lists the built-in drivers.
        load_driver_function(name, option, BUILTIN_DRIVERS)
    return load_driver(name, observation, action=action, action_repeat=action_repeat, option=option)


def _risk_profile(profile: Profile) -> str | None:
    """The profile of the package that draws dangerous scenes more often, if there is one."""
    name = f"{profile}{RISK_SUFFIX}" if isinstance(profile, str) else ""
    return name if name in profiles.profile_names() else None


def _compared_drivers(drivers: Sequence[str | Driver]) -> "list[Contestant]":
    """The contestant of each driver: the driver under evaluation first, then the references.

    Raises:
        ConfigError: No driver has such a name, or two drivers have the same name.
    """
    contestants = [
        _contestant(driver, "references" if index else "driver")
        for index, driver in enumerate(drivers)
    ]
    names = [contestant.name for contestant in contestants]
    if len(set(names)) < len(names):
        raise ConfigError(
            what="drivers",
            where="evaluate",
            expected="a driver and references, each once",
            got=", ".join(names),
            next_step="leave out the ones that repeat, or name others with --references",
        )
    return contestants


def _contestant(driver: str | Driver, argument_name: str) -> "Contestant":
    from overtaking.analysis.evaluation.run import Contestant

    engine = module_of("engine")
    if isinstance(driver, str):
        name = driver
        if name not in BUILTIN_DRIVERS:
            names = nearest_first(name, BUILTIN_DRIVERS)
            raise ConfigError.unknown_choice(
                what=argument_name, where="evaluate", choices=names, got=name
            )
        shipped = BUILTIN_DRIVERS[name]
        if shipped is None:  # The driver of the engine itself.
            return Contestant(name=name, simulate=engine.simulate)
        driver = shipped
    return Contestant(
        name=driver.display_name.rpartition(":")[2].rpartition("/")[2],
        source=driver.display_name,
        simulate=partial(_simulate, driver=driver),
        digest=driver.digest,
        observe="sensor" if isinstance(driver.observation, Sensor) else driver.observation,
        action=driver.action,
    )


def _simulate(scenario: Scenario, driver: Driver) -> Trajectories:
    return driving.drive(scenario, driver, module_of("engine").run)
