"""The loop over time."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import minimum
from overtaking.model.driver_interface import OBSERVATION_SIZE, Actions
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference import (
    acceleration,
    collisions,
    lane_change,
    overtake,
    perception,
    road_conditions,
    steering,
    vehicle_dynamics,
)
from overtaking.sim.reference.acceleration import accel_for_oncoming
from overtaking.sim.reference.decision_context import DecisionContext
from overtaking.sim.reference.ego_action import (
    EgoAction,
    action_at,
    action_from_integers,
    ordered_wheel_angle,
    with_requested_accel,
)
from overtaking.sim.reference.neighbour_search import find_neighbours
from overtaking.sim.reference.observation_table import observation_table
from overtaking.sim.reference.oncoming import observe_oncoming
from overtaking.sim.reference.pass_continuation import accel_limit_while_passing
from overtaking.sim.reference.recorder import Recorder
from overtaking.sim.reference.road_conditions import with_local_speeds
from overtaking.sim.reference.state import State, initial_state
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import (
    ParameterSwitch,
    StepParameters,
    VehicleParameters,
    step_parameters,
)
from overtaking.world.weather_parameters import SimulationParameters


class SteppedObservation(NamedTuple):
    """The observations of the egos of a batch after a step.

    Attributes:
        table: Observations of the egos, shape (simulation, `OBSERVATION_SIZE`). A simulation that
            ended within the step is observed at its end; one that ended earlier has zeros.
        runs: Whether each simulation continues, shape (simulation,).
        num_decisions: Number of decisions that each simulation carried out in this step, shape
            (simulation,).
    """

    table: F32
    runs: Mask
    num_decisions: NDArray[np.uint32]


class ReferenceStepper:
    """The reference, decision by decision.

    Args:
        given: Parameters of a batch.
        kind: A name in `model.driver_interface.ACTION_KINDS`; None where the model's own driver
            decides.
        is_true: Whether the truth is observed, not what the ego believes.
    """

    def __init__(self, given: StepParameters, kind: str | None, *, is_true: bool) -> None:
        """Stand before the first decision."""
        self._given, self._kind, self._is_true = given, kind, is_true
        self._p, self._q = given.vehicles, given.simulations
        self._here = self._p
        self._stride = SUBSTEPS if given.steps_per_frame % SUBSTEPS == 0 else 1
        self._state, self._step = initial_state(given), 0
        self._ran = np.ones(given.scenario_index.shape, np.bool_)

    def observe_start(self) -> SteppedObservation:
        """The observations at the start."""
        table, runs = self._observe()
        return SteppedObservation(table, runs, np.zeros(runs.shape, np.uint32))

    def step(self, values: NDArray[np.int32], decisions: int) -> SteppedObservation:
        """Carry out the same orders for some decisions.

        Args:
            values: Steps of each number of the action, shape (simulation, `MAX_ACTION_PARTS`).
            decisions: Number of decisions, at least 1.
        """
        orders = None if self._kind is None else action_from_integers(self._kind, values)
        num_decisions = np.zeros(self._ran.shape, np.uint32)
        table = np.zeros((len(self._ran), OBSERVATION_SIZE), np.float32)
        for _ in range(decisions):
            self._act(orders)
            num_decisions += self._ran
            observed, is_running = self._observe()
            # A simulation that has ended keeps the observation of its last decision.
            table = np.where(self._ran[:, None], observed, table)
            self._ran = is_running
        return SteppedObservation(table, self._ran, num_decisions)

    def _observe(self) -> tuple[F32, Mask]:
        """Observed numbers of all egos, ended simulations included, and which simulations run."""
        is_running = np.float32(self._step) <= self._state.end_step
        self._perceive()
        state, given, p = self._state, self._given, self._here
        decision = self._step // SUBSTEPS
        table = observation_table(
            state, given, p, self._q, self._moment, decision=decision, is_true=self._is_true
        )
        return table, is_running

    def _perceive(self) -> None:
        state, given, q = self._state, self._given, self._q
        self._here = with_local_speeds(state, given, self._p, q)
        self._moment = perceive(state, given, self._here, q, self._step)

    def _act(self, orders: EgoAction | None) -> None:
        state, given, p, q = self._state, self._given, self._here, self._q
        pairs = act(state, given, p, q, self._moment, None, self._step, orders)
        for k in range(0, SUBSTEPS, self._stride):
            advance(state, given, p, q, pairs, self._step + k, self._stride, orders)
        self._step += SUBSTEPS


def simulate(scenario: Scenario) -> Trajectories:
    """Simulate a batch with the readable twin of the engine.

    Args:
        scenario: A batch of scenarios.

    Returns:
        The recorded batch; equal to the engine's, bit for bit.
    """
    return run(scenario, step_parameters(scenario))


def run(
    scenario: Scenario,
    given: StepParameters,
    later: Sequence[ParameterSwitch] = (),
    *,
    actions: Actions | None = None,
) -> Trajectories:
    """Simulate a batch from its parameters.

    Args:
        scenario: A batch of scenarios.
        given: Its parameters.
        later: Parameters that take over at later steps, in their order.
        actions: What another driver did with the ego; None for the model's own.
    """
    state = initial_state(given)
    recorder = Recorder(scenario, given)
    p, q = given.vehicles, given.simulations
    pairs: collisions.Pairs = {}
    orders: EgoAction | None = None
    # Frames at other times than decisions want a state at every step.
    stride = SUBSTEPS if given.steps_per_frame % SUBSTEPS == 0 else 1
    step = 0
    while (np.float32(step) <= state.end_step).any():
        for then in (one for at, one in later if at == step):
            displace_vehicles(state, p, then.vehicles)
            if then.judgement_errors is not None:
                state.distance_error[EGO_SLOT], state.speed_error[EGO_SLOT] = then.judgement_errors
            given, p, q = then, then.vehicles, then.simulations
        if step % SUBSTEPS == 0:
            orders = action_at(actions, step // SUBSTEPS)
            pairs = decide(state, given, p, q, recorder, step, orders)
        if step % given.steps_per_frame == 0:
            recorder.record_frame(
                state, p, np.float32(step) <= state.end_step, step // given.steps_per_frame
            )
        advance(state, given, p, q, pairs, step, stride, orders)
        step += stride
    return dataclasses.replace(recorder.finish(state), actions=actions)


def displace_vehicles(state: State, before: VehicleParameters, after: VehicleParameters) -> None:
    """Move vehicles by as much as their starts differ, as if they had always been there."""
    ahead, faster = after.start_s - before.start_s, after.start_speed - before.start_speed
    moved = (ahead != 0) | (faster != 0)
    state.s = np.where(moved, state.s + ahead, state.s)
    state.vx = np.where(moved, state.vx + faster, state.vx)
    state.history_s = np.where(moved, state.history_s + ahead, state.history_s)
    state.history_v = np.where(moved, state.history_v + faster, state.history_v)


def decide(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    recorder: Recorder | None,
    step: int,
    orders: EgoAction | None = None,
) -> collisions.Pairs:
    """Everything that happens 20 times a second: weather, perception, decisions."""
    p = road_conditions.with_local_speeds(state, given, p, q)
    moment = perceive(state, given, p, q, step)
    return act(state, given, p, q, moment, recorder, step, orders)


def perceive(
    state: State, given: StepParameters, p: VehicleParameters, q: SimulationParameters, step: int
) -> DecisionContext:
    """What happens 20 times a second before anyone decides: weather, perception."""
    c = given.constants
    decision = step // SUBSTEPS
    road = given.road
    state.since_change = state.since_change + c.decision
    state.wanted_time = state.wanted_time + c.decision
    state.stage_time = state.stage_time + c.decision
    collisions.wreck_off_road_vehicles(state, c, p, road.boundaries[[0, road.num_lanes]], step)
    perception.record_history(state, decision)
    road_conditions.update_random_processes(state, given, p, q, decision)
    road_conditions.update_road_course(state, given, p, q)
    if step == 0 and road.varies_along_road:
        steering.settle_into_bend(state, c, p)
    road_conditions.update_friction(state, given, p, q)
    road_conditions.update_wind(state, given, p, q)
    steering.update_wind_trim(state, c, p, step)
    road_conditions.apply_study_push(state, p, q, decision)
    near = find_neighbours(state, given, p)
    if step == 0:
        perception.draw_shoulder_check(state, given, p, p.valid > 0, decision)
    looks = perception.checks_mirrors_now(state, given, p, decision)
    met = (
        observe_oncoming(state, given, p, q, near, decision) if road.has_oncoming_traffic else None
    )
    believed = perception.form_beliefs(state, given, p, q, near, decision, looks)
    waits = lane_change.gives_way(state, given, state.wanted, lane_change.lane_claims(state))
    return DecisionContext(
        neighbours=near, beliefs=believed, checks_mirrors=looks, gives_way=waits, oncoming=met
    )


def act(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    moment: DecisionContext,
    recorder: Recorder | None,
    step: int,
    orders: EgoAction | None,
) -> collisions.Pairs:
    """What everybody decides; what the ego does, where another driver has it, `orders` say."""
    near, believed, met = moment.neighbours, moment.beliefs, moment.oncoming
    leader = acceleration.accel_behind_leader(state, given, p, near, believed, met)
    if met is not None:
        leader = minimum(leader, accel_for_oncoming(state, given, p, met))
        leader = minimum(leader, accel_limit_while_passing(state, given, p, q, moment))
    old_leader = acceleration.accel_behind_old_leader(state, given, p, near, believed, met)
    acceleration.apply_pedals(state, given, p, *with_requested_accel(orders, leader, old_leader))
    if met is None:
        lane_change.change_lanes_by_mobil(
            state, given, p, believed, leader, moment.checks_mirrors, step // SUBSTEPS
        )
    else:
        overtake.decide_others(state, given, p, q, moment, step)
    overtake.decide_ego(state, given, p, q, moment, recorder, step, orders)
    return collisions.pairs_that_may_touch(state, given.constants, given.road, p)


def advance(
    state: State,
    given: StepParameters,
    p: VehicleParameters,
    q: SimulationParameters,
    pairs: collisions.Pairs,
    step: int,
    stride: int,
    orders: EgoAction | None = None,
) -> None:
    """Steer, move, collide: one step of 10 ms, or `stride` of them at once."""
    c = given.constants
    length = c.step if stride == 1 else c.decision
    before = (state.s, state.d)
    angle = steering.steer(state, c, p, q.max_lateral_accel, length, ordered_wheel_angle(orders))
    vehicle_dynamics.advance_motion(state, c, p, angle, length)
    collisions.resolve_contacts(state, c, given.road, p, pairs, before, step, length)
