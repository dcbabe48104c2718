"""The scenes written by hand still show the events in their names."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from overtaking.model.trajectories import Lights, Stage
from overtaking.sim import engine

from .scenes import WRITTEN, Written

BY_NAME = {written.name: written for written in WRITTEN}
LANES = BY_NAME["lane changes by hand"]
ACCIDENTS = BY_NAME["accidents by hand"]
MEETINGS = BY_NAME["meetings by hand"]
COMES_IN = BY_NAME["comes in alone"]
GIVEN_UP = BY_NAME["given up by hand"]
STEERED = BY_NAME["steered by hand"]
RING = BY_NAME["ring by hand"]
LIMITS = BY_NAME["limits by hand"]
BOTH_WAYS = BY_NAME["limits of each way by hand"]


@cache
def simulated(written: Written):
    return written.run(written.scenario(written.share), engine.run)


def stages(written: Written, name_part: str) -> list[list[Stage]]:
    """The stages of the ego in scenes with these words in their names, one after the other."""
    run, stage_orders = simulated(written), []
    for row, scene in enumerate(written.scenes):
        if name_part in scene.name:
            stage = run.stage[row, : run.num_frames[row]]
            starts = np.flatnonzero(np.diff(stage, prepend=255))
            stage_orders.append([Stage(code) for code in stage[starts]])
    assert stage_orders
    return stage_orders


def lanes(written: Written, name_part: str, slot: int) -> list[list[int]]:
    """The lanes that a vehicle is in, one after the other, in each of such scenes."""
    run, lane_orders = simulated(written), []
    for row, scene in enumerate(written.scenes):
        if name_part in scene.name:
            lane = run.states.lane[row, slot, : run.num_frames[row]].astype(int)
            lane_orders.append(lane[np.flatnonzero(np.diff(lane, prepend=-1))].tolist())
    return lane_orders


def test_an_ego_stuck_beside_a_vehicle_aborts_after_eight_seconds():
    run = simulated(LANES)
    assert stages(LANES, "is stuck") == [[Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.ABORT]]
    row = next(k for k, scene in enumerate(LANES.scenes) if "is stuck" in scene.name)
    assert 8.0 <= 0.05 * (run.stage[row] == Stage.PASS).sum() <= 9.0


@pytest.mark.parametrize("name_part", ["returns too early", "while a third comes in"])
def test_some_returning_egos_stay_in_the_left_lane_and_some_cannot(name_part):
    stays = [
        Stage.PASS in order[k:]
        for order in stages(LANES, name_part)
        for k in range(len(order))
        if order[k] in (Stage.RETURN, Stage.ABORT)
    ]
    assert any(stays)
    assert not all(stays)


def test_of_two_vehicles_side_by_side_the_one_moving_left_goes_first():
    (left_vehicle,), (right_vehicle,) = (lanes(LANES, "two side by side", slot) for slot in (1, 2))
    assert left_vehicle == [0, 1]
    assert right_vehicle == [2]


def test_a_vehicle_starts_a_lane_change_and_goes_back():
    run, rows = (
        simulated(LANES),
        [
            k
            for k, scene in enumerate(LANES.scenes)
            if scene.name == "somebody finds another beside"
        ],
    )
    d = run.states.d[rows, 1, :120] / 1e3
    displacement = np.abs(d - d[:, :1])
    goes_back = (
        (displacement.max(axis=1) > 0.5)
        & (displacement.max(axis=1) < 1.7)
        & (displacement[:, -1] < 0.4)
    )
    assert goes_back.any()
    assert (displacement.max(axis=1) > 1.7).any()


def test_an_ego_aborts_unless_it_can_no_longer_fall_back():
    last = [order[-1] for order in stages(GIVEN_UP, "fall back")]
    assert last == [Stage.ABORT] * 3 + [Stage.PASS]


def test_other_vehicles_overtake_and_meet_the_ego_in_its_lane():
    assert [0, 1, 0] in lanes(MEETINGS, "others overtake before", 2)
    assert all(order[:2] == [0, 1] for order in lanes(MEETINGS, "the ego is passed", 1))
    assert any(0 in order for order in lanes(MEETINGS, "who comes overtakes", 2))
    lights = simulated(COMES_IN).states.lights[0, 0]
    assert (lights & int(Lights.HIGH_BEAM)).any()


def test_a_follower_lets_its_leader_go_first():
    for order in lanes(MEETINGS, "goes before its follower", 3):
        assert order == [0]


def test_egos_in_oncoming_traffic_wait_pass_and_abort():
    stage_orders = {tuple(order) for order in stages(MEETINGS, "")}
    whole_pass = (Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE)
    for expected in (
        whole_pass[:1],
        whole_pass,
        (Stage.FOLLOW, Stage.PULL_OUT, Stage.ABORT, Stage.FOLLOW),
    ):
        assert any(order[: len(expected)] == expected for order in stage_orders), expected


def test_every_accident_scene_has_a_contact_with_the_third_vehicle():
    has_contact = simulated(ACCIDENTS).contacts.partner[:, 2] != 255
    for name in {scene.name for scene in ACCIDENTS.scenes}:
        assert any(
            has_contact[k] for k, scene in enumerate(ACCIDENTS.scenes) if scene.name == name
        ), name


def test_on_a_ring_a_vehicle_that_began_far_ahead_approaches_from_behind():
    assert simulated(RING).states.accel_lon[0, 1].min() < -1000


def test_wheel_angles_reach_their_limits():
    angle = simulated(STEERED).states.wheel_angle[:, 0].astype(int)
    assert -5000 <= angle[0].min() < -4900
    assert 4900 < angle[1].max() <= 5000


def speeds(written: Written, name_part: str, slot: int) -> list[np.ndarray]:
    """The speeds of a vehicle in scenes with these words in their names [m/s]."""
    run = simulated(written)
    return [
        1e-3 * run.states.speed[row, slot, : run.num_frames[row]]
        for row, scene in enumerate(written.scenes)
        if name_part in scene.name
    ]


def test_drivers_obey_lower_limits_as_the_names_of_the_scenes_state():
    obeys = speeds(LIMITS, "comes to a lower limit", 1)
    assert all(series[0] == 25.0 and series[-1] < 22.6 for series in obeys)
    assert min(series.min() for series in obeys) < 15.1
    (slow,) = speeds(LIMITS, "slower than any limit", 1)
    assert 13.9 < slow.min() <= slow.max() < 14.6
    (heavy,) = speeds(LIMITS, "a truck is as fast", 1)
    assert heavy.min() > 23.9
    (gentle,) = speeds(LIMITS, "no harder than is comfortable", 1)
    assert np.diff(gentle).min() > -0.05 * 0.6
    assert gentle[-1] > 20.0
    (leaves,) = speeds(LIMITS, "leaves the stretch", 1)
    assert leaves[-1] > 20.0
    assert lanes(LIMITS, "nobody changes lanes", 1) == [[1], [2]]
    passes = stages(LIMITS, "the ego overtakes before")
    assert [Stage.PULL_OUT in series for series in passes] == [True, True, False]


def test_oncoming_vehicles_have_their_own_speed_limits():
    (along,), (oncoming,) = (speeds(BOTH_WAYS, "who comes slows down", slot) for slot in (0, 1))
    assert along.min() > 24.9
    assert oncoming[0] == 25.0
    assert oncoming.min() < 15.1
    assert all(Stage.PULL_OUT in order for order in stages(BOTH_WAYS, "passes before"))
