"""Times of contacts in steps of 50 ms against steps of a millisecond."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest

from overtaking.model.trajectories import NO_VEHICLE
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.sim.reference import collisions, steering, vehicle_dynamics
from overtaking.sim.reference.recorder import Recorder
from overtaking.sim.reference.simulation import advance, decide
from overtaking.sim.reference.state import State
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import step_parameters

from .situations import ROUGH

pytestmark = pytest.mark.ci

FINE = 0.001
EARLIER = 8
"""Decisions before the contact at which the fine steps begin."""

CENTISECOND = 0.0105
"""Tolerance of a contact time, with the rounding of instants [s]."""


def scenarios(index: np.ndarray):
    return ScenarioSource(
        load_specification("pinto2023-physical", ROUGH), load_road("town06"), 5
    ).sample(index.astype(np.uint64))


def crashes(count: int) -> list[int]:
    """The first simulations with a contact, later than one second."""
    runs = engine.simulate(scenarios(np.arange(256)))
    hit = runs.contacts.partner != NO_VEHICLE
    first = np.where(hit, runs.contacts.time, 10**6).min(axis=1)
    return np.flatnonzero((first > 1000) & (first < 10**6))[:count].tolist()


class World:
    """One simulation, step by step."""

    def __init__(self, number: int) -> None:
        scenario = scenarios(np.array([number]))
        self.params = step_parameters(scenario)
        self.p = self.params.vehicles
        self.q = self.params.simulations
        self.recorder = Recorder(scenario, self.params)
        self.state = State.at_start(self.params)
        self.step = 0

    def decide(self) -> list[collisions.VehiclePair]:
        return decide(self.state, self.params, step=self.step, recorder=self.recorder)

    def stride(self) -> None:
        """Advance from one decision to the next in one step."""
        pairs = self.decide()
        advance(self.state, self.params, pairs, step=self.step, steps_at_once=SUBSTEPS)
        self.step += SUBSTEPS

    def creep(self) -> None:
        """Advance from one decision to the next in steps of a millisecond."""
        pairs, state = self.decide(), self.state
        fine_params = replace(self.params, constants=self.params.constants.replace(step=FINE))
        state.end_step[:] = 1e9
        for k in range(50):
            start = collisions.RoadVector(state.motion.s, state.motion.d)
            angle = steering.steer(state, fine_params, self.q.max_lateral_accel, FINE)
            vehicle_dynamics.advance_motion(state, fine_params, angle, FINE)
            swept = collisions.SweptStep(index=10 * self.step + k, length=FINE, start=start)
            collisions.resolve_contacts(state, fine_params, pairs, swept)
        self.step += SUBSTEPS


def first_contact(state: State) -> float:
    """Time of the first contact of any two vehicles [s]."""
    hit = state.first_contact.partner >= 0
    return float(state.first_contact.time[hit].min()) if hit.any() else float("inf")


@pytest.mark.parametrize("order", range(12))
def test_contact_times_are_exact_to_a_centisecond(order: int):
    world, before = World(crashes(12)[order]), []
    while not np.isfinite(first_contact(world.state)):
        before = [*before[1 - EARLIER :], (copy.deepcopy(world.state), world.step)]
        world.stride()
    coarse, last = first_contact(world.state), world.step + 2 * SUBSTEPS
    world.state, world.step = before[0]
    while not np.isfinite(first_contact(world.state)) and world.step < last:
        world.creep()
    assert coarse == pytest.approx(first_contact(world.state), abs=CENTISECOND)
