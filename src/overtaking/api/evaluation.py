"""Drivers of the user's: loading them, and comparing them with others in the same scenes."""

import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.simulator_registry import (
    Count,
    ProfileSource,
    Seed,
    simulator_module,
)
from overtaking.core.errors import ConfigError, nearest_first
from overtaking.core.progress import ProgressCallback
from overtaking.model.checks import check_arguments
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.recordings.roads import resolve_road
from overtaking.scenarios import profiles
from overtaking.sim import driving, policies
from overtaking.sim.driving import Driver
from overtaking.sim.observation import DriverFunction
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
    profile: ProfileSource = "motorway-risk",
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
        resolve_road(road or spec.road),
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
    return run(read(benchmark), evaluated, others, stay, resolve_road, progress)


def resolve_driver(
    name: str, observation: str | None, *, action: str, action_repeat: int, option: str = "--driver"
) -> str | Driver:
    """The driver that the options of a command name: a built-in one, or as in `load_driver`.

    Args:
        name: Its name.
        observation: Name of its observation; needed unless the driver is one of
            `BUILTIN_DRIVERS`.
        action: Name of its action, as in `drive`.
        action_repeat: Number of decisions for which an action holds.
        option: Option of the command line that names the driver, for messages.

    Raises:
        ConfigError: No such driver or sensor exists, or `observation` is missing.
    """
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


def _risk_profile(profile: ProfileSource) -> str | None:
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

    engine = simulator_module("engine")
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
    return driving.drive(scenario, driver, simulator_module("engine").run)


def load_driver(
    name: str, observation: str, *, action: str, action_repeat: int, option: str = "--driver"
) -> Driver:
    """Load the driver that the options of a command name.

    Args:
        name: `module:name` or `file.py:name` of a function, or of a class of drivers; or the path
            of an ONNX file.
        observation: `human`, `truth`, or a TOML file with the numbers of a sensor.
        action: As in `Driver`.
        action_repeat: As in `Driver`.
        option: Option of the command line that names the driver, for messages.

    Raises:
        ConfigError: No such driver or sensor exists, or another argument cannot be used.
        MissingExtraError: It is an ONNX file, and the extra `onnx` is not installed.
    """
    is_file = observation.endswith(".toml")
    driver = Driver(
        function=load_driver_function(name, option),
        observation=Sensor.read(observation) if is_file else observation,
        action=action,
        action_repeat=action_repeat,
        name=name,
    )
    _check_num_parts(driver)
    return driver


def _check_num_parts(driver: Driver) -> None:
    """Refuse a network whose output has more or fewer parts than the action."""
    parts = driver.control.parts
    num_parts = getattr(driver.function, "num_parts", len(parts))
    if num_parts != len(parts):
        raise ConfigError(
            what=f"output for --action {driver.action}",
            where=driver.name,
            expected=f"{len(parts)} parts ({', '.join(part.name for part in parts)})",
            got=str(num_parts),
            next_step="choose another action, or export the network anew",
        )


def load_driver_function(
    name: str, option: str = "--driver", builtin: Iterable[str] = ()
) -> DriverFunction:
    """Load the function of a driver from a module, a Python file or an ONNX file.

    A class is called without arguments, and the object is the driver.

    Args:
        name: `module:name`, `file.py:name` or `file.onnx`.
        option: Option of the command line that has this name, for messages.
        builtin: Names of the drivers that the command offers as well, for messages.

    Raises:
        ConfigError: No such module, file, function or driver exists.
        MissingExtraError: The name belongs to an ONNX file, and the extra `onnx` is not installed.
    """
    if name.endswith(".onnx"):
        from overtaking.sim.networks import OnnxDriver

        return OnnxDriver(Path(name))
    where, _, attribute = name.rpartition(":")
    if not where or not attribute:
        builtin_names = ", ".join(nearest_first(name, builtin))
        raise _unknown_driver(name, option, f"{builtin_names or 'a driver'}, {_FORMS}")
    try:
        module = _module(where)
    except Exception as error:  # The module of another author may raise anything.
        message = f"{name} ({type(error).__name__}: {error})"
        raise _unknown_driver(message, option, _FORMS) from error
    functions = [key for key, value in vars(module).items() if _may_be_driver(key, value)]
    if not hasattr(module, attribute):
        nearest = nearest_first(attribute, functions)[:_MOST_LISTED]
        listed = ", ".join(f"{where}:{function}" for function in nearest)
        expected = listed or f"{_FORMS}; {where} defines no function"
        raise _unknown_driver(f"{name} ({where} has no {attribute})", option, expected)
    function = getattr(module, attribute)
    try:
        return function() if isinstance(function, type) else function
    except Exception as error:  # The constructor may raise anything, too.
        message = f"{name} ({type(error).__name__}: {error})"
        raise _unknown_driver(message, option, "a class without arguments") from error


_FORMS = "module:name or file.py:name of a function, or a file.onnx"


_MOST_LISTED = 5


def _may_be_driver(name: str, value: object) -> bool:
    """Whether a message may propose an attribute of a module as a driver."""
    return callable(value) and not name.startswith("_")


def _unknown_driver(name: str, option: str, expected: str) -> ConfigError:
    return ConfigError(
        what="driver",
        where=option,
        expected=expected,
        got=name or "nothing",
        next_step="correct the name; modules in this folder are found as well",
    )


def _module(where: str) -> Any:
    """A module by its name or file."""
    if not where.endswith(".py"):
        sys.path.insert(0, str(Path.cwd()))
        try:
            return importlib.import_module(where)
        finally:
            sys.path.pop(0)
    spec = importlib.util.spec_from_file_location(Path(where).stem, where)
    if spec is None or spec.loader is None:
        raise ImportError(f"no module in {where}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # Classes are looked up in it.
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[module.__name__]  # Half a module would be imported under its name.
        raise
    return module
