"""A driver of one's own in the world."""

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
from overtaking.sim.driving import Driver
from overtaking.sim.observation import Policy
from overtaking.sim.sensor import Sensor


@check_arguments
def drive(
    scenario: Scenario,
    policy: Any,
    *,
    observe: str | Sensor,
    action: str = "accel_lane",
    hold: int = 1,
    simulator: str = "engine",
) -> Trajectories:
    """Simulate a batch in which a policy drives every ego; the others drive as ever.

    Args:
        scenario: A batch of scenarios.
        policy: A function from an `Observation` of all simulations to an array with an action for
            each.
        observe: What it observes: `human` for what the model's driver believes, `truth` for the
            state of the world, or a `Sensor`.
        action: What it answers: `accel_lane`, `speed_lane`, `accel_steer`, `trajectory` or
            `decision`; with the indicator as a part of it, `accel_move` or `accel_steer_signal`.
        hold: Decisions for which an answer holds, 20 a second.
        simulator: One of `BRANCHING`; the results are the same, bit for bit.

    Returns:
        The batch, with what the policy did as `actions`; simulated with them again it is the same.

    Raises:
        ConfigError: An argument cannot be used, or the scenario cannot be run.
        PolicyError: The policy raises, or answers what is no action.
    """
    run = module_of(simulator, BRANCHING).run
    check_runnable(scenario, "drive")
    driver = Driver(policy=policy, observe=observe, action=action, hold=hold)
    return driving.drive(scenario, driver, run, simulator)


def driven_by(driver: Driver, simulator: str) -> Simulator:
    """The simulator in which a policy drives every ego."""
    base = simulator_of(simulator)
    run = module_of(simulator, BRANCHING).run
    asks = partial(driving.drive, driver=driver, run=run, simulator=simulator)
    # A policy may keep a state of its own, so it is asked by one process, one batch at a time.
    return dataclasses.replace(base, simulate=asks, threads=1, shares_world=True)


def record_of(driver: Driver) -> PolicyRecord:
    """What a manifest says of a driver."""
    sensor = driver.observe
    return PolicyRecord(
        name=driver.title,
        version=driver.version,
        digest=driver.digest,
        observe=dataclasses.asdict(sensor) if isinstance(sensor, Sensor) else sensor,
        action=driver.action,
        hold=driver.hold,
    )


def driver_of(
    policy: str, observe: str, *, action: str, hold: int, option: str = "--policy"
) -> Driver:
    """The driver that the options of a command name.

    Args:
        policy: `module:name` or `file.py:name` of a function, or of a class of policies; or the
            path of an ONNX file.
        observe: `human`, `truth`, or a TOML file with the numbers of a sensor.
        action: As in `Driver`.
        hold: As in `Driver`.
        option: Option of the command line that names the policy, for messages.

    Raises:
        ConfigError: There is no such policy or sensor, or another word cannot be used.
        MissingExtraError: It is an ONNX file, and the extra `onnx` is not installed.
    """
    is_file = observe.endswith(".toml")
    sees = Sensor.read(observe) if is_file else observe
    driver = Driver(
        policy=load_policy(policy, option),
        observe=sees,
        action=action,
        hold=hold,
        name=policy,
    )
    _check_num_parts(driver)
    return driver


def _check_num_parts(driver: Driver) -> None:
    """Refuse a network whose output has more or fewer parts than the action."""
    parts = driver.control.parts
    num_parts = getattr(driver.policy, "num_parts", len(parts))
    if num_parts != len(parts):
        raise ConfigError(
            what=f"output for --action {driver.action}",
            where=driver.name,
            expected=f"{len(parts)} parts ({', '.join(part.name for part in parts)})",
            got=str(num_parts),
            next_step="choose another action, or export the network anew",
        )


def load_policy(name: str, option: str = "--policy", shipped: Iterable[str] = ()) -> Policy:
    """Load a policy from a module, a Python file or an ONNX file.

    A class is called without arguments, and the object is the policy.

    Args:
        name: `module:name`, `file.py:name` or `file.onnx`.
        option: Option of the command line that has this name, for messages.
        shipped: Names of the drivers that the command offers as well, for messages.

    Raises:
        ConfigError: No such module, file, function or driver exists.
        MissingExtraError: The name is that of an ONNX file, and the extra `onnx` is not installed.
    """
    if name.endswith(".onnx"):
        from overtaking.sim.networks import OnnxDriver

        return OnnxDriver(Path(name))
    where, _, attribute = name.rpartition(":")
    if not where or not attribute:
        shipped_names = ", ".join(nearest_first(name, shipped))
        raise _unknown_policy(name, option, f"{shipped_names or 'a policy'}, {_FORMS}")
    try:
        module = _module(where)
    except Exception as error:  # The module of another author may raise anything.
        message = f"{name} ({type(error).__name__}: {error})"
        raise _unknown_policy(message, option, _FORMS) from error
    functions = [key for key, value in vars(module).items() if _may_be_policy(key, value)]
    if not hasattr(module, attribute):
        nearest = nearest_first(attribute, functions)[:_MOST_LISTED]
        listed = ", ".join(f"{where}:{function}" for function in nearest)
        expected = listed or f"{_FORMS}; {where} has none"
        raise _unknown_policy(f"{name} ({where} has no {attribute})", option, expected)
    policy = getattr(module, attribute)
    try:
        return policy() if isinstance(policy, type) else policy
    except Exception as error:  # The constructor may raise anything, too.
        message = f"{name} ({type(error).__name__}: {error})"
        raise _unknown_policy(message, option, "a class without arguments") from error


_FORMS = "module:name or file.py:name of a function, or a file.onnx"
_MOST_LISTED = 5


def _may_be_policy(name: str, value: object) -> bool:
    """Whether a message may propose an attribute of a module as a policy."""
    return callable(value) and not name.startswith("_")


def _unknown_policy(name: str, option: str, expected: str) -> ConfigError:
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
