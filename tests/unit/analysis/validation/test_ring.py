"""Traffic on a road that closes on itself."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.analysis.validation import ring
from overtaking.analysis.validation.traffic import Batch, leaders
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine, reference

DENSITY = np.float32(20.0)


@pytest.fixture(scope="module")
def world():
    dry = {"weather.rain_probability": 0.0, "weather.fog_probability": 0.0}
    short = {"time.horizon_s": 4.0, "time.attempt_deadline_s": 4.0, "traffic.vehicles": [24, 32]}
    drawn = ScenarioSource(
        load_specification("motorway", dry | short), load_road("motorway"), 5
    ).sample(np.arange(20))
    return ring.on_ring(drawn, np.full(20, DENSITY, np.float32))


@pytest.mark.ci
def test_engine_and_reference_agree_on_a_ring(world):
    scenario, given = world
    one, other = engine.run(scenario, given), reference.run(scenario, given)
    np.testing.assert_array_equal(one.trace_hash, other.trace_hash)


def test_vehicles_are_spread_evenly_at_the_density(world):
    scenario, _ = world
    valid = scenario.vehicles.valid
    length = 1e3 * scenario.num_vehicles / (3 * DENSITY)
    for one in range(20):
        for lane in range(3):
            there = valid[one] & (scenario.start_lane[one] == lane)
            if not there.any():
                continue
            s = np.sort(scenario.start_s[one, there])
            assert np.diff(s) == pytest.approx(length[one] / there.sum(), rel=1e-3)


def test_the_foremost_follows_the_rearmost(world):
    scenario, given = world
    runs = engine.run(scenario, given)
    gap, _ = leaders(Batch.of(runs), slice(None))
    first = np.isinf(gap[:, 0]) & scenario.vehicles.valid
    foremost = first & (scenario.drivers.desired_speed > scenario.start_speed + 5.0)
    foremost[:, 0] = False
    assert foremost.sum() >= 10
    # On an open road nobody ahead lets everyone accelerate; on the ring the last one is ahead.
    open_road = engine.simulate(scenario)
    last = runs.num_frames - 1
    rows = np.arange(20)
    gained = [
        run.states.speed[rows, :, last] - run.states.speed[:, :, 0] for run in (runs, open_road)
    ]
    assert gained[0][foremost].mean() < gained[1][foremost].mean() - 300


def test_no_simulation_ends_early_and_no_ego_overtakes(world):
    scenario, given = world
    runs = engine.run(scenario, given)
    assert (runs.num_frames == 81).all()
    assert (runs.stage[runs.frame_mask] != 1).all()
