"""Where the ego believes others to be at every decision, and which vehicle each belief is about."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.show.view.ghosts import beliefs_at_every_decision
from overtaking.sim import engine
from overtaking.sim.stepping import trace_beliefs

_ONCOMING = 1
"""Place of who comes among the percepts of a decision to pull out."""


def test_who_comes_is_where_the_decision_to_pull_out_recorded_it():
    held_up = load_specification(
        "rural",
        {"traffic.held_up": 1.0, "time.horizon_s": 20.0} | {"time.attempt_deadline_s": 15.0},
    )
    compared = 0
    # Of the first 1,700, those that pull out and see who comes.
    for number in (1176, 1393, 1407, 1505, 1680):
        scenario = ScenarioSource(held_up, load_road("rural"), 3).sample([number])
        runs = engine.simulate(scenario)
        percepts = runs.percepts
        out = percepts.valid[0] & (percepts.kind[0] == ManoeuvreKind.PULL_OUT)
        out &= percepts.is_detected[0, :, _ONCOMING]
        out &= percepts.slot[0, :, _ONCOMING] != NO_VEHICLE
        if not out.any():
            continue
        columns = beliefs_at_every_decision(runs, trace_beliefs(scenario))
        oncoming = next(role for role in columns["roles"] if role["role"] == "oncoming")
        for row in np.flatnonzero(out):
            decision = round(percepts.time[0, row] / columns["interval_ms"])
            slot = percepts.slot[0, row, _ONCOMING]
            assert oncoming["slot"][decision] == slot
            assert oncoming["seen"][decision] == 1
            assert abs(oncoming["gap_mm"][decision] - percepts.gap[0, row, _ONCOMING]) <= 1
            true = percepts.true_gap[0, row, _ONCOMING]
            assert abs(oncoming["true_gap_mm"][decision] - true) <= 1
            # It stands ahead, as far as it is believed to be from where it is.
            frame = round(percepts.time[0, row] / scenario.frame_interval_ms)
            place = oncoming["s_mm"][decision] - (oncoming["gap_mm"][decision] - true)
            assert abs(place - runs.states.s[0, slot, frame]) <= 20
            compared += 1
    assert compared >= 4


@pytest.mark.parametrize(
    ("profile", "road"), [("pinto2023-physical", "town06"), ("rural", "rural")]
)
def test_each_belief_names_the_vehicle_at_its_true_gap(profile: str, road: str):
    scenario = ScenarioSource(load_specification(profile), load_road(road), 1).sample(range(8))
    batch = engine.simulate(scenario)
    num_compared = 0
    for simulation in range(8):
        trajectories = batch.select(np.array([simulation]))
        columns = beliefs_at_every_decision(trajectories, trace_beliefs(trajectories.scenario))
        s, length = trajectories.states.s[0], trajectories.scenario.vehicles.length[0]
        for role in columns["roles"]:
            direction = -1 if role["role"].endswith("follower") else 1
            for decision, slot in enumerate(role["slot"]):
                frame = round(
                    decision * columns["interval_ms"] / trajectories.scenario.frame_interval_ms
                )
                if slot is None or frame >= trajectories.num_frames[0]:
                    continue
                distance = direction * (float(s[slot, frame]) - float(s[0, frame])) / 1000
                gap = distance - (length[slot] + length[0]) / 2
                assert abs(role["true_gap_mm"][decision] / 1000 - gap) < 0.01
                num_compared += 1
    assert num_compared > 1000
