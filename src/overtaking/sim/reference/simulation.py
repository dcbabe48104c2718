"""The loop over time."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import minimum
from overtaking.model.driver_interface import OBSERVATION_SIZE, Actions, SteppedObservation
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
from overtaking.sim.reference.state import State
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import (
    ParameterSwitch,
    StepParameters,
    VehicleParameters,
    step_parameters,
)


class ReferenceStepper:
    """The reference, decision by decision.

    Args:
        params: Parameters of a batch.
        kind: A name in `model.driver_interface.ACTION_KINDS`; None where the model's own driver
            decides.
        observes_truth: Whether the truth is observed, not what the ego believes.
    """

    def __init__(self, params: StepParameters, kind: str | None, *, observes_truth: bool) -> None:
        """Stand before the first decision."""
        self._params, self._kind, self._is_true = params, kind, observes_truth
        self._local_params = params
        self._stride = SUBSTEPS if params.steps_per_frame % SUBSTEPS == 0 else 1
        self._state, self._step = State.at_start(params), 0
        self._ran = np.ones(params.scenario_index.shape, np.bool_)

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
        action = None if self._kind is None else action_from_integers(self._kind, values)
        num_decisions = np.zeros(self._ran.shape, np.uint32)
        table = np.zeros((len(self._ran), OBSERVATION_SIZE), np.float32)
        for _ in range(decisions):
            self._act(action)
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
        table = observation_table(
            self._state,
            self._local_params,
            self._context,
            decision_index=self._step // SUBSTEPS,
            observes_truth=self._is_true,
        )
        return table, is_running

    def _perceive(self) -> None:
        self._local_params = with_local_speeds(self._state, self._params)
        self._context = perceive(self._state, self._local_params, self._step)

    def _act(self, action: EgoAction | None) -> None:
        state, params = self._state, self._local_params
        pairs = act(state, params, self._context, None, self._step, action)
        for k in range(0, SUBSTEPS, self._stride):
            advance(state, params, pairs, self._step + k, self._stride, action)
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
    params: StepParameters,
    switches: Sequence[ParameterSwitch] = (),
    *,
    actions: Actions | None = None,
) -> Trajectories:
    """Simulate a batch from its parameters.

    Args:
        scenario: A batch of scenarios.
        params: Parameters of the batch.
        switches: Parameters that take over at later steps, in their order.
        actions: What another driver did with the ego; None for the model's own.
    """
    state = State.at_start(params)
    recorder = Recorder(scenario, params)
    pairs: collisions.Pairs = {}
    action: EgoAction | None = None
    # One linearly implicit step from decision to decision: an explicit one of 50 ms is unstable at
    # low speed. Frames at other times than decisions need a state at every step.
    steps_at_once = SUBSTEPS if params.steps_per_frame % SUBSTEPS == 0 else 1
    step = 0
    while (np.float32(step) <= state.end_step).any():
        for then in (one for at, one in switches if at == step):
            displace_vehicles(state, params.vehicles, then.vehicles)
            if then.judgement_errors is not None:
                state.noise.distance_error[EGO_SLOT], state.noise.speed_error[EGO_SLOT] = (
                    then.judgement_errors
                )
            params = then
        if step % SUBSTEPS == 0:
            action = action_at(actions, step // SUBSTEPS)
            pairs = decide(state, params, recorder, step, action)
        if step % params.steps_per_frame == 0:
            recorder.record_frame(
                state, params, np.float32(step) <= state.end_step, step // params.steps_per_frame
            )
        advance(state, params, pairs, step, steps_at_once, action)
        step += steps_at_once
    return dataclasses.replace(recorder.finish(state), actions=actions)


def displace_vehicles(state: State, before: VehicleParameters, after: VehicleParameters) -> None:
    """Move vehicles by as much as their starts differ, as if they had always been there."""
    ahead, faster = after.start_s - before.start_s, after.start_speed - before.start_speed
    moved = (ahead != 0) | (faster != 0)
    state.motion.s = np.where(moved, state.motion.s + ahead, state.motion.s)
    state.motion.vx = np.where(moved, state.motion.vx + faster, state.motion.vx)
    state.attention.past_s = np.where(moved, state.attention.past_s + ahead, state.attention.past_s)
    state.attention.past_speed = np.where(
        moved, state.attention.past_speed + faster, state.attention.past_speed
    )


def decide(
    state: State,
    params: StepParameters,
    recorder: Recorder | None,
    step: int,
    action: EgoAction | None = None,
) -> collisions.Pairs:
    """Everything that happens 20 times a second: weather, perception, decisions."""
    params = with_local_speeds(state, params)
    context = perceive(state, params, step)
    return act(state, params, context, recorder, step, action)


def perceive(state: State, params: StepParameters, step: int) -> DecisionContext:
    """What happens 20 times a second before anyone decides: weather, perception."""
    vehicles = params.vehicles
    constants = params.constants
    decision_index = step // SUBSTEPS
    road = params.road
    state.lane_choice.time_since_lane_change = (
        state.lane_choice.time_since_lane_change + constants.decision
    )
    state.lane_choice.time_wanted = state.lane_choice.time_wanted + constants.decision
    state.overtake.time_in_stage = state.overtake.time_in_stage + constants.decision
    collisions.wreck_off_road_vehicles(state, params, step)
    perception.record_history(state, decision_index)
    road_conditions.update_random_processes(state, params, decision_index)
    road_conditions.update_road_course(state, params)
    if step == 0 and road.varies_along_road:
        steering.settle_into_bend(state, params)
    road_conditions.update_friction(state, params)
    road_conditions.update_wind(state, params)
    steering.update_wind_trim(state, params, step)
    road_conditions.apply_study_push(state, params, decision_index)
    neighbours = find_neighbours(state, params)
    if step == 0:
        perception.draw_shoulder_check(state, params, vehicles.valid > 0, decision_index)
    checks_mirrors = perception.checks_mirrors_now(state, params, decision_index)
    oncoming = (
        observe_oncoming(state, params, neighbours, decision_index)
        if road.has_oncoming_traffic
        else None
    )
    beliefs = perception.form_beliefs(state, params, neighbours, decision_index, checks_mirrors)
    waits = lane_change.gives_way(
        state, params, state.lane_choice.wanted_side, lane_change.lane_claims(state)
    )
    return DecisionContext(
        neighbours=neighbours,
        beliefs=beliefs,
        checks_mirrors=checks_mirrors,
        gives_way=waits,
        oncoming=oncoming,
    )


def act(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    recorder: Recorder | None,
    step: int,
    action: EgoAction | None,
) -> collisions.Pairs:
    """The decisions of all drivers; with an external driver, the ego carries out `action`."""
    neighbours, beliefs, oncoming = context.neighbours, context.beliefs, context.oncoming
    leader = acceleration.accel_behind_leader(state, params, neighbours, beliefs, oncoming)
    if oncoming is not None:
        leader = minimum(leader, accel_for_oncoming(state, params, oncoming))
        leader = minimum(leader, accel_limit_while_passing(state, params, context))
    old_leader = acceleration.accel_behind_old_leader(state, params, neighbours, beliefs, oncoming)
    acceleration.apply_pedals(state, params, *with_requested_accel(action, leader, old_leader))
    if oncoming is None:
        lane_change.change_lanes_by_mobil(
            state, params, beliefs, leader, context.checks_mirrors, step // SUBSTEPS
        )
    else:
        overtake.decide_others(state, params, context, step)
    overtake.decide_ego(state, params, context, recorder, step, action)
    return collisions.pairs_that_may_touch(state, params)


def advance(
    state: State,
    params: StepParameters,
    pairs: collisions.Pairs,
    step: int,
    steps_at_once: int,
    action: EgoAction | None = None,
) -> None:
    """Steer, move, collide: one step of 10 ms, or `steps_at_once` of them at once."""
    simulations = params.simulations
    constants = params.constants
    step_length = constants.step if steps_at_once == 1 else constants.decision
    before = (state.motion.s, state.motion.d)
    angle = steering.steer(
        state, params, simulations.max_lateral_accel, step_length, ordered_wheel_angle(action)
    )
    vehicle_dynamics.advance_motion(state, params, angle, step_length)
    collisions.resolve_contacts(state, params, pairs, before, step, step_length)
