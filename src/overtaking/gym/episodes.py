"""Episodes in the rows of a batch, and the supply of their scenarios.

Each row of the batch is one environment. When its episode is over, the next one begins in the same
row while the other rows go on.
"""

import dataclasses
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, Mask
from overtaking.labels.label import label
from overtaking.model.batch import concatenate
from overtaking.model.driver_interface import (
    ACTION_KINDS,
    MAX_ACTION_PARTS,
    Actions,
    EgoColumns,
)
from overtaking.model.overtake_events import Outcome
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.scenarios import sampler, specification
from overtaking.sim import engine
from overtaking.sim.controls import CONTROLS
from overtaking.sim.driving import rounded
from overtaking.sim.observation import EgoObservation
from overtaking.sim.stepping import Renewable
from overtaking.world.constants import DECISIONS_PER_SECOND, SUBSTEPS
from overtaking.world.step_parameters import (
    SIMULATION_FIELDS,
    StepParameters,
    VehicleParameters,
    step_parameters,
)

MAX_DRAWN_AHEAD = 256
"""Scenarios that a supply draws at a time once it is running, unless it has more environments."""

_LAST_STEP = SIMULATION_FIELDS.index("last_step")
# The ego's own columns are the first of an observation, so this is also the column of its stage.
_STAGE = EgoColumns._fields.index("stage")


class SampledScenarios:
    """Scenarios that were drawn together, with their parameters."""

    def __init__(self, scenario: Scenario) -> None:
        """Compute the parameters."""
        self.scenario, self.parameters = scenario, step_parameters(scenario)


class ScenarioRef(NamedTuple):
    """One scenario of a sampled batch."""

    batch: SampledScenarios
    row: int


class SortedRefs(NamedTuple):
    """References to scenarios, sorted by batch, so that each batch is indexed once.

    Attributes:
        batches: The sampled batches, each once.
        rows: Rows of each batch.
        restore: Order that puts the joined rows into the original order.
    """

    batches: list[SampledScenarios]
    rows: list[NDArray[np.int64]]
    restore: NDArray[np.int64]


def sort_refs(refs: Sequence[ScenarioRef]) -> SortedRefs:
    """Sort references by batch."""
    batches = list(dict.fromkeys(ref.batch for ref in refs))
    positions = [
        [position for position, ref in enumerate(refs) if ref.batch is batch] for batch in batches
    ]
    rows = [np.array([refs[position].row for position in of_batch]) for of_batch in positions]
    order = [position for of_batch in positions for position in of_batch]
    return SortedRefs(batches, rows, np.argsort(order))


class ScenarioSupply:
    """The scenarios of several environments.

    Episode k of environment i has the scenario index first_scenario + i + k n, with n environments.
    The scenarios of an environment therefore do not depend on how long the episodes of the others
    last.

    Args:
        spec: The specification to sample from.
        road: The road of all scenarios.
        num_envs: Number of environments, n.
        first_scenario: Scenario index of the first episode.
    """

    def __init__(
        self, spec: specification.Specification, road: Road, *, num_envs: int, first_scenario: int
    ) -> None:
        """Start with seed 0; the first call of `take` draws scenarios."""
        self._spec, self._road, self._num_envs = spec, road, num_envs
        self._first_scenario = first_scenario
        self.restart(0)

    def restart(self, seed: int) -> None:
        """Start again from the first episodes, with a seed."""
        self._seed = seed
        self._next_episode = np.zeros(self._num_envs, np.uint64)
        self._ready = [deque[ScenarioRef]() for _ in range(self._num_envs)]
        self._num_ahead = 1

    def take(self, rows: Iterable[int]) -> list[ScenarioRef]:
        """The next scenario of some environments."""
        rows = list(rows)
        if not all(self._ready[row] for row in rows):
            self._draw_ahead()
        return [self._ready[row].popleft() for row in rows]

    def draw(self, scenario_index: NDArray[np.uint64]) -> list[ScenarioRef]:
        """Scenarios of given indices; the sequence that `take` follows stays as it is."""
        batch = SampledScenarios(
            sampler.ScenarioSource(self._spec, self._road, self._seed).sample(scenario_index)
        )
        return [ScenarioRef(batch, row) for row in range(len(scenario_index))]

    def _draw_ahead(self) -> None:
        """Draw scenarios for all environments, more at a time with every call."""
        # The first call draws one scenario for each environment, so that `reset` returns soon.
        # Later calls draw twice as many each time, because a large batch costs less per scenario.
        num_missing = [max(self._num_ahead - len(ready), 0) for ready in self._ready]
        rows = np.repeat(np.arange(self._num_envs), num_missing)
        scenario_index = np.empty(len(rows), np.uint64)
        for position, row in enumerate(rows):
            episode = self._next_episode[row]
            scenario_index[position] = np.uint64(self._first_scenario + row) + episode * np.uint64(
                self._num_envs
            )
            self._next_episode[row] += np.uint64(1)
        for row, ref in zip(rows, self.draw(scenario_index), strict=True):
            self._ready[row].append(ref)
        self._num_ahead = min(2 * self._num_ahead, max(1, MAX_DRAWN_AHEAD // self._num_envs))


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeSettings:
    """Settings that all environments of a batch share.

    Attributes:
        num_envs: Number of environments.
        action: Name of the action space, a key of `CONTROLS`. Several of them become the same kind
            of action of the engine, a key of `ACTION_KINDS`.
        action_repeat: Decisions for which an action holds, 20 a second.
        observes_truth: Whether the true state is observed, not what the driver perceives.
    """

    num_envs: int
    action: str
    action_repeat: int
    observes_truth: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeVerdicts:
    """Labels of episodes that have ended, each of shape (episode,).

    Attributes:
        outcome: `Outcome`.
        is_legal: Whether the simulation is legal under the policy `default`, for every profile.
        num_broken: Number of rules of that policy that it breaks.
    """

    outcome: NDArray[np.uint8]
    is_legal: Mask
    num_broken: NDArray[np.uint8]

    @property
    def is_completed(self) -> Mask:
        """Whether the label says that the overtake was completed."""
        return self.outcome == Outcome.COMPLETED


class EpisodeBatch:
    """Episodes of several environments; each runs in a row of a batch of the engine.

    A batch can be pickled and copied in the middle of its episodes. The copy carries out all
    actions since the start of each episode again, which costs what the episodes have cost.

    Attributes:
        observations: Observations of the egos, shape (env, `OBSERVATION_SIZE`), with the columns
            of `model.driver_interface`. An episode that has ended keeps its last observation until
            the next one begins.
        is_running: Whether an episode goes on, shape (env,).
        scenario_index: Index of the scenario of each episode, shape (env,).
        num_decisions: Decisions since the start of each episode, shape (env,).
        num_step_decisions: Decisions of the last step; fewer than it holds where an episode ended
            within it. Shape (env,).
        num_clipped: Actions outside their limits since the start of each episode, shape (env,); the
            environment counts them.

    Args:
        supply: Source of the scenarios.
        settings: Settings that all environments share.
        refs: First scenario of each environment.
    """

    def __init__(
        self, supply: ScenarioSupply, settings: EpisodeSettings, refs: Sequence[ScenarioRef]
    ) -> None:
        """Begin the first episode of each environment."""
        num_envs = settings.num_envs
        self._supply, self._settings, self._refs = supply, settings, list(refs)
        params = join_parameters(sort_refs(self._refs))
        # Decisions fall on steps 0, SUBSTEPS, 2 SUBSTEPS ... up to the last step. The specification
        # sets one horizon for all its scenarios, so later episodes need no more.
        max_decisions = int(params.simulation_table[_LAST_STEP].max()) // SUBSTEPS + 1
        # All actions are kept: labels, pictures and copies of the batch simulate them again.
        self._actions = np.zeros((num_envs, max_decisions, len(self._parts)), np.int32)
        # Each parameter has shape (vehicle, env); the ego is vehicle 0.
        self._vehicle = np.array([values[EGO_SLOT] for values in params.vehicles])
        self.scenario_index = params.scenario_index.astype(np.int64)
        self.num_decisions = np.zeros(num_envs, np.int64)
        self.num_step_decisions = np.zeros(num_envs, np.int64)
        self.num_clipped = np.zeros(num_envs, np.int64)
        self._stepper = Renewable(params, self._kind, is_true=settings.observes_truth)
        observed = self._stepper.begin()
        self.observations, self.is_running = observed.table, observed.runs

    def __getstate__(self) -> dict[str, Any]:
        """All but the compiled stepper, whose state belongs to the engine."""
        return {name: value for name, value in vars(self).items() if name != "_stepper"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a batch in the middle of its episodes."""
        vars(self).update(state)
        self._stepper = self._replay_actions()

    @property
    def observation(self) -> EgoObservation:
        """The present observations of the egos, by name."""
        return self._observation_at(0.0)

    @property
    def stage(self) -> F32:
        """`Stage` of each ego."""
        return self.observations[:, _STAGE]

    @property
    def has_crashed(self) -> Mask:
        """Whether each ego has hit another vehicle or left the road."""
        return self.stage == Stage.CRASHED

    def step(self, action: F64) -> None:
        """Carry out actions, shape (env, part), for as long as they hold."""
        control, action_repeat = CONTROLS[self._settings.action], self._settings.action_repeat
        self.num_step_decisions = np.zeros(self._settings.num_envs, np.int64)
        if control.plan is None:
            self._carry_out(action, action_repeat)
            return
        # A planned path becomes pedals and wheel angle anew at every decision.
        follow_plan = control.plan(action, self.observation)
        for decision in range(action_repeat):
            observation = self._observation_at(decision / float(DECISIONS_PER_SECOND))
            self._carry_out(follow_plan(observation), 1)

    def restart(self, rows: NDArray[np.int64], scenario_index: NDArray[np.uint64] | None) -> None:
        """Begin an episode in some rows.

        Args:
            rows: The rows, shape (row,), each once.
            scenario_index: Index of the scenario of each, shape (row,); None for the next ones of
                the sequence.
        """
        indices = scenario_index
        refs = self._supply.take(rows) if indices is None else self._supply.draw(indices)
        for row, ref in zip(rows, refs, strict=True):
            self._refs[row] = ref
        params = join_parameters(sort_refs(refs))
        observed = self._stepper.renew(rows, params)
        self.observations[rows], self.is_running[rows] = observed.table, observed.runs
        self._vehicle[:, rows] = [values[EGO_SLOT] for values in params.vehicles]
        self.scenario_index[rows] = params.scenario_index
        # `num_step_decisions` stays: it describes the last step, also where that step ended an
        # episode and the next one begins at once.
        self.num_decisions[rows] = self.num_clipped[rows] = 0

    def judge(self, rows: NDArray[np.int64]) -> EpisodeVerdicts:
        """Labels of the whole simulation of some episodes that have ended."""
        refs = sort_refs([self._refs[row] for row in rows])
        # Rules judge a whole simulation, and a stepper records nothing, so the actions are replayed
        # with recording. It costs more than the episode; with_labels=False leaves it out.
        trajectories = self._simulate(refs, join_parameters(refs), rows)
        labels = label(trajectories).labels
        policy = labels.policies.index("default")
        return EpisodeVerdicts(
            outcome=labels.outcome,
            is_legal=labels.is_legal[:, policy],
            num_broken=labels.num_broken[:, policy],
        )

    def record(self, row: int) -> Trajectories:
        """The episode of a row from its start until now."""
        refs = sort_refs([self._refs[row]])
        params = join_parameters(refs)
        simulation = params.simulation_table.copy()
        simulation[_LAST_STEP] = np.minimum(
            simulation[_LAST_STEP], np.float32(self.num_decisions[row] * SUBSTEPS)
        )
        params = dataclasses.replace(params, simulation_table=simulation)
        return self._simulate(refs, params, np.array([row]))

    @property
    def _kind(self) -> str:
        return CONTROLS[self._settings.action].kind

    @property
    def _parts(self) -> tuple[Any, ...]:
        return ACTION_KINDS[self._kind]

    def _observation_at(self, time: float) -> EgoObservation:
        """The present observations of the egos, by name.

        Args:
            time: Time since the start of the step [s].
        """
        return EgoObservation(
            time=time,
            is_running=self.is_running,
            table=self.observations,
            vehicle=VehicleParameters._make(self._vehicle),
        )

    def _carry_out(self, action: F64, num_decisions: int) -> None:
        """Carry out actions for some decisions, and keep them, once for each decision.

        The engine gives the same states whether an action holds for several decisions or is
        repeated at each, so `_replay_actions` repeats it.
        """
        # Steps of each part's resolution, shape (env, MAX_ACTION_PARTS); parts that this kind of
        # action lacks are 0.
        values = rounded(action, self.is_running, self._parts)
        observed = self._stepper.step(values, num_decisions)
        rows = np.flatnonzero(observed.num_decisions)
        for decision in range(num_decisions):
            acting = rows[observed.num_decisions[rows] > decision]
            episode_decision = self.num_decisions[acting] + decision
            self._actions[acting, episode_decision] = values[acting, : len(self._parts)]
        self.num_decisions += observed.num_decisions
        self.num_step_decisions += observed.num_decisions
        # Rows whose episode ended before this step keep their last observation. The array is a new
        # one, because callers compare the observations before and after a step.
        has_acted = observed.num_decisions[:, None] > 0
        self.observations = np.where(has_acted, observed.table, self.observations)
        self.is_running = observed.runs

    def _simulate(
        self, refs: SortedRefs, params: StepParameters, rows: NDArray[np.int64]
    ) -> Trajectories:
        """Simulate episodes again from the actions that were carried out."""
        num_decisions = self.num_decisions[rows]
        values = np.zeros((len(rows), max(int(num_decisions.max()), 1), MAX_ACTION_PARTS), np.int32)
        for index, (row, length) in enumerate(zip(rows, num_decisions, strict=True)):
            values[index, :length, : len(self._parts)] = self._actions[row, :length]
            # After an accident the simulation goes on for a moment, with the last action.
            values[index, length:] = values[index, max(length - 1, 0)]
        actions = Actions(values=values, kind=self._kind)
        return engine.run(join_scenarios(refs), params, actions=actions)

    def _replay_actions(self) -> Renewable:
        """A new stepper in which every episode has its present state."""
        params = join_parameters(sort_refs(self._refs))
        stepper = Renewable(params, self._kind, is_true=self._settings.observes_truth)
        stepper.begin()
        # Rows have different ages. Each begins when as many decisions are left as it has carried
        # out, so that all arrive together; until then it runs with actions of zero.
        duration = int(self.num_decisions.max())
        start = duration - self.num_decisions
        for decision in range(duration + 1):
            if len(rows := np.flatnonzero((start == decision) & (start > 0))):
                refs = sort_refs([self._refs[row] for row in rows])
                stepper.renew(rows, join_parameters(refs))
            if decision < duration:
                values = np.zeros((self._settings.num_envs, MAX_ACTION_PARTS), np.int32)
                rows = np.flatnonzero(start <= decision)
                values[rows, : len(self._parts)] = self._actions[rows, decision - start[rows]]
                stepper.step(values, 1)
        return stepper


def join_parameters(refs: SortedRefs) -> StepParameters:
    """Parameters of scenarios of one or several batches, as one batch in their original order."""
    batches, rows, restore = refs

    def join(name: str) -> NDArray[Any]:
        """One array of the parameters; its last axis is the simulation."""
        arrays = [
            getattr(batch.parameters, name)[..., of_batch]
            for batch, of_batch in zip(batches, rows, strict=True)
        ]
        return np.ascontiguousarray(np.concatenate(arrays, axis=-1)[..., restore])

    # These arrays differ between scenarios; `vehicles` and `simulations` are views of them.
    # The road, the constants and the seed are the same for all scenarios of a supply.
    names = ("vehicle_table", "simulation_table", "scenario_index")
    return dataclasses.replace(batches[0].parameters, **{name: join(name) for name in names})


def join_scenarios(refs: SortedRefs) -> Scenario:
    """Scenarios of one or several batches, as one batch in their original order."""
    batches, rows, restore = refs
    parts = [batch.scenario.select(of_batch) for batch, of_batch in zip(batches, rows, strict=True)]
    return concatenate(parts).select(restore)
