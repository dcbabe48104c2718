"""Passes that run short of time: the driver falls back, or returns into the gap ahead."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.two_way import beyond, in_the_other_lane, pair, platoon, simulated, with_another
from tests.support.worlds import Vehicle

from overtaking.analysis.validation.passes import meeting
from overtaking.model.trajectories import NO_VEHICLE, Stage
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.world.step_parameters import step_parameters

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories


def test_an_ego_falls_back_if_the_oncoming_vehicle_is_unusually_fast():
    scenes = [
        pair(gap, comes=75.0, gap_demand_factor=0.2) for gap in np.arange(200.0, 1500.0, 25.0)
    ]
    run = simulated(*scenes, horizon=20.0)
    aborted = (run.stage == Stage.ABORT).any(axis=1)
    assert aborted.any()
    for row in np.flatnonzero(aborted):
        frame = np.flatnonzero(run.stage[row] == Stage.ABORT)[0]
        assert run.states.s[row, 0, frame] < run.states.s[row, 1, frame]


def test_another_driver_falls_back_if_the_oncoming_vehicle_is_unusually_fast():
    gaps = np.arange(300.0, 1500.0, 50.0)
    scenes = [with_another(gap, comes=70.0, gap_demand_factor=0.1) for gap in gaps]
    run = simulated(*scenes, horizon=30.0)
    s, last = run.states.s, run.num_frames - 1
    tried = [
        row for row, frames_in_other_lane in enumerate(beyond(run, 2)) if len(frames_in_other_lane)
    ]
    behind = [s[row, 2, last[row]] < s[row, 1, last[row]] for row in tried]
    back = [run.states.lane[row, 2, last[row]] == 0 for row in tried]
    gave_up = [
        row
        for row, is_behind, is_back in zip(tried, behind, back, strict=True)
        if is_behind and is_back
    ]
    assert gave_up
    for row in gave_up:
        assert run.states.accel_lon[row, 2].min() < -2000


def test_an_ego_short_of_time_does_not_return_beside_a_vehicle():
    scenes = [
        platoon(room, gap, gap_demand_factor=0.0)
        for room in (8.0, 15.0, 25.0, 40.0)
        for gap in np.arange(550.0, 1150.0, 50.0)
    ]
    run = simulated(*scenes, horizon=25.0)
    returns = run.stage == Stage.RETURN
    rows = np.flatnonzero(returns.any(axis=1))
    assert len(rows) > 10
    frame = returns.argmax(axis=1)[rows]
    position = run.states.s[rows, :3, frame].astype(float) / 1e3
    length = run.scenario.vehicles.length[rows, :3]
    gap = np.abs(position[:, 1:] - position[:, :1]) - 0.5 * (length[:, 1:] + length[:, :1])
    assert gap.min() > 0.0
    # Some drivers are short of time and leave less than half a second to a neighbour.
    assert gap.min() < 9.0


def longest_beside(run: Trajectories, row: int) -> float:
    """Longest time that the ego stays beside a vehicle with an oncoming vehicle ahead [s].

    The ego is past the middle of the vehicle, less than 3 m from it, and less than 2 m/s faster or
    slower. It would meet the oncoming vehicle within 15 s.
    """
    states, specs = run.states, run.scenario.vehicles
    is_passed = specs.valid[row] & (run.scenario.start_lane[row] == 0)
    is_passed[0] = False
    gap = (states.s[row, 0] - states.s[row]) / 1e3
    is_passed = is_passed[:, None] & (gap > 0.0)
    gap = gap - 0.5 * (specs.length[row, :, None] + specs.length[row, 0])
    is_equally_fast = np.abs(states.speed[row].astype(float) - states.speed[row, 0]) < 2000
    frames = np.arange(states.s.shape[2])
    time, _, _ = meeting(run, np.full_like(frames, row), frames)
    is_beside = ((gap < 3.0) & is_equally_fast & is_passed).any(axis=0) & (
        run.stage[row] == Stage.PASS
    )
    is_beside = is_beside & (time < 15.0) & run.frame_mask[row]
    edges = np.flatnonzero(np.diff(is_beside, prepend=False, append=False))
    return 0.05 * float(max(edges[1::2] - edges[::2], default=0))


@pytest.mark.ci
def test_an_ego_with_neither_time_nor_room_does_not_stay_beside_a_vehicle():
    """Number 319 once stayed beside a vehicle for 7.5 s, without room but not trapped."""
    pressed = {
        "traffic.held_up": 1.0,
        "traffic.flow_vph": [200.0, 400.0],
        "traffic.slow_share": 0.2,
        "drivers.driving_style": [0.7, 1.0],
    }
    world = ScenarioSource(load_specification("rural", pressed), load_road("rural"), 5).sample(
        np.arange(192, 448)
    )
    run = engine.run(world, step_parameters(world))
    tried = np.flatnonzero((run.stage == Stage.PASS).any(axis=1))
    assert len(tried) > 20
    assert max(longest_beside(run, int(row)) for row in tried) < 2.0


def test_an_ego_short_of_time_brakes_to_return_behind_a_slow_vehicle():
    first, leader, comes = pair(620.0, gap_demand_factor=0.2, comes=28.0, passing_time_factor=0.8)
    slow = Vehicle(kind="M", s=leader.s + 120.0, speed=8.0, driver={"desired_speed": 8.0})
    run = simulated([first, leader, slow, comes], horizon=20.0)
    frames_in_other_lane = in_the_other_lane(run, 0)
    meeting_frame = np.flatnonzero(run.states.s[0, 3] < run.states.s[0, 0])[0]
    assert run.states.accel_lon[0, 0, frames_in_other_lane].min() < -3000
    assert (
        0.05 * (meeting_frame - frames_in_other_lane[-1]) > 4.0
    )  # 3.1 s if it returned without braking.
    assert (run.contacts.partner[0] == NO_VEHICLE).all()


def test_an_aborting_ego_has_no_contact_and_stays_on_the_road():
    """Simulations of former faults: the first ego left the road, the others had a contact."""
    numbers = [11703, 199, 4685, 7020, 25921, 27697, 29696]
    slow = load_specification("rural-risk", {"traffic.slow_share": 0.6, "traffic.held_up": 1.0})
    world = ScenarioSource(slow, load_road("rural"), 58).sample(np.array(numbers))
    run = engine.run(world, step_parameters(world))
    assert (run.stage == Stage.ABORT).any(axis=1).all()
    assert (run.contacts.partner[:, 0] == NO_VEHICLE).all()
    assert (run.stage != Stage.CRASHED).all()
    edge = 1e-3 * run.states.d[:, 0][run.frame_mask].min()
    assert edge > float(run.road.lane_boundaries[0]) + 0.5
