"""Simulations behind the environments of `environments`, and the supply of their scenarios.

An agent drives the ego, the vehicle whose overtaking is studied. An *episode* is one simulation; a
*scenario* is its start: road, weather, traffic and drivers. Each environment is a row of one batch
of the compiled engine. When its episode is over, the next one begins in the same row while the
other rows go on.

The engine's *stepper* advances all rows from decision to decision, 50 ms apart; a decision interval
has `SUBSTEPS` steps of 10 ms. It records nothing but the current state. So this module keeps all
actions, and simulates an episode again where more is needed: for labels (the judgement by traffic
rules), for pictures, and for copies of a batch.
"""

import dataclasses
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, Mask
from overtaking.labels.labelling import label
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
from overtaking.sim.action_spaces import ACTION_SPACES, to_action_integers
from overtaking.sim.ego_observation import EgoObservation
from overtaking.sim.stepping import EngineStepper
from overtaking.world.constants import DECISIONS_PER_SECOND, SUBSTEPS
from overtaking.world.step_parameters import (
    SIMULATION_FIELDS,
    StepParameters,
    VehicleParameters,
    step_parameters,
)

MAX_DRAWN_AHEAD = 256
"""Largest number of scenarios that a supply draws at a time, unless it has more environments.

Chosen: to draw one scenario costs nearly as much time as to draw several hundred.
"""

_LAST_STEP = SIMULATION_FIELDS.index("last_step")
"""Row of `StepParameters.simulation_table`, shape (field, simulation), with the last step."""

_STAGE = EgoColumns._fields.index("stage")
"""Column of an observation with the stage of the ego; the ego's columns are the first ones."""


class SampledScenarios:
    """Scenarios that were drawn together, with the numbers that the engine computes from.

    Not a dataclass, whose objects have no hash: `sort_refs` uses batches as keys of a dictionary.

    Attributes:
        scenario: The batch of scenarios.
        parameters: Its parameters for the engine.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Compute the parameters."""
        self.scenario = scenario
        self.parameters = step_parameters(scenario)


class ScenarioRef(NamedTuple):
    """Reference to one scenario: the batch in which it was drawn, and its row there."""

    batch: SampledScenarios
    row: int


class SortedRefs(NamedTuple):
    """References to scenarios, grouped by batch, so that arrays are indexed once per batch.

    Attributes:
        batches: The sampled batches, each once.
        rows: Rows in each batch, in the same order.
        restore: Indices that bring the rows of all batches, joined one after the other, into the
            original order of the references, shape (reference,).
    """

    batches: list[SampledScenarios]
    rows: list[NDArray[np.int64]]
    restore: NDArray[np.int64]


def sort_refs(refs: Sequence[ScenarioRef]) -> SortedRefs:
    """Group references by batch."""
    batches = list(dict.fromkeys(ref.batch for ref in refs))
    positions_by_batch = [
        [position for position, ref in enumerate(refs) if ref.batch is batch] for batch in batches
    ]
    rows = [
        np.array([refs[position].row for position in positions]) for positions in positions_by_batch
    ]
    joined_order = [position for positions in positions_by_batch for position in positions]
    return SortedRefs(batches, rows, np.argsort(joined_order))  # The inverse of the order.


class ScenarioSupply:
    """Draws the scenarios of all environments, several ahead for each.

    Episode k of environment i has the scenario index first_scenario + i + k n, with n environments;
    the index and the seed determine a scenario. So the scenarios of an environment do not depend on
    how long the episodes of the others last.

    Args:
        spec: Description of the traffic, weather and drivers to draw from.
        road: The road of all scenarios.
        num_envs: Number of environments, n.
        first_scenario: Scenario index of the first episode.
    """

    def __init__(
        self, spec: specification.Specification, road: Road, *, num_envs: int, first_scenario: int
    ) -> None:
        """Draw nothing yet; the seed is 0 until `restart` sets another one."""
        self._spec, self._road, self._num_envs = spec, road, num_envs
        self._first_scenario = first_scenario
        self.restart(0)

    def restart(self, seed: int) -> None:
        """Start again from the first episode of each environment, with a seed."""
        self._seed = seed
        # For each environment: the episode to draw next, and drawn scenarios that wait for use.
        self._next_episode = np.zeros(self._num_envs, np.uint64)
        self._ready = [deque[ScenarioRef]() for _ in range(self._num_envs)]
        self._num_ahead = 1  # Number of scenarios to have ready after drawing.

    def take(self, rows: Iterable[int]) -> list[ScenarioRef]:
        """Hand out the next scenario of each of some environments.

        Args:
            rows: Numbers of the environments.
        """
        rows = list(rows)
        if not all(self._ready[row] for row in rows):
            self._draw_ahead()
        return [self._ready[row].popleft() for row in rows]

    def draw(self, scenario_index: NDArray[np.uint64]) -> list[ScenarioRef]:
        """Draw scenarios by their indices, without effect on the sequence of `take`.

        Args:
            scenario_index: The indices, shape (scenario,).
        """
        batch = SampledScenarios(
            sampler.ScenarioSource(self._spec, self._road, self._seed).sample(scenario_index)
        )
        return [ScenarioRef(batch, row) for row in range(len(scenario_index))]

    def _draw_ahead(self) -> None:
        """Draw scenarios for all environments, more at a time with every call."""
        # The first call draws one scenario for each environment, so that `reset` returns soon.
        # Each later call fills up to twice as many, within `MAX_DRAWN_AHEAD`, because a large batch
        # costs less per scenario.
        num_missing = [max(self._num_ahead - len(ready), 0) for ready in self._ready]
        rows = np.repeat(np.arange(self._num_envs), num_missing)
        scenario_index = np.empty(len(rows), np.uint64)
        for position, row in enumerate(rows):
            episode = self._next_episode[row]
            # All terms are uint64, because NumPy makes a float of int64 plus uint64.
            scenario_index[position] = np.uint64(self._first_scenario + row) + episode * np.uint64(
                self._num_envs
            )
            self._next_episode[row] += np.uint64(1)
        for row, ref in zip(rows, self.draw(scenario_index), strict=True):
            self._ready[row].append(ref)
        max_ahead = max(1, MAX_DRAWN_AHEAD // self._num_envs)  # For each environment.
        self._num_ahead = min(2 * self._num_ahead, max_ahead)


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeSettings:
    """Settings that all environments of a batch share.

    Attributes:
        num_envs: Number of environments.
        action: Kind of the agent's actions, a key of `ACTION_SPACES`. The engine can carry out the
            kinds in `ACTION_KINDS`; each kind of the agent, such as a path to follow, becomes one
            of these.
        action_repeat: Number of decisions, 20 a second, for which an action holds.
        observes_truth: Whether the agent observes the exact state, not the perception of a human.
    """

    num_envs: int
    action: str
    action_repeat: int
    observes_truth: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeVerdicts:
    """Labels of episodes that have ended, each of shape (episode,).

    Attributes:
        outcome: Value of `Outcome`, such as completed.
        is_legal: The simulation breaks no rule of the policy `default`, a set of traffic rules.
        num_broken: Number of rules of that policy that it breaks.
    """

    outcome: NDArray[np.uint8]
    is_legal: Mask
    num_broken: NDArray[np.uint8]

    @property
    def is_completed(self) -> Mask:
        """The overtake was completed."""
        return self.outcome == Outcome.COMPLETED


class EpisodeBatch:
    """The current episode of each environment, in the rows of a batch of the engine.

    A batch can be pickled and copied in the middle of its episodes. The copy repeats all actions
    since the start of each episode, so copying takes as long as the episodes took.

    Attributes:
        observation_table: Last observation of each episode, shape (env, `OBSERVATION_SIZE`), with
            the columns of `model.driver_interface`. It stays after the end of an episode until the
            next one begins.
        is_running: Whether the simulation of each episode goes on, shape (env,): after an accident
            for two seconds, although `environments` ends the episode.
        scenario_index: Scenario index of each episode, shape (env,).
        num_decisions: Number of decisions since the start of each episode, shape (env,).
        num_step_decisions: Number of decisions in the last step of the environment, shape (env,):
            `action_repeat`, or fewer where the simulation ended within the step. An accident ends
            the simulation two seconds later.
        num_clipped: Number of actions of each episode that were outside their limits, shape (env,);
            `environments` counts them.

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
        # Decisions are made at the engine's steps 0, SUBSTEPS, 2 SUBSTEPS ... up to the last one.
        # All scenarios of a specification end at the same time, so later episodes have no more
        # decisions.
        max_decisions = int(params.simulation_table[_LAST_STEP].max()) // SUBSTEPS + 1
        # Actions as the engine takes them: integers, in steps of the resolution of each part.
        self._actions = np.zeros((num_envs, max_decisions, len(self._parts)), np.int32)
        # The ego's parameters, shape (parameter, env). In `params.vehicles`, each parameter has
        # shape (vehicle, env).
        self._vehicle = np.array([values[EGO_SLOT] for values in params.vehicles])
        # int64, because most functions of PyTorch do not support uint64.
        self.scenario_index = params.scenario_index.astype(np.int64)
        self.num_decisions = np.zeros(num_envs, np.int64)
        self.num_step_decisions = np.zeros(num_envs, np.int64)
        self.num_clipped = np.zeros(num_envs, np.int64)
        self._stepper = EngineStepper(params, self._kind, observes_truth=settings.observes_truth)
        observed = self._stepper.observe_start()
        self.observation_table, self.is_running = observed.table, observed.is_running

    def __getstate__(self) -> dict[str, Any]:
        """All attributes but the stepper, a compiled object that cannot be pickled."""
        return {name: value for name, value in vars(self).items() if name != "_stepper"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a batch in the middle of its episodes."""
        vars(self).update(state)
        self._stepper = self._replay_actions()

    @property
    def ego_observation(self) -> EgoObservation:
        """The columns of `observation_table` by name, as rewards read them."""
        return self._observation_at(0.0)

    @property
    def stage(self) -> F32:
        """`Stage` of each ego's overtake, shape (env,)."""
        return self.observation_table[:, _STAGE]

    @property
    def has_crashed(self) -> Mask:
        """Whether each ego has hit another vehicle or left the road, shape (env,)."""
        return self.stage == Stage.CRASHED

    def step(self, action: F64) -> None:
        """Carry out actions for `action_repeat` decisions; episodes that are over do not change.

        Args:
            action: Actions of the kind `settings.action`, shape (env, part), within their limits.
        """
        track = ACTION_SPACES[self._settings.action].track
        action_repeat = self._settings.action_repeat
        self.num_step_decisions = np.zeros(self._settings.num_envs, np.int64)
        if track is None:  # The engine can carry out the action itself.
            self._carry_out(action, action_repeat)
            return
        # The action is a speed or a path. At every decision `track` computes from it what the
        # engine carries out, such as acceleration and wheel angle.
        start = self.ego_observation
        for decision in range(action_repeat):
            now = self._observation_at(decision / float(DECISIONS_PER_SECOND))
            self._carry_out(track(action, start, now), 1)

    def restart(self, rows: NDArray[np.int64], scenario_index: NDArray[np.uint64] | None) -> None:
        """Begin the next episode in some rows.

        Args:
            rows: The rows, shape (row,), each once.
            scenario_index: Scenario index of each, shape (row,); None for the next one in the
                sequence of the environment.
        """
        if scenario_index is None:
            refs = self._supply.take(rows)
        else:
            refs = self._supply.draw(scenario_index)
        for row, ref in zip(rows, refs, strict=True):
            self._refs[row] = ref
        params = join_parameters(sort_refs(refs))
        observed = self._stepper.restart(rows, params)
        # In place: the reward, which reads the old observations, is already computed.
        self.observation_table[rows], self.is_running[rows] = observed.table, observed.is_running
        self._vehicle[:, rows] = [values[EGO_SLOT] for values in params.vehicles]
        self.scenario_index[rows] = params.scenario_index
        # `num_step_decisions` is not reset: it describes the last step, in which the previous
        # episode of the row may have ended.
        self.num_decisions[rows] = self.num_clipped[rows] = 0

    def judge(self, rows: NDArray[np.int64]) -> EpisodeVerdicts:
        """Label the whole simulation of some episodes that have ended.

        Args:
            rows: Rows of the episodes, shape (episode,).
        """
        refs = sort_refs([self._refs[row] for row in rows])
        # This second simulation, with recording, takes longer than the episode. Environments with
        # `with_labels=False` do without it.
        trajectories = self._simulate(refs, join_parameters(refs), rows)
        labels = label(trajectories).labels
        policy = labels.policies.index("default")
        return EpisodeVerdicts(
            outcome=labels.outcome,
            is_legal=labels.is_legal[:, policy],
            num_broken=labels.num_broken[:, policy],
        )

    def record(self, row: int) -> Trajectories:
        """The trajectories of a row's episode from its start until now, as a batch of one."""
        refs = sort_refs([self._refs[row]])
        params = join_parameters(refs)
        # The simulation ends at the present decision.
        table = params.simulation_table.copy()
        present_step = np.float32(self.num_decisions[row] * SUBSTEPS)  # The table is float32.
        table[_LAST_STEP] = np.minimum(table[_LAST_STEP], present_step)
        params = dataclasses.replace(params, simulation_table=table)
        return self._simulate(refs, params, np.array([row]))

    @property
    def _kind(self) -> str:
        """Kind of action that the engine carries out, a key of `ACTION_KINDS`."""
        return ACTION_SPACES[self._settings.action].kind

    @property
    def _parts(self) -> tuple[Any, ...]:
        """Parts of such an action, such as acceleration and lane change."""
        return ACTION_KINDS[self._kind]

    def _observation_at(self, time: float) -> EgoObservation:
        """The present observations of the egos with named columns.

        Args:
            time: Time since the start of the step [s], by which the points of a path are reached;
                0 for rewards, which do not read it.
        """
        return EgoObservation(
            time=time,
            is_running=self.is_running,
            table=self.observation_table,
            vehicle=VehicleParameters._make(self._vehicle),
        )

    def _carry_out(self, action: F64, num_decisions: int) -> None:
        """Carry out actions of the engine, and keep them for a later repetition.

        Args:
            action: Actions of the kind `self._kind`, shape (env, part).
            num_decisions: Number of decisions for which they hold. Each decision keeps a copy: the
                engine gives the same states whether an action holds or is repeated.
        """
        # Integers, in steps of each part's resolution, shape (env, MAX_ACTION_PARTS); 0 for parts
        # that this kind of action lacks, and for episodes that are over.
        values = to_action_integers(action, self.is_running, self._parts)
        observed = self._stepper.step(values, num_decisions)
        # A row that ends within the step makes fewer decisions; a row that is over makes none.
        rows = np.flatnonzero(observed.num_decisions)
        for decision in range(num_decisions):
            acting_rows = rows[observed.num_decisions[rows] > decision]
            episode_decision = self.num_decisions[acting_rows] + decision
            self._actions[acting_rows, episode_decision] = values[acting_rows, : len(self._parts)]
        self.num_decisions += observed.num_decisions
        self.num_step_decisions += observed.num_decisions
        # Rows whose episode ended before this step have zeros in `observed.table`; they keep their
        # last observation. A new array is made, because rewards compare the observations before and
        # after a step.
        has_acted = observed.num_decisions[:, None] > 0
        self.observation_table = np.where(has_acted, observed.table, self.observation_table)
        self.is_running = observed.is_running

    def _simulate(
        self, refs: SortedRefs, params: StepParameters, rows: NDArray[np.int64]
    ) -> Trajectories:
        """Simulate episodes again with the kept actions, and record them.

        Args:
            refs: Scenarios of the episodes.
            params: Their parameters, in the order of `rows`.
            rows: Rows of the episodes, shape (episode,).
        """
        num_decisions = self.num_decisions[rows]
        values = np.zeros((len(rows), max(int(num_decisions.max()), 1), MAX_ACTION_PARTS), np.int32)
        for index, (row, length) in enumerate(zip(rows, num_decisions, strict=True)):
            values[index, :length, : len(self._parts)] = self._actions[row, :length]
            # An episode ends at an accident, but its simulation goes on for two seconds. Then the
            # last action is repeated, as the engine does at the end of the array.
            values[index, length:] = values[index, max(length - 1, 0)]
        actions = Actions(values=values, kind=self._kind)
        return engine.run(join_scenarios(refs), params, actions=actions)

    def _replay_actions(self) -> EngineStepper:
        """A new stepper in which every episode has its present state."""
        params = join_parameters(sort_refs(self._refs))
        stepper = EngineStepper(params, self._kind, observes_truth=self._settings.observes_truth)
        stepper.observe_start()
        # The stepper advances all rows together, but their episodes have different ages. So each
        # row starts its episode again when as many decisions remain as the episode has had, so that
        # all rows reach their present states at the same time. Until then, the row runs with
        # actions of zero, and its states are discarded. Rows with start 0 have begun already.
        duration = int(self.num_decisions.max())
        start = duration - self.num_decisions
        # The last turn only begins the episodes that have had no decision yet; no step follows.
        for decision in range(duration + 1):
            if len(rows := np.flatnonzero((start == decision) & (start > 0))):
                refs = sort_refs([self._refs[row] for row in rows])
                stepper.restart(rows, join_parameters(refs))
            if decision < duration:
                values = np.zeros((self._settings.num_envs, MAX_ACTION_PARTS), np.int32)
                rows = np.flatnonzero(start <= decision)
                values[rows, : len(self._parts)] = self._actions[rows, decision - start[rows]]
                stepper.step(values, 1)
        return stepper


def join_parameters(refs: SortedRefs) -> StepParameters:
    """Parameters of scenarios from several batches, as one batch in the order of the references."""
    batches, rows, restore = refs

    def join(name: str) -> NDArray[Any]:
        """One array of the parameters; its last axis is the simulation."""
        arrays = [
            getattr(batch.parameters, name)[..., batch_rows]
            for batch, batch_rows in zip(batches, rows, strict=True)
        ]
        return np.ascontiguousarray(np.concatenate(arrays, axis=-1)[..., restore])

    # Only these arrays differ between scenarios. The road, the constants and the seed are the same
    # for all scenarios of a supply.
    names = ("vehicle_table", "simulation_table", "scenario_index")
    return dataclasses.replace(batches[0].parameters, **{name: join(name) for name in names})


def join_scenarios(refs: SortedRefs) -> Scenario:
    """Scenarios from several batches, as one batch in the order of the references."""
    batches, rows, restore = refs
    parts = [
        batch.scenario.select(batch_rows) for batch, batch_rows in zip(batches, rows, strict=True)
    ]
    return concatenate(parts).select(restore)
