"""Who passes against oncoming traffic: time and room for it, and one at a time."""

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


def test_the_ego_waits_for_who_comes_and_goes_behind_it():
    run = simulated(pair(300.0), pair(gap_demand_factor=0.5), pair(900.0), horizon=40.0)
    starts = [np.flatnonzero(stage == Stage.PULL_OUT)[:1] for stage in run.stage]
    assert all(len(first) for first in starts)
    met = np.flatnonzero(run.states.s[0, 2] < run.states.s[0, 0])[0]
    assert starts[0][0] >= met
    assert starts[1][0] * 0.05 < 5.0
    assert (run.stage == Stage.CRASHED).sum() == 0


def test_another_passes_by_the_rules_of_the_ego():
    run = simulated(with_another(), with_another(330.0), horizon=45.0)
    free, waits = beyond(run, 2)
    s = run.states.s
    assert len(free)
    assert s[0, 2, free[0]] < s[0, 1, free[0]]
    assert s[0, 2, free[-1]] > s[0, 1, free[-1]]
    # It is faster than it wants to be behind the van, and shows where it goes.
    speed = run.states.speed[0, 2] / 1e3
    assert speed[free].max() > 18.0 + 7.0
    shown = run.states.lights[0, 2, free[0] - 1], run.states.lights[0, 2, free[-1]]
    assert shown[0] & Lights.INDICATOR_LEFT
    assert shown[1] & Lights.INDICATOR_RIGHT
    met = np.flatnonzero(s[1, 3] < s[1, 2])[0]
    assert len(waits)
    assert waits[0] >= met


def test_who_follows_one_that_overtakes_waits():
    ego = Vehicle(s=800.0, speed=17.0, driver={"desired_speed": 17.0})
    leader = Vehicle(kind="L", s=1100.0, speed=14.0, driver={"desired_speed": 14.0})
    keen = [
        Vehicle(s=1100.0 - back, speed=15.0, driver=KEEN | {"gap_demand_factor": 0.5})
        for back in (30.0, 55.0)
    ]
    run = simulated([ego, leader, *keen], horizon=60.0)
    away = (run.states.lane[0] == 1) & run.frame_mask[0]
    assert away[2:].any(axis=1).sum() >= 2
    assert away.sum(axis=0).max() == 1


def test_the_next_vehicle_is_passed_as_well_where_there_is_time_and_no_room_to_fit_in():
    run = simulated(platoon(75.0), platoon(140.0), horizon=30.0)
    s = run.states.s
    both, one = (in_the_other_lane(run, row) for row in range(2))
    assert (np.diff(both) == 1).all()
    assert s[0, 0, both[0]] < s[0, 1, both[0]] < s[0, 2, both[-1]] < s[0, 0, both[-1]]
    # It does not brake behind the second one on the way.
    assert run.states.accel_lon[0, 0, both[0] : both[-1]].min() > -1000
    assert s[1, 1, one[-1]] < s[1, 0, one[-1]] < s[1, 2, one[-1]]


def least_accepted(duration: float) -> tuple[float, float]:
    """Least time to an oncomer that an ego takes, and what it asks for over what it needs."""
    gaps = np.arange(300.0, 1400.0, 10.0)
    scenes = [
        pair(gap, lane_change_duration=duration, patience=1e6, gap_demand_factor=0.4)
        for gap in gaps
    ]
    world = scenario(*scenes, road=road(), horizon=15.0, index=[9] * len(gaps))
    given = step_parameters(world)
    run = engine.run(world, given)
    out = run.stage == Stage.PULL_OUT
    rows, frame = np.flatnonzero(out.any(axis=1)), out.argmax(axis=1)
    time, _, _ = meeting(run, rows, frame[rows])
    of = dict(zip(VEHICLE_FIELDS, given.vehicle_table[:, 0, 0], strict=True))
    return float(time.min()), float(of["passing_time_factor"] * (1.0 + of["time_reserve_share"]))


def test_the_time_that_a_pass_needs_has_a_whole_change_of_lane_in_it():
    (short, factor), (long, same) = least_accepted(3.0), least_accepted(6.0)
    assert factor == same
    # It is judged for a speed of approach that is somewhat higher; half a change would be half.
    assert 0.9 * 3.0 * factor < long - short < 1.5 * 3.0 * factor


def test_who_follows_a_truck_leaves_more_room_than_behind_a_car():
    scenes = []
    for kind in ("M", "T"):
        leader = Vehicle(kind=kind, s=1060.0, speed=18.0, driver={"desired_speed": 18.0})
        scenes.append([Vehicle(s=1000.0, speed=18.0, driver={"desired_speed": 40.0}), leader])
    world = scenario(*scenes, road=road(), horizon=60.0)
    sure = EnabledEffects(delay=False, distance_error=False, looming=False)
    run = engine.run(world, step_parameters(world, sure))
    body = run.scenario.vehicles.length[:, :2].mean(axis=1)
    gap = 1e-3 * (run.states.s[:, 1, -1] - run.states.s[:, 0, -1]) - body
    kept = (
        CALM_DRIVER["time_gap"]
        * 18.0
        * np.array([1.0, float(constant("model.oncoming.tall_vehicle_gap_factor"))])
    )
    np.testing.assert_allclose(gap, CALM_DRIVER["min_gap"] + kept, rtol=0.01)
