"""Drivers give way to an oncoming vehicle in their lane."""

from __future__ import annotations

import numpy as np
from tests.support.two_way import pair, simulated, with_an_oncomer_that_overtakes

from overtaking.model.trajectories import Lights, Stage


def test_an_oncoming_driver_flashes_brakes_and_moves_aside_for_an_overtaking_ego():
    run = simulated(pair(420.0, gap_demand_factor=0.0, lead=15.0), horizon=12.0)
    lights, lateral = run.states.lights[0, 2], run.states.d[0, 2] / 1e3
    flashing = np.flatnonzero(lights & Lights.HIGH_BEAM)
    assert len(flashing)
    before = slice(0, flashing[0])
    assert (run.states.accel_lon[0, 2, before] > -500).all()
    assert run.states.accel_lon[0, 2].min() < -2500
    assert lateral.max() > 1.75 + 0.4


def test_the_ego_flashes_brakes_and_moves_aside_for_a_vehicle_in_its_lane():
    # A driver with a gap demand of 0, which counts on half of the needed time, overtakes an
    # oncoming van.
    scenes = [
        with_an_oncomer_that_overtakes(gap, gap_demand_factor=0.0, desired_speed=40.0)
        for gap in np.arange(300.0, 700.0, 20.0)
    ]
    run = simulated(*scenes, horizon=20.0)
    lights, lateral = run.states.lights[:, 0], run.states.d[:, 0] / 1e3
    flashes = (lights & Lights.HIGH_BEAM) > 0
    brakes = run.states.accel_lon[:, 0].min(axis=1) < -2500
    rows = np.flatnonzero(flashes.any(axis=1) & brakes)
    assert len(rows)
    for row in rows:
        first = int(flashes[row].argmax())
        assert run.states.lane[row, 2, first] == 0  # In the ego's lane.
        assert (run.states.accel_lon[row, 0, :first] > -500).all()
        assert lateral[row].min() < -1.75 - 0.3
    assert (run.stage == Stage.FOLLOW).mean() > 0.9
