"""Simulations in which an external driver, a program of the user's, drives the ego.

It replaces the *model driver*, the simulator's own driver of the ego. The external driver answers
at each decision for all simulations of a batch at once. This module clips its answers, rounds them
to integers and records them as actions. The batch is then simulated again with these actions. So
every machine can repeat the simulation from the actions, without the driver.
"""

import hashlib
import inspect
import traceback
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
    SteppedObservation,
    split_observation,
)
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.action_spaces import (
    ACTION_SPACES,
    ActionSpace,
    clip_to_limits,
    to_action_integers,
)
from overtaking.sim.branching import Simulate
from overtaking.sim.ego_observation import DriverFunction, Observation
from overtaking.sim.sensors import Sensor, SensorArray
from overtaking.sim.stepping import new_stepper
from overtaking.world.constants import DECISIONS_PER_SECOND, SUBSTEPS
from overtaking.world.step_parameters import StepParameters, step_parameters

OBSERVATION_SOURCES = ("human", "truth")
"""Observations without a sensor: the beliefs of the model driver, or the true state."""


MAX_ACTION_REPEAT = 200
"""Largest number of decisions for which an answer may hold: 10 s. Chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """A function that drives the ego, with its observations and its action space.

    Attributes:
        function: Takes an `Observation` of all simulations, and returns actions of shape
            (simulation, part). A method `reset` of the function, if it exists, is called with the
            `Scenario` of each batch before its start.
        observation: `human` for the beliefs of the model driver, `truth` for the true state, or a
            `Sensor` that measures the true state.
        action: Action space of the answers, a name in `ACTION_SPACES`; by default the first one.
        action_repeat: Number of decisions for which an answer holds, 20 a second, 1 to 200.
        name: Name of the driver; if it is empty, outputs show the name of the function.
        version: Version of the driver; may be empty.
    """

    function: DriverFunction
    observation: str | Sensor
    action: str = next(iter(ACTION_SPACES))
    action_repeat: int = 1
    name: str = ""
    version: str = ""

    def __post_init__(self) -> None:
        """Reject values of the wrong type or range."""
        if not callable(self.function):
            raise ConfigError(
                what="function",
                where="Driver",
                expected="a function of an observation",
                got=self.function,
                next_step="give a function, or an object with __call__",
            )
        if not isinstance(self.observation, Sensor) and self.observation not in OBSERVATION_SOURCES:
            choices = (*OBSERVATION_SOURCES, "a sensor, on the command line its .toml file")
            raise ConfigError.unknown_choice(
                what="observation", where="drive", choices=choices, got=self.observation
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
        definition = self._definition
        return self.name or f"{definition.__module__}:{definition.__qualname__}"

    @property
    def sha256(self) -> str:
        """SHA-256 of the file that defines the function, 64 digits; empty if unknown.

        A function with an attribute `sha256` states it, as `OnnxDriver` does.
        """
        if isinstance(sha256 := getattr(self.function, "sha256", None), str):
            return sha256
        try:
            path = inspect.getfile(self._definition)
            return hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except (OSError, TypeError):  # Functions from a console or a compiled module have no file.
            return ""

    @property
    def _definition(self) -> Any:
        """The function itself, or the class of an object with `__call__`."""
        function: Any = self.function
        return function if hasattr(function, "__qualname__") else type(function)


def drive(
    scenario: Scenario, driver: Driver, run: Simulate, simulator: str = "engine"
) -> Trajectories:
    """Simulate a batch in which an external driver drives every ego.

    Args:
        scenario: A batch of scenarios.
        driver: The driver.
        run: `engine.run` or `reference.run`, which makes the recording.
        simulator: `engine` or `reference`, in which the driver drives.

    Returns:
        The recordings, with the actions of the driver.

    Raises:
        DriverError: The driver raises an exception, or its answer is not an action.
    """
    params = step_parameters(scenario)
    return run(scenario, params, actions=record_actions(scenario, params, driver, simulator))


def record_actions(
    scenario: Scenario, params: StepParameters, driver: Driver, simulator: str
) -> Actions:
    """The actions of a driver in a batch.

    A simulation with these actions has the same bits as the simulation that the driver observed.

    Args:
        scenario: A batch of scenarios.
        params: Parameters of the batch.
        driver: The driver.
        simulator: `engine` or `reference`; both give the same actions.

    Raises:
        DriverError: The driver raises an exception, or its answer is not an action.
    """
    space = driver.action_space
    log = np.zeros(_log_shape(params), np.int32)
    num_clipped = np.zeros(scenario.num_simulations, np.int64)
    if not scenario.num_simulations:  # Steppers need at least one simulation.
        return Actions(values=log, kind=space.kind, num_clipped=num_clipped)
    if (reset := getattr(driver.function, "reset", None)) is not None:
        reset(scenario)
    batch = _DrivenBatch(scenario, params, driver, simulator, log)
    while batch.observation.is_running.any():
        start_observation = batch.observation
        answer = clip_to_limits(
            _call_driver(driver.function, start_observation, space), space.parts
        )
        num_clipped += answer.was_clipped
        if space.track is None:
            batch.carry_out(answer.values, driver.action_repeat)
        else:
            # The answer is a speed or a trajectory: each decision needs its own action to track it.
            for _ in range(driver.action_repeat):
                action = space.track(answer.values, start_observation, batch.observation)
                batch.carry_out(action, 1)
    return Actions(values=log, kind=space.kind, num_clipped=num_clipped)


def _log_shape(params: StepParameters) -> tuple[int, int, int]:
    """Numbers of simulations, decisions and action parts of a batch."""
    # A decision follows every `SUBSTEPS` steps; the first is at step 0.
    last_step = int(params.simulations.last_step.max(initial=0.0))
    return len(params.scenario_index), last_step // SUBSTEPS + 1, MAX_ACTION_PARTS


class _DrivenBatch:
    """A batch that waits at each decision for the action of a driver, and records the actions.

    Attributes:
        observation: The driver's observation at the present decision.

    Args:
        scenario: A batch of scenarios.
        params: Parameters of the batch.
        driver: The driver.
        simulator: `engine` or `reference`.
        log: The record of the actions, shape (simulation, decision, `MAX_ACTION_PARTS`); each
            action is written into it.
    """

    def __init__(
        self,
        scenario: Scenario,
        params: StepParameters,
        driver: Driver,
        simulator: str,
        log: NDArray[np.int32],
    ) -> None:
        """Place the batch before its first decision."""
        kind, source = driver.action_space.kind, driver.observation
        self._scenario, self._log, self._parts = scenario, log, ACTION_KINDS[kind]
        self._vehicle = params.vehicles.at_slots(EGO_SLOT)
        sensor = source if isinstance(source, Sensor) else None
        self._sensors = SensorArray(sensor, scenario, params) if sensor else None
        observes_truth = source != "human"  # Sensors measure the truth.
        self._stepper = new_stepper(
            params, kind, observes_truth=observes_truth, simulator=simulator
        )
        self.observation = self._observe(self._stepper.observe_start(), 0)

    def carry_out(self, action: F64, num_decisions: int) -> None:
        """Carry out an action for some decisions, and record it for each.

        Args:
            action: Actions of the recorded kind, shape (simulation, part).
            num_decisions: Number of decisions for which it holds.
        """
        values = to_action_integers(action, self.observation.is_running, self._parts)
        decision_index = self.observation.decision_index
        next_index = decision_index + num_decisions
        # The last answer may hold beyond the last decision; the slice then ends there.
        self._log[:, decision_index:next_index] = values[:, None]
        stepped = self._stepper.step(values, num_decisions)
        self.observation = self._observe(stepped, next_index)

    def _observe(self, stepped: SteppedObservation, decision_index: int) -> Observation:
        """The observation of the driver, through its sensors if it has any."""
        table, is_running = stepped.table, stepped.is_running
        # The stepper also observes the end of a simulation, where the driver decides no more.
        table[~is_running] = 0.0
        if self._sensors:
            # The parts are views, so the measurements are written into the table.
            _, neighbours, passing = split_observation(table)
            neighbours[...] = self._sensors.measure(neighbours, is_running, decision_index)
            self._sensors.clear_gap_ahead_of_leader(passing)  # No sensor measures this gap.
        return Observation(
            time=decision_index / float(DECISIONS_PER_SECOND),
            decision_index=decision_index,
            is_running=is_running,
            table=table,
            vehicle=self._vehicle,
            scenario=self._scenario,
        )


def _call_driver(function: DriverFunction, observation: Observation, space: ActionSpace) -> F64:
    """The answer of a driver, shape (simulation, part); zero for simulations that have ended.

    Raises:
        DriverError: The driver raises an exception, or its answer is not an action.
    """
    running = np.flatnonzero(observation.is_running)
    expected_shape = (len(observation.is_running), len(space.parts))
    try:
        answer: Any = np.asarray(function(observation))
    except DriverError:
        raise  # `OnnxDriver` raises it with a complete message.
    except Exception as error:
        failure = f"{type(error).__name__}{_error_line(error)}: {error}{_similar_names(error)}"
        raise _driver_error(observation, "an answer", failure, running) from error
    if answer.dtype.kind not in "fiub":  # Floats, integers, unsigned integers, Booleans.
        raise _driver_error(observation, "numbers", f"an array of {answer.dtype}", running)
    if answer.shape == expected_shape[:1] and len(space.parts) == 1:
        answer = answer[:, None]
    if answer.shape != expected_shape:
        expected = f"shape {expected_shape}: {', '.join(part.name for part in space.parts)}"
        raise _driver_error(observation, expected, f"shape {answer.shape}", running)
    values = answer.astype(np.float64)
    invalid = np.flatnonzero(~np.isfinite(values).all(axis=1) & observation.is_running)
    if len(invalid):
        raise _driver_error(observation, "finite numbers", values[invalid[0]].tolist(), invalid)
    return np.where(observation.is_running[:, None], values, 0.0)


def _error_line(error: Exception) -> str:
    """The last line of the driver's file in the traceback of an error, in words.

    The driver's file is the file of its outermost call; libraries that it calls have other files.
    """
    # The first entry is the call in this module.
    (_, *driver_calls) = traceback.extract_tb(error.__traceback__)
    if not driver_calls:
        return ""
    file = driver_calls[0].filename
    lines = [call.lineno for call in driver_calls if call.filename == file]
    return f" in {Path(file).name}, line {lines[-1]}"


def _similar_names(error: Exception) -> str:
    """The existing names that are most similar to an attribute that does not exist."""
    if not isinstance(error, AttributeError) or error.obj is None:
        return ""
    # The columns of an observation are named tuples, whose methods would only distract.
    names = getattr(type(error.obj), "_fields", None) or dir(error.obj)
    public_names = [name for name in names if not name.startswith("_")]
    # With the cutoff 0 the three most similar names are listed, however different they are.
    similar = get_close_matches(str(error.name), public_names, cutoff=0.0)
    return f"; similar names: {', '.join(similar)}" if similar else ""


def _driver_error(
    observation: Observation, expected: str, got: object, rows: NDArray[np.integer]
) -> DriverError:
    """The error for an invalid answer in some rows of the batch, at least one."""
    first_index = int(observation.scenario.scenario_index[rows[0]])
    others = f" and {len(rows) - 1} others" if len(rows) > 1 else ""
    return DriverError(
        what="answer of the driver",
        where=f"simulation {first_index}{others} at {observation.time:.2f} s",
        expected=expected,
        got=got,
        next_step="correct the driver; --resume continues after the simulations already written",
    )
