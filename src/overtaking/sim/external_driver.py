"""A driver of the user's that drives the ego of every simulation of a batch."""

import hashlib
import inspect
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError, DriverError, check_choice, check_whole_number
from overtaking.model.driver_interface import (
    ACTION_KINDS,
    MAX_ACTION_PARTS,
    Actions,
    split_observation,
)
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.sim.action_spaces import (
    ACTION_SPACES,
    ActionSpace,
    clip_to_limits,
    to_action_integers,
)
from overtaking.sim.branching import Simulate
from overtaking.sim.ego_observation import DriverFunction, Observation
from overtaking.sim.reference.simulation import SteppedObservation
from overtaking.sim.sensors import Sensor, SensorArray
from overtaking.sim.stepping import new_stepper
from overtaking.world.constants import DECISIONS_PER_SECOND, SUBSTEPS
from overtaking.world.step_parameters import StepParameters, step_parameters

OBSERVATION_SOURCES = ("human", "truth")
"""Observations without a sensor: the beliefs of the model's driver, or the state of the world."""


MAX_ACTION_REPEAT = 200
"""Largest number of decisions for which an action holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """A function that drives the ego, with its observations and actions.

    Attributes:
        function: Takes an `Observation` of all simulations, and returns actions of shape
            (simulation, part). Its method `reset`, if it has one, takes the scenarios before each
            batch.
        observation: `human` for the beliefs of the model's driver, `truth` for the state of the
            world, or a `Sensor`.
        action: What it answers, a name in `CONTROLS`.
        action_repeat: Number of decisions for which an action holds, 20 a second, 1 to 200.
        name: Its name; that of the function if left out.
        version: Its version, if it has one.
    """

    function: DriverFunction
    observation: str | Sensor
    action: str = next(iter(ACTION_SPACES))
    action_repeat: int = 1
    name: str = ""
    version: str = ""

    def __post_init__(self) -> None:
        """Refuse a value that is out of its range."""
        if not callable(self.function):
            raise ConfigError(
                what="function",
                where="Driver",
                expected="a function of an observation",
                got=self.function,
                next_step="give a function, or an object with __call__",
            )
        if not isinstance(self.observation, Sensor) and self.observation not in OBSERVATION_SOURCES:
            known = (*OBSERVATION_SOURCES, "a sensor, on the command line its .toml file")
            raise ConfigError.unknown_choice(
                what="observation", where="drive", choices=known, got=self.observation
            )
        check_choice(self.action, ACTION_SPACES, what="action", where="drive")
        action_repeat = check_whole_number(
            self.action_repeat, 1, MAX_ACTION_REPEAT, what="action_repeat", where="drive"
        )
        object.__setattr__(self, "action_repeat", action_repeat)

    @property
    def action_space(self) -> ActionSpace:
        """The actions that the driver may answer."""
        return ACTION_SPACES[self.action]

    @property
    def display_name(self) -> str:
        """Name of the driver, or of its function."""
        one: Any = self.function
        named = one if hasattr(one, "__qualname__") else type(one)
        return self.name or f"{named.__module__}:{named.__qualname__}"

    @property
    def sha256(self) -> str:
        """SHA-256 of the file that defines the function, 64 digits; empty if unknown."""
        one: Any = self.function
        if isinstance(stated := getattr(one, "sha256", None), str):
            return stated
        try:
            path = inspect.getfile(one if hasattr(one, "__qualname__") else type(one))
            return hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except (OSError, TypeError):
            return ""


def drive(
    scenario: Scenario, driver: Driver, run: Simulate, simulator: str = "engine"
) -> Trajectories:
    """Simulate a batch in which a driver of the user's drives every ego.

    Args:
        scenario: A batch of scenarios.
        driver: The driver.
        run: `engine.run` or `reference.run`.
        simulator: Which of them, by name.

    Raises:
        DriverError: The driver raises an exception, or its answer is not an action.
    """
    params = step_parameters(scenario)
    return run(scenario, params, actions=record_actions(scenario, params, driver, simulator))


def record_actions(
    scenario: Scenario, params: StepParameters, driver: Driver, simulator: str
) -> Actions:
    """The actions of a driver in a batch; a simulation with these actions is the one it observed.

    Args:
        scenario: A batch of scenarios.
        params: Parameters of the batch.
        driver: The driver.
        simulator: `engine` or `reference`; both let it do the same.
    """
    last = int(params.simulations.last_step.max(initial=0.0))
    log = np.zeros((scenario.num_simulations, last // SUBSTEPS + 1, MAX_ACTION_PARTS), np.int32)
    clipped = np.zeros(scenario.num_simulations, np.int64)
    if scenario.num_simulations:
        for decision, values in _decisions(scenario, params, driver, simulator, clipped):
            rows = log[:, decision : decision + len(values)]
            rows[...] = values.swapaxes(0, 1)[:, : rows.shape[1]]
    return Actions(values=log, kind=driver.action_space.kind, num_clipped=clipped)


def _decisions(
    scenario: Scenario,
    params: StepParameters,
    driver: Driver,
    simulator: str,
    clipped: NDArray[np.int64],
) -> Iterator[tuple[int, NDArray[np.int32]]]:
    """The number of a decision, and the actions from there on, (decision, simulation, part).

    Counts the answers that were beyond the limits.
    """
    control, sensor, action_repeat = driver.action_space, driver.observation, driver.action_repeat
    observes_truth = sensor != "human"
    if (reset := getattr(driver.function, "reset", None)) is not None:
        reset(scenario)
    steps = new_stepper(params, control.kind, observes_truth=observes_truth, simulator=simulator)
    eyes = _Observer(scenario, params, sensor if isinstance(sensor, Sensor) else None)
    observation, decision = eyes.observe(steps.observe_start(), 0), 0
    while observation.is_running.any():
        answer, num_clipped = clip_to_limits(
            _call_driver(driver.function, observation, control), control.parts
        )
        clipped += num_clipped
        if control.plan is None:
            values = to_action_integers(answer, observation.is_running, ACTION_KINDS[control.kind])
            yield decision, np.broadcast_to(values, (action_repeat, *values.shape))
            decision += action_repeat
            observation = eyes.observe(steps.step(values, action_repeat), decision)
            continue
        track = control.plan(answer, observation)
        for _ in range(action_repeat):
            values = to_action_integers(
                track(observation), observation.is_running, ACTION_KINDS[control.kind]
            )
            yield decision, values[None]
            decision += 1
            observation = eyes.observe(steps.step(values, 1), decision)


class _Observer:
    """Makes observations of a batch from the numbers of the engines."""

    def __init__(self, scenario: Scenario, params: StepParameters, sensor: Sensor | None) -> None:
        self._scenario, self._vehicle = scenario, params.vehicles.at_slots(0)
        self._sensing = SensorArray(sensor, scenario, params) if sensor else None

    def observe(self, stepped: SteppedObservation, decision: int) -> Observation:
        table, active = stepped.table, stepped.runs
        table[~active] = 0.0
        if self._sensing:
            _, neighbours, passing = split_observation(table)
            neighbours[...] = self._sensing.measure(neighbours, active, decision)
            self._sensing.clear_gap_ahead_of_leader(passing)
        return Observation(
            time=decision / float(DECISIONS_PER_SECOND),
            decision_index=decision,
            is_running=active,
            table=table,
            vehicle=self._vehicle,
            scenario=self._scenario,
        )


def _call_driver(function: DriverFunction, observation: Observation, control: ActionSpace) -> F64:
    """The answer of a driver, shape (simulation, part).

    Raises:
        DriverError: The driver raises an exception, or its answer is not an action.
    """
    running = np.flatnonzero(observation.is_running)
    expected = (len(observation.is_running), len(control.parts))
    try:
        answer: Any = np.asarray(function(observation))
    except DriverError:
        raise  # It says already what is wrong; the message would be cut within another one.
    except Exception as error:
        got = f"{type(error).__name__}{_error_line(error)}: {error}{_similar_names(error)}"
        raise _driver_error(observation, "an answer", got, running) from error
    if answer.dtype.kind not in "fiub":
        raise _driver_error(observation, "numbers", f"an array of {answer.dtype}", running)
    if answer.shape == expected[:1] and expected[1] == 1:
        answer = answer[:, None]
    if answer.shape != expected:
        wanted = f"shape {expected}: {', '.join(part.name for part in control.parts)}"
        raise _driver_error(observation, wanted, f"shape {answer.shape}", running)
    values = answer.astype(np.float64)
    wrong = np.flatnonzero(~np.isfinite(values).all(axis=1) & observation.is_running)
    if len(wrong):
        raise _driver_error(observation, "finite numbers", values[wrong[0]].tolist(), wrong)
    return np.where(observation.is_running[:, None], values, 0.0)


def _error_line(error: Exception) -> str:
    """The last line of the driver's file in the traceback of an error, in words."""
    (_, *own) = traceback.extract_tb(error.__traceback__)  # The first one is ours.
    lines = [one.lineno for one in own if one.filename == own[0].filename]
    return f" in {Path(own[0].filename).name}, line {lines[-1]}" if own else ""


def _similar_names(error: Exception) -> str:
    """The existing names that are most similar to an attribute that does not exist."""
    if not isinstance(error, AttributeError) or error.obj is None:
        return ""
    names = getattr(type(error.obj), "_fields", None) or dir(error.obj)
    public_names = [name for name in names if not name.startswith("_")]
    similar = get_close_matches(str(error.name), public_names, cutoff=0.0)
    return f"; near are {', '.join(similar)}" if similar else ""


def _driver_error(
    observation: Observation, expected: str, got: object, wrong: NDArray[np.integer]
) -> DriverError:
    """The error for an invalid answer."""
    first = int(observation.scenario.scenario_index[wrong[0]])
    others = f" and {len(wrong) - 1} others" if len(wrong) > 1 else ""
    return DriverError(
        what="answer of the driver",
        where=f"simulation {first}{others} at {observation.time:.2f} s",
        expected=expected,
        got=got,
        next_step="correct the driver; what is already written stays, and --resume goes on with it",
    )
