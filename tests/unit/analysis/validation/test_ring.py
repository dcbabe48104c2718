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
    scenario, parameters = world
    engine_runs, reference_runs = (
        engine.run(scenario, parameters),
        reference.run(scenario, parameters),
    )
    np.testing.assert_array_equal(engine_runs.trace_hash, reference_runs.trace_hash)


def test_vehicles_are_spread_evenly_at_the_density(world):
    scenario, _ = world
    valid = scenario.vehicles.valid
    # Length of the ring with three lanes at `DENSITY` vehicles per km and lane.
    ring_length = 1e3 * scenario.num_vehicles / (3 * DENSITY)
    for simulation in range(20):
        for lane in range(3):
            is_in_lane = valid[simulation] & (scenario.start_lane[simulation] == lane)
            if not is_in_lane.any():
                continue
            s = np.sort(scenario.start_s[simulation, is_in_lane])
            assert np.diff(s) == pytest.approx(ring_length[simulation] / is_in_lane.sum(), rel=1e-3)


def test_the_foremost_vehicle_of_a_ring_follows_the_rearmost(world):
    scenario, parameters = world
    runs = engine.run(scenario, parameters)
    gap, _ = leaders(Batch.of(runs), slice(None))
    has_no_leader = np.isinf(gap[:, 0]) & scenario.vehicles.valid
    is_held_foremost = has_no_leader & (scenario.drivers.desired_speed > scenario.start_speed + 5.0)
    is_held_foremost[:, 0] = False
    assert is_held_foremost.sum() >= 10
    # On an open road the foremost vehicle accelerates freely; on the ring the rearmost is ahead.
    open_runs = engine.simulate(scenario)
    last_frame = runs.num_frames - 1
    rows = np.arange(20)
    speed_gains = [
        run.states.speed[rows, :, last_frame] - run.states.speed[:, :, 0]
        for run in (runs, open_runs)
    ]
    assert speed_gains[0][is_held_foremost].mean() < speed_gains[1][is_held_foremost].mean() - 300


def test_no_simulation_ends_early_and_no_ego_overtakes(world):
    scenario, parameters = world
    runs = engine.run(scenario, parameters)
    assert (runs.num_frames == 81).all()
    assert (runs.stage[runs.frame_mask] != 1).all()
