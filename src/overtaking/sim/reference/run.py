"""The loop over time."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from overtaking.core.float32_math import minimum
from overtaking.model.driver_interface import Actions
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference import (
    collisions,
    control,
    dynamics,
    ego,
    environment,
    mobil,
    perception,
    steering,
)
from overtaking.sim.reference.giving_way import give_way
from overtaking.sim.reference.moment import Moment
from overtaking.sim.reference.neighbours import find_neighbours
from overtaking.sim.reference.oncoming import look_ahead
from overtaking.sim.reference.orders import Orders, orders_at, pedals, wheel
from overtaking.sim.reference.plight import held_back
from overtaking.sim.reference.recording import Recorder
from overtaking.sim.reference.state import Fields, State, initial_state
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import ParameterSwitch, StepParameters, step_parameters
from overtaking.world.weather_parameters import SimulationParameters


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
    orders: Orders | None = None
    # Frames at other times than decisions want a state at every step.
    stride = SUBSTEPS if given.steps_per_frame % SUBSTEPS == 0 else 1
    step = 0
    while (np.float32(step) <= state.end_step).any():
        for then in (one for at, one in later if at == step):
            displace(state, p, then.vehicles)
            if then.judgement_errors is not None:
                state.distance_error[EGO_SLOT], state.speed_error[EGO_SLOT] = then.judgement_errors
            given, p, q = then, then.vehicles, then.simulations
        if step % SUBSTEPS == 0:
            orders = orders_at(actions, step // SUBSTEPS)
            pairs = decide(state, given, p, q, recorder, step, orders)
        if step % given.steps_per_frame == 0:
            recorder.frame(
                state, p, np.float32(step) <= state.end_step, step // given.steps_per_frame
            )
        advance(state, given, p, q, pairs, step, stride, orders)
        step += stride
    return dataclasses.replace(recorder.finish(state), actions=actions)


def displace(state: State, before: Fields, after: Fields) -> None:
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
    p: Fields,
    q: SimulationParameters,
    recorder: Recorder | None,
    step: int,
    orders: Orders | None = None,
) -> collisions.Pairs:
    """Everything that happens 20 times a second: weather, perception, decisions."""
    p = environment.at_limits(state, given, p, q)
    moment = perceive(state, given, p, q, step)
    return act(state, given, p, q, moment, recorder, step, orders)


def perceive(
    state: State, given: StepParameters, p: Fields, q: SimulationParameters, step: int
) -> Moment:
    """What happens 20 times a second before anyone decides: weather, perception."""
    c = given.constants
    decision = step // SUBSTEPS
    road = given.road
    state.since_change = state.since_change + c.decision
    state.wanted_time = state.wanted_time + c.decision
    state.stage_time = state.stage_time + c.decision
    collisions.leave_road(state, c, p, road.boundaries[[0, road.num_lanes]], step)
    perception.remember(state, decision)
    environment.move_random_processes(state, given, p, q, decision)
    environment.course(state, given, p, q)
    if step == 0 and road.varies_along_road:
        steering.hold_bend(state, c, p)
    environment.grip(state, given, p, q)
    environment.wind(state, given, p, q)
    steering.hold_against_wind(state, c, p, step)
    environment.push(state, p, q, decision)
    near = find_neighbours(state, given, p)
    if step == 0:
        perception.draw_check(state, given, p, p.valid > 0, decision)
    looks = perception.looks_around(state, given, p, decision)
    met = look_ahead(state, given, p, q, near, decision) if road.has_oncoming_traffic else None
    believed = perception.perceive(state, given, p, q, near, decision, looks)
    waits = mobil.must_wait(state, given, state.wanted, mobil.claimed(state))
    return Moment(near=near, believed=believed, looks=looks, waits=waits, met=met)


def act(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    recorder: Recorder | None,
    step: int,
    orders: Orders | None,
) -> collisions.Pairs:
    """What everybody decides; what the ego does, where another driver has it, `orders` say."""
    near, believed, met = moment.near, moment.believed, moment.met
    leader = control.behind_leader(state, given, p, near, believed, met)
    if met is not None:
        leader = minimum(leader, give_way(state, given, p, met))
        leader = minimum(leader, held_back(state, given, p, q, moment))
    old_leader = control.behind_old_leader(state, given, p, near, believed, met)
    control.set_acceleration(state, given, p, *pedals(orders, leader, old_leader))
    if met is None:
        mobil.change_lanes(state, given, p, believed, leader, moment.looks, step // SUBSTEPS)
    else:
        ego.decide_others(state, given, p, q, moment, step)
    ego.decide(state, given, p, q, moment, recorder, step, orders)
    return collisions.near_pairs(state, given.constants, given.road, p)


def advance(
    state: State,
    given: StepParameters,
    p: Fields,
    q: SimulationParameters,
    pairs: collisions.Pairs,
    step: int,
    stride: int,
    orders: Orders | None = None,
) -> None:
    """Steer, move, collide: one step of 10 ms, or `stride` of them at once."""
    c = given.constants
    length = c.step if stride == 1 else c.decision
    before = (state.s, state.d)
    angle = steering.steer(state, c, p, q.max_lateral_accel, length, wheel(orders))
    dynamics.move(state, c, p, angle, length)
    collisions.collide(state, c, given.road, p, pairs, before, step, length)
