"""Passing against oncoming traffic: enough time, enough room, and one vehicle at a time."""

from __future__ import annotations

import numpy as np
from tests.support.two_way import (
    KEEN,
    beyond,
    in_the_other_lane,
    pair,
    platoon,
    road,
    simulated,
    with_another,
)
from tests.support.worlds import CALM_DRIVER, Vehicle, scenario

from overtaking.analysis.validation.passes import meeting
from overtaking.knowledge.toml_reader import constant
from overtaking.model.trajectories import Lights, Stage
from overtaking.sim import engine
from overtaking.world.constants import EnabledEffects
from overtaking.world.step_parameters import VEHICLE_FIELDS, step_parameters


def test_the_ego_waits_for_an_oncoming_vehicle_and_pulls_out_behind_it():
    run = simulated(pair(300.0), pair(gap_demand_factor=0.5), pair(900.0), horizon=40.0)
    starts = [np.flatnonzero(stage == Stage.PULL_OUT)[:1] for stage in run.stage]
    assert all(len(first) for first in starts)
    meeting_frame = np.flatnonzero(run.states.s[0, 2] < run.states.s[0, 0])[0]
    assert starts[0][0] >= meeting_frame
    assert starts[1][0] * 0.05 < 5.0
    assert (run.stage == Stage.CRASHED).sum() == 0


def test_another_driver_passes_by_the_same_rules_as_the_ego():
    run = simulated(with_another(), with_another(330.0), horizon=45.0)
    free_frames, waiting_frames = beyond(run, 2)
    s = run.states.s
    assert len(free_frames)
    assert s[0, 2, free_frames[0]] < s[0, 1, free_frames[0]]
    assert s[0, 2, free_frames[-1]] > s[0, 1, free_frames[-1]]
    # It passes faster than its desired speed behind the van, and indicates both lane changes.
    speed = run.states.speed[0, 2] / 1e3
    assert speed[free_frames].max() > 18.0 + 7.0
    lights = run.states.lights[0, 2, free_frames[0] - 1], run.states.lights[0, 2, free_frames[-1]]
    assert lights[0] & Lights.INDICATOR_LEFT
    assert lights[1] & Lights.INDICATOR_RIGHT
    meeting_frame = np.flatnonzero(s[1, 3] < s[1, 2])[0]
    assert len(waiting_frames)
    assert waiting_frames[0] >= meeting_frame


def test_only_one_vehicle_of_a_queue_overtakes_at_a_time():
    ego = Vehicle(s=800.0, speed=17.0, driver={"desired_speed": 17.0})
    leader = Vehicle(kind="L", s=1100.0, speed=14.0, driver={"desired_speed": 14.0})
    keen = [
        Vehicle(s=1100.0 - back, speed=15.0, driver=KEEN | {"gap_demand_factor": 0.5})
        for back in (30.0, 55.0)
    ]
    run = simulated([ego, leader, *keen], horizon=60.0)
    is_in_other_lane = (run.states.lane[0] == 1) & run.frame_mask[0]
    assert is_in_other_lane[2:].any(axis=1).sum() >= 2
    assert is_in_other_lane.sum(axis=0).max() == 1


def test_the_ego_passes_the_next_vehicle_too_with_time_and_without_a_gap_to_return():
    run = simulated(platoon(75.0), platoon(140.0), horizon=30.0)
    s = run.states.s
    pass_of_two, pass_of_one = (in_the_other_lane(run, row) for row in range(2))
    assert (np.diff(pass_of_two) == 1).all()
    assert (
        s[0, 0, pass_of_two[0]]
        < s[0, 1, pass_of_two[0]]
        < s[0, 2, pass_of_two[-1]]
        < s[0, 0, pass_of_two[-1]]
    )
    # The ego does not brake behind the second vehicle during the pass.
    assert run.states.accel_lon[0, 0, pass_of_two[0] : pass_of_two[-1]].min() > -1000
    assert s[1, 1, pass_of_one[-1]] < s[1, 0, pass_of_one[-1]] < s[1, 2, pass_of_one[-1]]


def least_accepted(duration: float) -> tuple[float, float]:
    """Least time to an oncoming vehicle that an ego accepts, and its factor on the needed time."""
    gaps = np.arange(300.0, 1400.0, 10.0)
    scenes = [
        pair(gap, lane_change_duration=duration, patience=1e6, gap_demand_factor=0.4)
        for gap in gaps
    ]
    world = scenario(*scenes, road=road(), horizon=15.0, index=[9] * len(gaps))
    parameters = step_parameters(world)
    run = engine.run(world, parameters)
    is_pulling_out = run.stage == Stage.PULL_OUT
    rows, frame = np.flatnonzero(is_pulling_out.any(axis=1)), is_pulling_out.argmax(axis=1)
    time, _, _ = meeting(run, rows, frame[rows])
    ego = dict(zip(VEHICLE_FIELDS, parameters.vehicle_table[:, 0, 0], strict=True))
    return float(time.min()), float(ego["passing_time_factor"] * (1.0 + ego["time_reserve_share"]))


def test_the_needed_time_of_a_pass_contains_a_whole_lane_change():
    (short_time, factor), (long_time, second_factor) = least_accepted(3.0), least_accepted(6.0)
    assert factor == second_factor
    # The driver assumes a somewhat higher closing speed. Half a lane change would give half.
    assert 0.9 * 3.0 * factor < long_time - short_time < 1.5 * 3.0 * factor


def test_an_ego_follows_a_truck_at_a_larger_gap_than_a_car():
    scenes = []
    for kind in ("M", "T"):
        leader = Vehicle(kind=kind, s=1060.0, speed=18.0, driver={"desired_speed": 18.0})
        scenes.append([Vehicle(s=1000.0, speed=18.0, driver={"desired_speed": 40.0}), leader])
    world = scenario(*scenes, road=road(), horizon=60.0)
    effects = EnabledEffects(delay=False, distance_error=False, looming=False)
    run = engine.run(world, step_parameters(world, effects))
    body = run.scenario.vehicles.length[:, :2].mean(axis=1)
    gap = 1e-3 * (run.states.s[:, 1, -1] - run.states.s[:, 0, -1]) - body
    distance_of_time_gap = (
        CALM_DRIVER["time_gap"]
        * 18.0
        * np.array([1.0, float(constant("model.oncoming.tall_vehicle_gap_factor"))])
    )
    np.testing.assert_allclose(gap, CALM_DRIVER["min_gap"] + distance_of_time_gap, rtol=0.01)
