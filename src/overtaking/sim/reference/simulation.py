"""The loop over time: decisions 20 times a second, and motion between them.

A *step* is 10 ms; every fifth step (`SUBSTEPS`) is a *decision*, a *frame* is a recorded state. The
*ego*, the vehicle under study, is in slot 0. An external driver, such as a trained network, may
drive it by its actions. A step belongs to a simulation up to and including its `end_step`.
"""

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
from overtaking.sim.reference.collisions import RoadVector, SweptStep, VehiclePair
from overtaking.sim.reference.decision_context import DecisionContext
from overtaking.sim.reference.ego_action import (
    EgoAction,
    action_at,
    action_from_integers,
    requested_wheel_angle,
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
    step_parameters,
)


class ReferenceStepper:
    """A batch of simulations that waits at each decision for the actions of an external driver.

    Nothing is recorded.

    Args:
        params: Parameters of the batch.
        action_kind: A name in `model.driver_interface.ACTION_KINDS`; None if the model's own driver
            decides, and `step` ignores its actions.
        observes_truth: Whether to observe the true state instead of the ego's beliefs.
    """

    def __init__(
        self, params: StepParameters, action_kind: str | None, *, observes_truth: bool
    ) -> None:
        """Start all simulations; `observe_start` computes the first observation."""
        self._params, self._action_kind = params, action_kind
        self._observes_truth = observes_truth
        self._local_params = params
        self._steps_at_once = _steps_at_once(params)
        self._state, self._step = State.at_start(params), 0
        self._is_running = np.ones(params.scenario_index.shape, np.bool_)

    def observe_start(self) -> SteppedObservation:
        """Observe the egos at the first decision, which the first call of `step` carries out."""
        table, is_running = self._observe()
        return SteppedObservation(table, is_running, np.zeros(is_running.shape, np.uint32))

    def step(self, actions: NDArray[np.int32], num_decisions: int) -> SteppedObservation:
        """Carry out the same action for some decisions, and observe the egos after the last.

        Args:
            actions: Parts of each action, such as an acceleration, as integers: the values divided
                by `ActionPart.resolution`, shape (simulation, `MAX_ACTION_PARTS`).
            num_decisions: Number of decisions, at least 1.
        """
        kind = self._action_kind
        action = None if kind is None else action_from_integers(kind, actions)
        num_carried_out = np.zeros(self._is_running.shape, np.uint32)
        table = np.zeros((len(self._is_running), OBSERVATION_SIZE), np.float32)
        for _ in range(num_decisions):
            self._act(action)
            num_carried_out += self._is_running
            observed, is_running = self._observe()
            # A simulation that ends during the call keeps the observation at its end.
            table = np.where(self._is_running[:, None], observed, table)
            self._is_running = is_running
        return SteppedObservation(table, self._is_running, num_carried_out)

    def _observe(self) -> tuple[F32, Mask]:
        """Observations of all egos, also in ended simulations, and whether each simulation runs."""
        is_running = np.float32(self._step) <= self._state.end_step
        # Parameters in which desired speeds follow the speed limits at each driver and ahead of it.
        self._local_params = with_local_speeds(self._state, self._params)
        self._context = perceive(self._state, self._local_params, self._step)
        table = observation_table(
            self._state, self._local_params, self._context, observes_truth=self._observes_truth
        )
        return table, is_running

    def _act(self, action: EgoAction | None) -> None:
        """Carry out the decisions of all drivers, and move all vehicles until the next decision."""
        state, params, first_step = self._state, self._local_params, self._step
        pairs = act(state, params, self._context, step=first_step, action=action)
        for k in range(0, SUBSTEPS, self._steps_at_once):
            advance(
                state,
                params,
                pairs,
                step=first_step + k,
                steps_at_once=self._steps_at_once,
                action=action,
            )
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
        switches: Parameters that replace the present ones at later steps, ordered by step.
        actions: Actions of an external driver of the ego; None if the model's driver decides.
    """
    state = State.at_start(params)
    recorder = Recorder(scenario, params)
    pairs: list[VehiclePair] = []
    action: EgoAction | None = None
    steps_at_once = _steps_at_once(params)
    step = 0
    while (np.float32(step) <= state.end_step).any():
        # A switch lies at a frame, so the loop reaches its step even if it advances by five steps.
        for switch in switches:
            if switch.step == step:
                switch_parameters(state, params, switch.params)
                params = switch.params
        if step % SUBSTEPS == 0:
            action = action_at(actions, step // SUBSTEPS)
            pairs = decide(state, params, step=step, action=action, recorder=recorder)
        if step % params.steps_per_frame == 0:
            is_running = np.float32(step) <= state.end_step
            # A frame at a decision has lamps and stage after this decision.
            recorder.record_frame(state, params, is_running, step // params.steps_per_frame)
        # The motion reads no desired speeds, so it needs no `with_local_speeds`.
        advance(state, params, pairs, step=step, steps_at_once=steps_at_once, action=action)
        step += steps_at_once
    return dataclasses.replace(recorder.finish(state), actions=actions)


def _steps_at_once(params: StepParameters) -> int:
    """Number of steps of 10 ms that the motion advances at once.

    If every frame coincides with a decision, the motion advances by 50 ms at once: the integration
    is linearly implicit, and so stable at low speed, where an explicit one is not at this length.
    Frames at other times need a state at every step of 10 ms.
    """
    return SUBSTEPS if params.steps_per_frame % SUBSTEPS == 0 else 1


def switch_parameters(state: State, params: StepParameters, new_params: StepParameters) -> None:
    """Adapt the state to parameters that replace others in the middle of a simulation.

    Station and speed of each vehicle change by the new `start_s` and `start_speed` minus the
    earlier ones.
    The history, which drivers recall, changes by the same, as if the vehicle had always been there.
    """
    vehicles, new_vehicles = params.vehicles, new_params.vehicles
    s_change = new_vehicles.start_s - vehicles.start_s
    speed_change = new_vehicles.start_speed - vehicles.start_speed
    # The other vehicles keep their numbers: adding 0 could change the sign of a zero.
    is_moved = (s_change != 0) | (speed_change != 0)
    motion, past = state.motion, state.attention
    motion.s = np.where(is_moved, motion.s + s_change, motion.s)
    motion.vx = np.where(is_moved, motion.vx + speed_change, motion.vx)
    past.past_s = np.where(is_moved, past.past_s + s_change, past.past_s)
    past.past_speed = np.where(is_moved, past.past_speed + speed_change, past.past_speed)
    if new_params.judgement_errors is not None:
        distance_error, speed_error = new_params.judgement_errors
        state.noise.distance_error[EGO_SLOT] = distance_error
        state.noise.speed_error[EGO_SLOT] = speed_error


def decide(
    state: State,
    params: StepParameters,
    *,
    step: int,
    action: EgoAction | None = None,
    recorder: Recorder | None = None,
) -> list[VehiclePair]:
    """Compute a decision: weather, perception, then the choices of all drivers.

    Args:
        state: The function updates it.
        params: Parameters of the batch.
        step: Index of this step of 10 ms.
        action: Action of an external driver of the ego; None if the model's driver decides.
        recorder: Records the ego's percepts; None without a recording.

    Returns:
        The pairs of vehicles that may touch before the next decision.
    """
    params = with_local_speeds(state, params)
    context = perceive(state, params, step)
    return act(state, params, context, step=step, action=action, recorder=recorder)


def perceive(state: State, params: StepParameters, step: int) -> DecisionContext:
    """Update the weather at each vehicle, then compute the perception of all drivers.

    Args:
        state: The function updates timers, history, noise, friction, wind and attention.
        params: Parameters of the batch, with speeds by `with_local_speeds`.
        step: Index of this step of 10 ms, a decision.
    """
    constants, road, choice = params.constants, params.road, state.lane_choice
    decision_index = step // SUBSTEPS
    choice.time_since_lane_change = choice.time_since_lane_change + constants.decision
    choice.time_wanted = choice.time_wanted + constants.decision
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
    # The pushes of the study by Pinto et al. (2023), a sideways force. They come after
    # `update_wind_trim`, because drivers do not foresee them.
    road_conditions.apply_study_push(state, params, decision_index)
    neighbours = find_neighbours(state, params)
    # Whether drivers look over the shoulder before their first lane change.
    if step == 0:
        perception.draw_shoulder_check(state, params, params.vehicles.valid > 0, decision_index)
    checks_mirrors = perception.checks_mirrors_now(state, params, decision_index)
    oncoming = None
    if road.has_oncoming_traffic:
        oncoming = observe_oncoming(state, params, neighbours, decision_index)
    beliefs = perception.form_beliefs(state, params, neighbours, decision_index, checks_mirrors)
    claims = lane_change.lane_claims(state)  # Lane and indicated side of each vehicle.
    return DecisionContext(
        neighbours=neighbours,
        beliefs=beliefs,
        checks_mirrors=checks_mirrors,
        gives_way=lane_change.gives_way(state, params, choice.wanted_side, claims),
        oncoming=oncoming,
        decision_index=decision_index,
    )


def act(
    state: State,
    params: StepParameters,
    context: DecisionContext,
    *,
    step: int,
    action: EgoAction | None = None,
    recorder: Recorder | None = None,
) -> list[VehiclePair]:
    """Let all drivers decide; with an external driver, the ego carries out its action.

    Args:
        state: The function updates it.
        params: Parameters of the batch.
        context: Perception of the drivers at this decision.
        step: Index of this step of 10 ms, a decision.
        action: Action of an external driver of the ego; None if the model's driver decides.
        recorder: Records the ego's percepts; None without a recording.

    Returns:
        The pairs of vehicles that may touch before the next decision.
    """
    # Accelerations come first: `context` has the neighbours in the lanes before any lane change.
    accel_limit = acceleration.accel_behind_leader(state, params, context)
    if context.oncoming is not None:
        accel_limit = minimum(accel_limit, accel_for_oncoming(state, params, context.oncoming))
        accel_limit = minimum(accel_limit, accel_limit_while_passing(state, params, context))
    # During a lane change the leader in the lane that the driver leaves limits it as well.
    old_leader_accel = acceleration.accel_behind_old_leader(state, params, context)
    requested_accels = with_requested_accel(action, accel_limit, old_leader_accel)
    acceleration.apply_pedals(state, params, *requested_accels)
    # The others change lanes by MOBIL on one-way roads, and by gap acceptance on two-way roads.
    if context.oncoming is None:
        lane_change.change_lanes_by_mobil(state, params, context, accel_limit)
    else:
        overtake.decide_others(state, params, context)
    overtake.decide_ego(state, params, context, step=step, action=action, recorder=recorder)
    return collisions.pairs_that_may_touch(state, params)


def advance(
    state: State,
    params: StepParameters,
    pairs: list[VehiclePair],
    *,
    step: int,
    steps_at_once: int,
    action: EgoAction | None = None,
) -> None:
    """Steer and move all vehicles for 10 or 50 ms, then resolve their collisions.

    Args:
        state: The function updates it.
        params: Parameters of the batch.
        pairs: Pairs of vehicles that may touch, from the last decision.
        step: Index of the first step of 10 ms.
        steps_at_once: Number of steps, 1 or `SUBSTEPS`.
        action: Action of an external driver of the ego; None if the model's driver decides.
    """
    constants, simulations = params.constants, params.simulations
    step_length = constants.step if steps_at_once == 1 else constants.decision
    start = RoadVector(state.motion.s, state.motion.d)
    wheel_angle = steering.steer(
        state, params, simulations.max_lateral_accel, step_length, requested_wheel_angle(action)
    )
    vehicle_dynamics.advance_motion(state, params, wheel_angle, step_length)
    swept = SweptStep(index=step, length=step_length, start=start)
    collisions.resolve_contacts(state, params, pairs, swept)
