"""An ego with less sight or less friction than it assumes: equal in both implementations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import EGO_SLOT
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.sim.reference.simulation import run
from overtaking.world.step_parameters import VEHICLE_FIELDS, step_parameters

DRAWN = ScenarioSource(
    load_specification("pinto2023", {"traffic.vehicles": "3..4"}), load_road("town06"), 4
).sample(np.arange(4))


@pytest.mark.ci
@pytest.mark.parametrize(("name", "value"), [("attention_range", 30.0), ("max_friction", 0.1)])
def test_an_impaired_ego_moves_differently_and_equally_in_both_implementations(
    name: str, value: float
):
    plain = step_parameters(DRAWN)
    vehicle = plain.vehicle_table.copy()
    vehicle[VEHICLE_FIELDS.index(name), EGO_SLOT] = value
    impaired = replace(plain, vehicle_table=vehicle)
    fast, slow = engine.run(DRAWN, impaired), run(DRAWN, impaired)
    np.testing.assert_array_equal(fast.trace_hash, slow.trace_hash)
    assert (fast.trace_hash != engine.simulate(DRAWN).trace_hash).any()


def test_drivers_brake_at_most_as_hard_as_the_friction_allows():
    plain = step_parameters(DRAWN)
    plain.vehicle_table[VEHICLE_FIELDS.index("max_friction")] = 0.1
    trajectories = engine.run(DRAWN, plain)
    untouched = trajectories.contacts.partner == NO_VEHICLE
    # Friction times gravity, and 1 m/s^2 for drag, rolling resistance and wind [mm/s^2].
    assert untouched.sum() > 3
    assert trajectories.states.accel_lon[untouched].min() > -(0.1 * 9810 + 1000)
    assert engine.simulate(DRAWN).states.accel_lon.min() < -(0.1 * 9810 + 1000)
