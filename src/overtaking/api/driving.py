"""Simulations in which a driver of one's own drives the ego."""

import dataclasses
import importlib
import importlib.util
import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from overtaking.api.choices import BRANCHING, module_of, simulator_of
from overtaking.api.simulating import check_runnable
from overtaking.core.errors import ConfigError, nearest_first
from overtaking.data.recipe import PolicyRecord, Simulator
from overtaking.model.checks import check_arguments
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.sim import driving
from overtaking.sim.driving import OBSERVATION_SOURCES, Driver
from overtaking.sim.observation import DriverFunction
from overtaking.sim.sensor import Sensor


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
        observation: Required with a function. What it observes: `human` for what the model's driver
            believes, `truth` for the state of the world, or a `Sensor`.
        action: What it answers: `accel_lane` (the default), `speed_lane`, `accel_steer`,
            `trajectory` or `decision`; with the indicator as a part of it, `accel_move` or
            `accel_steer_signal`.
        action_repeat: Number of decisions for which an action holds, 20 a second, 1 to 200; 1 by
            default.
        simulator: One of `BRANCHING`; the results are the same, bit for bit.

    Returns:
        The batch, with the actions of the driver as `actions`; a simulation with these actions
        gives the same batch.

    Raises:
        ConfigError: An argument cannot be used, or the scenario cannot be run.
        DriverError: The driver raises an exception, or its answer is not an action.
    """
    run = module_of(simulator, BRANCHING).run
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
    base = simulator_of(simulator)
    run = module_of(simulator, BRANCHING).run
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
        MissingExtraError: The name is that of an ONNX file, and the extra `onnx` is not installed.
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
        expected = listed or f"{_FORMS}; {where} has none"
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
