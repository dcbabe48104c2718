"""The loop over time."""

import numpy as np

from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Trajectories
from overtaking.model.vehicles import Role
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
from overtaking.sim.reference.neighbours import find_neighbours
from overtaking.sim.reference.recording import Recorder
from overtaking.sim.reference.state import Fields, State, initial_state
from overtaking.world.parameters import (
    SUBSTEPS,
    Parameters,
    SimulationParameters,
    parameters,
)

Pairs = dict[tuple[int, int], np.ndarray]


def simulate(scenario: Scenario) -> Trajectories:
    """Simulate a batch with the readable twin of the engine.

    Args:
        scenario: A batch of scenarios.

    Returns:
        The recorded batch; equal to the engine's, bit for bit.
    """
    return run(scenario, parameters(scenario))


def run(
    scenario: Scenario, given: Parameters, later: Parameters | None = None, switch: int = 0
) -> Trajectories:
    """Simulate a batch from its parameters; from step `switch` on with the parameters `later`."""
    state = initial_state(given)
    recorder = Recorder(scenario, given)
    p, q = given.of_vehicles, given.of_simulations
    pairs: Pairs = {}
    # Frames at other times than decisions want a state at every step.
    stride = SUBSTEPS if given.record_every % SUBSTEPS == 0 else 1
    step = 0
    while (np.float32(step) <= state.end_step).any():
        if later is not None and step == switch:
            given, p, q = later, later.of_vehicles, later.of_simulations
        if step % SUBSTEPS == 0:
            pairs = decide(state, given, p, q, recorder, step)
        if step % given.record_every == 0:
            recorder.frame(state, p, np.float32(step) <= state.end_step, step // given.record_every)
        advance(state, given, p, q, pairs, step, stride)
        step += stride
    return recorder.finish(state)


def decide(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    recorder: Recorder,
    step: int,
) -> Pairs:
    """Everything that happens 20 times a second: weather, perception, decisions."""
    c = given.constants
    decision = step // SUBSTEPS
    road = given.road
    state.since_change = state.since_change + c.decision
    state.wanted_time = state.wanted_time + c.decision
    collisions.leave_road(state, c, p, road.boundaries[[0, road.num_lanes]], step)
    perception.remember(state, decision)
    environment.move_random_processes(state, given, q, decision)
    environment.grip(state, given, p, q)
    environment.wind(state, given, p, q)
    steering.hold_against_wind(state, c, p, step)
    environment.push(state, p, q, decision)
    near = find_neighbours(state, given, p)
    if step == 0:
        perception.draw_check(state, given, p, p.valid > 0, decision)
    looks = perception.looks_around(state, c, p, decision)
    believed = perception.perceive(state, given, p, q, near, decision, looks)
    claims = mobil.claimed(state)
    leader = control.behind_leader(state, given, p, believed)
    old_leader = control.behind_old_leader(state, given, p, near, believed)
    control.set_acceleration(state, given, p, leader, old_leader)
    mobil.change_lanes(state, given, p, believed, leader, looks, claims, decision)
    ego.decide(state, given, p, q, near, believed, looks[Role.EGO], claims, recorder, step)
    count = len(p.valid)
    every = [(i, j) for i in range(count) for j in range(i + 1, count)]
    return {(i, j): collisions.is_near(state, c, p, i, j) for i, j in every}


def advance(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    pairs: Pairs,
    step: int,
    stride: int,
) -> None:
    """Steer, move, collide: one step of 10 ms, or `stride` of them at once."""
    c = given.constants
    length = c.step if stride == 1 else c.decision
    before = (state.s, state.d)
    angle = steering.steer(state, c, p, q.side_accel, length)
    dynamics.move(state, c, p, angle, length)
    collisions.collide(state, c, p, pairs, before, step, length)
