"""Public functions that compare drivers of the ego, and that load a driver from a name or file.

The *ego* is the vehicle whose overtaking is studied. A *driver* controls it: the human model of the
simulation, one of `BUILTIN_DRIVERS`, or a function or neural network of the user. A *scene* is a
scenario drawn at random: road, weather, traffic, and the ego's start. Every driver meets the same
scenes, so differences in outcome are differences between drivers.
A *profile* is a named setting that scenes are drawn from, such as `motorway`.

Python calls `evaluate` and `run_benchmark`; the command line also `resolve_driver` and
`load_driver`, which turn its options into a `Driver`. `check_arguments` raises a `ConfigError` for
an argument of another type than its annotation.
"""

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
from overtaking.sim import built_in_drivers, external_driver
from overtaking.sim.ego_observation import DriverFunction
from overtaking.sim.external_driver import Driver
from overtaking.sim.sensors import Sensor

if TYPE_CHECKING:
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.evaluation.run import Contestant

HUMAN, STAY = "human", "stay"
"""Names of drivers in `BUILTIN_DRIVERS`."""


BUILTIN_DRIVERS: Mapping[str, Driver | None] = {
    HUMAN: None,
    STAY: Driver(function=built_in_drivers.stay, observation="human", action="decision", name=STAY),
    "rules": Driver(
        function=built_in_drivers.rules, observation="human", action="decision", name="rules"
    ),
}
"""Drivers of the package by name. None marks the human model, which the engine itself computes.

`stay` never changes lanes; `rules` overtakes by fixed rules. Both observe the traffic as a human
perceives it (`observation="human"`, no reference to the driver `human`) and decide about lane
changes only (`action="decision"`). The human model keeps the distance to the vehicle ahead for
them.
"""


DEFAULT_REFERENCES = (HUMAN, STAY)
"""Drivers that an evaluated driver is compared with, unless the caller names others."""


RISK_SUFFIX = "-risk"
"""End of the name of a variant of a profile that draws dangerous scenes more often.

Accidents are so rare that thousands of natural scenes may pass without an accident. The weights of
the scenes restore natural rates in the result.
"""


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
    """Simulate the same scenes with several drivers, and compare safety, law, time and comfort.

    Args:
        driver: The driver to evaluate: a `Driver`, or a name in `BUILTIN_DRIVERS`.
        profile: Profile of the scenes: a name, a TOML file or a specification (the content of such
            a file, as an object). If the package has a profile of this name with the suffix
            `-risk`, that variant is used instead; the default is such a variant.
        num_simulations: Number of scenes, 1 to 1,000,000.
        seed: Seed of the random numbers of the scenes, 0 <= seed < 2**64.
        references: Drivers to compare it with. All names must differ, also from the evaluated one.
        natural: Whether to use the named profile itself, such as `motorway`, instead of its
            variant. Dangerous scenes are rare in it.
        overrides: New values of keys of the specification, such as
            `{"traffic.vehicles": "2..6"}`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.
        progress: Called with the number of simulations that are done, and of all: scenes times
            drivers.
        say: Called before the first simulation with a sentence that names the `-risk` variant, if
            it replaces the named profile.

    Returns:
        Rates of each driver with 95 % intervals, differences, safety margins and the worst scenes;
        `write_report` makes a page of it.

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
    evaluation = run(
        spec,
        resolve_road(road or spec.road),
        num_simulations,
        seed,
        policy=evaluated,  # The driver; elsewhere a policy is a set of rules of law.
        references=others,
        # Time gained is measured against `stay`, so it is simulated even if it is not a reference.
        stay=_contestant(STAY, "references"),
        progress=progress,
    )
    if risk_profile is None:
        return evaluation
    # Reports state both profiles: the one that the caller named, and the variant that was used.
    return replace(evaluation, asked_profile=str(profile))


@check_arguments
def run_benchmark(
    driver: str | Driver,
    benchmark: str | Path,
    *,
    references: Sequence[str | Driver] = DEFAULT_REFERENCES,
    progress: ProgressCallback | None = None,
) -> "BenchmarkResult":
    """Compare a driver with others in the published, unchanging scenes of a benchmark.

    A benchmark file names profiles, seeds and numbers of scenes, with hashes that reveal a changed
    profile or model, so that results of different users can be compared.

    Args:
        driver: The driver to evaluate: a `Driver`, or a name in `BUILTIN_DRIVERS`.
        benchmark: Name of a benchmark of the package, such as `overtake`, or a TOML file.
        references: Drivers to compare it with, as in `evaluate`.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        An evaluation for each profile of the benchmark.

    Raises:
        ConfigError: There is no such benchmark, or a profile or the model has changed since it was
            published; or as in `evaluate`.
        DriverError: A driver raises an exception, or its answer is not an action.
    """
    from overtaking.analysis.evaluation.benchmark import read as read_benchmark
    from overtaking.analysis.evaluation.benchmark import run

    evaluated, *others = _compared_drivers([driver, *references])
    stay = _contestant(STAY, "references")  # Time gained is measured against it.
    # `run` calls `resolve_road` for the road of each profile of the benchmark.
    return run(read_benchmark(benchmark), evaluated, others, stay, resolve_road, progress)


def resolve_driver(
    name: str, observation: str | None, *, action: str, action_repeat: int, option: str = "--driver"
) -> str | Driver:
    """Turn the options of a command into a driver for `evaluate`.

    Args:
        name: A name in `BUILTIN_DRIVERS`, which is returned unchanged, or a name that `load_driver`
            accepts.
        observation: As in `load_driver`. None if the option is missing, which is an error except
            for a built-in driver.
        action: As in `load_driver`; not used for a built-in driver.
        action_repeat: As in `load_driver`; not used for a built-in driver.
        option: Option of the command line that gave `name`, for error messages.

    Raises:
        ConfigError: No such driver or sensor exists, or `observation` is missing.
        MissingExtraError: The name is an ONNX file, and the extra `onnx` is not installed.
    """
    if name in BUILTIN_DRIVERS:
        return name
    # Before the check of `observation`: after a misspelt name, such as `rule`, a demand for
    # --observation would mislead.
    function = load_driver_function(name, option, BUILTIN_DRIVERS)
    if observation is None:
        raise ConfigError(
            what="--observation",
            where="evaluate",
            expected=f"human, truth or the file of a sensor, for {option} {name}",
            got="nothing",
            next_step=f"add --observation, or choose one of {', '.join(BUILTIN_DRIVERS)}",
        )
    return _driver_from_function(
        function, name, observation, action=action, action_repeat=action_repeat
    )


def _risk_profile(profile: ProfileSource) -> str | None:
    """Name of the `-risk` variant of a profile; None if the package has no such variant."""
    if not isinstance(profile, str):  # A file or a specification, not a name.
        return None
    name = f"{profile}{RISK_SUFFIX}"
    return name if name in profiles.profile_names() else None


def _compared_drivers(drivers: Sequence[str | Driver]) -> "list[Contestant]":
    """Prepare drivers for the comparison.

    Args:
        drivers: The driver under evaluation first, then the references.

    Returns:
        The drivers in the same order, each with its name and the function that simulates it.

    Raises:
        ConfigError: No driver has such a name, or two drivers have the same name.
    """
    contestants = [
        _contestant(driver, "driver" if index == 0 else "references")
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
    """Prepare a driver; error messages state `argument_name`, the argument that it comes from."""
    from overtaking.analysis.evaluation.run import Contestant

    engine = simulator_module("engine")
    if isinstance(driver, str):
        name = driver
        if name not in BUILTIN_DRIVERS:
            names = nearest_first(name, BUILTIN_DRIVERS)
            raise ConfigError.unknown_choice(
                what=argument_name, where="evaluate", choices=names, got=name
            )
        builtin_driver = BUILTIN_DRIVERS[name]
        if builtin_driver is None:  # The human model, which drives in an ordinary simulation.
            return Contestant(name=name, simulate=engine.simulate)
        driver = builtin_driver
    # Short name for tables: `keep_gap` for `lib/a.py:keep_gap`, `net.onnx` for `nets/net.onnx`.
    short_name = driver.display_name.rpartition(":")[2].rpartition("/")[2]
    return Contestant(
        name=short_name,
        simulate=partial(_simulate_with_driver, driver=driver),
        # Reports state these four; the digest is the SHA-256 of the driver's file.
        source=driver.display_name,
        digest=driver.sha256,
        observe="sensor" if isinstance(driver.observation, Sensor) else driver.observation,
        action=driver.action,
    )


def _simulate_with_driver(scenario: Scenario, driver: Driver) -> Trajectories:
    """Simulate a batch of scenarios on the engine, with the driver in every ego.

    `external_driver.drive` asks the driver for all its actions and passes them to the engine's
    `run`. In all else this is a simulation like the engine's `simulate`.
    """
    return external_driver.drive(scenario, driver, simulator_module("engine").run)


def load_driver(name: str, observation: str, *, action: str, action_repeat: int) -> Driver:
    """Load a driver of the user.

    Args:
        name: `module:name` or `file.py:name` of a function, or of a class whose objects are
            callable; or the path of an ONNX file with a neural network.
        observation: Input of the driver: `human` for the perception of a human, `truth` for the
            exact state, or a TOML file with the numbers of a sensor (ranges, errors, latency).
        action: Output of the driver, a name in `sim.action_spaces.ACTION_SPACES` such as
            `accel_lane` (acceleration and lane) or `decision` (lane changes only).
        action_repeat: Time for which an action holds, in units of 50 ms, 1 to 200. The driver is
            asked again after it.

    Raises:
        ConfigError: No such driver or sensor exists, or another argument cannot be used.
        MissingExtraError: The name is an ONNX file, and the extra `onnx` is not installed.
    """
    function = load_driver_function(name)
    return _driver_from_function(
        function, name, observation, action=action, action_repeat=action_repeat
    )


def _driver_from_function(
    function: DriverFunction, name: str, observation: str, *, action: str, action_repeat: int
) -> Driver:
    """Make a driver from its loaded function; other arguments as in `load_driver`."""
    is_sensor_file = observation.endswith(".toml")
    driver = Driver(
        function=function,
        observation=Sensor.from_file(observation) if is_sensor_file else observation,
        action=action,
        action_repeat=action_repeat,
        name=name,
    )
    _check_num_parts(driver)
    return driver


def _check_num_parts(driver: Driver) -> None:
    """Refuse a network whose number of output values is not the number of parts of its action.

    The parts of an action are its numbers, such as acceleration and lane. Only networks have an
    attribute `num_parts`; the answers of Python functions are checked when they drive.
    """
    parts = driver.action_space.parts
    num_parts = getattr(driver.function, "num_parts", None)
    if num_parts not in (None, len(parts)):
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
    """Load the function of a driver from a Python module, a Python file or an ONNX file.

    If the name is a class, it is called without arguments and its object is returned.

    Args:
        name: `module:name`, `file.py:name` or `file.onnx`.
        option: Option of the command line that gave `name`, for error messages.
        builtin: Further names for the error to propose if `name` has another form.

    Raises:
        ConfigError: No such module, file, function or driver exists.
        MissingExtraError: The name is an ONNX file, and the extra `onnx` is not installed.
    """
    if name.endswith(".onnx"):
        from overtaking.sim.built_in_drivers import OnnxDriver

        return OnnxDriver(Path(name))
    module_or_file, _, attribute = name.rpartition(":")
    if not module_or_file or not attribute:
        builtin_names = ", ".join(nearest_first(name, builtin))
        raise _unknown_driver(name, option, f"{builtin_names or 'a driver'}, {_FORMS}")
    try:
        module = _import_module(module_or_file)
    except Exception as error:  # The module of another author may raise anything.
        message = f"{name} ({type(error).__name__}: {error})"
        raise _unknown_driver(message, option, _FORMS) from error
    if not hasattr(module, attribute):
        functions = [key for key, value in vars(module).items() if _may_be_driver(key, value)]
        nearest = nearest_first(attribute, functions)[:_MAX_PROPOSALS]
        listed = ", ".join(f"{module_or_file}:{function}" for function in nearest)
        expected = listed or f"{_FORMS}; {module_or_file} defines no function"
        raise _unknown_driver(f"{name} ({module_or_file} has no {attribute})", option, expected)
    function = getattr(module, attribute)
    try:
        return function() if isinstance(function, type) else function
    except Exception as error:  # The constructor may raise anything, too.
        message = f"{name} ({type(error).__name__}: {error})"
        raise _unknown_driver(message, option, "a class without arguments") from error


_FORMS = "module:name or file.py:name of a function, or a file.onnx"
"""Forms of a driver's name, for error messages."""


_MAX_PROPOSALS = 5
"""Largest number of functions that an error message proposes. Chosen: a short message."""


def _may_be_driver(name: str, value: object) -> bool:
    """Whether a message may propose an attribute of a module as a driver."""
    return callable(value) and not name.startswith("_")


def _unknown_driver(name: str, option: str, expected: str) -> ConfigError:
    """The error for a name without a driver; `expected` lists valid names or forms."""
    return ConfigError(
        what="driver",
        where=option,
        expected=expected,
        got=name or "nothing",
        next_step="correct the name; modules in this folder are found as well",
    )


def _import_module(module_or_file: str) -> Any:
    """Import a module by its name, or run a file whose path ends in `.py` as a module."""
    if not module_or_file.endswith(".py"):
        # As with `python -m`, modules in the working folder come before installed ones.
        sys.path.insert(0, str(Path.cwd()))
        try:
            return importlib.import_module(module_or_file)
        finally:
            sys.path.pop(0)
    spec = importlib.util.spec_from_file_location(Path(module_or_file).stem, module_or_file)
    if spec is None or spec.loader is None:
        raise ImportError(f"no module in {module_or_file}")
    module = importlib.util.module_from_spec(spec)
    # Registered before it runs, as `import` does: dataclasses look up their module there.
    sys.modules[module.__name__] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[module.__name__]  # Else a later `import` gets a half-executed module.
        raise
    return module
