"""Where the ego believes others to be at every decision, on a road with two directions."""

from __future__ import annotations

import numpy as np

from overtaking.model.trajectory import NO_VEHICLE, DecisionKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.show.view.ghosts import every_ghost
from overtaking.sim import engine
from overtaking.sim.beliefs import beliefs

_ONCOMING = 1
"""Place of who comes among the percepts of a decision to pull out."""


def test_who_comes_is_where_the_decision_to_pull_out_recorded_it():
    held_up = spec(
        "rural",
        {"traffic.held_up": 1.0, "time.horizon_s": 20.0} | {"time.attempt_deadline_s": 15.0},
    )
    compared = 0
    # Of the first 1,700, those that pull out and see who comes.
    for number in (1176, 1393, 1407, 1505, 1680):
        scenario = sample(held_up, load_road("rural"), 3, [number])
        runs = engine.simulate(scenario)
        percepts = runs.percepts
        out = percepts.valid[0] & (percepts.kind[0] == DecisionKind.PULL_OUT)
        out &= percepts.detected[0, :, _ONCOMING]
        out &= percepts.vehicle[0, :, _ONCOMING] != NO_VEHICLE
        if not out.any():
            continue
        told = every_ghost(runs, beliefs(scenario))
        comes = next(one for one in told["roles"] if one["role"] == "oncoming")
        for row in np.flatnonzero(out):
            at = round(percepts.time[0, row] / told["interval_ms"])
            slot = percepts.vehicle[0, row, _ONCOMING]
            assert comes["slot"][at] == slot
            assert comes["seen"][at] == 1
            assert abs(comes["gap_mm"][at] - percepts.gap[0, row, _ONCOMING]) <= 1
            true = percepts.true_gap[0, row, _ONCOMING]
            assert abs(comes["true_gap_mm"][at] - true) <= 1
            # It stands ahead, as far as it is believed to be from where it is.
            frame = round(percepts.time[0, row] / scenario.frame_interval_ms)
            place = comes["s_mm"][at] - (comes["gap_mm"][at] - true)
            assert abs(place - runs.states.s[0, slot, frame]) <= 20
            compared += 1
    assert compared >= 4
